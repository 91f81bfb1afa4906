//! Breakdown of a computation: what is looked for after every step, and what is likely to have caused it.

use crate::base::Vector;
use crate::base::parallel::CHUNK;
use crate::frame::Frame;
use crate::kernel::{Smoothing, with_kernel};
use crate::particles::{ParticleKind, Particles, Place};
use crate::settings::{Body, Boundary, Settings, TimeStepLimits};
use rayon::prelude::*;

/// A particle whose neighbours' kernels sum to less than this part of its own is alone.
const LONELY: f64 = 0.25;

/// How far under a surface [Δx] a particle is lost: beyond the outermost solid particles.
const DEEP: f64 = 0.75;

/// How far beyond a side [Δx] a particle of a body that moves may be.
const OUTSIDE: f64 = 0.25;

/// What is wrong with a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symptom {
    pub particle: usize,
    /// ``velocity``, ``pressure``, ``position`` or ``volume``.
    pub field: &'static str,
    /// Speed, pressure, distance beyond the domain or under a surface, or volume.
    pub value: f64,
}

/// The first particle, if any, that has a value that is not finite, would cross more than Δx in a step, is faster than the
/// velocity limit and not alone in the air, has left the domain through a wall, has gone into a body, or has no neighbours,
/// or too few for a gradient. `place` is of real particles beside a free surface, empty where there is none.
pub fn find<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    place: &[Place],
    time_step: f64,
) -> Option<Symptom> {
    let volume = &frame.stencil.volume;
    let fastest = settings.velocity_limit.unwrap_or(f64::INFINITY).min(settings.particle_spacing / time_step);
    let largest = largest_volume(settings);
    let radius = settings.support_radius();
    let bad = |i: usize| {
        let symptom = |field, value| Some(Symptom { particle: i, field, value });
        if !particles.pressure[i].is_finite() {
            return symptom("pressure", particles.pressure[i]);
        }
        if particles.kind[i] == ParticleKind::Solid {
            let sides = |side| side != Boundary::Periodic;
            let beyond = if settings.bodies[particles.body[i] as usize].is_rigid() {
                beyond(settings, &particles.position[i], sides)
            } else {
                0.0
            };
            return if beyond > OUTSIDE * settings.particle_spacing { symptom("position", beyond) } else { None };
        }
        let speed = particles.velocity[i].norm();
        // A drop of a splash is no sign of a breakdown, however fast it is.
        let is_alone = place.get(i) == Some(&Place::Isolated);
        let fastest = if is_alone { settings.particle_spacing / time_step } else { fastest };
        if speed.is_nan() || speed > fastest {
            return symptom("velocity", speed);
        }
        if particles.kind[i] == ParticleKind::Fluid {
            let closed = |side| !matches!(side, Boundary::Inlet | Boundary::Outlet | Boundary::Air);
            let beyond = beyond(settings, &particles.position[i], closed);
            if beyond > radius {
                return symptom("position", beyond);
            }
            let under = depth(settings, particles, frame, i);
            if under > DEEP * settings.particle_spacing {
                return symptom("position", under);
            }
            if settings.free_surface.is_none() && (volume[i] > largest || frame.stencil.correction[i].is_singular()) {
                return symptom("volume", volume[i]);
            }
        }
        None
    };
    // Of several the one with the least id, whose choice does not depend on how they are stored.
    (0..particles.real)
        .into_par_iter()
        .with_min_len(CHUNK)
        .filter_map(bad)
        .min_by_key(|symptom| particles.id[symptom.particle])
}

/// V of a particle that is alone but for a few neighbours at the edge of its support.
fn largest_volume(settings: &Settings) -> f64 {
    let own = with_kernel!(settings.kernel, kernel => {
        Smoothing::new(kernel, settings.smoothing_length(), settings.dimensions).value(0.0)
    });
    1.0 / ((1.0 + LONELY) * own)
}

/// The least depth under the surface of a body that particle `i` can have, as the solid particles around it tell: a place
/// at a distance from one is no less deep than it by more than that. Which holds for the surface nearest to it; the depth
/// under the other face of a thin part, beside whose edge the fluid may be nearer, counts for fluid within Δx alone.
fn depth<const D: usize>(settings: &Settings, particles: &Particles<D>, frame: &Frame<D>, i: usize) -> f64 {
    let Particles { position, depth, .. } = particles;
    let least = |j: usize| {
        let away = (position[j] - position[i]).norm();
        let other = frame.faces.twin(j).filter(|_| away > settings.particle_spacing);
        other.map_or(depth[j], |twin| depth[j].min(depth[twin])) - away
    };
    let (row, lane) = frame.stencil.neighbours.row(i);
    if row.solid().is_empty() {
        return 0.0;
    }
    // Of two at one place, the one whose face it is not on is deeper.
    let facing = row.solid_seen(lane).filter(|(_, share)| *share > 0.5).map(|(entry, _)| entry.j());
    facing.filter(|&j| frame.stencil.is_near(settings, i, j)).map(least).fold(0.0, f64::max)
}

