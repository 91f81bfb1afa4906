"""Bodies in space: their distances and particles, meshes from files, a quarter of a flow, slices, and the pipe."""

import numpy as np
import pytest
import trimesh
from alsph import Run
from alsph.cases import Body3D, DamBreakObstacle, DamBreakStructure, Pipe, SettlingSphere, Spatial, Sphere
from alsph.errors import ConfigError
from alsph.geometry.lattice import lattice, symmetric_centres
from alsph.geometry.mesh import Mesh
from alsph.geometry.packing import pack
from alsph.geometry.plane import Plane
from alsph.geometry.volume import cube, sphere
from scipy.spatial import KDTree

BALL = trimesh.creation.icosphere(subdivisions=3, radius=3.0)  # 1280 triangles
BOX = trimesh.creation.box((3.0, 3.0, 3.0))
SMALL = {"length": 2.5, "height": 2.0, "width": 2.0, "upstream": 1.25, "resolution": 8}


def images(points, flip):
    """How far the mirror images of points are from points."""
    return KDTree(points).query(points * flip)[0].max()


@pytest.mark.parametrize("cells", [8, 10, 15])
def test_solid_particles_lie_in_even_layers_under_a_sphere(cells):
    spacing = 1 / cells
    solid = sphere(0.5).solid(spacing, 4)
    radius = np.linalg.norm(solid.position, axis=1)
    assert radius + solid.depth == pytest.approx(0.5, abs=0.01 * spacing)
    assert solid.normal == pytest.approx(solid.position / radius[:, None], abs=1e-6)
    assert np.isin(np.round(solid.depth / spacing, 6), [0.5, 1.5, 2.5, 3.5]).all()
    shells = 4 / 3 * np.pi * -np.diff((cells / 2 - np.arange(4)) ** 3)
    counts = [np.count_nonzero(np.round(solid.depth / spacing - 0.5) == layer) for layer in range(3)]
    assert counts[:2] == pytest.approx(shells[:2], rel=0.31)  # a lattice has 104 points where there are 80
    assert sum(counts) == pytest.approx(shells.sum(), rel=0.07)
    assert KDTree(solid.position).query(solid.position, 2)[0][:, 1].min() > 0.45 * spacing
    assert max(images(solid.position, flip) for flip in ((1, -1, 1), (1, 1, -1))) == 0


@pytest.mark.parametrize("cells", [8, 9])
def test_solid_particles_of_a_cube_stay_on_its_lattice(cells):
    solid = cube(1.0, 0.0).solid(1 / cells, 4)
    assert len(solid.position) > 0.98 * cells**3
    assert KDTree(solid.position).query(solid.position, 2)[0][:, 1].min() > 0.9 / cells


def test_flow_past_a_cube_goes_on():
    """With solids that had gone to its edges it broke down at once."""
    simulation = Body3D(
        **SMALL | {"resolution": 9, "length": 3, "height": 22 / 9, "width": 22 / 9, "upstream": 1.5}
    ).simulation()
    simulation.advance(12)
    force = simulation.history()["pressure_force"][-1, 0]
    assert np.abs(force[1:]).max() < 0.02 * force[0]


@pytest.mark.parametrize(
    ("told", "room"),
    [
        ("4 D high and 4 D wide, comes 0.5 D beyond the lower side of the channel.*larger height", {"scale": 4.0}),
        ("2.9 D wide, comes within 0.05 D of the lower side.*larger height, or a smaller scale", {"scale": 2.9}),
        ("comes within 0.1 D of the back of the channel.*larger width", {"scale": 2.8, "height": 6.0, "length": 6.0}),
        ("comes within 0.1 D of the inlet of the channel.*larger upstream", {"scale": 2.0, "upstream": 1.1}),
        (
            "1.77 D high and 1.25 D wide, comes within 0.1161 D of the upper side",
            {"body_offset": 0.5, "angle_of_attack": 45.0, "scale": 1.25},
        ),
    ],
)
def test_a_body_in_space_that_does_not_fit_in_is_refused(told, room):
    with pytest.raises(ConfigError, match=told):
        Body3D(**{"length": 4.0, "height": 3.0, "width": 3.0, "upstream": 1.6, "resolution": 8} | room).particles()
    assert Body3D(**SMALL).fluid_volume() == pytest.approx(9)


