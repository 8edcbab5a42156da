//! Mitsuba 3 XML (version 3.0.0): one scene file, and a folder of the same name beside it with the
//! environment (`environment.exr`) and binary PLY meshes, at most two a material.
//!
//! Deviations from Fenestra's own picture, each a warning where it applies:
//! - `roughconductor` and `roughplastic` mask and shadow separately, Fenestra together (\[Heitz
//!   2014\] Eq. 99): a difference that grows with α.
//! - `roughplastic` loses light that Fenestra's coupled base keeps (\[Kelemen & Szirmay-Kalos 2001\]):
//!   a white one of Mitsuba 3.9.1 reflects 0.96 of it at α = 0.05 and 0.69 at 0.3. Its linear variant
//!   is nearer, since the base's albedo enters once.
//! - Measured materials become diffuse with the same share of reflected light.
//!
//! The Gaussian filter, too small a difference for a warning, is cut off at 2 pixels, not at 1.5.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use glam::Vec3;

use super::ply::Part;
use crate::{
    brdf::{
        self, Material, MaterialTables,
        material::{ConductorFresnel, MaterialKind},
    },
    error::Result,
    files,
    film::Image,
    scene::{Camera, EnvironmentMap, Filter, Scene},
};

/// GGX width above which separate masking is worth a warning: below it, a white conductor reflects
/// within 0.5% of what Fenestra's does at every elevation up to 80°.
const SEPARATE_MASKING_ALPHA: f32 = 0.1;

/// Settings of the render that are not part of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Path vertices lit by the environment; 1 is direct light.
    pub depth: u32,
    /// Samples per pixel.
    pub samples: u32,
}

/// A scene on its way to Mitsuba.
#[derive(Debug)]
pub struct Export<'a> {
    scene: &'a Scene,
    settings: Settings,
    /// Reflection models in XML, one per material.
    models: Vec<String>,
    /// Differences that the format forces, one message for each material concerned.
    pub warnings: Vec<String>,
}

impl<'a> Export<'a> {
    /// Translates the materials, without writing anything.
    ///
    /// # Errors
    /// [`crate::Error::Scene`] if the tables of the materials are too large.
    pub fn new(scene: &'a Scene, settings: Settings) -> Result<Self> {
        let tables = MaterialTables::new(&scene.materials)?;
        let mut warnings = Vec::new();
        let models = scene.materials.iter().enumerate().map(|(index, material)| {
            model(material, || reflected_share(&tables, index), &mut warnings)
        });
        let models = models.collect();
        Ok(Self { scene, settings, models, warnings })
    }

    /// Writes `path` and the folder of the same name beside it.
    ///
    /// # Errors
    /// [`crate::Error::Io`] for a file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let folder = path.with_extension("");
        let scene = self.scene;
        let mut xml = format!(
            "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!-- Written by Fenestra {}. -->\n\
             <scene version=\"3.0.0\">\n    <integrator type=\"path\">\n        \
             <integer name=\"max_depth\" value=\"{}\"/>\n        \
             <boolean name=\"hide_emitters\" value=\"false\"/>\n    </integrator>\n",
            env!("CARGO_PKG_VERSION"),
            // Mitsuba counts the edges of a path, the one to the light included.
            u64::from(self.settings.depth) + 1
        );
        xml += &self.sensor();
        xml += &write_environment(&scene.environment, &folder)?;
        let mut parts: Vec<[Part; 2]> = Vec::new();
        parts.resize_with(scene.materials.len(), Default::default);
        for (&triangle, &material) in scene.geometry.triangles.iter().zip(&scene.geometry.materials)
        {
            let has_normal =
                |vertex: &u32| scene.geometry.normals[*vertex as usize] != [0.0_f32; 3];
            let is_flat = !triangle.iter().all(has_normal);
            parts[material as usize][usize::from(is_flat)].push(triangle);
        }
        for (index, parts) in parts.iter().enumerate() {
            if parts.iter().all(Part::is_empty) {
                continue;
            }
            let id = identifier(index, &scene.materials[index].name);
            _ = write!(
                xml,
                "    <bsdf type=\"twosided\" id=\"{id}\">\n{}    </bsdf>\n",
                self.models[index]
            );
            for (part, is_flat) in parts.iter().zip([false, true]) {
                if part.is_empty() {
                    continue;
                }
                let name = format!("{id}{}.ply", if is_flat { "_flat" } else { "" });
                files::write_atomically(&folder.join(&name), |file| {
                    part.write(file, &scene.geometry, !is_flat)
                })?;
                let file = relative(&folder, &name);
                _ = write!(
                    xml,
                    "    <shape type=\"ply\">\n        \
                     <string name=\"filename\" value=\"{file}\"/>\n        \
                     <boolean name=\"face_normals\" value=\"{is_flat}\"/>\n        \
                     <ref id=\"{id}\"/>\n    </shape>\n"
                );
            }
        }
        xml += "</scene>\n";
        files::write_text(path, &xml)
    }

    /// Camera, sampler and film. Mitsuba leaves out surfaces nearer or farther than its clip planes.
    fn sensor(&self) -> String {
        let Camera { position, look_at, up, .. } = self.scene.camera;
        let Camera { vertical_fov_deg, aperture_radius, focus_distance, .. } = self.scene.camera;
        let positions = self.scene.geometry.positions.iter();
        let distances = positions.map(|&vertex| position.distance(vertex.into()));
        let far = 2.0 * distances.fold(focus_distance, f32::max);
        let kind = if aperture_radius > 0.0 { "thinlens" } else { "perspective" };
        let mut xml = format!("    <sensor type=\"{kind}\">\n");
        let mut number = |name: &str, value: f32| {
            _ = writeln!(xml, "        <float name=\"{name}\" value=\"{value}\"/>");
        };
        number("fov", vertical_fov_deg);
        if aperture_radius > 0.0 {
            number("aperture_radius", aperture_radius);
            number("focus_distance", focus_distance);
        }
        number("near_clip", 1e-6 * far);
        number("far_clip", far);
        let filter = match self.scene.film.filter {
            Filter::Box => "<rfilter type=\"box\"/>",
            Filter::Gaussian => {
                "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"0.5\"/></rfilter>"
            }
        };
        _ = write!(
            xml,
            r#"        <string name="fov_axis" value="y"/>
        <transform name="to_world">
            <lookat origin="{}" target="{}" up="{}"/>
        </transform>
        <sampler type="independent">
            <integer name="sample_count" value="{}"/>
        </sampler>
        <film type="hdrfilm">
            <integer name="width" value="{}"/>
            <integer name="height" value="{}"/>
            <string name="pixel_format" value="rgb"/>
            <string name="component_format" value="float32"/>
            {filter}
        </film>
    </sensor>
"#,
            triple(position),
            triple(look_at),
            triple(up),
            self.settings.samples,
            self.scene.film.width,
            self.scene.film.height,
        );
        xml
    }
}

