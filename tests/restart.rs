//! A run that is cut and restored, with its particles stored in any order and all that is stale made NaN, has the bits of a whole one
//! without, whatever the settings.

use alsph::forcing::Rule;
use alsph::motion::{MotionRule, Pose};
use alsph::{Clock, ParticleKind, Particles, Place, Simulation, Vector};
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::collections::HashSet;
use std::f64::consts::TAU;

mod common;

/// What a configuration chooses, and what from. The first two say what closes the sides, the third whether the body moves, the fourth
/// what is prescribed by place and time, the rest are settings.
const FACTORS: [(&str, &[&str]); 19] = [
    (
        "layout",
        &[
            "walls and periodic sides",
            "walls and slip sides",
            "walls, inlet and outlet",
            "walls, inlet and outlet that fluid comes back through",
            "body between inlet, outlet and slip sides",
            "body between periodic sides",
            "body across a periodic side",
            "body across a slip side",
            "plate of two faces",
            "walls all around",
            "no solids",
        ],
    ),
    ("third direction", &["periodic", "slip", "walls"]),
    ("moves", &["false", "true", "belt", "told", "free"]),
    ("prescribed", &["nothing", "force and surfaces"]),
    ("wall_velocity", &["paper", "adami", "cubic", "morris"]),
    ("wall_pressure", &["paper", "adami", "linear"]),
    ("derivative_frame", &["midpoint", "updated", "initial", "updated, searched in every iteration"]), // updated by u^n in isph
    (
        "scheme",
        &[
            r#"{"kind": "alsph"}"#,
            r#"{"kind": "wcsph", "sound_speed": 10, "density_diffusion": "antuono", "diffusion_coefficient": 0.1}"#,
            r#"{"kind": "edac", "sound_speed": 10, "diffusion_coefficient": 0.5}"#,
            r#"{"kind": "isph", "pressure_share": 0.9, "solver": "bicgstab", "tolerance": 1e-3, "max_solver_iterations": 10, "density_relaxation": 0.01}"#,
            r#"{"kind": "isph", "pressure_share": 0, "solver": "multigrid", "tolerance": 0, "max_solver_iterations": 2}"#,
            r#"{"kind": "explicit_isph", "sweeps": 2, "mach_number": 0.1}"#,
            r#"{"kind": "isph", "pressure_share": 1, "solver": "jacobi", "tolerance": 0.1, "max_solver_iterations": 9}"#,
        ],
    ),
    ("shifting", &["strain", "xsph", "maximum_velocity", "none"]),
    ("viscous_order", &["2", "4"]),
    ("velocity_laplacian", &["scalar", "vector"]),
    ("laplacian_correction", &["true", "false"]),
    ("projection_sweeps", &["0", "3"]),
    ("sweep_weights", &["equal", "chebyshev"]),
    ("sweep_pressure", &["rough", "smooth"]),
    ("penalty_constant", &["100.0", "null"]),
    ("viscous_theta", &["1.0", "0.5"]),
    ("kernel", &["quintic_spline", "wendland_c2", "wendland_c4"]),
    ("adaptive_time_step", &["true", "false"]),
];

/// An index into the choices of each factor.
type Configuration = [usize; FACTORS.len()];

/// The first of these steps lie before the sixteenth, when the particles are sorted.
const STEPS: u64 = 8;
const FIRST_STEP: u64 = 12;

struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % count
    }

    fn configuration(&mut self) -> Configuration {
        FACTORS.map(|(_, choices)| self.below(choices.len()))
    }
}

/// Few configurations in which every pair of choices of two factors occurs: of some at random, the one with most new pairs is next.
fn covering(random: &mut Random) -> Vec<Configuration> {
    let pairs = |chosen: &Configuration| -> Vec<[usize; 4]> {
        (0..FACTORS.len()).flat_map(|a| (0..a).map(move |b| [a, b])).map(|[a, b]| [a, chosen[a], b, chosen[b]]).collect()
    };
    let count: usize =
        (0..FACTORS.len()).map(|a| (0..a).map(|b| FACTORS[a].1.len() * FACTORS[b].1.len()).sum::<usize>()).sum();
    let (mut seen, mut configurations) = (HashSet::new(), Vec::new());
    while seen.len() < count {
        let candidates: Vec<_> = (0..60).map(|_| random.configuration()).collect();
        let new = |chosen: &&Configuration| pairs(chosen).iter().filter(|&pair| !seen.contains(pair)).count();
        let best = *candidates.iter().max_by_key(new).expect("some");
        seen.extend(pairs(&best));
        configurations.push(best);
    }
    configurations
}

