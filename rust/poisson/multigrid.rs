//! Geometric multigrid on a Cartesian background grid: what takes off the long waves of a residual that sums over neighbours hardly see.
//!
//! Cells are about 2 Δx wide. The residual of the particles of a cell is its source, in proportion to their volumes, and the solution comes
//! back to the particles by linear interpolation between the centres of cells. What these do among each other: [`Level`].

use crate::base::Vector;
use crate::base::parallel;
use crate::neighbours::{Cells, flat};
use crate::particles::Particles;
use crate::poisson::level::{Columns, Level, place_of};
use crate::poisson::row::Row;
use crate::settings::{Boundary, Settings};

/// Width of the cells of the finest grid over Δx.
const WIDTH: f64 = 2.0;

/// A cell filled less than this is taken for empty.
const EMPTY: f64 = 0.05;

/// Share of a cell without particles from which on it is taken for air; less may be how particles happen to lie in it.
const AIR: f64 = 0.4;

/// How often a grid is smoothed before and after the coarser one's correction.
const SWEEPS: usize = 3;

/// How far in Δx the pressure is zero beyond where the fluid ends: at the first particles there.
const BEYOND: f64 = 0.5;

/// The coarsest grid has no more cells than this, and is solved by so many sweeps.
const COARSEST: usize = 16;
const COARSEST_SWEEPS: usize = 24;

#[derive(Debug)]
pub struct Multigrid<const D: usize> {
    counts: [usize; D],
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
        Self { counts: [0; D], lower: Vector::zeros(), width: Vector::repeat(1.0), cells, cell_of: Vec::new(), levels }
    }
}

impl<const D: usize> Multigrid<D> {
    /// Lay the grids for particles with these `rows`, amid air of zero pressure where there is a free surface.
    pub fn build(&mut self, settings: &Settings, particles: &Particles<D>, volume: &[f64], rows: &[Row], air: bool) {
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
        self.counts = counts;
        let count = counts.iter().product::<usize>();
        let mut cell_of = std::mem::take(&mut self.cell_of);
        cell_of.resize(particles.real, 0);
        parallel::for_each(&mut cell_of, |i, cell| {
            *cell = if rows[i] == Row::None && !air { count } else { self.cell(&particles.position[i]) } as u32;
        });
        self.cells.sort(&cell_of, count + 1, &particles.id);
        self.cell_of = cell_of;
        let whole = self.width.product();
        let filled = |row: Row, cell: usize| {
            let filled = self.cells.of(cell).filter(|&i| rows[i] == row).map(|i| volume[i]).sum::<f64>() / whole;
            if filled < EMPTY { 0.0 } else { filled }
        };
        let solid = settings.undisturbed_volume() / whole;
        let mut content = vec![[0.0; 2]; count];
        parallel::for_each(&mut content, |cell, content| {
            *content = [Row::Solved, Row::Zero].map(|row| filled(row, cell));
            if air {
                let solids = self.cells.of(cell).filter(|&i| rows[i] == Row::None).count() as f64 * solid;
                let empty = 1.0 - content[0] - solids;
                content[1] = if empty > AIR { empty } else { 0.0 };
            }
        });
        self.lay(periodic, &content);
        let area = self.width.map(|width| whole / (width * width));
        let beyond = self.width.map(|width| if air { 0.0 } else { BEYOND * settings.particle_spacing / width });
        let mut filling = self.levels[0].fill(content, &area);
        self.levels[0].couple(&filling, &beyond);
        for k in 1..self.levels.len() {
            let (finer, coarser) = self.levels.split_at_mut(k);
            filling = coarser[0].agglomerate(&finer[k - 1], &filling);
            coarser[0].couple(&filling, &beyond);
        }
    }

    /// Lay grids for cells with this content, unless those that are there serve.
    fn lay(&mut self, periodic: [bool; D], content: &[[f64; 2]]) {
        let mut excess = self.counts.map(|n| vec![0; n]);
        for (cell, &[fluid, zero]) in content.iter().enumerate() {
            for (excess, at) in excess.iter_mut().zip(place_of(cell, self.counts)) {
                excess[at] += i32::from(fluid > 0.0 && zero == 0.0) - i32::from(zero > 0.0);
            }
        }
        let solved = excess.map(|excess| excess.into_iter().map(|excess| excess > 0).collect::<Vec<_>>());
        let columns = solved.map(|solved| Columns::new(vec![1.0; solved.len()], solved));
        if self.levels.first().is_some_and(|finest| finest.columns == columns && finest.periodic == periodic) {
            return;
        }
        self.levels = vec![Level::new(columns, periodic)];
        while let Some(finer) = self.levels.last().filter(|level| level.count() > COARSEST) {
            let coarser = finer.coarser();
            if coarser.counts == finer.counts {
                break;
            }
            self.levels.push(coarser);
        }
    }

    fn cell(&self, position: &Vector<D>) -> usize {
        let counts = self.counts;
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
        let (finest, lower, width, cell_of) = (&self.levels[0], self.lower, self.width, &self.cell_of);
        parallel::for_each(correction, |i, out| {
            let cell = cell_of[i] as usize;
            let place = || (position[i] - lower).component_div(&width).into();
            *out = if cell < finest.count() { finest.mean(place(), place_of(cell, finest.counts)) } else { 0.0 };
        });
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
        level.smooth(COARSEST_SWEEPS);
        return level.reflect();
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
    level.reflect();
}
