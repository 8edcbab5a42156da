//! The film on the device.

use std::{collections::BTreeMap, sync::Arc};

use bytemuck::Zeroable;

use crate::{
    error::Result,
    film::{Aov, Sums, Window},
    gpu::{Buffer, Commands, DescriptorSet, Device},
    shader::{
        bindings::{FILM, film},
        constants::{
            AOV_ALBEDO, AOV_CACHE_ENTRIES, AOV_GUIDE_CELL, AOV_NORMAL, AOV_POSITION, AOV_VISIBLE,
        },
        structs::Counters,
    },
};

/// Pixels of a block in film order; waves hold whole blocks.
pub const BLOCK_PIXELS: u32 = 64;
/// Edge of a block, pixels.
const BLOCK_EDGE: u32 = 8;

/// Returns a pixel's position in film order; twin of `wave_pixel` in `glsl/include/wave.glsl`.
pub fn position_in_film_order(window: Window, column: u32, row: u32) -> u32 {
    let block = row / BLOCK_EDGE * window.width.div_ceil(BLOCK_EDGE) + column / BLOCK_EDGE;
    block * BLOCK_PIXELS + row % BLOCK_EDGE * BLOCK_EDGE + column % BLOCK_EDGE
}

/// Returns the bits `AOV_…` of the layers that passes write.
pub fn aov_bits(aovs: &[Aov]) -> u32 {
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

/// Sums per pixel of the window, row by row.
pub struct FilmBuffers {
    set: DescriptorSet,
    sum: Buffer,
    compensation: Buffer,
    squares: Buffer,
    counters: Buffer,
    albedo: Buffer,
    normal: Buffer,
    position: Buffer,
    visible: Buffer,
    cache_entries: Buffer,
    guide_cell: Buffer,
    guide_level: Buffer,
    aovs: u32,
    window: Window,
}

impl FilmBuffers {
    /// Makes an empty film of the window, with the extra layers in the bits `aovs`.
    pub fn new(device: &Arc<Device>, window: Window, aovs: u32) -> Result<Self> {
        let pixels = u64::from(window.width) * u64::from(window.height);
        let triple = |name: &str, wanted: bool| {
            Buffer::zeroed(device, name, if wanted { 12 * pixels } else { 0 })
        };
        let sum = triple("film sum", true)?;
        let compensation = triple("film compensation", true)?;
        let squares = triple("film squares", true)?;
        let counters = Buffer::from_slice(device, "counters", &[Counters::zeroed()])?;
        let albedo = triple("film albedo", aovs & AOV_ALBEDO != 0)?;
        let normal = triple("film normal", aovs & AOV_NORMAL != 0)?;
        let position = triple("film position", aovs & AOV_POSITION != 0)?;
        let pair = |name: &str, bit: u32| {
            Buffer::zeroed(device, name, if aovs & bit == 0 { 0 } else { 8 * pixels })
        };
        let visible = pair("film visible", AOV_VISIBLE)?;
        let cache_entries = pair("film cache entries", AOV_CACHE_ENTRIES)?;
        let guide_cell = triple("film guide cell", aovs & AOV_GUIDE_CELL != 0)?;
        let guide_level = triple("film guide level", aovs & AOV_GUIDE_CELL != 0)?;
        let bound = [
            (film::FILM_SUM, &sum),
            (film::FILM_COMPENSATION, &compensation),
            (film::FILM_SQUARES, &squares),
            (film::COUNTERS, &counters),
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
            sum,
            compensation,
            squares,
            counters,
            albedo,
            normal,
            position,
            visible,
            cache_entries,
            guide_cell,
            guide_level,
            aovs,
            window,
        })
    }

    /// Descriptor set 3.
    pub fn set(&self) -> &DescriptorSet {
        &self.set
    }

    /// Number of pixels in film order, counting whole blocks where they reach beyond the window.
    pub fn padded_pixels(&self) -> u32 {
        let blocks =
            self.window.width.div_ceil(BLOCK_EDGE) * self.window.height.div_ceil(BLOCK_EDGE);
        blocks * BLOCK_PIXELS
    }

    /// Sets everything to zero.
    pub fn clear(&self, device: &Arc<Device>) -> Result<()> {
        let mut commands = Commands::begin(device)?;
        for buffer in self.buffers() {
            commands.fill(buffer, 0);
        }
        commands.submit_and_wait()?;
        Ok(())
    }

    /// Reads the counters and sets them to zero.
    pub fn take_counters(&self) -> Result<Counters> {
        let counters = self.counters.download::<Counters>(1)?;
        self.counters.upload(bytemuck::bytes_of(&Counters::zeroed()))?;
        Ok(counters.first().copied().unwrap_or_default())
    }

    /// Reads everything but the sample count and the film's size, which the renderer knows.
    pub fn download(&self) -> Result<Sums> {
        let pixels = self.window.width as usize * self.window.height as usize;
        let layer = |buffer: &Buffer, bit: u32| {
            buffer.download::<[f32; 3]>(if self.aovs & bit == 0 { 0 } else { pixels })
        };
        let counts = |buffer: &Buffer, bit: u32| {
            buffer.download::<[u32; 2]>(if self.aovs & bit == 0 { 0 } else { pixels })
        };
        Ok(Sums {
            width: self.window.width,
            height: self.window.height,
            origin: [self.window.x, self.window.y],
            sum: self.sum.download(pixels)?,
            compensation: self.compensation.download(pixels)?,
            squares: self.squares.download(pixels)?,
            albedo: layer(&self.albedo, AOV_ALBEDO)?,
            normal: layer(&self.normal, AOV_NORMAL)?,
            position: layer(&self.position, AOV_POSITION)?,
            visible: counts(&self.visible, AOV_VISIBLE)?,
            cache_entries: counts(&self.cache_entries, AOV_CACHE_ENTRIES)?,
            guide_cell: layer(&self.guide_cell, AOV_GUIDE_CELL)?,
            guide_level: layer(&self.guide_level, AOV_GUIDE_CELL)?,
            ..Sums::default()
        })
    }

    /// Replaces the content of the film by sums of the same window.
    pub fn upload(&self, sums: &Sums) -> Result<()> {
        self.sum.upload(bytemuck::cast_slice(&sums.sum))?;
        self.compensation.upload(bytemuck::cast_slice(&sums.compensation))?;
        self.squares.upload(bytemuck::cast_slice(&sums.squares))?;
        for (buffer, bit, layer) in [
            (&self.albedo, AOV_ALBEDO, &sums.albedo),
            (&self.normal, AOV_NORMAL, &sums.normal),
            (&self.position, AOV_POSITION, &sums.position),
            (&self.guide_cell, AOV_GUIDE_CELL, &sums.guide_cell),
            (&self.guide_level, AOV_GUIDE_CELL, &sums.guide_level),
        ] {
            if self.aovs & bit != 0 {
                buffer.upload(bytemuck::cast_slice(layer))?;
            }
        }
        for (buffer, bit, counts) in [
            (&self.visible, AOV_VISIBLE, &sums.visible),
            (&self.cache_entries, AOV_CACHE_ENTRIES, &sums.cache_entries),
        ] {
            if self.aovs & bit != 0 {
                buffer.upload(bytemuck::cast_slice(counts))?;
            }
        }
        Ok(())
    }

    /// Bytes by buffer name.
    pub fn buffer_bytes(&self) -> BTreeMap<String, u64> {
        self.buffers().into_iter().map(|buffer| (buffer.name().to_owned(), buffer.size())).collect()
    }

    fn buffers(&self) -> [&Buffer; 11] {
        [
            &self.sum,
            &self.compensation,
            &self.squares,
            &self.counters,
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
