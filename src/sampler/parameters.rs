//! Parameters of all samplers, set by `--set key=value`. The table of a new room joins `set` and `keys`.

use super::{
    control_variates::ControlVariatesParameters,
    guided::GuidedParameters,
    haar::HaarParameters,
    knob::{self, Knob},
    portal::PortalParameters,
    product::ProductParameters,
    tiles::TilesParameters,
    visibility::VisibilityParameters,
};
use crate::error::{Error, Result};

/// Parameters of the samplers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// `share-tiles`: edge of the tiles whose pixels share second vertices, 1 for `off`. `None` is `auto`:
    /// `guided` measures what it gains, the other samplers do not share.
    pub share_tiles: Option<u32>,
    /// `candidates`: directions to choose each shadow ray of `ris`, `control-variates` or `guided` from;
    /// `None` is `auto`.
    pub candidates: Option<u32>,
    /// `compensation`: true if `mis`, `portal` and what `guided` falls back to draw directions of the
    /// environment by its compensated density, and `tiles` compensates what it has learned.
    pub compensation: bool,
    /// Parameters of `product`, also within `visibility`; its shares also within `haar`.
    pub product: ProductParameters,
    /// Parameters of `visibility`.
    pub visibility: VisibilityParameters,
    /// Parameters of `guided`.
    pub guided: GuidedParameters,
    /// Parameters of `portal`.
    pub portal: PortalParameters,
    /// Parameters of `haar`.
    pub haar: HaarParameters,
    /// Parameters of `control-variates`.
    pub control_variates: ControlVariatesParameters,
    /// Parameters of `tiles`.
    pub tiles: TilesParameters,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            share_tiles: None,
            candidates: None,
            compensation: true,
            product: ProductParameters::default(),
            visibility: VisibilityParameters::default(),
            guided: GuidedParameters::default(),
            portal: PortalParameters::default(),
            haar: HaarParameters::default(),
            control_variates: ControlVariatesParameters::default(),
            tiles: TilesParameters::default(),
        }
    }
}

/// Parameters shared by several rooms.
const KNOBS: &[Knob<Parameters>] = &[
    Knob {
        key: "candidates",
        set: |parameters, value| {
            let expected =
                "auto, 2, 4, 6 or 8 for ris and control-variates, auto, 1, 4 or 8 for guided";
            let is_known = |count: &Option<u32>| matches!(count, None | Some(1 | 2 | 4 | 6 | 8));
            let mut candidates = None;
            knob::number_or_auto(&mut candidates, value, 1..=8).map_err(|_| expected)?;
            parameters.candidates = Some(candidates).filter(is_known).ok_or(expected)?;
            Ok(())
        },
        get: |parameters| knob::text_or_auto(parameters.candidates),
    },
    Knob {
        key: "compensation",
        set: |parameters, value| knob::choice(&mut parameters.compensation, value, knob::ON_OR_OFF),
        get: |parameters| knob::name_of(&parameters.compensation, knob::ON_OR_OFF),
    },
    Knob {
        key: "preset",
        set: |parameters, value| {
            let mut product = ProductParameters::default();
            let presets = [
                ("default", ProductParameters::default()),
                ("strict", ProductParameters::strict()),
            ];
            knob::choice(&mut product, value, &presets)?;
            let is_preset = presets.iter().any(|(_, preset)| parameters.product == *preset)
                && parameters.visibility == VisibilityParameters::default();
            if !is_preset {
                return Err(
                    "it ahead of other parameters of product and visibility, all of which it sets"
                        .into(),
                );
            }
            parameters.product = product;
            Ok(())
        },
        get: |_| String::new(),
    },
    Knob {
        key: "share-tiles",
        set: |parameters, value| knob::choice(&mut parameters.share_tiles, value, SHARE_TILES),
        get: Parameters::share_tiles_text,
    },
];

const SHARE_TILES: &[(&str, Option<u32>)] =
    &[("auto", None), ("off", Some(1)), ("2", Some(2)), ("4", Some(4)), ("8", Some(8))];

impl Parameters {
    /// Returns `share-tiles` as text.
    pub fn share_tiles_text(&self) -> String {
        knob::name_of(&self.share_tiles, SHARE_TILES)
    }

