//! Refusal of arrays that cannot be simulated.

use crate::base::Vector;
use crate::base::error::{Error, Result, setting};
use crate::neighbours::Grid;
use crate::particles::{ParticleKind, Particles, Place, is_late, lineage};
use crate::settings::{Boundary, Settings};

/// Refuse arrays that cannot be simulated; give solid particles the velocity of their body, if it has one.
pub(super) fn check_particles<const D: usize>(settings: &Settings, particles: &mut Particles<D>) -> Result<()> {
    let array = |name, problem| Err(Error::Array { name, problem });
    particles.real = particles.len();
    if particles.place.is_empty() || settings.free_surface.is_none() {
        particles.place = vec![Place::Inside; particles.real];
    }
    if particles.unkept_pressure.is_empty() || !settings.has_unkept_pressure() {
        particles.unkept_pressure = vec![0.0; particles.real];
    }
    if particles.place.len() != particles.real {
        return array("place", format!("has {} entries for {} positions", particles.place.len(), particles.real));
    }
    if !particles.kind.contains(&ParticleKind::Fluid) {
        return array("kind", "holds no fluid particle (0)".into());
    }
    for i in 0..particles.len() {
        let vectors =
            [("position", particles.position[i]), ("velocity", particles.velocity[i]), ("normal", particles.normal[i])];
        if let Some((name, value)) = vectors.iter().find(|(_, value)| !value.iter().all(|x| x.is_finite())) {
            return array(name, format!("of particle {i} is {:?}; all must be finite", value.as_slice()));
        }
        let scalars = [
            ("pressure", particles.pressure[i]),
            ("depth", particles.depth[i]),
            ("unkept_pressure", particles.unkept_pressure[i]),
        ];
        if let Some((name, value)) = scalars.iter().find(|(_, value)| !value.is_finite()) {
            return array(name, format!("of particle {i} is {value}; all must be finite"));
        }
        if particles.kind[i] == ParticleKind::Solid {
            let Some(body) = settings.bodies.get(particles.body[i] as usize) else {
                return array(
                    "body",
                    format!("particle {i} belongs to body {}, of {}", particles.body[i], settings.bodies.len()),
                );
            };
            if let Some(velocity) = &body.velocity {
                particles.velocity[i] = Vector::from_column_slice(velocity);
            }
            let along = particles.velocity[i].try_normalize(0.0).map_or(0.0, |along| along.dot(&particles.position[i]));
            let slack = 1e-6 * settings.particle_spacing;
            if let Some([from, to]) = body.belt.filter(|[from, to]| !(from - slack..=to + slack).contains(&along)) {
                return array(
                    "position",
                    format!("particle {i} of {} is at {along} along its belt of {from}..{to}", body.name),
                );
            }
        } else if let Some(axis) = (0..D).find(|&axis| is_beyond_closed_side(settings, &particles.position[i], axis)) {
            let [lower, upper] = [settings.domain.lower[axis], settings.domain.upper[axis]];
            let x = particles.position[i][axis];
            return array("position", format!("particle {i} is at {x} in direction {axis}, outside {lower}..{upper}"));
        }
    }
    check_ids(particles)?;
    check_spacing(settings, particles)
}

/// Whether `position` lies beyond a slip wall or periodic side.
fn is_beyond_closed_side<const D: usize>(settings: &Settings, position: &Vector<D>, axis: usize) -> bool {
    let closed = |side| matches!(side, Boundary::Slip | Boundary::Periodic);
    let [lower, upper] = settings.domain.boundaries[axis];
    (closed(lower) && position[axis] < settings.domain.lower[axis])
        || (closed(upper) && position[axis] > settings.domain.upper[axis])
}

/// Refuse ids that stand twice, or would when inlet particles are followed by new ones.
fn check_ids<const D: usize>(particles: &Particles<D>) -> Result<()> {
    let refuse = |problem| Err(Error::Array { name: "id", problem });
    let mut sorted: Vec<_> = (0..particles.len()).map(|i| (lineage(particles.id[i]), particles.id[i], i)).collect();
    sorted.sort_unstable();
    for pair in sorted.windows(2) {
        let [(line, id, i), (next, other, _)] = [pair[0], pair[1]];
        if id == other {
            return refuse(format!("{id} stands twice"));
        }
        if line == next && particles.kind[i] == ParticleKind::Inlet {
            return refuse(format!("{other} is one that follows inlet particle {id}: give ids below {}", 1u64 << 40));
        }
    }
    match (0..particles.len()).find(|&i| particles.kind[i] == ParticleKind::Inlet && is_late(particles.id[i])) {
        Some(i) => refuse(format!("{} of an inlet particle is too large", particles.id[i])),
        None => Ok(()),
    }
}

/// Refuse a spacing that does not fit the positions: the number of pairs grows with its power.
fn check_spacing<const D: usize>(settings: &Settings, particles: &Particles<D>) -> Result<()> {
    const MOST: f64 = 20.0;
    let mut grid = Grid::default();
    grid.build(&particles.position, &particles.id, settings.support_radius(), settings.bounds());
    let mut candidates = 0;
    particles.position.iter().for_each(|point| grid.for_each_run(&[*point], |run| candidates += run.indices.len()));
    let mean = candidates as f64 / particles.len() as f64;
    let expected = (2.5 * settings.support_radius() / settings.particle_spacing).powi(D as i32);
    if mean > MOST * expected + 64.0 {
        let problem =
            format!("does not fit the positions: {mean:.0} particles around each, where it makes {expected:.0} expected");
        return Err(setting("particle_spacing", problem));
    }
    Ok(())
}
