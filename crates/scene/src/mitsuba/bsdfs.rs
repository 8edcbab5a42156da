//! Reflection models → [`MaterialKind`] and [`Surface`].

use glam::Vec3;

use super::{
    Reader,
    document::Node,
    parameters::{Parameters, float, value},
    spectra::{self, Role},
    textures::MAX_SCALES,
};
use crate::{
    MIN_ALPHA,
    coat::{COAT_IOR, LossyCoat, albedo_below_coat},
    error::Result,
    features,
    import::{SOLID_IOR, Value, Width, blend::numbers, media},
    material::{ConductorFresnel, Distribution, Material, MaterialKind, Surface},
    math::colour::luminance,
    texture::Interpolation,
};

/// Most models in one another; a model may name itself.
const MAX_DEPTH: usize = 16;

/// Material without a name as yet, whose back is black.
fn one_sided(kind: MaterialKind) -> Material {
    let surface = Surface { two_sided: false, ..Surface::default() };
    Material { name: String::new(), kind, surface }
}

/// Extinction coefficient of a metal that reflects more than 0.9996 of the light at all angles.
const IDEAL_EXTINCTION: Vec3 = Vec3::splat(100.0);

/// Material whose first factor is `value`.
pub(super) fn colored(value: Value, kind: impl FnOnce(Vec3) -> MaterialKind) -> Material {
    let is_of_vertices = matches!(value, Value::Vertices(_));
    let (factor, texture) = value.split();
    let mut model = one_sided(kind(factor));
    model.surface.color = texture;
    model.surface.vertex_color = is_of_vertices;
    model
}

/// Sheet that scatters `value`, of which the share `transmitted` leaves on the other side.
fn sheet(value: Value, transmitted: f32) -> Material {
    let mut model = colored(value, |all| MaterialKind::DiffuseTransmission {
        reflectance: (1.0 - transmitted) * all,
        transmittance: transmitted * all,
    });
    model.surface.two_sided = true;
    model
}

/// Material of a shape that names none.
pub(super) fn default_of_shapes() -> Material {
    diffuse(0.5)
}

pub(super) fn diffuse(reflectance: f32) -> Material {
    let kind = MaterialKind::Diffuse { reflectance: Vec3::splat(reflectance) };
    Material { name: "default".to_owned(), ..one_sided(kind) }
}

impl Reader {
    pub(super) fn model(&mut self, node: Node<'_>) -> Result<Material> {
        if self.models_around == MAX_DEPTH {
            return Err(node.error("a bsdf contains itself, or is nested too deep"));
        }
        self.models_around += 1;
        let model = self.model_of(node);
        self.models_around -= 1;
        let name = node.attribute("id").map_or_else(|| node.place(), str::to_owned);
        Ok(Material { name, ..model? })
    }

    fn model_of(&mut self, node: Node<'_>) -> Result<Material> {
        let parameters = Parameters::new(node);
        // Names as `lambertian` and `microfacet` are those of versions up to 0.2.
        let model = match node.kind() {
            "twosided" => self.two_sided(&parameters)?,
            "mask" => self.mask(&parameters)?,
            "blendbsdf" => self.blend(&parameters)?,
            "mixturebsdf" | "composite" => self.mixture(&parameters)?,
            "coating" | "roughcoating" => self.coating(&parameters)?,
            "bumpmap" | "bump" => self.bump_map(&parameters)?,
            "normalmap" => self.normal_map(&parameters)?,
            "null" => {
                let mut model = diffuse(0.0);
                model.surface.opacity.factor = 0.0;
                model
            }
            "diffuse" | "lambertian" | "roughdiffuse" => {
                let is_older = parameters.any("reflectance")?.is_none();
                let name = if is_older { "diffuse_reflectance" } else { "reflectance" };
                let value = self.value_or(&parameters, name, Role::Reflectance, 0.5)?;
                colored(value, |reflectance| MaterialKind::Diffuse { reflectance })
            }
            "difftrans" => {
                let value = self.value_or(&parameters, "transmittance", Role::Reflectance, 0.5)?;
                sheet(value, 1.0)
            }
            "phong" | "ward" => self.phong(&parameters)?,
            "plastic" => self.plastic(&parameters, None)?,
            "roughplastic" | "microfacet" | "pplastic" => {
                if node.kind() == "pplastic" {
                    self.ignored.add(features::MI_POLARIZED, || node.place());
                }
                let width = self.round_width(&parameters)?;
                self.plastic(&parameters, Some(width))?
            }
            "conductor" | "mirror" => self.conductor(&parameters, None)?,
            "roughconductor" | "roughmetal" => {
                let Width { alpha, texture, anisotropy, distribution } = self.width(&parameters)?;
                let mut model = self.conductor(&parameters, Some(alpha))?;
                model.surface.roughness = texture;
                model.surface.anisotropy = anisotropy;
                model.surface.distribution = distribution;
                model
            }
            "dielectric" => self.dielectric(&parameters, Some(0.0))?,
            "roughdielectric" | "roughglass" => {
                let Width { alpha, texture, distribution, .. } = self.round_width(&parameters)?;
                let mut model = self.dielectric(&parameters, Some(alpha))?;
                model.surface.roughness = texture;
                model.surface.distribution = distribution;
                model
            }
            "thindielectric" => self.dielectric(&parameters, None)?,
            "principled" => self.principled(&parameters)?,
            "principledthin" => {
                self.without_counterpart(&parameters, &["spec_trans", "sheen", "flatness"])?;
                parameters.without_effect(
                    "roughness anisotropic eta spec_tint sheen_tint \
                     diffuse_reflectance_sampling_rate",
                );
                let base = self.value_or(&parameters, "base_color", Role::Reflectance, 0.5)?;
                let transmitted = self.value_or(&parameters, "diff_trans", Role::Index, 0.0)?;
                // All of it where that is 2.
                sheet(base, 0.5 * luminance(transmitted.mean()).clamp(0.0, 2.0))
            }
            "measured" => self.measured(&parameters)?,
            found => {
                let name = format!("reflection model `{found}`, which is diffuse of 0.5");
                self.ignored.add_named(features::MI_MODEL, &name, || node.place());
                return Ok(default_of_shapes());
            }
        };
        parameters.finish(&mut self.ignored);
        Ok(model)
    }