fn choice(configuration: &Configuration, factor: &str) -> &'static str {
    let k = FACTORS.iter().position(|(name, _)| *name == factor).expect("a factor");
    FACTORS[k].1[configuration[k]]
}

/// What closes both sides of each direction; walls are solid particles beyond.
fn sides<const D: usize>(configuration: &Configuration) -> [&'static str; D] {
    let [x, y] = match choice(configuration, "layout") {
        "walls and periodic sides" => ["periodic", "walls"],
        "walls and slip sides" => ["slip", "walls"],
        "walls, inlet and outlet" | "walls, inlet and outlet that fluid comes back through" => ["open", "walls"],
        "body between inlet, outlet and slip sides" => ["open", "slip"],
        "body across a slip side" => ["periodic", "slip"],
        "walls all around" => ["walls", "walls"],
        _ => ["periodic", "periodic"],
    };
    std::array::from_fn(|axis| [x, y, choice(configuration, "third direction")][axis])
}

fn settings<const D: usize>(configuration: &Configuration, spacing: f64) -> Value {
    let mut value = common::settings_value::<D>(spacing, "none");
    for (key, _) in &FACTORS[4..] {
        let chosen = choice(configuration, key);
        value[*key] = serde_json::from_str(chosen).unwrap_or_else(|_| chosen.into());
    }
    if value["derivative_frame"].as_str().is_some_and(|frame| frame.contains("searched")) {
        (value["derivative_frame"], value["search_every_iteration"]) = ("updated".into(), true.into());
    }
    if motion_of(configuration) == "free" {
        value["time_step"] = (0.25 * value["time_step"].as_f64().expect("a number")).into(); // else refused where it is constant
    }
    if value["scheme"]["kind"] != "alsph" {
        // What other schemes refuse.
        value["velocity_laplacian"] = "scalar".into();
        if value["wall_pressure"] == "paper" {
            value["wall_pressure"] = "adami".into();
        }
    }
    if is_rigid(configuration) && value["wall_pressure"] == "paper" {
        value["wall_pressure"] = "linear".into();
    }
    if value["scheme"]["kind"].as_str().is_some_and(|kind| kind.contains("isph")) && value["derivative_frame"] == "updated" {
        (value["derivative_frame"], value["search_every_iteration"]) = ("predicted".into(), false.into());
    }
    value["max_iterations"] = 2.into();
    value["body_force"] = json!([0.2, -0.1, 0.1][..D]);
    value["domain"]["boundaries"] = sides::<D>(configuration)
        .map(|side| match side {
            "open" => ["inlet", "outlet"],
            "walls" => ["none", "none"],
            closed => [closed, closed],
        })
        .to_vec()
        .into();
    let moves = motion_of(configuration);
    let body = |name: &str, velocity: [f64; 3], moves: bool| json!({"name": name, "velocity": velocity[..D], "moves": moves, "center": vec![0.5; D]});
    let bodies = [
        body("walls", [0.0; 3], false),
        body("lid", [0.3, 0.0, 0.0], moves == "belt"),
        body("body", [0.4, 0.0, 0.1], moves == "true"),
    ];
    value["bodies"] = bodies.to_vec().into();
    if is_rigid(configuration) {
        let body = &mut value["bodies"][2];
        (body["velocity"], body["moves"]) = (Value::Null, true.into());
        body["center"] = centre::<D>(choice(configuration, "layout"), 0.0).as_slice().into();
    }
    if moves == "free" {
        // Of what lies across a slip side half is there.
        let turns = !choice(configuration, "layout").contains("slip side");
        let turning = if D == 2 { 1 } else { 3 };
        let inertia = if D == 2 { vec![0.01] } else { vec![0.01, 0.001, 0.0, 0.001, 0.012, 0.0, 0.0, 0.0, 0.011] };
        let free = [vec![true], vec![turns; D - 1 + turning]].concat();
        value["bodies"][2]["rigid"] = json!({
            "mass": 0.1, "inertia": inertia, "force": vec![0.05; D], "stiffness": vec![1.0; D], "damping": vec![0.1; D],
            "free": free, "added_mass": 0.05, "added_inertia": 0.01,
        });
    }
    if prescribes(configuration) {
        value["bodies"][0]["velocity"] = Value::Null;
    }
    if moves == "belt" {
        let outside = beyond(configuration, sides::<D>(configuration)[0]) as f64
            * value["particle_spacing"].as_f64().expect("a number");
        value["bodies"][1]["belt"] = json!([-outside, 1.0 + outside]);
    }
    value
}

