//! From films to the pixels of a window: the passes `show` and `compose`.

use std::sync::Arc;

use crate::{
    error::Result,
    film::{Tone, sky::Sky},
    gpu::{Buffer, Commands, DescriptorSet, Device, MOST_INVOCATIONS, Pipeline},
    pass::Explanation,
    scene::Scene,
    session::Renderer,
    shader::{
        bindings::{VIEW, view},
        spirv,
        structs::{ShownFilm, WindowFrame},
    },
};

/// One of the two films that a window can show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// The only film, or the one to the left.
    Left,
    Right,
}

/// Width of an inset, pixels, and height of the line between its pictures.
const INSET_WIDTH: usize = 256;
const INSET_GAP: usize = 2;
/// Width and height of an inset, pixels.
const INSET_SIZE: [u32; 2] = [INSET_WIDTH as u32, (INSET_WIDTH + INSET_GAP) as u32];

/// A picture over the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Inset {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Red, green, blue, each multiplied by the opacity, and this: row by row.
    pub pixels: Vec<[u8; 4]>,
}

impl Inset {
    /// Draws what the pixel under the pointer has learned of the sky, visibility above density; `None` where
    /// nothing was learned.
    pub(super) fn of(scene: &Scene, recorded: &dyn Explanation) -> Option<Self> {
        let [visibility, density]: [Sky; 2] = recorded.skies(scene, INSET_WIDTH).try_into().ok()?;
        let opaque = |sky: &Sky| -> Vec<[u8; 4]> {
            sky.pixels.iter().map(|[red, green, blue]| [*red, *green, *blue, 255]).collect()
        };
        let gap = vec![[255; 4]; INSET_GAP * INSET_WIDTH];
        let pixels = [opaque(&visibility), gap, opaque(&density)].concat();
        Some(Self { size: INSET_SIZE, pixels })
    }
}

/// The controls over the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Overlay {
    /// Their looks, in the upper left corner.
    pub picture: Inset,
    /// Columns to the left that films leave free, pixels.
    pub reserved: u32,
}

/// Passes and buffers between films and a window.
pub(crate) struct Projector {
    device: Arc<Device>,
    show: Pipeline,
    compose: Pipeline,
    /// Linear pixels of both films, and the set that writes each.
    shown: [DescriptorSet; 2],
    /// Width and height of the whole film, whose shape the picture has.
    film: [u32; 2],
    /// Width and height of what each of them shows.
    sizes: [[u32; 2]; 2],
    inset: Buffer,
    inset_size: [u32; 2],
    overlay: Overlay,
    /// Pixels of the window and room for an overlay of its size.
    window: Option<DescriptorSet>,
    window_size: [u32; 2],
}

impl Projector {
    /// Makes room for films of up to `film` pixels and an inset. Fails if the device does.
    pub(crate) fn new(device: &Arc<Device>, film: [u32; 2]) -> Result<Self> {
        let area = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        let pipeline = |name| Pipeline::new(device, name, spirv::pass(name), &[]);
        let shown = |name| {
            let buffer = Buffer::zeroed(device, name, 12 * area(film))?;
            DescriptorSet::new(device, &VIEW, &[(view::SHOWN, buffer)])
        };
        Ok(Self {
            device: Arc::clone(device),
            show: pipeline("show")?,
            compose: pipeline("compose")?,
            shown: [shown("shown")?, shown("shown right")?],
            film,
            sizes: [[1, 1]; 2],
            inset: Buffer::zeroed(device, "inset", 4 * area(INSET_SIZE))?,
            inset_size: [0, 0],
            overlay: Overlay::default(),
            window: None,
            window_size: [0, 0],
        })
    }

