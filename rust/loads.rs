//! Force and torque of the fluid on each body.
//!
//! The pressure acts through Σ_s Σ_f V_s V_f (p_s + p_f) ∇_s W_sf over solid s and fluid f, p being what the velocity of the step had the
//! gradient of (the scheme's acting pressure), and the viscous stress through the compact Laplacian of the same pairs. Both
//! are antisymmetric, so the solid's own pairs cancel and only fluid neighbours count. Their sum is the momentum that the fluid gives.
//! The viscous pairs feel the slope of the velocity over the width of a kernel. Where
//! the velocity's slope at the surface is known, the viscous part is its shear over the area of the surface, and the pressure part the rest.

use crate::base::Vector;
use crate::base::parallel;
use crate::boundary::{Walls, surface_area};
use crate::frame::Frame;
use crate::particles::{ParticleKind, Particles};
use crate::settings::Settings;

/// Force and torque on one body. In 2-D the torque's only component is the last one.
#[derive(Clone, Copy, Debug)]
pub struct Load<const D: usize> {
    pub pressure_force: Vector<D>,
    pub viscous_force: Vector<D>,
    pub pressure_torque: [f64; 3],
    pub viscous_torque: [f64; 3],
}

impl<const D: usize> Default for Load<D> {
    fn default() -> Self {
        Self {
            pressure_force: Vector::zeros(),
            viscous_force: Vector::zeros(),
            pressure_torque: [0.0; 3],
            viscous_torque: [0.0; 3],
        }
    }
}

impl<const D: usize> Load<D> {
    /// Add a pressure force that acts at `arm`, and a viscous force that acts at `surface`.
    fn add(&mut self, arm: &Vector<D>, pressure: Vector<D>, surface: &Vector<D>, viscous: Vector<D>) {
        self.pressure_force += pressure;
        self.viscous_force += viscous;
        add(&mut self.pressure_torque, cross(arm, &pressure));
        add(&mut self.viscous_torque, cross(surface, &viscous));
    }

    fn merge(&mut self, other: &Self) {
        self.pressure_force += other.pressure_force;
        self.viscous_force += other.viscous_force;
        add(&mut self.pressure_torque, other.pressure_torque);
        add(&mut self.viscous_torque, other.viscous_torque);
    }
}

/// The loads on every body, at the positions of `frame`, where `pressure` acts on the particles.
pub fn loads<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    walls: &Walls<D>,
    pressure: impl Fn(usize) -> f64 + Sync,
) -> Vec<Load<D>> {
    let centers: Vec<_> = settings.bodies.iter().map(|body| Vector::<D>::from_column_slice(&body.center)).collect();
    let chunk = |range: std::ops::Range<usize>| {
        let mut loads = Vec::new();
        for s in range.filter(|&i| particles.kind[i] == ParticleKind::Solid) {
            loads.resize(centers.len(), Load::default());
            let (pressure, viscous) = force_on(settings, particles, frame, walls, &pressure, s);
            let body = particles.body[s] as usize;
            let arm = particles.position[s] - centers[body];
            loads[body].add(&arm, pressure, &(arm + particles.normal[s] * particles.depth[s]), viscous);
        }
        loads
    };
    // Most chunks hold no solid and give an empty vector.
    let mut sum = parallel::reduce(particles.real, chunk, |mut sum: Vec<Load<D>>, part| {
        sum.resize(sum.len().max(part.len()), Load::default());
        sum.iter_mut().zip(&part).for_each(|(sum, part)| sum.merge(part));
        sum
    })
    .unwrap_or_default();
    sum.resize(centers.len(), Load::default());
    sum
}

/// Pressure and viscous force on solid particle `s`.
fn force_on<const D: usize>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    walls: &Walls<D>,
    acting: &impl Fn(usize) -> f64,
    s: usize,
) -> (Vector<D>, Vector<D>) {
    let stencil = &frame.stencil;
    let viscosity = settings.density * settings.kinematic_viscosity;
    let (mut pressure, mut viscous) = (Vector::zeros(), Vector::zeros());
    let (row, lane) = stencil.neighbours.row(s);
    for entry in row.flowing() {
        let f = entry.j();
        let slope = entry.slope(lane);
        let r_sf = stencil.position[s] - stencil.position[f];
        pressure -= r_sf * (slope * (acting(s) + acting(f)));
        let dispersion = |i: usize| walls.dispersion.get(i).copied().unwrap_or_else(Vector::zeros);
        let relative = (particles.velocity[f] - dispersion(f)) - (walls.seen_by(particles, s, f) - dispersion(s));
        viscous += relative * (-slope * 2.0 * viscosity);
    }
    (pressure, viscous) = (pressure * stencil.volume[s], viscous * stencil.volume[s]);
    if let Some(&Some(slope)) = walls.slope.get(s) {
        let normal = &particles.normal[s];
        // Without divergence the normal velocity has no slope at a wall; that of the fit is no stress.
        let along = slope - normal * slope.dot(normal);
        let shear = along * (viscosity * surface_area(settings, particles, stencil, s));
        (pressure, viscous) = (pressure + viscous - shear, shear);
    }
    (pressure, viscous)
}

fn add(sum: &mut [f64; 3], part: [f64; 3]) {
    sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
}

fn cross<const D: usize>(a: &Vector<D>, b: &Vector<D>) -> [f64; 3] {
    let [a, b] = [a, b].map(|v| nalgebra::Vector3::from_fn(|k, _| if k < D { v[k] } else { 0.0 }));
    a.cross(&b).into()
}
