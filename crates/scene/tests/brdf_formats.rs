//! MERL and Cornell files: the values read from them, and the messages that refuse bad ones.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::{
    f64::consts::{FRAC_PI_2, TAU},
    path::Path,
};

use fenestra_scene::measured::{
    CELL_COUNT, MeasuredTable, bin_directions, cell_index,
    lookup::{half_difference_angles, measured_pdf, measured_sample},
    merl::{FILE_BYTES, HEADER_BYTES, SCALES},
};
use glam::Vec3;

use crate::support::{assert_contains, folder::Folder};

/// Returns the error message for a file of this content.
fn message(name: &str, content: &[u8]) -> String {
    let folder = Folder::new();
    MeasuredTable::load(&folder.write(name, content)).unwrap_err().to_string()
}

/// Encodes a MERL file from its stored values, before the scales, by channel and cell.
fn merl_bytes(dimensions: [i32; 3], stored: impl Fn(usize, usize) -> f64) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(FILE_BYTES);
    dimensions.iter().for_each(|count| bytes.extend(count.to_le_bytes()));
    for channel in 0..3 {
        (0..CELL_COUNT).for_each(|cell| bytes.extend(stored(channel, cell).to_le_bytes()));
    }
    bytes
}

/// Names a cell by a value in 1/sr, small enough to reflect less light than it receives.
fn cell_name(theta_half: usize, theta_difference: usize, phi: usize) -> Vec3 {
    Vec3::new(
        0.05 + 0.001 * theta_half as f32,
        0.05 + 0.001 * theta_difference as f32,
        0.05 + 0.0005 * phi as f32,
    )
}

/// The value at a bin's centre is the stored one times its channel's scale. Tests index order,
/// angles and scales at once.
#[test]
fn merl_cells_lie_where_the_format_says() {
    let bytes = merl_bytes([90, 90, 180], |channel, cell| {
        let (phi, rest) = (cell % 180, cell / 180);
        let name = cell_name(rest / 90, rest % 90, phi);
        f64::from(name[channel]) / [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0][channel]
    });
    let folder = Folder::new();
    let table = MeasuredTable::load(&folder.write("named.binary", bytes)).unwrap();
    assert_eq!(table.warnings, Vec::<String>::new());
    assert_eq!(table.invalid_cell_count, 0);
    let mut checked = 0;
    for theta_half in (1..90).step_by(4) {
        for theta_difference in (1..90).step_by(4) {
            for phi in (0..180).step_by(7) {
                let (outgoing, incident) = bin_directions(theta_half, theta_difference, phi);
                if outgoing.z > 1e-3 && incident.z > 1e-3 {
                    let found = table.evaluate(outgoing, incident);
                    let expected = cell_name(theta_half, theta_difference, phi);
                    assert!(
                        ((found - expected) / expected).abs().max_element() < 2e-3,
                        "cell {theta_half}, {theta_difference}, {phi}: {found} against {expected}"
                    );
                    checked += 1;
                }
            }
        }
    }
    assert!(checked > 5_000, "{checked}");
}

/// Checks indices worked by hand: θ_h = 45°, θ_d = 30° and φ_d = 60° lie in bins 63, 30 and 60.
#[test]
fn merl_index_has_its_closed_form() {
    let bin_45 = (90.0 * (0.5_f64).sqrt()).floor() as usize;
    assert_eq!(cell_index(bin_45, 30, 60), 60 + 180 * (30 + 90 * 63));
    let (outgoing, incident) = bin_directions(63, 30, 60);
    let half_vector = (outgoing + incident).normalize();
    let theta_half = half_vector.z.acos().to_degrees();
    let (lower, upper) = ((63.0_f32 / 90.0).powi(2) * 90.0, (64.0_f32 / 90.0).powi(2) * 90.0);
    assert!(theta_half > lower && theta_half < upper, "{lower}, {theta_half}, {upper}");
    let theta_difference = incident.dot(half_vector).acos().to_degrees();
    assert!((theta_difference - 30.5).abs() < 1e-3, "{theta_difference}");
}

