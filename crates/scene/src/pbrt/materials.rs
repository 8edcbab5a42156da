//! Materials of a scene description → the nearest [`Material`]s; media inside shapes → absorption.

use glam::Vec3;

use super::{
    directives::Description,
    parameters::{Entity, Kind, Values},
    spectra,
    state::MaterialChoice,
    textures::{Textures, map_numbers},
    tokens::Place,
};
use crate::{
    coat::{COAT_IOR, DEFAULT_IOR, albedo_below_coat},
    error::Result,
    features,
    import::{SOLID_IOR, Value, Width, blend::mixed, media, relief::Reliefs, sheet},
    material::{ConductorFresnel, Material, MaterialKind, Principled, Surface},
    measured::MeasuredFiles,
};

/// Most materials that may mix one another.
const MAX_DEPTH: usize = 16;
/// Widths below which pbrt-v4 takes a surface for smooth.
const SMOOTH_ALPHA: f32 = 1e-3;
/// Reflectance from which a smooth metal is a mirror; pbrt has none of more.
const MIRROR_REFLECTANCE: f32 = 0.9999;

pub(super) struct Materials<'a> {
    pub description: &'a Description,
    pub textures: Textures<'a>,
    measured: MeasuredFiles,
    /// Mixtures around the material that is made.
    depth: usize,
    pub reliefs: Reliefs,
}

impl<'a> Materials<'a> {
    pub(super) fn new(description: &'a Description, textures: Textures<'a>) -> Self {
        Self {
            description,
            textures,
            measured: MeasuredFiles::default(),
            depth: 0,
            reliefs: Reliefs::default(),
        }
    }

    /// Makes the material that a shape takes; none for a surface that is not there.
    pub(super) fn make(&mut self, choice: &MaterialChoice) -> Result<Option<Material>> {
        match choice {
            MaterialChoice::Default => {
                let kind = MaterialKind::Diffuse { reflectance: Vec3::splat(0.5) };
                Ok(Some(Material::new("default", kind)))
            }
            MaterialChoice::Own(entity) => {
                let name = format!("{} of line {}", entity.name, entity.place.line);
                self.of_entity(entity, &entity.name, name)
            }
            MaterialChoice::Named(name, place) => match self.description.materials.get(&**name) {
                Some(entity) => self.named(name, entity),
                None => {
                    let message = format!("NamedMaterial \"{name}\": there is no such material");
                    Err(place.error(message))
                }
            },
        }
    }

    fn named(&mut self, name: &str, entity: &Entity) -> Result<Option<Material>> {
        self.of_entity(entity, entity.required("type")?, name.to_owned())
    }

    fn of_entity(&mut self, entity: &Entity, kind: &str, name: String) -> Result<Option<Material>> {
        let mut surface = Surface::default();
        let kind = match kind {
            "diffuse" => {
                let value = self.textures.spectrum(entity, "reflectance")?;
                let reflectance = color(value.unwrap_or(Value::number(0.5)), &mut surface);
                MaterialKind::Diffuse { reflectance: reflectance.clamp(Vec3::ZERO, Vec3::ONE) }
            }
            "coateddiffuse" => {
                self.layers(entity)?;
                let value = self.textures.spectrum(entity, "reflectance")?;
                let ior = self.ior(entity, "eta", DEFAULT_IOR, (SOLID_IOR.0, COAT_IOR.1))?;
                let base = value.unwrap_or(Value::number(0.5));
                let shown =
                    if ior < COAT_IOR.0 { base } else { base.mapped(albedo_below_coat(ior)) };
                self.plastic(entity, shown, ior, &mut surface)?
            }
            "conductor" => self.conductor(entity, "", &mut surface)?,
            "coatedconductor" => {
                self.layers(entity)?;
                self.coated_conductor(entity, &mut surface)?
            }
            "dielectric" => {
                let roughness = self.round_roughness(entity, "")?;
                surface.roughness = roughness.texture;
                let alpha = if roughness.alpha < SMOOTH_ALPHA { 0.0 } else { roughness.alpha };
                MaterialKind::glass(self.ior(entity, "eta", DEFAULT_IOR, SOLID_IOR)?, alpha)
            }
            "thindielectric" => {
                MaterialKind::pane(self.ior(entity, "eta", DEFAULT_IOR, SOLID_IOR)?, Vec3::ONE)
            }
            "diffusetransmission" => {
                let scale = entity.number("scale", 1.0)? as f32;
                let mut side = |name: &str| {
                    let value = self.textures.spectrum(entity, name)?;
                    Ok(value.unwrap_or(Value::number(0.25)).scaled(scale))
                };
                let (kind, color, is_mean) = sheet([side("reflectance")?, side("transmittance")?]);
                surface.color = color;
                if is_mean {
                    self.textures.log.ignore(features::PBRT_TRANSMISSION, &entity.place);
                }
                kind
            }
            "subsurface" => {
                let ior = self.ior(entity, "eta", 1.33, (SOLID_IOR.0, COAT_IOR.1))?;
                let shown = self.albedo_below(entity, ior)?;
                self.plastic(entity, shown, ior, &mut surface)?
            }
            "hair" => {
                self.textures.log.ignore(features::PBRT_HAIR, &entity.place);
                let reflectance = color(self.hair(entity)?, &mut surface);
                MaterialKind::Diffuse { reflectance }
            }
            "mix" => return self.mix(entity, name),
            "interface" | "none" | "" => return Ok(None),
            "measured" => self.measured(entity, &mut surface)?,
            other => {
                return Err(entity.error(format!(
                    "unknown material `{other}`; files of pbrt-v3 are converted by `pbrt --upgrade`"
                )));
            }
        };
        surface.normal = self.textures.normal_map(entity)?;
        match self.textures.number(entity, "displacement")? {
            Some(Value::Image(heights)) if surface.normal.is_none() => {
                surface.normal = Some(self.reliefs.keep(heights));
            }
            Some(Value::Image(_)) => {
                self.textures.log.ignore(features::PBRT_DISPLACEMENT, &entity.place);
            }
            // One height everywhere bends nothing.
            _ => {}
        }
        self.textures.log.unused(entity);
        Ok(Some(Material { name, kind, surface }))
    }

