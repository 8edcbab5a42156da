//! The film: files written whole or not at all, sums and estimates, exact checkpoints, merging.

#![expect(clippy::unwrap_used, reason = "tests may panic")]

use std::{collections::BTreeMap, fs, io, path::Path};

use clap::ValueEnum;
use fenestra::{
    film::{
        Aov, Attribute, Checkpoint, GroupSums, Image, Metadata, RgbImage, SampleRange, Sums,
        Window,
        checkpoint::checkpoint_path,
        merge::{Part, join_windows, merge_checkpoints, merge_images},
        picture::write_preview,
        sums::Ahead,
    },
    math::colour::display_from_linear,
    scene::files::write_atomically,
};
use io::Write;

use crate::support::{assert_error, random::Random};

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

fn metadata(ranges: &[SampleRange]) -> Metadata {
    let named = |name: &str, value: &str| BTreeMap::from([(name.to_owned(), value.to_owned())]);
    Metadata {
        version: "0.1.0".to_owned(),
        scene: "room".to_owned(),
        scene_hash: "ab12".to_owned(),
        fit_hashes: named("environment", "77ff"),
        sampler: "ris".to_owned(),
        sampler_parameters: named("candidates", "4"),
        candidates: Some(4),
        shadow_rays: 5,
        depth: 1,
        sample_ranges: ranges.to_vec(),
        ahead: Ahead::default(),
        seconds: 1.0 / 3.0,
        gpu_seconds: BTreeMap::from([("trace".to_owned(), 0.1)]),
        mattes: named("3ae39a5/name", "CryptoObject"),
        device: "llvmpipe (LLVM 15, 256 bits) “ä”".to_owned(),
        driver: "Mesa 22.3.6".to_owned(),
        tracer: "Embree 3.13.5".to_owned(),
    }
}

fn range(seed: u32, first: u32, count: u32) -> SampleRange {
    SampleRange { seed, first, count }
}

/// Adds without loss by Knuth's two-sum, whose error gathers in `rest`.
fn add_two_float(sum: &mut f32, rest: &mut f32, value: f32) {
    let before = *sum;
    *sum = before + value;
    let added = *sum - before;
    *rest += (before - (*sum - added)) + (value - added);
}

/// Accumulates radiance in 0…1 times `scale` in two-float sums, as the device does.
fn accumulate(numbers: &mut Random, sample_count: u32, scale: f32) -> (Sums, Vec<Vec<f64>>) {
    let mut sums = Sums::new([3, 1], 4, 2, [10, 6]);
    let mut drawn = vec![Vec::new(); 8];
    sums.unfiltered = vec![[0.0; 3]; 8];
    sums.albedo = vec![[0.0; 3]; 8];
    sums.normal = vec![[0.0; 3]; 8];
    sums.position = vec![[0.0; 3]; 8];
    sums.guide_cell = vec![[0.0; 3]; 8];
    sums.guide_level = vec![[0.0; 3]; 8];
    sums.visible = vec![[0; 2]; 8];
    sums.cache_entries = vec![[0; 2]; 8];
    for _ in 0..sample_count {
        for (pixel, drawn) in drawn.iter_mut().enumerate() {
            for channel in 0..3 {
                let value = scale * numbers.uniform_f32();
                if channel == 0 {
                    drawn.push(f64::from(value));
                }
                let (sum, rest) = (&mut sums.sum[pixel], &mut sums.compensation[pixel]);
                add_two_float(&mut sum[channel], &mut rest[channel], value);
                let rest = &mut sums.squares_compensation[pixel][channel];
                add_two_float(&mut sums.squares[pixel][channel], rest, value * value);
                sums.unfiltered[pixel][channel] += value;
                sums.albedo[pixel][channel] += 0.5;
                sums.normal[pixel][channel] -= numbers.uniform_f32();
                sums.position[pixel][channel] += 100.0 * numbers.uniform_f32();
                sums.guide_cell[pixel][channel] += 0.25;
            }
            sums.guide_level[pixel][2] += 1.0;
            sums.cache_entries[pixel][0] += 3;
            sums.cache_entries[pixel][1] += 2;
            sums.visible[pixel][0] += 2;
            sums.visible[pixel][1] += 5;
        }
    }
    sums.sample_count = sample_count;
    (sums, drawn)
}

