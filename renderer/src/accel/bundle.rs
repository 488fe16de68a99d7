//! Occlusion of segments that run close together: the tree is walked once for all of them, and rays are tested eight at a time.
//!
//! What is found is what each segment would find alone: the walk leaves out only what none of them can hit, and triangles are tested with
//! the same operations.

use super::leaf::Edges;
use super::node::Child;
use super::shaft::{Shaft, ShaftLanes, abs};
#[cfg(target_arch = "x86_64")]
use super::simd::{Avx2, Avx512};
use super::simd::{Lanes, Portable, Simd};
use super::wide::Tree;
use crate::geometry::triangle::Shear;
use crate::math::{Ray, Vec3};

/// Most rays of a bundle: a bit for each.
pub(super) const MAX_RAYS: usize = 64;
/// With fewer rays to walk the tree with each costs less.
pub(super) const MIN_RAYS: usize = 3;
/// Eight rays each, and a rest for each axis.
const MAX_PACKETS: usize = MAX_RAYS / 8 + 2;
/// With more triangles in the way, to walk the tree with each ray costs less.
const MAX_TRIANGLES: usize = 48;
/// The same for nodes and leaves.
const MAX_VISITS: usize = 64;

/// Relative, of a few operations in f64, with room to spare.
const ROUNDING: f64 = 1e-13;

