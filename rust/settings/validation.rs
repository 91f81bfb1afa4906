//! Checks of settings.

use super::{Boundary, DerivativeFrame, Domain, SchemeSettings, Settings, VelocityLaplacian, WallPressure};
use crate::base::error::{Result, setting};

/// Iterations or sweeps of a step above which a number is a mistake: a step cannot be interrupted.
const MOST_PASSES: usize = 1000;

impl Settings {
    /// Refuse settings that cannot be computed with.
    pub(super) fn validate(&self) -> Result<()> {
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
        if !(0.8..=3.0).contains(&self.smoothing_ratio) {
            return Err(setting("smoothing_ratio", format!("must lie in 0.8..3, not {}", self.smoothing_ratio)));
        }
        if let Some(constant) = self.penalty_constant.filter(|constant| !(1.0..=100.0).contains(constant)) {
            return Err(setting("penalty_constant", format!("must lie in 1..100, not {constant}")));
        }
        if !(0.5..=1.0).contains(&self.viscous_theta) {
            return Err(setting("viscous_theta", format!("must lie in 0.5..1, not {}", self.viscous_theta)));
        }
        if !(1..=MOST_PASSES).contains(&self.max_iterations) {
            return Err(setting("max_iterations", format!("must lie in 1..{MOST_PASSES}, not {}", self.max_iterations)));
        }
        if self.projection_sweeps > MOST_PASSES {
            return Err(setting(
                "projection_sweeps",
                format!("must lie in 0..{MOST_PASSES}, not {}", self.projection_sweeps),
            ));
        }
        if self.search_every_iteration && self.derivative_frame != DerivativeFrame::Updated {
            return Err(setting("search_every_iteration", "needs derivative_frame = \"updated\""));
        }
        self.validate_scheme()?;
        self.validate_vector("body_force", &self.body_force)?;
        for (k, body) in self.bodies.iter().enumerate() {
            if self.bodies[..k].iter().any(|other| other.name == body.name) {
                return Err(setting("bodies", format!("two are named \"{}\"; names must differ", body.name)));
            }
            self.validate_vector(&format!("bodies.{}.velocity", body.name), &body.velocity)?;
            self.validate_vector(&format!("bodies.{}.center", body.name), &body.center)?;
        }
        self.validate_domain()
    }

    fn validate_scheme(&self) -> Result<()> {
        let (sound_speed, coefficient) = match self.scheme {
            SchemeSettings::Alsph => return Ok(()),
            SchemeSettings::Wcsph { sound_speed, diffusion_coefficient, .. }
            | SchemeSettings::Edac { sound_speed, diffusion_coefficient } => (sound_speed, diffusion_coefficient),
        };
        if !(sound_speed.is_finite() && sound_speed > 0.0) {
            return Err(setting("scheme.sound_speed", format!("must be a positive number, not {sound_speed}")));
        }
        if !(0.0..=1.0).contains(&coefficient) {
            return Err(setting("scheme.diffusion_coefficient", format!("must lie in 0..1, not {coefficient}")));
        }
        if self.velocity_laplacian == VelocityLaplacian::Vector {
            return Err(setting("velocity_laplacian", "must be \"scalar\" but in the scheme alsph"));
        }
        if self.wall_pressure == WallPressure::Paper {
            return Err(setting("wall_pressure", "must be \"linear\" or \"adami\" but in the scheme alsph"));
        }
        Ok(())
    }

    fn validate_vector(&self, name: &str, vector: &[f64]) -> Result<()> {
        if vector.len() != self.dimensions || !vector.iter().all(|x| x.is_finite()) {
            return Err(setting(name, format!("must be {} finite numbers, not {vector:?}", self.dimensions)));
        }
        Ok(())
    }

    fn validate_domain(&self) -> Result<()> {
        let Domain { lower, upper, boundaries } = &self.domain;
        self.validate_vector("domain.lower", lower)?;
        self.validate_vector("domain.upper", upper)?;
        if boundaries.len() != self.dimensions {
            return Err(setting("domain.boundaries", format!("must have {} pairs, one a direction", self.dimensions)));
        }
        for (axis, pair) in boundaries.iter().enumerate() {
            if upper[axis] - lower[axis] < self.support_radius() {
                let problem = format!("direction {axis} is shorter than the support radius {}", self.support_radius());
                return Err(setting("domain", problem));
            }
            if (pair[0] == Boundary::Periodic) != (pair[1] == Boundary::Periodic) {
                return Err(setting("domain.boundaries", format!("direction {axis} is periodic on one side only")));
            }
        }
        Ok(())
    }
}
