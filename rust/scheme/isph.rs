//! Projection ISPH: a pressure from its Poisson equation makes the predicted velocity free of divergence.
//!
//! ```text
//! u* = u^n + Δt (ν ∇²u^n + g − β ∇p^n/ρ),    ∇²q = ρ/Δt (∇·u* − θ),    p^{n+1} = β p^n + q,    u^{n+1} = u* − Δt/ρ ∇q
//! ```
//!
//! with the compact Laplacian, so that a divergence of the order Δx² stays (an approximate projection). β = 0 solves the pressure anew (Cummins and
//! Rudman 1999; Shadloo et al. 2011), β = 1 its change. θ is [`DerivativeFrame::solenoidal_divergence`], and with a density that is
//! constrained, too, α (n/n₀ − 1)/Δt beside it, of the number density n and the lattice's n₀. Solids show q with ∂q/∂n = 0
//! to the Laplacian, and the fluid has their share of the flux into walls ([`add_wall_flux`]); to the gradient they show the pressure of the
//! rule for walls.
//!
//! [`DerivativeFrame::solenoidal_divergence`]: crate::settings::DerivativeFrame::solenoidal_divergence

use crate::base::{Matrix, Vector, parallel};
use crate::boundary::{PressureRule, VelocityRule, add_wall_flux, conditions, extend_pressure};
use crate::discretisation::{Divergence, Gradient};
use crate::flow::{Flow, Step};
use crate::particles::Particles;
use crate::poisson::{Goal, Poisson, Solution, System};
use crate::scheme::projection::{Projection, Sweeps};
use crate::scheme::viscous::Viscous;
use crate::scheme::{Scheme, Solved};
use crate::settings::{Eigenvalues, ProjectionSettings, Settings, Solver, TimeStepLimits, jacobi_damping};
use crate::shifting::measures_divergence;

/// Damping of Jacobi's iteration (Muta, Ramachandran and Negi 2020).
const JACOBI_DAMPING: f64 = 0.5;

/// The share of u^n's flux into walls, the answer of the step before, that is not answered again. What that answer left is mostly the
/// disorder of the particles, and with it the forces on bodies are three times as noisy. Where no pressure stands yet nothing was answered.
const ANSWERED: f64 = 0.8;

/// How the pressure comes from its equation.
#[derive(Clone, Copy, Debug)]
pub struct Solve {
    pub solver: Solver,
    pub goal: Goal,
    /// (c Δt)² of an explicit pressure, whose waves have the speed c; NaN of a solved one.
    relaxed: f64,
}

impl Solve {
    pub fn new(own: ProjectionSettings) -> Self {
        let ProjectionSettings { solver, tolerance, max_solver_iterations: max_iterations, .. } = own;
        Self { solver, goal: Goal { tolerance, max_iterations, damping: JACOBI_DAMPING }, relaxed: f64::NAN }
    }

    /// By so many steps of Jacobi's iteration from the old pressure in place of a solve (Hosseini, Manzari and Hannani 2007; Rafiee and
    /// Thiagarajan 2009; Barcarolo et al. 2012): as waves, whose divergence a step takes off.
    pub fn explicit(settings: &Settings, sweeps: usize) -> Self {
        let (damping, relaxed) = (jacobi_damping(sweeps), settings.explicit_reach(sweeps).powi(2));
        Self { solver: Solver::Jacobi, goal: Goal { tolerance: 0.0, max_iterations: sweeps, damping }, relaxed }
    }

    pub fn is_explicit(&self) -> bool {
        self.relaxed.is_finite()
    }

    /// How a solve ended, of an explicit pressure how many steps it took.
    pub fn solved(&self, Solution { iterations, residual, within_tolerance }: Solution) -> Solved {
        if self.is_explicit() {
            return Solved::after(iterations);
        }
        Solved { iterations, residual, within_tolerance: (self.goal.tolerance > 0.0).then_some(within_tolerance) }
    }

    /// See [`Scheme::penalty`].
    pub fn penalty(&self, time_step: f64) -> f64 {
        self.relaxed / time_step
    }

    /// See [`Scheme::reach`].
    pub fn reach(&self) -> f64 {
        if self.is_explicit() { self.relaxed.sqrt() } else { f64::INFINITY }
    }
}

