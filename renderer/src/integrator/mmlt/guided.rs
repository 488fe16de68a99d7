use crate::sampling::{Guide, MAX_GUIDED, PrimarySpace, PrimaryStream, Sampler, StepSizes, Stream};
use crate::math::Vec2;

/// Vertices of a walk whose numbers are guided, its start among them.
const BLOCKS: usize = 3;

/// Where the numbers of the blocks end: of a walk from the light (its point and direction, then four for each vertex) and of one from
/// the camera (the raster position, then the same).
pub const LIGHT_ENDS: [usize; BLOCKS] = [5, 9, 13];
/// See [`LIGHT_ENDS`].
pub const CAMERA_ENDS: [usize; BLOCKS] = [2, 6, 10];

/// The guided numbers of a walk's first vertices.
#[derive(Clone, Copy, Debug)]
pub struct GuidedNumbers {
    numbers: [f32; MAX_GUIDED],
    ends: &'static [usize; BLOCKS],
    /// How many blocks are drawn.
    blocks: usize,
    /// By number of blocks.
    densities: [f32; BLOCKS + 1],
}

impl GuidedNumbers {
    /// Those of a walk of `vertices` vertices (where there are media, how far the last flight comes is a number of the last).
    #[inline]
    pub fn draw(guide: &Guide, space: &mut PrimarySpace, stream: Stream, sizes: &StepSizes, vertices: usize) -> Self {
        let ends = if stream == Stream::Camera { &CAMERA_ENDS } else { &LIGHT_ENDS };
        let mut densities = [1.0; BLOCKS + 1];
        if guide.is_uniform() {
            return Self { numbers: [0.0; MAX_GUIDED], ends, blocks: 0, densities };
        }
        let blocks = vertices.min(BLOCKS);
        let mut numbers = space.blocks(stream, &ends[..blocks], sizes);
        guide.warp(&mut numbers, &ends[..blocks], &mut densities);
        Self { numbers, ends, blocks, densities }
    }

    /// Density of what a walk of `vertices` vertices is made from.
    #[inline]
    pub fn density(&self, vertices: usize) -> f32 {
        self.densities[vertices.min(self.blocks)]
    }

    /// The raster position, in units of the picture's size.
    #[inline]
    pub fn raster(&self) -> Option<Vec2> {
        (self.blocks > 0).then(|| Vec2::new(self.numbers[0], self.numbers[1]))
    }
}

/// A stream whose first blocks are guided.
#[derive(Debug)]
pub struct GuidedStream<'a> {
    /// The numbers as they are.
    pub stream: PrimaryStream<'a>,
    /// Those that stand in for the first of them.
    pub guided: &'a GuidedNumbers,
    /// Next of those, and the end of the block.
    at: usize,
    end: usize,
}

impl<'a> GuidedStream<'a> {
    /// At no vertex yet.
    #[inline]
    pub fn new(stream: PrimaryStream<'a>, guided: &'a GuidedNumbers) -> Self {
        Self { stream, guided, at: 0, end: 0 }
    }
}

impl Sampler for GuidedStream<'_> {
    #[inline]
    fn next_1d(&mut self) -> f32 {
        if self.at == self.end {
            return self.stream.next_1d();
        }
        self.at += 1;
        self.stream.skip();
        self.guided.numbers[self.at - 1]
    }

    #[inline]
    fn next_2d(&mut self) -> Vec2 {
        let x = self.next_1d();
        Vec2::new(x, self.next_1d())
    }

    #[inline]
    fn start_vertex(&mut self, vertex: u32) {
        self.stream.start_vertex(vertex);
        let block = vertex as usize;
        let ends = self.guided.ends;
        (self.at, self.end) = match block {
            b if b >= self.guided.blocks => (0, 0),
            0 => (0, ends[0]),
            b => (ends[b - 1], ends[b]),
        };
    }
}
