"""Where particles are put, beside what can be worked out on squared paper."""

import numpy as np
import pytest
import shapely
from alsph.geometry import lattice, packing, particles, solids, thin
from alsph.geometry.particles import Kind
from alsph.geometry.solids import Solid, facing
from scipy.spatial import KDTree

SQUARE = shapely.box(0, 0, 1, 1)
HALF = np.sqrt(0.5)


def same(points, others):
    """Whether two sets of points are the same but for rounding and order."""
    return (
        len(points)
        == len(others)
        == len(set(KDTree(points).query(others, distance_upper_bound=1e-9)[1]) - {len(points)})
    )


def test_particles_of_a_kind_share_what_is_given_once():
    position = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    plain = particles.particles(Kind.FLUID, position, 0.0)
    assert not any(plain[name].any() for name in ("velocity", "pressure", "kind", "body", "normal", "depth"))
    full = particles.particles(Kind.SOLID, position, (1, 2), pressure=0.5, body=7, normal=(0, 1), depth=[0.1, 0.2, 0.3])
    assert full["position"].tolist() == position.tolist() and full["velocity"].tolist() == 3 * [[1.0, 2.0]]
    assert full["pressure"].tolist() == 3 * [0.5] and full["normal"].tolist() == 3 * [[0.0, 1.0]]
    assert full["depth"].tolist() == [0.1, 0.2, 0.3]
    assert full["kind"].tolist() == [3, 3, 3] and full["kind"].dtype == np.uint8
    assert full["body"].tolist() == [7, 7, 7] and full["body"].dtype == np.uint16
    assert all(full[name].dtype == float for name in ("velocity", "pressure", "normal", "depth"))
    full["velocity"][0] = full["pressure"][0] = 9  # each has its own
    assert full["velocity"][1, 0] == 1 and full["pressure"][1] == 0.5
    both = particles.join(plain, full)
    assert both["body"].tolist() == [0, 0, 0, 7, 7, 7] and both["position"].shape == (6, 2)


def test_solids_are_chosen_moved_and_made_particles():
    solid = Solid(np.array([[0.0, 1.0], [2.0, 3.0]]), np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([0.1, 0.2]))
    part = solid.where(np.array([False, True])).moved(np.array([10.0, 20.0]))
    assert (part.position.tolist(), part.normal.tolist(), part.depth.tolist()) == ([[12, 23]], [[1, 0]], [0.2])
    made = part.particles((3, 4), 5)
    assert (made["velocity"].tolist(), made["body"].tolist(), made["kind"].tolist()) == ([[3, 4]], [5], [3])
    assert (made["normal"].tolist(), made["depth"].tolist()) == ([[1, 0]], [0.2])
    still = part.particles()
    assert (still["velocity"].tolist(), still["body"].tolist()) == ([[0, 0]], [0])


def test_lattices():
    assert lattice.lattice(np.array([0, 1]), np.array([5, 6, 7])).tolist() == [
        [0, 5], [0, 6], [0, 7], [1, 5], [1, 6], [1, 7]
    ]  # fmt: skip
    assert lattice.cell_centres(3, 0.5).tolist() == [0.25, 0.75, 1.25]
    assert lattice.symmetric_centres(4, 0.5).tolist() == [-0.75, -0.25, 0.25, 0.75]
    assert lattice.symmetric_centres(3, 0.5).tolist() == [-0.5, 0, 0.5]
    cells = lattice.cells(shapely.box(0.1, 0.2, 1.1, 0.7), 0.25, 1)
    axes = 0.1 + 0.25 * np.arange(-0.5, 5), 0.2 + 0.25 * np.arange(-0.5, 3)
    assert cells == pytest.approx(np.array([[x, y] for x in axes[0] for y in axes[1]]))
    assert len(lattice.cells(shapely.box(0.1, 0.2, 1.1, 0.7), 0.25)) == 4 * 2


