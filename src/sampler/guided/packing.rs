//! Words of a guide's file. Most are 0 or small: each is a number of LEB128, and after a 0 follows how many
//! more there are.

pub fn pack(words: impl IntoIterator<Item = u32>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut zeros = 0;
    for word in words {
        if word == 0 {
            zeros += 1;
            continue;
        }
        put_zeros(&mut bytes, zeros);
        zeros = 0;
        put(&mut bytes, word.into());
    }
    put_zeros(&mut bytes, zeros);
    bytes
}

/// Unpacks exactly `count` words; `None` if the bytes are no such words.
pub fn unpack(mut bytes: &[u8], count: usize) -> Option<Vec<u32>> {
    let mut words = Vec::new();
    while !bytes.is_empty() {
        let word = u32::try_from(take(&mut bytes)?).ok()?;
        let more = if word == 0 { usize::try_from(take(&mut bytes)?).ok()? } else { 0 };
        let length = words.len().checked_add(more)?.checked_add(1)?;
        if length > count {
            return None;
        }
        words.resize(length, word);
    }
    (words.len() == count).then_some(words)
}

fn put_zeros(bytes: &mut Vec<u8>, count: u64) {
    if count > 0 {
        bytes.push(0);
        put(bytes, count - 1);
    }
}

fn put(bytes: &mut Vec<u8>, mut number: u64) {
    while number > 0x7f {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

fn take(bytes: &mut &[u8]) -> Option<u64> {
    let mut number = 0;
    for shift in (0..63).step_by(7) {
        let (first, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u64::from(first & 0x7f) << shift;
        if first & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_come_back() {
        let mut words = vec![0; 300];
        words.extend([1, 127, 128, 1 << 14, u32::MAX, 0, 5]);
        words.extend([0; 1000]);
        let bytes = pack(words.clone());
        assert!(bytes.len() < 30, "{}", bytes.len());
        assert_eq!(unpack(&bytes, words.len()), Some(words.clone()));
        assert_eq!(unpack(&pack([]), 0), Some(Vec::new()));
        for wrong in [words.len() - 1, words.len() + 1, 0] {
            assert_eq!(unpack(&bytes, wrong), None);
        }
        for end in 1..bytes.len() {
            assert_eq!(unpack(&bytes[..end], words.len()), None);
        }
        // More zeros than the file may have, a word of more than 32 bits, a number without an end
        assert_eq!(unpack(&[0, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f], 9), None);
        assert_eq!(unpack(&[0xff, 0xff, 0xff, 0xff, 0x7f], 1), None);
        assert_eq!(unpack(&[0xff; 12], 1), None);
    }
}
