//! The viscous term of fourth order.

use crate::base::Vector;
use crate::discretisation::LaplacianAndGradient;
use crate::flow::{Flow, Step};

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