/// How the body moves: a plate from wall to wall stays.
fn motion_of(configuration: &Configuration) -> &'static str {
    let from_wall_to_wall =
        ["layout", "third direction"].map(|factor| choice(configuration, factor)) == ["plate of two faces", "walls"];
    if from_wall_to_wall { "false" } else { choice(configuration, "moves") }
}

fn is_rigid(configuration: &Configuration) -> bool {
    ["told", "free"].contains(&motion_of(configuration))
}

/// The motion of a body, which turns if it can.
fn motion(configuration: &Configuration, dimensions: usize) -> MotionRule {
    let turns = if choice(configuration, "layout").contains("slip side") { 0.0 } else { 1.0 };
    let about = if dimensions == 2 { Vector3::z() } else { Vector3::new(0.6, 0.0, 0.8) };
    Box::new(move |time| {
        let (way, swing) = (Vector3::x() * 0.3, about * (2.0 * turns));
        Ok(vec![Pose {
            displacement: way * time,
            velocity: way,
            angle: swing * (time + time * time),
            spin: swing * (1.0 + 2.0 * time),
            angular_acceleration: swing * 2.0,
            ..Pose::default()
        }])
    })
}

fn prescribes(configuration: &Configuration) -> bool {
    choice(configuration, "prescribed") != "nothing"
}

/// A body force, and a velocity of the walls, that change from place to place and in time.
fn wave<const D: usize>(position: &[Vector<D>], time: f64) -> alsph::Result<Vec<Vector<D>>> {
    let at = |r: &Vector<D>| Vector::from_fn(|axis, _| 0.2 * (TAU * r.sum() + 40.0 * time + axis as f64).sin());
    Ok(position.iter().map(at).collect())
}

/// Layers of particles outside of a side: walls four deep, buffers of 6h.
fn beyond(configuration: &Configuration, side: &str) -> i64 {
    match (side, choice(configuration, "kernel")) {
        ("walls", _) => 4,
        ("open", "quintic_spline") => 8,
        ("open", _) => 10,
        _ => 0,
    }
}

/// A disordered box of fluid with the walls, buffers and the body of the layout.
fn particles<const D: usize>(configuration: &Configuration, side: i64, spacing: f64, random: &mut Random) -> Particles<D> {
    let sides = sides::<D>(configuration);
    let beyond = sides.map(|side| beyond(configuration, side));
    let widths = beyond.map(|beyond| side + 2 * beyond);
    let mut particles = common::particles(Vec::new());
    for k in 0..widths.iter().product() {
        let mut rest = k;
        let position = Vector::<D>::from_fn(|axis, _| {
            let cell = rest % widths[axis] - beyond[axis];
            rest /= widths[axis];
            (cell as f64 + 0.5) * spacing
        });
        add(&mut particles, configuration, &sides, position, spacing, random);
    }
    particles.real = particles.position.len();
    particles.id = (0..particles.real as u64).collect();
    particles.place = vec![Place::Inside; particles.real];
    particles.unkept_pressure = vec![0.0; particles.real];
    particles
}

fn add<const D: usize>(
    particles: &mut Particles<D>,
    configuration: &Configuration,
    sides: &[&str; D],
    mut position: Vector<D>,
    spacing: f64,
    random: &mut Random,
) {
    let mut into_wall = Vector::<D>::zeros();
    for axis in (0..D).filter(|&axis| sides[axis] == "walls") {
        into_wall[axis] = position[axis] - position[axis].clamp(0.0, 1.0);
    }
    if let Some(faces) = plate(configuration, &position, spacing) {
        for (depth, outward) in faces {
            push(particles, ParticleKind::Solid, 2, position, Vector::zeros(), depth, outward);
        }
        return;
    }
    let (depth, outward) = match body(configuration, &position, spacing) {
        Some((depth, outward)) => (depth, outward),
        None => (into_wall.norm(), -into_wall.try_normalize(0.0).unwrap_or_else(Vector::zeros)),
    };
    let kind = match sides[0] {
        _ if depth > 0.0 => ParticleKind::Solid,
        "open" if position[0] < 0.0 => ParticleKind::Inlet,
        "open" if position[0] > 1.0 => ParticleKind::Outlet,
        _ => ParticleKind::Fluid,
    };
    if kind == ParticleKind::Fluid {
        position.iter_mut().for_each(|x| *x += 0.2 * spacing * (random.below(1000) as f64 / 500.0 - 1.0));
    }
    let [x, y] = [0, 1].map(|axis| TAU * position[axis]);
    let mean = if ["periodic", "open"].contains(&sides[0]) { 0.6 } else { 0.0 };
    let mut velocity = Vector::zeros();
    (velocity[0], velocity[1]) = (mean + 0.3 * x.sin() * y.cos(), -0.3 * x.cos() * y.sin());
    if choice(configuration, "layout").contains("comes back") && position[0] > 0.7 && depth == 0.0 {
        if position[0] > 1.0 + 3.0 * spacing {
            return; // void
        }
        velocity[0] -= 1.5 * position[1];
    }
    let body = if into_wall.norm() == 0.0 { 2 } else { u16::from(into_wall[1] > 0.0) } * u16::from(depth > 0.0);
    push(particles, kind, body, position, velocity, depth, outward);
}

