//! Finding vertices that are equal to the bit.
//!
//! [`Weld`] is an open-addressing table of indices over the list of distinct vertices itself. The standard map would
//! store every vertex twice and hash it with a keyed function, at about four times the cost.
//!
//! [`weld`] does the same for many vertices at once, in parallel and with the same result: each stretch of the input
//! has a table of its own, small enough for the cache, and since neighbours share most of their vertices little is left
//! to compare between stretches. That is divided by hash, so that again each part has a small table of its own. One
//! table for all of 60 million corners misses the cache at most looks: it took 1.8 times the processor time, on one
//! thread.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use crate::memory;

/// Items in a stretch.
const STRETCH: usize = 1 << 15;

/// Parts that distinct keys are divided into, a power of two.
const PARTS: usize = 256;

/// What tells vertices apart: the bits of their coordinates.
pub(crate) trait Key: Copy + Eq + Send + Sync {
    /// A number whose bits all depend on all bits of the key.
    fn hash(&self) -> u64;
}

impl Key for [u32; 3] {
    fn hash(&self) -> u64 {
        let [x, y, z] = *self;
        mix(mix(u64::from(x) | u64::from(y) << 32) ^ u64::from(z))
    }
}

impl Key for [u32; 4] {
    fn hash(&self) -> u64 {
        let [a, b, c, d] = self.map(u64::from);
        mix(mix(a | b << 32) ^ (c | d << 32))
    }
}

