//! The Poisson equation of the pressure: solvers that converge in few iterations whatever the number of particles and what bounds them, to
//! the same bits on any number of threads and in any order, and the whole flux into walls.

use alsph::boundary::add_wall_flux;
use alsph::discretisation::Divergence;
use alsph::settings::{Boundary, Settings, Solver};
use alsph::{ParticleKind, Vector};
use common::set::Set;
use common::solve::{add_outlet, noise_of, settings, solve, wave_of};
use std::f64::consts::TAU;

mod common;

/// A box of fluid, or of fluid around a cylinder; the last sixth of it an outlet if it has one.
fn boxes(side: usize) -> Vec<(String, Settings, Set<2>)> {
    let settings = |boundary| settings::<2>(side, boundary);
    let whole = || common::particles(common::lattice::<2>(side, 0.2));
    let mut outlet = whole();
    add_outlet(&mut outlet, 5.0 / 6.0);
    let all = [
        ("periodic", "periodic", whole()),
        ("slip", "slip", whole()),
        ("outlet", "slip", outlet),
        ("cylinder", "periodic", common::cylinder(side, 4)),
    ];
    all.into_iter()
        .map(|(name, boundary, particles)| {
            (format!("{name} {side}"), settings(boundary), Set::of(particles, &settings(boundary), true))
        })
        .collect()
}

#[test]
fn solvers_take_few_iterations_whatever_the_number_of_particles() {
    for (name, settings, set) in [24, 48, 96].into_iter().flat_map(boxes) {
        for (kind, source) in [("noise", noise_of(&set.particles)), ("wave", wave_of(&set.particles))] {
            // Passes over the neighbours: four of a cycle, eight of a step of BiCGSTAB.
            for (solver, tolerance, most) in [
                (Solver::Bicgstab, 1e-3, 2),
                (Solver::Bicgstab, 1e-8, 6),
                (Solver::Multigrid, 1e-3, 5),
                (Solver::Multigrid, 1e-8, 13),
            ] {
                let (solution, _) = solve(&set, &settings, solver, &source, tolerance);
                let message = format!("{name}, {kind}, {solver:?} to {tolerance}: {solution:?}");
                assert!(solution.residual <= tolerance && solution.iterations <= most, "{message}");
            }
        }
    }
}

/// Where the background grid's cells cannot be halved, where an outlet is no whole number of them or its edge is ragged, and between two.
#[test]
fn a_cycle_takes_off_as_much_with_an_outlet_as_without() {
    for side in [94, 126, 158] {
        let layers = |count: f64| count / side as f64;
        let [mut outlet, mut ragged] = [0.2, 0.3].map(|disorder| common::particles(common::lattice::<2>(side, disorder)));
        add_outlet(&mut outlet, 1.0 - layers(4.0));
        add_outlet(&mut ragged, 1.0 - layers(4.5));
        let mut both = common::perturbed_cylinder(side, 4, 0.2);
        add_outlet(&mut both, 1.0 - layers(4.0));
        (0..both.real).filter(|&i| both.position[i][0] < layers(5.3)).for_each(|i| both.kind[i] = ParticleKind::Outlet);
        let array = common::perturbed_cylinder(side, 4, 0.2);
        for (name, boundary, particles) in
            [("outlet", "slip", outlet), ("ragged", "slip", ragged), ("both", "slip", both), ("array", "periodic", array)]
        {
            let settings = settings::<2>(side, boundary);
            let set = Set::of(particles, &settings, true);
            let cycles = [1e-3, 1e-9].map(|tolerance| {
                let (solution, _) = solve(&set, &settings, Solver::Multigrid, &wave_of(&set.particles), tolerance);
                assert!(solution.within_tolerance, "{name} {side}: {solution:?}");
                solution.iterations
            });
            // To a fifth in each.
            assert!(cycles[0] <= 5 && cycles[1] - cycles[0] <= 9, "{name} {side}: {cycles:?}");
        }
    }
}

