"""Q and lambda_2: exact on linear fields, on grids, particles, in pictures; streamlines; what is refused."""

import numpy as np
import pytest
from alsph import plotting
from alsph.analysis.vortices import lambda_2, q_criterion, vorticity
from alsph.cases import Cylinder, TaylorGreen
from alsph.errors import ConfigError
from synthetic import write_flow

SPIN = np.array([0.3, -0.2, 0.5])
ROTATION = np.cross(np.eye(3), SPIN)  # of u = SPIN x r, du_k/dx_l at [k, l]
STRAIN = np.diag([0.7, -0.3, -0.4])
BOX = {"lower": (0.3, 0.35, 0.4), "upper": (0.7, 0.65, 0.6)}


def test_solid_rotation_and_pure_strain():
    """Of a rotation ω: Q = |ω|², S² + Ω² has the eigenvalues 0, -|ω|², -|ω|²; of a strain: Q = -½‖S‖²."""
    both = np.array([ROTATION, STRAIN])
    assert vorticity(both) == pytest.approx(np.array([2 * SPIN, 0 * SPIN]))
    assert q_criterion(both) == pytest.approx([SPIN @ SPIN, -0.5 * (0.49 + 0.09 + 0.16)])
    assert lambda_2(both) == pytest.approx([-SPIN @ SPIN, 0.16])


