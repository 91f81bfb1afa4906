//! Clock and report: what goes on through a restart, and what is recorded of a step.

use crate::base::{Vector, exact_sums, parallel};
use crate::discretisation::Stencil;
use crate::flow::{Flow, Step};
use crate::loads::{Load, cross};
use crate::motion::Pose;
use crate::particles::{ParticleKind, Particles, Place};
use crate::scheme::{Outcome, Taken};
use crate::settings::{Boundary, Settings};
use std::ops::Range;

/// Counters that go on through a restart.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    pub time: f64,
    pub step: u64,
    /// Mass that has crossed the inlet and outlet planes.
    pub mass_in: f64,
    pub mass_out: f64,
}

#[derive(Clone, Debug)]
pub struct Report<const D: usize> {
    /// At the end of the step.
    pub clock: Clock,
    pub time_step: f64,
    pub outcome: Outcome,
    /// u_max at the start of the step.
    pub velocity_max: f64,
    /// r_AL.
    pub penalty: f64,
    /// Fluid particles that the sums of this report run over.
    pub fluid: usize,
    /// Σ V_i of the fluid; beside a surface of 1/Σ W for particles inside, of Δx^D for the others.
    pub volume: f64,
    /// ½ρ Σ V_i u_i² of the fluid.
    pub kinetic_energy: f64,
    /// ρΔx^D Σ r_i × u_i of the fluid at the end of the step, about the origin.
    pub angular_momentum: [f64; 3],
    /// −ρ Σ V_i g·r_i of the fluid at the end of the step, g being the body force of the settings.
    pub potential_energy: f64,
    pub packing: Packing,
    /// What viscosity takes of the kinetic energy in unit time, see [`dissipation`].
    pub dissipation: f64,
    pub taken: Taken,
    /// Mean pressure within Δx of the inlet plane; NaN without an inlet.
    pub inlet_pressure: f64,
    /// Fluid, inlet, outlet, solid at the end of the step.
    pub counts: [usize; 4],
    /// Particles that come back in the buffers of outlets.
    pub returning: usize,
    /// Particles at a free surface, and those that are alone.
    pub places: [usize; 2],
    pub loads: Vec<Load<D>>,
    /// Where each body is at the end of the step, and how fast it moves, if it does as a rigid one.
    pub poses: Vec<Pose>,
}

/// How closely the fluid particles lie: their number density Σ W over that of the undisturbed lattice, 1 where the density of the fluid
/// has been kept; of those whose support no surface cuts.
#[derive(Clone, Copy, Debug)]
pub struct Packing {
    pub min: f64,
    pub max: f64,
    /// Root mean square of its distance from 1.
    pub rms: f64,
}

/// What a column of the history holds of a step.
pub enum Column<const D: usize> {
    Number(fn(&Report<D>) -> f64),
    Count(fn(&Report<D>) -> u64),
    Flag(fn(&Report<D>) -> bool),
    /// A vector for each body.
    Force(fn(&Load<D>) -> Vector<D>),
    /// Three components for each body, of which the last alone says something in 2-D.
    Torque(fn(&Load<D>) -> [f64; 3]),
    /// A vector of each body's motion.
    Way(fn(&Pose) -> nalgebra::Vector3<f64>),
    /// Likewise of its rotation, with the components of a torque.
    Turn(fn(&Pose) -> nalgebra::Vector3<f64>),
}

