//! Alias tables: draw an index by its probability from two numbers, without a search.

/// One column of an alias table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AliasEntry {
    /// The column keeps its own index if a uniform number in `0..scale` is below this.
    pub threshold: u64,
    /// Index drawn otherwise; the column's own if it holds no other.
    pub alias: u32,
}

/// Builds the alias table of `weights`, with thresholds in `0..=scale` (Walker 1977; Vose 1991).
///
/// Thresholds are rounded: the table draws with [`probabilities`], not exactly in proportion to the
/// weights. It never draws an index of weight 0. `None` if the weights sum to 0 or a subnormal. Panics if a
/// weight is negative or not finite: a mistake of the caller.
pub(crate) fn alias_table(weights: &[f64], scale: u64) -> Option<Vec<AliasEntry>> {
    assert!(
        weights.iter().all(|weight| weight.is_finite() && *weight >= 0.0),
        "weights are finite and not negative"
    );
    let sum: f64 = weights.iter().sum();
    if sum <= 0.0 || sum.is_subnormal() {
        return None;
    }
    let count = weights.len() as f64;
    let mut left: Vec<f64> = weights.iter().map(|weight| weight / sum * count).collect();
    let own = |index: usize| AliasEntry { threshold: scale, alias: index as u32 };
    let mut table: Vec<AliasEntry> = (0..weights.len()).map(own).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) =
        (0..weights.len()).partition(|&index| left[index] < 1.0);
    while let (Some(&poor), Some(&rich)) = (small.last(), large.last()) {
        small.pop();
        let mut threshold = (left[poor] * scale as f64).round() as u64;
        if weights[poor] > 0.0 {
            // A positive weight keeps a share, however small: the sampler stays unbiased.
            threshold = threshold.max(1);
        }
        table[poor] = AliasEntry { threshold, alias: rich as u32 };
        left[rich] -= 1.0 - left[poor];
        if left[rich] < 1.0 {
            large.pop();
            small.push(rich);
        }
    }
    // Rounding leaves these columns over: keep them full, unless their weight is 0.
    if let Some(heaviest) = (0..weights.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b])) {
        for index in small {
            if weights[index] <= 0.0 {
                table[index] = AliasEntry { threshold: 0, alias: heaviest as u32 };
            }
        }
    }
    Some(table)
}

/// Returns the probability with which `table` draws each index, exact but for the final division.
pub fn probabilities(table: &[AliasEntry], scale: u64) -> Vec<f64> {
    let mut parts = vec![0_u64; table.len()];
    for (index, entry) in table.iter().enumerate() {
        parts[index] += entry.threshold;
        parts[entry.alias as usize] += scale - entry.threshold;
    }
    let whole = scale as f64 * table.len() as f64;
    parts.into_iter().map(|part| part as f64 / whole).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_the_weights_and_sum_to_one() {
        let weights = [0.5, 0.0, 3.0, 1e-9, 1.25, 0.0, 2.0, 40.0];
        let sum: f64 = weights.iter().sum();
        for scale in [1 << 16, 1 << 32] {
            let table = alias_table(&weights, scale).unwrap();
            let found = probabilities(&table, scale);
            assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            for (weight, probability) in weights.iter().zip(&found) {
                assert!((weight / sum - probability).abs() < 1.0 / scale as f64, "{weight}");
                assert_eq!(*weight > 0.0, *probability > 0.0, "{weight}");
            }
        }
    }

    #[test]
    fn one_weight_takes_all_and_none_gives_no_table() {
        let table = alias_table(&[0.0, 2.0, 0.0], 16).unwrap();
        assert_eq!(probabilities(&table, 16), [0.0, 1.0, 0.0]);
        assert_eq!(alias_table(&[0.0, 0.0], 16), None);
        assert_eq!(probabilities(&alias_table(&[1.0; 5], 16).unwrap(), 16), [0.2; 5]);
    }
}
