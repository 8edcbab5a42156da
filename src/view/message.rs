//! Messages between the window's thread and the rendering thread.

use super::{keys::Action, projector::Overlay};
use crate::{
    film::{Curve, Tone},
    sampler::Sampler,
    scene::Camera,
};

/// Message from the window to the renderer.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Input {
    Key(Action),
    Set(Setting),
    /// Directions to fly to changed: right, up, forward, −1 to 1 each.
    Held([f32; 3]),
    /// The pointer moved with a button held, in heights of the window.
    Drag(Drag, [f32; 2]),
    /// The wheel turned, notches away from the user.
    Wheel(f32),
    /// The pointer is at this pixel of the window.
    Pointer([f64; 2]),
    /// The picture was clicked at this pixel of the window.
    Focus([f64; 2]),
    /// The controls look like this now.
    Overlay(Overlay),
    /// The window has this size now, pixels.
    Resized([u32; 2]),
    Redraw,
    Close,
}

impl Input {
    /// True if the film has to start again: a pass under way is worth nothing more.
    pub(super) fn restarts(&self) -> bool {
        match self {
            Self::Key(action) => matches!(
                action,
                Action::Sampler(_) | Action::Depth(_) | Action::Split | Action::Home | Action::Quit
            ),
            Self::Set(setting) => {
                matches!(setting, Setting::FieldOfView(_) | Setting::Aperture(_) | Setting::View(_))
            }
            Self::Held(direction) => *direction != [0.0; 3],
            Self::Drag(..) | Self::Wheel(_) | Self::Close => true,
            _ => false,
        }
    }
}

/// Effect of the pointer while a button is held: the first, the second, the third.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Drag {
    Orbit,
    Turn,
    Pan,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Setting {
    /// Exposure, stops.
    Exposure(f32),
    Curve(Curve),
    Denoise(Denoise),
    /// Factor of the speed of flying.
    Speed(f32),
    /// Vertical field of view, degrees.
    FieldOfView(f32),
    /// Radius of the lens, metres.
    Aperture(f32),
    /// Distance of the plane in focus, metres.
    Focus(f32),
    /// Number in [`Status::views`] of the view to go to.
    View(usize),
}

/// Pictures that Open Image Denoise filters for the window; the film is never filtered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Denoise {
    Never,
    /// Those of a moving camera.
    Moving,
    Always,
}

impl Denoise {
    /// Every choice and its name.
    pub(super) const ALL: [(Self, &str); 3] =
        [(Self::Never, "never"), (Self::Moving, "in motion"), (Self::Always, "always")];
}

/// State of the renderer, for title and controls.
#[derive(Clone, Debug)]
pub(super) struct Status {
    pub title: String,
    pub sampler: Sampler,
    /// True while two samplers are shown.
    pub is_split: bool,
    /// Path vertices.
    pub depth: u32,
    /// Exposure and curve.
    pub tone: Tone,
    /// Pictures that are denoised.
    pub denoise: Denoise,
    /// Factor of the speed of flying.
    pub speed: f32,
    pub camera: Camera,
    /// Samples per pixel, and those at which the film is finished.
    pub samples: [u32; 2],
    pub seconds: f64,
    /// Mean relative standard error, as far as it is known.
    pub error: Option<f64>,
    /// Longest passes: milliseconds a sample of the whole film, longest first.
    pub pass_ms: Vec<(String, f64)>,
    /// Names of the views that were written.
    pub views: Vec<String>,
    /// Last message about a file or a click.
    pub notice: String,
}
