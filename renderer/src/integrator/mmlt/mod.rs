//! Multiplexed Metropolis light transport (Hachisuka, Kaplanyan and Dachsbacher 2014): Markov chains over the numbers that drive
//! bidirectional path tracing, one chain for one path length, the technique being one of the numbers.
//!
//! A chain of paths with k edges visits points u of primary sample space with density `c(u) / b`, where `F(u)` is the weighted
//! contribution of the path that u makes, `c` a positive scalar of it and `b` the integral of c. Beside what Hachisuka et al. describe:
//!
//! * c is luminance times a factor per region of the picture, learned from a pilot, so that dark regions get their share
//!   (Veach 1997, section 11.4.3; Hoberock and Hart 2010, "Arbitrary Importance Functions for Metropolis Light Transport");
//! * the technique is chosen with probabilities learned from the pilot;
//! * what a large step finds is combined with the chain by the balance heuristic (Kelemen et al. 2002, section 3.4), so that what the
//!   chain seldom visits is as good as ordinary samples make it;
//! * a sample of the pool that chains start from is a whole bidirectional one: all techniques, all lengths;
//! * how many ordinary samples of short paths go with the mutations follows from how bright both are in the pilot;
//! * the path at hand counts, now and then, for the pixels around its own (`neighbours.rs`), which pays most of all of these;
//! * there are many chains, their starts drawn by systematic resampling from a pool of independent samples, which makes them free
//!   of start-up bias (Veach 1997, section 11.3.1).
//!
//! Tried on veach-ajar at equal time and left out, because nothing was gained: larger steps of the raster position than of the rest
//! (3 times: no better, 10 times: MSE doubled), steps that move one of the two walks only (MSE 10 % higher), a third of the work for
//! pools (10 % higher), walks guided by trees over the numbers of their first three vertices (Guo, Bauszat, Bikker and Eisemann 2018,
//! "Primary Sample Space Path Guiding"; trimmed relMSE 15 % lower, which is not worth a second density in every proposal).

mod bootstrap;
mod chain;
mod constants;
mod evaluate;
mod neighbours;

pub use bootstrap::{BootstrapSums, Found, PoolTask, run_bootstrap};
pub use chain::{ChainStart, ChainStats, ChainTask, Mismatch, run_chains};
pub use constants::{ChainConstants, Depth, MmltOptions, TARGET_CELL};
pub use evaluate::{Evaluator, Proposal};
