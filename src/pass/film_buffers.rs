//! The film on the device.

use std::{collections::BTreeMap, ops::Range, sync::Arc};

use bytemuck::{Pod, Zeroable};

use crate::{
    error::{Error, Result},
    film::{
        Aov, GroupSums, Sums, Window,
        layers::{COUNTS, COVERAGES, Coverage, TRIPLES},
    },
    gpu::{Buffer, Commands, DescriptorSet, Device},
    memory,
    shader::{
        bindings::{Binding, FILM, film},
        constants::{
            AOV_ALBEDO, AOV_CACHE_ENTRIES, AOV_GUIDE_CELL, AOV_MATERIALS, AOV_NORMAL, AOV_OBJECTS,
            AOV_POSITION, AOV_UNFILTERED, AOV_VISIBLE, FILM_BLOCK,
        },
        structs::Counters,
    },
};

/// Rows of other pages that a page keeps the radiance of: one before it and one after.
const EDGE_ROWS: u64 = 2;
const RADIANCE_BYTES: u64 = size_of::<[f32; 3]>() as u64;
/// Pixels of a block in film order; waves hold whole blocks.
pub(crate) const BLOCK_PIXELS: u32 = FILM_BLOCK * FILM_BLOCK;

/// Buffers of the layers: name, binding, and bit `AOV_…` that asks for it, 0 for those that every film has.
/// First [`Sums::triples`], then [`Sums::counts`] and [`Sums::coverages`].
const LAYERS: [(&str, Binding, u32); FIRST_COVERAGE + COVERAGES.len()] = [
    ("film sum", film::FILM_SUM, 0),
    ("film compensation", film::FILM_COMPENSATION, 0),
    ("film squares", film::FILM_SQUARES, 0),
    ("film squares compensation", film::FILM_SQUARES_COMPENSATION, 0),
    ("film unfiltered", film::FILM_UNFILTERED, AOV_UNFILTERED),
    ("film albedo", film::FILM_ALBEDO, AOV_ALBEDO),
    ("film normal", film::FILM_NORMAL, AOV_NORMAL),
    ("film position", film::FILM_POSITION, AOV_POSITION),
    ("film guide cell", film::FILM_GUIDE_CELL, AOV_GUIDE_CELL),
    ("film guide level", film::FILM_GUIDE_LEVEL, AOV_GUIDE_CELL),
    ("film visible", film::FILM_VISIBLE, AOV_VISIBLE),
    ("film cache entries", film::FILM_CACHE_ENTRIES, AOV_CACHE_ENTRIES),
    ("film objects", film::FILM_OBJECTS, AOV_OBJECTS),
    ("film materials", film::FILM_MATERIALS, AOV_MATERIALS),
];
/// Place of the first coverage in [`LAYERS`].
const FIRST_COVERAGE: usize = TRIPLES.len() + COUNTS.len();

/// Number of pixels of a window in film order, counting whole blocks where they reach beyond it.
pub(crate) fn padded_pixels(window: Window) -> u32 {
    window.width.div_ceil(FILM_BLOCK) * window.height.div_ceil(FILM_BLOCK) * BLOCK_PIXELS
}

/// Returns a pixel's position in film order; twin of `wave_pixel` in `glsl/include/wave.glsl`.
pub(crate) fn position_in_film_order(window: Window, column: u32, row: u32) -> u32 {
    let block = row / FILM_BLOCK * window.width.div_ceil(FILM_BLOCK) + column / FILM_BLOCK;
    block * BLOCK_PIXELS + row % FILM_BLOCK * FILM_BLOCK + column % FILM_BLOCK
}

/// Returns the bits `AOV_…` of the layers that passes write.
pub(crate) fn aov_bits(aovs: &[Aov]) -> u32 {
    let bit = |aov: &Aov| match aov {
        Aov::Unfiltered => AOV_UNFILTERED,
        Aov::Albedo => AOV_ALBEDO,
        Aov::Normal => AOV_NORMAL,
        Aov::Position => AOV_POSITION,
        Aov::Visible => AOV_VISIBLE,
        Aov::CacheEntries => AOV_CACHE_ENTRIES,
        Aov::GuideCell => AOV_GUIDE_CELL,
        Aov::CryptoObject => AOV_OBJECTS,
        Aov::CryptoMaterial => AOV_MATERIALS,
        Aov::Variance | Aov::SampleCount | Aov::LightGroups => 0,
    };
    aovs.iter().map(bit).fold(0, |bits, bit| bits | bit)
}

