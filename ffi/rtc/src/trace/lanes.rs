//! Rays as the caller lays them out: word by word, so many rays side by side.

use std::mem::{size_of, transmute};

use twincast::trace::bvh::Packet;

use crate::abi::{HIT_WORDS, RAY_WORDS, RTCHit, RTCRay};

/// Rays of the caller's, by number; those words of all rays that are the same lie side by side.
pub trait Lanes {
    /// Where word `word` of ray `lane` is: those of the ray, then those of its hit.
    fn word(&self, word: usize, lane: usize) -> *mut u32;

    /// A ray.
    #[inline(always)]
    fn ray(&self, lane: usize) -> RTCRay {
        let mut words = [0u32; RAY_WORDS];
        for (k, word) in words.iter_mut().enumerate() {
            // SAFETY: who made the lanes promised that all words of all rays can be read.
            *word = unsafe { self.word(k, lane).read() };
        }
        // SAFETY: both are that many words, of which each may be anything.
        unsafe { transmute::<[u32; RAY_WORDS], RTCRay>(words) }
    }

    /// Eight rays where they are; none where they do not lie as the native tracer reads them.
    ///
    /// # Safety
    /// Nobody writes to them as long as the result is used.
    #[inline(always)]
    unsafe fn packet(&self, _first: usize) -> Option<&Packet> {
        None
    }

    /// One word of eight rays.
    #[inline(always)]
    fn eight(&self, word: usize, first: usize) -> [u32; 8] {
        // SAFETY: who made the lanes promised that all words of all rays can be read; they lie side by side.
        unsafe { self.word(word, first).cast::<[u32; 8]>().read() }
    }

    /// Writes one word of eight rays.
    #[inline(always)]
    fn set_eight(&self, word: usize, first: usize, values: [u32; 8]) {
        // SAFETY: who made the lanes promised that hits, and where rays end, can be written; they lie side by side.
        unsafe { self.word(word, first).cast::<[u32; 8]>().write(values) };
    }

    /// Writes where a ray ends.
    #[inline(always)]
    fn set_tfar(&self, lane: usize, tfar: f32) {
        // SAFETY: who made the lanes promised that it can be written.
        unsafe { self.word(TFAR, lane).write(tfar.to_bits()) };
    }

    /// Writes a hit.
    #[inline(always)]
    fn set_hit(&self, lane: usize, hit: &RTCHit) {
        // SAFETY: a hit begins with that many words.
        let words = unsafe { (&raw const *hit).cast::<[u32; HIT_WORDS]>().read() };
        for (k, word) in words.into_iter().enumerate() {
            // SAFETY: who made the lanes promised that all words of all hits can be written.
            unsafe { self.word(RAY_WORDS + k, lane).write(word) };
        }
    }

    /// A hit as it is.
    #[inline(always)]
    fn hit(&self, lane: usize) -> RTCHit {
        let mut hit = RTCHit::NONE;
        let words = (&raw mut hit).cast::<u32>();
        for k in 0..HIT_WORDS {
            // SAFETY: a hit begins with that many words; who made the lanes promised that they can be read.
            unsafe { words.add(k).write(self.word(RAY_WORDS + k, lane).read()) };
        }
        hit
    }
}

/// When it is sent.
#[cfg(feature = "v3")]
const TIME: usize = 7;

/// Where a ray ends.
pub const TFAR: usize = 8;

/// What it sees.
pub const MASK: usize = 9;

const _: () = {
    use std::mem::offset_of;
    // Eight of each word, in the order of the words of a ray.
    assert!(offset_of!(Packet, origin) == 8 * offset_of!(RTCRay, org));
    assert!(offset_of!(Packet, tmin) == 8 * offset_of!(RTCRay, tnear));
    assert!(offset_of!(Packet, direction) == 8 * offset_of!(RTCRay, dir));
    assert!(offset_of!(Packet, time) == 8 * offset_of!(RTCRay, time));
    assert!(offset_of!(Packet, tmax) == 8 * offset_of!(RTCRay, tfar));
    assert!(size_of::<RTCRay>() == 4 * RAY_WORDS && size_of::<RTCHit>() >= 4 * HIT_WORDS);
    assert!(offset_of!(RTCRay, tfar) == 4 * TFAR && offset_of!(RTCRay, mask) == 4 * MASK);
};

/// A packet: all first words, all second words and so on.
#[derive(Clone, Copy)]
pub struct Packed {
    base: *mut u32,
    width: usize,
}

impl Packed {
    /// # Safety
    /// From `base` on there are `width` rays, with their hits where these are asked for; they are this thread's as long as the lanes are used.
    pub unsafe fn new(base: *mut u32, width: usize) -> Self {
        Self { base, width }
    }
}

impl Lanes for Packed {
    #[inline(always)]
    fn word(&self, word: usize, lane: usize) -> *mut u32 {
        self.base.wrapping_add(word * self.width + lane)
    }

    #[inline(always)]
    unsafe fn packet(&self, _first: usize) -> Option<&Packet> {
        let packet = self.base.cast::<Packet>().cast_const();
        // SAFETY: who made the lanes promised that there are eight rays, which begin with one of these, and the caller that nobody writes to them.
        (self.width == Packet::RAYS && packet.is_aligned()).then(|| unsafe { &*packet })
    }
}

/// An array for each word; null for one that the caller has no use for.
#[cfg(feature = "v3")]
#[derive(Clone, Copy)]
pub struct Pointers<'a> {
    words: *const *mut u32,
    spare: &'a Spare,
}

/// What stands for arrays that are not there, of eight rays.
#[cfg(feature = "v3")]
pub struct Spare {
    zero: [u32; 8],
    ones: [u32; 8],
    /// What nobody reads; written to through a shared reference.
    sink: std::cell::UnsafeCell<[u32; 8]>,
}

#[cfg(feature = "v3")]
impl Spare {
    pub fn new() -> Self {
        Self { zero: [0; 8], ones: [u32::MAX; 8], sink: [0; 8].into() }
    }
}

#[cfg(feature = "v3")]
impl<'a> Pointers<'a> {
    /// # Safety
    /// `words` are pointers to arrays of the words of rays, then of hits where these are asked for, each null or as long as there are rays; they are this
    /// thread's as long as the lanes are used.
    pub unsafe fn new(words: *const *mut u32, spare: &'a Spare) -> Self {
        Self { words, spare }
    }
}

#[cfg(feature = "v3")]
impl Lanes for Pointers<'_> {
    #[inline(always)]
    fn word(&self, word: usize, lane: usize) -> *mut u32 {
        // SAFETY: who made the lanes promised that there are so many pointers.
        let array = unsafe { self.words.add(word).read() };
        if array.is_null() {
            return match word {
                // Rays begin at 0 and at time 0, and see everything.
                MASK => self.spare.ones.as_ptr().cast_mut(),
                0..=TIME => self.spare.zero.as_ptr().cast_mut(),
                _ => self.spare.sink.get().cast(),
            };
        }
        array.wrapping_add(lane)
    }
}
