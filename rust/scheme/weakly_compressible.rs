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
//! 2019). A step is one of Störmer and Verlet in its frame: half of p, all of u, the other half of p. The viscous term is [`Viscous`].

use crate::base::{Matrix, Vector, parallel};
use crate::boundary::{PressureRule, VelocityRule, conditions, extend_pressure, extrapolate_vector};
use crate::discretisation::{Divergence, GradientAndLaplacian};
use crate::flow::{Flow, Step};
use crate::particles::{ParticleKind, Particles};
use crate::scheme::viscous::Viscous;
use crate::scheme::{Scheme, Solved};
use crate::settings::{DensityDiffusion, Eigenvalues, Settings, TimeStepLimits};

/// The fields of one step beside those of the particles, real particles and, where they have neighbours that read them, images.
#[derive(Debug)]
pub struct WeaklyCompressible<const D: usize> {
    sound_speed: f64,
    density_diffusion: DensityDiffusion,
    /// κ.
    diffusivity: f64,
    largest: Eigenvalues,
    viscous: Viscous<D>,
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
            viscous: Viscous::new(settings),
            divergence: Vec::new(),
            pressure: Vec::new(),
            gradient: Vec::new(),
            diffusing: Vec::new(),
            near_walls: Vec::new(),
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

    /// The pressure that images and solids show.
    fn extend_pressure(&mut self, settings: &Settings, Flow { particles, frame, body_force, .. }: &mut Flow<D>) {
        extend_pressure(settings, frame, particles, body_force, &mut self.near_walls);
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
        let (kind, position, condition) = (&particles.kind, &particles.position, conditions(settings));
        parallel::for_each(frame.images.real(&mut particles.velocity), |i, u| {
            if condition(kind[i], &position[i]).velocity == VelocityRule::Solved {
                let viscous = self.viscous.laplacian(i) * settings.kinematic_viscosity;
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

    fn solve(&mut self, step: Step, flow: &mut Flow<D>) -> Solved {
        self.viscous.begin(step, flow, &mut self.divergence, Matrix::trace);
        self.advance_pressure(step, flow);
        self.extend_pressure(step.settings, flow);
        self.advance_velocity(step, flow);
        flow.move_solids();
        let velocity = &flow.particles.velocity;
        flow.frame.stencil.for_each_one(Divergence(velocity), &mut self.divergence, |_, value, out| *out = value);
        self.advance_pressure(step, flow);
        self.diffuse_pressure(step, flow);
        self.extend_pressure(step.settings, flow);
        flow.walls.see(step.settings, &flow.particles, &flow.frame); // for the loads
        Solved::after(1)
    }

    fn divergence(&self, i: usize) -> f64 {
        self.divergence[i]
    }

    fn acting_pressure(&self, _: Step, _: &Particles<D>, i: usize) -> f64 {
        self.pressure[i][0]
    }

    fn viscous_laplacian(&self, _: Step, i: usize) -> Vector<D> {
        self.viscous.laplacian(i)
    }

    fn penalty(&self, time_step: f64) -> f64 {
        self.sound_speed.powi(2) * time_step
    }

    fn reach(&self, _: f64) -> f64 {
        0.0
    }
}
