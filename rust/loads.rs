//! Force and torque of the fluid on each body.
//!
//! The pressure acts through Σ_s Σ_f V_s V_f (p_s + p_f) ∇_s W_sf over solid s and fluid f, p being what the velocity of the step had the
//! gradient of (the scheme's acting pressure), and the viscous stress through the compact Laplacian of the same pairs. Both
//! are antisymmetric, so the solid's own pairs cancel and only fluid neighbours count. Their sum is the momentum that the fluid gives.
//! Beside a free surface all that the step's terms give to the fluid counts with the pressure, and what solids hold that comes too near.
//! The viscous pairs feel the slope of the velocity over the width of a kernel. Where
//! the velocity's slope at the surface is known, the viscous part is its shear over the area of the surface, and the pressure part the rest.

use crate::base::parallel;
use crate::base::{ExactSum, Matrix, Vector};
use crate::boundary::{Walls, surface_area};
use crate::discretisation::Stencil;
use crate::frame::Frame;
use crate::motion::Motion;
use crate::neighbours::Entry;
use crate::particles::{ParticleKind, Particles};
use crate::settings::Settings;

/// Force and torque on one body. In 2-D the torque's only component is the last one.
#[derive(Clone, Copy, Debug)]
pub struct Load<const D: usize> {
    pub pressure_force: Vector<D>,
    pub viscous_force: Vector<D>,
    pub pressure_torque: [f64; 3],
    pub viscous_torque: [f64; 3],
    /// What the surface gives in unit time as it slides along itself: minus both forces, of which only the sum is the fluid's loss, times
    /// its velocity without the normal part.
    pub sliding_power: f64,
}

impl<const D: usize> Default for Load<D> {
    fn default() -> Self {
        Self {
            pressure_force: Vector::zeros(),
            viscous_force: Vector::zeros(),
            pressure_torque: [0.0; 3],
            viscous_torque: [0.0; 3],
            sliding_power: 0.0,
        }
    }
}

/// What the loads on a body are summed in: both forces, then both torques, of three components each, and the power.
type Sums = [ExactSum; 13];

impl<const D: usize> Load<D> {
    /// That of a pressure force that acts at `arm`, and a viscous force that acts at `surface`, whose velocity along itself is `sliding`.
    fn new(arm: &Vector<D>, pressure: Vector<D>, surface: &Vector<D>, viscous: Vector<D>, sliding: &Vector<D>) -> Self {
        Self {
            pressure_force: pressure,
            viscous_force: viscous,
            pressure_torque: cross(arm, &pressure),
            viscous_torque: cross(surface, &viscous),
            sliding_power: -(pressure + viscous).dot(sliding),
        }
    }

    /// Force and torque.
    pub fn total(&self) -> [nalgebra::Vector3<f64>; 2] {
        let add = |a: [f64; 3], b: [f64; 3]| nalgebra::Vector3::from(a) + nalgebra::Vector3::from(b);
        let force = add(components(&self.pressure_force), components(&self.viscous_force));
        [force, add(self.pressure_torque, self.viscous_torque)]
    }

    fn add_to(&self, sums: &mut Sums) {
        let forces = [&self.pressure_force, &self.viscous_force].map(components);
        let terms =
            forces.into_iter().chain([self.pressure_torque, self.viscous_torque]).flatten().chain([self.sliding_power]);
        sums.iter_mut().zip(terms).for_each(|(sum, term)| sum.add(term));
    }

    fn of(sums: &Sums) -> Self {
        let three = |start: usize| std::array::from_fn(|k| sums[start + k].value());
        let force = |start: usize| Vector::from_fn(|k, _| sums[start + k].value());
        Self {
            pressure_force: force(0),
            viscous_force: force(3),
            pressure_torque: three(6),
            viscous_torque: three(9),
            sliding_power: sums[12].value(),
        }
    }
}

/// The loads on every body, at the positions of `frame`, where `pressure` is the force on a solid without the viscous one.
pub fn loads<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    walls: &Walls<D>,
    motion: &Motion<D>,
    pressure: impl Fn(usize) -> Vector<D> + Sync,
) -> Vec<Load<D>> {
    let centers: Vec<_> = (0..settings.bodies.len()).map(|body| motion.center(body, &settings.bodies)).collect();
    let add = |sums: &mut Vec<Sums>, s: usize| {
        if particles.kind[s] == ParticleKind::Solid {
            sums.resize_with(centers.len(), Sums::default);
            let (pressure, viscous) = force_on(settings, particles, frame, walls, pressure(s), s);
            let body = particles.body[s] as usize;
            let arm = motion.arm(body, particles.position[s] - centers[body]);
            let (normal, velocity) = (&particles.normal[s], &particles.velocity[s]);
            let (surface, sliding) = (arm + normal * particles.depth[s], velocity - normal * velocity.dot(normal));
            Load::new(&arm, pressure, &surface, viscous, &sliding).add_to(&mut sums[body]);
        }
    };
    // Most chunks hold no solid and give an empty vector.
    let mut sums = parallel::accumulate(particles.real, Vec::new, add, |sums, part| {
        sums.resize_with(sums.len().max(part.len()), Sums::default);
        sums.iter_mut().flatten().zip(part.iter().flatten()).for_each(|(sum, part)| sum.merge(part));
    });
    sums.resize_with(centers.len(), Sums::default);
    sums.iter().map(Load::of).collect()
}

