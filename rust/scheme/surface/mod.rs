//! The ALSPH step of a fluid with a free surface.
//!
//! Equations (8), (10) and (11) with operators that neither make energy nor lose momentum where the support of a particle is cut:
//!
//! ```text
//! u*    = u^n + Δt (r_AL G*(w q) + ν ∇²u),                        q = ∇·u^m − θ                  (8)
//! p^{m+1} = p^m − r_AL w (ρ (∇·u* − θ) − Δt ∇²p^m)                                              (10)
//! u^{m+1} = u* + Δt (g − P(p^{m+1})/ρ)                                                            (11)
//! ```
//!
//! G* is minus the adjoint of the divergence, w a weight that is 1 inside, P a gradient that is antisymmetric in pairs. In ∇²p next to
//! the surface the neighbours that are missing are air, at p = 0.
//!
//! Solids show what images beyond a slip wall do: to the divergence the mean velocity of the fluid around, the other way across the wall, and to
//! gradients of w q its mean, of p its mean continued with the hydrostatic slope. The viscous term sees the wall's velocity by its rule.

use crate::base::{Tensor, Vector, parallel};
use crate::boundary::{VelocityRule, conditions, extrapolate_scalar, shepard};
use crate::discretisation::{AdjointGradient, ConservativeGradient, Divergence, LaplacianAndGradient, LaplacianAndItsSum};
use crate::flow::{Flow, Step};
use crate::frame::Frame;
use crate::particles::{ParticleKind, Particles, of_solids};
use crate::scheme::projection::{Sweeps, weight};
use crate::scheme::{Derived, Scheme, Solved};
use crate::settings::{Eigenvalues, FreeSurface, PressureGradient, Settings, TimeStepLimits};
use crate::surface::{Place, Surface};

/// Height over a surface [Δx] from which on a particle comes no nearer, and its distance to a solid that tells of the surface.
const CLOSE: f64 = 0.25;
const BESIDE: f64 = 1.2;

#[derive(Debug)]
pub struct SurfaceAlsph<const D: usize> {
    own: FreeSurface,
    largest: Eigenvalues,
    sweeps: Sweeps,
    /// r_AL of the step.
    penalty: f64,
    undisturbed: f64,
    derived: Vec<Derived<D>>,
    /// S of u^n, real particles.
    strain_rate: Vec<Tensor<D>>,
    /// Of the real particles that see air: the pressure of that surface.
    surface_pressure: Vec<f64>,
    /// ∇·u less θ.
    divergence: Vec<f64>,
    /// What G* is taken of.
    tensor: Vec<Tensor<D>>,
    /// w q, and u as the divergence sees it, if there are solids.
    pushed: Vec<f64>,
    mirrored: Vec<Vector<D>>,
    velocity_star: Vec<Vector<D>>,
    pressure_laplacian: Vec<f64>,
}

impl<const D: usize> SurfaceAlsph<D> {
    pub fn new(settings: &Settings, own: FreeSurface) -> Self {
        let largest = settings.largest_eigenvalues();
        Self {
            own,
            largest,
            sweeps: Sweeps::new(settings, largest),
            penalty: f64::NAN,
            undisturbed: settings.undisturbed_volume(),
            derived: Vec::new(),
            strain_rate: Vec::new(),
            surface_pressure: Vec::new(),
            divergence: Vec::new(),
            tensor: Vec::new(),
            pushed: Vec::new(),
            mirrored: Vec::new(),
            velocity_star: Vec::new(),
            pressure_laplacian: Vec::new(),
        }
    }

    /// What ∇·u^{n+1} is to be in the frame, and ∇²u^n.
    fn begin(&mut self, step: Step, flow: &mut Flow<D>) {
        let Flow { particles, frame, surface, walls, .. } = flow;
        walls.see(step.settings, particles, frame);
        let walls = &*walls;
        frame.images.blank(&mut self.derived, particles.real);
        frame.images.blank(&mut self.divergence, particles.len());
        frame.images.blank(&mut self.strain_rate, particles.real);
        let (place, density) = (&surface.place, &frame.stencil.number_density);
        let (relaxation, undisturbed) = (self.own.packing_relaxation / step.time_step, self.undisturbed);
        let velocity = &particles.velocity;
        frame.stencil.for_each(
            LaplacianAndGradient { velocity, seen: |s, i| walls.seen_by(particles, s, i) },
            &mut self.derived,
            &mut self.strain_rate,
            |i, (laplacian, gradient), derived, strain_rate| {
                let mut solenoidal = step.settings.derivative_frame.solenoidal_divergence(&gradient, step.time_step);
                if !matches!(place[i], Place::AtSurface | Place::Isolated) {
                    solenoidal += relaxation * (undisturbed * density[i] - 1.0).max(0.0);
                }
                *derived = Derived { laplacian, solenoidal };
                strain_rate.0 = (gradient + gradient.transpose()) * 0.5;
            },
        );
        let (strain_rate, derived) = (&self.strain_rate, &self.derived);
        parallel::for_each(frame.images.real(&mut self.divergence), |i, divergence| {
            *divergence = strain_rate[i].0.trace() - derived[i].solenoidal;
        });
    }