    fn measured(&mut self, entity: &Entity, surface: &mut Surface) -> Result<MaterialKind> {
        let name = entity.required("filename")?;
        let log = &mut self.textures.log;
        let path = log.folder.file(name).map_err(|message| entity.error(message))?;
        if !path.exists() {
            let name = format!("measured `{name}`, which is not there: diffuse of 0.5");
            log.ignore_named(features::PBRT_MISSING, &name, &entity.place);
            return Ok(MaterialKind::Diffuse { reflectance: Vec3::splat(0.5) });
        }
        let table = self.measured.table(&path, &mut log.inputs, &mut log.warnings)?;
        surface.anisotropy.strength = f32::from(table.has_turns());
        Ok(MaterialKind::Measured { path, table })
    }

    /// Marks the parameters of a coat as read, and reports a coat that absorbs or scatters.
    fn layers(&mut self, entity: &Entity) -> Result<()> {
        entity.without_effect("thickness maxdepth nsamples g");
        let is_clear = match self.textures.spectrum(entity, "albedo")? {
            Some(value) => value == Value::Constant(Vec3::ZERO),
            None => true,
        };
        if !is_clear {
            self.textures.log.ignore(features::PBRT_COAT_ALBEDO, &entity.place);
        }
        Ok(())
    }

    /// Plastic that shows an albedo below its coat.
    fn plastic(
        &mut self,
        entity: &Entity,
        shown: Value,
        ior: f32,
        surface: &mut Surface,
    ) -> Result<MaterialKind> {
        let diffuse = color(shown, surface);
        // Such a coat reflects next to nothing.
        if ior < COAT_IOR.0 {
            entity.without_effect("roughness uroughness vroughness remaproughness");
            return Ok(MaterialKind::Diffuse { reflectance: diffuse });
        }
        let roughness = self.round_roughness(entity, "")?;
        surface.roughness = roughness.texture;
        Ok(MaterialKind::Plastic { diffuse, alpha: roughness.alpha, ior })
    }