def test_fluid_around_a_sphere_is_as_much_as_there_is_room_for_and_even():
    spacing = 0.1
    body = sphere(0.5)
    solid = body.solid(spacing, 4)
    cells = lattice(*3 * [symmetric_centres(20, spacing)])
    fluid = pack(cells, body, solid.position, spacing)
    assert len(fluid) == pytest.approx(len(cells) - np.pi / 6 / spacing**3, abs=4)
    assert body.height(fluid).min() > 0.399 * spacing
    assert max(images(fluid, flip) for flip in ((1, -1, 1), (1, 1, -1))) == 0
    near = fluid[body.height(fluid) < 4 * spacing]
    offset = (near[:, None] - np.concatenate([fluid, solid.position])) / spacing
    crowd = np.exp(-0.5 * (offset**2).sum(axis=2) / 0.6**2).sum(axis=1)
    assert crowd == pytest.approx((2 * np.pi) ** 1.5 * 0.6**3, rel=0.2)  # that of a lattice


def test_a_mesh_of_a_sphere_is_a_sphere():
    mesh = Mesh.of(BALL).volume(scale=1.0)
    points = np.random.default_rng(1).uniform(-0.7, 0.7, (500, 3))
    assert mesh.height(points) == pytest.approx(sphere(0.5).height(points), abs=3e-3)
    assert mesh.surface(points)[1] == pytest.approx(sphere(0.5).surface(points)[1], abs=0.15)
    assert np.linalg.norm(mesh.surface(points)[1], axis=1) == pytest.approx(1)
    assert (mesh.volume, mesh.frontal_area) == pytest.approx((np.pi / 6, np.pi / 4), rel=0.01)
    assert len(mesh.flips) == 2
    assert len(mesh.solid(0.1, 4).position) == len(sphere(0.5).solid(0.1, 4).position)


def test_a_turned_box():
    """Nose up by 90 degrees, what pointed forwards points up; its shadow is that of its longest sides."""
    box = Mesh.of(trimesh.creation.box((4.0, 2.0, 1.0)))
    flat, up = box.volume(scale=1.0), box.volume(scale=1.0, angle=90.0)
    assert (flat.frontal_area, up.frontal_area) == pytest.approx((0.125, 0.25))
    assert flat.upper - flat.lower == pytest.approx([1.0, 0.5, 0.25])
    assert up.upper - up.lower == pytest.approx([0.5, 1.0, 0.25])
    assert flat.thickness == pytest.approx(0.25, abs=0.02) and flat.volume == pytest.approx(0.125)
    turned = box.volume(scale=1.0, angle=30.0)
    assert np.sign(turned.height(np.array([[-0.35, 0.25, 0.0], [-0.35, -0.25, 0.0]]))).tolist() == [-1, 1]


@pytest.mark.parametrize("kind", ["stl", "ply", "obj", "off"])
def test_a_mesh_of_a_file_is_that_mesh(kind, tmp_path):
    path = tmp_path / f"ball.{kind}"
    BALL.export(path)
    mesh = Mesh.read(path)
    assert str(mesh) == f"ball.{kind}: 1280 triangles"
    assert mesh.surface.volume == pytest.approx(BALL.volume, rel=1e-5)
    assert Mesh(**mesh.model_dump()).surface.is_watertight


