//! Artificial particle displacement. (18) (19)

use crate::frame::Frame;
use crate::kernel::{BLOCK, Kernel, Smoothing};
use crate::neighbours::Row;
use crate::parallel;
use crate::particles::{ParticleKind, Particles, Vector};
use crate::settings::{Settings, Shifting};
use crate::with_kernel;

/// Displace the fluid particles towards an even spacing and carry velocity and pressure along to first order.
/// `particles` stand at r^{n+1}; the derivatives are those of `frame`.
pub fn shift<const D: usize>(
    settings: &Settings,
    particles: &mut Particles<D>,
    frame: &Frame<D>,
    time_step: f64,
    velocity_max: f64,
) {
    if settings.shifting == Shifting::None {
        return;
    }
    let change = with_kernel!(settings.kernel, K => {
        let kernel = Smoothing::<K>::new(settings.smoothing_length(), D);
        displacements(settings, kernel, particles, frame, time_step, velocity_max)
    });
    let Particles { real, position, velocity, pressure, .. } = particles;
    parallel::for_each(&mut position[..*real], |i, r| *r += change[i].0);
    parallel::for_each(&mut velocity[..*real], |i, u| *u += change[i].1);
    parallel::for_each(&mut pressure[..*real], |i, p| *p += change[i].2);
}

/// δr, δr·∇u and δr·∇p of every real particle.
fn displacements<K: Kernel, const D: usize>(
    settings: &Settings,
    kernel: Smoothing<K>,
    particles: &Particles<D>,
    frame: &Frame<D>,
    time_step: f64,
    velocity_max: f64,
) -> Vec<(Vector<D>, Vector<D>, f64)> {
    let limit = settings.shift_limit * settings.particle_spacing;
    let mut change = vec![(Vector::zeros(), Vector::zeros(), 0.0); particles.real];
    frame.stencil.for_each_one(
        &mut change,
        #[inline(always)]
        |near, (shift, du, dp)| {
            let i = near.i;
            if particles.kind[i] != ParticleKind::Fluid {
                return;
            }
            let local = Surroundings::of(settings, kernel, particles, near.row, i);
            let speed = match settings.shifting {
                Shifting::Xsph => local.relative_speed,
                _ => settings.shift_coefficient * velocity_max,
            };
            *shift = local.asymmetry * (local.mean_distance * local.mean_distance * speed * time_step);
            let length = shift.norm();
            if length > limit {
                *shift *= limit / length;
            }
            let (velocity_gradient, pressure_gradient) =
                near.velocity_and_pressure_gradient(&particles.velocity, &particles.pressure);
            *du = velocity_gradient * *shift;
            *dp = pressure_gradient.dot(shift);
        },
    );
    change
}

/// The sums of (18) at one particle.
struct Surroundings<const D: usize> {
    /// Σ r_ij / r_ij³.
    asymmetry: Vector<D>,
    /// r_0.
    mean_distance: f64,
    /// u_v.
    relative_speed: f64,
}

impl<const D: usize> Surroundings<D> {
    #[inline(always)]
    fn of<K: Kernel>(settings: &Settings, kernel: Smoothing<K>, particles: &Particles<D>, row: Row, i: usize) -> Self {
        let limit = settings.support_radius().powi(2);
        let smallest = 1e-12 * limit;
        let (mut asymmetry, mut relative) = (Vector::zeros(), Vector::zeros());
        let (mut total, mut distances, mut count) = (kernel.value(0.0), 0.0, 0.0);
        for block in row.all().chunks(BLOCK) {
            let mut squares = [limit; BLOCK];
            let (mut values, mut slopes) = ([0.0; BLOCK], [0.0; BLOCK]);
            for (square, pair) in squares.iter_mut().zip(block) {
                *square = (particles.position[i] - particles.position[pair.j()]).norm_squared().max(smallest);
            }
            kernel.evaluate(&squares, &mut values, &mut slopes);
            let mut lengths = squares.map(f64::sqrt);
            let mut inverse_cubes: [f64; BLOCK] = std::array::from_fn(|k| 1.0 / (squares[k] * lengths[k]));
            for k in 0..BLOCK {
                // Beyond the support: in the list only for its skin, or an unused entry of the block.
                let inside = f64::from(u8::from(squares[k] < limit));
                lengths[k] *= inside;
                inverse_cubes[k] *= inside;
                count += inside;
            }
            for (k, pair) in block.iter().enumerate() {
                let j = pair.j();
                asymmetry += (particles.position[i] - particles.position[j]) * inverse_cubes[k];
                relative += (particles.velocity[i] - particles.velocity[j]) * values[k];
            }
            total += values.iter().sum::<f64>();
            distances += lengths.iter().sum::<f64>();
        }
        let mean_distance = if count > 0.0 { distances / count } else { 0.0 };
        Self { asymmetry, mean_distance, relative_speed: relative.norm() / total }
    }
}