/// Checks that there is memory for a film with the layers in the bits `aovs` and of groups of lights, on a
/// software device too, and for the sums that are read back and the image that is made of them. Fails with
/// [`Error::Memory`] if there is not.
pub(crate) fn check_memory(
    device: &Device,
    window: Window,
    aovs: u32,
    light_groups: u32,
) -> Result<()> {
    let triples = (aovs & (AOV_UNFILTERED | AOV_ALBEDO | AOV_NORMAL | AOV_POSITION)).count_ones()
        + 2 * (aovs & AOV_GUIDE_CELL).count_ones();
    let coverages = (aovs & (AOV_OBJECTS | AOV_MATERIALS)).count_ones();
    let pairs = (aovs & (AOV_VISIBLE | AOV_CACHE_ENTRIES)).count_ones()
        + coverages * size_of::<Coverage>() as u32 / 8;
    // Four sums and the image, in three channels each, and the radiance of a sweep.
    let copies = if device.capabilities().is_software() { 2 } else { 1 };
    let pixel_bytes = u64::from(copies * (48 + 12 * triples + 8 * pairs + 24 * light_groups))
        + u64::from(12 * (2 + triples + pairs + 2 * light_groups));
    let Window { width, height, .. } = window;
    let asker = format_args!("a film of {width}x{height} pixels");
    memory::check(asker, u64::from(width) * u64::from(height) * pixel_bytes).map_err(Error::memory)
}

/// Sums per pixel of the window, row by row, in pages of whole rows of blocks: a storage buffer has a
/// limit, the film of a window has none.
pub(crate) struct FilmBuffers {
    pages: Vec<Page>,
    counters: Buffer,
    aovs: u32,
    /// Names of the groups of lights that it keeps apart.
    light_groups: Vec<String>,
    /// Window that there is room for.
    whole: Window,
    /// Window in use; another one lies in the first page.
    pub(crate) window: Window,
    /// Part of it that is read back.
    pub(crate) kept: Window,
    /// Positions in film order of every page but the last, which may have fewer: of the whole window, and
    /// of the one in use.
    whole_page_positions: u32,
    page_positions: u32,
}

/// The film of some rows of blocks.
struct Page {
    set: DescriptorSet,
    /// Pixels of the window before the page, and in it.
    first: usize,
    pixels: usize,
}

impl FilmBuffers {
    /// Makes an empty film of the window, with the extra layers in the bits `aovs` and of groups of lights,
    /// in buffers of at most `page_bytes` bytes and what the device allows, but of a row of blocks at least,
    /// for sweeps of up to `sweep_samples` samples.
    pub(crate) fn new(
        device: &Arc<Device>,
        window: Window,
        aovs: u32,
        light_groups: &[String],
        page_bytes: u64,
        sweep_samples: u32,
    ) -> Result<Self> {
        let page_bytes = page_bytes.min(device.capabilities().max_storage_buffer_range);
        let layers = 1 + light_groups.len() as u64;
        let row_bytes = u64::from(sweep_samples * window.width) * layers * RADIANCE_BYTES;
        let group_bytes = 2 * (layers - 1) * RADIANCE_BYTES;
        let widest_row = row_bytes.max(u64::from(window.width) * group_bytes);
        let blocks_down = window.height.div_ceil(FILM_BLOCK);
        let rows = (page_bytes / widest_row).saturating_sub(EDGE_ROWS) / u64::from(FILM_BLOCK);
        let rows = u32::try_from(rows).unwrap_or(blocks_down).clamp(1, blocks_down);
        let counters = Buffer::from_slice(device, "counters", &[Counters::zeroed()])?;
        let page_positions = rows * window.width.div_ceil(FILM_BLOCK) * BLOCK_PIXELS;
        let make = |first: u32| {
            let last = (first + rows * FILM_BLOCK).min(window.height);
            let radiance = u64::from(last - first) + EDGE_ROWS;
            let pixels = [first, last].map(|row| row * window.width);
            Page::new(device, &counters, pixels, aovs, [group_bytes, radiance * row_bytes])
        };
        Ok(Self {
            pages: (0..window.height)
                .step_by((rows * FILM_BLOCK) as usize)
                .map(make)
                .collect::<Result<_>>()?,
            counters,
            aovs,
            light_groups: light_groups.to_vec(),
            whole: window,
            window,
            kept: window,
            whole_page_positions: page_positions,
            page_positions,
        })
    }