def test_files_that_are_no_closed_mesh_are_refused(tmp_path):
    def refusal(path):
        with pytest.raises(ConfigError) as error:
            Body3D(shape=str(path))
        return str(error.value)

    whole = tmp_path / "ball.stl"
    BALL.export(whole)
    cut = tmp_path / "cut.stl"
    cut.write_bytes(whole.read_bytes()[:3000])
    assert "cut.stl: holds no triangles that can be read" in refusal(cut)
    (tmp_path / "empty.obj").write_text("")
    assert "empty.obj: holds no triangles that can be read" in refusal(tmp_path / "empty.obj")
    opened = BALL.copy()
    opened.update_faces(np.arange(len(opened.faces)) > 0)
    opened.export(tmp_path / "open.stl")
    assert "open.stl: is not closed, 3 edges are not those of two triangles" in refusal(tmp_path / "open.stl")
    assert "no such file" in refusal(tmp_path / "none.stl")
    (tmp_path / "foil.dat").write_text("0 0\n1 0\n")
    assert "a mesh is a file of triangles, .stl" in refusal(tmp_path / "foil.dat")
    fine = trimesh.creation.icosphere(subdivisions=6)
    with pytest.raises(ConfigError, match="81920 triangles, more than 50000; reduce them"):
        Mesh.of(fine)
    with pytest.raises(ConfigError, match="must be a trimesh.Trimesh, or vertices"):
        Mesh.of([1, 2, 3])
    spoilt = Mesh.of(BALL).model_dump() | {"triangles": "v 0 0 0\n"}
    with pytest.raises(ConfigError, match="not those of the SHA-256"):
        Mesh(**spoilt)


def together(*meshes):
    return trimesh.util.concatenate(meshes)


def test_shells_that_overlap_are_refused_also_where_no_corner_lies_within_another():
    def box(extents, at):
        return trimesh.creation.box(extents).apply_translation(at)

    block, knob = trimesh.creation.box((1, 0.5, 0.5)), box((0.5, 0.5, 0.5), (0, 0.3, 0))
    bars = [trimesh.creation.box((3, 1, 1)), box((1, 3, 1), (0, 0, 0.3))]
    on_top = box((0.5, 0.5, 0.5), (0, 0, 0.5))
    for meshes in ((block, knob), bars, (block, on_top), (box((1, 1, 1), (5, 0, 0)), block, knob)):
        numbers = f"{len(meshes) - 1} and {len(meshes)}"
        with pytest.raises(ConfigError, match=f"its shells {numbers} overlap near .*; unite them in the program"):
            Body3D(shape=together(*meshes))


def test_shells_within_others_are_filled():
    cavity, core = (trimesh.creation.icosphere(subdivisions=2, radius=radius) for radius in (2.5, 1.0))
    cavity.invert()
    hollow = Mesh.of(together(BALL, cavity, core))
    assert hollow.triangles == Mesh.of(BALL).triangles
    assert "2 of its 3 shells, within others, left out: the body is solid there" in hollow.remark
    assert not Mesh.of(trimesh.creation.annulus(0.3, 0.5, 1.0)).remark


def test_shells_apart_are_one_body_and_told_so():
    pair = Mesh.of(together(BALL, BALL.copy().apply_translation((9, 0, 0))))
    body = pair.volume(scale=5.0)
    assert body.volume == pytest.approx(2 * Mesh.of(BALL).volume(scale=2.0).volume)
    assert body.height(np.array([[0.0, 0, 0], [1.5, 0, 0], [-1.5, 0, 0]])) == pytest.approx([0.5, -1, -1], abs=0.02)
    told = "mesh: <mesh>: its 2 shells, apart from each other, are one body: drag and lift are those of all of them"
    case = Body3D(shape=Mesh(**pair.model_dump()))
    assert any(remark.startswith(told) for remark in case.remarks())
    assert not any(remark.startswith("mesh: ") for remark in Body3D(shape=BALL).remarks())


def test_a_cube_is_that_of_a_mesh():
    for angle in (0.0, 20.0):
        cube, mesh = (Body3D(shape=shape, scale=0.8, angle_of_attack=angle).volume() for shape in ("cube", BOX))
        points = np.random.default_rng(2).uniform(-1, 1, (300, 3))
        assert cube.height(points) == pytest.approx(mesh.height(points), abs=1e-6)
        assert [cube.volume, cube.frontal_area, *cube.upper] == pytest.approx(
            [mesh.volume, mesh.frontal_area, *mesh.upper]
        )


