//! The ALSPH step: equations (8) to (13) of the paper.

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::{PressureRule, VelocityRule, conditions, extrapolate_pressure};
use crate::discretisation::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient, vector_laplacian};
use crate::flow::{Flow, Step};
use crate::halo::Poison;
use crate::particles::{ParticleKind, Particles};
use crate::scheme::projection::{Projection, Sweeps};
use crate::scheme::viscous::sharpen;
use crate::scheme::{Outcome, Scheme, Solved};
use crate::settings::{DerivativeFrame, Eigenvalues, Settings, TimeStepLimits, VelocityLaplacian, WallPressure};
use crate::shifting::measures_divergence;

/// The fields of one step beside those of the particles, real particles and images.
#[derive(Debug)]
pub struct Alsph<const D: usize> {
    coefficients: Coefficients,
    /// ∇·u^m less [`Derived::solenoidal`], and p^m side by side, because (8) and (10) read them together.
    divergence_pressure: Vec<[f64; 2]>,
    /// The same of the iteration before, as (8) had it.
    divergence_pressure_before: Vec<[f64; 2]>,
    derived: Vec<Derived<D>>,
    /// What stands beside θ ∇²u^m in the viscous term, the same in all iterations: (1 − θ) ∇²u^n, and at fourth order minus the Laplacian
    /// of [`Walls::dispersion`]. Empty if nothing does.
    explicit: Vec<Vector<D>>,
    /// u*.
    velocity_star: Vec<Vector<D>>,
    pressure_laplacian: Vec<f64>,
    /// ∇p^m near solids, where the pressure is continued into them.
    pressure_gradient: Vec<Vector<D>>,
    projection: Projection,
}

/// What the velocity of a real particle gives beside ∇·u^m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derived<const D: usize> {
    /// ∇²u^m.
    pub laplacian: Vector<D>,
    /// [`DerivativeFrame::solenoidal_divergence`].
    pub solenoidal: f64,
}

impl<const D: usize> Poison for Derived<D> {
    const POISON: Self = Self { laplacian: Poison::POISON, solenoidal: Poison::POISON };
}

/// What the equations are multiplied by.
#[derive(Clone, Copy, Debug)]
pub struct Coefficients {
    /// r_AL of the step.
    penalty: f64,
    largest: Eigenvalues,
    sweeps: Sweeps,
    /// The error of the compact Laplacian of a wave over its square wave number, a length squared.
    dispersion: f64,
}

impl Coefficients {
    fn new(settings: &Settings) -> Self {
        let largest = settings.largest_eigenvalues();
        Self {
            penalty: f64::NAN,
            largest,
            sweeps: Sweeps::new(settings, largest),
            dispersion: settings.laplacian_dispersion() * settings.particle_spacing.powi(2),
        }
    }
}

impl<const D: usize> Scheme<D> for Alsph<D> {
    fn limits(&self, settings: &Settings, velocity_max: f64) -> TimeStepLimits {
        settings.time_step_limits(velocity_max, self.coefficients.largest)
    }

    fn solve(&mut self, step: Step, flow: &mut Flow<D>) -> Solved {
        let largest = self.coefficients.largest.laplacian;
        self.coefficients.penalty = step.settings.penalty(step.velocity_max, step.time_step, largest);
        self.begin(flow);
        self.velocity_derivatives(step, flow);
        self.begin_viscous_term(step, flow);
        flow.move_solids();
        for iteration in 1.. {
            self.predict_velocity(step, flow); // (8)
            self.update_pressure(step, flow); // (10) (20)
            self.correct_velocity(step, flow); // (11)
            if iteration == step.settings.max_iterations {
                let derived = &self.derived;
                self.projection.sweep(step, self.coefficients.sweeps, flow, |i| derived[i].solenoidal);
            }
            if step.settings.derivative_frame == DerivativeFrame::Updated {
                flow.advance_positions(step); // (12): Algorithm 1 takes its derivatives at r^{n+1,m}
                flow.frame.update(step.settings, &flow.particles);
            }
            std::mem::swap(&mut self.divergence_pressure, &mut self.divergence_pressure_before);
            let last = iteration == step.settings.max_iterations;
            if last && measures_divergence(step.settings) {
                flow.walls.see(step.settings, &flow.particles, &flow.frame); // for the loads
                return Solved::after(iteration);
            }
            self.velocity_derivatives(step, flow);
            self.check_images(flow);
            let solved = Solved::after(iteration);
            let outcome = Outcome::new(step.settings, &flow.particles, solved, |i| self.divergence(i)); // (13)
            // The first iteration has the old velocity only in its viscous term.
            let first_order = iteration == 1 && step.settings.viscous_theta < 1.0;
            if (outcome.converged && !first_order) || last || !outcome.divergence_max.is_finite() {
                return solved;
            }
        }
        unreachable!("the loop ends at its cap")
    }