/// The columns of the history: the one list of them.
pub fn columns<const D: usize>() -> Vec<(&'static str, Column<D>)> {
    use Column::{Count, Flag, Force, Number, Torque, Turn, Way};
    vec![
        ("time", Number(|r| r.clock.time)),
        ("time_step", Number(|r| r.time_step)),
        ("divergence_max", Number(|r| r.outcome.divergence_max)),
        ("divergence_mean", Number(|r| r.outcome.divergence_sum / r.fluid.max(1) as f64)),
        ("divergence_sum", Number(|r| r.outcome.divergence_sum)),
        ("velocity_max", Number(|r| r.velocity_max)),
        ("penalty_coefficient", Number(|r| r.penalty)),
        ("volume", Number(|r| r.volume)),
        ("kinetic_energy", Number(|r| r.kinetic_energy)),
        ("potential_energy", Number(|r| r.potential_energy)),
        ("dissipation", Number(|r| r.dissipation)),
        ("artificial_dissipation", Number(|r| r.taken.artificial)),
        ("penalty_dissipation", Number(|r| r.taken.penalty)),
        ("pressure_dissipation", Number(|r| r.taken.pressure)),
        ("sweep_dissipation", Number(|r| r.taken.sweeps)),
        ("contact_dissipation", Number(|r| r.taken.contact)),
        ("angular_momentum_x", Number(|r| r.angular_momentum[0])),
        ("angular_momentum_y", Number(|r| r.angular_momentum[1])),
        ("angular_momentum_z", Number(|r| r.angular_momentum[2])),
        ("packing_min", Number(|r| r.packing.min)),
        ("packing_max", Number(|r| r.packing.max)),
        ("packing_rms", Number(|r| r.packing.rms)),
        ("residual", Number(|r| r.outcome.residual)),
        ("mass_in", Number(|r| r.clock.mass_in)),
        ("mass_out", Number(|r| r.clock.mass_out)),
        ("inlet_pressure", Number(|r| r.inlet_pressure)),
        ("step", Count(|r| r.clock.step)),
        ("iterations", Count(|r| r.outcome.iterations as u64)),
        ("converged", Flag(|r| r.outcome.converged)),
        (ParticleKind::NAMES[0], Count(|r| r.counts[0] as u64)),
        (ParticleKind::NAMES[1], Count(|r| r.counts[1] as u64)),
        (ParticleKind::NAMES[2], Count(|r| r.counts[2] as u64)),
        (ParticleKind::NAMES[3], Count(|r| r.counts[3] as u64)),
        ("returning", Count(|r| r.returning as u64)),
        ("surface", Count(|r| r.places[0] as u64)),
        ("isolated", Count(|r| r.places[1] as u64)),
        ("pressure_force", Force(|load| load.pressure_force)),
        ("viscous_force", Force(|load| load.viscous_force)),
        ("pressure_torque", Torque(|load| load.pressure_torque)),
        ("viscous_torque", Torque(|load| load.viscous_torque)),
        ("displacement", Way(|pose| pose.displacement)),
        ("velocity", Way(|pose| pose.velocity)),
        ("angle", Turn(|pose| pose.angle)),
        ("angular_velocity", Turn(|pose| pose.spin)),
    ]
}

impl<const D: usize> Report<D> {
    /// The report of a step whose iteration has ended and whose particles have not yet been shifted; clock, counts, outcome, what is taken of
    /// the energy, potential energy and angular momentum come after.
    pub fn new(step: Step, flow: &Flow<D>, penalty: f64, loads: Vec<Load<D>>) -> Self {
        let Flow { particles, frame, surface, .. } = flow;
        let undisturbed = step.settings.undisturbed_volume();
        let Stencil { volume, number_density, .. } = &frame.stencil;
        let has_surface = step.settings.free_surface.is_some();
        let is_whole = |i: usize| !has_surface || surface.place[i] == Place::Inside;
        let [total, square, uneven, whole] = exact_sums(particles.real, |i| {
            let fluid = particles.kind[i] == ParticleKind::Fluid;
            fluid.then(|| {
                let whole = is_whole(i);
                let uneven = if whole { undisturbed * number_density[i] - 1.0 } else { 0.0 };
                let filled = if has_surface && whole { 1.0 / number_density[i] } else { volume[i] };
                let square = volume[i] * particles.velocity[i].norm_squared();
                [filled, square, uneven * uneven, f64::from(u8::from(whole))]
            })
        });
        let [least, largest] = extremes(particles, number_density, is_whole);
        let fluid = particles.counts()[ParticleKind::Fluid as usize];
        Self {
            clock: Clock::default(),
            time_step: step.time_step,
            outcome: Outcome {
                iterations: 0,
                residual: f64::NAN,
                converged: false,
                divergence_max: 0.0,
                divergence_sum: 0.0,
            },
            velocity_max: step.velocity_max,
            penalty,
            fluid,
            volume: total,
            kinetic_energy: 0.5 * step.settings.density * square,
            angular_momentum: [f64::NAN; 3],
            potential_energy: f64::NAN,
            packing: Packing { min: undisturbed * least, max: undisturbed * largest, rms: (uneven / whole).sqrt() },
            dissipation: f64::NAN,
            taken: Taken::default(),
            inlet_pressure: inlet_pressure(step.settings, particles),
            counts: [0; 4],
            returning: 0,
            places: [0; 2],
            loads,
            poses: Vec::new(),
        }
    }
}

