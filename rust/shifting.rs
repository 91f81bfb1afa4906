//! Artificial particle displacement. (18) (19)

use crate::base::lanes::{Lanes, add_product, from, matrices, norm_squared, vectors};
use crate::base::parallel;
use crate::base::{Matrix, Vector};
use crate::boundary::Walls;
use crate::discretisation::{Corrected, Neighbours, Stencil};
use crate::frame::Frame;
use crate::halo::Poison;
use crate::kernel::{Kernel, Smoothing, with_kernel};
use crate::neighbours::{Cluster, Row, Visit};
use crate::particles::{ParticleKind, Particles};
use crate::settings::{DerivativeFrame, Settings, Shifting};

/// How much of the neighbours' root mean square relative velocity the shift goes with where nothing is pressed together, as in shear and in
/// vortices: enough to keep the spacing even, and no noise.
const MIXING: f64 = 1.0 / 3.0;

/// Distance to the nearest solid particle [Δx] at which a particle touches the body, and that at which it does not at all; solids stand
/// half a spacing deep. A sharp limit in place of the two makes the lift noisy.
const TOUCH: [f64; 2] = [0.75, 1.25];

/// Displace the fluid particles towards an even spacing and carry velocity and pressure along to first order.
/// `particles` stand at r^{n+1}; the derivatives are those of `frame`, where solids show the velocity of the viscous term: the
/// velocity at rest would make ∇u too small next to a wall, and the displacement mix the boundary layer. `change` is what the particles were last changed by, kept
/// so that its memory is used again.
pub fn shift<const D: usize>(
    settings: &Settings,
    particles: &mut Particles<D>,
    frame: &Frame<D>,
    walls: &Walls<D>,
    time_step: f64,
    velocity_max: f64,
    change: &mut Vec<Change<D>>,
) {
    if settings.shifting == Shifting::None {
        return;
    }
    frame.images.blank(change, particles.real);
    let displacements = if frame.faces.is_empty() { displacements::<D, false> } else { displacements::<D, true> };
    displacements(settings, particles, frame, walls, [time_step, velocity_max], change);
    let images = &frame.images;
    parallel::for_each(images.real(&mut particles.position), |i, r| *r += change[i].position);
    parallel::for_each(images.real(&mut particles.velocity), |i, u| *u += change[i].velocity);
    parallel::for_each(images.real(&mut particles.pressure), |i, p| *p += change[i].pressure);
}

/// Whether the derivatives of the shift are those of u^{n+1} in the frame of the step: then the last iteration need not take them too.
pub fn measures_divergence(settings: &Settings) -> bool {
    settings.shifting != Shifting::None && settings.derivative_frame != DerivativeFrame::Updated
}

/// The change of every particle; where there are faces (`SHARED`) neighbours count by the shares that are seen of them.
fn displacements<const D: usize, const SHARED: bool>(
    settings: &Settings,
    particles: &Particles<D>,
    frame: &Frame<D>,
    walls: &Walls<D>,
    [time_step, velocity_max]: [f64; 2],
    change: &mut [Change<D>],
) {
    with_kernel!(settings.kernel, kernel => {
        let kernel = Smoothing::new(kernel, settings.smoothing_length(), D);
        let stencil = &frame.stencil;
        let visitor = Displacement::<_, D, SHARED> { settings, kernel, particles, stencil, walls, time_step, velocity_max };
        stencil.neighbours.for_each(change, &mut vec![(); particles.real], visitor);
    });
}

/// What the shift changes of a fluid particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change<const D: usize> {
    /// δr.
    position: Vector<D>,
    /// δr·∇u.
    velocity: Vector<D>,
    /// δr·∇p.
    pressure: f64,
    /// ∇·u before the shift, less [`DerivativeFrame::solenoidal_divergence`].
    pub divergence: f64,
}

impl<const D: usize> Poison for Change<D> {
    const POISON: Self =
        Self { position: Poison::POISON, velocity: Poison::POISON, pressure: Poison::POISON, divergence: Poison::POISON };
}

/// Displacement of every particle if it were fluid.
struct Displacement<'a, K, const D: usize, const SHARED: bool> {
    settings: &'a Settings,
    kernel: Smoothing<K>,
    particles: &'a Particles<D>,
    stencil: &'a Stencil<D>,
    walls: &'a Walls<D>,
    time_step: f64,
    velocity_max: f64,
}

