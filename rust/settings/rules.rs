//! The choices of a method.

use super::MOST_PASSES;
use crate::base::Matrix;
use crate::base::error::{Result, setting};
use serde::{Deserialize, Serialize};

/// How velocity and pressure come from one step to the next, with the parameters that are the scheme's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum SchemeSettings {
    /// Augmented Lagrangian SPH.
    #[default]
    Alsph,
    /// Projection ISPH.
    Isph(ProjectionSettings),
    /// ISPH whose Poisson equation gets a few steps of Jacobi's iteration from the old pressure, whatever they leave.
    ExplicitIsph {
        /// Steps of the iteration.
        sweeps: usize,
        /// Largest artificial Mach number, which bounds the step.
        mach_number: f64,
        /// As [`ProjectionSettings::density_relaxation`].
        #[serde(default)]
        density_relaxation: f64,
    },
    /// Weakly compressible SPH.
    Wcsph {
        /// c₀.
        sound_speed: f64,
        density_diffusion: DensityDiffusion,
        /// δ.
        diffusion_coefficient: f64,
    },
    /// Entropically damped artificial compressibility.
    Edac {
        /// c₀.
        sound_speed: f64,
        /// α.
        diffusion_coefficient: f64,
    },
}

/// What projection ISPH has of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProjectionSettings {
    /// β: how much of the old pressure the predicted velocity has felt.
    pub pressure_share: f64,
    pub solver: Solver,
    /// Largest ‖f + ∇²x‖ / ‖f‖ that a solve ends with; of Jacobi's iteration the largest change of x in one, Σ|Δx| / Σ|x|.
    pub tolerance: f64,
    pub max_solver_iterations: usize,
    /// α: how much of the error of the number density a step takes off beside ∇·u. 0: that of ∇·u alone; 1: the density, as Shao and Lo
    /// (2003) have it, to first order in Δt; small values hold it in the long run (Asai et al. 2012).
    #[serde(default)]
    pub density_relaxation: f64,
}

impl ProjectionSettings {
    pub(super) fn validate(&self) -> Result<()> {
        for (name, value, lowest, highest) in [
            ("scheme.pressure_share", self.pressure_share, 0.0, 1.0),
            ("scheme.tolerance", self.tolerance, 0.0, 1.0),
            ("scheme.density_relaxation", self.density_relaxation, 0.0, 1.0),
            ("scheme.max_solver_iterations", self.max_solver_iterations as f64, 1.0, MOST_PASSES),
        ] {
            if !(lowest..=highest).contains(&value) {
                return Err(setting(name, format!("must lie in {lowest}..{highest}, not {value}")));
            }
        }
        Ok(())
    }
}

/// A surface that is free: beyond it is air of no pressure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FreeSurface {
    /// U₀, such as √(gH): the least that u_max counts in the time step, so that a fluid at rest has one.
    pub reference_velocity: f64,
    pub pressure_gradient: PressureGradient,
    /// Whether the pressure may fall below that of the air, as in a fluid that turns or is stretched.
    pub tension: bool,
    /// α: how much of a number density above the lattice's a step takes off beside ∇·u.
    pub packing_relaxation: f64,
    /// Of what velocities do between two particles beside being linear [U₀ Δx].
    pub artificial_viscosity: f64,
}

impl FreeSurface {
    pub(super) fn validate(&self) -> Result<()> {
        if !(self.reference_velocity.is_finite() && self.reference_velocity > 0.0) {
            let problem = format!("must be a positive number, not {}", self.reference_velocity);
            return Err(setting("free_surface.reference_velocity", problem));
        }
        let shares = [("packing_relaxation", self.packing_relaxation), ("artificial_viscosity", self.artificial_viscosity)];
        for (name, share) in shares {
            if !(0.0..=1.0).contains(&share) {
                return Err(setting(format!("free_surface.{name}"), format!("must lie in 0..1, not {share}")));
            }
        }
        Ok(())
    }
}

/// The pressure gradient of a fluid with a free surface: forces between two particles are equal and opposite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PressureGradient {
    /// Σ (p_i + p_j) ∇W V_j: momentum is kept, angular momentum too.
    Conservative,
    /// Σ (p_i B_i + p_j B_j) ∇W V_j, minus the adjoint of the divergence: energy is kept, too.
    Adjoint,
}

