//! One grid of the multigrid.
//!
//! Cells that hold fluid are coupled by the finite-volume Laplacian, as far as both are full; what flows into cells without any counts as a
//! wall. Those with particles of an outlet have the pressure zero, not in their centres but where the fluid ends.

use crate::base::Vector;
use crate::base::parallel;
use crate::neighbours::flat;
use std::ops::Range;

/// Damping of the Jacobi iteration that smooths.
const DAMPING: f64 = 0.8;

/// The columns of cells along one direction. Lengths are over the width of the finest grid's.
#[derive(Debug, PartialEq)]
pub struct Columns {
    widths: Vec<f64>,
    centers: Vec<f64>,
    /// Whether anything is solved in them.
    solved: Vec<bool>,
    /// Those that the next coarser grid has as one, and which of its columns they are in.
    pairs: Vec<Range<usize>>,
    parents: Vec<usize>,
}

impl Columns {
    /// Two columns make one of the next coarser grid, but never one that is solved and one that is not: so what is straight between
    /// fluid and outlet is an end of cells on all grids.
    pub fn new(widths: Vec<f64>, solved: Vec<bool>) -> Self {
        let (mut centers, mut end) = (Vec::new(), 0.0);
        for width in &widths {
            centers.push(end + 0.5 * width);
            end += width;
        }
        let (mut pairs, mut parents) = (Vec::<Range<usize>>::new(), Vec::new());
        for (k, &own) in solved.iter().enumerate() {
            match pairs.last_mut().filter(|pair| pair.len() == 1 && solved[pair.start] == own) {
                Some(pair) => pair.end += 1,
                None => pairs.push(k..k + 1),
            }
            parents.push(pairs.len() - 1);
        }
        Self { widths, centers, solved, pairs, parents }
    }

    fn coarser(&self) -> Self {
        let widths = self.pairs.iter().map(|pair| self.widths[pair.clone()].iter().sum());
        Self::new(widths.collect(), self.pairs.iter().map(|pair| self.solved[pair.start]).collect())
    }
}

/// What the cells of a grid are made of.
pub struct Filling<const D: usize> {
    /// How much of fluid, and of zero pressure; a whole cell of the finest grid is 1.
    content: Vec<[f64; 2]>,
    /// The area of the faces to the cells before and after in each direction, over the width of the finest grid's cells there.
    faces: Vec<[[f64; 2]; D]>,
}

/// One grid. All fields by cell, the first direction fastest.
#[derive(Debug)]
pub struct Level<const D: usize> {
    pub columns: [Columns; D],
    pub counts: [usize; D],
    pub periodic: [bool; D],
    /// The cell before and the one after in each direction; itself at an end.
    beside: Vec<[[u32; 2]; D]>,
    /// What the faces to them let through, of a difference of the values; zero at an end. Of a cell of zero pressure: its share of the
    /// values beside in its own.
    faces: Vec<[[f64; 2]; D]>,
    /// Whether a cell is one of zero pressure. Its value is zero, and in the end what continues those beside through the place of p = 0.
    zero: Vec<bool>,
    /// The sum of the faces; zero of an empty cell and of one of zero pressure.
    diagonal: Vec<f64>,
    pub source: Vec<f64>,
    value: Vec<f64>,
    other: Vec<f64>,
}

