"""The numerical parameters that all cases share, and what follows from which."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, get_args

from pydantic import Field, model_validator

from alsph.engine.core import kernels
from alsph.parameters import Parameters

SUPPORT = kernels()
"""Support radius of each kernel in smoothing lengths."""

SUPPORTS = ", ".join(f"{support:g}h" for support in SUPPORT.values())

if TYPE_CHECKING:
    Kernel = str
else:
    Kernel = Literal[tuple(SUPPORT)]

COURANT = 0.3
"""Courant number where neither it nor the paper's pair is given."""

PAPER = {"time_step": 0.0508, "penalty_constant": 100.0}
"""ΔtU/Δx and C_BV where only one of them is given."""


Scheme = Literal["alsph", "isph", "explicit_isph", "wcsph", "edac", "shadloo", "sisph"]

SCHEMES: tuple[str, ...] = get_args(Scheme)

_ANEW = {"algorithm": 2, "pressure_share": 0.0, "projection_sweeps": 1, "viscous_order": 2}

PRESETS: dict[str, dict[str, Any]] = {
    "shadloo": _ANEW | {"shifting": "maximum_velocity"},
    "sisph": _ANEW
    | {"solver": "jacobi", "solver_tolerance": 0.05, "solver_iterations": 1000, "wall_pressure": "adami"},
}
"""Projection ISPH as papers have it: the parameters that each has for its own where nothing else is given."""

_ISPH = ("isph", *PRESETS)

_FOLLOWING = {"wall_pressure", "projection_sweeps", "algorithm", "viscous_order", "shifting"}
"""Parameters with a value of their own that a scheme may have for another."""


def _as_in_the_paper(values: Mapping[str, Any]) -> bool:
    """Whether values ask for the paper's time step and penalty: by one of them, or by an algorithm of first order."""
    return any(values.get(name) is not None for name in PAPER) or values.get("algorithm") not in (None, "midpoint")


def goes_with(scheme: Any) -> dict[str, Any]:
    """Return what goes with a scheme where nothing else is given."""
    return {
        "wall_pressure": "adami" if scheme in tuple(DIFFUSION) else "linear",
        "projection_sweeps": 1 if scheme in ("isph", "explicit_isph") else 4,
        **(PRESETS.get(scheme, {}) if isinstance(scheme, str) else {}),
    }


def _defaults(scheme: Any) -> dict[str, Any]:
    """Return the values that a scheme has of all parameters which depend on the scheme, where nothing else is given."""
    return {name: Method.model_fields[name].default for name in _FOLLOWING} | goes_with(scheme)


def _coefficient_of(*schemes: Any) -> tuple[str, ...]:
    """Name the coefficient of the shifting, which goes with its kind, if a scheme of these has a kind of its own."""
    return ("shift_coefficient",) if any("shifting" in goes_with(scheme) for scheme in schemes) else ()


