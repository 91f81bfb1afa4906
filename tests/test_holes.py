"""Bodies with holes: what of them is fluid, and that the flow does not come to it."""

import numpy as np
import pytest
import shapely
from alsph.cases import Bodies, Body
from alsph.geometry.outline import Outline
from alsph.geometry.particles import Kind
from alsph.geometry.thin import carried, holes
from scipy.spatial import KDTree

CHANNEL = {"length": 4.0, "height": 3.0, "upstream": 1.5}
SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def ring(radius, corners=120):
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def fluid_within(case, radius):
    state = case.particles()
    place = state["position"] - case.centre
    return (state["kind"] == Kind.FLUID) & (np.hypot(*place.T) < radius), state


def test_curves_within_curves_are_holes_and_bodies_in_turn():
    curves = [ring(0.1), ring(0.5), ring(0.3), ring(0.2) + [2, 0], ring(0.05)]
    innermost, island, apart = sorted(Outline.of(curves).polygons, key=lambda body: body.bounds[2])[0:3]
    assert [len(body.interiors) for body in (innermost, island, apart)] == [1, 1, 0]
    assert innermost.area == pytest.approx(np.pi * (0.1**2 - 0.05**2), rel=1e-3)
    assert island.area == pytest.approx(np.pi * (0.5**2 - 0.3**2), rel=1e-3)
    given = Outline.of([shapely.Polygon(ring(0.5), [ring(0.3)]), shapely.Polygon(ring(0.1), [ring(0.05)])])
    assert sum(body.area for body in given.polygons) == pytest.approx(innermost.area + island.area)


@pytest.mark.parametrize("shape", [[ring(0.5), ring(0.3)], [SQUARE, 0.6 * SQUARE], [SQUARE, 0.4 * SQUARE + [0, 0.1]]])
@pytest.mark.parametrize("angle", [0.0, 17.0])
def test_a_hole_is_filled_with_as_much_fluid_as_it_has_room_for_and_at_rest(shape, angle):
    case = Body(shape=shape, angle_of_attack=angle, resolution=20, **CHANNEL)
    state, spacing = case.particles(), case.particle_spacing
    (hole,) = holes(case.outline)
    fluid = state["position"][state["kind"] == Kind.FLUID] - case.centre
    enclosed = shapely.contains_xy(hole, *fluid.T)
    assert enclosed.sum() * spacing**2 == pytest.approx(hole.area, rel=0.02)
    assert len(fluid) * spacing**2 == pytest.approx(12 - case.outline.area, rel=1e-3)
    assert case.fluid_volume() == pytest.approx(12 - case.outline.area, rel=1e-3)
    velocity = state["velocity"][state["kind"] == Kind.FLUID]
    assert not velocity[enclosed].any() and velocity[~enclosed, 0].min() > 0.5
    assert not shapely.contains_xy(case.outline, *fluid.T).any()
    nearest = KDTree(state["position"]).query(fluid + case.centre, k=2)[0][:, 1] / spacing
    assert nearest.min() > 0.6 and nearest.max() < 1.2
    solid = state["position"][state["kind"] == Kind.SOLID] - case.centre
    assert shapely.distance(hole.exterior, shapely.points(solid)).min() == pytest.approx(spacing / 2, rel=0.02)


def test_holes_may_be_solid_and_then_leave_the_body_that_is_around_them():
    shape = [ring(0.5), ring(0.3), ring(0.1)]
    solid, full = Body(shape=shape, holes="solid", **CHANNEL), Body(shape=ring(0.5), **CHANNEL)
    for name, values in full.particles().items():
        assert np.array_equal(solid.particles()[name], values), name
    assert solid.coefficient_bodies == ["body"] and not [told for told in solid.remarks() if "hole" in told]
    fluid = Body(shape=shape, **CHANNEL)
    assert fluid.coefficient_bodies == ["body_1", "body_2"]
    with pytest.raises(ValueError, match="holes = .*must be 'fluid' or 'solid'"):
        fluid.replace(holes="gas")


def test_what_becomes_of_holes_is_told():
    told = " ".join(Body(shape=[ring(0.5), ring(0.3)], resolution=20, **CHANNEL).remarks())
    assert "closed holes: 1 of fluid" in told and "lost holes" not in told
    narrow = Body(shape=[ring(0.5), ring(0.09)], resolution=20, **CHANNEL)
    assert not fluid_within(narrow, 0.3)[0].any()
    told = " ".join(narrow.remarks())
    assert "lost holes: 1 of 1" in told and "closed holes" not in told
    assert fluid_within(narrow.replace(resolution=24), 0.3)[0].any()


def test_a_wall_that_is_too_thin_opens_the_hole():
    eccentric = shapely.Polygon(ring(0.5), [ring(0.3) + [0.18, 0]])
    assert len(holes(carried(eccentric, 1 / 20))) == 0  # 0.02 D of wall are 0.4 spacings
    assert len(holes(carried(eccentric, 1 / 120))) == 1
    assert "opened" in " ".join(Body(shape=eccentric, resolution=20, **CHANNEL).remarks())


def test_the_flow_does_not_come_into_a_ring(tmp_path):
    options = {"resolution": 14, "reynolds": 100.0, "perturbation": 0.0, **CHANNEL}
    rings = {how: Body(shape=[ring(0.5), ring(0.25)], holes=how, **options) for how in ("fluid", "solid")}
    runs = {
        how: case.run(tmp_path / how, until=0.5, threads=1, progress=False, output_interval=0.25)
        for how, case in rings.items()
    }
    snapshot = runs["fluid"].snapshot()
    place = snapshot.position - rings["fluid"].centre
    pocket = snapshot.fluid & (np.hypot(*place.T) < 0.27)
    assert pocket.sum() == pytest.approx(np.pi * 0.25**2 * 14**2, rel=0.05)
    assert np.hypot(*snapshot.velocity[pocket].T).max() < 0.02
    assert np.ptp(snapshot.pressure[pocket]) < 0.02 < np.ptp(snapshot.pressure[snapshot.fluid & ~pocket])
    drag = [run.coefficient("x")[-1] for run in runs.values()]
    assert drag[0] == pytest.approx(drag[1], rel=0.1)


def test_fluid_in_a_turning_ring_comes_to_turn_with_it(tmp_path):
    case = Body(
        shape=[ring(0.5), ring(0.25)],
        # As the hole's surface is at r = 1/4, in the solid particles below it, too.
        surface_velocity="-y/4/sqrt(y**2 + (x - 1.5)**2), (x - 1.5)/4/sqrt(y**2 + (x - 1.5)**2)",
        resolution=16,
        reynolds=5.0,
        perturbation=0.0,
        **CHANNEL,
    )
    run = case.run(tmp_path / "run", until=0.25, threads=1, progress=False)
    snapshot = run.snapshot()
    x, y = (snapshot.position - case.centre).T
    pocket = snapshot.fluid & (np.hypot(x, y) < 0.25)
    rigid = np.stack([-y, x], axis=1)[pocket]
    assert np.abs(snapshot.velocity[pocket] - rigid).max() < 0.03


def test_own_bodies_may_have_holes():
    class Tube(Bodies):
        name = "tube"
        title = "flow past a tube"

        def shapes(self):
            return [shapely.Point(0, 0).buffer(0.5) - shapely.Point(0, 0).buffer(0.25)]

    case = Tube(resolution=20, **CHANNEL)
    assert fluid_within(case, 0.3)[0].sum() == pytest.approx(np.pi * 0.25**2 * 400, rel=0.03)
    assert case.surface_points().integral(np.ones(len(case.surface_points().arc))) == pytest.approx(0, abs=1e-9)
