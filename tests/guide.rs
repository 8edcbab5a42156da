//! The sampler `guided` on the host: the partition of the environment, the estimates of cells, and
//! the estimators by exact enumeration.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]

use fenestra::{
    math::random::{hash_4d, random_independent_2d},
    sampler::guided::{
        ARRIVAL_DIRECTIONS, CellKey, Guide, PARTS_PER_RAY, decode_entry, decode_visibility, ratios,
    },
    sampler::regions::{FACE_COUNT, PARENT_COUNT, Partition, Rectangle, Region},
    scene::environment::{EnvironmentMap, EnvironmentTables},
    shader::{
        rooms::guided::{self, GUIDE_NO_KEY, GUIDE_REFINED, GUIDE_RESPONSE_UNITS},
        spirv::used_bindings,
    },
};
use glam::Vec3;

use crate::{
    support::{scenes, statistics::chi_square_p_value},
    twin::{environment::EnvironmentSampling as _, regions::choose_cell},
};

/// A sky with a small sun and a black ground: bright, dim and empty regions.
fn sunny() -> EnvironmentMap {
    let sun = Vec3::new(0.3, 0.5, -0.8).normalize();
    let mut map = scenes::environment(96, |direction| {
        if direction.y < -0.3 {
            return Vec3::ZERO;
        }
        Vec3::new(0.3, 0.5, 1.0) * (1.2 + direction.y)
            + 3000.0 * Vec3::splat(((direction.dot(sun) - 1.0) * 900.0).exp())
    });
    map.rotation_rad = -0.7;
    map
}

#[test]
fn regions_are_nested_rectangles_that_fill_the_map() {
    let map = sunny();
    let coarse = Partition::new(&map, PARENT_COUNT);
    let fine = Partition::new(&map, 256);
    assert_eq!((coarse.regions.len(), fine.regions.len()), (PARENT_COUNT, 256));
    let mut covered = vec![0; (map.width * (map.height + 1)) as usize];
    for (index, Region { rectangle, .. }) in fine.regions.iter().enumerate() {
        for row in rectangle.rows() {
            for cell in rectangle.cells(row, map.width as usize) {
                covered[cell] += 1;
                assert_eq!(usize::from(fine.region_of_cell[cell]), index);
                let parent = usize::from(coarse.region_of_cell[cell]);
                assert_eq!(rectangle.parent, parent, "the first 64 rectangles are the parents");
            }
        }
    }
    assert!(covered.iter().all(|count| *count == 1), "every cell lies in one region");
    let sum = |value: &dyn Fn(&Region) -> f64| -> f64 { fine.regions.iter().map(value).sum() };
    assert!((sum(&|region| region.share) - 1.0).abs() < 1e-12);
    assert!((sum(&|region| region.solid_angle) - 1.0).abs() < 1e-12);
    let brightest = fine.regions.iter().max_by(|a, b| a.share.total_cmp(&b.share)).unwrap();
    assert!(brightest.solid_angle < 1e-3, "the sun has a region of its own: {brightest:?}");
}

#[test]
fn small_and_black_maps_have_fewer_regions() {
    let constant = EnvironmentMap::constant(Vec3::ONE, 1.0).unwrap();
    assert_eq!(Partition::new(&constant, 1024).regions.len(), 1024);
    let tiny = scenes::environment(4, |_| Vec3::ONE);
    let partition = Partition::new(&tiny, 256);
    assert_eq!(partition.regions.len(), 4 * 3);
    let parents = partition.regions.iter().map(|region| region.rectangle.parent);
    assert!(parents.eq(0..4 * 3));
    let black = Partition::new(&scenes::environment(16, |_| Vec3::ZERO), 256);
    assert_eq!(black.regions.len(), 1);
    assert_eq!(black.regions[0].share, 0.0);
}

/// Splits the sunny map again, with importance in its eastern half only.
fn eastern(partition: &Partition) -> Partition {
    let importance: Vec<f64> = partition
        .regions
        .iter()
        .map(|region| if region.direction.x > 0.0 { 1.0 } else { 0.01 })
        .collect();
    partition.split_by(&importance, partition.regions.len()).expect("the map has enough cells")
}

