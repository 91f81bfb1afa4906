//! The flat neighbour list: one row of pairs a real particle, stored chunk by chunk.

use super::Grid;
use crate::parallel::{CHUNK, vectorised};
use crate::particles::{ParticleKind, Particles};
use rayon::prelude::*;

/// Type of the one number stored a pair.
#[cfg(not(feature = "double-slopes"))]
pub type Slope = f32;
#[cfg(feature = "double-slopes")]
pub type Slope = f64;

/// A neighbour j of the row's particle i.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Pair {
    /// V_j (dW/dr)/r, so that V_j ∇_i W_ij = slope · r_ij. Never positive.
    pub slope: Slope,
    index: u32,
}

impl Pair {
    #[inline(always)]
    pub fn j(&self) -> usize {
        self.index as usize
    }

    #[inline(always)]
    pub fn slope(&self) -> f64 {
        f64::from(self.slope)
    }
}

/// The neighbours of one particle: those that flow, then the solid ones.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    pairs: &'a [Pair],
    flowing: usize,
}

impl<'a> Row<'a> {
    #[inline(always)]
    pub fn all(&self) -> &'a [Pair] {
        self.pairs
    }

    /// Fluid and buffer neighbours.
    #[inline(always)]
    pub fn flowing(&self) -> &'a [Pair] {
        &self.pairs[..self.flowing]
    }

    #[inline(always)]
    pub fn solid(&self) -> &'a [Pair] {
        &self.pairs[self.flowing..]
    }
}

#[derive(Debug, Default)]
struct Chunk {
    pairs: Vec<Pair>,
    /// Start of each row and of its solid part, and the end.
    starts: Vec<[u32; 2]>,
    /// Neighbours of the row in the making.
    near: Vec<u32>,
}

impl Chunk {
    #[inline(always)]
    fn row(&self, k: usize) -> Row<'_> {
        let [start, solid] = self.starts[k];
        Row { pairs: &self.pairs[start as usize..self.starts[k + 1][0] as usize], flowing: (solid - start) as usize }
    }

    #[inline(always)]
    fn search<const D: usize>(
        &mut self,
        rows: std::ops::Range<usize>,
        particles: &Particles<D>,
        grid: &Grid<D>,
        radius: f64,
    ) {
        let blank = |&index: &u32| Pair { slope: 0.0, index };
        let solid = |j: &u32| particles.kind[*j as usize] == ParticleKind::Solid;
        self.pairs.clear();
        self.starts.clear();
        for i in rows {
            let start = self.pairs.len() as u32;
            let near = find(particles, grid, radius, i, &mut self.near);
            if near.iter().any(solid) {
                self.pairs.extend(near.iter().filter(|j| !solid(j)).map(blank));
                self.starts.push([start, self.pairs.len() as u32]);
                self.pairs.extend(near.iter().filter(|j| solid(j)).map(blank));
            } else {
                self.pairs.extend(near.iter().map(blank));
                self.starts.push([start, self.pairs.len() as u32]);
            }
        }
        self.starts.push([self.pairs.len() as u32; 2]);
    }
}

/// The indices of all others within `radius` of particle `i`, collected at the front of `near`, which only ever grows.
#[inline(always)]
fn find<'a, const D: usize>(
    particles: &Particles<D>,
    grid: &Grid<D>,
    radius: f64,
    i: usize,
    near: &'a mut Vec<u32>,
) -> &'a [u32] {
    const BATCH: usize = 32;
    let point = particles.position[i];
    let square = radius * radius;
    let mut count = 0;
    grid.for_each_run(&point, |run| {
        let length = run.indices.len();
        if near.len() < count + length {
            near.resize(2 * (count + length), 0);
        }
        for start in (0..length).step_by(BATCH) {
            let end = (start + BATCH).min(length);
            let mut squares = [0.0; BATCH];
            for axis in 0..D {
                for (sum, x) in squares.iter_mut().zip(&run.coordinates[axis][start..end]) {
                    *sum += (x - point[axis]) * (x - point[axis]);
                }
            }
            // Every candidate is written, and the next one overwrites it unless it counts: a branch would be mispredicted.
            for (&j, distance) in run.indices[start..end].iter().zip(squares) {
                near[count] = j;
                count += usize::from((distance < square) & (j as usize != i));
            }
        }
    });
    &near[..count]
}

#[derive(Debug, Default)]
pub struct NeighbourList {
    chunks: Vec<Chunk>,
}

impl NeighbourList {
    /// List the neighbours within `radius` of every real particle. The slopes are left blank.
    pub fn search<const D: usize>(&mut self, particles: &Particles<D>, grid: &Grid<D>, radius: f64) {
        let rows = particles.real;
        self.chunks.resize_with(rows.div_ceil(CHUNK), Chunk::default);
        self.chunks.par_iter_mut().enumerate().for_each(|(c, chunk)| {
            let rows = c * CHUNK..((c + 1) * CHUNK).min(rows);
            vectorised(
                #[inline(always)]
                || chunk.search(rows, particles, grid, radius),
            );
        });
    }

    /// `f(i, row, &mut a[i], &mut b[i])` for every row, in parallel. Mark `f` `#[inline(always)]`, see [`vectorised`].
    pub fn for_each<A: Send, B: Send>(
        &self,
        a: &mut [A],
        b: &mut [B],
        f: impl Fn(usize, Row<'_>, &mut A, &mut B) + Sync + Send,
    ) {
        let outputs = a.par_chunks_mut(CHUNK).zip(b.par_chunks_mut(CHUNK));
        self.chunks.par_iter().zip(outputs).enumerate().for_each(|(c, (chunk, (a, b)))| {
            vectorised(
                #[inline(always)]
                || {
                    for (k, (a, b)) in a.iter_mut().zip(b).enumerate() {
                        f(c * CHUNK + k, chunk.row(k), a, b);
                    }
                },
            );
        });
    }

    /// Fill the pairs of every row in parallel.
    pub fn for_each_mut<A: Send, B: Send>(
        &mut self,
        a: &mut [A],
        b: &mut [B],
        f: impl Fn(usize, &mut [Pair], &mut A, &mut B) + Sync + Send,
    ) {
        let outputs = a.par_chunks_mut(CHUNK).zip(b.par_chunks_mut(CHUNK));
        self.chunks.par_iter_mut().zip(outputs).enumerate().for_each(|(c, (chunk, (a, b)))| {
            vectorised(
                #[inline(always)]
                || {
                    for (k, (a, b)) in a.iter_mut().zip(b).enumerate() {
                        let range = chunk.starts[k][0] as usize..chunk.starts[k + 1][0] as usize;
                        f(c * CHUNK + k, &mut chunk.pairs[range], a, b);
                    }
                },
            );
        });
    }

    /// The row of particle `i`.
    pub fn row(&self, i: usize) -> Row<'_> {
        self.chunks[i / CHUNK].row(i % CHUNK)
    }

    /// Directed pairs in the list.
    pub fn pair_count(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.pairs.len()).sum()
    }
}