impl<K: Kernel, const D: usize, const SHARED: bool> Visit<Change<D>, ()> for Displacement<'_, K, D, SHARED> {
    #[inline(always)]
    fn visit<V: Lanes>(&self, cluster: Cluster, row: Row<'_>, out: &mut [Change<D>], _: &mut [()]) {
        let Surroundings { asymmetry, relative, squares, total, distances, count } = self.surroundings::<V>(cluster, row);
        let (asymmetry, relative) = (vectors(asymmetry), vectors(relative));
        let (squares, total, distances, count) = (squares.store(), total.store(), distances.store(), count.store());
        let Particles { velocity, pressure, kind, .. } = self.particles;
        let (u, p): ([V; D], V) = (cluster.vectors(velocity), cluster.lanes(|i| pressure[i]));
        let (mut velocity_gradient, mut pressure_gradient) = ([[V::zero(); D]; D], [V::zero(); D]);
        // What ∇·u has of solids beside ∇u: it takes their own velocity, not what they show.
        let mut hidden = [[V::zero(); D]; D];
        let Stencil { position, correction, .. } = self.stencil;
        let mut near = Corrected { cluster, row, position, correction };
        near.for_each_flowing(
            #[inline(always)]
            |j, slope: V, r_ij| {
                for k in 0..D {
                    add_product(&mut velocity_gradient[k], (V::splat(velocity[j][k]) - u[k]) * slope, r_ij);
                }
                add_product(&mut pressure_gradient, (V::splat(pressure[j]) - p) * slope, r_ij);
            },
        );
        near.for_each_solid(
            #[inline(always)]
            |s, slope: V, r_ij| {
                let seen = cluster.particles().map(|i| self.walls.seen_by(self.particles, s, i));
                for k in 0..D {
                    let (seen, own) = (V::load(&seen.map(|u| u[k])), V::splat(velocity[s][k]));
                    add_product(&mut velocity_gradient[k], (seen - u[k]) * slope, r_ij);
                    add_product(&mut hidden[k], (own - seen) * slope, r_ij);
                }
                add_product(&mut pressure_gradient, (V::splat(pressure[s]) - p) * slope, r_ij);
            },
        );
        let (velocity_gradient, hidden, pressure_gradient) =
            (matrices(velocity_gradient), matrices(hidden), vectors(pressure_gradient));
        for (lane, out) in out.iter_mut().enumerate() {
            let i = cluster.first + lane;
            if kind[i] != ParticleKind::Fluid {
                *out = Change { position: Vector::zeros(), velocity: Vector::zeros(), pressure: 0.0, divergence: 0.0 };
                continue;
            }
            // The particle itself is in the list: it is counted, and adds next to nothing to the other sums.
            let others = count[lane] - 1.0;
            let mean_distance = if others > 0.0 { distances[lane] / others } else { 0.0 };
            let shown = velocity_gradient[lane] * correction[i].inverse;
            let Settings { shifting, shift_coefficient, .. } = self.settings;
            let speed = match shifting {
                Shifting::Xsph => relative[lane].norm() / total[lane],
                Shifting::Strain => {
                    let pressing = self.settings.smoothing_length() * pressing_rate(&shown);
                    shift_coefficient * pressing.max(MIXING * (squares[lane] / total[lane]).sqrt())
                }
                _ => shift_coefficient * self.velocity_max,
            };
            let shift = self.limited(i, lane, row, self.shift(asymmetry[lane], mean_distance, speed));
            let carried = correction[i].inverse * shift;
            let gradient = shown + hidden[lane] * correction[i].inverse;
            let solenoidal = self.settings.derivative_frame.solenoidal_divergence(&gradient, self.time_step);
            *out = Change {
                position: shift,
                velocity: velocity_gradient[lane] * carried,
                pressure: pressure_gradient[lane].dot(&carried),
                divergence: gradient.trace() - solenoidal,
            };
        }
    }
}

/// How fast a flow of this ∇u presses neighbours together: (½ tr (∇u)²)^½ where strain exceeds rotation (the strain rate itself if
/// there is no rotation), zero in shear and in vortices.
fn pressing_rate<const D: usize>(velocity_gradient: &Matrix<D>) -> f64 {
    (0.5 * (velocity_gradient * velocity_gradient).trace()).max(0.0).sqrt()
}

