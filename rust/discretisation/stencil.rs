//! The stencil: all that the derivatives need to know of the particle positions of one frame. (14) (17)

use crate::base::lanes::{LANES, Lanes, from, matrices, norm_squared, vectors};
use crate::base::parallel;
use crate::base::{Matrix, Vector};
use crate::discretisation::correction::Correction;
use crate::discretisation::operator::{Neighbours, Nothing, Operator};
use crate::kernel::{Kernel, Smoothing, with_kernel};
use crate::neighbours::{Cluster, Entry, NeighbourList, Row, RowMut, Visit, VisitMut};
use crate::particles::{ParticleKind, Particles};
use crate::settings::Settings;
use std::ops::Range;

#[derive(Debug, Default)]
pub struct Stencil<const D: usize> {
    pub neighbours: NeighbourList,
    /// Positions that the stencil was evaluated at, of real particles and images.
    pub position: Vec<Vector<D>>,
    /// V_i of real particles and images: 1 / Σ_j W_ij, or Δx^D beside a free surface, where that sum says nothing of a volume.
    pub volume: Vec<f64>,
    /// Σ_j W_ij of the real particles.
    pub number_density: Vec<f64>,
    /// Correction of the real particles.
    pub correction: Vec<Correction<D>>,
    /// Whether the corrections belong to the positions.
    corrected: bool,
    /// The volume in the slopes before they are corrected.
    nominal: f64,
    /// Whether the Laplacian of a particle is corrected for the asymmetry of its neighbours: that of fluid, if asked for. At the cut
    /// ends of buffers and walls the asymmetry stays, and makes the compact Laplacian a condition of no flux.
    balanced: Vec<bool>,
}

impl<const D: usize> Stencil<D> {
    /// Volumes, slopes and, later, corrections at the present positions. `mirror` copies the volumes of real particles to their
    /// images.
    pub fn evaluate(&mut self, settings: &Settings, particles: &Particles<D>, mirror: impl Fn(&mut [f64])) {
        self.position.resize(particles.len(), Vector::zeros());
        parallel::for_each(&mut self.position, |i, position| *position = particles.position[i]);
        self.volume.resize(particles.len(), 0.0);
        self.correction.resize(particles.real, Correction::of(&Matrix::identity(), Vector::zeros()));
        let (position, real) = (&self.position, particles.real);
        // The slopes first hold the nominal volume Δx^D in the place of V_j, lest f32 overflow in small units.
        let nominal = settings.particle_spacing.powi(D as i32);
        let outputs = (&mut self.volume[..real], &mut nothing(real)[..], &mut nothing(real)[..]);
        with_kernel!(settings.kernel, kernel => {
            let kernel = Smoothing::new(kernel, settings.smoothing_length(), D);
            self.neighbours.for_each_mut(outputs, Volumes { kernel, position, nominal });
        });
        self.number_density.resize(real, 0.0);
        parallel::for_each(&mut self.number_density, |i, density| *density = 1.0 / self.volume[i]);
        if settings.free_surface.is_some() {
            self.volume.fill(nominal);
        } else {
            mirror(&mut self.volume);
        }
        self.nominal = nominal;
        self.balanced.resize(real, false);
        parallel::for_each(&mut self.balanced, |i, balanced| {
            *balanced = settings.laplacian_correction && particles.kind[i] == ParticleKind::Fluid;
        });
        self.corrected = false;
    }

    /// Whether particle `j` is in the support of particle `i`. The row of `i` holds others too, neighbours of its cluster's, which must not
    /// count where no zero slope sees to it.
    pub fn is_near(&self, settings: &Settings, i: usize, j: usize) -> bool {
        (self.position[j] - self.position[i]).norm_squared() < settings.neighbour_distance().powi(2)
    }

    /// Solid particles in the support of particle `i`.
    pub fn solids_near(&self, settings: &Settings, i: usize) -> impl Iterator<Item = usize> {
        self.neighbours.row(i).0.solid().iter().map(|entry| entry.j()).filter(move |&j| self.is_near(settings, i, j))
    }

    /// Bring the corrections up to date, if no pass has done so on its way.
    pub fn correct(&mut self) {
        let real = self.correction.len();
        self.correct_and_for_each(Nothing, &mut nothing(real), &mut nothing(real), |_, (), (), ()| ());
    }

