//! Where a rigid body is, and how a free one answers to what acts on it.

use crate::settings::Rigid;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// How much of the way to A the slow Ā goes in a step, and how much of the way to what it is behind by the lag does: slowly, so that it does not
/// ring with the waves between a light body and its vessel.
pub(super) const FOLLOWING: f64 = 0.1;
const LAGGING: f64 = 0.02;

/// Where a rigid body is: how far its centre has come and it has turned since the start, how fast it moves, and what accelerates it. In 2-D
/// the last component alone turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    pub displacement: Vector3<f64>,
    /// Rotation vector.
    pub angle: Vector3<f64>,
    pub velocity: Vector3<f64>,
    pub spin: Vector3<f64>,
    pub acceleration: Vector3<f64>,
    pub angular_acceleration: Vector3<f64>,
    /// What follows the two, of a free body.
    pub following: Following,
    pub angular_following: Following,
}

/// What follows an acceleration slowly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Following {
    pub mean: Vector3<f64>,
    /// How far that is behind in the mean.
    pub lag: Vector3<f64>,
}

impl Following {
    /// Right where the acceleration changes evenly.
    fn now(&self) -> Vector3<f64> {
        self.mean + self.lag
    }

    /// Go a share of the way; with all of it there is no lag.
    fn follow(&mut self, now: Vector3<f64>, share: f64) {
        let behind = now - self.mean;
        self.lag = if share < 1.0 { self.lag + (behind - self.lag) * LAGGING } else { Vector3::zeros() };
        self.mean += behind * share;
    }
}

/// The numbers of a pose.
pub const NUMBERS: usize = 30;

impl Pose {
    /// From its numbers, in the order of its fields.
    pub fn from_numbers(numbers: [f64; NUMBERS]) -> Self {
        let three = |k: usize| Vector3::from_column_slice(&numbers[3 * k..3 * k + 3]);
        Self {
            displacement: three(0),
            angle: three(1),
            velocity: three(2),
            spin: three(3),
            acceleration: three(4),
            angular_acceleration: three(5),
            following: Following { mean: three(6), lag: three(8) },
            angular_following: Following { mean: three(7), lag: three(9) },
        }
    }

    pub fn numbers(&self) -> [f64; NUMBERS] {
        let all = [
            self.displacement,
            self.angle,
            self.velocity,
            self.spin,
            self.acceleration,
            self.angular_acceleration,
            self.following.mean,
            self.angular_following.mean,
            self.following.lag,
            self.angular_following.lag,
        ];
        std::array::from_fn(|k| all[k / 3][k % 3])
    }

    /// Rotation vector from an earlier pose to this one.
    pub(super) fn turned_since<const D: usize>(&self, earlier: &Self) -> Vector3<f64> {
        if D == 2 {
            self.angle - earlier.angle
        } else {
            (Rotation3::from_scaled_axis(self.angle) * Rotation3::from_scaled_axis(-earlier.angle)).scaled_axis()
        }
    }

    /// After `time` with the same acceleration.
    pub(super) fn after<const D: usize>(&self, time: f64) -> Self {
        let (velocity, spin) = (self.velocity + self.acceleration * time, self.spin + self.angular_acceleration * time);
        let turned = (self.spin + spin) * (0.5 * time);
        // About one axis angles add up, and go on beyond a turn.
        let angle = if D == 2 {
            self.angle + turned
        } else {
            (Rotation3::from_scaled_axis(turned) * Rotation3::from_scaled_axis(self.angle)).scaled_axis()
        };
        let displacement = self.displacement + (self.velocity + velocity) * (0.5 * time);
        Self { displacement, angle, velocity, spin, ..*self }
    }
}

impl Pose {
    /// Accelerate a free body as force and torque, and its own, ask for. The fluid answers at once with a mass and a moment of inertia. Springs
    /// and dampers act, and the body stands and turns, as they will after the time `ahead`, in the middle of the step: with those of its start,
    /// energy would be made, and angular momentum.
    pub(super) fn respond<const D: usize>(
        &mut self,
        rigid: &Rigid,
        [added_mass, added_inertia]: [f64; 2],
        [force, torque]: [Vector3<f64>; 2],
        ahead: f64,
    ) {
        let Rigid { mass, inertia, force: own, stiffness, damping, free, .. } = rigid;
        let of = |values: &[f64]| Vector3::from_fn(|k, _| values.get(k).copied().unwrap_or(0.0));
        let spring = of(stiffness).component_mul(&(self.displacement + self.velocity * ahead));
        let damper = of(damping).component_mul(&(self.velocity + self.acceleration * ahead));
        let total = force + of(own) - spring - damper;
        let moves = |k: usize| k < D && free[k];
        let acceleration = (total + self.following.now() * added_mass) / (mass + added_mass);
        self.acceleration = Vector3::from_fn(|k, _| if moves(k) { acceleration[k] } else { 0.0 });
        let middle = self.after::<D>(ahead);
        let turn = Rotation3::from_scaled_axis(middle.angle);
        let own_axes = match inertia[..] {
            [only] => Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, only)),
            _ => Matrix3::from_row_slice(inertia),
        };
        let inertia = turn * own_axes * turn.inverse();
        let gyroscopic = if D == 2 { Vector3::zeros() } else { middle.spin.cross(&(inertia * middle.spin)) };
        let mut twist = torque - gyroscopic + self.angular_following.now() * added_inertia;
        let mut inertia = inertia + Matrix3::identity() * added_inertia;
        // About the other axes what holds the body answers any torque.
        for k in (0..3).filter(|&k| if D == 2 { k < 2 || !free[2] } else { !free[3 + k] }) {
            inertia.row_mut(k).fill(0.0);
            (inertia[(k, k)], twist[k]) = (1.0, 0.0);
        }
        self.angular_acceleration = inertia.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * twist);
    }

    /// Let what follows do so by a share of the way.
    pub(super) fn follow(&mut self, share: f64) {
        self.following.follow(self.acceleration, share);
        self.angular_following.follow(self.angular_acceleration, share);
    }
}
