//! EXR and PNG files: what is written is read back, the same image gives the same bytes, and damaged files are refused.

use renderer::film::exr::{self, Provenance};
use renderer::film::{Aov, AovSum, Counters, ERROR_BLOCK, GroupFilm, MergedImage, Rect, TileSums};
use renderer::scene::bundle::Digest;
use renderer::spectrum::Rgb;
use std::path::Path;

const WIDTH: u32 = 37;
const HEIGHT: u32 = 21;

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
}

fn groups(count: u32) -> (Vec<GroupFilm>, Vec<AovSum>) {
    let rect = Rect { x0: 0, y0: 0, x1: WIDTH, y1: HEIGHT };
    let mut noise = Noise(1);
    let mut films = Vec::new();
    for _ in 0..count {
        let sums = (0..rect.area()).map(|_| Rgb::new(noise.next(), 2.0 * noise.next(), 3.0 * noise.next())).collect();
        let mut film = GroupFilm::Empty;
        film.add_tile(
            WIDTH,
            HEIGHT,
            &TileSums { rect, covered: rect, samples: 2, sums, weights: vec![2.0; rect.area()], aovs: Vec::new() },
            0,
        );
        films.push(film);
    }
    let aov =
        |i: usize| Aov { albedo: [1.0, 0.5, i as f32], normal: [0.0, 2.0, 0.0], depth: 6.0, hits: (i % 3) as f32 };
    (films, (0..rect.area()).map(|i| AovSum::from_iter([aov(i)])).collect())
}

fn image(count: u32) -> MergedImage {
    let (films, aovs) = groups(count);
    let counters = Counters { samples: 7, rays: 1 << 40, non_finite: 0, negative: 1 };
    MergedImage::from_groups(WIDTH, HEIGHT, &films, &aovs, counters)
}

fn provenance() -> Provenance {
    Provenance {
        choice: None,
        scene: Digest::of(b"scene"),
        seed: u64::MAX,
        settings: serde_json::json!({"spp": 8, "filter": "tent"}),
    }
}

#[test]
fn an_exr_holds_the_image_its_error_and_its_history() {
    let image = image(4);
    let bytes = exr::encode(&image, &provenance()).unwrap();
    assert_eq!(bytes, exr::encode(&image, &provenance()).unwrap(), "the same image, other bytes");
    let back = exr::decode(&bytes).unwrap();
    assert_eq!((back.width, back.height), (WIDTH, HEIGHT));
    assert_eq!(back.triple(["R", "G", "B"]).unwrap(), image.mean);
    assert_eq!(back.triple(["stderror.R", "stderror.G", "stderror.B"]).unwrap(), image.std_error);
    assert_eq!(back.channel("samples.Y").unwrap(), image.samples);
    let blocks = back.triple(["blockerror.R", "blockerror.G", "blockerror.B"]).unwrap();
    let last = (WIDTH.div_ceil(ERROR_BLOCK) * HEIGHT.div_ceil(ERROR_BLOCK) - 1) as usize;
    assert_eq!(blocks.last(), Some(&image.blocks.std_error[last]));
    assert_eq!(blocks[0], image.blocks.std_error[0]);
    // Sums over the two samples of group 0 become averages, depth over the hits.
    assert_eq!(back.channel("albedo.G").unwrap()[5], 0.25);
    assert_eq!(back.channel("normal.Y").unwrap()[5], 1.0);
    assert_eq!(&back.channel("depth.Z").unwrap()[..3], &[f32::INFINITY, 6.0, 3.0]);
    let metadata = back.metadata.unwrap();
    assert_eq!((metadata.scene, metadata.seed), (Digest::of(b"scene"), u64::MAX));
    assert_eq!(metadata.settings, provenance().settings);
    assert_eq!((metadata.error, metadata.counters), (image.error, image.counters));
    assert_eq!(metadata.channels.unwrap().groups, 4);
}

#[test]
fn an_image_of_one_group_has_no_error_layers() {
    let back = exr::decode(&exr::encode(&image(1), &provenance()).unwrap()).unwrap();
    assert!(back.channel("stderror.R").is_none() && back.channel("blockerror.R").is_none());
    assert!(back.metadata.unwrap().error.is_none());
}

#[test]
fn block_errors_are_those_of_the_groups_block_means() {
    let (films, aovs) = groups(5);
    let image = MergedImage::from_groups(WIDTH, HEIGHT, &films, &aovs, Counters::default());
    // The block at the lower right corner: 5 x 5 pixels.
    let inside = |i: &usize| *i as u32 % WIDTH >= 32 && *i as u32 / WIDTH >= 16;
    let pixels: Vec<usize> = (0..(WIDTH * HEIGHT) as usize).filter(inside).collect();
    assert_eq!(pixels.len(), 25);
    for c in 0..3 {
        let means: Vec<f64> =
            films.iter().map(|f| pixels.iter().map(|i| f.pixel(*i).0[c]).sum::<f64>() / 25.0).collect();
        let mean = means.iter().sum::<f64>() / 5.0;
        let se = (means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / 4.0 / 5.0).sqrt();
        let got = f64::from(image.blocks.std_error[5][c]);
        assert!((got - se).abs() < 1e-6 * se, "{got} for {se}");
    }
}

#[test]
fn damaged_exr_files_are_refused_or_read() {
    let bytes = exr::encode(&image(2), &provenance()).unwrap();
    // Every shorter file lacks something, and no single wrong byte may do worse than give an error or another picture.
    for cut in (0..bytes.len()).step_by(61) {
        assert!(exr::decode(&bytes[..cut]).is_err(), "cut at {cut}");
    }
    for at in (0..bytes.len()).step_by(37) {
        let mut wrong = bytes.clone();
        wrong[at] ^= 0x5a;
        let _ = exr::decode(&wrong);
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/malformed/openexr-damaged");
    let Ok(files) = std::fs::read_dir(&folder) else {
        println!("skipped: {} is not here", folder.display());
        return;
    };
    for file in files {
        let path = file.unwrap().path();
        if path.is_file() {
            let _ = exr::decode(&std::fs::read(&path).unwrap());
        }
    }
}
