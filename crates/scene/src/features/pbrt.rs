//! Parts of pbrt-v4 scene files.

use super::{Feature, Support};

features! {
    /// Directives and parameters of pbrt-v4.
    PBRT;
    PBRT_FILE Done "`.pbrt` and `.pbrt.gz`, `Include`, `Import`"
        "files in the folder of the scene, none that includes itself";
    PBRT_TRANSFORM Done "`Identity`, `Translate`, `Scale`, `Rotate`, `LookAt`, `Transform`, \
        `ConcatTransform`, `CoordinateSystem`, `CoordSysTransform`"
        "a camera that does not mirror shows a left-handed world, which is mirrored as a whole";
    PBRT_STATE Done "`AttributeBegin`, `TransformBegin`, `Attribute`, `ReverseOrientation`" "";
    PBRT_OBJECT Done "`ObjectBegin`, `ObjectInstance`"
        "many copies are one mesh in memory";
    PBRT_MESH Done "`trianglemesh`, `plymesh` (`.ply`, `.ply.gz`)"
        "flat-shaded without normals; texture coordinates 00, 10, 11 without any";
    PBRT_QUADRIC Mapped "`sphere`, `disk`, `cylinder`, `bilinearmesh`, `loopsubdiv`"
        "cut into triangles";
    PBRT_ALPHA Done "`alpha` of shapes" "the share of light that a surface stops";
    PBRT_DIFFUSE Done "`diffuse`, `dielectric`, `thindielectric`, `interface`" "";
    PBRT_COATED Mapped "`coateddiffuse`" "plastic";
    PBRT_BLEND Done "`mix` of two diffuse materials, or of one with `interface`"
        "with at most one image among both and `amount`";
    PBRT_CONDUCTOR Done "`conductor`"
        "exact Fresnel; a textured `reflectance` by Schlick's approximation";
    PBRT_ROUGHNESS Done "`roughness`, `remaproughness`"
        "α = √roughness, or roughness itself; at least 0.001, for dielectrics 0 below";
    PBRT_SPECTRUM Mapped "`rgb`, `blackbody`, `spectrum`"
        "colours by CIE 1931: reflectances under D65, lights with luminance 1; named metals, glasses \
         (587.6 nm) and illuminants";
    PBRT_GAMUT Ignored "saturation of reflectance spectra beyond Rec.709" "clipped";
    PBRT_IMAGEMAP Done "`imagemap`, `constant`"
        "bilinear or nearest texels; a number is the opacity of an image that has some, else its \
         luminance; 8-bit colours are sRGB unless `encoding` differs";
    PBRT_SCALE Done "`scale`, `mix`, `checkerboard` textures" "of constants and one image";
    PBRT_NORMAL_MAP Done "`normalmap`" "";
    PBRT_LAMP Done "`point`, `spot`, `distant`, `infinite`"
        "equal-area maps become lat-long maps twice as wide, of the same mean radiance";
    PBRT_AREA Done "`AreaLightSource`"
        "images too; `power` is that of the whole shape, where pbrt gives it to each of its triangles";
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
    PBRT_COATED_CONDUCTOR Ignored "coat of `coatedconductor`" "rendered as the bare conductor";
    PBRT_TRANSMISSION Ignored "light through `diffusetransmission`" "rendered as diffuse reflection";
    PBRT_SUBSURFACE Ignored "light below `subsurface`" "rendered as plastic";
    PBRT_HAIR Ignored "parameters of `hair`" "rendered as diffuse of 0.5";
    PBRT_MIX Ignored "the lesser part of other `mix`" "the other one is the whole surface";
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
    PBRT_EMISSION_IMAGE Ignored "images of bilinear patches that emit" "their area light counts";
    PBRT_INSTANCE_LIGHT Ignored "area lights in objects" "dark, as in pbrt";
    PBRT_INTERFACE_LIGHT Ignored "area lights without a surface" "left out, as in pbrt";
    PBRT_PARAMETER Ignored "other parameters, by name" "";
    PBRT_REFUSED Refused "`orthographic`, `spherical` and `realistic` cameras, `measured` materials, \
        lat-long maps, files of pbrt-v3" "";
}
