//! Materials → `bsdf` elements, and the light of their surfaces.

use std::{fmt::Display, path::Path};

use glam::Vec3;

use crate::{
    coat::{LossyCoat, normal_reflectance, principled_base_factor},
    export::{
        folder::{Attributes, Folder, SAME_UV},
        images::{Pictures, Recipe},
        subject::{Opacity, Subject, difference_of_index, index_of},
        triple,
    },
    material::{ConductorFresnel, Distribution, MaterialKind},
    math::colour::luminance,
    measured::RglTraits,
    texture::TextureUse,
};

/// GGX width above which separate masking is worth a warning: below it, a white conductor reflects
/// within 0.5% of what Fenestra's does at every elevation up to 80°.
const SEPARATE_MASKING_ALPHA: f32 = 0.1;
/// Smallest index of Mitsuba's `principled`, which stands for no reflection.
const LEAST_ETA: f32 = 1.001;

/// Elements of a material.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) bsdf: String,
    /// `emitter` element for the shapes; empty unless they emit.
    pub(super) emitter: String,
    /// True if the shapes are repeated with their back to the front.
    pub(super) has_back: bool,
    /// Properties of vertices that the shapes need.
    pub(super) attributes: Attributes,
}

/// Material on its way to a [`Model`].
pub(super) struct Translator<'a> {
    pub(super) subject: Subject<'a>,
    pub(super) folder: &'a Folder,
    pub(super) pictures: &'a mut Pictures,
    pub(super) color_factor: Option<Vec3>,
}