/// Directions in one plane with the normal differ within it, and those beside a half vector in such a plane
/// across it, whichever comes first.
#[test]
fn differences_lie_in_the_plane_of_the_normal_or_across_it() {
    let at = |x: f32, y: f32| Vec3::new(x, y, (1.0 - x * x - y * y).sqrt());
    for (a, b, phi) in [((0.6, 0.0), (0.2, 0.0), 0.0), ((0.4, 0.3), (0.4, -0.3), FRAC_PI_2 as f32)]
    {
        for (one, other) in [(a, b), (b, a)] {
            let angles = half_difference_angles(at(one.0, one.1), at(other.0, other.1));
            assert_eq!(angles.z, phi, "{one:?} {other:?}");
        }
    }
}

/// Invalid cells take a neighbour's value, are counted, and never reach the shader.
#[test]
fn merl_invalid_cells_are_filled_from_their_neighbours() {
    // The second of these cells is also among the negative ones.
    let is_nan = |cell: usize| cell.is_multiple_of(1_000_003);
    let bytes = merl_bytes([90, 90, 180], |channel, cell| {
        if is_nan(cell) {
            [f64::NAN, f64::INFINITY, 1.0][channel]
        } else if (cell / 180) % 90 >= 60 {
            if cell % 3 == channel { -1.0 } else { 0.3 }
        } else {
            0.1 / SCALES[channel]
        }
    });
    let folder = Folder::new();
    let table = MeasuredTable::load(&folder.write("holes.binary", bytes)).unwrap();
    assert_eq!(table.invalid_cell_count, CELL_COUNT / 3 + 1);
    assert_contains(&table.warnings.join("\n"), &["2 cells that are not finite"]);
    for (theta_half, theta_difference, phi) in [(0, 0, 0), (61, 11, 103), (20, 70, 90), (3, 89, 0)]
    {
        let (outgoing, incident) = bin_directions(theta_half, theta_difference, phi);
        if outgoing.z > 0.0 && incident.z > 0.0 {
            let value = table.evaluate(outgoing, incident);
            assert!((value - Vec3::splat(0.1)).abs().max_element() < 1e-4, "{value}");
        }
    }
    let all_invalid = merl_bytes([90, 90, 180], |_, _| -1.0);
    assert_contains(&message("void.binary", &all_invalid), &["void.binary", "none of the 1458000"]);
}

#[test]
fn merl_sizes_are_checked_before_reading() {
    let with_header = |dimensions: [i32; 3], length: usize| {
        let mut bytes: Vec<u8> = dimensions.iter().flat_map(|count| count.to_le_bytes()).collect();
        bytes.resize(length, 0);
        bytes
    };
    let size = FILE_BYTES.to_string();
    assert_eq!(FILE_BYTES, 34_992_012);
    assert_contains(&message("a.binary", &[]), &["truncated", &size, "found 0"]);
    assert_contains(&message("a.binary", &[90, 0, 0, 0]), &["truncated", &size, "found 4"]);
    assert_contains(
        &message("a.binary", &with_header([90, 90, 360], 1000)),
        &["a.binary", "90 × 90 × 180", "90 × 90 × 360"],
    );
    assert_contains(
        &message("a.binary", &with_header([-5, i32::MAX, 0], 1000)),
        &["90 × 90 × 180", "-5 × 2147483647 × 0"],
    );
    assert_contains(
        &message("a.binary", &with_header([90, 90, 180], HEADER_BYTES + 800)),
        &["truncated", &size, "found 812"],
    );
    // The header decides, whatever the name.
    assert_contains(&message("a.data", &with_header([90, 90, 180], 5000)), &["truncated", "5000"]);
    let too_long = with_header([90, 90, 180], FILE_BYTES + 1);
    assert_contains(&message("a.binary", &too_long), &["too long", "found 34992013"]);
}

/// Formats a Cornell file of three wavelengths with the records of a Lambertian surface.
fn cornell_text(value: f64) -> String {
    let mut text = String::from("# a comment\n3 # wavelengths\n450 550\n650\n");
    for theta_incident in [0.3_f64, 0.8, 1.3] {
        for theta_outgoing in [0.2_f64, 0.7, 1.2] {
            for phi in [-2.0_f64, 0.0, 1.0, 3.1] {
                let values = format!("{value} {value} {value}");
                text += &format!("{theta_incident} 0 {theta_outgoing} {phi}  {values}\n");
            }
        }
    }
    text
}

