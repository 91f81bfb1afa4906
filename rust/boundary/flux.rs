//! The flux into a wall, all of it.
//!
//! ∇·u of the fluid with solids that show the wall's velocity sees the jump of the normal velocity at the surface, smeared over the support:
//! half of it on fluid particles, half on solid ones, which have no equations. A Poisson equation whose right-hand side lacks that half makes
//! half of the pressure gradient that would stop the fluid at the wall. So each solid hands what it sees to the fluid around.
//!
//! Solids at corners need not: one normal does not tell to which surface a flux belongs, and where a lid meets a wall at rest the flow has none.

use crate::base::{Vector, parallel};
use crate::boundary::average::for_each_weighted;
use crate::frame::Frame;
use crate::particles::{ParticleKind, Particles, of_solids};
use crate::settings::Settings;

/// A surface that turns by so much (the cosine) within so many spacings has a corner, as solids tell within this share of the support. No
/// distances of lattices, at which rounding would decide.
const TURN: f64 = 0.72;
const CORNER_REACH: f64 = 2.6;
const CORNER_SIGHT: f64 = 0.93;

/// Add to `divergence`, that of `velocity` at the real particles, what solid particles see of it: each gives the integral over its volume to
/// the flowing particles around, in proportion to the kernel, those at corners only if `corners`. `handed` is memory to be used.
pub fn add_wall_flux<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    velocity: impl Fn(usize) -> Vector<D> + Sync,
    corners: bool,
    handed: &mut Vec<f64>,
    divergence: &mut [f64],
) {
    let stencil = &frame.stencil;
    let share = |s: usize| {
        if !corners && is_at_corner(settings, particles, frame, s) {
            return 0.0;
        }
        let (row, lane) = stencil.neighbours.row(s);
        let (mut total, mut mean) = (0.0, Vector::zeros());
        for_each_weighted(settings, stencil, s, row.flowing_seen(lane), |j, weight, _| {
            total += weight;
            mean += velocity(j) * weight;
        });
        if total == 0.0 {
            return 0.0;
        }
        // Along the wall the fluid slides: there its own mean is what others differ from, else a corner's cut support would count as a flux.
        mean /= total;
        let normal = &particles.normal[s];
        let wall = mean + normal * (velocity(s) - mean).dot(normal);
        let flux = |j: usize| (velocity(j) - wall).dot(&(stencil.position[s] - stencil.position[j]));
        let flux = row.flowing().iter().map(|entry| flux(entry.j()) * entry.slope(lane)).sum::<f64>();
        stencil.volume[s] * flux / total
    };
    let shares = of_solids(&particles.kind[..particles.real], share);
    if shares.is_empty() {
        return;
    }
    frame.images.blank(handed, particles.len());
    shares.into_iter().for_each(|(s, share)| handed[s] = share);
    frame.images.fill(handed);
    let handed = &*handed;
    parallel::for_each(divergence, |i, divergence| {
        if particles.kind[i] != ParticleKind::Solid {
            let (row, lane) = stencil.neighbours.row(i);
            let mut sum = 0.0;
            for_each_weighted(settings, stencil, i, row.solid_seen(lane), |s, weight, _| sum += weight * handed[s]);
            *divergence += sum / stencil.volume[i];
        }
    });
}

/// Whether the surface above solid `s` turns sharply nearby.
fn is_at_corner<const D: usize>(settings: &Settings, particles: &Particles<D>, frame: &Frame<D>, s: usize) -> bool {
    let Particles { normal, depth, .. } = particles;
    let position = &frame.stencil.position;
    let surface = |s: usize| position[s] + normal[s] * depth[s];
    let (reach, sight) = (CORNER_REACH * settings.particle_spacing, CORNER_SIGHT * settings.support_radius());
    let (row, lane) = frame.stencil.neighbours.row(s);
    row.solid_seen(lane).any(|(entry, _)| {
        let k = entry.j();
        normal[k].dot(&normal[s]) < TURN
            && (position[k] - position[s]).norm() < sight
            && (surface(k) - surface(s)).norm() < reach
    })
}
