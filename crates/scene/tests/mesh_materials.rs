//! Surfaces, lamps and vertex attributes of glTF, OBJ and PLY files.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::f32::consts::FRAC_PI_2;

use fenestra_scene::{
    Scene,
    lamp::{LampKind, SpotFalloff},
    material::{Anisotropy, Material, MaterialKind, Principled},
    mesh::Mesh,
    picture::Image,
    texture::{Channels, Encoding, Interpolation, TextureUse, Wrap},
};
use glam::Vec3;

use crate::support::{
    assert_each_counts,
    folder::{self, Folder},
    gltf::{Attribute, base64, floats, gltf, gltf_of, png},
};

/// Positions of a triangle in the plane z = 0, and its texture coordinates, v downwards.
const CORNERS: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
const COORDINATES: [f32; 6] = [0.0, 1.0, 1.0, 1.0, 0.0, 0.0];

fn positions() -> Attribute<'static> {
    Attribute::floats("POSITION", "VEC3", &CORNERS)
}

/// Loads the material of a triangle with texture coordinates from `folder`.
fn gltf_material(folder: &Folder, material: &str, rest: &str) -> (Material, Vec<String>) {
    let uvs = Attribute::floats("TEXCOORD_0", "VEC2", &COORDINATES);
    let text = gltf_of(&[positions(), uvs], 3, material, rest);
    let mut warnings = Vec::new();
    let mesh = Mesh::read(&folder.write("a.gltf", text), &mut warnings).unwrap();
    warnings.extend(mesh.ignored_in_materials(|_| false).warnings("a.gltf".as_ref()));
    (mesh.materials[0].material.clone(), warnings)
}

fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

fn close(found: Vec3, expected: [f32; 3]) -> bool {
    found.abs_diff_eq(expected.into(), 1e-5)
}

#[test]
fn metallic_roughness_materials_come_with_all_their_textures() {
    let folder = Folder::new();
    folder.write("a b.png", png([[10, 20, 30, 255], [40, 50, 60, 128]]));
    let inline = base64(&png([[255, 128, 0, 255]; 2]));
    let rest = format!(
        r#", "images": [{{"uri": "a%20b.png"}}, {{"uri": "data:image/png;base64,{inline}"}}],
        "samplers": [{{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9987}}],
        "textures": [{{"source": 0, "sampler": 0}}, {{"source": 1}}]"#
    );
    let material = r#"{"name": "wood", "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true,
        "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.6, 0.4, 0.9], "metallicFactor": 0.25,
            "roughnessFactor": 0.5, "baseColorTexture": {"index": 0, "texCoord": 1,
                "extensions": {"KHR_texture_transform": {"texCoord": 0}}},
            "metallicRoughnessTexture": {"index": 1, "texCoord": 1}},
        "normalTexture": {"index": 1, "scale": 0.5}, "occlusionTexture": {"index": 1},
        "emissiveFactor": [1, 0.5, 0], "emissiveTexture": {"index": 0},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4},
            "KHR_materials_ior": {"ior": 1.4}, "KHR_materials_specular":
                {"specularFactor": 0.5, "specularColorFactor": [2, 1, 1]},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25,
                "clearcoatNormalTexture": {"index": 1, "scale": 0.5}},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.75, "anisotropyRotation": 0.5,
                "anisotropyTexture": {"index": 1}}}}"#;
    let (found, warnings) = gltf_material(&folder, material, &rest);
    assert_eq!(warnings, [""; 0]);
    let MaterialKind::Principled(Principled {
        base_color,
        metallic,
        roughness,
        ior,
        specular,
        specular_color,
        coat_weight,
        coat_roughness,
        sheen_color,
        sheen_roughness: _,
    }) = found.kind
    else {
        panic!("{found:?}")
    };
    assert_eq!((base_color, metallic), (Vec3::new(0.8, 0.6, 0.4), 0.25));
    assert_eq!((roughness, ior, specular), (0.5, 1.4, 0.5));
    assert_eq!((coat_weight, coat_roughness, sheen_color), (0.5, 0.25, Vec3::ZERO));
    let Anisotropy { strength, rotation, direction } = &found.surface.anisotropy;
    let direction = direction.as_ref().unwrap();
    assert_eq!((*strength, *rotation), (0.75, 0.5));
    assert_eq!((direction.channels, direction.encoding), (Channels::Color, Encoding::Linear));
    // Images of a coat count by their means, and it has no normals of its own.
    let images = r#""clearcoatTexture": {"index": 0}, "clearcoatRoughnessTexture": {"index": 0}"#;
    let normal = r#""clearcoatNormalTexture": {"index": 1, "scale": 0.5}"#;
    let (coat, warnings) = gltf_material(&folder, &material.replace(normal, images), &rest);
    let MaterialKind::Principled(Principled { coat_weight, coat_roughness, .. }) = coat.kind else {
        panic!()
    };
    let of = |channels| {
        let encoding = Encoding::Linear;
        TextureUse { channels, encoding, ..found.surface.color.clone().unwrap() }
    };
    let [red, green] = [Channels::Red, Channels::Green].map(|channel| of(channel).mean()[0]);
    assert!((coat_weight - 0.5 * red).abs() < 1e-6 && red < 0.9, "{coat_weight} {red}");
    assert!((coat_roughness - 0.25 * green).abs() < 1e-6 && green != red, "{coat_roughness}");
    assert!(warnings[0].contains("textures of `KHR_materials_clearcoat`"), "{warnings:?}");
    assert_eq!(specular_color, Vec3::new(2.0, 1.0, 1.0));
    // Images of the dielectric's reflection count by their means.
    let images = r#""specularTexture": {"index": 0}, "specularColorTexture": {"index": 0}, "#;
    let pictured = material.replace(r#""specularFactor""#, &format!(r#"{images}"specularFactor""#));
    let (pictured, warnings) = gltf_material(&folder, &pictured, &rest);
    let MaterialKind::Principled(own) = pictured.kind else { panic!() };
    assert!((own.specular - 0.5 * (255.0 + 128.0) / 510.0).abs() < 1e-6, "{}", own.specular);
    let mean = Vec3::from(found.surface.color.as_ref().unwrap().mean());
    assert!(close(own.specular_color, (mean * specular_color).into()), "{own:?}");
    assert!(warnings[0].contains("textures of `KHR_materials_specular`"), "{warnings:?}");
    // The index 0 is an infinite one, of which the factors alone are left.
    let (mirror, _) = gltf_material(&folder, &material.replace("1.4", "0"), &rest);
    let MaterialKind::Principled(Principled { specular_color, .. }) = mirror.kind else { panic!() };
    assert!(specular_color.abs_diff_eq(Vec3::new(50.0, 25.0, 25.0), 1e-4), "{specular_color}");
    let surface = found.surface;
    let color = surface.color.unwrap();
    assert_eq!((color.channels, color.encoding), (Channels::Color, Encoding::Srgb));
    assert_eq!(color.wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!((color.interpolation, color.uv_set), (Interpolation::Nearest, 0));
    assert_eq!((color.texture.width, color.texture.height), (2, 1));
    let of =
        |used: Option<TextureUse>| used.map(|used| (used.channels, used.encoding, used.uv_set));
    assert_eq!(of(surface.roughness), Some((Channels::Green, Encoding::Linear, 1)));
    assert_eq!(of(surface.metallic), Some((Channels::Blue, Encoding::Linear, 1)));
    assert_eq!(of(surface.normal), Some((Channels::Color, Encoding::Linear, 0)));
    assert_eq!(surface.normal_scale, 0.5);
    assert_eq!((surface.opacity.factor, surface.opacity.cutoff), (0.9, Some(0.3)));
    assert_eq!(of(surface.opacity.texture), Some((Channels::Alpha, Encoding::Linear, 0)));
    let emission = surface.emission.unwrap();
    assert!(emission.two_sided && surface.two_sided);
    assert_eq!(emission.radiance, Vec3::new(4.0, 2.0, 0.0));
    assert_eq!(of(emission.texture), Some((Channels::Color, Encoding::Srgb, 0)));

    // An opaque material ignores its alpha; a material without numbers is a white, rough metal.
    let (found, _) = gltf_material(&folder, &material.replace("MASK", "OPAQUE"), &rest);
    assert_eq!(found.surface.opacity, Default::default());
    let (found, _) = gltf_material(&folder, &material.replace("MASK", "BLEND"), &rest);
    assert_eq!((found.surface.opacity.factor, found.surface.opacity.cutoff), (0.9, None));
    let never = material.replace("\"alphaCutoff\": 0.3", "\"alphaCutoff\": 1.5");
    let (found, _) = gltf_material(&folder, &never, &rest);
    assert_eq!((found.surface.opacity.factor, found.surface.opacity.cutoff), (0.0, Some(1.0)));
    let (found, _) = gltf_material(&folder, "{}", "");
    assert!(matches!(
        found.kind,
        MaterialKind::Principled(Principled { metallic: 1.0, roughness: 1.0, specular: 1.0, .. })
    ));
    assert!(found.surface.emission.is_none());
    let one_sided = r#"{"emissiveFactor": [1, 1, 1]}"#;
    assert!(!gltf_material(&folder, one_sided, "").0.surface.emission.unwrap().two_sided);
}

#[test]
fn glass_unlit_and_specular_glossiness_materials_are_mapped() {
    let folder = Folder::new();
    let with = |extensions: &str, pbr: &str| {
        let material =
            format!(r#"{{"pbrMetallicRoughness": {{{pbr}}}, "extensions": {{{extensions}}}}}"#);
        gltf_material(&folder, &material, "")
    };
    let glass = r#""KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_ior": {"ior": 1.3}"#;
    let smooth = r#""baseColorFactor": [0.9, 1, 1, 1], "metallicFactor": 0, "roughnessFactor": 0"#;
    let (found, warnings) = with(glass, smooth);
    let MaterialKind::ThinDielectric { ior, transmittance, .. } = found.kind else { panic!() };
    assert_eq!((ior, transmittance, warnings.len()), (1.3, Vec3::new(0.9, 1.0, 1.0), 0));
    let rough = smooth.replace("Factor\": 0", "Factor\": 0.5").replacen("0.5", "0", 1);
    let (found, warnings) = with(glass, &rough);
    assert!(matches!(found.kind, MaterialKind::ThinDielectric { alpha: 0.25, .. }), "{found:?}");
    assert_eq!(warnings, [""; 0]);
    // Shadow rays go through a pane that looks smooth.
    let nearly = with(glass, &rough.replace("0.5", "0.04")).0.kind;
    assert!(matches!(nearly, MaterialKind::ThinDielectric { alpha: 0.0, .. }), "{nearly:?}");
    let volume = r#", "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 2,
        "attenuationColor": [1, 0.5, 0]}"#;
    let (found, warnings) = with(&format!("{glass}{volume}"), &rough);
    assert!(matches!(found.kind, MaterialKind::Dielectric { alpha: 0.25, ior: 1.3, .. }));
    assert_eq!(warnings, [""; 0]);
    let MaterialKind::Dielectric { transmittance, absorption, .. } = found.kind else { panic!() };
    assert_eq!(transmittance, Vec3::new(0.9, 1.0, 1.0));
    // exp(−absorption · 2 m) is the colour, and what absorbs all has no end of digits.
    assert!(
        (absorption - Vec3::new(0.0, 2_f32.ln() / 2.0, 0.0)).abs().with_z(0.0).max_element() < 1e-6
    );
    assert!(absorption.z > 40.0 && absorption.is_finite(), "{absorption}");
    // A metal transmits nothing, and little transmission stays opaque.
    let (found, warnings) = with(glass, r#""metallicFactor": 1"#);
    assert!(matches!(found.kind, MaterialKind::Principled(_)) && warnings.is_empty());
    // Its share of metal may come from an image.
    let inline = base64(&png([[0, 0, 64, 255]; 2]));
    let images = format!(
        r#", "images": [{{"uri": "data:image/png;base64,{inline}"}}], "textures": [{{"source": 0}}]"#
    );
    let material = format!(
        r#"{{"pbrMetallicRoughness": {{"metallicRoughnessTexture": {{"index": 0}},
        "baseColorTexture": {{"index": 0}}}}, "extensions": {{{glass}}}}}"#
    );
    let (found, warnings) = gltf_material(&folder, &material, &images);
    assert!(matches!(found.kind, MaterialKind::ThinDielectric { .. }), "{found:?}");
    assert_eq!((found.surface.color.unwrap().encoding, warnings.len()), (Encoding::Srgb, 0));
    let (found, warnings) = with(&glass.replace("Factor\": 1", "Factor\": 0.4"), smooth);
    assert!(matches!(found.kind, MaterialKind::Principled(_)) && warnings.len() == 1);

    let sheet = r#""KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.25,
        "diffuseTransmissionColorFactor": [0.4, 0.8, 1]}"#;
    let (found, warnings) = with(sheet, &smooth.replace("Factor\": 0,", "Factor\": 0.5,"));
    let MaterialKind::DiffuseTransmission { reflectance, transmittance } = found.kind else {
        panic!("{found:?}")
    };
    assert_eq!(reflectance, 0.5 * 0.75 * Vec3::new(0.9, 1.0, 1.0));
    assert_eq!(transmittance, 0.5 * 0.25 * Vec3::new(0.4, 0.8, 1.0));
    assert!(warnings.len() == 1 && warnings[0].contains("ignored gloss, metal"), "{warnings:?}");
    // The share that goes through may come from an image, here its opacity of ¼ and ¾.
    let inline = base64(&png([[255, 255, 255, 64], [255, 255, 255, 191]]));
    let images = format!(
        r#", "images": [{{"uri": "data:image/png;base64,{inline}"}}], "textures": [{{"source": 0}}]"#
    );
    let material = format!(
        r#"{{"pbrMetallicRoughness": {{{smooth}}}, "extensions":
        {{"KHR_materials_diffuse_transmission": {{"diffuseTransmissionFactor": 0.8,
        "diffuseTransmissionTexture": {{"index": 0}}}}}}}}"#
    );
    let (found, warnings) = gltf_material(&folder, &material, &images);
    let MaterialKind::DiffuseTransmission { reflectance, transmittance } = found.kind else {
        panic!("{found:?}")
    };
    let mean = Vec3::from(found.surface.color.unwrap().mean());
    let base = Vec3::new(0.9, 1.0, 1.0);
    assert!((reflectance * mean).abs_diff_eq(0.6 * base, 5e-3), "{}", reflectance * mean);
    assert!((transmittance * mean).abs_diff_eq(Vec3::splat(0.4), 5e-3), "{transmittance}");
    assert!(warnings[0].contains("own pattern"), "{warnings:?}");
    // A metal has no such light, and glass stays glass.
    assert!(matches!(with(sheet, "").0.kind, MaterialKind::Principled(_)));
    let both = with(&format!("{sheet}, {glass}"), smooth).0;
    assert!(matches!(both.kind, MaterialKind::ThinDielectric { .. }), "{both:?}");

    let unlit = r#""KHR_materials_unlit": {}"#;
    let (found, warnings) = with(unlit, r#""baseColorFactor": [0.2, 0.4, 0.6, 1]"#);
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(found.surface.emission.unwrap().radiance, Vec3::new(0.2, 0.4, 0.6));
    let MaterialKind::Diffuse { reflectance: Vec3::ZERO } = found.kind else { panic!() };

    let gloss = r#""KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.5, 0.4, 0.3, 1],
        "specularFactor": [0.04, 0.08, 0.02], "glossinessFactor": 0.75}"#;
    let (found, warnings) = with(gloss, "");
    assert!(warnings.is_empty(), "{warnings:?}");
    let MaterialKind::Principled(Principled {
        base_color,
        metallic,
        roughness,
        ior,
        specular_color,
        ..
    }) = found.kind
    else {
        panic!("{found:?}")
    };
    assert!(close(base_color, [0.5, 0.4, 0.3]) && close(specular_color, [1.0, 2.0, 0.5]));
    assert_eq!((metallic, roughness, ior), (0.0, 0.25, 1.5));
    // No dielectric reflects half the light: a metal with a little diffuse light.
    let (found, _) = with(&gloss.replace("[0.04, 0.08, 0.02]", "[0.5, 0.5, 0.5]"), "");
    let MaterialKind::Principled(Principled { base_color, metallic, specular_color, .. }) =
        found.kind
    else {
        panic!("{found:?}")
    };
    assert!(metallic > 0.5 && specular_color == Vec3::ONE, "{metallic}");
    let normal = Vec3::splat(0.04).lerp(base_color, metallic);
    assert!((luminance(normal) - 0.5).abs() < 0.02, "{normal}");
}

