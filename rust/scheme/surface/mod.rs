//! What the schemes have in common beside a free surface.
//!
//! Their terms neither make energy nor lose momentum where the support of a particle is cut:
//!
//! ```text
//! u^{n+1} = u* + Δt (g − P(p)/ρ),    sweeps  u ← u + σ G*(w q),  p ← p − ρσ/Δt w q,    q = ∇·u − θ
//! ```
//!
//! G* is minus the adjoint of the divergence, w a weight that is 1 inside, P a gradient that is antisymmetric in pairs. In ∇²p next to
//! the surface the neighbours that are missing are air, at p = 0.
//!
//! Solids show what images beyond a slip wall do: to the divergence the mean velocity of the fluid around, the other way across the wall, and to
//! gradients of w q its mean, of p its mean continued with the hydrostatic slope. The viscous term sees the wall's velocity by its rule.

mod alsph;
mod energy;
mod friction;
mod isph;
mod solids;
mod weakly_compressible;

use crate::base::{Tensor, Vector, parallel};
use crate::boundary::{VelocityRule, conditions, extrapolate_scalar};
use crate::discretisation::{AdjointGradient, ConservativeGradient, Divergence, LaplacianAndGradient, LaplacianAndItsSum};
use crate::flow::{Flow, Step};
use crate::frame::Frame;
use crate::loads::pairs;
use crate::particles::{ParticleKind, Particles, Place, of_solids};
use crate::scheme::isph::Solve;
use crate::scheme::projection::{Sweeps, weight};
use crate::scheme::{Derived, Scheme, Solved, Taken};
use crate::settings::{
    DensityDiffusion, Eigenvalues, FreeSurface, PressureGradient, SchemeSettings, Settings, TimeStepLimits,
};
use crate::surface::Surface;

use alsph::Penalty;
use isph::Solution;
use solids::mirror;
use weakly_compressible::Sound;

/// The scheme that the settings name, beside a free surface.
pub fn build<const D: usize>(settings: &Settings, own: FreeSurface) -> Box<dyn Scheme<D>> {
    fn beside<const D: usize>(
        settings: &Settings,
        own: FreeSurface,
        pressure: impl Pressure<D> + 'static,
    ) -> Box<dyn Scheme<D>> {
        Box::new(BesideSurface::new(settings, own, pressure))
    }
    match settings.scheme {
        SchemeSettings::Alsph => beside(settings, own, Penalty::new(settings)),
        SchemeSettings::Isph(isph) => beside(settings, own, Solution::new(settings, isph.pressure_share, Solve::new(isph))),
        SchemeSettings::ExplicitIsph { sweeps, .. } => {
            beside(settings, own, Solution::new(settings, 0.0, Solve::explicit(settings, sweeps)))
        }
        SchemeSettings::Wcsph { sound_speed, density_diffusion, diffusion_coefficient } => {
            beside(settings, own, Sound::new(settings, sound_speed, density_diffusion, diffusion_coefficient))
        }
        SchemeSettings::Edac { sound_speed, diffusion_coefficient } => {
            beside(settings, own, Sound::new(settings, sound_speed, DensityDiffusion::Molteni, diffusion_coefficient / 8.0))
        }
    }
}

/// How a scheme comes to the pressure.
pub trait Pressure<const D: usize>: Send + Sync {
    /// Advance pressure and velocity to n+1, but for what comes too near to solids.
    fn advance(&mut self, terms: &mut Terms<D>, step: Step, flow: &mut Flow<D>) -> Solved;

    /// See [`Scheme::penalty`].
    fn penalty(&self, time_step: f64) -> f64;

    /// See [`Scheme::reach`].
    fn reach(&self, time_step: f64) -> f64;
}

/// A scheme beside a free surface.
#[derive(Debug)]
pub struct BesideSurface<const D: usize, P> {
    largest: Eigenvalues,
    terms: Terms<D>,
    pressure: P,
}

