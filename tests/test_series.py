"""What runs with a free surface record in small CSV files: levels, front and sensors."""

import re
from dataclasses import fields
from functools import partial

import alsph
import numpy as np
import pytest
from alsph import Domain, cases, reference
from alsph.analysis import sampling
from alsph.analysis.sampling import pressure_on_walls
from alsph.cases.dam_break import SENSORS, WINDOWS, Front, impulse_name
from alsph.cases.free_surface import Levels, Sensors
from alsph.cases.sensors import WallSensors, _fitted
from alsph.cases.series import Series
from alsph.config import Config, RunSettings
from alsph.errors import ConfigError, RunFolderError
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import Snapshot

SPACING = 0.05
TANK = Domain([0, 0], [2, 3], [("slip", "slip"), ("slip", "air")])
DOWN = np.array([0.0, -1.0])


class Count(Series):
    """How often it was asked."""

    file = "output_count.csv"
    interval = 1.0

    def values(self, simulation):
        return np.array([simulation.time, 2.0])


class At:
    """What a series asks of a simulation."""

    def __init__(self, time):
        self.time = time


class Record:
    """What a series asks of a run."""

    def __init__(self, path):
        self.file = path.joinpath


def recorded(path, times):
    series = Count(["time [s]", "time again [s]", "two [-]"])
    for time in times:
        series.record(At(time), {})
        series.append(path)


def test_a_series_names_its_columns_once_and_is_read(tmp_path):
    path = tmp_path / Count.file
    recorded(path, [0.5, 1.0])
    recorded(path, [1.5])
    assert path.read_text() == "time [s],time again [s],two [-]\n0.5,0.5,2\n1,1,2\n1.5,1.5,2\n"
    times, values = Count.read(Record(tmp_path))
    assert times.tolist() == [0.5, 1, 1.5] and values.tolist() == [[0.5, 1, 1.5], [2, 2, 2]]


@pytest.mark.parametrize("head", ["time [s],time again [s],two [-]\n", ""])
def test_a_series_is_cut_with_its_run_and_one_of_an_older_version_too(tmp_path, head):
    path = tmp_path / Count.file
    path.write_text(head + "0.5,0.5,2\n1,1,2\n1.5,1.5,2\n1.7,1.")
    assert Count.read(Record(tmp_path))[0].tolist() == [0.5, 1, 1.5]
    Count([]).truncate(path, 1.0)
    assert path.read_text() == head + "0.5,0.5,2\n1,1,2\n"
    assert [each.name for each in tmp_path.iterdir()] == [Count.file]
    recorded(path, [2.0])
    assert path.read_text() == head + "0.5,0.5,2\n1,1,2\n2,2,2\n"


def test_a_series_has_a_number_for_each_column_and_a_name_for_each_number(tmp_path):
    with pytest.raises(ConfigError, match="output output_count.csv: two columns are called 'p'"):
        Count(["time [s]", "p", "p"])
    for names, told in ((["a"], "2 numbers for 1 columns"), (["a", "b", "c"], "2 numbers for 3 columns")):
        with pytest.raises(ConfigError, match=told):
            Count(["time [s]", *names]).record(At(1.0), {})


def test_gauges_that_were_moved_do_not_go_on_in_the_file_of_the_former_ones(tmp_path):
    """In another order, too: their depths would change places."""
    tank = cases.DamBreak(resolution=8)
    run = tank.run(tmp_path / "run", until=0.2, gauges=[[0.2], [0.8]], gauge_interval=0.1, progress=False)
    assert run.gauges.depth.shape == (2, 2)
    text = (run.path / "case.toml").read_text()
    for moved in ("[0.8], [0.2]", "[0.2], [0.5]", "[0.2]"):
        (run.path / "case.toml").write_text(
            re.sub(r"gauges = \[.*?\]\n\]|gauges = .*", f"gauges = [{moved}]", text, flags=re.S, count=1)
        )
        with pytest.raises(RunFolderError, match="gauges.csv: holds depth at x = 0.2"):
            _ = alsph.open_run(run.path).gauges
    with pytest.warns(RuntimeWarning, match="gauges.csv holds .*at other places and is set aside as gauges.former.csv"):
        later = alsph.resume(run.path, until=0.4, progress=False)
    assert later.gauges.position.tolist() == [[0.2]] and later.gauges.time.min() > 0.2