#[test]
fn writing_creates_folders_and_leaves_only_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a/b/out.txt");
    write_atomically(&path, |file| file.write_all(b"first")).unwrap();
    write_atomically(&path, |file| file.write_all(b"second")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"second");
    assert_eq!(names_in(path.parent().unwrap()), ["out.txt"]);
}

#[cfg(unix)]
#[test]
fn written_files_have_the_permissions_of_any_new_file() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
    write_atomically(&ours, |file| file.write_all(b"x")).unwrap();
    fs::write(&plain, b"x").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&ours), mode(&plain));
}

#[test]
fn a_failed_write_keeps_the_old_file_and_leaves_no_temporary_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.txt");
    fs::write(&path, b"old").unwrap();
    let written = write_atomically(&path, |file| {
        file.write_all(&[0; 100_000])?;
        Err(io::ErrorKind::StorageFull.into())
    });
    assert_error(written, &["out.txt: cannot write: no storage space"]);
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names_in(folder.path()), ["out.txt"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_reported_with_path_and_cause() {
    let mut image = Image::new(2, 2);
    image.channels.insert("Y".to_owned(), vec![1.0; 4]);
    assert_error(
        image.write_exr(Path::new("/dev/full")),
        &["/dev/full: cannot write: No space left on device"],
    );
}

#[test]
fn a_folder_in_the_way_or_a_file_for_a_folder_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, b"x").unwrap();
    assert_error(write_atomically(&file.join("out"), |_| Ok(())), &["file: cannot create folder"]);
    let taken = folder.path().join("taken");
    fs::create_dir(&taken).unwrap();
    assert_error(write_atomically(&taken, |_| Ok(())), &["taken: cannot write"]);
    assert_eq!(names_in(folder.path()), ["file", "taken"]);
}

#[test]
fn two_float_sums_stay_exact_where_floats_stagnate() {
    // Floats stop counting ones at 2²⁴. Start there to keep the test short.
    let mut sums = Sums::new([0, 0], 1, 1, [1, 1]);
    sums.sum[0] = [16_777_216.0; 3];
    let (mut sum, mut rest) = (16_777_216.0_f32, 0.0_f32);
    for _ in 0..1001 {
        add_two_float(&mut sum, &mut rest, 1.0);
    }
    assert_eq!(sum, 16_777_216.0, "a float alone does not move");
    sums.compensation[0] = [rest; 3];
    assert_eq!(sums.total(0), [16_778_217.0; 3]);
}

/// Two blocks a row, the second of which the film cuts.
#[test]
fn the_first_blocks_have_the_samples_of_a_stopped_sweep() {
    let mut sums = Sums::new([0, 0], 12, 16, [12, 16]);
    sums.sample_count = 4;
    sums.ahead = Ahead { blocks: 3, offset: None };
    let samples = |x: usize, y: usize| sums.samples(12 * y + x);
    assert_eq!([samples(11, 7), samples(7, 8), samples(8, 8)], [5, 5, 4]);
    // A constant picture stays constant, by whatever part of a sample a pixel has.
    sums.sum.fill([4.0; 3]);
    sums.pending = (0..192).map(|pixel| [(sums.samples(pixel) - 4) as f32; 3]).collect();
    sums.albedo = (0..192).map(|pixel| [0.5 * sums.samples(pixel) as f32; 3]).collect();
    let albedo = &sums.to_image(&[Aov::Albedo]).channels["Albedo.G"];
    assert!(albedo.iter().all(|albedo| *albedo == 0.5), "{albedo:?}");
    let covered = |pixel| [[7, sums.samples(pixel)], [0; 2], [0; 2], [0; 2], [0; 2], [0; 2]];
    sums.objects = (0..192).map(covered).collect();
    let shares = &sums.to_image(&[Aov::CryptoObject]).channels["CryptoObject00.G"];
    assert!(shares.iter().all(|share| *share == 1.0), "{shares:?}");
    // A group of lights brings a quarter of it.
    let quarter = |of: &[[f32; 3]]| of.iter().map(|value| value.map(|v| 0.25 * v)).collect();
    let group = GroupSums {
        name: "lamps".into(),
        sum: quarter(&sums.sum),
        compensation: vec![[0.0; 3]; 192],
        pending: quarter(&sums.pending),
    };
    for offset in [None, Some([-0.4, 0.3])] {
        sums.ahead.offset = offset;
        for pixel in 0..192 {
            assert!((sums.mean(pixel)[1] - 1.0).abs() < 1e-12, "pixel {pixel}");
            assert!((sums.group_means(&group)(pixel)[1] - 0.25).abs() < 1e-12, "pixel {pixel}");
        }
    }
    // The first row of blocks alone is ahead, by a sample of 1: the row below has as much of it as the filter
    // reaches, the next one nothing.
    sums.sum.fill([0.0; 3]);
    sums.ahead = Ahead { blocks: 2, offset: Some([0.2, 0.3]) };
    sums.pending = (0..192).map(|pixel| [(sums.samples(pixel) - 4) as f32; 3]).collect();
    let [above, own, below] =
        [-0.7_f64, 0.3, 1.3].map(|distance| (-0.5 * (distance / 0.5).powi(2)).exp());
    let share = above / (above + own + below);
    for (row, expected) in [(0, 0.2), (6, 0.2), (8, share / (4.0 + share)), (9, 0.0)] {
        let found = sums.mean(12 * row + 5)[1];
        assert!((found - expected).abs() < 1e-6, "row {row}: {found}, expected {expected}");
    }
}