    /// [`Stencil::for_each`], which also brings the corrections up to date on its way: the first pass after `evaluate`.
    pub fn correct_and_for_each<O: Operator<D>, A: Send, B: Send>(
        &mut self,
        operator: O,
        a: &mut [A],
        b: &mut [B],
        f: impl Fn(usize, O::Value, &mut A, &mut B) + Sync,
    ) {
        if self.corrected {
            return self.for_each(operator, a, b, f);
        }
        let Self { neighbours, position, volume, correction, .. } = self;
        let (nominal, balanced) = (self.nominal, &self.balanced[..]);
        neighbours.for_each_mut((correction, a, b), CorrectAndApply { operator, position, volume, nominal, balanced, f });
        self.corrected = true;
    }

    /// `f(i, value of the operator at i, &mut a[i], &mut b[i])` for every real particle, in parallel.
    pub fn for_each<O: Operator<D>, A: Send, B: Send>(
        &self,
        operator: O,
        a: &mut [A],
        b: &mut [B],
        f: impl Fn(usize, O::Value, &mut A, &mut B) + Sync,
    ) {
        assert!(self.corrected, "the corrections are of another frame");
        let Self { position, correction, .. } = self;
        self.neighbours.for_each(a, b, Apply { operator, position, correction, f });
    }

    /// `out[i] = value of the operator at i` for the particles with solid neighbours (and others of their clusters), in parallel.
    pub fn evaluate_near_solids<O: Operator<D>>(&self, operator: O, out: &mut [O::Value])
    where
        O::Value: Send,
    {
        assert!(self.corrected, "the corrections are of another frame");
        let Self { position, correction, .. } = self;
        let f = |_, value, out: &mut O::Value, (): &mut ()| *out = value;
        let count = out.len();
        self.neighbours.for_each(out, &mut nothing(count), NearSolids(Apply { operator, position, correction, f }));
    }

    /// `f(i, value of the operator at i, &mut out[i])` for every real particle, in parallel.
    pub fn for_each_one<O: Operator<D>, A: Send>(
        &self,
        operator: O,
        out: &mut [A],
        f: impl Fn(usize, O::Value, &mut A) + Sync,
    ) {
        let count = out.len();
        self.for_each(
            operator,
            out,
            &mut nothing(count),
            #[inline(always)]
            |i, value, out, ()| f(i, value, out),
        );
    }
}

/// Outputs for those who have none: a vector of () takes no memory.
fn nothing(count: usize) -> Vec<()> {
    vec![(); count]
}

/// A cluster whose corrections are known.
#[derive(Clone, Copy)]
pub struct Corrected<'a, const D: usize> {
    pub cluster: Cluster,
    pub row: Row<'a>,
    pub position: &'a [Vector<D>],
    pub correction: &'a [Correction<D>],
}

impl<const D: usize> Corrected<'_, D> {
    #[inline(always)]
    fn each<V: Lanes>(&self, entries: &[Entry], mut add: impl FnMut(usize, V, [V; D])) {
        let here: [V; D] = self.cluster.vectors(self.position);
        for entry in entries {
            add(entry.j(), entry.slopes(), from(here, &self.position[entry.j()]));
        }
    }
}

impl<V: Lanes, const D: usize> Neighbours<V, D> for Corrected<'_, D> {
    #[inline(always)]
    fn cluster(&self) -> Cluster {
        self.cluster
    }

    #[inline(always)]
    fn for_each_flowing(&mut self, add: impl FnMut(usize, V, [V; D])) {
        self.each(self.row.flowing(), add);
    }

    #[inline(always)]
    fn for_each_solid(&mut self, add: impl FnMut(usize, V, [V; D])) {
        self.each(self.row.solid(), add);
    }

    #[inline(always)]
    fn for_each(&mut self, add: impl FnMut(usize, V, [V; D])) {
        self.each(self.row.all(), add);
    }

    #[inline(always)]
    fn corrections(&mut self) -> [Correction<D>; LANES] {
        self.cluster.particles().map(|i| self.correction[i])
    }
}

/// An operator, and what is done with its value at each particle.
struct Apply<'a, O, F, const D: usize> {
    operator: O,
    position: &'a [Vector<D>],
    correction: &'a [Correction<D>],
    f: F,
}

