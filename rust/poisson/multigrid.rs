//! Geometric multigrid on a Cartesian background grid: what takes off the long waves of a residual that sums over neighbours hardly see.
//!
//! Cells are about 2 Δx wide. Those that hold fluid are coupled by the finite-volume Laplacian, as far as both are full; what flows into
//! cells without any counts as a wall, those of outlets have the pressure zero. The residual of the particles of a cell is its source, in
//! proportion to their volumes, and the solution comes back to the particles by linear interpolation between the centres of cells with fluid.

use crate::base::Vector;
use crate::base::parallel;
use crate::neighbours::{Cells, flat};
use crate::particles::Particles;
use crate::poisson::row::Row;
use crate::settings::{Boundary, Settings};

/// Width of the cells of the finest grid over Δx.
const WIDTH: f64 = 2.0;

/// A cell filled less than this is taken for empty.
const EMPTY: f64 = 0.05;

/// How much farther the centres of two cells are apart than that of one from the first particles in the other.
const NEARER: f64 = WIDTH / (0.5 * WIDTH + 0.5);

/// How much nearer the centre of a cell is to where the pressure is zero than that of the next coarser one.
const FARTHER: f64 = 0.6;

/// Damping of the Jacobi iteration that smooths, and how often it does before and after the coarser grid's correction.
const DAMPING: f64 = 0.8;
const SWEEPS: usize = 3;

/// The coarsest grid has no more cells than this, and is solved by so many sweeps.
const COARSEST: usize = 16;
const COARSEST_SWEEPS: usize = 24;

#[derive(Debug)]
pub struct Multigrid<const D: usize> {
    lower: Vector<D>,
    width: Vector<D>,
    /// Particles with a row of the equation by cell; the others are in one cell more.
    cells: Cells,
    cell_of: Vec<u32>,
    /// From the finest to the coarsest.
    levels: Vec<Level<D>>,
}

impl<const D: usize> Default for Multigrid<D> {
    fn default() -> Self {
        let (cells, levels) = (Cells::default(), Vec::new());
        Self { lower: Vector::zeros(), width: Vector::repeat(1.0), cells, cell_of: Vec::new(), levels }
    }
}

/// One grid. All fields by cell, the first direction fastest.
#[derive(Debug)]
struct Level<const D: usize> {
    counts: [usize; D],
    periodic: [bool; D],
    /// The cell before and the one after in each direction; itself at an end.
    beside: Vec<[[u32; 2]; D]>,
    /// What the faces to them let through; zero at an end.
    faces: Vec<[[f64; 2]; D]>,
    /// Whether a cell is one of zero pressure.
    zero: Vec<bool>,
    /// What the faces to such cells let through.
    outlet: Vec<f64>,
    /// The sum of all these; zero of an empty cell.
    diagonal: Vec<f64>,
    source: Vec<f64>,
    value: Vec<f64>,
    other: Vec<f64>,
}

