//! The operators on disordered particles: exact for linear fields, consistent for quadratic ones, in 2-D and 3-D.

use alsph::frame::Frame;
use alsph::operators::{
    Divergence, Gradient, GradientAndLaplacian, LaplacianAndDivergence, Operator, VelocityGradient, vector_laplacian,
};
use alsph::settings::Settings;
use alsph::{Particles, Vector};
use approx::assert_relative_eq;
use proptest::prelude::*;

mod common;

struct Set<const D: usize> {
    particles: Particles<D>,
    frame: Frame<D>,
}

impl<const D: usize> Set<D> {
    /// A box of disordered particles without walls: those at its sides have one-sided neighbourhoods.
    fn new(side: usize, disorder: f64, settings: &Settings) -> Self {
        let mut particles = common::particles(common::lattice::<D>(side, disorder));
        let mut frame = Frame::default();
        frame.search(settings, &mut particles, 0.0, true);
        Self { particles, frame }
    }

    /// The operator's value at every real particle.
    fn apply<O: Operator<D>>(&self, operator: O) -> Vec<O::Value>
    where
        O::Value: Clone + Send,
    {
        let mut values = vec![None; self.particles.real];
        self.frame.stencil.for_each_one(operator, &mut values, |_, value, out| *out = Some(value));
        values.into_iter().flatten().collect()
    }

    fn field<T>(&self, f: impl Fn(&Vector<D>) -> T) -> Vec<T> {
        self.particles.position.iter().map(f).collect()
    }

    /// Particles all of whose neighbours have their support inside the box.
    fn interior(&self, settings: &Settings) -> impl Iterator<Item = usize> {
        let radius = 2.0 * settings.support_radius();
        (0..self.particles.real)
            .filter(move |&i| self.particles.position[i].iter().all(|&x| x >= radius && x <= 1.0 - radius))
    }
}