impl Translator<'_> {
    pub(super) fn model(mut self) -> Model {
        let surface = self.subject.surface;
        let kind = &self.subject.material.kind;
        let is_glass = kind.is_glass();
        let has_sides = is_glass || matches!(kind, MaterialKind::DiffuseTransmission { .. });
        let mut bsdf = self.reflection();
        if surface.two_sided && !has_sides {
            bsdf = around("twosided", "", &bsdf);
        } else if !surface.two_sided && has_sides && !is_glass {
            self.subject.warn("its back is black in Fenestra alone");
        }
        if let Some(normal) = self.subject.normal() {
            bsdf = self.bumps(normal, &bsdf);
        }
        if let Some(opacity) = self.opacity() {
            bsdf = around("mask", &opacity, &bsdf);
        }
        let (emitter, has_back) = self.light(is_glass);
        let mut sets = surface.textures().map(|used| used.uv_set);
        let uv_set = sets.next();
        if sets.any(|set| Some(set) != uv_set) {
            self.subject.warn(
                "its textures read two sets of coordinates, Mitsuba's only the first of them",
            );
        }
        let uvs = uv_set.or(surface.tangent_uv_set()).map(|set| (set as usize, SAME_UV));
        let attributes = Attributes { uvs, color_factor: self.color_factor };
        Model { bsdf, emitter, has_back, attributes }
    }

    fn warn_of_masking(&mut self, alpha: f32, kind: &str) {
        if alpha > SEPARATE_MASKING_ALPHA {
            self.subject.warn(&format!(
                "Mitsuba's {kind} masks and shadows separately, Fenestra together; highlights are \
                 darker there at alpha = {alpha}"
            ));
        }
    }

    fn reflection(&mut self) -> String {
        match &self.subject.material.kind {
            MaterialKind::Diffuse { reflectance } => {
                element("diffuse", &self.color("reflectance", *reflectance))
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                self.subject.warn(
                    "Mitsuba's principledthin has one ratio of both sides for all colours, and \
                     reflects by Disney's diffuse part",
                );
                let all = *reflectance + *transmittance;
                let passed = luminance(*transmittance) / luminance(all).max(f32::MIN_POSITIVE);
                let content = self.color("base_color", all) + &float("diff_trans", 2.0 * passed);
                element("principledthin", &content)
            }
            MaterialKind::Plastic { diffuse, alpha, ior } => {
                self.warn_of_masking(*alpha, "plastic");
                let base = self.plastic_base(*diffuse, *alpha, *ior);
                let mut content = self.microfacets(*alpha);
                content += &self.color("diffuse_reflectance", base);
                content += &float("int_ior", *ior);
                content += &float("ext_ior", 1.0);
                content += &property("boolean", "nonlinear", false);
                element("roughplastic", &content)
            }
            MaterialKind::Conductor {
                alpha,
                fresnel: ConductorFresnel::Exact { reflectance, eta, k },
            } => {
                self.warn_of_masking(*alpha, "conductor");
                let content = self.microfacets(*alpha)
                    + &self.color("specular_reflectance", *reflectance)
                    + &rgb("eta", *eta)
                    + &rgb("k", *k);
                element("roughconductor", &content)
            }
            MaterialKind::Conductor {
                alpha,
                fresnel: ConductorFresnel::Schlick { reflectance },
            } => {
                // Use a fully metallic `principled`, which has Schlick's Fresnel on the same GGX lobe.
                self.warn_of_masking(*alpha, "conductor");
                self.subject.without_beckmann();
                let content = self.color("base_color", *reflectance)
                    + &float("metallic", 1.0)
                    + &self.roughness(alpha.sqrt());
                element("principled", &content)
            }
            MaterialKind::Principled(own) => {
                self.warn_of_masking(own.roughness * own.roughness, "principled");
                self.subject.without_cover(own);
                self.subject.warn(
                    "Mitsuba's principled differs from glTF's: its diffuse part is Disney's, here of the \
                     same mean, and its dielectric reflects by Fresnel's equations instead of Schlick's",
                );
                let difference = difference_of_index(own);
                difference.iter().for_each(|difference| self.subject.warn(difference));
                let eta = index_of(own).max(LEAST_ETA);
                // The base of metal reflects alike in both.
                let (metal, rough) = self.subject.mean_metal_and_roughness();
                let factor = principled_base_factor(rough, normal_reflectance(eta)).recip();
                let factor = 1.0 + (1.0 - metal) * (factor - 1.0);
                let content = self.color("base_color", own.base_color * factor)
                    + &self.number(
                        "metallic",
                        own.metallic,
                        self.subject.surface.metallic.as_ref(),
                    )
                    + &self.roughness(own.roughness)
                    + &float("eta", eta);
                element("principled", &content)
            }
            MaterialKind::Mirror { reflectance } => {
                let content = property("string", "material", "none")
                    + &self.color("specular_reflectance", *reflectance);
                element("conductor", &content)
            }
            MaterialKind::Dielectric { ior, alpha, reflectance, transmittance, .. } => {
                let glass = self.glass(*ior, *reflectance, *transmittance);
                if *alpha > 0.0 {
                    self.warn_of_masking(*alpha, "dielectric");
                    element("roughdielectric", &(self.microfacets(*alpha) + &glass))
                } else {
                    element("dielectric", &glass)
                }
            }
            MaterialKind::ThinDielectric { ior, reflectance, transmittance, .. } => {
                self.subject.without_rough_pane();
                element("thindielectric", &self.glass(*ior, *reflectance, *transmittance))
            }
            MaterialKind::Measured { path, table } => match table.rgl {
                Some(traits) => self.measured(path, traits),
                None => element("diffuse", &rgb("reflectance", self.subject.measured(path, table))),
            },
        }
    }

    /// Copy of an RGL file, which Mitsuba reads.
    fn measured(&mut self, path: &Path, traits: RglTraits) -> String {
        let file = path.display();
        if self.subject.surface.anisotropy.rotation != 0.0 {
            self.subject
                .warn("its tangents are turned, which Mitsuba's measured material leaves out");
        }
        if traits.is_spectral {
            self.subject.warn(&format!(
                "{file} holds spectra, which only Mitsuba's spectral variants read; its rgb variants \
                 read files with the field `rgb`"
            ));
        }
        let name = self.pictures.copy(path);
        element("measured", &property("string", "filename", self.folder.relative(&name)))
    }

    /// Base of Mitsuba's plastic, which loses light below its coat, that reflects as much as ours.
    fn plastic_base(&mut self, diffuse: Vec3, alpha: f32, ior: f32) -> Vec3 {
        let surface = self.subject.surface;
        let roughness = surface.roughness.as_ref();
        let root = roughness.map_or(1.0, |used| luminance(used.mean().into()));
        let factor = LossyCoat::new(surface.distribution, alpha * root * root, ior).base_factor();
        let texels = surface.color.iter().flat_map(|used| used.values());
        let lightest = texels.map(|[r, g, b, _]| r.max(g).max(b)).reduce(f32::max).unwrap_or(1.0)
            * diffuse.max_element();
        let most = factor.min(lightest.max(1e-3).recip().max(1.0));
        let aim = if most < factor {
            format!(", {factor} times would have the same mean reflectance, but no base is above 1")
        } else {
            " for the same mean reflectance".to_owned()
        };
        let horizon = if alpha > SEPARATE_MASKING_ALPHA {
            "; seen along the horizon it may differ by several times"
        } else {
            ""
        };
        self.subject.warn(&format!(
            "Mitsuba's plastic loses light below its coat, Fenestra's does not; its base is {most} \
             times as light{aim}{horizon}"
        ));
        most * diffuse
    }

    /// Main colour of the model, with its texture or the colours of vertices.
    fn color(&mut self, name: &str, factor: Vec3) -> String {
        let surface = self.subject.surface;
        let is_of_vertices = self.subject.triangles.has_colors;
        if let Some(used) = &surface.color {
            if is_of_vertices {
                self.subject.warn(
                    "Mitsuba multiplies no texture by the colours of vertices; they are left out",
                );
            }
            let is_bright =
                |value: &[f32; 4]| (Vec3::from_slice(value) * factor).max_element() > 1.0;
            if used.values().iter().any(is_bright) {
                self.subject
                    .warn("its image is above 1 in places, where Mitsuba does not cut it off");
            }
            return self.bitmap(name, used, Recipe::Color(factor));
        }
        let is_plastic = matches!(self.subject.material.kind, MaterialKind::Plastic { .. });
        if is_of_vertices && is_plastic {
            self.subject.warn("Mitsuba's plastic has no colours of vertices; they are left out");
        } else if is_of_vertices {
            self.color_factor = Some(factor);
            let content = property("string", "name", "vertex_color");
            return texture("mesh_attribute", name, &content);
        }
        rgb(name, factor)
    }

    /// Parameters of a dielectric in air.
    fn glass(&mut self, ior: f32, reflectance: Vec3, transmittance: Vec3) -> String {
        float("int_ior", ior)
            + &float("ext_ior", 1.0)
            + &rgb("specular_reflectance", reflectance)
            + &self.color("specular_transmittance", transmittance)
    }

    fn number(&mut self, name: &str, factor: f32, used: Option<&TextureUse>) -> String {
        match used {
            Some(used) => self.bitmap(name, used, Recipe::Number(factor)),
            None => float(name, factor),
        }
    }

    fn roughness(&mut self, factor: f32) -> String {
        match self.subject.widths(factor * factor) {
            None => self.number("roughness", factor, self.subject.surface.roughness.as_ref()),
            Some([along_u, along_v]) if along_u < along_v => {
                self.subject.warn("its highlights are widest along v; they become round");
                float("roughness", (0.5 * (along_u + along_v)).sqrt())
            }
            Some([along_u, along_v]) => {
                float("roughness", (along_u * along_v).powf(0.25))
                    + &float("anisotropic", (1.0 - along_v / along_u) / 0.9)
            }
        }
    }

    /// Parameters of microfacets of width `alpha`.
    fn microfacets(&mut self, alpha: f32) -> String {
        let alpha = match (self.subject.widths(alpha), self.subject.width(alpha)) {
            (Some([along_u, along_v]), _) => float("alpha_u", along_u) + &float("alpha_v", along_v),
            (None, Some((used, recipe))) => self.bitmap("alpha", used, recipe),
            (None, None) => float("alpha", alpha),
        };
        let distribution = match self.subject.surface.distribution {
            Distribution::Ggx => "ggx",
            Distribution::Beckmann => "beckmann",
        };
        property("string", "distribution", distribution) + &alpha
    }

    /// Texture element; the image is written later.
    fn bitmap(&mut self, name: &str, used: &TextureUse, recipe: Recipe) -> String {
        let wrap = |axis: usize| ["repeat", "mirror", "clamp"][used.wrap[axis] as usize];
        if used.wrap[0] != used.wrap[1] {
            self.subject.warn(&format!(
                "`{name}` continues along u by {}, along v by {}; Mitsuba has one way for both, that \
                 of u",
                wrap(0),
                wrap(1)
            ));
        }
        let bitmap = self.pictures.add(used, recipe);
        let filter = if bitmap.is_nearest { "nearest" } else { "bilinear" };
        let mut content = property("string", "filename", self.folder.relative(&bitmap.name))
            + &property("boolean", "raw", bitmap.is_raw)
            + &property("string", "filter_type", filter)
            + &property("string", "wrap_mode", wrap(0));
        let [[a, b, c], [d, e, f]] = used.image_from_uv;
        if used.image_from_uv != SAME_UV {
            content += &format!(
                "    <transform name=\"to_uv\">\n        \
                 <matrix value=\"{a} {b} 0 {c}  {d} {e} 0 {f}  0 0 1 0  0 0 0 1\"/>\n    \
                 </transform>\n"
            );
        }
        texture("bitmap", name, &content)
    }

    /// Normal map around a model. It stands around `twosided`: inside, it would mirror the bumps
    /// of the back.
    fn bumps(&mut self, normal: &TextureUse, bsdf: &str) -> String {
        let recipe = self.subject.bumps();
        let [along, across, _] = normal.image_from_uv[0];
        if along <= 0.0 || across != 0.0 {
            self.subject.warn(
                "its normal map is turned or mirrored on its coordinates; Mitsuba bends along those \
                 of the mesh",
            );
        }
        let content = self.bitmap("normalmap", normal, recipe)
            + &property("boolean", "use_shadowing_function", false);
        around("normalmap", &content, bsdf)
    }

    /// Parameter of a `mask`, for a surface that is not opaque.
    fn opacity(&mut self) -> Option<String> {
        if self.subject.triangles.has_transparency {
            self.subject.warn("the opacity of its vertices is left out");
        }
        Some(match self.subject.opacity("mask")? {
            Opacity::Factor(factor) => float("opacity", factor),
            Opacity::Image(used, recipe) => self.bitmap("opacity", used, recipe),
        })
    }

    /// Emitter of the surface, and true if its back emits too.
    fn light(&mut self, is_glass: bool) -> (String, bool) {
        let surface = self.subject.surface;
        let Some(emission) = &surface.emission else { return Default::default() };
        let radiance = match &emission.texture {
            Some(used) => self.bitmap("radiance", used, Recipe::Color(emission.radiance)),
            None => rgb("radiance", emission.radiance),
        };
        let is_opaque = surface.opacity == Default::default();
        if !is_opaque {
            self.subject
                .warn("Mitsuba's light is that of the whole surface, also where it is not opaque");
        }
        let can_have_back = is_opaque && !is_glass && surface.two_sided;
        if emission.two_sided && !can_have_back {
            self.subject
                .warn("Mitsuba's surfaces emit in front only; the light of the back is left out");
        }
        let emitter = format!("<emitter type=\"area\">\n{radiance}</emitter>\n");
        (emitter, emission.two_sided && can_have_back)
    }
}