def test_rings_of_a_cylinder():
    rings = solids.cylinder_rings(0.5, 0.25, 4)  # π 0.375 / 0.25 = 4.7 in the upper half, and 1.6; then the centre
    assert rings.depth.tolist() == 10 * [0.125] + 4 * [0.375]
    angles = np.radians([*np.arange(18, 360, 36), 45, 135, 225, 315])
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for part, radius in ((slice(10), 0.375), (slice(10, 14), 0.125)):
        assert same(rings.position[part], radius * normals[part])
        assert rings.normal[part] == pytest.approx(rings.position[part] / radius)
    assert len(solids.cylinder_rings(0.375, 0.25, 4).depth) == 2 * round(np.pi)  # none in the centre
    assert len(solids.cylinder_rings(0.4, 0.75, 1).depth) == 4


def test_walls_go_around_corners():
    walls = solids.walls(SQUARE, 0.25, 2)
    assert len(walls.depth) == 8 * 8 - 4 * 4 - 4  # but for the corners' corners, 0.53 off
    for place, normal, depth in (
        ((-0.125, 0.375), (1, 0), 0.125),
        ((0.625, 1.375), (0, -1), 0.375),
        ((-0.125, -0.125), (HALF, HALF), 0.125 / HALF),
        ((1.375, -0.125), (-0.375 / 0.3953, 0.125 / 0.3953), 0.3953),
    ):
        (k,) = np.flatnonzero(np.hypot(*(walls.position - place).T) < 1e-9)
        assert walls.normal[k] == pytest.approx(normal, abs=1e-3) and walls.depth[k] == pytest.approx(depth, rel=1e-3)


def test_faces_look_out_and_corners_along_their_bisector():
    place = np.array([[0.1, 0.4], [0.7, 0.95], [0.2, 0.2], [0.5, 0.5], [0.8, 0.2]])
    found = facing(place, SQUARE, 0.1)
    assert found.normal == pytest.approx(np.array([[-1, 0], [0, 1], [-HALF, -HALF], [0, 0], [HALF, -HALF]]), abs=1e-6)
    assert found.depth == pytest.approx([0.1, 0.05, 0.2, 0.5, 0.2])
    assert (found.position == place).all()


def ring(corners, side=1.0):
    """Return a regular polygon with sides of that length and a corner on the right."""
    angle = 2 * np.pi * np.arange(corners) / corners
    return side / 2 / np.sin(np.pi / corners) * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@pytest.mark.parametrize("first", [0, 3])
def test_points_along_a_curve_lie_on_its_corners(first):
    box = np.roll(np.array([[0, 0], [1, 0], [1, 0.5], [0.4, 0.5], [0, 0.5]]), first, axis=0)  # one of them is no corner
    x = np.arange(0, 1.1, 0.25)
    expected = np.concatenate([[[a, b] for a in x for b in (0, 0.5)], [[0, 0.25], [1, 0.25]]])
    assert same(solids._along(box, 0.25), expected)
    assert same(solids._along(box, 0.26), expected)
    assert same(solids._along(ring(11), 3.0), ring(11))  # they turn by 33 degrees
    loop = solids._along(np.roll(ring(13), first, axis=0), 1.08)  # by 28
    assert len(loop) == 12
    outline = shapely.LinearRing(np.roll(ring(13), -first, axis=0))
    walked = np.sort([shapely.LinearRing(ring(13)).project(shapely.Point(point)) for point in loop])
    assert walked == pytest.approx((np.arange(12) + 0.5) * 13 / 12) and outline.length == pytest.approx(13)


def test_layers_leave_no_room_within_their_depth():
    plate, spacing = shapely.box(-0.26, -1.5, 0.26, 1.5), 0.2
    place = solids.body_layers(plate, spacing, 3).position
    outer = np.abs(np.abs(place) - [0.16, 1.4]).min(axis=1) < 1e-9
    assert np.count_nonzero(outer) == 2 * (14 + 2)  # 2.8 and 0.32 long
    x, y = np.meshgrid(np.linspace(-0.16, 0.16, 33), np.linspace(-1.4, 1.4, 281))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    assert KDTree(place).query(points)[0].max() < 0.75 * spacing + 0.02
    assert KDTree(place).query(place[~outer], k=2)[0][:, 1].min() > 0.75 * spacing
    assert np.abs(place[~outer, 0]).max() < 0.06 and 9 < np.count_nonzero(~outer) < 18
    assert len(solids.body_layers(plate, spacing, 1).position) == 2 * (14 + 2)
    thick = solids.body_layers(shapely.box(-1, -1, 1, 1), spacing, 2)
    assert len(thick.depth) == 4 * 9 + 4 * 7 and thick.depth.max() == pytest.approx(0.3)


