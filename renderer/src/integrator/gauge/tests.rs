use super::lesson::{BUNDLE, JOIN, KEEPING, LIGHT, SAMPLE, SIDES};
use super::*;
use crate::scene::desc::FilterDesc;

const TILE: Rect = Rect { x0: 32, y0: 64, x1: 64, y1: 128 };

/// Shows sample `index` of the pixels of rows `rows`, of which every other one is brighter.
fn watch(gauge: &mut Gauge, rows: std::ops::Range<u32>, index: u32, own: f32, reflected: f32) {
    watch_lit(gauge, rows, index, (own, None), reflected);
}

/// The same, with samples of lights that scatter.
fn watch_lit(
    gauge: &mut Gauge,
    rows: std::ops::Range<u32>,
    index: u32,
    (own, direct): (f32, Option<f64>),
    reflected: f32,
) {
    for y in rows {
        for x in TILE.x0..TILE.x1 {
            let odd = ((x + y) % 2) as f32;
            let surface = Some((Vec3::Y, 0.5));
            let (own, reflected) = (Rgb::splat(1.0 + own * odd), Rgb::splat(reflected * (odd + 1.0)));
            gauge.see((x, y), index, Seen { own, reflected, surface, rays: 6, direct });
        }
    }
}

fn gauge() -> Gauge {
    gauge_of(TILE, true)
}

fn gauge_of(tile: Rect, shares: bool) -> Gauge {
    Gauge::new(&Filter::new(&FilterDesc::Box { radius: 0.5 }, 256, 256), tile, 0, shares, None)
}

/// The side after samples of the whole tile.
fn side_after(own: f32, reflected: f32) -> u32 {
    let mut gauge = gauge();
    watch(&mut gauge, TILE.y0..TILE.y1, 0, own, reflected);
    gauge.choose(TILE.y0, 1).side
}

#[test]
fn blocks_grow_with_what_is_shared() {
    assert_eq!(gauge().choose(TILE.y0, 0).side, FIRST);
    // Nothing to share, nothing that varies, noise that can't be shared.
    assert_eq!([side_after(0.5, 0.0), side_after(0.0, 0.0), side_after(0.5, 0.01)], [1, 1, 1]);
    let sides = [0.1f32, 0.2, 0.5, 2.0].map(|reflected| side_after(0.05, reflected));
    assert!(sides.windows(2).all(|w| w[0] <= w[1]) && sides[0] > 1 && sides[3] >= 5, "{sides:?}");
}

/// However low the tile, its first sample tells of both halves, so that no band goes on without knowing anything.
#[test]
fn both_halves_are_watched_from_the_first() {
    for height in 9..70 {
        let mut gauge = gauge_of(Rect { y1: 64 + height, ..TILE }, true);
        watch(&mut gauge, 64..64 + height, 0, 0.05, 2.0);
        assert!(gauge.halves.iter().all(|h| h.counts.firsts > 0.0), "{height} rows");
    }
}

/// With samples a and b of variance V alone and `V / n` shared by n, the best of the sides is that of least cost times variance.
#[test]
fn the_side_is_the_best_one() {
    let (own, reflected) = (0.1f64, 0.4);
    let work = |side: u32| {
        let n = f64::from(side * side);
        let (keeping, bundle) = if side > 1 { (KEEPING, BUNDLE) } else { (1.0, 0.0) };
        (SAMPLE + 6.0 + bundle + JOIN * (n - 1.0)) * (own * own + reflected * reflected / n) * keeping
    };
    let best = SIDES.into_iter().min_by(|a, b| work(*a).total_cmp(&work(*b)));
    assert_eq!(Some(side_after(own as f32, reflected as f32)), best);
}

/// Without anything to share: as many samples of lights as make the variance times the cost least, but the first takes all of them.
#[test]
fn lights_are_sampled_as_often_as_it_pays() {
    // Every other pixel is brighter by d: the variance is d^2 / 2 at two samples of lights; half of what they scatter more at one.
    for (own, direct) in [(0.5f32, 0.0f64), (0.5, 0.01), (0.5, 0.05), (0.5, 0.12)] {
        let mut gauge = gauge_of(TILE, false);
        watch_lit(&mut gauge, TILE.y0..TILE.y1, 0, (own, Some(direct)), 0.0);
        let variance = 0.5 * f64::from(own) * f64::from(own);
        let pays = variance * (SAMPLE + 6.0) <= (variance + direct) * (SAMPLE + 6.0 - LIGHT);
        let lights = if pays { LIGHTS } else { 1 };
        assert_eq!(gauge.choose(TILE.y0, 1), Choice { side: 1, lights }, "{direct}");
        assert_eq!(gauge.choose(TILE.y0, 0).lights, LIGHTS);
    }
}

/// Where the neighbours are of two kinds, nothing tells noise from an edge.
#[test]
fn edges_count_less_than_they_differ() {
    assert_eq!([edge(0.0, 0.0), edge(1.0, 1.0)], [0.0, 0.0]);
    // A pixel of which a part p is white: the mean over p of p (1 - p), over the square of the mean.
    assert!((edge(0.0, 1.0) - (1.0 / 6.0) / 0.25).abs() < 1e-12 && edge(1.0, 1e9) < 0.7);
}

/// Once a pixel has samples, none of its band has a say in how it goes on.
#[test]
fn no_band_decides_for_itself() {
    let mut gauge = gauge();
    let first_band = TILE.y0..gauge.band_end(TILE.y0);
    watch(&mut gauge, first_band.clone(), 0, 0.05, 2.0);
    assert!(gauge.choose(first_band.start, 0).side > 2);
    assert_eq!(gauge.choose(first_band.start, 1).side, FIRST);
    assert!(gauge.choose(first_band.end, 1).side > 2);
    let of_others = gauge.band_end(first_band.end);
    watch(&mut gauge, first_band.end..of_others, 0, 0.5, 0.0);
    assert_eq!(gauge.choose(first_band.start, 1).side, 1);
}
