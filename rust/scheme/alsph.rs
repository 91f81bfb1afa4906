//! The ALSPH step: equations (8) to (13) of the paper.

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::{Walls, deep_in_inlet, extrapolate};
use crate::discretisation::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient, vector_laplacian};
use crate::frame::Frame;
use crate::halo::Poison;
use crate::particles::{ParticleKind, Particles};
use crate::scheme::projection::Projection;
use crate::settings::{DerivativeFrame, Settings, VelocityLaplacian, WallPressure};
use crate::shifting::measures_divergence;

/// How a step ended.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    pub iterations: usize,
    /// Whether ε of (13) was reached, else the cap ended the iteration.
    pub converged: bool,
    /// max |∇·u| over the fluid.
    pub divergence_max: f64,
    /// Σ |∇·u| over the fluid.
    pub divergence_sum: f64,
}

impl Outcome {
    /// That of so many iterations which left this ∇·u, less [`Derived::solenoidal`].
    pub fn new<const D: usize>(
        settings: &Settings,
        particles: &Particles<D>,
        iterations: usize,
        divergence: impl Fn(usize) -> f64 + Sync,
    ) -> Self {
        let norms = |range: std::ops::Range<usize>| {
            range.filter(|&i| particles.kind[i] == ParticleKind::Fluid).fold((0.0, 0.0), |(max, sum): (f64, f64), i| {
                let value = divergence(i).abs();
                // NaN must not hide behind max, which drops it.
                (if value > max || value.is_nan() { value } else { max }, sum + value)
            })
        };
        let larger = |a: f64, b: f64| if b > a || b.is_nan() { b } else { a };
        let (divergence_max, divergence_sum) =
            parallel::reduce(particles.real, norms, |a, b| (larger(a.0, b.0), a.1 + b.1)).unwrap_or_default();
        let converged = divergence_max <= settings.divergence_tolerance;
        Self { iterations, converged, divergence_max, divergence_sum }
    }
}

/// The fields of one step beside those of the particles, real particles and images.
#[derive(Debug, Default)]
pub struct Alsph<const D: usize> {
    /// r^n, u^n, p^n of the real particles.
    pub position_initial: Vec<Vector<D>>,
    pub velocity_initial: Vec<Vector<D>>,
    pub pressure_initial: Vec<f64>,
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

/// What stays the same during one step.
#[derive(Clone, Copy)]
pub struct Step<'a> {
    pub settings: &'a Settings,
    /// Δt.
    pub time_step: f64,
    /// r_AL.
    pub penalty: f64,
    /// σ of the projection sweeps, a length squared.
    pub relaxation: f64,
    /// The error of the compact Laplacian of a wave over its square wave number, a length squared.
    pub dispersion: f64,
    /// One over the largest eigenvalue of the compact Laplacian, a length squared: so much of it takes the shortest waves off.
    pub shortest: f64,
}

impl<const D: usize> Alsph<D> {
    /// Advance velocity and pressure to n+1 and leave `particles.position` at the frame of the last derivatives; see
    /// [`Alsph::advance_positions`]. `frame` holds the stencil at r^n, or in the middle of the step. Returns the number of iterations;
    /// what they leave of ∇·u is found with the shift where that can ([`measures_divergence`]), else by [`Alsph::divergence`].
    pub fn iterate(
        &mut self,
        step: Step,
        particles: &mut Particles<D>,
        frame: &mut Frame<D>,
        walls: &mut Walls<D>,
    ) -> usize {
        self.begin(particles, frame);
        self.velocity_derivatives(step, particles, frame, walls);
        self.begin_viscous_term(step, particles, frame, walls);
        for iteration in 1.. {
            self.predict_velocity(step, particles, frame); // (8)
            self.update_pressure(step, particles, frame); // (10) (20)
            self.correct_velocity(step, particles, frame); // (11)
            if iteration == step.settings.max_iterations {
                self.projection.sweep(step, particles, frame, &self.derived);
            }
            if step.settings.derivative_frame == DerivativeFrame::Updated {
                self.advance_positions(step, particles, frame); // (12): Algorithm 1 takes its derivatives at r^{n+1,m}
                frame.update(step.settings, particles);
            }
            std::mem::swap(&mut self.divergence_pressure, &mut self.divergence_pressure_before);
            let last = iteration == step.settings.max_iterations;
            if last && measures_divergence(step.settings) {
                walls.see(step.settings, particles, frame); // for the loads
                return iteration;
            }
            self.velocity_derivatives(step, particles, frame, walls);
            self.check_images(particles, frame, walls);
            let outcome = Outcome::new(step.settings, particles, iteration, |i| self.divergence(i)); // (13)
            // The first iteration has the old velocity only in its viscous term.
            let first_order = iteration == 1 && step.settings.viscous_theta < 1.0;
            if (outcome.converged && !first_order) || last || !outcome.divergence_max.is_finite() {
                return iteration;
            }
        }
        unreachable!("the loop ends at its cap")
    }