def lost(radius, *angles):
    """Return what a disc of that radius does not reach in corners of these inner angles [degrees]."""
    angles = np.radians(angles)
    return (radius**2 * (1 / np.tan(angles / 2) - (np.pi - angles) / 2)).sum()


def triangle(apex):
    """Return an isosceles triangle with a horizontal axis, and another one with a vertical one."""
    half = np.tan(np.radians(apex / 2))
    return shapely.Polygon([(0, 0), (1, -half), (1, half)]), shapely.Polygon([(0, 0), (half, 1), (-half, 1)])


@pytest.mark.parametrize(("apex", "rounded"), [(60, (60, 60, 60)), (70, (70, 55, 55)), (80, (50, 50)), (20, (20,))])
def test_what_is_cut_off_a_body_is_what_a_disc_does_not_reach(apex, rounded):
    for body in triangle(apex):
        radius = 0.05 * (1 - 1e-3)
        carried = thin.carried(body, 0.05)
        assert body.area - carried.area == pytest.approx(lost(radius, *rounded), rel=5e-3)
        assert thin.is_symmetric(carried) == thin.is_symmetric(body) == (body.bounds[0] == 0)


def test_a_body_falls_to_pieces_where_a_disc_does_not_pass():
    left, right = shapely.box(0, 0, 1, 1), shapely.box(2, 0, 3.5, 1)
    for width, parts in ((0.19, 2), (0.21, 1)):
        body = shapely.union_all([left, right, shapely.box(0.9, 0.2, 2.1, 0.2 + width)])
        carried = thin.carried(body, 0.1)
        assert len(shapely.get_parts(carried)) == parts
        assert carried.area == pytest.approx(2.5 if parts == 2 else body.area, rel=0.01)


def test_thickness_is_that_of_the_largest_disc():
    angle = shapely.box(0, 0, 3, 0.4).union(shapely.box(0, 0, 0.4, 3))  # the disc in its corner has r = √2 (0.4 - r)
    right_angled = shapely.Polygon([(0, 0), (4, 0), (0, 3)])
    for shape, width in (
        (angle, 0.8 * (2 - np.sqrt(2))),
        (right_angled, 2.0),
        (shapely.box(0, 0, 3, 0.4), 0.4),
        (shapely.Point(0, 0).buffer(0.5), 1.0),
    ):
        assert thin.thickness(shape) == pytest.approx(width, rel=5e-3)


@pytest.mark.parametrize(("reach", "found"), [(0.19, 1), (0.21, 2)])
def test_the_opposite_face_is_that_within_reach(reach, found):
    plate = shapely.box(0, 0, 0.3, 1)
    both = thin.with_both_faces(facing(np.array([[0.1, 0.5]]), plate, 0.1), plate, reach)
    assert both.position.tolist() == found * [[0.1, 0.5]]
    assert both.normal == pytest.approx(np.array([[-1, 0], [1, 0]][:found]), abs=1e-6)
    assert both.depth == pytest.approx([0.1, 0.2][:found])


@pytest.mark.parametrize(("apex", "found"), [(10, 2), (30, 2), (34, 1), (60, 1)])
def test_faces_that_turn_away_from_each_other_are_not_opposite(apex, found):
    wedge, _ = triangle(apex)
    half = np.radians(apex / 2)
    place = np.array([[0.5, 0.01]])
    both = thin.with_both_faces(facing(place, wedge, 0.1), wedge, 0.6)
    assert len(both.depth) == found
    upper, lower = (np.array([-np.sin(half), sign * np.cos(half)]) for sign in (1, -1))
    assert both.normal == pytest.approx(np.array([upper, lower])[:found], abs=1e-4)
    assert both.depth == pytest.approx([-(place[0] @ normal) for normal in (upper, lower)][:found])


