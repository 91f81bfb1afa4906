import json

import numpy as np
import pytest
from alsph import _alsph, cases
from alsph.cases import (
    CASES,
    Bodies,
    Body,
    ConfinedCylinder,
    Cylinder,
    FreeSurface,
    RotatingCylinder,
    SolidBody,
    Sphere,
    TaylorGreen,
)
from alsph.cases.base import OFFERED
from alsph.config import Config, from_tables
from alsph.errors import ConfigError
from alsph.geometry.particles import Kind
from alsph.geometry.solids import cylinder_rings
from alsph.study.declaration import digest


def mirrored(points):
    """Return the points mirrored about y = 0, sorted, beside the points, sorted."""
    return sorted(map(tuple, points)), sorted(map(tuple, points * (1.0, -1.0)))


@pytest.fixture(scope="module")
def paper():
    return Cylinder().particles()


def test_paper_channel_has_the_papers_particles(paper):
    fluid = paper["position"][paper["kind"] == Kind.FLUID]
    assert abs(len(fluid) - 73000) < 1000
    assert np.hypot(fluid[:, 0] - 4, fluid[:, 1]).min() >= 0.5
    assert fluid.min(axis=0) == pytest.approx([0.025, -6.475])
    assert fluid.max(axis=0) == pytest.approx([13.975, 6.475])


@pytest.mark.parametrize("kind", Kind)
def test_arrangement_is_exactly_symmetric(paper, kind):
    points, mirror = mirrored(paper["position"][paper["kind"] == kind])
    assert points == mirror


def test_buffers_continue_the_lattice(paper):
    inlet, outlet = (paper["position"][paper["kind"] == kind] for kind in (Kind.INLET, Kind.OUTLET))
    assert len(inlet) == len(outlet) == 8 * 260
    assert sorted(set(np.round(inlet[:, 0], 9))) == pytest.approx(-0.025 - 0.05 * np.arange(7, -1, -1))
    assert sorted(set(np.round(outlet[:, 0], 9))) == pytest.approx(14.025 + 0.05 * np.arange(8))


def test_rings_have_the_spacing_of_the_lattice():
    spacing = 0.05
    rings = cylinder_rings(0.5, spacing, 4)
    assert sorted(set(np.round(rings.depth, 9))) == pytest.approx([0.025, 0.075, 0.125, 0.175])
    assert np.hypot(*rings.normal.T) == pytest.approx(1)
    assert np.hypot(*rings.position.T) == pytest.approx(0.5 - rings.depth)
    distance = np.linalg.norm(rings.position[:, None] - rings.position, axis=2)
    np.fill_diagonal(distance, np.inf)
    assert 0.9 * spacing < distance.min(axis=1).min() <= distance.min(axis=1).max() < 1.1 * spacing


def test_rings_stop_at_the_centre():
    assert cylinder_rings(0.5, 1 / 8, 6).depth.max() < 0.5


def test_solid_is_as_deep_as_the_support():
    case = Cylinder(smoothing_ratio=1.5)
    depth = case.particles()["depth"]
    assert depth.max() + case.particle_spacing / 2 >= 3 * 1.5 * case.particle_spacing


def test_initial_vortex_is_divergence_free_and_can_be_left_out():
    case, offset = Cylinder(perturbation=0.2), 1e-6
    points = case.particles()["position"][::97]
    velocity = case._initial_velocity
    dudx = (velocity(points + [offset, 0]) - velocity(points - [offset, 0]))[:, 0]
    dvdy = (velocity(points + [0, offset]) - velocity(points - [0, offset]))[:, 1]
    assert np.abs(dudx + dvdy).max() / (2 * offset) < 1e-8
    assert np.abs(velocity(case.particles()["position"]) - [1, 0]).max() == pytest.approx(0.2, rel=0.02)
    still = Cylinder(perturbation=0).particles()
    assert (still["velocity"][still["kind"] == Kind.FLUID] == [1, 0]).all()


