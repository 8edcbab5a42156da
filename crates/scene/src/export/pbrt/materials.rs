//! Materials → named materials with their textures, and the light of their surfaces.

use glam::{Mat3, Vec3};

use super::triple;
use crate::{
    coat::{COAT_IOR, base_below_coat},
    export::{
        folder::{Attributes, Folder, SAME_UV},
        images::{Pictures, Recipe},
        subject::{Opacity, Subject, index_of},
    },
    material::{ConductorFresnel, MaterialKind},
    texture::{Interpolation, TextureUse, Wrap},
};

/// Largest reflectance at normal incidence that pbrt finds an extinction coefficient for.
const MAX_REFLECTANCE: f32 = 0.9999;

/// Directives of a material.
#[derive(Debug)]
pub(super) struct Model {
    /// `Texture`s and `MakeNamedMaterial`.
    pub(super) text: String,
    /// `AreaLightSource`, if the surface emits.
    pub(super) light: String,
    /// Parameter of shapes for a surface that is not opaque.
    pub(super) alpha: String,
    /// Properties of vertices that the shapes need.
    pub(super) attributes: Attributes,
}

/// Material on its way to a [`Model`].
pub(super) struct Translator<'a> {
    pub(super) subject: Subject<'a>,
    /// Name in the file.
    pub(super) id: String,
    pub(super) folder: &'a Folder,
    pub(super) pictures: &'a mut Pictures,
    /// Directives of the textures.
    pub(super) textures: String,
    /// Use of a texture whose image coordinates the meshes have in place of their own.
    pub(super) base: Option<&'a TextureUse>,
}

impl<'a> Translator<'a> {
    pub(super) fn model(mut self) -> Model {
        let surface = self.subject.surface;
        // A normal map has no mapping of its own.
        self.base = surface.normal.as_ref().or(surface.textures().next());
        if surface.textures().any(|used| Some(used.uv_set) != self.base.map(|base| base.uv_set)) {
            self.subject.warn("its textures read two sets of coordinates, pbrt's only one of them");
        }
        if self.subject.triangles.has_colors {
            self.subject
                .warn("pbrt has no colours of vertices; theirs and their opacity are left out");
        }
        if !surface.two_sided && !self.subject.material.kind.is_glass() {
            self.subject.warn("its back is black in Fenestra, and as the front in pbrt");
        }
        let (kind, mut parameters) = self.reflection();
        if let Some(normal) = self.subject.normal() {
            parameters += &self.bumps(normal);
        }
        let alpha = self.alpha();
        let light = self.light();
        let id = &self.id;
        let text = format!(
            "{}MakeNamedMaterial \"{id}\" \"string type\" \"{kind}\"{parameters}\n",
            self.textures
        );
        let uvs = self.base.map(|base| {
            // v points up in pbrt, down in images.
            let [row_u, [a, b, c]] = base.image_from_uv;
            (base.uv_set as usize, [row_u, [-a, -b, 1.0 - c]])
        });
        let uvs = uvs.or(surface.tangent_uv_set().map(|set| (set as usize, SAME_UV)));
        Model { text, light, alpha, attributes: Attributes { uvs, color_factor: None } }
    }

    /// Kind of the material, and its parameters.
    fn reflection(&mut self) -> (&'static str, String) {
        match &self.subject.material.kind {
            MaterialKind::Diffuse { reflectance } => {
                ("diffuse", self.color("reflectance", *reflectance))
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                let sides = self.color("reflectance", *reflectance)
                    + &self.color("transmittance", *transmittance);
                ("diffusetransmission", sides)
            }
            MaterialKind::Plastic { diffuse, alpha, ior } => {
                self.coated(*diffuse, *alpha, *ior, "its coat and base")
            }
            MaterialKind::Conductor {
                alpha,
                fresnel: ConductorFresnel::Exact { reflectance: Vec3::ONE, eta, k },
            } if self.subject.surface.color.is_none() => {
                let index = rgb("eta", *eta) + &rgb("k", *k);
                ("conductor", index + &self.roughness(*alpha))
            }
            MaterialKind::Conductor { alpha, fresnel } => {
                self.metal(fresnel.at_normal_incidence(), *alpha)
            }
            MaterialKind::Principled(own) => {
                self.subject.without_cover(own);
                let (share, _) = self.subject.mean_metal_and_roughness();
                if share > 0.0 && share < 1.0 || self.subject.surface.metallic.is_some() {
                    self.subject
                        .warn("pbrt mixes no metal with others; the greater share is all of it");
                }
                let alpha = own.roughness * own.roughness;
                if share >= 0.5 {
                    return self.metal(own.base_color, alpha);
                }
                // Smaller ones are not read back.
                let ior = index_of(own).max(COAT_IOR.0);
                self.coated(own.base_color, alpha, ior, "its dielectric")
            }
            MaterialKind::Mirror { reflectance } => self.metal(*reflectance, 0.0),
            MaterialKind::Dielectric { ior, alpha, reflectance, transmittance, .. } => {
                self.colored_glass(*reflectance, *transmittance);
                ("dielectric", float("eta", *ior) + &self.roughness(*alpha))
            }
            MaterialKind::ThinDielectric { ior, reflectance, transmittance, .. } => {
                self.subject.without_rough_pane();
                self.colored_glass(*reflectance, *transmittance);
                ("thindielectric", float("eta", *ior))
            }
            MaterialKind::Measured { path, table } => {
                ("diffuse", rgb("reflectance", self.subject.measured(path, table)))
            }
        }
    }

