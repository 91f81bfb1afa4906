import dataclasses
import json
import re
from typing import Any

import alsph
import numpy as np
import pytest
from alsph import _alsph
from alsph.cases import CASES, Case, Cavity, Couette, Cylinder, Domain, SolidBody
from alsph.errors import ConfigError
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import Kind, particles
from hypothesis import given
from hypothesis import strategies as st

OPEN = [("inlet", "outlet"), ("slip", "slip")]
NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.integers() | st.none() | st.text(max_size=3)


class Drift(Case):
    """A stream in a periodic box, with no more than a case must say."""

    def domain(self) -> Domain:
        return Domain((0, 0), (2, 1), [("periodic", "periodic"), ("periodic", "periodic")])

    def particles(self) -> dict[str, Any]:
        sides = [cell_centres(round(length / self.particle_spacing), self.particle_spacing) for length in (2, 1)]
        return particles(Kind.FLUID, lattice(*sides), (1, 0))


class Older(Couette):
    """As cases wrote it before."""

    def domain(self):
        return {"lower": [0, 0], "upper": [self.length, 1], "boundaries": [["periodic"] * 2, ["none"] * 2]}

    def bodies(self):
        about = {"moves": False, "center": [self.length / 2, 0.5]}
        return [{"name": "lower", "velocity": [0, 0]} | about, {"name": "upper", "velocity": [1, 0]} | about]


def test_they_are_of_alsph_and_frozen():
    assert alsph.Domain is Domain and alsph.SolidBody is SolidBody
    domain = Domain(np.zeros(2), np.ones(2, int), OPEN)
    assert domain == Domain([0, 0], [1, 1], [list(pair) for pair in OPEN]) and hash(domain)
    with pytest.raises(dataclasses.FrozenInstanceError):
        domain.lower = (1, 1)


def test_a_case_of_ones_own_needs_domain_and_particles_alone():
    case = Drift(resolution=8)
    assert (case.name, case.default_until, case.particle_estimate()) == ("drift", 4.0, 128)
    simulation = case.simulation(threads=1)
    simulation.advance(2)
    assert np.abs(simulation.state()["velocity"] - [1, 0]).max() < 1e-12


def test_a_case_with_tables_as_before_is_the_same_to_the_last_bit(tmp_path):
    older, newer = Older(resolution=8), Couette(resolution=8)
    assert json.dumps(older.settings()) == json.dumps(newer.settings())
    states = []
    for case in (older, newer):
        simulation = case.simulation(threads=1)
        simulation.advance(5)
        states.append(simulation.state())
    assert all(np.array_equal(states[0][name], states[1][name]) for name in states[1])
    assert older.moment_point == pytest.approx([0.25, 0.5])


