import pytest
from alsph.cases import Cylinder
from alsph.cli.app import app

SMALL = {"resolution": 8, "length": 5.0, "height": 4.0, "upstream": 2.0}


@pytest.fixture
def small():
    """Return a cylinder that takes about a millisecond a step."""
    return Cylinder(**SMALL)


@pytest.fixture
def alsph(capsys):
    """Return a function that runs a command line and returns exit code, stdout and stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as end:
            app([str(argument) for argument in arguments])
        return end.value.code or 0, *capsys.readouterr()

    return run


@pytest.fixture
def small_options():
    """Return the options of the small cylinder."""
    return [f"--{name}={value}" for name, value in SMALL.items()]
