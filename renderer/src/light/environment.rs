use super::constant::SKY_FLAGS;
use super::sample::disk_area;
use super::{Emitter, LeSample, LiSample, LightContext, LightError, LightFlags, emits};
use crate::math::{DAffine3, DMat3, DVec3, INV_2PI, INV_PI, Vec2, Vec3, atan2, sin_cos, sin64};
use crate::sampling::{Discrete, warp};
use crate::spectrum::Rgb;
use crate::texture::Image;
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// Most texels of a picture (16384 x 8192): a table of 8 bytes for each is kept beside it.
pub(super) const MAX_TEXELS: usize = 1 << 27;

/// An equirectangular picture of the sky, interpolated bilinearly: it wraps round, its first and last row go on to the poles.
/// Negative texels count as zero.
///
/// Directions are drawn with a density that is itself the bilinear interpolation of luminance times sine: a texel is chosen, then a
/// point of the tent around it. So wherever there is light, there is density.
#[derive(Clone, Debug)]
pub struct EnvironmentLight {
    image: Arc<Image>,
    scale: Rgb,
    /// The light's axes in the world.
    axes: [Vec3; 3],
    /// Chooses a row.
    rows: Discrete,
    /// Chooses a texel in a row; `None` for black rows.
    columns: Vec<Option<Discrete>>,
    /// Sine of the polar angle at each row's centre.
    sines: Vec<f32>,
    /// Texels over the sum of luminance times sine: makes the interpolation a density over the unit square.
    norm: f32,
    /// Integral of the radiance over all directions.
    integral: Rgb,
}

/// Four texels and their weights.
struct Taps {
    index: [usize; 4],
    row: [usize; 4],
    weight: [f32; 4],
}

impl EnvironmentLight {
    /// From a picture, a factor and the light's placement (rotation part used); `None` when black.
    pub fn new(image: Arc<Image>, scale: Rgb, to_world: &DAffine3) -> Result<Option<Self>, LightError> {
        let (width, height) = (image.width as usize, image.height as usize);
        if width == 0 || height == 0 || width.checked_mul(height) != Some(image.texels.len()) {
            return Err(LightError::Picture);
        }
        if image.texels.len() > MAX_TEXELS {
            return Err(LightError::Large);
        }
        if image.texels.iter().any(|t| !t.to_array().iter().all(|c| c.is_finite())) {
            return Err(LightError::Emission);
        }
        let axes = orthonormal(&to_world.matrix3)?;
        if !emits(scale)? {
            return Ok(None);
        }
        // Tabulate luminance times sine by rows.
        let step = std::f64::consts::PI / height as f64;
        let sines: Vec<f32> = (0..height).map(|y| sin64(step * (y as f64 + 0.5)) as f32).collect();
        let luminance = |x, y| (positive(image.texel(x, y)) * scale).luminance();
        let luminances = |y| (0..image.width).map(|x| luminance(x, y)).collect::<Vec<f32>>();
        let columns: Vec<_> = (0..image.height).map(|y| Discrete::new(&luminances(y))).collect();
        let sums: Vec<f32> =
            columns.iter().zip(&sines).map(|(c, s)| c.as_ref().map_or(0.0, |c| c.total() as f32) * s).collect();
        let Some(rows) = Discrete::new(&sums) else { return Ok(None) };
        let norm = ((width * height) as f64 / rows.total()) as f32;
        let integral = integral(&image) * scale;
        Ok(Some(Self { image, scale, axes, rows, columns, sines, norm, integral }))
    }

    /// The texels around (x, y), in texels.
    fn taps(&self, x: f32, y: f32) -> Taps {
        let (width, height) = (self.image.width as usize, self.image.height as usize);
        let (x, y) = (x - 0.5, y - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let column = |i: f32| (i as i64).rem_euclid(width as i64) as usize;
        let row = |j: f32| (j.max(0.0) as usize).min(height - 1);
        let (c0, c1, r0, r1) = (column(x0), column(x0 + 1.0), row(y0), row(y0 + 1.0));
        Taps {
            index: [r0 * width + c0, r0 * width + c1, r1 * width + c0, r1 * width + c1],
            row: [r0, r0, r1, r1],
            weight: [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy],
        }
    }

    /// Radiance at the taps, and density over the unit square.
    fn lookup(&self, taps: &Taps) -> (Rgb, f32) {
        let mut radiance = Rgb::ZERO;
        let mut density = 0.0;
        for k in 0..4 {
            let texel = positive(self.image.texels.at(taps.index[k])) * self.scale * taps.weight[k];
            radiance += texel;
            density += texel.luminance() * self.sines[taps.row[k]];
        }
        (radiance, density * self.norm)
    }

    /// Where a world direction falls on the picture, in texels, and the sine of its polar angle.
    fn to_texels(&self, w: Vec3) -> (f32, f32, f32) {
        let local = Vec3::new(self.axes[0].dot(w), self.axes[1].dot(w), self.axes[2].dot(w));
        let sin = (local.x * local.x + local.z * local.z).sqrt();
        let u = 0.5 + atan2(local.x, -local.z) * INV_2PI;
        let v = atan2(sin, local.y) * INV_PI;
        (u * self.image.width as f32, v * self.image.height as f32, sin)
    }

    /// Samples a direction towards the sky: (direction, radiance, density per solid angle).
    fn sample(&self, u: Vec2) -> Option<(Vec3, Rgb, f32)> {
        // Choose a texel.
        let row = self.rows.sample(u.y);
        let column = self.columns[row.index].as_ref()?.sample(u.x);
        // Choose a point of the tent around it; beyond a pole it comes back, so that the last row's share goes on to the pole.
        let (width, height) = (self.image.width as f32, self.image.height as f32);
        let x = column.index as f32 + 0.5 + tent(column.u);
        let y = (row.index as f32 + 0.5 + tent(row.u)).abs();
        let y = if y > height { 2.0 * height - y } else { y };
        // Turn it into a direction.
        let (sin_theta, cos_theta) = sin_cos(PI * (y / height));
        let (sin_phi, cos_phi) = sin_cos(TAU * (x / width - 0.5));
        let wi = self.axes[0] * (sin_theta * sin_phi) + self.axes[1] * cos_theta - self.axes[2] * (sin_theta * cos_phi);
        let (radiance, density) = self.lookup(&self.taps(x, y));
        let pdf = solid_angle(density, sin_theta);
        (pdf > 0.0 && sin_theta > 0.0).then_some((wi, radiance, pdf))
    }
}

/// Density per solid angle of a density over the unit square; bounded at the poles.
fn solid_angle(density: f32, sin_theta: f32) -> f32 {
    density / (2.0 * PI * PI * sin_theta.max(1e-10))
}

fn positive(texel: Rgb) -> Rgb {
    texel.map(|c| c.max(0.0))
}

/// A number with density `1 - |x|` on [-1, 1].
fn tent(u: f32) -> f32 {
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * u).sqrt() }
}