#[test]
fn mean_and_variance_agree_with_64_bit_sums() {
    for (sample_count, scale) in [(2, 1.0), (64, 1e-3), (1000, 1e4), (5000, 1.0)] {
        let (sums, drawn) = accumulate(&mut Random(7), sample_count, scale);
        for (pixel, values) in drawn.iter().enumerate() {
            let n = f64::from(sample_count);
            let mean = values.iter().sum::<f64>() / n;
            let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
            let variance = squares / (n - 1.0) / n;
            assert!((sums.mean(pixel)[0] / mean - 1.0).abs() < 1e-12);
            let found = sums.variance_of_mean(pixel)[0];
            assert!((found / variance - 1.0).abs() < 1e-5, "{found} against {variance}");
        }
    }
}

#[test]
fn relative_error_of_a_picture_worked_by_hand() {
    // Two pixels have two samples each: 0 and 2, but for 1 and 1 in red, and 3 and 3. With means 1 and 3,
    // mean standard errors ⅔ and 0, and image mean 2, expect the average of ⅔/√(1 + 0.04) and 0.
    let mut sums = Sums::new([0, 0], 2, 1, [2, 1]);
    assert_eq!(sums.relative_standard_error(), f64::INFINITY);
    sums.sum = vec![[2.0; 3], [6.0; 3]];
    sums.squares = vec![[2.0, 4.0, 4.0], [18.0; 3]];
    sums.sample_count = 2;
    assert_eq!(sums.variance_of_mean(0), [0.0, 1.0, 1.0]);
    let expected = 0.5 * (2.0 / 3.0) / 1.04_f64.sqrt();
    assert!((sums.relative_standard_error() - expected).abs() < 1e-15);
    let mut black = Sums::new([0, 0], 2, 1, [2, 1]);
    black.sample_count = 2;
    assert_eq!(black.relative_standard_error(), 0.0);
}

#[test]
fn relative_error_falls_as_one_over_root_n() {
    let error = |count| accumulate(&mut Random(3), count, 1.0).0.relative_standard_error();
    let ratio = error(100) / error(6400);
    assert!((ratio / 8.0 - 1.0).abs() < 0.1, "{ratio}");
}

#[test]
fn image_layers_have_pbrts_names_and_the_means() {
    let (sums, _) = accumulate(&mut Random(1), 10, 1.0);
    let image = sums.to_image(Aov::value_variants());
    let names: Vec<&str> = image.channels.keys().map(String::as_str).collect();
    let expected = "Albedo.B Albedo.G Albedo.R B CacheEntries.Y G GuideCell.B GuideCell.G \
                    GuideCell.R GuideLevel.B GuideLevel.G GuideLevel.R Hits.Y N.X N.Y N.Z P.X P.Y \
                    P.Z R SampleCount.Y ShadowRays.Y Unfiltered.B Unfiltered.G \
                    Unfiltered.R Variance.B Variance.G Variance.R Visible.Y";
    assert_eq!(names.join(" "), expected);
    assert_eq!((image.origin, image.film_size), ([3, 1], [10, 6]));
    assert_eq!(image.channels["Albedo.G"], [0.5; 8]);
    assert_eq!(image.channels["SampleCount.Y"], [10.0; 8]);
    assert_eq!(image.channels["Visible.Y"], [0.4; 8]);
    assert_eq!(image.channels["ShadowRays.Y"], [50.0; 8]);
    assert_eq!(image.channels["CacheEntries.Y"], [1.5; 8]);
    assert_eq!(image.channels["Hits.Y"], [20.0; 8]);
    assert_eq!(image.channels["GuideCell.B"], [0.25; 8]);
    assert_eq!(image.channels["GuideLevel.B"], [1.0; 8]);
    assert_eq!(image.channels["G"][5], sums.mean(5)[1] as f32);
    assert_eq!(image.channels["N.Z"][5], (f64::from(sums.normal[5][2]) / 10.0) as f32);
    let plain = sums.to_image(&[]);
    assert_eq!(plain.channels.keys().collect::<Vec<_>>(), ["B", "G", "R"]);
    let bare = Sums::new([0, 0], 1, 1, [1, 1]).to_image(&[Aov::Albedo, Aov::Visible]);
    assert_eq!(bare.channels.len(), 3, "layers without sums are left out");
}