/// The sums of (18), of the particle of each lane.
struct Surroundings<V, const D: usize> {
    /// Σ r_ij h³ / r_ij³.
    asymmetry: [V; D],
    /// Σ w u_ij, Σ w u_ij² and Σ w, w the kernel without its factor.
    relative: [V; D],
    squares: V,
    total: V,
    /// Σ r_ij / h, and the number of neighbours with the particle itself.
    distances: V,
    count: V,
}

impl<K: Kernel, const D: usize, const SHARED: bool> Displacement<'_, K, D, SHARED> {
    /// At r^{n+1}, over the neighbours in the frame of the last derivatives. The distances in double precision: the rounding of
    /// single would break the symmetry of a symmetric flow within a few steps.
    #[inline(always)]
    fn surroundings<V: Lanes>(&self, cluster: Cluster, row: Row<'_>) -> Surroundings<V, D> {
        let in_frame = &self.stencil.position;
        let kernel = self.kernel;
        let Particles { position, velocity, .. } = self.particles;
        let here: [V; D] = cluster.vectors(position);
        let here_in_frame: [V; D] = cluster.vectors(in_frame);
        let u: [V; D] = cluster.vectors(velocity);
        let limit = V::splat(self.settings.neighbour_distance().powi(2));
        let (mut asymmetry, mut relative) = ([V::zero(); D], [V::zero(); D]);
        let (mut squares, mut total, mut distances, mut count) = (V::zero(), V::zero(), V::zero(), V::zero());
        for (pair, two) in row.all().chunks(2).enumerate() {
            // An odd last entry stands twice, the second time unused.
            let two_j = [two[0].j(), two[two.len() - 1].j()];
            let r = [from(here, &position[two_j[0]]), from(here, &position[two_j[1]])];
            let ratios = kernel.ratios([norm_squared(r[0]), norm_squared(r[1])]);
            for k in 0..two.len() {
                let (j, r_ij, (q, inverse, value)) = (two_j[k], r[k], ratios[k]);
                // The row also holds particles beyond the support of this lane, which must not count.
                let mut inside = norm_squared(from(here_in_frame, &in_frame[j])).below(limit);
                if SHARED {
                    inside = inside * row.shares().get(2 * pair + k).map_or(V::splat(1.0), |shares| V::load_single(shares));
                }
                add_product(&mut asymmetry, inside * inverse * (inverse * inverse), r_ij);
                distances = distances.plus_product(inside, q);
                count += inside;
                let weight = inside * value;
                let u_ij = from(u, &velocity[j]);
                add_product(&mut relative, weight, u_ij);
                squares = squares.plus_product(weight, norm_squared(u_ij));
                total += weight;
            }
        }
        Surroundings { asymmetry, relative, squares, total, distances, count }
    }

    /// δr (18).
    fn shift(&self, asymmetry: Vector<D>, mean_distance: f64, speed: f64) -> Vector<D> {
        // The h³ of the one and the h² of the other leave 1/h.
        let scale = mean_distance * mean_distance / self.settings.smoothing_length();
        asymmetry * (scale * speed * self.time_step)
    }

    /// The shift of particle `i`, no longer than the limit; of one that touches a body than the way of the fastest in the step, if that
    /// is more: a lesser shift would not keep it out where the flow stagnates.
    fn limited(&self, i: usize, lane: usize, row: Row<'_>, shift: Vector<D>) -> Vector<D> {
        let (length, limit) = (shift.norm(), self.settings.shift_limit * self.settings.particle_spacing);
        if length <= limit {
            return shift;
        }
        let position = &self.particles.position;
        let solids = row.solid_seen(lane).map(|(entry, _)| (position[i] - position[entry.j()]).norm());
        let nearest = solids.fold(f64::INFINITY, f64::min) / self.settings.particle_spacing;
        let touching = ((TOUCH[1] - nearest) / (TOUCH[1] - TOUCH[0])).clamp(0.0, 1.0);
        let limit = limit + touching * (self.velocity_max * self.time_step - limit).max(0.0);
        shift * (limit / length).min(1.0)
    }
}
