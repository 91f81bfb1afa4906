//! Points listed by cell with a counting sort, those of a cell by their keys. So the order in which sums over them are formed does not
//! depend on how the points are stored.

use std::ops::Range;

#[derive(Debug)]
pub struct Cells {
    /// First entry of `items` of each cell, and the end.
    starts: Vec<u32>,
    /// Point indices sorted by cell, then by key, then by index.
    pub items: Vec<u32>,
}

impl Default for Cells {
    fn default() -> Self {
        Self { starts: vec![0, 0], items: Vec::new() }
    }
}

impl Cells {
    /// List the points, of which `cell_of` and `keys` tell cell and key.
    pub fn sort(&mut self, cell_of: &[u32], cells: usize, keys: &[u64]) {
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        cell_of.iter().for_each(|&cell| self.starts[cell as usize + 1] += 1);
        for cell in 1..self.starts.len() {
            self.starts[cell] += self.starts[cell - 1];
        }
        self.items.resize(cell_of.len(), 0);
        for (index, &cell) in cell_of.iter().enumerate() {
            let slot = &mut self.starts[cell as usize];
            self.items[*slot as usize] = index as u32;
            *slot += 1;
        }
        // Each start has moved on to its end, which is the next cell's start.
        self.starts.rotate_right(1);
        self.starts[0] = 0;
        sort_by_keys(&mut self.items, &self.starts, keys);
    }

    /// The entries of `items` of the cells from `first` to before `end`.
    #[inline(always)]
    pub fn range(&self, first: usize, end: usize) -> Range<usize> {
        self.starts[first] as usize..self.starts[end] as usize
    }

    /// The points of a cell.
    pub fn of(&self, cell: usize) -> impl Iterator<Item = usize> {
        self.items[self.range(cell, cell + 1)].iter().map(|&item| item as usize)
    }
}

/// The number of the cell at `at`, of `counts` in each direction, the first direction fastest.
#[inline(always)]
pub fn flat<const D: usize>(at: [usize; D], counts: [usize; D]) -> usize {
    at.iter().zip(&counts).rev().fold(0, |flat, (&at, &n)| flat * n + at)
}

/// Cells that are sorted one after the other.
const CELLS: usize = 1024;

/// Sort the items of each cell by their keys; those with the same one stay in order. `starts` are those of the cells, and the end.
fn sort_by_keys(items: &mut [u32], starts: &[u32], keys: &[u64]) {
    let cells = starts.len() - 1;
    if cells > CELLS {
        let (lower, upper) = items.split_at_mut((starts[cells / 2] - starts[0]) as usize);
        rayon::join(|| sort_by_keys(lower, &starts[..=cells / 2], keys), || sort_by_keys(upper, &starts[cells / 2..], keys));
        return;
    }
    for cell in starts.windows(2) {
        let items = &mut items[(cell[0] - starts[0]) as usize..(cell[1] - starts[0]) as usize];
        if !items.is_sorted_by_key(|&item| keys[item as usize]) {
            items.sort_by_key(|&item| keys[item as usize]);
        }
    }
}