    /// The viscous term next to the surface, where no stress acts on the fluid from outside: of the stress 2ν S it is what the pressure's
    /// gradient is of the pressure, so that Σ u·(term) is minus what 2ν S:S takes. And the pressure that answers the stress there.
    fn free_of_stress(&mut self, step: Step, Flow { particles, frame, surface, .. }: &Flow<D>) {
        let viscosity = step.settings.kinematic_viscosity;
        frame.images.blank(&mut self.surface_pressure, particles.real);
        let strain_rate = &self.strain_rate;
        parallel::for_each(&mut self.surface_pressure, |i, pressure| {
            let normal = surface.normal(i);
            *pressure = if surface.place[i].sees_air() {
                2.0 * step.settings.density * viscosity * (strain_rate[i].0 * normal).dot(&normal)
            } else {
                0.0
            };
        });
        if viscosity == 0.0 {
            return;
        }
        frame.images.blank(&mut self.tensor, particles.len());
        parallel::for_each(frame.images.real(&mut self.tensor), |i, tensor| {
            tensor.0 = strain_rate[i].0 * frame.stencil.correction[i].inverse * 2.0;
        });
        frame.images.fill(&mut self.tensor);
        frame.stencil.for_each_one(
            AdjointGradient { tensor: &self.tensor, own: |_| 1.0 },
            &mut self.derived,
            |i, value, derived| {
                // What a wall does to the stress solids do not tell.
                let is_free = frame.stencil.solids_near(step.settings, i).next().is_none();
                if surface.place[i].sees_air() && is_free {
                    derived.laplacian = value;
                }
            },
        );
    }

    /// w q B of all particles, from the divergence of the fluid.
    fn form_tensor(&mut self, settings: &Settings, Flow { particles, frame, surface, .. }: &Flow<D>) {
        let kind = &particles.kind[..particles.real];
        let (divergence, weight) = (&self.divergence, &surface.weight);
        let pushed = &mut self.pushed;
        if !settings.bodies.is_empty() {
            frame.images.blank(pushed, particles.len());
            parallel::for_each(frame.images.real(pushed), |i, pushed| *pushed = weight[i] * divergence[i]);
            extrapolate_scalar(settings, frame, kind, pushed);
        }
        frame.images.blank(&mut self.tensor, particles.len());
        parallel::for_each(frame.images.real(&mut self.tensor), |i, tensor| {
            let pushed = if kind[i] == ParticleKind::Solid { pushed[i] } else { weight[i] * divergence[i] };
            tensor.0 = frame.stencil.correction[i].inverse * pushed;
        });
        frame.images.fill(&mut self.tensor);
    }

    /// The pressure that images and solids show.
    fn extend_pressure(&self, step: Step, Flow { particles, frame, body_force, surface, .. }: &mut Flow<D>) {
        let (place, settings) = (&surface.place, step.settings);
        let fill = |particles: &mut Particles<D>| {
            frame.images.fill_pressure(&mut particles.pressure, &particles.position, |i| match place[i] {
                Place::Inside | Place::Near => body_force.at(i) * settings.density,
                Place::AtSurface | Place::Isolated => Vector::zeros(),
            });
        };
        fill(particles);
        if settings.bodies.is_empty() {
            return;
        }
        let pressure = &particles.pressure;
        let shown = |s: usize| {
            let mean = shepard(settings, &frame.stencil, s, |j, r_sj| {
                // Nothing is known of the pressure beyond what is at the surface, which may be falling.
                let known = if surface.is_at_surface(j) { 0.0 } else { settings.density };
                [pressure[j] + (body_force.at(j) - body_force.acceleration_of_wall(s)).dot(&r_sj) * known]
            });
            let [p] = mean.unwrap_or([0.0]);
            if self.own.tension { p } else { p.max(0.0) }
        };
        let shown = of_solids(&particles.kind[..particles.real], shown);
        let real = frame.images.real(&mut particles.pressure);
        shown.into_iter().for_each(|(s, p)| real[s] = p);
        fill(particles);
    }

