//! Schemes: how velocity and pressure come from n to n+1.

mod alsph;
mod isph;
mod projection;
mod surface;
mod viscous;
mod weakly_compressible;

use crate::base::{Vector, exact_sums, parallel};
use crate::flow::{Flow, Step};
use crate::loads::force_of_pressure;
use crate::particles::{ParticleKind, Particles};
use crate::settings::{DensityDiffusion, SchemeSettings, Settings, TimeStepLimits};

pub use alsph::{Alsph, Derived};
pub use isph::Isph;
pub use weakly_compressible::WeaklyCompressible;

/// A scheme. What a step does beside it, from the search of neighbours to loads and shift, is the same for all.
pub trait Scheme<const D: usize>: Send + Sync {
    /// Upper bounds of Δt for the largest velocity `velocity_max`.
    fn limits(&self, settings: &Settings, velocity_max: f64) -> TimeStepLimits;

    /// Advance velocity and pressure to n+1, and leave `particles.position` in the frame of the last derivatives; that of the flow stands at
    /// r^n, or in the middle of the step. What the iterations leave of ∇·u is found with the shift where that
    /// can ([`crate::shifting::measures_divergence`]), else by [`Scheme::divergence`].
    fn solve(&mut self, step: Step, flow: &mut Flow<D>) -> Solved;

    /// ∇·u of the last derivatives, less [`Derived::solenoidal`].
    fn divergence(&self, i: usize) -> f64;

    /// What the velocity of the step had the gradient of.
    fn acting_pressure(&self, step: Step, particles: &Particles<D>, i: usize) -> f64;

    /// Note what pushed the flowing particles beside the pressure that they keep.
    fn note_unkept_pressure(&self, step: Step, Flow { particles, frame, .. }: &mut Flow<D>) {
        if step.settings.has_unkept_pressure() {
            let mut unkept = std::mem::take(&mut particles.unkept_pressure);
            parallel::for_each(frame.images.real(&mut unkept), |i, unkept| {
                let flows = particles.kind[i] != ParticleKind::Solid;
                *unkept = if flows { self.acting_pressure(step, particles, i) - particles.pressure[i] } else { 0.0 };
            });
            particles.unkept_pressure = unkept;
        }
    }

    /// The force on solid particle `s` of all but the viscous term.
    fn pressure_force(&self, step: Step, flow: &Flow<D>, s: usize) -> Vector<D> {
        force_of_pressure(&flow.frame.stencil, |i| self.acting_pressure(step, &flow.particles, i), s)
    }

    /// ∇²u of particle `i` as the viscous term of the step had it.
    fn viscous_laplacian(&self, step: Step, i: usize) -> Vector<D>;

    /// What parts of the step have taken of the energy; no numbers where the scheme does not tell.
    fn taken(&self, _step: Step, _flow: &Flow<D>) -> Taken {
        Taken::default()
    }

    /// r_AL of a step so long: c² Δt, c being the speed of the waves by which the scheme keeps ∇·u small.
    fn penalty(&self, time_step: f64) -> f64;

    /// How far the pressure travels within a step so long, to which a free body needs an answer: c Δt, infinite where a Poisson equation is
    /// solved, and zero where c is given and Δt has to follow it.
    fn reach(&self, time_step: f64) -> f64 {
        (self.penalty(time_step) * time_step).sqrt()
    }
}

/// The scheme that the settings name.
pub fn build<const D: usize>(settings: &Settings) -> Box<dyn Scheme<D>> {
    if let Some(own) = settings.free_surface {
        return surface::build(settings, own);
    }
    match settings.scheme {
        SchemeSettings::Alsph => Box::new(Alsph::new(settings)),
        SchemeSettings::Isph(own) => Box::new(Isph::new(settings, own)),
        SchemeSettings::ExplicitIsph { sweeps, density_relaxation, .. } => {
            Box::new(Isph::explicit(settings, sweeps, density_relaxation))
        }
        SchemeSettings::Wcsph { sound_speed, density_diffusion, diffusion_coefficient } => {
            Box::new(WeaklyCompressible::new(settings, sound_speed, density_diffusion, diffusion_coefficient))
        }
        SchemeSettings::Edac { sound_speed, diffusion_coefficient } => {
            let coefficient = diffusion_coefficient / 8.0;
            Box::new(WeaklyCompressible::new(settings, sound_speed, DensityDiffusion::Molteni, coefficient))
        }
    }
}

/// What parts of a step beside the viscous term take of kinetic and potential energy, in unit time.
#[derive(Clone, Copy, Debug)]
pub struct Taken {
    /// The artificial viscosity.
    pub artificial: f64,
    /// The penalty's gradient of ALSPH.
    pub penalty: f64,
    /// The pressure's gradient. What bodies do is in it, and in what follows.
    pub pressure: f64,
    pub sweeps: f64,
    /// What is held that comes too near to solids.
    pub contact: f64,
}

impl Default for Taken {
    fn default() -> Self {
        let unknown = f64::NAN;
        Self { artificial: unknown, penalty: unknown, pressure: unknown, sweeps: unknown, contact: unknown }
    }
}

/// How the iterations of a step ended.
#[derive(Clone, Copy, Debug)]
pub struct Solved {
    pub iterations: usize,
    /// What a Poisson solve left of its right-hand side, relative; NaN without one, or where it was not looked at.
    pub residual: f64,
    /// Whether that is within the solve's tolerance; None without one, where ∇·u tells (13).
    pub within_tolerance: Option<bool>,
}

impl Solved {
    /// After so many iterations, of which none solves a Poisson equation.
    pub fn after(iterations: usize) -> Self {
        Self { iterations, residual: f64::NAN, within_tolerance: None }
    }
}

/// How a step ended.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    pub iterations: usize,
    /// Of the Poisson solve; NaN without one, or where it was not looked at.
    pub residual: f64,
    /// Whether the Poisson solve reached its tolerance, or without one whether ε of (13) was reached; else the cap ended the iteration.
    pub converged: bool,
    /// max |∇·u| over the fluid.
    pub divergence_max: f64,
    /// Σ |∇·u| over the fluid.
    pub divergence_sum: f64,
}

impl Outcome {
    /// That of iterations which left this ∇·u, less [`Derived::solenoidal`].
    pub fn new<const D: usize>(
        settings: &Settings,
        particles: &Particles<D>,
        solved: Solved,
        divergence: impl Fn(usize) -> f64 + Sync,
    ) -> Self {
        let size = |i: usize| (particles.kind[i] == ParticleKind::Fluid).then(|| divergence(i).abs());
        // NaN must not hide behind max, which drops it.
        let larger = |a: f64, b: f64| if b > a || b.is_nan() { b } else { a };
        let largest = |range: std::ops::Range<usize>| range.filter_map(size).fold(0.0, larger);
        let divergence_max = parallel::reduce(particles.real, largest, larger).unwrap_or_default();
        let [divergence_sum] = exact_sums(particles.real, |i| size(i).map(|size| [size]));
        let Solved { iterations, residual, within_tolerance } = solved;
        let converged = within_tolerance.unwrap_or(divergence_max <= settings.divergence_tolerance);
        Self { iterations, residual, converged, divergence_max, divergence_sum }
    }
}