    pub(super) fn inner(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        match parameters.object("bsdf")? {
            Some(inner) => self.model(inner),
            None => {
                let kind = parameters.node.kind();
                Err(parameters.node.error(format!("{kind}: expected a bsdf in it, found none")))
            }
        }
    }

    fn measured(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let name = parameters.required("filename", parameters.string("filename")?)?;
        let path = parameters.node.file(name)?;
        let table = self.measured.table(&path, &mut self.inputs, &mut self.warnings)?;
        let strength = f32::from(table.has_turns());
        let mut model = one_sided(MaterialKind::Measured { path, table });
        model.surface.anisotropy.strength = strength;
        Ok(model)
    }

    fn two_sided(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let mut model = self.inner(parameters)?;
        if let Some(second) = parameters.objects("bsdf")?.get(1) {
            self.ignored.add(features::MI_TWO_MODELS, || second.place());
        }
        model.surface.two_sided = true;
        Ok(model)
    }

    fn mask(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let mut model = self.inner(parameters)?;
        let opacity = self.value_or(parameters, "opacity", Role::Reflectance, 0.5)?;
        self.cut(&mut model, parameters.node, opacity);
        Ok(model)
    }

    /// Multiplies the opacity of a model; of two textures, names the inner one.
    pub(super) fn cut(&mut self, model: &mut Material, node: Node<'_>, opacity: Value) {
        let (factor, texture) = opacity.split();
        let own = &mut model.surface.opacity;
        own.factor *= luminance(factor);
        if texture.is_some() {
            if own.texture.is_some() {
                let name = "second `opacity` texture of nested masks";
                self.ignored.add_named(features::MI_PARAMETER, name, || node.place());
            }
            own.texture = texture;
        }
    }

    fn normal_map(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let mut model = self.inner(parameters)?;
        if model.surface.normal.is_some() {
            self.ignored.add(features::MI_BUMP_MAP, || parameters.node.place());
        }
        parameters.without_effect("flip_invalid_normals use_shadowing_function");
        match self.value(parameters, "normalmap", Role::Index)? {
            Some(Value::Image(texture)) => model.surface.normal = Some(texture),
            _ => return Err(parameters.node.error("normalmap: expected the texture `normalmap`")),
        }
        Ok(model)
    }

    fn bump_map(&mut self, parameters: &Parameters<'_>) -> Result<Material> {
        let mut model = self.inner(parameters)?;
        let scale = Vec3::splat(parameters.float("scale")?.unwrap_or(1.0));
        parameters.without_effect("flip_invalid_normals use_shadowing_function");
        for texture in parameters.objects("texture")? {
            match self.texture(texture, MAX_SCALES)? {
                // One height everywhere bends nothing, nor do steps.
                Value::Constant(_) => {}
                Value::Image(heights) if heights.interpolation == Interpolation::Nearest => {}
                Value::Image(heights) if model.surface.normal.is_none() => {
                    let heights = heights.affine(scale, Vec3::ZERO);
                    model.surface.normal = Some(self.reliefs.keep(heights));
                }
                _ => self.ignored.add(features::MI_BUMP_MAP, || texture.place()),
            }
        }
        Ok(model)
    }