    fn divergence(&self, i: usize) -> f64 {
        self.divergence_pressure[i][0]
    }

    /// p^{n+1}, what the penalty term of (8) pushed with beside it, minus ρ r_AL ∇·u^m, and what the pressure does not keep of the sweeps.
    /// The rest tends to zero with ∇·u, but where the flow turns sharply not in the mean.
    fn acting_pressure(&self, step: Step, particles: &Particles<D>, i: usize) -> f64 {
        let penalty = -step.settings.density * self.coefficients.penalty * self.divergence_pressure_before[i][0];
        particles.pressure[i] + penalty + self.projection.unkept(particles, i)
    }

    fn viscous_laplacian(&self, step: Step, i: usize) -> Vector<D> {
        viscous_laplacian(&self.derived, &self.explicit, step, i)
    }

    fn penalty(&self, _: f64) -> f64 {
        self.coefficients.penalty
    }

    fn reach(&self, time_step: f64) -> f64 {
        (self.penalty(time_step) * time_step + self.coefficients.sweeps.reach_squared()).sqrt()
    }
}

/// θ ∇²u^m of particle `i`, and what stands beside it.
#[inline(always)]
fn viscous_laplacian<const D: usize>(derived: &[Derived<D>], explicit: &[Vector<D>], step: Step, i: usize) -> Vector<D> {
    derived[i].laplacian * step.settings.viscous_theta + explicit.get(i).copied().unwrap_or_else(Vector::zeros)
}

impl<const D: usize> Alsph<D> {
    pub fn new(settings: &Settings) -> Self {
        Self {
            coefficients: Coefficients::new(settings),
            divergence_pressure: Vec::new(),
            divergence_pressure_before: Vec::new(),
            derived: Vec::new(),
            explicit: Vec::new(),
            velocity_star: Vec::new(),
            pressure_laplacian: Vec::new(),
            pressure_gradient: Vec::new(),
            projection: Projection::default(),
        }
    }

    fn begin(&mut self, Flow { particles, frame, .. }: &Flow<D>) {
        let (real, count) = (particles.real, particles.len());
        let images = &frame.images;
        images.blank(&mut self.divergence_pressure, count);
        images.blank(&mut self.divergence_pressure_before, count);
        self.projection.begin();
        images.blank(&mut self.derived, real);
        images.blank(&mut self.velocity_star, count);
        images.blank(&mut self.pressure_laplacian, real);
    }

    /// ∇·u^m and ∇²u^m, and p^m beside ∇·u^m: the first pass over a frame, so it forms the corrections too.
    fn velocity_derivatives(&mut self, step: Step, Flow { particles, frame, walls, .. }: &mut Flow<D>) {
        walls.see(step.settings, particles, frame);
        let (velocity, pressure) = (&particles.velocity, &particles.pressure);
        let walls = &*walls;
        let seen = |s, i| walls.seen_by(particles, s, i);
        frame.stencil.correct_and_for_each(
            LaplacianAndGradient { velocity, seen },
            frame.images.real(&mut self.divergence_pressure),
            &mut self.derived,
            |i, (laplacian, gradient), out, derived| {
                let solenoidal = step.settings.derivative_frame.solenoidal_divergence(&gradient, step.time_step);
                *out = [gradient.trace() - solenoidal, pressure[i]];
                *derived = Derived { laplacian, solenoidal };
            },
        );
        if step.settings.velocity_laplacian == VelocityLaplacian::Vector {
            parallel::for_each(&mut self.derived, |i, derived| {
                derived.laplacian = vector_laplacian(&frame.stencil, velocity, i, |s| seen(s, i));
            });
        }
        frame.images.fill(&mut self.divergence_pressure);
    }

    /// What u^n gives of the viscous term.
    fn begin_viscous_term(&mut self, step: Step, flow: &mut Flow<D>) {
        if step.settings.viscous_order == 4 {
            sharpen(step, flow, |i| self.derived[i].laplacian, self.coefficients.dispersion, &mut self.explicit);
        } else {
            self.explicit.clear();
        }
        let (share, derived) = (1.0 - step.settings.viscous_theta, &self.derived);
        if share > 0.0 {
            self.explicit.resize(flow.particles.real, Vector::zeros());
            parallel::for_each(&mut self.explicit, |i, explicit| *explicit += derived[i].laplacian * share);
        }
    }

