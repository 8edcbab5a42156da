//! Cryptomatte: coverage of pixels by objects and materials, for compositors. \[Friedman & Jones 2015\],
//! Cryptomatte Specification 1.2.0, Psyop 2018, <https://github.com/Psyop/Cryptomatte>.
//!
//! Identifiers are hashes of names, stored as the bits of floats that are finite. Layers hold pairs of
//! identifier and coverage, the largest coverage first, two pairs a layer. Attributes hold the manifest.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::{Attribute, Image};
use crate::{scene::Scene, shader::constants::MATTE_SLOTS};

/// Layer of objects.
pub const OBJECTS: &str = "CryptoObject";
/// Layer of materials.
pub const MATERIALS: &str = "CryptoMaterial";
/// Name of what has none.
pub(crate) const NAMELESS: &str = "unnamed";
pub(crate) const PREFIX: &str = "cryptomatte/";

/// Identifiers and their shares of a pixel, 0…1; a share of 0 without one.
pub(crate) type Shares = [(u32, f64); MATTE_SLOTS as usize];

/// Identifier of a name: its hash, with an exponent that neither makes zero nor infinity.
pub fn identifier(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes());
    match hash >> 23 & 255 {
        0 | 255 => hash ^ 1 << 23,
        _ => hash,
    }
}

/// MurmurHash3_x86_32 with the seed 0. \[Appleby 2011\]
fn murmur3(bytes: &[u8]) -> u32 {
    let mixed =
        |word: u32| word.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (words, rest) = bytes.as_chunks::<4>();
    let mut hash = words.iter().fold(0_u32, |hash, word| {
        let hash = hash ^ mixed(u32::from_le_bytes(*word));
        hash.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64)
    });
    let mut last = [0; 4];
    last[..rest.len()].copy_from_slice(rest);
    hash ^= mixed(u32::from_le_bytes(last)) ^ bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

/// Attributes that describe the layers of objects and materials that are `asked` for, without [`PREFIX`].
pub(crate) fn attributes(scene: &Scene, asked: [bool; 2]) -> BTreeMap<String, String> {
    let objects = scene.geometry.objects.iter().map(|start| start.name.as_str());
    let objects: BTreeSet<&str> = objects.chain([NAMELESS]).collect();
    let materials = scene.materials.iter().map(|material| material.name.as_str()).collect();
    let layers = [(OBJECTS, objects), (MATERIALS, materials)].into_iter().zip(asked);
    let described = layers.filter(|(_, asked)| *asked).flat_map(|((layer, names), _)| {
        let digits = format!("{:08x}", murmur3(layer.as_bytes()));
        let hexadecimal = |name: &str| format!("{:08x}", identifier(name)).into();
        let manifest: serde_json::Map<_, _> =
            names.into_iter().map(|name| (name.to_owned(), hexadecimal(name))).collect();
        [
            ("name", layer.to_owned()),
            ("hash", "MurmurHash3_32".to_owned()),
            ("conversion", "uint32_to_float32".to_owned()),
            ("manifest", serde_json::Value::Object(manifest).to_string()),
        ]
        .map(|(key, value)| (format!("{}/{key}", &digits[..7]), value))
    });
    described.collect()
}

/// Attributes of an image that has no layers of Cryptomatte.
pub(crate) fn without(attributes: &BTreeMap<String, Attribute>) -> BTreeMap<String, Attribute> {
    let mut attributes = attributes.clone();
    attributes.retain(|name, _| !name.starts_with(PREFIX));
    attributes
}

/// Channels of a layer: identifier and coverage of each rank in turn.
fn channels(layer: &str) -> impl Iterator<Item = String> {
    (0..2 * MATTE_SLOTS as usize)
        .map(move |index| format!("{layer}{:02}.{}", index / 4, ["R", "G", "B", "A"][index % 4]))
}

/// Tests for a channel of a layer of Cryptomatte.
pub(crate) fn is_channel(name: &str) -> bool {
    let layer = name.strip_prefix(OBJECTS).or(name.strip_prefix(MATERIALS));
    layer.is_some_and(|rest| rest.starts_with(|digit: char| digit.is_ascii_digit()))
}

