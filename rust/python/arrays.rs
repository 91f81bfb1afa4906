//! Arrays of the engine as NumPy's, and NumPy's as the engine's.

use super::errors::array_error;
use crate::base::{Matrix, Vector};
use crate::loads::Load;
use crate::motion::{NUMBERS, Pose};
use crate::particles::{ParticleKind, Particles, Place, each_array};
use crate::report::{Clock, Column, Report, columns};
use crate::settings::Body;
use crate::simulation::Simulation;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

pub(super) fn read_poses(name: &'static str, array: &Bound<'_, PyAny>) -> PyResult<Vec<Pose>> {
    let wrong = || array_error(name, format!("must be a float64 array of shape (bodies, {NUMBERS})"));
    let array: PyReadonlyArray2<f64> = array.extract().map_err(|_| wrong())?;
    let pose = |row: numpy::ndarray::ArrayView1<f64>| row.to_vec().try_into().map(Pose::from_numbers).map_err(|_| wrong());
    array.as_array().rows().into_iter().map(pose).collect()
}

pub(super) fn vector<const D: usize>(
    name: &'static str,
    mut values: impl ExactSizeIterator<Item = f64>,
) -> PyResult<Vector<D>> {
    if values.len() != D {
        return Err(array_error(name, format!("must have {D} components, not {}", values.len())));
    }
    Ok(Vector::from_fn(|_, _| values.next().unwrap_or_default()))
}

pub(super) fn vectors<'py, const D: usize>(
    py: Python<'py>,
    values: impl ExactSizeIterator<Item = Vector<D>>,
) -> Bound<'py, PyArray2<f64>> {
    let mut array = Array2::zeros((values.len(), D));
    for (mut row, value) in array.rows_mut().into_iter().zip(values) {
        row.iter_mut().zip(value.iter()).for_each(|(to, from)| *to = *from);
    }
    array.into_pyarray(py)
}

pub(super) fn read_vectors<const D: usize>(name: &'static str, array: &Bound<'_, PyAny>) -> PyResult<Vec<Vector<D>>> {
    let array: PyReadonlyArray2<f64> =
        array.extract().map_err(|_| array_error(name, format!("must be a float64 array of shape (n, {D})")))?;
    array.as_array().rows().into_iter().map(|row| vector(name, row.iter().copied())).collect()
}

fn read_array<T: numpy::Element + Copy>(state: &Bound<'_, PyDict>, name: &'static str, count: usize) -> PyResult<Vec<T>> {
    let item = state.get_item(name)?.ok_or_else(|| array_error(name, "is missing from the state"))?;
    let array: PyReadonlyArray1<T> = item.extract().map_err(|_| {
        let kind = item.get_type().to_string();
        array_error(name, format!("must be a one-dimensional {} array, not {kind}", std::any::type_name::<T>()))
    })?;
    let array = array.as_array();
    if array.len() != count {
        return Err(array_error(name, format!("has {} entries for {count} positions", array.len())));
    }
    Ok(array.to_vec())
}

fn read_rows<const D: usize>(
    state: &Bound<'_, PyDict>,
    name: &'static str,
    count: Option<usize>,
) -> PyResult<Vec<Vector<D>>> {
    let item = state.get_item(name)?.ok_or_else(|| array_error(name, "is missing from the state"))?;
    let rows = read_vectors(name, &item)?;
    match count {
        Some(count) if count != rows.len() => {
            Err(array_error(name, format!("has {} rows for {count} positions", rows.len())))
        }
        _ => Ok(rows),
    }
}

pub(super) fn read_particles<const D: usize>(state: &Bound<'_, PyDict>) -> PyResult<Particles<D>> {
    let count = read_rows::<D>(state, "position", None)?.len();
    let mut particles = Particles { real: count, ..Particles::default() };
    each_array!(particles, (&mut) array, name => {
        if !["id", "place", "unkept_pressure"].contains(&name) || state.contains(name)? {
            *array = Exchanged::read(state, name, count)?;
        }
    });
    if particles.id.is_empty() {
        particles.id = (0..count as u64).collect();
    }
    Ok(particles)
}

pub(super) fn read_clock(state: &Bound<'_, PyDict>) -> PyResult<Clock> {
    fn scalar<'py, T: Default + for<'a> FromPyObject<'a, 'py>>(
        state: &Bound<'py, PyDict>,
        name: &'static str,
    ) -> PyResult<T> {
        match state.get_item(name)? {
            Some(value) => value.extract().map_err(|_| array_error(name, "must be a number not below zero")),
            None => Ok(T::default()),
        }
    }
    Ok(Clock {
        time: scalar(state, "time")?,
        step: scalar(state, "step")?,
        mass_in: scalar(state, "mass_in")?,
        mass_out: scalar(state, "mass_out")?,
    })
}

pub(super) fn state<'py, const D: usize>(py: Python<'py>, simulation: &Simulation<D>) -> PyResult<Bound<'py, PyDict>> {
    let (particles, clock) = (simulation.particles(), simulation.clock());
    let dict = PyDict::new(py);
    if simulation.settings().bodies.iter().any(Body::is_rigid) {
        let poses = simulation.poses();
        let numbers = PyArray1::from_iter(py, poses.iter().flat_map(Pose::numbers));
        dict.set_item("pose", numbers.reshape([poses.len(), NUMBERS])?)?;
    }
    let settings = simulation.settings();
    each_array!(particles, (&) array, name => {
        let is_told = match name {
            "place" => settings.free_surface.is_some(),
            "unkept_pressure" => settings.has_unkept_pressure(),
            _ => true,
        };
        if is_told {
            dict.set_item(name, Exchanged::write(py, &array[..particles.real]))?;
        }
    });
    dict.set_item("time", clock.time)?;
    dict.set_item("step", clock.step)?;
    dict.set_item("mass_in", clock.mass_in)?;
    dict.set_item("mass_out", clock.mass_out)?;
    Ok(dict)
}