impl Key for [u64; 3] {
    fn hash(&self) -> u64 {
        self.iter().fold(0, |hash, word| mix(hash ^ word))
    }
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014, *Fast splittable pseudorandom number generators*).
fn mix(word: u64) -> u64 {
    let z = word.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The distinct keys of `count` items of M keys each, numbered in the order of their first appearance; and the numbers
/// of every item's keys. `keys` gives an item's keys, and `done` is told of items that will not be asked for again.
///
/// # Panics
/// With 2^32 keys or more, which callers rule out by the size of their input.
pub(crate) fn weld<K: Key, const M: usize>(
    count: usize,
    keys: impl Fn(usize) -> [K; M] + Sync,
    done: impl Fn(Range<usize>) + Sync,
) -> (Vec<[u32; M]>, Vec<K>)
where
    [u32; M]: bytemuck::Zeroable,
{
    assert!(count.checked_mul(M).is_some_and(|n| u32::try_from(n).is_ok()), "more keys than 32-bit numbers can tell");
    let mut items: Vec<[u32; M]> = memory::zeroed(count);
    let stretches: Vec<Stretch<K>> = items
        .par_chunks_mut(STRETCH)
        .enumerate()
        .map(|(s, items)| {
            let range = s * STRETCH..s * STRETCH + items.len();
            // Half as many vertices as triangles is the rule.
            let mut table = Weld::with_slots((2 * items.len()).next_power_of_two());
            for (item, i) in items.iter_mut().zip(range.clone()) {
                *item = keys(i).map(|key| table.index(key));
            }
            done(range);
            Stretch::new(table.into_keys())
        })
        .collect();

    // The distinct keys of all stretches, one after the other.
    let mut begin = Vec::with_capacity(stretches.len());
    let mut sum = 0;
    for stretch in &stretches {
        begin.push(sum);
        sum += stretch.keys.len() as u32;
    }
    // For each, the first that is equal; then its number.
    let numbers: Vec<AtomicU32> = memory::zeroed::<u32>(sum as usize).into_iter().map(AtomicU32::new).collect();
    (0..PARTS).into_par_iter().for_each(|part| {
        let (mut table, mut firsts) = (Weld::new(), Vec::new());
        for (stretch, begin) in stretches.iter().zip(&begin) {
            for &local in stretch.part(part) {
                let (key, place) = (stretch.keys[local as usize], begin + local);
                let index = table.index(key) as usize;
                if index == firsts.len() {
                    firsts.push(place);
                }
                numbers[place as usize].store(firsts[index], Ordering::Relaxed);
            }
        }
    });
    let mut distinct = memory::with_capacity(sum as usize);
    let mut numbers: Vec<u32> = numbers.into_iter().map(AtomicU32::into_inner).collect();
    for (key, place) in stretches.iter().flat_map(|stretch| &stretch.keys).zip(0..) {
        let first = numbers[place];
        // The first one of a key comes before all others, so it has its number.
        numbers[place] = if first as usize == place {
            distinct.push(*key);
            distinct.len() as u32 - 1
        } else {
            numbers[first as usize]
        };
    }
    distinct.shrink_to_fit();
    items.par_chunks_mut(STRETCH).zip(&begin).for_each(|(items, begin)| {
        for number in items.as_flattened_mut() {
            *number = numbers[(begin + *number) as usize];
        }
    });
    (items, distinct)
}

/// The distinct keys of a stretch of items.
struct Stretch<K> {
    keys: Vec<K>,
    /// Their indices by part, each part's in rising order.
    order: Vec<u32>,
    /// Where the parts end in `order`.
    ends: Vec<u32>,
}

impl<K: Key> Stretch<K> {
    fn new(keys: Vec<K>) -> Self {
        // The table's slots are the hash's low bits.
        let part = |key: &K| (key.hash() >> 32) as usize % PARTS;
        let mut ends = vec![0; PARTS + 1];
        keys.iter().for_each(|key| ends[part(key) + 1] += 1);
        for p in 1..=PARTS {
            ends[p] += ends[p - 1];
        }
        // Each part's begin moves to its end as it is filled.
        let mut order = vec![0; keys.len()];
        for (i, key) in keys.iter().enumerate() {
            let end = &mut ends[part(key)];
            order[*end as usize] = i as u32;
            *end += 1;
        }
        ends.truncate(PARTS);
        Self { keys, order, ends }
    }

    fn part(&self, part: usize) -> &[u32] {
        let begin = if part == 0 { 0 } else { self.ends[part - 1] };
        &self.order[begin as usize..self.ends[part] as usize]
    }
}

/// Distinct keys, numbered in the order of their first appearance.
pub(crate) struct Weld<K> {
    keys: Vec<K>,
    /// Index + 1 into `keys`, 0 where free; a power of two of them, at most half of them taken.
    slots: Vec<u32>,
}

impl<K: Key> Weld<K> {
    pub(crate) fn new() -> Self {
        Self::with_slots(64)
    }

    /// With a power of two of slots to begin with.
    fn with_slots(slots: usize) -> Self {
        Self { keys: Vec::new(), slots: vec![0; slots.max(64)] }
    }

    /// The number of `key`. There may be at most 2^32 - 2 keys, which callers ensure by the size of their input.
    pub(crate) fn index(&mut self, key: K) -> u32 {
        if self.keys.len() * 2 >= self.slots.len() {
            self.grow();
        }
        let slot = self.find(&key, key.hash());
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
    fn find(&self, key: &K, hash: u64) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = hash as usize & mask;
        while self.slots[slot] != 0 && self.keys[self.slots[slot] as usize - 1] != *key {
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn grow(&mut self) {
        self.slots = vec![0; self.slots.len() * 2];
        for i in 0..self.keys.len() {
            let slot = self.find(&self.keys[i], self.keys[i].hash());
            self.slots[slot] = i as u32 + 1;
        }
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

    #[test]
    fn in_parallel_as_one_by_one() {
        // Neighbours that share, keys that come again far away, and stretches of unequal size.
        let key = |i: usize| [(i / 3) as u32 % 70_001, 7, (i % 5) as u32];
        for count in [0, 1, STRETCH - 1, 3 * STRETCH + 12_345] {
            let mut one = Weld::new();
            let expected: Vec<[u32; 3]> =
                (0..count).map(|i| [one.index(key(i)), one.index(key(i + 1)), one.index(key(2 * i))]).collect();
            let (items, distinct) = weld(count, |i| [key(i), key(i + 1), key(2 * i)], |_| ());
            assert!(items == expected && distinct == one.into_keys(), "{count}");
        }
    }
}