#[test]
fn layers_may_be_called_by_their_names_in_the_file() {
    for (name, aov) in [
        ("variance", Aov::Variance),
        ("Variance", Aov::Variance),
        ("sample-count", Aov::SampleCount),
        ("SampleCount", Aov::SampleCount),
        ("Albedo", Aov::Albedo),
        ("N", Aov::Normal),
        ("P", Aov::Position),
        ("Visible", Aov::Visible),
        ("CacheEntries", Aov::CacheEntries),
        ("cache-entries", Aov::CacheEntries),
        ("GuideCell", Aov::GuideCell),
    ] {
        assert_eq!(Aov::from_str(name, false), Ok(aov), "{name}");
    }
}

#[test]
fn sums_that_are_not_finite_are_counted() {
    let mut sums = Sums::new([0, 0], 2, 2, [2, 2]);
    assert_eq!(sums.non_finite_count(), 0);
    sums.sum[1][2] = f32::NAN;
    sums.squares[1][0] = f32::INFINITY;
    sums.squares[3][0] = f32::INFINITY;
    assert_eq!(sums.non_finite_count(), 2);
    sums.pending = vec![[0.0; 3]; sums.pixel_count()];
    sums.pending[0][1] = f32::INFINITY;
    assert_eq!(sums.non_finite_count(), 3, "a sample of a stopped sweep counts as well");
}

#[test]
fn metadata_survives_the_attributes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.exr");
    let written = metadata(&[range(u32::MAX, 0, 64), range(9, 5, 6)]);
    let mut image = accumulate(&mut Random(1), 2, 1.0).0.to_image(&[]);
    written.store(&mut image);
    image.write_exr(&path).unwrap();
    let image = Image::read_exr(&path).unwrap();
    assert_eq!(Metadata::load(&image, &path).unwrap(), written);
    assert_eq!(image.attributes["samplesPerPixel"], Attribute::Integer(70));
    assert_eq!(image.attributes["renderTimeSeconds"], Attribute::Float(1.0 / 3.0));
    assert_error(Metadata::load(&Image::new(1, 1), &path), &["out.exr: no attribute fenestra."]);
    let mut broken = image.clone();
    let nonsense = Attribute::Text("7:0-64".to_owned());
    broken.attributes.insert("fenestra.sample_ranges".to_owned(), nonsense);
    assert_error(Metadata::load(&broken, &path), &["expected seed:first+count, found \"7:0-64\""]);
}

#[test]
fn sample_ranges_overlap_only_within_a_seed() {
    let overlaps = |a: SampleRange, b: SampleRange| {
        assert_eq!(a.overlaps(&b), b.overlaps(&a));
        a.overlaps(&b)
    };
    assert!(overlaps(range(1, 0, 64), range(1, 63, 1)));
    assert!(!overlaps(range(1, 0, 64), range(1, 64, 64)));
    assert!(!overlaps(range(1, 0, 64), range(2, 0, 64)));
    assert!(overlaps(range(1, u32::MAX, 2), range(1, u32::MAX, 1)));
    assert!(!overlaps(range(1, 5, 0), range(1, 0, 64)), "an empty range holds nothing");
    let mut joined = metadata(&[range(1, 64, 64)]);
    joined.add_ranges(&metadata(&[range(1, 0, 64), range(2, 128, 1)]));
    assert_eq!(joined.sample_ranges, [range(1, 0, 128), range(2, 128, 1)]);
    joined.add_ranges(&metadata(&[range(1, 128, 8), range(2, 0, 128)]));
    assert_eq!(joined.sample_ranges, [range(1, 0, 136), range(2, 0, 129)]);
}