    /// Albedo of `subsurface` by what scatters below it: a medium by its name or coefficients, milk without
    /// any, else its `reflectance`.
    fn albedo_below(&mut self, entity: &Entity, ior: f32) -> Result<Value> {
        let log = &mut self.textures.log;
        log.ignore(features::PBRT_SUBSURFACE, &entity.place);
        entity.without_effect("mfp scale");
        let share = 1.0 - entity.number("g", 0.0)? as f32;
        let of = |name: &str| match entity.find(name) {
            Some(found) if found.kind != Kind::Texture => spectra::index(found, log).map(Some),
            _ => Ok(None),
        };
        let (own, reflectance) =
            ([of("sigma_a")?, of("sigma_s")?], self.textures.spectrum(entity, "reflectance")?);
        let [absorption, scattering] = match (entity.string("name")?, own, reflectance) {
            (None, [Some(absorption), Some(scattering)], _) => [absorption, share * scattering],
            (None, _, Some(reflectance)) => return Ok(reflectance),
            (name, ..) => match media::scattering(name.unwrap_or("Wholemilk")) {
                Some(found) => found,
                None => return Ok(Value::number(0.5)),
            },
        };
        Ok(Value::Constant(diffusion_albedo(scattering / (absorption + scattering), ior)))
    }

    /// Colour of much hair, by its absorption, its colour or its pigments \[Chiang et al. 2016\].
    fn hair(&mut self, entity: &Entity) -> Result<Value> {
        entity.without_effect("eta beta_m alpha");
        let mut number =
            |name: &str| Ok(self.textures.number(entity, name)?.map(|value| value.mean().x));
        let b = number("beta_n")?.unwrap_or(0.3);
        let [dark, red] = match [number("eumelanin")?, number("pheomelanin")?] {
            [None, None] => [1.3, 0.0],
            pigments => pigments.map(|amount| amount.unwrap_or(0.0)),
        };
        let own = match self.textures.spectrum(entity, "reflectance")? {
            None => self.textures.spectrum(entity, "color")?,
            found => found,
        };
        let absorption = match entity.find("sigma_a").filter(|found| found.kind != Kind::Texture) {
            Some(found) => spectra::index(found, &self.textures.log)?,
            None => match own {
                Some(own) => return Ok(own),
                None => dark * Vec3::new(0.419, 0.697, 1.37) + red * Vec3::new(0.187, 0.4, 1.05),
            },
        };
        let width = 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
        let color = |sigma: f32| (-width * sigma.max(0.0).sqrt()).exp().min(1.0);
        Ok(Value::Constant(absorption.map(color)))
    }

    fn conductor(
        &mut self,
        entity: &Entity,
        prefix: &str,
        surface: &mut Surface,
    ) -> Result<MaterialKind> {
        let roughness = self.roughness(entity, prefix)?;
        surface.roughness = roughness.texture;
        surface.anisotropy = roughness.anisotropy;
        let own = |name: &str| format!("{prefix}{name}");
        let reflectance = match self.textures.spectrum(entity, &own("reflectance"))? {
            // coatedconductor names this one without a prefix.
            None => self.textures.spectrum(entity, "reflectance")?,
            found => found,
        };
        let fresnel = match reflectance {
            Some(value @ Value::Image(_)) => {
                ConductorFresnel::Schlick { reflectance: color(value, surface) }
            }
            // A smooth metal that reflects all light does so in all directions.
            Some(Value::Constant(color))
                if color.min_element() >= MIRROR_REFLECTANCE
                    && surface.roughness.is_none()
                    && surface.anisotropy.strength == 0.0
                    && roughness.alpha < SMOOTH_ALPHA =>
            {
                return Ok(MaterialKind::Mirror { reflectance: Vec3::ONE });
            }
            Some(Value::Constant(color) | Value::Vertices(color)) => {
                exact(Vec3::ONE, extinction_of_metal(color))
            }
            None => {
                let index = |name: &str| match entity.find_of(&own(name), &spectra::KINDS)? {
                    Some(parameter) => spectra::index(parameter, &self.textures.log),
                    None => {
                        Ok(media::index(&format!("metal-Cu-{name}")).unwrap_or_default().as_vec3())
                    }
                };
                exact(index("eta")?.max(Vec3::splat(0.01)), index("k")?)
            }
        };
        Ok(MaterialKind::Conductor { alpha: roughness.alpha, fresnel })
    }

