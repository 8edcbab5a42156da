//! The passes `trace` and `shadow` on the host, where the device is software: its buffers are the host's
//! memory, and Embree follows packets of rays several times as fast as the kernels do there.

use std::{
    mem::offset_of,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
};

use bytemuck::Pod;
use glam::Vec3;
use rayon::prelude::*;

use super::{
    host_parts::{check_copies, parts},
    kernel::Question,
    passages::{Chances, OpenPassages, Passages},
};
use crate::{
    accel::{
        Accel,
        traverse::{FAR_AWAY, moved_off_surface},
    },
    error::Result,
    gpu::{
        Buffer, DescriptorSet, Embree,
        embree_rays::{LANES, Packet},
        embree_scene::{EmbreeScene, Search},
    },
    shader::{
        bindings::{scene, wave as buffers},
        constants::{NO_INSTANCE, NO_MATERIAL, NO_TRIANGLE, PATH_LISTS},
        structs::{Hit, PathState, Ray, ShadowRay, Wave},
    },
};

/// Most and least paths that a thread takes at a time, and its turns where there are more.
const MOST_PATHS: usize = 1024;
const LEAST_PATHS: usize = 64;
const TURNS: usize = 32;

/// Tree of the host over the triangles of a scene, which lie in buffers of the device.
pub struct HostTracer {
    tree: EmbreeScene,
    /// Surfaces through which light may pass, if there are any.
    passages: Option<Passages>,
    ray_offset: f32,
    has_instances: bool,
}

/// True if any path that a pass walks has a ray to follow; `waves` is the set of the wave. Fails as
/// [`HostTracer::answer`].
pub(super) fn has_rays(wave: &Wave, waves: &DescriptorSet) -> Result<bool> {
    let ListedPaths { count, list } = ListedPaths::new(wave, waves)?;
    let rays = waves.buffer(buffers::RAY_TEXELS).words()?;
    let is_active = |path: usize| {
        let word = words_of::<Ray>() * path + offset_of!(Ray, is_active) / size_of::<u32>();
        rays[word].load(Ordering::Relaxed) != 0
    };
    Ok(match list {
        None => (0..count).any(is_active),
        Some(list) => list.iter().any(|path| is_active(path.load(Ordering::Relaxed) as usize)),
    })
}

impl HostTracer {
    /// Builds the tree over `accel`, whose triangles lie in `pages`; `passages` says what light passes, if it
    /// passes any. Instances are placed: as instances of the library, in the space of their meshes, those
    /// that share edges would leak. Too many are refused unless the host `must_trace`. Fails if memory does
    /// not suffice, or the library fails.
    pub(super) fn new(
        embree: &Arc<Embree>,
        accel: &Accel,
        pages: &[Buffer],
        passages: Option<Passages>,
        must_trace: bool,
    ) -> Result<Self> {
        if !must_trace {
            check_copies(accel)?;
        }
        let may_pass =
            |material| passages.as_ref().is_some_and(|passages| passages.may_pass(material));
        let tree = EmbreeScene::new(embree, parts(accel, pages, &may_pass)?)?;
        Ok(Self {
            tree,
            passages,
            ray_offset: accel.ray_offset(),
            has_instances: accel.is_instanced(),
        })
    }

    /// Answers what a pass asks about the rays of a wave, in the buffers that the pass would write to of the
    /// sets of scene and wave. Returns the number of paths that it walked. Fails if the host does not share
    /// the memory of a buffer.
    pub(super) fn answer(
        &self,
        question: Question,
        wave: &Wave,
        [scene, waves]: [&DescriptorSet; 2],
    ) -> Result<u32> {
        let paths = ListedPaths::new(wave, waves)?;
        let words = |binding| waves.buffer(binding).words();
        let passages = self.passages.as_ref().map(|passages| passages.open(scene)).transpose()?;
        let rays = Rays { tree: &self.tree, passages: passages.as_ref() };
        match question {
            Question::Closest => {
                let instances = self.has_instances.then(|| words(buffers::HIT_INSTANCES));
                let parameters = scene.buffer(scene::PARAMETERS).words()?;
                let closest = Closest {
                    rays,
                    chances: Chances::new(wave, parameters, self.has_instances),
                    is_coherent: wave.vertex == 0,
                    from: words(buffers::RAY_TEXELS)?,
                    hits: words(buffers::HITS)?,
                    instances: instances.transpose()?,
                    paths: words(buffers::PATHS)?,
                };
                paths.for_each_chunk(|paths| closest.answer(paths));
            }
            Question::Visible => {
                let visible = Visible {
                    rays,
                    wave,
                    ray_offset: self.ray_offset,
                    hits: words(buffers::HIT_TEXELS)?,
                    shadow_rays: words(buffers::SHADOW_RAY_TEXELS)?,
                    visibility: words(buffers::VISIBILITY)?,
                };
                paths.for_each_chunk(|paths| visible.answer(paths));
            }
        }
        Ok(paths.count as u32)
    }
}

