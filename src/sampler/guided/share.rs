//! Share of the BRDF among the two techniques that rays come from, learned for every cell.
//!
//! In the one-sample model a ray comes from the BRDF with probability c and from the guide
//! otherwise, and brings X = f / q with q = c p_B + (1 − c) p_G. The iteration c ← E\[X c p_B / q\]
//! / E\[X\] lowers the Kullback-Leibler divergence between f and q with every step (Douc, Guillin,
//! Marin & Robert 2007, "Convergence of adaptive mixtures of importance sampling schemes"). With X²
//! in place of X it would lower the variance (the same, "Minimum variance importance sampling via
//! population Monte Carlo"), which depends on the brightest hits of a cell alone; measured in
//! `docs/experiments.md`, brdf_shares. X is heavy-tailed, so the evidence of a cell weighs as much as its
//! effective number of rays, (Σ X)² / Σ X², against the prior of its surroundings.
//!
//! Deviation: averages the evidence of several rebuilds, each older one with half the weight, where
//! the paper takes the last iteration only. X is known to the octave.
//!
//! Octave of the light of every visible ray, its c p_B / q → [`ShareEvidence`] → share in 256ths.

use super::cells::adds;
use crate::shader::rooms::guided::GUIDE_SHARE_OCTAVES;

/// Words of the counts of one cell: for every octave of X from 2⁻³² on, the number of visible rays
/// and the sum of their c p_B / q in 256ths.
pub const SHARE_WORDS: usize = 2 * GUIDE_SHARE_OCTAVES as usize;

/// Weight of the prior, in effective rays.
const PRIOR_RAYS: f64 = 16.0;
/// Least and greatest share, 256ths: keeps both techniques in use.
const LIMITS: [f64; 2] = [13.0, 230.0];

/// Evidence on the share, in rays of equal weight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShareEvidence {
    /// Effective number of rays.
    rays: f64,
    /// Share that they ask for, times their effective number.
    weighted: f64,
}

impl ShareEvidence {
    /// Evidence of the counts of one cell, [`SHARE_WORDS`] words.
    pub fn from_counts(counts: &[u32]) -> Self {
        let (mut sum, mut squares, mut from_brdf) = (0.0, 0.0, 0.0);
        for (octave, pair) in counts.chunks_exact(2).enumerate() {
            let light = 2.0_f64.powi(octave as i32 - GUIDE_SHARE_OCTAVES as i32 / 2);
            sum += f64::from(pair[0]) * light;
            squares += f64::from(pair[0]) * light * light;
            from_brdf += f64::from(pair[1]) / 256.0 * light;
        }
        if sum <= 0.0 {
            return Self::default();
        }
        let rays = sum * sum / squares;
        Self { rays, weighted: rays * (from_brdf / sum).min(1.0) }
    }

    /// Share of the BRDF, given that of the surroundings; `None` where there is neither prior nor
    /// evidence worth as much.
    pub fn share(self, prior: Option<f64>) -> Option<f64> {
        match prior {
            Some(prior) => Some((self.weighted + PRIOR_RAYS * prior) / (self.rays + PRIOR_RAYS)),
            None => (self.rays >= PRIOR_RAYS).then(|| self.weighted / self.rays),
        }
    }
}

adds!(ShareEvidence: rays weighted);

/// Converts a share to 256ths as they lie on the device; 0 lets the material decide.
pub fn share_in_256ths(share: Option<f64>) -> u32 {
    share.map_or(0, |share| (256.0 * share).round().clamp(LIMITS[0], LIMITS[1]) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts of one cell after a million rays at a discrete integrand.
    fn counts_of(integrand: &[f64], brdf: &[f64], guide: &[f64], share: f64) -> Vec<u32> {
        let mut counts = vec![0; SHARE_WORDS];
        for ((f, brdf), guide) in integrand.iter().zip(brdf).zip(guide) {
            let q = share * brdf + (1.0 - share) * guide;
            let rays = (1e6 * q).round() as u32;
            let octave = (f / q).log2().floor() as i32 + GUIDE_SHARE_OCTAVES as i32 / 2;
            counts[2 * octave as usize] += rays;
            counts[2 * octave as usize + 1] += (f64::from(rays) * 256.0 * share * brdf / q) as u32;
        }
        counts
    }

    #[test]
    fn the_iteration_ends_where_the_divergence_is_least() {
        // f is the mixture with a share of 0.375, where X is 1 everywhere.
        let (brdf, guide) = ([0.5, 0.3, 0.1, 0.1], [0.1, 0.1, 0.3, 0.5]);
        let integrand: Vec<f64> =
            brdf.iter().zip(&guide).map(|(b, g)| 0.375 * b + 0.625 * g).collect();
        let mut share = 0.8;
        for _ in 0..200 {
            let counts = counts_of(&integrand, &brdf, &guide, share);
            share = ShareEvidence::from_counts(&counts).share(None).unwrap();
        }
        // X is known to a factor of two only.
        assert!((share - 0.375).abs() < 0.12, "{share}");
        // One technique that is better everywhere wins.
        let (good, bad) = ([0.5, 0.5, 1e-9, 1e-9], [0.1, 0.1, 0.4, 0.4]);
        let integrand = [0.5, 0.5, 1e-9, 1e-9];
        let mut share = 0.3;
        for _ in 0..60 {
            let counts = counts_of(&integrand, &good, &bad, share);
            share = ShareEvidence::from_counts(&counts).share(None).unwrap();
        }
        assert!(share > 0.97, "{share}");
        assert_eq!(share_in_256ths(Some(share)), 230);
    }

    #[test]
    fn few_bright_rays_count_as_few() {
        let mut counts = vec![0; SHARE_WORDS];
        counts[2 * 32] = 1000;
        counts[2 * 32 + 1] = 1000 * 64;
        let many = ShareEvidence::from_counts(&counts);
        assert!((many.rays - 1000.0).abs() < 1e-9);
        assert!((many.share(None).unwrap() - 0.25).abs() < 1e-9);
        // One ray 65,536 times as bright, from the BRDF.
        counts[2 * 48] = 1;
        counts[2 * 48 + 1] = 256;
        let one = ShareEvidence::from_counts(&counts);
        assert!(one.rays < 1.1, "{}", one.rays);
        let share = one.share(Some(0.25)).unwrap();
        assert!((0.25..0.31).contains(&share), "{share}");
        assert_eq!(ShareEvidence::from_counts(&vec![0; SHARE_WORDS]).share(None), None);
        assert_eq!(share_in_256ths(None), 0);
        assert_eq!(share_in_256ths(Some(0.0)), 13);
    }
}