/// The fields of one step beside those of the particles, real particles and, where they have neighbours that read them, images.
#[derive(Debug)]
pub struct Isph<const D: usize> {
    /// β.
    pressure_share: f64,
    solve: Solve,
    /// α.
    density_relaxation: f64,
    /// V of a particle of the undisturbed lattice.
    undisturbed: f64,
    largest: Eigenvalues,
    sweeps: Sweeps,
    viscous: Viscous<D>,
    /// θ.
    solenoidal: Vec<f64>,
    /// u*.
    velocity_star: Vec<Vector<D>>,
    /// ∇·u*, then the right-hand side.
    source: Vec<f64>,
    handed: Vec<f64>,
    /// β p^n as the gradient saw it.
    base: Vec<f64>,
    /// q.
    change: Vec<f64>,
    /// ∇p near solids, where the pressure is continued into them.
    near_walls: Vec<Vector<D>>,
    divergence: Vec<f64>,
    poisson: Poisson<D>,
    projection: Projection,
}

impl<const D: usize> Isph<D> {
    pub fn new(settings: &Settings, own: ProjectionSettings) -> Self {
        Self::with(settings, Solve::new(own), own.pressure_share, own.density_relaxation)
    }

    /// See [`Solve::explicit`].
    pub fn explicit(settings: &Settings, sweeps: usize, density_relaxation: f64) -> Self {
        Self::with(settings, Solve::explicit(settings, sweeps), 0.0, density_relaxation)
    }

    fn with(settings: &Settings, solve: Solve, pressure_share: f64, density_relaxation: f64) -> Self {
        let largest = settings.largest_eigenvalues();
        Self {
            pressure_share,
            solve,
            density_relaxation,
            undisturbed: settings.undisturbed_volume(),
            largest,
            sweeps: Sweeps::new(settings, largest),
            viscous: Viscous::new(settings),
            solenoidal: Vec::new(),
            velocity_star: Vec::new(),
            source: Vec::new(),
            handed: Vec::new(),
            base: Vec::new(),
            change: Vec::new(),
            near_walls: Vec::new(),
            divergence: Vec::new(),
            poisson: Poisson::default(),
            projection: Projection::default(),
        }
    }

    /// The pressure that images and solids show.
    fn extend_pressure(&mut self, settings: &Settings, Flow { particles, frame, body_force, .. }: &mut Flow<D>) {
        extend_pressure(settings, frame, particles, body_force, &mut self.near_walls);
    }

    /// u*. Buffers and solids keep their velocities.
    fn predict_velocity(&mut self, step: Step, flow: &mut Flow<D>) {
        let share = self.pressure_share;
        if share > 0.0 {
            self.extend_pressure(step.settings, flow);
        }
        let Flow { particles, frame, body_force, motion, .. } = flow;
        frame.images.blank(&mut self.base, particles.len());
        parallel::for_each(&mut self.base, |i, p| *p = if share > 0.0 { share * particles.pressure[i] } else { 0.0 });
        frame.images.blank(&mut self.velocity_star, particles.len());
        let (velocity, viscous) = (&particles.velocity, &self.viscous);
        let condition = conditions(step.settings);
        let star = |i: usize, gradient: Vector<D>| match condition(particles.kind[i], &particles.position[i]).velocity {
            VelocityRule::Kept => velocity[i],
            VelocityRule::Solved => {
                let viscous = viscous.laplacian(i) * step.settings.kinematic_viscosity;
                velocity[i] + (viscous + body_force.at(i) - gradient / step.settings.density) * step.time_step
            }
        };
        let out = frame.images.real(&mut self.velocity_star);
        if share > 0.0 {
            frame.stencil.for_each_one(Gradient(&self.base), out, |i, gradient, out| *out = star(i, gradient));
        } else {
            parallel::for_each(out, |i, out| *out = star(i, Vector::zeros()));
        }
        motion.give_velocity(frame.images.real(&mut self.velocity_star));
        frame.images.fill(&mut self.velocity_star);
    }

    /// Let θ take off α of the error of the number density.
    fn constrain_density(&mut self, step: Step, volume: &[f64]) {
        let (factor, undisturbed) = (self.density_relaxation / step.time_step, self.undisturbed);
        if factor > 0.0 {
            parallel::for_each(&mut self.solenoidal, |i, theta| *theta += factor * (undisturbed / volume[i] - 1.0));
        }
    }

