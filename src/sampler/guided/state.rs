//! The guide in a file: `--save-guide`, `--load-guide`, and beside a checkpoint.
//!
//! A file is one line of JSON, then [packed](super::packing) words: the arrays of [`GuideState`] from
//! `rectangles` on, in their order. The header holds the SHA-256 of both.

use std::{borrow::Cow, path::Path};

use bytemuck::Pod;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::sampler::guided::{
    arm::Arm,
    arriving::{ARRIVAL_DIRECTIONS, ArrivalWords},
    counts::CountWords,
    packing::{pack, unpack},
    share::SHARE_WORDS,
};
use crate::{
    error::{Error, Result},
    files::hexadecimal,
    memory,
    shader::rooms::guided::GUIDE_COUNT_WORDS,
};

const COUNT_WORDS: usize = GUIDE_COUNT_WORDS as usize;
const FORMAT: &str = "fenestra-guide";
const VERSION: u32 = 15;
/// Upper bound of the rays of one cell and direction: each rebuild halves them and adds a word.
const MAX_ARRIVAL_RAYS: f32 = 1e10;
/// Upper bound of their light, such that its product with the rays of all cells stays finite.
const MAX_ARRIVAL_LIGHT: f32 = 1e20;

/// State that lets a renderer go on learning where another stopped. The header of its file holds all but the
/// arrays.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GuideState {
    /// Scene that the guide was learned in.
    pub origin: Origin,
    /// Samples per pixel of the film when the state was taken; 0 where it belongs to no film.
    pub samples: u32,
    /// Samples per pixel at the last rebuild.
    pub rebuilt_at: u32,
    /// True if the scene was found open, so that the renderer learns nothing more.
    pub is_open: bool,
    /// The arm that was chosen; `None` before any race.
    pub arm: Option<Arm>,
    /// Samples per pixel from which it was in use.
    pub arm_since: u32,
    /// Number of races.
    pub races: u32,
    /// Tag of the guides that this one went on from, see [`GuideState::epoch_tag`]; 0 for none.
    #[serde(default)]
    pub tag: u32,
    /// First column and row, number of columns and rows, and parent of every region.
    #[serde(skip)]
    pub rectangles: Vec<[u32; 5]>,
    /// Key of every cell, the faces first.
    #[serde(skip)]
    pub keys: Vec<u32>,
    /// Indices of the cells whose children may be cells.
    #[serde(skip)]
    pub refined: Vec<u32>,
    /// Counts per cell and region up to the last rebuild: trials and hits, in sixteenths of rays,
    /// and the sum of the responses of the hits.
    #[serde(skip)]
    pub counts: Vec<CountWords>,
    /// Visible rays and their c p_B / q per cell and octave of light up to the last rebuild, see
    /// [`ShareEvidence`](super::ShareEvidence).
    #[serde(skip)]
    pub shares: Vec<u32>,
    /// Counts since the last rebuild, trials and hits in rays; empty where there are none.
    #[serde(skip)]
    pub pending: Vec<CountWords>,
    /// Shares since the last rebuild; empty where there are none.
    #[serde(skip)]
    pub pending_shares: Vec<u32>,
    /// Slots of the table of keys that passes looked up and did not find since the last rebuild: which keys
    /// come in a full table depends on where others lie. Complements of keys, so that an empty slot is 0.
    #[serde(skip)]
    pub missing: Vec<u32>,
    /// Bounce rays and light per cell and direction up to the last rebuild, as bits of floats;
    /// empty where bounces do not teach.
    #[serde(skip)]
    pub arrivals: Vec<ArrivalWords>,
    /// Bounce rays and units of light since the last rebuild; empty where there are none.
    #[serde(skip)]
    pub pending_arrivals: Vec<ArrivalWords>,
}

/// Properties of the scene that a guide was learned in.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// SHA-256 of the environment map: regions are meaningless under another.
    pub environment: String,
    /// SHA-256 of the geometry: counts are worth less under another.
    pub geometry: String,
    /// Number of regions.
    pub regions: u32,
    /// Corner of the grids, metres.
    pub grid_origin: [f32; 3],
    /// Largest edge of a cell, metres; all others are this over a power of two.
    pub largest_edge: f32,
}

#[derive(Clone, Serialize, Deserialize)]
struct Header<'a> {
    format: String,
    version: u32,
    checksum: String,
    #[serde(flatten)]
    state: Cow<'a, GuideState>,
    cells: usize,
    refined: usize,
    pending: usize,
    pending_shares: usize,
    #[serde(rename = "wanted")]
    missing: usize,
    arrivals: usize,
    pending_arrivals: usize,
}

impl Header<'_> {
    /// SHA-256 of the header without its checksum, and of the words.
    fn checksum_with(&self, words: &[u8]) -> serde_json::Result<String> {
        let bare = serde_json::to_vec(&Self { checksum: String::new(), ..self.clone() })?;
        let digest = Sha256::new().chain_update(bare).chain_update(words).finalize();
        Ok(hexadecimal(&digest))
    }
}

