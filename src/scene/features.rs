//! Parts of glTF, OBJ, MTL and Mitsuba files and what becomes of them: the one declaration behind the
//! warnings of the readers and the tables of `docs/formats.md`.

use std::path::Path;

/// Treatment of a part of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Rendered as the format says.
    Done,
    /// Rendered as the nearest thing that exists, without a warning.
    Mapped,
    /// Left out, with one warning for each file.
    Ignored,
    /// An error that names it.
    Refused,
}

impl Support {
    /// Word of the tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Mapped => "mapped",
            Self::Ignored => "ignored with a warning",
            Self::Refused => "refused",
        }
    }
}

/// Part of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Feature {
    /// Name in warnings and tables; that of an extension or keyword is the format's own.
    pub name: &'static str,
    /// Treatment.
    pub support: Support,
    /// Details; may be empty.
    pub details: &'static str,
}

macro_rules! features {
    ($(#[$about:meta])* $table:ident; $($feature:ident $support:ident $name:literal $details:literal;)*) => {
        $(
            #[doc = $name]
            pub const $feature: Feature =
                Feature { name: $name, support: Support::$support, details: $details };
        )*
        $(#[$about])*
        pub const $table: &[Feature] = &[$($feature),*];
    };
}

features! {
    /// Parts of glTF 2.0.
    GLTF;
    GLTF_FILE Done "`.gltf` and `.glb`, buffers beside the file or inline" "";
    GLTF_NODES Done "nodes with transforms, mirrored ones too"
        "a mesh of several nodes is repeated in memory";
    GLTF_TRIANGLES Done "triangles, strips and fans, with or without indices" "";
    GLTF_NORMALS Done "vertex normals" "flat-shaded without";
    GLTF_SPARSE Done "sparse accessors" "";
    GLTF_INSTANCING Done "`EXT_mesh_gpu_instancing`" "attributes of floats; refused otherwise";
    GLTF_PERSPECTIVE Done "perspective cameras"
        "the first, or that of `--camera`; near and far planes do not clip";
    GLTF_CAMERAS Ignored "cameras that are not used" "";
    GLTF_ORTHOGRAPHIC Ignored "orthographic cameras" "refused if `--camera` names one";
    GLTF_METAL Mapped "metallic factor"
        "from 0.5 a conductor with the base colour as reflectance; below, plastic with the base \
         colour times (1 − metallic)";
    GLTF_ROUGHNESS Mapped "roughness factor" "α = roughness², at least 0.001";
    GLTF_IOR Mapped "`KHR_materials_ior`" "index of plastic, 1.01 to 4";
    GLTF_OWN_MATERIALS Ignored "metallic factor, roughness factor and index of a mesh in a `.toml` scene"
        "an object without `material` is diffuse in its mesh's base colours";
    GLTF_SINGLE_SIDED Mapped "single-sided materials" "every surface is two-sided";
    GLTF_TEXCOORD Mapped "first set of texture coordinates, tangents" "serve textures only";
    GLTF_BASE_TEXTURE Ignored "base colour texture" "the factor alone counts, as for all textures";
    GLTF_METAL_TEXTURE Ignored "metallic-roughness texture" "";
    GLTF_NORMAL_TEXTURE Ignored "normal texture" "";
    GLTF_OCCLUSION_TEXTURE Ignored "occlusion texture" "";
    GLTF_EMISSIVE_TEXTURE Ignored "emissive texture" "";
    GLTF_EMISSIVE Ignored "emissive factor" "light comes only from the environment";
    GLTF_MASK Ignored "alpha mode MASK, with its cutoff" "surfaces are opaque";
    GLTF_BLEND Ignored "alpha mode BLEND, with its factor" "surfaces are opaque";
    GLTF_COLOR Ignored "vertex colours" "";
    GLTF_UV Ignored "further sets of texture coordinates" "";
    GLTF_MORPH Ignored "morph targets" "the mesh is taken without them";
    GLTF_SKIN Ignored "skins" "the mesh is placed by its node";
    GLTF_ANIMATION Ignored "animations" "nodes stand as the file places them";
    GLTF_POINTS Ignored "points and lines" "";
    GLTF_SCENES Ignored "further scenes" "the default scene is rendered, else the first";
    GLTF_LIGHTS Ignored "`KHR_lights_punctual`" "light comes only from the environment";
    GLTF_UNLIT Ignored "`KHR_materials_unlit`" "shaded as any other";
    GLTF_CLEARCOAT Ignored "`KHR_materials_clearcoat`" "";
    GLTF_SHEEN Ignored "`KHR_materials_sheen`" "";
    GLTF_SPECULAR Ignored "`KHR_materials_specular`" "";
    GLTF_TRANSMISSION Ignored "`KHR_materials_transmission`" "";
    GLTF_VOLUME Ignored "`KHR_materials_volume`" "";
    GLTF_IRIDESCENCE Ignored "`KHR_materials_iridescence`" "";
    GLTF_ANISOTROPY Ignored "`KHR_materials_anisotropy`" "";
    GLTF_DISPERSION Ignored "`KHR_materials_dispersion`" "";
    GLTF_STRENGTH Ignored "`KHR_materials_emissive_strength`" "";
    GLTF_GLOSSINESS Ignored "`KHR_materials_pbrSpecularGlossiness`" "";
    GLTF_VARIANTS Ignored "`KHR_materials_variants`" "";
    GLTF_TEXTURE_TRANSFORM Ignored "`KHR_texture_transform`" "";
    GLTF_BASISU Ignored "`KHR_texture_basisu`" "";
    GLTF_WEBP Ignored "`EXT_texture_webp`" "";
    GLTF_EXTENSION Ignored "other extensions, by name" "refused where the file requires them";
    GLTF_DRACO Refused "`KHR_draco_mesh_compression`"
        "where the file requires it, as are the next; else the uncompressed mesh is read";
    GLTF_MESHOPT Refused "`EXT_meshopt_compression`" "";
    GLTF_QUANTIZATION Refused "`KHR_mesh_quantization`" "";
}

features! {
    /// Statements of OBJ files.
    OBJ;
    OBJ_POSITION Done "`v`" "";
    OBJ_NORMAL Done "`vn`" "flat-shaded without";
    OBJ_FACE Done "`f`" "polygons are cut into triangles";
    OBJ_MATERIAL Done "`usemtl`, `mtllib`" "a missing library is a warning";
    OBJ_GROUP Done "`o`, `g`" "names only";
    OBJ_TEXCOORD Mapped "`vt`" "serves textures only";
    OBJ_COLOR Ignored "vertex colours" "";
    OBJ_SMOOTHING Ignored "smoothing groups `s`" "where faces have no normals";
    OBJ_POINTS Ignored "points and lines" "`p`, `l`";
    OBJ_UNDESCRIBED Ignored "materials that no library describes" "they are white";
    OBJ_NO_MATERIAL Ignored "faces without a material"
        "grey, 0.5; in a `.toml` scene an error";
    OBJ_STATEMENT Ignored "other statements, by name" "curves and surfaces among them";
}

features! {
    /// Keys of MTL files.
    MTL;
    MTL_NAME Done "`newmtl`" "";
    MTL_KD Done "`Kd`" "diffuse reflectance; `spectral` and `xyz` are refused";
    MTL_KS Mapped "`Ks`" "unless black, a plastic of index `Ni`, in place of a diffuse surface";
    MTL_KS_COLOR Ignored "colour and strength of `Ks`"
        "Fresnel's equations give the gloss of plastic";
    MTL_NS Mapped "`Ns`" "α = √(2/(Ns + 2)), at least 0.001";
    MTL_NI Mapped "`Ni`" "1.01 to 4; else 1.5";
    MTL_ILLUM Done "`illum` 0 to 2" "below 2 without gloss";
    MTL_OWN_MATERIALS Ignored "`Ks`, `Ns` and `Ni` of a mesh in a `.toml` scene"
        "an object without `material` is diffuse in its mesh's colours";
    MTL_OPACITY Ignored "`d`, `Tr`" "surfaces are opaque";
    MTL_KE Ignored "`Ke`" "light comes only from the environment";
    MTL_KA Ignored "`Ka` other than black" "";
    MTL_TF Ignored "`Tf` other than white" "";
    MTL_ILLUM_MODEL Ignored "`illum` 3 to 10" "as 2";
    MTL_KEY Ignored "other keys, by name" "`map_Kd`, `bump`, `Pr` and `Pm` among them";
}

features! {
    /// Parts of Mitsuba scene files.
    MITSUBA;
    MI_DOCUMENT Done "`default` and `$name`, `ref`, `include`, `alias`, `path`"
        "files lie in the scene's folder or below";
    MI_NAMES Done "names of versions 0.5, 0.6, 2 and 3" "`toWorld` is `to_world`, `intIOR` `int_ior`";
    MI_TRANSFORM Done "`translate`, `rotate`, `scale`, `matrix`, `lookat`" "in their order";
    MI_COLOR Done "`rgb`, `srgb`, `spectrum`, `blackbody`"
        "spectra become linear Rec.709; those of reflectance under D65";
    MI_MESH Done "shapes `obj`, `ply`, `serialized`"
        "smooth normals where the file has none, unless `face_normals`";
    MI_QUADRIC Done "shapes `rectangle`, `cube`, `sphere`, `disk`, `cylinder`"
        "round ones of 128 segments";
    MI_INSTANCE Done "`shapegroup` and `instance`" "repeated in memory";
    MI_SIDES Done "`flip_normals`, `twosided`"
        "without `twosided` a surface that lets nothing through is black from behind";
    MI_TWO_MODELS Ignored "second model of `twosided`" "the first is on both sides";
    MI_DIFFUSE Done "`diffuse`" "";
    MI_PLASTIC Mapped "`plastic`, `roughplastic`"
        "smooth as α = 0.001; the base loses no light below the coat, as it does in Mitsuba, with \
         `nonlinear` (more colour) as without";
    MI_CONDUCTOR Done "`conductor`, `roughconductor`"
        "by `material`, `eta` and `k`, or `none`; smooth as α = 0.001; by Schlick's approximation \
         where `specular_reflectance` is not white";
    MI_DIELECTRIC Done "`dielectric`, `roughdielectric`, `thindielectric`" "indices by number or name";
    MI_PRINCIPLED Mapped "`principled`"
        "glTF's metallic-roughness material, whose diffuse part is Lambertian";
    MI_SPEC_TRANS Ignored "`spec_trans` between 0 and 1"
        "from ½ a rough dielectric, below none of it; as is a metal";
    MI_PRINCIPLED_REST Ignored "further parameters of `principled`, by name" "";
    MI_OPACITY Done "`mask`, `null`, `blendbsdf` with `null`" "";
    MI_BLEND Ignored "the lesser part of `blendbsdf`" "the other one is the whole surface";
    MI_NORMAL_MAP Done "`normalmap`" "";
    MI_BUMP_MAP Ignored "`bumpmap`" "";
    MI_BECKMANN Ignored "distribution `beckmann`" "`ggx` of the same α";
    MI_ANISOTROPIC Ignored "`alpha_u` and `alpha_v` that differ" "their mean";
    MI_ALPHA_TEXTURE Ignored "texture of `alpha`" "0.1";
    MI_SPECULAR Ignored "`specular_reflectance` of plastic" "white";
    MI_SPECULAR_TEXTURE Ignored
        "textures of `specular_reflectance` and `specular_transmittance` of dielectrics" "white";
    MI_BITMAP Done "`bitmap`"
        "`filename`, `raw`, `to_uv`, `wrap_mode`, `filter_type`; alpha is not read";
    MI_CHECKERBOARD Done "`checkerboard`" "of two colours";
    MI_ATTRIBUTE Done "`mesh_attribute` of `vertex_color`" "";
    MI_AREA Done "`area` lights" "on the side of the normals; textured ones too";
    MI_LAMP Done "`point`, `spot`, `directional`" "";
    MI_SPOT_TEXTURE Ignored "`texture` of a `spot`" "";
    MI_ENVIRONMENT Done "`envmap`, `constant`"
        "rows become those of Fenestra; resampled if turned about another axis than +Y";
    MI_SENSOR Done "`perspective`, `thinlens`"
        "the first, or that of `--camera` by id or number; near and far planes do not clip";
    MI_SENSORS Ignored "sensors that are not used" "";
    MI_MIRRORED Ignored "mirror image of the sensor's `to_world`" "the picture is not mirrored";
    MI_PRINCIPAL_POINT Ignored "`principal_point_offset_x`, `principal_point_offset_y`" "";
    MI_FILM Done "film: `width`, `height`, `rfilter` `box` and `gaussian` of ½"
        "how the film is written is not read";
    MI_CROP Ignored "crop of the film off its middle" "the whole film; one in the middle is done";
    MI_FILTER Ignored "other `rfilter`s" "`gaussian` of ½";
    MI_INTEGRATOR Ignored "`integrator` and `sampler`"
        "options of the command line and their defaults, as `--depth` and `--spp`";
    MI_MEDIUM Ignored "`medium`" "";
    MI_ELEMENT Ignored "other elements, by name" "";
    MI_PARAMETER Ignored "other parameters, by name" "";
    MI_PLUGIN Refused "other shapes, models, textures, emitters and sensors, by name"
        "`sunsky`, `measured`, `hair` among them";
}

/// Most kinds counted for one file; a file that is not what it seems may hold any number.
const MAX_KINDS: usize = 64;
/// Most characters of a name or place in a warning.
const MAX_CHARACTERS: usize = 80;

/// Counts what a file says and Fenestra leaves out, by kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ignored {
    kinds: Vec<Kind>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Kind {
    feature: Feature,
    name: String,
    count: usize,
    first: String,
}

impl Ignored {
    /// Counts `feature` once more; `place` is asked for the first time only.
    pub fn add(&mut self, feature: Feature, place: impl FnOnce() -> String) {
        self.add_named(feature, feature.name, place);
    }

    /// Counts a kind of `feature` that has a name of its own.
    pub fn add_named(&mut self, feature: Feature, name: &str, place: impl FnOnce() -> String) {
        self.count(feature, name, 1, place);
    }

    fn count(
        &mut self,
        feature: Feature,
        name: &str,
        count: usize,
        place: impl FnOnce() -> String,
    ) {
        debug_assert_eq!(feature.support, Support::Ignored, "{}", feature.name);
        let same = |kind: &&mut Kind| kind.feature == feature && kind.name == name;
        if let Some(kind) = self.kinds.iter_mut().find(same) {
            kind.count += count;
        } else if self.kinds.len() < MAX_KINDS || name == feature.name {
            let name = name.to_owned();
            self.kinds.push(Kind { feature, name, count, first: place() });
        } else {
            self.count(feature, feature.name, count, place);
        }
    }

    /// Adds the counts of another.
    pub fn merge(&mut self, other: &Self) {
        for kind in &other.kinds {
            self.count(kind.feature, &kind.name, kind.count, || kind.first.clone());
        }
    }

    /// One warning for each kind, in the order in which they came.
    pub fn warnings(&self, path: &Path) -> Vec<String> {
        let text = |kind: &Kind| {
            let Kind { feature, name, count, first } = kind;
            let (name, first) = (shorten(name), shorten(first));
            // The details of a table's "other" row say nothing of one of its kinds.
            let details = match feature.details {
                details if details.is_empty() || kind.name != feature.name => String::new(),
                details => format!(": {details}"),
            };
            let path = path.display();
            let first = if *count == 1 { first } else { format!("{count}, first in {first}") };
            format!("{path}: ignored {name} ({first}){details}")
        };
        self.kinds.iter().map(text).collect()
    }
}

/// Cuts a text that comes from a file, and replaces characters that would disturb a log.
fn shorten(text: &str) -> String {
    let mut characters = text.chars().map(|c| if c.is_control() { '?' } else { c });
    let mut short: String = characters.by_ref().take(MAX_CHARACTERS).collect();
    if characters.next().is_some() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_one_warning_and_kinds_are_bounded() {
        let mut ignored = Ignored::default();
        for line in 1..=3 {
            ignored.add(OBJ_COLOR, || format!("line {line}"));
        }
        ignored.add_named(OBJ_STATEMENT, "`deg`", || "line\n4".to_owned());
        let path = Path::new("a.obj");
        assert_eq!(ignored.warnings(path)[0], "a.obj: ignored vertex colours (3, first in line 1)");
        let second = "a.obj: ignored `deg` (line?4)";
        assert_eq!(ignored.warnings(path)[1], second);
        for number in 0..1000 {
            ignored.add_named(OBJ_STATEMENT, &format!("`x{number}`"), || "line 5".to_owned());
        }
        let warnings = ignored.warnings(path);
        assert_eq!(warnings.len(), MAX_KINDS + 1);
        assert!(warnings[MAX_KINDS].contains("other statements, by name (938, first in line 5)"));
        let mut twice = ignored.clone();
        twice.merge(&ignored);
        assert!(twice.warnings(path)[0].contains("(6, first in line 1)"));
    }
}
