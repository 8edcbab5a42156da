//! The passes `trace` and `shadow` on the host, where the device is software: its buffers are the host's
//! memory, and Embree follows rays several times as fast as the kernels do there.
//!
//! The host answers what triangles decide alone. Rays that meet a surface through which light may pass are
//! left to the kernels, marked in the buffer of the answers.

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

use super::kernel::Question;
use crate::{
    accel::{Accel, traverse::moved_off_surface},
    error::Result,
    gpu::{
        Buffer, Embree,
        embree_rays::Segment,
        embree_scene::{EmbreeScene, Part},
    },
    shader::{
        constants::{NO_MATERIAL, NO_TRIANGLE, PATH_LISTS, TRIANGLE_LEFT, VISIBILITY_LEFT},
        structs::{Hit, Ray, ShadowRay, Wave},
    },
};

/// Distance up to which hits count, as in `bvh.glsl`.
const FAR_AWAY: f32 = 3.0e38;
/// Paths that a thread takes at a time.
const CHUNK: usize = 256;

/// Trees of the host over the triangles of a scene, which lie in buffers of the device.
pub struct HostTracer {
    /// Surfaces that stop all light.
    opaque: EmbreeScene,
    /// All others, if there are any.
    passing: Option<EmbreeScene>,
    ray_offset: f32,
}

/// Buffers of a wave that the host reads and answers in.
pub struct Answers<'a> {
    /// [`Ray`] of every path.
    pub rays: &'a Buffer,
    /// [`Hit`] of every path.
    pub hits: &'a Buffer,
    /// [`ShadowRay`]s of the group.
    pub shadow_rays: &'a Buffer,
    /// A word for each of them.
    pub visibility: &'a Buffer,
    /// Lists of living paths.
    pub path_lists: &'a Buffer,
}

impl HostTracer {
    /// Builds the trees over `accel`, which has no instances, and whose triangles lie in `pages`. `passes`
    /// says of a material whether light may pass its surfaces.
    ///
    /// # Errors
    /// Memory does not suffice, or the library fails.
    pub(super) fn new(
        embree: &Arc<Embree>,
        accel: &Accel,
        pages: &[Arc<Buffer>],
        passes: &dyn Fn(u32) -> bool,
    ) -> Result<Self> {
        let build = |passing: bool| {
            let is_wanted =
                |place: &u32| passes(accel.triangle_materials[*place as usize]) == passing;
            let part = |(number, page): (u32, &Arc<Buffer>)| {
                let first = number << accel.page_shift;
                let end = (first + (1 << accel.page_shift)).min(accel.triangle_count() as u32);
                Part::new(page, first, (first..end).filter(is_wanted))
            };
            EmbreeScene::new(embree, (0..).zip(pages).map(part).collect())
        };
        let any_passes = accel.triangle_materials.iter().any(|material| passes(*material));
        Ok(Self {
            opaque: build(false)?,
            passing: any_passes.then(|| build(true)).transpose()?,
            ray_offset: accel.ray_offset(),
        })
    }

    /// Answers what a pass asks about the rays of a wave.
    ///
    /// # Errors
    /// The host does not share the memory of a buffer.
    pub(super) fn answer(
        &self,
        question: Question,
        wave: &Wave,
        answers: &Answers<'_>,
    ) -> Result<()> {
        let paths = ListedPaths::new(wave, answers.path_lists)?;
        let hits = answers.hits.words()?;
        match question {
            Question::Closest => {
                let rays = answers.rays.words()?;
                paths.for_each(|path| {
                    let triangle = &hits[words_of::<Hit>() * path + offset_of!(Hit, triangle) / 4];
                    triangle.store(self.closest(&read(rays, path)), Ordering::Relaxed);
                });
            }
            Question::Visible | Question::VisibleIfOpaque => {
                let (rays, visibility) =
                    (answers.shadow_rays.words()?, answers.visibility.words()?);
                let all_paths = (wave.pixel_count * wave.sample_count) as usize;
                paths.for_each(|path| {
                    let hit: Hit = read(hits, path);
                    for direction in 0..wave.shadow_ray_count as usize {
                        let ray = direction * all_paths + path;
                        let answer = self.visibility(wave, &hit, read(rays, ray));
                        visibility[ray].store(answer, Ordering::Relaxed);
                    }
                });
            }
        }
        Ok(())
    }

