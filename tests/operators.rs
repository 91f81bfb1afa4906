//! The operators on disordered particles: exact for linear fields, consistent for quadratic ones, in 2-D and 3-D.

use alsph::base::lanes::{LANES, Portable};
use alsph::boundary::Walls;
use alsph::discretisation::{
    Corrected, Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient, Operator, VelocityGradient,
    vector_laplacian,
};
use alsph::kernel::{Kernel, QuinticSpline, Smoothing, WendlandC2, WendlandC4};
use alsph::neighbours::{Cluster, brute_force_neighbours};
use alsph::settings::Settings;
use alsph::shifting::shift;
use alsph::{Matrix, ParticleKind, Vector};
use approx::assert_relative_eq;
use common::manufactured::{Errors, OperatorErrors, laplacian_of_positions};
use common::set::Set;
use proptest::prelude::*;

mod common;

impl<const D: usize> Set<D> {
    /// A box of disordered particles without walls, every third one solid: those at its sides have one-sided neighbourhoods.
    fn new(side: usize, disorder: f64, settings: &Settings) -> Self {
        let mut particles = common::particles(common::lattice::<D>(side, disorder));
        particles.kind.iter_mut().step_by(3).for_each(|kind| *kind = ParticleKind::Solid);
        Self::of(particles, settings, true)
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
    // The Laplacian of a linear field vanishes in the fluid, to rounding: it divides by Δx².
    let zero = |i: usize| match set.particles.kind[i] {
        ParticleKind::Fluid => tolerance * (side * side) as f64,
        _ => f64::INFINITY,
    };
    for (i, (value, laplacian)) in set.apply(GradientAndLaplacian(&both)).into_iter().enumerate() {
        assert_relative_eq!(value, row, epsilon = tolerance);
        assert!(laplacian.abs() <= zero(i), "{laplacian}");
    }
    for value in set.apply(VelocityGradient(&velocity)) {
        assert_relative_eq!(value, gradient, epsilon = tolerance);
    }
    for value in set.apply(Divergence(&velocity)) {
        assert_relative_eq!(value, gradient.trace(), epsilon = tolerance);
    }
    let operator = LaplacianAndGradient { velocity: &velocity, seen: |s, _| velocity[s] };
    for (i, (laplacian, value)) in set.apply(operator).into_iter().enumerate() {
        assert_relative_eq!(value, gradient, epsilon = tolerance);
        assert!(laplacian.norm() <= zero(i), "{laplacian}");
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

/// Operators do not depend on how particles are sorted into clusters, but for the order of the sums.
#[test]
fn operators_do_not_depend_on_the_order_of_the_particles() {
    let settings = common::settings::<2>(0.05, "none");
    let sorted = Set::<2>::new(20, 0.3, &settings);
    let mut particles = common::particles(common::lattice::<2>(20, 0.3));
    particles.kind.iter_mut().step_by(3).for_each(|kind| *kind = ParticleKind::Solid);
    let scattered: Vec<u32> = (0..400).map(|i| (i * 171) % 400).collect();
    particles.reorder(&scattered);
    let scattered = Set::of(particles, &settings, false);
    let by_id = |set: &Set<2>| {
        let field = set.field(|x| (7.0 * x[0]).sin() * x[1]);
        let mut values: Vec<_> = set.particles.id.iter().zip(set.apply(Gradient(&field))).collect();
        values.sort_by_key(|(id, _)| **id);
        values.into_iter().map(|(_, value)| value).collect::<Vec<_>>()
    };
    for (a, b) in by_id(&sorted).iter().zip(by_id(&scattered)) {
        assert_relative_eq!(*a, b, epsilon = 1e-11);
    }
}

/// Every instruction set gives the same bits.
#[test]
fn portable_lanes_give_the_bits_of_the_machines() {
    let set = Set::<3>::new(9, 0.3, &common::settings::<3>(1.0 / 9.0, "none"));
    let velocity = set.field(|x| Vector::from([x[0] * x[1], x[2].sin(), x[0] - x[1]]));
    let operator =
        || LaplacianAndGradient { velocity: &velocity, seen: |s: usize, i: usize| velocity[s] * 2.0 - velocity[i] };
    let values = set.apply(operator());
    let stencil = &set.frame.stencil;
    for first in (0..set.particles.real).step_by(LANES) {
        let cluster = Cluster { first, count: LANES.min(set.particles.real - first) };
        let (row, _) = stencil.neighbours.row(first);
        let mut near = Corrected { cluster, row, position: &stencil.position, correction: &stencil.correction };
        let portable = operator().apply::<Portable>(&mut near);
        assert_eq!(values[first..first + cluster.count], portable[..cluster.count]);
    }
}

/// Corrections formed in the pass of an operator are those of a pass of their own, and so are the operator's values.
#[test]
fn corrections_on_the_way_change_no_bit() {
    let settings = common::settings::<3>(1.0 / 9.0, "none");
    let mut set = Set::<3>::new(9, 0.3, &settings);
    let velocity = set.field(|x| Vector::from([x[0] * x[1], x[2].sin(), x[0] - x[1]]));
    let operator = || LaplacianAndGradient { velocity: &velocity, seen: |s: usize, _: usize| velocity[s] };
    let expected = set.apply(operator());
    set.frame.update(&settings, &set.particles);
    let mut values = vec![None; set.particles.real];
    let mut nothing = vec![(); set.particles.real];
    set.frame.stencil.correct_and_for_each(operator(), &mut values, &mut nothing, |_, value, out, ()| *out = Some(value));
    assert_eq!(values.into_iter().flatten().collect::<Vec<_>>(), expected);
    assert_eq!(set.apply(operator()), expected);
}

/// Volumes and slopes against plain sums in double precision.
fn check_stencil<const D: usize>(side: usize, kernel: impl Kernel, name: &str, ratio: f64) {
    let mut value = common::settings_value::<D>(1.0 / side as f64, "none");
    (value["kernel"], value["smoothing_ratio"]) = (name.into(), ratio.into());
    let settings = common::parse(&value);
    let set = Set::<D>::new(side, 0.3, &settings);
    let smoothing = Smoothing::new(kernel, settings.smoothing_length(), D);
    let (position, stencil) = (&set.particles.position, &set.frame.stencil);
    let near = brute_force_neighbours(position, set.particles.real, settings.support_radius());
    let volume: Vec<f64> = (0..set.particles.real)
        .map(|i| {
            let others: f64 = near[i].iter().map(|&j| smoothing.value((position[i] - position[j as usize]).norm())).sum();
            1.0 / (others + smoothing.value(0.0))
        })
        .collect();
    let largest = smoothing.slope(0.3 / side as f64).abs() * settings.particle_spacing.powi(D as i32);
    for i in 0..set.particles.real {
        assert_relative_eq!(stencil.volume[i], volume[i], max_relative = 1e-5);
        let (row, lane) = stencil.neighbours.row(i);
        for entry in row.all().iter().filter(|entry| entry.j() != i) {
            let distance = (position[i] - position[entry.j()]).norm();
            assert_relative_eq!(entry.slope(lane), volume[entry.j()] * smoothing.slope(distance), epsilon = 1e-5 * largest);
        }
    }
}

#[test]
fn volumes_and_slopes_are_those_of_plain_sums() {
    check_stencil::<2>(14, QuinticSpline, "quintic_spline", 4.0 / 3.0);
    check_stencil::<3>(9, QuinticSpline, "quintic_spline", 4.0 / 3.0);
    check_stencil::<2>(14, WendlandC2, "wendland_c2", 1.6);
    check_stencil::<3>(9, WendlandC4, "wendland_c4", 1.6);
}

/// The displacement and what is carried along, against plain sums of (18) and (19).
#[test]
fn shift_is_that_of_plain_sums() {
    let settings = common::settings::<2>(1.0 / 14.0, "none");
    let mut set = Set::<2>::new(14, 0.3, &settings);
    set.particles.velocity = set.field(|x| Vector::from([(5.0 * x[1]).sin(), x[0] * x[1]]));
    set.particles.pressure = set.field(|x| x[0] - (3.0 * x[1]).cos());
    let velocity_gradient = set.apply(VelocityGradient(&set.particles.velocity));
    let pressure_gradient = set.apply(Gradient(&set.particles.pressure));
    // The solids themselves are at rest, but not what they show.
    let mut walls = Walls::new(&settings);
    walls.viscous_velocity = set.particles.velocity.clone();
    let solids = (0..set.particles.real).filter(|&i| set.particles.kind[i] == ParticleKind::Solid).collect::<Vec<_>>();
    assert!(!solids.is_empty());
    solids.into_iter().for_each(|i| set.particles.velocity[i] = Vector::zeros());
    let in_frame = set.particles.position.clone();
    for (i, x) in set.particles.position.iter_mut().enumerate() {
        *x += Vector::from([(i as f64).cos(), (i as f64).sin()]) * 0.002;
    }
    let before = set.particles.clone();
    let time_step = 1e-4;
    shift(&settings, &mut set.particles, &set.frame, &walls, time_step, 1.0, &mut Vec::new());
    let smoothing = Smoothing::new(QuinticSpline, settings.smoothing_length(), 2);
    let near = brute_force_neighbours(&in_frame, before.real, settings.support_radius());
    let mut moved = 0;
    for i in 0..before.real {
        let change = set.particles.position[i] - before.position[i];
        if before.kind[i] != ParticleKind::Fluid {
            assert_eq!(change, Vector::<2>::zeros());
            continue;
        }
        let (mut asymmetry, mut relative) = (Vector::<2>::zeros(), Vector::<2>::zeros());
        let (mut total, mut distances) = (smoothing.value(0.0), 0.0);
        for j in near[i].iter().map(|&j| j as usize) {
            let r_ij = before.position[i] - before.position[j];
            let weight = smoothing.value(r_ij.norm());
            asymmetry += r_ij / r_ij.norm().powi(3);
            relative += (before.velocity[i] - before.velocity[j]) * weight;
            (total, distances) = (total + weight, distances + r_ij.norm());
        }
        let expected = asymmetry * ((distances / near[i].len() as f64).powi(2) * relative.norm() / total * time_step);
        assert!(expected.norm() < settings.shift_limit * settings.particle_spacing);
        assert_relative_eq!(change, expected, epsilon = 1e-5 * expected.norm());
        let carried = velocity_gradient[i] * expected;
        assert_relative_eq!(set.particles.velocity[i] - before.velocity[i], carried, epsilon = 1e-4 * expected.norm());
        let carried = pressure_gradient[i].dot(&expected);
        assert_relative_eq!(set.particles.pressure[i] - before.pressure[i], carried, epsilon = 1e-4 * expected.norm());
        moved += 1;
    }
    assert!(moved > 100);
}

#[test]
fn derivatives_of_a_constant_are_exactly_zero() {
    let set = Set::<2>::new(12, 0.3, &common::settings::<2>(1.0 / 12.0, "none"));
    let scalar = set.field(|_| 0.1);
    let vector = set.field(|_| Vector::from([0.1, 1e5]));
    let both = set.field(|_| [0.1, 1e5]);
    assert!(set.apply(Gradient(&scalar)).iter().all(|value| *value == Vector::<2>::zeros()));
    assert!(set.apply(GradientAndLaplacian(&both)).iter().all(|value| *value == (Vector::<2>::zeros(), 0.0)));
    let operator = LaplacianAndGradient { velocity: &vector, seen: |s, _| vector[s] };
    assert!(set.apply(operator).iter().all(|value| *value == (Vector::<2>::zeros(), Matrix::<2>::zeros())));
}

/// ∇² of x² + y² (+ z²), and of each component of the velocity (x² , xy): on a lattice to a part in a thousand.
fn laplacian_of_quadratics<const D: usize>(side: usize) {
    let settings = common::settings::<D>(1.0 / side as f64, "none");
    let set = Set::<D>::new(side, 0.0, &settings);
    let scalar = set.field(|x| [0.0, x.norm_squared()]);
    let sheared = set.field(|x| Vector::<D>::from_fn(|k, _| if k == 0 { x[1] * x[1] } else { x[0] * x[1] }));
    let scalars = set.apply(GradientAndLaplacian(&scalar));
    let vectors = set.apply(LaplacianAndGradient { velocity: &sheared, seen: |s, _| sheared[s] });
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
        let eigenvalue = common::compact_settings::<2>(0.05, ratio).largest_laplacian_eigenvalue();
        assert_relative_eq!(eigenvalue, expected, epsilon = 0.01);
    }
}

#[test]
fn largest_projection_eigenvalue_is_that_of_a_plain_sum() {
    // From a separate program, over a finer set of wave vectors.
    for (ratio, expected) in [(1.0, 0.7476), (1.2, 0.5206), (4.0 / 3.0, 0.4211), (1.6, 0.2928), (2.0, 0.1872)] {
        let eigenvalue = common::compact_settings::<2>(0.05, ratio).largest_projection_eigenvalue();
        assert_relative_eq!(eigenvalue, expected, max_relative = 0.02);
    }
}

/// Errors on a periodic lattice displaced by up to `disorder` spacings.
fn errors_in_a_box<const D: usize>(side: usize, disorder: f64) -> OperatorErrors {
    let settings = common::compact_settings::<D>(1.0 / side as f64, 4.0 / 3.0);
    let set = Set::<D>::of(common::particles(common::lattice(side, disorder)), &settings, true);
    OperatorErrors::of(&set, &(0..set.particles.real).collect::<Vec<_>>())
}

/// The observed order when Δx is halved.
fn order(coarse: Errors, fine: Errors) -> f64 {
    (coarse.mean / fine.mean).log2()
}

fn second_order_on_a_lattice<const D: usize>(side: usize) {
    let [coarse, fine] = [side, 2 * side].map(|side| errors_in_a_box::<D>(side, 0.0));
    assert_relative_eq!(order(coarse.gradient, fine.gradient), 2.0, epsilon = 0.2);
    assert_relative_eq!(order(coarse.divergence, fine.divergence), 2.0, epsilon = 0.2);
    assert_relative_eq!(order(coarse.laplacian, fine.laplacian), 2.0, epsilon = 0.2);
    // By symmetry the Laplacian has no linear part to remove.
    assert_relative_eq!(fine.laplacian.mean, fine.corrected_laplacian.mean, max_relative = 1e-3);
}

#[test]
fn derivatives_are_of_second_order_on_a_lattice() {
    second_order_on_a_lattice::<2>(20);
    second_order_on_a_lattice::<3>(16);
}

/// At constant h/Δx and disorder the gradient converges. The compact Laplacian does not: Σ slope r_ij is a constant part of 1/Δx,
/// so that its error grows like 1/Δx; without what it makes of the linear part of the field it stays where it is.
#[test]
fn compact_laplacian_diverges_on_disordered_particles_with_its_linear_part_only() {
    let [coarse, fine] = [40, 80].map(|side| errors_in_a_box::<2>(side, 0.2));
    assert!(order(coarse.gradient, fine.gradient) > 1.5, "{fine:?}");
    assert!(order(coarse.divergence, fine.divergence) > 1.5, "{fine:?}");
    assert_relative_eq!(order(coarse.laplacian, fine.laplacian), -1.0, epsilon = 0.2);
    assert_relative_eq!(order(coarse.vector_laplacian, fine.vector_laplacian), -1.0, epsilon = 0.2);
    assert!(order(coarse.corrected_laplacian, fine.corrected_laplacian) > -0.2, "{fine:?}");
    assert!((0.3..0.7).contains(&fine.laplacian.mean) && fine.corrected_laplacian.mean < 0.05, "{fine:?}");
}

/// Where a lattice is cut by rings of solid particles, too.
#[test]
fn compact_laplacian_errs_in_the_linear_part_around_a_cylinder() {
    let (side, settings) = (80, common::compact_settings::<2>(1.0 / 80.0, 4.0 / 3.0));
    let set = Set::of(common::cylinder(side, 4), &settings, true);
    let judged = common::fluid_near_cylinder(&set.particles, settings.support_radius());
    let errors = OperatorErrors::of(&set, &judged);
    assert!(errors.gradient.max < 0.01 && errors.divergence.max < 0.01, "{errors:?}");
    assert!(errors.laplacian.mean > 0.1 && errors.corrected_laplacian.mean < 0.03, "{errors:?}");
    let of_positions = laplacian_of_positions(&set);
    let largest = judged.iter().map(|&i| of_positions[i].norm() * settings.particle_spacing).fold(0.0, f64::max);
    assert!((0.05..0.15).contains(&largest), "{largest}");
}
