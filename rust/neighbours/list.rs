//! The neighbour list: four particles that follow each other share one row, because they have most neighbours in common and a
//! loop over the row then computes all four at once. Rows are stored chunk by chunk.

use super::Grid;
use crate::base::Vector;
use crate::base::lanes::{LANES, Lanes, Task, from, norm_squared, run};
use crate::base::parallel::CHUNK;
use crate::particles::{ParticleKind, Particles};
use rayon::prelude::*;
use std::ops::Range;

/// Most chunks in a task, so that a thread that falls behind leaves little to wait for.
const TASK: usize = 8;

const _: () = assert!(CHUNK.is_multiple_of(LANES));

/// A neighbour j of one or more particles i of a cluster.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Entry {
    /// V_j (dW/dr)/r for each i, so that V_j ∇_i W_ij = slope · r_ij. Never positive, and zero beyond the support.
    pub slopes: [f32; LANES],
    index: u32,
}

impl Entry {
    #[inline(always)]
    pub fn j(&self) -> usize {
        self.index as usize
    }

    #[inline(always)]
    pub fn slope(&self, lane: usize) -> f64 {
        f64::from(self.slopes[lane])
    }

    #[inline(always)]
    pub fn slopes<V: Lanes>(&self) -> V {
        V::load_single(&self.slopes)
    }

    #[inline(always)]
    pub fn set_slopes<V: Lanes>(&mut self, slopes: V) {
        self.slopes = slopes.store_single();
    }
}

/// The neighbours of a cluster, itself included: those that flow, then the solid ones.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    entries: &'a [Entry],
    flowing: usize,
    chunk: &'a Chunk,
    number: usize,
}

impl<'a> Row<'a> {
    #[inline(always)]
    pub fn all(&self) -> &'a [Entry] {
        self.entries
    }

    /// Fluid and buffer neighbours.
    #[inline(always)]
    pub fn flowing(&self) -> &'a [Entry] {
        &self.entries[..self.flowing]
    }

    #[inline(always)]
    pub fn solid(&self) -> &'a [Entry] {
        &self.entries[self.flowing..]
    }

    /// How much of each neighbour each particle of the cluster sees; empty if all of them see all.
    #[inline(always)]
    pub fn shares(&self) -> &'a [[f32; LANES]] {
        shares_of(&self.chunk.shares, &self.chunk.shared, self.number)
    }

    /// The flowing neighbours that the particle of a lane sees any of, and how much.
    pub fn flowing_seen(&self, lane: usize) -> impl Iterator<Item = (Entry, f64)> + use<'a> {
        self.seen(0..self.flowing, lane)
    }

    /// The solid neighbours that the particle of a lane sees any of, and how much.
    pub fn solid_seen(&self, lane: usize) -> impl Iterator<Item = (Entry, f64)> + use<'a> {
        self.seen(self.flowing..self.entries.len(), lane)
    }

    fn seen(&self, range: Range<usize>, lane: usize) -> impl Iterator<Item = (Entry, f64)> + use<'a> {
        let (entries, shares) = (self.entries, self.shares());
        let share = move |k| shares.get(k).map_or(1.0, |shares: &[f32; LANES]| f64::from(shares[lane]));
        range.map(move |k| (entries[k], share(k))).filter(|(_, share)| *share > 0.0)
    }
}

/// A row to be changed.
#[derive(Debug)]
pub struct RowMut<'a> {
    pub entries: &'a mut [Entry],
    /// Number of flowing neighbours, which come first.
    pub flowing: usize,
    /// [`Row::shares`].
    pub shares: &'a [[f32; LANES]],
}

/// Up to four particles that follow each other in the arrays.
#[derive(Clone, Copy, Debug)]
pub struct Cluster {
    pub first: usize,
    pub count: usize,
}

impl Cluster {
    /// The particle of each lane. Surplus lanes repeat the last particle.
    #[inline(always)]
    pub fn particles(&self) -> [usize; LANES] {
        std::array::from_fn(|lane| self.first + lane.min(self.count - 1))
    }

    /// `value` of the particle of each lane.
    #[inline(always)]
    pub fn lanes<V: Lanes>(&self, value: impl Fn(usize) -> f64) -> V {
        V::load(&self.particles().map(value))
    }

    /// A vector field at the particle of each lane.
    #[inline(always)]
    pub fn vectors<V: Lanes, const D: usize>(&self, field: &[Vector<D>]) -> [V; D] {
        let mut vectors = [V::zero(); D];
        for axis in 0..D {
            vectors[axis] = self.lanes(|i| field[i][axis]);
        }
        vectors
    }
}