def test_bodies_too_thin_are_refused_and_thin_parts_remarked_on():
    plate = trimesh.creation.box((0.15, 1.0, 1.0))
    with pytest.raises(ConfigError, match="too thin: the body is at most 1.5 Δx thick"):
        Body3D(shape=plate, resolution=10).particles()
    assert any(remark.startswith("thin body: ") for remark in Body3D(shape=plate, resolution=20).remarks())
    cone = Body3D(shape=trimesh.creation.cone(0.25, 1.0), resolution=10)
    assert any(remark.startswith("thin parts: ") for remark in cone.remarks())
    for case in (Sphere(resolution=8), Sphere(), Body3D(resolution=8), Body3D(resolution=9), Body3D()):
        assert not any("thin" in remark for remark in case.remarks())


def test_a_quarter_has_a_drag_alone_and_is_refused_of_what_is_no_image_of_itself(tmp_path):
    wedge = trimesh.creation.box((1.0, 1.0, 0.5))
    run = Body3D(**SMALL, quarter=True).run(tmp_path / "run", until=0.02, progress=False)
    assert run.measures and all("drag" in measure.name for measure in run.measures)
    with pytest.raises(ConfigError, match="quarter = true: the body is not its own mirror image in y and in z"):
        Body3D(shape=wedge, angle_of_attack=10.0, quarter=True)


QUARTER = {"quarter": True, **SMALL}


@pytest.mark.parametrize(
    ("model", "options", "told"),
    [
        (Sphere, QUARTER | {"surface_velocity": "0,-z,y"}, "velocity of surfaces is not symmetric in y = 0"),
        (Sphere, QUARTER | {"body_motion": "0,0,0,sin(t),0,0"}, "motion of bodies is not symmetric in y = 0"),
        (Sphere, QUARTER | {"body_motion": "0,0,t"}, "motion of bodies is not symmetric in z = 0"),
        (Sphere, QUARTER | {"inlet_velocity": "1,0.3,0"}, r"inflow is not symmetric in y = 0.*gives \(1, 0.3, 0\)"),
        (Sphere, QUARTER | {"driving_force": "y,0,0"}, "body force is not symmetric in y = 0"),
        (Sphere, QUARTER | {"perturbation": 0.5}, "quarter = true: not with perturbation = 0.5"),
        (SettlingSphere, {"driving_force": "1,0,0"}, "body force is not symmetric in x = 0"),
        (DamBreakObstacle, {"driving_force": "0,0.5*(t > 1),0"}, "body force is not symmetric in y = 0"),
        (DamBreakStructure, {"body_motion": "0,0,0,0,0,t"}, "motion of bodies is not symmetric in y = 0"),
    ],
)
def test_a_part_up_to_planes_of_symmetry_refuses_what_breaks_it(model, options, told):
    with pytest.raises(ConfigError, match=told):
        model(**options)


def test_a_part_up_to_planes_of_symmetry_takes_what_has_it():
    Sphere(**QUARTER, inlet_velocity="1 + 0.1*y**2*sin(t), -0.1*y, 0", body_motion="3 + 0.1*t, 2, 1")
    Sphere(**QUARTER, driving_force="sin(t), -y, z", surface_velocity="1, y, z*abs(y)")
    SettlingSphere(driving_force="x*z, y, z*t")
    DamBreakStructure(body_motion="0.1*t, 0, 0, 0, 0.1*t, 0")


def test_a_method_that_breaks_the_symmetry_is_refused_before_a_run():
    class Blown(Sphere):
        """Inflow from the side."""

        def inflow(self, position, time):
            return [1.0, 0.1 * time, 0.0]

    with pytest.raises(ConfigError, match=r"Blown.inflow: the inflow is not symmetric in y = 0"):
        Blown(**QUARTER).build()


