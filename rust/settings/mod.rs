//! Numerical settings: what a simulation is told beside its particles.

use crate::base::Vector;
use crate::base::error::{Result, setting};
use crate::kernel::KernelKind;
use serde::{Deserialize, Serialize};

mod domain;
mod lattice;
mod limits;
mod rules;

pub use domain::{Body, Boundary, Domain, Rigid};
pub use lattice::Eigenvalues;
pub use limits::{TimeStepLimits, jacobi_damping};
pub use rules::{
    DensityDiffusion, DerivativeFrame, FreeSurface, PressureGradient, ProjectionSettings, SchemeSettings, Shifting, Solver,
    SweepPressure, SweepWeights, VelocityLaplacian, WallPressure, WallVelocity,
};

/// Iterations or sweeps of a step above which a number is a mistake: a step cannot be interrupted.
const MOST_PASSES: f64 = 1000.0;

/// All that governs a simulation beside its particles. Any consistent units.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    pub dimensions: usize,
    /// Δx.
    pub particle_spacing: f64,
    /// h/Δx.
    pub smoothing_ratio: f64,
    pub kernel: KernelKind,
    pub density: f64,
    /// ν.
    pub kinematic_viscosity: f64,
    /// Body force per unit mass, g.
    pub body_force: Vec<f64>,
    /// Largest Δt.
    pub time_step: f64,
    /// Largest u_max Δt/Δx of an adaptive step; no bound if not given.
    #[serde(default)]
    pub courant: Option<f64>,
    /// Take less than `time_step` where the stability law asks for it.
    pub adaptive_time_step: bool,
    /// Time from which on every step is `time_step` all the same.
    pub adaptive_until: Option<f64>,
    /// Speed that no particle reaches unless the computation has gone wrong; none if not given.
    #[serde(default)]
    pub velocity_limit: Option<f64>,
    /// Fraction of the penalty's stability law that an adaptive step uses for a given C_BV.
    pub time_step_safety: f64,
    #[serde(default)]
    pub scheme: SchemeSettings,
    /// None if the fluid fills the domain.
    #[serde(default)]
    pub free_surface: Option<FreeSurface>,
    pub derivative_frame: DerivativeFrame,
    /// Search the neighbours again in every iteration (Fatehi et al. 2019). Only with the updated frame.
    pub search_every_iteration: bool,
    /// Cap of the inner iterations.
    pub max_iterations: usize,
    /// Projection sweeps after the iterations of a step; none in the paper.
    pub projection_sweeps: usize,
    pub sweep_weights: SweepWeights,
    pub sweep_pressure: SweepPressure,
    /// ε of (13), 1/time.
    pub divergence_tolerance: f64,
    /// C_BV, as in the paper; if not given r_AL Δt λ_max is 1, whatever the step.
    #[serde(default)]
    pub penalty_constant: Option<f64>,
    /// Weight of the ∇²u of the new velocity in the viscous term, the rest being that of the old: 1 in (8), ½ of second order in time.
    pub viscous_theta: f64,
    pub velocity_laplacian: VelocityLaplacian,
    /// Correct the scalar Laplacians so that they vanish for linear fields on any particle arrangement.
    pub laplacian_correction: bool,
    /// Order of the viscous term in the particle spacing, 2 or 4.
    pub viscous_order: u8,
    pub shifting: Shifting,
    /// β of the shift, of `strain` and `maximum_velocity`.
    pub shift_coefficient: f64,
    /// Largest shift in a step over Δx; of what touches a body the way of the fastest in the step, if that is more.
    pub shift_limit: f64,
    pub wall_velocity: WallVelocity,
    pub wall_pressure: WallPressure,
    pub domain: Domain,
    pub bodies: Vec<Body>,
}

impl Settings {
    /// Parse and validate.
    pub fn from_json(text: &str) -> Result<Self> {
        let settings: Self = serde_json::from_str(text).map_err(|e| setting("settings", e.to_string()))?;
        settings.validate()?;
        Ok(settings)
    }

    /// h.
    pub fn smoothing_length(&self) -> f64 {
        self.smoothing_ratio * self.particle_spacing
    }

    /// Whether steps push with more than the pressure that they leave ([`crate::particles::Particles::unkept_pressure`]).
    pub fn has_unkept_pressure(&self) -> bool {
        self.free_surface.is_none() && !matches!(self.scheme, SchemeSettings::Wcsph { .. } | SchemeSettings::Edac { .. })
    }

