//! The camera: rays for a raster position, and their importance for paths that arrive from the lights.
//!
//! Raster positions are in pixels: (0, 0) is the picture's top left corner, x to the right, y down; pixel (i, j) is the square
//! [i, i + 1) x [j, j + 1). They may lie outside the picture: the film decides what counts.
//!
//! **Importance.** `We` is normalised per pixel area. With `h_j` the filter of pixel j, whose integral over the raster is 1,
//!
//! `I_j = integral over raster x and lens point of h_j(x) L(ray(x, lens)) p_lens = integral over lens and directions of h_j L We cos`,
//!
//! cos being that between the ray and the optical axis. So a contribution carried to the camera with weight `We`, times `h_j` at its
//! raster position, is an estimate of pixel j itself, whatever the resolution.

mod desc;
#[cfg(test)]
mod tests;

pub use desc::{CameraDesc, FovAxis};

use crate::math::{Anchor, DMat3, DVec2, DVec3, Ray, Vec2, Vec3, tan64};
use crate::sampling::warp;
use std::f64::consts::PI;

/// Why a camera was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CameraError {
    /// A number is NaN or infinite, or the transform is singular.
    #[error("its transform is singular or not finite")]
    Transform,
    /// Angle of view out of range.
    #[error("its angle of view must lie between 0 and 180 degrees")]
    Fov,
    /// Lens or focus out of range.
    #[error("its aperture radius must be at least 0 and its focus distance positive, both finite")]
    Lens,
    /// No pixels.
    #[error("its picture has no pixels")]
    Size,
}

/// A pinhole or thin-lens camera with perspective projection. All set-up is in f64.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Centre of the lens, as rays start there: rounded to f32.
    position: DVec3,
    /// Camera axes in the world: right, up, backward; orthonormal.
    axes: DMat3,
    /// Half the picture's size in pixels.
    half: DVec2,
    /// Side of a pixel on the plane at distance 1.
    pixel: f64,
    /// 0 for a pinhole.
    lens_radius: f64,
    focus_distance: f64,
}

/// A connection from a point to the lens. Its contribution is `f * we * |cos at the point| * visibility / pdf` (times the filter's
/// weight at `raster`, in every pixel that it covers).
#[derive(Clone, Copy, Debug)]
pub struct WeSample {
    /// Unit direction from the point towards the lens.
    pub wi: Vec3,
    /// Distance to the lens.
    pub dist: f32,
    /// Where the ray from the lens to the point falls on the picture, in pixels.
    pub raster: Vec2,
    /// Importance of the ray, normalised per pixel area (see the module's description).
    pub we: f32,
    /// Density of `wi` per solid angle at the point. For a pinhole, what density 1 of the lens point turns into.
    pub pdf: f32,
    /// The point of the lens; no surface.
    pub lens: Anchor,
    /// Unit optical axis, towards the scene.
    pub n: Vec3,
}

impl WeSample {
    /// The ray that must be free between `from` and the lens.
    #[inline]
    pub fn shadow_ray(&self, from: &Anchor) -> Ray {
        from.segment_to(&self.lens)
    }
}

impl Camera {
    /// A camera whose picture has `width` times `height` pixels.
    pub fn new(desc: &CameraDesc, width: u32, height: u32) -> Result<Self, CameraError> {
        if width == 0 || height == 0 {
            return Err(CameraError::Size);
        }
        if !(desc.fov > 0.0 && desc.fov < 180.0) {
            return Err(CameraError::Fov);
        }
        let lens_ok = desc.aperture_radius >= 0.0 && desc.aperture_radius.is_finite();
        let focus_ok = desc.focus_distance > 0.0 && desc.focus_distance.is_finite();
        if !lens_ok || !focus_ok {
            return Err(CameraError::Lens);
        }
        let position = desc.to_world.translation.as_vec3();
        if !position.is_finite() {
            return Err(CameraError::Transform);
        }
        let size = DVec2::new(f64::from(width), f64::from(height));
        let side = match desc.fov_axis {
            FovAxis::X => size.x,
            FovAxis::Y => size.y,
            FovAxis::Smaller => size.min_element(),
            FovAxis::Larger => size.max_element(),
            FovAxis::Diagonal => size.length(),
        };
        Ok(Self {
            position: position.as_dvec3(),
            axes: orthonormal(&desc.to_world.matrix3).ok_or(CameraError::Transform)?,
            half: 0.5 * size,
            pixel: 2.0 * tan64(desc.fov.to_radians() * 0.5) / side,
            lens_radius: desc.aperture_radius,
            focus_distance: desc.focus_distance,
        })
    }

    /// Whether all rays start in one point.
    #[inline]
    pub fn is_pinhole(&self) -> bool {
        self.lens_radius == 0.0
    }

    /// The ray of unit direction through the raster position and the point of the lens that `lens_u` in [0, 1)^2 chooses (not used by
    /// a pinhole).
    #[inline]
    pub fn generate_ray(&self, raster: Vec2, lens_u: Vec2) -> Ray {
        let plane = (raster.as_dvec2() - self.half) * self.pixel;
        let towards = DVec3::new(plane.x, -plane.y, -1.0);
        if self.is_pinhole() {
            return Ray::new(self.position.as_vec3(), (self.axes * towards).normalize().as_vec3());
        }
        let lens = self.lens_point(lens_u);
        let d = towards * self.focus_distance - lens;
        Ray::new((self.position + self.axes * lens).as_vec3(), (self.axes * d).normalize().as_vec3())
    }

