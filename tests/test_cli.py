import subprocess
import sys

import pytest
from alsph import Units, config, open_run, plotting
from alsph.cases import CASES
from alsph.cli import app, options, runs
from alsph.cli.app import COMMANDS
from alsph.results import export

COMMAND = [sys.executable, "-c", "from alsph.cli import main; main()"]


def test_end_to_end(alsph, tmp_path, small_options):
    run = tmp_path / "run"
    options = ["--reynolds", 150, "--max-iterations=2", "--threads=2", "--until=0.2", "--output-interval=0.1"]
    code, stdout, _ = alsph("run", "cylinder", *small_options, *options, "-o", run)
    assert code == 0
    assert "mean drag coefficient" in stdout
    resolved = config.load(run / "case.toml")
    assert (resolved.case.reynolds, resolved.case.max_iterations, resolved.run.threads) == (150, 2, 2)
    assert open_run(run).history["iterations"].max() == 2

    code, stdout, _ = alsph("info", run)
    assert code == 0
    assert "finished" in stdout

    code, stdout, _ = alsph("plot", run, "--time", 0.1)
    assert code == 0
    for name in ("forces", "spectrum", "pressure_coefficient", "ledger", "vorticity", "pressure"):
        assert str(run / "figures" / f"{name}.png") in stdout
        assert (run / "figures" / f"{name}.png").stat().st_size > 1000

    code, stdout, _ = alsph("animate", run, "--field", "pressure", "--fps", 5)
    assert (code, stdout) == (0, f"{run / 'figures' / 'pressure.gif'}\n")
    code, _, stderr = alsph("animate", run, "--start", 0.15)
    assert code == 2 and "a film needs two snapshots or more, and there are 1 between start and end" in stderr

    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "run.json").write_text("{")
    code, stdout, _ = alsph("runs", tmp_path)
    assert code == 0 and [line.split("|")[1].strip() for line in stdout.splitlines()[2:]] == ["bad", "run"]
    assert "case.toml is missing" in stdout and "| cylinder | 150 | 8    | finished" in stdout
    code, _, stderr = alsph("runs", run / "figures")
    assert code == 2 and "holds no run folder" in stderr

    assert alsph("plot", run, "-o", tmp_path / "elsewhere" / "figures")[0] == 0
    assert (tmp_path / "elsewhere" / "figures" / "forces.png").exists()
    code, stdout, stderr = alsph("plot", run, "--field", "vortcity")
    assert (code, stdout, "did you mean 'vorticity'?" in stderr) == (2, "", True)
    code, _, stderr = alsph("plot", run, "-o", run / "case.toml")
    assert (code, stderr.startswith("error: "), "Traceback" in stderr) == (2, True, False)

    code, _, stderr = alsph("run", "cylinder", *small_options, "-o", run)
    assert (code, "exists already" in stderr) == (2, True)
    assert alsph("resume", run, "--until", 0.25)[0] == 0
    assert open_run(run).history["time"][-1] >= 0.25
    assert alsph("run", "cylinder", *small_options, "--until=0.02", "--force", "-o", run)[0] == 0
    assert open_run(run).history["time"][-1] < 0.04


LIBRARIES = ("numpy", "pydantic", "shapely", "h5py", "rich", "filelock", "scipy", "matplotlib")


@pytest.mark.parametrize(
    ("program", "loaded"),
    [
        ("import alsph, alsph.cli", ()),
        ("import alsph.cli.runs, alsph.cli.studies", LIBRARIES[:2]),
        ("import alsph.cli.of_cases", LIBRARIES[:3]),
    ],
)
def test_what_is_not_used_is_not_loaded(program, loaded):
    """Half a second and more, which help, a completion or a mistyped option must not take."""
    program += f"; import sys; print([name for name in {LIBRARIES} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(list(loaded))