@pytest.mark.parametrize("torn", ["time [s],ti", "", None])
def test_a_series_of_nothing(tmp_path, torn):
    """With a head that was cut, which is written anew."""
    path = tmp_path / Count.file
    if torn is not None:
        path.write_text(torn)
        assert Count.read(Record(tmp_path))[1].shape == (1, 0)
        Count([]).truncate(path, 1.0)
    assert Count.read(Record(tmp_path))[0].shape == (0,)
    recorded(path, [2.0])
    assert path.read_text() == "time [s],time again [s],two [-]\n2,2,2\n"


def test_depths_in_space_are_those_of_a_lattice():
    case = cases.DamBreak(resolution=12, dimensions=3, width=0.5)
    position = case.particles()["position"]
    spacing = case.particle_spacing
    gauges = [[0.0, 0.0], [0.3, 0.2], [0.9, 0.5], [1.0, 0.25]]
    levels = Levels(gauges, case.domain(), spacing)
    assert levels.depth(position) == pytest.approx(1, rel=1e-12)
    assert levels.columns[1:3] == ["depth at x = 0 H; y = 0 H [H]", "depth at x = 0.3 H; y = 0.2 H [H]"]
    upper = position[:, 1] > 0.25
    half = Levels([[0.9, 0.0], [0.9, 0.5], [0.9, 0.25]], case.domain(), spacing)
    across = position[~upper | (position[:, 2] < 0.5)]  # half as deep along the one side
    assert across.shape != position.shape
    low, high, middle = half.depth(across)
    assert high == pytest.approx(0.5, abs=0.1) and low == pytest.approx(1, abs=0.1) and high < middle < low


@pytest.mark.parametrize(("gauges", "dimensions"), [([0.1], 3), ([[0.1, 0.2]], 2)])
def test_gauges_of_another_number_of_directions_are_refused(gauges, dimensions):
    def tank(dimensions):
        return Domain([0] * dimensions, [2] * dimensions, [("slip", "slip")] * dimensions)

    with pytest.raises(ConfigError, match="along x and y"):
        Levels(gauges, tank(dimensions), 0.1)
    levels = Levels([0.1], tank(2), 0.1)
    with pytest.raises(ConfigError, match="tank in 2-D"):
        levels.depth(np.zeros((4, 3)))


def water(depth=0.6, shift=0.0, seed=0):
    """Particles of water in the corner at the right of the tank, disturbed by shares of Δx."""
    cells = lattice(cell_centres(16, SPACING), cell_centres(round(depth / SPACING), SPACING))
    cells[:, 0] = 2 - cells[:, 0]
    return cells + np.random.default_rng(seed).uniform(-shift, shift, cells.shape) * SPACING


@pytest.mark.parametrize("shift", [0, 0.2])
def test_pressure_on_walls_is_exact_for_what_is_quadratic_and_has_no_slope_across_them(shift):
    def field(r):
        return 2 - r[:, 1] - 3 * (r[:, 0] - 2) ** 2 - 2 * r[:, 1] ** 2

    position, points = water(shift=shift), np.array([[2, 0.0], [2, 0.01], [2, 0.3], [1.6, 0], [1.99, 0.1]])
    found = pressure_on_walls(position, field(position), points, SPACING, TANK, DOWN)
    assert found == pytest.approx(field(points), abs=1e-10)


def test_pressure_on_walls_of_spray_is_none_beyond_it_and_makes_little_of_little():
    """Of two particles that differ by 2 no more than a quarter of that beyond them."""
    drop = np.array([[1.98, 0.5], [1.98, 0.53]])
    points = np.array([[2, 0.46], [2, 0.515], [2, 0.54], [2, 0.56], [2, 0.6], [2, 0.7], [0, 0.5]])
    found = pressure_on_walls(drop, np.array([1.0, 3.0]), points, SPACING, TANK, np.zeros(2))
    assert (found[:5] > 0.5).all() and (found[:5] < 3.5).all() and np.isnan(found[5:]).all()


