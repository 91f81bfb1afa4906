"""Fuzzing of all that alsph reads: how many damaged inputs were tried, and what became of them.

    python benches/fuzz.py --minutes 10

Files of a real run are damaged at random (bits flipped, parts cut out, doubled or exchanged, numbers replaced by
extreme ones) and read. What is no error of alsph's own counts as a failure: another exception, a crash of the process,
an input that takes more than ten seconds or more than 2 GiB. Each input can be made again: ``--target T --seed S``.
"""

import argparse
import faulthandler
import json
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time as clock
import warnings
from collections import Counter
from contextlib import suppress
from pathlib import Path

BATCH = 2000
BATCH_SECONDS = 20
MEMORY = 2 * 2**30
EXTREMES = [
    b"0",
    b"-1",
    b"1e400",
    b"nan",
    b"inf",
    b"18446744073709551616",
    b"1e-320",
    b"{",
    b"[[",
    b'"',
    b"\0",
    b"=",
    b"true",
]


def targets(folder):
    """Return for each target the file that is damaged and the function that reads it."""
    import h5py
    import numpy as np
    from alsph import config, open_run, resume, study
    from alsph.errors import AlsphError
    from alsph.folder import checkpoint, reading
    from alsph.geometry.outline import Outline

    state = checkpoint.read(folder / "checkpoint.h5").state
    until = state["time"] + 1e-9
    with h5py.File(folder / "version_1.h5", "w") as old:
        for name, value in state.items():
            if np.ndim(value):
                old.create_dataset(name, data=value, compression="gzip")
            else:
                old.attrs[name] = value

    def resealed(path):
        """Read a checkpoint that was damaged before its checksum was formed."""
        content = path.read_bytes()
        if len(content) > checkpoint.HEAD_BYTES:
            import hashlib

            digest = hashlib.sha256(content[checkpoint.HEAD_BYTES :]).hexdigest()
            head = f"alsph checkpoint\nversion 2\nsha256 {digest}\n".encode().ljust(checkpoint.HEAD_BYTES, b"\0")
            path.write_bytes(head + content[checkpoint.HEAD_BYTES :])
        checkpoint.read(path)

    def snapshots(path):
        for step in range(len(reading.snapshot_times(path))):
            reading.snapshot(path, step)

    def whole(path):
        """Look at a run and go on with it by a step."""
        name = path.name.removeprefix("damaged ")
        copy = folder.with_name(f"copy {folder.name}")
        shutil.copytree(folder, copy, dirs_exist_ok=True, ignore=shutil.ignore_patterns("damaged *"))
        (copy / name).write_bytes(path.read_bytes())
        try:
            with suppress(AlsphError):
                open_run(copy).summary()
            resume(copy, until=until, progress=False)
        finally:
            shutil.rmtree(copy)

    (folder / "study.toml").write_bytes(
        Path(study.__file__).with_name("shipped").joinpath("reynolds.toml").read_bytes()
    )
    (folder / "outline.txt").write_text("two\n3. 3.\n\n0,0\n.5,.1\n1,0\n\n0,0\n.5,-.1\n1,0\n999 999\n2,0\n3,0\n2,1\n")
    return {
        "outline": ("outline.txt", Outline.read),
        "configuration": ("case.toml", config.load),
        "study": ("study.toml", lambda path: study.load(path).points()),
        "checkpoint": ("checkpoint.h5", checkpoint.read),
        "checkpoint, checksum renewed": ("checkpoint.h5", resealed),
        "checkpoint of version 1": ("version_1.h5", checkpoint.read),
        "particles": ("particles.vtkhdf", snapshots),
        "surface": ("surface.h5", reading.surface),
        "points of the surface": ("surface.h5", reading.surface_points),
        "history": ("history.csv", reading.history),
        "run.json": ("run.json", whole),
        "case.toml of a run": ("case.toml", whole),
        "particles of a run": ("particles.vtkhdf", whole),
        "surface pressure of a run": ("surface.h5", whole),
        "history of a run": ("history.csv", whole),
        "checkpoint of a run": ("checkpoint.h5", whole),
    }


