//! What a report holds: the JSON file, from which the page is made.

use crate::error::stats::{Interval, or_nan};
use serde::{Deserialize, Serialize};

/// A whole report.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Document {
    /// Where and how it was measured.
    pub about: About,
    /// Scene by scene.
    pub scenes: Vec<SceneReport>,
    /// How cost grows.
    pub scaling: Vec<Growth>,
    /// What a reader must know.
    pub notes: Vec<String>,
}

/// Where and how it was measured.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct About {
    /// Version of lightfarm.
    pub version: String,
    /// The processor.
    pub processor: String,
    /// Processors of the machine.
    pub cores: usize,
    /// The command line.
    pub command: String,
}

/// One scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SceneReport {
    /// Its name.
    pub name: String,
    /// Its file.
    pub file: String,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Edges of the longest path; -1 = unbounded.
    pub max_depth: i32,
    /// Render threads.
    pub threads: usize,
    /// Renders of each checkpoint.
    pub rounds: usize,
    /// Whether times are processor seconds over threads.
    pub cpu_clock: bool,
    /// Budget by name.
    pub budget: String,
    /// What the pictures were compared with.
    pub reference: ReferenceAbout,
    /// One for each contender.
    pub curves: Vec<Curve>,
    /// Errors at the same time.
    pub equal_time: EqualTime,
    /// Times to the same error.
    pub equal_error: Vec<EqualError>,
    /// What a reader must know.
    pub notes: Vec<String>,
}

/// The reference.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ReferenceAbout {
    /// What made it.
    pub made_by: String,
    /// Its variance as a relMSE.
    #[serde(deserialize_with = "or_nan")]
    pub relmse: f64,
    /// Agreement with a picture by another renderer.
    pub published: Option<String>,
    /// The picture, a PNG in base 64.
    pub picture: String,
}

/// One contender on one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// `lightfarm`, or the name of the renderer.
    pub renderer: String,
    /// What its time covers.
    pub covers: String,
    /// Median seconds to read the scene, not in the curve.
    pub load_s: Option<f64>,
    /// Median seconds of compilation and warming up, not in the curve.
    pub warmup_s: Option<f64>,
    /// Largest resident memory.
    pub peak_mib: Option<f64>,
    /// By rising time.
    pub points: Vec<Point>,
    /// d ln relMSE / d ln s over the last points.
    pub slope: Option<f64>,
    /// Pictures at about the same time as those of the others.
    pub pictures: Option<Pictures>,
    /// Why there is nothing.
    pub failed: Option<String>,
}

/// One checkpoint: figures are means over its renders with 95 % intervals.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Point {
    /// Samples, light paths or mutations per pixel.
    pub count: u32,
    /// Seconds by the clock of the scene.
    pub seconds: Interval,
    /// Seconds of each round.
    pub rounds_s: Vec<f64>,
    /// relMSE of each round, less the variance of the reference.
    pub rounds_relmse: Vec<f64>,
    /// The same without the 0.1 % of pixels where it is largest.
    pub rounds_trimmed: Vec<f64>,
    /// Processor seconds.
    pub cpu_seconds: Option<f64>,
    /// The same as `rounds_relmse`, the mean.
    pub relmse: Interval,
    /// Without the 0.1 % of pixels where it is largest.
    pub relmse_trimmed: Interval,
    /// Mean squared error.
    pub mse: Interval,
    /// Mean absolute percentage error.
    pub mape: Interval,
    /// HDR-FLIP.
    pub flip: Option<Interval>,
    /// Mean of the picture over that of the reference.
    pub mean_ratio: Interval,
    /// Variance of the reference over relMSE.
    #[serde(deserialize_with = "or_nan")]
    pub reference_share: f64,
    /// Whether that is too much: the point is in no curve and no table.
    pub rejected: bool,
    /// `1 / (relMSE x seconds x threads)`.
    #[serde(deserialize_with = "or_nan")]
    pub efficiency: f64,
}

/// PNGs in base 64.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pictures {
    /// Samples of the render.
    pub count: u32,
    /// Its seconds.
    pub seconds: f64,
    /// The render.
    pub render: String,
    /// Per-pixel relative deviation over all renders of the checkpoint.
    pub deviation: String,
    /// Map of FLIP.
    pub flip: String,
}

/// Errors at the same time.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct EqualTime {
    /// Seconds.
    pub seconds: f64,
    /// One for each contender that has points on both sides, or at the end.
    pub rows: Vec<EqualTimeRow>,
}

/// One contender's errors.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EqualTimeRow {
    /// Its name.
    pub name: String,
    /// relMSE.
    #[serde(deserialize_with = "or_nan")]
    pub relmse: f64,
    /// Trimmed relMSE.
    #[serde(deserialize_with = "or_nan")]
    pub relmse_trimmed: f64,
    /// Mean absolute percentage error.
    #[serde(deserialize_with = "or_nan")]
    pub mape: f64,
    /// HDR-FLIP.
    #[serde(deserialize_with = "or_nan")]
    pub flip: f64,
}

/// How much longer a contender takes than another to the same error.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EqualError {
    /// `relMSE` or `trimmed relMSE`.
    pub measure: String,
    /// Whose time is divided.
    pub name: String,
    /// Its renderer.
    pub renderer: String,
    /// By whose time.
    pub by: String,
    /// The error.
    #[serde(deserialize_with = "or_nan")]
    pub error: f64,
    /// Time of `name` over that of `by`; above 1: `by` is sooner there.
    pub ratio: Interval,
    /// `>=` where the true ratio can only be larger, as `by` was below the error at its first checkpoint; `<=` the other way round.
    pub bound: String,
}

/// How cost grows with one thing.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Growth {
    /// Of what: `threads`, `triangles`, ...
    pub name: String,
    /// What was done.
    pub about: String,
    /// What the cost is.
    pub unit: String,
    /// Measurements.
    pub rows: Vec<GrowthRow>,
    /// Exponent of cost over the upper half of the range.
    pub exponent: Option<Interval>,
    /// Further figures in words.
    pub notes: Vec<String>,
}

/// One measurement.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GrowthRow {
    /// The number of threads, triangles, ...
    pub x: f64,
    /// The cost: median, least and greatest of the runs.
    pub cost: Interval,
    /// Further columns, by name.
    pub more: Vec<(String, f64)>,
}