def test_a_quarter_of_a_sphere_has_the_drag_of_the_whole(tmp_path):
    whole, quarter = Sphere(**SMALL), Sphere(**SMALL, quarter=True)
    assert 4 * quarter.fluid_volume() == pytest.approx(whole.fluid_volume())
    runs = [case.run(tmp_path / name, until=0.2, progress=False) for name, case in (("w", whole), ("q", quarter))]
    counts = [run.history["fluid"][0] for run in runs]
    assert counts[0] == 4 * counts[1]
    for part in ("total", "pressure", "viscous"):
        drag, of_quarter = (run.coefficient("x", part) for run in runs)
        assert of_quarter == pytest.approx(drag, rel=0.01)  # walls know no profiles of solids beyond the planes
    assert abs(runs[0].coefficient("y")).max() < 1e-9 and abs(runs[0].coefficient("z")).max() < 1e-9
    names = [measure.name for measure in runs[1].measures]
    assert names and all("drag" in name for name in names)


def test_the_drag_of_a_sphere_is_the_momentum_that_it_takes(tmp_path):
    case = Sphere(**SMALL | {"length": 3.0, "height": 2.5, "width": 2.5})
    run = case.run(tmp_path / "run", until=2.0, output_interval=0.05, progress=False)
    boxes = [run.momentum_balance((0.4, -h, -h), (2.5, h, h)) for h in (0.85, 1.0)]
    window = (run.history["time"] >= run.window.start) & (run.history["time"] <= run.window.end)
    drag = run.coefficient("x")[window].mean()
    assert [box[0] for box in boxes] == pytest.approx([drag, drag], rel=0.08)  # D/Δx = 8 and little room
    assert run.summary()["case"] == "sphere"


def test_a_mesh_far_from_the_origin_keeps_its_shape():
    far = Mesh.of(BALL.copy().apply_translation((5e6, 5e5, 0)))
    assert far.surface.volume == pytest.approx(BALL.volume, rel=1e-6)
    distances = [Body3D(shape=mesh)._volume.distance(np.zeros((1, 3)))[0] for mesh in (far, Mesh.of(BALL))]
    assert distances[0] == pytest.approx(distances[1], rel=1e-6)
    near = Mesh.of(BALL.copy().apply_translation((0.3, 0, 0)))
    assert max(len(line) for line in near.triangles.splitlines()) < 3 * 16


def test_a_mesh_that_crosses_itself_is_told():
    spindle = Mesh.of(trimesh.creation.torus(0.15, 0.3))
    assert "pairs of its triangles cross, as near (" in spindle.remark and "may be taken for fluid" in str(spindle)
    assert not Mesh.of(trimesh.creation.torus(0.3, 0.1)).remark and not Mesh.of(BOX).remark


def test_a_mesh_of_one_shell_is_kept_as_it_was_by_older_versions():
    """A run that goes on with one is otherwise one that was changed on its way."""
    assert set(Body3D(shape=BALL).shape.model_dump()) == {"file", "sha256", "triangles"}


def test_a_run_of_a_mesh_needs_no_file_but_its_folder(tmp_path):
    BALL.export(tmp_path / "ball.stl")
    run = Body3D(**SMALL, quarter=True, shape=tmp_path / "ball.stl").run(tmp_path / "run", until=0.05, progress=False)
    (tmp_path / "ball.stl").unlink()
    again = Run(run.path).config.case
    assert again.shape.surface.volume == pytest.approx(BALL.volume, rel=1e-5)
    from alsph import repeat, resume

    steps = len(run.history["time"])
    assert len(resume(run.path, until=0.08, progress=False).history["time"]) > steps
    assert repeat(run.path, progress=False)


