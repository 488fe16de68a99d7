//! What every importer produces: plain data with typed indices. Metres, right-handed, +Y up, linear Rec.709 radiance.

use crate::bsdf::{Material, MaterialId};
pub use crate::camera::{CameraDesc, FovAxis};
use crate::geometry::{Mesh, MeshId};
pub use crate::light::{Emission, LightDesc, SpotFalloff};
use crate::math::DAffine3;
pub use crate::medium::{Medium, MediumId, Phase};
use crate::texture::Texture;
use serde::{Deserialize, Serialize};

/// A whole scene.
#[derive(Clone, Debug, Default)]
pub struct SceneDesc {
    /// Shared geometry.
    pub meshes: Vec<Mesh>,
    /// Placed objects.
    pub shapes: Vec<ShapeDesc>,
    /// Shared textures.
    pub textures: Vec<Texture>,
    /// Shared materials.
    pub materials: Vec<Material>,
    /// Shared media.
    pub media: Vec<Medium>,
    /// The medium wherever no shape's inside is.
    pub global_medium: Option<MediumId>,
    /// Lights other than emitting shapes.
    pub lights: Vec<LightDesc>,
    /// The one camera that renders.
    pub camera: CameraDesc,
    /// What the scene file says of rendering; the command line overrides it.
    pub defaults: RenderDefaults,
}

/// What a placed object is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShapeKind {
    /// A mesh; used by several shapes it is instanced, not copied.
    Mesh(MeshId),
    /// The unit sphere.
    Sphere,
    /// The unit disk in xy, normal +z.
    Disk,
    /// The square [-1, 1]^2 in xy, normal +z, uv from (0, 0) at (-1, -1) to (1, 1).
    Rectangle,
    /// The cube [-1, 1]^3, normals outward, uv [0, 1]^2 on each face.
    Cube,
}

/// A placed object.
#[derive(Clone, Debug)]
pub struct ShapeDesc {
    /// For messages.
    pub name: String,
    /// What it is.
    pub kind: ShapeKind,
    /// Object to world, composed in f64.
    pub to_world: DAffine3,
    /// Turns normals round.
    pub flip_normals: bool,
    /// What it is made of.
    pub material: MaterialId,
    /// Light it emits, if any.
    pub emission: Option<Emission>,
    /// What it is filled with; `None` is empty space.
    pub interior: Option<MediumId>,
    /// Where insides overlap, the one of the shape with the highest priority is there.
    pub priority: i32,
}

/// Pixel reconstruction filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum FilterDesc {
    /// Constant within `radius` (0.5 = the pixel).
    Box {
        /// Half width in pixels.
        radius: f32,
    },
    /// Linear to zero at `radius`.
    Tent {
        /// Half width in pixels.
        radius: f32,
    },
    /// Gaussian minus its value at the radius (4 standard deviations).
    Gaussian {
        /// Standard deviation in pixels.
        stddev: f32,
    },
    /// Four-term Blackman-Harris window.
    BlackmanHarris {
        /// Half width in pixels.
        radius: f32,
    },
}

impl FilterDesc {
    /// The largest radius in pixels.
    pub const MAX_RADIUS: f32 = 8.0;
    /// The largest standard deviation, whose radius is that.
    pub const MAX_STDDEV: f32 = 2.0;

    /// Checks that the filter has a usable radius.
    pub fn validate(&self) -> Result<(), String> {
        let (what, v, limit) = match *self {
            Self::Box { radius } => ("radius of the box filter", radius, Self::MAX_RADIUS),
            Self::Tent { radius } => ("radius of the tent filter", radius, Self::MAX_RADIUS),
            Self::Gaussian { stddev } => ("standard deviation of the Gaussian filter", stddev, Self::MAX_STDDEV),
            Self::BlackmanHarris { radius } => ("radius of the Blackman-Harris filter", radius, Self::MAX_RADIUS),
        };
        if v > 0.0 && v <= limit {
            Ok(())
        } else {
            Err(format!("the {what} is {v}; it must be above 0 and at most {limit} pixels"))
        }
    }
}

/// What the scene file asks for; every field can be overridden.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderDefaults {
    /// `path`, `light`, ...
    pub integrator: Option<String>,
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// Width and height in pixels.
    pub size: Option<(u32, u32)>,
    /// Edges of the longest path; -1 unbounded.
    pub max_depth: Option<i32>,
    /// Depth from which Russian roulette may end a path.
    pub rr_depth: Option<u32>,
    /// Seed.
    pub seed: Option<u64>,
    /// Reconstruction filter.
    pub filter: Option<FilterDesc>,
}