    /// u* (8), and ∇²p^m for (10), which reads the same neighbours.
    fn predict_velocity(&mut self, step: Step, Flow { particles, frame, before, body_force, .. }: &Flow<D>) {
        let velocity = &particles.velocity;
        let (dt, viscosity) = (step.time_step, step.settings.kinematic_viscosity);
        let condition = conditions(step.settings);
        let (initial, r_al) = (&before.velocity, self.coefficients.penalty);
        let (derived, explicit) = (&self.derived, &self.explicit);
        frame.stencil.for_each(
            GradientAndLaplacian(&self.divergence_pressure),
            frame.images.real(&mut self.velocity_star),
            &mut self.pressure_laplacian,
            |i, (penalty, p), star, pressure_laplacian| {
                *pressure_laplacian = p;
                *star = match condition(particles.kind[i], &particles.position[i]).pressure {
                    PressureRule::Zero | PressureRule::FromFluid => velocity[i],
                    PressureRule::Solved | PressureRule::SolvedWithoutDivergence => {
                        initial[i]
                            + (penalty * r_al + viscous_laplacian(derived, explicit, step, i) * viscosity + body_force.at(i))
                                * dt
                    }
                };
            },
        );
        frame.images.fill(&mut self.velocity_star);
    }

    /// p^{m+1} (10), with the pressure of solid particles (20).
    fn update_pressure(&mut self, step: Step, flow: &mut Flow<D>) {
        let Flow { particles, frame, before, body_force, .. } = flow;
        if step.settings.wall_pressure == WallPressure::Linear {
            let gradient = &mut self.pressure_gradient;
            frame.images.blank(gradient, particles.len());
            frame.stencil.evaluate_near_solids(Gradient(&particles.pressure), frame.images.real(gradient));
            frame.images.fill(gradient);
        }
        let Particles { kind, normal, position, pressure, .. } = particles;
        let (kind, normal) = (&*kind, &*normal);
        let Step { settings, time_step: dt, .. } = step;
        let penalty = self.coefficients.penalty;
        let paper_walls = settings.wall_pressure == WallPressure::Paper;
        let (star, initial, laplacian) = (&self.velocity_star, &before.velocity, &self.pressure_laplacian);
        let derived = &self.derived;
        let (position, condition) = (&*position, conditions(settings));
        frame.stencil.for_each_one(Divergence(star), frame.images.real(pressure), |i, divergence, p| {
            let source = |divergence: f64| penalty * (settings.density * divergence - dt * laplacian[i]);
            match condition(kind[i], &position[i]).pressure {
                PressureRule::Zero => *p = 0.0,
                PressureRule::Solved => *p -= source(divergence - derived[i].solenoidal),
                PressureRule::SolvedWithoutDivergence => *p -= source(0.0),
                PressureRule::FromFluid => {}
            }
            if paper_walls && kind[i] == ParticleKind::Solid {
                // ∂p/∂n r_s with the pseudo-acceleration Δu/Δt and, from (12), the pseudo-displacement ½ Δu Δt.
                *p += 0.5 * settings.density * (star[i] - initial[i]).dot(&normal[i]).powi(2);
            }
        });
        if paper_walls {
            frame.images.fill(pressure);
        } else {
            extrapolate_pressure(settings, frame, particles, &self.pressure_gradient, body_force);
        }
    }

    /// u^{m+1} (11). Buffers and solids keep their velocities.
    fn correct_velocity(&mut self, step: Step, Flow { particles, frame, .. }: &mut Flow<D>) {
        let Particles { kind, position, pressure, velocity, .. } = particles;
        let (kind, position, pressure, star) = (&*kind, &*position, &*pressure, &self.velocity_star);
        let condition = conditions(step.settings);
        let factor = step.time_step / step.settings.density;
        frame.stencil.for_each_one(Gradient(pressure), frame.images.real(velocity), |i, gradient, u| {
            if condition(kind[i], &position[i]).velocity == VelocityRule::Solved {
                *u = star[i] - gradient * factor;
            }
        });
        frame.images.fill(&mut particles.velocity);
    }

    /// Panic if a stage has left stale images that look fresh. Nothing unless poison is on.
    fn check_images(&self, Flow { particles, frame, walls, .. }: &Flow<D>) {
        let images = &frame.images;
        images.check_positions(&particles.position);
        for field in
            [&particles.velocity, &self.velocity_star, &self.pressure_gradient, &walls.viscous_velocity, &walls.dispersion]
        {
            images.check(field);
        }
        [&particles.pressure, &frame.stencil.volume].into_iter().for_each(|field| images.check(field));
        images.check(&self.divergence_pressure);
    }
}