    /// Metal below a coat, seen from inside of which it reflects less than from the air.
    fn coated_conductor(&mut self, entity: &Entity, surface: &mut Surface) -> Result<MaterialKind> {
        let ior = self.ior(entity, "interface.eta", DEFAULT_IOR, (SOLID_IOR.0, COAT_IOR.1))?;
        if (ior - DEFAULT_IOR).abs() > 0.01 {
            self.textures.log.ignore(features::PBRT_COAT_INDEX, &entity.place);
        }
        let coat_roughness = self.round_roughness(entity, "interface.")?.mean_roughness();
        let below = |eta: Vec3, k: Vec3| exact(eta / ior, k / ior).at_normal_incidence();
        let (reflectance, alpha) = match self.conductor(entity, "conductor.", surface)? {
            MaterialKind::Conductor { alpha, fresnel: ConductorFresnel::Exact { eta, k, .. } } => {
                (below(eta, k), alpha)
            }
            MaterialKind::Conductor { alpha, .. } => (Vec3::ONE, alpha),
            _ => (Vec3::ONE, 0.0),
        };
        surface.color = surface.color.take().map(|texture| {
            texture.mapped(|share| below(Vec3::ONE, extinction_of_metal(Vec3::splat(share))).x)
        });
        let metal = Principled::coated_metal(reflectance, alpha, coat_roughness);
        Ok(MaterialKind::Principled(metal))
    }

    /// Refractive index, a number or the mean of a spectrum.
    fn ior(
        &self,
        entity: &Entity,
        name: &str,
        otherwise: f32,
        (low, high): (f32, f32),
    ) -> Result<f32> {
        let kinds = [Kind::Float, Kind::Rgb, Kind::Spectrum];
        let Some(parameter) = entity.find_of(name, &kinds)? else { return Ok(otherwise) };
        let ior = match (parameter.kind, parameter.numbers()) {
            (Kind::Float, [ior, ..]) => *ior as f32,
            _ => spectra::index(parameter, &self.textures.log)?.element_sum() / 3.0,
        };
        if !(low..=high).contains(&ior) {
            let message = format!("expected a refractive index from {low} to {high}, found {ior}");
            return Err(parameter.place.error(format!("{}: {message}", entity.label())));
        }
        Ok(ior)
    }

    /// Width α from `roughness`, or `uroughness` and `vroughness`, and `remaproughness`.
    fn roughness(&mut self, entity: &Entity, prefix: &str) -> Result<Width> {
        // α = √roughness unless the file says that it is α itself.
        let remaps = entity.boolean("remaproughness", true)?;
        let alpha_of = |roughness: f32| {
            let roughness = roughness.max(0.0);
            if remaps { roughness.sqrt() } else { roughness }
        };
        let mut number = |name: &str| {
            let name = format!("{prefix}{name}");
            self.textures.number(entity, &name)
        };
        let both = number("roughness")?.unwrap_or(Value::number(0.0));
        let along_u = number("uroughness")?.unwrap_or(both.clone());
        let along_v = number("vroughness")?.unwrap_or(both);
        match (along_u, along_v) {
            (Value::Image(image), other) | (other, Value::Image(image)) => {
                if other.image() != Some(&image) {
                    self.textures.log.ignore(features::PBRT_ANISOTROPY, &entity.place);
                }
                let texture = map_numbers(&image, |roughness| alpha_of(roughness).min(1.0).sqrt());
                Ok(Width::round(1.0, Some(texture)))
            }
            (u, v) => Ok(Width::of_pair([u, v].map(|value| alpha_of(value.mean().x).min(1.0)))),
        }
    }

    /// The same for a model whose width is one for all directions.
    fn round_roughness(&mut self, entity: &Entity, prefix: &str) -> Result<Width> {
        let width = self.roughness(entity, prefix)?;
        Ok(width.rounded(|| self.textures.log.ignore(features::PBRT_ANISOTROPY, &entity.place)))
    }

    /// The mixture, else the material of the greater share; its opacity is the share if the other is
    /// not there.
    fn mix(&mut self, entity: &Entity, name: String) -> Result<Option<Material>> {
        let names = match entity.find_of("materials", &[Kind::Text])?.map(|found| &found.values) {
            Some(Values::Texts(names)) if names.len() == 2 => names,
            _ => return Err(entity.error("expected two names of `materials`")),
        };
        if self.depth == MAX_DEPTH {
            let message = format!("more than {MAX_DEPTH} materials mix one another");
            return Err(entity.error(message));
        }
        self.depth += 1;
        let parts = names.iter().map(|part| {
            let Some(part_entity) = self.description.materials.get(part) else {
                return Err(entity.error(format!("there is no material `{part}`")));
            };
            self.named(part, part_entity)
        });
        let parts: Result<Vec<_>> = parts.collect();
        self.depth -= 1;
        let mut parts = parts?;
        let (second, first) = (parts.pop().flatten(), parts.pop().flatten());
        let amount = self.textures.number(entity, "amount")?.unwrap_or(Value::number(0.5));
        self.textures.log.unused(entity);
        let (material, opacity) = match (first, second) {
            (None, None) => return Ok(None),
            (Some(first), None) => (first, Some(amount.affine(Vec3::NEG_ONE, Vec3::ONE))),
            (None, Some(second)) => (second, Some(amount)),
            (Some(first), Some(second)) => {
                let share = match amount {
                    Value::Constant(amount) => {
                        Value::Constant(amount.map(|share| share.clamp(0.0, 1.0)))
                    }
                    image => image,
                };
                let losses = [features::PBRT_MIX_LOBES, features::PBRT_MIX];
                let (material, loss) = mixed([first, second], &share, losses);
                if let Some(loss) = loss {
                    self.textures.log.ignore(loss, &entity.place);
                }
                (material, None)
            }
        };
        let mut material = Material { name, ..material };
        if let Some(opacity) = opacity {
            set_opacity(&mut material.surface, opacity);
        }
        Ok(Some(material))
    }