/// The columns of `m` made orthonormal; a mirror image stays one.
fn orthonormal(m: &DMat3) -> Result<[Vec3; 3], LightError> {
    if !m.is_finite() {
        return Err(LightError::NotFinite);
    }
    let unit = |v: DVec3| v.try_normalize().ok_or(LightError::Transform);
    let y = unit(m.y_axis)?;
    let z = unit(m.z_axis - y * y.dot(m.z_axis))?;
    let x = y.cross(z) * if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    Ok([x.as_vec3(), y.as_vec3(), z.as_vec3()])
}

/// Integral of the interpolated picture over all directions. Each row's texels count by the integral of their tent times sine.
fn integral(image: &Image) -> Rgb {
    let (width, height) = (image.width as usize, image.height as usize);
    let h = std::f64::consts::PI / height as f64;
    let row_integral = |y: usize| {
        if height == 1 {
            return 2.0;
        }
        let s = sin64(0.5 * h);
        let inner = sin64(h * (y as f64 + 0.5)) * 4.0 * s * s / h;
        // The part of the tent beyond the pole is reflected.
        if y == 0 || y == height - 1 { inner + 1.0 - 2.0 * s / h } else { inner }
    };
    let mut sum = [0.0f64; 3];
    for y in 0..image.height {
        let weight = row_integral(y as usize) * 2.0 * std::f64::consts::PI / width as f64;
        for x in 0..image.width {
            for (s, c) in sum.iter_mut().zip(positive(image.texel(x, y)).to_array()) {
                *s += weight * f64::from(c);
            }
        }
    }
    Rgb::from(sum.map(|s| s as f32))
}

impl Emitter for EnvironmentLight {
    fn flags(&self) -> LightFlags {
        SKY_FLAGS
    }

    fn sample_li(&self, ctx: &LightContext, p: Vec3, _uc: f32, u: Vec2) -> Option<LiSample> {
        let (wi, radiance, pdf) = self.sample(u)?;
        Some(LiSample::infinite(&ctx.bounds, p, wi, radiance, pdf, false))
    }

    fn pdf_li_escaped(&self, w: Vec3) -> f32 {
        let (x, y, sin) = self.to_texels(w);
        solid_angle(self.lookup(&self.taps(x, y)).1, sin)
    }

    fn le_infinite(&self, w: Vec3) -> Rgb {
        let (x, y, _) = self.to_texels(w);
        self.lookup(&self.taps(x, y)).0
    }

    fn sample_le(&self, ctx: &LightContext, _uc: f32, u_pos: Vec2, u_dir: Vec2) -> Option<LeSample> {
        let (wi, radiance, pdf) = self.sample(u_dir)?;
        LeSample::infinite(&ctx.bounds, -wi, warp::concentric_disk(u_pos), radiance, pdf, SKY_FLAGS)
    }

    fn pdf_le(&self, ctx: &LightContext, _ng: Vec3, w: Vec3) -> (f32, f32) {
        (1.0 / disk_area(&ctx.bounds), self.pdf_li_escaped(-w))
    }

    fn power(&self, ctx: &LightContext) -> Rgb {
        self.integral * disk_area(&ctx.bounds)
    }

    #[cfg(test)]
    fn examples() -> Vec<super::tests::Example> {
        super::tests::environments()
            .into_iter()
            .map(|(name, image, to_world)| {
                let light = Self::new(Arc::new(image), Rgb::new(1.0, 0.5, 0.25), &to_world).unwrap().unwrap();
                super::tests::Example::free(name, light.into())
            })
            .collect()
    }
}
