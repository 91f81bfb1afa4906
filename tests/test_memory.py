"""Memory that is short is noticed before the engine, which cannot bear it, runs out of it."""

import subprocess
import sys

import pytest
from alsph import memory, resume
from alsph.errors import ConfigError, SolverError
from alsph.memory import free_memory

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are looked at on Linux only")

WITHIN = """
import resource, sys
from pathlib import Path
import alsph.cli.of_cases  # what is loaded is not counted
from alsph.cli import main
size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (size + int(sys.argv.pop(1)) * 2**20, resource.getrlimit(resource.RLIMIT_AS)[1]))
main()
"""


@pytest.mark.parametrize("megabytes", [100, 400, 700])
def test_a_limit_of_memory_is_an_error_and_no_abort(tmp_path, megabytes):
    """As with ``ulimit -v``; the run takes 280 MiB to step, its threads' stacks and outputs apart."""
    options = ["cylinder", "--resolution=40", "--until=0.001", "--threads=1", "-o", tmp_path / "run"]
    arguments = [sys.executable, "-c", WITHIN, str(megabytes), "run", *map(str, options)]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=300)
    if done.returncode:  # else it was enough
        assert done.returncode == 2 and "GiB of memory" in done.stderr and len(done.stderr.splitlines()) == 1
        assert not (tmp_path / "run").exists()
    assert (done.returncode == 0) == (megabytes == 700)


def test_limits_count(monkeypatch, small, tmp_path):
    whole = free_memory()
    monkeypatch.setattr(memory, "_within_limits", lambda: 2.0 * memory.BYTES_PER_THREAD)
    assert free_memory(1) < free_memory() < whole and free_memory(3) == 0
    with pytest.raises(ConfigError, match="resolution = 40: about 299,520 particles need 0.27 GiB of memory"):
        small.replace(resolution=40, length=14.0, height=13.0, upstream=4.0).build(1)
    path = small.run(tmp_path / "run", until=0.02, threads=1, progress=False).path
    with pytest.raises(ConfigError, match="resolution = 8: about 1,792 particles need .* and 0 GiB are free"):
        resume(path, until=0.5, threads=3)


def test_an_engine_that_panics_is_an_error(small, monkeypatch):
    class PanicException(BaseException):
        """As that of the compiled module."""

    class Engine:
        def snapshot(self):
            raise PanicException("PyObject pointer is null")

    simulation = small.simulation(1)
    monkeypatch.setattr(simulation, "_engine_of_process", Engine())
    with pytest.raises(SolverError, match="out of memory: PyObject pointer is null"):
        simulation.snapshot()