/// Each member, alone in place of `@`, makes a scene that no other member of its object makes; those after
/// `;` state defaults of the format, and change nothing.
#[test]
fn every_member_of_a_gltf_file_counts() {
    let extension =
        |name: &str, others: &str| format!("\"extensions\": {{\"{name}\": {{{others}@}}}}");
    let metal = "\"pbrMetallicRoughness\": {\"metallicFactor\": 1}, ";
    let light = |kind: &str| format!("\"type\": \"{kind}\"@");
    let groups = [
        (
            "material",
            "\"pbrMetallicRoughness\": {\"extras\": 0@}".to_owned(),
            "baseColorFactor [0.5,1,1,1]|metallicFactor 0.3|roughnessFactor 0.3;\
             baseColorFactor [1,1,1,1]|metallicFactor 1|roughnessFactor 1",
        ),
        (
            "material",
            "\"extras\": 0@".to_owned(),
            "emissiveFactor [1,0,0];emissiveFactor [0,0,0]|doubleSided false|alphaMode \"OPAQUE\"",
        ),
        (
            "material",
            "\"pbrMetallicRoughness\": {\"baseColorFactor\": [1, 1, 1, 0.4]}, \"alphaMode\": \"MASK\"@"
                .to_owned(),
            "alphaCutoff 0.3;alphaCutoff 0.5",
        ),
        ("material", extension("KHR_materials_ior", "\"extras\": 0"), "ior 1.7;ior 1.5"),
        (
            "material",
            extension("KHR_materials_specular", "\"extras\": 0"),
            "specularFactor 0.3|specularColorFactor [0.5,1,1];specularFactor 1|specularColorFactor [1,1,1]",
        ),
        (
            "material",
            extension("KHR_materials_clearcoat", "\"clearcoatFactor\": 0.5"),
            "clearcoatRoughnessFactor 0.3;clearcoatRoughnessFactor 0",
        ),
        (
            "material",
            extension("KHR_materials_sheen", "\"sheenColorFactor\": [1, 0, 0]"),
            "sheenRoughnessFactor 0.3;sheenRoughnessFactor 0",
        ),
        (
            "material",
            metal.to_owned() + &extension("KHR_materials_anisotropy", "\"anisotropyStrength\": 0.5"),
            "anisotropyRotation 0.3;anisotropyRotation 0",
        ),
        (
            "material",
            "\"emissiveFactor\": [1, 0, 0], ".to_owned()
                + &extension("KHR_materials_emissive_strength", "\"extras\": 0"),
            "emissiveStrength 2;emissiveStrength 1",
        ),
        (
            "material",
            extension("KHR_materials_pbrSpecularGlossiness", "\"extras\": 0"),
            "specularFactor [0.5,1,1];specularFactor [1,1,1]",
        ),
        (
            "material",
            extension("KHR_materials_pbrSpecularGlossiness", "\"specularFactor\": [0.2, 0.2, 0.2]"),
            "diffuseFactor [0.5,1,1,1]|glossinessFactor 0.3;diffuseFactor [1,1,1,1]|glossinessFactor 1",
        ),
        (
            "material",
            metal.replace('1', "0")
                + &extension("KHR_materials_transmission", "\"transmissionFactor\": 1").replace(
                    '@',
                    "}, \"KHR_materials_volume\": {\"thicknessFactor\": 1, \
                     \"attenuationColor\": [0.5, 1, 1]@",
                ),
            "attenuationDistance 3|attenuationDistance 4",
        ),
        ("light", light("point"), "color [1,0,0]|intensity 3;color [1,1,1]|intensity 1"),
        ("light", light("directional"), "color [1,0,0]|intensity 3;color [1,1,1]|intensity 1"),
        (
            "light",
            light("spot").replace('@', ", \"spot\": {\"extras\": 0@}"),
            "innerConeAngle 0.3|outerConeAngle 1;innerConeAngle 0|outerConeAngle 0.7853981633974483",
        ),
        (
            "camera",
            "\"yfov\": 0.5, \"znear\": 0.1@".to_owned(),
            "aspectRatio 0.5|aspectRatio 2;zfar 9",
        ),
    ];
    let folder = Folder::new();
    for (part, object, members) in groups {
        let read = |member: &str| {
            let (name, value) = member.trim().split_once(' ').unwrap_or_default();
            let stated = format!(", \"{name}\": {value}");
            let own = object.replace('@', if name.is_empty() { "" } else { &stated });
            let own =
                |of: &str, other: &str| if of == part { own.clone() } else { other.to_owned() };
            let light = own("light", "\"type\": \"point\"");
            let camera = own("camera", "\"yfov\": 1, \"znear\": 0.1");
            let nodes =
                r#"{"mesh": 0, "camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}"#;
            let rest = format!(
                ", \"extensions\": {{\"KHR_lights_punctual\": {{\"lights\": [{{{light}}}]}}}}, \
                \"cameras\": [{{\"type\": \"perspective\", \"perspective\": {{{camera}}}}}]"
            );
            let material = format!("{{{}}}", own("material", ""));
            let text = gltf(nodes, &material, ", \"material\": 0", &rest);
            Scene::load(&folder.write("a.gltf", text)).expect(member)
        };
        assert_each_counts(&object, members, read);
    }
}