@pytest.mark.parametrize(("height", "felt"), [(0.1, 0.5), (0.55, 0.05), (0.6, 0.0), (0.9, 0.0)])
def test_a_sensor_feels_water_where_it_is_wet_and_air_where_it_is_dry(height, felt):
    """At the surface half of it, and nothing below the pressure of the air."""
    case = cases.StillWater(resolution=20, length=2)
    simulation = case.simulation(threads=1)
    state = simulation.state()
    kept = state["position"][:, 1] < 0.6
    position = state["position"][kept]
    arrays = {name: value[kept] for name, value in state.items() if np.shape(value)[:1] == kept.shape}
    simulation.restore(state | arrays | {"pressure": np.maximum(0.6 - position[:, 1], 0)})
    heights = height + np.linspace(-0.02, 0.02, 5)
    sensors = Sensors({"one": np.stack([np.full(5, 2.0), heights], axis=1)}, SPACING)
    (found,) = sensors.values(simulation)
    assert found == pytest.approx(np.maximum(0.6 - heights, 0).mean(), abs=1e-9) == pytest.approx(felt, abs=0.007)


def test_a_sensor_in_a_tank_that_sways_feels_what_pushes_the_water():
    """A pressure that balances gravity and the sway, also at the wall, where it has a slope."""
    case = cases.Sloshing(resolution=20, amplitude=0.5)
    simulation = case.simulation(threads=1)
    state, push = simulation.state(), np.array(case.forcing(None, 0.0))
    position = state["position"]
    simulation.restore(state | {"pressure": 3 + position @ (push - [0, 1])})
    at = np.array([[0.0, 0.3], [0.0, 0.32]])
    (found,) = Sensors({"one": at}, SPACING).values(simulation)
    assert abs(push[0]) > 0.5 and found == pytest.approx(3 - 0.31, abs=1e-9)


@pytest.mark.parametrize("resolution", [14, 20, 33])
@pytest.mark.parametrize("made", [cases.DamBreakObstacle, cases.RollingTank, partial(cases.DamBreak, walls="solid")])
def test_sensors_in_walls_of_solids_fit_what_these_show(made, resolution):
    """A pressure that is linear along the wall, at all heights and with however many spacings below an edge."""
    case = made(resolution=resolution)
    simulation, (*_, sensors) = case.simulation(threads=1), case.outputs()
    assert isinstance(sensors, WallSensors)
    state = simulation.state()
    slope = np.array([0, 0.7, 0.4])[: case.space_dimensions]
    simulation.restore(state | {"pressure": 3 - state["position"] @ slope})
    exact = [np.average(3 - points @ slope, weights=weights) for points, weights, _ in sensors.sensors]
    assert sensors.values(simulation) == pytest.approx(exact, abs=1e-9)
    simulation.restore(state | {"pressure": 0 * state["pressure"]})
    assert (sensors.values(simulation) == 0).all()


@pytest.mark.parametrize(
    ("begun", "row"), [("time [s],two [-]\n1,2\n", "3,2"), ("time [s],old [-],two [-]\n", "3,nan,2"), ("1,1\n", "3,3")]
)
def test_a_series_that_an_older_version_began_goes_on_with_its_columns(tmp_path, begun, row):
    """Where columns were added, taken away or not named."""
    path = tmp_path / Count.file
    path.write_text(begun)
    recorded(path, [3.0])
    assert path.read_text() == f"{begun}{row}\n"
    assert Count.read(Record(tmp_path))[0][-1] == 3.0


WATERS = [model for model in cases.CASES.values() if issubclass(model, cases.FreeSurface)]


@pytest.mark.parametrize("model", WATERS, ids=lambda model: model.name)
def test_gauges_of_each_case_tell_the_volume_of_its_water(model):
    """The integral of the depth over the floor, and at the sides as much as half a column off them."""
    case = model(resolution=10)
    if not case.has_depth:
        with pytest.raises(ConfigError, match="no gauges"):
            _ = Config(case, RunSettings(gauges="0.5" if case.space_dimensions == 2 else "0.5,0.5")).gauges
        return
    state, domain, spacing = case.particles(), case.checked_domain, case.particle_spacing
    water = state["position"][state["kind"] == 0]
    axes = [
        np.linspace(low, high, round(2 * (high - low) / spacing) + 1)
        for low, high in zip(domain.lower[:-1], domain.upper[:-1], strict=True)
    ]
    depth = Levels(lattice(*axes) if len(axes) > 1 else axes[0], domain, spacing).depth(water)
    depth = depth.reshape([*map(len, axes)])
    for axis in reversed(axes):
        depth = np.trapezoid(depth, axis, axis=-1)
    assert depth == pytest.approx(len(water) * spacing**case.space_dimensions, rel=1e-3)


