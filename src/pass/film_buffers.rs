//! The film on the device.

use std::{collections::BTreeMap, sync::Arc};

use bytemuck::{Pod, Zeroable};

use crate::{
    error::{Error, Result},
    film::{Aov, Sums, Window},
    gpu::{Buffer, Commands, DescriptorSet, Device},
    memory,
    shader::{
        bindings::{FILM, film},
        constants::{
            AOV_ALBEDO, AOV_CACHE_ENTRIES, AOV_GUIDE_CELL, AOV_NORMAL, AOV_POSITION, AOV_VISIBLE,
        },
        structs::Counters,
    },
};

/// Pixels of a block in film order; waves hold whole blocks.
pub(crate) const BLOCK_PIXELS: u32 = 64;
/// Edge of a block, pixels.
const BLOCK_EDGE: u32 = 8;

/// Returns a pixel's position in film order; twin of `wave_pixel` in `glsl/include/wave.glsl`.
pub(crate) fn position_in_film_order(window: Window, column: u32, row: u32) -> u32 {
    let block = row / BLOCK_EDGE * window.width.div_ceil(BLOCK_EDGE) + column / BLOCK_EDGE;
    block * BLOCK_PIXELS + row % BLOCK_EDGE * BLOCK_EDGE + column % BLOCK_EDGE
}

/// Returns the bits `AOV_…` of the layers that passes write.
pub(crate) fn aov_bits(aovs: &[Aov]) -> u32 {
    let bit = |aov: &Aov| match aov {
        Aov::Albedo => AOV_ALBEDO,
        Aov::Normal => AOV_NORMAL,
        Aov::Position => AOV_POSITION,
        Aov::Visible => AOV_VISIBLE,
        Aov::CacheEntries => AOV_CACHE_ENTRIES,
        Aov::GuideCell => AOV_GUIDE_CELL,
        Aov::Variance | Aov::SampleCount => 0,
    };
    aovs.iter().map(bit).fold(0, |bits, bit| bits | bit)
}

/// Checks that there is memory for a film with the layers in the bits `aovs`, on a software device too,
/// and for the sums that are read back and the image that is made of them.
///
/// # Errors
/// [`Error::Memory`].
pub(crate) fn check_memory(device: &Device, window: Window, aovs: u32) -> Result<()> {
    let triples = (aovs & (AOV_ALBEDO | AOV_NORMAL | AOV_POSITION)).count_ones()
        + 2 * (aovs & AOV_GUIDE_CELL).count_ones();
    let pairs = (aovs & (AOV_VISIBLE | AOV_CACHE_ENTRIES)).count_ones();
    // Three sums and the image, in three channels each.
    let copies = if device.capabilities().kind == "software" { 2 } else { 1 };
    let pixel_bytes =
        u64::from(copies * (36 + 12 * triples + 8 * pairs) + 12 * (1 + triples + pairs));
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
    /// Window that there is room for.
    whole: Window,
    /// Window in use; another one lies in the first page.
    window: Window,
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
    sum: Buffer,
    compensation: Buffer,
    squares: Buffer,
    albedo: Buffer,
    normal: Buffer,
    position: Buffer,
    visible: Buffer,
    cache_entries: Buffer,
    guide_cell: Buffer,
    guide_level: Buffer,
}