    /// Uses the buffers for a film of `size` pixels, or again for the whole one. The content means nothing
    /// until [`FilmBuffers::clear`]. Panics if a smaller film does not fit into the first page.
    pub(crate) fn reshape(&mut self, [width, height]: [u32; 2]) {
        if [width, height] == [self.whole.width, self.whole.height] {
            (self.window, self.kept) = (self.whole, self.whole);
            self.page_positions = self.whole_page_positions;
            return;
        }
        let room = self.pages[0].pixels;
        assert!(
            width as usize * height as usize <= room,
            "a film of {width}x{height} in {room} pixels"
        );
        self.window = Window { x: 0, y: 0, width, height };
        self.kept = self.window;
        self.page_positions = self.padded_pixels();
    }

    pub(crate) fn is_whole(&self) -> bool {
        self.kept == self.window
    }

    /// Places in the window in use of the rows that are read back.
    fn kept_rows(&self) -> impl Iterator<Item = Range<usize>> {
        let Window { x, y, width, height } = self.kept;
        let (left, top) = ((x - self.window.x) as usize, y - self.window.y);
        let stride = self.window.width as usize;
        (top..top + height).map(move |row| {
            let start = row as usize * stride + left;
            start..start + width as usize
        })
    }

    /// Descriptor set 3 of every page in use, its first pixel and its number of pixels.
    pub(crate) fn pages(&self) -> impl Iterator<Item = (&DescriptorSet, u32, u32)> {
        let used = self.pages.iter().map(|page| (page, self.pixels_of(page)));
        used.filter(|(_, pixels)| *pixels > 0)
            .map(|(page, pixels)| (&page.set, page.first as u32, pixels as u32))
    }

    /// Pixels of the window in use that lie in a page.
    fn pixels_of(&self, page: &Page) -> usize {
        let pixels = self.window.width as usize * self.window.height as usize;
        page.pixels.min(pixels.saturating_sub(page.first))
    }

    fn page(&self, position: u32) -> &Page {
        let last = self.pages.len() - 1;
        &self.pages[last.min((position / self.page_positions) as usize)]
    }

    /// Descriptor set 3 of the page that has a position in film order.
    pub(crate) fn set(&self, position: u32) -> &DescriptorSet {
        &self.page(position).set
    }

    /// Index of the first pixel of that page.
    pub(crate) fn first_pixel(&self, position: u32) -> u32 {
        self.page(position).first as u32
    }

    /// Number of positions from `position` to the end of its page.
    pub(crate) fn left_in_page(&self, position: u32) -> u32 {
        self.page_positions - position % self.page_positions
    }

    /// Number of pixels in film order, as [`padded_pixels`].
    pub(crate) fn padded_pixels(&self) -> u32 {
        padded_pixels(self.window)
    }

    pub(crate) fn clear(&self, device: &Arc<Device>) -> Result<()> {
        let mut commands = Commands::begin(device)?;
        for buffer in self.buffers() {
            commands.fill(buffer, 0);
        }
        commands.submit_and_wait()?;
        Ok(())
    }

    /// Reads the counters and sets them to zero.
    pub(crate) fn take_counters(&self) -> Result<Counters> {
        let counters = self.counters.download::<Counters>(1)?;
        self.counters.upload(bytemuck::bytes_of(&Counters::zeroed()))?;
        Ok(counters.first().copied().unwrap_or_default())
    }

    /// Reads everything but the sample count and the film's size, which the renderer knows.
    pub(crate) fn download(&self) -> Result<Sums> {
        let mut sums = Sums {
            width: self.kept.width,
            height: self.kept.height,
            origin: [self.kept.x, self.kept.y],
            ..Sums::default()
        };
        self.download_layers(0, &mut sums.triples_mut())?;
        self.download_layers(TRIPLES.len(), &mut sums.counts_mut())?;
        self.download_layers(FIRST_COVERAGE, &mut sums.coverages_mut())?;
        sums.groups = self.download_groups()?;
        Ok(sums)
    }

    /// Most samples of a sweep over the window in use, 1 at least.
    pub(crate) fn sweep_samples(&self) -> u32 {
        let page = &self.pages[0];
        let pixels = self.pixels_of(page) as u64 + EDGE_ROWS * u64::from(self.window.width);
        let samples = page.radiance().size() / (pixels * self.sample_bytes());
        u32::try_from(samples).unwrap_or(u32::MAX).max(1)
    }

