//! ALSPH beside a free surface: equations (8), (10) and (11).
//!
//! ```text
//! u*    = u^n + Δt (r_AL G*(w q) + ν ∇²u + f),                    q = ∇·u^m − θ                  (8)
//! p^{m+1} = p^m − r_AL w (ρ (∇·u* − θ) − Δt ∇²p^m)                                              (10)
//! u^{m+1} = u* + Δt (g − P(p^{m+1})/ρ)                                                            (11)
//! ```
//!
//! with f what the artificial viscosity does.

use super::{Pressure, Terms};
use crate::boundary::{VelocityRule, conditions};
use crate::discretisation::{AdjointGradient, Divergence};
use crate::flow::{Flow, Step};
use crate::particles::{ParticleKind, Particles, Place};
use crate::scheme::Solved;
use crate::scheme::projection::Sweeps;
use crate::settings::{Eigenvalues, Settings};

#[derive(Debug)]
pub struct Penalty {
    largest: Eigenvalues,
    sweeps: Sweeps,
    /// r_AL of the step.
    penalty: f64,
}

impl Penalty {
    pub fn new(settings: &Settings) -> Self {
        let largest = settings.largest_eigenvalues();
        Self { largest, sweeps: Sweeps::new(settings, largest), penalty: f64::NAN }
    }

    /// (8)
    fn predict_velocity<const D: usize>(&self, terms: &mut Terms<D>, step: Step, flow: &Flow<D>) {
        terms.form_tensor(step.settings, flow);
        let Flow { particles, frame, before, .. } = flow;
        let condition = conditions(step.settings);
        let (dt, penalty) = (step.time_step, self.penalty);
        frame.images.blank(&mut terms.velocity_star, particles.len());
        let friction = &terms.friction;
        frame.stencil.for_each_one(
            AdjointGradient { tensor: &terms.tensor, own: |_| 1.0 },
            frame.images.real(&mut terms.velocity_star),
            |i, gradient, star| {
                *star = match condition(particles.kind[i], &particles.position[i]).velocity {
                    VelocityRule::Kept => particles.velocity[i],
                    VelocityRule::Solved => before.velocity[i] + (gradient * penalty + friction[i]) * dt,
                };
            },
        );
        terms.forget_reaction(particles.real);
        terms.react_to_tensor(flow, penalty * step.settings.density);
        terms.show_predicted(step.settings, flow);
    }

    /// (10)
    fn update_pressure<const D: usize>(&self, terms: &mut Terms<D>, step: Step, flow: &mut Flow<D>) {
        terms.find_pressure_laplacian(flow);
        let Flow { particles, frame, surface, .. } = &mut *flow;
        let Particles { kind, pressure, .. } = particles;
        let (place, weight) = (&surface.place, &surface.weight);
        let (density, dt, penalty) = (step.settings.density, step.time_step, self.penalty);
        let (laplacian, derived, least) = (&terms.pressure_laplacian, &terms.derived, terms.least_pressure());
        frame.stencil.for_each_one(Divergence(&terms.velocity_star), frame.images.real(pressure), |i, divergence, p| {
            if kind[i] == ParticleKind::Solid {
                return;
            }
            if place[i] == Place::Isolated {
                *p = 0.0;
                return;
            }
            *p -= penalty * weight[i] * (density * (divergence - derived[i].solenoidal) - dt * laplacian[i]);
            *p = p.max(least);
        });
        terms.extend_pressure(step, flow);
    }
}

impl<const D: usize> Pressure<D> for Penalty {
    fn advance(&mut self, terms: &mut Terms<D>, step: Step, flow: &mut Flow<D>) -> Solved {
        self.penalty = step.settings.penalty(step.velocity_max, step.time_step, self.largest.laplacian);
        for iteration in 1..=step.settings.max_iterations {
            if iteration > 1 {
                terms.measure_divergence(step, flow);
            }
            self.predict_velocity(terms, step, flow);
            self.update_pressure(terms, step, flow);
            terms.correct_velocity(step, flow); // (11)
        }
        terms.sweep(step, self.sweeps, flow);
        Solved::after(step.settings.max_iterations)
    }

    fn penalty(&self, _: f64) -> f64 {
        self.penalty
    }

    fn reach(&self, time_step: f64) -> f64 {
        (self.penalty * time_step + self.sweeps.reach_squared()).sqrt()
    }
}