    pub(super) fn width(&mut self, parameters: &Parameters<'_>) -> Result<Width> {
        let node = parameters.node;
        let distribution = match parameters.string("distribution")? {
            Some("ggx") => Distribution::Ggx,
            None | Some("beckmann") => Distribution::Beckmann,
            Some("phong" | "as") => {
                self.ignored.add(features::MI_DISTRIBUTION, || node.place());
                Distribution::Beckmann
            }
            Some(found) => {
                let message = format!("distribution: expected ggx or beckmann, found `{found}`");
                return Err(node.error(message));
            }
        };
        parameters.without_effect("sample_visible specular_sampling_weight");
        Ok(Width { distribution, ..self.width_of(parameters)? })
    }

    /// The same for a model whose width is one for all directions.
    pub(super) fn round_width(&mut self, parameters: &Parameters<'_>) -> Result<Width> {
        let width = self.width(parameters)?;
        let place = || parameters.node.place();
        Ok(width.rounded(|| self.ignored.add(features::MI_ANISOTROPIC, place)))
    }

    pub(super) fn width_of(&mut self, parameters: &Parameters<'_>) -> Result<Width> {
        let node = parameters.node;
        let mut width = |name: &str| self.value(parameters, name, Role::Index);
        let value = match (width("alpha_u")?, width("alpha_v")?) {
            (Some(Value::Constant(u)), Some(Value::Constant(v))) => {
                return Ok(Width::of_pair([u, v].map(|width| width.x.clamp(MIN_ALPHA, 1.0))));
            }
            (Some(one), other) => {
                if !matches!((&one, &other), (Value::Image(u), Some(Value::Image(v))) if u == v) {
                    self.ignored.add(features::MI_ANISOTROPIC, || node.place());
                }
                Some(one)
            }
            (None, one) => one.or(width("alpha")?),
        };
        Ok(match value {
            Some(Value::Image(texture)) => {
                let root = |alpha: f32| alpha.clamp(MIN_ALPHA, 1.0).sqrt();
                Width::round(1.0, Some(numbers(&texture).mapped(root)))
            }
            value => {
                let alpha = self.without_texture(value, node, features::MI_ALPHA_TEXTURE);
                let alpha = alpha.map_or(0.1, |alpha| alpha.x).clamp(MIN_ALPHA, 1.0);
                Width::round(alpha, None)
            }
        })
    }

    /// Index of the inside over that of the outside.
    pub(super) fn ior(&mut self, parameters: &Parameters<'_>, inside: &str) -> Result<f32> {
        let index = |name: &str, default: &str| {
            let Some(node) = parameters.any(name)? else {
                return Ok(media::dielectric(default).unwrap_or(1.0));
            };
            if node.tag() != "string" {
                return float(node);
            }
            let medium = value(node)?;
            media::dielectric(medium).ok_or_else(|| {
                let names = media::DIELECTRICS.map(|(name, _)| name).join(", ");
                node.error(format!("{name}: expected a number or one of {names}, found `{medium}`"))
            })
        };
        let (int_ior, ext_ior) = (index("int_ior", inside)?, index("ext_ior", "air")?);
        let ior = int_ior / ext_ior;
        if (SOLID_IOR.0..=SOLID_IOR.1).contains(&ior) {
            return Ok(ior);
        }
        let (low, high) = SOLID_IOR;
        Err(parameters.node.error(format!(
            "int_ior {int_ior} over ext_ior {ext_ior}: expected a ratio of {low} to {high}"
        )))
    }

