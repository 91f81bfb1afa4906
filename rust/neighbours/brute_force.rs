//! The oracle that the grid search is tested against.

use crate::base::Vector;

/// For each of the first `rows` points, the sorted indices of all other points closer than `radius`. O(N²).
pub fn brute_force_neighbours<const D: usize>(points: &[Vector<D>], rows: usize, radius: f64) -> Vec<Vec<u32>> {
    (0..rows)
        .map(|i| {
            (0..points.len())
                .filter(|&j| j != i && (points[j] - points[i]).norm_squared() < radius * radius)
                .map(|j| j as u32)
                .collect()
        })
        .collect()
}