fn element(kind: &str, content: &str) -> String {
    format!("<bsdf type=\"{kind}\">\n{content}</bsdf>\n")
}

fn texture(kind: &str, name: &str, content: &str) -> String {
    indented(&format!("<texture type=\"{kind}\" name=\"{name}\">\n{content}</texture>\n"))
}

/// Element with parameters around a model.
fn around(kind: &str, content: &str, bsdf: &str) -> String {
    element(kind, &format!("{content}{}", indented(bsdf)))
}

/// Medium inside a dielectric that absorbs.
pub(super) fn interior(kind: &MaterialKind) -> String {
    let Some(absorption) = kind.absorption() else { return String::new() };
    // Colours are at most 1, times a scale.
    let scale = absorption.max_element();
    let content =
        rgb("sigma_t", absorption / scale) + &float("scale", scale) + &float("albedo", 0.0);
    format!("<medium name=\"interior\" type=\"homogeneous\">\n{content}</medium>\n")
}

/// Parameter of an element, on a line of its own.
pub(super) fn property(kind: &str, name: &str, value: impl Display) -> String {
    format!("    <{kind} name=\"{name}\" value=\"{value}\"/>\n")
}

fn float(name: &str, value: f32) -> String {
    property("float", name, value)
}

pub(super) fn rgb(name: &str, value: Vec3) -> String {
    property("rgb", name, triple(value))
}

/// Moves lines to the right by one level.
pub(super) fn indented(text: &str) -> String {
    text.lines().flat_map(|line| ["    ", line, "\n"]).collect()
}