impl<const D: usize> Multigrid<D> {
    /// Lay the grids for particles with these `rows`.
    pub fn build(&mut self, settings: &Settings, particles: &Particles<D>, volume: &[f64], rows: &[Row]) {
        let domain = &settings.domain;
        let buffer = |kind: Boundary| match kind {
            Boundary::Inlet | Boundary::Outlet => settings.buffer_length(),
            _ => 0.0,
        };
        self.lower = Vector::from_fn(|axis, _| domain.lower[axis] - buffer(domain.boundaries[axis][0]));
        let upper = Vector::<D>::from_fn(|axis, _| domain.upper[axis] + buffer(domain.boundaries[axis][1]));
        let extent = upper - self.lower;
        let counts: [usize; D] =
            std::array::from_fn(|axis| ((extent[axis] / (WIDTH * settings.particle_spacing)).round() as usize).max(1));
        let periodic = std::array::from_fn(|axis| domain.boundaries[axis][0] == Boundary::Periodic);
        self.width = Vector::from_fn(|axis, _| extent[axis] / counts[axis] as f64);
        if self.levels.first().map(|level| (level.counts, level.periodic)) != Some((counts, periodic)) {
            self.levels = vec![Level::new(counts, periodic)];
            while let Some(level) = self.levels.last().filter(|level| level.count() > COARSEST) {
                let coarser = Level::new(level.counts.map(|n| n.div_ceil(2)), periodic);
                self.levels.push(coarser);
            }
        }
        let count = counts.iter().product::<usize>();
        let mut cell_of = std::mem::take(&mut self.cell_of);
        cell_of.resize(particles.real, 0);
        parallel::for_each(&mut cell_of, |i, cell| {
            *cell = if rows[i] == Row::None { count } else { self.cell(&particles.position[i]) } as u32;
        });
        self.cells.sort(&cell_of, count + 1, &particles.id);
        self.cell_of = cell_of;
        let whole = self.width.product();
        let filled = |row: Row, cell: usize| {
            let filled = self.cells.of(cell).filter(|&i| rows[i] == row).map(|i| volume[i]).sum::<f64>() / whole;
            if filled < EMPTY { 0.0 } else { filled.min(1.0) }
        };
        let mut shares = vec![[0.0; 2]; count];
        parallel::for_each(&mut shares, |cell, share| {
            let [fluid, zero] = [filled(Row::Solved, cell), filled(Row::Zero, cell)];
            *share = if zero > fluid { [0.0, zero] } else { [fluid, 0.0] };
        });
        let area = self.width.map(|width| whole / (width * width));
        let (finest, coarser) = self.levels.split_at_mut(1);
        finest[0].couple(&shares, &area);
        let mut finer = &finest[0];
        for level in coarser {
            level.agglomerate(finer);
            finer = level;
        }
    }

    fn cell(&self, position: &Vector<D>) -> usize {
        let counts = self.levels[0].counts;
        let cell = (position - self.lower).component_div(&self.width);
        flat(std::array::from_fn(|axis| (cell[axis].max(0.0) as usize).min(counts[axis] - 1)), counts)
    }

    /// Set `correction` to about the solution of −∇²x = `residual` by one V-cycle. Of a `closed` domain the source has no mean.
    pub fn correct(
        &mut self,
        position: &[Vector<D>],
        volume: &[f64],
        residual: &[f64],
        closed: bool,
        correction: &mut [f64],
    ) {
        let cells = &self.cells;
        parallel::for_each(&mut self.levels[0].source, |cell, source| {
            *source = cells.of(cell).map(|i| volume[i] * residual[i]).sum();
        });
        cycle(&mut self.levels, closed);
        let this = &*self;
        parallel::for_each(correction, |i, out| {
            *out = if (this.cell_of[i] as usize) < this.levels[0].count() { this.interpolate(&position[i]) } else { 0.0 };
        });
    }

    /// The finest grid's value between the centres of the cells around.
    fn interpolate(&self, position: &Vector<D>) -> f64 {
        let level = &self.levels[0];
        let place = (position - self.lower).component_div(&self.width).add_scalar(-0.5);
        let base = place.map(f64::floor);
        let share = place - base;
        level.mean(|axis, above| {
            let cell = base[axis] as i64 + above as i64;
            (level.within(axis, cell), if above { share[axis] } else { 1.0 - share[axis] })
        })
    }
}

/// One V-cycle from zero.
fn cycle<const D: usize>(levels: &mut [Level<D>], closed: bool) {
    let Some((level, coarser)) = levels.split_first_mut() else { return };
    if closed {
        level.take_mean_off();
    }
    let Some(coarse) = coarser.first_mut() else {
        level.begin();
        return level.smooth(COARSEST_SWEEPS);
    };
    level.begin();
    level.smooth(SWEEPS - 1);
    let (counts, source) = (coarse.counts, &mut coarse.source);
    parallel::for_each(source, |cell, source| {
        *source = level.children(cell, counts).map(|child| level.residual(child)).sum();
    });
    cycle(coarser, closed);
    level.add(&coarser[0]);
    level.smooth(SWEEPS);
}