#[test]
fn checkpoints_come_back_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = checkpoint_path(&folder.path().join("room.exr"));
    assert!(path.ends_with("room.checkpoint.exr"));
    let (mut sums, _) = accumulate(&mut Random(5), 1000, 1e3);
    sums.sum[0] = [-0.0, f32::MIN_POSITIVE / 8.0, f32::MAX];
    sums.visible[0] = [u32::MAX - 1, u32::MAX];
    sums.cache_entries[1] = [u32::MAX - 3, 16_777_217];
    let metadata = metadata(&[range(4, 0, 1000)]);
    let checkpoint = Checkpoint { sums, metadata: metadata.clone() };
    checkpoint.write(&path).unwrap();
    let read = Checkpoint::read(&path).unwrap();
    let bits = |values: &[[f32; 3]]| {
        values.as_flattened().iter().map(|value| value.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(bits(&read.sums.sum), bits(&checkpoint.sums.sum));
    assert_eq!(bits(&read.sums.compensation), bits(&checkpoint.sums.compensation));
    assert_eq!(read, checkpoint);
    let picture = Image::read_exr(&path).unwrap().rgb(&path).unwrap();
    assert_eq!(picture.pixels[3][1], checkpoint.sums.mean(3)[1] as f32, "viewers see the picture");
    // The film has one block, which cannot be ahead of others.
    let metadata = Metadata { ahead: Ahead { blocks: 1, offset: Some([0.25, -0.5]) }, ..metadata };
    Checkpoint { metadata, ..checkpoint }.write(&path).unwrap();
    assert_error(Checkpoint::read(&path), &["1 blocks of its film have further samples"]);
}

#[test]
fn a_checkpoint_without_its_sums_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.checkpoint.exr");
    let (sums, _) = accumulate(&mut Random(5), 4, 1.0);
    let checkpoint = Checkpoint { sums, metadata: metadata(&[range(4, 0, 4)]) };
    checkpoint.write(&path).unwrap();
    let image = Image::read_exr(&path).unwrap();
    let refused = |image: &Image, part: &str| {
        assert_error(Checkpoint::from_image(image, &path), &[part]);
    };

    let mut incomplete = image.clone();
    incomplete.channels.remove("Squares.G");
    refused(&incomplete, "no channels [\"Squares.R\", \"Squares.G\"");
    let mut plain = image.clone();
    plain.attributes.remove("fenestra.checkpoint");
    refused(&plain, "not a checkpoint");
    let mut newer = image.clone();
    newer.attributes.insert("fenestra.checkpoint".to_owned(), Attribute::Integer(6));
    refused(&newer, "another version: expected 5, found Integer(6)");
    let mut outside = image.clone();
    outside.origin = [-1, 0];
    refused(&outside, "outside the film");
    let mut broken = image;
    broken.channels.get_mut("Sum.R").unwrap()[3] = f32::NAN;
    refused(&broken, "1 pixels with sums that are not finite");
}

#[test]
fn a_checkpoint_of_another_render_is_refused_with_every_difference() {
    let (sums, _) = accumulate(&mut Random(5), 4, 1.0);
    let window = Sums::new(sums.origin, 4, 2, sums.film_size);
    let checkpoint = Checkpoint { sums, metadata: metadata(&[range(4, 8, 4)]) };
    let path = Path::new("room.checkpoint.exr");
    let at = |seed, first| Metadata { seconds: 0.0, ..metadata(&[range(seed, first, 0)]) };
    let expected = at(4, 8);
    checkpoint.check_resume(path, &expected, &window).unwrap();

    let mut other = at(5, 8);
    other.scene_hash = "cd34".to_owned();
    other.sampler = "mis".to_owned();
    other.sampler_parameters.clear();
    other.fit_hashes.clear();
    other.shadow_rays = 6;
    other.depth = 2;
    let smaller = Sums::new([0, 0], 3, 2, [10, 6]);
    let parts = [
        "room.checkpoint.exr: the checkpoint belongs to another render",
        "scene hash: ab12 against cd34",
        "sampler: ris against mis",
        "sampler parameter candidates: 4 against default",
        "fit of environment: 77ff against none",
        "shadow rays: 5 against 6",
        "depth: 1 against 2",
        "window: 4x2 at 3,1 of 10x6 against 3x2 at 0,0 of 10x6",
        "seed: 4 against 5",
        "--resume",
    ];
    assert_error(checkpoint.check_resume(path, &other, &smaller), &parts);
    let resumed = checkpoint.check_resume(path, &at(4, 0), &window);
    assert_error(resumed, &["first sample: 8 against 0"]);
    let mut merged = checkpoint.clone();
    merged.metadata.sample_ranges.push(range(9, 0, 4));
    assert_error(
        merged.check_resume(path, &expected, &window),
        &["a merged checkpoint cannot be continued"],
    );
    let mut bare = checkpoint.clone();
    bare.sums.albedo.clear();
    bare.sums.cache_entries.clear();
    bare.sums.guide_cell.clear();
    for layer in ["albedo", "cache-entries", "guide-cell"] {
        let part = format!("layer {layer}: absent against asked for");
        assert_error(bare.check_resume(path, &expected, &checkpoint.sums), &[&part]);
    }
    let mut grouped = checkpoint.sums.clone();
    grouped.groups.push(GroupSums { name: "key".to_owned(), ..GroupSums::default() });
    let resumed = checkpoint.check_resume(path, &expected, &grouped);
    assert_error(resumed, &["layer light-groups: absent against asked for"]);
}