/// The terms of a step, and the fields that they need.
#[derive(Debug)]
pub struct Terms<const D: usize> {
    own: FreeSurface,
    undisturbed: f64,
    derived: Vec<Derived<D>>,
    /// S of u^n, real particles.
    strain_rate: Vec<Tensor<D>>,
    /// Of the real particles that see air: the pressure of that surface.
    surface_pressure: Vec<f64>,
    /// ∇·u less θ.
    divergence: Vec<f64>,
    /// ν∇²u and what the artificial viscosity does.
    friction: Vec<Vector<D>>,
    /// What G* is taken of.
    tensor: Vec<Tensor<D>>,
    /// w q, and u as the divergence sees it, if there are solids.
    pushed: Vec<f64>,
    mirrored: Vec<Vector<D>>,
    /// u*, what the pressure has made of it, and what sweeps have of that.
    velocity_star: Vec<Vector<D>>,
    corrected: Vec<Vector<D>>,
    swept: Vec<Vector<D>>,
    /// ∇²p with air beyond the surface.
    pressure_laplacian: Vec<f64>,
    /// What all but the viscous term gives to solids.
    reaction: Vec<Vector<D>>,
}

impl<const D: usize> Terms<D> {
    fn new(settings: &Settings, own: FreeSurface) -> Self {
        Self {
            own,
            undisturbed: settings.undisturbed_volume(),
            derived: Vec::new(),
            strain_rate: Vec::new(),
            surface_pressure: Vec::new(),
            divergence: Vec::new(),
            friction: Vec::new(),
            tensor: Vec::new(),
            pushed: Vec::new(),
            mirrored: Vec::new(),
            velocity_star: Vec::new(),
            corrected: Vec::new(),
            swept: Vec::new(),
            pressure_laplacian: Vec::new(),
            reaction: Vec::new(),
        }
    }

    /// What all of a step begins with: the terms of u^n, the solids' velocity at n+1, and the pressure that they show.
    fn begin(&mut self, step: Step, flow: &mut Flow<D>) {
        self.derive(step, flow);
        self.find_friction(step, flow);
        flow.move_solids();
        self.extend_pressure(step, flow);
    }