@pytest.mark.parametrize("model", CASES.values())
def test_engine_accepts_the_settings_and_the_estimate_is_close(model):
    case = model()
    speed = case.reference_velocity if issubclass(model, FreeSurface) else 1.0
    limits = _alsph.time_step_limits(json.dumps(case.replace(penalty_constant=100.0).settings()), speed)
    assert 0.09 < limits["penalty"] * speed / case.particle_spacing < 0.1 and limits["courant"] == np.inf
    limits = _alsph.time_step_limits(json.dumps(case.settings()), speed)
    courant = limits["courant"] * speed / case.particle_spacing
    assert courant == pytest.approx(case.courant) and limits["penalty"] == np.inf
    assert case.particle_estimate() == pytest.approx(len(case.particles()["kind"]), rel=0.02)


@pytest.mark.parametrize(
    ("algorithm", "frame", "search"), [(1, "updated", False), (2, "initial", False), ("original", "updated", True)]
)
def test_algorithms(algorithm, frame, search):
    settings = Cylinder(algorithm=algorithm).settings()
    assert settings["derivative_frame"] == frame
    assert settings["search_every_iteration"] is search


def test_the_courant_number_and_the_pair_of_the_paper_take_the_place_of_one_another(small):
    def given(case):
        return case.courant, case.time_step, case.penalty_constant

    def engine(case):
        names = ("courant", "penalty_constant", "viscous_theta", "sweep_weights", "sweep_pressure")
        return [case.settings()[name] for name in names]

    assert given(small) == given(small.replace(courant=None)) == (0.3, None, None)
    assert engine(small) == [0.3, None, 0.5, "chebyshev", "smooth"]
    paper = small.replace(penalty_constant=80.0)
    assert given(paper) == given(Cylinder(penalty_constant=80.0)) == (None, 0.0508, 80.0)
    assert engine(paper) == [None, 80.0, 1.0, "equal", "rough"]
    assert paper.settings()["time_step"] == pytest.approx(0.0508 * small.particle_spacing)
    assert given(small.replace(time_step=0.04)) == given(Cylinder(time_step=0.04)) == (None, 0.04, 100.0)
    assert given(paper.replace(courant=0.2)) == (0.2, None, None)
    assert given(paper.replace(reynolds=50)) == given(paper) and given(small.replace(reynolds=50)) == given(small)
    assert given(paper.replace(courant=0.2, time_step=0.1)) == (0.2, 0.1, None)
    # The paper's algorithms are of first order in time.
    assert given(small.replace(algorithm=2)) == given(Cylinder(algorithm=2)) == (None, 0.0508, 100.0)
    assert given(Cylinder(algorithm=2, courant=0.1)) == (0.1, None, None)
    for case in (small, paper):
        with pytest.raises(ConfigError, match="courant and penalty_constant: .* leave the other out"):
            case.replace(courant=0.25, penalty_constant=100.0)


def test_the_coefficient_of_the_shifting_is_that_of_its_kind(small):
    assert (small.shifting, small.settings()["shift_coefficient"]) == ("strain", 0.75)
    assert TaylorGreen(dimensions=3) == TaylorGreen().replace(dimensions=3)
    assert TaylorGreen(dimensions=3).shift_coefficient == 0.25
    assert TaylorGreen(dimensions=3, shift_coefficient=0.0).settings()["shift_coefficient"] == 0.0
    for kind in ("xsph", "maximum_velocity"):
        assert small.replace(shifting=kind).shift_coefficient == Cylinder(shifting=kind).shift_coefficient == 0.04
        assert small.replace(shifting=kind).replace(shifting="strain") == small
    assert small.replace(shifting="maximum_velocity", shift_coefficient=0.1).shift_coefficient == 0.1
    assert small.replace(shift_coefficient=0.3).replace(reynolds=50).shift_coefficient == 0.3


def test_steps_that_are_not_adaptive_have_the_courant_number_at_the_expected_velocity(small):
    assert small.replace(adaptive_time_step=False).largest_time_step == pytest.approx(0.3 / 1.5)
    assert small.replace(adaptive_time_step=False).time_step_warning() is None
    assert small.largest_time_step == 0.3


