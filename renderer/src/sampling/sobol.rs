//! Owen-scrambled Sobol points, padded in pairs of dimensions (Burley 2020, "Practical Hash-based Owen Scrambling").

use super::rng::{hash_words, stream_bits, unit_f32};
use super::{Sampler, mix64};
use crate::math::Vec2;

/// Low-discrepancy numbers: a function of (seed, replicate, pixel, sample index, dimension) only.
///
/// Each call takes one dimension pair: the first two Sobol dimensions (a (0,2)-sequence) at an index that is shuffled anew
/// for every pair, with a scramble of its own. Any `2^k` samples whose indices start at a multiple of `2^k` form a
/// (0,k,2)-net in every pair; pairs, pixels and replicates are independent of each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SobolSampler {
    key: u64,
    reversed_index: u32,
    pair: u32,
}

impl SobolSampler {
    /// The `index`-th sample of a pixel (or of any other stream, named by `pixel_key`) in a replicate.
    #[inline]
    pub const fn new(seed: u64, replicate: u32, pixel_key: u64, index: u32) -> Self {
        let key = hash_words(&[seed, replicate as u64, pixel_key]);
        Self { key, reversed_index: index.reverse_bits(), pair: 0 }
    }

    /// Sample `i` of the `count` that one of this stream is split into: all of them together are as even as the stream itself.
    #[inline]
    pub const fn one_of(&self, count: u32, i: u32) -> Self {
        let index = self.reversed_index.reverse_bits().wrapping_mul(count).wrapping_add(i);
        Self { reversed_index: index.reverse_bits(), ..*self }
    }

    /// Passes over the numbers of [`Sampler::next_3`].
    #[inline]
    pub const fn skip_3(&mut self) {
        self.pair += 2;
    }

    /// What shuffles the index for the next pair, and two words for its scrambles.
    #[inline]
    fn next_words(&mut self) -> (u32, u32, u32) {
        let shuffle = stream_bits(self.key, self.pair as u64);
        let scramble = mix64(shuffle);
        self.pair += 1;
        (shuffle as u32, scramble as u32, (scramble >> 32) as u32)
    }

    /// The index as `shuffle` shuffles it, by an Owen scramble of the index itself: aligned blocks of 2^k indices stay together.
    /// Digits from the highest bit.
    #[inline]
    fn shuffled(&self, shuffle: u32) -> u32 {
        laine_karras(self.reversed_index, shuffle)
    }
}

/// Both numbers with their bits in the other order: two cost no more than one.
#[inline]
const fn reverse_both(a: u32, b: u32) -> (u32, u32) {
    let reversed = (((b as u64) << 32) | a as u64).reverse_bits();
    ((reversed >> 32) as u32, reversed as u32)
}

/// The point with a shuffled index in the first two Sobol dimensions, scrambled.
#[inline]
fn point(index: u32, scramble_x: u32, scramble_y: u32) -> Vec2 {
    let (x, y) = reverse_both(laine_karras(index, scramble_x), laine_karras(pascal(index), scramble_y));
    Vec2::new(unit_f32(x), unit_f32(y))
}

impl Sampler for SobolSampler {
    #[inline]
    fn start_vertex(&mut self, vertex: u32) {
        self.pair = vertex.wrapping_mul(8);
    }

    #[inline]
    fn next_1d(&mut self) -> f32 {
        let (shuffle, scramble, _) = self.next_words();
        unit_f32(laine_karras(self.shuffled(shuffle).reverse_bits(), scramble).reverse_bits())
    }

    #[inline]
    fn next_2d(&mut self) -> Vec2 {
        let (shuffle, scramble_x, scramble_y) = self.next_words();
        point(self.shuffled(shuffle).reverse_bits(), scramble_x, scramble_y)
    }

    #[inline]
    fn next_3(&mut self) -> (f32, Vec2) {
        let (shuffle, scramble, _) = self.next_words();
        let (shuffle_xy, scramble_x, scramble_y) = self.next_words();
        let (index, index_xy) = reverse_both(self.shuffled(shuffle), self.shuffled(shuffle_xy));
        (unit_f32(laine_karras(index, scramble).reverse_bits()), point(index_xy, scramble_x, scramble_y))
    }

    #[inline]
    fn skip_1d(&mut self) {
        self.pair += 1;
    }
}

/// Nested uniform scramble of a number whose digits run from its lowest bit (Laine and Karras 2011, with Vegdahl's constants,
/// "Building a Better LK Hash", 2022): each bit is flipped by a hash of the bits below it.
#[inline]
const fn laine_karras(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// The second Sobol dimension, digits from the lowest bit: the index times Pascal's triangle modulo 2.
///
/// Binomial(j, i) is odd just when the bits of i are among those of j (Lucas), so the product is a sum over supersets,
/// which five steps do.
#[inline]
const fn pascal(mut x: u32) -> u32 {
    x ^= (x >> 1) & 0x5555_5555;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 4) & 0x0f0f_0f0f;
    x ^= (x >> 8) & 0x00ff_00ff;
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_together_are_those_one_after_the_other() {
        for index in [0, 1, 5, 0x1234_5678] {
            let mut one = SobolSampler::new(3, 0, 17, index);
            let mut other = one;
            for _ in 0..4 {
                let mut skipped = one;
                skipped.skip_3();
                assert_eq!(one.next_3(), (other.next_1d(), other.next_2d()));
                assert_eq!(one, skipped);
                one.skip_1d();
                other.next_1d();
            }
            assert_eq!(one, other);
        }
    }

    #[test]
    fn the_parts_of_a_sample_are_samples_of_the_stream() {
        let stream = |index: u32| SobolSampler::new(3, 1, 17, index);
        for (index, count) in [(0, 1), (5, 2), (6, 4), (1000, 3)] {
            for i in 0..count {
                assert_eq!(stream(index).one_of(count, i), stream(index * count + i));
            }
        }
    }

    /// Every aligned block of 2^m points has one point in each elementary interval of area 2^-m.
    #[test]
    fn blocks_of_a_power_of_two_are_nets() {
        for m in [1u32, 4, 7, 10] {
            let n = 1u32 << m;
            for first in [0, 3 * n, u32::MAX - n + 1] {
                let points: Vec<Vec2> = (0..n)
                    .map(|i| {
                        let mut s = SobolSampler::new(7, 1, 99, first + i);
                        s.next_1d();
                        s.next_2d()
                    })
                    .collect();
                for a in 0..=m {
                    let (columns, rows) = (1u32 << a, 1u32 << (m - a));
                    let mut seen = vec![false; n as usize];
                    for p in &points {
                        let cell = (p.x * columns as f32) as u32 * rows + (p.y * rows as f32) as u32;
                        assert!(!std::mem::replace(&mut seen[cell as usize], true), "m {m}, columns {columns}: {p}");
                    }
                }
            }
        }
    }
}