/// Returns one accumulation of 30 samples, and the same samples in parts of 10 and 20.
fn whole_and_parts() -> (Checkpoint, Checkpoint, Checkpoint) {
    let checkpoint = |sums: Sums, first: u32| {
        let count = sums.sample_count;
        Checkpoint { sums, metadata: metadata(&[range(1, first, count)]) }
    };
    let whole = accumulate(&mut Random(11), 30, 10.0).0;
    let mut numbers = Random(11);
    let first = accumulate(&mut numbers, 10, 10.0).0;
    let second = accumulate(&mut numbers, 20, 10.0).0;
    (checkpoint(whole, 0), checkpoint(first, 0), checkpoint(second, 10))
}

fn assert_close(found: &Image, expected: &Image, tolerance: f32) {
    assert_eq!(
        found.channels.keys().collect::<Vec<_>>(),
        expected.channels.keys().collect::<Vec<_>>()
    );
    for (name, values) in &found.channels {
        for (found, expected) in values.iter().zip(&expected.channels[name]) {
            let allowed = tolerance * expected.abs().max(1e-3);
            assert!((found - expected).abs() <= allowed, "{name}: {found} against {expected}");
        }
    }
}

#[test]
fn merged_checkpoints_equal_one_run() {
    let (whole, first, second) = whole_and_parts();
    let (a, b) = (Path::new("a"), Path::new("b"));
    let merged = merge_checkpoints(&[(b, &second), (a, &first)]).unwrap();
    assert_eq!(merged.metadata.sample_ranges, [range(1, 0, 30)]);
    assert_eq!(merged.sums.sample_count, 30);
    assert_eq!(merged.sums.visible, whole.sums.visible);
    assert_eq!(merged.sums.cache_entries, whole.sums.cache_entries);
    assert_eq!(merged.sums.guide_level, whole.sums.guide_level);
    for pixel in 0..8 {
        for channel in 0..3 {
            let (found, expected) =
                (merged.sums.total(pixel)[channel], whole.sums.total(pixel)[channel]);
            // Both add the same floats, and each two-float sum keeps 48 bits.
            assert!((found / expected - 1.0).abs() < 1e-12, "{found} against {expected}");
            let squares = |sums: &Sums| sums.total_squares(pixel)[channel];
            let (found, expected) = (squares(&merged.sums), squares(&whole.sums));
            assert!((found / expected - 1.0).abs() < 1e-12, "{found} against {expected}");
        }
    }
    let all = Aov::value_variants();
    assert_close(&merged.sums.to_image(all), &whole.sums.to_image(all), 1e-5);
    // Order does not matter.
    let other = merge_checkpoints(&[(a, &first), (b, &second)]).unwrap();
    assert_eq!(other.sums, merged.sums);
    // Parts may have drawn from different numbers of candidates, each chosen by a measurement.
    assert_eq!(other.metadata.candidates, Some(4));
    let mut second = second.clone();
    second.metadata.candidates = Some(1);
    // Machines may differ too, and each has a name once.
    second.metadata.device = "card".to_owned();
    second.metadata.tracer = "device".to_owned();
    let mixed = merge_checkpoints(&[(a, &first), (b, &second)]).unwrap();
    assert_eq!(mixed.metadata.candidates, None);
    let Metadata { device, driver, tracer, .. } = &mixed.metadata;
    assert_eq!(device, "card + llvmpipe (LLVM 15, 256 bits) “ä”");
    assert_eq!((driver.as_str(), tracer.as_str()), ("Mesa 22.3.6", "Embree 3.13.5 + device"));
    // Half the samples are no layer of a group of lights.
    let with_group = |part: &Checkpoint| {
        let mut part = part.clone();
        let [sum, compensation] = [part.sums.sum.clone(), part.sums.compensation.clone()];
        let name = "key".to_owned();
        part.sums.groups.push(GroupSums { name, sum, compensation, pending: Vec::new() });
        part
    };
    let grouped = with_group(&first);
    let both = merge_checkpoints(&[(a, &grouped), (b, &with_group(&second))]).unwrap().sums;
    let GroupSums { sum, compensation, .. } = &both.groups[0];
    assert_eq!([sum, compensation], [&both.sum, &both.compensation]);
    for parts in [[(a, &grouped), (b, &second)], [(b, &second), (a, &grouped)]] {
        assert!(merge_checkpoints(&parts).unwrap().sums.groups.is_empty());
    }
}