    /// A coat over a base that shows `color` through it.
    fn coated(&mut self, color: Vec3, alpha: f32, ior: f32, part: &str) -> (&'static str, String) {
        self.subject.warn(&format!(
            "{part} become pbrt's coateddiffuse, in which light bounces between coat and base; the \
             same colour shows through a smooth coat, a rough one differs"
        ));
        let reflectance = match &self.subject.surface.color {
            Some(used) => self.texture("reflectance", used, Recipe::Base(color, ior)),
            None => rgb("reflectance", color.map(base_below_coat(ior))),
        };
        ("coateddiffuse", reflectance + &float("eta", ior) + &self.roughness(alpha))
    }

    /// A metal of this reflectance at normal incidence.
    fn metal(&mut self, reflectance: Vec3, alpha: f32) -> (&'static str, String) {
        if reflectance != Vec3::ONE || self.subject.surface.color.is_some() {
            self.subject.warn(
                "its reflectance is that of pbrt's metal at normal incidence alone; toward the \
                 horizon that follows Fresnel's equations",
            );
        }
        let reflectance = reflectance.min(Vec3::splat(MAX_REFLECTANCE));
        ("conductor", self.color("reflectance", reflectance) + &self.roughness(alpha))
    }

    /// Names colours that glass has no place for.
    fn colored_glass(&mut self, reflectance: Vec3, transmittance: Vec3) {
        if self.subject.surface.color.is_some() {
            self.subject.warn("the colours of its surface have no place in a dielectric");
        }
        if reflectance != Vec3::ONE || transmittance != Vec3::ONE {
            self.subject.warn(
                "the factors of reflected and transmitted light have no place in pbrt's glass",
            );
        }
    }

    fn color(&mut self, name: &str, factor: Vec3) -> String {
        match &self.subject.surface.color {
            Some(used) => self.texture(name, used, Recipe::Color(factor)),
            None => rgb(name, factor),
        }
    }

    fn roughness(&mut self, alpha: f32) -> String {
        self.subject.without_beckmann();
        let width = match (self.subject.widths(alpha), self.subject.width(alpha)) {
            (Some([along_u, along_v]), _) => {
                float("uroughness", along_u) + &float("vroughness", along_v)
            }
            (None, Some((used, recipe))) => self.texture("roughness", used, recipe),
            (None, None) => float("roughness", alpha),
        };
        width + " \"bool remaproughness\" false"
    }