    /// What the velocity of the step had the gradient of: p^{n+1}, what the penalty term of (8) pushed with beside it, minus ρ r_AL ∇·u^m, and what
    /// the pressure does not keep of the sweeps. The rest tends to zero with ∇·u, but where the flow turns sharply not in the mean.
    pub fn acting_pressure(&self, step: Step, particles: &Particles<D>, i: usize) -> f64 {
        let penalty = -step.settings.density * step.penalty * self.divergence_pressure_before[i][0];
        particles.pressure[i] + penalty + self.projection.unkept(particles, i)
    }

    /// ∇·u of the last derivatives, less [`Derived::solenoidal`].
    pub fn divergence(&self, i: usize) -> f64 {
        self.divergence_pressure[i][0]
    }

    fn begin(&mut self, particles: &Particles<D>, frame: &Frame<D>) {
        let (real, count) = (particles.real, particles.len());
        let start = if frame.start.is_empty() { &particles.position[..real] } else { &frame.start[..] };
        copy(start, &mut self.position_initial);
        copy(&particles.velocity[..real], &mut self.velocity_initial);
        copy(&particles.pressure[..real], &mut self.pressure_initial);
        let images = &frame.images;
        images.blank(&mut self.divergence_pressure, count);
        images.blank(&mut self.divergence_pressure_before, count);
        self.projection.begin();
        images.blank(&mut self.derived, real);
        images.blank(&mut self.velocity_star, count);
        images.blank(&mut self.pressure_laplacian, real);
    }

    /// ∇·u^m and ∇²u^m, and p^m beside ∇·u^m: the first pass over a frame, so it forms the corrections too.
    fn velocity_derivatives(&mut self, step: Step, particles: &Particles<D>, frame: &mut Frame<D>, walls: &mut Walls<D>) {
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
        frame.images.scalars(&mut self.divergence_pressure);
    }

    /// What u^n gives of the viscous term.
    fn begin_viscous_term(&mut self, step: Step, particles: &Particles<D>, frame: &Frame<D>, walls: &mut Walls<D>) {
        if step.settings.viscous_order == 4 {
            self.sharpen_laplacian(step, particles, frame, walls);
        } else {
            self.explicit.clear();
        }
        let (share, derived) = (1.0 - step.settings.viscous_theta, &self.derived);
        if share > 0.0 {
            self.explicit.resize(particles.real, Vector::zeros());
            parallel::for_each(&mut self.explicit, |i, explicit| *explicit += derived[i].laplacian * share);
        }
    }

    /// The error of the compact Laplacian of a wave of wave number k is `dispersion` k² of it: take it off.
    fn sharpen_laplacian(&mut self, step: Step, particles: &Particles<D>, frame: &Frame<D>, walls: &mut Walls<D>) {
        walls.sharpen(step.settings, particles, frame, |i| self.derived[i].laplacian, step.dispersion);
        let dispersion = &walls.dispersion;
        let count = particles.real;
        frame.images.blank(&mut self.explicit, count);
        frame.stencil.for_each_one(
            LaplacianAndGradient { velocity: dispersion, seen: |s: usize, _: usize| dispersion[s] },
            &mut self.explicit,
            |_, (laplacian, _), out| *out = -laplacian,
        );
    }

    /// u* (8), and ∇²p^m for (10), which reads the same neighbours.
    fn predict_velocity(&mut self, step: Step, particles: &Particles<D>, frame: &Frame<D>) {
        let gravity = Vector::<D>::from_column_slice(&step.settings.body_force);
        let (dt, viscosity) = (step.time_step, step.settings.kinematic_viscosity);
        let paper_walls = step.settings.wall_pressure == WallPressure::Paper;
        let (initial, derived) = (&self.velocity_initial, &self.derived);
        let theta = step.settings.viscous_theta;
        let explicit = |i: usize| self.explicit.get(i).copied().unwrap_or_else(Vector::zeros);
        frame.stencil.for_each(
            GradientAndLaplacian(&self.divergence_pressure),
            frame.images.real(&mut self.velocity_star),
            &mut self.pressure_laplacian,
            |i, (penalty, p), star, pressure_laplacian| {
                let still = match particles.kind[i] {
                    ParticleKind::Outlet => true,
                    ParticleKind::Solid => !paper_walls,
                    _ => false,
                };
                *pressure_laplacian = p;
                *star = if still {
                    initial[i]
                } else {
                    initial[i]
                        + (penalty * step.penalty + (derived[i].laplacian * theta + explicit(i)) * viscosity + gravity) * dt
                };
            },
        );
        frame.images.vectors(&mut self.velocity_star);
    }

