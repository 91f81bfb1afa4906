//! Which settings are refused, and the lengths, eigenvalues and limits that follow from those that are not.

use alsph::settings::Eigenvalues;
use alsph::{Settings, Vector};
use approx::assert_relative_eq;
use serde_json::{Value, json};

mod common;

/// Settings with the values at these JSON pointers.
fn with(changes: &[(&str, Value)]) -> Value {
    let mut value = common::settings_value::<2>(0.05, "slip");
    value["adaptive_until"] = Value::Null;
    value["velocity_limit"] = Value::Null;
    for (pointer, chosen) in changes {
        *value.pointer_mut(pointer).expect("a setting") = chosen.clone();
    }
    value
}

const LARGEST: Eigenvalues = Eigenvalues { laplacian: 8.0, projection: 0.5 };

#[test]
fn settings_beyond_their_bounds_are_refused_by_name() {
    let wall = json!({"name": "wall", "velocity": [0.0, 0.0], "moves": false, "center": [0.0, 0.0]});
    let plane = json!([["slip", "slip"], ["slip", "slip"]]);
    // The bounds themselves, or what lies next to them within, and what lies beyond.
    let bounds = [
        ("/dimensions", "dimensions", vec![], vec![json!(1), json!(4)]),
        ("/viscous_order", "viscous_order", vec![json!(2), json!(4)], vec![json!(3), json!(0)]),
        ("/particle_spacing", "particle_spacing", vec![], vec![json!(0.0), json!(-0.05)]),
        ("/smoothing_ratio", "smoothing_ratio", vec![json!(0.8), json!(3.0)], vec![json!(0.79), json!(3.01), json!(0.0)]),
        ("/density", "density", vec![json!(1e-9)], vec![json!(0.0), json!(-1.0)]),
        ("/time_step", "time_step", vec![json!(1e-9)], vec![json!(0.0), json!(-1.0)]),
        ("/courant", "courant", vec![json!(1e-9), Value::Null], vec![json!(0.0), json!(-1.0)]),
        ("/viscous_theta", "viscous_theta", vec![json!(0.5), json!(1.0)], vec![json!(0.49), json!(1.01)]),
        ("/time_step_safety", "time_step_safety", vec![json!(1e-9)], vec![json!(0.0), json!(-1.0)]),
        ("/divergence_tolerance", "divergence_tolerance", vec![json!(1e-9)], vec![json!(0.0), json!(-1.0)]),
        ("/shift_limit", "shift_limit", vec![json!(1e-9)], vec![json!(0.0), json!(-1.0)]),
        ("/velocity_limit", "velocity_limit", vec![json!(1e-9), Value::Null], vec![json!(0.0), json!(-1.0)]),
        ("/kinematic_viscosity", "kinematic_viscosity", vec![json!(0.0)], vec![json!(-1e-9)]),
        ("/shift_coefficient", "shift_coefficient", vec![json!(0.0)], vec![json!(-1e-9)]),
        (
            "/penalty_constant",
            "penalty_constant",
            vec![json!(1.0), json!(100.0), Value::Null],
            vec![json!(0.99), json!(100.01)],
        ),
        ("/max_iterations", "max_iterations", vec![json!(1), json!(1000)], vec![json!(0), json!(1001)]),
        ("/projection_sweeps", "projection_sweeps", vec![json!(0), json!(1000)], vec![json!(1001)]),
        ("/body_force", "body_force", vec![json!([1.0, -2.0])], vec![json!([1.0]), json!([1.0, 0.0, 0.0])]),
        ("/bodies", "bodies", vec![json!([]), json!([wall])], vec![json!([wall, wall])]),
        ("/bodies/0/velocity", "bodies.wall.velocity", vec![json!([1.0, -2.0])], vec![json!([1.0])]),
        ("/bodies/0/center", "bodies.wall.center", vec![json!([1.0, -2.0])], vec![json!([1.0])]),
        ("/domain/lower", "domain", vec![json!([-9.0, 0.7])], vec![json!([0.0]), json!([0.0, 0.9]), json!([2.0, 0.0])]),
        ("/domain/upper", "domain", vec![json!([0.2, 9.0])], vec![json!([1.0]), json!([0.1, 1.0]), json!([1.0, -2.0])]),
        ("/domain/boundaries", "domain.boundaries", vec![plane], vec![json!([["slip", "slip"]])]),
        (
            "/domain/boundaries/1",
            "domain.boundaries",
            vec![json!(["periodic", "periodic"]), json!(["inlet", "none"])],
            vec![json!(["periodic", "slip"]), json!(["inlet", "periodic"])],
        ),
        ("/search_every_iteration", "search_every_iteration", vec![json!(false)], vec![json!(true)]),
    ];
    for (pointer, name, good, bad) in bounds {
        for value in good {
            let settings = Settings::from_json(&with(&[(pointer, value.clone())]).to_string());
            assert!(settings.is_ok(), "{pointer} = {value}: {:?}", settings.err());
        }
        for value in bad {
            let refused = Settings::from_json(&with(&[(pointer, value.clone())]).to_string());
            let error = refused.expect_err(&format!("{pointer} = {value}")).to_string();
            assert!(error.starts_with(&format!("setting `{name}")), "{pointer} = {value}: {error}");
        }
    }
    let original = with(&[("/derivative_frame", "updated".into()), ("/search_every_iteration", true.into())]);
    assert!(Settings::from_json(&original.to_string()).is_ok());
}

