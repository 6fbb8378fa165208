//! Finding vertices that are equal to the bit.
//!
//! An open-addressing table of indices over the list of distinct vertices itself. The standard map would store every
//! vertex twice and hash it with a keyed function, at about four times the cost.

use std::hash::{BuildHasher, BuildHasherDefault, Hasher};

/// Distinct keys, numbered in the order of their first appearance.
pub(crate) struct Weld<K> {
    keys: Vec<K>,
    /// Index + 1 into `keys`, 0 where free; a power of two of them, at most half of them taken.
    slots: Vec<u32>,
}

impl<K: Copy + Eq + std::hash::Hash> Weld<K> {
    pub(crate) fn new() -> Self {
        Self { keys: Vec::new(), slots: vec![0; 64] }
    }

    /// The number of `key`. There may be at most 2^32 - 2 keys, which callers ensure by the size of their input.
    pub(crate) fn index(&mut self, key: K) -> u32 {
        if self.keys.len() * 2 >= self.slots.len() {
            self.grow();
        }
        let slot = self.find(&key);
        if self.slots[slot] == 0 {
            self.keys.push(key);
            self.slots[slot] = self.keys.len() as u32;
        }
        self.slots[slot] - 1
    }

    /// The distinct keys.
    pub(crate) fn into_keys(self) -> Vec<K> {
        self.keys
    }

    /// The slot where `key` is or belongs.
    fn find(&self, key: &K) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = BuildHasherDefault::<Mixer>::default().hash_one(key) as usize & mask;
        while self.slots[slot] != 0 && self.keys[self.slots[slot] as usize - 1] != *key {
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn grow(&mut self) {
        self.slots = vec![0; self.slots.len() * 2];
        for i in 0..self.keys.len() {
            let slot = self.find(&self.keys[i]);
            self.slots[slot] = i as u32 + 1;
        }
    }
}

/// Multiplies and folds, 64 bits at a time (Steele, Lea, Flood 2014, *Fast splittable pseudorandom number generators*:
/// the constants of the finaliser).
#[derive(Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    fn write_u64(&mut self, word: u64) {
        let mut z = (self.0 ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        self.0 = z ^ (z >> 31);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn numbers_distinct_keys() {
        let keys: Vec<[u32; 3]> = (0..5000u32).map(|i| [i * i % 97, i % 13, 7]).collect();
        let mut weld = Weld::new();
        let indices: Vec<u32> = keys.iter().map(|k| weld.index(*k)).collect();
        let distinct = weld.into_keys();
        assert_eq!(distinct.len(), keys.iter().collect::<BTreeSet<_>>().len());
        assert!(keys.iter().zip(&indices).all(|(k, i)| distinct[*i as usize] == *k));
        // Numbered in the order of first appearance.
        let mut seen = 0;
        for i in indices {
            assert!(i <= seen);
            seen = seen.max(i + 1);
        }
    }
}