    /// p^{m+1} (10), with the pressure of solid particles (20).
    fn update_pressure(&mut self, step: Step, particles: &mut Particles<D>, frame: &Frame<D>) {
        if step.settings.wall_pressure == WallPressure::Linear {
            let gradient = &mut self.pressure_gradient;
            frame.images.blank(gradient, particles.len());
            frame.stencil.evaluate_near_solids(Gradient(&particles.pressure), frame.images.real(gradient));
            frame.images.vectors(gradient);
        }
        let Particles { kind, normal, position, pressure, .. } = particles;
        let (kind, normal) = (&*kind, &*normal);
        let Step { settings, time_step: dt, penalty, .. } = step;
        let paper_walls = settings.wall_pressure == WallPressure::Paper;
        let (star, initial, laplacian) = (&self.velocity_star, &self.velocity_initial, &self.pressure_laplacian);
        let derived = &self.derived;
        let (position, deep_in_inlet) = (&*position, deep_in_inlet(settings));
        frame.stencil.for_each_one(Divergence(star), frame.images.real(pressure), |i, divergence, p| {
            let solid = kind[i] == ParticleKind::Solid;
            let divergence = if deep_in_inlet(kind[i], &position[i]) { 0.0 } else { divergence - derived[i].solenoidal };
            if kind[i] == ParticleKind::Outlet {
                *p = 0.0;
            } else if !solid || paper_walls {
                *p -= penalty * (settings.density * divergence - dt * laplacian[i]);
            }
            if solid && paper_walls {
                // ∂p/∂n r_s with the pseudo-acceleration Δu/Δt and, from (12), the pseudo-displacement ½ Δu Δt.
                *p += 0.5 * settings.density * (star[i] - initial[i]).dot(&normal[i]).powi(2);
            }
        });
        if paper_walls {
            frame.images.scalars(pressure);
        } else {
            self.extrapolate_wall_pressure(settings, particles, frame);
        }
    }

    /// The pressure of solid particles: the Shepard average of the fluid's, with the hydrostatic term (Adami, Hu and Adams 2012,
    /// eq. 27; bodies do not accelerate) or continued along its gradient.
    fn extrapolate_wall_pressure(&self, settings: &Settings, particles: &mut Particles<D>, frame: &Frame<D>) {
        let gravity = Vector::<D>::from_column_slice(&settings.body_force);
        let Particles { real, kind, pressure, .. } = particles;
        let gradient = |j: usize| match settings.wall_pressure {
            WallPressure::Linear => self.pressure_gradient[j],
            _ => gravity * settings.density,
        };
        let continued = |pressure: &[f64], j: usize, r_ij: Vector<D>| pressure[j] + gradient(j).dot(&r_ij);
        extrapolate(settings, frame, &kind[..*real], pressure, continued);
    }

    /// u^{m+1} (11). Buffers and solids keep their velocities.
    fn correct_velocity(&mut self, step: Step, particles: &mut Particles<D>, frame: &Frame<D>) {
        let Particles { kind, pressure, velocity, .. } = particles;
        let (kind, pressure, star) = (&*kind, &*pressure, &self.velocity_star);
        let factor = step.time_step / step.settings.density;
        frame.stencil.for_each_one(Gradient(pressure), frame.images.real(velocity), |i, gradient, u| {
            if kind[i] == ParticleKind::Fluid {
                *u = star[i] - gradient * factor;
            }
        });
        frame.images.vectors(&mut particles.velocity);
    }

    /// r^{n+1} (12), for everything that moves with its velocity.
    pub fn advance_positions(&self, step: Step, particles: &mut Particles<D>, frame: &Frame<D>) {
        let mut position = std::mem::take(&mut particles.position);
        parallel::for_each(frame.images.real(&mut position), |i, r| {
            if !particles.is_fixed(i, &step.settings.bodies) {
                let velocity = self.velocity_initial[i] + particles.velocity[i];
                *r = self.position_initial[i] + velocity * (0.5 * step.time_step);
            }
        });
        frame.images.positions(&mut position);
        particles.position = position;
    }

    /// Panic if a stage has left stale images that look fresh. Nothing unless poison is on.
    fn check_images(&self, particles: &Particles<D>, frame: &Frame<D>, walls: &Walls<D>) {
        let images = &frame.images;
        images.check(&particles.position, |k, x| images.position(k, x));
        for field in
            [&particles.velocity, &self.velocity_star, &self.pressure_gradient, &walls.viscous_velocity, &walls.dispersion]
        {
            images.check(field, |k, u| images.vector(k, u));
        }
        for field in [&particles.pressure, &frame.stencil.volume] {
            images.check(field, |_, value| value);
        }
        images.check(&self.divergence_pressure, |_, value| value);
    }
}

fn copy<T: Copy>(from: &[T], to: &mut Vec<T>) {
    to.clear();
    to.extend_from_slice(from);
}
