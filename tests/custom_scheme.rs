//! A scheme from outside the crate: what diffuses u and knows no pressure.

use alsph::discretisation::LaplacianAndGradient;
use alsph::flow::{Flow, Step};
use alsph::scheme::{Scheme, Solved};
use alsph::settings::{Eigenvalues, TimeStepLimits};
use alsph::{Clock, ParticleKind, Particles, Settings, Simulation, Vector};
use approx::assert_relative_eq;
use serde_json::json;
use std::f64::consts::TAU;

mod common;

/// du/dt = ν ∇²u.
struct Diffusion {
    largest: Eigenvalues,
    laplacian: Vec<Vector<2>>,
    divergence: Vec<f64>,
}

impl Diffusion {
    fn new(settings: &Settings) -> Self {
        Self { largest: settings.largest_eigenvalues(), laplacian: Vec::new(), divergence: Vec::new() }
    }
}

impl Scheme<2> for Diffusion {
    fn limits(&self, settings: &Settings, velocity_max: f64) -> TimeStepLimits {
        settings.time_step_limits(velocity_max, self.largest)
    }

    fn solve(&mut self, step: Step, Flow { particles, frame, walls, .. }: &mut Flow<2>) -> Solved {
        walls.see(step.settings, particles, frame);
        self.laplacian.resize(particles.real, Vector::zeros());
        self.divergence.resize(particles.real, 0.0);
        let operator = LaplacianAndGradient { velocity: &particles.velocity, seen: |s, i| walls.seen_by(particles, s, i) };
        frame.stencil.correct_and_for_each(
            operator,
            &mut self.laplacian,
            &mut self.divergence,
            |_, (value, gradient), laplacian, divergence| (*laplacian, *divergence) = (value, gradient.trace()),
        );
        let factor = step.time_step * step.settings.kinematic_viscosity;
        for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Fluid) {
            particles.velocity[i] += self.laplacian[i] * factor;
        }
        frame.images.fill(&mut particles.velocity);
        Solved::after(1)
    }

    fn divergence(&self, i: usize) -> f64 {
        self.divergence[i]
    }

    fn acting_pressure(&self, _: Step, particles: &Particles<2>, i: usize) -> f64 {
        particles.pressure[i]
    }

    fn viscous_laplacian(&self, _: Step, i: usize) -> Vector<2> {
        self.laplacian[i]
    }

    fn penalty(&self, _: f64) -> f64 {
        0.0
    }
}

/// A shear wave, which needs no pressure, decays at ν k².
#[test]
fn a_scheme_of_the_callers_takes_the_steps() {
    let length = 32;
    let mut value = common::settings_value::<2>(1.0 / length as f64, "periodic");
    (value["kinematic_viscosity"], value["time_step"], value["adaptive_time_step"]) =
        (0.05.into(), 1e-3.into(), false.into());
    (value["shifting"], value["body_force"]) = ("none".into(), json!([0.0, 0.0]));
    let settings = common::parse(&value);
    let mut particles = common::particles(common::lattice::<2>(length, 0.0));
    for i in 0..particles.real {
        particles.velocity[i] = Vector::from([1e-3 * (TAU * particles.position[i][1]).sin(), 0.0]);
    }
    let scheme = Box::new(Diffusion::new(&settings));
    let mut simulation = Simulation::with_scheme(settings, particles, Clock::default(), Some(1), scheme).expect("valid");
    simulation.advance(200, None).expect("stable");
    let history = simulation.take_history();
    let rate = (history[0].kinetic_energy / history[199].kinetic_energy).ln() / (2.0 * 0.199);
    assert_relative_eq!(rate, 0.05 * TAU * TAU, max_relative = 0.02);
    assert!(history.iter().all(|report| report.outcome.iterations == 1 && report.outcome.divergence_max < 1e-6));
}