def test_particles_midway_between_parallel_faces_have_the_normal_of_one():
    plate = shapely.box(-0.1, -1, 0.1, 1)
    solid = thin.solid(plate, 0.1, 3)
    assert np.hypot(*solid.normal.T) == pytest.approx(1)
    midway = thin._with_normals(facing(np.array([[0.0, 0.5]]), plate, 0.1), plate)
    assert np.abs(midway.normal[0]) == pytest.approx([1, 0]) and midway.depth == pytest.approx([0.1])


@pytest.mark.parametrize("lower", [-0.3, 0.1])  # symmetric or not
def test_second_faces_are_those_within_the_layers_of_a_thick_plate(lower):
    """The third row of a plate 6 Δx thick is 3.5 Δx off the far face: within four layers, not within three."""
    plate = shapely.box(-1, lower, 1, lower + 0.6)
    for layers, seconds in ((3, 0), (4, 2 * 14)):
        solid = thin.solid(plate, 0.1, layers)
        height = np.abs(solid.position[:, 1] - lower - 0.3)
        points = lattice.cells(plate, 0.1)
        depth = np.minimum(1 - np.abs(points[:, 0]), 0.3 - np.abs(points[:, 1] - lower - 0.3))
        assert same(np.unique(solid.position.round(9), axis=0), points[depth < layers * 0.1])
        assert len(solid.depth) == np.count_nonzero(depth < layers * 0.1) + seconds
        second = np.abs(solid.depth - 0.35) < 1e-9
        assert np.count_nonzero(second) == seconds and height[second] == pytest.approx(0.05)
        assert np.abs(solid.position[second, 0]).max(initial=0) < 0.7
        away = np.sign(lower + 0.3 - solid.position[second, 1])
        assert solid.normal[second] == pytest.approx(np.stack([0 * away, away], axis=1), abs=1e-6)


def test_a_row_on_the_axis_of_a_symmetric_body_is_there_once():
    solid = thin.solid(shapely.box(-0.25, -0.25, 0.25, 0.25), 0.1, 2)
    x = 0.1 * np.arange(-2, 3)
    assert same(solid.position, lattice.lattice(x, x)[np.arange(25) != 12])
    axis = solid.position[:, 1] == 0
    assert np.count_nonzero(axis) == 4
    assert solid.normal[axis] == pytest.approx(np.sign(solid.position[axis]), abs=1e-6)


@pytest.mark.parametrize("turn", [0, 17])  # symmetric or not
def test_the_arrangement_does_not_depend_on_the_unit_of_length(turn):
    """Powers of two do not even change how numbers are rounded, so that equals are chosen between alike."""
    disc = shapely.Polygon(0.5 * ring(90) / np.hypot(*ring(90)[0]))
    body = shapely.affinity.rotate(disc.union(shapely.box(0.3, -0.15, 0.9, 0.15)), turn, origin=(0, 0))
    found = []
    for unit in (2.0**-6, 2.0**6):
        spacing = 0.1 * unit
        carried = thin.carried(shapely.affinity.scale(body, unit, unit, origin=(0, 0)), spacing)
        solid = thin.solid(carried, spacing, 3)
        cells = lattice.lattice(*2 * [lattice.symmetric_centres(24, spacing)])
        fluid = packing.pack(cells, packing.Planar(carried), solid.position, spacing)
        found.append([carried.area / unit**2, solid.position / unit, solid.normal, solid.depth / unit, fluid / unit])
    assert all(one == pytest.approx(other, rel=1e-9, abs=1e-9) for one, other in zip(*found, strict=True))
    assert thin.is_symmetric(carried) == (turn == 0) and len(fluid) == pytest.approx(24**2 - 100 * body.area, abs=2)