impl GuideState {
    /// The arrays from `rectangles` on.
    fn words(&self) -> impl Iterator<Item = u32> {
        self.rectangles
            .as_flattened()
            .iter()
            .chain(&self.keys)
            .chain(&self.refined)
            .chain(self.counts.as_flattened())
            .chain(&self.shares)
            .chain(self.pending.as_flattened())
            .chain(&self.pending_shares)
            .chain(&self.missing)
            .chain(self.arrivals.as_flattened())
            .chain(self.pending_arrivals.as_flattened())
            .copied()
    }

    /// Tells the random numbers of renders that start from this guide from those that taught it: a
    /// density shaped by the outcomes of some numbers must not be sampled with the same numbers.
    pub fn epoch_tag(&self) -> u32 {
        let words: Vec<[u8; 4]> = self.words().map(u32::to_le_bytes).collect();
        let digest = Sha256::new().chain_update(self.tag.to_le_bytes());
        let digest = digest.chain_update(words.as_flattened());
        let digest: [u8; 32] = digest.finalize().into();
        u32::from_le_bytes([digest[0], digest[1], digest[2], digest[3]])
    }

    /// Returns the content of the state's file.
    ///
    /// # Errors
    /// An error of the encoder.
    pub fn to_bytes(&self) -> std::io::Result<Vec<u8>> {
        let words = pack(self.words());
        let mut header = Header {
            format: FORMAT.to_owned(),
            version: VERSION,
            checksum: String::new(),
            state: Cow::Borrowed(self),
            cells: self.keys.len(),
            refined: self.refined.len(),
            pending: self.pending.len(),
            pending_shares: self.pending_shares.len(),
            missing: self.missing.len(),
            arrivals: self.arrivals.len(),
            pending_arrivals: self.pending_arrivals.len(),
        };
        header.checksum = header.checksum_with(&words)?;
        let mut bytes = serde_json::to_vec(&header)?;
        bytes.push(b'\n');
        bytes.extend(words);
        Ok(bytes)
    }

    /// Reads a state from the content of its file; `path` only serves error messages.
    ///
    /// # Errors
    /// [`Error::Format`] if it is not a guide, of another version, or damaged.
    pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Self> {
        let no_guide = || {
            Error::format(path, "not a guide; expected a file written by --save-guide".to_owned())
        };
        let damaged = |what: &str| Error::format(path, format!("damaged guide: {what}"));
        let split = bytes.iter().position(|byte| *byte == b'\n').ok_or_else(no_guide)?;
        let header: Header<'_> = serde_json::from_slice(&bytes[..split]).map_err(|_| no_guide())?;
        if header.format != FORMAT {
            return Err(no_guide());
        }
        if header.version != VERSION {
            return Err(Error::format(
                path,
                format!(
                    "guide of version {}; this program reads version {VERSION}: learn it again",
                    header.version
                ),
            ));
        }
        let words = &bytes[split + 1..];
        if header.checksum_with(words).ok().as_ref() != Some(&header.checksum) {
            return Err(damaged("its checksum does not match its content"));
        }
        if header.state.arm.is_some_and(|arm| !arm.is_possible()) {
            return Err(damaged("its header holds an impossible arm"));
        }
        let regions = header.state.origin.regions as usize;
        // Sums of so wide numbers do not overflow.
        let words_of = |count: usize, words: usize| count as u128 * words as u128;
        let length = words_of(header.cells, regions) * COUNT_WORDS as u128
            + words_of(header.cells, SHARE_WORDS + 1)
            + words_of(header.pending, COUNT_WORDS)
            + words_of(regions, 5)
            + words_of(header.arrivals, 2)
            + words_of(header.pending_arrivals, 2)
            + words_of(header.pending_shares, 1)
            + words_of(header.refined, 1)
            + words_of(header.missing, 1);
        let length =
            usize::try_from(length).map_err(|_| damaged("its header holds impossible lengths"))?;
        let (counts, shares) = (header.cells * regions, header.cells * SHARE_WORDS);
        memory::check(path.display(), (length as u64).saturating_mul(4)).map_err(Error::memory)?;
        let words = unpack(words, length)
            .filter(|_| header.pending <= counts && header.pending_shares <= shares)
            .ok_or_else(|| damaged(&format!("{length} words expected")))?;
        if header.arrivals.max(header.pending_arrivals) > header.cells * ARRIVAL_DIRECTIONS {
            return Err(damaged("its bounces belong to more cells than it has"));
        }
        let mut rest = &words[..];
        let state = Self {
            rectangles: take(&mut rest, regions),
            keys: take(&mut rest, header.cells),
            refined: take(&mut rest, header.refined),
            counts: take(&mut rest, counts),
            shares: take(&mut rest, shares),
            pending: take(&mut rest, header.pending),
            pending_shares: take(&mut rest, header.pending_shares),
            missing: take(&mut rest, header.missing),
            arrivals: take(&mut rest, header.arrivals),
            pending_arrivals: take(&mut rest, header.pending_arrivals),
            ..header.state.into_owned()
        };
        let is_possible = |[rays, light]: &ArrivalWords| {
            (0.0..=MAX_ARRIVAL_RAYS).contains(&f32::from_bits(*rays))
                && (0.0..=MAX_ARRIVAL_LIGHT).contains(&f32::from_bits(*light))
        };
        if !state.arrivals.iter().all(is_possible) {
            return Err(damaged("its bounces brought impossible amounts of light"));
        }
        Ok(state)
    }
}