    /// −ρ/Δt (∇·u* − θ), as the equation of each particle has it.
    fn form_source(&mut self, step: Step, Flow { particles, frame, .. }: &Flow<D>) {
        frame.images.blank(&mut self.source, particles.real);
        let star = &self.velocity_star;
        frame.stencil.for_each_one(Divergence(star), &mut self.source, |_, divergence, out| *out = divergence);
        let starts = particles.pressure[..particles.real].iter().all(|&p| p == 0.0);
        let answered = if starts { 0.0 } else { ANSWERED };
        let flux_of = |j: usize| star[j] - particles.velocity[j] * answered;
        // A pressure that begins anew has but this step to answer in.
        let corners = starts || self.pressure_share == 0.0 && !self.solve.is_explicit();
        add_wall_flux(step.settings, particles, frame, flux_of, corners, &mut self.handed, &mut self.source);
        let (condition, factor) = (conditions(step.settings), step.settings.density / step.time_step);
        parallel::for_each(&mut self.source, |i, source| {
            *source = match condition(particles.kind[i], &particles.position[i]).pressure {
                PressureRule::Solved => -factor * (*source - self.solenoidal[i]),
                _ => 0.0,
            };
        });
    }

    /// p^{n+1} and u^{n+1}.
    fn correct_velocity(&mut self, step: Step, flow: &mut Flow<D>) {
        let Flow { particles, frame, .. } = &mut *flow;
        parallel::for_each(frame.images.real(&mut particles.pressure), |i, p| *p = self.base[i] + self.change[i]);
        self.extend_pressure(step.settings, flow);
        let Flow { particles, frame, .. } = flow;
        parallel::for_each(&mut self.change, |i, change| *change = particles.pressure[i] - self.base[i]);
        let Particles { kind, position, velocity, .. } = particles;
        let (star, factor, condition) =
            (&self.velocity_star, step.time_step / step.settings.density, conditions(step.settings));
        frame.stencil.for_each_one(Gradient(&self.change), frame.images.real(velocity), |i, gradient, u| {
            if condition(kind[i], &position[i]).velocity == VelocityRule::Solved {
                *u = star[i] - gradient * factor;
            }
        });
        frame.images.fill(velocity);
    }
}

impl<const D: usize> Scheme<D> for Isph<D> {
    fn limits(&self, settings: &Settings, velocity_max: f64) -> TimeStepLimits {
        settings.time_step_limits(velocity_max, self.largest)
    }

    fn solve(&mut self, step: Step, flow: &mut Flow<D>) -> Solved {
        self.projection.begin();
        let (frame, time_step) = (step.settings.derivative_frame, step.time_step);
        let solenoidal = |gradient: &Matrix<D>| frame.solenoidal_divergence(gradient, time_step);
        self.viscous.begin(step, flow, &mut self.solenoidal, solenoidal);
        self.constrain_density(step, &flow.frame.stencil.volume);
        self.predict_velocity(step, flow);
        self.form_source(step, flow);
        flow.move_solids();
        let Flow { particles, frame, .. } = &mut *flow;
        let share = self.pressure_share;
        frame.images.blank(&mut self.change, particles.len());
        parallel::for_each(frame.images.real(&mut self.change), |i, change| *change = (1.0 - share) * particles.pressure[i]);
        let Solve { solver, goal, .. } = self.solve;
        let system = System { settings: step.settings, particles, frame, surface: None, largest: self.largest };
        self.poisson.begin(system, solver);
        let solution = self.poisson.solve(system, solver, goal, &mut self.source, &mut self.change);
        self.correct_velocity(step, flow);
        let solenoidal = &self.solenoidal;
        if step.settings.projection_sweeps > 0 {
            self.projection.sweep(step, self.sweeps, flow, |i| solenoidal[i]);
        }
        if !measures_divergence(step.settings) {
            let Flow { particles, frame, .. } = &*flow;
            frame.images.blank(&mut self.divergence, particles.real);
            frame.stencil.for_each_one(Divergence(&particles.velocity), &mut self.divergence, |i, value, out| {
                *out = value - solenoidal[i];
            });
        }
        flow.walls.see(step.settings, &flow.particles, &flow.frame); // for the loads
        self.solve.solved(solution)
    }

    fn divergence(&self, i: usize) -> f64 {
        self.divergence[i]
    }

    fn acting_pressure(&self, _: Step, particles: &Particles<D>, i: usize) -> f64 {
        particles.pressure[i] + self.projection.unkept(particles, i)
    }

    fn viscous_laplacian(&self, _: Step, i: usize) -> Vector<D> {
        self.viscous.laplacian(i)
    }

    fn penalty(&self, time_step: f64) -> f64 {
        self.solve.penalty(time_step)
    }

    fn reach(&self, _: f64) -> f64 {
        self.solve.reach()
    }
}
