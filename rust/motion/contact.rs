//! What bodies that move cannot do: come into each other, or leave a slip wall that cuts them. Contact is not computed, so that what follows
//! would be wrong.

use super::{Motion, Moving, Shape};
use crate::base::Vector;
use crate::base::error::{Result, setting};
use crate::discretisation::Stencil;
use crate::particles::Particles;
use crate::settings::{Boundary, Settings};
use rayon::prelude::*;

/// How far [Δx] a surface may come into another one, or a body move across a slip wall that cuts it.
const OVERLAP: f64 = 0.25;

/// A solid nearer to a slip wall [Δx] that is deeper than the other under its surface, is of a body which the wall cuts.
const BESIDE: f64 = 0.75;
const DEEP: f64 = 1.0;

/// The slip walls across `axis`: where they are, and the way out.
fn slip_walls(settings: &Settings, axis: usize) -> impl Iterator<Item = (f64, f64)> + use<> {
    let domain = &settings.domain;
    let sides = [(domain.lower[axis], -1.0), (domain.upper[axis], 1.0)];
    let kinds = domain.boundaries[axis];
    sides.into_iter().zip(kinds).filter(|(_, kind)| *kind == Boundary::Slip).map(|(side, _)| side)
}

/// Note of a body which walls cut it, from one of its particles at the start.
pub(super) fn note_cuts<const D: usize>(settings: &Settings, position: &Vector<D>, depth: f64, is_cut: &mut [bool; D]) {
    let spacing = settings.particle_spacing;
    for axis in (0..D).filter(|_| depth > DEEP * spacing) {
        is_cut[axis] |= slip_walls(settings, axis).any(|(wall, out)| (wall - position[axis]) * out < BESIDE * spacing);
    }
}

impl<const D: usize> Motion<D> {
    /// Refuse bodies where they are in the frame of a step, at a `time`.
    pub fn check_contact(
        &self,
        settings: &Settings,
        particles: &Particles<D>,
        stencil: &Stencil<D>,
        time: f64,
    ) -> Result<()> {
        let name = |body: u16| &settings.bodies[body as usize].name;
        let refuse = |problem: String| Err(setting("bodies", format!("at time {time:.6} {problem}")));
        let most = OVERLAP * self.spacing;
        for Moving { body, is_cut, frame, .. } in &self.bodies {
            if let Some(axis) = (0..D).find(|&axis| is_cut[axis] && frame.displacement[axis].abs() > most) {
                return refuse(format!("`{}`, which a slip wall cuts, moves across it, along axis {axis}", name(*body)));
            }
        }
        let met = self.members.par_iter().find_map_first(|&(i, shape)| {
            let Shape { body, outer, .. } = self.shape[shape];
            let Moving { body, rigid, .. } = &self.bodies[body];
            if rigid.is_none() || !outer {
                return None;
            }
            let surface = stencil.position[i] + particles.normal[i] * particles.depth[i];
            let is_in = |&a: &usize| {
                let way = surface - stencil.position[a];
                particles.body[a] != *body
                    && way.norm() < self.spacing
                    && way.dot(&particles.normal[a]) - particles.depth[a] < -most
            };
            let other = stencil.solids_near(settings, i).find(is_in)?;
            Some(format!("`{}` has come into `{}`", name(*body), name(particles.body[other])))
        });
        met.map_or(Ok(()), |met| refuse(format!("{met}; what happens where bodies touch is not computed")))
    }
}
