//! Numerical settings, their validation and the stability law of the time step.

use crate::error::{Result, setting};
use crate::kernel::{KernelKind, Smoothing};
use crate::particles::{Matrix, Vector};
use crate::with_kernel;
use serde::{Deserialize, Serialize};

/// At which positions the derivatives inside the iteration are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DerivativeFrame {
    /// Algorithm 1: ⟨ ⟩ at r^{n+1,m}.
    Updated,
    /// Algorithm 2: ⟨ ⟩ at r^n.
    Initial,
    /// ⟨ ⟩ at r^n + ½ u^n Δt, where u^{n+1} is given the divergence that makes it solenoidal at r^{n+1}: of second order in time.
    Midpoint,
}

impl DerivativeFrame {
    /// How far of the way u^n Δt the frame lies before the iteration.
    pub fn fraction(self) -> f64 {
        if self == Self::Midpoint { 0.5 } else { 0.0 }
    }

    /// The ∇·u that a u^{n+1} of this ∇u, solenoidal once the particles have moved, has in the frame: in the middle of the step, half a
    /// step before r^{n+1}, it is ½Δt tr (∇u)². Zero in the paper's algorithms.
    #[inline(always)]
    pub fn solenoidal_divergence<const D: usize>(self, gradient: &Matrix<D>, time_step: f64) -> f64 {
        let lead = self.fraction() * time_step;
        if lead > 0.0 { lead * (gradient * gradient).trace() } else { 0.0 }
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

/// What closes one side of the domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Boundary {
    None,
    Slip,
    Periodic,
    Inlet,
    Outlet,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    /// [lower side, upper side] of each direction.
    pub boundaries: Vec<[Boundary; 2]>,
}

/// A solid body or wall: the solid particles with its index.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    pub name: String,
    /// Prescribed velocity.
    pub velocity: Vec<f64>,
    /// Whether the particles move with that velocity (a cavity's lid slides in place: false).
    pub moves: bool,
    /// Point that the torque is taken about. It stays where it is when the body moves.
    pub center: Vec<f64>,
}

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
    /// β of the maximum-velocity shift.
    pub shift_coefficient: f64,
    /// Largest shift in a step over Δx.
    pub shift_limit: f64,
    pub wall_velocity: WallVelocity,
    pub wall_pressure: WallPressure,
    pub domain: Domain,
    pub bodies: Vec<Body>,
}

/// Iterations or sweeps of a step above which a number is a mistake: a step cannot be interrupted.
const MOST_PASSES: usize = 1000;

/// Upper bounds of Δt; infinite where one does not apply.
#[derive(Clone, Copy, Debug)]
pub struct TimeStepLimits {
    /// The Courant number's.
    pub courant: f64,
    /// r_AL Δt λ_max < 2 for a given C_BV (method section 3).
    pub penalty: f64,
    /// 0.125 h²/ν.
    pub viscous: f64,
    /// 0.25 sqrt(h/|g|).
    pub body_force: f64,
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

    /// λ_max Δx²: the largest eigenvalue of the negative compact Laplacian on a square lattice, sought over the wave
    /// vectors of the Brillouin zone.
    pub fn largest_laplacian_eigenvalue(&self) -> f64 {
        let (slopes, trace) = self.lattice_slopes();
        let factor = 2.0 * (self.dimensions as f64 + 2.0) / (2.0 + trace);
        let eigenvalue = |phase: &dyn Fn(&[f64; 3]) -> f64| {
            slopes.iter().map(|(r, slope)| -factor * slope * (1.0 - phase(r).cos())).sum()
        };
        self.largest_over_waves(eigenvalue)
    }

    /// The same of −∇·∇, the divergence of the gradient: three to five times smaller, since both operators miss short waves.
    pub fn largest_projection_eigenvalue(&self) -> f64 {
        let (slopes, trace) = self.lattice_slopes();
        let correction = self.dimensions as f64 / trace;
        let eigenvalue = |phase: &dyn Fn(&[f64; 3]) -> f64| {
            let gradient =
                |k: usize| slopes.iter().map(|(r, slope)| correction * slope * r[k] * phase(r).sin()).sum::<f64>();
            (0..3).map(|k| gradient(k).powi(2)).sum()
        };
        self.largest_over_waves(eigenvalue)
    }

