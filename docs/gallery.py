"""Make the pictures of gallery.md again, from the commands that stand in it: `python docs/gallery.py [CASE]...`."""

import re
import resource
import shlex
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import alsph
from PIL import Image

HERE = Path(__file__).parent
RUNS = HERE.parent / "target" / "gallery"
FIELDS = {
    "bend": "velocity",
    "body": "velocity",
    "body_3d": "velocity",
    "backward_facing_step": "velocity",
    "cavity": "velocity",
    "concentric_release": "velocity",
    "dam_break": "pressure",
    "dam_break_obstacle": "pressure",
    "dam_break_structure": "pressure",
    "elliptical_drop": "pressure",
    "floating_box": "pressure",
    "nozzle": "velocity",
    "pressure_jump": "pressure",
    "sloshing": "pressure",
    "rolling_tank": "pressure",
    "rotating_patch": "pressure",
    "standing_wave": "pressure",
    "still_water": "pressure",
    "taylor_green": "vorticity",
}
"""The field of those pictures that show neither a profile nor the vorticity past a body."""

PROFILES = {"heaving_cylinder"}
"""Cases with a body whose picture is a profile."""


def commands() -> dict[str, list[str]]:
    """Return the command of each case in gallery.md."""
    text = (HERE / "gallery.md").read_text(encoding="utf-8")
    lines = re.findall(r"^    alsph (run (\S+) .*)$", text, re.MULTILINE)
    return {Path(case).stem: shlex.split(line) for line, case in lines}


def compute(case: str, arguments: list[str]) -> None:
    """Run a case on one thread, and tell what that took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    command = [sys.executable, "-m", "alsph", *arguments, "--threads", "1", "--force", "--output", str(RUNS / case)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    print(f"{case}: {resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before:.0f} s of one core", flush=True)


def draw(case: str) -> None:
    """Save the picture of a run: the profile where it has one, a field otherwise."""
    run = alsph.open_run(RUNS / case)
    profile = next((each for each in run.profiles if case in PROFILES or not (case in FIELDS or run.body)), None)
    figure = run.plot_profile(profile) if profile else run.plot_field(FIELDS.get(case, "vorticity"))
    drawn = BytesIO()
    figure.savefig(drawn, dpi=90)
    picture = Image.open(drawn).convert("RGB").quantize(256, dither=Image.Dither.NONE)  # a third of the size
    picture.save(HERE / "images" / "gallery" / f"{case}.png", optimize=True)


if __name__ == "__main__":
    for name, line in commands().items():
        if name in sys.argv[1:] or not sys.argv[1:]:
            compute(name, line)
            draw(name)