    /// Plastic; `width` is none for a smooth one.
    fn plastic(&mut self, parameters: &Parameters<'_>, width: Option<Width>) -> Result<Material> {
        let node = parameters.node;
        let ior = self.ior(parameters, "polypropylene")?;
        let mut value = self.value_or(parameters, "diffuse_reflectance", Role::Reflectance, 0.5)?;
        let specular = self.value(parameters, "specular_reflectance", Role::Reflectance)?;
        if !matches!(specular, None | Some(Value::Constant(Vec3::ONE))) {
            self.ignored.add(features::MI_SPECULAR, || node.place());
        }
        let is_nonlinear = parameters.boolean("nonlinear")?.unwrap_or(false);
        let (least, most) = COAT_IOR;
        if ior > most {
            let message = format!("int_ior over ext_ior: expected at most 4, found {ior}");
            return Err(node.error(message));
        }
        // Such a coat reflects next to nothing.
        if ior < least {
            return Ok(colored(value, |reflectance| MaterialKind::Diffuse { reflectance }));
        }
        if let Some(width) = &width {
            let root = width.texture.as_ref().map_or(1.0, |texture| texture.mean()[0]);
            let coat = LossyCoat::new(width.distribution, width.alpha * root * root, ior);
            value = value.mapped(coat.albedo(is_nonlinear));
        } else if is_nonlinear {
            value = value.mapped(albedo_below_coat(ior));
        }
        let Width { alpha, texture, distribution, .. } =
            width.unwrap_or(Width::round(MIN_ALPHA, None));
        let plastic = |diffuse| MaterialKind::Plastic { diffuse, alpha, ior };
        let mut model = colored(value, plastic);
        model.surface.roughness = texture;
        model.surface.distribution = distribution;
        Ok(model)
    }

    /// Metal; `alpha` is none for a smooth one.
    fn conductor(&mut self, parameters: &Parameters<'_>, alpha: Option<f32>) -> Result<Material> {
        let node = parameters.node;
        let eta = spectra::parameter(parameters, "eta", Role::Index)?;
        let k = spectra::parameter(parameters, "k", Role::Index)?;
        // Deviation: Mitsuba 3.9.1 takes a mirror, and version 0.6, for which such files were made, copper.
        let is_copper = node.version() < 2.0 && node.kind().ends_with("conductor");
        let of_old = (is_copper && eta.is_none() && k.is_none()).then_some("Cu");
        let material = parameters.string("material")?.or(of_old);
        let outside = match parameters.any("ext_eta")? {
            Some(node) if node.tag() != "string" => float(node)?,
            Some(node) => media::dielectric(value(node)?).unwrap_or(1.0),
            None => 1.0,
        };
        let metal = match (material, eta, k) {
            (None, Some(eta), k) => Some((eta, k.unwrap_or(Vec3::ONE))),
            (None, None, Some(k)) => Some((Vec3::ZERO, k)),
            (None | Some("none"), None, None) => None,
            (Some(name), None, None) => Some(
                media::conductor(name).map(|(eta, k)| (eta.as_vec3(), k.as_vec3())).ok_or_else(
                    || {
                        let names = media::CONDUCTORS.map(|(name, _)| name).join(", ");
                        node.error(format!(
                            "material: expected none or one of {names}, found `{name}`"
                        ))
                    },
                )?,
            ),
            _ => return Err(node.error("expected either `material` or `eta` and `k`")),
        };
        let value = self.value_or(parameters, "specular_reflectance", Role::Reflectance, 1.0)?;
        let width = alpha.unwrap_or(MIN_ALPHA);
        let (eta, k) = match metal {
            Some((eta, k)) => (eta.max(Vec3::splat(0.01)) / outside, k / outside),
            None if alpha.is_none() => {
                return Ok(colored(value, |reflectance| MaterialKind::Mirror { reflectance }));
            }
            None => (Vec3::ONE, IDEAL_EXTINCTION),
        };
        Ok(colored(value, |reflectance| MaterialKind::Conductor {
            alpha: width,
            fresnel: ConductorFresnel::Exact { reflectance, eta, k },
        }))
    }

    /// Glass; `alpha` is none for a thin sheet.
    fn dielectric(&mut self, parameters: &Parameters<'_>, alpha: Option<f32>) -> Result<Material> {
        let ior = self.ior(parameters, "bk7")?;
        let reflected = self.value(parameters, "specular_reflectance", Role::Reflectance)?;
        let feature = features::MI_SPECULAR_TEXTURE;
        let reflectance = self.without_texture(reflected, parameters.node, feature);
        let reflectance = reflectance.unwrap_or(Vec3::ONE);
        let passed = self.value(parameters, "specular_transmittance", Role::Reflectance)?;
        let mut model =
            colored(passed.unwrap_or(Value::Constant(Vec3::ONE)), |transmittance| match alpha {
                Some(alpha) => {
                    let absorption = Vec3::ZERO;
                    MaterialKind::Dielectric { ior, alpha, reflectance, transmittance, absorption }
                }
                None => {
                    MaterialKind::ThinDielectric { ior, alpha: 0.0, reflectance, transmittance }
                }
            });
        model.surface.two_sided = true;
        Ok(model)
    }
}