def test_heights_above_a_body():
    points = np.array([[0.5, 1.5], [0.5, 0.8], [2.0, 2.0], [1.3, 0.5], [-0.45, 0.5]])
    assert packing.height_over(packing.Planar(SQUARE), points) == pytest.approx([0.5, -0.2, np.sqrt(2), 0.3, 0.45])
    assert packing.height_over(packing.Planar(SQUARE), points, 0.4) == pytest.approx(
        [np.inf, -0.2, np.inf, 0.3, np.inf]
    )
    assert packing._around(points, packing.Planar(SQUARE), 0.46).tolist() == points[[1, 3, 4]].tolist()


def test_cells_around_a_rectangle_continue_its_lattice():
    beyond = packing._beyond(lattice.cells(shapely.box(1, 2, 1.75, 2.5), 0.25), 0.25)
    whole = lattice.cells(shapely.box(0.25, 1.25, 2.5, 3.25), 0.25)  # three more on each side
    assert same(beyond, whole[~lattice.inside(shapely.box(1, 2, 1.75, 2.5), whole)])


def test_the_crowd_is_a_sum_of_gaussians():
    rng = np.random.default_rng(0)
    points, others = rng.uniform(size=(5, 2)), rng.uniform(size=(40, 2))
    distance = np.hypot(*(points[:, None] - others).transpose(2, 0, 1))
    weights = np.exp(-0.5 * (distance / 0.06) ** 2) * (distance < 0.24)
    assert packing._weights(points, others, 0.1) == pytest.approx(weights.sum(axis=1))


@pytest.mark.parametrize(
    ("flips", "count", "left"), [([], 3, [0, 1, 4]), ([(1, -1)], 3, [0, 1, 4]), ([(1, -1)], 4, [0, 1, 2, 3, 4])]
)
def test_the_most_crowded_particles_go_with_their_mirror_images(flips, count, left):
    near = np.array([[0, 0.5], [0, -0.5], [1, 0.04], [1, -0.04], [2, 0.0]])
    assert packing._thinned(near, np.array([[1.0, 0.0]]), count, 0.1, flips).tolist() == near[left].tolist()


def test_particles_next_to_a_body_are_moved_out_of_it():
    points = np.array([[0.5, 1.1], [0.5, 0.9], [1.5, 0.5], [1.06, 1.08]])
    cleared = packing._cleared(points, packing.Planar(SQUARE), 0.2)
    assert cleared == pytest.approx(np.array([[0.5, 1.2], [0.5, 1.2], [1.5, 0.5], [1.12, 1.16]]))
    assert points[0, 1] == 1.1


def test_fluid_that_is_even_stays_and_the_rest_moves_apart():
    spacing, body = 0.1, shapely.box(-0.2, -0.2, 0.2, 0.2)
    cells = lattice.lattice(*2 * [lattice.symmetric_centres(20, spacing)])
    solid = cells[lattice.inside(body, cells)]
    fluid = packing.pack(cells, packing.Planar(body), solid, spacing)
    assert same(fluid, cells[~lattice.inside(body, cells)])
    wider = shapely.box(-0.25, -0.25, 0.25, 0.25)
    solid = solids.body_layers(wider, spacing, 3).position
    fluid = packing.pack(cells, packing.Planar(wider), solid, spacing)
    assert len(fluid) == 376  # 400 - 25 are not in pairs
    assert same(fluid, fluid * (1, -1)) and packing.height_over(packing.Planar(wider), fluid).min() > 0.39 * spacing
    assert KDTree(fluid).query(fluid, 2)[0][:, 1].min() > 0.75 * spacing
    height = packing.height_over(packing.Planar(wider), fluid)
    free = fluid[(height > 0.41 * spacing) & (height < 4 * spacing)]
    offset = (free[:, None] - np.concatenate([fluid, solid])) / spacing
    push = (offset * np.exp(-0.5 * (offset**2).sum(axis=2, keepdims=True) / 0.6**2)).sum(axis=1)
    assert np.hypot(*push.T).max() < 0.006  # a neighbour a spacing off pushes with 0.25
    far = cells[packing.height_over(packing.Planar(wider), cells) > 4 * spacing]
    assert same(fluid[: len(far)], far)
