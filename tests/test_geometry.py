import numpy as np
import pytest
import shapely
from alsph.geometry import thin
from alsph.geometry.lattice import cells, inside
from alsph.geometry.naca import naca
from alsph.geometry.solids import body_layers, cylinder_rings, walls
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

ANGLES = np.radians(np.arange(0, 360, 0.5))
SHAPES = {
    "circle": shapely.Polygon(0.5 * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)),
    "ellipse": shapely.Polygon(np.stack([0.5 * np.cos(ANGLES), 0.2 * np.sin(ANGLES)], axis=1)),
    "square": shapely.box(-0.5, -0.5, 0.5, 0.5),
    "airfoil": naca("0012"),
    "wedge": shapely.Polygon([(0, 0), (1, 0.2), (1, -0.2)]),
    "bracket": shapely.box(-0.5, -0.5, 0.5, 0.5) - shapely.box(-0.2, -0.2, 0.6, 0.2),
}
SPACING = 1 / 40


def same(points, others):
    """Whether two sets of points are the same but for rounding, and none is taken twice."""
    distance, index = KDTree(points).query(others)
    return len(points) == len(others) == len(set(index)) and distance.max() < 1e-9


@pytest.fixture(params=SHAPES.values(), ids=SHAPES)
def shape(request):
    return thin.carried(request.param, SPACING)


def test_body_particles_lie_in_the_body_a_spacing_apart(shape):
    places = np.unique(thin.solid(shape, SPACING, 4).position, axis=0)
    assert inside(shape, places).all()
    distance, _ = KDTree(places).query(places, k=2)
    assert distance[:, 1].min() > 0.15 * SPACING
    assert distance[:, 1].max() < 1.2 * SPACING
    assert np.median(distance[:, 1]) == pytest.approx(SPACING, rel=0.05)


def test_body_particles_leave_no_hole_in_the_surface_layer(shape):
    solid = thin.solid(shape, SPACING, 4)
    x, y = np.mgrid[-0.6:1.1:0.005, -0.6:0.6:0.005]
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    points = points[inside(shape, points)]
    depth = shapely.distance(shape.boundary, shapely.points(points))
    near = points[depth < 3.5 * SPACING]
    assert KDTree(solid.position).query(near)[0].max() < 1.05 * SPACING


def test_normal_leads_to_the_surface(shape):
    solid = thin.solid(shape, SPACING, 4)
    nearest = shapely.distance(shape.boundary, shapely.points(solid.position))
    assert (solid.depth > nearest - 1e-9).all()
    assert np.count_nonzero(solid.depth < nearest + 1e-9) >= len(np.unique(solid.position, axis=0))
    assert np.hypot(*solid.normal.T) == pytest.approx(1)
    assert not inside(shape, solid.position + 1.5 * solid.normal * np.maximum(solid.depth, SPACING)[:, None]).all()
    # Off the bisectors of corners a step along the normal, as long as the depth, ends on the surface.
    ends = solid.position + solid.depth[:, None] * solid.normal
    assert np.median(shapely.distance(shape.boundary, shapely.points(ends))) < 1e-3 * SPACING


@pytest.mark.parametrize("name", SHAPES)
def test_symmetric_body_has_symmetric_particles(name):
    carried = [(thin.carried(SHAPES[name], 1 / count), 1 / count) for count in range(8, 41)]
    for shape, spacing in [each for each in carried if not each[0].is_empty]:
        solid = thin.solid(shape, spacing, 4)
        states = np.concatenate([solid.position, solid.normal, solid.depth[:, None]], axis=1)
        assert same(states, states * (1, -1, 1, -1, 1)), spacing


def test_square_has_the_particles_of_the_lattice():
    solid = body_layers(SHAPES["square"], SPACING, 4)
    points = cells(SHAPES["square"], SPACING)
    assert same(solid.position, points[np.abs(points).max(axis=1) > 0.5 - 4 * SPACING])


def test_circle_has_the_rings_of_the_cylinder():
    solid, rings = body_layers(SHAPES["circle"], SPACING, 4), cylinder_rings(0.5, SPACING, 4)
    assert np.hypot(*solid.position.T) == pytest.approx(0.5 - solid.depth, abs=1e-4)
    assert len(solid.depth) == pytest.approx(len(rings.depth), rel=0.01)


@given(st.integers(8, 60), st.integers(2, 5), st.floats(0.0, 1.0))
@settings(max_examples=25, deadline=None)
def test_walls_lie_midway_between_fluid_and_solid(resolution, layers, offset):
    spacing = 1 / resolution
    box = shapely.box(offset, -offset, offset + 1, 1 - offset)
    fluid, solid = cells(box, spacing), walls(box, spacing, layers)
    assert len(fluid) == resolution**2
    assert inside(box, fluid).all() and not inside(box, solid.position).any()
    assert shapely.distance(box.boundary, shapely.points(fluid)).min() == pytest.approx(spacing / 2)
    assert solid.depth.min() == pytest.approx(spacing / 2)
    assert solid.depth.max() < layers * spacing
    side = (np.abs(solid.position - [offset + 0.5, 0.5 - offset]) < 0.5).any(axis=1)
    assert side.sum() == 4 * layers * resolution
    assert set(np.round(np.abs(solid.normal[side]).ravel(), 6)) == {0.0, 1.0}
    ends = solid.position + solid.depth[:, None] * solid.normal
    assert shapely.distance(box, shapely.points(ends)).max() < 1e-4 * spacing
