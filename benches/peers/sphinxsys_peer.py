"""Time SPHinXsys's own examples on alsph's cases and print one line of JSON.

Takes the sources of SPHinXsys and a folder in which CMake has built `sphinxsys_2d`; compiles a copy of an example in
which case parameters are replaced and which notes its CPU time each step, and runs it on one core (`taskset`).
"""

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
from alsph.analysis.sampling import interpolate
from alsph.cases.cavity import CENTRE_LINES, on_centre_lines
from numpy.typing import NDArray
from scipy.spatial import KDTree

WARM_UP = 5
SUPPORT = 2 * 1.3  # of the kernel, Δx
LIBRARIES = "-lSimTKsimbody -lSimTKmath -lSimTKcommon -lspdlog -lfmt -ltbb -lboost_program_options -lpthread"
NUMBER = 'std::stod(std::getenv("{}"))'
EVERY_STEP = {
    "screen_output_interval = 100;": "screen_output_interval = 1;",
    '<< "N=" <<': '<< "CPU=" << std::clock() / double(CLOCKS_PER_SEC) << "\\tN=" <<',
}
EXAMPLES = {"taylor_green": "taylor_green", "cavity": "lid_driven_cavity_corrected", "cylinder": "flow_around_cylinder"}
CHANGES = {
    "taylor_green": {
        "global_resolution = 1.0 / 100.0;": f"global_resolution = 1.0 / {NUMBER.format('RESOLUTION')};",
        "end_time = 5.0;": f"end_time = {NUMBER.format('UNTIL')};",
        "output_interval = 0.1;": "output_interval = end_time;",
    },
    "cavity": {
        "global_resolution = 1.0 / 50.0;": f"global_resolution = 1.0 / {NUMBER.format('RESOLUTION')};",
        "End_Time = 30.0;": f"End_Time = {NUMBER.format('UNTIL')};",
    },
    "cylinder": {  # the channel of Kolukisa, Ozbulut and Yildiz (2021) between the zones where u is held; no states
        "Real DL = 15.0;": "Real DL = 14.0;",
        "Real DH = 10.0;": "Real DH = 13.0;",
        "global_resolution = 0.2;": f"global_resolution = 1.0 / {NUMBER.format('RESOLUTION')};",
        "insert_circle_center(4.0, 5.0)": "insert_circle_center(4.0, 6.5)",
        "insert_circle_radius = 0.75;": "insert_circle_radius = 0.5;",
        "Re = 100.0;": "Re = 200.0;",
        'Viscosity="0.020"': 'Viscosity="0.005"',  # which is what counts, not the line before
        "end_time = 200.0;": f"end_time = {NUMBER.format('UNTIL')};",
        "output_interval = end_time / 200.0;": "output_interval = 0.01;",  # every step: the forces are noisy
        "compute_vorticity.exec();\n        write_real_body_states.writeToFile();": "",
    },
}


def substituted(folder: Path, changes: dict[str, str]) -> dict[str, str]:
    """Return the texts of an example's files with every change made, each of which must fit exactly once."""
    paths = [*folder.glob("*.cpp"), *folder.glob("*.h"), *folder.glob("data/*.dat")]
    texts = {path.name: path.read_text() for path in paths}
    for old, new in changes.items():
        places = [name for name, text in texts.items() for _ in range(text.count(old))]
        if len(places) != 1:
            raise SystemExit(f"{folder}: {old!r} is there {len(places)} times, not once: another version of SPHinXsys?")
        texts[places[0]] = texts[places[0]].replace(old, new)
    return texts


def compiled(case: str, source: Path, build: Path) -> Path:
    """Return the folder in which the changed example is compiled, as the library was; it is kept there."""
    example = source / "tests" / "2d_examples" / f"test_2d_{EXAMPLES[case]}"
    texts = substituted(example, EVERY_STEP | CHANGES[case])
    folder = build / "peer" / case
    program, library = folder / "program", build / "src" / "libsphinxsys_2d.a"
    new = program.exists() and program.stat().st_mtime > library.stat().st_mtime
    if new and all((folder / name).read_text() == text for name, text in texts.items()):
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(example / "regression_test_tool", folder / "input")
    for name, text in texts.items():
        (folder / name).write_text(text)
        if name.endswith(".dat"):
            shutil.copy(folder / name, folder / "input")
    commands = json.loads((build / "compile_commands.json").read_text())
    command = next(entry["command"] for entry in commands if "sphinxsys_2d.dir" in entry["command"])
    flags = shlex.split(command.split(" -o ")[0])
    main = next(str(path) for path in folder.glob("*.cpp"))
    subprocess.run([*flags, "-w", "-o", str(program), main, str(library), *LIBRARIES.split()], check=True)
    return folder


def run(folder: Path, resolution: int, until: float, *arguments: str) -> str:
    """Run an example on one core and return what it prints; its regression test at the end may well fail."""
    core = str(min(os.sched_getaffinity(0)))
    values = {"RESOLUTION": str(resolution), "UNTIL": str(until)}
    command = ["taskset", "-c", core, "./program", *arguments]
    return subprocess.run(command, cwd=folder, env=os.environ | values, stdout=subprocess.PIPE, text=True).stdout


def field(path: Path, name: str) -> NDArray[np.float64]:
    """Return a field of a state that was written."""
    match = re.search(rf'Name="{name}"[^>]*>([^<]*)<', path.read_text())
    if match is None:
        raise SystemExit(f"{path} has no {name}")
    return np.array(match[1].split(), float)