/// Work on one cluster after the other, such as an operator and what is done with its values; `a` and `b` are the outputs of its
/// particles.
pub trait Visit<A, B>: Sync {
    fn visit<V: Lanes>(&self, cluster: Cluster, row: Row<'_>, a: &mut [A], b: &mut [B]);
}

/// Work that changes the rows.
pub trait VisitMut<A, B, C>: Sync {
    fn visit<V: Lanes>(&self, cluster: Cluster, row: RowMut<'_>, outputs: (&mut [A], &mut [B], &mut [C]));
}

#[derive(Debug, Default)]
struct Chunk {
    entries: Vec<Entry>,
    /// Start of each row and of its solid part, and the end.
    starts: Vec<[u32; 2]>,
    /// Number of its particles.
    count: usize,
    /// Neighbours of the row in the making.
    near: Vec<u32>,
    /// The shares of the rows that have some, and where those of each row start and end; empty if every particle sees all.
    shares: Vec<[f32; LANES]>,
    shared: Vec<[u32; 2]>,
}

impl Chunk {
    #[inline(always)]
    fn range(&self, row: usize) -> Range<usize> {
        self.starts[row][0] as usize..self.starts[row + 1][0] as usize
    }

    #[inline(always)]
    fn row(&self, row: usize) -> Row<'_> {
        let [start, solid] = self.starts[row];
        Row { entries: &self.entries[self.range(row)], flowing: (solid - start) as usize, chunk: self, number: row }
    }

    #[inline(always)]
    fn row_mut(&mut self, row: usize) -> RowMut<'_> {
        let ([start, solid], range) = (self.starts[row], self.range(row));
        let shares = shares_of(&self.shares, &self.shared, row);
        RowMut { entries: &mut self.entries[range], flowing: (solid - start) as usize, shares }
    }
}

#[inline(always)]
fn shares_of<'a>(shares: &'a [[f32; LANES]], shared: &[[u32; 2]], row: usize) -> &'a [[f32; LANES]] {
    shared.get(row).map_or(&[], |&[start, end]| &shares[start as usize..end as usize])
}

#[derive(Debug, Default)]
pub struct NeighbourList {
    chunks: Vec<Chunk>,
}

impl NeighbourList {
    /// List for every cluster of real particles all that lie within `radius` of one of them, or will when they are at the
    /// positions `expected`. `grid` must reach all of these. The slopes are left blank.
    pub fn search<const D: usize>(
        &mut self,
        particles: &Particles<D>,
        expected: Option<&[Vector<D>]>,
        grid: &Grid<D>,
        radius: f64,
    ) {
        let real = particles.real;
        self.chunks.resize_with(real.div_ceil(CHUNK), Chunk::default);
        self.chunks.par_iter_mut().enumerate().with_max_len(TASK).for_each(|(c, chunk)| {
            let start = c * CHUNK;
            run(Search { chunk, start, count: CHUNK.min(real - start), particles, expected, grid, radius });
        });
    }

    /// Let `shares` add to a vector what each particle of a cluster sees of each neighbour, or nothing if that is all of it; with
    /// `all` every particle sees all.
    pub fn share_out(&mut self, all: bool, shares: impl Fn(Cluster, &[Entry], &mut Vec<[f32; LANES]>) + Sync) {
        self.chunks.par_iter_mut().enumerate().with_max_len(TASK).for_each(|(c, chunk)| {
            chunk.shares.clear();
            chunk.shared.clear();
            for row in 0..if all { 0 } else { chunk.starts.len() - 1 } {
                let cluster =
                    Cluster { first: c * CHUNK + row * LANES, count: chunk.count.min((row + 1) * LANES) - row * LANES };
                let (start, range) = (chunk.shares.len() as u32, chunk.range(row));
                shares(cluster, &chunk.entries[range], &mut chunk.shares);
                chunk.shared.push([start, chunk.shares.len() as u32]);
            }
        });
    }

    /// Visit every cluster in parallel.
    pub fn for_each<A: Send, B: Send>(&self, a: &mut [A], b: &mut [B], visitor: impl Visit<A, B>) {
        struct Pass<'a, A, B, W>(&'a Chunk, usize, &'a mut [A], &'a mut [B], &'a W);

        impl<A, B, W: Visit<A, B>> Task for Pass<'_, A, B, W> {
            #[inline(always)]
            fn run<V: Lanes>(self) {
                let Self(chunk, start, a, b, visitor) = self;
                let outputs = a.chunks_mut(LANES).zip(b.chunks_mut(LANES));
                for (row, (a, b)) in outputs.enumerate() {
                    let cluster = Cluster { first: start + row * LANES, count: a.len() };
                    visitor.visit::<V>(cluster, chunk.row(row), a, b);
                }
            }
        }

