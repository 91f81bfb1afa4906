//! Projection sweeps: what the iterations leave of ∇·u is taken off with the very operators that measure it.
//!
//! The fixed point of (8), (10) and (11) is not free of divergence, because the compact Laplacian of (10) is not the divergence of
//! the gradient of (11). A sweep
//!
//! ```text
//! u ← u + σ ∇(∇·u),    p ← p − κ ρ σ/Δt ∇·u
//! ```
//!
//! is the same step of the augmented Lagrangian (Uzawa) with that divergence and that gradient, so that any ∇·u they see falls by
//! 1 − σ λ, λ being the eigenvalue of −∇·∇. These reach a fifth of the compact Laplacian's: σ is five times as large and the
//! sweep needs two passes over the neighbours, not four.
//!
//! What the gradient does not see of a sweep's potential, the shortest waves, does nothing to u, comes again in every step and would make p as rough:
//! of the potential of all sweeps the pressure keeps what is left when the compact Laplacian, which sees them best, has taken them off.
//!
//! One σ for all sweeps is best for the shortest waves alone. Sweeps of different σ multiply to a polynomial of λ; that of Chebyshev on
//! [a λ_max, λ_max] leaves least of all those waves, at the same cost.

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::{PressureRule, VelocityRule, conditions, extrapolate_scalar};
use crate::discretisation::{Divergence, Gradient, GradientAndLaplacian};
use crate::flow::{Flow, Step};
use crate::particles::Particles;
use crate::settings::{Eigenvalues, Settings, SweepPressure, SweepWeights};

/// κ: the share of a sweep's potential that the pressure keeps. The rest of it is mostly noise of the one step; all of the
/// pressure comes in over a few steps.
const PRESSURE_SHARE: f64 = 0.5;

/// a: the smallest eigenvalue that the polynomial of Chebyshev looks to, over the largest. With a tenth four sweeps go so far that
/// disordered particles leave more ∇·u, not less.
const CHEBYSHEV_SPAN: f64 = 0.2;

/// Degree of that polynomial; more sweeps go through its zeros again, for of a high degree the order of the zeros would matter.
const CHEBYSHEV_DEGREE: usize = 4;

/// What disordered particles may add to the largest eigenvalue of the lattice.
const EIGENVALUE_MARGIN: f64 = 1.1;

/// What the sweeps are multiplied with, lengths squared.
#[derive(Clone, Copy, Debug)]
pub struct Sweeps {
    /// σ.
    pub(super) relaxation: f64,
    /// One over the largest eigenvalue of the compact Laplacian: so much of it takes the shortest waves off.
    shortest: f64,
    /// Σ 1/weight of all.
    together: f64,
}

impl Sweeps {
    /// The square of how far all sweeps carry the pressure, each of which spreads it as diffusion does.
    pub fn reach_squared(self) -> f64 {
        self.relaxation * self.together
    }

    pub fn new(settings: &Settings, largest: Eigenvalues) -> Self {
        let area = settings.particle_spacing.powi(2);
        Self {
            relaxation: area / (EIGENVALUE_MARGIN * largest.projection),
            shortest: area / largest.laplacian,
            together: (0..settings.projection_sweeps).map(|sweep| 1.0 / weight(settings, sweep)).sum(),
        }
    }
}

#[derive(Debug, Default)]
pub struct Projection {
    /// ∇·u, that of solids extrapolated (∂/∂n = 0) and none where pressure or velocity are prescribed.
    divergence: Vec<f64>,
    /// p before the sweeps of this step; empty without any.
    pressure_before: Vec<f64>,
    /// ∇·u before the last sweep, and what the pressure would keep of all sweeps, were it not made smooth; empty if it is not.
    rough: Vec<[f64; 2]>,
}

/// The eigenvalue over the largest whose waves a sweep takes off: a zero of the polynomial.
pub(super) fn weight(settings: &Settings, sweep: usize) -> f64 {
    match settings.sweep_weights {
        SweepWeights::Equal => 1.0,
        SweepWeights::Chebyshev => {
            let degree = settings.projection_sweeps.min(CHEBYSHEV_DEGREE);
            let angle = std::f64::consts::PI * ((sweep % degree) as f64 + 0.5) / degree as f64;
            0.5 * (1.0 + CHEBYSHEV_SPAN + (1.0 - CHEBYSHEV_SPAN) * angle.cos())
        }
    }
}

impl Projection {
    pub fn begin(&mut self) {
        self.pressure_before.clear();
        self.rough.clear();
    }

    /// What the sweeps of this step pushed with, and the pressure has not kept.
    pub fn unkept<const D: usize>(&self, particles: &Particles<D>, i: usize) -> f64 {
        let Some(before) = self.pressure_before.get(i) else { return 0.0 };
        let kept = particles.pressure[i] - before;
        let share = self.rough.get(i).map_or(kept, |[_, rough]| *rough);
        share / PRESSURE_SHARE - kept
    }

    /// All sweeps of one step. They take off what ∇·u of a particle has beyond `solenoidal`.
    pub fn sweep<const D: usize>(
        &mut self,
        step: Step,
        Sweeps { relaxation, shortest, .. }: Sweeps,
        Flow { particles, frame, .. }: &mut Flow<D>,
        solenoidal: impl Fn(usize) -> f64 + Sync,
    ) {
        self.pressure_before.extend_from_slice(&particles.pressure);
        let Step { settings, time_step, .. } = step;
        let Particles { real, kind, position, pressure, velocity, .. } = particles;
        let (kind, position) = (&kind[..*real], &*position);
        let condition = conditions(settings);
        let divergence = &mut self.divergence;
        frame.images.blank(divergence, velocity.len());
        for sweep in 0..settings.projection_sweeps {
            let relaxation = relaxation / weight(settings, sweep);
            let factor = PRESSURE_SHARE * settings.density * relaxation / time_step;
            frame.stencil.for_each_one(Divergence(velocity), frame.images.real(divergence), |i, value, out| {
                *out = match condition(kind[i], &position[i]).pressure {
                    PressureRule::Zero | PressureRule::SolvedWithoutDivergence => 0.0,
                    PressureRule::Solved | PressureRule::FromFluid => value - solenoidal(i),
                };
            });
            extrapolate_scalar(settings, frame, kind, divergence);
            let (corrected, pressure) = (frame.images.real(velocity), frame.images.real(pressure));
            let is_solved = |i: usize| condition(kind[i], &position[i]).velocity == VelocityRule::Solved;
            let correct = |i: usize, gradient: Vector<D>, u: &mut Vector<D>, p: &mut f64| {
                *p -= factor * divergence[i];
                if is_solved(i) {
                    *u += gradient * relaxation;
                }
            };
            let is_last = sweep + 1 == settings.projection_sweeps;
            if is_last && settings.sweep_pressure == SweepPressure::Smooth {
                let (rough, before) = (&mut self.rough, &self.pressure_before);
                frame.images.blank(rough, divergence.len());
                parallel::for_each(frame.images.real(rough), |i, rough| {
                    *rough = [divergence[i], pressure[i] - factor * divergence[i] - before[i]];
                });
                frame.images.fill(rough);
                frame.stencil.for_each(
                    GradientAndLaplacian(rough),
                    corrected,
                    pressure,
                    |i, (gradient, laplacian), u, p| {
                        correct(i, gradient, u, p);
                        if is_solved(i) {
                            *p += laplacian * shortest;
                        }
                    },
                );
            } else {
                frame.stencil.for_each(Gradient(divergence), corrected, pressure, correct);
            }
            frame.images.fill(velocity);
            frame.images.check(divergence);
        }
        frame.images.fill(pressure);
    }
}