#[test]
fn regions_are_split_again_where_they_matter() {
    let map = sunny();
    let before = Partition::new(&map, 256);
    let after = eastern(&before);
    let in_the_east = |partition: &Partition| {
        partition.regions.iter().filter(|region| region.direction.x > 0.0).count()
    };
    assert_eq!(after.regions.len(), 256);
    assert!(in_the_east(&before) < 180 && in_the_east(&after) > 220, "{}", in_the_east(&after));
    let sum: f64 = after.regions.iter().map(|region| region.share).sum();
    assert!((sum - 1.0).abs() < 1e-12);
    assert!(after.regions.iter().all(|region| region.rectangle.parent < PARENT_COUNT));
    // Uniform importance restores the first regions, to the bit.
    let again = after.split_by(&[1.0; 256], 256).unwrap();
    assert_eq!((&again.regions, &again.entries), (&before.regions, &before.entries));
    // Split into more regions, and into fewer again.
    let more = after.split_by(&[1.0; 256], 1024).unwrap();
    assert_eq!(more.regions.len(), 1024);
    let sum: f64 = more.regions.iter().map(|region| region.share).sum();
    assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    let again = more.split_by(&[1.0; 1024], 256).unwrap();
    assert_eq!((&again.regions, &again.entries), (&before.regions, &before.entries));
}

#[test]
fn rectangles_restore_the_regions_unless_they_are_damaged() {
    let map = sunny();
    let partition = Partition::new(&map, 256);
    let other = eastern(&partition);
    let rectangles = other.rectangles();
    let restored = partition.with_rectangles(&rectangles).unwrap();
    assert_eq!((&restored.regions, &restored.entries), (&other.regions, &other.entries));
    assert_eq!(restored.region_of_cell, other.region_of_cell);
    let refused = |change: &dyn Fn(&mut Vec<[u32; 5]>)| {
        let mut damaged = rectangles.clone();
        change(&mut damaged);
        assert!(partition.with_rectangles(&damaged).is_none());
    };
    refused(&|all| all[3][2] += 1);
    refused(&|all| all[3][2] -= 1);
    refused(&|all| all[0][0] = u32::MAX);
    refused(&|all| all[7] = all[6]);
    refused(&|all| all[9][4] = 64);
    refused(&|all| {
        all.pop();
    });
}

#[test]
fn counts_follow_the_regions() {
    let map = sunny();
    let before = Partition::new(&map, 64);
    let after = eastern(&before);
    let mut guide = guide_of(&before, 1 << 12, 1 << 14);
    // Sum over regions with energy: black ones receive no counts.
    let sums = |guide: &Guide, cell: usize, partition: &Partition| {
        let counts = guide.counts(cell).iter().zip(&partition.regions);
        counts
            .filter(|(_, region)| region.share > 0.0)
            .fold((0, 0), |sum, (count, _)| (sum.0 + count.hits, sum.1 + count.trials))
    };
    let seeing = guide.keys().iter().position(|key| *key == CellKey::fine([3, 4, 5], 6, 2));
    let cell = seeing.unwrap();
    let old = sums(&guide, cell, &before);
    guide.carry_over(&before, &after, 64);
    let new = sums(&guide, cell, &after);
    // Each share is rounded to a sixteenth of a ray.
    assert!(new.1.abs_diff(old.1) < 64 && new.0.abs_diff(old.0) < 64, "{old:?} → {new:?}");
    // Regions keep the visibility of their part of the sky.
    for (region, count) in after.regions.iter().zip(guide.counts(cell)) {
        if region.direction.x.abs() > 0.4 && count.trials >= 16 {
            let rate = count.hits as f64 / count.trials as f64;
            let expected = if region.direction.x > 0.0 { 1.0 } else { 0.0 };
            assert!((rate - expected).abs() < 0.3, "{rate} {region:?}");
        }
    }
    let shares = before.shares_in(&after);
    for (region, shares) in before.regions.iter().zip(&shares) {
        let sum: f64 = shares.iter().map(|(_, share)| share).sum();
        assert!((sum - if region.share > 0.0 { 1.0 } else { 0.0 }).abs() < 1e-12);
    }
}

