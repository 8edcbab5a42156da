//! Triangles of a scene as the host's tree takes them: those in the world from the buffers of the device,
//! those of instances placed.

use std::{ops::Range, sync::Arc};

use crate::{
    accel::{Accel, instances::Record},
    error::{Error, Result},
    gpu::{
        Buffer,
        embree_scene::{Part, Vertices},
    },
    memory,
    shader::constants::NO_INSTANCE,
};

/// Place in [`Accel::first_triangles`] of the triangles that are no instances.
const PLACED: u32 = 0;
/// Triangles of instances that the host places unasked: more would make the first picture wait for seconds.
const MOST_COPIES: usize = 1 << 23;
/// Bytes that one takes while the tree is built.
const COPY_BYTES: usize = 250;

fn copies(accel: &Accel) -> usize {
    let meshes = accel.instance_meshes.iter().filter(|mesh| **mesh != PLACED);
    meshes.map(|mesh| triangles_of(accel, *mesh).len()).sum()
}

fn triangles_of(accel: &Accel, mesh: u32) -> Range<u32> {
    accel.first_triangles[mesh as usize]..accel.first_triangles[mesh as usize + 1]
}

/// Checks that the host may place the instances unasked. Fails if there are too many triangles.
pub(super) fn check_copies(accel: &Accel) -> Result<()> {
    let copies = copies(accel);
    if copies <= MOST_COPIES {
        return Ok(());
    }
    Err(Error::Memory {
        message: format!(
            "the host's tree holds {MOST_COPIES} triangles of instances, unless --tracer host asks for \
             more, and the scene has {copies}"
        ),
        help: None,
    })
}

/// Returns the triangles of `accel`, which lie in `pages`; `may_pass` says of a material whether light may
/// pass its surfaces. Fails if memory does not suffice.
pub(super) fn parts(
    accel: &Accel,
    pages: &[Buffer],
    may_pass: &dyn Fn(u32) -> bool,
) -> Result<Vec<Part>> {
    if !accel.is_instanced() {
        let triangles = 0..accel.triangle_count() as u32;
        return Ok(shared_parts(accel, pages, triangles, NO_INSTANCE, may_pass));
    }
    let copies = copies(accel);
    let asker = format_args!("the host's tree over {copies} triangles of instances");
    memory::check_count(asker, copies, COPY_BYTES).map_err(Error::memory)?;
    let mut parts = Vec::new();
    for (instance, (record, mesh)) in (0..).zip(accel.instances.iter().zip(&accel.instance_meshes))
    {
        let triangles = triangles_of(accel, *mesh);
        let may_pass = |own: u32| may_pass(record.material(own));
        if *mesh == PLACED {
            parts.extend(shared_parts(accel, pages, triangles, instance, &may_pass));
        } else {
            parts.extend(own_parts(accel, record, triangles, instance, &may_pass));
        }
    }
    Ok(parts)
}

/// Triangles in the buffers of the device, those that stop all light and others.
fn shared_parts(
    accel: &Accel,
    pages: &[Buffer],
    triangles: Range<u32>,
    instance: u32,
    may_pass: &dyn Fn(u32) -> bool,
) -> Vec<Part> {
    let may_pass = |triangle: u32| may_pass(accel.triangle_materials[triangle as usize]);
    let mut parts = Vec::new();
    for (number, page) in (0..).zip(pages) {
        let first = number << accel.page_shift;
        let own = first.max(triangles.start)..(first + (1 << accel.page_shift)).min(triangles.end);
        parts.extend(Part::pair(&Vertices::Shared(page.clone()), first, instance, own, may_pass));
    }
    parts
}

/// The same of an instance, placed in the world.
fn own_parts(
    accel: &Accel,
    record: &Record,
    triangles: Range<u32>,
    instance: u32,
    may_pass: &dyn Fn(u32) -> bool,
) -> [Part; 2] {
    let mut vertices = Vec::with_capacity(3 * triangles.len() + 1);
    vertices.extend(triangles.clone().flat_map(|triangle| {
        let corners = accel.triangle(triangle).vertices;
        corners.map(|vertex| record.point_to_world(vertex.position.into()).to_array())
    }));
    vertices.push([0.0; 3]);
    let may_pass = |triangle: u32| may_pass(accel.triangle_materials[triangle as usize]);
    let first = triangles.start;
    Part::pair(&Vertices::Own(Arc::new(vertices)), first, instance, triangles, may_pass)
}
