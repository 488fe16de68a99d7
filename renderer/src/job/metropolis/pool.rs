use crate::integrator::mmlt::ChainStart;

/// A pool of one replicate and path length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pool {
    /// Number of samples.
    pub samples: u32,
    /// What they found, by sample: start and weight.
    pub found: Vec<(ChainStart, f32)>,
}

impl Pool {
    /// Mean of the target.
    pub(super) fn b(&self) -> f64 {
        let sum: f64 = self.found.iter().map(|f| f64::from(f.1)).sum();
        if self.samples == 0 { 0.0 } else { sum / f64::from(self.samples) }
    }

    /// `n` starts by systematic resampling: the expected number of starts at a sample is proportional to its weight.
    pub(super) fn starts(&self, n: u32, u: f32) -> Vec<ChainStart> {
        let total: f64 = self.found.iter().map(|f| f64::from(f.1)).sum();
        let mut starts = Vec::with_capacity(n as usize);
        let (mut sum, mut next) = (0.0, f64::from(u));
        for (start, weight) in &self.found {
            sum += f64::from(*weight) / total * f64::from(n);
            while next < sum && starts.len() < n as usize {
                starts.push(*start);
                next += 1.0;
            }
        }
        // Rounding may leave the last one out.
        if let Some((start, _)) = self.found.last() {
            starts.resize(n as usize, *start);
        }
        starts
    }
}
