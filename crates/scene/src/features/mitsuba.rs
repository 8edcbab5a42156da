//! Parts of Mitsuba scene files.

use super::{Feature, Support};

features! {
    /// Parts of Mitsuba scene files.
    MITSUBA;
    MI_DOCUMENT Done "`default` and `$name`, `ref`, `include`, `alias`, `path`"
        "files lie in the scene's folder or below";
    MI_NAMES Done "names of versions 0.5, 0.6, 2 and 3" "`toWorld` is `to_world`, `intIOR` `int_ior`";
    MI_TRANSFORM Done "`translate`, `rotate`, `scale`, `matrix`, `lookat`" "in their order";
    MI_COLOR Done "`rgb`, `srgb`, `spectrum`, `blackbody`"
        "spectra become linear Rec.709; those of reflectance under D65";
    MI_GAMUT Ignored "saturation of reflectance spectra beyond Rec.709" "clipped";
    MI_MESH Done "shapes `obj`, `ply`, `serialized`"
        "smooth normals where the file has none, unless `face_normals`";
    MI_QUADRIC Done "shapes `rectangle`, `cube`, `sphere`, `disk`, `cylinder`"
        "round ones of 128 segments";
    MI_INSTANCE Done "`shapegroup` and `instance`" "many copies are one mesh in memory";
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
    MI_MIXTURE Done "`blendbsdf` of two `diffuse`" "with at most one image among both and `weight`";
    MI_BLEND Ignored "the lesser part of other `blendbsdf`" "the other one is the whole surface";
    MI_NORMAL_MAP Done "`normalmap`" "";
    MI_BUMP_MAP Ignored "`bumpmap`" "";
    MI_BECKMANN Ignored "distribution `beckmann`" "`ggx` of the same α";
    MI_ALPHA Done "`alpha`, constant or textured" "between texels its root is interpolated";
    MI_ANISOTROPIC Ignored "`alpha_u` and `alpha_v` that differ" "their mean, or `alpha_u`";
    MI_ALPHA_TEXTURE Ignored "`alpha` of vertices" "0.1";
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
