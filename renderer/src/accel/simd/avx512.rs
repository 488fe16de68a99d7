//! Eight lanes with AVX-512: masks and twice the registers.
#![allow(unsafe_code, reason = "intrinsics; see the reason at `intrinsic`")]
use super::Lanes;
use std::arch::x86_64::*;
use std::mem::MaybeUninit;

/// AVX-512 on eight lanes: masks and twice the registers. Its functions may only run in callees of a function that enables the
/// features after they were detected; the entry points in `traverse.rs` and `bundle.rs` are the only ones.
pub struct Avx512;

/// An intrinsic of AVX-512 or less.
macro_rules! intrinsic {
    ($e:expr) => {
        // SAFETY: the machine has AVX-512 F, VL, BW and DQ, see `Avx512`; pointers come from references to whole arrays.
        unsafe { $e }
    };
}

impl Lanes for Avx512 {
    type F = __m256;
    type I = __m256i;
    type M = __mmask8;
    type K = __m256i;
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
    fn le_lanes(a: __m256, b: __m256) -> (__mmask8, u32) {
        let m = intrinsic!(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b));
        (m, u32::from(m))
    }
    #[inline(always)]
    fn keys(a: __m256, m: __mmask8) -> __m256i {
        intrinsic!({
            let lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let bits = _mm256_and_si256(_mm256_castps_si256(a), _mm256_set1_epi32(!7));
            _mm256_mask_or_epi32(_mm256_set1_epi32(-1), m, bits, lane)
        })
    }
    #[inline(always)]
    fn least(k: __m256i) -> u32 {
        intrinsic!({
            let k = _mm_min_epu32(_mm256_castsi256_si128(k), _mm256_extracti128_si256::<1>(k));
            let k = _mm_min_epu32(k, _mm_shuffle_epi32::<0b01_00_11_10>(k));
            let k = _mm_min_epu32(k, _mm_shuffle_epi32::<0b10_11_00_01>(k));
            _mm_cvtsi128_si32(k) as u32
        })
    }
    #[inline(always)]
    fn falling(k: __m256i) -> __m256i {
        // Batcher's bitonic sorter: the halves, then both together. Each step compares lanes with those of `other`; lanes set in
        // the constant take the smaller.
        macro_rules! step {
            ($k:expr, $other:expr, $smaller:literal) => {{
                let (k, other) = ($k, $other);
                _mm256_mask_min_epi32(_mm256_max_epi32(k, other), $smaller, k, other)
            }};
        }
        intrinsic!({
            let k = step!(k, _mm256_shuffle_epi32::<0b10_11_00_01>(k), 0b1010_1010);
            let k = step!(k, _mm256_shuffle_epi32::<0b00_01_10_11>(k), 0b1100_1100);
            let k = step!(k, _mm256_shuffle_epi32::<0b10_11_00_01>(k), 0b1010_1010);
            let mirror = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
            let k = step!(k, _mm256_permutevar8x32_epi32(k, mirror), 0b1111_0000);
            let k = step!(k, _mm256_shuffle_epi32::<0b01_00_11_10>(k), 0b1100_1100);
            step!(k, _mm256_shuffle_epi32::<0b10_11_00_01>(k), 0b1010_1010)
        })
    }
    #[inline(always)]
    fn pick(a: &[u32; 8], k: __m256i) -> __m256i {
        intrinsic!(_mm256_permutevar8x32_epi32(_mm256_loadu_si256(a.as_ptr().cast()), k))
    }
    #[inline(always)]
    fn gather(a: &[u32; 8], bits: u32) -> __m256i {
        intrinsic!(_mm256_maskz_compress_epi32(bits as u8, _mm256_loadu_si256(a.as_ptr().cast())))
    }
    #[inline(always)]
    fn store_keys(k: __m256i, to: &mut [MaybeUninit<u32>; 8]) {
        intrinsic!(_mm256_storeu_si256(to.as_mut_ptr().cast(), k));
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
        u32::from(intrinsic!(_mm256_cmp_ps_mask::<_CMP_LT_OQ>(a, b)))
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
    fn or_zero(x: __m256, a: __m256, b: __m256) -> __m256 {
        intrinsic!(_mm256_maskz_mov_ps(_mm256_cmp_ps_mask::<_CMP_LT_OQ>(a, b), x))
    }
    #[inline(always)]
    fn le(a: __m256, b: __m256) -> u32 {
        u32::from(intrinsic!(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b)))
    }
}
