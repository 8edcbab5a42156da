//! The keys of the window: one table for the program and for `docs/view.md`.

use crate::{
    film::Aov,
    sampler::Sampler,
    shader::constants::{
        SHOW_ALBEDO, SHOW_CELLS, SHOW_ERROR, SHOW_LEVELS, SHOW_NORMAL, SHOW_PICTURE, SHOW_VISIBLE,
    },
};

/// Effect of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Flies along an axis (0 right, 1 up, 2 forward) as long as the key is held.
    Fly(usize, f32),
    /// Renders by another sampler.
    Sampler(Sampler),
    /// Adds to the number of path vertices.
    Depth(i32),
    /// Adds to the exposure, stops.
    Exposure(f32),
    /// Sets the exposure by the picture.
    AutoExposure,
    /// Goes to the next tone curve.
    Curve,
    /// Shows two samplers side by side, or one again.
    Split,
    /// Lets the next sampler be that of the other side.
    Swap,
    /// Shows a layer, `SHOW_…`, or the picture again if it is shown.
    Layer(u32),
    /// Goes to the next layer.
    NextLayer,
    /// Shows what the pixel under the cursor has learned, or not.
    Inset,
    /// Writes picture, film and camera.
    Save,
    /// Takes the camera back to the start.
    Home,
    /// Writes the camera.
    Bookmark,
    /// Shows the panel, or hides it.
    Panel,
    /// Shows the keys, or hides them.
    Help,
    /// Closes the window.
    Quit,
}

/// Layers in the order of [`Action::NextLayer`], with the layer of the film that each shows.
pub(crate) const LAYERS: [(u32, &str, Option<Aov>); 7] = [
    (SHOW_PICTURE, "picture", None),
    (SHOW_ERROR, "relative error", None),
    (SHOW_ALBEDO, "albedo", Some(Aov::Albedo)),
    (SHOW_NORMAL, "normal", Some(Aov::Normal)),
    (SHOW_VISIBLE, "visible share", Some(Aov::Visible)),
    (SHOW_CELLS, "cells", Some(Aov::GuideCell)),
    (SHOW_LEVELS, "kinds of cells", Some(Aov::GuideCell)),
];

/// Every key but those of samplers: its text, or one of the names `Escape` and `Tab`; its effect; and one
/// phrase for the documentation, empty where the row before says it.
const KEYS: &[(&str, Action, &str)] = &[
    ("w", Action::Fly(2, 1.0), "fly forward and back"),
    ("s", Action::Fly(2, -1.0), ""),
    ("a", Action::Fly(0, -1.0), "fly left and right"),
    ("d", Action::Fly(0, 1.0), ""),
    ("q", Action::Fly(1, -1.0), "fly down and up"),
    ("e", Action::Fly(1, 1.0), ""),
    ("r", Action::Home, "return to the camera of the scene"),
    ("x", Action::Split, "two samplers side by side at equal time, or one"),
    ("z", Action::Swap, "choose the sampler of the other side"),
    ("[", Action::Depth(-1), "fewer and more path vertices"),
    ("]", Action::Depth(1), ""),
    ("-", Action::Exposure(-0.5), "exposure, half a stop down and up"),
    ("=", Action::Exposure(0.5), ""),
    ("0", Action::AutoExposure, "exposure by the picture"),
    ("c", Action::Curve, "next tone curve: clip, reinhard, filmic"),
    (
        "h",
        Action::Layer(SHOW_ERROR),
        "relative error in false colour, from 1% (blue) to 100% (red)",
    ),
    ("g", Action::Layer(SHOW_CELLS), "cells of `guided`"),
    (
        "l",
        Action::NextLayer,
        "next layer: picture, error, albedo, normal, visible share, cells, their kinds",
    ),
    (
        "i",
        Action::Inset,
        "learned sky of the pixel under the cursor: visibility above, density below",
    ),
    ("p", Action::Save, "write the window (PNG), the film (EXR) and the camera (TOML)"),
    ("b", Action::Bookmark, "write the camera alone, to return to it"),
    ("Tab", Action::Panel, "show or hide the panel"),
    ("?", Action::Help, "show or hide these keys"),
    ("Escape", Action::Quit, "hide these keys, or close the window"),
];

pub(crate) fn action_of(key: &str) -> Option<Action> {
    let key = if key.chars().count() == 1 { key.to_lowercase() } else { key.to_owned() };
    let of_sampler = || Sampler::ALL.iter().copied().find(|sampler| sampler.key() == key);
    let known = KEYS.iter().find(|(known, ..)| *known == key).map(|(_, action, _)| *action);
    known.or_else(|| of_sampler().map(Action::Sampler))
}

/// Keys that share an effect, joined, with it.
pub fn rows() -> Vec<(String, String)> {
    let named = |of: fn(Sampler) -> &'static str, separator| {
        Sampler::ALL.iter().map(|sampler| of(*sampler)).collect::<Vec<_>>().join(separator)
    };
    let samplers = (named(Sampler::key, " "), format!("sampler: {}", named(Sampler::name, ", ")));
    let mut rows: Vec<(Vec<&str>, &str)> = Vec::new();
    for (key, _, about) in KEYS {
        match rows.last_mut() {
            Some((keys, _)) if about.is_empty() => keys.push(key),
            _ => rows.push((vec![key], about)),
        }
    }
    let others = rows.into_iter().map(|(keys, about)| (keys.join(" "), about.to_owned()));
    [samplers].into_iter().chain(others).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_distinct_and_complete() {
        let mut keys: Vec<&str> = KEYS.iter().map(|(key, ..)| *key).collect();
        keys.extend(Sampler::ALL.iter().map(|sampler| sampler.key()));
        keys.sort_unstable();
        assert!(keys.windows(2).all(|pair| pair[0] != pair[1]), "{keys:?}");
        for sampler in Sampler::ALL {
            assert_eq!(action_of(sampler.key()), Some(Action::Sampler(*sampler)));
        }
        assert_eq!(action_of("W"), Some(Action::Fly(2, 1.0)));
        assert_eq!(action_of("Escape"), Some(Action::Quit));
        assert_eq!(action_of("y"), None);
        assert!(rows().iter().any(|(keys, _)| keys == "w s"));
    }
}
