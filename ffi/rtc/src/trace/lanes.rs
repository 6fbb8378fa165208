//! Rays as the caller lays them out: word by word, so many rays side by side.

use std::marker::PhantomData;
use std::mem::{size_of, transmute};

use twincast_core::trace::bvh::Packet;

use crate::abi::{HIT_WORDS, RAY_WORDS, RTCHit, RTCRay, RTCRayHit};

/// What a lane holds.
pub trait Words {
    /// In so many words.
    const COUNT: usize;
}

impl Words for RTCRay {
    const COUNT: usize = RAY_WORDS;
}

impl Words for RTCRayHit {
    const COUNT: usize = RAY_WORDS + HIT_WORDS;
}

/// Rays of the caller's, by number; those words of all rays that are the same lie side by side.
///
/// # Safety
/// As long as the lanes are there, [`word`](Lanes::word) is where this thread can read each of
/// [`Record`](Lanes::Record)'s words of each of [`count`](Lanes::count) rays, those of eight in a row side by side, and
/// write to those that answer, which are [`field::TFAR`] and the words of hits.
pub unsafe trait Lanes {
    /// A ray, or a ray and its hit.
    type Record: Words;

    /// How many rays.
    fn count(&self) -> usize;

    /// Where word `word` of ray `lane` is: those of the ray, then those of its hit.
    ///
    /// # Safety
    /// There is such a word, and such a lane.
    unsafe fn word(&self, word: usize, lane: usize) -> *mut u32;

    /// All rays where they are; none unless they are eight that lie as the native tracer reads them.
    ///
    /// # Safety
    /// Nobody writes to them as long as the result is used.
    #[inline(always)]
    unsafe fn packet(&self) -> Option<&Packet> {
        None
    }

    /// Whether the words up to `word` are there of `N` rays in a row, from `first` on.
    #[inline(always)]
    fn has<const N: usize>(&self, word: usize, first: usize) -> bool {
        const { assert!(N <= 8, "rays are side by side in eights") };
        word < Self::Record::COUNT && self.count().checked_sub(N).is_some_and(|last| first <= last)
    }

    /// One word of rays in a row, eight at most.
    #[inline(always)]
    fn row<const N: usize>(&self, word: usize, first: usize) -> [u32; N] {
        assert!(self.has::<N>(word, first));
        // SAFETY: they are there, and who implements this promises that they can be read, and lie side by side.
        unsafe { self.word(word, first).cast::<[u32; N]>().read() }
    }

    /// Writes one word that answers, of rays in a row, eight at most.
    #[inline(always)]
    fn set_row<const N: usize>(&self, word: usize, first: usize, values: [u32; N]) {
        assert!(self.has::<N>(word, first) && (word == field::TFAR || word >= RAY_WORDS));
        // SAFETY: they are there and answer, and who implements this promises that they can be written to, and lie side
        // by side.
        unsafe { self.word(word, first).cast::<[u32; N]>().write(values) };
    }

    /// A ray.
    #[inline(always)]
    fn ray(&self, lane: usize) -> RTCRay {
        assert!(self.has::<1>(RAY_WORDS - 1, lane));
        let mut words = [0u32; RAY_WORDS];
        for (k, word) in words.iter_mut().enumerate() {
            // SAFETY: it is there, and who implements this promises that it can be read.
            *word = unsafe { self.word(k, lane).read() };
        }
        // SAFETY: both are that many words, of which each may be anything.
        unsafe { transmute::<[u32; RAY_WORDS], RTCRay>(words) }
    }

    /// Writes where a ray ends.
    #[inline(always)]
    fn set_tfar(&self, lane: usize, tfar: f32) {
        self.set_row(field::TFAR, lane, [tfar.to_bits()]);
    }

    /// Writes a hit, and that the ray ends there.
    #[inline(always)]
    fn set_hit(&self, lane: usize, tfar: f32, hit: &RTCHit) {
        assert!(self.has::<1>(RAY_WORDS + HIT_WORDS - 1, lane));
        // SAFETY: a hit begins with that many words.
        let words = unsafe { (&raw const *hit).cast::<[u32; HIT_WORDS]>().read() };
        // SAFETY: all words are there, and who implements this promises that these can be written to.
        unsafe { self.word(field::TFAR, lane).write(tfar.to_bits()) };
        for (k, word) in words.into_iter().enumerate() {
            // SAFETY: as above.
            unsafe { self.word(RAY_WORDS + k, lane).write(word) };
        }
    }

    /// A hit as it is.
    #[inline(always)]
    fn hit(&self, lane: usize) -> RTCHit {
        assert!(self.has::<1>(RAY_WORDS + HIT_WORDS - 1, lane));
        let mut hit = RTCHit::NONE;
        let words = (&raw mut hit).cast::<u32>();
        for k in 0..HIT_WORDS {
            // SAFETY: a hit begins with that many words; it is there, and who implements this promises that it can be
            // read.
            unsafe { words.add(k).write(self.word(RAY_WORDS + k, lane).read()) };
        }
        hit
    }
}

/// At which word of a ray its fields begin, and those of its hit behind them.
pub mod field {
    use std::mem::offset_of;

    use crate::abi::{RAY_WORDS, RTCHit, RTCRay};