#[test]
fn cornell_constant_samples_give_a_constant_grid() {
    let folder = Folder::new();
    let path = folder.write("grey.brdf", cornell_text(0.1));
    let table = MeasuredTable::load(&path).unwrap();
    assert_eq!(table.warnings, Vec::<String>::new());
    let mut values = Vec::new();
    for (theta_half, theta_difference, phi) in [(0, 0, 0), (30, 20, 50), (60, 40, 90), (10, 80, 3)]
    {
        let (outgoing, incident) = bin_directions(theta_half, theta_difference, phi);
        assert!(outgoing.z > 0.0 && incident.z > 0.0);
        values.push(table.evaluate(outgoing, incident));
        // Three wavelengths make a coarse spectrum, but of the right luminance.
        let luminance = values[0].dot(Vec3::new(0.2126, 0.7152, 0.0722));
        assert!((luminance - 0.1).abs() < 2e-3, "{luminance}");
        let difference = (values[0] - values[values.len() - 1]).abs().max_element();
        assert!(difference < 1e-3 * values[0].max_element(), "{values:?}");
    }
}

/// Samples of light that goes on past the normal, and of light that goes back, at several turns.
#[test]
fn cornell_samples_lie_at_their_azimuths() {
    let mut text = String::from("3\n450 550 650\n");
    for (step, past, value) in (0..8).flat_map(|step| [(step, 0.5 * TAU, 0.2), (step, 0.0, 0.02)]) {
        let turn = 0.7 * f64::from(step);
        text += &format!("0.8 {turn} 0.8 {}  {value} {value} {value}\n", turn + past);
    }
    let table = MeasuredTable::load(&Folder::new().write("a.brdf", text)).unwrap();
    let (sine, cosine) = 0.8_f32.sin_cos();
    let incident = Vec3::new(sine, 0.0, cosine);
    for (outgoing, expected) in [(incident.with_x(-sine), 0.2), (incident, 0.02)] {
        let luminance = table.evaluate(outgoing, incident).dot(Vec3::new(0.2126, 0.7152, 0.0722));
        assert!((luminance / expected - 1.0).abs() < 0.05, "{luminance}, not {expected}");
    }
}

#[test]
fn cornell_records_that_cannot_be_used_are_counted() {
    let folder = Folder::new();
    let mut text = cornell_text(0.1);
    text += "0.5 0 0.5 1  nan 0.1 0.1\n2.0 0 0.5 1  0.1 0.1 0.1\n0.5 0 inf 1  0.1 0.1 0.1\n";
    let table = MeasuredTable::load(&folder.write("a.brdf", text)).unwrap();
    assert_contains(&table.warnings.join("\n"), &["3 records"]);
    let (outgoing, incident) = bin_directions(30, 20, 50);
    assert!(table.evaluate(outgoing, incident).is_finite());
    let unusable = "1\n550\n0.5 0 0.5 1 nan\n";
    assert_contains(&message("a.brdf", unusable.as_bytes()), &["a.brdf", "no usable record"]);
}

#[test]
fn cornell_text_is_refused_with_its_place() {
    let error = |text: &str| message("a.brdf", text.as_bytes());
    assert_contains(&error(""), &["a.brdf", "empty"]);
    assert_contains(&error("# nothing\n"), &["empty"]);
    assert_contains(&error("2\n400 spam"), &["a.brdf:2:5", "number", "spam"]);
    assert_contains(&error("2.5 400 500"), &["a.brdf:1:1", "integer", "2.5"]);
    assert_contains(&error("-3"), &["count of wavelengths", "-3"]);
    assert_contains(&error("1e30"), &["count of wavelengths"]);
    assert_contains(&error("nan"), &["count of wavelengths"]);
    assert_contains(&error("3 400 500"), &["truncated", "3 wavelengths", "found 2"]);
    assert_contains(&error("2 500\n400 0 0 0 0 1 1"), &["a.brdf:2:1", "increasing", "400"]);
    assert_contains(&error("2 400 500"), &["records of 6", "found 0"]);
    assert_contains(
        &error("2 400 500\n0 0 0 0 1 1\n0 0 0"),
        &["a.brdf:3:5", "records of 6", "1 records and 3 left over"],
    );
    assert_contains(&error("2 1400 1500\n0 0 0 0 1 1"), &["visible"]);
    assert_contains(&message("a.brdf", &[0x35, 0x20, 0xff, 0xfe]), &["UTF-8", "byte 2"]);
}