    /// Takes what the film of `renderer` shows: a layer `SHOW_…`, whose sums it has. `mean_radiance` is
    /// that of the film, for its relative error. Fails if the device does.
    pub(crate) fn show(
        &mut self,
        renderer: &Renderer,
        place: Place,
        layer: u32,
        mean_radiance: f32,
    ) -> Result<()> {
        let index = place as usize;
        let mut commands = Commands::begin(&self.device)?;
        for (film, first_pixel, pixels) in renderer.runner.film.pages() {
            for first_place in (0..pixels).step_by(MOST_INVOCATIONS as usize) {
                let end_place = pixels.min(first_place + MOST_INVOCATIONS);
                let constants = ShownFilm {
                    first_pixel,
                    first_place,
                    end_place,
                    sample_count: renderer.sample_count(),
                    layer,
                    mean_radiance,
                };
                let sets = [film, &self.shown[index]];
                let bytes = bytemuck::bytes_of(&constants);
                commands.dispatch(&self.show, &sets, bytes, end_place - first_place)?;
            }
        }
        commands.submit_and_wait()?;
        self.sizes[index] = renderer.film_size;
        Ok(())
    }

    /// Replaces the inset; one of no size is not shown. Fails if the device does. Panics if it is larger than
    /// there is room for.
    pub(crate) fn set_inset(&mut self, inset: &Inset) -> Result<()> {
        self.inset.upload(bytemuck::cast_slice(&inset.pixels))?;
        self.inset_size = inset.size;
        Ok(())
    }

    /// Replaces the controls and returns those before. Fails if the device does.
    pub(crate) fn set_overlay(&mut self, overlay: Overlay) -> Result<Overlay> {
        let before = std::mem::replace(&mut self.overlay, overlay);
        if let Some(window) = self.window.as_ref().filter(|_| self.has_overlay()) {
            let pixels = bytemuck::cast_slice(&self.overlay.picture.pixels);
            window.buffer(view::OVERLAY).upload(pixels)?;
        }
        Ok(before)
    }

    /// True if there are controls, and the window has room for them: it may have shrunk since.
    pub(crate) fn has_overlay(&self) -> bool {
        let [width, height] = self.overlay.picture.size;
        width > 0 && width <= self.window_size[0] && height <= self.window_size[1]
    }

    /// Left and upper edge, width and height of the films in the window.
    fn films(&self) -> [u32; 4] {
        let [width, height] = self.window_size;
        let reserved = if self.has_overlay() { self.overlay.reserved } else { 0 };
        let [left, top, shown_width, shown_height] =
            fit(self.film, [width.saturating_sub(reserved), height]);
        [left + reserved, top, shown_width, shown_height]
    }

    /// Draws the pixels of a window of `size` pixels: films in this tone, whole and at the largest size that
    /// fits. Fails if the device does.
    pub(crate) fn compose(
        &mut self,
        [width, height]: [u32; 2],
        has_right: bool,
        tone: Tone,
        is_bgra: bool,
    ) -> Result<Buffer> {
        let window = match self.window.take() {
            Some(window) if self.window_size == [width, height] => window,
            _ => self.make_window([width, height])?,
        };
        let [left, top, shown_width, shown_height] = self.films();
        let overlay = if self.has_overlay() { self.overlay.picture.size } else { [0, 0] };
        let inset = self.inset_size;
        let has_inset = inset[0] <= shown_width && inset[1] <= shown_height;
        let frame = WindowFrame {
            width,
            height,
            left,
            top,
            shown_width,
            shown_height,
            film_width: self.sizes[0][0],
            film_height: self.sizes[0][1],
            right_width: self.sizes[1][0],
            right_height: self.sizes[1][1],
            is_reduced: u32::from(self.sizes[0] != self.film),
            split: if has_right { left + shown_width / 2 } else { width },
            first_index: 0,
            exposure: tone.exposure.exp2(),
            curve: tone.curve as u32,
            is_bgra: u32::from(is_bgra),
            inset_width: if has_inset { inset[0] } else { 0 },
            inset_height: if has_inset { inset[1] } else { 0 },
            overlay_width: overlay[0],
            overlay_height: overlay[1],
        };
        let set = &*self.window.insert(window);
        let mut commands = Commands::begin(&self.device)?;
        let pixels = width * height;
        for first_index in (0..pixels).step_by(MOST_INVOCATIONS as usize) {
            let frame = WindowFrame { first_index, ..frame };
            let invocations = MOST_INVOCATIONS.min(pixels - first_index);
            commands.dispatch(&self.compose, &[set], bytemuck::bytes_of(&frame), invocations)?;
        }
        commands.submit_and_wait()?;
        Ok(set.buffer(view::WINDOW_PIXELS).clone())
    }