impl<O, F, A, B, const D: usize> Visit<A, B> for Apply<'_, O, F, D>
where
    O: Operator<D>,
    F: Fn(usize, O::Value, &mut A, &mut B) + Sync,
{
    #[inline(always)]
    fn visit<V: Lanes>(&self, cluster: Cluster, row: Row<'_>, a: &mut [A], b: &mut [B]) {
        let mut near = Corrected { cluster, row, position: self.position, correction: self.correction };
        hand_out(cluster, self.operator.apply::<V>(&mut near), a, b, &self.f);
    }
}

/// A visit to the clusters with solid neighbours only.
struct NearSolids<T>(T);

impl<A, B, T: Visit<A, B>> Visit<A, B> for NearSolids<T> {
    #[inline(always)]
    fn visit<V: Lanes>(&self, cluster: Cluster, row: Row<'_>, a: &mut [A], b: &mut [B]) {
        if !row.solid().is_empty() {
            self.0.visit::<V>(cluster, row, a, b);
        }
    }
}

/// `f(i, value, a, b)` for each particle of a cluster.
#[inline(always)]
fn hand_out<T, A, B>(cluster: Cluster, values: [T; LANES], a: &mut [A], b: &mut [B], f: &impl Fn(usize, T, &mut A, &mut B)) {
    for (lane, ((value, a), b)) in values.into_iter().zip(a).zip(b).enumerate() {
        f(cluster.first + lane, value, a, b);
    }
}

/// V_i, and the slopes with the volume `nominal` in the place of V_j.
struct Volumes<'a, K, const D: usize> {
    kernel: Smoothing<K>,
    position: &'a [Vector<D>],
    nominal: f64,
}

/// Entries whose distances are found before their kernels.
const BLOCK: usize = 32;

impl<K: Kernel, const D: usize> VisitMut<f64, (), ()> for Volumes<'_, K, D> {
    #[inline(always)]
    fn visit<V: Lanes>(&self, cluster: Cluster, row: RowMut<'_>, (volume, ..): (&mut [f64], &mut [()], &mut [()])) {
        let sum = if row.shares.is_empty() { self.sum::<V, false>(cluster, row) } else { self.sum::<V, true>(cluster, row) };
        volume.iter_mut().zip(sum.store()).for_each(|(volume, sum)| *volume = 1.0 / sum);
    }
}

impl<K: Kernel, const D: usize> Volumes<'_, K, D> {
    /// Set the slopes and return Σ W. With shares (`SHARED`) take off the slopes what the cluster's particles do not see; the sum then
    /// counts each place once, and all fluid: the volume of a particle is that of its place, whatever it sees.
    #[inline(always)]
    fn sum<V: Lanes, const SHARED: bool>(&self, cluster: Cluster, row: RowMut<'_>) -> V {
        let here: [V; D] = cluster.vectors(self.position);
        let kernel = self.kernel;
        let (value_factor, slope_factor) = kernel.factors();
        let slope_factor = slope_factor * self.nominal;
        let mut sum = V::zero();
        let mut number = 0;
        // Distances in double precision, kernels in single, eight at a time.
        let mut squares = [[0.0; LANES]; BLOCK];
        for block in row.entries.chunks_mut(BLOCK) {
            for (square, entry) in squares.iter_mut().zip(&*block) {
                let r_ij = from(here, &self.position[entry.j()]);
                *square = kernel.ratio_squared(norm_squared(r_ij)).store_single();
            }
            for (two, squares) in block.chunks_mut(2).zip(squares.as_chunks().0) {
                // An odd last entry comes with the square of another, not used.
                let (values, slopes) = kernel.value_and_slope(V::load_singles(squares), slope_factor);
                let (values, slopes) = (V::split(values), V::store_singles(slopes));
                for (k, entry) in two.iter_mut().enumerate() {
                    entry.slopes = slopes[k];
                    if SHARED {
                        let shares = &row.shares[number];
                        let place = if number < row.flowing { V::splat(1.0) } else { V::load_single(shares) };
                        sum += values[k] * place;
                        entry.slopes.iter_mut().zip(shares).for_each(|(slope, share)| *slope *= share);
                        number += 1;
                    } else {
                        sum += values[k];
                    }
                }
            }
        }
        sum * V::splat(value_factor)
    }
}