@pytest.mark.parametrize("model", CASES.values())
def test_the_engine_takes_what_the_cases_give(model):
    case = model()
    assert isinstance(case.domain(), Domain) and all(isinstance(body, SolidBody) for body in case.bodies())
    assert _alsph.time_step_limits(json.dumps(case.settings()), 1.0)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Domain((0, 0), (1, 0), OPEN), "domain: lower = 0 does not lie below upper = 0 along y"),
        (lambda: Domain((0, 2), (1, 1), OPEN), "lower = 2 does not lie below upper = 1 along y"),
        (lambda: Domain((0,), (1,), OPEN), "domain.lower = (0,): must be two or three finite numbers"),
        (lambda: Domain(0, 1, OPEN), "domain.lower = 0: must be two or three"),
        (lambda: Domain((0, 0), (1, 1, 1), OPEN), "domain.upper = (1, 1, 1): must be two finite numbers, x and y"),
        (lambda: Domain((0, 0, 0), (1, 1), OPEN), "domain.upper = (1, 1): must be three finite numbers"),
        (lambda: Domain((0, 0), (1, float("nan")), OPEN), "domain.upper = (1, nan)"),
        (lambda: Domain((0, float("-inf")), (1, 1), OPEN), "domain.lower = (0, -inf)"),
        (lambda: Domain((0, 10**400), (1, 1), OPEN), "domain.lower = (0, 1000"),
        (lambda: Domain((0, 0), (1, 1), OPEN[:1]), "must be 2 pairs, the lower and the upper side of each direction"),
        (lambda: Domain((0, 0, 0), (1, 1, 1), OPEN), "must be 3 pairs"),
        (lambda: Domain((0, 0), (1, 1), ["slip", "slip"]), "must be 2 pairs"),
        (lambda: Domain((0, 0), (1, 1), None), "domain.boundaries = None: must be 2 pairs"),
        (
            lambda: Domain((0, 0), (1, 1), [OPEN[0], ("slip", "slipp")]),
            "domain.boundaries along y = 'slipp': unknown; did you mean 'slip'?",
        ),
        (lambda: Domain((0, 0), (1, 1), [OPEN[0], (None, 1)]), "along y = None: unknown; did you mean 'none'?"),
        (
            lambda: Domain((0, 0), (1, 1), [("periodic", "slip"), OPEN[1]]),
            "along x = ('periodic', 'slip'): periodic must be both sides, or none",
        ),
        (lambda: Domain.of({"lower": [0, 0]}), "Domain: lacks upper, boundaries; it is Domain(lower, upper, bound"),
        (lambda: Domain.of({"uper": [0, 0]}), "Domain: 'uper' is unknown; did you mean 'upper'?"),
        (lambda: Domain.of(None), "None: must be a Domain(lower, upper, boundaries)"),
        (lambda: SolidBody("", (0, 0)), "body '': its name must be a text"),
        (lambda: SolidBody(3, (0, 0)), "body 3: its name must be a text"),
        (lambda: SolidBody("a,b", (0, 0)), "body 'a,b': its name must be a text without commas"),
        (lambda: SolidBody("a", 0), "body 'a': center = 0: must be two or three finite numbers"),
        (lambda: SolidBody("a", (0, 0), (1,)), "body 'a': velocity = (1,): must be two finite numbers, x and y"),
        (lambda: SolidBody("a", (0, 0), []), "body 'a': velocity = []: must be two finite numbers"),
        (lambda: SolidBody("a", (0, 0), (1, float("nan"))), "body 'a': velocity = (1, nan)"),
        (lambda: SolidBody("a", (0, 0), moves=1), "body 'a': moves = 1: must be True or False"),
        (lambda: SolidBody("a", (0, 0), rigid=3), "body 'a': rigid = 3: must be a Rigid(mass, inertia, displaced)"),
        (lambda: SolidBody("a", (0, 0), belt=(0, 1)), "belt = (0, 1): must be two numbers, the lower one first"),
        (lambda: SolidBody("a", (0, 0), moves=True, belt=(1, 0)), "belt = (1, 0)"),
        (
            lambda: SolidBody.of({"name": "a", "centre": (0, 0)}),
            "SolidBody: 'centre' is unknown; did you",
        ),
        (lambda: SolidBody.of({"name": "a"}), "SolidBody: lacks center"),
    ],
)
def test_what_cannot_be_is_told_in_a_line(make, told):
    with pytest.raises(ConfigError, match=re.escape(told)) as caught:
        make()
    assert "\n" not in str(caught.value)


@given(lower=st.lists(NUMBERS, max_size=4), upper=st.lists(NUMBERS, max_size=4))
def test_any_corners_make_a_domain_or_a_config_error(lower, upper):
    try:
        domain = Domain(lower, upper, OPEN)
    except ConfigError:
        return
    assert Domain.of(json.loads(json.dumps(domain.settings()))) == domain
    assert all(np.isfinite(domain.size)) and domain.contains(np.array([domain.lower, domain.upper])).all()


def test_what_a_domain_tells():
    domain = Cylinder(length=8.0, height=6.0).domain()
    assert domain.is_open and not domain.periodic.any() and list(domain.inlets()) == [(0, 1, 0.0)]
    assert domain.size == (8.0, 6.0)
    assert not Cavity().domain().is_open and Couette().domain().periodic.tolist() == [True, False]
    points = np.array([[0.0, 0.0], [8.0, 3.0], [8.1, 0.0], [4.0, -3.2]])
    assert domain.contains(points).tolist() == [True, True, False, False]
    assert domain.contains(points, 0.15).tolist() == [True, True, True, False]


@pytest.mark.parametrize("method", ["domain", "bodies"])
def test_a_mistake_in_a_case_is_told_before_anything_is_written(tmp_path, method):
    wrong = Domain((0, 0, 0), (2, 1, 1), [("periodic", "periodic")] * 3) if method == "domain" else [{"name": "a"}]
    model = type("Wrong", (Drift,), {method: lambda self: wrong})
    with pytest.raises(ConfigError, match="drift: its domain is in 3-D and the case in 2-D|SolidBody: lacks center"):
        model(resolution=8).run(tmp_path / "run", until=0.1, progress=False)
    assert not (tmp_path / "run").exists()
