import time as clock

import numpy as np
import pytest
import shapely
from alsph.cases import Body
from alsph.errors import ConfigError
from alsph.geometry import thin
from alsph.geometry.particles import Kind
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

CHANNEL = {"length": 5.0, "height": 4.0, "upstream": 2.0}


def plate(tmp_path, thickness):
    path = tmp_path / "plate.txt"
    path.write_text(f"0 -0.5\n{thickness} -0.5\n{thickness} 0.5\n0 0.5\n")
    return path


@given(st.integers(1, 200), st.floats(0.01, 0.2))
@settings(max_examples=30, deadline=None)
def test_what_a_resolution_carries_is_part_of_the_body_and_keeps_wide_corners(turn, thickness):
    box = shapely.affinity.rotate(shapely.box(-0.5, -thickness / 2, 0.5, thickness / 2), turn)
    carried = thin.carried(box, thickness / 2.5)
    assert carried.symmetric_difference(box).area < 1e-3 * box.area
    assert thin.carried(box, thickness / 1.9).is_empty


def test_what_is_carried_of_an_airfoil_tends_to_it():
    outline = Body(shape="naca0012", **CHANNEL).outline
    carried = [thin.carried(outline, 1 / resolution) for resolution in (20, 40, 80, 160, 320)]
    lost = [1 - shape.area / outline.area for shape in carried]
    chord = [shape.bounds[2] - shape.bounds[0] for shape in carried]
    assert (np.diff(lost) < 0).all() and lost[-1] < 2e-3
    assert (np.diff(chord) > 0).all() and chord[-1] > 0.97
    assert all(outline.buffer(1e-9).contains(shape) for shape in carried)


@pytest.mark.parametrize("thickness", [0.001, 0.01, 0.04, 0.15])
def test_a_body_too_thin_for_the_resolution_is_refused(tmp_path, thickness):
    path = plate(tmp_path, thickness)
    case = Body(shape=path, resolution=10, **CHANNEL)
    with pytest.raises(ConfigError, match=f"at most {thickness:g} D or .* Δx thick.*resolution = ") as refusal:
        case.simulation()
    assert str(refusal.value) in case.remarks()
    enough = int(str(refusal.value).split("resolution = ")[1].split()[0])
    if enough < 1000:
        assert Body(shape=path, resolution=enough, **CHANNEL).carried[0].area == pytest.approx(thickness, rel=0.01)


@pytest.mark.parametrize("shape", ["naca0012", "naca2412", [(-1, 0), (1, -0.15), (1, 0.15)]])
def test_a_body_of_which_less_than_half_is_left_is_refused(shape):
    for resolution in range(8, 20):
        case = Body(shape=shape, resolution=resolution, **CHANNEL)
        left = sum(body.area for body in case.carried) / case.outline.area
        refusal = [remark for remark in case.remarks() if remark.startswith("too thin")]
        assert bool(refusal) == (left < 0.5)
        if not refusal:
            break
        enough = int(refusal[0].split("resolution = ")[1].split()[0])
        assert left == 0 or f"{100 * left:.2g} % of it is left" in refusal[0]
    assert resolution == enough  # the first that is carried


@pytest.mark.parametrize("thickness", [0.2, 0.25, 0.3, 0.4])
def test_a_thin_plate_is_filled_and_has_two_faces(tmp_path, thickness):
    (solid,) = Body(shape=plate(tmp_path, thickness), resolution=10, **CHANNEL).solids()
    places, count = np.unique(solid.position.round(12), axis=0, return_counts=True)
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 101) * thickness, np.linspace(-0.45, 0.45, 91))
    assert KDTree(places).query(np.stack([x.ravel(), y.ravel()], axis=1))[0].max() < 0.09
    assert set(count) == {1, 2}
    middle = np.abs(solid.position[:, 1]) < 0.3
    right = solid.normal[:, 0] > 0
    assert (np.abs(solid.normal[middle, 0]) > 0.99).all()
    assert np.count_nonzero(middle & right) == np.count_nonzero(middle & ~right)
    depth = np.where(right, 0.5 * thickness - solid.position[:, 0], 0.5 * thickness + solid.position[:, 0])
    assert solid.depth[middle] == pytest.approx(depth[middle], abs=1e-6)