def superseded(changes: Mapping[str, Any], before: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the parameters whose place others take, of a case that had those of `before`.

    A Courant number takes that of the paper's pair, which takes its; the coefficient of a shifting goes with its kind.
    With the scheme goes what was the scheme's: of a preset all that it sets, of others the rule of the walls' pressure
    and the number of sweeps. From units the Reynolds number follows.
    """
    others: tuple[str, ...] = ()
    if any(changes.get(name) is not None for name in ("shifting", "dimensions")):
        others += ("shift_coefficient",)
    schemes = [table.get("scheme") or "alsph" for table in (before, {**before, **changes})]
    if schemes[0] != schemes[1]:
        others += tuple(name for name, value in _defaults(schemes[0]).items() if before.get(name) == value)
        others += _coefficient_of(*schemes)
    if changes.get("units") is not None:
        others += ("reynolds",)
    if changes.get("courant") is not None:
        return (*PAPER, *others)
    return ("courant", *others) if _as_in_the_paper(changes) else others


OWN = {
    "penalty_constant": ("alsph",),
    "solver": _ISPH,
    "solver_tolerance": _ISPH,
    "solver_iterations": (*_ISPH, "explicit_isph"),
    "pressure_share": _ISPH,
    "density_relaxation": (*_ISPH, "explicit_isph"),
    "mach_number": ("explicit_isph",),
    "sound_speed": ("wcsph", "edac"),
    "density_diffusion": ("wcsph",),
    "diffusion_coefficient": ("wcsph", "edac"),
}
"""The schemes that a parameter belongs to, of those that do not belong to all."""

OWNERS = OWN | {"algorithm": ("alsph", *_ISPH, "explicit_isph")}
"""The same with what others have, too, but for one value."""

DIFFUSION = {"wcsph": 0.1, "edac": 0.5}
"""Coefficient of each weakly compressible scheme's diffusion where none is given: δ of δ-SPH, α of EDAC."""


def of_all_schemes(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of a case's parameters that hold whatever its scheme: not its own, nor what follows from it."""
    scheme = values.get("scheme")
    follows = _defaults(scheme) | {"courant": COURANT}
    if values.get("penalty_constant") is not None:
        follows["time_step"] = PAPER["time_step"]
    left_out = {"scheme", *OWNERS, *(name for name, value in follows.items() if values.get(name) == value)}
    left_out.update(_coefficient_of(scheme))
    return {name: value for name, value in values.items() if name not in left_out}


def of_scheme(scheme: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of a case's parameters that belong to a scheme and are not what its own has by default."""
    defaults = goes_with(values.get("scheme"))
    own = {name: value for name, value in values.items() if scheme in OWNERS.get(name, ())}
    default = {name: (None, defaults.get(name, Method.model_fields[name].default)) for name in own}
    return {name: value for name, value in own.items() if value not in default[name]}


class Method(Parameters):
    """How a flow is computed: scheme, time step, iterations, operators, shift and walls."""

    in_space: ClassVar[int] = 2
    """Number of space dimensions of a case without a parameter for it."""
    usual_sound_speed: ClassVar[float] = 10.0
    """Speed of sound of the weakly compressible schemes where none is given [U]: the density varies by 1 %."""

    scheme: Scheme | None = Field(
        default=None,
        description="augmented Lagrangian SPH, projection ISPH, explicit ISPH, weakly compressible SPH, entropically "
        "damped artificial compressibility, or isph set as Shadloo et al. 2011 or Muta et al. 2020 (sisph) have it; "
        "alsph if not given",
    )
    sound_speed: float | None = Field(
        default=None, gt=0, description="speed of sound of wcsph and edac, 10 if not given [U]"
    )
    density_diffusion: Literal["antuono", "molteni", "none"] | None = Field(
        default=None, description="density diffusion of wcsph, antuono if not given"
    )
    diffusion_coefficient: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="δ of wcsph, 0.1 if not given, or α of edac, 0.5 if not given [-]",
    )
    solver: Literal["bicgstab", "multigrid", "jacobi"] | None = Field(
        default=None,
        description="how isph solves the Poisson equation of the pressure, bicgstab if not given",
    )
    solver_tolerance: float | None = Field(
        default=None,
        ge=0,
        lt=1,
        description="relative residual that a solve of isph ends with, or of jacobi the change of an iteration; "
        "1e-3 if not given [-]",
    )
    solver_iterations: int | None = Field(
        default=None,
        ge=1,
        le=1000,
        description="cap of the iterations of a solve of isph, 200 if not given; iterations of explicit_isph, 1 if "
        "not given [-]",
    )
    pressure_share: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="how much of the old pressure isph's predicted velocity has felt, 0.9 if not given; "
        "0: the pressure is solved anew in every step [-]",
    )
    density_relaxation: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="share of the error of the number density that a step of isph or explicit_isph takes off beside "
        "the divergence; 0 if not given; 1: the density constraint of Shao and Lo 2003 [-]",
    )
    mach_number: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="artificial Mach number that the step of explicit_isph keeps, 0.1 if not given [-]",
    )
    courant: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="Courant number u_max Δt/Δx of a step, which the penalty follows; if not given 0.3, or none where "
        "time_step, penalty_constant or, with alsph, an algorithm of the paper are [-]",
    )
    time_step: float | None = Field(
        default=None,
        gt=0,
        description="upper bound of the time step, ΔtU/Δx; if not given none but courant's, or 0.0508 beside a "
        "penalty_constant [-]",
    )
    adaptive_time_step: bool = Field(
        default=True, description="take a smaller time step where the stability law asks for it"
    )
    adaptive_until: float | None = Field(
        default=None,
        gt=0,
        description="time from which on every step is time_step all the same; never if not given [D/U]",
    )
    time_step_safety: float = Field(
        default=0.9,
        gt=0,
        le=1,
        description="fraction of the penalty's stability law that a step beside a penalty_constant takes [-]",
    )
    algorithm: Literal["midpoint", 1, 2, "original"] = Field(
        default="midpoint",
        description="derivatives in the middle of the step, of second order in time; the paper's at updated (1) or "
        "initial positions (2); or 1 with a search in every iteration; isph updates them by the old velocity",
    )
    max_iterations: int = Field(default=2, ge=1, le=1000, description="cap of the inner iterations of a step [-]")
    projection_sweeps: int = Field(
        default=4,
        ge=0,
        le=1000,
        description="projection sweeps after the iterations of a step, 0 in the paper; 1 if not given with isph "
        "and explicit_isph [-]",
    )
    sweep_weights: Literal["chebyshev", "equal"] | None = Field(
        default=None,
        description="how far each sweep goes; if not given chebyshev, or equal beside a penalty_constant",
    )
    sweep_pressure: Literal["smooth", "rough"] | None = Field(
        default=None,
        description="what the pressure keeps of the sweeps, without the shortest waves or as it is; if not given "
        "smooth, or rough beside a penalty_constant",
    )
    tolerance: float = Field(default=1e-3, gt=0, description="largest |∇·u| at which the iterations end, ε [U/D]")
    penalty_constant: float | None = Field(
        default=None,
        ge=1,
        le=100,
        description="penalty constant C_BV = (c/u_max)²; if not given it follows the step, or is 100 beside "
        "a time_step without courant [-]",
    )
    smoothing_ratio: float = Field(
        default=4 / 3, ge=1, le=2, description="smoothing length over particle spacing, h/Δx [-]"
    )
    kernel: Kernel = Field(default="quintic_spline", description=f"smoothing kernel; support {SUPPORTS}")
    velocity_laplacian: Literal["scalar", "vector"] = Field(
        default="scalar", description="viscous term per component, or eq. (16) as printed"
    )
    laplacian_correction: bool = Field(
        default=True, description="make the scalar Laplacians vanish for linear fields on any particle arrangement"
    )
    viscous_order: Literal[2, 4] = Field(
        default=4,
        description="order of the viscous term in Δx: the compact Laplacian's own, 2, or without its leading error",
    )
    viscous_theta: float | None = Field(
        default=None,
        ge=0.5,
        le=1,
        description="weight of the new velocity in the viscous term, 1/2 of second order in time, 1 in the paper; if "
        "not given 1/2, or 1 beside a penalty_constant [-]",
    )
    shifting: Literal["strain", "xsph", "maximum_velocity", "none"] = Field(
        default="strain",
        description="particle shifting: eq. (18) with β times how fast the flow strains a neighbourhood, with the XSPH "
        "velocity as in the paper, with β u_max, or none",
    )
    shift_coefficient: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="β of the shifting; if not given 0.75 of strain in 2-D, 0.25 in 3-D; 0.04 of maximum_velocity [-]",
    )
    shift_limit: float = Field(
        default=0.1,
        gt=0,
        le=0.5,
        description="largest shift in a step [Δx]; next to a body the way of the fastest particle, if that is more",
    )
    wall_velocity: Literal["paper", "adami", "morris", "cubic"] = Field(
        default="cubic",
        description="velocity of solid particles in the viscous term: the body's own, or extrapolated for no-slip",
    )
    wall_pressure: Literal["paper", "adami", "linear"] = Field(
        default="linear",
        description="pressure of solid particles: eqs. (10) and (20), or that of the fluid around, constant or linear; "
        "adami if not given with wcsph and edac, whose sound grows where it is linear; paper with alsph alone",
    )

    @model_validator(mode="before")
    @classmethod
    def _what_follows_from_others(cls, values: dict[str, Any]) -> dict[str, Any]:
        values = {name: value for name, value in values.items() if value is not None or name not in _FOLLOWING}
        for name, value in goes_with(values.get("scheme")).items():
            if values.get(name, value) is None or (name not in values and value != cls.model_fields[name].default):
                values = values | {name: value}
        if values.get("shift_coefficient") is None:
            strain = 0.25 if values.get("dimensions", cls.in_space) == 3 else 0.75  # in 3-D more neighbours push
            kind = values.get("shifting")
            values = values | {"shift_coefficient": strain if kind in (None, "strain") else 0.04}
        if values.get("courant") is not None:
            if values.get("penalty_constant") is not None:
                raise ValueError("courant and penalty_constant: the penalty follows one of them; leave the other out")
            return values
        if values.get("scheme") in SCHEMES[1:]:  # it may be anything
            return values if values.get("time_step") is not None else values | {"courant": COURANT}
        if not _as_in_the_paper(values):
            return values | {"courant": COURANT}
        return values | {name: value for name, value in PAPER.items() if values.get(name) is None}

    @model_validator(mode="before")
    @classmethod
    def _what_belongs_to_the_scheme(cls, values: dict[str, Any]) -> dict[str, Any]:
        scheme = values.get("scheme") or "alsph"
        if scheme not in SCHEMES:
            return values  # its own check refuses it
        for name, schemes in OWN.items():
            if values.get(name) is not None and scheme not in schemes:
                raise ValueError(f"{name}: of the scheme {' or '.join(schemes)}, not of {scheme}; leave it out")
        if scheme not in OWNERS["algorithm"] and values.get("algorithm") not in (None, "midpoint"):
            raise ValueError(f"algorithm = {values['algorithm']!r}: not of the scheme {scheme}; leave it out")
        if scheme != "alsph" and values.get("algorithm") == "original":
            raise ValueError(f"algorithm = 'original': of the scheme alsph, not of {scheme}; leave it out")
        return values

    def replace(self, **changes: Any) -> Self:
        """Return a case with some parameters changed; see `superseded`."""
        return super().replace(**dict.fromkeys(superseded(changes, dict(self))) | changes)

    @classmethod
    def schemes(cls) -> tuple[str, ...]:
        """Return the schemes that the case takes."""
        return tuple(name for choice in get_args(cls.model_fields["scheme"].annotation) for name in get_args(choice))

    @property
    def is_weakly_compressible(self) -> bool:
        """Whether the fluid has a speed of sound, whatever the step."""
        return self.scheme in DIFFUSION

    @property
    def is_projection(self) -> bool:
        """Whether a Poisson equation is solved for the pressure."""
        return self.scheme in _ISPH

    def _scheme_settings(self) -> dict[str, Any]:
        """Return the engine's settings of the scheme alone."""
        relaxation = {"density_relaxation": self.density_relaxation or 0.0}
        if self.is_projection:
            return {
                "kind": "isph",
                "pressure_share": 0.9 if self.pressure_share is None else self.pressure_share,
                "solver": self.solver or "bicgstab",
                "tolerance": self.residual_tolerance,
                "max_solver_iterations": self.most_iterations,
                **relaxation,
            }
        if self.scheme == "explicit_isph":
            sweeps = {"sweeps": self.most_iterations, "mach_number": self.mach_number or 0.1}
            return {"kind": self.scheme, **sweeps, **relaxation}
        if not self.is_weakly_compressible:
            return {"kind": "alsph"}
        given = self.diffusion_coefficient
        settings: dict[str, Any] = {
            "kind": self.scheme,
            "sound_speed": self.sound_speed or self.usual_sound_speed,
            "diffusion_coefficient": DIFFUSION[self.scheme or ""] if given is None else given,
        }
        if self.scheme == "wcsph":
            settings["density_diffusion"] = self.density_diffusion or "antuono"
        return settings

    @property
    def residual_tolerance(self) -> float:
        """Relative residual that the Poisson solve of a step is to reach; 0 where there is none to reach."""
        if not self.is_projection:
            return 0.0
        return 1e-3 if self.solver_tolerance is None else self.solver_tolerance

    @property
    def most_iterations(self) -> int:
        """Cap of the iterations of a step, those of the solver where there is one."""
        if self.is_projection:
            return self.solver_iterations or 200
        return self.solver_iterations or 1 if self.scheme == "explicit_isph" else self.max_iterations

    @property
    def passes(self) -> int:
        """About how often a step goes over all pairs of particles."""
        if self.is_weakly_compressible:
            return 7
        if self.is_projection or self.scheme == "explicit_isph":
            iteration = {"multigrid": 4, "bicgstab": 8}.get(self._scheme_settings().get("solver", ""), 1)
            return 9 + iteration * min(self.most_iterations, 4) + 2 * self.projection_sweeps
        iteration = 8 if self.algorithm in (1, "original") else 4
        return 5 + iteration * self.max_iterations + 2 * self.projection_sweeps

    @property
    def support_layers(self) -> int:
        """Support radius in particle spacings, rounded up."""
        return math.ceil(SUPPORT[self.kernel] * self.smoothing_ratio - 1e-9)

    @property
    def buffer_columns(self) -> int:
        """Length of the inlet and outlet buffers, 6h, in particle spacings."""
        return math.ceil(6 * self.smoothing_ratio - 1e-9)

    def method_settings(self) -> dict[str, Any]:
        """Return those of the engine's settings that do not depend on the problem."""
        follows = self.courant is not None or self.is_weakly_compressible
        updated = "updated" if self.scheme in (None, "alsph") else "predicted"
        shared = (
            "smoothing_ratio kernel courant adaptive_time_step adaptive_until time_step_safety max_iterations "
            "projection_sweeps penalty_constant velocity_laplacian laplacian_correction viscous_order shifting "
            "shift_coefficient shift_limit wall_velocity wall_pressure"
        )
        return {name: getattr(self, name) for name in shared.split()} | {
            "scheme": self._scheme_settings(),
            "viscous_theta": self.viscous_theta or (0.5 if follows else 1.0),
            "sweep_weights": self.sweep_weights or ("chebyshev" if follows else "equal"),
            "sweep_pressure": self.sweep_pressure or ("smooth" if follows else "rough"),
            "derivative_frame": {2: "initial", "midpoint": "midpoint"}.get(self.algorithm, updated),
            "search_every_iteration": self.algorithm == "original",
            "divergence_tolerance": self.tolerance,
        }
