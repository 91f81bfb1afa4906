"""Runs that are killed, stopped, starved and damaged at random: what was lost, and whether the results are the same.

    python benches/faults.py --trials 50

Each trial starts or resumes a run in a process of its own, does one thing to it, and resumes it to its end in the next
ones; then its history, state, particles and surface pressure are compared, bit by bit, with those of a run that nothing
befell. Runs write all the time, so that many faults fall into a write. The table goes into docs/reliability.md.
"""

import argparse
import random
import resource
import shutil
import signal
import statistics
import sys
import tempfile
import time as clock
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import alsph
from alsph.config import Config, RunSettings
from alsph.folder import checkpoint
from alsph.folder.run_folder import RunFolder

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from processes import bits, command, wait_until_stepping

CHANNEL = {"resolution": 8, "length": 5.0, "height": 4.0, "upstream": 2.0}
CASES = {
    "cylinder, open boundaries": (alsph.cases.Cylinder(**CHANNEL), 1.2),
    "cylinder, Algorithm 1": (alsph.cases.Cylinder(**CHANNEL, algorithm=1), 1.0),
    "Taylor-Green, 3-D": (alsph.cases.TaylorGreen(resolution=10, dimensions=3), 0.5),
}
OFTEN = {"output_interval": 0.02, "surface_interval": 0.01, "flush_seconds": 0.02}


@dataclass
class Tally:
    tried: int = 0
    took: int = 0
    lost: list = field(default_factory=list)
    wrong: int = 0
    stuck: int = 0


def last_step(path):
    """The last step that the history knows of."""
    lines = (path / "history.csv").read_text().splitlines() if (path / "history.csv").exists() else []
    numbers = [line.split(",")[0] for line in lines[1:]]
    return int(numbers[-1]) if numbers and numbers[-1].isdigit() else 0


def go_on(case_file, path):
    return command("resume", path) if (path / "case.toml").exists() else command("run", case_file, "-o", path)


def send(number):
    def fault(case_file, path, chance, tally):
        process = go_on(case_file, path)
        wait_until_stepping(path, process)
        clock.sleep(chance.uniform(0, 0.3))
        process.send_signal(number)
        expected = -number if number == signal.SIGKILL else 128 + number
        tally.took += process.wait() == expected

    return fault


def walltime(case_file, path, chance, tally):
    arguments = ("resume", path) if (path / "case.toml").exists() else ("run", case_file, "-o", path)
    tally.took += command(*arguments, "--walltime", "0:00:01").wait() == 75


def full_disk(case_file, path, chance, tally):
    """A limit of the size of files, at a random place, makes a write fail in its midst."""
    if not (path / "case.toml").exists():
        send(signal.SIGINT)(case_file, path, chance, Tally())
    largest = max(file.stat().st_size for file in path.iterdir())
    room = largest + chance.randrange(200_000)
    process = command(
        "resume", path, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))
    )
    tally.took += process.wait() == 2


def damage(case_file, path, chance, tally):
    """The newest checkpoint is damaged after a kill."""
    send(signal.SIGKILL)(case_file, path, chance, Tally())
    file = path / "checkpoint.h5"
    if file.exists() and (path / "checkpoint.previous.h5").exists():
        content = bytearray(file.read_bytes())
        if chance.random() < 0.5:
            content[chance.randrange(checkpoint.HEAD_BYTES, len(content))] ^= 1 << chance.randrange(8)
        else:
            content = content[: chance.randrange(len(content))]
        file.write_bytes(content)
        tally.took += 1


FAULTS = {
    "kill -9": send(signal.SIGKILL),
    "SIGTERM": send(signal.SIGTERM),
    "Ctrl-C (SIGINT)": send(signal.SIGINT),
    "wall time": walltime,
    "disk full": full_disk,
    "newest checkpoint damaged": damage,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=20, help="trials of each fault")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--faults", nargs="*", choices=list(FAULTS), default=list(FAULTS))
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    chance = random.Random(options.seed)
    tallies = {name: Tally() for name in options.faults}
    with tempfile.TemporaryDirectory() as scratch:
        scratch, whole = Path(scratch), {}
        for name, (case, until) in CASES.items():
            settings = RunSettings(until=until, threads=2, **OFTEN)
            Config(case, settings).save(scratch / f"{name}.toml")
            run = case.run(scratch / name, threads=1, until=until, progress=False, **OFTEN)
            whole[name] = bits(run.path)
        for fault, tally in tallies.items():
            name, path = "", scratch / "run"
            while tally.tried < options.trials or path.exists():
                if not path.exists():
                    name = list(CASES)[tally.tried % len(CASES)]
                tally.tried += 1
                FAULTS[fault](scratch / f"{name}.toml", path, chance, tally)
                reached = last_step(path)
                kept = RunFolder(path).read_checkpoint().state["step"] if RunFolder(path).has_checkpoint() else 0
                tally.lost.append(max(reached - kept, 0))
                # Every fourth fault, or when the trials are over, the run goes on to its end.
                if (
                    tally.tried % 4 == 0
                    or tally.tried >= options.trials
                    or RunFolder(path).last_info().get("status") == "finished"
                ):
                    process = go_on(scratch / f"{name}.toml", path)
                    _, errors = process.communicate()
                    if process.returncode:
                        tally.stuck += 1
                        print(f"{fault}: {errors}", flush=True)
                    elif bits(path) != whole[name]:
                        tally.wrong += 1
                        print(f"{fault}: {name} differs", flush=True)
                    shutil.rmtree(path)
        print("| fault | tried | took effect | steps lost: median, most | not resumed | wrong results |")
        print("|---|---|---|---|---|---|")
        for fault, tally in tallies.items():
            lost = f"{statistics.median(tally.lost):g}, {max(tally.lost)}"
            print(f"| {fault} | {tally.tried} | {tally.took} | {lost} | {tally.stuck} | {tally.wrong} |")
    return sum(tally.stuck + tally.wrong for tally in tallies.values())


if __name__ == "__main__":
    sys.exit(main())
