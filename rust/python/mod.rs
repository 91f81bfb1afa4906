//! The extension module `alsph._alsph`: the only folder that knows Python.

mod arrays;
mod errors;

use crate::base::lanes::{Instructions, LANES};
use crate::base::{Error, Vector};
use crate::forcing::{Forcing, Rule};
use crate::kernel::KernelKind;
use crate::motion::MotionRule;
use crate::neighbours::Entry;
use crate::particles::ParticleKind;
use crate::settings::Settings;
use crate::simulation::Simulation;
use arrays::{
    history, plane_snapshot, read_clock, read_particles, read_poses, read_vectors, space_snapshot, state, vector, vectors,
};
use errors::{ConfigError, SolverError};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// The simulation in the dimension chosen at run time.
enum Engine {
    Two(Box<Simulation<2>>),
    Three(Box<Simulation<3>>),
}

/// Run `$body` with `$simulation` bound to the simulation of either dimension.
macro_rules! engine {
    ($engine:expr, $simulation:ident => $body:expr) => {
        match $engine {
            Engine::Two($simulation) => $body,
            Engine::Three($simulation) => $body,
        }
    };
}

/// State and stepping of one simulation in 2-D or 3-D.
#[pyclass(name = "Simulation", module = "alsph._alsph")]
struct PySimulation {
    engine: Engine,
    /// What a function of the caller's has raised in the engine.
    raised: Raised,
}

type Raised = Arc<Mutex<Option<PyErr>>>;

#[pymethods]
impl PySimulation {
    #[new]
    #[pyo3(signature = (settings, state, threads=None))]
    fn new(settings: &str, state: &Bound<'_, PyDict>, threads: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let settings = Settings::from_json(settings)?;
        let threads = threads.map(read_threads).transpose()?;
        let clock = read_clock(state)?;
        let mut engine = match settings.dimensions {
            2 => Engine::Two(Box::new(Simulation::new(settings, read_particles(state)?, clock, threads)?)),
            _ => Engine::Three(Box::new(Simulation::new(settings, read_particles(state)?, clock, threads)?)),
        };
        if let Some(poses) = state.get_item("pose")? {
            let poses = read_poses("pose", &poses)?;
            engine!(&mut engine, s => s.set_poses(&poses))?;
        } else if clock.step > 0 && engine!(&engine, s => s.settings().bodies.iter().any(|body| body.rigid.is_some())) {
            let problem = format!("is missing, with which free bodies go on from step {}", clock.step);
            return Err(Error::Array { name: "pose", problem }.into());
        }
        Ok(Self { engine, raised: Raised::default() })
    }

    #[getter]
    fn dimensions(&self) -> usize {
        engine!(&self.engine, s => s.settings().dimensions)
    }

    #[getter]
    fn time(&self) -> f64 {
        engine!(&self.engine, s => s.clock().time)
    }

    #[getter]
    fn step(&self) -> u64 {
        engine!(&self.engine, s => s.clock().step)
    }

    #[getter]
    fn threads(&self) -> usize {
        engine!(&self.engine, s => s.threads())
    }

