//! Animations of a glTF file at one time → transforms of nodes.

use std::collections::HashMap;

use glam::{Mat4, Quat, Vec3};
use gltf::animation::{Interpolation, Property, Sampler};

use super::GltfReader;
use crate::{
    error::Result,
    features,
    math::keys::{Between, between, hermite},
    mesh::label,
};

impl GltfReader<'_> {
    /// Returns the transforms, parent from node, of the nodes that move, at `time` seconds. All animations of
    /// the file play together, the later ones over the earlier; before its first key and after its last, a
    /// channel stands.
    pub(super) fn poses(&mut self, time: f32) -> Result<HashMap<usize, Mat4>> {
        let mut poses = HashMap::new();
        for animation in self.document.animations() {
            for channel in animation.channels() {
                let place = || label("animation", animation.index(), animation.name());
                let (node, sampler) = (channel.target().node(), channel.sampler());
                let stands = || {
                    let (translation, rotation, scale) = node.transform().decomposed();
                    (Vec3::from(translation), Quat::from_array(rotation), Vec3::from(scale))
                };
                let (translation, rotation, scale) =
                    poses.entry(node.index()).or_insert_with(stands);
                match channel.target().property() {
                    Property::Translation => *translation = self.at(&sampler, time, place)?.into(),
                    Property::Rotation => {
                        *rotation = Quat::from_array(self.at(&sampler, time, place)?).normalize();
                    }
                    Property::Scale => *scale = self.at(&sampler, time, place)?.into(),
                    Property::MorphTargetWeights => {
                        self.ignored.add(features::GLTF_MORPH_ANIMATION, place);
                    }
                }
                if !(translation.is_finite() && rotation.is_finite() && scale.is_finite()) {
                    let message = format!("{}: expected finite transforms", place());
                    return Err(self.error(message));
                }
            }
        }
        let matrix = |(translation, rotation, scale)| {
            Mat4::from_scale_rotation_translation(scale, rotation, translation)
        };
        Ok(poses.into_iter().map(|(node, parts)| (node, matrix(parts))).collect())
    }

    /// Value of a channel at `time` seconds; rotations go the shorter way.
    fn at<const N: usize>(
        &self,
        sampler: &Sampler,
        time: f32,
        place: impl Fn() -> String,
    ) -> Result<[f32; N]> {
        let times: Vec<f32> =
            self.vectors::<1>(&sampler.input())?.into_iter().map(|[time]| time).collect();
        let values = self.vectors::<N>(&sampler.output())?;
        let interpolation = sampler.interpolation();
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let ascend = !times.is_empty() && times.is_sorted_by(|a, b| a < b);
        if !ascend || values.len() != per_key * times.len() {
            return Err(self.error(format!(
                "{}: expected times that ascend, and {per_key} values for each of them, found {} times \
                 and {} values",
                place(),
                times.len(),
                values.len()
            )));
        }
        let between = between(&times, time);
        let Between { keys: [first, second], fraction, .. } = between;
        Ok(match interpolation {
            Interpolation::Step => values[first],
            Interpolation::Linear if N == 4 => {
                let [from, to] =
                    [first, second].map(|key| Quat::from_slice(&values[key]).normalize());
                let turned = from.slerp(to, fraction).to_array();
                std::array::from_fn(|axis| turned[axis])
            }
            Interpolation::Linear => std::array::from_fn(|axis| {
                let [from, to] = [first, second].map(|key| values[key][axis]);
                from + fraction * (to - from)
            }),
            // A key has the slope before it, its value, and the slope after it.
            Interpolation::CubicSpline => std::array::from_fn(|axis| {
                let ends = [values[3 * first + 1][axis], values[3 * second + 1][axis]];
                let slopes = [values[3 * first + 2][axis], values[3 * second][axis]];
                hermite(ends, slopes, between)
            }),
        })
    }
}
