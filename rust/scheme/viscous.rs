//! The viscous term of u^n, and what takes it to fourth order in space and to second order in time.
//!
//! In the middle of the step, where the particles stand, u is u^n + ½Δt (ν ∇²u^n − ∇p/ρ + g). What ∇p and a uniform g add there to ν ∇²u is a
//! gradient, which the pressure takes up; so ½νΔt ∇²∇²u^n is what makes the term one of the middle, and comes with the pass that
//! takes the error of the compact Laplacian off, c ∇²∇²u^n of the opposite sign.

use crate::base::{Matrix, Vector};
use crate::discretisation::LaplacianAndGradient;
use crate::flow::{Flow, Step};
use crate::halo::Poison;
use crate::settings::Settings;

/// ∇²u^n, for schemes whose viscous term is of the old velocity.
#[derive(Debug)]
pub struct Viscous<const D: usize> {
    dispersion: f64,
    laplacian: Vec<Vector<D>>,
    /// What is added to it; empty at second order, at which the term is that of u^n.
    sharper: Vec<Vector<D>>,
}

impl<const D: usize> Viscous<D> {
    pub fn new(settings: &Settings) -> Self {
        let dispersion = settings.laplacian_dispersion() * settings.particle_spacing.powi(2);
        Self { dispersion, laplacian: Vec::new(), sharper: Vec::new() }
    }

    /// Find it, and set `out` to what `of` makes of ∇u^n: the first pass over a frame, so it forms the corrections too.
    pub fn begin<T: Poison + Send>(
        &mut self,
        step: Step,
        flow: &mut Flow<D>,
        out: &mut Vec<T>,
        of: impl Fn(&Matrix<D>) -> T + Sync,
    ) {
        let Flow { particles, frame, walls, .. } = &mut *flow;
        walls.see(step.settings, particles, frame);
        let walls = &*walls;
        frame.images.blank(&mut self.laplacian, particles.real);
        frame.images.blank(out, particles.real);
        frame.stencil.correct_and_for_each(
            LaplacianAndGradient { velocity: &particles.velocity, seen: |s, i| walls.seen_by(particles, s, i) },
            &mut self.laplacian,
            out,
            |_, (value, gradient), laplacian, out| (*laplacian, *out) = (value, of(&gradient)),
        );
        self.sharper.clear();
        if step.settings.viscous_order == 4 {
            let factor = self.dispersion - 0.5 * step.settings.kinematic_viscosity * step.time_step;
            sharpen(step, flow, |i| self.laplacian[i], factor, &mut self.sharper);
        }
    }

    /// ∇²u^n of particle `i`.
    pub fn laplacian(&self, i: usize) -> Vector<D> {
        self.laplacian[i] + self.sharper.get(i).copied().unwrap_or_else(Vector::zeros)
    }
}

/// Set `out` to what takes the compact Laplacian of u^n, of which `laplacian` tells, to fourth order: the error of a wave of wave number k is
/// `dispersion` k² of it.
pub fn sharpen<const D: usize>(
    step: Step,
    Flow { particles, frame, walls, .. }: &mut Flow<D>,
    laplacian: impl Fn(usize) -> Vector<D> + Sync,
    dispersion: f64,
    out: &mut Vec<Vector<D>>,
) {
    walls.sharpen(step.settings, particles, frame, laplacian, dispersion);
    let dispersion = &walls.dispersion;
    frame.images.blank(out, particles.real);
    frame.stencil.for_each_one(
        LaplacianAndGradient { velocity: dispersion, seen: |s: usize, _: usize| dispersion[s] },
        out,
        |_, (laplacian, _), out| *out = -laplacian,
    );
}
