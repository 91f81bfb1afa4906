//! A smooth periodic field with known derivatives, and the errors of the operators applied to it.

use super::set::Set;
use alsph::discretisation::{Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient, vector_laplacian};
use alsph::{Matrix, Vector};
use std::f64::consts::TAU;

/// Wave vector of u_k = sin(n_k·x + ½): 2π (1, ±1, ...), so that in 2-D the sum of the components is 2 sin(2πx + ½) cos(2πy).
fn wave_vector<const D: usize>(k: usize) -> Vector<D> {
    Vector::from_fn(|axis, _| if axis == k && k > 0 { -TAU } else { TAU })
}

fn phase<const D: usize>(x: &Vector<D>, k: usize) -> f64 {
    wave_vector::<D>(k).dot(x) + 0.5
}

/// u, whose divergence is not zero.
pub fn velocity<const D: usize>(x: &Vector<D>) -> Vector<D> {
    Vector::from_fn(|k, _| phase(x, k).sin())
}

/// ∂u_k/∂x_l as the entry (k, l).
pub fn velocity_gradient<const D: usize>(x: &Vector<D>) -> Matrix<D> {
    Matrix::from_fn(|k, l| wave_vector::<D>(k)[l] * phase(x, k).cos())
}

/// ∇²u.
pub fn laplacian<const D: usize>(x: &Vector<D>) -> Vector<D> {
    Vector::from_fn(|k, _| -wave_vector::<D>(k).norm_squared() * phase(x, k).sin())
}

/// ∇(∇·u).
pub fn gradient_of_divergence<const D: usize>(x: &Vector<D>) -> Vector<D> {
    (0..D).map(|k| wave_vector::<D>(k) * (-wave_vector::<D>(k)[k] * phase(x, k).sin())).sum()
}

/// Relative errors in the L2 and in the maximum norm.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    pub mean: f64,
    pub max: f64,
}

impl Errors {
    fn of<const N: usize>(judged: &[usize], pair: impl Fn(usize) -> (Vector<N>, Vector<N>)) -> Self {
        let [mut difference, mut size] = [[0.0; 2]; 2];
        for &i in judged {
            let (value, exact) = pair(i);
            for (norms, square) in [(&mut difference, (value - exact).norm_squared()), (&mut size, exact.norm_squared())] {
                *norms = [norms[0] + square, square.max(norms[1])];
            }
        }
        let [mean, max] = std::array::from_fn(|k| (difference[k] / size[k]).sqrt());
        Self { mean, max }
    }
}

/// Errors of the operators on a set of particles that all carry the exact field.
#[derive(Clone, Copy, Debug)]
pub struct OperatorErrors {
    pub gradient: Errors,
    pub divergence: Errors,
    pub laplacian: Errors,
    /// Of the Laplacian less what it makes of the field's linear part, which has none.
    pub corrected_laplacian: Errors,
    /// Of the vector form of (16) as printed.
    pub vector_laplacian: Errors,
}

impl OperatorErrors {
    pub fn all(&self) -> [Errors; 5] {
        [self.gradient, self.divergence, self.laplacian, self.corrected_laplacian, self.vector_laplacian]
    }

    /// Over the particles `judged`. The scalar field is the sum of the velocity's components.
    pub fn of<const D: usize>(set: &Set<D>, judged: &[usize]) -> Self {
        let (u, x) = (set.field(velocity), &set.particles.position);
        let scalar: Vec<f64> = u.iter().map(|u| u.sum()).collect();
        let gradient = set.apply(Gradient(&scalar));
        let divergence = set.apply(Divergence(&u));
        let both: Vec<_> = scalar.iter().map(|&f| [f, f]).collect();
        let laplacians: Vec<f64> = set.apply(GradientAndLaplacian(&both)).iter().map(|value| value.1).collect();
        let of_positions = laplacian_of_positions(set);
        let one = |value: f64, exact: f64| (Vector::from([value]), Vector::from([exact]));
        Self {
            gradient: Errors::of(judged, |i| (gradient[i], velocity_gradient(&x[i]).row_sum().transpose())),
            divergence: Errors::of(judged, |i| one(divergence[i], velocity_gradient(&x[i]).trace())),
            laplacian: Errors::of(judged, |i| one(laplacians[i], laplacian(&x[i]).sum())),
            corrected_laplacian: Errors::of(judged, |i| {
                one(laplacians[i] - of_positions[i].dot(&gradient[i]), laplacian(&x[i]).sum())
            }),
            vector_laplacian: Errors::of(judged, |i| {
                let value = vector_laplacian(&set.frame.stencil, &u, i, |s| u[s]);
                (value, laplacian(&x[i]) + gradient_of_divergence(&x[i]) * 2.0)
            }),
        }
    }
}

/// ∇²x = −K Σ slope r_ij, which an exact operator would give as zero: times ∇f the error of ∇²f for a linear f.
pub fn laplacian_of_positions<const D: usize>(set: &Set<D>) -> Vec<Vector<D>> {
    let velocity = &set.particles.position;
    set.apply(LaplacianAndGradient { velocity, seen: |s, _| velocity[s] }).into_iter().map(|value| value.0).collect()
}
