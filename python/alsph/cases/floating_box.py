"""A box that floats in a tank."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
import shapely
from pydantic import Field, model_validator

from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.free_surface import FreeSurface
from alsph.cases.heave import SOURCE, linear_heave
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, inside, lattice
from alsph.geometry.packing import Planar
from alsph.geometry.particles import join
from alsph.geometry.rigid import Rigid
from alsph.geometry.solids import body_layers

ELEMENT = 0.02
"""Length of a boundary element [H]: half of it changes the motion by 0.003 of a lift."""

SHOWN = 2.0
"""Time from which on the force on the box is compared with its weight [√(H/g)]."""


class FloatingBox(FreeSurface):
    """A box that floats in a tank with slip walls, free to move and to turn; let go above its draught it heaves.

    The tank is filled to the depth H but for the box's part below the water; sizes of the box and the lift are taken to
    whole spacings, and its density so that its draught is. At rest it displaces its weight (Archimedes).
    """

    name: ClassVar[str] = "floating_box"
    title: ClassVar[str] = "a box that floats in a tank"
    later_names: ClassVar[tuple[str, ...]] = (
        "mean force of the water over the weight",
        "turn of the box, rad",
        "largest difference over the lift",
        "heave",
    )

    tank_length: float = Field(default=3.0, gt=0, description="length of the tank [H]")
    tank_height: float = Field(default=2.0, gt=1, description="height above which spray is lost [H]")
    box_length: float = Field(default=0.6, gt=0, description="length of the box [H]")
    box_height: float = Field(default=0.4, gt=0, description="height of the box [H]")
    density_ratio: float = Field(default=0.5, gt=0, lt=1, description="density of the box over that of water [-]")
    lift: float = Field(default=0.0, description="height above its draught that it is let go at [H]")

    @model_validator(mode="after")
    def _floats_inside(self) -> Self:
        half = self.tank_length / 2
        if self.size[0] / 2 > half - 4 * self.particle_spacing:
            told = f"does not fit into a tank_length of {self.tank_length:g}"
            raise ConfigError(f"box_length = {self.box_length:g}: {told}")
        for name, size in zip(("box_length", "box_height"), self.size, strict=True):
            if size <= 0:
                told = "to whole particle spacings it is none; use a finer resolution"
                raise ConfigError(f"{name} = {getattr(self, name):g}: {told}")
        if not 0 < self.draught < self.size[1]:
            told = f"to whole spacings, 1/{self.resolution}, its draught is {self.draught:g} of a box_height of"
            remedy = "it would not float; use a finer resolution"
            raise ConfigError(f"density_ratio = {self.density_ratio:g}: {told} {self.size[1]:g}: {remedy}")
        if self.bottom >= 1:
            raise ConfigError(f"lift = {self.lift:g}: the box would not be in the water")
        if self.bottom + self.size[1] <= 1:
            raise ConfigError(f"lift = {self.lift:g}: the box would be under water")
        if min(self.bottom, 1 - self.draught) < 4 * self.particle_spacing:
            raise ConfigError(f"box_height = {self.box_height:g}: the box would stand on the floor")
        if (top := self.bottom + self.size[1]) > self.tank_height:
            raise ConfigError(f"tank_height = {self.tank_height:g}: the box, up to {top:g}, would reach out of it")
        self.whole_cells("tank_length", self.tank_length)
        return self

    @property
    def _whole_lift(self) -> float:
        """The lift, to whole spacings [H]."""
        return float(self.whole(self.lift))

    @property
    def size(self) -> tuple[float, float]:
        """Length and height of the box, to whole spacings [H]."""
        return float(self.whole(self.box_length, 2)), float(self.whole(self.box_height))

    @property
    def draught(self) -> float:
        """Depth that the box is immersed to at rest, to whole spacings [H]."""
        return float(self.whole(self.density_ratio * self.size[1]))

    @property
    def metacentric_height(self) -> float:
        """Height of the metacentre over the centre of gravity [H]: below zero the box does not float upright."""
        (length, height), draught = self.size, self.draught
        return draught / 2 + length**2 / (12 * draught) - height / 2

    def remarks(self) -> list[str]:
        """Return what is rounded to whole spacings, what is too small for them, and that the box does not float so."""
        length, height = self.size
        taken = {
            "box_length": (self.box_length, length),
            "box_height": (self.box_height, height),
            "density_ratio": (self.density_ratio, self.draught / height),
            "lift": (self.lift, self._whole_lift),
        }
        rounded = [
            f"{name} {to:.4g} for {asked:g}"
            for name, (asked, to) in taken.items()
            if abs(to - asked) > 0.01 * abs(asked)
        ]
        coarse = [
            f"{name} of {size * self.resolution:.3g} Δx"
            for name, size, least in (("draught", self.draught, 4), ("lift", abs(self._whole_lift), 2))
            if 0 < size < (least - 0.5) * self.particle_spacing
        ]
        found = super().remarks()
        if rounded:
            found.append(f"rounded: sizes to whole particle spacings, {', '.join(rounded)}")
        if coarse:
            found.append(f"coarse: a {' and a '.join(coarse)}; the motion is some tenths of the lift off")
        if self.metacentric_height < 0:
            told = f"its metacentre lies {-self.metacentric_height:.3g} H below its centre of gravity"
            found.append(f"unstable: the box does not float upright, {told}, and turns sooner or later")
        return found

    @property
    def default_until(self) -> float:
        """About two periods of heaving."""
        return 8.0

    @property
    def bottom(self) -> float:
        """Height of the box's bottom at the start [H]."""
        return 1 - self.draught + self._whole_lift

    @property
    def coefficient_bodies(self) -> list[str]:
        """Name of the box."""
        return ["box"]

    def domain(self) -> Domain:
        """Return the tank, whose top is open."""
        half = self.tank_length / 2
        return Domain((-half, 0), (half, self.tank_height), [("slip", "slip"), ("slip", "air")])

    @property
    def weight(self) -> float:
        """That of the box [ρgH²]."""
        return self.draught * self.size[0]

    def _weights(self, run: Record) -> FloatArray:
        """Return its weight in every step, with what drives the flow beside gravity where its centre is [ρgH²]."""
        if "forcing" not in self.rules:
            return np.full(len(run.history["time"]), self.weight)
        (start,), history = (body.center for body in self.checked_bodies), run.history
        way = np.stack([history[f"box_displacement_{axis}"] for axis in "xy"], axis=1)
        steps = zip(way + start, history["time"] - 0.5 * history["time_step"], strict=True)
        return -self.weight * np.array([self.body_force_at(place[None], time)[0, 1] for place, time in steps])

    def bodies(self) -> list[SolidBody]:
        """Return the box."""
        inertia = self.weight * (self.size[0] ** 2 + self.size[1] ** 2) / 12
        rigid = Rigid(self.weight, inertia, displaced=self.weight)
        return [SolidBody("box", (0, self.bottom + self.size[1] / 2), rigid=rigid)]

    def linear_heave(self, until: float) -> tuple[FloatArray, FloatArray]:
        """Return times [√(H/g)] and how far the box has come [H], of linear theory; it is in the middle of its tank."""
        beam, draught = self.size[0] / 2, self.draught
        bottom = np.linspace(0, beam, 1 + max(1, round(beam / ELEMENT))) - 1j * draught
        side = beam - 1j * np.linspace(draught, 0, 1 + max(1, round(draught / ELEMENT)))
        section = tuple(np.concatenate([bottom, side[1:]]).tolist())
        time, height = linear_heave(until, section, self.weight, 1.0, self.tank_length)
        return time, self._whole_lift * (height - 1)

    @property
    def initial_volume(self) -> float:
        """That of the water [H²]."""
        return self.tank_length - self.size[0] * (1 - self.bottom)

    def particle_estimate(self) -> int:
        """Return about how many particles there are, with those of the box."""
        hollow = [max(0.0, side - 2 * self.support_layers * self.particle_spacing) for side in self.size]
        box = self.size[0] * self.size[1] - hollow[0] * hollow[1]
        return super().particle_estimate() + round(box * self.resolution**2)

    def particles(self) -> Arrays:
        """Return water at rest around the box."""
        spacing, box = self.particle_spacing, self._box
        columns = cell_centres(self.whole_cells("tank_length", self.tank_length), spacing) - self.tank_length / 2
        position = lattice(columns, cell_centres(self.resolution, spacing))
        position = position[~inside(box, position)]
        water = self.fluid(position, np.zeros_like(position), 1 - position[:, 1])
        return join(water, body_layers(box, spacing, self.support_layers).particles())

    @property
    def _box(self) -> shapely.Polygon:
        """The box where it begins [H]."""
        length, height = self.size
        return shapely.box(-length / 2, self.bottom, length / 2, self.bottom + height)

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie outside of the box where it begins [H]."""
        return Planar(self._box).height(position)

    def measures(self, run: Record) -> list[Measure]:
        """Return the mean force of the water on the box over its weight, the largest turn, and the heave."""
        rows: list[Measure] = []
        time, force = run.history["time"], run.history.get("box_pressure_force_y", np.empty(0))
        late = time > SHOWN
        if late.any() and len(force):
            weight = self._weights(run)
            step = run.history["time_step"][late]
            mean = float((force[late] * step).sum() / (weight[late] * step).sum())
            turn = float(np.abs(run.history["box_angle"]).max())
            known, source = np.nan if self._whole_lift else 1.0, "Archimedes' principle"
            rows += [
                Measure("mean force of the water over the weight", mean, known, 0.02, source),
                Measure("turn of the box, rad", turn, 0.0, 0.02, "symmetry"),
            ]
        if self._whole_lift and "box_displacement_y" in run.history and len(time) and time[-1] > SHOWN:
            exact = np.interp(time, *self.linear_heave(time[-1]))
            worst = np.abs(run.history["box_displacement_y"] - exact).max() / abs(self._whole_lift)
            rows.append(Measure("largest difference over the lift", float(worst), 0.0, 0.15, SOURCE))
        return rows

    def profiles(self, run: Record) -> list[Profile]:
        """Return how far the box has risen over time."""
        if "box_displacement_y" not in run.history:
            return []
        time, known, source = run.history["time"], (np.empty(0), np.empty(0)), ""
        if self._whole_lift and len(time) and time[-1] > 0:
            known, source = self.linear_heave(time[-1]), SOURCE
        axes = ("$t\\sqrt{g/H}$", "height of the box over that at the start, $/H$")
        return [Profile("heave", axes, (time, run.history["box_displacement_y"]), known, source)]