def test_the_penalty_follows_the_courant_number(small):
    case = small.replace(courant=0.25)
    assert case.largest_time_step == 0.25 and case.expected_time_step() == pytest.approx(0.25 / 1.5)
    settings = case.settings()
    simulation = case.simulation()
    simulation.advance(4)
    history, spacing = simulation.history(), case.particle_spacing
    assert history["velocity_max"] * history["time_step"] == pytest.approx(0.25 * spacing)
    # r_AL Δt λ_max/Δx² is 1, and c² = r_AL/Δt = C_BV u_max².
    largest = _alsph.time_step_limits(json.dumps(settings), 1.0)["lambda_max"]
    relaxed = history["penalty_coefficient"] * history["time_step"] * largest / spacing**2
    assert relaxed == pytest.approx(1.0)
    constant = history["penalty_coefficient"] / history["time_step"] / history["velocity_max"] ** 2
    assert constant == pytest.approx(case.expected_penalty_constant())


def test_time_step_warning_names_the_limit():
    assert Cylinder().time_step_warning() is None
    fixed = {"adaptive_time_step": False}
    paper = {"penalty_constant": 100.0}
    assert "penalty stability limit 0.06" in Cylinder(time_step=0.08, **fixed, **paper).time_step_warning()
    assert "courant limit 0.2 " in Cylinder(time_step=0.25, courant=0.3, **fixed).time_step_warning()
    assert "viscous stability limit" in Cylinder(reynolds=0.1, **fixed).time_step_warning()
    assert "expect divergence" in Cylinder(time_step=0.08, adaptive_until=1.0, **paper).time_step_warning()
    for handled in (Cylinder(time_step=0.08, **paper), Cylinder(reynolds=0.1)):
        assert handled.time_step_warning() is None
    with pytest.warns(UserWarning, match="expect divergence"):
        Cylinder(time_step=0.2, resolution=8, **fixed, **paper).simulation()


def test_too_much_memory_is_refused_before_it_is_taken():
    with pytest.raises(ConfigError, match="need .* GiB of memory"):
        Cylinder(resolution=1_000_000).build()


def test_exact_taylor_green_solves_the_euler_equation():
    case = TaylorGreen(reynolds=1e14)
    points, offset = np.random.default_rng(1).random((50, 2)), 1e-5

    def derivative(name, axis):
        step = offset * np.eye(2)[axis]
        return (case.exact(points + step, 0)[name] - case.exact(points - step, 0)[name]) / (2 * offset)

    velocity = case.exact(points, 0)["velocity"]
    advection = velocity[:, [0]] * derivative("velocity", 0) + velocity[:, [1]] * derivative("velocity", 1)
    gradient = np.stack([derivative("pressure", 0), derivative("pressure", 1)], axis=1)
    assert np.abs(advection + gradient).max() < 1e-6
    assert np.abs(derivative("velocity", 0)[:, 0] + derivative("velocity", 1)[:, 1]).max() < 1e-6


def test_taylor_green_starts_from_the_exact_solution_and_decays():
    case = TaylorGreen(perturbation=0.2)
    state = case.particles()
    exact = case.exact(state["position"], 0)
    assert (state["velocity"] == exact["velocity"]).all()
    assert (state["pressure"] == exact["pressure"]).all()
    later = case.exact(state["position"], 0.3)
    assert later["velocity"] == pytest.approx(exact["velocity"] * np.exp(-8 * np.pi**2 * 0.3 / 100))
    with pytest.raises(ConfigError, match="2-D only"):
        TaylorGreen(dimensions=3).exact(state["position"], 0)


def test_taylor_green_perturbation_is_seeded():
    first, same, other = (TaylorGreen(perturbation=0.2, seed=seed).particles()["position"] for seed in (1, 1, 2))
    assert (first == same).all()
    assert (first != other).any()
    assert np.abs(first - TaylorGreen().particles()["position"]).max() <= 0.2 / 50 + 1e-12