def damage(content, chance):
    """Return the bytes with one to six changes."""
    data = bytearray(content)
    for _ in range(chance.choice([1, 1, 2, 3, 6])):
        if not data:
            break
        place = chance.randrange(len(data))
        kind, length = chance.randrange(6), min(chance.choice([1, 2, 8, 100, 5000]), len(data))
        other = chance.randrange(len(data))
        if kind == 0:
            data[place] ^= 1 << chance.randrange(8)
        elif kind == 1:
            data[place : place + length] = bytes(chance.randrange(256) for _ in range(min(length, 100)))
        elif kind == 2:
            del data[place : place + length]
        elif kind == 3:
            data[place:place] = data[other : other + length]
        elif kind == 4:
            data[place : place + length] = data[other : other + length]
        else:
            data[place : place + chance.randrange(9)] = chance.choice(EXTREMES)
    return bytes(data)


def work(folder, target, seeds):
    """Read damaged inputs; print a line for each that is not refused or read as it should be."""
    from alsph.errors import AlsphError

    faulthandler.enable()
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    name, read = targets(folder)[target]
    content = (folder / name).read_bytes()
    path = folder / f"damaged {name}"
    counts = Counter()
    end = clock.monotonic() + BATCH_SECONDS
    for seed in seeds:
        if clock.monotonic() > end:
            break
        path.write_bytes(damage(content, random.Random(f"{target} {seed}")))
        print(json.dumps({"seed": seed}), flush=True)
        signal.alarm(10)
        try:
            read(path)
            counts["read"] += 1
        except AlsphError:
            counts["refused"] += 1
        except BaseException as error:
            print(json.dumps({"failure": f"seed {seed}: {type(error).__name__}: {error}"}), flush=True)
        signal.alarm(0)
    print(json.dumps({"counts": counts}), flush=True)


def campaign(folder, minutes, first):
    names = list(targets(folder))
    tried, found, failures, next_seed = Counter(), Counter(), [], dict.fromkeys(names, first)
    end = clock.monotonic() + 60 * minutes
    while clock.monotonic() < end:
        for target in names:
            seeds = range(next_seed[target], next_seed[target] + BATCH)
            command = [
                sys.executable,
                __file__,
                "--folder",
                folder,
                "--target",
                target,
                "--batch",
                *map(str, (seeds[0], seeds[-1] + 1)),
            ]
            process = subprocess.run(list(map(str, command)), capture_output=True, text=True)
            lines = [json.loads(line) for line in process.stdout.splitlines()]
            done = [line["seed"] for line in lines if "seed" in line]
            next_seed[target] = done[-1] + 1 if done else seeds[-1] + 1
            tried[target] += len(done)
            new = [line["failure"] for line in lines if "failure" in line]
            if process.returncode:
                new.append(f"seed {done[-1] if done else '?'}: exit code {process.returncode}: {process.stderr[-300:]}")
            for line in lines:
                found.update({f"{target} {key}": value for key, value in line.get("counts", {}).items()})
            failures += [f"{target}: {failure}" for failure in new]
            for failure in new:
                print(failure, flush=True)
    print("\n| what | inputs | failures |\n|---|---|---|")
    for target in names:
        print(f"| {target} | {tried[target]} | {sum(failure.startswith(target + ':') for failure in failures)} |")
    print(f"{sum(tried.values())} inputs, {len(failures)} failures")
    return len(failures)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--target")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--batch", type=int, nargs=2)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.folder or Path(scratch) / "run"
        if options.batch:
            return work(folder, options.target, range(*options.batch))
        import alsph

        case = alsph.cases.Cylinder(resolution=8, length=4.0, height=4.0, upstream=2.0)
        case.run(folder, until=0.1, output_interval=0.05, surface_interval=0.02, progress=False)
        if options.seed is not None:
            return work(folder, options.target, [options.seed])
        return campaign(folder, options.minutes, options.first)


if __name__ == "__main__":
    sys.exit(main())