/// How the Poisson equation of the pressure is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// Cycles of multigrid on a background grid, each with a few steps of Chebyshev's iteration.
    Multigrid,
    /// BiCGSTAB preconditioned by them.
    Bicgstab,
    /// Damped Jacobi iteration.
    Jacobi,
}

/// Diffusion of the density in weakly compressible SPH.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DensityDiffusion {
    None,
    /// δ h c₀ ∇²ρ (Molteni and Colagrossi 2009).
    Molteni,
    /// The same less that of the gradient, δ h c₀ (∇² − ∇·∇) ρ, which leaves a smooth field as it is (after Antuono et al. 2010).
    Antuono,
}

/// At which positions the derivatives inside the iteration are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DerivativeFrame {
    /// Algorithm 1: ⟨ ⟩ at r^{n+1,m}.
    Updated,
    /// Algorithm 2: ⟨ ⟩ at r^n.
    Initial,
    /// ⟨ ⟩ at r^n + u^n Δt (Cummins and Rudman 1999). Not with ALSPH.
    Predicted,
    /// ⟨ ⟩ at r^n + ½ u^n Δt, where u^{n+1} is given the divergence that makes it solenoidal at r^{n+1}: of second order in time.
    Midpoint,
}

impl DerivativeFrame {
    /// How far of the way u^n Δt the frame lies before the iteration.
    pub fn fraction(self) -> f64 {
        match self {
            Self::Updated | Self::Initial => 0.0,
            Self::Midpoint => 0.5,
            Self::Predicted => 1.0,
        }
    }

    /// The ∇·u that a u^{n+1} of this ∇u, solenoidal once the particles have moved, has in the frame: in the middle of the step, half a
    /// step before r^{n+1}, it is ½Δt tr (∇u)². Zero in the paper's algorithms, and where the frame is r^{n+1} to second order.
    #[inline(always)]
    pub fn solenoidal_divergence<const D: usize>(self, gradient: &Matrix<D>, time_step: f64) -> f64 {
        if self == Self::Midpoint { 0.5 * time_step * (gradient * gradient).trace() } else { 0.0 }
    }
}

/// Form of the viscous Laplacian (16).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VelocityLaplacian {
    /// One compact scalar Laplacian a component.
    Scalar,
    /// (16) as printed, with the correction tensor.
    Vector,
}

/// Velocity scale of the particle shift (18).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shifting {
    /// `shift_coefficient` times the larger of h (½ tr (∇u)²)^½, the rate at which the flow presses neighbours together, and a third of the
    /// root mean square of the neighbours' relative velocities.
    Strain,
    /// The XSPH velocity modulus u_v, as in (18), which vanishes at stagnation points.
    Xsph,
    /// `shift_coefficient` times the largest velocity, the older form.
    MaximumVelocity,
    None,
}

/// How far each of the projection sweeps goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SweepWeights {
    /// All as far as the shortest waves allow.
    Equal,
    /// Together the polynomial of Chebyshev that is least over all waves but the longest.
    Chebyshev,
}

/// What the pressure keeps of the projection sweeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SweepPressure {
    /// Its share as it is.
    Rough,
    /// Its share without the shortest waves, of which the gradient sees next to nothing.
    Smooth,
}

/// Velocity that a solid particle shows to the viscous term of a fluid neighbour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WallVelocity {
    /// The velocity of the wall itself, as in the paper.
    Paper,
    /// 2 u_wall minus the Shepard average of the fluid's (Adami, Hu and Adams 2012).
    Adami,
    /// On the cubic through u_wall at the surface that fits the fluid above it best.
    Cubic,
    /// Per pair, linear through u_wall at the surface, with the ratio of distances limited (Morris, Fox and Zhu 1997).
    Morris,
}

/// Pressure of a solid particle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WallPressure {
    /// (10) with the pseudo-velocity of (8), then (20).
    Paper,
    /// Shepard average of the fluid's with the hydrostatic term (Adami, Hu and Adams 2012).
    Adami,
    /// Shepard average of the fluid's, each continued to the solid particle along its own gradient: exact for linear fields.
    Linear,
}