impl<const D: usize> Level<D> {
    pub fn new(columns: [Columns; D], periodic: [bool; D]) -> Self {
        let counts = columns.each_ref().map(|columns| columns.widths.len());
        let count = counts.iter().product();
        let mut beside = vec![[[0; 2]; D]; count];
        parallel::for_each(&mut beside, |cell, beside| {
            let place = place_of(cell, counts);
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
        let [diagonal, source, value] = std::array::from_fn(|_| zeros.clone());
        let zero = vec![false; count];
        Self { columns, counts, periodic, beside, faces, zero, diagonal, source, value, other: zeros }
    }

    /// The next coarser grid.
    pub fn coarser(&self) -> Self {
        Self::new(self.columns.each_ref().map(Columns::coarser), self.periodic)
    }

    pub fn count(&self) -> usize {
        self.source.len()
    }

    /// What the cells of the finest grid are made of, if this is in them, and `area` that of a whole face.
    pub fn fill(&self, content: Vec<[f64; 2]>, area: &Vector<D>) -> Filling<D> {
        let mut faces = vec![[[0.0; 2]; D]; self.count()];
        let open = |cell: usize| content[cell].iter().sum::<f64>().min(1.0);
        parallel::for_each(&mut faces, |cell, faces| {
            for axis in 0..D {
                faces[axis] = self.beside[cell][axis].map(|other| open(cell).min(open(other as usize)) * area[axis]);
            }
        });
        Filling { content, faces }
    }

    /// Set what the faces of cells with this filling let through. The pressure is zero so far `beyond` the fluid's end.
    pub fn couple(&mut self, filling: &Filling<D>, beyond: &Vector<D>) {
        let content = &filling.content;
        parallel::for_each(&mut self.zero, |cell, zero| *zero = content[cell][1] > 0.0);
        let (beside, zero) = (&self.beside, &self.zero);
        let width = |axis: usize, cell: usize| self.columns[axis].widths[place_of(cell, self.counts)[axis]];
        let apart = |axis: usize, cell: usize, other: usize| 0.5 * (width(axis, cell) + width(axis, other));
        // From the centre of a cell to where the pressure is zero in one beside it, behind what fluid that one has.
        let to_zero = |axis: usize, cell: usize, other: usize| {
            let [fluid, rest] = content[other];
            0.5 * width(axis, cell) + width(axis, other) * fluid / (fluid + rest) + beyond[axis]
        };
        parallel::for_each(&mut self.faces, |cell, faces| {
            let mut around = 0.0;
            for (axis, side) in sides::<D>() {
                let (other, area) = (beside[cell][axis][side] as usize, filling.faces[cell][axis][side]);
                faces[axis][side] = match (zero[cell], zero[other]) {
                    _ if other == cell || area == 0.0 => 0.0,
                    (false, false) => area / apart(axis, cell, other),
                    (false, true) => area / to_zero(axis, cell, other),
                    (true, true) => 0.0,
                    (true, false) => {
                        around += 1.0;
                        1.0 - apart(axis, cell, other) / to_zero(axis, other, cell)
                    }
                };
            }
            if around > 1.0 {
                faces.as_flattened_mut().iter_mut().for_each(|share| *share /= around);
            }
        });
        let faces = &self.faces;
        parallel::for_each(&mut self.diagonal, |cell, diagonal| {
            *diagonal = if zero[cell] { 0.0 } else { faces[cell].as_flattened().iter().sum() };
        });
    }

    /// What the cells are made of, if those of a `finer` grid are of this.
    pub fn agglomerate(&self, finer: &Self, filling: &Filling<D>) -> Filling<D> {
        let mut content = vec![[0.0; 2]; self.count()];
        parallel::for_each(&mut content, |cell, content| {
            *content = [0, 1].map(|of| finer.children(cell, self.counts).map(|child| filling.content[child][of]).sum());
        });
        let mut faces = vec![[[0.0; 2]; D]; self.count()];
        parallel::for_each(&mut faces, |cell, faces| {
            for (axis, side) in sides::<D>() {
                let other = self.beside[cell][axis][side] as usize;
                let crosses = |&child: &usize| finer.parent(finer.beside[child][axis][side], self.counts) == other;
                let through = finer.children(cell, self.counts).filter(|child| other != cell && crosses(child));
                faces[axis][side] = through.map(|child| filling.faces[child][axis][side]).sum();
            }
        });
        Filling { content, faces }
    }

    /// The cells that cell `cell` of the grid of `counts` cells next coarser is made of.
    pub fn children(&self, cell: usize, counts: [usize; D]) -> impl Iterator<Item = usize> {
        let at = place_of(cell, counts);
        let pairs: [_; D] = std::array::from_fn(|axis| self.columns[axis].pairs[at[axis]].clone());
        (0..1usize << D).filter_map(move |corner| {
            let at: [usize; D] = std::array::from_fn(|axis| pairs[axis].start + (corner >> axis & 1));
            (0..D).all(|axis| at[axis] < pairs[axis].end).then(|| flat(at, self.counts))
        })
    }

    /// Where the cell that holds the one at `at` is in the next coarser grid.
    fn parent_of(&self, at: [usize; D]) -> [usize; D] {
        std::array::from_fn(|axis| self.columns[axis].parents[at[axis]])
    }

    fn parent(&self, cell: u32, counts: [usize; D]) -> usize {
        flat(self.parent_of(place_of(cell as usize, self.counts)), counts)
    }

    /// The cell at `at` along `axis`, if there is one.
    fn within(&self, axis: usize, at: i64) -> Option<usize> {
        let n = self.counts[axis] as i64;
        let at = if self.periodic[axis] { at.rem_euclid(n) } else { at };
        (0..n).contains(&at).then_some(at as usize)
    }

    /// The value at `place`, which is in the cell at `at`, from the 2^D cells around, as far as these hold fluid or zero.
    #[inline(always)]
    pub fn mean(&self, place: [f64; D], at: [usize; D]) -> f64 {
        let around: [_; D] = std::array::from_fn(|axis| {
            let (Columns { widths, centers, .. }, own) = (&self.columns[axis], at[axis]);
            let away = place[axis] - centers[own];
            let other = self.within(axis, own as i64 + if away < 0.0 { -1 } else { 1 });
            let share = other.map_or(0.0, |other| (2.0 * away.abs() / (widths[own] + widths[other])).min(1.0));
            [(own, 1.0 - share), (other.unwrap_or(own), share)]
        });
        let (mut total, mut sum) = (0.0, 0.0);
        for k in 0..1usize << D {
            let corner: [_; D] = std::array::from_fn(|axis| around[axis][k >> axis & 1]);
            let weight = corner.iter().map(|(_, weight)| weight).product::<f64>();
            let cell = flat(corner.map(|(at, _)| at), self.counts);
            if self.diagonal[cell] > 0.0 || self.zero[cell] {
                total += weight;
                sum += weight * self.value[cell];
            }
        }
        if total > 0.0 { sum / total } else { 0.0 }
    }

    /// Add the interpolated values of the next coarser grid.
    pub fn add(&mut self, coarse: &Self) {
        let mut value = std::mem::take(&mut self.value);
        parallel::for_each(&mut value, |cell, value| {
            if self.diagonal[cell] > 0.0 {
                let at = place_of(cell, self.counts);
                let center = std::array::from_fn(|axis| self.columns[axis].centers[at[axis]]);
                *value += coarse.mean(center, self.parent_of(at));
            }
        });
        self.value = value;
    }

    /// Give cells of zero pressure what continues the values beside through the place of p = 0.
    pub fn reflect(&mut self) {
        let mut other = std::mem::take(&mut self.other);
        let this = &*self;
        parallel::for_each(&mut other, |cell, other| {
            *other = if this.zero[cell] { this.inflow(cell) } else { this.value[cell] };
        });
        self.other = std::mem::replace(&mut self.value, other);
    }

    pub fn take_mean_off(&mut self) {
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

    pub fn residual(&self, cell: usize) -> f64 {
        if self.diagonal[cell] > 0.0 {
            self.source[cell] + self.inflow(cell) - self.diagonal[cell] * self.value[cell]
        } else {
            0.0
        }
    }

    /// The first sweep of the smoothing iteration, from zero.
    pub fn begin(&mut self) {
        let (source, diagonal) = (&self.source, &self.diagonal);
        parallel::for_each(&mut self.value, |cell, value| {
            *value = if diagonal[cell] > 0.0 { DAMPING * source[cell] / diagonal[cell] } else { 0.0 };
        });
    }

    pub fn smooth(&mut self, sweeps: usize) {
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

/// The directions, each with the sides before and after.
fn sides<const D: usize>() -> impl Iterator<Item = (usize, usize)> {
    (0..D).flat_map(|axis| [(axis, 0), (axis, 1)])
}

/// Where a cell of the grid of `counts` cells is.
#[inline(always)]
pub fn place_of<const D: usize>(cell: usize, counts: [usize; D]) -> [usize; D] {
    let mut rest = cell;
    counts.map(|n| {
        let at = rest % n;
        rest /= n;
        at
    })
}
