//! Eight lanes with AVX2 and FMA.
#![allow(unsafe_code, reason = "intrinsics; see the reason at `intrinsic`")]
use super::Lanes;
use std::arch::x86_64::*;
use std::mem::MaybeUninit;

/// AVX2 and FMA. Its functions may only run in callees of a function that enables both after they were detected; the
/// entry points in `traverse.rs` and `bundle.rs` are the only ones.
pub struct Avx2;

/// An intrinsic of AVX2 or FMA.
macro_rules! intrinsic {
    ($e:expr) => {
        // SAFETY: the machine has AVX2 and FMA, see `Avx2`; pointers come from references to whole arrays.
        unsafe { $e }
    };
}

/// The places of the bits that are set in a byte.
static SET_BITS: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut bits = 0;
    while bits < 256 {
        let (mut lane, mut n) = (0, 0);
        while lane < 8 {
            if bits >> lane & 1 == 1 {
                table[bits][n] = lane as u8;
                n += 1;
            }
            lane += 1;
        }
        bits += 1;
    }
    table
};

impl Lanes for Avx2 {
    type F = __m256;
    type I = __m256i;
    type M = __m256i;
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
    fn le_lanes(a: __m256, b: __m256) -> (__m256i, u32) {
        let m = intrinsic!(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b));
        (intrinsic!(_mm256_castps_si256(m)), intrinsic!(_mm256_movemask_ps(m)) as u32)
    }
    #[inline(always)]
    fn keys(a: __m256, m: __m256i) -> __m256i {
        intrinsic!({
            let lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let bits = _mm256_and_si256(_mm256_castps_si256(a), _mm256_set1_epi32(!7));
            _mm256_or_si256(_mm256_or_si256(bits, lane), _mm256_xor_si256(m, _mm256_set1_epi32(-1)))
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
                _mm256_blend_epi32::<$smaller>(_mm256_max_epi32(k, other), _mm256_min_epi32(k, other))
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
        intrinsic!(_mm256_permutevar8x32_epi32(
            _mm256_loadu_si256(a.as_ptr().cast()),
            _mm256_cvtepu8_epi32(_mm_loadl_epi64(SET_BITS[bits as usize & 255].as_ptr().cast()))
        ))
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
    fn or_zero(x: __m256, a: __m256, b: __m256) -> __m256 {
        intrinsic!(_mm256_and_ps(x, _mm256_cmp_ps::<_CMP_LT_OQ>(a, b)))
    }
    #[inline(always)]
    fn le(a: __m256, b: __m256) -> u32 {
        intrinsic!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b))) as u32
    }
}
