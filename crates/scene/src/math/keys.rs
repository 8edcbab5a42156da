//! Interpolation between the keys of an animation.

/// Place of a time among keys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Between {
    /// The keys around it: twice the first before it, twice the last after it.
    pub keys: [usize; 2],
    /// Share of the way from one to the other, 0…1.
    pub fraction: f32,
    /// Time from one to the other, seconds.
    pub seconds: f32,
}

/// Finds the keys around a time; `times` ascend and are not empty.
pub(crate) fn between(times: &[f32], time: f32) -> Between {
    let next = times.partition_point(|key| *key <= time);
    if next == 0 || next == times.len() {
        return Between { keys: [next.saturating_sub(1); 2], fraction: 0.0, seconds: 0.0 };
    }
    let seconds = times[next] - times[next - 1];
    Between { keys: [next - 1, next], fraction: (time - times[next - 1]) / seconds, seconds }
}

/// Cubic through two values with the slopes there, per second (Hermite).
pub(crate) fn hermite(values: [f32; 2], slopes: [f32; 2], place: Between) -> f32 {
    let Between { fraction: t, seconds, .. } = place;
    let (squared, cubed) = (t * t, t * t * t);
    values[0] * (2.0 * cubed - 3.0 * squared + 1.0)
        + values[1] * (3.0 * squared - 2.0 * cubed)
        + seconds * (slopes[0] * (cubed - 2.0 * squared + t) + slopes[1] * (cubed - squared))
}

/// Smooth curve through the values of keys that never leaves the range of two neighbours, so that a value
/// stands still between two that are the same. [Fritsch & Butland 1984]
pub(crate) fn monotone(times: &[f32], value: impl Fn(usize) -> f32, place: Between) -> f32 {
    let secant = |key: usize| (value(key + 1) - value(key)) / (times[key + 1] - times[key]);
    let slope = |key: usize| {
        if key == 0 || key + 1 == times.len() {
            return secant(key.min(times.len() - 2));
        }
        let (before, after) = (secant(key - 1), secant(key));
        if before * after <= 0.0 {
            return 0.0;
        }
        let (to, from) = (times[key] - times[key - 1], times[key + 1] - times[key]);
        3.0 * (to + from) / ((2.0 * from + to) / before + (from + 2.0 * to) / after)
    };
    let [first, second] = place.keys;
    match first == second {
        true => value(first),
        false => hermite([value(first), value(second)], [slope(first), slope(second)], place),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMES: [f32; 4] = [0.0, 1.0, 1.5, 3.0];

    fn curve(values: [f32; 4], time: f32) -> f32 {
        monotone(&TIMES, |key| values[key], between(&TIMES, time))
    }

    #[test]
    fn the_curve_passes_its_keys_and_does_not_overshoot() {
        let values = [1.0, 4.0, 4.0, -2.0];
        for (time, value) in TIMES.into_iter().zip(values) {
            assert_eq!(curve(values, time), value);
        }
        assert_eq!([curve(values, -1.0), curve(values, 1.2), curve(values, 9.0)], [1.0, 4.0, -2.0]);
        for step in 0..300 {
            let found = curve(values, 0.01 * step as f32);
            assert!((-2.0..=4.0).contains(&found), "{found}");
        }
        // A straight line stays one, and the slope is the same on both sides of a key.
        assert!((curve([0.0, 2.0, 3.0, 6.0], 2.2) - 4.4).abs() < 1e-5);
        let rising = [0.0, 1.0, 5.0, 6.0];
        let slope = |from: f32| (curve(rising, from + 1e-3) - curve(rising, from)) / 1e-3;
        assert!((slope(1.0) - slope(1.0 - 1e-3)).abs() < 0.05, "{} {}", slope(1.0), slope(0.999));
        // By the lengths of both stretches: 1 s at 1 per second, then 0.5 s at 8.
        let expected = 3.0 * 1.5 / ((2.0 * 0.5 + 1.0) / 1.0 + (0.5 + 2.0 * 1.0) / 8.0);
        assert!((slope(1.0) - expected).abs() < 0.05, "{} {expected}", slope(1.0));
    }
}