    /// Sets one parameter from `key=value`. Returns [`Error::Usage`] for a value out of range, or
    /// for an unknown key, listing the known ones.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let (key, value) = assignment.split_once('=').ok_or_else(|| {
            Error::usage(format!("--set {assignment}: expected key=value, found no '='"))
        })?;
        let is_known = knob::set(KNOBS, self, key, value)?
            || knob::set(ProductParameters::KNOBS, &mut self.product, key, value)?
            || knob::set(VisibilityParameters::KNOBS, &mut self.visibility, key, value)?
            || knob::set(GuidedParameters::KNOBS, &mut self.guided, key, value)?
            || knob::set(PortalParameters::KNOBS, &mut self.portal, key, value)?
            || knob::set(HaarParameters::KNOBS, &mut self.haar, key, value)?
            || knob::set(ControlVariatesParameters::KNOBS, &mut self.control_variates, key, value)?
            || knob::set(TilesParameters::KNOBS, &mut self.tiles, key, value)?;
        if is_known {
            return Ok(());
        }
        Err(Error::usage(format!(
            "--set {key}: unknown parameter; known: {}",
            Self::keys().join(", ")
        )))
    }

    /// Every key.
    pub fn keys() -> Vec<&'static str> {
        let mut keys: Vec<_> = KNOBS
            .iter()
            .map(|knob| knob.key)
            .chain(ProductParameters::KNOBS.iter().map(|knob| knob.key))
            .chain(VisibilityParameters::KNOBS.iter().map(|knob| knob.key))
            .chain(GuidedParameters::KNOBS.iter().map(|knob| knob.key))
            .chain(PortalParameters::KNOBS.iter().map(|knob| knob.key))
            .chain(HaarParameters::KNOBS.iter().map(|knob| knob.key))
            .chain(ControlVariatesParameters::KNOBS.iter().map(|knob| knob.key))
            .chain(TilesParameters::KNOBS.iter().map(|knob| knob.key))
            .collect();
        keys.sort_unstable();
        keys
    }

    /// Returns the number of candidates; [`Error::Usage`] if one outside `allowed` was requested.
    pub fn candidates_among(&self, sampler: &str, allowed: &[u32], auto: u32) -> Result<u32> {
        let count = self.candidates.unwrap_or(auto);
        if allowed.contains(&count) {
            return Ok(count);
        }
        Err(Error::usage(format!(
            "--set candidates={count}: {sampler} takes auto or one of {allowed:?}"
        )))
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::sampler::Sampler;

    #[test]
    fn an_unknown_key_lists_the_known_ones() {
        let error = Parameters::default().set("candidate=4").unwrap_err().to_string();
        assert!(
            error.contains("candidate:") && error.contains("known: bounce-candidates"),
            "{error}"
        );
    }

    #[test]
    fn keys_have_one_spelling() {
        let keys = Parameters::keys();
        assert!(keys.windows(2).all(|pair| pair[0] < pair[1]), "{keys:?}");
        assert!(keys.iter().all(|key| !key.contains('_')), "{keys:?}");
    }

    #[test]
    fn values_out_of_range_are_refused() {
        for value in ["candidates=0", "candidates=3", "candidates=10", "candidates=x", "candidates"]
        {
            assert!(Parameters::default().set(value).is_err(), "{value}");
        }
        let mut parameters = Parameters::default();
        parameters.set("candidates=8").unwrap();
        assert_eq!(parameters.candidates, Some(8));
        assert_eq!(Sampler::Ris.describe(&parameters)["candidates"], "8");
        Sampler::Ris.check(&parameters, 1, &[]).unwrap();
        Sampler::Mis.check(&parameters, 1, &[]).unwrap();
        parameters.set("candidates=1").unwrap();
        let error = Sampler::Ris.check(&parameters, 1, &[]).unwrap_err().to_string();
        assert!(error.contains("[2, 4, 6, 8]"), "{error}");
        parameters.set("candidates=auto").unwrap();
        assert_eq!(parameters.candidates_among("guided", &[1, 4], 1).unwrap(), 1);
        parameters.set("guide-memory=16MiB").unwrap();
        assert_eq!(parameters.guided.guide_memory, 16 << 20);
        for wrong in [
            "guide-memory=1",
            "guide-memory=x",
            "guide-memory=4TB",
            "regions=2000",
            "bounce-candidates=0",
            "bounce-candidates=17",
            "open-rays=0",
            "later-rays=0",
            "later-rays=x",
            "lobes=0",
            "lobes=513",
            "k=NaN",
            "brdf-share=0",
            "cache=scene",
            "preset=loose",
            "share-tiles=3",
        ] {
            let error = parameters.set(wrong).unwrap_err().to_string();
            assert!(error.contains(&format!("--set {wrong}: expected")), "{error}");
        }
    }

    #[test]
    fn a_preset_replaces_no_parameter_that_was_set() {
        let mut parameters = Parameters::default();
        parameters.set("preset=strict").unwrap();
        assert_eq!(parameters.product, ProductParameters::strict());
        parameters.set("preset=default").unwrap();
        assert_eq!(parameters, Parameters::default());
        for assignment in ["order=coefficient", "k=1", "cache=pixel"] {
            let mut parameters = Parameters::default();
            parameters.set(assignment).unwrap();
            let before = parameters;
            let error = parameters.set("preset=strict").unwrap_err().to_string();
            assert!(error.contains("--set preset=strict: expected it ahead of"), "{error}");
            assert_eq!(parameters, before);
        }
    }
}
