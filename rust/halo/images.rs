//! Images: copies of the particles near a slip wall (mirrored) or a periodic side (shifted).
//!
//! An image has position `sign * x + offset` and velocity `sign * u` of its source, and its scalars. Corners are images of
//! images, so one direction after the other is enough.
//!
//! An image is a copy, stale once a field of the real particles is written and until it is renewed. So stages write through
//! [`Images::real`], and begin what they form anew with [`Images::blank`]: with [`Images::poisons`] what is stale is NaN, which shows
//! whatever reads it.

use crate::base::parallel;
use crate::base::{Matrix, Tensor, Vector};
use crate::halo::Poison;
use crate::particles::Particles;
use crate::settings::{Boundary, Domain};

#[derive(Debug)]
pub struct Images<const D: usize> {
    source: Vec<u32>,
    sign: Vec<Vector<D>>,
    offset: Vec<Vector<D>>,
    /// Whether what is stale is made NaN.
    pub poisons: bool,
}

impl<const D: usize> Default for Images<D> {
    fn default() -> Self {
        Self { source: Vec::new(), sign: Vec::new(), offset: Vec::new(), poisons: cfg!(debug_assertions) }
    }
}

impl<const D: usize> Images<D> {
    /// Append to `particles`, which hold no images, those of everything within `reach` of a slip wall or periodic side.
    pub fn create(&mut self, particles: &mut Particles<D>, domain: &Domain, reach: f64) {
        self.source.clear();
        self.sign.clear();
        self.offset.clear();
        particles.real = particles.len();
        for axis in 0..D {
            let count = particles.len();
            let (lower, upper) = (domain.lower[axis], domain.upper[axis]);
            let [lower_kind, upper_kind] = domain.boundaries[axis];
            let position = &particles.position;
            let near = parallel::filter(count, |i| {
                let x = position[i][axis];
                (0.0..reach).contains(&(x - lower)) || (0.0..reach).contains(&(upper - x))
            });
            for i in near {
                let x = particles.position[i][axis];
                let sides = [(lower_kind, lower, x - lower, upper - lower), (upper_kind, upper, upper - x, lower - upper)];
                for (kind, plane, distance, period) in sides {
                    if !(0.0..reach).contains(&distance) {
                        continue;
                    }
                    match kind {
                        Boundary::Periodic => self.push(particles, i, axis, 1.0, period),
                        // A particle on the wall is its own image.
                        Boundary::Slip if distance > 0.0 => self.push(particles, i, axis, -1.0, 2.0 * plane),
                        _ => {}
                    }
                }
            }
        }
    }

    fn push(&mut self, particles: &mut Particles<D>, i: usize, axis: usize, factor: f64, shift: f64) {
        let (mut source, mut sign, mut offset) = (i as u32, Vector::repeat(1.0), Vector::zeros());
        if let Some(k) = i.checked_sub(particles.real) {
            (source, sign, offset) = (self.source[k], self.sign[k], self.offset[k]);
        }
        sign[axis] *= factor;
        offset[axis] = factor * offset[axis] + shift;
        let image = particles.push_copy(source as usize);
        particles.position[image] = sign.component_mul(&particles.position[source as usize]) + offset;
        particles.velocity[image].component_mul_assign(&sign);
        particles.normal[image].component_mul_assign(&sign);
        self.source.push(source);
        self.sign.push(sign);
        self.offset.push(offset);
    }