    /// Lets a dielectric absorb as the medium inside it does; names a medium that does more, or that
    /// another surface bounds.
    pub(super) fn fill(
        &mut self,
        kind: Option<&mut MaterialKind>,
        medium: &str,
        place: &Place,
    ) -> Result<()> {
        let Some(entity) = self.description.media.get(medium) else {
            let message = format!("MediumInterface \"{medium}\": there is no such medium");
            return Err(place.error(message));
        };
        match (kind, self.absorption(entity)?) {
            (Some(MaterialKind::Dielectric { absorption, .. }), Some(found)) => {
                *absorption = found;
                self.textures.log.unused(entity);
            }
            _ => self.textures.log.ignore(features::PBRT_MEDIUM, &entity.place),
        }
        Ok(())
    }

    /// Absorption coefficient, per metre, of a medium that neither scatters nor emits light.
    fn absorption(&self, medium: &Entity) -> Result<Option<Vec3>> {
        let color = |name: &str| match medium.find_of(name, &spectra::KINDS)? {
            Some(parameter) => spectra::index(parameter, &self.textures.log),
            None => Ok(Vec3::ONE),
        };
        let is_clear = medium.string("type")? == Some("homogeneous")
            && color("sigma_s")? == Vec3::ZERO
            && ["preset", "Le"].iter().all(|name| medium.find(name).is_none());
        let scale = medium.number("scale", 1.0)? as f32;
        let absorption = (scale * color("sigma_a")?).clamp(Vec3::ZERO, Vec3::splat(1e6));
        medium.find("g");
        Ok(is_clear.then_some(absorption))
    }
}

/// Diffuse reflectance of a medium of the reduced albedo `albedo` by the dipole of \[Jensen et al. 2001\],
/// with their fit to what a surface of refractive index `ior` throws back inside.
fn diffusion_albedo(albedo: Vec3, ior: f32) -> Vec3 {
    let inside = -1.44 / (ior * ior) + 0.71 / ior + 0.668 + 0.0636 * ior;
    let inside = inside.clamp(0.0, 0.99);
    let boundary = (1.0 + inside) / (1.0 - inside);
    albedo.clamp(Vec3::ZERO, Vec3::ONE).map(|albedo| {
        let depth = (3.0 * (1.0 - albedo)).sqrt();
        let shown = 0.5 * albedo * (1.0 + (-4.0 / 3.0 * boundary * depth).exp()) * (-depth).exp();
        // A medium that does nothing has no albedo.
        shown.min(1.0)
    })
}

pub(super) fn set_opacity(surface: &mut Surface, value: Value) {
    match value {
        Value::Image(image) => surface.opacity.texture = Some(image),
        constant => surface.opacity.factor = constant.mean().x.clamp(0.0, 1.0),
    }
}

/// Extinction coefficient of a metal of refractive index η = 1 and this reflectance, which pbrt takes for it.
fn extinction_of_metal(reflectance: Vec3) -> Vec3 {
    let color = reflectance.clamp(Vec3::ZERO, Vec3::splat(0.9999));
    2.0 * color.map(f32::sqrt) / (Vec3::ONE - color).map(f32::sqrt)
}

/// Returns the constant colour of a model, 1 if a texture gives it.
fn color(value: Value, surface: &mut Surface) -> Vec3 {
    let (color, texture) = value.split();
    surface.color = texture;
    color
}

fn exact(eta: Vec3, k: Vec3) -> ConductorFresnel {
    ConductorFresnel::Exact { reflectance: Vec3::ONE, eta, k }
}