impl FilmBuffers {
    /// Makes an empty film of the window, with the extra layers in the bits `aovs`, in buffers of at
    /// most `page_bytes` bytes and what the device allows, but of a row of blocks at least.
    pub(crate) fn new(
        device: &Arc<Device>,
        window: Window,
        aovs: u32,
        page_bytes: u64,
    ) -> Result<Self> {
        let page_bytes = page_bytes.min(device.capabilities().max_storage_buffer_range);
        let row_bytes = u64::from(window.width) * size_of::<[f32; 3]>() as u64;
        let blocks_down = window.height.div_ceil(BLOCK_EDGE);
        let rows = page_bytes / row_bytes / u64::from(BLOCK_EDGE);
        let rows = u32::try_from(rows).unwrap_or(blocks_down).clamp(1, blocks_down);
        let counters = Buffer::from_slice(device, "counters", &[Counters::zeroed()])?;
        let page_positions = rows * window.width.div_ceil(BLOCK_EDGE) * BLOCK_PIXELS;
        let make = |first: u32| {
            let last = (first + rows * BLOCK_EDGE).min(window.height);
            Page::new(device, &counters, [first, last].map(|row| row * window.width), aovs)
        };
        Ok(Self {
            pages: (0..window.height)
                .step_by((rows * BLOCK_EDGE) as usize)
                .map(make)
                .collect::<Result<_>>()?,
            counters,
            aovs,
            whole: window,
            window,
            whole_page_positions: page_positions,
            page_positions,
        })
    }

    /// Uses the buffers for a film of `size` pixels, or again for the whole one. The content means nothing
    /// until [`FilmBuffers::clear`].
    ///
    /// # Panics
    /// If a smaller film does not fit into the first page.
    pub(crate) fn reshape(&mut self, [width, height]: [u32; 2]) {
        if [width, height] == [self.whole.width, self.whole.height] {
            self.window = self.whole;
            self.page_positions = self.whole_page_positions;
            return;
        }
        let room = self.pages[0].pixels;
        assert!(
            width as usize * height as usize <= room,
            "a film of {width}x{height} in {room} pixels"
        );
        self.window = Window { x: 0, y: 0, width, height };
        self.page_positions = self.padded_pixels();
    }

    /// Window in use.
    pub(crate) fn window(&self) -> Window {
        self.window
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

    /// Number of pixels in film order, counting whole blocks where they reach beyond the window.
    pub(crate) fn padded_pixels(&self) -> u32 {
        let blocks =
            self.window.width.div_ceil(BLOCK_EDGE) * self.window.height.div_ceil(BLOCK_EDGE);
        blocks * BLOCK_PIXELS
    }

    /// Sets everything to zero.
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
        Ok(Sums {
            width: self.window.width,
            height: self.window.height,
            origin: [self.window.x, self.window.y],
            sum: self.layer(|page| &page.sum, true)?,
            compensation: self.layer(|page| &page.compensation, true)?,
            squares: self.layer(|page| &page.squares, true)?,
            albedo: self.layer(|page| &page.albedo, self.has(AOV_ALBEDO))?,
            normal: self.layer(|page| &page.normal, self.has(AOV_NORMAL))?,
            position: self.layer(|page| &page.position, self.has(AOV_POSITION))?,
            visible: self.layer(|page| &page.visible, self.has(AOV_VISIBLE))?,
            cache_entries: self.layer(|page| &page.cache_entries, self.has(AOV_CACHE_ENTRIES))?,
            guide_cell: self.layer(|page| &page.guide_cell, self.has(AOV_GUIDE_CELL))?,
            guide_level: self.layer(|page| &page.guide_level, self.has(AOV_GUIDE_CELL))?,
            ..Sums::default()
        })
    }

