//! Range, mean and oddities of a channel's samples, to judge whether a file is sane.

/// Summary of the samples of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub(crate) struct ChannelSummary {
    /// Smallest finite sample; absent if there is none.
    pub minimum: Option<f32>,
    /// Largest finite sample; absent if there is none.
    pub maximum: Option<f32>,
    /// Mean of the finite samples; absent if there is none.
    pub mean: Option<f64>,
    /// Samples that are not a number.
    pub nan: usize,
    /// Infinite samples.
    pub infinite: usize,
    /// Samples below 0, including −∞.
    pub negative: usize,
}

impl ChannelSummary {
    /// Summarises `samples`.
    pub(crate) fn of(samples: impl IntoIterator<Item = f32>) -> Self {
        let mut summary = Self::default();
        let (mut sum, mut count) = (0.0_f64, 0_usize);
        for sample in samples {
            if sample < 0.0 {
                summary.negative += 1;
            }
            if sample.is_nan() {
                summary.nan += 1;
            } else if sample.is_infinite() {
                summary.infinite += 1;
            } else {
                sum += f64::from(sample);
                count += 1;
                summary.minimum = Some(summary.minimum.map_or(sample, |least| least.min(sample)));
                summary.maximum = Some(summary.maximum.map_or(sample, |most| most.max(sample)));
            }
        }
        if count > 0 {
            summary.mean = Some(sum / count as f64);
        }
        summary
    }
}

#[cfg(test)]
mod tests {
    use super::ChannelSummary;

    #[test]
    fn oddities_are_counted_and_left_out_of_the_mean() {
        let samples = [1.0, f32::NAN, -3.0, f32::INFINITY, 5.0, f32::NEG_INFINITY];
        let expected = ChannelSummary {
            minimum: Some(-3.0),
            maximum: Some(5.0),
            mean: Some(1.0),
            nan: 1,
            infinite: 2,
            negative: 2,
        };
        assert_eq!(ChannelSummary::of(samples), expected);
        assert_eq!(ChannelSummary::of([f32::NAN]).mean, None);
        assert_eq!(ChannelSummary::of([]), ChannelSummary::default());
    }
}