#[test]
fn merged_images_equal_one_run_up_to_rounding() {
    let (whole, mut first, second) = whole_and_parts();
    // Shares of visible rays are weighted by the number of rays.
    first.sums.visible[2] = [1, 7];
    first.sums.cache_entries[3] = [9, 2];
    let all = Aov::value_variants();
    let images = [&first, &second].map(|checkpoint| checkpoint.sums.to_image(all));
    let part = |image, checkpoint: &'static str, metadata| Part {
        path: Path::new(checkpoint),
        image,
        metadata,
    };
    let parts = [part(&images[0], "a", &first.metadata), part(&images[1], "b", &second.metadata)];
    let (merged, metadata) = merge_images(&parts).unwrap();
    let mut expected = whole.sums.clone();
    expected.visible[2] = [1 + 40, 7 + 100];
    expected.cache_entries[3] = [9 + 60, 2 + 40];
    assert_close(&merged, &expected.to_image(all), 1e-5);
    assert_eq!(metadata.sample_ranges, [range(1, 0, 30)]);
    assert_eq!(metadata.gpu_seconds["trace"], 0.2);
    assert_eq!(merged.attributes["samplesPerPixel"], Attribute::Integer(30));
    assert_eq!((merged.origin, merged.film_size), ([3, 1], [10, 6]));
}

/// Parts have other seeds and layers: the file names no seed and describes no layer that it lacks.
#[test]
fn merged_images_say_nothing_that_is_true_of_one_part_alone() {
    let (_, first, second) = whole_and_parts();
    let mut other = second.metadata.clone();
    other.sample_ranges = vec![range(2, 0, 20)];
    other.candidates = Some(1);
    other.mattes.clear();
    let mut images = [&first, &second].map(|checkpoint| checkpoint.sums.to_image(&[]));
    first.metadata.store(&mut images[0]);
    other.store(&mut images[1]);
    let path = Path::new("merged.exr");
    let parts = [(&images[0], &first.metadata), (&images[1], &other)];
    let parts = parts.map(|(image, metadata)| Part { path, image, metadata });
    let (merged, metadata) = merge_images(&parts).unwrap();
    assert_eq!(Metadata::load(&merged, path).unwrap(), metadata);
    assert_eq!((metadata.candidates, metadata.mattes.len()), (None, 0));
    assert!(!merged.attributes.contains_key("fenestra.seed"));
}

