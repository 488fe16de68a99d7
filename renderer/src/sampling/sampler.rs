use crate::math::Vec2;

/// The source of a path's numbers in [0, 1): a pure function of (seed, replicate, pixel or path, sample index, dimension).
///
/// Integrators are generic over it, so that the same walk is driven by Sobol points or by a chain's primary-sample vector.
pub trait Sampler {
    /// The next number.
    fn next_1d(&mut self) -> f32;
    /// The next two numbers, well distributed in the unit square.
    fn next_2d(&mut self) -> Vec2;
    /// One number, then two: those that [`Sampler::next_1d`] and [`Sampler::next_2d`] would give.
    #[inline]
    fn next_3(&mut self) -> (f32, Vec2) {
        (self.next_1d(), self.next_2d())
    }
    /// Passes over a number that nobody looks at.
    #[inline]
    fn skip_1d(&mut self) {
        self.next_1d();
    }
    /// Moves on to the block of numbers that belongs to a vertex (1, 2, ...), whatever was used before: what happens at one vertex
    /// does not shift the numbers of the next. A vertex uses at most eight calls.
    fn start_vertex(&mut self, vertex: u32);
}