    /// The compact Laplacian of a wave of wave number k along an axis of a square lattice is −k² (1 − c k²Δx² + ...): c.
    pub fn laplacian_dispersion(&self) -> f64 {
        let (slopes, trace) = self.lattice_slopes();
        let factor = 2.0 * (self.dimensions as f64 + 2.0) / (2.0 + trace);
        slopes.iter().map(|(r, slope)| -factor * slope * r[0].powi(4) / 24.0).sum()
    }

    /// V_j |∇W|/r, negative, at the points of the unit lattice around the origin, and tr α.
    fn lattice_slopes(&self) -> (Vec<([f64; 3], f64)>, f64) {
        let (ratio, dimensions) = (self.smoothing_ratio, self.dimensions);
        let weights = with_kernel!(self.kernel, K => {
            let smoothing = Smoothing::<K>::new(ratio, dimensions);
            lattice(dimensions, self.kernel.support() * ratio)
                .map(|r| {
                    let distance = r.iter().map(|x| x * x).sum::<f64>().sqrt();
                    let slope = if distance > 0.0 { smoothing.slope(distance) } else { 0.0 };
                    (r, distance, smoothing.value(distance), slope)
                })
                .collect::<Vec<_>>()
        });
        let volume = 1.0 / weights.iter().map(|w| w.2).sum::<f64>();
        let trace = weights.iter().map(|w| -volume * w.3 * w.1 * w.1).sum();
        (weights.into_iter().map(|(r, _, _, slope)| (r, volume * slope)).collect(), trace)
    }

    /// The largest value of `eigenvalue`, which gets the phase of a wave at a lattice point, over the wave vectors.
    fn largest_over_waves(&self, eigenvalue: impl Fn(&dyn Fn(&[f64; 3]) -> f64) -> f64) -> f64 {
        let samples = 16;
        lattice(self.dimensions, samples as f64 * (self.dimensions as f64).sqrt())
            .filter(|k| k.iter().all(|&x| (0.0..=samples as f64).contains(&x)))
            .map(|k| eigenvalue(&|r| (0..3).map(|a| k[a] * r[a]).sum::<f64>() * std::f64::consts::PI / samples as f64))
            .fold(0.0, f64::max)
    }

    /// Stability limits for the largest velocity `velocity_max`.
    pub fn time_step_limits(&self, velocity_max: f64, largest_eigenvalue: f64) -> TimeStepLimits {
        let gravity = self.body_force.iter().map(|g| g * g).sum::<f64>().sqrt();
        let h = self.smoothing_length();
        let spacing = self.particle_spacing;
        let wave = |constant: f64| velocity_max * (constant * largest_eigenvalue / 2.0).sqrt();
        TimeStepLimits {
            courant: self.courant.map_or(f64::INFINITY, |courant| courant * spacing / velocity_max),
            penalty: self.penalty_constant.map_or(f64::INFINITY, |constant| spacing / wave(constant)),
            viscous: self.viscous_limit() * h * h / self.kinematic_viscosity,
            body_force: 0.25 * (h / gravity).sqrt(),
        }
    }

    /// r_AL of a step: C_BV u_max² Δt, or half of what the stability law allows, r_AL Δt λ_max = 1: then an iteration takes off all that
    /// the Laplacian's shortest waves have of ∇·u, and less of longer ones.
    pub fn penalty(&self, velocity_max: f64, time_step: f64, largest_eigenvalue: f64) -> f64 {
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

    fn validate(&self) -> Result<()> {
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

/// Points of the unit lattice within `radius` of the origin, in a fixed order.
fn lattice(dimensions: usize, radius: f64) -> impl Iterator<Item = [f64; 3]> {
    let n = radius.ceil() as i64;
    let third = if dimensions == 3 { n } else { 0 };
    (-n..=n)
        .flat_map(move |i| (-n..=n).flat_map(move |j| (-third..=third).map(move |k| [i as f64, j as f64, k as f64])))
        .filter(move |r| r.iter().map(|x| x * x).sum::<f64>() <= radius * radius)
}