    /// The ∇·u that takes particles apart which are closer than the lattice's.
    fn loosening<'a>(
        &self,
        step: Step,
        frame: &'a Frame<D>,
        surface: &'a Surface<D>,
    ) -> impl Fn(usize) -> f64 + Sync + use<'a, D> {
        let (relaxation, undisturbed) = (self.own.packing_relaxation / step.time_step, self.undisturbed);
        move |i| match surface.place[i] {
            Place::AtSurface | Place::Isolated => 0.0,
            Place::Inside | Place::Near => relaxation * (undisturbed * frame.stencil.number_density[i] - 1.0).max(0.0),
        }
    }

    /// What ∇·u^{n+1} is to be in the frame, ∇²u^n, and ∇u^n as `tensor`.
    fn derive(&mut self, step: Step, flow: &mut Flow<D>) {
        let Flow { particles, frame, surface, walls, .. } = flow;
        walls.see(step.settings, particles, frame);
        let walls = &*walls;
        frame.images.blank(&mut self.derived, particles.real);
        frame.images.blank(&mut self.divergence, particles.len());
        frame.images.blank(&mut self.strain_rate, particles.real);
        frame.images.blank(&mut self.tensor, particles.len());
        let (velocity, loosening) = (&particles.velocity, self.loosening(step, frame, surface));
        frame.stencil.for_each(
            LaplacianAndGradient { velocity, seen: |s, i| walls.seen_by(particles, s, i) },
            &mut self.derived,
            frame.images.real(&mut self.tensor),
            |i, (laplacian, gradient), derived, tensor| {
                let bent = step.settings.derivative_frame.solenoidal_divergence(&gradient, step.time_step);
                *derived = Derived { laplacian, solenoidal: bent + loosening(i) };
                tensor.0 = gradient;
            },
        );
        let (gradient, derived) = (&self.tensor, &self.derived);
        parallel::for_each(&mut self.strain_rate, |i, strain_rate| {
            strain_rate.0 = (gradient[i].0 + gradient[i].0.transpose()) * 0.5;
        });
        let strain_rate = &self.strain_rate;
        parallel::for_each(frame.images.real(&mut self.divergence), |i, divergence| {
            *divergence = strain_rate[i].0.trace() - derived[i].solenoidal;
        });
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

    /// u* of friction alone. Solids keep their velocities.
    fn predict_velocity(&mut self, step: Step, flow: &Flow<D>) {
        let Flow { particles, frame, before, .. } = flow;
        let condition = conditions(step.settings);
        self.forget_reaction(particles.real);
        frame.images.blank(&mut self.velocity_star, particles.len());
        let (friction, dt) = (&self.friction, step.time_step);
        parallel::for_each(frame.images.real(&mut self.velocity_star), |i, star| {
            *star = match condition(particles.kind[i], &particles.position[i]).velocity {
                VelocityRule::Kept => particles.velocity[i],
                VelocityRule::Solved => before.velocity[i] + friction[i] * dt,
            };
        });
        self.show_predicted(step.settings, flow);
    }

    /// u* of images and solids.
    fn show_predicted(&mut self, settings: &Settings, Flow { particles, frame, .. }: &Flow<D>) {
        frame.images.fill(&mut self.velocity_star);
        mirror(settings, frame, particles, &mut self.velocity_star);
    }

    /// Find ∇²p, the pressure beyond the surface being that of the air.
    fn find_pressure_laplacian(&mut self, Flow { particles, frame, surface, .. }: &Flow<D>) {
        frame.images.blank(&mut self.pressure_laplacian, particles.real);
        let (pressure, air) = (&particles.pressure, &self.surface_pressure);
        frame.stencil.for_each_one(LaplacianAndItsSum(pressure), &mut self.pressure_laplacian, |i, value, out| {
            *out = surface.laplacian(i, value, pressure[i] - air[i]);
        });
    }

    /// The least pressure there is.
    fn least_pressure(&self) -> f64 {
        if self.own.tension { f64::NEG_INFINITY } else { 0.0 }
    }

    /// u^{n+1} by the pressure that there is, from u*.
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
        let own = |i: usize| own_share(pressure[i], place[i]);
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
        self.corrected.clone_from(velocity);
        let Flow { particles: Particles { real, pressure, .. }, frame, surface, .. } = &*flow;
        let own = |f: usize| {
            let f = frame.images.source(*real, f);
            own_share(pressure[f], surface.place[f])
        };
        match self.own.pressure_gradient {
            PressureGradient::Conservative => {
                self.react(flow, |s, f, r_sf| -r_sf * (pressure[s] + own(f) * pressure[f]));
            }
            PressureGradient::Adjoint => {
                let tensor = std::mem::take(&mut self.tensor);
                self.react(flow, |s, f, r_sf| -(tensor[s].0 + tensor[f].0 * own(f)) * r_sf);
                self.tensor = tensor;
            }
        }
    }

    /// Solids feel from the fluid in front of them what they give to it: `pair`(s, f, r_sf) times V_s V_f (dW/dr)/r.
    fn react(&mut self, flow: &Flow<D>, pair: impl Fn(usize, usize, Vector<D>) -> Vector<D> + Sync) {
        let Flow { particles, frame, .. } = flow;
        let force = |s: usize| pairs(&frame.stencil, s, |f, r_sf| pair(s, f, r_sf));
        let forces = of_solids(&particles.kind[..particles.real], force);
        forces.into_iter().for_each(|(s, force)| self.reaction[s] += force);
    }

    /// The same of a `factor` times G* of what is in `tensor`, as a force on the fluid.
    fn react_to_tensor(&mut self, flow: &Flow<D>, factor: f64) {
        let tensor = std::mem::take(&mut self.tensor);
        self.react(flow, |s, f, r_sf| (tensor[s].0 + tensor[f].0) * r_sf * factor);
        self.tensor = tensor;
    }

    /// Begin anew with what acts on solids.
    fn forget_reaction(&mut self, count: usize) {
        self.reaction.clear();
        self.reaction.resize(count, Vector::zeros());
    }

    /// Find ∇·u less θ.
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

    /// All projection sweeps of the step.
    fn sweep(&mut self, step: Step, sweeps: Sweeps, flow: &mut Flow<D>) {
        for sweep in 0..step.settings.projection_sweeps {
            let relaxation = sweeps.relaxation / weight(step.settings, sweep);
            let factor = step.settings.density * relaxation / step.time_step;
            self.measure_divergence(step, flow);
            self.form_tensor(step.settings, flow);
            let Flow { particles, frame, surface, .. } = &mut *flow;
            let condition = conditions(step.settings);
            let Particles { kind, position, pressure, velocity, .. } = particles;
            let (divergence, weight, least) = (&self.divergence, &surface.weight, self.least_pressure());
            let (real_pressure, real_velocity) = (frame.images.real(pressure), frame.images.real(velocity));
            frame.stencil.for_each(
                AdjointGradient { tensor: &self.tensor, own: |_| 1.0 },
                real_velocity,
                real_pressure,
                |i, gradient, u, p| {
                    if condition(kind[i], &position[i]).velocity == VelocityRule::Solved {
                        *u += gradient * relaxation;
                        *p = (*p - factor * weight[i] * divergence[i]).max(least);
                    }
                },
            );
            frame.images.fill(velocity);
            self.react_to_tensor(flow, factor);
        }
        self.extend_pressure(step, flow);
    }
}

