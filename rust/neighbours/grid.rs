//! Cells at least half as wide as the search radius, with their points.

use crate::base::Vector;
use crate::base::parallel;
use crate::neighbours::cells::{Cells, flat};
use std::ops::Range;

/// Cells that the search radius reaches to either side: narrow cells fit the sphere closer than wide ones.
const REACH: usize = 2;

/// Cells a point, above which the cells are made wider (a few stray particles must not cost memory).
const CELLS_PER_POINT: usize = 8;

#[derive(Debug)]
pub struct Grid<const D: usize> {
    /// Where the first of all cells begins, and the first of those that are kept.
    origin: Vector<D>,
    first: [usize; D],
    inverse_width: f64,
    cells: [usize; D],
    /// Point indices by cell (first direction fastest).
    listed: Cells,
    /// The coordinates of the points in that order, one array a direction.
    coordinates: [Vec<f64>; D],
    cell_of: Vec<u32>,
}

/// Points in neighbouring cells.
#[derive(Clone, Copy)]
pub struct Run<'a, const D: usize> {
    pub indices: &'a [u32],
    /// One array a direction.
    pub coordinates: [&'a [f64]; D],
}

impl<const D: usize> Default for Grid<D> {
    fn default() -> Self {
        Self {
            origin: Vector::zeros(),
            first: [0; D],
            inverse_width: 1.0,
            cells: [1; D],
            listed: Cells::default(),
            coordinates: std::array::from_fn(|_| Vec::new()),
            cell_of: Vec::new(),
        }
    }
}

impl<const D: usize> Grid<D> {
    /// Sort `points`, each with its key, for searches within `radius`. Cells are those of the box `bounds`, wherever the points are, as far
    /// as these reach: points beyond share its border cells, so that strays cost no memory.
    pub fn build(&mut self, points: &[Vector<D>], keys: &[u64], radius: f64, bounds: (Vector<D>, Vector<D>)) {
        let Some(&point) = points.first() else {
            *self = Self::default();
            return;
        };
        let corners = |range: Range<usize>| {
            points[range].iter().fold((point, point), |(low, high), point| (low.inf(point), high.sup(point)))
        };
        let (lower, upper) =
            parallel::reduce(points.len(), corners, |a, b| (a.0.inf(&b.0), a.1.sup(&b.1))).unwrap_or((point, point));
        let (lower, upper) = (lower.sup(&bounds.0), upper.inf(&bounds.1));
        // No number tells the cells of a box that is longer than any.
        self.origin = if (upper - bounds.0).iter().all(|extent| extent.is_finite()) { bounds.0 } else { lower };
        let (lower, upper) = (lower - self.origin, upper - self.origin);
        // A hair wider, so that rounding cannot put a neighbour one cell farther away.
        let mut width = radius / REACH as f64 * (1.0 + 1e-9);
        let most = (CELLS_PER_POINT * points.len()).max(64) as f64;
        let first = |width: f64| lower.map(|x| (x.max(0.0) / width).floor());
        let cells = |width: f64| {
            (upper.map(|x| (x.max(0.0) / width).floor()) - first(width)).add_scalar(1.0).sup(&Vector::repeat(1.0))
        };
        while cells(width).iter().product::<f64>() > most && width.is_finite() {
            width *= 2.0;
        }
        let (counts, first) = (cells(width), first(width));
        self.first = std::array::from_fn(|axis| first[axis] as usize);
        self.cells = std::array::from_fn(|axis| counts[axis] as usize);
        self.inverse_width = 1.0 / width;
        self.sort(points, keys);
    }

    fn sort(&mut self, points: &[Vector<D>], keys: &[u64]) {
        let mut cell_of = std::mem::take(&mut self.cell_of);
        cell_of.resize(points.len(), 0);
        parallel::for_each(&mut cell_of, |i, cell| *cell = flat(self.cell(&points[i]), self.cells) as u32);
        self.listed.sort(&cell_of, self.cells.iter().product(), keys);
        for (axis, coordinates) in self.coordinates.iter_mut().enumerate() {
            coordinates.resize(points.len(), 0.0);
            parallel::for_each(coordinates, |k, x| *x = points[self.listed.items[k] as usize][axis]);
        }
        self.cell_of = cell_of;
    }

    /// Point indices sorted by cell, then by key, then by index.
    pub fn order(&self) -> &[u32] {
        &self.listed.items
    }

    /// Call `visit` with each run of points that may lie within the search radius of one of `points`, in a fixed order and
    /// no run twice.
    #[inline(always)]
    pub fn for_each_run<const N: usize>(&self, points: &[Vector<D>; N], mut visit: impl FnMut(Run<D>)) {
        let mut boxes: [[[usize; 2]; D]; N] = points.each_ref().map(|point| self.around(point));
        boxes.sort_unstable_by_key(|cells| cells[0]);
        let rows = |axis: usize| {
            let starts = boxes.iter().map(|cells| cells[axis][0]);
            starts.min().unwrap_or(0)..boxes.iter().map(|cells| cells[axis][1]).max().unwrap_or(0)
        };
        let mut visit_row = |row: [usize; D]| {
            // In the first direction the boxes that meet this row overlap, or leave gaps that need no visit.
            let mut run: Option<[usize; 2]> = None;
            for cells in &boxes {
                if (1..D).any(|axis| row[axis] < cells[axis][0] || row[axis] >= cells[axis][1]) {
                    continue;
                }
                let [start, end] = cells[0];
                run = match run {
                    Some([first, last]) if start <= last => Some([first, last.max(end)]),
                    other => {
                        other.into_iter().for_each(|run| visit(self.run(row, run)));
                        Some([start, end])
                    }
                };
            }
            run.into_iter().for_each(|run| visit(self.run(row, run)));
        };
        let mut row = [0; D];
        for k in if D == 3 { rows(2) } else { 0..1 } {
            for j in rows(1) {
                row[1] = j;
                if D == 3 {
                    row[2] = k;
                }
                visit_row(row);
            }
        }
    }

    /// First cell and end, in each direction, of those that the search radius reaches around `point`.
    #[inline(always)]
    fn around(&self, point: &Vector<D>) -> [[usize; 2]; D] {
        let center = self.cell(point);
        std::array::from_fn(|axis| [center[axis].saturating_sub(REACH), (center[axis] + REACH + 1).min(self.cells[axis])])
    }

    /// The points in cells `first` to `end` of a row.
    #[inline(always)]
    fn run(&self, row: [usize; D], [first, end]: [usize; 2]) -> Run<'_, D> {
        let start = flat(row, self.cells);
        let range = self.listed.range(start + first, start + end);
        Run {
            indices: &self.listed.items[range.clone()],
            coordinates: self.coordinates.each_ref().map(|x| &x[range.clone()]),
        }
    }

    #[inline(always)]
    fn cell(&self, point: &Vector<D>) -> [usize; D] {
        // A float-to-integer cast saturates, so points outside the box land in its border cells.
        std::array::from_fn(|axis| {
            let cell = ((point[axis] - self.origin[axis]) * self.inverse_width) as usize;
            cell.saturating_sub(self.first[axis]).min(self.cells[axis] - 1)
        })
    }
}
