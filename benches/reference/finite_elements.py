"""Incompressible flow past bodies in a channel with NGSolve: what the reference solutions here share.

Velocity of order 4 and pressure of order 3 on curved elements. In time, second-order backward differences with an
extrapolated convective term. At the outlet the traction vanishes (natural condition); the side walls let slip.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import netgen.occ as occ
import ngsolve as ng
from ngsolve.nonlinearsolvers import Newton

HOLD = 16
"""The step may be doubled when this many of it have been taken."""


def past_cylinder(
    channel: tuple[float, float, float],
    wake: tuple[float, float],
    size: float,
    curve: int,
    offset: float = 0.0,
    sides: str = "side",
) -> ng.Mesh:
    """Return the mesh of a channel (length, height, upstream) [D] around a cylinder, whose centre has y = 0.

    From 1 D before its centre to the outlet, from a height `wake[0]` on and `wake[1]` high [D], elements have a `size`
    [D]; they are of the order `curve` at the cylinder. The centre lies `offset` above the channel's; `sides` is what
    its sides are called, "inlet" where they do not let slip, as the inflow vanishes there.
    """
    length, height, upstream = channel
    whole = occ.MoveTo(0, -height / 2 - offset).Rectangle(length, height).Face()
    for edge in whole.edges:
        at = edge.center.x
        edge.name = "inlet" if abs(at) < 1e-6 else "outlet" if abs(at - length) < 1e-6 else sides
    behind = occ.MoveTo(upstream - 1, wake[0]).Rectangle(length - upstream + 1, wake[1]).Face()
    near, disc = (occ.Circle((upstream, 0), radius).Face() for radius in (1.0, 0.5))
    behind.faces.maxh, near.faces.maxh = size, 0.13
    disc.edges.name, disc.edges.maxh = "body", 0.08
    parts = occ.Glue([whole - behind - near - disc, behind - near - disc, near - disc])
    return ng.Mesh(occ.OCCGeometry(parts, dim=2).GenerateMesh(maxh=0.8, grading=0.3)).Curve(curve)


class Flow:
    """Velocity and pressure on a mesh whose boundaries are named inlet, outlet, side and body; U = ρ = 1.

    Parameters
    ----------
    mesh
        The mesh, curved.
    reynolds
        UD/ν.
    order
        Order of the velocity's elements; that of the pressure's is one less.
    inflow
        The velocity (2,) at the inlet [U].
    surface
        The velocity (2,) of the body's surface, along itself [U].
    round
        Whether the flow is the same all around the axis y = 0, where the mesh ends, called side.
    """

    def __init__(
        self,
        mesh: ng.Mesh,
        reynolds: float,
        order: int = 4,
        inflow: tuple[ng.CoefficientFunction | float, ...] = (1, 0),
        surface: ng.CoefficientFunction | tuple[float, float] = (0, 0),
        *,
        round: bool = False,
    ) -> None:
        self.mesh, self.body = mesh, mesh.Boundaries("body")
        self._round, self._around = round, 2 * math.pi * ng.y if round else ng.CoefficientFunction(1)
        velocity = ng.VectorH1(mesh, order=order, dirichletx="inlet|body", dirichlety="inlet|side|body")
        self.space = velocity * ng.H1(mesh, order=order - 1)
        self.flow, self._inflow = ng.GridFunction(self.space), ng.GridFunction(self.space)
        self.velocity, self.pressure = self.flow.components
        given = mesh.BoundaryCF({"inlet": ng.CoefficientFunction(inflow), "body": ng.CoefficientFunction(surface)})
        self._inflow.components[0].Set(given, definedon=mesh.Boundaries("inlet|body"))
        self.flow.vec.data = self._inflow.vec
        (u, p), (v, q) = self.space.TnT()
        strain = ng.InnerProduct(ng.Grad(u) + ng.Grad(u).trans, ng.Grad(v))
        if round:
            strain += 2 * u[1] * v[1] / ng.y**2
        self._stokes = self._around * (strain / reynolds - self._divergence(u) * q - self._divergence(v) * p)
        self._inertia, self._transport = self._around * u * v, self._around * ng.InnerProduct(ng.Grad(u) * u, v)
        self._convection = ng.LinearForm(self.space)
        self._convection += self._around * ng.InnerProduct(ng.Grad(self.velocity) * self.velocity, v) * ng.dx
        self._residual = self.flow.vec.CreateVector()
        self._shifts = [self.shift(along) for along in ((1, 0), (0, 1))]

    def march(self, until: float, step: float, doublings: int = 0) -> Iterator[float]:
        """Go on from the velocity at t* = 0, which may slip on the body, to `until`; yield the time after each step.

        The first steps are ``step / 2**doublings``, as the layers of an impulsive start are thin.
        """
        mass = ng.BilinearForm(self._inertia * ng.dx).Assemble().mat
        right = self.flow.vec.CreateVector()
        now, time, states, convections = step / 2**doublings, 0.0, [], []  # the newest first
        while time < until - now / 2:
            self._convection.Assemble()
            states = [self.flow.vec.Copy(), *states[:2]]
            convections = [self._convection.vec.Copy(), *convections[:2]]
            doubled = now < step and round(time / now) == HOLD
            if doubled:
                now, states, convections = 2 * now, states[::2], convections[::2]
            if len(states) == 1:
                matrix, inverse, given = self._implicit(1 / now)
                right.data = 1 / now * (mass * states[0]) - convections[0]
            else:
                if doubled or len(states) == 2:
                    matrix, inverse, given = self._implicit(1.5 / now)
                right.data = 1 / now * (mass * (2 * states[0] - 0.5 * states[1])) + convections[1] - 2 * convections[0]
            self.flow.vec.data = self._inflow.vec + inverse * (right - given)
            self._residual.data = matrix * self.flow.vec - right
            time += now
            yield time

    def settle(self) -> None:
        """Go on to the steady flow, by Newton's method."""
        form = ng.BilinearForm((self._stokes + self._transport) * ng.dx)
        Newton(form, self.flow, inverse="umfpack", maxerr=1e-10, printing=False)
        form.Apply(self.flow.vec, self._residual)

    def shift(self, along: tuple[ng.CoefficientFunction | float, ...]) -> ng.GridFunction:
        """Return a velocity that the body's surface has and nothing else."""
        shift = ng.GridFunction(self.space)
        shift.components[0].Set(ng.CoefficientFunction(along), definedon=self.body)
        return shift

    def push(self, shift: ng.GridFunction) -> float:
        """Return the power of the fluid on a body that moves so, over ½: what the momentum equation lacks on it."""
        return -2 * ng.InnerProduct(self._residual, shift.vec)

    def loads(self) -> list[float]:
        """Return drag, its pressure and its viscous part, and those of the lift, with ½ρU²D (½ρU²D² if `round`).

        The whole is :meth:`push`, which is more exact at corners than an integral over the surface, as which the
        pressure's part is found; the viscous one is the rest.
        """
        loads = []
        for shift in self._shifts:
            moved = shift.components[0]
            density = self._around * (ng.Grad(self.pressure) * moved + self.pressure * self._divergence(moved))
            whole, pressure = self.push(shift), 2 * ng.Integrate(density, self.mesh)
            loads += [whole, pressure, whole - pressure]
        return loads

    def _divergence(self, velocity: ng.CoefficientFunction) -> ng.CoefficientFunction:
        spread = velocity[1] / ng.y if self._round else 0
        return ng.div(velocity) + spread

    def _implicit(self, rate: float) -> tuple[ng.BaseMatrix, ng.BaseMatrix, ng.BaseVector]:
        """Return matrix and inverse of the implicit terms, and what they make of the velocity that is given."""
        form = ng.BilinearForm((self._stokes + rate * self._inertia) * ng.dx, symmetric=True).Assemble()
        inverse = form.mat.Inverse(self.space.FreeDofs(), inverse="sparsecholesky")
        return form.mat, inverse, (form.mat * self._inflow.vec).Evaluate()