#[test]
fn a_missing_file_is_named() {
    let message = MeasuredTable::load(Path::new("no/such.brdf")).unwrap_err().to_string();
    assert_contains(&message, &["no/such.brdf", "cannot read"]);
}

/// Grid values that would reflect more light than they receive are scaled down and stay reciprocal.
#[test]
fn energy_is_limited() {
    let table = MeasuredTable::tabulate(|outgoing, incident| {
        Vec3::new(1.0, 0.5, 0.1) * 0.2 / (outgoing.z * incident.z).max(1e-4).sqrt()
    })
    .unwrap();
    assert_contains(&table.warnings.join("\n"), &["times the light"]);
    for angle in [0.1_f64, 0.8, 1.3, 1.5] {
        let outgoing = Vec3::new(angle.sin() as f32, 0.0, angle.cos() as f32);
        let (mut albedo, points) = (0.0, 400);
        for index in 0..points * points {
            let theta = (f64::from(index % points) + 0.5) / f64::from(points) * FRAC_PI_2;
            let phi = (f64::from(index / points) + 0.5) / f64::from(points) * TAU;
            let incident = Vec3::new(
                (theta.sin() * phi.cos()) as f32,
                (theta.sin() * phi.sin()) as f32,
                theta.cos() as f32,
            );
            let value = table.evaluate(outgoing, incident);
            assert_eq!(value, table.evaluate(incident, outgoing));
            assert_eq!(table.evaluate(outgoing, -incident), Vec3::ZERO);
            assert_eq!(table.evaluate(-incident, outgoing), Vec3::ZERO);
            albedo += f64::from(value.x) * theta.cos() * theta.sin();
        }
        albedo *= FRAC_PI_2 * TAU / f64::from(points * points);
        assert!(albedo < 1.02, "{angle}: {albedo}");
    }
}

/// The interpolation has no seam where φ_d wraps around, or at the poles of θ_h and θ_d, where it
/// turns quickly.
#[test]
fn interpolation_is_continuous() {
    // Make all cells differ, as noise would.
    let mut cells = vec![Vec3::ZERO; CELL_COUNT];
    for (index, cell) in cells.iter_mut().enumerate() {
        *cell = Vec3::splat(0.05 + 0.1 * ((index * 7919) % 1000) as f32 / 1000.0);
    }
    let table = MeasuredTable::from_cells(cells).unwrap();
    let step = 1e-6_f32;
    let around = |axis: Vec3, turn: f32| -> Vec3 {
        let tangent = axis.any_orthonormal_vector();
        (axis + step * (turn.cos() * tangent + turn.sin() * axis.cross(tangent))).normalize()
    };
    let mirror = |v: Vec3| Vec3::new(-v.x, -v.y, v.z);
    for index in 0..200_u32 {
        let theta = 0.1 + 1.2 * index as f32 / 200.0;
        let outgoing = Vec3::new(theta.sin() * 0.6, theta.sin() * 0.8, theta.cos());
        // Half vector along the normal, equal directions, and both in one plane with the normal.
        let in_plane =
            Vec3::new((0.5 * theta).sin() * 0.6, (0.5 * theta).sin() * 0.8, (0.5 * theta).cos());
        for incident in [mirror(outgoing), outgoing, in_plane, mirror(in_plane)] {
            let values: Vec<f32> = (0..8)
                .map(|turn| table.evaluate(outgoing, around(incident, turn as f32 * 0.785)).x)
                .collect();
            let smallest = values.iter().copied().fold(f32::INFINITY, f32::min);
            let largest = values.iter().copied().fold(0.0, f32::max);
            assert!(largest - smallest < 0.01, "{outgoing}, {incident}: {values:?}");
        }
    }
}