/// Writes the environment into `folder` and returns its emitter.
///
/// Mitsuba's texel columns have centres at (i + ½)/width as Fenestra's, but its rows lie at
/// j/(height − 1), on the poles too. A map of 2·height + 1 rows holds Fenestra's bilinear function
/// exactly: odd rows are the texels, even ones the means of their neighbours. Mitsuba's middle looks
/// along +Z, Fenestra's along −Z: half a turn.
fn write_environment(map: &EnvironmentMap, folder: &Path) -> Result<String> {
    let first = map.texels[0];
    if map.texels.iter().all(|texel| *texel == first) {
        return Ok(format!(
            "    <emitter type=\"constant\">\n        <rgb name=\"radiance\" value=\"{}\"/>\n    \
             </emitter>\n",
            triple(first)
        ));
    }
    let (width, height) = (map.width as usize, map.height as usize);
    let mut image = Image::new(map.width, 2 * map.height + 1);
    let mut texels = Vec::with_capacity(image.pixel_count());
    for row in 0..=2 * height {
        let above = row.saturating_sub(1) / 2 * width;
        let below = (row / 2).min(height - 1) * width;
        texels.extend((0..width).map(|column| {
            (0.5 * map.texels[above + column] + 0.5 * map.texels[below + column]).to_array()
        }));
    }
    image.insert_triple(["R", "G", "B"], &texels);
    let name = "environment.exr";
    image.write_exr(&folder.join(name))?;
    Ok(format!(
        "    <emitter type=\"envmap\">\n        <string name=\"filename\" value=\"{}\"/>\n        \
         <transform name=\"to_world\">\n            <rotate y=\"1\" angle=\"{}\"/>\n        \
         </transform>\n    </emitter>\n",
        relative(folder, name),
        f64::from(map.rotation_rad).to_degrees() + 180.0
    ))
}

