//! Device buffers of learned visibility, and the rebuild: counts of the passes → tables they read.

use std::{sync::Arc, time::Instant};

use bytemuck::Pod;

use super::{
    ARRIVAL_DIRECTIONS, ArrivalWords, CellKey, CountWords, Guide, GuideState, MAX_CELLS, Origin,
    PARTS_PER_RAY, SHARE_WORDS, Snapshot,
    budget::GuideBudget,
    cell_readback::{CellReadback, RegionReadback},
    decode_visibility,
    parameters::GuidedParameters,
    ratios,
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Commands, DescriptorSet, Device},
    sampler::regions::{FACE_COUNT, Partition, bounds_of, cell_edges},
    scene::{self, Scene},
    shader::{
        bindings::Binding,
        rooms::guided::{self, GUIDE_COUNT_WORDS, GUIDE_NO_KEY, GuideParameters, PathCell},
    },
};

/// Pixels along the edge of a cell, unless the scene limits it.
const CELL_PIXELS: f32 = 24.0;
/// Number of levels below the largest cell.
const LEVELS: i32 = 12;
const COUNT_BYTES: u64 = 4 * GUIDE_COUNT_WORDS as u64;
/// Bytes of a cell per region: an entry to read and counts to write.
const BYTES_PER_REGION: u64 = 4 + COUNT_BYTES;
const ARRIVAL_BYTES: u64 = size_of::<ArrivalWords>() as u64;
/// Bytes of a cell that knows arriving light: by direction the light and two counted words, and its
/// reflected light.
const ARRIVALS_PER_CELL: u64 = (4 + ARRIVAL_BYTES) * ARRIVAL_DIRECTIONS as u64 + 4;
/// Divisor of the counts when the geometry has changed.
const FORGETTING: u32 = 8;
/// Number of cells that fit at least, memory permitting.
const FEW_CELLS: u64 = 4096;
/// Pixels per cell beyond those: no film can fill more.
const PIXELS_PER_CELL: u64 = 4;

/// Samples per pixel after which the map is split a second time; the first is after training.
pub const SPLIT_AFTER: u32 = 16;

/// Number of regions at the start of a render.
const FIRST_REGIONS: usize = 256;

/// Returns the first rebuild at or after `samples` samples: 1, 2, 3, 4, 6, 8, 12, 16, 32, 64, …
pub fn guide_schedule(samples: u32) -> u32 {
    let power = samples.next_power_of_two();
    let middle = power / 4 * 3;
    if middle >= samples && power <= SPLIT_AFTER { middle } else { power }
}

/// Quantities that determine the size of a guide's buffers.
#[derive(Clone, Copy, Debug)]
pub struct GuideSize {
    /// Pixels of the film.
    pub pixels: u32,
    /// Paths of a wave.
    pub paths: u32,
    /// Shadow rays of a path in one group.
    pub shadow_rays: u32,
    /// True if bounces are guided.
    pub has_bounces: bool,
}

/// Everything that learns in one render.
pub struct GuideBuffers {
    device: Arc<Device>,
    /// Descriptor set 1.
    pub set: DescriptorSet,
    pub(super) partition: Partition,
    /// True if the regions differ from those at the start.
    is_split: bool,
    learned: Guide,
    snapshot: Snapshot,
    budget: GuideBudget,
    origin: Origin,
    layout: GuideParameters,
    slots: usize,
    missing_slots: usize,
    has_bounces: bool,
    /// Host milliseconds spent on rebuilds since the start.
    pub(super) rebuild_ms: f64,
}