    /// The entries of the real particles of `field`, to be written: those of the images are stale from here on.
    pub fn real<'a, T: Poison>(&self, field: &'a mut [T]) -> &'a mut [T] {
        let (real, images) = field.split_at_mut(field.len() - self.source.len());
        if self.poisons {
            images.fill(T::POISON);
        }
        real
    }

    /// Give `field`, whose memory is used again, `count` entries to be written; all are stale.
    pub fn blank<T: Poison>(&self, field: &mut Vec<T>, count: usize) {
        if self.poisons {
            field.clear();
        }
        field.resize(count, T::POISON);
    }

    /// Panic if an image of `field`, empty where it is not used, is stale and not poisoned: then a stage has written past
    /// [`Images::real`]. Nothing unless poison is on.
    pub fn check<T: Mirrored<D> + Poison + PartialEq>(&self, field: &[T]) {
        self.check_with(field, |k, value| value.mirrored(&self.sign[k]));
    }

    /// [`Images::check`] of positions.
    pub fn check_positions(&self, field: &[Vector<D>]) {
        self.check_with(field, |k, x| self.position(k, x));
    }

    fn check_with<T: Poison + PartialEq>(&self, field: &[T], image: impl Fn(usize, T) -> T) {
        if self.poisons && !field.is_empty() {
            let (real, images) = field.split_at(field.len() - self.source.len());
            for (k, value) in images.iter().enumerate() {
                let renewed = image(k, real[self.source[k] as usize]);
                assert!(
                    value.is_poison() || renewed.is_poison() || *value == renewed,
                    "image {k} is stale, and looks fresh"
                );
            }
        }
    }

    /// Renew the entries of the images from those of the real particles in front of them.
    fn renew<T: Copy + Send + Sync>(&self, field: &mut [T], image: impl Fn(usize, T) -> T + Sync + Send) {
        let (real, images) = field.split_at_mut(field.len() - self.source.len());
        parallel::for_each(images, |k, value| *value = image(k, real[self.source[k] as usize]));
    }

    /// Make the copies in `field` current: the one verb for it, whatever the field is.
    pub fn fill<T: Mirrored<D>>(&self, field: &mut [T]) {
        self.renew(field, |k, value| value.mirrored(&self.sign[k]));
    }

    /// Particle `index`, or that whose image it is where there are `real` ones.
    pub fn source(&self, real: usize, index: usize) -> usize {
        index.checked_sub(real).map_or(index, |k| self.source[k] as usize)
    }

    /// What is `value` at particle `index` as its source has it.
    pub fn at_source<T: Mirrored<D>>(&self, real: usize, index: usize, value: T) -> T {
        index.checked_sub(real).map_or(value, |k| value.mirrored(&self.sign[k]))
    }

    /// [`Images::fill`] of a pressure with the gradient `slope` of each particle: across a slip wall it goes on with that.
    pub fn fill_pressure(
        &self,
        pressure: &mut [f64],
        position: &[Vector<D>],
        slope: impl Fn(usize) -> Vector<D> + Sync + Send,
    ) {
        let real = pressure.len() - self.source.len();
        self.renew(pressure, |k, p| {
            let source = self.source[k] as usize;
            let (slope, way) = (slope(source), position[real + k] - position[source]);
            // A periodic side has the same pressure on both sides.
            let walls = (0..D).filter(|&axis| self.sign[k][axis] < 0.0);
            p + walls.map(|axis| slope[axis] * way[axis]).sum::<f64>()
        });
    }

    /// [`Images::fill`] of positions, which a periodic side shifts too.
    pub fn fill_positions(&self, field: &mut [Vector<D>]) {
        self.renew(field, |k, x| self.position(k, x));
    }

    fn position(&self, k: usize, x: Vector<D>) -> Vector<D> {
        self.sign[k].component_mul(&x) + self.offset[k]
    }
}

/// What a particle carries, and its image across slip walls, whose normals `sign` has −1 at.
pub trait Mirrored<const D: usize>: Copy + Send + Sync {
    fn mirrored(self, sign: &Vector<D>) -> Self;
}

impl<const D: usize> Mirrored<D> for f64 {
    fn mirrored(self, _: &Vector<D>) -> Self {
        self
    }
}

impl<const D: usize, const N: usize> Mirrored<D> for [f64; N] {
    fn mirrored(self, _: &Vector<D>) -> Self {
        self
    }
}

impl<const D: usize> Mirrored<D> for Vector<D> {
    fn mirrored(self, sign: &Vector<D>) -> Self {
        sign.component_mul(&self)
    }
}

impl<const D: usize> Mirrored<D> for Tensor<D> {
    fn mirrored(self, sign: &Vector<D>) -> Self {
        Self(Matrix::from_fn(|k, l| sign[k] * self.0[(k, l)] * sign[l]))
    }
}