/// Integrates the density over the cells of every region by quadrature.
#[test]
fn the_density_integrates_to_one_over_every_region() {
    let map = sunny();
    let tables = EnvironmentTables::new(&map);
    let partition = Partition::new(&map, 64);
    let mut integrals = vec![0.0; partition.regions.len()];
    // Gauss-Legendre points in every cell: two are exact for the bilinear patch, except for the
    // variation of the sine, which the density divides by.
    let offsets = [0.5 - 0.5 / 3.0_f64.sqrt(), 0.5 + 0.5 / 3.0_f64.sqrt()];
    let (width, height) = (f64::from(map.width), f64::from(map.height));
    for row in 0..=map.height {
        let (top, extent) = match row {
            0 => (0.0, 0.5),
            row if row == map.height => (height - 0.5, 0.5),
            row => (f64::from(row) - 0.5, 1.0),
        };
        for column in 0..map.width {
            let region = partition.region_of_cell[(row * map.width + column) as usize];
            for (dx, dy) in offsets.iter().flat_map(|x| offsets.iter().map(move |y| (*x, *y))) {
                let u = ((f64::from(column) + 0.5 + dx) / width).fract();
                let v = (top + extent * dy) / height;
                let direction = direction_from(&map, u, v);
                let radiance = map.radiance(direction);
                let pdf = f64::from(tables.pdf(&map, direction, radiance));
                let jacobian =
                    2.0 * std::f64::consts::PI.powi(2) * (std::f64::consts::PI * v).sin();
                integrals[usize::from(region)] += pdf * jacobian * 0.25 * extent / (width * height);
            }
        }
    }
    for (region, integral) in partition.regions.iter().zip(&integrals) {
        if region.share > 0.0 {
            let ratio = integral / region.share;
            assert!((ratio - 1.0).abs() < 2e-2, "{ratio} over {region:?}");
        }
    }
    assert!((integrals.iter().sum::<f64>() - 1.0).abs() < 1e-3);
}

/// World direction of lat-long coordinates of the map.
fn direction_from(map: &EnvironmentMap, u: f64, v: f64) -> Vec3 {
    let (azimuth, theta) = (2.0 * std::f64::consts::PI * u, std::f64::consts::PI * v);
    let (s, c) = f64::from(map.rotation_rad).sin_cos();
    let (x, z) = (-theta.sin() * azimuth.sin(), theta.sin() * azimuth.cos());
    glam::DVec3::new(c * x + s * z, theta.cos(), c * z - s * x).as_vec3()
}

#[test]
fn samples_of_a_region_have_its_density() {
    let map = sunny();
    let tables = EnvironmentTables::new(&map);
    let partition = Partition::new(&map, 64);
    for (index, region) in partition.regions.iter().enumerate().step_by(5) {
        let Rectangle { first, size, .. } = region.rectangle;
        let count = size[0] * size[1];
        if region.share <= 0.0 || count < 4 {
            continue;
        }
        let energy = |cell: [u32; 2]| -> f64 {
            // P_cell from the cumulative tables of the map
            let column = tables.cell_cumulative(&map, cell[1] as usize);
            let before = if cell[0] > 0 { column[cell[0] as usize - 1] } else { 0.0 };
            let row = tables.row_cumulative(&map);
            let above = if cell[1] > 0 { row[cell[1] as usize - 1] } else { 0.0 };
            f64::from(column[cell[0] as usize] - before) * f64::from(row[cell[1] as usize] - above)
        };
        let cell_of = |index: u32| [first[0] + index % size[0], first[1] + index / size[0]];
        let expected: Vec<f64> = (0..count).map(|index| energy(cell_of(index))).collect();
        let mut observed = vec![0.0; count as usize];
        for sample in 0..20_000 {
            let bits = hash_4d([sample, index as u32, 7, 1]);
            let cell = choose_cell(&partition, index, [bits[0], bits[1]]);
            let local = [cell[0] - first[0], cell[1] - first[1]];
            observed[(local[1] * size[0] + local[0]) as usize] += 1.0;
            if sample < 50 {
                let u = random_independent_2d(sample, 0, index as u32, 2);
                let drawn = tables.sample_cell(&map, cell, u);
                let pdf = tables.pdf(&map, drawn.direction, drawn.radiance);
                assert!((drawn.pdf / pdf - 1.0).abs() < 1e-3, "{} {pdf}", drawn.pdf);
            }
        }
        if expected.iter().filter(|e| **e > 0.0).count() > 2 {
            let p = chi_square_p_value(&observed, &expected);
            assert!(p > 1e-5, "region {index}: p = {p}");
        }
    }
}

