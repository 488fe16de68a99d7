//! Eight f32 lanes: AVX-512 or AVX2 where the machine has it, plain arrays elsewhere.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

use std::mem::MaybeUninit;
#[cfg(target_arch = "x86_64")]
pub(super) use {avx2::Avx2, avx512::Avx512};

/// Which instructions a machine has for the walk. The hits are the same bit for bit with all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Simd {
    /// Arrays of eight; the compiler makes of them what the target allows.
    Portable,
    /// AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, VL, BW and DQ.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Simd {
    /// What this machine has, the best last.
    pub fn all() -> Vec<Self> {
        let mut all = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::is_x86_feature_detected as has;
            let bits = has!("bmi1") && has!("bmi2") && has!("lzcnt") && has!("popcnt");
            if has!("avx2") && has!("fma") && bits {
                all.push(Self::Avx2);
                if has!("avx512f") && has!("avx512vl") && has!("avx512bw") && has!("avx512dq") {
                    all.push(Self::Avx512);
                }
            }
        }
        all
    }

    /// The best that this machine has.
    pub fn detect() -> Self {
        Self::all().pop().unwrap_or(Self::Portable)
    }
}

/// Operations on eight lanes. All round like the scalar operation of the same name except [`Lanes::mul_add`], which may fuse.
pub(super) trait Lanes {
    /// The lanes.
    type F: Copy;
    /// Eight lane numbers.
    type I: Copy;
    /// Whether something holds, by lane.
    type M: Copy;
    /// Eight u32.
    type K: Copy;
    /// Lane numbers from memory.
    fn lanes(x: &[u8; 8]) -> Self::I;
    /// Lane i of the result is lane `i`-th of `i` of `a`.
    fn permute(a: Self::F, i: Self::I) -> Self::F;
    /// The same number in every lane.
    fn splat(x: f32) -> Self::F;
    /// From memory.
    fn load(x: &[f32; 8]) -> Self::F;
    /// To memory.
    fn store(a: Self::F) -> [f32; 8];
    /// Where `a <= b`, also with one bit for each lane; not where either is NaN.
    fn le_lanes(a: Self::F, b: Self::F) -> (Self::M, u32);
    /// The bits of `a`, of which no lane is negative, with the number of the lane in the lowest three; all ones where `m` is not set.
    fn keys(a: Self::F, m: Self::M) -> Self::K;
    /// The least key.
    fn least(k: Self::K) -> u32;
    /// Keys in falling order, those of all ones last.
    fn falling(k: Self::K) -> Self::K;
    /// Lane i of the result is lane `k_i & 7` of `a`.
    fn pick(a: &[u32; 8], k: Self::K) -> Self::K;
    /// The lanes of `a` whose bits are set, close together from lane 0 on; what lies in the others does not matter.
    fn gather(a: &[u32; 8], bits: u32) -> Self::K;
    /// Keys to memory.
    fn store_keys(k: Self::K, to: &mut [MaybeUninit<u32>; 8]);
    /// `a + b`.
    fn add(a: Self::F, b: Self::F) -> Self::F;
    /// `a / b`.
    fn div(a: Self::F, b: Self::F) -> Self::F;
    /// Bit i is set where `a < b` in lane i; not set where either is NaN.
    fn lt(a: Self::F, b: Self::F) -> u32;
    /// `a - b`.
    fn sub(a: Self::F, b: Self::F) -> Self::F;
    /// `a * b`.
    fn mul(a: Self::F, b: Self::F) -> Self::F;
    /// `a * b + c` with one or two roundings: for conservative tests only.
    fn mul_add(a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// The smaller; of numbers only.
    fn min(a: Self::F, b: Self::F) -> Self::F;
    /// The larger; of numbers only.
    fn max(a: Self::F, b: Self::F) -> Self::F;
    /// `x` where `a < b`, else 0.
    fn or_zero(x: Self::F, a: Self::F, b: Self::F) -> Self::F;
    /// Bit i is set where `a <= b` in lane i; not set where either is NaN.
    fn le(a: Self::F, b: Self::F) -> u32;
}

/// Arrays: any machine.
pub(super) struct Portable;

#[inline(always)]
fn zip(a: [f32; 8], b: [f32; 8], f: impl Fn(f32, f32) -> f32) -> [f32; 8] {
    let mut r = [0.0; 8];
    for i in 0..8 {
        r[i] = f(a[i], b[i]);
    }
    r
}

impl Lanes for Portable {
    type F = [f32; 8];
    type I = [u8; 8];
    type M = u32;
    type K = [u32; 8];
    #[inline(always)]
    fn lanes(x: &[u8; 8]) -> [u8; 8] {
        *x
    }
    #[inline(always)]
    fn permute(a: [f32; 8], i: [u8; 8]) -> [f32; 8] {
        i.map(|i| a[usize::from(i & 7)])
    }
    #[inline(always)]
    fn splat(x: f32) -> [f32; 8] {
        [x; 8]
    }
    #[inline(always)]
    fn load(x: &[f32; 8]) -> [f32; 8] {
        *x
    }
    #[inline(always)]
    fn store(a: [f32; 8]) -> [f32; 8] {
        a
    }
    #[inline(always)]
    fn le_lanes(a: [f32; 8], b: [f32; 8]) -> (u32, u32) {
        let m = Self::le(a, b);
        (m, m)
    }
    #[inline(always)]
    fn keys(a: [f32; 8], m: u32) -> [u32; 8] {
        std::array::from_fn(|i| if m >> i & 1 == 1 { a[i].to_bits() & !7 | i as u32 } else { u32::MAX })
    }
    #[inline(always)]
    fn least(k: [u32; 8]) -> u32 {
        k.into_iter().fold(u32::MAX, u32::min)
    }
    #[inline(always)]
    fn falling(mut k: [u32; 8]) -> [u32; 8] {
        // As signed numbers, all ones come last.
        for i in 1..8 {
            let mut j = i;
            while j > 0 && (k[j - 1] as i32) < (k[j] as i32) {
                k.swap(j - 1, j);
                j -= 1;
            }
        }
        k
    }
    #[inline(always)]
    fn pick(a: &[u32; 8], k: [u32; 8]) -> [u32; 8] {
        k.map(|k| a[(k & 7) as usize])
    }
    #[inline(always)]
    fn gather(a: &[u32; 8], mut bits: u32) -> [u32; 8] {
        let mut k = [0; 8];
        let mut n = 0;
        while bits != 0 {
            k[n & 7] = a[bits.trailing_zeros() as usize & 7];
            bits &= bits - 1;
            n += 1;
        }
        k
    }
    #[inline(always)]
    fn store_keys(k: [u32; 8], to: &mut [MaybeUninit<u32>; 8]) {
        *to = k.map(MaybeUninit::new);
    }
    #[inline(always)]
    fn add(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn div(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn lt(a: [f32; 8], b: [f32; 8]) -> u32 {
        let mut m = 0;
        for i in 0..8 {
            m |= u32::from(a[i] < b[i]) << i;
        }
        m
    }
    #[inline(always)]
    fn sub(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn mul_add(a: [f32; 8], b: [f32; 8], c: [f32; 8]) -> [f32; 8] {
        zip(zip(a, b, |a, b| a * b), c, |ab, c| ab + c)
    }
    #[inline(always)]
    fn min(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn or_zero(x: [f32; 8], a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| if a[i] < b[i] { x[i] } else { 0.0 })
    }
    #[inline(always)]
    fn le(a: [f32; 8], b: [f32; 8]) -> u32 {
        let mut m = 0;
        for i in 0..8 {
            m |= u32::from(a[i] <= b[i]) << i;
        }
        m
    }
}