impl<const D: usize> Level<D> {
    fn new(counts: [usize; D], periodic: [bool; D]) -> Self {
        let count = counts.iter().product();
        let mut beside = vec![[[0; 2]; D]; count];
        parallel::for_each(&mut beside, |cell, beside| {
            let place = place(cell, counts);
            let mut stride = 1;
            for axis in 0..D {
                let (n, at) = (counts[axis], place[axis]);
                let to = |other: usize| (cell + other * stride - at * stride) as u32;
                let ends = if periodic[axis] { [n - 1, 0] } else { [at, at] };
                beside[axis] = [to(if at > 0 { at - 1 } else { ends[0] }), to(if at + 1 < n { at + 1 } else { ends[1] })];
                stride *= n;
            }
        });
        let (faces, zeros) = (vec![[[0.0; 2]; D]; count], vec![0.0; count]);
        let [outlet, diagonal, source, value] = std::array::from_fn(|_| zeros.clone());
        Self { counts, periodic, beside, faces, zero: vec![false; count], outlet, diagonal, source, value, other: zeros }
    }

    fn count(&self) -> usize {
        self.source.len()
    }

    /// Faces between cells of these shares of fluid and of zero pressure; `area` of a whole face is that over the distance.
    fn couple(&mut self, shares: &[[f64; 2]], area: &Vector<D>) {
        let beside = &self.beside;
        parallel::for_each(&mut self.zero, |cell, zero| *zero = shares[cell][1] > 0.0);
        parallel::for_each(&mut self.faces, |cell, faces| {
            for axis in 0..D {
                faces[axis] = beside[cell][axis].map(|other| {
                    let other = other as usize;
                    if other == cell { 0.0 } else { shares[cell][0].min(shares[other][0]) * area[axis] }
                });
            }
        });
        parallel::for_each(&mut self.outlet, |cell, outlet| {
            let through = |axis: usize, other: u32| NEARER * shares[cell][0].min(shares[other as usize][1]) * area[axis];
            *outlet = (0..D).map(|axis| beside[cell][axis].map(|other| through(axis, other)).iter().sum::<f64>()).sum();
        });
        self.sum_up();
    }

    /// Faces of pairs of cells of a finer grid, between whose centres it is twice as far.
    fn agglomerate(&mut self, finer: &Self) {
        let (counts, beside) = (self.counts, &self.beside);
        parallel::for_each(&mut self.faces, |cell, faces| {
            for axis in 0..D {
                for side in 0..2 {
                    let other = beside[cell][axis][side];
                    let crosses = |child: usize| finer.parent(finer.beside[child][axis][side], counts) == other as usize;
                    let through = finer.children(cell, counts).filter(|&child| crosses(child));
                    let sum = through.map(|child| finer.faces[child][axis][side]).sum::<f64>();
                    faces[axis][side] = if other as usize == cell { 0.0 } else { 0.5 * sum };
                }
            }
        });
        parallel::for_each(&mut self.outlet, |cell, outlet| {
            *outlet = FARTHER * finer.children(cell, counts).map(|child| finer.outlet[child]).sum::<f64>();
        });
        self.sum_up();
        let diagonal = &self.diagonal;
        parallel::for_each(&mut self.zero, |cell, zero| {
            *zero = diagonal[cell] == 0.0 && finer.children(cell, counts).any(|child| finer.zero[child]);
        });
    }

    fn sum_up(&mut self) {
        let (faces, outlet) = (&self.faces, &self.outlet);
        parallel::for_each(&mut self.diagonal, |cell, diagonal| {
            *diagonal = outlet[cell] + faces[cell].as_flattened().iter().sum::<f64>();
        });
    }

    /// The cells that cell `cell` of the grid of `counts` cells next coarser is made of.
    fn children(&self, cell: usize, counts: [usize; D]) -> impl Iterator<Item = usize> {
        let (first, own) = (place(cell, counts).map(|at| 2 * at), self.counts);
        (0..1usize << D).filter_map(move |corner| {
            let at: [usize; D] = std::array::from_fn(|axis| first[axis] + (corner >> axis & 1));
            (0..D).all(|axis| at[axis] < own[axis]).then(|| flat(at, own))
        })
    }