    fn predict_velocity(&mut self, step: Step, flow: &mut Flow<D>) {
        self.form_tensor(step.settings, flow);
        let Flow { particles, frame, before, .. } = flow;
        let condition = conditions(step.settings);
        let (dt, viscosity, penalty) = (step.time_step, step.settings.kinematic_viscosity, self.penalty);
        frame.images.blank(&mut self.velocity_star, particles.len());
        let derived = &self.derived;
        frame.stencil.for_each_one(
            AdjointGradient { tensor: &self.tensor, own: |_| 1.0 },
            frame.images.real(&mut self.velocity_star),
            |i, gradient, star| {
                *star = match condition(particles.kind[i], &particles.position[i]).velocity {
                    VelocityRule::Kept => particles.velocity[i],
                    VelocityRule::Solved => {
                        before.velocity[i] + (gradient * penalty + derived[i].laplacian * viscosity) * dt
                    }
                };
            },
        );
        frame.images.fill(&mut self.velocity_star);
        mirror(step.settings, frame, particles, &mut self.velocity_star);
    }

    fn update_pressure(&mut self, step: Step, flow: &mut Flow<D>) {
        let Flow { particles, frame, surface, .. } = &mut *flow;
        frame.images.blank(&mut self.pressure_laplacian, particles.real);
        let surface = &*surface;
        let Surface { place, weight, .. } = surface;
        let (pressure, air) = (&particles.pressure, &self.surface_pressure);
        frame.stencil.for_each_one(
            LaplacianAndItsSum(pressure),
            &mut self.pressure_laplacian,
            |i, (laplacian, sum), out| {
                *out = if place[i].sees_air() { sum - 2.0 * surface.missing(i) * (pressure[i] - air[i]) } else { laplacian };
            },
        );
        let Particles { kind, pressure, .. } = particles;
        let (density, dt, penalty) = (step.settings.density, step.time_step, self.penalty);
        let (laplacian, derived, tension) = (&self.pressure_laplacian, &self.derived, self.own.tension);
        frame.stencil.for_each_one(Divergence(&self.velocity_star), frame.images.real(pressure), |i, divergence, p| {
            if kind[i] == ParticleKind::Solid {
                return;
            }
            if place[i] == Place::Isolated {
                *p = 0.0;
                return;
            }
            *p -= penalty * weight[i] * (density * (divergence - derived[i].solenoidal) - dt * laplacian[i]);
            if !tension {
                *p = p.max(0.0);
            }
        });
        self.extend_pressure(step, flow);
    }

    fn correct_velocity(&mut self, step: Step, flow: &mut Flow<D>) {
        let Flow { particles, frame, body_force, surface, .. } = flow;
        if self.own.pressure_gradient == PressureGradient::Adjoint {
            frame.images.blank(&mut self.tensor, particles.len());
            parallel::for_each(frame.images.real(&mut self.tensor), |i, tensor| {
                tensor.0 = frame.stencil.correction[i].inverse;
            });
            frame.images.fill(&mut self.tensor);
            // The pressure of an image is its own, beyond a wall across gravity.
            parallel::for_each(&mut self.tensor, |i, tensor| tensor.0 *= particles.pressure[i]);
        }
        let Particles { kind, position, pressure, velocity, .. } = particles;
        let star = &self.velocity_star;
        let condition = conditions(step.settings);
        let (dt, density) = (step.time_step, step.settings.density);
        let correct = |i: usize, gradient: Vector<D>, u: &mut Vector<D>| {
            if condition(kind[i], &position[i]).velocity == VelocityRule::Solved {
                *u = star[i] + (body_force.at(i) - gradient / density) * dt;
            }
        };
        let place = &surface.place;
        // Antisymmetric forces draw particles together that carry a pressure below that of the air, until voids open between them (Swegle,
        // Hicks and Attaway 1995); differences do not (Sun et al. 2018).
        let own = |i: usize| if pressure[i] < 0.0 && place[i] == Place::Inside { -1.0 } else { 1.0 };
        let real = frame.images.real(velocity);
        match self.own.pressure_gradient {
            PressureGradient::Conservative => {
                frame.stencil.for_each_one(ConservativeGradient { pressure, own }, real, correct)
            }
            PressureGradient::Adjoint => {
                frame.stencil.for_each_one(AdjointGradient { tensor: &self.tensor, own }, real, correct)
            }
        }
        frame.images.fill(velocity);
    }

    fn measure_divergence(&mut self, step: Step, Flow { particles, frame, .. }: &Flow<D>) {
        let derived = &self.derived;
        let mut velocity = &particles.velocity;
        if !step.settings.bodies.is_empty() {
            self.mirrored.clone_from(velocity);
            mirror(step.settings, frame, particles, &mut self.mirrored);
            velocity = &self.mirrored;
        }
        frame.stencil.for_each_one(Divergence(velocity), frame.images.real(&mut self.divergence), |i, value, out| {
            *out = value - derived[i].solenoidal
        });
    }