#[test]
fn lengths_follow_from_the_spacing() {
    let settings = common::settings::<2>(0.05, "none");
    assert_relative_eq!(settings.smoothing_length(), 0.2 / 3.0, max_relative = 1e-15);
    assert_relative_eq!(settings.support_radius(), 0.2, max_relative = 1e-15);
    // More than the support radius by a hair, so that a lattice's particles at that distance count.
    assert!((1e-8..1e-6).contains(&(settings.neighbour_distance() / 0.2 - 1.0)));
    let buffer = |ratio: f64| common::parse(&with(&[("/smoothing_ratio", ratio.into())])).buffer_length();
    for (ratio, spacings) in [(1.0, 6.0), (1.1, 7.0), (4.0 / 3.0, 8.0), (1.35, 9.0)] {
        assert_relative_eq!(buffer(ratio), spacings * 0.05, max_relative = 1e-12);
    }
    let (lower, upper) = settings.bounds();
    assert_relative_eq!(lower, Vector::from([-1.2, -1.2]), max_relative = 1e-12);
    assert_relative_eq!(upper, Vector::from([2.2, 2.2]), max_relative = 1e-12);
}

#[test]
fn the_time_step_is_limited_by_penalty_friction_and_body_force() {
    let limits = |rule: &str| {
        let changes = [("/wall_velocity", rule.into()), ("/body_force", json!([0.3, -0.4]))];
        common::parse(&with(&changes)).time_step_limits(2.0, LARGEST)
    };
    let (h, adami, cubic) = (0.2f64 / 3.0, limits("adami"), limits("cubic"));
    // r_AL Δt λ/Δx² = 2 with r_AL = C u² Δt.
    assert_eq!(adami.courant, f64::INFINITY);
    assert_relative_eq!(adami.penalty, (2.0f64 / 8.0 / 100.0).sqrt() * 0.05 / 2.0, max_relative = 1e-12);
    assert_relative_eq!(adami.viscous, 0.125 * h * h / 0.01, max_relative = 1e-12);
    assert_relative_eq!(cubic.viscous, 0.0625 * h * h / 0.01, max_relative = 1e-12);
    assert_relative_eq!(adami.body_force, 0.25 * (h / 0.5).sqrt(), max_relative = 1e-12);
    let still = common::settings::<2>(0.05, "none").time_step_limits(0.0, LARGEST);
    assert!(still.penalty == f64::INFINITY && still.body_force == f64::INFINITY);
}

/// Without a C_BV of the user's the step goes by its Courant number, and r_AL Δt λ/Δx² is 2 s², whatever the step.
#[test]
fn the_penalty_follows_the_step() {
    let settings = common::parse(&with(&[("/penalty_constant", Value::Null), ("/courant", json!(0.25))]));
    let limits = settings.time_step_limits(2.0, LARGEST);
    assert!(limits.penalty == f64::INFINITY);
    assert_relative_eq!(limits.courant, 0.25 * 0.05 / 2.0, max_relative = 1e-12);
    for time_step in [1e-4, 1e-2] {
        let relaxed = settings.penalty(2.0, time_step, 8.0) * time_step * 8.0 / (0.05 * 0.05);
        assert_relative_eq!(relaxed, 1.0, max_relative = 1e-12);
    }
    let given = common::parse(&with(&[("/penalty_constant", json!(60.0))]));
    assert_relative_eq!(given.penalty(2.0, 0.01, 8.0), 60.0 * 4.0 * 0.01, max_relative = 1e-12);
}

/// Largest eigenvalues of Laplacian and of the divergence of the gradient, and c of the error of the Laplacian of a long wave, from
/// a separate program over a set of wave vectors four times as fine.
#[test]
fn eigenvalues_and_dispersion_are_those_of_plain_sums() {
    for (dimensions, kernel, ratio, laplacian, projection, dispersion) in [
        (2, "quintic_spline", 4.0 / 3.0, 2.17486, 0.42105, 0.21472),
        (3, "quintic_spline", 4.0 / 3.0, 2.25087, 0.43609, 0.20720),
        (3, "quintic_spline", 1.0, 4.00042, 0.77426, 0.11668),
        (2, "wendland_c2", 1.6, 2.58304, 0.50345, 0.17796),
        (3, "wendland_c2", 1.6, 2.69485, 0.52537, 0.17193),
    ] {
        let mut value = if dimensions == 2 {
            common::settings_value::<2>(0.05, "none")
        } else {
            common::settings_value::<3>(0.05, "none")
        };
        (value["kernel"], value["smoothing_ratio"]) = (kernel.into(), ratio.into());
        let settings = common::parse(&value);
        assert_relative_eq!(settings.largest_laplacian_eigenvalue(), laplacian, max_relative = 2e-3);
        assert_relative_eq!(settings.largest_projection_eigenvalue(), projection, max_relative = 0.02);
        assert_relative_eq!(settings.laplacian_dispersion(), dispersion, max_relative = 2e-3);
    }
}