/// What the pressure of a particle counts in its own gradient. Antisymmetric forces draw particles together that carry one below that of the
/// air, until voids open between them (Swegle, Hicks and Attaway 1995); differences do not (Sun et al. 2018).
fn own_share(pressure: f64, place: Place) -> f64 {
    if pressure < 0.0 && place == Place::Inside { -1.0 } else { 1.0 }
}

impl<const D: usize, P: Pressure<D>> BesideSurface<D, P> {
    pub fn new(settings: &Settings, own: FreeSurface, pressure: P) -> Self {
        Self { largest: settings.largest_eigenvalues(), terms: Terms::new(settings, own), pressure }
    }
}

impl<const D: usize, P: Pressure<D>> Scheme<D> for BesideSurface<D, P> {
    fn limits(&self, settings: &Settings, velocity_max: f64) -> TimeStepLimits {
        settings.time_step_limits(velocity_max, self.largest)
    }

    fn solve(&mut self, step: Step, flow: &mut Flow<D>) -> Solved {
        self.terms.begin(step, flow);
        let solved = self.pressure.advance(&mut self.terms, step, flow);
        self.terms.swept.clone_from(&flow.particles.velocity);
        self.terms.hold(step, flow);
        self.terms.measure_divergence(step, flow);
        if !step.settings.bodies.is_empty() {
            flow.walls.see(step.settings, &flow.particles, &flow.frame); // for the loads
        }
        solved
    }

    fn divergence(&self, i: usize) -> f64 {
        self.terms.divergence[i]
    }

    fn acting_pressure(&self, _: Step, particles: &Particles<D>, i: usize) -> f64 {
        particles.pressure[i]
    }

    fn pressure_force(&self, _: Step, _: &Flow<D>, s: usize) -> Vector<D> {
        self.terms.reaction[s]
    }

    fn viscous_laplacian(&self, _: Step, i: usize) -> Vector<D> {
        self.terms.derived[i].laplacian
    }

    fn taken(&self, step: Step, flow: &Flow<D>) -> Taken {
        self.terms.taken(step, flow)
    }

    fn penalty(&self, time_step: f64) -> f64 {
        self.pressure.penalty(time_step)
    }

    fn reach(&self, time_step: f64) -> f64 {
        self.pressure.reach(time_step)
    }
}