def test_a_sensor_above_a_single_row_feels_that_row():
    found = _fitted(np.array([[0, -1.9], [1, -1.9]]), np.array([1.0, 2.0]))
    assert found == pytest.approx(1.0) and _fitted(np.array([[0.5, 0], [1.0, 0]]), np.array([1.0, 3.0])) == 0


def test_discs_are_of_their_size():
    """The mean over one is that over a disc: of y² about its middle d²/16."""
    for case in (cases.DamBreak(resolution=40), cases.DamBreak(resolution=80, dimensions=3)):
        points = case.disc(0.3, 0.15)
        up = points[:, -1] - 0.3
        assert points.shape[1] == case.dimensions and (points[:, 0] == case.tank_length).all()
        assert np.mean(up**2) == pytest.approx(0.15**2 / 16, rel=0.05) and abs(up.mean()) < 1e-12
        spaced = np.diff(np.unique(np.round(up, 9)))
        assert spaced.max() <= case.particle_spacing / 2 + 1e-9
    assert np.allclose(points[:, 1].mean(), 0.25) and points[:, 1].max() < 0.325


@pytest.fixture(scope="module")
def broken(tmp_path_factory):
    """A dam break past its fall back, and the same cut and gone on with."""
    path, case = tmp_path_factory.mktemp("runs"), cases.DamBreak(resolution=10)
    case.run(path / "cut", until=1.0, progress=False)
    alsph.resume(path / "cut", until=7.05, progress=False)
    return case.run(path / "whole", until=7.05, progress=False)


def test_front_and_sensors_of_a_run_that_is_cut_are_those_of_a_whole_one(broken):
    for file in (Front.file, Sensors.file):
        texts = [(broken.path.with_name(name) / file).read_text() for name in ("whole", "cut")]
        assert texts[0] == texts[1]
    head, first, *_ = texts[0].splitlines()
    assert head == "time [√(H/g)],P1 [ρgH],P3 [ρgH],P4 [ρgH],Buchner's disc [ρgH]"
    assert len(first.split(",")) == 5


def test_the_front_is_recorded_finely_and_judged_at_its_times(broken):
    time, front = Front.read(broken)
    assert len(time) > 200 and np.diff(time).max() < 0.05 and len(broken.times) == 9
    measures = {measure.name: measure for measure in broken.measures}
    assert measures["front at t = 1, H"].value == pytest.approx(np.interp(1, time, front[0]))
    assert broken.profiles[0].computed[0] == pytest.approx(time)
    assert (np.diff(front[0]) > -0.05).all() and front[0].max() == broken.config.case.tank_length


def test_impulses_stand_beside_those_of_the_experiments(broken):
    time, pressure = Sensors.read(broken)
    assert (pressure >= 0).all() and not pressure[:, time < 2].any() and pressure[:, time > 4].any(axis=1).all()
    measures = {measure.name: measure for measure in broken.measures}
    for (name, sensor), own in zip(SENSORS.items(), pressure, strict=True):
        for window in WINDOWS:
            measure = measures[impulse_name(name, window)]
            inside = (time >= window[0]) & (time <= window[1])
            mean = np.average(own[inside], weights=np.gradient(time[inside]))
            assert measure.value == pytest.approx(mean * (window[1] - window[0]), rel=0.05)
            assert (measure.tolerance, measure.source) == (0.15, sensor.source)
    known = [measures[impulse_name("P1", window)].reference for window in WINDOWS]
    assert known == pytest.approx([1.28, 1.19, 1.10], abs=0.005)
    assert [profile.name for profile in broken.profiles[1:]] == [f"pressure at {name}" for name in SENSORS]


def test_the_weight_of_the_water_at_last_is_felt_by_the_sensors(broken):
    """At rest the pressure at the lowest sensor is the depth above it; it is still sloshing, so in the mean."""
    time, pressure = Sensors.read(broken)
    late = time > 3.5
    assert pressure[0, late].mean() > pressure[1, late].mean() > pressure[2, late].mean() > 0


