//! Random numbers of an epoch: the samples between two rebuilds of the guide.

use crate::{math::random::hash_4d, shader::structs::Wave};

/// Tells the seeds of epochs from other hashes.
const EPOCH_TAG: u32 = 0x6b43_a9b5;
/// Tells the seeds of arms from other hashes.
const ARM_TAG: u32 = 0x51ed_270b;
/// Tells the random numbers of training from those of the picture.
pub(super) const TRAINING_SEED: u32 = 0x7e11_ab1e;

/// Gives `wave` random numbers of its own for the epoch that begins at `sample`: those of `guided`
/// start anew after every rebuild. `guide_tag` tells them from those that taught a loaded guide.
pub fn with_epoch(wave: Wave, sample: u32, guide_tag: u32) -> Wave {
    let [epoch_seed, ..] = hash_4d([wave.seed, sample, EPOCH_TAG ^ guide_tag, wave.is_training]);
    Wave { epoch_seed, epoch_start: sample, ..wave }
}

/// Gives `wave` random numbers of its own for an arm that is in use since `sample`: the choice knew the
/// outcome of earlier samples, to which the next numbers of a sequence are related.
pub(super) fn with_arm(wave: Wave, sample: u32) -> Wave {
    let [seed, ..] = hash_4d([wave.seed, sample, ARM_TAG, 0]);
    Wave { seed: if sample == 0 { wave.seed } else { seed }, ..wave }
}
