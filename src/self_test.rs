//! Self-test of a device: the passes that every render needs, on a scene whose answers the host knows.
//!
//! A driver may compile wrong code without a word, and a picture would show it late or never. The test
//! traces closest hits and shadow rays through a tree of two levels, and lists paths by subgroup ballots;
//! [`Accel`] answers the same on the host.

use std::sync::Arc;

use glam::{Vec3, Vec4};

use crate::{
    accel::{Accel, traverse::Intersection},
    error::{Error, Result},
    gpu::{Buffer, Capabilities, Commands, DescriptorSet, Device},
    pass::{
        Domain, GeometryBuffers, Kernel, Pass, Schedule, Surfaces, geometry::triangle_page_bytes,
        wave_buffers::path_list_bytes,
    },
    scene::{Geometry, Instance},
    shader::{
        bindings::{FILM, SCENE, WAVE, film, wave as bindings},
        constants::{NO_TRIANGLE, PATH_LISTS},
        structs::{Counters, Hit, PathState, Ray, ShadowRay, Wave},
    },
};

/// Passes of the test, which name the files of `glsl`.
pub(crate) const PASSES: [&str; 3] = ["trace", "list_paths", "shadow"];
/// Rays of the test, enough for every lane of a subgroup to take several.
const RAYS: u32 = 4096;
/// One path in so many has ended before.
const ENDED: u32 = 13;
/// Largest share of rays whose answer may differ: rounding decides at edges.
const TOLERATED: f64 = 2e-3;
/// Largest relative difference of distances.
const DISTANCE_TOLERANCE: f32 = 1e-4;
/// Visibility before the pass, which writes 0 or 1.
const UNWRITTEN: u32 = u32::MAX;

/// Runs the test in this process and refuses a device that fails it.
///
/// The program `fenestra` runs it in a process of its own before it first uses a device, so that a driver
/// that crashes ends in a message. A library has no such program, and calls this where it wants.
///
/// # Errors
/// [`Error::Device`] if an answer is wrong; others if the device fails or memory runs out.
pub fn run(device: &Arc<Device>) -> Result<()> {
    match faults(device)? {
        faults if faults.is_empty() => Ok(()),
        faults => Err(refusal(device.capabilities(), &faults.join("; "))),
    }
}

/// Returns the error for a device that has failed the test by `fault`.
pub(crate) fn refusal(capabilities: &Capabilities, fault: &str) -> Error {
    Error::Device {
        reason: format!(
            "{} ({}) fails the self-test: {fault}",
            capabilities.name, capabilities.driver
        ),
        help: "update the driver (as root, ./setup installs the newest lavapipe), unset variables that \
               change it (LP_…, GALLIVM_…, MESA_…), empty its shader cache (~/.cache/mesa_shader_cache*), \
               or choose another --device"
            .into(),
    }
}

/// Runs the test and lists what is wrong.
pub(crate) fn faults(device: &Arc<Device>) -> Result<Vec<String>> {
    let accel = Accel::build(&scene(), triangle_page_bytes(device.capabilities()))?;
    Ok(judge(&Answers::of_host(&accel), &Answers::of_device(device, &accel)?))
}

#[derive(Clone, Debug, PartialEq)]
struct Answers {
    hits: Vec<Option<Intersection>>,
    /// Paths that have hit something, in ascending order.
    living: Vec<u32>,
    /// One for each shadow ray that reaches the light, else zero.
    visibility: Vec<u32>,
    /// Rays given up.
    overruns: u32,
}