    fn make_window(&mut self, [width, height]: [u32; 2]) -> Result<DescriptorSet> {
        let bytes = 4 * u64::from(width) * u64::from(height);
        let overlay = Buffer::new(&self.device, "controls", bytes)?;
        let bound = [
            (view::SHOWN, self.shown[0].buffer(view::SHOWN)),
            (view::SHOWN_RIGHT, self.shown[1].buffer(view::SHOWN)),
            (view::INSET, &self.inset),
            (view::OVERLAY, &overlay),
            (view::WINDOW_PIXELS, &Buffer::new(&self.device, "window", bytes)?),
        ];
        let set = DescriptorSet::new(&self.device, &VIEW, &bound)?;
        self.window_size = [width, height];
        if self.has_overlay() {
            overlay.upload(bytemuck::cast_slice(&self.overlay.picture.pixels))?;
        }
        Ok(set)
    }

    /// Replaces the linear pixels of a film as it was shown last. Fails if the device does.
    pub(crate) fn replace(&self, place: Place, pixels: &[[f32; 3]]) -> Result<()> {
        self.shown[place as usize].buffer(view::SHOWN).upload(bytemuck::cast_slice(pixels))
    }

    /// Returns the linear pixels of a film as they were shown last. Fails if the device does.
    pub(crate) fn shown(&self, place: Place) -> Result<Vec<[f32; 3]>> {
        let index = place as usize;
        let [width, height] = self.sizes[index];
        self.shown[index].buffer(view::SHOWN).download(width as usize * height as usize)
    }

    /// Returns the pixel of a film of `film` pixels under a place in the window, as composed last.
    pub(crate) fn pixel_under(&self, [x, y]: [f64; 2], film: [u32; 2]) -> Option<[u32; 2]> {
        let [left, top, width, height] = self.films();
        let at = |place: f64, start: u32, length: u32, pixels: u32| {
            let share = (place - f64::from(start)) / f64::from(length.max(1));
            (0.0..1.0).contains(&share).then_some((share * f64::from(pixels)) as u32)
        };
        Some([at(x, left, width, film[0])?, at(y, top, height, film[1])?])
    }
}

/// Returns left and upper edge, width and height of the largest picture of the shape of `film` in the middle
/// of a window.
fn fit(film: [u32; 2], window: [u32; 2]) -> [u32; 4] {
    let [film_width, film_height] = film.map(|side| u64::from(side.max(1)));
    let [width, height] = window.map(u64::from);
    let is_wide = width * film_height > height * film_width;
    let (shown_width, shown_height) = if is_wide {
        (height * film_width / film_height, height)
    } else {
        (width, width * film_height / film_width)
    };
    let (shown_width, shown_height) = (shown_width.max(1), shown_height.max(1));
    let left = width.saturating_sub(shown_width) / 2;
    let top = height.saturating_sub(shown_height) / 2;
    [left, top, shown_width, shown_height].map(|value| u32::try_from(value).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::fit;

    #[test]
    fn films_fit_into_windows() {
        assert_eq!(fit([64, 48], [64, 48]), [0, 0, 64, 48]);
        assert_eq!(fit([64, 48], [128, 48]), [32, 0, 64, 48]);
        assert_eq!(fit([64, 48], [64, 200]), [0, 76, 64, 48]);
        assert_eq!(fit([640, 480], [1, 1]), [0, 0, 1, 1]);
    }
}
