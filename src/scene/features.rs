//! Parts of glTF, OBJ, MTL and PLY files and what becomes of them: the one declaration behind the readers'
//! warnings and the tables of `docs/formats.md`.

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
    GLTF_QUANTIZATION Done "`KHR_mesh_quantization`" "";
    GLTF_INSTANCING Done "`EXT_mesh_gpu_instancing`" "";
    GLTF_PERSPECTIVE Done "perspective cameras"
        "the first, or that of `--camera`; near and far planes do not clip";
    GLTF_CAMERAS Ignored "cameras that are not used" "";
    GLTF_ORTHOGRAPHIC Ignored "orthographic cameras" "refused if `--camera` names one";
    GLTF_METAL Done "metallic-roughness materials with their textures" "";
    GLTF_SINGLE_SIDED Mapped "single-sided materials"
        "every surface is seen from both sides; without `doubleSided` it emits only in front";
    GLTF_TEXTURE Done "textures: PNG and JPEG beside the file, inline and in buffers"
        "read by the first two sets of coordinates; one that cannot be read is a warning";
    GLTF_SAMPLER Done "samplers: wrap modes, magnification filter" "";
    GLTF_MIP Mapped "minification and mip map filters" "the samples of a pixel average the texels";
    GLTF_NO_IMAGE Ignored "textures without an image"
        "or with none but that of an extension which is ignored";
    GLTF_HIGH_UV Ignored "textures with coordinates of the third or a further set" "";
    GLTF_NORMAL_TEXTURE Done "normal textures with their scale"
        "without `TANGENT` by MikkTSpace";
    GLTF_OCCLUSION_TEXTURE Mapped "occlusion textures" "not read: shadows are traced";
    GLTF_EMISSIVE Done "emissive factors and textures" "radiance";
    GLTF_MASK Done "alpha modes OPAQUE, MASK and BLEND" "BLEND lets a share of the rays through";
    GLTF_COLOR Done "vertex colours `COLOR_0`" "";
    GLTF_COLORS Ignored "further sets of vertex colours" "";
    GLTF_UV Ignored "third and further sets of texture coordinates" "";
    GLTF_ATTRIBUTES Mapped "attributes of applications" "no part of the picture";
    GLTF_MORPH Done "morph targets" "with the weights of the file";
    GLTF_SKIN Ignored "skins" "the mesh is placed by its node";
    GLTF_ANIMATION Ignored "animations" "nodes stand as the file places them";
    GLTF_POINTS Ignored "points and lines" "";
    GLTF_SCENES Ignored "further scenes" "the default scene is rendered, else the first";
    GLTF_LIGHTS Done "`KHR_lights_punctual`"
        "candela and lux count as W/sr and W/m² of each colour channel";
    GLTF_LIGHT_RANGE Ignored "range of lights" "light falls off with the squared distance alone";
    GLTF_OBJECT_LIGHTS Ignored "lights of a file in a `.toml` scene" "";
    GLTF_UNLIT Mapped "`KHR_materials_unlit`"
        "emits its base colour on both sides and reflects nothing, so that it also lights others";
    GLTF_UNLIT_COLOR Ignored "vertex colours of unlit materials" "";
    GLTF_STRENGTH Done "`KHR_materials_emissive_strength`" "";
    GLTF_IOR Done "`KHR_materials_ior`" "1.01 to 4; 0 reflects all";
    GLTF_SPECULAR Done "`KHR_materials_specular`" "by its factors";
    GLTF_SPECULAR_TEXTURE Ignored "textures of `KHR_materials_specular`" "";
    GLTF_TRANSMISSION Mapped "`KHR_materials_transmission`"
        "glass if at least half the light is transmitted: a thin pane, or with a volume a solid";
    GLTF_LOW_TRANSMISSION Ignored "transmission of less than half the light"
        "the surface is opaque";
    GLTF_TRANSMISSION_TEXTURE Ignored "texture of transmission" "its mean counts";
    GLTF_GLASS_COLOR Ignored "base colour texture of glass" "the factor alone tints it";
    GLTF_THIN_ROUGHNESS Ignored "roughness of thin glass" "a pane is smooth";
    GLTF_VOLUME Mapped "`KHR_materials_volume`" "a thickness above 0 makes glass solid";
    GLTF_ABSORPTION Ignored "absorption of `KHR_materials_volume`" "";
    GLTF_GLOSSINESS Mapped "`KHR_materials_pbrSpecularGlossiness`"
        "a dielectric of the same diffuse colour and reflectance";
    GLTF_GLOSSINESS_TEXTURE Ignored "specular colour texture of `KHR_materials_pbrSpecularGlossiness`"
        "the factor alone counts; its glossiness is read";
    GLTF_TEXTURE_TRANSFORM Done "`KHR_texture_transform`" "";
    GLTF_CLEARCOAT Ignored "`KHR_materials_clearcoat`" "";
    GLTF_SHEEN Ignored "`KHR_materials_sheen`" "";
    GLTF_IRIDESCENCE Ignored "`KHR_materials_iridescence`" "";
    GLTF_ANISOTROPY Ignored "`KHR_materials_anisotropy`" "";
    GLTF_DISPERSION Ignored "`KHR_materials_dispersion`" "";
    GLTF_VARIANTS Ignored "`KHR_materials_variants`" "";
    GLTF_BASISU Ignored "`KHR_texture_basisu`" "the other image of the texture is used";
    GLTF_WEBP Ignored "`EXT_texture_webp`" "the other image of the texture is used";
    GLTF_EXTENSION Ignored "other extensions, by name" "refused where the file requires them";
    GLTF_DRACO Refused "`KHR_draco_mesh_compression`"
        "where the file requires it, as are the next; else the uncompressed mesh is read";
    GLTF_MESHOPT Refused "`EXT_meshopt_compression`" "";
    GLTF_NAMES Refused "names of files that are absolute or lead out of the folder of the scene" "";
}