def positions(path: Path) -> NDArray[np.float64]:
    """Return the positions of the particles of a state."""
    return field(path, "Position").reshape(-1, 3)[:, :2]


def velocities(path: Path) -> NDArray[np.float64]:
    """Return the velocities of the particles of a state."""
    return field(path, "Velocity").reshape(-1, 3)[:, :2]


def states(folder: Path, body: str) -> list[tuple[float, Path]]:
    """Return (time, file) of every state written of a body, in order of time."""
    return sorted((field(path, "TimeValue")[0], path) for path in (folder / "output").glob(f"{body}_*.vtp"))


def errors(time: float, state: Path) -> dict[str, float]:
    """Return the decay rate of the kinetic energy and the mean error of the velocity, of the Taylor-Green vortex."""
    rate = -8 * np.pi**2 / 100
    x, y = 2 * np.pi * positions(state).T
    velocity = velocities(state)
    exact = np.exp(rate * time) * np.stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)], 1)
    return {
        "decay_rate": float(-np.log(2 * np.mean(np.sum(velocity**2, 1))) / time),
        "decay_rate_exact": -2 * rate,
        "velocity_error": float(np.mean(np.linalg.norm(velocity - exact, axis=1)) / np.exp(rate * time)),
    }


def extrema(folder: Path, start: float, spacing: float) -> list[float]:
    """Return the smallest u and the largest and smallest v on the centre lines, of the mean of the late outputs."""
    late = [state for time, state in states(folder, "WaterBody") if time >= start]
    found = [interpolate(positions(state), velocities(state), CENTRE_LINES, spacing)[0] for state in late]
    u, v = on_centre_lines(np.mean(found, axis=0))
    return [float(u.min()), float(v.max()), float(v.min())]


def forces(folder: Path, start: float) -> dict[str, float]:
    """Return the mean drag and the rms lift coefficient of the late outputs, with D = U = ρ = 1."""
    names = ("ViscousForceFromFluid", "PressureForceFromFluid")
    parts = [np.loadtxt(folder / "output" / f"Cylinder_Total{name}.dat", skiprows=1) for name in names]
    late = parts[0][:, 0] >= start
    drag, lift = 2 * sum(part[late, 1:3] for part in parts).T
    return {"drag": float(np.mean(drag)), "lift": float(np.std(lift))}


parser = argparse.ArgumentParser()
parser.add_argument("case", choices=list(EXAMPLES))
parser.add_argument("--resolution", type=int, default=20)
parser.add_argument("--until", type=float, help="time to reach, D/U")
parser.add_argument("--window", type=float, default=5.0, help="length of the averages at the end, D/U")
parser.add_argument("--relaxed", action="store_true", help="start the vortex from where the particles of a run ended")
parser.add_argument("--source", type=Path, required=True, help="folder of SPHinXsys's sources")
parser.add_argument("--build", type=Path, required=True, help="folder in which CMake has built them")
options = parser.parse_args()

case, until = options.case, options.until or {"taylor_green": 1.0, "cavity": 20.0, "cylinder": 40.0}[options.case]
folder = compiled(case, options.source.resolve(), options.build.resolve())
shutil.rmtree(folder / "output", ignore_errors=True)
relaxed = options.relaxed and case == "taylor_green"
reload = relaxed or case == "cylinder"
if reload:  # the particles of a run before, as the examples' own tests do; the cylinder's fits them to the circle
    run(folder, options.resolution, until, f"--relax={str(case == 'cylinder').lower()}", "--state_recording=false")
log = run(folder, options.resolution, until, f"--reload={str(reload).lower()}")
steps = np.array(re.findall(r"^CPU=(\S+)\tN=\d+\tTime = (\S+)", log, re.MULTILINE), float)
if "Total wall time" not in log:
    raise SystemExit(f"the run ended early:\n{log[-2000:]}")
cpu, time = steps.T
inner = re.findall(r"Dt / dt = (\d+)", log)  # else there is the last inner step of every step
inner = np.array(inner, float) if inner else np.diff(time) / np.array(re.findall(r"\tdt = (\S+)", log), float)[1:]
bodies = {"taylor_green": ["WaterBody"], "cavity": ["WaterBody", "Wall"], "cylinder": ["WaterBlock", "Cylinder"]}[case]
points = [positions(states(folder, body)[0][1]) for body in bodies]
box = 1.0 if case == "taylor_green" else None
tree = KDTree(points[0] % 1 if box else points[0], boxsize=box)
pairs = tree.count_neighbors(tree, SUPPORT / options.resolution)
result = {
    "code": "SPHinXsys" + (", relaxed" if relaxed else ""),
    "particles": sum(map(len, points)),
    "smoothing_ratio": SUPPORT / 2,
    "neighbours": pairs / len(points[0]) - 1,
    "cpu_per_step": float(np.median(np.diff(cpu[WARM_UP:]))),
    "cpu_per_time": (cpu[-1] - cpu[0]) / (time[-1] - time[0]),
    "time_step": float(np.mean(np.diff(time[WARM_UP:]))),
    "acoustic_steps": float(np.mean(inner[WARM_UP:])),
}
if case == "taylor_green":
    result |= errors(*states(folder, "WaterBody")[-1])
elif case == "cavity":
    result["extrema"] = extrema(folder, until - options.window, 1 / options.resolution)
else:
    result |= forces(folder, until - options.window)
print(json.dumps(result))
