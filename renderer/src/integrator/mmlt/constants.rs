use crate::math::Vec2;
use crate::sampling::{Discrete, StepSizes};
use crate::scene::Scene;
use crate::spectrum::Rgb;
use serde::{Deserialize, Serialize};

/// Side of a cell of the target map in pixels.
pub const TARGET_CELL: u32 = 16;

/// How chains run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MmltOptions {
    /// Probability of a large step.
    pub large_step: f32,
    /// Smallest small step.
    pub step_min: f32,
    /// Largest small step.
    pub step_max: f32,
    /// Standard deviation of normally distributed small steps in place of those; 0 = none.
    pub gaussian: f32,
    /// Combine large steps with the chain by the balance heuristic.
    pub kelemen: bool,
    /// Exponent by which dark regions are lifted: 0 = luminance alone, 1 = the same relative error everywhere.
    pub lift: f32,
    /// Learn the probabilities of the techniques from the pilot.
    pub learn: bool,
    /// Mutations of one chain.
    pub chain_length: u32,
    /// Ordinary samples of emission and direct light, for each mutation; 0 = as many as the pilot finds them to be worth.
    pub direct_share: f32,
    /// Share of the work that goes into pools.
    pub pool_share: f32,
    /// Edges of the longest path that ordinary samples carry.
    pub direct_edges: u32,
    /// Edges of the longest path that chains carry; ordinary samples carry the rest.
    pub longest: u32,
    /// Of so many mutations one counts for the pixels around, too; 0 = none.
    pub neighbours: u32,
}

impl Default for MmltOptions {
    fn default() -> Self {
        Self {
            large_step: 0.3,
            step_min: 1.0 / 512.0,
            step_max: 1.0 / 32.0,
            gaussian: 0.0,
            kelemen: true,
            lift: 0.5,
            learn: true,
            chain_length: 1 << 16,
            direct_share: 0.0,
            pool_share: 0.1,
            direct_edges: 2,
            longest: 64,
            neighbours: 32,
        }
    }
}

impl MmltOptions {
    /// The method as published, with the steps of Kelemen et al.: no weights for large steps, luminance as the target, techniques alike,
    /// few long chains, all light by chains.
    pub const PLAIN: Self = Self {
        large_step: 0.3,
        step_min: 1.0 / 1024.0,
        step_max: 1.0 / 64.0,
        gaussian: 0.0,
        kelemen: false,
        lift: 0.0,
        learn: false,
        chain_length: 1 << 18,
        direct_share: 0.25,
        pool_share: 0.1,
        direct_edges: 0,
        longest: 64,
        neighbours: 0,
    };

    /// The same with the steps of Pharr, Jakob and Humphreys (2016, section 16.4).
    pub const PBRT: Self = Self { gaussian: 0.01, ..Self::PLAIN };

    /// Sizes of small steps.
    pub fn step_sizes(&self) -> StepSizes {
        if self.gaussian > 0.0 {
            StepSizes::gaussian(f64::from(self.gaussian))
        } else {
            StepSizes::log_uniform(f64::from(self.step_min), f64::from(self.step_max))
        }
    }

    /// Checks what came from a user or over the wire.
    pub fn validate(&self) -> Result<(), String> {
        let fail = |what: &str| Err(format!("mmlt: {what}"));
        if !(self.large_step > 0.0 && self.large_step <= 1.0) {
            return fail("large_step must be a probability above 0");
        }
        if !(self.step_min > 0.0 && self.step_min <= self.step_max && self.step_max <= 0.5) {
            return fail("steps must fulfil 0 < step_min <= step_max <= 0.5");
        }
        if !(0.0..=0.25).contains(&self.gaussian) {
            return fail("gaussian must lie between 0 and 0.25");
        }
        if !(0.0..=1.0).contains(&self.lift) {
            return fail("lift must lie between 0 and 1");
        }
        if !(self.direct_share >= 0.0 && self.direct_share <= 100.0) {
            return fail("direct_share must lie between 0 and 100");
        }
        if !(self.pool_share > 0.0 && self.pool_share <= 0.9) {
            return fail("pool_share must lie between 0 and 0.9");
        }
        if self.direct_edges > 2 {
            return fail("direct_edges goes from 0 to 2");
        }
        if !(1..=1 << 24).contains(&self.chain_length) || !(2..=255).contains(&self.longest) {
            return fail("chain_length must lie between 1 and 16777216, longest between 2 and 255");
        }
        Ok(())
    }
}

