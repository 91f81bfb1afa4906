//! What the operators do to waves on a square lattice.

use super::Settings;
use crate::kernel::{Smoothing, with_kernel};

/// Largest eigenvalues on a square lattice, times Δx².
#[derive(Clone, Copy, Debug)]
pub struct Eigenvalues {
    /// Of the negative compact Laplacian: λ_max.
    pub laplacian: f64,
    /// Of −∇·∇, the divergence of the gradient.
    pub projection: f64,
}

impl Settings {
    pub fn largest_eigenvalues(&self) -> Eigenvalues {
        Eigenvalues { laplacian: self.largest_laplacian_eigenvalue(), projection: self.largest_projection_eigenvalue() }
    }

    /// λ_max Δx²: the largest eigenvalue of the negative compact Laplacian on a square lattice, sought over the wave
    /// vectors of the Brillouin zone.
    pub fn largest_laplacian_eigenvalue(&self) -> f64 {
        let (slopes, trace) = self.lattice_slopes();
        let factor = 2.0 * (self.dimensions as f64 + 2.0) / (2.0 + trace);
        let eigenvalue = |phase: &dyn Fn(&[f64; 3]) -> f64| {
            slopes.iter().map(|(r, slope)| -factor * slope * (1.0 - phase(r).cos())).sum()
        };
        self.largest_over_waves(eigenvalue)
    }

    /// What the value of a particle itself counts in the negative compact Laplacian, times Δx².
    pub fn laplacian_diagonal(&self) -> f64 {
        let (slopes, trace) = self.lattice_slopes();
        -2.0 * (self.dimensions as f64 + 2.0) / (2.0 + trace) * slopes.iter().map(|(_, slope)| slope).sum::<f64>()
    }

    /// −Σ slope and −Σ slope |r_ij| of a particle of the lattice, times Δx² and Δx.
    pub fn lattice_sums(&self) -> (f64, f64) {
        let (slopes, _) = self.lattice_slopes();
        let distance = |r: &[f64; 3]| r.iter().map(|x| x * x).sum::<f64>().sqrt();
        (
            -slopes.iter().map(|(_, slope)| slope).sum::<f64>(),
            -slopes.iter().map(|(r, slope)| slope * distance(r)).sum::<f64>(),
        )
    }

    /// The same of −∇·∇, the divergence of the gradient: three to five times smaller, since both operators miss short waves.
    pub fn largest_projection_eigenvalue(&self) -> f64 {
        let (slopes, trace) = self.lattice_slopes();
        let correction = self.dimensions as f64 / trace;
        let eigenvalue = |phase: &dyn Fn(&[f64; 3]) -> f64| {
            let gradient =
                |k: usize| slopes.iter().map(|(r, slope)| correction * slope * r[k] * phase(r).sin()).sum::<f64>();
            (0..3).map(|k| gradient(k).powi(2)).sum()
        };
        self.largest_over_waves(eigenvalue)
    }

    /// The compact Laplacian of a wave of wave number k along an axis of a square lattice is −k² (1 − c k²Δx² + ...): c.
    pub fn laplacian_dispersion(&self) -> f64 {
        let (slopes, trace) = self.lattice_slopes();
        let factor = 2.0 * (self.dimensions as f64 + 2.0) / (2.0 + trace);
        slopes.iter().map(|(r, slope)| -factor * slope * r[0].powi(4) / 24.0).sum()
    }

    /// V = 1 / Σ W of a particle of the undisturbed lattice, nearly Δx^D.
    pub fn undisturbed_volume(&self) -> f64 {
        self.lattice_volume() * self.particle_spacing.powi(self.dimensions as i32)
    }

    /// The same over Δx^D.
    pub fn lattice_volume(&self) -> f64 {
        1.0 / self.lattice_kernels().iter().map(|w| w.2).sum::<f64>()
    }

    /// V_j |∇W|/r, negative, at the points of the unit lattice around the origin, and tr α.
    fn lattice_slopes(&self) -> (Vec<([f64; 3], f64)>, f64) {
        let (weights, volume) = (self.lattice_kernels(), self.lattice_volume());
        let trace = weights.iter().map(|w| -volume * w.3 * w.1 * w.1).sum();
        (weights.into_iter().map(|(r, _, _, slope)| (r, volume * slope)).collect(), trace)
    }

    /// The points of the unit lattice around the origin, each with its distance, W and |∇W|/r, negative.
    fn lattice_kernels(&self) -> Vec<([f64; 3], f64, f64, f64)> {
        let (ratio, dimensions) = (self.smoothing_ratio, self.dimensions);
        with_kernel!(self.kernel, kernel => {
            let smoothing = Smoothing::new(kernel, ratio, dimensions);
            lattice(dimensions, self.kernel.support() * ratio)
                .map(|r| {
                    let distance = r.iter().map(|x| x * x).sum::<f64>().sqrt();
                    let slope = if distance > 0.0 { smoothing.slope(distance) } else { 0.0 };
                    (r, distance, smoothing.value(distance), slope)
                })
                .collect()
        })
    }

    /// The largest value of `eigenvalue`, which gets the phase of a wave at a lattice point, over the wave vectors.
    fn largest_over_waves(&self, eigenvalue: impl Fn(&dyn Fn(&[f64; 3]) -> f64) -> f64) -> f64 {
        let samples = 16;
        lattice(self.dimensions, samples as f64 * (self.dimensions as f64).sqrt())
            .filter(|k| k.iter().all(|&x| (0.0..=samples as f64).contains(&x)))
            .map(|k| eigenvalue(&|r| (0..3).map(|a| k[a] * r[a]).sum::<f64>() * std::f64::consts::PI / samples as f64))
            .fold(0.0, f64::max)
    }
}

/// Points of the unit lattice within `radius` of the origin, in a fixed order.
fn lattice(dimensions: usize, radius: f64) -> impl Iterator<Item = [f64; 3]> {
    let n = radius.ceil() as i64;
    let third = if dimensions == 3 { n } else { 0 };
    (-n..=n)
        .flat_map(move |i| (-n..=n).flat_map(move |j| (-third..=third).map(move |k| [i as f64, j as f64, k as f64])))
        .filter(move |r| r.iter().map(|x| x * x).sum::<f64>() <= radius * radius)
}