    fn sweep(&mut self, step: Step, flow: &mut Flow<D>) {
        for sweep in 0..step.settings.projection_sweeps {
            let relaxation = self.sweeps.relaxation / weight(step.settings, sweep);
            let factor = step.settings.density * relaxation / step.time_step;
            self.measure_divergence(step, flow);
            self.form_tensor(step.settings, flow);
            let Flow { particles, frame, surface, .. } = &mut *flow;
            let condition = conditions(step.settings);
            let Particles { kind, position, pressure, velocity, .. } = particles;
            let (divergence, weight, tension) = (&self.divergence, &surface.weight, self.own.tension);
            let (real_pressure, real_velocity) = (frame.images.real(pressure), frame.images.real(velocity));
            frame.stencil.for_each(
                AdjointGradient { tensor: &self.tensor, own: |_| 1.0 },
                real_velocity,
                real_pressure,
                |i, gradient, u, p| {
                    if condition(kind[i], &position[i]).velocity == VelocityRule::Solved {
                        *u += gradient * relaxation;
                        *p -= factor * weight[i] * divergence[i];
                        if !tension {
                            *p = p.max(0.0);
                        }
                    }
                },
            );
            frame.images.fill(velocity);
        }
        self.extend_pressure(step, flow);
    }
}

/// Take what is next to a surface no nearer. A pressure that is not below that of the air holds little back where the fluid is thin.
fn keep_out<const D: usize>(settings: &Settings, Flow { particles, frame, .. }: &mut Flow<D>) {
    if settings.bodies.is_empty() {
        return;
    }
    let Particles { kind, normal, depth, velocity, .. } = particles;
    let (stencil, spacing) = (&frame.stencil, settings.particle_spacing);
    let walls = velocity.clone();
    parallel::for_each(frame.images.real(velocity), |i, u| {
        if kind[i] != ParticleKind::Fluid {
            return;
        }
        let (row, lane) = stencil.neighbours.row(i);
        for s in row.solid_seen(lane).map(|(entry, _)| entry.j()) {
            let way = stencil.position[i] - stencil.position[s];
            if way.norm_squared() < (BESIDE * spacing).powi(2) && way.dot(&normal[s]) - depth[s] < CLOSE * spacing {
                let approach = (*u - walls[s]).dot(&normal[s]);
                *u -= normal[s] * approach.min(0.0);
            }
        }
    });
    frame.images.fill(velocity);
}

/// Let solids show what is beyond a slip wall in a mirror: the mean of the fluid around, with the other velocity across the wall.
fn mirror<const D: usize>(settings: &Settings, frame: &Frame<D>, particles: &Particles<D>, velocity: &mut [Vector<D>]) {
    if settings.bodies.is_empty() {
        return;
    }
    let Particles { real, kind, normal, .. } = particles;
    let seen = &*velocity;
    let shown = |s: usize| {
        let own = particles.velocity[s];
        let mean = shepard(settings, &frame.stencil, s, |j, _| seen[j].into()).map_or(own, Vector::from);
        mean - normal[s] * (2.0 * (mean - own).dot(&normal[s]))
    };
    let shown = of_solids(&kind[..*real], shown);
    let real = frame.images.real(velocity);
    shown.into_iter().for_each(|(s, u)| real[s] = u);
    frame.images.fill(velocity);
}

impl<const D: usize> Scheme<D> for SurfaceAlsph<D> {
    fn limits(&self, settings: &Settings, velocity_max: f64) -> TimeStepLimits {
        settings.time_step_limits(velocity_max, self.largest)
    }

    fn solve(&mut self, step: Step, flow: &mut Flow<D>) -> Solved {
        self.penalty = step.settings.penalty(step.velocity_max, step.time_step, self.largest.laplacian);
        self.begin(step, flow);
        self.free_of_stress(step, flow);
        flow.move_solids();
        self.extend_pressure(step, flow);
        for iteration in 1..=step.settings.max_iterations {
            if iteration > 1 {
                self.measure_divergence(step, flow);
            }
            self.predict_velocity(step, flow); // (8)
            self.update_pressure(step, flow); // (10)
            self.correct_velocity(step, flow); // (11)
        }
        self.sweep(step, flow);
        keep_out(step.settings, flow);
        self.measure_divergence(step, flow);
        if !step.settings.bodies.is_empty() {
            flow.walls.see(step.settings, &flow.particles, &flow.frame); // for the loads
        }
        Solved::after(step.settings.max_iterations)
    }

    fn divergence(&self, i: usize) -> f64 {
        self.divergence[i]
    }

    fn acting_pressure(&self, _: Step, particles: &Particles<D>, i: usize) -> f64 {
        particles.pressure[i]
    }

    fn viscous_laplacian(&self, _: Step, i: usize) -> Vector<D> {
        self.derived[i].laplacian
    }

    fn penalty(&self, _: f64) -> f64 {
        self.penalty
    }

    fn reach(&self, time_step: f64) -> f64 {
        (self.penalty * time_step + self.sweeps.reach_squared()).sqrt()
    }
}