fn linear_fields_are_exact<const D: usize>(side: usize, disorder: f64, slope: [f64; 9], offset: f64) {
    let set = Set::<D>::new(side, disorder, &common::settings::<D>(1.0 / side as f64, "none"));
    let gradient = nalgebra::SMatrix::<f64, D, D>::from_fn(|k, l| slope[3 * k + l]);
    let velocity = set.field(|x| gradient * x + Vector::repeat(offset));
    let scalar: Vec<f64> = velocity.iter().map(|u| u[0]).collect();
    let tolerance = 1e-11;
    let both: Vec<[f64; 2]> = scalar.iter().map(|&f| [f, f]).collect();
    let row = gradient.row(0).transpose();
    for value in set.apply(Gradient(&scalar)) {
        assert_relative_eq!(value, row, epsilon = tolerance);
    }
    for (value, _) in set.apply(GradientAndLaplacian(&both)) {
        assert_relative_eq!(value, row, epsilon = tolerance);
    }
    for value in set.apply(VelocityGradient(&velocity)) {
        assert_relative_eq!(value, gradient, epsilon = tolerance);
    }
    for value in set.apply(Divergence(&velocity)) {
        assert_relative_eq!(value, gradient.trace(), epsilon = tolerance);
    }
    for (_, value) in set.apply(LaplacianAndDivergence { velocity: &velocity, seen: |s, _| velocity[s] }) {
        assert_relative_eq!(value, gradient.trace(), epsilon = tolerance);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn derivatives_of_linear_fields_are_exact_on_disordered_particles(
        slope in proptest::array::uniform9(-1.0..1.0f64), offset in -1.0..1.0f64, disorder in 0.0..0.4f64,
    ) {
        linear_fields_are_exact::<2>(14, disorder, slope, offset);
        linear_fields_are_exact::<3>(9, disorder, slope, offset);
    }
}

#[test]
fn derivatives_of_a_constant_are_exactly_zero() {
    let set = Set::<2>::new(12, 0.3, &common::settings::<2>(1.0 / 12.0, "none"));
    let scalar = set.field(|_| 0.1);
    let vector = set.field(|_| Vector::from([0.1, 1e5]));
    let both = set.field(|_| [0.1, 1e5]);
    assert!(set.apply(Gradient(&scalar)).iter().all(|value| *value == Vector::<2>::zeros()));
    assert!(set.apply(GradientAndLaplacian(&both)).iter().all(|value| *value == (Vector::<2>::zeros(), 0.0)));
    let operator = LaplacianAndDivergence { velocity: &vector, seen: |s, _| vector[s] };
    assert!(set.apply(operator).iter().all(|value| *value == (Vector::<2>::zeros(), 0.0)));
}

/// ∇² of x² + y² (+ z²), and of each component of the velocity (x² , xy): on a lattice to a part in a thousand.
fn laplacian_of_quadratics<const D: usize>(side: usize) {
    let settings = common::settings::<D>(1.0 / side as f64, "none");
    let set = Set::<D>::new(side, 0.0, &settings);
    let scalar = set.field(|x| [0.0, x.norm_squared()]);
    let sheared = set.field(|x| Vector::<D>::from_fn(|k, _| if k == 0 { x[1] * x[1] } else { x[0] * x[1] }));
    let scalars = set.apply(GradientAndLaplacian(&scalar));
    let vectors = set.apply(LaplacianAndDivergence { velocity: &sheared, seen: |s, _| sheared[s] });
    let mut seen = 0;
    for i in set.interior(&settings) {
        seen += 1;
        assert_relative_eq!(scalars[i].1, 2.0 * D as f64, max_relative = 3e-3);
        let vector = vectors[i].0;
        assert_relative_eq!(vector[0], 2.0, max_relative = 3e-3);
        assert_relative_eq!(vector[1], 0.0, epsilon = 2e-3);
    }
    assert!(seen > 0);
}

#[test]
fn scalar_laplacian_is_isotropic_on_a_lattice() {
    laplacian_of_quadratics::<2>(20);
    laplacian_of_quadratics::<3>(17);
}

#[test]
fn printed_vector_laplacian_is_anisotropic_as_measured() {
    // Method, section 2: pure shear u = (y², 0) along an axis 1.89 (exact 2), at 45 degrees 2.11, at h/Δx = 4/3.
    let settings = common::settings::<2>(0.05, "none");
    let set = Set::<2>::new(20, 0.0, &settings);
    let i = set.interior(&settings).next().expect("the box has an interior");
    let along = set.field(|x| Vector::from([x[1] * x[1], 0.0]));
    assert_relative_eq!(vector_laplacian(&set.frame.stencil, &along, i, |s| along[s])[0], 1.89, epsilon = 0.01);
    let normal = Vector::from([-1.0, 1.0]) / 2f64.sqrt();
    let tangent = Vector::from([1.0, 1.0]) / 2f64.sqrt();
    let oblique = set.field(|x| tangent * x.dot(&normal).powi(2));
    assert_relative_eq!(
        vector_laplacian(&set.frame.stencil, &oblique, i, |s| oblique[s]).dot(&tangent),
        2.11,
        epsilon = 0.01
    );
}

#[test]
fn volumes_on_a_lattice_are_those_of_its_cells() {
    for (ratio, kernel) in [(4.0 / 3.0, "quintic_spline"), (1.6, "wendland_c2"), (1.8, "wendland_c4")] {
        let mut value = common::settings_value::<2>(0.05, "periodic");
        value["smoothing_ratio"] = ratio.into();
        value["kernel"] = kernel.into();
        let set = Set::<2>::new(20, 0.0, &common::parse(&value));
        for &volume in &set.frame.stencil.volume {
            assert_relative_eq!(volume, 0.05 * 0.05, max_relative = 5e-3);
        }
    }
}

#[test]
fn largest_laplacian_eigenvalue_is_that_of_the_stability_law() {
    // Method, section 3.
    for (ratio, expected) in [(1.0, 3.84), (1.2, 2.69), (4.0 / 3.0, 2.17), (1.6, 1.51), (2.0, 0.97)] {
        let mut value = common::settings_value::<2>(0.05, "periodic");
        value["smoothing_ratio"] = ratio.into();
        let eigenvalue = common::parse(&value).largest_laplacian_eigenvalue();
        assert_relative_eq!(eigenvalue, expected, epsilon = 0.01);
    }
}
