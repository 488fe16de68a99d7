//! Counter-based random numbers: every number is a hash of its place, so that no order of work can change it.

use super::Sampler;
use crate::math::Vec2;

/// 2^64 divided by the golden ratio, made odd: the step of SplitMix64's counter.
pub(super) const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Mixes 64 bits, bijectively (SplitMix64's finaliser: variant 13 of Stafford 2011, "Better Bit Mixing").
#[inline]
pub const fn mix64(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Hashes a tuple of words to 64 bits; the order and the number of the words matter.
#[inline]
pub const fn hash_words(words: &[u64]) -> u64 {
    let mut h = GOLDEN.wrapping_mul(words.len() as u64 + 1);
    let mut i = 0;
    while i < words.len() {
        h = mix64(h ^ mix64(words[i].wrapping_add(GOLDEN)));
        i += 1;
    }
    h
}

/// The `counter`-th 64 bits of the stream `key` (SplitMix64: Steele, Lea, Flood 2014).
#[inline]
pub(super) const fn stream_bits(key: u64, counter: u64) -> u64 {
    mix64(key.wrapping_add(counter.wrapping_add(1).wrapping_mul(GOLDEN)))
}

/// The upper 24 bits as a number in [0, 1): every value is exact in f32, and below one.
#[inline]
pub(super) fn unit_f32(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// Independent uniform numbers: a function of (key words, count of calls) only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndependentSampler {
    key: u64,
    counter: u64,
}

impl IndependentSampler {
    /// The stream of a tuple such as (seed, purpose, replicate, index).
    #[inline]
    pub const fn new<const N: usize>(words: [u64; N]) -> Self {
        Self { key: hash_words(&words), counter: 0 }
    }

    /// The next 64 random bits.
    #[inline]
    pub fn next_bits(&mut self) -> u64 {
        let bits = stream_bits(self.key, self.counter);
        self.counter += 1;
        bits
    }
}

impl Sampler for IndependentSampler {
    #[inline]
    fn start_vertex(&mut self, vertex: u32) {
        self.counter = u64::from(vertex) * 8;
    }

    #[inline]
    fn next_1d(&mut self) -> f32 {
        unit_f32((self.next_bits() >> 32) as u32)
    }

    #[inline]
    fn next_2d(&mut self) -> Vec2 {
        let bits = self.next_bits();
        Vec2::new(unit_f32((bits >> 32) as u32), unit_f32(bits as u32))
    }
}