    /// Triangle that a ray meets, as in `trace.comp`.
    fn closest(&self, ray: &Ray) -> u32 {
        let Ray { origin, direction, is_active, .. } = *ray;
        if is_active == 0 || !is_finite(origin, direction) {
            return NO_TRIANGLE;
        }
        let met = self.opaque.closest(Segment::new(origin, direction, FAR_AWAY));
        let farthest = met.map_or(FAR_AWAY, |(_, distance)| distance);
        let before = Segment::new(origin, direction, farthest);
        match &self.passing {
            Some(passing) if passing.is_blocked(before) => TRIANGLE_LEFT,
            _ => met.map_or(NO_TRIANGLE, |(triangle, _)| triangle),
        }
    }

    /// Word of `visibility` for a shadow ray from `hit`, as in `shadow.comp`.
    fn visibility(&self, wave: &Wave, hit: &Hit, ray: ShadowRay) -> u32 {
        if hit.material == NO_MATERIAL || ray.contribution == [0.0; 3] {
            return 0;
        }
        let position = Vec3::from(hit.position);
        let mut direction = Vec3::from(ray.direction);
        let normal = Vec3::from(hit.geometric_normal);
        let origin = moved_off_surface(position, normal, direction, self.ray_offset);
        let mut farthest = FAR_AWAY;
        if wave.to_lamps != 0 {
            let to_lamp = direction + (position - origin);
            farthest = to_lamp.length();
            direction = to_lamp / farthest.max(1.0e-20);
        }
        let (origin, direction) = (origin.to_array(), direction.to_array());
        if !is_finite(origin, direction) {
            return 0;
        }
        let segment = Segment::new(origin, direction, farthest);
        match &self.passing {
            _ if self.opaque.is_blocked(segment) => 0,
            Some(passing) if passing.is_blocked(segment) => VISIBILITY_LEFT,
            _ => 1,
        }
    }
}

/// The library expects numbers.
fn is_finite(origin: [f32; 3], direction: [f32; 3]) -> bool {
    origin.iter().chain(&direction).all(|x| x.is_finite())
}

const fn words_of<T>() -> usize {
    size_of::<T>() / size_of::<u32>()
}

/// Reads element `index` of a buffer of `T`, which is at most twelve words.
fn read<T: Pod>(words: &[AtomicU32], index: usize) -> T {
    let mut element = [0; 12];
    let element = &mut element[..words_of::<T>()];
    let from = &words[index * element.len()..][..element.len()];
    for (to, word) in element.iter_mut().zip(from) {
        *to = word.load(Ordering::Relaxed);
    }
    bytemuck::pod_read_unaligned(bytemuck::cast_slice(element))
}

/// The paths that a dispatch walks, as in `path_list.glsl`.
struct ListedPaths<'a> {
    count: usize,
    /// All paths are walked where there is none.
    list: Option<&'a [AtomicU32]>,
}

impl<'a> ListedPaths<'a> {
    fn new(wave: &Wave, path_lists: &'a Buffer) -> Result<Self> {
        let all = (wave.pixel_count * wave.sample_count) as usize;
        let Some(list) = wave.path_list.checked_sub(1) else {
            return Ok(Self { count: all, list: None });
        };
        let words = path_lists.words()?;
        let count = words[list as usize].load(Ordering::Relaxed) as usize;
        let start = PATH_LISTS as usize + (list & 1) as usize * all;
        Ok(Self { count, list: Some(&words[start..start + count]) })
    }

    /// Calls `walk` with every path, on all cores.
    fn for_each(&self, walk: impl Fn(usize) + Sync) {
        (0..self.count.div_ceil(CHUNK)).into_par_iter().for_each(|chunk| {
            for place in chunk * CHUNK..self.count.min((chunk + 1) * CHUNK) {
                walk(self.list.map_or(place, |list| list[place].load(Ordering::Relaxed) as usize));
            }
        });
    }
}
