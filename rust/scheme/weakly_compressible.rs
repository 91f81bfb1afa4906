//! Weakly compressible SPH: sound of finite speed in place of the constraint ∇·u = 0.
//!
//! With the linear equation of state p = c₀² (ρ − ρ₀) the pressure stands for the density, and no particle carries another field:
//!
//! ```text
//! dp/dt = −ρ₀ c₀² ∇·u + κ ∇²p,    du/dt = −∇p/ρ₀ + ν ∇²u + g,    dr/dt = u
//! ```
//!
//! κ = δ h c₀ is the density diffusion of δ-SPH, of ∇²p (Molteni and Colagrossi 2009) or of what ∇²p has beyond ∇·∇p, nothing where p is
//! smooth (after Antuono et al. 2010); κ = α h c₀/8 that of entropically damped artificial compressibility (EDAC; Ramachandran and Puri
//! 2019). A step is one of Störmer and Verlet in its frame: half of p, all of u, the other half of p. The viscous term is that of u^n.

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::{PressureRule, VelocityRule, conditions, extrapolate_pressure, extrapolate_vector};
use crate::discretisation::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient};
use crate::flow::{Flow, Step};
use crate::particles::{ParticleKind, Particles};
use crate::scheme::Scheme;
use crate::scheme::viscous::sharpen;
use crate::settings::{DensityDiffusion, Eigenvalues, Settings, TimeStepLimits, WallPressure};

/// The fields of one step beside those of the particles, real particles and, where they have neighbours that read them, images.
#[derive(Debug)]
pub struct WeaklyCompressible<const D: usize> {
    sound_speed: f64,
    density_diffusion: DensityDiffusion,
    /// κ.
    diffusivity: f64,
    largest: Eigenvalues,
    dispersion: f64,
    /// ∇²u^n, and what takes it to fourth order.
    laplacian: Vec<Vector<D>>,
    sharper: Vec<Vector<D>>,
    /// ∇·u, of u^n and then of u^{n+1}.
    divergence: Vec<f64>,
    /// p in the middle of the step, twice, because its gradient and Laplacian are taken together.
    pressure: Vec<[f64; 2]>,
    /// ∇p of that, and what diffuses of it: ∇²p or (∇² − ∇·∇)p.
    gradient: Vec<Vector<D>>,
    diffusing: Vec<f64>,
    /// ∇p near solids, where the pressure is continued into them.
    near_walls: Vec<Vector<D>>,
}

impl<const D: usize> WeaklyCompressible<D> {
    /// With the speed of sound c₀ and κ/(h c₀).
    pub fn new(settings: &Settings, sound_speed: f64, density_diffusion: DensityDiffusion, coefficient: f64) -> Self {
        Self {
            sound_speed,
            density_diffusion,
            diffusivity: coefficient * settings.smoothing_length() * sound_speed,
            largest: settings.largest_eigenvalues(),
            dispersion: settings.laplacian_dispersion() * settings.particle_spacing.powi(2),
            laplacian: Vec::new(),
            sharper: Vec::new(),
            divergence: Vec::new(),
            pressure: Vec::new(),
            gradient: Vec::new(),
            diffusing: Vec::new(),
            near_walls: Vec::new(),
        }
    }

    /// ∇²u^n and ∇·u^n: the first pass over a frame, so it forms the corrections too.
    fn velocity_derivatives(&mut self, step: Step, flow: &mut Flow<D>) {
        let Flow { particles, frame, walls, .. } = &mut *flow;
        walls.see(step.settings, particles, frame);
        let walls = &*walls;
        frame.images.blank(&mut self.laplacian, particles.real);
        frame.images.blank(&mut self.divergence, particles.real);
        frame.stencil.correct_and_for_each(
            LaplacianAndGradient { velocity: &particles.velocity, seen: |s, i| walls.seen_by(particles, s, i) },
            &mut self.laplacian,
            &mut self.divergence,
            |_, (value, gradient), laplacian, divergence| (*laplacian, *divergence) = (value, gradient.trace()),
        );
        self.sharper.clear();
        if step.settings.viscous_order == 4 {
            sharpen(step, flow, |i| self.laplacian[i], self.dispersion, &mut self.sharper);
        }
    }

    /// Half a step of the pressure by ∇·u.
    fn advance_pressure(&self, step: Step, Flow { particles, frame, .. }: &mut Flow<D>) {
        let Particles { kind, position, pressure, .. } = particles;
        let stiffness = 0.5 * step.time_step * step.settings.density * self.sound_speed.powi(2);
        let condition = conditions(step.settings);
        parallel::for_each(frame.images.real(pressure), |i, p| match condition(kind[i], &position[i]).pressure {
            PressureRule::Zero => *p = 0.0,
            PressureRule::Solved => *p -= stiffness * self.divergence[i],
            PressureRule::SolvedWithoutDivergence | PressureRule::FromFluid => {}
        });
    }

