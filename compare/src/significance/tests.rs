use super::*;
use renderer::film::exr::{self, Provenance};
use renderer::film::{Counters, GroupFilm, MergedImage, Rect, TileSums};
use renderer::scene::bundle::Digest;
use renderer::scene::desc::FilterDesc;
use renderer::spectrum::Rgb;

const SIDE: u32 = 128;
const PIXELS: usize = (SIDE * SIDE) as usize;

/// A fixed sequence of numbers in [0, 1) (splitmix64).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / 16_777_216.0
    }

    /// A sample of a picture whose mean is `scale` everywhere.
    fn sample(&mut self, scale: f32) -> [f32; 3] {
        [0.0; 3].map(|_| 2.0 * scale * self.next())
    }
}

/// A picture of eight groups of one sample per pixel, as lightfarm writes it.
fn with_groups(seed: u64, scale: f32) -> Picture {
    let rect = Rect { x0: 0, y0: 0, x1: SIDE, y1: SIDE };
    let mut noise = Noise(seed);
    let mut film = || {
        let sums = (0..PIXELS).map(|_| Rgb::from(noise.sample(scale))).collect();
        let mut film = GroupFilm::Empty;
        film.add_tile(
            SIDE,
            SIDE,
            &TileSums { rect, covered: rect, samples: 1, sums, weights: vec![1.0; rect.area()], aovs: Vec::new() },
            0,
        );
        film
    };
    let films: Vec<GroupFilm> = (0..8).map(|_| film()).collect();
    let image = MergedImage::from_groups(SIDE, SIDE, &films, &[], Counters::default());
    let about = Provenance { scene: Digest::of(b""), seed, settings: serde_json::Value::Null, choice: None };
    exr::decode(&exr::encode(&image, &about).unwrap()).unwrap()
}

/// A picture of eight images whose samples were splatted with a tent filter, as Mitsuba does it, with the variance of each pixel.
fn with_pixel_variances(seed: u64, scale: f32) -> Picture {
    let mut noise = Noise(seed);
    let (mut sums, mut squares) = (vec![[0.0f64; 3]; PIXELS], vec![[0.0f64; 3]; PIXELS]);
    for _ in 0..8 {
        let mut image = vec![[0.0f32; 4]; PIXELS];
        // Four samples a pixel, each added to the four pixels that its tent covers.
        for (y, x) in (0..SIDE).flat_map(|y| (0..SIDE).flat_map(move |x| [(y, x); 4])) {
            let (px, py) = (x as f32 + noise.next() - 0.5, y as f32 + noise.next() - 0.5);
            let value = noise.sample(scale);
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (ix, iy) = (px.floor() as i32 + dx, py.floor() as i32 + dy);
                if (0..SIDE as i32).contains(&ix) && (0..SIDE as i32).contains(&iy) {
                    let weight = (1.0 - (px - ix as f32).abs()) * (1.0 - (py - iy as f32).abs());
                    let to = &mut image[(iy * SIDE as i32 + ix) as usize];
                    (0..3).for_each(|c| to[c] += weight * value[c]);
                    to[3] += weight;
                }
            }
        }
        for (i, [r, g, b, weight]) in image.into_iter().enumerate() {
            for (c, v) in [r, g, b].into_iter().enumerate() {
                let v = f64::from(v / weight);
                sums[i][c] += v / 8.0;
                squares[i][c] += v * v;
            }
        }
    }
    let mut channels = Vec::new();
    for (c, name) in CHANNELS.into_iter().enumerate() {
        let variance = |i: usize| ((squares[i][c] - 8.0 * sums[i][c] * sums[i][c]) / 7.0 / 8.0).max(0.0) as f32;
        channels.push((name.to_string(), sums.iter().map(|v| v[c] as f32).collect()));
        channels.push((format!("variance.{name}"), (0..PIXELS).map(variance).collect()));
    }
    Picture { width: SIDE, height: SIDE, channels, metadata: None, comments: "8 seeds, tent filter".into() }
}

fn tested(a: &Picture, b: &Picture, filter: Option<FilterDesc>) -> Agreement {
    test(&Pair::new(a, b).unwrap(), a, b, &Assumptions { replicates: 8, filter }).unwrap()
}

// With 192 blocks and channels the root mean square z of a right test lies in 1 +- 0.15 (three standard deviations).
const RIGHT: Range<f64> = 0.85..1.15;

#[test]
fn estimates_of_the_same_picture_agree_and_the_errors_are_told_right() {
    for (a, b) in [
        (with_groups(1, 1.0), with_groups(2, 1.0)),
        (with_groups(3, 1.0), with_pixel_variances(4, 1.0)),
        (with_pixel_variances(5, 1.0), with_pixel_variances(6, 1.0)),
    ] {
        let t = tested(&a, &b, None);
        assert!(t.agree && t.block_tests == 192 && t.image.len() == 3, "{t:?}");
        assert!(RIGHT.contains(&t.block_rms_z), "{}", t.block_rms_z);
    }
}

#[test]
fn a_bias_of_two_percent_is_found() {
    assert!(!tested(&with_groups(7, 1.02), &with_pixel_variances(8, 1.0), None).agree);
    assert!(!tested(&with_groups(9, 1.0), &with_groups(10, 1.02), None).agree);
}

#[test]
fn pixels_that_share_samples_are_not_taken_for_independent() {
    let t = tested(&with_pixel_variances(5, 1.0), &with_pixel_variances(6, 1.0), Some(FilterDesc::Box { radius: 0.5 }));
    assert!(t.block_rms_z > 1.3, "{}", t.block_rms_z);
}

#[test]
fn files_without_errors_are_not_tested_and_masked_blocks_are_left_out() {
    let mut a = with_groups(11, 1.0);
    let b = with_groups(12, 1.0);
    let mut plain = a.clone();
    plain.channels.retain(|(name, _)| name.len() == 1);
    plain.metadata = None;
    let assume = Assumptions { replicates: 8, filter: None };
    assert!(test(&Pair::new(&plain, &b).unwrap(), &plain, &b, &assume).is_none());
    a.channels.iter_mut().find(|(name, _)| name == "R").unwrap().1[0] = f32::INFINITY;
    let t = tested(&a, &b, None);
    assert_eq!((t.blocks_skipped, t.block_tests, t.image.len()), (1, 189, 0));
}

#[test]
fn the_filter_is_read_from_the_comments() {
    let t = tested(&with_groups(1, 1.0), &with_pixel_variances(2, 1.0), None);
    assert_eq!(t.b, "pixel variances of 8 images, tent filter");
}