    /// The raster position of the point `p` seen from the world point `lens` of the lens (a ray's origin); `None` behind the lens.
    #[inline]
    pub fn project(&self, p: Vec3, lens: Vec3) -> Option<Vec2> {
        let lens = self.camera_space(lens);
        self.raster(lens, self.camera_space(p) - lens)
    }

    /// The raster position of the direction `w` (from the camera towards the scene) at the world point `lens` of the lens; `None`
    /// behind the lens.
    #[inline]
    pub fn project_direction(&self, w: Vec3, lens: Vec3) -> Option<Vec2> {
        self.raster(self.camera_space(lens), self.axes.transpose() * w.as_dvec3())
    }

    /// Whether a raster position lies on the picture. Around it nothing is splatted.
    #[inline]
    pub fn shows(&self, raster: Vec2) -> bool {
        let size = (2.0 * self.half).as_vec2();
        raster.x >= 0.0 && raster.y >= 0.0 && raster.x < size.x && raster.y < size.y
    }

    /// Connects `p` to a point of the lens, uniform in its area; `None` behind the lens. The picture's border does not matter.
    pub fn sample_we(&self, p: Vec3, lens_u: Vec2) -> Option<WeSample> {
        let lens = if self.is_pinhole() { DVec3::ZERO } else { self.lens_point(lens_u) };
        let to_p = self.camera_space(p) - lens;
        let raster = self.raster(lens, to_p)?;
        let dist2 = to_p.length_squared();
        let dist = dist2.sqrt();
        let cos = -to_p.z / dist;
        Some(WeSample {
            wi: (self.axes * (to_p / -dist)).as_vec3(),
            dist: dist as f32,
            raster,
            we: self.we(cos) as f32,
            pdf: (self.lens_density() * dist2 / cos) as f32,
            lens: Anchor::free((self.position + self.axes * lens).as_vec3()),
            n: self.forward(),
        })
    }

    /// Importance of a ray in direction `w` from any point of the lens, normalised per pixel area (see the module's description);
    /// 0 behind the lens, not cut off at the picture's border.
    pub fn importance(&self, w: Vec3) -> f32 {
        let cos = self.cos(w);
        if cos > 0.0 { self.we(cos) as f32 } else { 0.0 }
    }

    /// Densities `(pdf_pos, pdf_dir)` of the rays that uniform raster positions over the picture and uniform lens points give: per
    /// lens area (1 for a pinhole's delta) and per solid angle; not cut off at the picture's border, 0 behind the lens.
    pub fn pdf_we(&self, w: Vec3) -> (f32, f32) {
        let cos = self.cos(w);
        let pixels = 4.0 * self.half.x * self.half.y;
        let pdf_dir = if cos > 0.0 { 1.0 / (pixels * self.pixel * self.pixel * cos * cos * cos) } else { 0.0 };
        (self.lens_density() as f32, pdf_dir as f32)
    }

    /// Unit optical axis, towards the scene.
    #[inline]
    pub fn forward(&self) -> Vec3 {
        (-self.axes.z_axis).as_vec3()
    }

    /// `We`: lens density over the raster's area per projected solid angle. On the plane at distance 1 a pixel has area `pixel^2`,
    /// and a direction's solid angle is that of its area times cos^3.
    fn we(&self, cos: f64) -> f64 {
        let cos2 = cos * cos;
        self.lens_density() / (self.pixel * self.pixel * cos2 * cos2)
    }

    /// Density of the lens point per area; 1 for a pinhole.
    fn lens_density(&self) -> f64 {
        if self.is_pinhole() { 1.0 } else { 1.0 / (PI * self.lens_radius * self.lens_radius) }
    }

    fn cos(&self, w: Vec3) -> f64 {
        -self.axes.z_axis.dot(w.as_dvec3())
    }

    /// The point of the lens, camera space.
    fn lens_point(&self, u: Vec2) -> DVec3 {
        (warp::concentric_disk(u).as_dvec2() * self.lens_radius).extend(0.0)
    }

    /// A world point in camera space.
    fn camera_space(&self, p: Vec3) -> DVec3 {
        self.axes.transpose() * (p.as_dvec3() - self.position)
    }

    /// Where a ray from `lens` along `d` (camera space) meets the plane in focus, in pixels.
    fn raster(&self, lens: DVec3, d: DVec3) -> Option<Vec2> {
        if !(d.z < 0.0) {
            return None;
        }
        // A pinhole's focus does not matter: its lens point is the origin.
        let plane = d.truncate() / -d.z + lens.truncate() / self.focus_distance;
        let raster = (DVec2::new(plane.x, -plane.y) / self.pixel + self.half).as_vec2();
        raster.is_finite().then_some(raster)
    }
}

/// The columns of `m` made orthonormal, the viewing axis first; a mirror image stays one.
fn orthonormal(m: &DMat3) -> Option<DMat3> {
    let z = m.z_axis.try_normalize()?;
    let y = (m.y_axis - z * z.dot(m.y_axis)).try_normalize()?;
    let x = y.cross(z) * if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    m.is_finite().then_some(DMat3::from_cols(x, y, z))
}