/// The scene that rays are followed in.
#[derive(Clone, Copy)]
struct Rays<'a> {
    tree: &'a EmbreeScene,
    passages: Option<&'a OpenPassages<'a>>,
}

/// Search for the surfaces that the rays of paths meet, as in `trace.comp`.
struct Closest<'a> {
    rays: Rays<'a>,
    chances: Chances<'a>,
    is_coherent: bool,
    from: &'a [AtomicU32],
    hits: &'a [AtomicU32],
    instances: Option<&'a [AtomicU32]>,
    paths: &'a [AtomicU32],
}

/// A surface that light may pass, and the decision about it.
struct Chance {
    lane: usize,
    surface: [u32; 2],
    distance: f32,
    goes_on: bool,
    weight: Vec3,
}

impl Closest<'_> {
    fn answer(&self, paths: impl Iterator<Item = u32>) {
        let segments = paths.filter_map(|path| {
            let Ray { origin, direction, is_active, .. } = read(self.from, path);
            let is_followed = is_active != 0 && is_finite(origin, direction);
            if !is_followed {
                self.write(path, NO_TRIANGLE, NO_INSTANCE);
            }
            is_followed.then_some((path, (origin, direction, FAR_AWAY)))
        });
        let mut chances = Vec::new();
        in_packets(segments, |packet| self.follow(packet, &mut chances));
    }

    fn follow(&self, packet: &mut Packet, chances: &mut Vec<Chance>) {
        let Rays { tree, passages } = self.rays;
        let mut paths = [0; LANES];
        paths[..packet.places().len()].copy_from_slice(packet.places());
        chances.clear();
        tree.find(Search::Closest, packet, self.is_coherent, &mut |met| {
            let Some(passages) = passages else { return true };
            let (goes_on, weight) = self.chances.take(paths[met.lane], met, &passages.passing(met));
            chances.push(Chance {
                lane: met.lane,
                surface: [met.triangle, met.instance],
                distance: met.distance,
                goes_on,
                weight,
            });
            !goes_on
        });
        for (lane, &path) in packet.places().iter().enumerate() {
            let found = tree.hit(packet, lane);
            let (surface, distance) = found.map_or(([NO_TRIANGLE, NO_INSTANCE], FAR_AWAY), |hit| {
                ([hit.triangle, hit.instance], hit.distance)
            });
            self.write(path, surface[0], surface[1]);
            // Surfaces beyond the one where the ray stops do not count.
            let counts = |chance: &&Chance| {
                let is_passed = chance.goes_on && chance.distance < distance;
                chance.lane == lane && (is_passed || !chance.goes_on && chance.surface == surface)
            };
            let weight: Vec3 = chances.iter().filter(counts).map(|chance| chance.weight).product();
            scale::<PathState>(self.paths, path, offset_of!(PathState, throughput), weight);
        }
    }

    fn write(&self, path: u32, triangle: u32, instance: u32) {
        let word = words_of::<Hit>() * path as usize + offset_of!(Hit, triangle) / 4;
        self.hits[word].store(triangle, Ordering::Relaxed);
        if let Some(instances) = self.instances {
            instances[path as usize].store(instance, Ordering::Relaxed);
        }
    }
}

/// Search for anything that blocks shadow rays, as in `shadow.comp`.
struct Visible<'a> {
    rays: Rays<'a>,
    wave: &'a Wave,
    ray_offset: f32,
    hits: &'a [AtomicU32],
    shadow_rays: &'a [AtomicU32],
    visibility: &'a [AtomicU32],
}

impl Visible<'_> {
    fn answer(&self, paths: impl Iterator<Item = u32>) {
        let wave = self.wave;
        let all_paths = wave.pixel_count * wave.sample_count;
        let segments = paths.flat_map(|path| {
            let hit: Hit = read(self.hits, path);
            (0..wave.shadow_ray_count).filter_map(move |direction| {
                let ray = direction * all_paths + path;
                let segment = self.segment(&hit, read(self.shadow_rays, ray));
                if segment.is_none() {
                    self.visibility[ray as usize].store(0, Ordering::Relaxed);
                }
                Some((ray, segment?))
            })
        });
        in_packets(segments, |packet| self.follow(packet));
    }

    /// The shadow ray from `hit`, unless it needs no tracing.
    fn segment(&self, hit: &Hit, ray: ShadowRay) -> Option<Segment> {
        let is_lit =
            hit.material != NO_MATERIAL || self.wave.to_lamps != 0 && hit.triangle != NO_TRIANGLE;
        if !is_lit || ray.contribution == [0.0; 3] {
            return None;
        }
        let position = Vec3::from(hit.position);
        let mut direction = Vec3::from(ray.direction);
        let normal = Vec3::from(hit.geometric_normal);
        let origin = moved_off_surface(position, normal, direction, self.ray_offset);
        let mut farthest = FAR_AWAY;
        if self.wave.to_lamps != 0 {
            let to_lamp = direction + (position - origin);
            farthest = to_lamp.length();
            direction = to_lamp / farthest.max(1.0e-20);
        }
        let (origin, direction) = (origin.to_array(), direction.to_array());
        is_finite(origin, direction).then_some((origin, direction, farthest))
    }

    fn follow(&self, packet: &mut Packet) {
        let Rays { tree, passages } = self.rays;
        let mut passed = [Vec3::ONE; LANES];
        tree.find(Search::Any, packet, false, &mut |met| {
            let Some(passages) = passages else { return true };
            passed[met.lane] *= passages.passing(met).passed;
            passed[met.lane] == Vec3::ZERO
        });
        for (lane, &ray) in packet.places().iter().enumerate() {
            let is_visible = !packet.is_blocked(lane);
            self.visibility[ray as usize].store(is_visible.into(), Ordering::Relaxed);
            if is_visible {
                let offset = offset_of!(ShadowRay, contribution);
                scale::<ShadowRay>(self.shadow_rays, ray, offset, passed[lane]);
            }
        }
    }
}