def test_curves_of_the_experiments_run_forward_in_time():
    for sensor in SENSORS.values():
        time, pressure = sensor.measured()
        assert (np.diff(time) >= 0).all() and time[0] < 0.3 and time[-1] > WINDOWS[-1][1] - 0.1
        assert len(pressure) == len(reference.table(f"dam_break_pressure_{sensor.curve}.csv")[0])


def test_a_sensor_that_the_water_has_not_met_is_not_drawn(tmp_path):
    run = cases.DamBreak(resolution=8).run(tmp_path / "run", until=0.2, progress=False)
    assert [profile.name for profile in run.profiles] == ["front"] and Sensors.read(run)[1].shape[0] == 4


def compared(run):
    """The measures that have a reference."""
    return [measure for measure in run.measures if not np.isnan(measure.reference)]


def test_other_columns_and_tanks_have_no_experiment(tmp_path):
    run = cases.DamBreak(resolution=8, length=1.25, tank_length=2.5).run(tmp_path / "run", until=4.0, progress=False)
    assert [measure.name for measure in compared(run)] == ["largest rise of the energy over its start"]
    assert all(not profile.reference[0].size for profile in run.profiles) and len(run.profiles) == 5


def test_a_front_is_compared_before_it_meets_the_wall(tmp_path):
    run = cases.DamBreak(resolution=8, length=1.0, tank_length=2.0).run(tmp_path / "run", until=2.5, progress=False)
    assert [each.name[:24] for each in compared(run)] == ["front at t = 1 beside Ma", "largest rise of the ener"]
    (measured,) = (each.reference for each in run.profiles if each.name == "front, Martin and Moyce (1952)")
    assert measured[1].max() < 2.0
    at_wall = cases.DamBreak(resolution=20, length=0.5, tank_length=2.475).run(
        tmp_path / "w", until=2.1, progress=False
    )
    assert not any(each.name.startswith("front at t = 2") for each in at_wall.measures)
    narrow = cases.DamBreak(resolution=8, length=1.0, tank_length=1.05).run(tmp_path / "b", until=0.1, progress=False)
    assert len(compared(narrow)) == 1 and len(narrow.profiles) >= 2


def test_probes_at_walls_do_not_read_below_the_air(tmp_path):
    """Where the pressure grows away from a wall, and the fit goes on below zero in the half spacing before it."""
    case = cases.StillWater(resolution=12)
    simulation = case.simulation(threads=1)
    state = simulation.state()
    steep = 10 * (state["position"][:, 0] - case.particle_spacing / 2)
    simulation.restore(state | {"pressure": np.maximum(steep, 0)})
    at = np.array([[0, 0.5], [0.02, 0.5], [0.5, 0.5], [9, 9]])
    found = simulation.sample(at)["pressure"]
    assert found[:2].tolist() == [0, 0] and found[2] == pytest.approx(4.58, abs=0.01) and np.isnan(found[3])
    arrays = simulation.snapshot()
    snapshot = Snapshot(**{each.name: arrays[each.name] for each in fields(Snapshot) if each.name in arrays})
    sampled = sampling.at(snapshot, at[:3], case.particle_spacing, case.checked_domain)["pressure"]
    assert sampled[:2].tolist() == [0, 0] and sampled[2] == pytest.approx(4.58, abs=0.01)


def test_a_fluid_in_tension_reads_below_the_air(tmp_path):
    run = cases.RotatingPatch(resolution=12).run(tmp_path / "patch", until=0.2, probes="0,0", progress=False)
    assert run.probes.pressure.max() < -0.05 and run.sample([[0, 0]])["pressure"] < -0.05


def test_a_folder_that_is_replaced_keeps_no_old_figure_of_water(alsph, tmp_path):
    run = tmp_path / "run"
    assert alsph("run", "dam_break", "--resolution=8", "--until=0.1", "-o", run)[0] == 0
    assert f"{run / 'figures' / 'front.png'}" in alsph("plot", run)[1]
    (run / "figures" / "pressure_at_buchner_s_disc.png").touch()
    assert alsph("run", "still_water", "--resolution=8", "--until=0.1", "--force", "-o", run)[0] == 0
    assert not (run / "figures").exists() and not [*run.glob("output_*")]


def test_a_probe_outside_is_refused_in_the_names_of_the_case():
    with pytest.raises(ConfigError, match=r"lies outside of the domain, .* \[H\]"):
        _ = Config(cases.StillWater(), RunSettings(probes="5,5")).probes