features! {
    /// Statements of OBJ files.
    OBJ;
    OBJ_POSITION Done "`v`" "";
    OBJ_NORMAL Done "`vn`" "flat-shaded without";
    OBJ_FACE Done "`f`" "polygons are cut into triangles";
    OBJ_MATERIAL Done "`usemtl`, `mtllib`" "a missing library is a warning";
    OBJ_GROUP Done "`o`, `g`" "names only";
    OBJ_TEXCOORD Done "`vt`" "";
    OBJ_COLOR Ignored "vertex colours" "";
    OBJ_SMOOTHING Ignored "smoothing groups `s`" "where faces have no normals";
    OBJ_POINTS Ignored "points and lines" "`p`, `l`";
    OBJ_UNDESCRIBED Ignored "materials that no library describes" "they are white";
    OBJ_NO_MATERIAL Ignored "faces without a material"
        "grey, 0.5; in a `.toml` scene an error";
    OBJ_STATEMENT Ignored "other statements, by name" "curves and surfaces among them";
    OBJ_NAMES Refused "names of files that are absolute or lead out of the folder of the scene"
        "in MTL files too";
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
    MTL_MIRROR Mapped "`illum` 3 and 5" "a mirror of `Ks` if `Kd` is black; else as 2";
    MTL_GLASS Mapped "`illum` 4, 6, 7 and 9"
        "if `d` is below 0.5 a thin pane of index `Ni`, tinted by `Tf`, else by 1 − d (1 − Kd); \
         else as 2";
    MTL_ILLUM_MODEL Ignored "other models of `illum`" "as 2";
    MTL_OPACITY Done "`d`, `Tr`" "share of the light that is stopped; `d` counts before `Tr`";
    MTL_KE Done "`Ke`, `map_Ke`" "radiance of both sides";
    MTL_PBR Mapped "`Pr`, `Pm`, `map_Pr`, `map_Pm`"
        "instead of `Ks`, `Ns` and `illum` a metallic-roughness material as in glTF";
    MTL_MAP_KD Done "`map_Kd`"
        "factor of `Kd`, alone where that is black; its alpha is the opacity unless there is `map_d`";
    MTL_MAP_D Done "`map_d`" "the alpha of the image if it has one, else its luminance";
    MTL_NORM Done "`norm`" "normal map; tangents by MikkTSpace";
    MTL_OPTIONS Done "options `-s`, `-o`, `-clamp`, `-mm`, `-imfchan`, and `-bm` of `norm`" "";
    MTL_OPTION Ignored "other options of images, by name" "";
    MTL_MISSING Done "images that cannot be read" "a warning; rendered without the texture";
    MTL_BUMP Ignored "`bump`, `map_bump`" "height maps";
    MTL_KA Ignored "`Ka` other than black" "";
    MTL_TF Ignored "`Tf` other than white" "of all but thin panes";
    MTL_KEY Ignored "other keys, by name" "`map_Ks`, `refl` and `Pc` among them";
}

features! {
    /// Parts of PLY files.
    PLY;
    PLY_FORMAT Done "ascii, and binary in both byte orders" "";
    PLY_POSITION Done "`x y z`, `nx ny nz`" "flat-shaded without normals";
    PLY_UV Done "`u v`, `s t`, `texture_u texture_v`, `texture_s texture_t`"
        "from the lower left corner of an image";
    PLY_FACE Done "`vertex_indices`, `vertex_index`" "polygons are cut into triangles";
    PLY_COLOR Ignored "vertex colours `red green blue`" "";
    PLY_OTHER Mapped "other elements and properties" "no part of the surface";
    PLY_STRIPS Refused "`tristrips`" "";
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
