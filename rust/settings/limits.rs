//! The stability law of the time step, and the penalty that goes with it.

use super::{Eigenvalues, SchemeSettings, Settings, WallVelocity};

/// c₀Δt over what a lattice's shortest waves bear.
const ACOUSTIC_SHARE: f64 = 0.45;

/// Damping of as many steps of Jacobi's iteration as explicit ISPH takes: particles that an impact presses together bear no whole one.
pub fn jacobi_damping(sweeps: usize) -> f64 {
    if sweeps == 1 { 0.84 } else { 0.67 }
}

/// Upper bounds of Δt; infinite where one does not apply.
#[derive(Clone, Copy, Debug)]
pub struct TimeStepLimits {
    /// The Courant number's.
    pub courant: f64,
    /// r_AL Δt λ_max < 2 for a given C_BV (method section 3).
    pub penalty: f64,
    /// A weakly compressible scheme's: (c₀ + u_max) Δt below a share of what a lattice's shortest waves bear, 2 Δx/√λ. That of explicit ISPH,
    /// whose waves go so far in a step, whatever its length ([`Settings::explicit_reach`]): u_max below its share of their speed.
    pub acoustic: f64,
    /// 0.125 h²/ν.
    pub viscous: f64,
    /// 0.25 sqrt(h/|g|).
    pub body_force: f64,
}

impl Settings {
    /// Stability limits for the largest velocity `velocity_max`.
    pub fn time_step_limits(&self, velocity_max: f64, largest: Eigenvalues) -> TimeStepLimits {
        let gravity = self.body_force.iter().map(|g| g * g).sum::<f64>().sqrt();
        let h = self.smoothing_length();
        let velocity_max = self.reference_velocity(velocity_max);
        let spacing = self.particle_spacing;
        let wave = |constant: f64| velocity_max * (constant * largest.laplacian / 2.0).sqrt();
        TimeStepLimits {
            courant: self.courant.map_or(f64::INFINITY, |courant| courant * spacing / velocity_max),
            penalty: self.penalty_constant.map_or(f64::INFINITY, |constant| spacing / wave(constant)),
            acoustic: self.acoustic_limit(velocity_max, largest),
            viscous: self.viscous_limit() * h * h / self.kinematic_viscosity,
            body_force: self.acceleration_limit(gravity),
        }
    }

    /// Largest Δt where something has such an acceleration: 0.25 sqrt(h/a).
    pub fn acceleration_limit(&self, acceleration: f64) -> f64 {
        0.25 * (self.smoothing_length() / acceleration).sqrt()
    }

    /// Speed of sound, if it is given.
    pub fn sound_speed(&self) -> Option<f64> {
        match self.scheme {
            SchemeSettings::Wcsph { sound_speed, .. } | SchemeSettings::Edac { sound_speed, .. } => Some(sound_speed),
            _ => None,
        }
    }

    /// How far waves go in a step of explicit ISPH: √(Jω/a) Δx with J steps of Jacobi's iteration, ω their damping and a the Laplacian's
    /// diagonal times Δx².
    pub fn explicit_reach(&self, sweeps: usize) -> f64 {
        let relaxed = sweeps as f64 * jacobi_damping(sweeps) / self.laplacian_diagonal();
        relaxed.sqrt() * self.particle_spacing
    }

    fn acoustic_limit(&self, velocity_max: f64, largest: Eigenvalues) -> f64 {
        let spacing = self.particle_spacing;
        match self.scheme {
            SchemeSettings::Alsph | SchemeSettings::Isph(_) => f64::INFINITY,
            SchemeSettings::ExplicitIsph { sweeps, mach_number, .. } => {
                mach_number * self.explicit_reach(sweeps) / velocity_max
            }
            SchemeSettings::Wcsph { sound_speed, .. } | SchemeSettings::Edac { sound_speed, .. } => {
                ACOUSTIC_SHARE * 2.0 * spacing / (largest.projection.sqrt() * (sound_speed + velocity_max))
            }
        }
    }

    /// u_max, beside a free surface at least U₀.
    fn reference_velocity(&self, velocity_max: f64) -> f64 {
        velocity_max.max(self.free_surface.map_or(0.0, |surface| surface.reference_velocity))
    }

    /// r_AL of a step: C_BV u_max² Δt, or half of what the stability law allows, r_AL Δt λ_max = 1: then an iteration takes off all that
    /// the Laplacian's shortest waves have of ∇·u, and less of longer ones.
    pub fn penalty(&self, velocity_max: f64, time_step: f64, largest_eigenvalue: f64) -> f64 {
        let velocity_max = self.reference_velocity(velocity_max);
        match self.penalty_constant {
            Some(constant) => constant * velocity_max * velocity_max * time_step,
            None => self.particle_spacing.powi(2) / (largest_eigenvalue * time_step),
        }
    }

    /// Largest ν Δt / h²: 0.125, and half of it where walls show a cubic, whose velocities beyond the surface are larger than those above
    /// it. (Past a cylinder at Re = 1, h/Δx = 4/3, 0.1 is stable and 0.125 is not.)
    fn viscous_limit(&self) -> f64 {
        if self.wall_velocity == WallVelocity::Cubic { 0.0625 } else { 0.125 }
    }
}
