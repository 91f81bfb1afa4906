//! Artificial particle displacement. (18) (19)

use crate::frame::Frame;
use crate::kernel::{Kernel, Smoothing};
use crate::lanes::{LANES, Lanes, add_product, from, matrices, norm_squared, vectors};
use crate::operators::{Neighbourhood, Operator};
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
    let mut change = vec![(Vector::zeros(), Vector::zeros(), 0.0); particles.real];
    with_kernel!(settings.kernel, K => {
        let kernel = Smoothing::<K>::new(settings.smoothing_length(), D);
        let operator = Displacement { settings, kernel, particles, time_step, velocity_max };
        let kind = &particles.kind;
        frame.stencil.for_each_one(operator, &mut change, |i, value, change| {
            if kind[i] == ParticleKind::Fluid {
                *change = value;
            }
        });
    });
    let Particles { real, position, velocity, pressure, .. } = particles;
    parallel::for_each(&mut position[..*real], |i, r| *r += change[i].0);
    parallel::for_each(&mut velocity[..*real], |i, u| *u += change[i].1);
    parallel::for_each(&mut pressure[..*real], |i, p| *p += change[i].2);
}

/// δr, δr·∇u and δr·∇p.
type Change<const D: usize> = (Vector<D>, Vector<D>, f64);

/// Displacement of every particle if it were fluid.
struct Displacement<'a, K, const D: usize> {
    settings: &'a Settings,
    kernel: Smoothing<K>,
    particles: &'a Particles<D>,
    time_step: f64,
    velocity_max: f64,
}

impl<K: Kernel, const D: usize> Operator<D> for Displacement<'_, K, D> {
    type Value = Change<D>;

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: Neighbourhood<D>) -> [Change<D>; LANES] {
        let Particles { position, velocity, pressure, .. } = self.particles;
        let here: [V; D] = near.cluster.vectors(position);
        let (u, p): ([V; D], V) = (near.cluster.vectors(velocity), near.cluster.lanes(|i| pressure[i]));
        let limit = self.settings.support_radius().powi(2);
        let (limit, smallest) = (V::splat(limit), V::splat(1e-12 * limit));
        // Σ r_ij / r_ij³, Σ W u_ij, Σ W, Σ r_ij and the number of neighbours of (18), and the gradients for (19).
        let (mut asymmetry, mut relative) = ([V::zero(); D], [V::zero(); D]);
        let (mut total, mut distances, mut count) = (V::zero(), V::zero(), V::zero());
        let (mut velocity_gradient, mut pressure_gradient) = ([[V::zero(); D]; D], [V::zero(); D]);
        near.for_each(
            near.row.all(),
            #[inline(always)]
            |j, slope: V, r_ij_of_frame| {
                let r_ij = from(here, &position[j]);
                let square = norm_squared(r_ij) + smallest;
                let distance = square.sqrt();
                // The row also holds particles beyond the support of this lane, which must not count.
                let inside = norm_squared(r_ij_of_frame).below(limit);
                add_product(&mut asymmetry, inside / (square * distance), r_ij);
                distances += inside * distance;
                count += inside;
                let u_ij = from(u, &velocity[j]);
                let weight = inside * self.kernel.value(distance);
                add_product(&mut relative, weight, u_ij);
                total += weight;
                for k in 0..D {
                    // Minus u_ij, because ∇u sums u_j − u_i.
                    add_product(&mut velocity_gradient[k], (V::zero() - u_ij[k]) * slope, r_ij_of_frame);
                }
                add_product(&mut pressure_gradient, (V::splat(pressure[j]) - p) * slope, r_ij_of_frame);
            },
        );
        let (asymmetry, relative) = (vectors(asymmetry), vectors(relative));
        let [total, distances, count] = [total, distances, count].map(V::store);
        let (velocity_gradient, pressure_gradient) = (matrices(velocity_gradient), vectors(pressure_gradient));
        let corrections = near.corrections();
        std::array::from_fn(|lane| {
            // The particle itself is in the list: it is counted, and adds next to nothing to the other sums.
            let others = count[lane] - 1.0;
            let mean_distance = if others > 0.0 { distances[lane] / others } else { 0.0 };
            let relative_speed = relative[lane].norm() / total[lane];
            let shift = self.limited(asymmetry[lane], mean_distance, relative_speed);
            let carried = corrections[lane].inverse * shift;
            (shift, velocity_gradient[lane] * carried, pressure_gradient[lane].dot(&carried))
        })
    }
}

impl<K, const D: usize> Displacement<'_, K, D> {
    /// δr (18), never longer than the limit.
    fn limited(&self, asymmetry: Vector<D>, mean_distance: f64, relative_speed: f64) -> Vector<D> {
        let speed = match self.settings.shifting {
            Shifting::Xsph => relative_speed,
            _ => self.settings.shift_coefficient * self.velocity_max,
        };
        let shift = asymmetry * (mean_distance * mean_distance * speed * self.time_step);
        let (length, limit) = (shift.norm(), self.settings.shift_limit * self.settings.particle_spacing);
        if length > limit { shift * (limit / length) } else { shift }
    }
}
