//! Eight f32 lanes: AVX2 where the machine has it, plain arrays elsewhere.

/// Which instructions a machine has for the walk. The hits are the same bit for bit with all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Simd {
    /// Arrays of eight; the compiler makes of them what the target allows.
    Portable,
    /// AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Simd {
    /// The best that this machine has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
            return Self::Avx2;
        }
        Self::Portable
    }
}

/// Operations on eight lanes. All round like the scalar operation of the same name except [`Lanes::mul_add`], which may fuse.
pub(super) trait Lanes {
    /// The lanes.
    type F: Copy;
    /// Eight lane numbers.
    type I: Copy;
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
    /// For every lane, the bits of `a` above those of `b`.
    fn keys(a: Self::F, b: &[u32; 8]) -> [u64; 8];
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
    fn keys(a: [f32; 8], b: &[u32; 8]) -> [u64; 8] {
        let mut r = [0; 8];
        for i in 0..8 {
            r[i] = u64::from(a[i].to_bits()) << 32 | u64::from(b[i]);
        }
        r
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
    fn le(a: [f32; 8], b: [f32; 8]) -> u32 {
        let mut m = 0;
        for i in 0..8 {
            m |= u32::from(a[i] <= b[i]) << i;
        }
        m
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use avx2::Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    #![allow(unsafe_code, reason = "intrinsics; see the reason at `intrinsic`")]
    use super::Lanes;
    use std::arch::x86_64::*;

    /// AVX2 and FMA. Its functions may only run in callees of a function that enables both after they were detected; the
    /// traversal entry points in `traverse.rs` are the only ones.
    pub struct Avx2;

    /// An intrinsic of AVX2 or FMA.
    macro_rules! intrinsic {
        ($e:expr) => {
            // SAFETY: the machine has AVX2 and FMA, see `Avx2`; pointers come from references to whole arrays.
            unsafe { $e }
        };
    }

    impl Lanes for Avx2 {
        type F = __m256;
        type I = __m256i;
        #[inline(always)]
        fn lanes(x: &[u8; 8]) -> __m256i {
            intrinsic!(_mm256_cvtepu8_epi32(_mm_loadl_epi64(x.as_ptr().cast())))
        }
        #[inline(always)]
        fn permute(a: __m256, i: __m256i) -> __m256 {
            intrinsic!(_mm256_permutevar8x32_ps(a, i))
        }
        #[inline(always)]
        fn splat(x: f32) -> __m256 {
            intrinsic!(_mm256_set1_ps(x))
        }
        #[inline(always)]
        fn load(x: &[f32; 8]) -> __m256 {
            intrinsic!(_mm256_loadu_ps(x.as_ptr()))
        }
        #[inline(always)]
        fn store(a: __m256) -> [f32; 8] {
            let mut r = [0.0; 8];
            intrinsic!(_mm256_storeu_ps(r.as_mut_ptr(), a));
            r
        }
        #[inline(always)]
        fn keys(a: __m256, b: &[u32; 8]) -> [u64; 8] {
            let mut r = [0u64; 8];
            let p = r.as_mut_ptr();
            intrinsic!({
                let a = _mm256_castps_si256(a);
                let b = _mm256_loadu_si256(b.as_ptr().cast());
                let (low, high) = (_mm256_unpacklo_epi32(b, a), _mm256_unpackhi_epi32(b, a));
                _mm_storeu_si128(p.cast(), _mm256_castsi256_si128(low));
                _mm_storeu_si128(p.add(2).cast(), _mm256_castsi256_si128(high));
                _mm_storeu_si128(p.add(4).cast(), _mm256_extracti128_si256::<1>(low));
                _mm_storeu_si128(p.add(6).cast(), _mm256_extracti128_si256::<1>(high));
            });
            r
        }
        #[inline(always)]
        fn add(a: __m256, b: __m256) -> __m256 {
            intrinsic!(_mm256_add_ps(a, b))
        }
        #[inline(always)]
        fn div(a: __m256, b: __m256) -> __m256 {
            intrinsic!(_mm256_div_ps(a, b))
        }
        #[inline(always)]
        fn lt(a: __m256, b: __m256) -> u32 {
            intrinsic!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b))) as u32
        }
        #[inline(always)]
        fn sub(a: __m256, b: __m256) -> __m256 {
            intrinsic!(_mm256_sub_ps(a, b))
        }
        #[inline(always)]
        fn mul(a: __m256, b: __m256) -> __m256 {
            intrinsic!(_mm256_mul_ps(a, b))
        }
        #[inline(always)]
        fn mul_add(a: __m256, b: __m256, c: __m256) -> __m256 {
            intrinsic!(_mm256_fmadd_ps(a, b, c))
        }
        #[inline(always)]
        fn min(a: __m256, b: __m256) -> __m256 {
            intrinsic!(_mm256_min_ps(a, b))
        }
        #[inline(always)]
        fn max(a: __m256, b: __m256) -> __m256 {
            intrinsic!(_mm256_max_ps(a, b))
        }
        #[inline(always)]
        fn le(a: __m256, b: __m256) -> u32 {
            intrinsic!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b))) as u32
        }
    }
}