/// Which of at most [`MAX_RAYS`] rays meet a triangle; `None` if they don't run close enough together.
pub(super) fn any(tree: &Tree, root: Child, rays: &[Ray], simd: Simd) -> Option<u64> {
    let shaft = Shaft::new(rays, tree.reach)?;
    match simd {
        Simd::Portable => any_by::<Portable>(tree, root, &shaft, rays),
        // SAFETY: `Simd::Avx2` is only made where the machine has AVX2 and FMA.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx2 => unsafe { any_avx2(tree, root, &shaft, rays) },
        // SAFETY: `Simd::Avx512` is only made where the machine has these parts of it.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx512 => unsafe { any_avx512(tree, root, &shaft, rays) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn any_avx2(tree: &Tree, root: Child, shaft: &Shaft, rays: &[Ray]) -> Option<u64> {
    any_by::<Avx2>(tree, root, shaft, rays)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn any_avx512(tree: &Tree, root: Child, shaft: &Shaft, rays: &[Ray]) -> Option<u64> {
    any_by::<Avx512>(tree, root, shaft, rays)
}

#[inline(always)]
fn any_by<L: Lanes>(tree: &Tree, root: Child, shaft: &Shaft, rays: &[Ray]) -> Option<u64> {
    let mut inside = Inside { triangles: [Candidate::NONE; MAX_TRIANGLES], count: 0 };
    inside.gather::<L>(tree, root, shaft)?;
    if inside.count == 0 {
        return Some(0);
    }
    let mut packets = Packets { packets: [Packet::EMPTY; MAX_PACKETS], count: 0 };
    packets.fill(rays);
    let mut hit = 0;
    let packets = &packets.packets[..packets.count];
    for packet in packets {
        let lanes = packet.any::<L>(&mut inside.triangles[..inside.count], packets);
        if lanes == 0 {
            continue;
        }
        for (lane, number) in packet.numbers.iter().enumerate() {
            hit |= u64::from(lanes >> lane & 1) << (number & 63);
        }
    }
    Some(hit)
}

/// Triangles that segments in a shaft may hit.
struct Inside {
    triangles: [Candidate; MAX_TRIANGLES],
    count: usize,
}

/// A triangle that some of the rays may hit.
#[derive(Clone, Copy)]
struct Candidate {
    corners: [[f32; 3]; 3],
    /// Whether no ray reaches its plane; unknown as long as nobody asked.
    apart: Option<bool>,
}

impl Candidate {
    const NONE: Self = Self { corners: [[0.0; 3]; 3], apart: None };

    /// Whether [`Shear::plane_distance`] finds nothing within any of the rays, by far more than its roundings: most triangles with a
    /// corner before and one behind an origin are those on which rays begin or end.
    #[inline(always)]
    fn is_apart_from(&mut self, packets: &[Packet]) -> bool {
        if let Some(apart) = self.apart {
            return apart;
        }
        let [a, b, c] = self.corners.map(|p| Vec3::from_array(p).as_dvec3());
        let n = (b - a).cross(c - a);
        let apart = packets.iter().all(|p| p.misses_plane(a.to_array(), n.to_array()));
        self.apart = Some(apart);
        apart
    }
}

impl Inside {
    /// Finds them; `None` if there are too many.
    #[inline(always)]
    fn gather<L: Lanes>(&mut self, tree: &Tree, root: Child, shaft: &Shaft) -> Option<()> {
        let lanes = ShaftLanes::<L>::new(shaft);
        let (mut todo, mut left, mut visits) = ([Child(0); MAX_VISITS], 1, 1);
        todo[0] = root;
        while left > 0 {
            left -= 1;
            let Some(leaf) = todo[left].as_leaf() else {
                let node = &tree.nodes[todo[left].0 as usize];
                let mut inside = lanes.children(node);
                visits += inside.count_ones() as usize;
                if visits > MAX_VISITS {
                    return None;
                }
                while inside != 0 {
                    todo[left] = node.children[inside.trailing_zeros() as usize & 7];
                    inside &= inside - 1;
                    left += 1;
                }
                continue;
            };
            let leaf = &tree.leaves[leaf as usize];
            let mut inside = lanes.triangles(leaf);
            while inside != 0 {
                let lane = inside.trailing_zeros() as usize & 7;
                inside &= inside - 1;
                *self.triangles.get_mut(self.count)? = Candidate { corners: leaf.triangle(lane), ..Candidate::NONE };
                self.count += 1;
            }
        }
        Some(())
    }
}

/// Eight rays whose directions have their largest components along one axis.
#[derive(Clone, Copy)]
struct Packet {
    /// The permutation; see [`Shear`].
    axes: [usize; 3],
    o: [[f32; 8]; 3],
    d: [[f32; 8]; 3],
    /// Exclusive ends.
    t_end: [f32; 8],
    /// Which ray of the bundle each is.
    numbers: [u8; 8],
    count: usize,
}

impl Packet {
    const EMPTY: Self =
        Self { axes: [0, 1, 2], o: [[0.0; 8]; 3], d: [[1.0; 8]; 3], t_end: [0.0; 8], numbers: [0; 8], count: 0 };

    /// Of one ray, on all lanes.
    #[inline(always)]
    fn of(axes: [usize; 3], ray: &Ray) -> Self {
        let all = |v: Vec3| [[v.x; 8], [v.y; 8], [v.z; 8]];
        Self { axes, o: all(ray.o), d: all(ray.d), t_end: [ray.t_max; 8], numbers: [0; 8], count: 0 }
    }

    /// Sets a lane.
    #[inline(always)]
    fn push(&mut self, number: usize, ray: &Ray) {
        let lane = self.count & 7;
        for k in 0..3 {
            self.o[k][lane] = ray.o[k];
            self.d[k][lane] = ray.d[k];
        }
        self.t_end[lane] = ray.t_max;
        self.numbers[lane] = number as u8;
        self.count += 1;
    }

    /// Whether all rays end before the plane through `a` with the normal `n`, or begin behind it.
    #[inline(always)]
    fn misses_plane(&self, a: [f64; 3], n: [f64; 3]) -> bool {
        let mut misses = true;
        for lane in 0..8 {
            let (mut over, mut under, mut over_error, mut under_error) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
            for k in 0..3 {
                let (o, d) = (n[k] * (a[k] - f64::from(self.o[k][lane])), n[k] * f64::from(self.d[k][lane]));
                (over, under) = (over + o, under + d);
                (over_error, under_error) = (over_error + ROUNDING * o.abs(), under_error + ROUNDING * d.abs());
            }
            let height = over.abs() - over_error;
            let leaves = (over * under < 0.0) & (under.abs() > under_error);
            // What is rounded to single precision before it is compared is at least the end that is exclusive.
            let beyond = height > (under.abs() + under_error) * f64::from(self.t_end[lane]);
            misses &= (height > 0.0) & (leaves | beyond);
        }
        misses
    }

    /// The lanes that hit any of some triangles.
    #[inline(always)]
    fn any<L: Lanes>(&self, triangles: &mut [Candidate], packets: &[Packet]) -> u32 {
        let all = (1u32 << self.count) - 1;
        let mut hit = 0;
        let [kx, ky, kz] = self.axes.map(|k| k % 3);
        // Prepare the rays as `Shear::new` does.
        let o = [L::load(&self.o[kx]), L::load(&self.o[ky]), L::load(&self.o[kz])];
        let [dx, dy, dz] = [L::load(&self.d[kx]), L::load(&self.d[ky]), L::load(&self.d[kz])];
        let floor = L::mul(L::splat(Shear::FLAT), abs::<L>(dz));
        let sz = L::div(L::splat(1.0), dz);
        let inv_x = L::or_zero(L::div(L::splat(1.0), dx), floor, abs::<L>(dx));
        let inv_y = L::or_zero(L::div(L::splat(1.0), dy), floor, abs::<L>(dy));
        let s = [L::mul(dx, sz), L::mul(dy, sz), sz];
        // The end is exclusive, and distances found are inclusive.
        let t_max = self.t_end.map(f32::next_down);
        for triangle in triangles {
            let [a, b, c] = &triangle.corners;
            let a = [L::sub(L::splat(a[kx]), o[0]), L::sub(L::splat(a[ky]), o[1]), L::sub(L::splat(a[kz]), o[2])];
            let b = [L::sub(L::splat(b[kx]), o[0]), L::sub(L::splat(b[ky]), o[1]), L::sub(L::splat(b[kz]), o[2])];
            let c = [L::sub(L::splat(c[kx]), o[0]), L::sub(L::splat(c[ky]), o[1]), L::sub(L::splat(c[kz]), o[2])];
            let x = [sheared::<L>(&a, 0, &s), sheared::<L>(&b, 0, &s), sheared::<L>(&c, 0, &s)];
            let y = [sheared::<L>(&a, 1, &s), sheared::<L>(&b, 1, &s), sheared::<L>(&c, 1, &s)];
            let Some(edges) = Edges::<L>::new(x, y, all & !hit) else { continue };
            let near_x = L::min(L::min(L::mul(a[0], inv_x), L::mul(b[0], inv_x)), L::mul(c[0], inv_x));
            let near_y = L::min(L::min(L::mul(a[1], inv_y), L::mul(b[1], inv_y)), L::mul(c[1], inv_y));
            let h = edges.hits([a[2], b[2], c[2]], sz, L::max(near_x, near_y), L::load(&t_max));
            hit |= h.easy;
            let (mut around, hard) = (h.around & !hit, h.hard & !hit);
            if around != 0 && triangle.is_apart_from(packets) {
                around = 0;
            }
            if around | hard != 0 {
                hit |= self.rest(around, hard, &triangle.corners, &L::store(h.least_t), &t_max);
            }
            if hit == all {
                break;
            }
        }
        hit
    }

    /// The lanes that hit a triangle among those without a distance (`around`) and those that only the reference test can decide.
    #[inline(never)]
    fn rest(&self, mut around: u32, mut hard: u32, corners: &[[f32; 3]; 3], least: &[f32; 8], t_max: &[f32; 8]) -> u32 {
        let [a, b, c] = corners.map(|p| self.axes.map(|k| p[k % 3]));
        let shear = |lane: usize| {
            let of = |rows: &[[f32; 8]; 3]| Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane]);
            Shear::new(of(&self.o), of(&self.d))
        };
        let mut hit = 0;
        while around != 0 {
            let lane = around.trailing_zeros() as usize & 7;
            around &= around - 1;
            let t = shear(lane).plane_distance(a, b, c);
            hit |= u32::from(t.is_some_and(|t| t.max(least[lane]) <= t_max[lane])) << lane;
        }
        while hard != 0 {
            let lane = hard.trailing_zeros() as usize & 7;
            hard &= hard - 1;
            hit |= u32::from(shear(lane).intersect(a, b, c, t_max[lane]).is_some()) << lane;
        }
        hit
    }
}

/// Coordinate `k` of a corner after the shear.
#[inline(always)]
fn sheared<L: Lanes>(r: &[L::F; 3], k: usize, s: &[L::F; 3]) -> L::F {
    L::sub(r[k], L::mul(s[k], r[2]))
}

/// The rays of a bundle.
struct Packets {
    packets: [Packet; MAX_PACKETS],
    count: usize,
}

impl Packets {
    /// Sorts rays by the axis of their largest component.
    #[inline(always)]
    fn fill(&mut self, rays: &[Ray]) {
        // For each axis the packet that is being filled.
        let mut open = [usize::MAX; 3];
        for (number, ray) in rays.iter().enumerate() {
            let axes = Shear::axes(ray.d);
            let at = &mut open[axes[2] % 3];
            if self.packets.get(*at).is_none_or(|p| p.count == 8) {
                *at = self.count;
                self.count += 1;
                self.packets[*at] = Packet::of(axes, ray);
            }
            self.packets[*at].push(number, ray);
        }
    }
}