#[test]
fn windows_join_to_the_film_to_the_bit() {
    let (whole, ..) = whole_and_parts();
    let image = whole.sums.to_image(Aov::value_variants());
    let at = |x: u32, y: u32, width: u32, height: u32| {
        let window = Window { x: 3 + x, y: 1 + y, width, height };
        image.cropped(window, Path::new("whole.exr")).unwrap()
    };
    // The second overlaps the first, which gives the pixels of both.
    let mut windows = [at(0, 0, 2, 2), at(1, 0, 3, 1), at(2, 1, 2, 1)];
    windows[1].channels.values_mut().for_each(|values| values[0] = -1.0);
    let names = ["a.exr", "b.exr", "c.exr"].map(Path::new);
    let parts: Vec<Part<'_>> = (names.iter().zip(&windows))
        .map(|(path, image)| Part { path, image, metadata: &whole.metadata })
        .collect();
    let (joined, metadata) = join_windows(&parts).unwrap();
    assert_eq!((joined.origin, joined.width, joined.height), (image.origin, 4, 2));
    assert_eq!(joined.channels, image.channels);
    assert_eq!(metadata.sample_ranges, whole.metadata.sample_ranges);
    assert_eq!(metadata.gpu_seconds["trace"], 3.0 * whole.metadata.gpu_seconds["trace"]);
    assert_error(join_windows(&parts[..2]), &["pixel 5,2 of its film lies in no part"]);
    let mut other = whole.metadata.clone();
    other.sample_ranges = vec![range(2, 0, 30)];
    let joined = join_windows(&[parts[0], Part { metadata: &other, ..parts[1] }]);
    assert_error(joined, &["b.exr: no window of one film with a.exr: samples: "]);
    let larger = Image { film_size: [11, 6], ..windows[1].clone() };
    let joined = join_windows(&[parts[0], Part { image: &larger, ..parts[1] }]);
    assert_error(joined, &["film: [11, 6] against [10, 6] pixels"]);
    assert!(join_windows(&[]).is_err());
}

#[test]
fn merging_leaves_out_channels_that_a_part_lacks() {
    let (_, first, second) = whole_and_parts();
    let rich = first.sums.to_image(&[Aov::Albedo, Aov::Variance]);
    let plain = second.sums.to_image(&[Aov::Variance]);
    let parts = [
        Part { path: Path::new("a"), image: &rich, metadata: &first.metadata },
        Part { path: Path::new("b"), image: &plain, metadata: &second.metadata },
    ];
    let (merged, _) = merge_images(&parts).unwrap();
    assert_eq!(
        merged.channels.keys().collect::<Vec<_>>(),
        ["B", "G", "R", "Variance.B", "Variance.G", "Variance.R"]
    );
}

#[test]
fn parts_that_do_not_belong_together_are_refused() {
    let (_, first, second) = whole_and_parts();
    let (a, b) = (Path::new("a.exr"), Path::new("b.exr"));
    let message = |first: &Checkpoint, second: &Checkpoint| {
        let exact = merge_checkpoints(&[(a, first), (b, second)]).unwrap_err().to_string();
        let images = [first, second].map(|checkpoint| checkpoint.sums.to_image(&[]));
        let parts = [
            Part { path: a, image: &images[0], metadata: &first.metadata },
            Part { path: b, image: &images[1], metadata: &second.metadata },
        ];
        assert_eq!(merge_images(&parts).unwrap_err().to_string(), exact);
        exact
    };
    let mut other = second.clone();
    other.metadata.sample_ranges = vec![range(1, 9, 20)];
    let text = message(&first, &other);
    assert!(
        text.contains("b.exr: holds samples 9..29 of seed 1, but a.exr holds samples 0..10"),
        "{text}"
    );
    let mut other = second.clone();
    other.metadata.scene_hash = "cd34".to_owned();
    let text = message(&first, &other);
    assert!(text.contains("not of one render with a.exr: scene hash: cd34 against ab12"), "{text}");
    let mut other = second.clone();
    other.sums.origin = [0, 0];
    let text = message(&first, &other);
    assert!(text.contains("b.exr: shows 4x2 pixels at 0,0 of 10x6"), "{text}");
    assert!(merge_checkpoints(&[]).is_err() && merge_images(&[]).is_err());
}

#[test]
fn previews_apply_exposure_and_the_srgb_curve() {
    // IEC 61966-2-1: 0.5 linear is 188, 0.0021 is on the linear foot.
    assert_eq!(display_from_linear(0.5), 188);
    assert_eq!(display_from_linear(0.0021), 7);
    assert_eq!(display_from_linear(-1.0), 0);
    assert_eq!(display_from_linear(7.0), 255);
    assert_eq!(display_from_linear(f32::NAN), 0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("preview.png");
    let picture = RgbImage { width: 2, height: 1, pixels: vec![[0.25, 0.5, 1.0], [0.0; 3]] };
    write_preview(&path, &picture, 1.0).unwrap();
    let read = image::open(&path).unwrap().into_rgb8();
    assert_eq!(read.dimensions(), (2, 1));
    assert_eq!(read.into_raw(), [188, 255, 255, 0, 0, 0]);
}