    /// Replaces the content of the film by sums of the same window.
    pub(crate) fn upload(&self, sums: &Sums) -> Result<()> {
        for page in &self.pages {
            let range = page.first..page.first + page.pixels;
            for (buffer, wanted, layer) in [
                (&page.sum, true, &sums.sum),
                (&page.compensation, true, &sums.compensation),
                (&page.squares, true, &sums.squares),
                (&page.albedo, self.has(AOV_ALBEDO), &sums.albedo),
                (&page.normal, self.has(AOV_NORMAL), &sums.normal),
                (&page.position, self.has(AOV_POSITION), &sums.position),
                (&page.guide_cell, self.has(AOV_GUIDE_CELL), &sums.guide_cell),
                (&page.guide_level, self.has(AOV_GUIDE_CELL), &sums.guide_level),
            ] {
                if wanted && let Some(layer) = layer.get(range.clone()) {
                    buffer.upload(bytemuck::cast_slice(layer))?;
                }
            }
            for (buffer, bit, counts) in [
                (&page.visible, AOV_VISIBLE, &sums.visible),
                (&page.cache_entries, AOV_CACHE_ENTRIES, &sums.cache_entries),
            ] {
                if self.has(bit)
                    && let Some(counts) = counts.get(range.clone())
                {
                    buffer.upload(bytemuck::cast_slice(counts))?;
                }
            }
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

    fn has(&self, bit: u32) -> bool {
        self.aovs & bit != 0
    }

    /// Reads a layer of all pages, or nothing if it is not wanted.
    fn layer<T: Pod>(&self, of: impl Fn(&Page) -> &Buffer, wanted: bool) -> Result<Vec<T>> {
        let mut layer = Vec::new();
        if wanted {
            layer.reserve_exact(self.window.width as usize * self.window.height as usize);
            for page in &self.pages {
                let add = |piece: &[T]| layer.extend_from_slice(piece);
                of(page).download_pieces(self.pixels_of(page), add)?;
            }
        }
        Ok(layer)
    }

    fn buffers(&self) -> impl Iterator<Item = &Buffer> {
        self.pages.iter().flat_map(Page::buffers).chain([&self.counters])
    }
}

impl Page {
    /// Makes the empty film of the pixels `first` to `end`, `end` excluded.
    fn new(
        device: &Arc<Device>,
        counters: &Buffer,
        [first, end]: [u32; 2],
        aovs: u32,
    ) -> Result<Self> {
        let pixels = u64::from(end - first);
        let make = |name: &str, bytes: u64, wanted: bool| {
            Buffer::zeroed(device, name, if wanted { bytes * pixels } else { 0 })
        };
        let triple = |name: &str, bit: u32| make(name, 12, aovs & bit != 0);
        let pair = |name: &str, bit: u32| make(name, 8, aovs & bit != 0);
        let sum = make("film sum", 12, true)?;
        let compensation = make("film compensation", 12, true)?;
        let squares = make("film squares", 12, true)?;
        let albedo = triple("film albedo", AOV_ALBEDO)?;
        let normal = triple("film normal", AOV_NORMAL)?;
        let position = triple("film position", AOV_POSITION)?;
        let visible = pair("film visible", AOV_VISIBLE)?;
        let cache_entries = pair("film cache entries", AOV_CACHE_ENTRIES)?;
        let guide_cell = triple("film guide cell", AOV_GUIDE_CELL)?;
        let guide_level = triple("film guide level", AOV_GUIDE_CELL)?;
        let bound = [
            (film::FILM_SUM, &sum),
            (film::FILM_COMPENSATION, &compensation),
            (film::FILM_SQUARES, &squares),
            (film::COUNTERS, counters),
            (film::FILM_ALBEDO, &albedo),
            (film::FILM_NORMAL, &normal),
            (film::FILM_POSITION, &position),
            (film::FILM_VISIBLE, &visible),
            (film::FILM_CACHE_ENTRIES, &cache_entries),
            (film::FILM_GUIDE_CELL, &guide_cell),
            (film::FILM_GUIDE_LEVEL, &guide_level),
        ];
        let set = DescriptorSet::new(device, &FILM, &bound)?;
        Ok(Self {
            set,
            first: first as usize,
            pixels: pixels as usize,
            sum,
            compensation,
            squares,
            albedo,
            normal,
            position,
            visible,
            cache_entries,
            guide_cell,
            guide_level,
        })
    }

    fn buffers(&self) -> [&Buffer; 10] {
        [
            &self.sum,
            &self.compensation,
            &self.squares,
            &self.albedo,
            &self.normal,
            &self.position,
            &self.visible,
            &self.cache_entries,
            &self.guide_cell,
            &self.guide_level,
        ]
    }
}