    pub const ORIGIN: usize = offset_of!(RTCRay, org) / 4;
    pub const TNEAR: usize = offset_of!(RTCRay, tnear) / 4;
    pub const DIRECTION: usize = offset_of!(RTCRay, dir) / 4;
    #[cfg(feature = "v3")]
    pub const TIME: usize = offset_of!(RTCRay, time) / 4;
    pub const TFAR: usize = offset_of!(RTCRay, tfar) / 4;
    pub const MASK: usize = offset_of!(RTCRay, mask) / 4;
    pub const NORMAL: usize = RAY_WORDS + offset_of!(RTCHit, ng) / 4;
    pub const U: usize = RAY_WORDS + offset_of!(RTCHit, u) / 4;
    pub const V: usize = RAY_WORDS + offset_of!(RTCHit, v) / 4;
    pub const PRIMITIVE: usize = RAY_WORDS + offset_of!(RTCHit, primitive) / 4;
    pub const GEOMETRY: usize = RAY_WORDS + offset_of!(RTCHit, geometry) / 4;
    /// The first of its words.
    pub const INSTANCE: usize = RAY_WORDS + offset_of!(RTCHit, instance) / 4;
}

const _: () = {
    use std::mem::offset_of;
    // Eight of each word, in the order of the words of a ray.
    assert!(offset_of!(Packet, origin) == 8 * offset_of!(RTCRay, org));
    assert!(offset_of!(Packet, tmin) == 8 * offset_of!(RTCRay, tnear));
    assert!(offset_of!(Packet, direction) == 8 * offset_of!(RTCRay, dir));
    assert!(offset_of!(Packet, time) == 8 * offset_of!(RTCRay, time));
    assert!(offset_of!(Packet, tmax) == 8 * offset_of!(RTCRay, tfar));
    assert!(size_of::<Packet>() <= 8 * size_of::<RTCRay>() && Packet::RAYS == 8);
    assert!(size_of::<RTCRay>() == 4 * RAY_WORDS && size_of::<RTCHit>() >= 4 * HIT_WORDS);
};

/// A packet: all first words, all second words and so on.
pub struct Packed<T> {
    base: *mut u32,
    width: usize,
    record: PhantomData<T>,
}

impl<T: Words> Packed<T> {
    /// # Safety
    /// From `base` on there are `width` rays, with their hits where `T` has one; they are this thread's as long as the
    /// lanes are there.
    pub unsafe fn new(base: *mut u32, width: usize) -> Self {
        Self { base, width, record: PhantomData }
    }
}

// SAFETY: who made the lanes promised that there are so many rays of so many words, and that they are this thread's.
unsafe impl<T: Words> Lanes for Packed<T> {
    type Record = T;

    #[inline(always)]
    fn count(&self) -> usize {
        self.width
    }

    #[inline(always)]
    unsafe fn word(&self, word: usize, lane: usize) -> *mut u32 {
        self.base.wrapping_add(word * self.width + lane)
    }

    #[inline(always)]
    unsafe fn packet(&self) -> Option<&Packet> {
        let packet = self.base.cast::<Packet>().cast_const();
        // SAFETY: who made the lanes promised that there are eight rays, which begin with one of these, and the caller
        // that nobody writes to them.
        (self.width == Packet::RAYS && packet.is_aligned()).then(|| unsafe { &*packet })
    }
}

/// An array for each word; null for one that the caller has no use for.
#[cfg(feature = "v3")]
pub struct Pointers<'a, T> {
    words: *const *mut u32,
    count: usize,
    spare: &'a Spare,
    record: PhantomData<T>,
}

/// What stands for arrays that are not there, of eight rays.
#[cfg(feature = "v3")]
pub struct Spare {
    zero: [u32; 8],
    ones: [u32; 8],
    /// Stands for tfar, ids, flags and hits: what is read is what was written last, at first 0. Written to through a
    /// shared reference.
    sink: std::cell::UnsafeCell<[u32; 8]>,
}

#[cfg(feature = "v3")]
impl Spare {
    pub fn new() -> Self {
        Self { zero: [0; 8], ones: [u32::MAX; 8], sink: [0; 8].into() }
    }
}

#[cfg(feature = "v3")]
impl<'a, T: Words> Pointers<'a, T> {
    /// # Safety
    /// `words` are pointers to arrays of the words of `count` rays, then of their hits where `T` has one, each null or
    /// that long; they are this thread's as long as the lanes are there.
    pub unsafe fn new(words: *const *mut u32, count: usize, spare: &'a Spare) -> Self {
        Self { words, count, spare, record: PhantomData }
    }
}

#[cfg(feature = "v3")]
// SAFETY: who made the lanes promised that there are such arrays, which are this thread's; what stands for others is
// long enough for eight rays, wherever they are, and what of it may be written to can be.
unsafe impl<T: Words> Lanes for Pointers<'_, T> {
    type Record = T;

    #[inline(always)]
    fn count(&self) -> usize {
        self.count
    }

    #[inline(always)]
    unsafe fn word(&self, word: usize, lane: usize) -> *mut u32 {
        // SAFETY: there is such a word, so who made the lanes promised that there are so many pointers.
        let array = unsafe { self.words.add(word).read() };
        if array.is_null() {
            return match word {
                // Rays begin at 0 and at time 0, and see everything.
                field::MASK => self.spare.ones.as_ptr().cast_mut(),
                0..=field::TIME => self.spare.zero.as_ptr().cast_mut(),
                _ => self.spare.sink.get().cast(),
            };
        }
        array.wrapping_add(lane)
    }
}
