"""What a whole run costs beside its steps: start, Python, history, output every 0.5 D/U, checkpoint.

    python benches/overhead.py

Time inside the engine's steps against that of the whole run, the cylinder at D/Δx = 20 to t* = 2.
"""

import tempfile
import time

import alsph
from alsph import simulation

Engine = simulation._alsph.Simulation


class TimedEngine:
    """The engine, with the time of its steps added up."""

    seconds = 0.0

    def __init__(self, *arguments):
        self._engine = Engine(*arguments)

    def __getattr__(self, name):
        return getattr(self._engine, name)

    def advance_until(self, *arguments):
        start = time.perf_counter()
        try:
            return self._engine.advance_until(*arguments)
        finally:
            TimedEngine.seconds += time.perf_counter() - start


simulation._alsph.Simulation = TimedEngine
with tempfile.TemporaryDirectory() as folder:
    start = time.perf_counter()
    alsph.cases.Cylinder(reynolds=200, resolution=20).run(f"{folder}/run", until=2.0, threads=2)
    whole = time.perf_counter() - start
print(f"steps {TimedEngine.seconds:.1f} s, whole run {whole:.1f} s: {whole / TimedEngine.seconds - 1:.1%} more")