/// Σ V_s V_f (dW/dr)/r `pair`(f, r_sf) over the fluid around solid particle `s`, whose row has V_f (dW/dr)/r.
pub fn pairs<const D: usize>(stencil: &Stencil<D>, s: usize, pair: impl Fn(usize, Vector<D>) -> Vector<D>) -> Vector<D> {
    let (row, lane) = stencil.neighbours.row(s);
    let of = |entry: &Entry| {
        let f = entry.j();
        pair(f, stencil.position[s] - stencil.position[f]) * entry.slope(lane)
    };
    row.flowing().iter().map(of).sum::<Vector<D>>() * stencil.volume[s]
}

/// The force on solid particle `s` of a pressure that acts so.
pub fn force_of_pressure<const D: usize>(stencil: &Stencil<D>, acting: impl Fn(usize) -> f64, s: usize) -> Vector<D> {
    pairs(stencil, s, |f, r_sf| -r_sf * (acting(s) + acting(f)))
}

/// Pressure and viscous force on solid particle `s`.
fn force_on<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    walls: &Walls<D>,
    mut pressure: Vector<D>,
    s: usize,
) -> (Vector<D>, Vector<D>) {
    let stencil = &frame.stencil;
    let viscosity = settings.density * settings.kinematic_viscosity;
    let mut viscous = Vector::zeros();
    let (row, lane) = stencil.neighbours.row(s);
    for entry in row.flowing() {
        let f = entry.j();
        let slope = entry.slope(lane);
        let dispersion = |i: usize| walls.dispersion.get(i).copied().unwrap_or_else(Vector::zeros);
        let relative = (particles.velocity[f] - dispersion(f)) - (walls.seen_by(particles, s, f) - dispersion(s));
        viscous += relative * (-slope * 2.0 * viscosity);
    }
    viscous *= stencil.volume[s];
    if let Some(&Some(slope)) = walls.slope.get(s) {
        let normal = &particles.normal[s];
        // Without divergence the normal velocity has no slope at a wall; that of the fit is no stress.
        let along = slope - normal * slope.dot(normal);
        let factor = viscosity * surface_area(settings, particles, stencil, s);
        let turning = if factor > 0.0 { turning(settings, particles, frame, s) } else { Vector::zeros() };
        let shear = along * factor;
        (pressure, viscous) = (pressure + viscous - shear, shear + turning * factor);
    }
    (pressure, viscous)
}

/// (∇u)ᵀ n of the surface above solid particle `s`, along it: what the stress has beside the slope where the surface turns, −u/R on a cylinder
/// of radius R. Its torque alone is not zero. From the solids of the body around, whose velocity is that of the surface above them.
fn turning<const D: usize>(settings: &Settings, particles: &Particles<D>, frame: &Frame<D>, s: usize) -> Vector<D> {
    let Particles { position, normal, depth, velocity, body, .. } = particles;
    let above = |a: usize| position[a] + normal[a] * depth[a];
    let n = &normal[s];
    let near = || frame.stencil.solids_near(settings, s).filter(|&a| body[a] == body[s]);
    if near().all(|a| velocity[a] == velocity[s]) {
        return Vector::zeros();
    }
    // Least squares of the differences along the surface; nothing is known across it.
    let (mut moments, mut sums) = (Matrix::<D>::zeros(), Vector::<D>::zeros());
    for a in near().filter(|&a| normal[a].dot(n) > 0.0) {
        let away = above(a) - above(s);
        let along = away - n * away.dot(n);
        moments += along * along.transpose();
        sums += along * (velocity[a] - velocity[s]).dot(n);
    }
    moments += n * n.transpose() * moments.trace();
    moments.try_inverse().map_or_else(Vector::zeros, |inverse| inverse * sums)
}

fn components<const D: usize>(v: &Vector<D>) -> [f64; 3] {
    std::array::from_fn(|k| if k < D { v[k] } else { 0.0 })
}

pub fn cross<const D: usize>(a: &Vector<D>, b: &Vector<D>) -> [f64; 3] {
    let [a, b] = [a, b].map(|v| nalgebra::Vector3::from(components(v)));
    a.cross(&b).into()
}