#[test]
fn so_they_do_in_space() {
    for side in [12, 20] {
        for boundary in ["periodic", "slip"] {
            let settings = settings::<3>(side, boundary);
            for outlet in [0.0, 5.0] {
                let mut particles = common::particles(common::lattice::<3>(side, 0.2));
                add_outlet(&mut particles, 1.0 - outlet / side as f64);
                let set = Set::of(particles, &settings, true);
                for (solver, most) in [(Solver::Bicgstab, 2), (Solver::Multigrid, 4)] {
                    for source in [noise_of(&set.particles), wave_of(&set.particles)] {
                        let (solution, _) = solve(&set, &settings, solver, &source, 1e-3);
                        assert!(solution.iterations <= most, "{boundary} {side} {outlet} {solver:?}: {solution:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn the_solution_is_that_of_the_equation() {
    let errors = [16, 32, 64].map(|side| {
        let settings = settings::<2>(side, "periodic");
        let set = Set::of(common::particles(common::lattice::<2>(side, 0.0)), &settings, true);
        let exact: Vec<_> = set.field(|x| (TAU * x[0]).sin() * (TAU * x[1]).cos())[..set.particles.real].to_vec();
        let source: Vec<_> = exact.iter().map(|x| 2.0 * TAU * TAU * x).collect();
        let found = [Solver::Bicgstab, Solver::Multigrid, Solver::Jacobi].map(|solver| {
            let (solution, x) = solve(&set, &settings, solver, &source, if solver == Solver::Jacobi { 3e-4 } else { 1e-10 });
            assert!(solution.residual <= 0.1, "{solver:?}: {solution:?}");
            x
        });
        assert!(found[0].iter().zip(&found[1]).all(|(a, b)| (a - b).abs() < 1e-8));
        found[0].iter().zip(&exact).map(|(x, exact)| (x - exact).abs()).fold(0.0, f64::max)
    });
    for pair in errors.windows(2) {
        assert!(pair[0] / pair[1] > 3.5, "{errors:?}");
    }
    assert!(errors[2] < 0.006, "{errors:?}");
}

/// What solids show, too, which a gradient near walls reads.
#[test]
fn solvers_agree_at_every_particle() {
    for (name, settings, set) in boxes(48) {
        let source = wave_of(&set.particles);
        let [(_, one), (solution, other)] =
            [Solver::Bicgstab, Solver::Multigrid].map(|solver| solve(&set, &settings, solver, &source, 1e-10));
        let largest = one.iter().map(|x| x.abs()).fold(0.0, f64::max);
        let apart = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-7 * largest, "{name}: {apart} of {largest}, {solution:?}");
    }
}

#[test]
fn neither_threads_nor_the_order_change_a_bit() {
    for (name, settings, set) in boxes(32) {
        for solver in [Solver::Bicgstab, Solver::Multigrid, Solver::Jacobi] {
            let by_id = |set: &Set<2>| {
                let (solution, x) = solve(set, &settings, solver, &noise_of(&set.particles), 1e-3);
                let mut values: Vec<_> = set.particles.id.iter().zip(x).map(|(&id, x)| (id, x.to_bits())).collect();
                values.sort_unstable();
                (solution.iterations, values)
            };
            let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let first = pool(1).install(|| by_id(&set));
            assert_eq!(first, pool(3).install(|| by_id(&set)), "{name} {solver:?}: threads");
            let mut other = set.particles.clone();
            other.drop_images();
            let backwards: Vec<u32> = (0..other.real as u32).rev().collect();
            other.reorder(&backwards);
            let other = Set::of(other, &settings, false);
            assert_eq!(first, by_id(&other), "{name} {solver:?}: order");
        }
    }
}

/// Fluid between two walls, periodic along them.
fn channel(side: usize, disorder: f64) -> (Settings, Set<2>) {
    let spacing = 1.0 / side as f64;
    let mut settings = settings::<2>(side, "none");
    settings.domain.boundaries[0] = [Boundary::Periodic; 2];
    let mut points = common::lattice::<2>(side, disorder);
    let fluid = points.len();
    for layer in 0..6 {
        for k in 0..side {
            let (x, depth) = ((k as f64 + 0.5) * spacing, (layer as f64 + 0.5) * spacing);
            points.extend([Vector::from([x, -depth]), Vector::from([x, 1.0 + depth])]);
        }
    }
    let mut particles = common::particles(points);
    particles.kind[fluid..].fill(ParticleKind::Solid);
    for s in fluid..particles.real {
        let y = particles.position[s][1];
        particles.depth[s] = (-y).max(y - 1.0);
        particles.normal[s] = Vector::from([0.0, if y < 0.0 { 1.0 } else { -1.0 }]);
    }
    let set = Set::of(particles, &settings, true);
    (settings, set)
}

/// ∇·u of what `velocity` gives the fluid between walls at rest, with and without the flux that their solids see.
fn divergence(settings: &Settings, set: &Set<2>, velocity: impl Fn(&Vector<2>) -> Vector<2>) -> [Vec<f64>; 2] {
    let Set { particles, frame } = set;
    let mut field = set.field(velocity);
    for (i, u) in field.iter_mut().enumerate() {
        if particles.kind[i] == ParticleKind::Solid {
            *u = Vector::zeros();
        }
    }
    let own = set.apply(Divergence(&field));
    let mut all = own.clone();
    add_wall_flux(settings, particles, frame, |j| field[j], true, &mut Vec::new(), &mut all);
    [own, all]
}

#[test]
fn a_fall_onto_a_wall_is_stopped_at_once() {
    for (side, tolerance) in [(20, 0.03), (40, 0.02)] {
        let (settings, set) = channel(side, 0.1);
        let slopes = divergence(&settings, &set, |_| Vector::from([0.0, -1.0])).map(|divergence| {
            let source: Vec<_> = divergence.iter().map(|d| -d).collect();
            let (_, p) = solve(&set, &settings, Solver::Bicgstab, &source, 1e-8);
            let fluid = (0..set.particles.real).filter(|&i| set.particles.kind[i] == ParticleKind::Fluid);
            let pairs: Vec<_> = fluid.map(|i| (set.particles.position[i][1] - 0.5, p[i])).collect();
            pairs.iter().map(|(y, p)| y * p).sum::<f64>() / pairs.iter().map(|(y, _)| y * y).sum::<f64>()
        });
        // ∂p/∂y = −1 stops it. What fluid particles see alone makes half of that.
        assert!((slopes[0] + 0.5).abs() < 0.02, "{slopes:?}");
        assert!((slopes[1] + 1.0).abs() < tolerance, "{slopes:?}");
    }
}

#[test]
fn flow_along_a_wall_has_no_flux_into_it() {
    // Free of divergence and of flux, with slip and without.
    let slip = |x: &Vector<2>| {
        Vector::from([(TAU * x[0]).sin() * (1.0 - 2.0 * x[1]), -TAU * (TAU * x[0]).cos() * x[1] * (1.0 - x[1])])
    };
    let stuck = |x: &Vector<2>| {
        let height = x[1] * (1.0 - x[1]);
        Vector::from([
            10.0 * (TAU * x[0]).sin() * height * (1.0 - 2.0 * x[1]),
            -5.0 * TAU * (TAU * x[0]).cos() * height * height,
        ])
    };
    for (side, most) in [(20, [2.0, 1.0]), (40, [1.0, 0.5])] {
        let (settings, set) = channel(side, 0.0);
        for (velocity, most) in [(&slip as &dyn Fn(&Vector<2>) -> Vector<2>, most[0]), (&stuck, most[1])] {
            let [own, all] = divergence(&settings, &set, velocity);
            let handed =
                (0..own.len()).filter(|&i| set.particles.kind[i] == ParticleKind::Fluid).map(|i| (all[i] - own[i]).abs());
            let largest = handed.fold(0.0, f64::max);
            assert!(largest < most, "{side}: {largest}");
        }
    }
}

/// A corner of two walls: solids within its reach hand no flux unless they are to, those along the walls always do.
#[test]
fn solids_at_corners_hand_no_flux_unless_they_are_to() {
    let side = 20;
    let spacing = 1.0 / side as f64;
    let settings = settings::<2>(side, "none");
    let mut points = common::lattice::<2>(side, 0.1);
    let fluid = points.len();
    for i in -5..side as i32 {
        for j in -5..side as i32 {
            if i < 0 || j < 0 {
                points.push(Vector::from([i, j].map(|k| (f64::from(k) + 0.5) * spacing)));
            }
        }
    }
    let mut particles = common::particles(points);
    particles.kind[fluid..].fill(ParticleKind::Solid);
    for s in fluid..particles.real {
        let surface = particles.position[s].map(|x| x.max(0.0));
        let way = surface - particles.position[s];
        particles.depth[s] = way.norm();
        particles.normal[s] = way.normalize();
    }
    let set = Set::of(particles, &settings, true);
    // Into both walls.
    let [without, with] = [false, true].map(|corners| {
        let mut handed = vec![0.0; set.particles.real];
        let velocity = |j: usize| {
            let fluid = set.particles.kind[j] == ParticleKind::Fluid;
            Vector::repeat(if fluid { -1.0 } else { 0.0 })
        };
        add_wall_flux(&settings, &set.particles, &set.frame, velocity, corners, &mut Vec::new(), &mut handed);
        handed
    });
    for i in (0..set.particles.real).filter(|&i| set.particles.kind[i] == ParticleKind::Fluid) {
        let [x, y] = set.particles.position[i].into();
        if x.max(y) < 1.5 * spacing {
            assert!(without[i].abs() < 0.5 * with[i].abs(), "in the corner: {}, {}", without[i], with[i]);
        }
        if x.min(y) < spacing && (8.0 * spacing..0.8).contains(&x.max(y)) {
            assert!(with[i] < -1.0 && without[i] == with[i], "at a wall: {}, {}", without[i], with[i]);
        }
    }
}

/// Jacobi's iteration ends where a step hardly changes x, however large the residual of long waves is; others look at the residual.
#[test]
fn jacobi_looks_at_the_change() {
    let settings = settings::<2>(48, "periodic");
    let set = Set::of(common::particles(common::lattice::<2>(48, 0.1)), &settings, true);
    let source: Vec<_> = set.field(|x| (TAU * x[0]).cos())[..set.particles.real].to_vec();
    let [loose, tight] = [0.05, 0.01].map(|tolerance| solve(&set, &settings, Solver::Jacobi, &source, tolerance).0);
    assert!(loose.within_tolerance && tight.within_tolerance && loose.iterations < tight.iterations, "{loose:?} {tight:?}");
    assert!(loose.iterations > 10 && loose.residual > 0.5, "{loose:?}: the first steps grow like their number");
    let (krylov, _) = solve(&set, &settings, Solver::Bicgstab, &source, 0.05);
    assert!(krylov.within_tolerance && krylov.residual <= 0.05, "{krylov:?}");
}
