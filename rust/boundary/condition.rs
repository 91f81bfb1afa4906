//! What a particle obeys: the one place that every scheme reads.

use crate::base::Vector;
use crate::boundary::side::deep_in_inlet;
use crate::particles::ParticleKind;
use crate::settings::{Settings, WallPressure};

/// Where the velocity of a particle at n+1 comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VelocityRule {
    /// From the momentum equation.
    Solved,
    /// It is prescribed, or that with which the particle has left the domain.
    Kept,
}

/// Where the pressure of a particle comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PressureRule {
    /// From the equation of the scheme.
    Solved,
    /// From that without ∇·u, which the end of a buffer would spoil.
    SolvedWithoutDivergence,
    /// None: an outlet.
    Zero,
    /// From the fluid near it, by [`crate::boundary::extrapolate_pressure`].
    FromFluid,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Condition {
    pub velocity: VelocityRule,
    pub pressure: PressureRule,
}

/// The condition of a particle by its kind and its position.
pub fn conditions<const D: usize>(settings: &Settings) -> impl Fn(ParticleKind, &Vector<D>) -> Condition + Sync {
    let deep_in_inlet = deep_in_inlet(settings);
    let walls = if settings.wall_pressure == WallPressure::Paper { PressureRule::Solved } else { PressureRule::FromFluid };
    move |kind, position| {
        let (velocity, pressure) = match kind {
            ParticleKind::Fluid => (VelocityRule::Solved, PressureRule::Solved),
            ParticleKind::Inlet if deep_in_inlet(position) => (VelocityRule::Kept, PressureRule::SolvedWithoutDivergence),
            ParticleKind::Inlet => (VelocityRule::Kept, PressureRule::Solved),
            ParticleKind::Outlet => (VelocityRule::Kept, PressureRule::Zero),
            ParticleKind::Solid => (VelocityRule::Kept, walls),
        };
        Condition { velocity, pressure }
    }
}