/// Compares the answers of a device with those of the host.
fn judge(expected: &Answers, found: &Answers) -> Vec<String> {
    let is_same = |(expected, found): (&Option<Intersection>, &Option<Intersection>)| {
        let (Some(expected), Some(found)) = (expected, found) else {
            return expected == found;
        };
        (expected.triangle, expected.instance) == (found.triangle, found.instance)
            && (expected.distance - found.distance).abs() <= DISTANCE_TOLERANCE * expected.distance
    };
    let different = expected.hits.iter().zip(&found.hits).filter(|pair| !is_same(*pair)).count();
    let blocked = expected.visibility.iter().zip(&found.visibility);
    let blocked = blocked.filter(|(expected, found)| expected != found).count();
    let is_too_many = |count: usize| count as f64 > TOLERATED * expected.hits.len() as f64;
    let mut faults = Vec::new();
    if is_too_many(different) {
        let hits = found.hits.iter().flatten().count();
        faults.push(format!(
            "closest hits: {different} of {RAYS} rays are wrong, {hits} meet a surface where {} do",
            expected.living.len()
        ));
    }
    let hit_paths = found.hits.iter().zip(0..).filter_map(|(hit, path)| hit.map(|_| path));
    let hit_paths: Vec<u32> = hit_paths.collect();
    if hit_paths != found.living {
        faults.push(format!(
            "subgroup ballots: a list holds {} paths and not those {} that have met a surface",
            found.living.len(),
            hit_paths.len()
        ));
    }
    if is_too_many(blocked) {
        let sum = |visibility: &[u32]| visibility.iter().filter(|visible| **visible == 1).count();
        faults.push(format!(
            "shadow rays: {blocked} of {RAYS} are wrong, {} reach the light where {} do",
            sum(&found.visibility),
            sum(&expected.visibility)
        ));
    }
    if found.overruns > 0 {
        faults.push(format!("traversal: {} rays did not end", found.overruns));
    }
    faults
}

impl Answers {
    fn of_host(accel: &Accel) -> Self {
        let mut answers =
            Self { hits: Vec::new(), living: Vec::new(), visibility: Vec::new(), overruns: 0 };
        for (path, ray) in (0..).zip(rays()) {
            let hit = accel.closest(ray.origin.into(), ray.direction.into());
            let hit = hit.filter(|_| ray.is_active != 0);
            answers.living.extend(hit.map(|_| path));
            answers.hits.push(hit);
        }
        let (starts, shadow_rays) = shadow_rays();
        for (start, ray) in starts.iter().zip(&shadow_rays) {
            let (normal, towards) = (start.geometric_normal.into(), ray.direction.into());
            let origin = accel.offset_ray_origin(start.position.into(), normal, towards);
            answers.visibility.push((!accel.is_occluded(origin, towards)).into());
        }
        answers
    }

