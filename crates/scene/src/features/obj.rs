//! Parts of OBJ, MTL and PLY files.

use super::{Feature, Support};

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
    PLY_COLORS Done "vertex colours `red green blue`, `r g b`, with `alpha` or `a`"
        "for materials with `vertex_color`; floats are linear, integers sRGB";
    PLY_COLOR Ignored "vertex colours of other materials" "";
    PLY_OTHER Mapped "other elements and properties" "no part of the surface";
    PLY_STRIPS Refused "`tristrips`" "";
}