def test_a_shear_is_no_vortex_and_turning_axes_change_nothing():
    shear = np.zeros((1, 3, 3))
    shear[0, 0, 1] = 3.0
    assert q_criterion(shear) == pytest.approx(0) and lambda_2(shear) == pytest.approx(0, abs=1e-12)
    rng = np.random.default_rng(3)
    gradient = rng.standard_normal((50, 3, 3))
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    for measure in (q_criterion, lambda_2):
        assert measure(turn @ gradient @ turn.T) == pytest.approx(measure(gradient))
    gradient -= np.trace(gradient, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    assert q_criterion(gradient) == pytest.approx(-0.5 * np.trace(gradient @ gradient, axis1=1, axis2=2))


def test_in_the_plane_one_is_the_other_with_the_sign_changed():
    gradient = np.random.default_rng(4).standard_normal((50, 2, 2))
    gradient[:, 1, 1] = -gradient[:, 0, 0]
    assert q_criterion(gradient) == pytest.approx(np.linalg.det(gradient))
    assert lambda_2(gradient) == pytest.approx(-np.linalg.det(gradient))
    gradient[7] = np.nan
    assert (
        np.isnan(lambda_2(gradient)).tolist() == np.isnan(q_criterion(gradient)).tolist() == [k == 7 for k in range(50)]
    )


@pytest.fixture(scope="module")
def linear(tmp_path_factory):
    """A flow in 3-D that turns and is strained."""
    case = TaylorGreen(dimensions=3, resolution=8)
    velocity = lambda x, t: x @ (ROTATION + STRAIN).T  # noqa: E731
    return write_flow(tmp_path_factory.mktemp("runs") / "run", case, velocity, (0.0, 1.0))


def test_grids_have_them_where_asked(linear, alsph, tmp_path):
    grid = linear.to_grid(spacing=0.05, derived=["q_criterion", "lambda_2"], **BOX)
    exact = (ROTATION + STRAIN)[None]
    assert grid.fields["q_criterion"].shape == (8, 6, 4)
    assert grid.fields["q_criterion"] == pytest.approx(q_criterion(exact)[0], abs=1e-4)
    assert grid.fields["lambda_2"] == pytest.approx(lambda_2(exact)[0], abs=1e-4)
    assert "q_criterion" not in linear.to_grid(spacing=0.2).fields
    found = linear.to_xarray(spacing=0.05, derived=["lambda_2"], **BOX)
    assert found.lambda_2.attrs == {"long_name": "lambda 2", "units": "U^2/D^2"} and found.lambda_2.shape == (4, 6, 8)
    assert found.vorticity_x.attrs["long_name"] == "vorticity along x"
    path = tmp_path / "flow.csv"
    code, _, _ = alsph("export", linear.path, "--field", "q_criterion", "--spacing", 0.25, "--output", path)
    assert code == 0 and path.read_text().splitlines()[0].endswith("vorticity_z,q_criterion")
    code, _, err = alsph("export", linear.path, "--field", "q", "--output", tmp_path / "other.csv")
    assert code == 2 and "field = 'q': unknown; " in err and not (tmp_path / "other.csv").exists()


def test_particles_have_them_where_asked(linear):
    pytest.importorskip("pyvista")
    cloud = linear.to_pyvista(derived=["q_criterion"])
    inside = np.all(np.abs(cloud.points - 0.5) < 0.1, axis=1)  # the flow is not periodic, as its domain is
    assert cloud["q_criterion"][inside] == pytest.approx(q_criterion((ROTATION + STRAIN)[None])[0], abs=1e-4)
    assert "q_criterion" not in linear.to_pyvista().point_data
    with pytest.raises(ConfigError, match="field = 'lambda': unknown; did you mean 'lambda_2'"):
        linear.to_pyvista(derived=["lambda"])


def vortices(x, t):
    x, y, z = 2 * np.pi * x.T
    return np.stack([np.sin(x) * np.cos(y) * np.cos(z), -np.cos(x) * np.sin(y) * np.cos(z), 0 * x], axis=1)


def test_pictures_of_them_are_periodic_where_the_flow_is(tmp_path):
    """Every half period the same, at the sides of the box as within."""
    run = write_flow(tmp_path / "run", TaylorGreen(dimensions=3, resolution=16), vortices, (0.0, 1.0))
    picture = run.plot_field("q_criterion", plane="z=0.03125").axes[0].images[0].get_array()
    rows, columns = picture.shape
    moved = np.roll(picture, (rows // 2, columns // 2), axis=(0, 1))
    assert np.abs(moved - picture)[2:-2, 2:-2].max() < 0.1 * np.abs(picture).max()
    other = run.plot_field("lambda_2", plane="z=0.03125").axes[0].images[0].get_array()
    assert np.corrcoef(picture.ravel(), other.ravel())[0, 1] < -0.5


@pytest.fixture(scope="module")
def past(tmp_path_factory):
    """A flow round and round past a cylinder."""
    case = Cylinder(resolution=10, length=6, height=4, upstream=3)
    turning = lambda x, t: (x - [3, 0])[:, ::-1] * [-1, 1]  # noqa: E731
    return write_flow(tmp_path_factory.mktemp("runs") / "run", case, turning, (0.0, 1.0))


def streamlines(figure):
    lines = [each for each in figure.axes[0].collections if type(each).__name__ == "LineCollection"]
    return np.concatenate([line.vertices for each in lines for line in each.get_paths()] or [np.empty((0, 2))])


def test_streamlines_go_along_the_flow_and_round_bodies(past):
    figure = past.plot_field("velocity", streamlines=True)
    points = streamlines(figure)
    radius = np.hypot(*(points - [3, 0]).T)
    assert len(points) > 500 and radius.min() > 0.4
    assert figure.axes[0].get_xlim() == pytest.approx((0, 6)) and figure.axes[0].get_ylim() == pytest.approx((-2, 2))
    paths = [path.vertices for path in figure.axes[0].collections[-1].get_paths()]
    longest = max(paths, key=lambda path: np.ptp(path))
    assert np.ptp(np.hypot(*(longest - [3, 0]).T)) < 0.05  # circles
    assert not len(streamlines(past.plot_field("velocity")))


def test_streamlines_in_space_are_those_along_the_plane(linear):
    flow = linear.plot_field("pressure", plane="y=0.5", streamlines=True, view=(0.2, 0.8, 0.2, 0.8))
    points = streamlines(flow)
    assert len(points) > 100 and points.min() > 0.2 and points.max() < 0.8


def test_streamlines_where_there_is_no_flow(past, tmp_path):
    figure = past.plot_field("velocity", streamlines=True, view=(2.9, 3.1, -0.1, 0.1), path=tmp_path / "picture.png")
    assert not len(streamlines(figure)) and (tmp_path / "picture.png").exists()
    still = write_flow(tmp_path / "still", TaylorGreen(resolution=8), lambda x, t: 0 * x, (0.0, 1.0))
    assert len(still.plot_field("velocity", streamlines=True).axes) == 2


def test_the_command_draws_them(past, alsph, tmp_path):
    options = "--field", "velocity", "--field", "q_criterion", "--streamlines", "--output", tmp_path
    code, out, _ = alsph("plot", past.path, *options)
    assert code == 0 and {"velocity.png", "q_criterion.png"} <= {path.name for path in tmp_path.iterdir()}
    code, _, err = alsph("plot", past.path, "--field", "q")
    assert code == 2 and "unknown field 'q'" in err and {"q_criterion", "lambda_2"} < set(plotting.FIELDS)