    fn of_device(device: &Arc<Device>, accel: &Accel) -> Result<Self> {
        let (rays, (starts, shadow_rays)) = (rays(), shadow_rays());
        let count = rays.len();
        let zeroed = |name, bytes: usize| Buffer::zeroed(device, name, bytes as u64);
        let geometry = GeometryBuffers::new(device, accel)?;
        let rays = Buffer::from_slice(device, "rays", &rays)?;
        let hits = zeroed("hits", count * size_of::<Hit>())?;
        let instances = zeroed("hit instances", count * size_of::<u32>())?;
        let starts = Buffer::from_slice(device, "starts of shadow rays", &starts)?;
        let shadow_rays = Buffer::from_slice(device, "shadow rays", &shadow_rays)?;
        let paths = zeroed("paths", count * size_of::<PathState>())?;
        let visibility = Buffer::from_slice(device, "visibility", &vec![UNWRITTEN; count])?;
        let path_lists = Buffer::zeroed(device, "path lists", path_list_bytes(count as u64))?;
        let counters = zeroed("counters", size_of::<Counters>())?;
        // Shaders name buffers that this scene does not need.
        let spare = zeroed("spare", 256)?;
        let path_buffers = [
            (bindings::RAYS, &rays),
            (bindings::HITS, &hits),
            (bindings::HIT_INSTANCES, &instances),
            (bindings::PATHS, &paths),
            (bindings::PATH_LISTS, &path_lists),
        ];
        let shadow_buffers = [
            (bindings::HIT_TEXELS, &starts),
            (bindings::SHADOW_RAYS, &shadow_rays),
            (bindings::VISIBILITY, &visibility),
        ];
        let own: Vec<_> = geometry.bound.iter().map(|(at, buffer)| (*at, buffer)).collect();
        let scene = DescriptorSet::filled(device, &SCENE, &own, &spare)?;
        let path_set = DescriptorSet::filled(device, &WAVE, &path_buffers, &spare)?;
        let shadow_set = DescriptorSet::filled(device, &WAVE, &shadow_buffers, &spare)?;
        let film = DescriptorSet::new(device, &FILM, &[(film::COUNTERS, &counters)])?;
        let wave = Wave {
            pixel_count: count as u32,
            sample_count: 1,
            shadow_ray_count: 1,
            total_shadow_rays: 1,
            ..Wave::default()
        };
        let schedule = Schedule::incoherent(device.capabilities());
        let traversal = geometry.traversal;
        let [_, list_paths, _] = PASSES;
        let mut commands = Commands::begin(device)?;
        for (kernel, wave_set) in [
            (traversal.trace(schedule, Surfaces::default()), &path_set),
            (Kernel::new(list_paths, Domain::Arrivals, &[]), &path_set),
            (traversal.shadow(schedule, Surfaces::default()), &shadow_set),
        ] {
            Pass::new(device, kernel)?.record(
                &mut commands,
                &[&scene, wave_set, &film],
                &wave,
                None,
            )?;
        }
        commands.submit_and_wait()?;

        let found: Vec<Hit> = hits.download(count)?;
        let list: Vec<u32> = path_lists.download(PATH_LISTS as usize + count)?;
        let (lengths, list) = list.split_at(PATH_LISTS as usize);
        let mut living: Vec<u32> = list.iter().take(lengths[0] as usize).copied().collect();
        living.sort_unstable();
        let instances: Vec<u32> = instances.download(count)?;
        let hit = |(hit, instance): (&Hit, &u32)| {
            let (triangle, instance, distance) = (hit.triangle, *instance, hit.distance);
            (triangle != NO_TRIANGLE).then_some(Intersection { triangle, instance, distance })
        };
        Ok(Self {
            hits: found.iter().zip(&instances).map(hit).collect(),
            living,
            visibility: visibility.download(count)?,
            overruns: counters.download::<Counters>(1)?[0].traversal_overruns,
        })
    }
}

/// Point `index` of a sequence that fills the cube −1…1 evenly: multiples of powers of the root of
/// x⁴ = x + 1, without whole parts.
fn point(index: u32) -> Vec3 {
    let powers = Vec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5);
    (powers * (index % (1 << 14)) as f32).fract() * 2.0 - 1.0
}

/// Makes triangles in the cube, and three instances of others.
fn scene() -> Geometry {
    let soup = |count: u32, first: u32| {
        let mut geometry = Geometry::default();
        for triangle in 0..count {
            let at = first + 4 * triangle;
            let corner = |k: u32| (point(at) + 0.5 * point(at + k)).to_array();
            geometry.positions.extend([1, 2, 3].map(corner));
            geometry.normals.extend([[0.0; 3]; 3]);
            geometry.triangles.push([0, 1, 2].map(|corner| 3 * triangle + corner));
            geometry.materials.push(triangle % 5);
        }
        geometry
    };
    let mut geometry = soup(40, 1);
    geometry.prototypes.push(soup(24, 1000));
    geometry.instances.extend((0..3_u32).map(|instance| {
        let (sine, cosine) = (0.5 + instance as f32).sin_cos();
        let [x, y, z] = (1.5 * point(7 * instance + 1)).to_array();
        let world_from_object = [
            Vec4::new(0.6 * cosine, 0.0, 0.6 * sine, x),
            Vec4::new(0.0, 0.8, 0.0, y),
            Vec4::new(-0.6 * sine, 0.0, 0.6 * cosine, z),
        ];
        Instance { prototype: 0, world_from_object, first_material: 5, material_mask: u32::MAX }
    }));
    geometry
}