/// Draws many regions from the entries of a cell as the shader does and compares with their ratios.
#[test]
fn entries_hold_the_probabilities_they_are_drawn_with() {
    let map = sunny();
    let partition = Partition::new(&map, 64);
    let guide = guide_of(&partition, 1 << 12, 1 << 14);
    let snapshot = guide.snapshot(&partition);
    let regions = partition.regions.len();
    for cell in [0, FACE_COUNT, guide.cell_count() - 1] {
        let entries = &snapshot.entries[cell * regions..][..regions];
        let shares = || partition.regions.iter().map(|region| region.share);
        let expected: Vec<f64> =
            ratios(entries, shares()).zip(shares()).map(|(ratio, share)| ratio * share).collect();
        assert!((expected.iter().sum::<f64>() - 1.0).abs() < 1e-6);
        let mut observed = vec![0.0; regions];
        for sample in 0..200_000 {
            let bits = hash_4d([sample, cell as u32, 3, 3]);
            observed[choose_region(entries, bits[0])] += 1.0;
        }
        let p = chi_square_p_value(&observed, &expected);
        assert!(p > 1e-5, "cell {cell}: p = {p}");
        for (entry, probability) in entries.iter().zip(&expected) {
            let weight = decode_entry(*entry).2;
            // An entry that begins where the next one does would stand for all.
            assert!(*probability < 1.0, "every region with energy can be drawn");
            assert!((7e-4..=1.0).contains(&weight));
        }
    }
}