#[test]
fn images_in_buffers_are_read_and_broken_ones_are_warnings() {
    let folder = Folder::new();
    let image = png([[1, 2, 3, 255], [4, 5, 6, 255]]);
    let attributes = [positions(), Attribute("_IMAGE", 5121, "SCALAR", false, image)];
    let material =
        r#"{"name": "wood", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#;
    let load = |images: &str| {
        let rest = format!(r#", "images": [{images}], "textures": [{{"source": 0}}]"#);
        let mut warnings = Vec::new();
        let path = folder.write("a.gltf", gltf_of(&attributes, 3, material, &rest));
        let mesh = Mesh::read(&path, &mut warnings);
        mesh.map(|mesh| (mesh.materials[0].material.surface.color.clone(), warnings))
    };
    let (color, warnings) = load(r#"{"bufferView": 1, "mimeType": "image/png"}"#).unwrap();
    assert!(color.is_some() && warnings.is_empty(), "{warnings:?}");
    for broken in [
        r#"{"bufferView": 0, "mimeType": "image/png"}"#,
        r#"{"uri": "data:image/png;base64,AAAA"}"#,
        r#"{"uri": "lost.png"}"#,
    ] {
        let (color, warnings) = load(broken).unwrap();
        assert!(color.is_none(), "{broken}");
        let expected = "rendered without this texture (material `wood`)";
        assert!(warnings.len() == 1 && warnings[0].contains(expected), "{warnings:?}");
    }
    let (color, warnings) = load(r#"{"uri": "../secret.png"}"#).unwrap();
    assert!(color.is_none() && warnings[0].contains("`../secret.png` leads out of that folder"));
}

#[test]
fn a_texture_without_an_image_that_is_read_ends_the_file() {
    let folder = Folder::new();
    let material =
        r#"{"name": "wood", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#;
    let load = |texture: &str| {
        let rest = format!(
            r#", "images": [{{"uri": "a.png"}}], "extensionsRequired": ["KHR_texture_basisu"],
            "textures": [{{{texture}"extensions": {{"KHR_texture_basisu": {{"source": 0}}}}}}]"#
        );
        Mesh::read(
            &folder.write("a.gltf", gltf_of(&[positions()], 3, material, &rest)),
            &mut Vec::new(),
        )
    };
    folder.write("a.png", png([[255; 4]; 2]));
    let message = load("").unwrap_err().to_string();
    assert!(message.contains("material `wood`") && message.contains("ktxdecompress"), "{message}");
    let mesh = load(r#""source": 0, "#).unwrap();
    assert!(mesh.materials[0].material.surface.color.is_some());

    let old =
        gltf(r#"{"mesh": 0}"#, "", "", "").replace(r#""version": "2.0""#, r#""version": "1.0""#);
    let message =
        Mesh::read(&folder.write("b.gltf", old), &mut Vec::new()).unwrap_err().to_string();
    assert!(message.contains("`asset.version`: expected 2.0, found 1.0"), "{message}");
}

#[test]
fn specular_glossiness_is_converted_texel_by_texel() {
    let folder = Folder::new();
    // A matt red, and silver of half the gloss.
    folder.write("d.png", png([[200, 20, 20, 255], [0, 0, 0, 128]]));
    folder.write("s.png", png([[0, 0, 0, 0], [230, 230, 230, 128]]));
    let rest = r#", "images": [{"uri": "d.png"}, {"uri": "s.png"}],
        "textures": [{"source": 0}, {"source": 1}]"#;
    let material = |transform: &str| {
        format!(
            r#"{{"extensions": {{"KHR_materials_pbrSpecularGlossiness": {{
            "diffuseTexture": {{"index": 0}},
            "specularGlossinessTexture": {{"index": 1{transform}}}}}}}}}"#
        )
    };
    let (found, warnings) = gltf_material(&folder, &material(""), rest);
    assert!(warnings.is_empty(), "{warnings:?}");
    let values = |used: &Option<TextureUse>| used.as_ref().unwrap().values();
    let surface = &found.surface;
    let (color, metallic) = (values(&surface.color), values(&surface.metallic));
    let roughness = values(&surface.roughness);
    assert!((metallic[0][0], roughness[0][0]) == (0.0, 1.0), "{metallic:?} {roughness:?}");
    assert!(metallic[1][0] > 0.99 && (roughness[1][0] - 0.5).abs() < 0.01, "{metallic:?}");
    // 200 and 230 in linear light; the coat of 0.04 takes its share from below.
    assert!((color[0][0] - 0.578 / 0.96).abs() < 0.01 && color[0][1] < 0.01, "{color:?}");
    assert!((color[1][0] - 0.791).abs() < 0.01, "{color:?}");
    assert!(color[0][3] == 1.0 && (color[1][3] - 0.502).abs() < 0.01, "{color:?}");

    let kind = &found.kind;
    assert!(
        matches!(kind, MaterialKind::Principled(Principled { roughness: 1.0, .. })),
        "{kind:?}"
    );

    // The larger image sets the texels: the others are read at the middles of those.
    let specular = image::RgbaImage::from_pixel(4, 1, image::Rgba([230, 230, 230, 128]));
    specular.save(folder.path().join("wide.png")).unwrap();
    let (found, _) = gltf_material(&folder, &material(""), &rest.replace("s.png", "wide.png"));
    let opacity = values(&found.surface.color).iter().map(|color| color[3]).collect::<Vec<_>>();
    let expected = [0.75, 0.75, 0.25, 0.25].map(|left| left + (1.0 - left) * 128.0 / 255.0);
    assert!(opacity.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{opacity:?}");

    // On other coordinates the mean of the specular colour counts, and the diffuse image stays.
    let turned = r#", "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}"#;
    let (found, warnings) = gltf_material(&folder, &material(turned), rest);
    assert!(warnings[0].contains("its mean colour counts"), "{warnings:?}");
    let (color, metallic) = (values(&found.surface.color), values(&found.surface.metallic));
    assert!(metallic[1][0] > 0.99 && (color[1][0] - 0.5 * 0.791).abs() < 0.01, "{color:?}");
    let clamped = r#"{"source": 1, "sampler": 0}], "samplers": [{"wrapS": 33071}]"#;
    let clamped = rest.replace(r#"{"source": 1}]"#, clamped);
    let warnings = gltf_material(&folder, &material(""), &clamped).1;
    assert!(warnings[0].contains("its mean colour counts"), "{warnings:?}");
    // Half of a gloss of half: a roughness of three quarters.
    for transform in [turned, ""] {
        let dull = material(transform)
            .replace("Glossiness\": {", "Glossiness\": {\"glossinessFactor\": 0.5,");
        let roughness = values(&gltf_material(&folder, &dull, rest).0.surface.roughness);
        assert!((roughness[1][0] - 0.75).abs() < 0.01, "{roughness:?}");
    }
}

/// A grey material keeps its diffuse reflectance and its reflectance at normal incidence.
#[test]
fn greys_keep_both_reflectances() {
    let folder = Folder::new();
    folder.write("a.png", png([[255; 4]; 2]));
    let rest = r#", "images": [{"uri": "a.png"}], "textures": [{"source": 0}]"#;
    // One without a gloss stays what it is.
    for (diffuse, specular) in
        [(0.5, 0.04), (0.3, 0.2), (0.8, 0.5), (0.0, 0.9), (0.2, 0.06), (1.0, 0.0)]
    {
        let material = format!(
            r#"{{"extensions": {{"KHR_materials_pbrSpecularGlossiness": {{
            "diffuseFactor": [{diffuse}, {diffuse}, {diffuse}, 1],
            "specularFactor": [{specular}, {specular}, {specular}],
            "specularGlossinessTexture": {{"index": 0}}}}}}}}"#
        );
        let surface = gltf_material(&folder, &material, rest).0.surface;
        let [base, metallic] =
            [surface.color, surface.metallic].map(|used| used.unwrap().values()[0][0]);
        if specular == 0.0 {
            assert_eq!(metallic, 0.0);
            continue;
        }
        let below = base * (1.0 - metallic) * 0.96;
        let normal = 0.04 + (base - 0.04) * metallic;
        let expected = diffuse * (1.0 - specular);
        assert!((below - expected).abs() < 0.02, "{diffuse} {specular}: {below}");
        assert!((normal - specular).abs() < 0.02, "{diffuse} {specular}: {normal}");
    }
}

#[test]
fn transmission_by_texture_is_glass_where_it_says_so() {
    let folder = Folder::new();
    folder.write("t.png", png([[255, 0, 0, 255], [0, 0, 0, 255]]));
    let rest = r#", "images": [{"uri": "t.png"}],
        "samplers": [{"wrapS": 33071, "magFilter": 9728}], "textures": [{"source": 0, "sampler": 0}]"#;
    let material = r#"{"name": "lamp", "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
        "extensions": {"KHR_materials_transmission":
            {"transmissionFactor": 1, "transmissionTexture": {"index": 0}}}}"#;
    // The first triangle lies on the left texel, the second on the right one.
    let corners = [&CORNERS[..], &CORNERS.map(|coordinate| coordinate + 2.0)].concat();
    let uvs = [0.1, 0.5, 0.2, 0.5, 0.1, 0.6, 0.8, 0.5, 0.9, 0.5, 0.8, 0.6];
    let attributes = [
        Attribute::floats("POSITION", "VEC3", &corners),
        Attribute::floats("TEXCOORD_0", "VEC2", &uvs),
    ];
    let path = folder.write("a.gltf", gltf_of(&attributes, 6, material, rest));
    let scene = Scene::load(&path).unwrap();
    let of = |x: f32| {
        let is_there =
            |triangle: &&[u32; 3]| scene.geometry.positions[triangle[0] as usize][0] == x;
        let at = scene.geometry.triangles.iter().position(|triangle| is_there(&triangle)).unwrap();
        &scene.materials[scene.geometry.materials[at] as usize]
    };
    assert!(matches!(of(0.0).kind, MaterialKind::ThinDielectric { .. }), "{:?}", of(0.0));
    assert!(matches!(of(2.0).kind, MaterialKind::Principled(_)), "{:?}", of(2.0));
    assert_eq!((of(0.0).name.as_str(), of(2.0).name.as_str()), ("lamp, glass", "lamp"));
    let is_named = |text: &&String| text.contains("glass or opaque by its mean there");
    assert_eq!(scene.warnings.iter().filter(is_named).count(), 1, "{:?}", scene.warnings);

    let unlit =
        material.replace("\"extensions\": {", "\"extensions\": {\"KHR_materials_unlit\": {}, ");
    let path = folder.write("c.gltf", gltf_of(&attributes, 6, &unlit, rest));
    assert!(Scene::load(&path).unwrap().materials.iter().all(|own| own.name != "lamp, glass"));

    // Factor times texel is less than half.
    folder.write("t.png", png([[150, 0, 0, 255], [0, 0, 0, 255]]));
    let weak = material.replace("\"transmissionFactor\": 1", "\"transmissionFactor\": 0.8");
    let scene = Scene::load(&folder.write("b.gltf", gltf_of(&attributes, 6, &weak, rest))).unwrap();
    assert!(scene.materials.iter().all(|material| !material.kind.is_glass()));
}

/// A wall of two faces on the same points: each side shows its own.
#[test]
fn faces_back_to_back_look_their_own_way() {
    let folder = Folder::new();
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl front\nf 1 2 3\nusemtl back\nf 3 2 1\n";
    let mut warnings = Vec::new();
    let mesh = Mesh::read(&folder.write("wall.obj", text), &mut warnings).unwrap();
    let height = |triangle: usize| mesh.positions[mesh.triangles[triangle][0] as usize][2];
    assert!(height(0) > 0.0 && height(1) < 0.0 && height(0) < 1e-4, "{:?}", mesh.positions);
    assert!(warnings.iter().any(|text| text.contains("1 pairs of triangles lie back to back")));
}

/// Steps by which triangles of different materials stand above z = 0, and warnings. The first two materials
/// are opaque, the third lets half the light through, the fourth is glass. As many as `sharing` after the
/// first triangle have the material of the one before.
fn heights(triangles: &[[u8; 3]], is_culled: bool, sharing: usize) -> (Vec<f32>, Vec<String>) {
    let folder = Folder::new();
    let corners = [5.0, 0.0, 0.0, 6.0, 0.0, 0.0, 5.0, 1.0, 0.0, 5.0, 0.0, -0.0];
    let bytes = [floats(&corners), triangles.concat()].concat();
    let all =
        |of: &dyn Fn(usize) -> String| (0..triangles.len()).map(of).collect::<Vec<_>>().join(", ");
    let primitives = all(&|at| {
        format!(
            r#"{{"attributes": {{"POSITION": 0}}, "indices": {}, "material": {}}}"#,
            at + 1,
            at.saturating_sub(sharing)
        )
    });
    let indices = all(&|at| {
        let first = 3 * at;
        format!(
            r#"{{"bufferView": 1, "byteOffset": {first}, "componentType": 5121, "count": 3,
            "type": "SCALAR"}}"#
        )
    });
    let materials = all(&|at| {
        let (alpha, transmission) = (["1", "1", "0.5", "1"][at], u8::from(at == 3));
        format!(
            r#"{{"doubleSided": {}, "alphaMode": "BLEND", "pbrMetallicRoughness":
            {{"baseColorFactor": [1, 1, 1, {alpha}], "metallicFactor": 0}}, "extensions":
            {{"KHR_materials_transmission": {{"transmissionFactor": {transmission}}}}}}}"#,
            !is_culled
        )
    });
    let (count, length, inline) = (triangles.len() * 3, bytes.len(), base64(&bytes));
    let text = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "materials": [{materials}], "meshes": [{{"primitives": [{primitives}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
            "min": [5, 0, 0], "max": [6, 1, 0]}}, {indices}],
        "bufferViews": [{{"buffer": 0, "byteLength": 48}},
            {{"buffer": 0, "byteOffset": 48, "byteLength": {count}}}],
        "buffers": [{{"byteLength": {length}, "uri": "data:;base64,{inline}"}}]}}"#
    );
    let mut warnings = Vec::new();
    let mesh = Mesh::read(&folder.write("a.gltf", text), &mut warnings).unwrap();
    mesh.check().unwrap();
    let height = |triangle: &[u32; 3]| {
        // A step is 1.2e-5 of the largest coordinate, rounded up to a power of two.
        let [a, b, c] = triangle.map(|at| mesh.positions[at as usize][2] / (8.0 * 1.2e-5));
        assert_eq!((a, b), (b, c));
        a
    };
    (mesh.triangles.iter().map(height).collect(), warnings)
}

