//! The flat neighbour list: one row of pairs a real particle, stored chunk by chunk.

use super::Grid;
use crate::parallel::{CHUNK, vectorised};
use crate::particles::{ParticleKind, Particles};
use rayon::prelude::*;

/// Type of the stored pair weights.
#[cfg(not(feature = "double-weights"))]
pub type Weight = f32;
#[cfg(feature = "double-weights")]
pub type Weight = f64;

/// A neighbour and the weights with which its differences enter the derivatives at the row's particle.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Pair<const D: usize> {
    /// ∇f_i = Σ gradient (f_j − f_i): the corrected V_j ∇_i W_ij.
    pub gradient: [Weight; D],
    /// ∇²f_i = Σ laplacian (f_j − f_i).
    pub laplacian: Weight,
    /// j.
    pub index: u32,
}

impl<const D: usize> Pair<D> {
    #[inline(always)]
    pub fn j(&self) -> usize {
        self.index as usize
    }
}

/// The neighbours of one particle: those that flow, then the solid ones.
#[derive(Clone, Copy)]
pub struct Row<'a, const D: usize> {
    pairs: &'a [Pair<D>],
    flowing: usize,
}

impl<'a, const D: usize> Row<'a, D> {
    #[inline(always)]
    pub fn all(&self) -> &'a [Pair<D>] {
        self.pairs
    }

    /// Fluid and buffer neighbours.
    #[inline(always)]
    pub fn flowing(&self) -> &'a [Pair<D>] {
        &self.pairs[..self.flowing]
    }

    #[inline(always)]
    pub fn solid(&self) -> &'a [Pair<D>] {
        &self.pairs[self.flowing..]
    }
}

#[derive(Debug, Default)]
struct Chunk<const D: usize> {
    pairs: Vec<Pair<D>>,
    /// Start of each row and of its solid part, and the end.
    starts: Vec<[u32; 2]>,
    /// Neighbours of the row in the making.
    near: Vec<u32>,
}

impl<const D: usize> Chunk<D> {
    #[inline(always)]
    fn row(&self, k: usize) -> Row<'_, D> {
        let [start, solid] = self.starts[k];
        Row { pairs: &self.pairs[start as usize..self.starts[k + 1][0] as usize], flowing: (solid - start) as usize }
    }

    #[inline(always)]
    fn search(&mut self, rows: std::ops::Range<usize>, particles: &Particles<D>, grid: &Grid<D>, radius: f64) {
        let blank = |&index: &u32| Pair { gradient: [0.0; D], laplacian: 0.0, index };
        let solid = |j: &u32| particles.kind[*j as usize] == ParticleKind::Solid;
        self.pairs.clear();
        self.starts.clear();
        for i in rows {
            let start = self.pairs.len() as u32;
            find(particles, grid, radius, i, &mut self.near);
            self.pairs.extend(self.near.iter().filter(|j| !solid(j)).map(blank));
            self.starts.push([start, self.pairs.len() as u32]);
            if self.pairs.len() < start as usize + self.near.len() {
                self.pairs.extend(self.near.iter().filter(|j| solid(j)).map(blank));
            }
        }
        self.starts.push([self.pairs.len() as u32; 2]);
    }
}

/// Collect in `near` the indices of all others within `radius` of particle `i`.
#[inline(always)]
fn find<const D: usize>(particles: &Particles<D>, grid: &Grid<D>, radius: f64, i: usize, near: &mut Vec<u32>) {
    const BATCH: usize = 32;
    let point = particles.position[i];
    let square = radius * radius;
    near.clear();
    grid.for_each_run(&point, |points, indices| {
        for (points, indices) in points.chunks(BATCH).zip(indices.chunks(BATCH)) {
            let mut within = [false; BATCH];
            for (within, candidate) in within.iter_mut().zip(points) {
                *within = (candidate - point).norm_squared() < square;
            }
            // Every candidate is written, and the next one overwrites it unless it counts: a branch would be mispredicted.
            let mut found = [0; BATCH];
            let mut count = 0;
            for (&j, within) in indices.iter().zip(within) {
                found[count % BATCH] = j;
                count += usize::from(within & (j as usize != i));
            }
            near.extend_from_slice(&found[..count]);
        }
    });
}

#[derive(Debug, Default)]
pub struct NeighbourList<const D: usize> {
    chunks: Vec<Chunk<D>>,
}

impl<const D: usize> NeighbourList<D> {
    /// List the neighbours within `radius` of every real particle. The weights are left blank.
    pub fn search(&mut self, particles: &Particles<D>, grid: &Grid<D>, radius: f64) {
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
        f: impl Fn(usize, Row<D>, &mut A, &mut B) + Sync + Send,
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

    /// `f(i, row, &mut out[i])` for every row, in parallel. Mark `f` `#[inline(always)]`, see [`vectorised`].
    pub fn for_each_one<A: Send>(&self, out: &mut [A], f: impl Fn(usize, Row<D>, &mut A) + Sync + Send) {
        // A vector of () takes no memory.
        let mut nothing = vec![(); out.len()];
        self.for_each(
            out,
            &mut nothing,
            #[inline(always)]
            |i, row, out, ()| f(i, row, out),
        );
    }

    /// Fill the pairs of every row in parallel.
    pub fn for_each_mut<A: Send, B: Send>(
        &mut self,
        a: &mut [A],
        b: &mut [B],
        f: impl Fn(usize, &mut [Pair<D>], &mut A, &mut B) + Sync + Send,
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
    pub fn row(&self, i: usize) -> Row<'_, D> {
        self.chunks[i / CHUNK].row(i % CHUNK)
    }

    /// Directed pairs in the list.
    pub fn pair_count(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.pairs.len()).sum()
    }
}