    fn parent(&self, cell: u32, counts: [usize; D]) -> usize {
        flat(place(cell as usize, self.counts).map(|at| at / 2), counts)
    }

    /// The cell at `at` along `axis`, if there is one.
    fn within(&self, axis: usize, at: i64) -> Option<usize> {
        let n = self.counts[axis] as i64;
        let at = if self.periodic[axis] { at.rem_euclid(n) } else { at };
        (0..n).contains(&at).then_some(at as usize)
    }

    /// The mean of the values of the 2^D cells around a place that `corner` gives by axis and side, with their weights, as far as these hold fluid or zero.
    #[inline(always)]
    fn mean(&self, corner: impl Fn(usize, bool) -> (Option<usize>, f64)) -> f64 {
        let (mut total, mut sum) = (0.0, 0.0);
        'corners: for k in 0..1usize << D {
            let (mut weight, mut at) = (1.0, [0; D]);
            for axis in 0..D {
                let (Some(place), share) = corner(axis, k >> axis & 1 == 1) else { continue 'corners };
                weight *= share;
                at[axis] = place;
            }
            let cell = flat(at, self.counts);
            if self.diagonal[cell] > 0.0 || self.zero[cell] {
                total += weight;
                sum += weight * self.value[cell];
            }
        }
        if total > 0.0 { sum / total } else { 0.0 }
    }

    /// Add the interpolated values of the next coarser grid.
    fn add(&mut self, coarse: &Self) {
        let (counts, diagonal) = (self.counts, &self.diagonal);
        parallel::for_each(&mut self.value, |cell, value| {
            if diagonal[cell] > 0.0 {
                let at = place(cell, counts);
                *value += coarse.mean(|axis, other| {
                    let parent = (at[axis] / 2) as i64;
                    if !other {
                        return (coarse.within(axis, parent), 0.75);
                    }
                    (coarse.within(axis, if at[axis] % 2 == 1 { parent + 1 } else { parent - 1 }), 0.25)
                });
            }
        });
    }

    fn take_mean_off(&mut self) {
        let fluid = |cell: &usize| self.diagonal[*cell] > 0.0;
        let count = (0..self.count()).filter(fluid).count().max(1) as f64;
        let mean = (0..self.count()).filter(fluid).map(|cell| self.source[cell]).sum::<f64>() / count;
        self.source.iter_mut().for_each(|source| *source -= mean);
    }

    /// What the cells around let in.
    #[inline(always)]
    fn inflow(&self, cell: usize) -> f64 {
        let (beside, faces) = (self.beside[cell].as_flattened(), self.faces[cell].as_flattened());
        beside.iter().zip(faces).map(|(&other, face)| face * self.value[other as usize]).sum()
    }

    fn residual(&self, cell: usize) -> f64 {
        if self.diagonal[cell] > 0.0 {
            self.source[cell] + self.inflow(cell) - self.diagonal[cell] * self.value[cell]
        } else {
            0.0
        }
    }

    /// The first sweep of the smoothing iteration, from zero.
    fn begin(&mut self) {
        let (source, diagonal) = (&self.source, &self.diagonal);
        parallel::for_each(&mut self.value, |cell, value| {
            *value = if diagonal[cell] > 0.0 { DAMPING * source[cell] / diagonal[cell] } else { 0.0 };
        });
    }

    fn smooth(&mut self, sweeps: usize) {
        for _ in 0..sweeps {
            let mut other = std::mem::take(&mut self.other);
            let this = &*self;
            parallel::for_each(&mut other, |cell, other| {
                let residual = this.residual(cell);
                *other = this.value[cell] + if residual == 0.0 { 0.0 } else { DAMPING * residual / this.diagonal[cell] };
            });
            self.other = std::mem::replace(&mut self.value, other);
        }
    }
}

/// Where a cell of the grid of `counts` cells is.
#[inline(always)]
fn place<const D: usize>(cell: usize, counts: [usize; D]) -> [usize; D] {
    let mut rest = cell;
    counts.map(|n| {
        let at = rest % n;
        rest /= n;
        at
    })
}