#[test]
fn faces_back_to_back_part_and_layers_rise() {
    let (front, back) = ([0, 1, 2], [2, 1, 3]);
    assert_eq!(heights(&[front, back], true, 0), (vec![1.0, -1.0], vec![]));
    let (found, warnings) = heights(&[front, back], false, 0);
    assert_eq!(found, [1.0, -1.0]);
    assert!(warnings[0].contains("1 pairs of triangles lie back to back"), "{warnings:?}");
    let (found, warnings) = heights(&[front, [1, 2, 3]], true, 0);
    assert_eq!(found, [0.0, 0.0]);
    assert!(warnings[0].contains("1 triangles lie on others"), "{warnings:?}");
    assert_eq!(heights(&[front, back, front, back], true, 0).0, [1.0, -1.0, 2.0, -2.0]);
    // One material, beside another elsewhere.
    let shared = heights(&[front, back, [0, 3, 1]], false, 1);
    assert_eq!(shared, (vec![0.0; 3], vec![]));
    // Another place, and no area.
    assert_eq!(heights(&[front, [0, 3, 1]], false, 0), (vec![0.0, 0.0], vec![]));
}

#[test]
fn quantized_attributes_are_numbers() {
    let words = |words: &[i16]| words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let attributes = [
        Attribute("POSITION", 5122, "VEC3", false, words(&[0, 0, 0, 300, 0, 0, 0, -7, 0])),
        Attribute("NORMAL", 5120, "VEC3", true, vec![0, 0, 127, 0, 0, 127, 0, 128, 0]),
        Attribute("TEXCOORD_0", 5123, "VEC2", true, words(&[0, -1, -1, 0, 0, 0])),
        Attribute("COLOR_0", 5121, "VEC4", true, vec![255, 51, 0, 102, 0, 0, 0, 0, 0, 0, 0, 51]),
    ];
    let rest = r#", "extensionsRequired": ["KHR_mesh_quantization"]"#;
    let folder = Folder::new();
    let load = |material: &str| {
        let path = folder.write("a.gltf", gltf_of(&attributes, 3, material, rest));
        Mesh::read(&path, &mut Vec::new()).unwrap()
    };
    let mesh = load(r#"{"alphaMode": "BLEND"}"#);
    assert_eq!(mesh.positions, [[0.0; 3], [300.0, 0.0, 0.0], [0.0, -7.0, 0.0]]);
    assert_eq!(mesh.normals, [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]);
    assert_eq!(mesh.uvs[0], [[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    assert_eq!(mesh.colors[0], [1.0, 0.2, 0.0, 0.4]);
    assert!(mesh.materials[0].material.surface.vertex_color);
    let masked = load(r#"{"alphaMode": "MASK"}"#);
    assert_eq!(masked.colors[0], mesh.colors[0]);
    assert_eq!(masked.materials[0].material.surface.opacity.cutoff, Some(0.5));
    for opaque in ["{}", ""] {
        assert_eq!(load(opaque).colors[2], [0.0, 0.0, 0.0, 1.0], "opaque: `{opaque}`");
    }
    let bare = [
        Attribute::floats("POSITION", "VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        Attribute::floats("COLOR_0", "VEC3", &[0.5, 0.25, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]),
    ];
    let path = folder.write("a.gltf", gltf_of(&bare, 3, r#"{"alphaMode": "BLEND"}"#, ""));
    let mesh = Mesh::read(&path, &mut Vec::new()).unwrap();
    assert_eq!(mesh.colors[0], [0.5, 0.25, 0.0, 1.0], "opaque without a fourth number");
}

/// The last normal ends with the buffer, 12 bytes before a whole stride does.
#[test]
fn positions_and_normals_may_lie_by_turns() {
    let corners = CORNERS.as_chunks::<3>().0;
    let by_turns: Vec<f32> =
        corners.iter().flat_map(|&[x, y, z]| [x, y, z, 0.0, 0.6, 0.8]).collect();
    let attributes = [
        Attribute::floats("POSITION", "VEC3", &by_turns),
        Attribute::floats("NORMAL", "VEC3", &[0.0; 9]),
    ];
    let text = gltf_of(&attributes, 3, "", "")
        .replace("\"byteLength\": 72}", "\"byteLength\": 72, \"byteStride\": 24}")
        .replace("\"bufferView\": 1", "\"bufferView\": 0, \"byteOffset\": 12");
    let folder = Folder::new();
    let mesh = Mesh::read(&folder.write("a.gltf", text), &mut Vec::new()).unwrap();
    assert_eq!((&mesh.positions[..], &mesh.normals[..]), (corners, &[[0.0, 0.6, 0.8]; 3][..]));
}

#[test]
fn sparse_accessors_replace_elements_of_a_view_or_of_zeros() {
    let text = gltf(r#"{"mesh": 0}"#, "", "", "");
    let sparse = r#"{"sparse": {"count": 1, "indices": {"bufferView": 2, "componentType": 5121},
        "values": {"bufferView": 1}}, "componentType""#;
    let view = r#"{"bufferView": 0, "componentType""#;
    for (sparse, last) in
        [(sparse.to_owned(), 0.0), (sparse.replace("{\"sp", "{\"bufferView\": 0, \"sp"), 1.0)]
    {
        let folder = Folder::new();
        let path = folder.write("a.gltf", text.replace(view, &sparse));
        let mesh = Mesh::read(&path, &mut Vec::new()).unwrap();
        assert_eq!(mesh.positions, [[0.0; 3], [0.0, 0.0, 7.0], [0.0, last, 0.0]]);
    }
    // Indices of two bytes, 0 and 1, and values lie behind others.
    let places = [2_u16, 0, 1].map(u16::to_le_bytes).concat();
    let attributes = [
        positions(),
        Attribute("_PLACES", 5123, "SCALAR", false, places),
        Attribute::floats("_NEW", "VEC3", &[9.0, 9.0, 9.0, 4.0, 4.0, 4.0, 5.0, 5.0, 5.0]),
    ];
    let sparse = r#"{"sparse": {"count": 2, "indices": {"bufferView": 1, "byteOffset": 2,
        "componentType": 5123}, "values": {"bufferView": 2, "byteOffset": 12}}, "bufferView": 0"#;
    let text = gltf_of(&attributes, 3, "", "").replacen(r#"{"bufferView": 0"#, sparse, 1);
    let mesh = Mesh::read(&Folder::new().write("a.gltf", text), &mut Vec::new()).unwrap();
    assert_eq!(mesh.positions[..2], [[4.0; 3], [5.0; 3]]);
}

/// Quaternions need not have the length 1.
#[test]
fn instances_of_a_node_are_stretched_then_turned_then_shifted() {
    let attributes = [
        positions(),
        Attribute::floats("_SHIFTS", "VEC3", &[5.0, 6.0, 7.0].repeat(3)),
        Attribute::floats("_TURNS", "VEC4", &[0.0, 0.0, 2.0, 2.0].repeat(3)),
        Attribute::floats("_SIZES", "VEC3", &[2.0, 3.0, 4.0].repeat(3)),
    ];
    let nodes = r#"[{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes":
        {"TRANSLATION": 1, "ROTATION": 2, "SCALE": 3}}}}]"#;
    let text = gltf_of(&attributes, 3, "", "").replace(r#"[{"mesh": 0}]"#, nodes);
    let mesh = Mesh::read(&Folder::new().write("a.gltf", text), &mut Vec::new()).unwrap();
    let expected = [[5.0, 6.0, 7.0], [5.0, 8.0, 7.0], [2.0, 6.0, 7.0]].repeat(3);
    for (found, expected) in mesh.positions.iter().zip(&expected) {
        assert!(Vec3::from(*found).abs_diff_eq(Vec3::from(*expected), 1e-5), "{found:?}");
    }
    assert_eq!(mesh.positions.len(), expected.len());
}

#[test]
fn normals_stand_on_stretched_surfaces() {
    let attributes = [positions(), Attribute::floats("NORMAL", "VEC3", &[1.0, 0.0, 0.0].repeat(3))];
    // An eighth of a turn about z, then twice as wide: the line along (−1, 1) becomes (−2, 1).
    let nodes = r#"[{"children": [1], "scale": [2, 1, 1]},
        {"mesh": 0, "rotation": [0, 0, 0.38268343, 0.92387953]}]"#;
    let text = gltf_of(&attributes, 3, "", "").replace(r#"[{"mesh": 0}]"#, nodes);
    let folder = Folder::new();
    let mesh = Mesh::read(&folder.write("a.gltf", text), &mut Vec::new()).unwrap();
    let expected = Vec3::new(1.0, 2.0, 0.0).normalize().to_array();
    assert!(close(mesh.normals[0].into(), expected), "{:?}", mesh.normals);
}

#[test]
fn morph_targets_move_vertices_by_their_weights() {
    let target = [0.0, 0.0, 2.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0];
    let attributes = [
        positions(),
        Attribute::floats("_TARGET", "VEC3", &target),
        Attribute::floats("NORMAL", "VEC3", &[0.0, 1.0, 0.0].repeat(3)),
        Attribute::floats("TANGENT", "VEC4", &[1.0, 0.0, 0.0, -1.0].repeat(3)),
    ];
    let text = gltf_of(&attributes, 3, "", "");
    let targets = r#""targets": [{"POSITION": 1, "NORMAL": 1, "TANGENT": 1}]"#;
    let text = text.replace("}}]}]", &format!("}}, {targets}}}], \"weights\": [0.5]}}]"));
    let of_node = text.replace(r#"[{"mesh": 0}]"#, r#"[{"mesh": 0, "weights": [0.25]}]"#);
    let folder = Folder::new();
    for (text, weight) in [(text, 0.5), (of_node.clone(), 0.25)] {
        let mut warnings = Vec::new();
        let mesh = Mesh::read(&folder.write("a.gltf", text), &mut warnings).unwrap();
        let moved = [[0.0, 0.0, 2.0 * weight], [1.0, 0.0, 4.0 * weight], [0.0, 1.0, 0.0]];
        assert_eq!(mesh.positions, moved);
        let normal = Vec3::new(0.0, 1.0, 4.0 * weight).normalize();
        assert!(close(normal, mesh.normals[1]), "{:?}", mesh.normals);
        let ([x, y, z, sign], along) = (mesh.tangents[1], Vec3::new(1.0, 0.0, 4.0 * weight));
        assert!(close(along.normalize(), [x, y, z]) && sign == -1.0, "{:?}", mesh.tangents);
        assert!(warnings.is_empty(), "{warnings:?}");
    }
    let mut warnings = Vec::new();
    let path = folder.write("a.gltf", of_node.replace("{\"POSITION\": 1,", "{\"TEXCOORD_0\": 1,"));
    Mesh::read(&path, &mut warnings).unwrap();
    let expected = "ignored colours and texture coordinates of morph targets (mesh 0)";
    assert!(matches!(&warnings[..], [one] if one.contains(expected)), "{warnings:?}");
}

#[test]
fn joints_carry_the_vertices_of_a_skin() {
    let shift = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
    let twice = [2.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let joints = vec![0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
    // Those of the second vertex add up to a half: their ratio counts.
    let weights = [1.0, 0.0, 0.0, 0.0, 0.25, 0.25, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0];
    let attributes = [
        positions(),
        Attribute("JOINTS_0", 5121, "VEC4", false, joints),
        Attribute::floats("WEIGHTS_0", "VEC4", &weights),
        Attribute::floats("_BINDS", "MAT4", &[shift, twice, twice].concat()),
        Attribute::floats("NORMAL", "VEC3", &[0.6, 0.8, 0.0].repeat(3)),
        Attribute::floats("TANGENT", "VEC4", &[0.8, -0.6, 0.0, -1.0].repeat(3)),
        // A second set carries the last vertex as much as the first.
        Attribute("JOINTS_1", 5121, "VEC4", false, vec![0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]),
        Attribute::floats("WEIGHTS_1", "VEC4", &[0., 0., 0., 0., 0., 0., 0., 0., 0.5, 0., 0., 0.]),
    ];
    let skins = r#", "skins": [{"joints": [1, 2], "inverseBindMatrices": 3}]"#;
    let nodes = r#""nodes": [{"mesh": 0, "skin": 0, "translation": [9, 9, 9]},
        {"translation": [2, 0, 0], "children": [2]}, {"translation": [0, 0, 4]}]"#;
    let text = gltf_of(&attributes, 3, "", skins)
        .replace(r#""nodes": [{"mesh": 0}]"#, nodes)
        .replace(r#"[{"nodes": [0]}]"#, r#"[{"nodes": [0, 1]}]"#);
    let folder = Folder::new();
    let read = |text: String| Mesh::read(&folder.write("a.gltf", text), &mut Vec::new());
    let mesh = read(text.clone()).unwrap();
    assert_eq!(mesh.positions, [[2.0, 1.0, 0.0], [3.5, 0.5, 2.0], [2.0, 3.0, 2.0]]);
    // The second vertex is stretched by 1.5 and by 2.5: its normal still stands on its tangent.
    let unit = |[x, y, z]: [f32; 3]| Vec3::new(x, y, z).normalize();
    assert!(close(unit(mesh.normals[1]), unit([0.6 / 1.5, 0.8 / 2.5, 0.0]).to_array()));
    let [x, y, z, sign] = mesh.tangents[1];
    assert!(close(unit([x, y, z]), unit([0.8 * 1.5, -0.6 * 2.5, 0.0]).to_array()) && sign == -1.0);
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    // Joints that are not seen carry all the same.
    let hidden = r#"{"extensions": {"KHR_node_visibility": {"visible": false}}, "translation": [2"#;
    let hidden = read(text.replace(r#"{"translation": [2"#, hidden)).unwrap();
    assert_eq!(hidden.positions, mesh.positions);
    // Joints that mirror turn triangles and bitangents.
    let mirrored =
        read(text.replace("\"translation\": [2, 0, 0]", "\"scale\": [-1, 1, 1]")).unwrap();
    assert_eq!((mirrored.triangles[0], mirrored.tangents[1][3]), ([0, 2, 1], 1.0));
    let found = read(text.replace("[1, 2], \"inverse", "[1], \"inverse")).unwrap_err().to_string();
    assert!(found.contains("vertex 1: joint 1 is out of range, the skin has 1"), "{found}");
}

#[test]
fn normal_maps_without_tangents_get_them() {
    let folder = Folder::new();
    folder.write("n.png", png([[128, 128, 255, 255]; 2]));
    let rest = r#", "images": [{"uri": "n.png"}], "textures": [{"source": 0}]"#;
    let uvs = || Attribute::floats("TEXCOORD_0", "VEC2", &COORDINATES);
    let material = r#"{"normalTexture": {"index": 0}}"#;
    let read = |attributes: &[Attribute], material: &str| {
        let path = folder.write("a.gltf", gltf_of(attributes, 3, material, rest));
        Mesh::read(&path, &mut Vec::new()).unwrap()
    };
    // u runs along +X, and up in the image, against v, along +Y = n × t.
    let mesh = read(&[positions(), uvs()], material);
    assert_eq!(mesh.tangents, [[1.0, 0.0, 0.0, 1.0]; 3]);
    // A mirrored image turns tangent and sign.
    let mirrored: Vec<f32> = COORDINATES
        .iter()
        .enumerate()
        .map(|(i, c)| if i % 2 == 0 { 1.0 - c } else { *c })
        .collect();
    let mirrored = Attribute::floats("TEXCOORD_0", "VEC2", &mirrored);
    let mesh = read(&[positions(), mirrored], material);
    assert_eq!(mesh.tangents, [[-1.0, 0.0, 0.0, -1.0]; 3]);
    // Tangents of the file stay, and no normal map needs none.
    let stored = Attribute::floats("TANGENT", "VEC4", &[0.0, 1.0, 0.0, -1.0].repeat(3));
    assert_eq!(read(&[positions(), uvs(), stored], material).tangents[0], [0.0, 1.0, 0.0, -1.0]);
    let mut some = [0.0, 1.0, 0.0, -1.0].repeat(3);
    some[..4].fill(0.0);
    let some = Attribute::floats("TANGENT", "VEC4", &some);
    let mesh = read(&[positions(), uvs(), some], material);
    assert_eq!((mesh.tangents.len(), mesh.tangents[0][..3].to_vec()), (3, vec![0.0; 3]));
    assert!(read(&[positions(), uvs()], "{}").tangents.is_empty());

    // An OBJ file counts v from below, and may name normals under the key of heights. Two triangles share
    // an edge with its vertices and mirror the image there, so that the vertices of the edge are repeated.
    for key in ["norm", "map_Bump"] {
        folder.write("a.mtl", format!("newmtl bumpy\n{key} -bm 0.5 n.png\n"));
        let text = "mtllib a.mtl\nusemtl bumpy\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv -1 0 0\n\
            vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/2/1\n";
        let mesh = Mesh::read(&folder.write("a.obj", text), &mut Vec::new()).unwrap();
        assert_eq!(mesh.positions.len(), 6);
        let tangents =
            |face: usize| mesh.triangles[face].map(|corner| mesh.tangents[corner as usize]);
        assert_eq!(tangents(0), [[1.0, 0.0, 0.0, 1.0]; 3]);
        assert_eq!(tangents(1), [[-1.0, 0.0, 0.0, -1.0]; 3]);
        assert_eq!(mesh.uvs[0].len(), 6);
        assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 6]);
        assert_eq!(mesh.materials[0].material.surface.normal_scale, 0.5, "{key}");
    }
}

#[test]
fn lights_of_nodes_become_lamps() {
    let light =
        |node: &str| format!(r#""extensions": {{"KHR_lights_punctual": {{"light": {node}}}}}"#);
    let nodes = format!(
        r#"{{"mesh": 0, "translation": [0, 2, 0], "children": [1, 2, 3]}},
        {{"name": "bulb", {}}}, {{"scale": [3, 3, 3], "rotation": [-0.70710678, 0, 0, 0.70710678], {}}},
        {{{}}}"#,
        light("0"),
        light("1"),
        light("2")
    );
    let rest = r#", "extensionsRequired": ["KHR_lights_punctual"], "extensions":
        {"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1, 0.5, 0], "intensity": 40},
        {"type": "spot", "name": "beam", "intensity": 2, "spot": {"innerConeAngle": 0.1}},
        {"type": "directional", "intensity": 3}]}}"#;
    let folder = Folder::new();
    let text = gltf(&nodes, "", "", rest);
    let scene = Scene::load(&folder.write("a.gltf", &text)).unwrap();
    assert_eq!(scene.warnings.len(), 2, "those on light and camera: {:?}", scene.warnings);
    let [sun, beam, bulb] = &scene.lamps[..] else { panic!("{:?}", scene.lamps) };
    let above = Vec3::new(0.0, 2.0, 0.0);
    assert_eq!((bulb.name.as_str(), beam.name.as_str()), ("bulb", "beam"));
    let intensity = Vec3::new(40.0, 20.0, 0.0);
    assert_eq!(bulb.kind, LampKind::Point { position: above, intensity });
    let direction = Vec3::NEG_Z;
    assert_eq!(sun.kind, LampKind::Directional { direction, irradiance: Vec3::splat(3.0) });
    let LampKind::Spot(spot) = beam.kind else { panic!("{beam:?}") };
    assert!(close(spot.direction, [0.0, -1.0, 0.0]), "{}", spot.direction);
    assert_eq!(
        (spot.position, spot.intensity, spot.inner_angle_rad),
        (above, Vec3::splat(2.0), 0.1)
    );
    assert_eq!(
        (spot.outer_angle_rad.to_degrees(), spot.falloff),
        (45.0, SpotFalloff::SquaredCosine)
    );
    let limited = text.replace("\"intensity\": 40", "\"intensity\": 40, \"range\": 5");
    let warnings = Scene::load(&folder.write("b.gltf", limited)).unwrap().warnings;
    let expected = "ignored range of lights (node `bulb`)";
    assert!(warnings.iter().any(|text| text.contains(expected)), "{warnings:?}");
    // The lamps are a part of the picture.
    let other = text.replace("\"intensity\": 3", "\"intensity\": 4");
    assert_ne!(Scene::load(&folder.write("b.gltf", other)).unwrap().hash, scene.hash);
    for (from, to, expected) in [
        ("\"light\": 2", "\"light\": 3", "node 3: the file has no light 3"),
        ("\"intensity\": 2", "\"intensity\": -2", "node 2: expected a light of finite colour"),
    ] {
        let path = folder.write("b.gltf", text.replace(from, to));
        let message = Scene::load(&path).unwrap_err().to_string();
        assert!(message.contains(expected), "expected {expected:?}, found {message}");
    }
}

/// three.js and Blender write equal angles for a sharp edge.
#[test]
fn lights_of_others_do_not_end_the_file() {
    let light = r#""extensions": {"KHR_lights_punctual": {"light": 0}}"#;
    let lamp = |lamp: &str| {
        let rest = format!(r#", "extensions": {{"KHR_lights_punctual": {{"lights": [{lamp}]}}}}"#);
        let text = gltf(&format!(r#"{{"mesh": 0, {light}}}"#), "", "", &rest);
        Scene::load(&Folder::new().write("a.gltf", text)).unwrap()
    };
    for (inner, outer, expected) in [(0.9, 0.9, 0.9), (0.5, 9.0, FRAC_PI_2), (0.9, 0.2, 0.2)] {
        let angles = format!(r#"{{"innerConeAngle": {inner}, "outerConeAngle": {outer}}}"#);
        let scene = lamp(&format!(r#"{{"type": "spot", "spot": {angles}}}"#));
        let LampKind::Spot(spot) = scene.lamps[0].kind else { panic!() };
        assert_eq!(spot.outer_angle_rad, expected);
        assert_eq!(spot.inner_angle_rad, f32::min(inner, 0.999 * expected));
        let is_named = scene.warnings.iter().any(|text| text.contains("ignored angles of spots"));
        assert_eq!(is_named, inner != outer, "{:?}", scene.warnings);
    }
    let scene = lamp(r#"{"type": "ambient"}"#);
    assert!(scene.lamps.is_empty());
    assert!(scene.warnings[0].contains("ignored lights of type \"ambient\" (node 0)"), "{scene:?}");
}

/// Documents as Blender, three.js, trimesh and others write them.
#[test]
fn what_the_format_leaves_open_is_completed() {
    let folder = Folder::new();
    let load = |text: &str| Scene::load(&folder.write("a.gltf", text)).unwrap();
    let whole = gltf(r#"{"mesh": 0}"#, "", "", "");
    let triangle = |scene: &Scene| scene.geometry.triangles.len() == 1;
    assert!(triangle(&load(&format!("\u{feff}{whole}"))));
    // An empty scene, null, and a channel that moves another part than a node.
    let one = r#""scenes": [{"nodes": [0]}]"#;
    let animation = r#""scenes": [{"nodes": [0]}, {}], "animations": [{"name": null, "channels":
        [{"sampler": 0, "target": {"path": "pointer"}}], "samplers": [{"input": 0, "output": 0}]}]"#;
    assert!(triangle(&load(&whole.replace(one, animation))));
    // Without scenes all nodes stand.
    let without = whole.replace(&format!("{one}, "), "");
    assert!(!without.contains("scenes") && triangle(&load(&without)));
    let parent = r#"{"children": [1], "translation": [5, 0, 0]}, {"mesh": 0}"#;
    let child = load(&gltf(parent, "", "", "").replace(&format!("{one}, "), ""));
    assert!(triangle(&child) && child.geometry.positions.iter().all(|point| point[0] >= 5.0));
    let without = whole.replace(r#""min": [0, 0, 0], "max": [1, 1, 0]"#, r#""name": "corners""#);
    assert!(!without.contains("min") && triangle(&load(&without)));
    let zeros = whole.replace(
        r#"{"bufferView": 1, "componentType": 5126, "count": 1"#,
        r#"{"componentType": 5126, "count": 3"#,
    );
    let zeros = zeros.replace(r#""POSITION": 0"#, r#""POSITION": 0, "NORMAL": 1"#);
    assert_eq!(load(&zeros).geometry.normals, [[0.0; 3]; 3]);
    // Attributes that a part has not, after one that has them.
    let parts = whole.replace(
        r#"{"attributes": {"POSITION": 0}"#,
        r#"{"attributes": {"POSITION": 0, "NORMAL": 0, "COLOR_0": 0}}, {"attributes": {"POSITION": 0}"#,
    );
    let parts = Mesh::read(&folder.write("a.gltf", parts), &mut Vec::new()).unwrap();
    assert_eq!(
        parts.normals[1..],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3], [0.0; 3], [0.0; 3]]
    );
    assert_eq!(parts.colors[2..], [[0.0, 1.0, 0.0, 1.0], [1.0; 4], [1.0; 4], [1.0; 4]]);
    let hidden = r#"{"mesh": 0}, {"mesh": 0, "children": [2], "extensions":
        {"KHR_node_visibility": {"visible": false}}}, {"mesh": 0}"#;
    let hidden = gltf(hidden, "", "", "");
    let hidden = load(&hidden.replace(one, r#""scenes": [{"nodes": [0, 1]}]"#));
    assert!(triangle(&hidden));
    assert!(hidden.warnings.iter().all(|text| !text.contains("ignored")), "{:?}", hidden.warnings);
    // A part without positions, and numbers that exporters write and nobody reads.
    let two = whole.replace(r#""primitives": ["#, r#""primitives": [{"attributes": {}}, "#);
    let odd =
        two.replace(r#""bufferViews": [{"#, r#""bufferViews": [{"target": 7, "byteStride": 0, "#);
    let odd = load(
        &odd.replace(one, &format!(r#""samplers": [{{"wrapS": 0, "magFilter": 9987}}], {one}"#)),
    );
    assert!(two != whole && triangle(&odd));
    assert!(odd.warnings.iter().any(|text| text.contains("points and lines (mesh `sail`)")));
    let idle = r#"{"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0},
        "KHR_materials_iridescence": {"iridescenceFactor": 0}, "KHR_materials_dispersion": {}}}"#;
    let (_, warnings) = gltf_material(&folder, idle, "");
    assert!(warnings.iter().all(|text| !text.contains("ignored")), "{warnings:?}");
    let (_, warnings) = gltf_material(
        &folder,
        &idle.replace("iridescenceFactor\": 0", "iridescenceFactor\": 1"),
        "",
    );
    assert!(warnings[0].contains("KHR_materials_iridescence"), "{warnings:?}");
}

#[test]
fn cloth_has_a_sheen() {
    let folder = Folder::new();
    folder.write("a.png", png([[10, 20, 30, 255], [40, 50, 60, 128]]));
    let rest = r#", "images": [{"uri": "a.png"}], "textures": [{"source": 0}]"#;
    let sheen = r#""KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.25, 0],
        "sheenRoughnessFactor": 0.5"#;
    let of = |more: &str| {
        let text = format!(r#"{{"extensions": {{{sheen}{more}}}}}"#);
        let (material, warnings) = gltf_material(&folder, &text, rest);
        let MaterialKind::Principled(own) = material.kind else { panic!() };
        (own.sheen_color, own.sheen_roughness, warnings)
    };
    assert_eq!(of("}"), (Vec3::new(0.5, 0.25, 0.0), 0.5, vec![]));
    let (_, roughness, warnings) = of(r#", "sheenRoughnessTexture": {"index": 0}}"#);
    assert!((roughness - 0.5 * 383.0 / 510.0).abs() < 1e-6, "{roughness}");
    assert!(warnings[0].contains("textures of `KHR_materials_sheen`"), "{warnings:?}");
    let (color, ..) = of(r#", "sheenColorTexture": {"index": 0}}"#);
    let linear = |byte: f32| ((byte / 255.0 + 0.055) / 1.055).powf(2.4);
    assert!((color.y - 0.125 * (linear(20.0) + linear(50.0))).abs() < 1e-5, "{color}");
    let (color, _, warnings) = of(r#"}, "KHR_materials_clearcoat": {"clearcoatFactor": 1}"#);
    assert_eq!(color, Vec3::ZERO);
    assert!(warnings[0].contains("sheen below a coat"), "{warnings:?}");
    let kind = |keys: &str| mtl_material(&folder, keys).0.kind;
    let MaterialKind::Principled(own) = kind("Kd 0.5\nPs 0.25") else { panic!() };
    assert_eq!((own.sheen_color, own.sheen_roughness), (Vec3::splat(0.25), 0.5));
    let MaterialKind::Principled(own) = kind("Kd 0.5\nPs 0.25\nPc 1") else { panic!() };
    assert_eq!((own.sheen_color, own.coat_weight), (Vec3::ZERO, 1.0));
}

#[test]
fn colours_of_vertices_without_a_material_are_seen() {
    let folder = Folder::new();
    let text = "v 0 0 0 1 0 0\nv 1 0 0 0 0.5 0\nv 0 1 0\nf 1 2 3\n";
    for (text, most) in [
        (text, 1.0),
        (&text.replace("0.5", "127.5").replace(" 1 0 0\nv 1", " 255 0 0\nv 1"), 255.0),
    ] {
        let scene = Scene::load(&folder.write("a.obj", text)).unwrap();
        let [r, g, b] = &scene.geometry.colors[..] else { panic!("{most}") };
        assert_eq!((*r, *b), ([1.0, 0.0, 0.0, 1.0], [1.0; 4]));
        // Value of the transfer function of IEC 61966-2-1.
        assert!((g[1] - 0.214_041).abs() < 1e-5 && g[0] == 0.0, "{g:?}");
        assert!(scene.materials[0].surface.vertex_color);
        assert!(
            scene.warnings.iter().all(|text| !text.contains("ignored")),
            "{:?}",
            scene.warnings
        );
    }
    // The least grey of a file of bytes is not white.
    let dark = text.replace("0 0.5 0", "1 1 1").replace(" 1 0 0\nv 1", " 255 0 0\nv 1");
    let colors = Scene::load(&folder.write("a.obj", dark)).unwrap().geometry.colors;
    assert!(colors[1][..3].iter().all(|channel| *channel < 1e-3), "{colors:?}");
    let colors = Attribute::floats("COLOR_0", "VEC3", &[0.5; 9]);
    let text = gltf_of(&[positions(), colors], 3, "", "");
    let scene = Scene::load(&folder.write("a.gltf", text)).unwrap();
    assert!(scene.materials[0].surface.vertex_color);
    assert_eq!(scene.geometry.colors, [[0.5, 0.5, 0.5, 1.0]; 3]);
    let text = "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let painted = "usemtl a\n".to_owned() + text;
    let scene = Scene::load(&folder.write("a.obj", painted)).unwrap();
    assert!(!scene.materials[0].surface.vertex_color);
    assert!(scene.warnings[1].contains("ignored vertex colours of faces"), "{:?}", scene.warnings);
}

/// Files of Blender, 3ds Max, VTK, and of programs on old Macs and on Windows.
#[test]
fn obj_files_of_others_are_read() {
    let folder = Folder::new();
    let reflectances = |obj: &[u8], mtl: &[u8]| {
        folder.write("A.mtl", mtl);
        let scene = Scene::load(&folder.write("a.obj", obj)).unwrap();
        let of = |index: &u32| match scene.materials[*index as usize].kind {
            MaterialKind::Diffuse { reflectance } => reflectance.x,
            _ => panic!("{scene:?}"),
        };
        (scene.geometry.materials.iter().map(of).collect::<Vec<_>>(), scene.warnings)
    };
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\n";
    let faces = "usemtl Mat #1 # wood\nf 1 2 3#\nusemtl Mat #2\nf 4 5 6\n";
    let library =
        "newmtl Mat #1\nKd 0.1 0 0\nPc 0\naniso 0\nNEWMTL Mat #2 # red\nKd 0.2 0 0 # dark\n";
    let text = format!("mtllib a.MTL\n{corners}{faces}");
    let (found, warnings) = reflectances(text.as_bytes(), library.as_bytes());
    assert_eq!(found, [0.1, 0.2]);
    assert!(warnings.iter().all(|text| !text.contains("ignored")), "{warnings:?}");
    // The library may come last, lines end in one character, and the first begins with a mark.
    let late = format!("\u{feff}{corners}{faces}mtllib \"C:\\me\\A.mtl\"").replace('\n', "\r");
    assert_eq!(
        reflectances(late.as_bytes(), format!("\u{feff}{library}").as_bytes()).0,
        [0.1, 0.2]
    );
    let latin = |text: &str| -> Vec<u8> { text.chars().map(|c| c as u8).collect() };
    let text = text.replace("Mat #1", "gr\u{fc}n").replace("Mat #2", "gr\u{e4}n");
    let names = library.replace("Mat #1", "gr\u{fc}n").replace("Mat #2", "gr\u{e4}n");
    assert_eq!(reflectances(&latin(&text), &latin(&names)).0, [0.1, 0.2]);
    // A comment goes on in no other line, and what is no number or no face is left out.
    let odd = format!("# a \\\n{corners}v -nan(ind) 0 -1.#IND\nf 1 2\nf 1/9 2/0 3//7\n");
    let (found, warnings) = reflectances(odd.as_bytes(), b"");
    assert_eq!(found, [0.5]);
    for expected in [
        "faces of fewer than three corners (line 9)",
        "texture coordinates that are not there (2, first in line 10)",
    ] {
        assert!(warnings.iter().any(|text| text.contains(expected)), "{expected}: {warnings:?}");
    }
    // Faces may stand above what they name, and old files have their own word for them.
    let late = "f 1/1/1 2/2/1 3/3/1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nfo -3 -1 -2\n\
        vt 0 1\nvn 0 0 1\n";
    let mut warnings = Vec::new();
    let mesh = Mesh::read(&folder.write("a.obj", late), &mut warnings).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(mesh.positions[4..], [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]);
    assert_eq!((mesh.uvs[0][2], mesh.normals[2]), ([0.0, 1.0], [0.0, 0.0, 1.0]));
    assert_eq!(warnings, [""; 0]);
    let wide: Vec<u8> = "v 0 0 0\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let path = folder.write("a.obj", [&b"\xff\xfe"[..], &wide].concat());
    assert!(Scene::load(&path).unwrap_err().to_string().contains("found UTF-16: save it as UTF-8"));
}

/// Surveyors write metres from an origin far away.
#[test]
fn a_scene_far_from_the_origin_is_named() {
    let folder = Folder::new();
    for (place, is_named) in [(4_649_776.0, true), (100.0, false)] {
        let corners = format!("v {place} 0 0\nv {} 0 0\nv {place} 3 0\nf 1 2 3\n", place + 3.0);
        let scene = Scene::load(&folder.write("a.obj", corners)).unwrap();
        let is_far =
            |text: &String| text.contains("have steps of 5.5") && text.contains("of 3e0: move");
        assert_eq!(scene.warnings.iter().any(is_far), is_named, "{:?}", scene.warnings);
    }
    let flat = "v 4649776 0 0\nv 4649776.1 0 0\nv 4649776 0.1 0\nf 1 2 3\n";
    let message = Scene::load(&folder.write("a.obj", flat)).unwrap_err().to_string();
    assert!(message.contains("found neither (") && message.contains("of zero area"), "{message}");
}

/// Loads an OBJ triangle with the only material of a library.
fn mtl_material(folder: &Folder, keys: &str) -> (Material, Vec<String>) {
    folder.write("a.mtl", format!("newmtl a\n{keys}\n"));
    let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\n\
        f 1/1 2/2 3/3\n";
    let mut warnings = Vec::new();
    let mesh = Mesh::read(&folder.write("a.obj", text), &mut warnings).unwrap();
    assert_eq!(mesh.uvs[0], [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    warnings.extend(mesh.ignored_in_materials(|_| false).warnings("a.obj".as_ref()));
    (mesh.materials[0].material.clone(), warnings)
}

#[test]
fn mtl_materials_become_surfaces() {
    let folder = Folder::new();
    folder.write("maps/leaf green.png", png([[10, 90, 10, 255], [0, 0, 0, 0]]));
    folder.write("grey.png", png([[128, 128, 128, 255]; 2]));
    // Transparent texels cut out; a black colour does not blacken its image.
    let keys = "Kd 0 0 0\nd 0.5\nmap_Kd -s 2 3 -o 0.5 0.25 -clamp on maps\\leaf green.png\n";
    let (found, warnings) = mtl_material(&folder, keys);
    assert!(warnings.is_empty(), "{warnings:?}");
    let MaterialKind::Diffuse { reflectance: Vec3::ONE } = found.kind else { panic!("{found:?}") };
    let color = found.surface.color.unwrap();
    assert_eq!(color.image_from_uv, [[2.0, 0.0, 0.5], [0.0, -3.0, 0.75]]);
    assert_eq!((color.wrap, color.encoding), ([Wrap::Clamp; 2], Encoding::Srgb));
    let opacity = found.surface.opacity;
    let texture = opacity.texture.unwrap();
    assert_eq!((opacity.factor, opacity.cutoff, texture.channels), (0.5, None, Channels::Alpha));
    assert_eq!(texture.image_from_uv, color.image_from_uv);
    let keys = "map_Kd maps/leaf green.png\nmap_d -mm 0.2 0.5 -imfchan g grey.png\nTr 0.75\n";
    let opacity = mtl_material(&folder, keys).0.surface.opacity;
    let texture = opacity.texture.unwrap();
    assert_eq!((opacity.factor, texture.channels), (0.25, Channels::Green));
    let (found, warnings) = mtl_material(&folder, "Tr 1");
    assert!(found.surface.opacity.factor == 1.0 && warnings[0].contains("`Tr 1`"), "{warnings:?}");
    assert_eq!(mtl_material(&folder, "d 0\nTr 1").0.surface.opacity.factor, 0.0);
    assert_eq!((texture.scale, texture.bias), ([0.5; 3], [0.2; 3]));

    // Exporters that write both mean `d`.
    assert_eq!(mtl_material(&folder, "Tr 0.5\nd 0.75").0.surface.opacity.factor, 0.75);

    let kind = |keys: &str| mtl_material(&folder, keys).0.kind;
    let pane = kind("Kd 0.5 1 1\nKs 1 1 1\nd 0.2\nNi 1.4\nillum 7");
    let MaterialKind::ThinDielectric { ior, transmittance, .. } = pane else { panic!("{pane:?}") };
    assert!(ior == 1.4 && close(transmittance, [0.9, 1.0, 1.0]), "{transmittance}");
    let keys = "Kd 0.5 1 1\nmap_Kd maps/leaf green.png\nd 0.2\nKs 1 1 1\nillum 7";
    let pane = mtl_material(&folder, keys).0;
    let MaterialKind::ThinDielectric { transmittance, .. } = pane.kind else { panic!("{pane:?}") };
    assert_eq!(transmittance, Vec3::ONE);
    let image = pane.surface.color.unwrap();
    assert!(close(image.scale.into(), [0.1, 0.2, 0.2]) && close(image.bias.into(), [0.8; 3]));
    let filtered = mtl_material(&folder, &format!("{keys}\nTf 0.1 0.2 0.3")).0;
    assert!(filtered.surface.color.is_none(), "{filtered:?}");
    let (_, warnings) = mtl_material(&folder, "Kd spectral a.rfl");
    assert!(warnings[0].contains("`Kd` that is no colour"), "{warnings:?}");
    let reflectance = Vec3::new(0.9, 0.8, 0.7);
    let mirror = kind("Kd 0 0 0\nKs 0.9 0.8 0.7\nillum 3");
    assert!(matches!(mirror, MaterialKind::Mirror { reflectance: found } if found == reflectance));
    // The Cornell boxes of the McGuire archive have mirrors and solid glass of a dark colour.
    let mirror = kind("Kd 0.01 0.01 0.01\nKs 0.95 0.95 0.95\nNs 1000\nillum 5");
    assert!(matches!(mirror, MaterialKind::Mirror { reflectance } if reflectance.x == 0.95));
    let (glass, warnings) = mtl_material(&folder, "Kd 0.01\nKs 0.3\nTf 0.25\nNi 1.33\nillum 7");
    let MaterialKind::Dielectric { ior, transmittance, .. } = glass.kind else {
        panic!("{glass:?}")
    };
    assert_eq!((ior, transmittance), (1.33, Vec3::splat(0.5)));
    assert_eq!(warnings, [""; 0]);
    for keys in [
        "Ks 0.5\nillum 3",
        "Ks 0.5\nillum 7\nd 0.8",
        "Ks 0.5",
        "Kd 0\nKs 0.5\nillum 2",
        "Kd 0\nKs 1\nillum 7",
        "Kd 0.1\nKs 1\nNi 1.5\nillum 7",
        "Kd 0\nKs 1\nNi 1.5\nillum 7\nd 0.8",
    ] {
        assert!(matches!(kind(keys), MaterialKind::Plastic { .. }), "{keys}");
    }
    let debug = |keys: &str| format!("{:?}", kind(keys));
    assert_eq!(debug("Ks 0.5\nNs -3"), debug("Ks 0.5"), "no exponent");
    let metal = kind("Kd 0.5\nPm 0.25");
    assert!(
        matches!(metal, MaterialKind::Principled(Principled { metallic: 0.25, .. })),
        "{metal:?}"
    );
    assert!(mtl_material(&folder, "Ke 0 0 0").0.surface.emission.is_none());
    let deep = image::ImageBuffer::from_pixel(1, 1, image::Rgba([9000_u16, 9000, 9000, 30_000]));
    deep.save(folder.path().join("deep.png")).unwrap();
    let surface = mtl_material(&folder, "map_Kd deep.png").0.surface;
    assert_eq!(surface.opacity.texture.map(|used| used.channels), Some(Channels::Alpha));
    let (found, _) = mtl_material(&folder, "Kd 0.5\nPr 0.3\nmap_Pm grey.png\nKs 1\nKe 2 1 0");
    let MaterialKind::Principled(Principled { metallic, roughness, .. }) = found.kind else {
        panic!()
    };
    assert_eq!((metallic, roughness), (1.0, 0.3));
    // The aspect is ½, a quarter of a turn further.
    let brushed = mtl_material(&folder, "Kd 0.5\nPr 0.4\naniso 0.8333333\nanisor 0.25").0;
    let MaterialKind::Principled(Principled { roughness, .. }) = brushed.kind else { panic!() };
    let [along, across] = brushed.surface.anisotropy.widths(roughness * roughness);
    assert!((along - 0.32).abs() < 1e-5 && (across - 0.08).abs() < 1e-5, "{along} {across}");
    assert_eq!(brushed.surface.anisotropy.rotation, FRAC_PI_2);
    // Fits have one lobe, of the mean width.
    let MaterialKind::Principled(mean) = brushed.mean_kind() else { panic!() };
    assert!((mean.roughness * mean.roughness - 0.2).abs() < 1e-5, "{}", mean.roughness);
    let coated = kind("Kd 0.5\nPc 0.5\nPcr 0.25");
    let MaterialKind::Principled(Principled { coat_weight, coat_roughness, .. }) = coated else {
        panic!("{coated:?}")
    };
    assert_eq!((coat_weight, coat_roughness), (0.5, 0.25));
    assert_eq!(found.surface.metallic.unwrap().encoding, Encoding::Linear);
    let emission = found.surface.emission.unwrap();
    assert_eq!((emission.radiance, emission.two_sided), (Vec3::new(2.0, 1.0, 0.0), true));
    // Exporters write a black factor beside an image.
    for keys in ["map_Ke grey.png", "Ke 0 0 0\nmap_Ke grey.png"] {
        let emission = mtl_material(&folder, keys).0.surface.emission.unwrap();
        assert_eq!(
            (emission.radiance, emission.texture.unwrap().encoding),
            (Vec3::ONE, Encoding::Srgb)
        );
    }
}

#[test]
fn opacities_above_one_are_one() {
    let folder = Folder::new();
    let mut image = Image::of_rgb(2, 1, &[[9.0; 3]; 2]);
    image.channels.insert("A".to_owned(), vec![0.5, 2.0]);
    image.write_exr(&folder.path().join("a.exr")).unwrap();
    let (found, warnings) = mtl_material(&folder, "map_Kd a.exr");
    let values = found.surface.color.unwrap().values();
    assert_eq!(values, [[9.0, 9.0, 9.0, 0.5], [9.0, 9.0, 9.0, 1.0]]);
    assert!(warnings[0].contains("1 values are above 65504, or opacities above 1"), "{warnings:?}");
    // Grey images have an opacity too.
    let grey = [("Y", vec![0.25, 4.0]), ("A", vec![0.5, 1.0])];
    image.channels = grey.map(|(name, values)| (name.to_owned(), values)).into();
    image.write_exr(&folder.path().join("a.exr")).unwrap();
    let values = mtl_material(&folder, "map_Kd a.exr").0.surface.color.unwrap().values();
    assert_eq!(values, [[0.25, 0.25, 0.25, 0.5], [4.0, 4.0, 4.0, 1.0]]);
}

#[test]
fn options_of_images_stand_before_names_with_spaces() {
    let folder = Folder::new();
    for name in ["my oak.png", "oak.png", "-oak.png", "2.png"] {
        folder.write(name, png([[128, 128, 255, 255]; 2]));
    }
    let options =
        "-s 2 3 1 -o 0.5 -clamp on -bm 0.3 -blendu off -blendv on -cc off -mm 0.1 0.8 -imfchan g";
    let (found, warnings) = mtl_material(&folder, &format!("norm {options} my oak.png"));
    assert!(warnings.len() == 1 && warnings[0].contains("option `-blendu`"), "{warnings:?}");
    let normal = found.surface.normal.unwrap();
    assert_eq!(normal.image_from_uv, [[2.0, 0.0, 0.5], [0.0, -3.0, 1.0]]);
    assert_eq!((normal.wrap, normal.channels), ([Wrap::Clamp; 2], Channels::Green));
    assert_eq!((normal.scale, normal.bias), ([0.8; 3], [0.1; 3]));
    assert_eq!(found.surface.normal_scale, 0.3);
    for name in ["oak.png", "-oak.png", "2.png", "-s 2 2.png"] {
        let color = mtl_material(&folder, &format!("map_Kd {name}")).0.surface.color.unwrap();
        let expected = folder.path().join(name.strip_prefix("-s 2 ").unwrap_or(name));
        assert_eq!(color.texture.name, expected.display().to_string());
    }
    assert!(mtl_material(&folder, "map_Kd").1[0].contains("image ``"));
    for (letter, channels) in [
        ("r", Channels::Red),
        ("b", Channels::Blue),
        ("m", Channels::Alpha),
        ("l", Channels::Color),
    ] {
        let keys = format!("map_Pr -imfchan {letter} oak.png");
        assert_eq!(mtl_material(&folder, &keys).0.surface.roughness.unwrap().channels, channels);
    }
}

/// The tip of the arrow of the Khronos model `TextureTransformTest` is at 7/9 of the image; its marks for the
/// right place of the tip are the children of the nodes "Rotation" and "All", relative to the upper left
/// corner.
#[test]
fn transforms_of_textures_turn_as_the_khronos_model_shows() {
    let folder = Folder::new();
    folder.write("a.png", png([[255; 4]; 2]));
    let tip = |transform: &str, [u, v]: [f32; 2]| {
        let material = format!(
            r#"{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0,
            "extensions": {{"KHR_texture_transform": {{{transform}}}}}}}}}}}"#
        );
        let rest = r#", "images": [{"uri": "a.png"}], "textures": [{"source": 0}]"#;
        let color = gltf_material(&folder, &material, rest).0.surface.color.unwrap();
        color.image_from_uv.map(|row| row[0] * u + row[1] * v + row[2])
    };
    let turned = tip(r#""rotation": 0.3926991"#, [0.421, 1.016]);
    let all = r#""rotation": 0.3, "scale": [1.5, 1.5], "offset": [-0.2, -0.1]"#;
    for place in [turned, tip(all, [0.43, 0.75])] {
        assert!(place.iter().all(|coordinate| (coordinate - 0.77).abs() < 0.03), "{place:?}");
    }
}

#[test]
fn names_do_not_leave_the_folder_of_the_scene() {
    let folder = Folder::new();
    folder.write("secret.txt", "newmtl a\nKd top secret\n");
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    let refuse = |name: &str, text: String| {
        let message =
            Mesh::read(&folder.write(name, text), &mut Vec::new()).unwrap_err().to_string();
        assert!(message.contains("expected one in the folder of the scene"), "{message}");
        assert!(!message.contains("top secret"), "{message}");
    };
    // A library or an image elsewhere is a warning.
    let leave_out = |text: String, expected: &str| {
        let mut warnings = Vec::new();
        let mesh = Mesh::read(&folder.write("scene/a.obj", text), &mut warnings).unwrap();
        warnings.extend(mesh.ignored_in_materials(|_| false).warnings("a.obj".as_ref()));
        assert!(warnings.iter().any(|text| text.contains(expected)), "{warnings:?}");
        assert!(!warnings.iter().any(|text| text.contains("top secret")), "{warnings:?}");
        assert!(mesh.materials[0].material.surface.color.is_none());
    };
    let absolute = folder.path().join("secret.txt");
    leave_out(format!("mtllib \\\\host\\a.mtl\n{obj}"), "cannot read the material library");
    for name in [
        "../secret.txt",
        absolute.to_str().unwrap(),
        "x/../../secret.txt",
        "C:/secret.txt",
        "file:///secret.txt",
        "maps/..",
    ] {
        leave_out(format!("mtllib {name}\n{obj}"), "cannot read the material library");
        folder.write("scene/a.mtl", format!("newmtl a\nmap_Kd {name}\n"));
        leave_out(format!("mtllib a.mtl\n{obj}"), "ignored image `");
        let text = gltf(r#"{"mesh": 0}"#, "", "", "");
        let (before, after) = text.split_once("data:").unwrap();
        let after = after.split_once('"').unwrap().1;
        refuse("scene/a.gltf", format!("{before}{name}\"{after}"));
        let escaped = name.replace('.', "%2e");
        refuse("scene/a.gltf", format!("{before}{escaped}\"{after}"));
    }
    // A library in a folder below may name images elsewhere in the scene.
    folder.write("scene/maps/a.png", png([[1; 4]; 2]));
    folder.write("scene/materials/a.mtl", "newmtl a\nmap_Kd ../maps/a.png\n");
    let path = folder.write("scene/a.obj", format!("mtllib materials/a.mtl\n{obj}"));
    let mesh = Mesh::read(&path, &mut Vec::new()).unwrap();
    assert!(mesh.materials[0].material.surface.color.is_some());
    assert_eq!(mesh.side_files.len(), 2);
}

#[test]
fn triangles_without_area_are_dropped_with_a_word() {
    let folder = Folder::new();
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\n";
    let scene = Scene::load(&folder.write("a.obj", text)).unwrap();
    assert_eq!(scene.geometry.triangles.len(), 1);
    let expected = "dropped 1 triangles of zero area of 2";
    assert!(scene.warnings.iter().any(|text| text.ends_with(expected)), "{:?}", scene.warnings);
}

#[test]
fn extras_may_be_anything() {
    let text = gltf(r#"{"mesh": 0, "extras": "a text"}"#, r#"{"extras": [1, 2]}"#, "", "");
    let text = text.replace("\"version\"", "\"extras\": 7, \"version\"");
    let folder = Folder::new();
    assert_eq!(Scene::load(&folder.write("a.gltf", text)).unwrap().geometry.triangles.len(), 1);
}

#[test]
fn ply_coordinates_and_colours_are_read() {
    let names = [
        ("u", "v"),
        ("s", "t"),
        ("texture_u", "texture_v"),
        ("texture_s", "texture_t"),
        ("s0", "t0"),
        ("tu", "tv"),
    ];
    let folder = Folder::new();
    for (u, v) in names {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nproperty float {v}\nproperty float {u}\nproperty uchar red\n\
             property ushort green\nproperty uchar blue\nproperty uchar alpha\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n\
             0 0 0 0.1 0.2 255 48316 188 51\n1 0 0 0.3 0.4 0 0 0 0\n0 1 0 0.5 0.6 0 0 0 0\n\
             3 0 1 2\n"
        );
        let mut warnings = Vec::new();
        let mesh = Mesh::read(&folder.write("a.ply", text), &mut warnings).unwrap();
        assert_eq!(mesh.uvs[0], [[0.2, 0.1], [0.4, 0.3], [0.6, 0.5]]);
        assert_eq!(warnings, [""; 0]);
        let [r, g, b, a] = mesh.colors[0];
        // 48316 of 65535 is 188 of 255. Opacity is linear.
        assert!((r, g, a) == (1.0, b, 0.2) && (b - 0.5029).abs() < 1e-3, "{g} {b}");
    }
    let unknown = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n\
        -nan(ind) 1.#QNAN 0\n";
    let mesh = Mesh::read(&folder.write("d.ply", unknown), &mut Vec::new()).unwrap();
    assert!(mesh.positions[0][0].is_nan() && mesh.positions[0][1].is_nan());
    // MeshLab gives corners coordinates, and Blender 2.47 forgot to mark a comment.
    let text = "ply\nformat ascii 1.0\nMade by Blender\nelement vertex 4\nproperty float x\n\
        property float y\nproperty float z\nproperty uchar diffuse_red\nproperty uchar diffuse_green\n\
        property uchar diffuse_blue\nelement face 2\nproperty list uchar int vertex_indices\n\
        property list uchar float texcoord\nproperty int texnumber\nend_header\n\
        0 0 0 255 0 0\n1 0 0 0 0 0\n0 1 0 0 0 0\n1 1 0 0 0 0\n\
        3 0 1 2 6 0 0 1 0 0 1 0\n3 1 3 2 6 0.5 0.5 1 1 0 1 0\n";
    let mut warnings = Vec::new();
    let mesh = Mesh::read(&folder.write("b.ply", text), &mut warnings).unwrap();
    // Both triangles share the corner whose coordinates agree.
    assert_eq!(mesh.triangles, [[0, 1, 2], [4, 3, 2]]);
    assert_eq!(mesh.positions[4], mesh.positions[1]);
    assert_eq!(mesh.uvs[0], [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]]);
    assert_eq!((mesh.colors[0], mesh.colors.len()), ([1.0, 0.0, 0.0, 1.0], 5));
    let names = ["red", "green", "blue"].iter().enumerate();
    let of_mitsuba = names.fold(text.to_owned(), |text, (index, name)| {
        text.replace(&format!("diffuse_{name}"), &format!("color_{index}"))
    });
    let own = Mesh::read(&folder.write("b.ply", of_mitsuba), &mut Vec::new()).unwrap();
    assert_eq!(own.colors, mesh.colors);
    let [header, number] = &warnings[..] else { panic!("{warnings:?}") };
    assert!(header.contains("other lines of the header (`Made by Blender`)"), "{header}");
    assert!(number.contains("ignored `texnumber` of faces"), "{number}");
    // Old Macs end lines otherwise, and programs count in integers of 64 bits.
    let quad = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n\
        property float y\nproperty float z\nelement face 1\n\
        property list uchar int64 vertex_indices\nend_header\n";
    let floats = [10.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    let indices = [0_i64, 2, 1].map(i64::to_le_bytes);
    let body = [floats.as_flattened(), &[3], indices.as_flattened()].concat();
    for header in [quad.to_owned(), quad.replace('\n', "\r"), quad.replace('\n', "\r\n")] {
        let path = folder.write("e.ply", [header.as_bytes(), &body].concat());
        let mesh = Mesh::read(&path, &mut Vec::new()).unwrap();
        assert_eq!((&mesh.triangles[..], mesh.positions[0]), (&[[0, 2, 1]][..], [10.0, 0.0, 0.0]));
    }
    let strips = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n\
        0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 3 2 1\n";
    let mesh = Mesh::read(&folder.write("c.ply", strips), &mut Vec::new()).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3], [3, 2, 1]]);
    let clay = "type = \"diffuse\"\nreflectance = [1, 1, 1]";
    let toml = |clay: &str| folder::yard([8, 8], "constant = [1, 1, 1]", clay, "mesh = \"a.ply\"");
    let plain = Scene::load(&folder.write("a.toml", toml(clay))).unwrap();
    assert!(plain.geometry.colors.is_empty());
    assert!(plain.warnings.iter().any(|text| text.contains("ignored vertex colours of other")));
    let colored = toml(&format!("{clay}\nvertex_color = true"));
    let colored = Scene::load(&folder.write("b.toml", colored)).unwrap();
    assert_eq!(colored.geometry.colors.len(), colored.geometry.positions.len());
    assert_eq!(colored.warnings, [""; 0]);
}

#[test]
fn objects_of_a_scene_take_whole_materials_of_their_mesh() {
    let folder = Folder::new();
    let material = r#"{"name": "brass", "emissiveFactor": [1, 0, 0]}"#;
    folder.write("a.gltf", gltf(r#"{"mesh": 0}"#, material, r#", "material": 0"#, ""));
    let clay = "type = \"diffuse\"\nreflectance = [0, 0, 0]";
    let toml = folder::yard([8, 8], "constant = [1, 1, 1]", clay, "mesh = \"a.gltf\"");
    let own = toml.strip_suffix("material = \"clay\"\n").unwrap();
    let scene = Scene::load(&folder.write("b.toml", own)).unwrap();
    let found = scene.materials.last().unwrap();
    assert_eq!(found.name, "mesh/brass");
    assert!(matches!(found.kind, MaterialKind::Principled(Principled { metallic: 1.0, .. })));
    assert_eq!(found.surface.emission.as_ref().unwrap().radiance, Vec3::X);
}