        let outputs = a.par_chunks_mut(CHUNK).zip(b.par_chunks_mut(CHUNK));
        self.chunks.par_iter().zip(outputs).enumerate().with_max_len(TASK).for_each(|(c, (chunk, (a, b)))| {
            run(Pass(chunk, c * CHUNK, a, b, &visitor));
        });
    }

    /// Visit every cluster in parallel and change its row.
    pub fn for_each_mut<A: Send, B: Send, C: Send>(
        &mut self,
        (a, b, c): (&mut [A], &mut [B], &mut [C]),
        visitor: impl VisitMut<A, B, C>,
    ) {
        struct Pass<'a, A, B, C, W>(&'a mut Chunk, usize, (&'a mut [A], &'a mut [B], &'a mut [C]), &'a W);

        impl<A, B, C, W: VisitMut<A, B, C>> Task for Pass<'_, A, B, C, W> {
            #[inline(always)]
            fn run<V: Lanes>(self) {
                let Self(chunk, start, (a, b, c), visitor) = self;
                let outputs = a.chunks_mut(LANES).zip(b.chunks_mut(LANES)).zip(c.chunks_mut(LANES));
                for (row, ((a, b), c)) in outputs.enumerate() {
                    let cluster = Cluster { first: start + row * LANES, count: a.len() };
                    visitor.visit::<V>(cluster, chunk.row_mut(row), (a, b, c));
                }
            }
        }

        let outputs = a.par_chunks_mut(CHUNK).zip(b.par_chunks_mut(CHUNK)).zip(c.par_chunks_mut(CHUNK));
        self.chunks.par_iter_mut().zip(outputs).enumerate().with_max_len(TASK).for_each(|(k, (chunk, ((a, b), c)))| {
            run(Pass(chunk, k * CHUNK, (a, b, c), &visitor));
        });
    }

    /// The row of the cluster of particle `i`, and its lane there.
    pub fn row(&self, i: usize) -> (Row<'_>, usize) {
        (self.chunks[i / CHUNK].row(i % CHUNK / LANES), i % LANES)
    }

    /// Directed pairs of the real particles that are closer than `radius`.
    pub fn pair_count<const D: usize>(&self, particles: &Particles<D>, radius: f64) -> usize {
        let position = &particles.position;
        let near = |i: usize, j: usize| i != j && (position[i] - position[j]).norm_squared() < radius * radius;
        (0..particles.real).map(|i| self.row(i).0.all().iter().filter(|entry| near(i, entry.j())).count()).sum()
    }

    /// Entries in the list, each for up to four pairs.
    pub fn entry_count(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.entries.len()).sum()
    }
}

/// The search of one chunk.
struct Search<'a, const D: usize> {
    chunk: &'a mut Chunk,
    start: usize,
    count: usize,
    particles: &'a Particles<D>,
    expected: Option<&'a [Vector<D>]>,
    grid: &'a Grid<D>,
    radius: f64,
}

impl<const D: usize> Task for Search<'_, D> {
    #[inline(always)]
    fn run<V: Lanes>(self) {
        self.chunk.count = self.count;
        let Chunk { entries, starts, near, .. } = self.chunk;
        let blank = |&index: &u32| Entry { slopes: [0.0; LANES], index };
        let solid = |j: &u32| self.particles.kind[*j as usize] == ParticleKind::Solid;
        entries.clear();
        starts.clear();
        for offset in (0..self.count).step_by(LANES) {
            let cluster = Cluster { first: self.start + offset, count: LANES.min(self.count - offset) };
            let start = entries.len() as u32;
            let here: [V; D] = cluster.vectors(&self.particles.position);
            let limit = V::splat(self.radius * self.radius);
            let points = cluster.particles().map(|i| self.particles.position[i]);
            let near = if let Some(expected) = self.expected {
                let there: [V; D] = cluster.vectors(expected);
                find(
                    &points,
                    self.grid,
                    near,
                    #[inline(always)]
                    |j, position| {
                        let (now, then) = (norm_squared(from(here, &position)), norm_squared(from(there, &expected[j])));
                        now.least(then).any_below(limit)
                    },
                )
            } else {
                find(
                    &points,
                    self.grid,
                    near,
                    #[inline(always)]
                    |_, position| norm_squared(from(here, &position)).any_below(limit),
                )
            };
            if near.iter().any(solid) {
                entries.extend(near.iter().filter(|j| !solid(j)).map(blank));
                starts.push([start, entries.len() as u32]);
                entries.extend(near.iter().filter(|j| solid(j)).map(blank));
            } else {
                entries.extend(near.iter().map(blank));
                starts.push([start, entries.len() as u32]);
            }
        }
        starts.push([entries.len() as u32; 2]);
        // A vector that grew holds up to twice what it needs.
        if entries.capacity() > entries.len() + entries.len() / 4 {
            entries.shrink_to(entries.len() + entries.len() / 8);
        }
    }
}

/// The indices of all that may lie around `points` and for which `counts(j, position of j)` holds, collected at the front of
/// `near`, which only ever grows.
#[inline(always)]
fn find<'a, const D: usize>(
    points: &[Vector<D>; LANES],
    grid: &Grid<D>,
    near: &'a mut Vec<u32>,
    counts: impl Fn(usize, Vector<D>) -> bool,
) -> &'a [u32] {
    let mut count = 0;
    grid.for_each_run(
        points,
        #[inline(always)]
        |run| {
            let length = run.indices.len();
            if near.len() < count + length {
                near.resize(2 * (count + length), 0);
            }
            let (slots, coordinates) = (&mut near[count..][..length], run.coordinates.map(|x| &x[..length]));
            let mut found = 0;
            for (k, &j) in run.indices.iter().enumerate() {
                // Every candidate is written, and the next one overwrites it unless it counts: a branch would be mispredicted.
                slots[found] = j;
                found += usize::from(counts(j as usize, Vector::from_fn(|axis, _| coordinates[axis][k])));
            }
            count += found;
        },
    );
    &near[..count]
}