@pytest.mark.parametrize(
    ("line", "completed"),
    [
        ("alsph ru", ["run", "runs"]),
        ("alsph run cyl", ["cylinder", "cylinder_pair"]),
        ("alsph run cylinder --scheme ", ["alsph", "isph", "explicit_isph", "wcsph", "edac", "shadloo", "sisph"]),
        ("alsph run cylinder --algorithm m", ["midpoint"]),
        ("alsph run dam_break --sm", ["--smoothing-ratio"]),
        ("alsph plot runs/a --field v", ["vorticity", "velocity", "velocity_divergence"]),
        ("alsph plot runs/a --format p", ["png", "pdf"]),
        ("alsph export runs/a --to ", ["vtkhdf", "vti", "netcdf", "csv"]),
        ("alsph study run rey", ["reynolds"]),
        ("alsph validate cav", []),
        ("alsph validate --full cav", ["cavity"]),
        ("alsph info ru", []),  # a path, which the shell completes
    ],
)
def test_shells_complete(monkeypatch, capsys, line, completed):
    monkeypatch.setenv("_ALSPH_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
    with pytest.raises(SystemExit):
        app(prog_name="alsph")
    assert capsys.readouterr().out.split() == completed


def test_choices_are_those_that_there_are():
    assert (*plotting.FIELDS,) == runs.FIELDS and (*export.FORMATS,) == runs.GRIDS


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_says_what_each_says_of_itself(alsph, name):
    code, stdout, _ = alsph(name, "--help")
    assert (code, COMMANDS[name][1].removesuffix(".") in " ".join(stdout.split())) == (0, True)
    assert "╭" not in stdout  # plain text in every terminal and file


def test_a_mistyped_command_is_guessed(alsph):
    code, _, stderr = alsph("resum", "folder")
    assert (code, "Did you mean 'resume'" in stderr) == (2, True)


def test_configuration_file_with_options_on_top(alsph, tmp_path):
    path = tmp_path / "my.toml"
    path.write_text('case = "taylor_green"\nresolution = 12\nseed = 3\n[run]\nuntil = 0.05\nthreads = 1\n')
    assert (
        alsph("run", path, "--resolution", 10, "--algorithm", 1, "--no-adaptive-time-step", "-o", tmp_path / "run")[0]
        == 0
    )
    resolved = config.load(tmp_path / "run" / "case.toml")
    assert (resolved.case.resolution, resolved.case.seed, resolved.case.algorithm) == (10, 3, 1)
    assert resolved.case.adaptive_time_step is False
    assert (resolved.run.until, resolved.run.threads) == (0.05, 1)
    assert alsph("run", tmp_path / "run" / "case.toml", "-o", tmp_path / "again")[0] == 0
    histories = [(tmp_path / name / "history.csv").read_text() for name in ("run", "again")]
    assert histories[0] == histories[1]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("command", ["run", "describe"])
def test_help_teaches_every_parameter(alsph, case, command):
    code, stdout, _ = alsph(command, case, "--help")
    assert code == 0
    words = " ".join(stdout.split())
    model = CASES[case]
    told = {name: model.describe(name) for name in model.model_fields}
    del told["units"]  # a table, whose entries are options
    told |= {f"units_{name}": model.symbols(Units.describe(name)) for name in Units.model_fields}
    idle = options.idle(model, model())
    for name, description in told.items():
        assert (f"--{name.replace('_', '-')} " in words) == (name not in idle)
        assert description in words or name in idle
    assert "--until" in words


def test_plot_in_3d_draws_what_it_can(alsph, tmp_path):
    run = tmp_path / "run"
    assert alsph("run", "taylor_green", "--dimensions=3", "--resolution=8", "--until=0.01", "-o", run)[0] == 0
    drawn = ["kinetic_energy", "ledger", "vorticity", "pressure"]
    assert alsph("plot", run, "--plane", "y=0.2")[:2] == (
        0,
        "".join(f"{run / 'figures' / name}.png\n" for name in drawn),
    )
    assert "no fluid there" in alsph("plot", run, "--field", "pressure", "--plane", "y=2")[2]
    code, output, error = alsph("plot", run, "--plane", "q=1")
    assert (code, output) == (2, "") and "must be an axis" in error


def test_describe(alsph, small_options):
    code, stdout, _ = alsph("describe", "cylinder", *small_options, "--until", 2)
    assert code == 0
    for text in (
        "fluid",
        "solid",
        "MiB",
        "Mach number",
        "courant limit",
        "(binds)",
        "viscous limit",
        "Reynolds number",
        "to t* = 2",
    ):
        assert text in stdout
    assert "s a step" in stdout
    paper = "--penalty-constant=100"
    code, stdout, _ = alsph("describe", "cylinder", "--time-step=0.1", paper, "--no-probe")
    assert "estimated time" not in stdout
    assert "0.06393 at u_max = 1.5 U (binds)" in stdout and "warning" not in stdout
    code, stdout, _ = alsph("describe", "cylinder", "--time-step=0.1", paper, "--no-adaptive-time-step", "--no-probe")
    assert "lies above the penalty stability limit" in stdout


def test_cases_and_version(alsph):
    code, stdout, _ = alsph("cases")
    assert (code, all(name in stdout for name in CASES)) == (0, True)
    assert alsph("--version")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "cilinder"], "unknown case 'cilinder'; did you mean 'cylinder'?"),
        (["run", "missing.toml"], "missing.toml: cannot be read"),
        (["run", "cylinder", "--resolution", "4"], "resolution = 4: too coarse"),
        (["run", "cylinder", "--reynolds", "nan"], "reynolds = nan: must be a finite number"),
        (["run", "cylinder", "--reynolds", "much"], "Invalid value for '--reynolds'"),
        (["run", "cylinder", "--algorithm", "3"], "algorithm = '3': must be 'midpoint', 1, 2 or 'original'"),
        (["run", "cylinder", "--threads", "0"], "run.threads = 0: must be greater than or equal to 1"),
        (["run", "cylinder", "--bogus", "1"], "No such option"),
        (["describe", "cylinder", "--resolution", "100000"], "GiB of memory"),
        (["converge", "poiseuille", "--resolution", "8"], "Possible options: --resolutions"),
        (["run", "cylinder", "--probe-interval", "0.1"], "run.probe_interval: there are no probes"),
        (["info", "missing"], "missing"),
        (["plot", "missing"], "missing"),
        (["resume", "missing"], "missing"),
    ],
)
def test_mistakes(alsph, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    code, _, stderr = alsph(*arguments)
    assert code == 2
    assert message in stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.filterwarnings("ignore:.*expect divergence")
def test_divergence_is_exit_code_1(alsph, tmp_path, small_options):
    options = ["--time-step=0.3", "--penalty-constant=100", "--no-adaptive-time-step", "--until=20"]
    code, _, stderr = alsph("run", "cylinder", *small_options, *options, "-o", tmp_path / "run")
    assert code == 1
    assert "last good state" in stderr
    assert "Traceback" not in stderr
    assert "last good state" in alsph("info", tmp_path / "run")[1]


def test_help_has_problem_method_and_run_apart(alsph):
    code, out, _ = alsph("run", "cylinder", "--help")
    words = "Options:", "--force", "Parameters of the problem:", "--reynolds", "--upstream", "Parameters of the method:"
    at = [out.index(word) for word in (*words, "--courant", "--wall-pressure", "Settings of the run:", "--until")]
    assert code == 0 and at == sorted(at)