    /// Particles by kind: ``fluid``, ``inlet``, ``outlet``, ``solid``.
    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = engine!(&self.engine, s => s.particles().counts());
        let dict = PyDict::new(py);
        for (name, count) in ParticleKind::NAMES.iter().zip(counts) {
            dict.set_item(name, count)?;
        }
        Ok(dict)
    }

    /// Take up to `steps` steps, stop early after `wall_seconds`; return the steps taken.
    #[pyo3(signature = (steps, wall_seconds=None))]
    fn advance(&mut self, py: Python<'_>, steps: u64, wall_seconds: Option<f64>) -> PyResult<u64> {
        let wall = wall(wall_seconds)?;
        let taken = engine!(&mut self.engine, s => py.detach(|| s.advance(steps, wall)));
        self.or_raised(taken)
    }

    /// Step until ``self.time >= time`` (True) or `wall_seconds` have passed (False). Δt is never clipped to `time`.
    #[pyo3(signature = (time, wall_seconds=None))]
    fn advance_until(&mut self, py: Python<'_>, time: f64, wall_seconds: Option<f64>) -> PyResult<bool> {
        if time.is_nan() {
            return Err(ConfigError::new_err("argument `time`: must be a number, not NaN"));
        }
        let wall = wall(wall_seconds)?;
        let reached = engine!(&mut self.engine, s => py.detach(|| s.advance_until(time, wall)));
        self.or_raised(reached)
    }

    /// One row for each step since the last call, see docs/architecture.md for the columns.
    fn take_history<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        engine!(&mut self.engine, s => {
            let bodies = s.settings().bodies.len();
            history(py, &s.take_history(), bodies)
        })
    }

    /// Return the particles: the arrays of `state` and ``volume``, ``velocity_divergence``, ``vorticity``.
    fn snapshot<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        match &mut self.engine {
            Engine::Two(s) => plane_snapshot(py, s),
            Engine::Three(s) => space_snapshot(py, s),
        }
    }

    /// The same for what the step that broke down led to, at the positions before that step; None if none has.
    fn failed_snapshot<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        match &mut self.engine {
            Engine::Two(s) => s.look_at_failed(|s| plane_snapshot(py, s)).transpose(),
            Engine::Three(s) => s.look_at_failed(|s| space_snapshot(py, s)).transpose(),
        }
    }

    /// All that is needed to go on from here to the last bit.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        engine!(&self.engine, s => state(py, s))
    }

    /// Fluid ``pressure`` (m,) and ``velocity`` (m, d) at `points` (m, d), quadratic moving least squares; NaN without neighbours.
    fn sample<'py>(&mut self, py: Python<'py>, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        engine!(&mut self.engine, s => {
            let points = read_vectors("points", points)?;
            let values = py.detach(|| s.sample(&points));
            let dict = PyDict::new(py);
            dict.set_item("pressure", values.iter().map(|v| v.0).collect::<Vec<_>>().into_pyarray(py))?;
            dict.set_item("velocity", vectors(py, values.iter().map(|v| v.1)))?;
            Ok(dict)
        })
    }

    /// Return the positions (m, d) of the inlet buffer particles.
    fn inflow_position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        engine!(&self.engine, s => vectors(py, s.inflow_position().into_iter()))
    }

    /// Prescribe the velocity of the inlet buffer particles, (d,) or (m, d) in the order of `inflow_position`.
    fn set_inflow(&mut self, velocity: &Bound<'_, PyAny>) -> PyResult<()> {
        engine!(&mut self.engine, s => {
            let velocity = match velocity.extract::<PyReadonlyArray1<f64>>() {
                Ok(same) => vec![vector("inflow velocity", same.as_array().iter().copied())?; s.inflow_position().len()],
                Err(_) => read_vectors("inflow velocity", velocity)?,
            };
            Ok(s.set_inflow(&velocity)?)
        })
    }

    /// Ask functions, once a step, for a body force per unit mass beside that of the settings, and the velocity of surfaces that stay
    /// in place: (m, d) from positions (m, d) and the time; and one for the poses (b, 30) of the b bodies that move and are not free, from
    /// the time.
    #[pyo3(signature = (forcing, sliding, motion))]
    fn prescribe(&mut self, forcing: Option<Py<PyAny>>, sliding: Option<Py<PyAny>>, motion: Option<Py<PyAny>>) {
        let raised = &self.raised;
        engine!(&mut self.engine, s => s.forcing = Forcing {
            body_force: forcing.map(|function| rule("body force", function, Arc::clone(raised))),
            surface_velocity: sliding.map(|function| rule("surface velocity", function, Arc::clone(raised))),
            motion: motion.map(|function| motion_rule(function, Arc::clone(raised))),
        });
    }
}

impl PySimulation {
    /// `result`, or what a function of the caller's has raised.
    fn or_raised<T>(&self, result: crate::Result<T>) -> PyResult<T> {
        let raised = self.raised.lock().ok().and_then(|mut raised| raised.take());
        result.map_err(|error| raised.unwrap_or_else(|| error.into()))
    }
}

/// The rule that a function of the caller's gives. What that raises is kept for the thread that called the engine.
fn rule<const D: usize>(name: &'static str, function: Py<PyAny>, raised: Raised) -> Rule<D> {
    Box::new(move |position, time| {
        Python::attach(|py| {
            let values = function.call1(py, (vectors(py, position.iter().copied()), time));
            kept(name, &raised, values.and_then(|values| read_vectors(name, values.bind(py))))
        })
    })
}