impl GuideBuffers {
    /// Splits the environment and allocates the buffers. Fails if the device does or its limits are exceeded.
    pub fn new(
        device: &Arc<Device>,
        scene: &Scene,
        parameters: &GuidedParameters,
        size: GuideSize,
    ) -> Result<Self> {
        let most_regions = parameters.regions as usize;
        let partition = Partition::new(&scene.environment, most_regions.min(FIRST_REGIONS));
        let region_count = partition.regions.len();
        let useful_cells = FEW_CELLS.max(u64::from(size.pixels) / PIXELS_PER_CELL) as usize;
        let useful_cells = useful_cells.min(MAX_CELLS);
        // The other memory of cells weighs most per region with the fewest regions.
        let besides = 4 * SHARE_WORDS as u64 + if size.has_bounces { ARRIVALS_PER_CELL } else { 0 };
        let by_memory =
            parameters.guide_memory / (BYTES_PER_REGION + besides.div_ceil(region_count as u64));
        let by_range = device.capabilities().max_storage_buffer_range / COUNT_BYTES;
        let budget = GuideBudget {
            counts: (by_memory.min(by_range) as usize)
                .min(useful_cells * most_regions)
                .max(FACE_COUNT * region_count),
            useful_cells,
            max_regions: most_regions,
        };
        let capacity = budget.cells(region_count);
        let slots = (4 * capacity).next_power_of_two();
        let missing_slots = (2 * capacity).next_power_of_two();
        let learned = Guide::new(region_count, capacity, slots);

        let (mut regions, aliases) = partition.tables();
        regions.resize(most_regions.max(region_count), [0; 4]);
        let (entry_bytes, count_bytes) =
            (4 * (budget.counts as u64 + 1), COUNT_BYTES * budget.counts as u64);
        let guide = guide_parameters(scene, region_count, slots, missing_slots);
        let origin = Origin {
            environment: scene::environment_hash(scene),
            geometry: scene::geometry_hash(scene),
            regions: region_count as u32,
            grid_origin: guide.grid_origin,
            largest_edge: guide.largest_edge,
        };
        let rays = u64::from(size.paths) * u64::from(size.shadow_rays);
        let path_bytes = u64::from(size.paths) * size_of::<PathCell>() as u64;
        let make = |name, bytes| Buffer::new(device, name, bytes);
        let of_cell = &partition.region_of_cell;
        let mut bound = vec![
            (guided::GUIDE, Buffer::from_slice(device, "guide parameters", &[guide])?),
            (guided::GUIDE_TABLE, make("guide table", 8 * slots as u64)?),
            (guided::GUIDE_ENTRIES, make("guide entries", entry_bytes)?),
            (guided::GUIDE_REGIONS, Buffer::texels_from_slice(device, "guide regions", &regions)?),
            (guided::GUIDE_ALIASES, Buffer::texels_from_slice(device, "guide aliases", &aliases)?),
            (
                guided::GUIDE_REGION_OF_CELL,
                Buffer::texels_from_slice(device, "guide region of cell", of_cell)?,
            ),
            (guided::GUIDE_COUNTS, make("guide counts", count_bytes)?),
            (guided::GUIDE_SHARES, make("guide shares", 4 * (capacity * SHARE_WORDS) as u64)?),
            (guided::GUIDE_MISSING, make("guide missing", 4 * missing_slots as u64)?),
            (guided::LEARN_TARGETS, make("learn targets", 8 * rays)?),
            (guided::PATH_CELLS, make("path cells", path_bytes)?),
        ];
        if size.has_bounces {
            let directions = (capacity * ARRIVAL_DIRECTIONS) as u64;
            bound.extend([
                (guided::GUIDE_ARRIVING, make("guide arriving", 4 * directions)?),
                (guided::GUIDE_REFLECTED, make("guide reflected", 4 * capacity as u64)?),
                (guided::GUIDE_ARRIVALS, make("guide arrivals", ARRIVAL_BYTES * directions)?),
            ]);
        }
        let set = DescriptorSet::new(device, &guided::TABLE, &bound)?;
        let mut buffers = Self {
            device: Arc::clone(device),
            set,
            partition,
            is_split: false,
            learned,
            snapshot: Snapshot::default(),
            budget,
            origin,
            layout: guide,
            slots,
            missing_slots,
            has_bounces: size.has_bounces,
            rebuild_ms: 0.0,
        };
        buffers.forget()?;
        Ok(buffers)
    }

