//! The film: sums of tiles and splats, replicate groups, the merged image with its error, and picture files.

mod blocks;
pub mod exr;
mod filter;
mod group;
mod image;
pub mod png;
mod splat;
mod tile;
mod tiled;

pub use crate::path::Counters;
pub use blocks::{BlockErrors, ChannelMeans, ERROR_BLOCK};
pub use filter::{Filter, Footprint, MAX_FOOTPRINT};
pub use group::GroupFilm;
pub use image::{ErrorSummary, MergedImage};
pub use splat::{BLOCK, SplatSums};
pub use tile::{Aov, AovSum, Rect, TileSums};
pub use tiled::{TileGrid, TiledFilm};