/// A cluster whose corrections are formed while an operator goes over its neighbours.
struct Correcting<'a, V, const D: usize> {
    cluster: Cluster,
    row: RowMut<'a>,
    position: &'a [Vector<D>],
    volume: &'a [f64],
    nominal: f64,
    balanced: &'a [bool],
    /// −α of the neighbours so far, its lower triangle.
    alpha: [[V; D]; D],
    /// Σ slope r_ij of the neighbours so far.
    asymmetry: [V; D],
    correction: &'a mut [Correction<D>],
}

impl<V: Lanes, const D: usize> Correcting<'_, V, D> {
    /// V_j into the slopes, and the correction tensor (17) from the slopes as stored.
    #[inline(always)]
    fn each(&mut self, range: Range<usize>, mut add: impl FnMut(usize, V, [V; D])) {
        let here: [V; D] = self.cluster.vectors(self.position);
        let inverse = 1.0 / self.nominal;
        let (mut alpha, mut asymmetry) = (self.alpha, self.asymmetry);
        for entry in &mut self.row.entries[range] {
            let j = entry.j();
            entry.set_slopes(entry.slopes::<V>() * V::splat(self.volume[j] * inverse));
            let (slope, r_ij) = (entry.slopes::<V>(), from(here, &self.position[j]));
            for k in 0..D {
                let weight = slope * r_ij[k];
                asymmetry[k] += weight;
                for l in 0..=k {
                    alpha[k][l] = alpha[k][l].plus_product(weight, r_ij[l]);
                }
            }
            add(j, slope, r_ij);
        }
        (self.alpha, self.asymmetry) = (alpha, asymmetry);
    }
}

impl<V: Lanes, const D: usize> Neighbours<V, D> for Correcting<'_, V, D> {
    #[inline(always)]
    fn cluster(&self) -> Cluster {
        self.cluster
    }

    #[inline(always)]
    fn for_each_flowing(&mut self, add: impl FnMut(usize, V, [V; D])) {
        self.each(0..self.row.flowing, add);
    }

    #[inline(always)]
    fn for_each_solid(&mut self, add: impl FnMut(usize, V, [V; D])) {
        self.each(self.row.flowing..self.row.entries.len(), add);
    }

    #[inline(always)]
    fn for_each(&mut self, add: impl FnMut(usize, V, [V; D])) {
        self.each(0..self.row.entries.len(), add);
    }

    #[inline(always)]
    fn corrections(&mut self) -> [Correction<D>; LANES] {
        for k in 0..D {
            for l in 0..k {
                self.alpha[l][k] = self.alpha[k][l];
            }
        }
        let alpha = matrices(self.alpha);
        let asymmetry = vectors(self.asymmetry);
        let (particles, balanced) = (self.cluster.particles(), self.balanced);
        let corrections = std::array::from_fn(
            #[inline(always)]
            |lane| Correction::of(&-alpha[lane], asymmetry[lane] * f64::from(balanced[particles[lane]])),
        );
        self.correction.copy_from_slice(&corrections[..self.correction.len()]);
        corrections
    }
}

/// [`Apply`] to clusters whose corrections are yet to be formed.
struct CorrectAndApply<'a, O, F, const D: usize> {
    operator: O,
    position: &'a [Vector<D>],
    volume: &'a [f64],
    nominal: f64,
    balanced: &'a [bool],
    f: F,
}

impl<O, F, A, B, const D: usize> VisitMut<Correction<D>, A, B> for CorrectAndApply<'_, O, F, D>
where
    O: Operator<D>,
    F: Fn(usize, O::Value, &mut A, &mut B) + Sync,
{
    #[inline(always)]
    fn visit<V: Lanes>(
        &self,
        cluster: Cluster,
        row: RowMut<'_>,
        (correction, a, b): (&mut [Correction<D>], &mut [A], &mut [B]),
    ) {
        let Self { position, volume, nominal, balanced, .. } = *self;
        let (alpha, asymmetry) = ([[V::zero(); D]; D], [V::zero(); D]);
        let mut near = Correcting { cluster, row, position, volume, nominal, balanced, alpha, asymmetry, correction };
        hand_out(cluster, self.operator.apply::<V>(&mut near), a, b, &self.f);
    }
}