/// Returns the reflection model of a material, and warns where it is not Fenestra's.
fn model(
    material: &Material,
    reflected_share: impl Fn() -> Vec3,
    warnings: &mut Vec<String>,
) -> String {
    let label = format!("material `{}`", material.name);
    let mut warn_of_masking = |alpha: f32, kind: &str| {
        if alpha > SEPARATE_MASKING_ALPHA {
            warnings.push(format!(
                "{label}: Mitsuba's {kind} masks and shadows separately, Fenestra together; \
                 highlights are darker there at alpha = {alpha}"
            ));
        }
    };
    match &material.kind {
        MaterialKind::Diffuse { reflectance } => diffuse(*reflectance),
        MaterialKind::Plastic { diffuse, alpha, ior } => {
            warn_of_masking(*alpha, "plastic");
            warnings.push(format!(
                "{label}: Mitsuba's plastic loses light below its coat, Fenestra's does not; a \
                 white one reflects 0.96 there at alpha = 0.05 and 0.69 at 0.3"
            ));
            let mut xml = rough("roughplastic", *alpha);
            xml += &colour("diffuse_reflectance", *diffuse);
            _ = write!(
                xml,
                "            <float name=\"int_ior\" value=\"{ior}\"/>\n            \
                 <float name=\"ext_ior\" value=\"1\"/>\n            \
                 <boolean name=\"nonlinear\" value=\"false\"/>\n        </bsdf>\n"
            );
            xml
        }
        MaterialKind::Conductor { alpha, fresnel: ConductorFresnel::Exact { eta, k } } => {
            warn_of_masking(*alpha, "conductor");
            rough("roughconductor", *alpha)
                + &colour("eta", *eta)
                + &colour("k", *k)
                + "        </bsdf>\n"
        }
        MaterialKind::Conductor { alpha, fresnel: ConductorFresnel::Schlick { reflectance } } => {
            // Use a fully metallic `principled`, which has Schlick's Fresnel on the same GGX lobe.
            warn_of_masking(*alpha, "conductor");
            format!(
                "        <bsdf type=\"principled\">\n{}            \
                 <float name=\"metallic\" value=\"1\"/>\n            \
                 <float name=\"roughness\" value=\"{}\"/>\n        </bsdf>\n",
                colour("base_color", *reflectance),
                alpha.sqrt()
            )
        }
        MaterialKind::Principled { base_color, metallic, roughness, .. } => {
            warn_of_masking(roughness * roughness, "principled");
            warnings.push(format!(
                "{label}: Mitsuba's principled differs from glTF's: its diffuse part is Disney's"
            ));
            format!(
                "        <bsdf type=\"principled\">\n{}            \
                 <float name=\"metallic\" value=\"{metallic}\"/>\n            \
                 <float name=\"roughness\" value=\"{roughness}\"/>\n        </bsdf>\n",
                colour("base_color", *base_color)
            )
        }
        MaterialKind::Mirror { reflectance } => {
            let reflectance = colour("specular_reflectance", *reflectance);
            format!(
                "        <bsdf type=\"conductor\">\n            \
                 <string name=\"material\" value=\"none\"/>\n{reflectance}        </bsdf>\n"
            )
        }
        MaterialKind::Dielectric { ior, alpha, reflectance, transmittance } => {
            let opening = if *alpha > 0.0 {
                rough("roughdielectric", *alpha)
            } else {
                "        <bsdf type=\"dielectric\">\n".to_owned()
            };
            opening + &glass(*ior, *reflectance, *transmittance)
        }
        MaterialKind::ThinDielectric { ior, reflectance, transmittance } => {
            "        <bsdf type=\"thindielectric\">\n".to_owned()
                + &glass(*ior, *reflectance, *transmittance)
        }
        MaterialKind::Measured { path, .. } => {
            let share = reflected_share().clamp(Vec3::ZERO, Vec3::ONE);
            warnings.push(format!(
                "{label}: Mitsuba reads no table such as {}; written as diffuse with the \
                 reflectance {}",
                path.display(),
                triple(share)
            ));
            diffuse(share)
        }
    }
}

/// Parameters of a dielectric in air, and the end of its element.
fn glass(ior: f32, reflectance: Vec3, transmittance: Vec3) -> String {
    format!(
        "            <float name=\"int_ior\" value=\"{ior}\"/>\n            \
         <float name=\"ext_ior\" value=\"1\"/>\n{}{}        </bsdf>\n",
        colour("specular_reflectance", reflectance),
        colour("specular_transmittance", transmittance)
    )
}

fn diffuse(reflectance: Vec3) -> String {
    format!(
        "        <bsdf type=\"diffuse\">\n{}        </bsdf>\n",
        colour("reflectance", reflectance)
    )
}

/// Begins a GGX model, sampled by visible normals.
fn rough(kind: &str, alpha: f32) -> String {
    format!(
        "        <bsdf type=\"{kind}\">\n            \
         <string name=\"distribution\" value=\"ggx\"/>\n            \
         <float name=\"alpha\" value=\"{alpha}\"/>\n"
    )
}

fn colour(name: &str, value: Vec3) -> String {
    format!("            <rgb name=\"{name}\" value=\"{}\"/>\n", triple(value))
}

/// Share of light from a uniform hemisphere that a material reflects: 2 ∫ E(μ) μ dμ by midpoints.
fn reflected_share(tables: &MaterialTables, material: usize) -> Vec3 {
    const STEPS: u32 = 64;
    let step = |index: u32| {
        let cosine = (index as f32 + 0.5) / STEPS as f32;
        let outgoing_local = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        brdf::albedo(tables, material, outgoing_local) * (2.0 * cosine / STEPS as f32)
    };
    (0..STEPS).map(step).sum()
}

fn triple(vector: Vec3) -> String {
    format!("{}, {}, {}", vector.x, vector.y, vector.z)
}

/// Returns an identifier that Mitsuba and file systems take: `00_name`, other characters as `_`.
fn identifier(index: usize, name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    format!("m{index:02}_{}", name.chars().take(60).map(safe).collect::<String>())
}

/// Path of a file in `folder` relative to the scene file, escaped for XML.
fn relative(folder: &Path, name: &str) -> String {
    let folder = folder.file_name().unwrap_or_default();
    let path = PathBuf::from(folder).join(name).display().to_string();
    path.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