/// How far `position` lies beyond the sides of the domain that are `closed`.
fn beyond<const D: usize>(settings: &Settings, position: &Vector<D>, closed: impl Fn(Boundary) -> bool) -> f64 {
    let domain = &settings.domain;
    (0..D).fold(0.0, |farthest: f64, axis| {
        let [lower, upper] = domain.boundaries[axis];
        let below = if closed(lower) { domain.lower[axis] - position[axis] } else { 0.0 };
        let above = if closed(upper) { position[axis] - domain.upper[axis] } else { 0.0 };
        farthest.max(below).max(above)
    })
}

/// The likely cause of a symptom, and a remedy. `limits` are those of the velocities before the step.
pub fn likely_cause<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    symptom: Symptom,
    time_step: f64,
    limits: TimeStepLimits,
) -> String {
    let bounds = [
        ("Courant", limits.courant),
        ("penalty", limits.penalty),
        ("acoustic", limits.acoustic),
        ("viscous", limits.viscous),
        ("body force", limits.body_force),
    ];
    let (name, bound) = bounds.into_iter().fold(bounds[0], |least, next| if next.1 < least.1 { next } else { least });
    // A hair of room, because a step at its bound is not beyond it.
    if time_step > 1.001 * bound {
        let ratio = time_step / bound;
        return format!(
            "the time step {time_step:.3e} is {ratio:.1} times the {name} limit of the velocities before it, {bound:.3e}: \
             take a smaller time step, or an adaptive one"
        );
    }
    match symptom.field {
        "position" if particles.kind[symptom.particle] == ParticleKind::Solid => format!(
            "body \"{}\" has reached a side of the domain: let it move less far, or take a larger domain",
            settings.bodies[particles.body[symptom.particle] as usize].name
        ),
        "position" => {
            let told = "it has gone through a wall or into a body: take a smaller time step or a finer resolution";
            match nearest_body(settings, particles, symptom.particle).filter(|body| body.is_rigid()) {
                Some(body) => format!("{told}, or keep \"{}\" some spacings away from sides and other bodies", body.name),
                None => told.into(),
            }
        }
        "volume" => "a void has opened around it: take a smaller time step, a finer resolution, or more shifting".into(),
        _ => format!(
            "{}: take a smaller time step, a smaller penalty constant or a finer resolution",
            place(settings, particles, symptom.particle)
        ),
    }
}

/// Where a particle is, in words.
fn place<const D: usize>(settings: &Settings, particles: &Particles<D>, i: usize) -> String {
    let near = 2.0 * settings.support_radius();
    match particles.kind[i] {
        ParticleKind::Inlet => return "it is in the inlet buffer".into(),
        ParticleKind::Outlet => return "it is in the outlet buffer".into(),
        _ => {}
    }
    let domain = &settings.domain;
    for axis in 0..D {
        let x = particles.position[i][axis];
        for (side, distance) in domain.boundaries[axis].iter().zip([x - domain.lower[axis], domain.upper[axis] - x]) {
            match side {
                Boundary::Inlet if distance < near => return "it is near the inlet".into(),
                Boundary::Outlet if distance < near => return "it is near the outlet".into(),
                _ => {}
            }
        }
    }
    match nearest_body(settings, particles, i) {
        Some(body) => format!("it is near \"{}\"", body.name),
        None => "it is in the open flow".into(),
    }
}

/// The body that a particle is near, if it is near one.
fn nearest_body<'a, const D: usize>(settings: &'a Settings, particles: &Particles<D>, i: usize) -> Option<&'a Body> {
    let distance = |&j: &usize| (particles.position[j] - particles.position[i]).norm();
    let solid = (0..particles.real).filter(|&j| particles.kind[j] == ParticleKind::Solid && j != i);
    let nearest = solid.min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let near = nearest.filter(|j| distance(j) < 2.0 * settings.support_radius());
    near.map(|j| &settings.bodies[particles.body[j] as usize])
}