/// The least and the largest number density of the fluid particles that are `whole`; of no fluid no numbers.
fn extremes<const D: usize>(particles: &Particles<D>, density: &[f64], whole: impl Fn(usize) -> bool + Sync) -> [f64; 2] {
    let wider = |[least, largest]: [f64; 2], [a, b]: [f64; 2]| [least.min(a), largest.max(b)];
    let fluid = |i: &usize| particles.kind[*i] == ParticleKind::Fluid && whole(*i);
    let of = |range: Range<usize>| range.filter(fluid).fold([f64::NAN; 2], |known, i| wider(known, [density[i]; 2]));
    parallel::reduce(particles.real, of, wider).unwrap_or([f64::NAN; 2])
}

/// What viscosity takes of the fluid's kinetic energy in unit time. Where nothing flows in or out it is 2ρν ∫ S:S dV, S = (∇u + ∇uᵀ)/2: the work
/// −ρν ∫ u·∇²u dV that the viscous term `laplacian` takes in the step of the mean of u^n and u^{n+1}, and what
/// walls give that slide along themselves. (ρν ∫ ∇u:∇u dV is another where walls turn.) Formed of the gradients that the particles
/// see it would be too small, by 3 % for a wave over 50 particles, and the budget of energy would not tell what the scheme loses.
pub fn dissipation<const D: usize>(
    step: Step,
    Flow { particles, before, frame, .. }: &Flow<D>,
    loads: &[Load<D>],
    laplacian: impl Fn(usize) -> Vector<D> + Sync,
) -> f64 {
    let [taken] = exact_sums(particles.real, |i| {
        let mean = || (before.velocity[i] + particles.velocity[i]) * 0.5;
        (particles.kind[i] == ParticleKind::Fluid).then(|| [-frame.stencil.volume[i] * mean().dot(&laplacian(i))])
    });
    let given: f64 = loads.iter().map(|load| load.sliding_power).sum();
    step.settings.density * step.settings.kinematic_viscosity * taken + given
}

/// [`Report::angular_momentum`] of particles at the end of a step.
pub fn angular_momentum<const D: usize>(settings: &Settings, particles: &Particles<D>) -> [f64; 3] {
    let sums = exact_sums(particles.real, |i| {
        (particles.kind[i] == ParticleKind::Fluid).then(|| cross(&particles.position[i], &particles.velocity[i]))
    });
    let mass = settings.density * settings.particle_spacing.powi(D as i32);
    sums.map(|sum| mass * sum)
}

/// [`Report::potential_energy`] once the particles have moved.
pub fn potential_energy<const D: usize>(step: Step, Flow { particles, frame, .. }: &Flow<D>) -> f64 {
    let gravity = Vector::<D>::from_column_slice(&step.settings.body_force);
    let [sum] = exact_sums(particles.real, |i| {
        (particles.kind[i] == ParticleKind::Fluid).then(|| [frame.stencil.volume[i] * gravity.dot(&particles.position[i])])
    });
    -step.settings.density * sum
}

fn inlet_pressure<const D: usize>(settings: &Settings, particles: &Particles<D>) -> f64 {
    let domain = &settings.domain;
    let planes = domain.boundaries.iter().enumerate().flat_map(|(axis, sides)| {
        let planes = [domain.lower[axis], domain.upper[axis]];
        sides.iter().zip(planes).filter(|(side, _)| **side == Boundary::Inlet).map(move |(_, plane)| (axis, plane))
    });
    let planes: Vec<_> = planes.collect();
    let [sum, count] = exact_sums(particles.real, |i| {
        let near = |&(axis, plane): &(usize, f64)| (particles.position[i][axis] - plane).abs() <= settings.particle_spacing;
        let planes = planes.iter().filter(|plane| particles.kind[i] != ParticleKind::Solid && near(plane)).count() as f64;
        (planes > 0.0).then(|| [planes * (particles.pressure[i] + particles.unkept_pressure[i]), planes])
    });
    sum / count
}