def test_a_width_without_a_third_dimension_is_refused(alsph):
    with pytest.raises(ConfigError, match="width = 0.4: of a tank in 3-D; give dimensions = 3, too"):
        cases.DamBreak(width=0.4)
    assert cases.DamBreak(width=0.5) == cases.DamBreak()
    assert cases.DamBreak(width=0.4, dimensions=3, resolution=10).width == 0.4
    code, _, complaint = alsph("run", "dam_break", "--width", "0.4")
    assert code == 2 and "width = 0.4: of a tank in 3-D" in complaint


def test_gauges_of_a_run_tell_what_its_snapshots_have(tmp_path):
    """In 2-D and 3-D, a run that was cut included; the mean of a whole line of them is the volume over the length."""
    sizes = {"2": ("0:2:41", 0.5), "3": ("0.5,0.2; 1.5,0.1", 0.3)}
    for dimensions, (gauges, until) in sizes.items():
        case = cases.DamBreak(resolution=10, tank_length=2.0, length=1.0, dimensions=int(dimensions))
        settings = {"gauges": gauges, "gauge_interval": 0.1, "output_interval": 0.1, "progress": False}
        whole = case.run(tmp_path / dimensions, until=until, **settings)
        case.run(tmp_path / f"{dimensions}_cut", until=0.2, **settings)
        cut = alsph.resume(tmp_path / f"{dimensions}_cut", until=until, progress=False)
        assert (whole.path / "gauges.csv").read_text() == (cut.path / "gauges.csv").read_text()
        found = whole.gauges
        assert found.depth.shape == (len(found.time), len(found.position)) and len(found.time) > 2
        last = whole.snapshot().position
        assert found.time[-1] == pytest.approx(whole.times[-1])
        levels = Levels(found.position, case.domain(), case.particle_spacing)
        assert found.depth[-1] == pytest.approx(levels.depth(last), abs=1e-6)  # snapshots are in single precision
        if dimensions == "2":
            assert np.trapezoid(found.depth, found.position[:, 0], axis=1) == pytest.approx(1.0, rel=2e-3)
        axes = whole.plot_gauges().axes[0]
        assert len(axes.lines) == min(10, len(found.position)) and axes.get_xlabel() == r"$t\sqrt{g/H}$"
        assert axes.lines[-1].get_ydata() == pytest.approx(found.depth[:, -1])
    text = (tmp_path / "3" / "gauges.csv").read_text()
    assert text.splitlines()[0].endswith("depth at x = 1.5 H; y = 0.1 H [H]")


def test_gauges_beside_the_topmost_row_of_a_wave(tmp_path):
    case = cases.StandingWave(resolution=20)
    run = case.run(tmp_path / "wave", until=0.3, gauges="0:1:5", progress=False)
    position, spacing = run.snapshot().position, case.particle_spacing
    for place, depth in zip(run.gauges.position[:, 0], run.gauges.depth[-1], strict=True):
        near = np.abs(position[:, 0] - place) < 0.8 * spacing
        assert depth == pytest.approx(position[near, 1].max() + spacing / 2, abs=0.25 * spacing)


@pytest.mark.parametrize(
    ("case", "gauges", "message"),
    [
        (cases.Cylinder(), "1", "cylinder takes no gauges"),
        (cases.EllipticalDrop(), [0.5], "takes no gauges"),
        (cases.DamBreak(), "0:1:1", "'0:1:1' is no line, which is X:X:COUNT .* COUNT from 2 to 10000"),
        (cases.DamBreak(dimensions=3), "0:1:1", "must be two finite numbers"),
        (cases.DamBreak(), "0.5,1", "must be a finite number, x"),
        (cases.DamBreak(), "6", r"\[6.0\] lies outside of the domain, \[0.0\] to \[5.366\] \[H\]"),
        (cases.DamBreak(dimensions=3), "1", "must be two finite numbers"),
        (cases.DamBreak(), "0:1", "run.gauges: '0:1' is no line"),
        (cases.DamBreak(), "0; 0:5.366:60", "run.gauges = '0; 0:5.366:60': 0 is there twice"),
    ],
)
def test_gauges_that_cannot_be_are_refused(case, gauges, message):
    with pytest.raises(ConfigError, match=message):
        _ = Config(case, RunSettings(gauges=gauges)).gauges