impl std::str::FromStr for MmltOptions {
    type Err = String;

    /// `plain`, `pbrt`, or `key=value` pairs, separated by commas; later ones win.
    fn from_str(text: &str) -> Result<Self, String> {
        // A plain struct of numbers always serialises.
        let object = |o: Self| serde_json::to_value(o).map_err(|e| e.to_string());
        let mut value = object(Self::default())?;
        for item in text.split(',').filter(|item| !item.is_empty()) {
            if let Some((_, preset)) = [("plain", Self::PLAIN), ("pbrt", Self::PBRT)].iter().find(|(n, _)| *n == item) {
                value = object(*preset)?;
                continue;
            }
            let (key, number) =
                item.split_once('=').ok_or_else(|| format!("{item:?} is not `plain`, `pbrt` or key=value"))?;
            let Some(slot) = value.get_mut(key) else {
                let known = value.as_object().map(|o| o.keys().cloned().collect::<Vec<_>>().join(", "));
                return Err(format!("there is no option {key:?} (known: {})", known.unwrap_or_default()));
            };
            *slot = serde_json::from_str(number).map_err(|_| format!("{number:?} is not a value for {key}"))?;
        }
        let options: Self = serde_json::from_value(value).map_err(|e| e.to_string())?;
        options.validate()?;
        Ok(options)
    }
}

/// Paths of one length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Depth {
    /// Edges of the path.
    pub edges: u32,
    /// Weight of the technique with s vertices from the light, s = 0 ..= edges; 0 = not proposed.
    pub techniques: Vec<f32>,
}

/// What the chains of a pass have in common; a constant of its plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChainConstants {
    /// The path lengths.
    pub depths: Vec<Depth>,
    /// Cells of the target map across the picture.
    pub columns: u32,
    /// Factor of the target by cell, row by row; empty = 1 everywhere.
    pub target: Vec<f32>,
    /// Samples of pools leave it to chance whether paths whose share of the target is below this are tested for visibility.
    pub threshold: f32,
    /// Ordinary samples of what chains don't carry, for each mutation.
    pub direct_share: f32,
}

impl ChainConstants {
    /// Those of a length.
    pub fn depth(&self, edges: u32) -> Option<&Depth> {
        self.depths.iter().find(|d| d.edges == edges)
    }

    /// What a chain's density is proportional to at a path: 0 outside the picture and where the value is none.
    #[inline]
    pub fn target_of(&self, value: Rgb, raster: Vec2, size: Vec2) -> f32 {
        if !(raster.x >= 0.0 && raster.y >= 0.0 && raster.x < size.x && raster.y < size.y) {
            return 0.0;
        }
        let target = value.luminance() * self.target_at(raster.x, raster.y);
        if target > 0.0 && target.is_finite() { target } else { 0.0 }
    }

    /// Factor of the target at a raster position.
    #[inline]
    fn target_at(&self, x: f32, y: f32) -> f32 {
        if self.target.is_empty() {
            return 1.0;
        }
        let cell = |v: f32| (v.max(0.0) as u32) / TARGET_CELL;
        let column = cell(x).min(self.columns - 1) as usize;
        let rows = self.target.len() / self.columns as usize;
        let row = (cell(y) as usize).min(rows - 1);
        self.target[row * self.columns as usize + column]
    }
}

/// Whether the technique with s vertices from the light can make any path in a scene.
fn possible(scene: &Scene, s: usize) -> bool {
    s > 0 || scene.lights.iter().any(|l| !l.flags().is_delta())
}

impl Depth {
    /// The probabilities of the techniques that can make a path in the scene; `None` when there are none.
    pub fn table(&self, scene: &Scene) -> Option<Discrete> {
        let weights = self.techniques.iter().enumerate().map(|(s, w)| if possible(scene, s) { *w } else { 0.0 });
        let weights: Vec<f32> = weights.collect();
        (weights.len() == self.edges as usize + 1).then(|| Discrete::new(&weights)).flatten()
    }
}