/// Makes rays from around the scene into it.
fn rays() -> Vec<Ray> {
    let ray = |path: u32| {
        let (origin, target) = (4.0 * point(path + 1).normalize(), 1.5 * point(3 * path + 2));
        Ray {
            origin: origin.into(),
            is_active: u32::from(!path.is_multiple_of(ENDED)),
            direction: (target - origin).normalize().into(),
            brdf_pdf: 0.0,
        }
    };
    (0..RAYS).map(ray).collect()
}

/// Makes shadow rays, and the surfaces among the triangles that they leave.
fn shadow_rays() -> (Vec<Hit>, Vec<ShadowRay>) {
    let pair = |path: u32| {
        let direction = point(5 * path + 3).normalize().to_array();
        let position = point(3 * path + 1).to_array();
        let start = Hit { position, geometric_normal: direction, ..Hit::default() };
        (start, ShadowRay { direction, contribution: [1.0; 3] })
    };
    (0..RAYS).map(pair).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fault that a driver with a wrong answer is refused for.
    fn fault(spoil: impl FnOnce(&mut Answers)) -> String {
        let expected = Answers::of_host(&Accel::build(&scene(), 1 << 20).unwrap());
        let mut found = expected.clone();
        spoil(&mut found);
        judge(&expected, &found).join("; ")
    }

    #[test]
    fn the_scene_has_answers_of_every_kind() {
        let accel = Accel::build(&scene(), 1 << 20).unwrap();
        let answers = Answers::of_host(&accel);
        let all = f64::from(RAYS);
        let is_placed = |hit: &&Intersection| (hit.triangle as usize) < accel.placed_count();
        let placed = answers.hits.iter().flatten().filter(is_placed).count();
        let visible = answers.visibility.iter().filter(|visible| **visible == 1).count();
        for (kind, count) in [
            ("misses", answers.hits.iter().filter(|hit| hit.is_none()).count()),
            ("placed triangles", placed),
            ("instances", answers.living.len() - placed),
            ("visible", visible),
            ("blocked", answers.visibility.len() - visible),
        ] {
            assert!((0.1..0.8).contains(&(count as f64 / all)), "{count} {kind}");
        }
    }

    #[test]
    fn wrong_answers_are_faults_and_rounding_is_none() {
        assert_eq!(fault(|_| ()), "");
        let rounded = fault(|found| {
            found.visibility[5] ^= 1;
            found.hits.iter_mut().flatten().for_each(|hit| hit.distance *= 1.0 + 1e-6);
        });
        assert_eq!(rounded, "");
        let no_hit = fault(|found| {
            found.hits.fill(None);
            found.living.clear();
        });
        assert!(no_hit.starts_with("closest hits: ") && no_hit.contains(" 0 meet"), "{no_hit}");
        let far =
            fault(|found| found.hits.iter_mut().flatten().for_each(|hit| hit.distance *= 1.01));
        assert!(far.starts_with("closest hits: "), "{far}");
        let instance =
            fault(|found| found.hits.iter_mut().flatten().for_each(|hit| hit.instance = 0));
        assert!(instance.starts_with("closest hits: "), "{instance}");
        let no_shadow = fault(|found| found.visibility.fill(1));
        let told = format!(" of {RAYS} are wrong, {RAYS} reach the light where ");
        assert!(no_shadow.starts_with("shadow rays: ") && no_shadow.contains(&told), "{no_shadow}");
        // One wrong answer in a hundred is no rounding.
        let few = fault(|found| found.visibility.iter_mut().step_by(100).for_each(|one| *one ^= 1));
        assert!(few.starts_with("shadow rays: 41 "), "{few}");
        let unwritten = fault(|found| found.visibility.fill(UNWRITTEN));
        assert!(unwritten.starts_with("shadow rays: "), "{unwritten}");
        let ballot = fault(|found| found.living.truncate(found.living.len() - 1));
        assert!(ballot.starts_with("subgroup ballots: "), "{ballot}");
        let endless = fault(|found| found.overruns = 1);
        assert!(endless.starts_with("traversal: "), "{endless}");
    }
}