#[test]
fn only_the_frame_in_the_middle_lies_ahead() {
    let fraction = |frame: &str| common::parse(&with(&[("/derivative_frame", frame.into())])).derivative_frame.fraction();
    assert_eq!(["initial", "updated", "midpoint"].map(fraction), [0.0, 0.0, 0.5]);
    let predicted = Settings::from_json(&with(&[("/derivative_frame", "predicted".into())]).to_string());
    assert!(predicted.expect_err("not with ALSPH").to_string().contains("derivative_frame"));
}

#[test]
fn a_weakly_compressible_scheme_has_parameters_of_its_own() {
    let wcsph = json!({"kind": "wcsph", "sound_speed": 10.0, "density_diffusion": "molteni", "diffusion_coefficient": 0.1});
    let refused = |changes: &[(&str, Value)]| {
        let value = with(&[&[("/scheme", wcsph.clone())], changes].concat());
        Settings::from_json(&value.to_string()).expect_err("refused").to_string()
    };
    for (pointer, bad, word) in [
        ("/scheme/sound_speed", json!(0.0), "sound_speed"),
        ("/scheme/diffusion_coefficient", json!(1.5), "diffusion_coefficient"),
        ("/scheme/density_diffusion", json!("fourtakas"), "fourtakas"),
        ("/velocity_laplacian", json!("vector"), "velocity_laplacian"),
        ("/wall_pressure", json!("paper"), "wall_pressure"),
        ("/scheme", json!({"kind": "edac", "sound_speed": 10.0, "diffusion_coefficient": 0.5, "sweeps": 4}), "sweeps"),
    ] {
        let text = refused(&[("/velocity_laplacian", json!("scalar")), ("/wall_pressure", json!("linear")), (pointer, bad)]);
        assert!(text.contains(word), "{text}");
    }
    let isph = json!({"kind": "isph", "pressure_share": 0.9, "solver": "bicgstab", "tolerance": 1e-3, "max_solver_iterations": 9,
               "density_relaxation": 0.0});
    for (pointer, bad, word) in [
        ("/scheme/pressure_share", json!(1.1), "scheme.pressure_share"),
        ("/scheme/tolerance", json!(-1.0), "scheme.tolerance"),
        ("/scheme/max_solver_iterations", json!(0), "scheme.max_solver_iterations"),
        ("/scheme/solver", json!("cg"), "cg"),
        ("/scheme/density_relaxation", json!(1.5), "scheme.density_relaxation"),
        ("/derivative_frame", json!("updated"), "derivative_frame"),
        ("/scheme", json!({"kind": "explicit_isph", "sweeps": 0, "mach_number": 0.1}), "scheme.sweeps"),
        ("/scheme", json!({"kind": "explicit_isph", "sweeps": 1, "mach_number": 0.0}), "scheme.mach_number"),
        ("/wall_pressure", json!("paper"), "wall_pressure"),
    ] {
        let chosen =
            [("/scheme", isph.clone()), ("/velocity_laplacian", json!("scalar")), ("/wall_pressure", json!("linear"))];
        let value = with(&[&chosen[..], &[(pointer, bad)]].concat());
        let text = Settings::from_json(&value.to_string()).expect_err("refused").to_string();
        assert!(text.contains(word), "{text}");
    }
    // The step follows the sound and the flow: 0.45 of 2 Δx/√λ.
    let settings = common::parse(&with(&[
        ("/scheme", wcsph),
        ("/velocity_laplacian", json!("scalar")),
        ("/wall_pressure", json!("linear")),
    ]));
    assert_relative_eq!(settings.time_step_limits(2.0, LARGEST).acoustic, 0.9 * 0.05 / (0.5_f64.sqrt() * 12.0));
    // That of explicit ISPH keeps the Mach number of its waves, four steps damped by 0.67; a is 1.823 with h/Δx = 4/3.
    let explicit = common::parse(&with(&[
        ("/scheme", json!({"kind": "explicit_isph", "sweeps": 4, "mach_number": 0.1})),
        ("/velocity_laplacian", json!("scalar")),
        ("/wall_pressure", json!("linear")),
    ]));
    let limit = explicit.time_step_limits(2.0, LARGEST).acoustic;
    assert_relative_eq!(limit, 0.1 * (4.0 * 0.67 / explicit.laplacian_diagonal()).sqrt() * 0.05 / 2.0, max_relative = 1e-12);
    let wide = common::settings::<2>(0.05, "none");
    assert_relative_eq!(wide.laplacian_diagonal(), 1.823, epsilon = 1e-3);
    assert_eq!(common::settings::<2>(0.05, "none").time_step_limits(2.0, LARGEST).acoustic, f64::INFINITY);
}