fn push<const D: usize>(
    particles: &mut Particles<D>,
    kind: ParticleKind,
    body: u16,
    position: Vector<D>,
    velocity: Vector<D>,
    depth: f64,
    normal: Vector<D>,
) {
    particles.kind.push(kind);
    particles.body.push(body);
    particles.position.push(position);
    particles.velocity.push(velocity);
    particles.pressure.push(0.05 * ((TAU * position[0]).cos() + (TAU * position[1]).cos()));
    particles.depth.push(depth);
    particles.normal.push(normal);
}

/// Depths below the two faces of a plate across the flow, three layers thick, and the normals there, if `position` is inside.
fn plate<const D: usize>(
    configuration: &Configuration,
    position: &Vector<D>,
    spacing: f64,
) -> Option<[(f64, Vector<D>); 2]> {
    let along = position[0] - (0.5 + 0.5 * spacing);
    let from_end = (0.25 / spacing).floor() * spacing - (position[1] - 0.5).abs();
    let inside = along.abs() < 1.2 * spacing && from_end > 0.0;
    let outward = |side: f64| Vector::from_fn(|axis, _| if axis == 0 { side } else { 0.0 });
    let face = |side: f64| ((1.5 * spacing - side * along).min(from_end), outward(side));
    (choice(configuration, "layout").contains("plate") && inside).then(|| [face(1.0), face(-1.0)])
}

/// The middle of the body; of one across a periodic side where its x is `side`.
fn centre<const D: usize>(layout: &str, side: f64) -> Vector<D> {
    let mut centre = Vector::repeat(0.5);
    match layout {
        "body across a periodic side" => centre[0] = side,
        "body across a slip side" => centre[1] = 0.0,
        _ => {}
    }
    centre
}

/// Depth below the surface of the body, and the normal there, if `position` is inside.
fn body<const D: usize>(configuration: &Configuration, position: &Vector<D>, spacing: f64) -> Option<(f64, Vector<D>)> {
    let layout = choice(configuration, "layout");
    let centre = centre(layout, position[0].round());
    let (radius, arm) = (if D == 2 { 2.6 } else { 1.7 } * spacing, position - centre);
    (layout.contains("body") && arm.norm() < radius).then(|| (radius - arm.norm(), arm.normalize()))
}

/// Velocity, pressure and position by id, and the history.
type Outcome = (Vec<[u64; 8]>, Vec<String>);

/// The same particles, stored in another order.
fn shuffled<const D: usize>(mut particles: Particles<D>, random: &mut Random) -> Particles<D> {
    let mut order: Vec<u32> = (0..particles.real as u32).collect();
    (1..order.len()).rev().for_each(|k| order.swap(k, random.below(k + 1)));
    particles.reorder(&order);
    particles
}

