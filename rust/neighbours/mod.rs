//! Neighbour search: a counting-sort cell grid and a flat list of rows, one for four particles.

mod brute_force;
mod cells;
mod grid;
mod list;

pub use brute_force::brute_force_neighbours;
pub use cells::{Cells, flat};
pub use grid::Grid;
pub use list::{Cluster, Entry, NeighbourList, Row, RowMut, Visit, VisitMut};
