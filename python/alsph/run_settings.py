"""Settings of a run: when it ends, on how many threads, and what is written when."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, TypeAdapter, ValidationInfo, WrapValidator, field_validator, model_validator

from alsph.parameters import Parameters

Converged = Literal["converged"]
"""What stands in place of an end time for a run that ends when what it is averaged for is known well enough."""

UNCERTAINTY = 0.003
"""Largest ± of mean drag and Strouhal number over their values with which a run has converged."""

LATEST = 3.0
"""When a run that has not converged ends, over the end time that its case has by default."""

OF_CONVERGED = ("uncertainty", "latest")
"""Settings that go with it."""

TIME = TypeAdapter(Annotated[float, Field(gt=0, strict=True, allow_inf_nan=False)])


def _time(value: Any, _: Any) -> Any:
    """Tell of a value what is wrong with it as a time, and not what each type of the union has against it."""
    if isinstance(value, str) and value != "converged":
        raise ValueError('must be a time, without quotes, or "converged"')
    return value if value is None or isinstance(value, str) else TIME.validate_python(value)


OR_CONVERGED = "; or converged: as soon as mean drag, lift and shedding are known well enough"
"""What the description of `until` says of that, which only bodies in a stream have."""


class RunSettings(Parameters):
    """Settings of a run: how long, on how many threads, and what is written when."""

    until: Annotated[float | Converged | None, WrapValidator(_time)] = Field(
        default=None,
        description="end time [D/U]; the case's own default if not given" + OR_CONVERGED,
    )
    uncertainty: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description=f"with until = converged, largest relative ± of mean drag and Strouhal number, {UNCERTAINTY:g} if "
        "not given; the rms lift may have 10/3 of it [-]",
    )
    latest: float | None = Field(
        default=None,
        gt=0,
        description="with until = converged, when the run ends in any case [D/U]; "
        f"{LATEST:g} times the default of until if not given",
    )
    threads: int | None = Field(default=None, ge=1, le=4096, description="number of threads; all cores if not given")
    initial_run: str | None = Field(
        default=None,
        description="run folder whose last flow to start with, at any resolution; the case's own start if not given",
    )
    output_interval: float = Field(default=1.0, gt=0, description="time between two outputs of the particles [D/U]")
    surface_interval: float = Field(
        default=0.1, gt=0, description="time between two samples of the surface pressure [D/U]"
    )
    probes: str | list[list[float]] | None = Field(
        default=None,
        description="points where velocity and pressure are recorded, and lines of them: 'X,Y; X,Y:X,Y:COUNT' [D]",
    )

    probe_interval: float | None = Field(
        default=None, gt=0, description="time between two records of the probes, 0.05 if not given [D/U]"
    )
    planes: str | list[str] | None = Field(
        default=None,
        description="planes, in 2-D lines and regions, where velocity and pressure are recorded: an axis and its place "
        "or two corners, and the distance of points if it is not Δx: 'x=3; z=0.5:0.1; X,Y,Z:X,Y,Z' [D]",
    )

    @field_validator("planes", mode="before")
    @classmethod
    def _joined(cls, planes: Any) -> Any:
        if planes is None or isinstance(planes, str):
            return planes
        if not (isinstance(planes, list | tuple) and all(isinstance(plane, str) for plane in planes)):
            raise ValueError("must be a text such as 'x=3; 1,-1:4,1', or a list of such")
        return "; ".join(planes)

    plane_interval: float | None = Field(
        default=None, gt=0, description="time between two records of the planes, 0.5 if not given [D/U]"
    )
    gauges: str | list[list[float]] | None = Field(
        default=None,
        description="places on the floor where the depth of water is recorded, in 3-D by x and y, and lines of them: "
        "'X; X:X:COUNT' or 'X,Y; X,Y:X,Y:COUNT' [D]",
    )
    gauge_interval: float | None = Field(
        default=None, gt=0, description="time between two records of the gauges, 0.05 if not given [D/U]"
    )

    @field_validator("probes", "gauges", mode="before")
    @classmethod
    def _plain(cls, given: Any, info: ValidationInfo) -> Any:
        if given is None or isinstance(given, str):
            return given
        try:
            found = np.array(given, float)
        except (TypeError, ValueError):
            found = np.empty(0)
        if info.field_name == "gauges" and found.ndim == 1 and len(found):
            found = found[:, None]
        if found.ndim != 2:
            example = "'0.5; 0:3:31'" if info.field_name == "gauges" else "'6,0; 5,-1:5,1:21'"
            raise ValueError(f"must be a text such as {example}, or a list of points")
        return found.tolist()

    checkpoint_minutes: float = Field(default=10.0, gt=0, description="longest time between two checkpoints [min]")
    flush_seconds: float = Field(
        default=2.0, gt=0, description="longest time that rows of the history stay unwritten [s]"
    )

    @model_validator(mode="after")
    def _ends_once(self) -> Self:
        if self.until != "converged":
            for name in OF_CONVERGED:
                if (value := getattr(self, name)) is not None:
                    raise ValueError(f'{name} = {value:g}: goes with until = "converged"; say that too or leave it out')
        return self

    def replace(self, **changes: Any) -> Self:
        """Return settings with some changed; an end time takes the place of all that goes with ``"converged"``."""
        return super().replace(**dict.fromkeys(superseded(changes)) | changes)


def superseded(changes: dict[str, Any]) -> tuple[str, ...]:
    """Return the names of the settings whose place others take."""
    return OF_CONVERGED if changes.get("until", "converged") != "converged" else ()
