"""Whatever the compiled module is given, it answers with a typed error or works: no panic, abort or hang."""

import json

import numpy as np
import pytest
from alsph import _alsph
from alsph.cases import Cylinder, TaylorGreen
from alsph.errors import ConfigError
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

PLANE = TaylorGreen(resolution=8).build()
CHANNEL = Cylinder(resolution=8, length=4.0, height=4.0, upstream=2.0).build()
ERRORS = (_alsph.ConfigError, _alsph.SolverError)
SIZE = len(PLANE.state["position"])
NAMES = st.sampled_from(sorted(PLANE.state))


def attempt(state, engine_settings=PLANE.settings, threads=1):
    """Take a few steps and look at the flow; return what was refused, or None."""
    text = engine_settings if isinstance(engine_settings, str) else json.dumps(engine_settings)
    try:
        simulation = _alsph.Simulation(text, state, threads)
        simulation.advance(2, 1.0)
        simulation.snapshot()
        simulation.state()
        simulation.take_history()
    except ERRORS as error:
        assert str(error)
        return error
    return None


def changed(**changes):
    return {name: np.copy(value) for name, value in PLANE.state.items()} | changes


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("position", np.zeros((SIZE, 2), np.float32), "must be a float64 array"),
        ("position", np.zeros((SIZE, 2), ">f8"), "must be a float64 array"),
        ("position", np.zeros((SIZE, 2), object), "must be a float64 array"),
        ("position", np.zeros((SIZE, 1)), "must have 2 components, not 1"),
        ("position", np.zeros(SIZE), "must be a float64 array"),
        ("position", [[0.0, 0.0]], "must be a float64 array"),
        ("position", np.full((SIZE, 2), np.nan), "all must be finite"),
        ("position", np.full((SIZE, 2), 1e300), "outside 0.0..1.0|outside 0..1"),
        ("velocity", np.full((SIZE, 2), np.inf), "all must be finite"),
        ("pressure", np.zeros(SIZE - 1), f"has {SIZE - 1} entries for {SIZE} positions"),
        ("unkept_pressure", np.zeros(3), f"has 3 entries for {SIZE} positions"),
        ("unkept_pressure", np.full(SIZE, np.nan), "unkept_pressure.*of particle 0 is NaN; all must be finite"),
        ("kind", np.full(SIZE, 4, np.uint8), "4 is not 0 fluid"),
        ("kind", np.full(SIZE, 3, np.uint8), "holds no fluid particle"),
        ("kind", np.zeros(SIZE, np.int64), "must be a one-dimensional u8 array"),
        ("id", np.zeros(SIZE, np.uint64), "0 stands twice"),
        ("time", np.inf, "must be finite"),
        ("time", "noon", "must be a number"),
        ("step", -1, "must be a number not below zero"),
    ],
)
def test_arrays_that_cannot_be_used_are_named(name, value, message):
    with pytest.raises(_alsph.ConfigError, match=message):
        _alsph.Simulation(json.dumps(PLANE.settings), changed(**{name: value}))


def test_views_are_read_as_they_are():
    position = PLANE.state["position"]
    plain = _alsph.Simulation(json.dumps(PLANE.settings), changed(), 1)
    for view in (np.asfortranarray(position), np.repeat(position, 2, axis=0)[::2], position[::-1][::-1]):
        simulation = _alsph.Simulation(json.dumps(PLANE.settings), changed(position=view), 1)
        assert np.array_equal(simulation.state()["position"], plain.state()["position"])


@pytest.mark.parametrize("threads", [0, -1, 10**6, 2**70, "two", 1.5])
def test_numbers_of_threads_without_sense_are_refused(threads):
    with pytest.raises(_alsph.ConfigError, match="must be a whole number from 1 to 4096"):
        _alsph.Simulation(json.dumps(PLANE.settings), PLANE.state, threads)


def test_a_particle_alone_and_particles_in_one_place():
    one = {name: value[:1] for name, value in PLANE.state.items()}
    assert isinstance(attempt(one), _alsph.SolverError)
    assert isinstance(attempt({name: value[:0] for name, value in one.items()}), _alsph.ConfigError)
    same = np.full_like(PLANE.state["position"], 0.5)
    attempt(changed(position=same))
    pair = PLANE.state["position"].copy()
    pair[0] = pair[1]
    attempt(changed(position=pair))


@settings(deadline=None, max_examples=150)
@given(
    name=NAMES,
    value=arrays.arrays(
        dtype=st.sampled_from([np.float64, np.float32, np.uint8, np.uint16, np.int64, np.bool_]),
        shape=arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3)
        | st.sampled_from([(SIZE,), (SIZE, 2)]),
    ),
)
def test_arrays_of_any_shape_and_type(name, value):
    attempt(changed(**{name: value}))


FLOATS = st.floats(allow_nan=True, allow_infinity=True) | st.sampled_from([0.0, 1e-300, 1e300, -1e300, 0.5])


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.too_slow])
@given(
    name=st.sampled_from(["position", "velocity", "pressure"]), rows=st.dictionaries(st.integers(0, SIZE - 1), FLOATS)
)
def test_any_values_of_particles(name, rows):
    value = PLANE.state[name].copy()
    for row, number in rows.items():
        value[row] = number
    attempt(changed(**{name: value}))


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | FLOATS | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@settings(deadline=None, max_examples=300)
@given(problem=st.sampled_from([PLANE, CHANNEL]), data=st.data())
def test_any_value_of_a_setting(problem, data):
    name = data.draw(st.sampled_from([*sorted(problem.settings), "unknown"]))
    attempt(problem.state, problem.settings | {name: data.draw(JSON)})


@settings(deadline=None, max_examples=100)
@given(text=st.text() | JSON.map(json.dumps))
def test_settings_that_are_none(text):
    with pytest.raises(_alsph.ConfigError):
        _alsph.Simulation(text, PLANE.state, 1)


PARAMETERS = sorted(set(Cylinder.model_fields) - {"resolution", "length", "height", "upstream"})


@settings(deadline=None, max_examples=200)
@given(data=st.data())
def test_any_value_of_a_parameter(data):
    name = data.draw(st.sampled_from(PARAMETERS))
    try:
        Cylinder(resolution=8, length=4.0, height=4.0, upstream=2.0, **{name: data.draw(JSON)})
    except ConfigError as error:
        assert name in str(error) or "Cylinder" in str(error) or str(error)