def test_parameters_change_only_in_a_new_set():
    case = Cylinder(reynolds=200, length=12.0)
    other = case.replace(reynolds=100)
    assert (case.reynolds, other.reynolds, other.length) == (200, 100, 12)
    with pytest.raises(ConfigError, match="reynold: unknown parameter; did you mean 'reynolds'"):
        case.replace(reynold=100)
    with pytest.raises(ConfigError, match=r"cannot be changed; make another set with .replace\(reynolds=100\)"):
        case.reynolds = 100


def test_a_case_is_shown_in_short_by_what_is_not_as_by_default():
    angle = np.linspace(0, 2 * np.pi, 5000)[:-1]
    body = Body(shape=np.stack([np.cos(angle), np.sin(angle)], axis=1), length=20.0, height=20.0, upstream=8.0)
    assert repr(body).startswith("Body(length=20.0, height=20.0, upstream=8.0, shape=<points: a body of 4999 points>")
    assert len(repr(body)) < 200 and str(body) == repr(body)
    case = Cylinder(reynolds=100, time_step=0.01)
    assert eval(repr(case), {"Cylinder": Cylinder}) == case


def test_what_completes_on_a_case_is_its_parameters_and_what_it_is_used_by():
    offered = {name for name in dir(Cylinder()) if not name.startswith("_")}
    assert {*Cylinder.model_fields} < offered <= {*Cylinder.model_fields, *OFFERED}
    assert {*OFFERED} <= {*dir(Body())} and "run" in offered and "outlines" not in offered

    class Own(Cylinder):
        """One of a user's."""

        gap: float = 1.0

        def clearance(self):
            return self.gap

    assert {name for name in dir(Own()) if not name.startswith("_")} - offered == {"gap", "clearance"}
    assert {*dir(cases)} == {*cases.__all__}


CONFINED = {"length": 6.0, "height": 4.0, "upstream": 2.0, "resolution": 10, "side_walls": "no_slip"}


@pytest.mark.parametrize(
    "case", [Cylinder(**CONFINED), Cylinder(**CONFINED, body_offset=-0.25), Body(**CONFINED, body_offset=0.3)], ids=str
)
def test_between_no_slip_sides_the_inflow_is_a_parabola_of_mean_u(case):
    state, kind = case.particles(), case.particles()["kind"]
    inlet = state["position"][kind == Kind.INLET]
    y, u = inlet[:, 1], state["velocity"][kind == Kind.INLET]
    assert u[:, 0] == pytest.approx(1.5 * (1 - (y / 2) ** 2)) and not u[:, 1].any()
    assert u[:, 0].mean() == pytest.approx(1, rel=1e-3)
    sides = (kind == Kind.SOLID) & (state["body"] == 1)
    place, normal, depth = (state[name][sides] for name in ("position", "normal", "depth"))
    assert np.abs(place[:, 1]) - 2 == pytest.approx(depth) and depth.min() == pytest.approx(0.05)
    assert (normal[:, 1] == -np.sign(place[:, 1])).all() and not normal[:, 0].any()
    beyond = case.buffer_columns * case.particle_spacing
    assert place[:, 0].min() < -beyond and place[:, 0].max() > case.length + beyond
    assert [body.name for body in case.checked_bodies] == [*case.coefficient_bodies, "sides"]
    assert case.sliding_bodies == case.moved_bodies == case.coefficient_bodies
    solid = state["position"][(kind == Kind.SOLID) & (state["body"] == 0)]
    middle = (solid.min(axis=0) + solid.max(axis=0)) / 2
    assert middle == pytest.approx([2.0, case.centre[1]], abs=0.02)
    assert abs(case.particle_estimate() / len(kind) - 1) < 0.05


def test_slip_sides_are_as_they_were():
    case = Cylinder(resolution=10)
    state, kind = case.particles(), case.particles()["kind"]
    x, y = ((state["position"][kind == Kind.FLUID] - [4, 0]) / 0.6).T
    swirl = 0.1 * np.exp(0.5 * (1 - x**2 - y**2))
    assert (state["velocity"][kind == Kind.FLUID] == np.stack([1 - swirl * y, swirl * x], axis=1)).all()
    assert (state["velocity"][kind == Kind.INLET] == [1, 0]).all() and len(case.bodies()) == 1


