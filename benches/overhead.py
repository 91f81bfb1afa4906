"""What a whole run costs beside its steps: start, Python, history, output, checkpoints.

    python benches/overhead.py [RESOLUTION] [UNTIL]

The cylinder, at D/Δx = 20 to t* = 2, with the default output and a checkpoint every D/U.
"""

import sys
import tempfile
import time
from collections import defaultdict

import alsph
from alsph.engine import simulation
from alsph.folder import checkpoint, run_folder, surface, vtkhdf

seconds, calls = defaultdict(float), defaultdict(int)


def timed(owner, name, label):
    """Have the calls of a function counted and their time added up."""
    function = getattr(owner, name)

    def call(*arguments, **options):
        start = time.perf_counter()
        try:
            return function(*arguments, **options)
        finally:
            seconds[label] += time.perf_counter() - start
            calls[label] += 1

    setattr(owner, name, call)


class Engine:
    """The engine, with the time of its steps added up."""

    def __init__(self, *arguments):
        self._engine = Compiled(*arguments)

    def __getattr__(self, name):
        return getattr(self._engine, name)

    def advance_until(self, *arguments):
        return self._engine.advance_until(*arguments)


Compiled = simulation._alsph.Simulation
simulation._alsph.Simulation = Engine
timed(Engine, "advance_until", "steps")
timed(run_folder.RunFolder, "append_history", "history")
timed(run_folder.RunFolder, "write_checkpoint", "checkpoints")
timed(checkpoint, "digest", "digests of the state")
timed(vtkhdf, "append", "outputs of the particles")
timed(surface, "append", "surface pressure")
timed(run_folder.RunFolder, "write_info", "run.json")

resolution, until = (int(sys.argv[1]) if len(sys.argv) > 1 else 20), (float(sys.argv[2]) if len(sys.argv) > 2 else 2.0)
with tempfile.TemporaryDirectory() as folder:
    start = time.perf_counter()
    run = alsph.cases.Cylinder(reynolds=200, resolution=resolution).run(f"{folder}/run", until=until, threads=2)
    whole, steps = time.perf_counter() - start, run.info["step"]
for label in seconds:
    each = 1e3 * seconds[label] / calls[label]
    share = seconds[label] / seconds["steps"]
    print(f"{label:25} {seconds[label]:8.2f} s  {calls[label]:4} times {each:8.1f} ms  {share:7.2%} of the steps")
print(f"whole run {whole:.1f} s, {steps} steps: {whole / seconds['steps'] - 1:.1%} more than its steps")
