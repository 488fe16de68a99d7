//! What a file knows of its error.

use super::CHANNELS;
use renderer::film::exr::Picture;
use renderer::film::{ChannelMeans, Filter};
use renderer::scene::desc::FilterDesc;
use serde::Deserialize;
use statcheck::Estimate;
use std::ops::Range;

/// How files with pixel variances were made.
#[derive(Clone, Copy, Debug)]
pub struct Assumptions {
    /// Independent images behind a `variance.*` layer.
    pub replicates: u32,
    /// The filter that splatted the samples; `None` = as the file's comments say, else a box.
    pub filter: Option<FilterDesc>,
}

/// The filter of pixels that share nothing.
const PIXEL: FilterDesc = FilterDesc::Box { radius: 0.5 };

/// What a file knows of its error.
pub(super) enum Errors {
    /// Standard errors of blocks (at each pixel) and of the image, from groups; what they are at least, if that is known.
    Groups { block: Vec<[f32; 3]>, image: ChannelMeans, least: Option<Box<Self>> },
    /// Variance of each pixel; how much larger the variance of a block's mean is than that of independent pixels, by axis.
    Pixels { variance: Vec<[f32; 3]>, dof: f64, filter: Filter, name: String },
}

impl Errors {
    pub(super) fn of(p: &Picture, assume: &Assumptions) -> Option<Self> {
        let layer = |name: &str| {
            let names = CHANNELS.map(|c| format!("{name}.{c}"));
            p.triple([&names[0], &names[1], &names[2]])
        };
        let square = |v: Vec<[f32; 3]>| v.into_iter().map(|p| p.map(|s| s * s)).collect();
        let own = p.metadata.as_ref().and_then(|m| {
            let filter = FilterDesc::deserialize(&m.settings["filter"]).ok();
            let path = m.settings["integrator"] == "path";
            m.channels.map(|image| (image, path, m.settings["share"] == true, filter))
        });
        match (own, layer("blockerror"), layer("stderror")) {
            // Pixels of a path tracer share samples in a known way, if at all: hundreds of pixel errors tell a block's error better
            // than its own few groups do, whose chance of being far too small the t-test of two images underrates. Where they share
            // paths as well, it is at least that.
            (Some((image, true, shares, own)), block, Some(errors)) => {
                let filter = Filter::new(&own.unwrap_or(PIXEL), p.width, p.height);
                let name = format!("pixel errors of {} replicate groups", image.groups);
                let dof = f64::from(image.groups) - 1.0;
                let pixels = Self::Pixels { variance: square(errors), dof, filter, name };
                return Some(match block {
                    Some(block) if shares => Self::Groups { block, image, least: Some(Box::new(pixels)) },
                    _ => pixels,
                });
            }
            (Some((image, ..)), Some(block), _) => return Some(Self::Groups { block, image, least: None }),
            _ => {}
        }
        let variance = layer("variance").or_else(|| layer("stderror").map(square))?;
        let (desc, name) = match assume.filter {
            Some(f) => (f, filter_name(&f)),
            None => filter_of_comments(&p.comments).map_or((PIXEL, "box"), |f| (f, filter_name(&f))),
        };
        let filter = Filter::new(&desc, p.width, p.height);
        let name = format!("pixel variances of {} images, {name} filter", assume.replicates);
        Some(Self::Pixels { variance, dof: f64::from(assume.replicates) - 1.0, filter, name })
    }

    pub(super) fn describe(&self) -> String {
        match self {
            Self::Groups { image, .. } => format!("block errors of {} replicate groups", image.groups),
            Self::Pixels { name, .. } => name.clone(),
        }
    }

    /// The `mean` over a block, with its error.
    pub(super) fn block(&self, mean: f64, width: u32, x: &Range<u32>, y: &Range<u32>, c: usize) -> Estimate {
        match self {
            Self::Groups { block, image, least } => {
                let se = f64::from(block[(y.start * width + x.start) as usize][c]);
                let own = Estimate { mean, variance: se * se, dof: f64::from(image.groups) - 1.0 };
                own.at_least(least.as_ref().map(|l| l.block(mean, width, x, y, c)))
            }
            Self::Pixels { variance, dof, filter, .. } => {
                let pixels = y.clone().flat_map(|y| x.clone().map(move |x| (y * width + x) as usize));
                let inflation = filter.inflation(0, x) * filter.inflation(1, y);
                Estimate::pooled(mean, pixels.map(|i| f64::from(variance[i][c])), *dof, inflation)
            }
        }
    }

    /// The `mean` over the image, with its error.
    pub(super) fn image(&self, mean: f64, width: u32, height: u32, c: usize) -> Estimate {
        match self {
            Self::Groups { image, least, .. } => {
                let variance = image.std_error[c] * image.std_error[c];
                let own = Estimate { mean, variance, dof: f64::from(image.groups) - 1.0 };
                own.at_least(least.as_ref().map(|l| l.image(mean, width, height, c)))
            }
            Self::Pixels { .. } => self.block(mean, width, &(0..width), &(0..height), c),
        }
    }
}

fn filter_name(f: &FilterDesc) -> &'static str {
    match f {
        FilterDesc::Box { .. } => "box",
        FilterDesc::Tent { .. } => "tent",
        FilterDesc::Gaussian { .. } => "gaussian",
        FilterDesc::BlackmanHarris { .. } => "blackman-harris",
    }
}

/// A filter by name, with the width that Mitsuba gives it.
pub fn filter_by_name(name: &str) -> Option<FilterDesc> {
    Some(match name {
        "box" => FilterDesc::Box { radius: 0.5 },
        "tent" => FilterDesc::Tent { radius: 1.0 },
        "gaussian" => FilterDesc::Gaussian { stddev: 0.5 },
        _ => return None,
    })
}

/// The filter that comments such as `8 seeds x 512 spp, tent filter` name.
fn filter_of_comments(comments: &str) -> Option<FilterDesc> {
    let words: Vec<&str> = comments.split(|c: char| !c.is_alphanumeric()).collect();
    words.windows(2).find(|w| w[1] == "filter").and_then(|w| filter_by_name(w[0]))
}