pub(crate) fn insert(image: &mut Image, layer: &str, shares: &[Shares]) {
    let ranked: Vec<Shares> = shares.par_iter().map(|shares| ranked(shares)).collect();
    for (index, name) in channels(layer).enumerate() {
        let value = |shares: &Shares| match (shares[index / 2], index % 2) {
            ((id, _), 0) => f32::from_bits(id),
            ((_, share), _) => share as f32,
        };
        image.channels.insert(name, ranked.iter().map(value).collect());
    }
}

/// Sorts pairs by falling share, then by identifier, and keeps the first; none without a share.
fn ranked(shares: &[(u32, f64)]) -> Shares {
    let mut sorted: Vec<_> = shares.iter().copied().filter(|(_, share)| *share > 0.0).collect();
    sorted.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut first = Shares::default();
    first.iter_mut().zip(sorted).for_each(|(slot, pair)| *slot = pair);
    first
}

/// Adds to `merged` the layers of Cryptomatte that all of `parts` have: the means by their weights, whose
/// sum is `total`.
pub(crate) fn merge(merged: &mut Image, parts: &[(&Image, f64)], total: f64) {
    for layer in [OBJECTS, MATERIALS] {
        let of = |(image, weight): &(&Image, f64)| {
            let channels = channels(layer).map(|name| image.channels.get(&name).cloned());
            Some((channels.collect::<Option<Vec<_>>>()?, weight / total))
        };
        let Some(parts) = parts.iter().map(of).collect::<Option<Vec<_>>>() else { continue };
        let pixel = |pixel: usize| {
            let mut sum: BTreeMap<u32, f64> = BTreeMap::new();
            for (channels, weight) in &parts {
                for pair in channels.chunks(2) {
                    let share = weight * f64::from(pair[1][pixel]);
                    *sum.entry(pair[0][pixel].to_bits()).or_default() += share;
                }
            }
            ranked(&sum.into_iter().collect::<Vec<_>>())
        };
        let shares: Vec<_> = (0..merged.pixel_count()).map(pixel).collect();
        insert(merged, layer, &shares);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the tests of Psyop's plug-in for Nuke, and of the hash's own.
    #[test]
    fn identifiers_are_those_of_the_reference() {
        assert_eq!(murmur3(b"The quick brown fox jumps over the lazy dog"), 0x2e4f_f723);
        assert_eq!((murmur3(b""), murmur3(b"hello")), (0, 0x248b_fa47));
        for (name, expected) in [
            ("hello", 6.070_563e-17_f32),
            ("cube", -4.084_619e15),
            ("sphere", 2.790_186e15),
            ("plane", 3.665_576_2e-11),
        ] {
            assert_eq!(f32::from_bits(identifier(name)), expected, "{name}");
        }
        // Neither zero nor infinite nor no number.
        assert_eq!(identifier(""), 1 << 23);
        assert!(
            (0..10_000).all(|index| f32::from_bits(identifier(&index.to_string())).is_normal())
        );
    }

    #[test]
    fn merged_coverages_are_means_by_samples() {
        let image = |pairs: &[(u32, f64)]| {
            let mut image = Image::new(1, 1);
            insert(&mut image, OBJECTS, &[ranked(pairs)]);
            image
        };
        let [one, two, three] = ["one", "two", "three"].map(identifier);
        let parts = [image(&[(one, 0.75), (two, 0.25)]), image(&[(two, 0.5), (three, 0.5)])];
        let mut merged = Image::new(1, 1);
        merge(&mut merged, &[(&parts[0], 1.0), (&parts[1], 3.0)], 4.0);
        let expected = image(&[(two, 0.4375), (three, 0.375), (one, 0.1875)]);
        assert_eq!(merged.channels, expected.channels);
        assert_eq!(
            ranked(&[(9, 0.25), (3, 0.25), (5, 0.5)])[..3],
            [(5, 0.5), (3, 0.25), (9, 0.25)]
        );
        assert!(
            merged.channels.keys().all(|name| is_channel(name)) && !is_channel("CryptoObject.R")
        );
    }
}