    /// Adds a texture, whose image is written later, and returns the parameter that names it.
    fn texture(&mut self, name: &str, used: &TextureUse, recipe: Recipe) -> String {
        let bitmap = self.pictures.add(used, recipe);
        let wrap = match used.wrap {
            [Wrap::Repeat, Wrap::Repeat] => "repeat",
            [Wrap::Clamp, Wrap::Clamp] => "clamp",
            [first, _] => {
                self.subject.warn(&format!(
                    "`{name}` is mirrored beyond its edges, or continues along u and v in two ways; \
                     pbrt repeats or clamps it"
                ));
                if first == Wrap::Clamp { "clamp" } else { "repeat" }
            }
        };
        let ([du, u], [dv, v]) = self.mapping(name, used);
        let id = format!("{}_{name}", self.id);
        let kind = match recipe {
            Recipe::Number(_) | Recipe::Squared(_) | Recipe::Cut { .. } => "float",
            _ => "spectrum",
        };
        self.textures += &format!(
            "Texture \"{id}\" \"{kind}\" \"imagemap\" \"string filename\" \"{}\"\n    \
             \"string encoding\" \"{}\" \"string filter\" \"{}\" \"string wrap\" \"{wrap}\"\n    \
             \"float udelta\" {du} \"float uscale\" {u} \"float vdelta\" {dv} \"float vscale\" {v}\n",
            self.folder.relative(&bitmap.name),
            if bitmap.is_raw { "linear" } else { "sRGB" },
            if bitmap.is_nearest { "point" } else { "bilinear" },
        );
        format!(" \"texture {name}\" \"{id}\"")
    }

    /// Shift and scale along u and v, from the coordinates of the meshes to those of an image.
    fn mapping(&mut self, name: &str, used: &TextureUse) -> ([f32; 2], [f32; 2]) {
        let Some(base) = self.base.filter(|base| base.image_from_uv != used.image_from_uv) else {
            return ([0.0, 1.0], [0.0, 1.0]);
        };
        let matrix =
            |[u, v]: [[f32; 3]; 2]| Mat3::from_cols_array_2d(&[u, v, [0.0, 0.0, 1.0]]).transpose();
        let relative = matrix(used.image_from_uv) * matrix(base.image_from_uv).inverse();
        let [u, v, _] = relative.transpose().to_cols_array_2d();
        let is_straight = u[1].abs() <= 1e-5 * u[0].abs() && v[0].abs() <= 1e-5 * v[1].abs();
        if !(relative.is_finite() && is_straight) {
            self.subject.warn(&format!(
                "`{name}` is turned against another texture; pbrt has one direction for both"
            ));
            return ([0.0, 1.0], [0.0, 1.0]);
        }
        // v of the image = v[1] · (1 − v of the mesh) + v[2], and pbrt turns it round again.
        ([u[2], u[0]], [1.0 - v[1] - v[2], v[1]])
    }

    fn bumps(&mut self, normal: &TextureUse) -> String {
        let recipe = self.subject.bumps();
        let [along, across, _] = normal.image_from_uv[0];
        if self.subject.triangles.has_tangents && (along <= 0.0 || across != 0.0) {
            self.subject.warn(
                "its normal map is turned or mirrored on its coordinates; pbrt bends along those of \
                 the image",
            );
        }
        if normal.wrap != [Wrap::Repeat; 2] || normal.interpolation == Interpolation::Nearest {
            self.subject.warn("pbrt repeats and interpolates its normal map");
        }
        let file = self.folder.relative(&self.pictures.add(normal, recipe).name);
        format!(" \"string normalmap\" \"{file}\"")
    }

    /// Parameter of shapes for a surface that is not opaque.
    fn alpha(&mut self) -> String {
        match self.subject.opacity("alpha") {
            None => String::new(),
            Some(Opacity::Factor(factor)) => float("alpha", factor),
            Some(Opacity::Image(used, recipe)) => self.texture("alpha", used, recipe),
        }
    }

    /// `AreaLightSource` of the surface.
    fn light(&mut self) -> String {
        let surface = self.subject.surface;
        let Some(emission) = &surface.emission else { return String::new() };
        let radiance = match &emission.texture {
            Some(used) => {
                if used.wrap != [Wrap::Clamp; 2]
                    || self.base.map(|base| base.image_from_uv) != Some(used.image_from_uv)
                {
                    self.subject.warn(
                        "pbrt shows the image of its light once on the coordinates of the mesh, and \
                         continues it by the texels of its edge",
                    );
                }
                let bitmap = self.pictures.add(used, Recipe::Radiance(emission.radiance));
                let file = self.folder.relative(&bitmap.name);
                format!(" \"string filename\" \"{file}\"")
            }
            None => rgb("L", emission.radiance),
        };
        let two_sided = emission.two_sided;
        format!("AreaLightSource \"diffuse\"{radiance} \"bool twosided\" {two_sided}\n")
    }
}

fn float(name: &str, value: f32) -> String {
    format!(" \"float {name}\" {value}")
}

pub(super) fn rgb(name: &str, value: Vec3) -> String {
    format!(" \"rgb {name}\" [{}]", triple(value))
}