    /// Copies the radiance of `samples` samples along the edges of pages to the pages beside them.
    pub(crate) fn copy_edges(&self, commands: &mut Commands, samples: u32) {
        let width = u64::from(self.window.width);
        let row_bytes = width * u64::from(samples) * self.sample_bytes();
        let used = self.pages.iter().filter(|page| self.pixels_of(page) > 0);
        let used: Vec<&Page> = used.collect();
        for pair in used.windows(2) {
            let rows = pair[0].pixels as u64 / width;
            let [above, below] = [pair[0].radiance(), pair[1].radiance()];
            commands.copy(above, rows * row_bytes, below, 0, row_bytes);
            commands.copy(below, row_bytes, above, (rows + 1) * row_bytes, row_bytes);
        }
    }

    /// Reads the radiance of a sweep of one sample to what is pending of `sums`; what the sweep has not
    /// reached means nothing.
    pub(crate) fn download_radiance(&self, sums: &mut Sums) -> Result<()> {
        let layers = 1 + self.light_groups.len();
        for page in &self.pages {
            let edge = self.window.width as usize;
            let pixels = self.pixels_of(page);
            let all: Vec<[f32; 3]> = page.radiance().download((edge + pixels) * layers)?;
            for sample in all.chunks_exact(layers).skip(edge) {
                sums.pending.push(sample[0]);
                for (group, own) in sums.groups.iter_mut().zip(&sample[1..]) {
                    group.pending.push(*own);
                }
            }
        }
        Ok(())
    }

    /// Replaces the content of the film by sums of the same window.
    pub(crate) fn upload(&self, sums: &Sums) -> Result<()> {
        for page in &self.pages {
            if let Some(pixels) = sums.pending.get(page.first..page.first + page.pixels) {
                let edge = self.window.width as usize * (1 + self.light_groups.len());
                let mut samples = vec![[0.0; 3]; edge];
                for (pixel, radiance) in (page.first..).zip(pixels) {
                    samples.push(*radiance);
                    let of =
                        |name: &String| sums.group(name).map_or([0.0; 3], |own| own.pending[pixel]);
                    samples.extend(self.light_groups.iter().map(of));
                }
                page.radiance().upload(bytemuck::cast_slice(&samples))?;
            }
        }
        self.upload_layers(0, &sums.triples())?;
        self.upload_layers(TRIPLES.len(), &sums.counts())?;
        self.upload_layers(FIRST_COVERAGE, &sums.coverages())?;
        self.upload_groups(sums)
    }

    fn sample_bytes(&self) -> u64 {
        (1 + self.light_groups.len() as u64) * RADIANCE_BYTES
    }

    fn download_groups(&self) -> Result<Vec<GroupSums>> {
        let mut all: Vec<[f32; 3]> = Vec::new();
        let values = 2 * self.light_groups.len();
        for page in self.pages.iter().filter(|_| values > 0) {
            let add = |piece: &[_]| all.extend_from_slice(piece);
            let groups = page.set.buffer(film::FILM_GROUPS);
            groups.download_pieces(self.pixels_of(page) * values, add)?;
        }
        let kept = |part: usize| {
            self.kept_rows().flatten().map(|pixel| all[pixel * values + part]).collect()
        };
        let sums = |(index, name): (usize, &String)| GroupSums {
            name: name.clone(),
            sum: kept(2 * index),
            compensation: kept(2 * index + 1),
            pending: Vec::new(),
        };
        Ok(self.light_groups.iter().enumerate().map(sums).collect())
    }

    fn upload_groups(&self, sums: &Sums) -> Result<()> {
        let values = 2 * self.light_groups.len();
        let pixels = self.window.width as usize * self.window.height as usize;
        let mut all = vec![[0.0; 3]; pixels * values];
        for (index, name) in self.light_groups.iter().enumerate() {
            let Some(group) = sums.group(name) else { continue };
            for (pixel, parts) in
                self.kept_rows().flatten().zip(group.sum.iter().zip(&group.compensation))
            {
                let at = pixel * values + 2 * index;
                (all[at], all[at + 1]) = (*parts.0, *parts.1);
            }
        }
        for page in self.pages.iter().filter(|page| values > 0 && self.pixels_of(page) > 0) {
            let own = page.first * values..(page.first + self.pixels_of(page)) * values;
            page.set.buffer(film::FILM_GROUPS).upload(bytemuck::cast_slice(&all[own]))?;
        }
        Ok(())
    }