/// A lobe of a few bins, seen along the normal: lines between its nodes would reflect 1.7% too much.
#[test]
fn a_narrow_lobe_reflects_what_its_function_does() {
    let lobe = |half_angle: f32| Vec3::splat((-(half_angle / 0.01).powi(2)).exp());
    let table = MeasuredTable::tabulate(|outgoing, incident| {
        let half_vector = outgoing + incident;
        lobe(half_vector.truncate().length().atan2(half_vector.z))
    });
    let table = table.unwrap();
    let mut sums = [0.0_f64; 2];
    for step in 0..20_000 {
        let angle = (step as f32 + 0.5) * 5e-6;
        let incident = Vec3::new(angle.sin(), 0.0, angle.cos());
        for (sum, value) in
            sums.iter_mut().zip([table.evaluate(Vec3::Z, incident), lobe(angle / 2.0)])
        {
            *sum += f64::from(value.x * angle.sin() * angle.cos());
        }
    }
    let ratio = sums[0] / sums[1];
    assert!((ratio - 1.0).abs() < 3e-3, "{ratio}");
}

/// Samples divided by their density integrate what has a closed form over the hemisphere.
#[test]
fn samples_are_as_dense_as_stated() {
    let table = MeasuredTable::tabulate(|outgoing, incident| {
        let half_vector = (outgoing + incident).normalize();
        Vec3::splat(0.1 + 0.2 * (-(half_vector.z.acos() / 0.4).powi(2)).exp())
    });
    let table = table.unwrap();
    let words = table.words();
    let outgoing = Vec3::new(0.6, 0.0, 0.8);
    let count = 100_000;
    let mut sums = [0.0_f64; 4];
    for sample in 1..=count {
        // The additive sequence of the plastic number for three dimensions.
        let digit =
            |power: i32| (f64::from(sample) * 1.220_744_084_605_759_5_f64.powi(-power)).fract();
        let u = Vec3::new(digit(1) as f32, digit(2) as f32, digit(3) as f32);
        let way = measured_sample(words, 0, outgoing, u);
        if way.z <= 0.0 {
            continue;
        }
        let theta_half = half_difference_angles(outgoing, way).x;
        let pdf = measured_pdf(words, 0, outgoing, way, theta_half);
        let moments = [1.0, way.x * way.x, way.y * way.y, way.x];
        for (sum, moment) in sums.iter_mut().zip(moments) {
            *sum += f64::from(way.z * moment / pdf);
        }
    }
    let pi = std::f64::consts::PI;
    let expected = [pi, 0.25 * pi, 0.25 * pi, 0.0];
    for (sum, expected) in sums.iter().zip(expected) {
        let found = sum / f64::from(count);
        assert!((found - expected).abs() < 0.01, "{found} instead of {expected}");
    }
}

/// Reflectance toward the normal of a Cornell file with a spectrum sampled so often, nm.
fn cornell_color(step: usize, spectrum: impl Fn(f64) -> f64) -> Vec3 {
    let wavelengths: Vec<f64> = (380..=780).step_by(step).map(|nm| nm as f64).collect();
    let list = |value: &dyn Fn(f64) -> f64| {
        wavelengths.iter().map(|&nm| format!("{} ", value(nm))).collect::<String>()
    };
    let text = format!("{} {}\n0 0 0 0 {}", wavelengths.len(), list(&|nm| nm), list(&spectrum));
    let folder = Folder::new();
    let table = MeasuredTable::load(&folder.write("a.brdf", text)).unwrap();
    table.evaluate(Vec3::Z, Vec3::Z)
}

/// The white of sRGB is D65: a grey reflectance stays grey, to the digits of the matrix. A spectrum that is
/// sampled twice as finely has the same colour.
#[test]
fn spectra_of_samples_are_seen_under_daylight() {
    let grey = cornell_color(10, |_| 0.1);
    assert!((10.0 * grey - Vec3::ONE).abs().max_element() < 3e-3, "{grey}");
    let spectrum = |nm: f64| 0.1 + 0.05 * ((nm - 400.0) / 60.0).sin();
    let [coarse, fine] = [10, 5].map(|step| cornell_color(step, spectrum));
    assert!(coarse.abs_diff_eq(fine, 5e-4), "{coarse} {fine}");
}