fn motion_rule(function: Py<PyAny>, raised: Raised) -> MotionRule {
    Box::new(move |time| {
        Python::attach(|py| {
            let poses = function.call1(py, (time,));
            kept("motion", &raised, poses.and_then(|poses| read_poses("motion", poses.bind(py))))
        })
    })
}

/// What a function of the caller's has given. What it has raised is kept.
fn kept<T>(name: &'static str, raised: &Raised, given: PyResult<T>) -> crate::Result<T> {
    given.map_err(|error| {
        if let Ok(mut raised) = raised.lock() {
            *raised = Some(error);
        }
        Error::Array { name, problem: "its function has failed".into() }
    })
}

/// Bounds of Δt: ``courant``, ``penalty``, ``acoustic``, ``viscous``, ``body_force`` (inf where it does not apply), and ``lambda_max`` (λ_max Δx²).
#[pyfunction]
fn time_step_limits<'py>(py: Python<'py>, settings: &str, velocity_max: f64) -> PyResult<Bound<'py, PyDict>> {
    let settings = Settings::from_json(settings)?;
    let largest = settings.largest_eigenvalues();
    let limits = settings.time_step_limits(velocity_max, largest);
    let dict = PyDict::new(py);
    dict.set_item("courant", limits.courant)?;
    dict.set_item("penalty", limits.penalty)?;
    dict.set_item("acoustic", limits.acoustic)?;
    dict.set_item("viscous", limits.viscous)?;
    dict.set_item("body_force", limits.body_force)?;
    dict.set_item("lambda_max", largest.laplacian)?;
    Ok(dict)
}

/// Estimate the engine's memory per particle, buffers and neighbour list included.
#[pyfunction]
fn bytes_per_particle(settings: &str) -> PyResult<f64> {
    let settings = Settings::from_json(settings)?;
    let ratio = settings.support_radius() / settings.particle_spacing;
    // Neighbours of four particles: a sphere widened by the distance between them.
    let (neighbours, fields) = match settings.dimensions {
        2 => (std::f64::consts::PI * (ratio + 0.9).powi(2), 20 * size_of::<Vector<2>>()),
        _ => (4.0 / 3.0 * std::f64::consts::PI * (ratio + 0.9).powi(3), 20 * size_of::<Vector<3>>()),
    };
    // The rows grow by doubling, so half of their room may be empty.
    Ok(1.5 * neighbours * (size_of::<Entry>() / LANES) as f64 + fields as f64 + 100.0)
}

/// The kernels by name, each with its support radius over the smoothing length.
#[pyfunction]
fn kernels(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    for kind in KernelKind::ALL {
        let name = serde_json::to_value(kind).map_err(|error| ConfigError::new_err(error.to_string()))?;
        dict.set_item(name.as_str(), kind.support())?;
    }
    Ok(dict)
}

/// Name of the vector instructions in use, ``portable`` or ``avx2``; the environment variable ``ALSPH_INSTRUCTIONS`` pins them.
#[pyfunction]
fn instructions() -> PyResult<&'static str> {
    Ok(Instructions::chosen()?.name())
}

#[pymodule]
fn _alsph(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("SolverError", module.py().get_type::<SolverError>())?;
    module.add("ConfigError", module.py().get_type::<ConfigError>())?;
    module.add_class::<PySimulation>()?;
    module.add_function(wrap_pyfunction!(time_step_limits, module)?)?;
    module.add_function(wrap_pyfunction!(bytes_per_particle, module)?)?;
    module.add_function(wrap_pyfunction!(kernels, module)?)?;
    module.add_function(wrap_pyfunction!(instructions, module)?)
}

/// Each thread takes memory of the system, which a wrong number must not exhaust.
const MOST_THREADS: usize = 4096;

fn wall(seconds: Option<f64>) -> PyResult<Option<Duration>> {
    let convert =
        |s| Duration::try_from_secs_f64(s).map_err(|e| ConfigError::new_err(format!("argument `wall_seconds`: {e}")));
    seconds.map(convert).transpose()
}

fn read_threads(threads: &Bound<'_, PyAny>) -> PyResult<usize> {
    match threads.extract::<usize>() {
        Ok(count) if (1..=MOST_THREADS).contains(&count) => Ok(count),
        _ => Err(ConfigError::new_err(format!("setting `threads`: must be a whole number from 1 to {MOST_THREADS}"))),
    }
}