    /// Bytes by buffer name, all pages together.
    pub(crate) fn buffer_bytes(&self) -> BTreeMap<String, u64> {
        let mut bytes = BTreeMap::new();
        for buffer in self.buffers() {
            *bytes.entry(buffer.name().to_owned()).or_default() += buffer.size();
        }
        bytes
    }

    /// Reads those of [`LAYERS`] from `first` on of all pages, as far as they are asked for.
    fn download_layers<T: Pod>(&self, first: usize, layers: &mut [&mut Vec<T>]) -> Result<()> {
        let asked_for = (first..).zip(layers).filter(|(index, _)| is_asked_for(*index, self.aovs));
        for (index, layer) in asked_for {
            layer.reserve_exact(self.window.width as usize * self.window.height as usize);
            for page in &self.pages {
                let add = |piece: &[T]| layer.extend_from_slice(piece);
                page.layer(index).download_pieces(self.pixels_of(page), add)?;
            }
            if !self.is_whole() {
                **layer = self.kept_rows().flat_map(|row| layer[row].iter().copied()).collect();
            }
        }
        Ok(())
    }

    fn upload_layers<T: Pod>(&self, first: usize, layers: &[&Vec<T>]) -> Result<()> {
        for (index, mut layer) in (first..).zip(layers.iter().copied()) {
            let mut whole = Vec::new();
            if !self.is_whole() && !layer.is_empty() {
                whole.resize(self.window.width as usize * self.window.height as usize, T::zeroed());
                for (row, values) in self.kept_rows().zip(layer.chunks(self.kept.width as usize)) {
                    whole[row].copy_from_slice(values);
                }
                layer = &whole;
            }
            for page in self.pages.iter().filter(|_| is_asked_for(index, self.aovs)) {
                if let Some(pixels) = layer.get(page.first..page.first + page.pixels) {
                    page.layer(index).upload(bytemuck::cast_slice(pixels))?;
                }
            }
        }
        Ok(())
    }

    fn buffers<'a>(&'a self) -> impl Iterator<Item = &'a Buffer> {
        let layers = LAYERS.iter().map(|(_, binding, _)| *binding);
        let own = layers.chain([film::FILM_GROUPS, film::FILM_RADIANCE]);
        let of_page = move |page: &'a Page| own.clone().map(|binding| page.set.buffer(binding));
        self.pages.iter().flat_map(of_page).chain([&self.counters])
    }
}

impl Page {
    /// Makes the empty film of the pixels `first` to `end`, `end` excluded, with so many bytes for the groups
    /// of lights of a pixel and for the radiance of a sweep.
    fn new(
        device: &Arc<Device>,
        counters: &Buffer,
        [first, end]: [u32; 2],
        aovs: u32,
        [group_bytes, radiance_bytes]: [u64; 2],
    ) -> Result<Self> {
        let pixels = u64::from(end - first);
        let make = |(index, (name, binding, _)): (usize, &(&str, Binding, u32))| -> Result<_> {
            let bytes = match index {
                _ if !is_asked_for(index, aovs) => 0,
                _ if index < TRIPLES.len() => 12,
                _ if index < FIRST_COVERAGE => 8,
                _ => size_of::<Coverage>() as u64,
            };
            Ok((*binding, Buffer::zeroed(device, name, bytes * pixels)?))
        };
        let mut bound = LAYERS.iter().enumerate().map(make).collect::<Result<Vec<_>>>()?;
        let zeroed = |name, bytes| Buffer::zeroed(device, name, bytes);
        bound.extend([
            (film::COUNTERS, counters.clone()),
            (film::FILM_RADIANCE, zeroed("film radiance", radiance_bytes)?),
            (film::FILM_GROUPS, zeroed("film groups", group_bytes * pixels)?),
        ]);
        let set = DescriptorSet::new(device, &FILM, &bound)?;
        Ok(Self { set, first: first as usize, pixels: pixels as usize })
    }

    /// One of [`LAYERS`].
    fn layer(&self, index: usize) -> &Buffer {
        self.set.buffer(LAYERS[index].1)
    }

    /// Radiance of a sweep, of the picture and of its groups of lights, [`EDGE_ROWS`] included.
    fn radiance(&self) -> &Buffer {
        self.set.buffer(film::FILM_RADIANCE)
    }
}

/// Tests whether a film with the layers in the bits `aovs` has one of [`LAYERS`].
fn is_asked_for(index: usize, aovs: u32) -> bool {
    let (.., bit) = LAYERS[index];
    bit == 0 || aovs & bit != 0
}
