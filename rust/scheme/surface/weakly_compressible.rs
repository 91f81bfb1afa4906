//! Weakly compressible SPH beside a free surface, and entropically damped artificial compressibility.
//!
//! ```text
//! dp/dt = −ρ c₀² w ∇·u + κ ∇²p,    du/dt = ν ∇²u + g − P(p)/ρ
//! ```
//!
//! by leaps of p over u: that of r^n takes p from n−½ to n+½, whose gradient takes u from n to n+1. So the pressure that is kept is the one that
//! acts: cut off at that of the air, another would carry less than the weight. With w a particle whose support is cut is softer, so that the
//! sum over pairs is no stiffer there than inside. In what diffuses air is beyond the surface, so that water at rest is left as it is; where
//! the fluid is whole Antuono's form takes off ∇·∇p, what p − ρg·r has of it.

use super::{Pressure, Terms};
use crate::base::{Vector, parallel};
use crate::boundary::extrapolate_vector;
use crate::discretisation::{Divergence, Gradient};
use crate::flow::{Flow, Step};
use crate::particles::{ParticleKind, Place};
use crate::scheme::Solved;
use crate::settings::{DensityDiffusion, Settings};

#[derive(Debug)]
pub struct Sound<const D: usize> {
    sound_speed: f64,
    density_diffusion: DensityDiffusion,
    /// κ.
    diffusivity: f64,
    /// ∇p − ρg, images and solids included.
    gradient: Vec<Vector<D>>,
    /// Its divergence.
    smooth: Vec<f64>,
}

impl<const D: usize> Sound<D> {
    /// With the speed of sound c₀ and κ/(h c₀).
    pub fn new(settings: &Settings, sound_speed: f64, density_diffusion: DensityDiffusion, coefficient: f64) -> Self {
        let diffusivity = coefficient * settings.smoothing_length() * sound_speed;
        Self { sound_speed, density_diffusion, diffusivity, gradient: Vec::new(), smooth: Vec::new() }
    }

    /// The pressure by ∇·u^n, which in the frame is less by what u^{n+1} has more of it there.
    fn compress(&self, terms: &Terms<D>, step: Step, Flow { particles, frame, surface, .. }: &mut Flow<D>) {
        let stiffness = step.time_step * step.settings.density * self.sound_speed.powi(2);
        let (place, weight, least) = (&surface.place, &surface.weight, terms.least_pressure());
        let loosening = terms.loosening(step, frame, surface);
        let (kind, divergence, derived) = (&particles.kind, &terms.divergence, &terms.derived);
        parallel::for_each(frame.images.real(&mut particles.pressure), |i, p| {
            if kind[i] != ParticleKind::Fluid {
                return;
            }
            let bent = derived[i].solenoidal - loosening(i);
            *p -= stiffness * weight[i] * (divergence[i] + 2.0 * bent);
            *p = if place[i] == Place::Isolated { 0.0 } else { p.max(least) };
        });
    }

    /// The diffusion of the pressure.
    fn diffuse(&mut self, terms: &mut Terms<D>, step: Step, flow: &mut Flow<D>) {
        if self.density_diffusion == DensityDiffusion::None {
            return;
        }
        terms.find_pressure_laplacian(flow);
        let Flow { particles, frame, surface, body_force, .. } = flow;
        frame.images.blank(&mut self.smooth, particles.real);
        if self.density_diffusion == DensityDiffusion::Antuono {
            frame.images.blank(&mut self.gradient, particles.len());
            let out = frame.images.real(&mut self.gradient);
            let density = step.settings.density;
            frame.stencil.for_each_one(Gradient(&particles.pressure), out, |i, gradient, out| {
                *out = gradient - body_force.at(i) * density;
            });
            extrapolate_vector(step.settings, frame, &particles.kind[..particles.real], &mut self.gradient);
            frame.stencil.for_each_one(Divergence(&self.gradient), &mut self.smooth, |_, value, out| *out = value);
        } else {
            self.smooth.fill(0.0);
        }
        let (kind, place, factor) = (&particles.kind, &surface.place, self.diffusivity * step.time_step);
        let (laplacian, smooth) = (&terms.pressure_laplacian, &self.smooth);
        parallel::for_each(frame.images.real(&mut particles.pressure), |i, p| {
            if kind[i] == ParticleKind::Fluid && place[i] != Place::Isolated {
                let smooth = if place[i] == Place::Inside { smooth[i] } else { 0.0 };
                *p += factor * (laplacian[i] - smooth);
            }
        });
    }
}

impl<const D: usize> Pressure<D> for Sound<D> {
    fn advance(&mut self, terms: &mut Terms<D>, step: Step, flow: &mut Flow<D>) -> Solved {
        terms.predict_velocity(step, flow);
        self.diffuse(terms, step, flow);
        self.compress(terms, step, flow);
        terms.extend_pressure(step, flow);
        terms.correct_velocity(step, flow);
        Solved::after(1)
    }

    fn penalty(&self, time_step: f64) -> f64 {
        self.sound_speed.powi(2) * time_step
    }

    fn reach(&self, _: f64) -> f64 {
        0.0
    }
}