@pytest.mark.parametrize("resolution", range(8, 14))
@pytest.mark.parametrize("shape", ["square_cylinder", "plate"])
def test_fluid_fills_what_the_body_leaves(tmp_path, shape, resolution):
    case = Body(shape=plate(tmp_path, 0.4) if shape == "plate" else shape, resolution=resolution, **CHANNEL)
    state = case.particles()
    fluid = state["position"][state["kind"] == Kind.FLUID] - case.centre
    assert len(fluid) == pytest.approx((20 - case.outline.area) * resolution**2, abs=1)
    assert shapely.distance(case.outline, shapely.points(fluid)).min() > 0.35 / resolution
    assert KDTree(fluid).query(fluid, 2)[0][:, 1].min() > 0.75 / resolution
    assert KDTree(fluid).query(fluid * (1, -1))[0].max() < 1e-12


@pytest.mark.parametrize("resolution", [9, 11])
def test_symmetric_flow_past_a_square_between_lattice_lines_has_no_lift(resolution):
    case = Body(resolution=resolution, reynolds=100, perturbation=0, **CHANNEL)
    simulation = case.simulation(threads=1)
    simulation.advance(60)
    assert np.abs(simulation.history()["lift_coefficient"]).max() < 1e-6


ELLIPSE = np.stack(
    [0.5 * np.cos(AROUND := np.linspace(0, 2 * np.pi, 100, endpoint=False)), 0.1 * np.sin(AROUND)], axis=1
)


@pytest.mark.parametrize(
    ("shape", "angle", "reynolds", "resolution"),
    [
        ("naca0012", 5, 200, 20),
        ("naca2412", 5, 500, 24),
        (ELLIPSE, 10, 200, 12),
        (ELLIPSE, 10, 1000, 16),
        ([(-0.3, 0), (0.6, -0.35), (0.6, 0.35)], 0, 1000, 20),
        ([(-0.5, -0.04), (0.5, -0.04), (0.5, 0.04), (-0.5, 0.04)], 10, 1000, 26),
    ],
)
def test_no_particle_goes_into_a_pointed_body(shape, angle, reynolds, resolution):
    """With the shift next to bodies held to 0.1 Δx a particle came in at the stagnation point of all of these."""
    flow = {"length": 4, "height": 3, "upstream": 1.5, "angle_of_attack": angle}
    case = Body(shape=shape, reynolds=reynolds, resolution=resolution, **flow)
    simulation = case.simulation(threads=1)
    simulation.run_until(0.9)
    state = simulation.snapshot()
    fluid = shapely.points(state["position"][state["kind"] == Kind.FLUID][:, :2] - case.centre)
    body = case.carried[0]
    inside = fluid[shapely.contains(body, fluid)]
    assert shapely.distance(body.boundary, inside).max(initial=0) < 0.75 / resolution


@pytest.mark.parametrize("length", [2.0, 4.0])
def test_fluid_stays_within_a_channel_that_the_body_nearly_fills(length):
    case = Body(resolution=8, length=length, height=2.0, upstream=1.0)
    state = case.particles()
    fluid = state["position"][state["kind"] == Kind.FLUID]
    lower, upper = np.array(case.domain().lower), np.array(case.domain().upper)
    assert np.minimum(fluid - lower, upper - fluid).min() > 0.4 / case.resolution
    assert KDTree(fluid).query(fluid, 2)[0][:, 1].min() > 0.75 / case.resolution


def test_nothing_is_carried_apart_from_where_a_disc_fits_in():
    """The wide corners of a short thin stub are near the body, and cut off from it."""
    box = shapely.box(-0.5, -0.5, 0.5, 0.5)
    carried = thin.carried(box.union(shapely.box(0.5, -0.03, 0.65, 0.03)), 0.1)
    assert carried.geom_type == "Polygon" and carried.symmetric_difference(box).area < 0.002


def test_the_noise_of_a_measured_outline_has_no_corners():
    """Each of them takes its time, and there may be thousands."""
    angle = np.linspace(0, 2 * np.pi, 20_000, endpoint=False)
    radius = 0.5 + 1e-4 * np.random.default_rng(0).normal(size=len(angle))
    shape = shapely.Polygon(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)).buffer(0)
    began = clock.monotonic()
    assert thin.carried(shape, 0.05).area == pytest.approx(np.pi / 4, rel=1e-3)
    assert clock.monotonic() - began < 20
