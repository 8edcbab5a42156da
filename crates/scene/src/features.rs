//! Parts of foreign files that Fenestra leaves out with a warning. The tables of `docs/formats.md` have
//! these rows word for word, beside those of what is rendered or refused.

use std::path::Path;

/// Part of a file that is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Feature {
    /// Name in warnings and tables; that of an extension or keyword is the format's own.
    pub name: &'static str,
    /// Details; may be empty.
    pub details: &'static str,
}

macro_rules! features {
    ($(#[$about:meta])* $table:ident; $($feature:ident $name:literal $details:literal;)*) => {
        $(
            #[doc = $name]
            pub const $feature: Feature = Feature { name: $name, details: $details };
        )*
        $(#[$about])*
        pub const $table: &[Feature] = &[$($feature),*];
    };
}

features! {
    /// Parts of glTF 2.0.
    GLTF;
    GLTF_CAMERAS "cameras that are not used" "";
    GLTF_ORTHOGRAPHIC "orthographic cameras" "perspective from afar";
    GLTF_NO_IMAGE "textures without an image" "";
    GLTF_HIGH_UV "textures with coordinates of the third or a further set" "";
    GLTF_COLORS "further sets of vertex colours" "";
    GLTF_UV "third and further sets of texture coordinates" "";
    GLTF_ANIMATION "animations" "played by `--frames`; else nodes stand as the file places them";
    GLTF_MORPH_COLORS "colours and texture coordinates of morph targets" "";
    GLTF_MORPH_ANIMATION "animated weights of morph targets" "those of the file count";
    GLTF_POINTS "points and lines" "";
    GLTF_SCENES "further scenes" "the default scene is rendered, else the first";
    GLTF_LIGHT_TYPE "lights of other types" "";
    GLTF_LIGHT_RANGE "range of lights" "light falls off with the squared distance alone";
    GLTF_OBJECT_LIGHTS "lights of a file in a `.toml` scene" "";
    GLTF_UNLIT_COLOR "vertex colours of unlit materials" "";
    GLTF_SPECULAR_TEXTURE "textures of `KHR_materials_specular`" "their means";
    GLTF_LOW_TRANSMISSION "transmission of less than half the light" "the surface is opaque";
    GLTF_TRANSMISSION_TEXTURE "texture of transmission" "a triangle is glass or opaque by its mean there";
    GLTF_GLOSSINESS_TEXTURE
        "specular texture of `KHR_materials_pbrSpecularGlossiness` on other coordinates than the diffuse one"
        "its mean colour counts; its glossiness is read";
    GLTF_SHEET "gloss, metal, volume and own pattern of `KHR_materials_diffuse_transmission`" "left out";
    GLTF_CLEARCOAT "coat on glass or a sheet" "left out";
    GLTF_CLEARCOAT_TEXTURE "textures of `KHR_materials_clearcoat`" "their means; normals as below the coat";
    GLTF_SHEEN "sheen below a coat, of glass or a sheet" "left out";
    GLTF_SHEEN_TEXTURE "textures of `KHR_materials_sheen`" "their means";
    GLTF_IRIDESCENCE "`KHR_materials_iridescence`" "reflections without the colours of thin films";
    GLTF_ANISOTROPY "anisotropy of glass or a sheet" "left out";
    GLTF_DISPERSION "`KHR_materials_dispersion`" "glass does not part colours";
    GLTF_VARIANTS "`KHR_materials_variants`" "without `--variant NAME`";
    GLTF_BASISU "`KHR_texture_basisu`" "the other image of the texture is used; refused if there is none";
    GLTF_EXTENSION "other extensions, by name" "refused where the file requires them";
}

features! {
    /// Statements of OBJ files.
    OBJ;
    OBJ_COLOR "vertex colours of faces with a material"
        "for those without, and materials with `vertex_color`; sRGB";
    OBJ_SMOOTHING "smoothing groups `s`" "where faces have no normals";
    OBJ_POINTS "points and lines" "`p`, `l`";
    OBJ_UNDESCRIBED "materials that no library describes" "they are white";
    OBJ_NO_MATERIAL "faces without a material" "grey, 0.5; in a `.toml` scene an error";
    OBJ_FACE "faces of fewer than three corners" "";
    OBJ_INDEX "indices of texture coordinates and normals that are not there" "the corner has none";
    OBJ_STATEMENT "other statements, by name" "curves and surfaces among them";
}

features! {
    /// Keys of MTL files.
    MTL;
    MTL_KS_COLOR "colour and strength of `Ks`" "Fresnel's equations give the gloss of plastic";
    MTL_ILLUM_MODEL "other models of `illum`" "as 2";
    MTL_OPTION "other options of images, by name" "";
    MTL_BUMP "heights in `bump`, `map_bump`" "their unit is open";
    MTL_KA "`Ka` other than black" "";
    MTL_TF "`Tf` other than white" "of all but thin panes";
    MTL_TRANSPARENT "`Tr 1` without `d`" "opaque";
    MTL_OUTSIDE "images whose names are absolute or lead out of the folder of the scene"
        "rendered without";
    MTL_KEY "other keys, by name" "`map_Ks` and `refl` among them";
}

features! {
    /// Parts of PLY files.
    PLY;
    PLY_COLOR "vertex colours of other materials" "";
    PLY_FACE "colours and texture numbers of faces" "";
    PLY_HEADER "other lines of the header" "";
}

features! {
    /// Directives and parameters of pbrt-v4.
    PBRT;
    PBRT_GAMUT "saturation of reflectance spectra beyond Rec.709" "clipped";
    PBRT_FILM "other parameters of the film"
        "size, crop, `iso` and `whitebalance` are done; open time times `iso`/100 scales all light";
    PBRT_INTEGRATOR "other integrators than path tracers, by name" "";
    PBRT_FILTER "`PixelFilter` other than a box of 0.5 and a Gaussian of 1.5, by name"
        "a Gaussian of 1.5, or the box";
    PBRT_CAMERA "cameras other than `perspective`, by name"
        "in 90° from their place, `orthographic` ones from afar";
    PBRT_SENSOR "`sensor` other than `cie1931`" "";
    PBRT_OPTION "`Option`, by name" "";
    PBRT_COLOR_SPACE "`ColorSpace` other than `srgb`" "colours are those of Rec.709";
    PBRT_MOTION "`ActiveTransform`, `TransformTimes`" "nothing moves";
    PBRT_MEDIUM "other media" "";
    PBRT_SCREEN_WINDOW "`screenwindow` of another ratio"
        "its height alone counts";
    PBRT_ASPECT "`frameaspectratio` other than that of the film" "pixels are square";
    PBRT_CURVE "exact form of `curve`" "tubes of 3 to 6 sides";
    PBRT_DISPLACEMENT "`displacement` of shapes, or beside a `normalmap`" "left out";
    PBRT_MISSING "files of shapes and of `measured` that are not there" "left out; diffuse of 0.5";
    PBRT_FLAT "shapes whose transformation flattens space" "left out";
    PBRT_COAT_INDEX "`interface.eta` other than 1.5" "the coat reflects as one of 1.5";
    PBRT_TRANSMISSION "images of `diffusetransmission` that differ"
        "the ratio of `reflectance` to `transmittance` is the same everywhere";
    PBRT_SUBSURFACE "light below `subsurface`" "plastic of the same albedo";
    PBRT_HAIR "parameters of `hair`" "diffuse of its colour";
    PBRT_MIX_LOBES "gloss of `mix`"
        "one lobe of the mean roughness; images on other coordinates than the first count by their means";
    PBRT_MIX "the lesser part of `mix` with glass or a sheet" "the other one is the whole surface";
    PBRT_COAT_ALBEDO "`albedo` of coats" "coats are clear";
    PBRT_ANISOTROPY "`uroughness` other than `vroughness`, of plastic and glass or textures"
        "their mean α, or the texture";
    PBRT_TEXTURE "other textures, by name" "`fbm`, `marble`, `dots`, `ptex` and others are 0.5";
    PBRT_TEXTURE_MIX "`scale` and `mix` of images on other coordinates than the first" "their means count";
    PBRT_TEXTURE_WRAP "`wrap` other than `repeat` and `clamp`" "as `clamp`";
    PBRT_TEXTURE_MAPPING "`mapping` of textures other than `uv`" "as `uv`";
    PBRT_LIGHT_IMAGE "image of `goniometric` and `projection`, stretch of spots"
        "its mean from a point, or over a cone as wide; round cones";
    PBRT_PORTAL "`portal` of lights" "they hide nothing";
    PBRT_EMISSION_IMAGE "images of bilinear patches that emit" "their area light counts";
    PBRT_INSTANCE_LIGHT "area lights in objects" "dark, as in pbrt";
    PBRT_INVISIBLE_LIGHT "area lights whose `alpha` is 0" "seen, and black to other light";
    PBRT_INTERFACE_LIGHT "area lights without a surface" "left out, as in pbrt";
    PBRT_PARAMETER "other parameters, by name" "";
}

features! {
    /// Parts of Mitsuba scene files.
    MITSUBA;
    MI_GAMUT "saturation of reflectance spectra beyond Rec.709" "clipped";
    MI_SHAPE "shapes of other kinds, by name" "left out";
    MI_CURVE "exact form of `bsplinecurve`, `linearcurve` and `hair`" "tubes of 3 to 6 sides";
    MI_MISSING "files of shapes and textures that are not there" "the shape is left out; the texture is 0.5";
    MI_FILE_CASE "files whose names are written in another case" "read all the same";
    MI_MODEL "other reflection models, by name" "diffuse of 0.5";
    MI_TEXTURE "other textures, by name" "0.5";
    MI_PHONG "`phong` and `ward`" "a metallic-roughness material of the same colours";
    MI_POLARIZED "polarisation of `pplastic`" "as `roughplastic`";
    MI_COATING "`coating` of other models than `diffuse` and metals" "left out";
    MI_WEIGHTS "sum of `weights` of `mixturebsdf` other than 1" "their ratios count";
    MI_CUT_LIGHT "light of `null`, or of a textured `mask`" "black, or as much as is opaque";
    MI_TWO_MODELS "second model of `twosided`" "the first is on both sides";
    MI_SPEC_TRANS "`spec_trans` between 0 and 1"
        "from ½ a rough dielectric, below none of it; as is a metal";
    MI_PRINCIPLED_REST "further parameters of `principled` and `principledthin`, by name" "";
    MI_BLEND_LOBES "gloss of `blendbsdf` and `mixturebsdf`"
        "one lobe of the mean roughness; images on other coordinates than the first count by their means";
    MI_BLEND "the lesser part of `blendbsdf` and `mixturebsdf` with glass or a sheet"
        "the other one is the whole surface";
    MI_BUMP_MAP "`bumpmap` of vertex colours, or beside a `normalmap`" "left out";
    MI_DISTRIBUTION "distributions `phong`, `as`; `beckmann` on coated metal" "`beckmann`; `ggx`";
    MI_ANISOTROPIC "`alpha_u` and `alpha_v` of plastic and glass, or images that differ"
        "their mean, or the image of `alpha_u`";
    MI_ALPHA_TEXTURE "`alpha` of vertices" "0.1";
    MI_SPECULAR "`specular_reflectance` of plastic" "white";
    MI_SPECULAR_TEXTURE "textures of `specular_reflectance` of dielectrics, or of glass that is `principled`"
        "white";
    MI_SPOT_TEXTURE "`texture` of a `spot`" "its mean over the whole cone";
    MI_EMITTER "other emitters, by name" "left out";
    MI_SENSORS "sensors that are not used" "";
    MI_SENSOR "other sensors, by name" "`orthographic` from afar, else a view is found";
    MI_FILTER "other `rfilter`s" "`gaussian` of ½";
    MI_INTEGRATOR "integrators of other pictures than those of paths, by name" "";
    MI_HIDE_EMITTERS "`hide_emitters`" "lights are seen";
    MI_MEDIUM "other uses of `medium`" "";
    MI_ELEMENT "other elements, by name" "";
    MI_PARAMETER "other parameters, by name" "";
}

/// Extensions of glTF that are read.
pub const GLTF_EXTENSIONS: [&str; 19] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

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
