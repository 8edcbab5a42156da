//! `fenestra convert`: pictures and images of a small EXR file, read back.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use fenestra::film::{Attribute, Image};

use crate::support::command::Folder;

/// Writes a film of 6×4 pixels, of which the image holds 4×3 from (1, 1): R is the column of the film, G
/// its row, in tenths.
fn folder() -> Folder {
    let folder = Folder::new();
    let mut image = Image::new(4, 3);
    image.origin = [1, 1];
    image.film_size = [6, 4];
    let pixels: Vec<[f32; 3]> = (0..12)
        .map(|index| [(1 + index % 4) as f32 * 0.1, (1 + index / 4) as f32 * 0.1, 3.0])
        .collect();
    image.insert_triple(["R", "G", "B"], &pixels);
    image.insert_triple(["N.X", "N.Y", "N.Z"], &[[0.0, 1.0, -1.0]; 12]);
    image.channels.insert("Visible.Y".into(), vec![0.25; 12]);
    image.attributes.insert("fenestra.sampler".into(), Attribute::Text("mis".into()));
    image.write_exr(&folder.path().join("in.exr")).unwrap();
    folder
}

fn bytes(folder: &Folder, name: &str) -> (u32, u32, Vec<[u8; 3]>) {
    let picture = image::open(folder.path().join(name)).unwrap().into_rgb8();
    (picture.width(), picture.height(), picture.pixels().map(|pixel| pixel.0).collect())
}

#[test]
fn pictures_have_exposure_curve_part_and_layer() {
    let folder = folder();
    let run = |arguments: &[&str]| {
        folder.run(&[&["convert", "in.exr"], arguments].concat()).assert(0, &[])
    };
    run(&["plain.png"]);
    let (width, height, plain) = bytes(&folder, "plain.png");
    assert_eq!((width, height), (4, 3));
    // sRGB of 0.1, 0.1 and 3: 89, 89, white.
    assert_eq!(plain[0], [89, 89, 255]);
    run(&["part.png", "--crop", "2,2,4,3", "--exposure", "1"]);
    // The pixel (2, 2) holds 0.2, 0.2: 0.4 after a stop, 170 in sRGB.
    let (width, height, part) = bytes(&folder, "part.png");
    assert_eq!((width, height, part[0]), (2, 1, [170, 170, 255]));
    run(&["curve.png", "--curve", "reinhard"]);
    let curve = bytes(&folder, "curve.png").2;
    assert!(curve[0][0] < plain[0][0] && curve[0] != plain[0]);
    run(&["normal.png", "--layer", "N"]);
    assert_eq!(bytes(&folder, "normal.png").2[0], [188, 255, 0]);
    run(&["visible.png", "--layer", "Visible"]);
    assert_eq!(bytes(&folder, "visible.png").2[0], [137; 3]);
    run(&["grey.png", "--layer", "Visible", "--auto-exposure"]);
    assert_eq!(bytes(&folder, "grey.png").2[0], [118; 3], "0.18, by the layer's own luminance");
    run(&["plain.jpg"]);
    let (_, _, jpeg) = bytes(&folder, "plain.jpg");
    let is_near = |(one, other): (&u8, &u8)| one.abs_diff(*other) < 24;
    assert!(jpeg.as_flattened().iter().zip(plain.as_flattened()).all(is_near));
    run(&["auto.png", "--auto-exposure", "--crop", "1,1,2,2"]);
    let [red, _, blue] = bytes(&folder, "auto.png").2[0];
    // The luminance 0.31 of the pixel becomes 0.18.
    // That is 0.0582 of the red's 0.1, 68 in sRGB, whatever lies outside.
    assert_eq!((red, blue), (68, 255));
    run(&["brighter.png", "--auto-exposure", "--exposure", "1", "--crop", "1,1,2,2"]);
    assert!(bytes(&folder, "brighter.png").2[0][0] > red, "a stop beside the automatic ones");
}

#[test]
fn images_keep_their_values() {
    let folder = folder();
    let run = |arguments: &[&str]| {
        folder.run(&[&["convert", "in.exr"], arguments].concat()).assert(0, &[])
    };
    let read = |name: &str| folder.image(name);
    run(&["same.exr"]);
    assert_eq!(read("same.exr"), read("in.exr"));
    run(&["part.exr", "--crop", "2,1,5,3"]);
    let part = read("part.exr");
    assert_eq!((part.origin, part.width, part.height, part.film_size), ([2, 1], 3, 2, [6, 4]));
    assert_eq!(
        part.channels["R"],
        [0.2, 0.3, 0.4, 0.2, 0.3, 0.4].map(|v: f32| (v * 10.0).round() * 0.1)
    );
    assert!(
        part.channels.contains_key("Visible.Y") && part.attributes.contains_key("fenestra.sampler")
    );
    // Values that are no longer those of the render do not say that they are.
    run(&["bright.exr", "--exposure", "2"]);
    let bright = read("bright.exr");
    assert_eq!((bright.channels["B"][0], bright.channels.len()), (12.0, 3));
    assert!(!bright.attributes.contains_key("fenestra.sampler"));
    run(&["bright.hdr", "--exposure", "-1"]);
    let hdr = image::open(folder.path().join("bright.hdr")).unwrap().into_rgb32f();
    assert!((hdr.get_pixel(0, 0).0[2] - 1.5).abs() < 0.01);
    // The luminance 0.31 of the pixel becomes 0.18: 0.0582 of the red's 0.1, and a stop more if asked for.
    for (stops, red) in [("0", 0.0582), ("1", 0.1164)] {
        run(&["auto.exr", "--auto-exposure", "--exposure", stops, "--crop", "1,1,2,2"]);
        let found = read("auto.exr").channels["R"][0];
        assert!((found - red).abs() < 2e-4, "{found}, not {red}");
    }
}

#[test]
fn wrong_use_is_named() {
    let folder = folder();
    folder.write("text.exr", "no image");
    let cases: [(&[&str], i32, &str); 9] = [
        (&["in.exr", "out.gif"], 2, "expected a name that ends in .png, .jpg, .hdr or .exr"),
        (&["in.exr", "in.exr"], 2, "the output in.exr would replace in.exr, which is read"),
        (&["in.exr", "out.hdr", "--curve", "filmic"], 2, "a curve is for PNG and JPEG"),
        (
            &["in.exr", "out.png", "--crop", "0,0,2,2"],
            2,
            "in.exr holds pixels 1 ≤ x < 5, 1 ≤ y < 4",
        ),
        (&["in.exr", "out.png", "--layer", "Albedo"], 2, "it has N, Visible"),
        (&["in.exr", "out.png", "--exposure", "inf"], 2, "expected a finite number of stops"),
        (&["text.exr", "out.png"], 1, "text.exr: not a complete OpenEXR file"),
        (&["missing.exr", "out.png"], 1, "missing.exr"),
        (&["in.exr", "/proc/out.png"], 1, "/proc"),
    ];
    for (arguments, status, part) in cases {
        folder.run(&[&["convert"], arguments].concat()).assert(status, &[part]);
    }
    assert_eq!(folder.files(), ["in.exr", "text.exr"]);
}