/// Run `simulation` to the end; with poison, also through a restart after so many steps, each time in some other order of storage.
fn outcome<const D: usize>(
    configuration: &Configuration,
    settings: &Value,
    particles: &Particles<D>,
    cut: Option<u64>,
    random: &mut Random,
) -> Result<Outcome, String> {
    let settings = common::parse(settings);
    let clock = Clock { step: FIRST_STEP, ..Clock::default() };
    let start = |particles, clock, threads| -> alsph::Result<Simulation<D>> {
        let mut simulation = Simulation::new(settings.clone(), particles, clock, Some(threads))?;
        simulation.poison(cut.is_some());
        if prescribes(configuration) {
            let rules = [(); 2].map(|()| Some(Box::new(wave) as Rule<D>));
            [simulation.forcing.body_force, simulation.forcing.surface_velocity] = rules;
        }
        if motion_of(configuration) == "told" {
            simulation.forcing.motion = Some(motion(configuration, D));
        }
        Ok(simulation)
    };
    let mut run = || -> alsph::Result<Outcome> {
        let particles = if cut.is_some() { shuffled(particles.clone(), random) } else { particles.clone() };
        let mut simulation = start(particles, clock, 1)?;
        let mut history = Vec::new();
        if let Some(cut) = cut {
            simulation.advance(cut, None)?;
            history.extend(simulation.take_history());
            let mut saved = simulation.particles().clone();
            saved.drop_images();
            let poses = simulation.poses();
            simulation = start(shuffled(saved, random), simulation.clock(), 2)?;
            simulation.set_poses(&poses)?;
        }
        simulation.advance(STEPS - cut.unwrap_or(0), None)?;
        history.extend(simulation.take_history());
        Ok((state(simulation.particles()), history.iter().map(|report| format!("{report:?}")).collect()))
    };
    run().map_err(|error| error.to_string())
}

fn state<const D: usize>(particles: &Particles<D>) -> Vec<[u64; 8]> {
    let mut order: Vec<usize> = (0..particles.real).collect();
    order.sort_by_key(|&i| particles.id[i]);
    let numbers = |i: usize| {
        let mut numbers = [particles.pressure[i]; 8];
        numbers[7] = particles.unkept_pressure[i];
        for axis in 0..D {
            (numbers[axis], numbers[3 + axis]) = (particles.position[i][axis], particles.velocity[i][axis]);
        }
        numbers.map(f64::to_bits)
    };
    order.into_iter().map(numbers).collect()
}

/// What is wrong with a configuration, if anything.
fn problem<const D: usize>(configuration: &Configuration, random: &mut Random) -> Option<String> {
    let side = if D == 2 { 12 } else { 6 };
    let spacing = 1.0 / side as f64;
    let settings = settings::<D>(configuration, spacing);
    let particles = particles::<D>(configuration, side, spacing, random);
    let cut = 1 + random.below(STEPS as usize - 1) as u64;
    let whole = outcome(configuration, &settings, &particles, None, random);
    let problem = match (whole, outcome(configuration, &settings, &particles, Some(cut), random)) {
        (Ok(whole), Ok(cut)) if whole == cut => return None,
        (Ok(whole), Ok(cut)) => {
            let pairs = whole.0.iter().flatten().zip(cut.0.iter().flatten());
            let (numbers, differ) = (pairs.clone().count(), pairs.filter(|(a, b)| a != b).count());
            format!("{differ} of {numbers} numbers differ, {} of {STEPS} reports", {
                whole.1.iter().zip(&cut.1).filter(|(a, b)| a != b).count()
            })
        }
        (whole, cut) => format!("whole: {:?}, cut: {:?}", whole.err(), cut.err()),
    };
    let chosen: Vec<_> = FACTORS.iter().map(|(factor, _)| choice(configuration, factor)).collect();
    Some(format!("{D}-D, cut after {cut}: {problem}\n    {}", chosen.join(", ")))
}

fn check(problems: Vec<String>, count: usize) {
    println!("{count} configurations");
    assert!(problems.is_empty(), "{} of {count} configurations:\n{}", problems.len(), problems.join("\n"));
}

#[test]
fn a_run_cut_poisoned_and_stored_in_another_order_has_the_bits_of_a_whole_one() {
    let random = &mut Random(1);
    let (plane, space) = (covering(random), covering(random));
    let mut problems: Vec<_> = plane.iter().filter_map(|configuration| problem::<2>(configuration, random)).collect();
    problems.extend(space.iter().filter_map(|configuration| problem::<3>(configuration, random)));
    check(problems, plane.len() + space.len());
}

/// As many configurations in 2-D, and a tenth in 3-D, as `ALSPH_CONFIGURATIONS` says, of 2e8 and 7e8.
#[test]
#[ignore = "takes hours"]
fn any_run_cut_poisoned_and_stored_in_another_order_has_the_bits_of_a_whole_one() {
    let count = std::env::var("ALSPH_CONFIGURATIONS").ok().and_then(|count| count.parse().ok()).unwrap_or(10_000);
    let random = &mut Random(2);
    let mut problems: Vec<_> = (0..count).filter_map(|_| problem::<2>(&random.configuration(), random)).collect();
    problems.extend((0..count / 10).filter_map(|_| problem::<3>(&random.configuration(), random)));
    check(problems, count + count / 10);
}
