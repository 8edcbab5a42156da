//! Parts of foreign files and what becomes of them: the one declaration behind the readers'
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
        "smooth as α = 0.001; the base loses no light below the coat, as it does in Mitsuba; \
         `nonlinear` deepens its colour";
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

features! {
    /// Directives and parameters of pbrt-v4.
    PBRT;
    PBRT_FILE Done "`.pbrt` and `.pbrt.gz`, `Include`, `Import`"
        "files in the folder of the scene, none that includes itself";
    PBRT_TRANSFORM Done "`Identity`, `Translate`, `Scale`, `Rotate`, `LookAt`, `Transform`, \
        `ConcatTransform`, `CoordinateSystem`, `CoordSysTransform`"
        "a camera that does not mirror shows a left-handed world, which is mirrored as a whole";
    PBRT_STATE Done "`AttributeBegin`, `TransformBegin`, `Attribute`, `ReverseOrientation`" "";
    PBRT_OBJECT Done "`ObjectBegin`, `ObjectInstance`" "repeated in memory";
    PBRT_MESH Done "`trianglemesh`, `plymesh` (`.ply`, `.ply.gz`)"
        "flat-shaded without normals; texture coordinates 00, 10, 11 without any";
    PBRT_QUADRIC Mapped "`sphere`, `disk`, `cylinder`, `bilinearmesh`, `loopsubdiv`"
        "cut into triangles";
    PBRT_ALPHA Done "`alpha` of shapes" "the share of light that a surface stops";
    PBRT_DIFFUSE Done "`diffuse`, `dielectric`, `thindielectric`, `interface`" "";
    PBRT_COATED Mapped "`coateddiffuse`" "plastic";
    PBRT_CONDUCTOR Done "`conductor`"
        "exact Fresnel; a textured `reflectance` by Schlick's approximation";
    PBRT_ROUGHNESS Done "`roughness`, `remaproughness`"
        "α = √roughness, or roughness itself; at least 0.001, for dielectrics 0 below";
    PBRT_SPECTRUM Mapped "`rgb`, `blackbody`, `spectrum`"
        "colours by CIE 1931: reflectances under D65, lights with luminance 1; named metals, glasses \
         (587.6 nm) and illuminants";
    PBRT_IMAGEMAP Done "`imagemap`, `constant`"
        "bilinear or nearest texels; a number is the opacity of an image that has some, else its \
         luminance; 8-bit colours are sRGB unless `encoding` differs";
    PBRT_SCALE Done "`scale`, `mix`, `checkerboard` textures" "of constants and one image";
    PBRT_NORMAL_MAP Done "`normalmap`" "";
    PBRT_LAMP Done "`point`, `spot`, `distant`, `infinite`"
        "equal-area maps become lat-long maps twice as wide, of the same mean radiance";
    PBRT_AREA Done "`AreaLightSource`"
        "`power` is that of the whole shape, where pbrt gives it to each of its triangles";
    PBRT_CAMERA Done "`perspective`, with `lensradius` and `focaldistance`" "";
    PBRT_FILM Ignored "other parameters of the film"
        "`xresolution`, `yresolution` and `iso` are done; open time times `iso`/100 scales all light";
    PBRT_SAMPLER Mapped "`Sampler`, `Accelerator`" "the command line chooses samples";
    PBRT_DEPTH Ignored "`maxdepth` of the integrator" "the command line chooses the length of paths";
    PBRT_INTEGRATOR Ignored "other integrators than path tracers, by name" "";
    PBRT_FILTER Ignored "`PixelFilter` other than a box of 0.5 and a Gaussian of 1.5, by name"
        "a Gaussian of 1.5, or the box";
    PBRT_SENSOR Ignored "`sensor` other than `cie1931`" "";
    PBRT_OPTION Ignored "`Option`, by name" "";
    PBRT_COLOR_SPACE Ignored "`ColorSpace` other than `srgb`" "colours are those of Rec.709";
    PBRT_MOTION Ignored "`ActiveTransform`, `TransformTimes`" "nothing moves";
    PBRT_MEDIUM Ignored "`MakeNamedMedium`, `MediumInterface`" "all space is empty";
    PBRT_SCREEN_WINDOW Ignored "`screenwindow` that is not centred or of another ratio"
        "its height alone counts";
    PBRT_ASPECT Ignored "`frameaspectratio` other than that of the film" "pixels are square";
    PBRT_SHAPE Ignored "`curve`" "left out";
    PBRT_PARTIAL Ignored "`phimax`, `zmin`, `zmax`, by shape" "quadrics are whole";
    PBRT_DISPLACEMENT Ignored "`displacement`" "";
    PBRT_FLAT Ignored "shapes whose transformation flattens space" "left out";
    PBRT_NEAREST_MATERIAL Ignored "parts of `coatedconductor`, `diffusetransmission`, `subsurface`, \
        `hair` and `mix`, by name"
        "the bare conductor, diffuse reflection, plastic, diffuse 0.5, and the greater share";
    PBRT_COAT_ALBEDO Ignored "`albedo` of coats" "coats are clear";
    PBRT_ANISOTROPY Ignored "`uroughness` other than `vroughness`" "their mean α, or the texture";
    PBRT_TEXTURE Ignored "other textures, by name"
        "`fbm`, `marble`, `dots`, `ptex` and others are 0.5";
    PBRT_TEXTURE_PRODUCT Ignored "products of two images" "the first counts";
    PBRT_TEXTURE_MIX Ignored "mixtures of two images, or by an image" "the greater share counts";
    PBRT_TEXTURE_WRAP Ignored "`wrap` other than `repeat` and `clamp`" "as `clamp`";
    PBRT_TEXTURE_MAPPING Ignored "`mapping` of textures other than `uv`" "as `uv`";
    PBRT_LIGHT Ignored "`projection`, `goniometric`" "left out";
    PBRT_PORTAL Ignored "`portal` of lights" "they hide nothing";
    PBRT_EMISSION_IMAGE Ignored "images of area lights" "`L` alone counts";
    PBRT_INSTANCE_LIGHT Ignored "area lights in objects" "dark, as in pbrt";
    PBRT_INTERFACE_LIGHT Ignored "area lights without a surface" "left out, as in pbrt";
    PBRT_PARAMETER Ignored "other parameters, by name" "";
    PBRT_REFUSED Refused "`orthographic`, `spherical` and `realistic` cameras, `measured` materials, \
        lat-long maps, files of pbrt-v3" "";
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
