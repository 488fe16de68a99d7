use crate::math::DAffine3;

/// Which side of the picture an angle of view spans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FovAxis {
    /// Width.
    X,
    /// Height.
    Y,
    /// The shorter side.
    Smaller,
    /// The longer side.
    Larger,
    /// Corner to corner.
    Diagonal,
}

/// A perspective camera that looks along its own -Z, with +X to the right and +Y up.
#[derive(Clone, Debug)]
pub struct CameraDesc {
    /// Camera to world; scale is ignored.
    pub to_world: DAffine3,
    /// Full angle of view, degrees, in (0, 180).
    pub fov: f64,
    /// The side that `fov` spans.
    pub fov_axis: FovAxis,
    /// Radius of the lens; 0 = pinhole.
    pub aperture_radius: f64,
    /// Distance of the plane in focus, along -Z.
    pub focus_distance: f64,
}

impl Default for CameraDesc {
    fn default() -> Self {
        Self {
            to_world: DAffine3::IDENTITY,
            fov: 45.0,
            fov_axis: FovAxis::Y,
            aperture_radius: 0.0,
            focus_distance: 1.0,
        }
    }
}