pub(super) fn snapshot<'py, const D: usize>(
    py: Python<'py>,
    simulation: &mut Simulation<D>,
) -> PyResult<(Bound<'py, PyDict>, Vec<Matrix<D>>)> {
    let snapshot = py.detach(|| simulation.snapshot());
    let dict = state(py, simulation)?;
    let divergence: Vec<f64> = snapshot.velocity_gradient.iter().map(|gradient| gradient.trace()).collect();
    if simulation.settings().has_unkept_pressure() {
        dict.del_item("unkept_pressure")?; // the pressure has it
    }
    dict.set_item("pressure", snapshot.pressure.into_pyarray(py))?;
    dict.set_item("volume", snapshot.volume.into_pyarray(py))?;
    dict.set_item("velocity_divergence", divergence.into_pyarray(py))?;
    Ok((dict, snapshot.velocity_gradient))
}

pub(super) fn plane_snapshot<'py>(py: Python<'py>, simulation: &mut Simulation<2>) -> PyResult<Bound<'py, PyDict>> {
    let (dict, gradient) = snapshot(py, simulation)?;
    let vorticity = gradient.iter().map(|g| g[(1, 0)] - g[(0, 1)]).collect::<Vec<_>>();
    dict.set_item("vorticity", vorticity.into_pyarray(py))?;
    Ok(dict)
}

pub(super) fn space_snapshot<'py>(py: Python<'py>, simulation: &mut Simulation<3>) -> PyResult<Bound<'py, PyDict>> {
    let (dict, gradient) = snapshot(py, simulation)?;
    let curl = |g: &Matrix<3>| Vector::from([g[(2, 1)] - g[(1, 2)], g[(0, 2)] - g[(2, 0)], g[(1, 0)] - g[(0, 1)]]);
    dict.set_item("vorticity", vectors(py, gradient.iter().map(curl)))?;
    Ok(dict)
}

pub(super) fn history<'py, const D: usize>(
    py: Python<'py>,
    reports: &[Report<D>],
    bodies: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let of_bodies = |name: &str, width: usize, of: &dyn Fn(&Load<D>) -> Vec<f64>| {
        let values = reports.iter().flat_map(|r| r.loads.iter().flat_map(of)).collect::<Vec<_>>();
        dict.set_item(name, PyArray1::from_vec(py, values).reshape([reports.len(), bodies, width])?)
    };
    let of_poses = |name: &str, start: usize, width: usize, of: &dyn Fn(&Pose) -> Vector<3>| {
        let of = |pose: &Pose| of(pose).as_slice()[start..start + width].to_vec();
        let values = reports.iter().flat_map(|r| r.poses.iter().flat_map(of)).collect::<Vec<_>>();
        dict.set_item(name, PyArray1::from_vec(py, values).reshape([reports.len(), bodies, width])?)
    };
    let spin = if D == 2 { 1 } else { 3 };
    for (name, column) in columns() {
        match column {
            Column::Number(of) => dict.set_item(name, PyArray1::from_iter(py, reports.iter().map(of)))?,
            Column::Count(of) => dict.set_item(name, PyArray1::from_iter(py, reports.iter().map(of)))?,
            Column::Flag(of) => dict.set_item(name, PyArray1::from_iter(py, reports.iter().map(of)))?,
            Column::Force(of) => of_bodies(name, D, &|load| of(load).iter().copied().collect())?,
            Column::Torque(of) => of_bodies(name, spin, &|load| of(load)[3 - spin..].to_vec())?,
            Column::Way(of) => of_poses(name, 0, D, &of)?,
            Column::Turn(of) => of_poses(name, 3 - spin, spin, &of)?,
        }
    }
    Ok(dict)
}

/// What an array of particles is in Python.
trait Exchanged: Sized {
    fn write<'py>(py: Python<'py>, values: &[Self]) -> Bound<'py, PyAny>;

    /// Those of the state, `count` of them.
    fn read(state: &Bound<'_, PyDict>, name: &'static str, count: usize) -> PyResult<Vec<Self>>;
}

macro_rules! exchange_as_it_is {
    ($($number:ty)*) => {
        $(impl Exchanged for $number {
            fn write<'py>(py: Python<'py>, values: &[Self]) -> Bound<'py, PyAny> {
                PyArray1::from_slice(py, values).into_any()
            }

            fn read(state: &Bound<'_, PyDict>, name: &'static str, count: usize) -> PyResult<Vec<Self>> {
                read_array(state, name, count)
            }
        })*
    };
}
exchange_as_it_is!(f64 u16 u64);

macro_rules! exchange_as_numbers {
    ($($named:ty)*) => {
        $(impl Exchanged for $named {
            fn write<'py>(py: Python<'py>, values: &[Self]) -> Bound<'py, PyAny> {
                PyArray1::from_iter(py, values.iter().map(|&value| value as u8)).into_any()
            }

            fn read(state: &Bound<'_, PyDict>, name: &'static str, count: usize) -> PyResult<Vec<Self>> {
                Ok(read_array::<u8>(state, name, count)?.into_iter().map(Self::try_from).collect::<Result<_, _>>()?)
            }
        })*
    };
}
exchange_as_numbers!(ParticleKind Place);

impl<const D: usize> Exchanged for Vector<D> {
    fn write<'py>(py: Python<'py>, values: &[Self]) -> Bound<'py, PyAny> {
        vectors(py, values.iter().copied()).into_any()
    }

    fn read(state: &Bound<'_, PyDict>, name: &'static str, count: usize) -> PyResult<Vec<Self>> {
        read_rows(state, name, Some(count))
    }
}