    /// Whether the pressure errs from layer to layer next to walls, so that a sample of it follows its gradient, too: in every scheme but
    /// ALSPH, whose sum of many small corrections is smooth. Beside a free surface gradients are formed otherwise.
    pub fn pressure_alternates(&self) -> bool {
        self.free_surface.is_none() && !matches!(self.scheme, SchemeSettings::Alsph)
    }

    /// Radius beyond which the kernel vanishes.
    pub fn support_radius(&self) -> f64 {
        self.kernel.support() * self.smoothing_length()
    }

    /// Distance up to which others count as neighbours: the support radius and a hair, because on a lattice many lie at just the
    /// support radius (4 Δx at h/Δx = 4/3), and rounding must not decide which of them count.
    pub fn neighbour_distance(&self) -> f64 {
        self.support_radius() * (1.0 + 5e-7)
    }

    /// Length of the inlet and outlet buffers: 6h, in whole spacings.
    pub fn buffer_length(&self) -> f64 {
        (6.0 * self.smoothing_ratio - 1e-9).ceil() * self.particle_spacing
    }

    /// A box beyond which nothing is expected: the domain, its buffers and solid walls.
    pub fn bounds<const D: usize>(&self) -> (Vector<D>, Vector<D>) {
        let margin = self.buffer_length() + 4.0 * self.support_radius();
        let corner = |corner: &[f64], outward| Vector::from_fn(|axis, _| corner[axis] + outward * margin);
        (corner(&self.domain.lower, -1.0), corner(&self.domain.upper, 1.0))
    }

