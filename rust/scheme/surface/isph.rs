//! ISPH beside a free surface, with a solve or a few steps of Jacobi's iteration.
//!
//! ```text
//! u* = u^n + Δt (ν ∇²u + f),    ∇²q = ρ/Δt w (∇·(u* + β Δt (g − P(p^n)/ρ)) − θ),    p = β p^n + q,    u^{n+1} = u* + Δt (g − P(p)/ρ)
//! ```
//!
//! with w the weight of a cut support and f what the artificial viscosity does. What the velocity has felt of the old pressure leaves the
//! change to the operator ∇²: with β = 0 water at rest would be what that takes for it, not what P does, and its surface would creep.
//! Beyond walls the pressure goes on with the hydrostatic slope, beyond the surface is air: what both add to ∇² without any p belongs to the
//! right-hand side. Particles that are alone have p = 0.

use super::solids::mirror;
use super::{Pressure, Terms};
use crate::base::{Vector, parallel};
use crate::discretisation::Divergence;
use crate::flow::{Flow, Step};
use crate::particles::Place;
use crate::poisson::{Poisson, System};
use crate::scheme::Solved;
use crate::scheme::isph::Solve;
use crate::scheme::projection::Sweeps;
use crate::settings::{Eigenvalues, Settings};

#[derive(Debug)]
pub struct Solution<const D: usize> {
    /// β.
    pressure_share: f64,
    solve: Solve,
    largest: Eigenvalues,
    sweeps: Sweeps,
    source: Vec<f64>,
    /// p^n.
    before: Vec<f64>,
    /// q.
    change: Vec<f64>,
    /// u* and what it has felt of the old pressure.
    felt: Vec<Vector<D>>,
    poisson: Poisson<D>,
}

impl<const D: usize> Solution<D> {
    pub fn new(settings: &Settings, pressure_share: f64, solve: Solve) -> Self {
        let largest = settings.largest_eigenvalues();
        Self {
            pressure_share,
            solve,
            largest,
            sweeps: Sweeps::new(settings, largest),
            source: Vec::new(),
            before: Vec::new(),
            change: Vec::new(),
            felt: Vec::new(),
            poisson: Poisson::default(),
        }
    }

    /// −∇² of nothing but walls and air, and what is left of ∇·u*.
    fn form_source(&mut self, terms: &mut Terms<D>, step: Step, flow: &mut Flow<D>) {
        let share = self.pressure_share;
        self.felt.clone_from(&terms.velocity_star);
        if share > 0.0 {
            terms.correct_velocity(step, flow);
            terms.forget_reaction(flow.particles.real);
            let velocity = &flow.particles.velocity;
            parallel::for_each(&mut self.felt, |i, u| *u = *u * (1.0 - share) + velocity[i] * share);
            mirror(step.settings, &flow.frame, &flow.particles, &mut self.felt);
        }
        flow.particles.pressure.fill(0.0);
        terms.extend_pressure_above(f64::NEG_INFINITY, step, flow);
        terms.find_pressure_laplacian(flow);
        let Flow { particles, frame, surface, .. } = flow;
        frame.images.blank(&mut self.source, particles.real);
        let (laplacian, derived) = (&terms.pressure_laplacian, &terms.derived);
        // Jacobi's iteration takes the share of all where water splashes.
        let whole = self.solve.is_explicit() && step.settings.splashes();
        let weight = |i: usize| if whole { 1.0 } else { surface.weight[i] };
        let factor = step.settings.density / step.time_step;
        frame.stencil.for_each_one(Divergence(&self.felt), &mut self.source, |i, divergence, out| {
            *out = (1.0 - share) * laplacian[i] - factor * weight(i) * (divergence - derived[i].solenoidal);
        });
    }
}

impl<const D: usize> Pressure<D> for Solution<D> {
    fn advance(&mut self, terms: &mut Terms<D>, step: Step, flow: &mut Flow<D>) -> Solved {
        let share = self.pressure_share;
        terms.predict_velocity(step, flow);
        self.before.clone_from(&flow.particles.pressure);
        self.form_source(terms, step, flow);
        let Flow { particles, frame, surface, .. } = &mut *flow;
        let before = &self.before;
        frame.images.blank(&mut self.change, particles.len());
        parallel::for_each(frame.images.real(&mut self.change), |i, change| *change = (1.0 - share) * before[i]);
        let system = System { settings: step.settings, particles, frame, surface: Some(surface), largest: self.largest };
        let Solve { solver, goal, .. } = self.solve;
        self.poisson.begin(system, solver);
        let solution = self.poisson.solve(system, solver, goal, &mut self.source, &mut self.change);
        let (change, least, place) = (&self.change, terms.least_pressure(), &surface.place);
        parallel::for_each(frame.images.real(&mut particles.pressure), |i, p| {
            *p = if place[i] == Place::Isolated { 0.0 } else { (share * before[i] + change[i]).max(least) };
        });
        terms.extend_pressure(step, flow);
        terms.correct_velocity(step, flow);
        terms.sweep(step, self.sweeps, flow);
        self.solve.solved(solution)
    }

    fn penalty(&self, time_step: f64) -> f64 {
        self.solve.penalty(time_step)
    }

    fn reach(&self, _: f64) -> f64 {
        self.solve.reach()
    }
}