    /// Starts from nothing. Fails if the device does.
    pub fn forget(&mut self) -> Result<()> {
        if self.is_split {
            let alike = vec![1.0; self.partition.regions.len()];
            if let Some(partition) = self.partition.split_by(&alike, FIRST_REGIONS.min(alike.len()))
            {
                self.take_regions(partition)?;
            }
            self.is_split = false;
        }
        let learned = Guide::new(
            self.partition.regions.len(),
            self.budget.cells(self.partition.regions.len()),
            self.slots,
        );
        self.learned = self.with_bounces(learned, &[], 1);
        self.rebuild_ms = 0.0;
        self.clear_counts()?;
        self.upload()
    }

    fn upload_to<T: Pod>(&self, binding: Binding, values: &[T]) -> Result<()> {
        self.set.buffer(binding).upload(bytemuck::cast_slice(values))
    }

    fn missing(&self) -> Result<Vec<u32>> {
        self.set.buffer(guided::GUIDE_MISSING).download(self.missing_slots)
    }

    /// Reads the counts of arriving light; none without guided bounces.
    fn arrivals(&self) -> Result<Vec<ArrivalWords>> {
        if !self.has_bounces {
            return Ok(Vec::new());
        }
        let directions = self.learned.cell_count() * ARRIVAL_DIRECTIONS;
        self.set.buffer(guided::GUIDE_ARRIVALS).download(directions)
    }

    fn with_bounces(&self, learned: Guide, words: &[ArrivalWords], forget: u32) -> Guide {
        if self.has_bounces { learned.with_bounces(words, forget) } else { learned }
    }