    /// Refuse settings that cannot be computed with.
    pub fn validate(&self) -> Result<()> {
        if !(2..=3).contains(&self.dimensions) {
            return Err(setting("dimensions", format!("must be 2 or 3, not {}", self.dimensions)));
        }
        if ![2, 4].contains(&self.viscous_order) {
            return Err(setting("viscous_order", format!("must be 2 or 4, not {}", self.viscous_order)));
        }
        let positive = [
            ("particle_spacing", self.particle_spacing),
            ("smoothing_ratio", self.smoothing_ratio),
            ("density", self.density),
            ("time_step", self.time_step),
            ("courant", self.courant.unwrap_or(1.0)),
            ("time_step_safety", self.time_step_safety),
            ("divergence_tolerance", self.divergence_tolerance),
            ("shift_limit", self.shift_limit),
            ("velocity_limit", self.velocity_limit.unwrap_or(1.0)),
        ];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(setting(name, format!("must be a positive number, not {value}")));
            }
        }
        for (name, value) in
            [("kinematic_viscosity", self.kinematic_viscosity), ("shift_coefficient", self.shift_coefficient)]
        {
            if !(value.is_finite() && value >= 0.0) {
                return Err(setting(name, format!("must be a number not below zero, not {value}")));
            }
        }
        let ranges = [
            ("smoothing_ratio", self.smoothing_ratio, 0.8, 3.0),
            ("penalty_constant", self.penalty_constant.unwrap_or(1.0), 1.0, 100.0),
            ("viscous_theta", self.viscous_theta, 0.5, 1.0),
            ("max_iterations", self.max_iterations as f64, 1.0, MOST_PASSES),
            ("projection_sweeps", self.projection_sweeps as f64, 0.0, MOST_PASSES),
        ];
        for (name, value, lowest, highest) in ranges {
            if !(lowest..=highest).contains(&value) {
                return Err(setting(name, format!("must lie in {lowest}..{highest}, not {value}")));
            }
        }
        if self.search_every_iteration && self.derivative_frame != DerivativeFrame::Updated {
            return Err(setting("search_every_iteration", "needs derivative_frame = \"updated\""));
        }
        // On surfaces, too.
        self.kernel.validate(self.dimensions)?;
        self.kernel.validate(self.dimensions - 1)?;
        self.validate_scheme()?;
        self.validate_free_surface()?;
        domain::validate_vector("body_force", &self.body_force, self.dimensions)?;
        domain::validate_bodies(&self.bodies, self.dimensions)?;
        if self.wall_pressure == WallPressure::Paper && self.bodies.iter().any(Body::is_rigid) {
            return Err(setting("wall_pressure", "must be \"linear\" or \"adami\" where bodies move by a rule or freely"));
        }
        self.domain.validate(self.dimensions, self.support_radius())
    }

    /// Whether the fluid has a free surface and no tension, so that it may splash. What is thin keeps a pressure below that of the air too long
    /// where Jacobi's steps are as short as a splash needs them.
    pub fn splashes(&self) -> bool {
        self.free_surface.is_some_and(|own| !own.tension)
    }

    fn validate_free_surface(&self) -> Result<()> {
        let has = |sides: [Boundary; 2]| self.domain.boundaries.iter().flatten().any(|side| sides.contains(side));
        let Some(surface) = self.free_surface else {
            if has([Boundary::Air; 2]) {
                return Err(setting(
                    "domain.boundaries",
                    "air lies beyond a free surface alone, which `free_surface` tells of",
                ));
            }
            return Ok(());
        };
        surface.validate()?;
        let relaxation = match self.scheme {
            SchemeSettings::Isph(own) => own.density_relaxation,
            SchemeSettings::ExplicitIsph { density_relaxation, .. } => density_relaxation,
            _ => 0.0,
        };
        use DerivativeFrame::{Initial, Midpoint};
        for (name, fits, needed) in [
            ("scheme.density_relaxation", relaxation == 0.0, "0"),
            ("derivative_frame", matches!(self.derivative_frame, Midpoint | Initial), "midpoint or initial"),
            ("shifting", self.shifting == Shifting::None, "none"),
            ("viscous_order", self.viscous_order == 2, "2"),
            ("velocity_laplacian", self.velocity_laplacian == VelocityLaplacian::Scalar, "scalar"),
            ("wall_pressure", self.wall_pressure != WallPressure::Paper, "linear or adami"),
            ("wall_velocity", self.bodies.is_empty() || self.wall_velocity != WallVelocity::Cubic, "adami, morris or paper"),
            ("domain.boundaries", !has([Boundary::Inlet, Boundary::Outlet]), "without inlets and outlets"),
        ] {
            if !fits {
                return Err(setting(name, format!("must be {needed} beside a free surface")));
            }
        }
        Ok(())
    }

    fn validate_scheme(&self) -> Result<()> {
        match self.scheme {
            SchemeSettings::Alsph if self.derivative_frame == DerivativeFrame::Predicted => {
                return Err(setting(
                    "derivative_frame",
                    "must be \"updated\", \"initial\" or \"midpoint\" in the scheme alsph",
                ));
            }
            SchemeSettings::Alsph => return Ok(()),
            SchemeSettings::Isph(own) => own.validate()?,
            SchemeSettings::ExplicitIsph { sweeps, mach_number, density_relaxation } => {
                if !(0.0..=1.0).contains(&density_relaxation) {
                    let problem = format!("must lie in 0..1, not {density_relaxation}");
                    return Err(setting("scheme.density_relaxation", problem));
                }
                if !(1.0..=MOST_PASSES).contains(&(sweeps as f64)) {
                    return Err(setting("scheme.sweeps", format!("must lie in 1..{MOST_PASSES}, not {sweeps}")));
                }
                if !(mach_number > 0.0 && mach_number <= 1.0) {
                    let problem = format!("must be a positive number up to 1, not {mach_number}");
                    return Err(setting("scheme.mach_number", problem));
                }
            }
            SchemeSettings::Wcsph { sound_speed, diffusion_coefficient, .. }
            | SchemeSettings::Edac { sound_speed, diffusion_coefficient } => {
                if !(sound_speed.is_finite() && sound_speed > 0.0) {
                    return Err(setting("scheme.sound_speed", format!("must be a positive number, not {sound_speed}")));
                }
                if !(0.0..=1.0).contains(&diffusion_coefficient) {
                    let problem = format!("must lie in 0..1, not {diffusion_coefficient}");
                    return Err(setting("scheme.diffusion_coefficient", problem));
                }
            }
        }
        let projects = matches!(self.scheme, SchemeSettings::Isph(_) | SchemeSettings::ExplicitIsph { .. });
        if projects && self.derivative_frame == DerivativeFrame::Updated {
            return Err(setting("derivative_frame", "must be \"initial\", \"predicted\" or \"midpoint\" in this scheme"));
        }
        if self.velocity_laplacian == VelocityLaplacian::Vector {
            return Err(setting("velocity_laplacian", "must be \"scalar\" but in the scheme alsph"));
        }
        if self.wall_pressure == WallPressure::Paper {
            return Err(setting("wall_pressure", "must be \"linear\" or \"adami\" but in the scheme alsph"));
        }
        Ok(())
    }
}