/// Takes the next array of `count` elements off the words.
fn take<T: Pod>(words: &mut &[u32], count: usize) -> Vec<T> {
    let (own, rest) = words.split_at(count * size_of::<T>() / 4);
    *words = rest;
    bytemuck::cast_slice(own).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arm() -> Arm {
        Arm {
            is_guided: true,
            guides_bounces: false,
            guides_later: true,
            shares_paths: true,
            candidates: 8,
            rays: [4, 1],
            roulette_throughput: 0.1,
        }
    }

    fn state() -> GuideState {
        let origin = Origin { regions: 2, largest_edge: 0.3, ..Origin::default() };
        GuideState {
            origin,
            samples: 5,
            rebuilt_at: 4,
            is_open: true,
            arm: Some(arm()),
            arm_since: 2,
            races: 3,
            tag: 5,
            rectangles: vec![[0, 0, 5, 9, 0], [5, 0, 3, 9, 1]],
            keys: vec![u32::MAX, 7, 8],
            refined: vec![1],
            counts: vec![
                [1, 0, 0],
                [2, 1, 7],
                [3, 3, 1 << 31],
                [0, 0, 0],
                [1 << 24, 5, 6],
                [9, 9, 9],
            ],
            shares: (0..3 * SHARE_WORDS as u32).collect(),
            pending: vec![[4, 4, 5]],
            pending_shares: vec![1, 2, 3],
            missing: vec![0x1234_5678],
            arrivals: vec![[3.0_f32.to_bits(), 0.25_f32.to_bits()], [0, 0]],
            pending_arrivals: vec![[5, 77]],
        }
    }

    fn read(bytes: &[u8]) -> Result<GuideState> {
        GuideState::from_bytes(bytes, Path::new("room.guide"))
    }

    #[test]
    fn a_state_survives_a_file() {
        assert_eq!(read(&state().to_bytes().unwrap()).unwrap(), state());
        // Who goes on from it and learns nothing new has other numbers than those it began with.
        let tag = state().epoch_tag();
        assert_ne!(GuideState { tag, ..state() }.epoch_tag(), tag);
    }

    #[test]
    fn damaged_files_are_refused() {
        let message = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
        assert!(message(b"").contains("not a guide"));
        assert!(message(b"{\"format\":\"other\"}\n").contains("not a guide"));
        let good = state().to_bytes().unwrap();
        assert!(message(&good[..good.len() - 1]).contains("damaged guide"));
        let version = format!("\"version\":{VERSION}").into_bytes();
        let mut other = good.clone();
        let place = good.windows(version.len()).position(|w| w == version).unwrap();
        other.splice(place..place + version.len(), *b"\"version\":7");
        assert!(message(&other).contains("version 7"));
        // A change of any number in the header, whole as it may be, does not match the checksum.
        for number in ["\"cells\":3", "\"candidates\":8", "\"tag\":5", "\"largest_edge\":0.3"] {
            let place = good.windows(number.len()).position(|w| w == number.as_bytes()).unwrap();
            let mut other = good.clone();
            other[place + number.len() - 1] = b'4';
            assert!(message(&other).contains("its checksum does not match"), "{number}");
        }
        // Forged numbers with a checksum of their own
        let forged = |change: &dyn Fn(&mut Header<'_>)| {
            let split = good.iter().position(|byte| *byte == b'\n').unwrap();
            let mut header: Header<'_> = serde_json::from_slice(&good[..split]).unwrap();
            change(&mut header);
            header.checksum = header.checksum_with(&good[split + 1..]).unwrap();
            let mut bytes = serde_json::to_vec(&header).unwrap();
            bytes.extend(&good[split..]);
            message(&bytes)
        };
        assert!(forged(&|header| header.cells = 4).contains("words expected"));
        assert!(forged(&|header| header.cells = usize::MAX).contains("impossible lengths"));
        for wrong in [
            Arm { candidates: 3, ..arm() },
            Arm { rays: [4097, 1], ..arm() },
            Arm { guides_bounces: true, guides_later: false, ..arm() },
            Arm { roulette_throughput: -1.0, ..arm() },
        ] {
            let message = forged(&|header| header.state.to_mut().arm = Some(wrong));
            assert!(message.contains("impossible arm"), "{message}");
        }
        // Sums that would overflow to infinities, and these to densities that are no numbers
        for light in [f32::INFINITY, f32::NAN, -1.0, 1e30] {
            let arrivals = vec![[3.0_f32.to_bits(), light.to_bits()]];
            let error = message(&GuideState { arrivals, ..state() }.to_bytes().unwrap());
            assert!(error.contains("impossible amounts of light"), "{light}: {error}");
        }
        let arrivals = vec![[0; 2]; 3 * ARRIVAL_DIRECTIONS + 1];
        let error = message(&GuideState { arrivals, ..state() }.to_bytes().unwrap());
        assert!(error.contains("more cells than it has"), "{error}");
    }
}