    /// The pressure that solids show.
    fn extrapolate_wall_pressure(&mut self, settings: &Settings, flow: &mut Flow<D>) {
        let Flow { particles, frame, body_force, .. } = flow;
        frame.images.fill(&mut particles.pressure);
        if settings.wall_pressure == WallPressure::Linear {
            let gradient = &mut self.near_walls;
            frame.images.blank(gradient, particles.len());
            frame.stencil.evaluate_near_solids(Gradient(&particles.pressure), frame.images.real(gradient));
            frame.images.fill(gradient);
        }
        extrapolate_pressure(settings, frame, particles, &self.near_walls, body_force);
    }

    /// u^{n+1} by the pressure in the middle of the step. Buffers and solids keep their velocities.
    fn advance_velocity(&mut self, step: Step, Flow { particles, frame, body_force, .. }: &mut Flow<D>) {
        let settings = step.settings;
        self.pressure.clear();
        self.pressure.extend(particles.pressure.iter().map(|&p| [p; 2]));
        frame.images.blank(&mut self.gradient, particles.len());
        frame.images.blank(&mut self.diffusing, particles.real);
        frame.stencil.for_each(
            GradientAndLaplacian(&self.pressure),
            frame.images.real(&mut self.gradient),
            &mut self.diffusing,
            |_, values, gradient, laplacian| (*gradient, *laplacian) = values,
        );
        let sharper = |i: usize| self.sharper.get(i).copied().unwrap_or_else(Vector::zeros);
        let (kind, position, condition) = (&particles.kind, &particles.position, conditions(settings));
        parallel::for_each(frame.images.real(&mut particles.velocity), |i, u| {
            if condition(kind[i], &position[i]).velocity == VelocityRule::Solved {
                let viscous = (self.laplacian[i] + sharper(i)) * settings.kinematic_viscosity;
                *u += (viscous - self.gradient[i] / settings.density + body_force.at(i)) * step.time_step;
            }
        });
        frame.images.fill(&mut particles.velocity);
    }

    /// The diffusion of the pressure in the middle of the step. What walls and buffers show takes no part in it.
    fn diffuse_pressure(&mut self, step: Step, Flow { particles, frame, .. }: &mut Flow<D>) {
        if self.density_diffusion == DensityDiffusion::None {
            return;
        }
        if self.density_diffusion == DensityDiffusion::Antuono {
            // The gradients of solids would feel where these end.
            extrapolate_vector(step.settings, frame, &particles.kind[..particles.real], &mut self.gradient);
            let gradient = &self.gradient;
            frame.stencil.for_each_one(Divergence(gradient), &mut self.diffusing, |_, value, out| *out -= value);
        }
        let (kind, factor) = (&particles.kind, self.diffusivity * step.time_step);
        parallel::for_each(frame.images.real(&mut particles.pressure), |i, p| {
            if kind[i] == ParticleKind::Fluid {
                *p += factor * self.diffusing[i];
            }
        });
    }
}

impl<const D: usize> Scheme<D> for WeaklyCompressible<D> {
    fn limits(&self, settings: &Settings, velocity_max: f64) -> TimeStepLimits {
        settings.time_step_limits(velocity_max, self.largest)
    }

    fn solve(&mut self, step: Step, flow: &mut Flow<D>) -> usize {
        self.velocity_derivatives(step, flow);
        self.advance_pressure(step, flow);
        self.extrapolate_wall_pressure(step.settings, flow);
        self.advance_velocity(step, flow);
        let velocity = &flow.particles.velocity;
        flow.frame.stencil.for_each_one(Divergence(velocity), &mut self.divergence, |_, value, out| *out = value);
        self.advance_pressure(step, flow);
        self.diffuse_pressure(step, flow);
        self.extrapolate_wall_pressure(step.settings, flow);
        flow.walls.see(step.settings, &flow.particles, &flow.frame); // for the loads
        1
    }

    fn divergence(&self, i: usize) -> f64 {
        self.divergence[i]
    }

    fn acting_pressure(&self, _: Step, _: &Particles<D>, i: usize) -> f64 {
        self.pressure[i][0]
    }

    fn penalty(&self, time_step: f64) -> f64 {
        self.sound_speed.powi(2) * time_step
    }
}
