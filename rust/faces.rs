//! The two faces of thin parts of bodies.
//!
//! Where a body is thin, a solid particle is within reach of the fluid on both its faces, and would show either the mean of the two. So two
//! solid particles stand at each place there, one for each face, with its normal and depth. What is on a face sees that face's particle
//! alone; around an edge the shares of the two change smoothly, and always sum to one. Fluid still sees the fluid across, which a body
//! thicker than 3 Δx keeps out of its reach: to hide it leaves the support of the kernel empty there, and the flow then breaks down.

use crate::base::Vector;
use crate::base::lanes::LANES;
use crate::base::parallel;
use crate::neighbours::{Cluster, Entry};
use crate::particles::{ParticleKind, Particles};
use std::cmp::Ordering;

/// Distance [Δx] of a thin part's particles from the line of sight at which they cease to hide all behind them; at twice that they
/// hide nothing. They are Δx apart, so every line through the part comes as near.
const HIDING: f64 = 0.5;

#[derive(Debug, Default)]
pub struct Faces<const D: usize> {
    /// The particle of the other face at the same place, itself if there is none; of real particles and images. Empty if no particle
    /// has one.
    twin: Vec<u32>,
}

impl<const D: usize> Faces<D> {
    /// Find the solid particles that share a place.
    pub fn find(&mut self, particles: &Particles<D>) {
        self.twin.clear();
        let position = &particles.position;
        let mut solids = parallel::filter(particles.len(), |i| particles.kind[i] == ParticleKind::Solid);
        solids.sort_unstable_by(|&a, &b| {
            let different = (0..D).map(|k| position[a][k].total_cmp(&position[b][k])).find(|order| order.is_ne());
            different.unwrap_or(Ordering::Equal).then(a.cmp(&b))
        });
        for pair in solids.windows(2) {
            if let &[a, b] = pair
                && position[a] == position[b]
            {
                if self.twin.is_empty() {
                    self.twin.extend(0..particles.len() as u32);
                }
                (self.twin[a], self.twin[b]) = (b as u32, a as u32);
            }
        }
    }

    pub fn is_empty(&self) -> bool {
        self.twin.is_empty()
    }

    /// The particle of the other face at the same place, if there is one.
    pub fn twin(&self, i: usize) -> Option<usize> {
        self.twin.get(i).map(|&twin| twin as usize).filter(|&twin| twin != i)
    }

    /// Add to `shares` how much of each of its neighbours `entries` each particle of a cluster sees, 0 to 1; nothing if that is all.
    pub fn share_out(&self, particles: &Particles<D>, cluster: Cluster, entries: &[Entry], shares: &mut Vec<[f32; LANES]>) {
        if entries.iter().any(|entry| self.twin(entry.j()).is_some()) {
            let lanes = cluster.particles();
            shares.extend(entries.iter().map(|entry| lanes.map(|i| self.share(particles, i, entry.j()) as f32)));
        }
    }

    /// How much particles `i` and `j` see of each other.
    fn share(&self, particles: &Particles<D>, i: usize, j: usize) -> f64 {
        let seen = |s: usize, from: usize| {
            let place = viewpoint(particles, from);
            self.twin(s).map_or(1.0, |twin| on_face(particles, s, twin, &place))
        };
        if i == j { 1.0 } else { seen(i, j) * seen(j, i) }
    }

    /// How much of place `b` in the fluid is seen from place `a`, with the solid particles `near` both.
    pub fn sight(&self, particles: &Particles<D>, spacing: f64, near: &[usize], a: &Vector<D>, b: &Vector<D>) -> f64 {
        let hidden = near.iter().filter_map(|&s| {
            let twin = self.twin(s)?;
            let apart = on_face(particles, s, twin, a) - on_face(particles, s, twin, b);
            let away = distance_to_segment(&particles.position[s], a, b) / (HIDING * spacing);
            Some(apart * apart * (2.0 - away).clamp(0.0, 1.0))
        });
        1.0 - hidden.fold(0.0, f64::max)
    }
}

/// Where a particle looks from: a solid one from the surface above it.
fn viewpoint<const D: usize>(particles: &Particles<D>, i: usize) -> Vector<D> {
    particles.position[i] + particles.normal[i] * particles.depth[i]
}

/// The part of a place that is on the face of solid particle `s`, not on that of its `twin`: 1 above the one and 0 above the other, smooth
/// between the two.
fn on_face<const D: usize>(particles: &Particles<D>, s: usize, twin: usize, place: &Vector<D>) -> f64 {
    let Particles { position, normal, depth, .. } = particles;
    let thickness = (depth[s] + depth[twin]).max(f64::MIN_POSITIVE); // zero where nobody has told the depths
    let higher = (place - position[s]).dot(&(normal[s] - normal[twin])) - (depth[s] - depth[twin]);
    let t = (0.5 + 0.5 * higher / thickness).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn distance_to_segment<const D: usize>(point: &Vector<D>, a: &Vector<D>, b: &Vector<D>) -> f64 {
    let along = b - a;
    let t = ((point - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (point - a - along * t).norm()
}