def test_a_class_of_ones_own_gives_a_distance():
    class Capsule(Spatial):
        """Flow past a capsule along z."""

        def volume(self):
            def distance(points):
                above = np.maximum(np.abs(points[:, 2]) - 0.25, 0.0)
                return np.sqrt(points[:, 0] ** 2 + points[:, 1] ** 2 + above**2) - 0.5

            from alsph.geometry.volume import Volume

            corner = np.array([0.5, 0.5, 0.75])
            return Volume(distance, -corner, corner, np.pi / 6 + np.pi / 8, np.pi / 4 + 0.5)

    case = Capsule(**SMALL)
    state = case.particles()
    solid, fluid = (state["position"][state["kind"] == kind] - case.centre for kind in (3, 0))
    distance = case.volume().distance
    assert -distance(solid) == pytest.approx(state["depth"][state["kind"] == 3], abs=0.002)
    assert distance(fluid).min() > 0.39 * case.particle_spacing
    assert case.reference_area == pytest.approx(np.pi / 4 + 0.5) and case.blockage == pytest.approx(
        (np.pi / 4 + 0.5) / 4
    )


def test_pictures_show_a_plane(tmp_path):
    run = Sphere(**SMALL).run(tmp_path / "run", until=0.1, progress=False)
    figure = run.plot_field("velocity")
    assert "$z/D$ = 0," in figure.axes[0].get_title() and figure.axes[0].get_ylabel() == "$y/D$"
    figure = run.plot_field("vorticity", plane="x = 2.5")
    assert [figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()] == ["$y/D$", "$z/D$"]
    image = run.plot_field("pressure", plane="y").axes[0].images[0].get_array()
    assert image.shape == (32, 40) and np.isnan(image.astype(float)).mean() < 0.15
    for wrong, words in (
        ("q=1", "an axis, x, y, z, and where"),
        ("z=inf", "an axis"),
        ("", "an axis"),
        ("z=9", "no fluid there"),
    ):
        with pytest.raises(ConfigError, match=words):
            run.plot_field("pressure", plane=wrong)


def test_a_plane_takes_the_vorticity_normal_to_it(tmp_path):
    run = Sphere(**SMALL).run(tmp_path / "run", until=0.1, progress=False)
    snapshot = run.snapshot()
    near = Plane.of("y=0.5", np.zeros(3)).near(snapshot, run.spacing)
    chosen = np.abs(snapshot.position[:, 1] - 0.5) < 2 * run.spacing
    assert near.vorticity.tolist() == snapshot.vorticity[chosen, 1].tolist()
    assert Plane.of(None, np.array([1.0, 2.0, 3.0])) == Plane(2, 3.0)
    assert Plane(1, 0.5).points(np.array([[1.0, 2.0]])).tolist() == [[1.0, 0.5, 2.0]]


def test_pipe_flow_is_the_exact_one():
    """The series solves the equation, and is the paraboloid in the end."""
    case, r, t, step = Pipe(reynolds=10), np.array([0.0, 0.11, 0.3, 0.45]), 0.3, 1e-4
    rate = (case.profile(r, t + step) - case.profile(r, t - step)) / (2 * step)
    u = [case.profile(np.abs(r + move), t) for move in (-step, 0, step)]
    slope = np.divide(u[2] - u[0], 2 * step * r, out=(u[2] - 2 * u[1] + u[0]) / step**2, where=r > 0)
    viscous = ((u[2] - 2 * u[1] + u[0]) / step**2 + slope) / 10
    assert rate == pytest.approx(1.6 + viscous, abs=1e-5)
    assert case.profile(r, 50.0) == pytest.approx(1 - 4 * r**2)
    assert case.profile(r, 0.0) == pytest.approx(0, abs=1e-4)
    assert case.profile(np.array([0.5]), 0.1) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(("resolution", "error"), [(8, 0.012), (12, 0.003)])
def test_a_pipe_from_rest(resolution, error, tmp_path):
    case = Pipe(resolution=resolution)
    assert case.shift_coefficient == 0.25  # as of all cases in 3-D
    run = case.run(tmp_path / "run", until=0.2, progress=False)
    assert run.measures[0].value < error
    (profile,) = run.profiles
    assert profile.computed[0].max() < 0.5 and profile.reference[0][-1] == 0.5
