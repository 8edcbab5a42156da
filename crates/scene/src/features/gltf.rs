//! Parts of glTF 2.0 files.

use super::{Feature, Support};

features! {
    /// Parts of glTF 2.0.
    GLTF;
    GLTF_FILE Done "`.gltf` and `.glb`, buffers beside the file or inline" "";
    GLTF_NODES Done "nodes with transforms, mirrored ones too"
        "many copies of a mesh are one in memory";
    GLTF_TRIANGLES Done "triangles, strips and fans, with or without indices" "";
    GLTF_NORMALS Done "vertex normals" "flat-shaded without";
    GLTF_SPARSE Done "sparse accessors" "";
    GLTF_QUANTIZATION Done "`KHR_mesh_quantization`" "";
    GLTF_INSTANCING Done "`EXT_mesh_gpu_instancing`" "likewise";
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
