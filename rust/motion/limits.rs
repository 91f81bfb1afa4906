//! How long a step may be with bodies that move.

use super::{Motion, Moving, Pose};
use crate::base::error::{Result, setting};
use crate::settings::Settings;

/// Up to which shares free bodies answer well: ρ c S Δt over M, where c is given; Δt over √(mass/stiffness) of a spring, as Ā needs some three
/// hundred steps a period, and with fewer the fluid's answer adds energy (a tenth in three periods with sixty); Δt over mass/damping.
const WELL: [f64; 3] = [0.5, 0.02, 0.5];

/// The same, up to which nothing grows at once.
const STABLY: [f64; 3] = [1.0, 1.0, 1.0];

impl<const D: usize> Motion<D> {
    /// Largest Δt with which bodies are followed well.
    pub fn step_limit(&self, settings: &Settings) -> f64 {
        settings.acceleration_limit(self.acceleration()).min(self.response_limit(settings, WELL))
    }

    /// Refuse a constant step with which the motion of a free body would grow.
    pub fn check_step(&self, settings: &Settings) -> Result<()> {
        let most = self.response_limit(settings, STABLY);
        if settings.time_step > most {
            let problem = format!("{} is too long for a free body: at most {most:.3e}", settings.time_step);
            return Err(setting("time_step", problem));
        }
        Ok(())
    }

    /// Largest Δt with which free bodies answer so, by [`WELL`] or [`STABLY`].
    fn response_limit(&self, settings: &Settings, [sounding, springing, damping]: [f64; 3]) -> f64 {
        let speed = settings.sound_speed().unwrap_or(0.0);
        let of = |body: &Moving<D>| {
            let Some(rigid) = &body.rigid else { return f64::INFINITY };
            let free = |of: &[f64]| {
                of.iter().zip(&rigid.free).map(|(value, &free)| if free { *value } else { 0.0 }).fold(0.0, f64::max)
            };
            let moves = rigid.free[..D].contains(&true);
            let sound = if moves { sounding * self.spacing / (speed * body.layer) } else { f64::INFINITY };
            let spring = springing / (free(&rigid.stiffness) * rigid.mass).sqrt();
            rigid.mass * sound.min(spring).min(damping / free(&rigid.damping))
        };
        self.bodies.iter().map(of).fold(f64::INFINITY, f64::min)
    }

    /// The largest acceleration of a body's surface at the start of the step.
    fn acceleration(&self) -> f64 {
        let of = |body: &Moving<D>| {
            let Pose { acceleration, angular_acceleration, spin, .. } = body.start;
            acceleration.norm() + (angular_acceleration.norm() + spin.norm_squared()) * body.radius
        };
        self.bodies.iter().map(of).fold(0.0, f64::max)
    }
}