/// Origin, direction and length of a ray.
type Segment = ([f32; 3], [f32; 3], f32);

/// Calls `follow` with the rays in packets, each with the place of its answer.
fn in_packets(segments: impl Iterator<Item = (u32, Segment)>, mut follow: impl FnMut(&mut Packet)) {
    let mut packet = Packet::new();
    for (place, (origin, direction, farthest)) in segments {
        packet.push(place, origin, direction, farthest);
        if packet.places().len() == LANES {
            follow(&mut packet);
            packet.clear();
        }
    }
    follow(&mut packet);
}

/// The library expects numbers.
fn is_finite(origin: [f32; 3], direction: [f32; 3]) -> bool {
    origin.iter().chain(&direction).all(|x| x.is_finite())
}

const fn words_of<T>() -> usize {
    size_of::<T>() / size_of::<u32>()
}

/// Reads element `index` of a buffer of `T`, which is at most twelve words.
fn read<T: Pod>(words: &[AtomicU32], index: u32) -> T {
    let mut element = [0; 12];
    let element = &mut element[..words_of::<T>()];
    let from = &words[index as usize * element.len()..][..element.len()];
    for (to, word) in element.iter_mut().zip(from) {
        *to = word.load(Ordering::Relaxed);
    }
    bytemuck::pod_read_unaligned(bytemuck::cast_slice(element))
}

/// Multiplies three numbers, at `offset` bytes of element `index` of a buffer of `T`, by `factor`.
fn scale<T>(words: &[AtomicU32], index: u32, offset: usize, factor: Vec3) {
    if factor == Vec3::ONE {
        return;
    }
    let first = index as usize * words_of::<T>() + offset / size_of::<u32>();
    for (word, factor) in words[first..].iter().zip(factor.to_array()) {
        let value = f32::from_bits(word.load(Ordering::Relaxed)) * factor;
        word.store(value.to_bits(), Ordering::Relaxed);
    }
}

/// The paths that a dispatch walks, as in `path_list.glsl`.
struct ListedPaths<'a> {
    count: usize,
    /// All paths are walked where there is none.
    list: Option<&'a [AtomicU32]>,
}

impl<'a> ListedPaths<'a> {
    fn new(wave: &Wave, waves: &'a DescriptorSet) -> Result<Self> {
        let all = (wave.pixel_count * wave.sample_count) as usize;
        let Some(list) = wave.path_list.checked_sub(1) else {
            return Ok(Self { count: all, list: None });
        };
        let words = waves.buffer(buffers::PATH_LIST_TEXELS).words()?;
        let count = words[list as usize].load(Ordering::Relaxed) as usize;
        let start = PATH_LISTS as usize + (list & 1) as usize * all;
        Ok(Self { count, list: Some(&words[start..start + count]) })
    }

    /// Calls `walk` with all paths, some at a time, on all cores.
    fn for_each_chunk(&self, walk: impl Fn(&mut dyn Iterator<Item = u32>) + Sync) {
        let size = (self.count / TURNS).clamp(LEAST_PATHS, MOST_PATHS);
        let walk_chunk = |chunk: usize| {
            let places = chunk * size..self.count.min((chunk + 1) * size);
            match self.list {
                None => walk(&mut places.map(|place| place as u32)),
                Some(list) => {
                    walk(&mut list[places].iter().map(|path| path.load(Ordering::Relaxed)));
                }
            }
        };
        let chunks = 0..self.count.div_ceil(size);
        // Waking other threads takes longer than to follow few rays.
        if chunks.len() <= 1 {
            chunks.for_each(walk_chunk);
        } else {
            chunks.into_par_iter().for_each(walk_chunk);
        }
    }
}
