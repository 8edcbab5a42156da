//! Settings of a render, and checks that they can be rendered.

use crate::{
    error::{Error, Result},
    film::{Aov, Window},
    pass::{PathLists, Roulette},
    sampler::{Parameters, Sampler},
    scene::{Filter, Scene},
};

/// Lit vertices of a path for the commands, if neither an option nor the scene's file says otherwise.
pub const DEFAULT_DEPTH: u32 = 8;

/// Settings of a render, apart from its scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Sampler that chooses directions.
    pub sampler: Sampler,
    /// Parameters of the sampler.
    pub parameters: Parameters,
    /// Directions traced at every vertex of every camera path.
    pub shadow_rays: u32,
    /// Path vertices at which environment light is gathered; 1 is direct light.
    pub depth: u32,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Index of the first sample of every pixel.
    pub first_sample: u32,
    /// Part of the film; the whole film if absent.
    pub window: Option<Window>,
    /// Extra layers.
    pub aovs: Vec<Aov>,
    /// Where paths of several vertices end by chance.
    pub roulette: Roulette,
    /// When passes walk lists of living paths, which changes no bit of the picture.
    pub path_lists: PathLists,
    /// Most bytes of one buffer of the film, beside the device's own limit; larger films have pages,
    /// which changes no bit of the picture.
    pub film_page_bytes: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            sampler: Sampler::Mis,
            parameters: Parameters::default(),
            shadow_rays: 5,
            depth: 1,
            seed: 0,
            first_sample: 0,
            window: None,
            aovs: Vec::new(),
            roulette: Roulette::default(),
            path_lists: PathLists::default(),
            film_page_bytes: u64::MAX,
        }
    }
}

/// Returns the window of `settings`, or the whole film.
pub fn window_of(settings: &Settings, scene: &Scene) -> Window {
    let [width, height] = [scene.film.width, scene.film.height];
    settings.window.unwrap_or(Window { x: 0, y: 0, width, height })
}

/// Returns the window whose samples the picture needs: around that of `settings`, one pixel more where
/// the film has one and its filter reaches so far.
pub fn traced_window(settings: &Settings, scene: &Scene) -> Window {
    let window = window_of(settings, scene);
    if scene.film.filter == Filter::Box {
        return window;
    }
    let grown = |start: u32, length: u32, end: u32| {
        let first = start.saturating_sub(1);
        (first, start.saturating_add(length).saturating_add(1).min(end) - first)
    };
    let (x, width) = grown(window.x, window.width, scene.film.width);
    let (y, height) = grown(window.y, window.height, scene.film.height);
    Window { x, y, width, height }
}

impl Settings {
    /// Returns [`Error::Usage`] for settings that cannot be rendered, before anything is allocated.
    pub fn check(&self, film_size: [u32; 2]) -> Result<()> {
        let end = |start: u32, length: u32| u64::from(start) + u64::from(length);
        if let Some(window) = self.window
            && (window.width == 0
                || window.height == 0
                || end(window.x, window.width) > u64::from(film_size[0])
                || end(window.y, window.height) > u64::from(film_size[1]))
        {
            return Err(Error::usage(format!(
                "crop window {},{},{},{} does not lie in the film of {}x{} pixels",
                window.x,
                window.y,
                end(window.x, window.width),
                end(window.y, window.height),
                film_size[0],
                film_size[1]
            )));
        }
        if self.shadow_rays > 4096 {
            return Err(Error::usage(format!(
                "--shadow-rays {}: expected at most 4096; use more samples per pixel",
                self.shadow_rays
            )));
        }
        if !(1..=64).contains(&self.depth) {
            return Err(Error::usage(format!("--depth {}: expected 1 to 64", self.depth)));
        }
        if !(self.roulette.throughput >= 0.0 && self.roulette.throughput.is_finite()) {
            return Err(Error::usage(format!(
                "--roulette-throughput {}: expected 0 or more; 0 ends no path",
                self.roulette.throughput
            )));
        }
        self.sampler.check(&self.parameters, self.depth, &self.aovs)
    }
}

/// Parses `640x480`; each side 1 to 16384.
pub fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let side = |side: &str| side.parse().ok().filter(|side| (1..=16384).contains(side));
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some([side(width)?, side(height)?]))
        .ok_or_else(|| format!("expected WIDTHxHEIGHT, each 1 to 16384, found {text:?}"))
}
