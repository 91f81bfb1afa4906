//! alsph: Augmented Lagrangian SPH for incompressible flow.
//!
//! The engine behind the Python package of the same name. A [`Simulation`] holds the particles and settings; a time step is
//! `Simulation::step`, and the method's equations (8) to (13) are [`scheme::Alsph`]. Equation numbers are those of
//! Kolukisa, Ozbulut and Yildiz, Symmetry 2021, 13, 472.

pub mod base;
pub mod boundary;
pub mod breakdown;
pub mod discretisation;
pub mod faces;
pub mod flow;
pub mod forcing;
pub mod frame;
pub mod halo;
mod interpolation;
pub mod kernel;
pub mod loads;
pub mod motion;
pub mod neighbours;
pub mod particles;
pub mod poisson;
#[cfg(feature = "python")]
mod python;
pub mod report;
pub mod scheme;
pub mod settings;
pub mod shifting;
mod simulation;
pub mod surface;

pub use base::{Error, Matrix, Result, Vector};
pub use particles::{ParticleKind, Particles, Place};
pub use report::{Clock, Report};
pub use settings::Settings;
pub use simulation::{Simulation, Snapshot};