def test_surfaces_that_slide_are_the_bodys_not_the_sides():
    case = Cylinder(**CONFINED, surface_velocity="-2*y, 2*(x - upstream)", perturbation=0.0)
    simulation = case.simulation(threads=1)
    simulation.advance(1)
    state = simulation.state()
    solid = state["kind"] == Kind.SOLID
    x, y = (state["position"] - case.centre).T
    of_sides = solid & (state["body"] == 1)
    of_body = solid & (state["body"] == 0)
    assert (
        np.abs(state["velocity"][of_body]).max() > 0.5
        and not np.asarray(case.settings()["bodies"][1]["velocity"]).any()
    )
    flow = Cylinder(**CONFINED, perturbation=0.0).simulation(threads=1)
    flow.advance(1)
    assert (state["velocity"][of_sides] == flow.state()["velocity"][of_sides]).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"body_offset": 1.2}, "body_offset = 1.2: the cylinder does not fit"),
        ({"height": 4.15}, "height"),
    ],
)
def test_an_offset_that_leaves_no_room(changes, message):
    with pytest.raises(ConfigError, match=message):
        Cylinder(**(CONFINED | changes))


def test_a_quarter_has_no_offset():
    with pytest.raises(ConfigError, match="not with body_offset"):
        Sphere(quarter=True, body_offset=0.1)


def test_what_is_off_centre_or_between_no_slip_sides_has_no_reference_of_the_centred_cylinder():
    assert Cylinder(reynolds=100)._reference() is not None
    wide = {"reynolds": 100, "height": 60.0, "upstream": 30.0, "length": 90.0, "resolution": 8}
    assert Cylinder(**wide)._reference() is not None
    for case in (
        Cylinder(reynolds=100, side_walls="no_slip"),
        Cylinder(reynolds=100, body_offset=1.0),
        Cylinder(**wide, body_offset=20.0),
        ConfinedCylinder(height=5.0),
    ):
        assert case._reference() is None and "not validated" in " ".join(case.remarks())
    assert RotatingCylinder(body_offset=1.0)._loads("developed") == {} != RotatingCylinder()._loads("developed")
    assert ConfinedCylinder()._reference().results["Strouhal number"] == pytest.approx(0.3017, abs=1e-3)
    assert ConfinedCylinder(reynolds=20)._reference().results["mean drag coefficient"] == 5.579535
    assert not ConfinedCylinder().remarks()


def test_runs_from_before_there_were_sides_are_the_same():
    case = Cylinder(resolution=10)
    tables = Config(case).tables()
    assert not {"side_walls", "body_offset"} & tables.keys()
    assert digest(Config(case)) == digest(from_tables(tables))


def test_a_class_of_ones_own_may_have_parameters_called_sides_and_offset():
    class Polygon(Bodies):
        """A polygon."""

        sides: int = 6
        offset: float = 1.0

        def shapes(self):
            angle = np.arange(self.sides) * 2 * np.pi / self.sides
            return [0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)]

    case = Polygon(resolution=10, length=6.0, height=5.0, upstream=2.0)
    assert len(case.checked_bodies) == 1 and case.centre.tolist() == [2, 0]
    case.simulation(threads=1).advance(1)


def test_a_class_that_says_its_bodies_itself_may_have_no_slip_sides():
    class Sliding(Bodies):
        """A plate that moves along itself."""

        def shapes(self):
            return [[(-0.5, -0.25), (0.5, -0.25), (0.5, 0.25), (-0.5, 0.25)]]

        def bodies(self):
            return [SolidBody("body", tuple(self.centre), velocity=(0.1, 0.0))]

    case = Sliding(**CONFINED)
    assert [body.name for body in case.checked_bodies] == ["body", "sides"]
    case.simulation(threads=1).advance(1)
