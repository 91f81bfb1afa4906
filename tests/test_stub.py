import subprocess
import sys


def test_the_stub_describes_the_engine():
    command = [sys.executable, "-m", "mypy.stubtest", "alsph._alsph"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
