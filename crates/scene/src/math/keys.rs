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