    /// Turns the counts of passes into tables for the next ones. Splits the map again if `splits`,
    /// or if the counts suffice to tell more regions apart. Fails if the device does.
    pub fn rebuild(&mut self, splits: bool) -> Result<()> {
        let start = Instant::now();
        let counted = self.learned.cell_count() * self.partition.regions.len();
        let mut first = 0;
        self.set.buffer(guided::GUIDE_COUNTS).download_pieces::<CountWords>(counted, |piece| {
            self.learned.add(first, piece);
            first += piece.len();
        })?;
        let words = self.learned.cell_count() * SHARE_WORDS;
        self.learned.add_shares(&self.set.buffer(guided::GUIDE_SHARES).download::<u32>(words)?);
        if self.has_bounces {
            self.learned.add_arrivals(&self.arrivals()?, &self.snapshot.reflected);
        }
        self.learned.add_cells(&self.missing()?);
        let now = self.partition.regions.len();
        let rays = if now < self.budget.max_regions { self.learned.rays() } else { 0 };
        let count = self.budget.regions(now, self.learned.cell_count(), rays);
        if count == self.budget.max_regions {
            self.learned.refine();
        }
        if splits || count > now {
            let importance = self.learned.region_importance(&self.partition, &self.snapshot);
            if let Some(partition) = self.partition.split_by(&importance, count) {
                let capacity = self.budget.cells(partition.regions.len());
                self.learned.carry_over(&self.partition, &partition, capacity);
                self.take_regions(partition)?;
            }
        }
        self.clear_counts()?;
        self.upload()?;
        self.rebuild_ms += start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    /// Reads the targets of the first `count` shadow rays of the last group: region + number of
    /// regions · cell, or `NOTHING_TO_LEARN`. Fails if the device does.
    pub fn targets(&self, count: usize) -> Result<Vec<u32>> {
        let words: Vec<[u32; 2]> = self.set.buffer(guided::LEARN_TARGETS).download(count)?;
        Ok(words.into_iter().map(|[target, _]| target).collect())
    }

    /// Returns a cell as passes read it. Fails if the device does, panics if there is no such cell.
    pub fn cell(&self, index: usize) -> Result<CellReadback> {
        let key = Some(self.learned.keys()[index]).filter(|_| index >= FACE_COUNT);
        let count = self.partition.regions.len();
        let entries = &self.snapshot.entries[index * count..][..count];
        let shares = || self.partition.regions.iter().map(|region| region.share);
        let known = entries.iter().zip(ratios(entries, shares())).zip(shares());
        let rays = |parts: u32| f64::from(parts) / f64::from(PARTS_PER_RAY);
        let regions =
            known.zip(self.learned.counts(index)).map(|(((entry, ratio), share), count)| {
                RegionReadback {
                    trials: rays(count.trials),
                    hits: rays(count.hits),
                    visibility: decode_visibility(*entry),
                    probability: ratio * share,
                }
            });
        let face = key.map_or(index, CellKey::face);
        Ok(CellReadback { key, face, regions: regions.collect() })
    }

    /// Returns what was learned, and the counts since the last rebuild. Fails if the device does.
    pub fn state(&self) -> Result<GuideState> {
        let counted = self.learned.cell_count() * self.partition.regions.len();
        let shares = self.learned.cell_count() * SHARE_WORDS;
        Ok(GuideState {
            origin: self.origin.clone(),
            rectangles: self.partition.rectangles(),
            pending: self.set.buffer(guided::GUIDE_COUNTS).download(counted)?,
            pending_shares: self.set.buffer(guided::GUIDE_SHARES).download(shares)?,
            missing: self.missing()?.into_iter().map(|key| !key).collect(),
            pending_arrivals: self.arrivals()?,
            ..self.learned.state()
        })
    }

    /// Continues from a state, in its grids. Returns true if the geometry differs, so that most counts were
    /// forgotten. [`Error::Usage`] for another environment or number of regions. Fails if the device does.
    pub fn restore(&mut self, state: &GuideState) -> Result<bool> {
        let (here, there) = (&self.origin, &state.origin);
        if here.environment != there.environment || there.regions > self.budget.max_regions as u32 {
            // A file may hold any text.
            let short = |hash: &str| hash.chars().take(12).collect::<String>();
            return Err(Error::usage(format!(
                "the guide belongs to another environment: map {} in {} regions, expected {} in at most \
                 {}; learn it again under this map, with the same --set regions",
                short(&there.environment),
                there.regions,
                short(&here.environment),
                self.budget.max_regions
            )));
        }
        let edge = there.largest_edge;
        let is_sane =
            edge.is_finite() && edge > 0.0 && there.grid_origin.iter().all(|x| x.is_finite());
        let has_face = |key: &u32| CellKey(*key).face() < FACE_COUNT;
        let is_sane = is_sane && state.keys.iter().skip(FACE_COUNT).all(has_face);
        if state.keys.len() < FACE_COUNT || !is_sane {
            return Err(Error::usage("the guide holds no cells, or none that could be found"));
        }
        let partition = self.partition.with_rectangles(&state.rectangles).ok_or_else(|| {
            Error::usage("the regions of the guide do not fill the map; learn it again")
        })?;
        let has_moved = here.geometry != there.geometry;
        let forget = if has_moved { FORGETTING } else { 1 };
        self.origin.grid_origin = there.grid_origin;
        self.origin.largest_edge = edge;
        self.layout.grid_origin = there.grid_origin;
        self.layout.largest_edge = edge;
        self.layout.finest_edge = edge * 0.5_f32.powi(LEVELS);
        self.take_regions(partition)?;
        let learned = Guide::resume(
            self.partition.regions.len(),
            self.budget.cells(self.partition.regions.len()),
            self.slots,
            state,
            forget,
        );
        self.learned = self.with_bounces(learned, &state.arrivals, forget);
        self.clear_counts()?;
        let cells = self.learned.cell_count();
        let pending = start(&state.pending, cells * self.partition.regions.len());
        self.upload_to(guided::GUIDE_COUNTS, pending)?;
        self.upload_to(guided::GUIDE_SHARES, start(&state.pending_shares, cells * SHARE_WORDS))?;
        if self.has_bounces {
            let pending = start(&state.pending_arrivals, cells * ARRIVAL_DIRECTIONS);
            self.upload_to(guided::GUIDE_ARRIVALS, pending)?;
        }
        let mut missing: Vec<u32> = state.missing.iter().map(|word| !word).collect();
        if missing.len() != self.missing_slots {
            missing.retain(|key| *key != CellKey::NONE.0);
            missing.truncate(self.missing_slots);
        }
        self.upload_to(guided::GUIDE_MISSING, &missing)?;
        self.upload()?;
        Ok(has_moved)
    }

    fn take_regions(&mut self, partition: Partition) -> Result<()> {
        let (regions, aliases) = partition.tables();
        self.upload_to(guided::GUIDE_REGIONS, &regions)?;
        self.upload_to(guided::GUIDE_ALIASES, &aliases)?;
        self.upload_to(guided::GUIDE_REGION_OF_CELL, &partition.region_of_cell)?;
        self.layout.region_count = partition.regions.len() as u32;
        self.upload_to(guided::GUIDE, &[self.layout])?;
        self.origin.regions = self.layout.region_count;
        self.partition = partition;
        self.is_split = true;
        Ok(())
    }

    /// Forgets the counts since the last rebuild. Fails if the device does.
    pub fn clear_counts(&self) -> Result<()> {
        let mut commands = Commands::begin(&self.device)?;
        // The rest belongs to no cell.
        let cells = self.learned.cell_count() as u64;
        let mut clear = |binding, bytes_per_cell: u64| {
            commands.fill_start(self.set.buffer(binding), bytes_per_cell * cells, 0);
        };
        clear(guided::GUIDE_COUNTS, COUNT_BYTES * self.partition.regions.len() as u64);
        clear(guided::GUIDE_SHARES, 4 * SHARE_WORDS as u64);
        if self.has_bounces {
            clear(guided::GUIDE_ARRIVALS, ARRIVAL_BYTES * ARRIVAL_DIRECTIONS as u64);
        }
        commands.fill(self.set.buffer(guided::GUIDE_MISSING), GUIDE_NO_KEY);
        commands.submit_and_wait()?;
        Ok(())
    }

    fn upload(&mut self) -> Result<()> {
        self.learned.write_snapshot(&self.partition, &mut self.snapshot);
        let Snapshot { table, entries, arriving, reflected, .. } = &self.snapshot;
        if self.has_bounces {
            self.upload_to(guided::GUIDE_ARRIVING, arriving)?;
            self.upload_to(guided::GUIDE_REFLECTED, &reflected.units)?;
        }
        self.upload_to(guided::GUIDE_TABLE, table)?;
        self.upload_to(guided::GUIDE_ENTRIES, entries)
    }
}

/// Returns as many of the values as there is `room` for.
fn start<T>(values: &[T], room: usize) -> &[T] {
    &values[..values.len().min(room)]
}

/// Makes cells about [`CELL_PIXELS`] wide in the picture, at most a twentieth of the scene.
fn guide_parameters(
    scene: &Scene,
    region_count: usize,
    slots: usize,
    missing_slots: usize,
) -> GuideParameters {
    let low = bounds_of(scene)[0];
    let [edge_per_distance, largest_edge] = cell_edges(scene, CELL_PIXELS);
    GuideParameters {
        // Shift the grid by a third of the largest edge from the corner of the scene, since walls
        // at its sides should not lie between two cells.
        grid_origin: if low.is_finite() { (low - largest_edge / 3.0).into() } else { [0.0; 3] },
        finest_edge: largest_edge * 0.5_f32.powi(LEVELS),
        edge_per_distance,
        largest_edge,
        region_count: region_count as u32,
        table_mask: (slots - 1) as u32,
        missing_mask: (missing_slots - 1) as u32,
    }
}