/// Region that `bits` choose among the entries of a cell; twin of `draw_guided`.
fn choose_region(entries: &[u32], bits: u32) -> usize {
    let start = |interval: usize| decode_entry(entries[interval]).1 as usize;
    let interval = ((u64::from(bits) * entries.len() as u64) >> 32) as usize;
    let mut low = if interval == 0 { 0 } else { start(interval) };
    let mut high = start((interval + 1) % entries.len());
    while low < high {
        let middle = (low + high).div_ceil(2);
        if decode_entry(entries[middle]).0 <= bits >> 16 {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    low
}

/// A guide with counts: one fine cell sees the eastern regions, another sees nothing.
fn guide_of(partition: &Partition, capacity: usize, slots: usize) -> Guide {
    let mut guide = Guide::new(partition.regions.len(), capacity, slots);
    let keys = [CellKey::fine([3, 4, 5], 6, 2), CellKey::fine([40, 4, 5], 6, 2)];
    guide.add_cells(&keys.map(|key| key.0));
    let regions = partition.regions.len();
    let mut counted = vec![[0_u32; 3]; guide.cell_count() * regions];
    for (cell, key) in guide.keys().iter().enumerate() {
        for (region, count) in partition.regions.iter().zip(&mut counted[cell * regions..]) {
            let sees = *key == keys[0] && region.direction.x > 0.0;
            if !key.is_coarse() && cell >= FACE_COUNT {
                let hits = if sees { 40 } else { 0 };
                *count = [40, hits, hits * GUIDE_RESPONSE_UNITS / 10];
            }
        }
    }
    guide.add(0, &counted);
    guide
}

#[test]
fn cells_learn_and_fall_back_on_their_surroundings() {
    let map = sunny();
    let partition = Partition::new(&map, 64);
    let mut guide = guide_of(&partition, 1 << 12, 1 << 14);
    // Add a neighbour of the first cell without rays, and a stranger on another face.
    let neighbour = CellKey::fine([2, 4, 5], 6, 2);
    let stranger = CellKey::fine([3, 4, 5], 6, 3);
    guide.add_cells(&[neighbour.0, stranger.0]);
    let snapshot = guide.snapshot(&partition);
    let regions = partition.regions.len();
    let share_east = |key: CellKey| -> f64 {
        let slot = snapshot.table.iter().find(|entry| entry[0] == key.0).unwrap();
        let entries = &snapshot.entries[slot[1] as usize * regions..][..regions];
        let shares = partition.regions.iter().map(|region| region.share);
        ratios(entries, shares)
            .zip(&partition.regions)
            .filter(|(_, region)| region.direction.x > 0.0)
            .map(|(ratio, region)| ratio * region.share)
            .sum()
    };
    let prior: f64 = partition
        .regions
        .iter()
        .filter(|region| region.direction.x > 0.0)
        .map(|region| region.share)
        .sum();
    let seen = share_east(CellKey::fine([3, 4, 5], 6, 2));
    let blind = share_east(CellKey::fine([40, 4, 5], 6, 2));
    assert!(seen > 0.9, "{seen}");
    assert!(share_east(neighbour) > 0.8, "through the coarse cell: {}", share_east(neighbour));
    assert!((share_east(stranger) - prior).abs() < 0.25, "{} {prior}", share_east(stranger));
    assert!(blind < seen, "{blind}");
}

/// Two regions are equally visible and one is reflected ten times as strongly: compares their
/// probabilities in the cell that counted it and in its neighbour.
#[test]
fn cells_learn_what_their_surfaces_reflect() {
    const RAYS: u32 = 4000;
    let map = sunny();
    let partition = Partition::new(&map, 64);
    let regions = partition.regions.len();
    let cell = CellKey::fine([3, 4, 5], 6, 2);
    let neighbour = CellKey::fine([2, 4, 5], 6, 2);
    let mut guide = Guide::new(regions, 1 << 12, 1 << 14);
    guide.add_cells(&[cell.0, neighbour.0]);
    // The two regions of most energy above the horizon of the face, whose normal points up
    let mut bright: Vec<usize> =
        (0..regions).filter(|&index| partition.regions[index].direction.y > 0.2).collect();
    bright.sort_by(|a, b| partition.regions[*b].share.total_cmp(&partition.regions[*a].share));
    let [strong, weak] = [bright[0], bright[1]];
    let place = guide.keys().iter().position(|key| *key == cell).unwrap();
    let mut counted = vec![[0_u32; 3]; guide.cell_count() * regions];
    for index in 0..regions {
        let response = match index {
            _ if index == strong => RAYS * GUIDE_RESPONSE_UNITS / 2,
            _ if index == weak => RAYS * GUIDE_RESPONSE_UNITS / 20,
            _ => 0,
        };
        let hits = if response > 0 { RAYS } else { 0 };
        counted[place * regions + index] = [RAYS, hits, response];
    }
    guide.add(0, &counted);
    let ratio = |key: CellKey| {
        let snapshot = guide.snapshot(&partition);
        let slot = snapshot.table.iter().find(|entry| entry[0] == key.0).unwrap();
        let entries = &snapshot.entries[slot[1] as usize * regions..][..regions];
        let shares = partition.regions.iter().map(|region| region.share);
        let densities: Vec<f64> = ratios(entries, shares).collect();
        densities[strong] / densities[weak]
    };
    // The defensive share ignores the counts and lowers the ratio a little.
    assert!((8.0..10.5).contains(&ratio(cell)), "{}", ratio(cell));
    assert!(ratio(neighbour) > 5.0, "through the coarse cell: {}", ratio(neighbour));
    // Counts survive a file to the bit, also where they were halved.
    let many: Vec<_> = counted.iter().map(|count| count.map(|word| 16 * word)).collect();
    guide.add(0, &many);
    guide.add(0, &many);
    let again = Guide::resume(regions, 1 << 12, 1 << 14, &guide.state(), 1);
    assert_eq!(again.state().counts, guide.state().counts);
    assert_eq!(again.snapshot(&partition), guide.snapshot(&partition));
    assert!(guide.counts(place)[strong].trials <= 65_536 * PARTS_PER_RAY);
    // A divisor makes what is old count less, evidence of shares included.
    let mut state = guide.state();
    state.shares.fill(6);
    let older = Guide::resume(regions, 1 << 12, 1 << 14, &state, 2).state();
    assert!(older.shares.iter().all(|share| *share == 3));
    assert!(older.counts.iter().zip(&state.counts).all(|(half, all)| half[0] == all[0] / 2));
}

/// Four cells: the first sees half of the rays of every region; the second all rays of half of the
/// regions; the third is the first with few rays; the fourth sees a quarter of the rays of every
/// region.
#[test]
fn cells_are_refined_whose_rays_disagree() {
    const RAYS: u32 = 40;
    let map = sunny();
    let partition = Partition::new(&map, 64);
    let regions = partition.regions.len();
    let keys: Vec<CellKey> =
        [3, 40, 80, 120].iter().map(|&x| CellKey::fine([x, 4, 5], 6, 2)).collect();
    let [mixed, certain, unknown, other] = keys[..] else { panic!("four cells") };
    let learn = |capacity: usize| {
        let mut guide = Guide::new(regions, capacity, 1 << 14);
        guide.add_cells(&keys.iter().map(|key| key.0).collect::<Vec<u32>>());
        let mut counted = vec![[0_u32; 3]; guide.cell_count() * regions];
        for (key, counts) in guide.keys().iter().zip(counted.chunks_mut(regions)) {
            for (region, count) in counts.iter_mut().enumerate() {
                *count = match *key {
                    key if key == mixed => [RAYS, RAYS / 2, RAYS],
                    key if key == other => [RAYS, RAYS / 4, RAYS],
                    key if key == certain && region % 2 == 0 => [RAYS, RAYS, RAYS],
                    key if key == certain => [RAYS, 0, 0],
                    key if key == unknown && region % 2 == 0 => [2, 1, 1],
                    _ => [0; 3],
                };
            }
        }
        guide.add(0, &counted);
        guide.refine();
        guide
    };
    let refined = |guide: &Guide| -> Vec<CellKey> {
        guide.state().refined.iter().map(|&cell| guide.keys()[cell as usize]).collect()
    };
    let mut guide = learn(1 << 12);
    assert_eq!(refined(&guide), [mixed, other], "the greatest variance first");
    guide.refine();
    assert_eq!(guide.state().refined.len(), 2, "once only");
    // Leave room for four more cells, besides the eighth that stays free for cells not seen yet.
    let cells = guide.cell_count();
    assert_eq!(refined(&learn((cells + 4) * 8 / 7 + 1)), [mixed]);
    assert!(refined(&learn(cells)).is_empty());

    // Children become cells without coarse cells of their own; their prior is their parent.
    let child = |x: i32| CellKey::fine([x, 9, 10], 5, 2);
    let (here, there) = (child(6), child(81));
    guide.add_cells(&[here.0, there.0]);
    assert_eq!(guide.cell_count(), cells + 3);
    let is_cell = |key: CellKey| guide.keys().contains(&key);
    assert!(is_cell(here) && is_cell(there) && is_cell(there.coarse()) && !is_cell(here.coarse()));
    let slot = |guide: &Guide, key: CellKey| {
        let snapshot = guide.snapshot(&partition);
        let slot = *snapshot.table.iter().find(|entry| entry[0] == key.0).unwrap();
        let cell = (slot[1] & (GUIDE_REFINED - 1)) as usize;
        (slot[1], snapshot.entries[cell * regions..][..regions].to_vec())
    };
    assert_ne!(slot(&guide, mixed).0 & GUIDE_REFINED, 0);
    assert_eq!(slot(&guide, certain).0 & GUIDE_REFINED, 0);
    assert_eq!(slot(&guide, here).0 & GUIDE_REFINED, 0);
    let visibility =
        |guide: &Guide, key: CellKey, region: usize| decode_visibility(slot(guide, key).1[region]);
    let shining = (0..regions).filter(|&region| partition.regions[region].share > 0.0);
    for region in shining.clone() {
        let (parent, child) = (visibility(&guide, mixed, region), visibility(&guide, here, region));
        assert!((child / parent - 1.0).abs() < 0.3, "{child} instead of {parent}");
    }
    // Counts of the child are also those of its parent.
    let before = visibility(&guide, mixed, 7);
    let mut counted = vec![[0_u32; 3]; guide.cell_count() * regions];
    let cell = guide.keys().iter().position(|key| *key == here).unwrap();
    counted[cell * regions..][..regions].fill([RAYS, 0, 0]);
    guide.add(0, &counted);
    for region in shining {
        assert!(visibility(&guide, here, region) < 0.1);
    }
    assert!(visibility(&guide, mixed, 7) < 0.8 * before);

    let again = Guide::resume(regions, 1 << 12, 1 << 14, &guide.state(), 1);
    assert_eq!(again.state().refined, guide.state().refined);
    assert_eq!(again.snapshot(&partition), guide.snapshot(&partition));
}

#[test]
fn overflow_and_collisions_fall_back() {
    let map = sunny();
    let partition = Partition::new(&map, 16);
    let missing: Vec<u32> = (0..500)
        .map(|index| CellKey::fine([index % 50, index / 50, 0], 3, 2).0)
        .chain([GUIDE_NO_KEY, 0xf000_0000, CellKey::fine([0; 3], 0, 0).coarse().0])
        .collect();
    let mut guide = Guide::new(partition.regions.len(), 64, 64);
    guide.add_cells(&missing);
    assert_eq!(guide.cell_count(), 64, "no more than there is room for");
    let coarse = guide.keys()[FACE_COUNT..].iter().filter(|key| key.is_coarse()).count();
    assert_eq!(coarse, 13 * 3, "coarse cells come first");
    let snapshot = guide.snapshot(&partition);
    let entered = snapshot.table.iter().filter(|entry| entry[0] != GUIDE_NO_KEY).count();
    assert!(entered <= 58, "{entered}");
    // A table far too small leaves cells out, and nothing breaks.
    let mut crowded = Guide::new(partition.regions.len(), 400, 16);
    crowded.add_cells(&missing);
    let snapshot = crowded.snapshot(&partition);
    assert!(snapshot.table.iter().all(|entry| entry[0] != GUIDE_NO_KEY), "16 slots are full");
    assert_eq!(snapshot.entries.len(), crowded.cell_count() * partition.regions.len() + 1);
}

#[test]
fn the_order_in_which_cells_are_found_does_not_matter() {
    let map = sunny();
    let partition = Partition::new(&map, 32);
    let missing: Vec<u32> =
        (0..300).map(|index| CellKey::fine([index, 7, index / 3], 4, 1).0).collect();
    let mut repeated: Vec<u32> = missing.iter().rev().copied().collect();
    repeated.extend(&missing[20..90]);
    let snapshot = |missing: &[u32]| {
        let mut guide = Guide::new(partition.regions.len(), 128, 512);
        guide.add_cells(missing);
        guide.snapshot(&partition)
    };
    assert_eq!(snapshot(&missing), snapshot(&repeated));
}

/// A toy environment of four directions: light if visible, visibility, two densities, and an
/// estimate of the visibility.
struct Toy {
    integrand: [f64; 4],
    visible: [f64; 4],
    brdf: [f64; 4],
    guided: [f64; 4],
    guess: [f64; 4],
}

const TOY: Toy = Toy {
    integrand: [4.0, 1.0, 2.5, 0.5],
    visible: [1.0, 0.0, 0.0, 1.0],
    brdf: [0.1, 0.2, 0.3, 0.4],
    guided: [0.55, 0.05, 0.1, 0.3],
    guess: [0.9, 0.02, 0.3, 0.05],
};

impl Toy {
    fn truth(&self) -> f64 {
        self.integrand.iter().zip(self.visible).map(|(value, seen)| value * seen).sum()
    }

    /// Expectation of the resampled estimate with `from_brdf` and `from_guide` candidates, over
    /// every tuple of candidates and every choice; `brdf_part` is the weight of the density of the
    /// BRDF.
    fn resampled(&self, from_brdf: u32, from_guide: u32, brdf_part: f64) -> f64 {
        let count = from_brdf + from_guide;
        let pdf = |y: usize| brdf_part * self.brdf[y] + (1.0 - brdf_part) * self.guided[y];
        let unguided = |y: usize| self.integrand[y] / pdf(y);
        let guided = |y: usize| unguided(y) * self.guess[y].powf(0.7);
        let mut expectation = 0.0;
        for tuple in 0..4_usize.pow(count) {
            let chosen: Vec<usize> =
                (0..count).map(|index| tuple / 4_usize.pow(index) % 4).collect();
            let probability: f64 = chosen
                .iter()
                .enumerate()
                .map(
                    |(index, &y)| {
                        if (index as u32) < from_brdf { self.brdf[y] } else { self.guided[y] }
                    },
                )
                .product();
            let sums = chosen
                .iter()
                .fold((0.0, 0.0), |sums, &y| (sums.0 + guided(y), sums.1 + unguided(y)));
            for &y in &chosen {
                let chance = 0.9 * guided(y) / sums.0 + 0.1 * unguided(y) / sums.1;
                let estimate =
                    self.integrand[y] * self.visible[y] / (f64::from(count) * pdf(y) * chance);
                expectation += probability * chance * estimate;
            }
        }
        expectation
    }
}

#[test]
fn the_resampled_estimator_is_exact_with_unequal_counts() {
    for (from_brdf, from_guide) in [(1, 3), (2, 6), (1, 1), (3, 1)] {
        let part = f64::from(from_brdf) / f64::from(from_brdf + from_guide);
        let found = TOY.resampled(from_brdf, from_guide, part);
        assert!((found - TOY.truth()).abs() < 1e-10, "{from_brdf} + {from_guide}: {found}");
    }
    // The enumeration detects a wrong density, that of the one-sample model.
    let wrong = TOY.resampled(1, 3, 0.1);
    assert!((wrong - TOY.truth()).abs() > 0.05, "{wrong}");
}

/// Traces two rays in turn; the result of the first changes the density of the second. Dividing by
/// the density that a ray was drawn with is exact; dividing by the density known afterwards is not.
#[test]
fn feedback_inside_a_pass_would_be_caught() {
    let after = |seen: usize| -> [f64; 4] {
        // After one ray, its direction is drawn more often if it was visible.
        let mut weights = TOY.guided;
        weights[seen] *= if TOY.visible[seen] > 0.0 { 3.0 } else { 0.2 };
        let sum: f64 = weights.iter().sum();
        weights.map(|weight| weight / sum)
    };
    let value = |y: usize| TOY.integrand[y] * TOY.visible[y];
    let (mut snapshot, mut feedback) = (0.0, 0.0);
    for first in 0..4 {
        let later = after(first);
        for second in 0..4 {
            let probability = TOY.guided[first] * later[second];
            snapshot += probability
                * 0.5
                * (value(first) / TOY.guided[first] + value(second) / later[second]);
            // A pass that reads the table it writes divides the first ray by the table at the end
            // of the pass.
            feedback +=
                probability * 0.5 * (value(first) / later[first] + value(second) / later[second]);
        }
    }
    assert!((snapshot - TOY.truth()).abs() < 1e-12, "{snapshot}");
    assert!((feedback - TOY.truth()).abs() > 0.2, "{feedback}");
    // Shaders cannot do so: those that sample have no access to the counts.
    let counted = [guided::GUIDE_COUNTS, guided::GUIDE_SHARES, guided::GUIDE_ARRIVALS];
    for (name, expected) in [
        ("sample_guided", [false; 3]),
        ("bounce_guided", [false; 3]),
        ("learn", [true, true, false]),
        ("learn_arrivals", [false, false, true]),
    ] {
        let spirv = fenestra::shader::spirv::pass(name);
        let used = used_bindings(&bytemuck::pod_collect_to_vec(spirv));
        let found = counted.map(|binding| used.contains(&(binding.set, binding.number)));
        assert_eq!(found, expected, "{name}");
    }
}

/// Cells learn the light that bounces found, and cells with few rays fall back on their parents; a
/// cell reflects the sky it sees and the light that arrives.
#[test]
fn cells_learn_where_light_arrives_from() {
    let map = sunny();
    let partition = Partition::new(&map, 64);
    let key = |place: [u32; 3]| place[0] | place[1] << 8 | place[2] << 16 | 3 << 24;
    // Two cells of one coarse cell, one elsewhere
    let [bright, beside, far] = [key([1, 1, 1]), key([2, 1, 1]), key([90, 90, 90])];
    let mut guide = Guide::new(64, 100, 256).with_bounces(&[], 1);
    guide.add_cells(&[bright, beside, far]);
    let index = |key: u32| guide.keys().iter().position(|found| *found == CellKey(key)).unwrap();
    let [bright, beside, far] = [bright, beside, far].map(index);
    let cells = guide.cell_count();
    // The sky is visible from the far cell only.
    let mut counts = vec![[20, 0, 0]; cells * 64];
    counts[far * 64..][..64].fill([20, 20, 20 * 1000]);
    guide.add(0, &counts);
    let before = guide.snapshot(&partition);
    assert!(before.arriving.iter().all(|light| *light == 1.0), "nothing is known");
    let reflected = |snapshot: &fenestra::sampler::guided::Snapshot, cell: usize| {
        snapshot.reflected.units[cell] as f32 * snapshot.reflected.unit
    };
    assert!(reflected(&before, far) > 20.0 * reflected(&before, bright));

    let mut found = vec![[10, 0]; cells * ARRIVAL_DIRECTIONS];
    found[far * ARRIVAL_DIRECTIONS..][..ARRIVAL_DIRECTIONS].fill([0, 0]);
    found[beside * ARRIVAL_DIRECTIONS..][..ARRIVAL_DIRECTIONS].fill([1, 0]);
    let from = 17;
    found[bright * ARRIVAL_DIRECTIONS + from] = [40, 4000];
    guide.add_arrivals(&found, &before.reflected);
    let snapshot = guide.snapshot(&partition);
    let light = |cell: usize, direction: usize| {
        snapshot.arriving[cell * ARRIVAL_DIRECTIONS..][..ARRIVAL_DIRECTIONS][direction]
    };
    for cell in 0..cells {
        let mean = (0..ARRIVAL_DIRECTIONS).map(|direction| light(cell, direction)).sum::<f32>()
            / ARRIVAL_DIRECTIONS as f32;
        assert!((mean - 1.0).abs() < 1e-3, "cell {cell}: {mean}");
    }
    assert!(light(bright, from) > 50.0 && light(bright, from + 1) < 0.65);
    assert!(light(beside, from) > 20.0, "falls back on its coarse cell: {}", light(beside, from));
    assert!(light(far, from) > 5.0, "and the far one on the face: {}", light(far, from));
    assert!(reflected(&snapshot, bright) > reflected(&before, bright));

    // Words restore the light, and an update without counts leaves it as it is.
    let words = guide.state().arrivals;
    let again = Guide::new(64, 100, 256).with_bounces(&words[..6 * ARRIVAL_DIRECTIONS], 1);
    assert_eq!(again.state().arrivals, words[..6 * ARRIVAL_DIRECTIONS]);
    guide.add_arrivals(&[], &before.reflected);
    assert_eq!(guide.state().arrivals, words, "nothing was counted");
}
