//! Thin bodies: what the two faces of one show to the fluid on each.

use alsph::boundary::Walls;
use alsph::shifting::shift;
use alsph::{Clock, ParticleKind, Particles, Simulation, Vector};
use common::set::Set;
use serde_json::json;

mod common;

const SIDE: usize = 10;
const SPACING: f64 = 1.0 / SIDE as f64;

/// Two streams over each other, each one unit high, between a floor, a plate of `rows` layers of solid particles and a lid that slides.
/// With `faces` the plate has two particles at each place.
fn two_streams(rows: usize, faces: bool) -> (serde_json::Value, Particles<2>) {
    let mut points = Vec::new();
    let mut walls = Vec::new();
    let thickness = rows as f64 * SPACING;
    let mut row = |y: f64, wall: Option<(u16, f64, f64)>| {
        for k in 0..SIDE {
            points.push(Vector::from([(k as f64 + 0.5) * SPACING, y]));
            walls.push(wall);
        }
    };
    for k in 0..SIDE {
        let height = (k as f64 + 0.5) * SPACING;
        row(height, None);
        row(1.0 + thickness + height, None);
    }
    for k in 0..4 {
        let depth = (k as f64 + 0.5) * SPACING;
        row(-depth, Some((0, 1.0, depth)));
        row(2.0 + thickness + depth, Some((2, -1.0, depth)));
    }
    for k in 0..rows {
        let depth = (k as f64 + 0.5) * SPACING;
        let upper = (1, 1.0, thickness - depth);
        let lower = (1, -1.0, depth);
        if faces {
            row(1.0 + depth, Some(upper));
            row(1.0 + depth, Some(lower));
        } else {
            row(1.0 + depth, Some(if upper.2 < lower.2 { upper } else { lower }));
        }
    }
    let mut particles = common::particles(points);
    for (i, wall) in walls.into_iter().enumerate() {
        let Some((body, up, depth)) = wall else { continue };
        particles.kind[i] = ParticleKind::Solid;
        (particles.body[i], particles.normal[i], particles.depth[i]) = (body, Vector::from([0.0, up]), depth);
    }
    let mut value = common::settings_value::<2>(SPACING, "none");
    value["kinematic_viscosity"] = 1.0.into();
    (value["wall_velocity"], value["wall_pressure"], value["viscous_order"]) = ("cubic".into(), "linear".into(), 4.into());
    value["domain"] = json!({"lower": [0.0, 0.0], "upper": [1.0, 2.0 + thickness], "boundaries": [["periodic", "periodic"], ["none", "none"]]});
    value["bodies"] = ["floor", "plate", "lid"]
        .map(|name| json!({"name": name, "velocity": [f64::from(name == "lid"), 0.0], "moves": false, "center": [0.0, 0.0]}))
        .into_iter()
        .collect();
    (value, particles)
}

/// Largest velocity below the plate, and largest error above it, after the flow has settled; shear on floor, plate and lid.
fn settled(rows: usize, faces: bool) -> (f64, f64, [f64; 3]) {
    let (value, particles) = two_streams(rows, faces);
    let mut simulation = Simulation::new(common::parse(&value), particles, Clock::default(), Some(1)).expect("valid");
    simulation.advance_until(1.0, None).expect("stable");
    let particles = simulation.particles();
    let (mut below, mut above) = (0.0f64, 0.0f64);
    for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Fluid) {
        let height = particles.position[i][1] - 1.0 - rows as f64 * SPACING;
        let [u, v] = particles.velocity[i].into();
        if height < 0.0 { below = below.max(u.hypot(v)) } else { above = above.max((u - height).hypot(v)) }
    }
    let loads = simulation.take_history().pop().expect("steps were taken").loads;
    (below, above, [0, 1, 2].map(|k| loads[k].viscous_force[0]))
}

#[test]
fn a_thin_plate_parts_two_streams() {
    for rows in [2, 3] {
        let (below, above, shear) = settled(rows, true);
        assert!(below < 1e-3 && above < 1e-3, "{rows} rows: {below} below the plate, error {above} above it");
        let error = [0.0, 1.0, -1.0].into_iter().zip(shear).map(|(exact, shear)| (shear - exact).abs()).fold(0.0, f64::max);
        assert!(error < 0.02, "{rows} rows: shear {shear:?}");
    }
    let (one_for_both, ..) = settled(2, false);
    assert!(one_for_both > 2e-3, "one particle for both faces drags the stream below along, {one_for_both}");
}

#[test]
fn a_restart_and_threads_change_no_bit_of_a_flow_past_a_thin_plate() {
    let (value, particles) = two_streams(2, true);
    let start =
        |particles, clock, threads| Simulation::new(common::parse(&value), particles, clock, Some(threads)).expect("valid");
    let mut whole = start(particles.clone(), Clock::default(), 2);
    whole.advance(21, None).expect("stable");
    let mut first = start(particles, Clock::default(), 1);
    first.advance(7, None).expect("stable");
    let mut state = first.particles().clone();
    state.drop_images();
    let mut resumed = start(state, first.clock(), 1);
    resumed.advance(14, None).expect("stable");
    let bits = |simulation: &Simulation<2>| -> Vec<_> {
        let particles = simulation.particles();
        let mut rows: Vec<_> =
            (0..particles.real).map(|i| (particles.id[i], particles.velocity[i].map(f64::to_bits))).collect();
        rows.sort_by_key(|row| row.0);
        rows
    };
    let different = bits(&whole).iter().zip(&bits(&resumed)).filter(|(a, b)| a != b).count();
    assert_eq!(different, 0);
}

/// Part of a place at `height` over the middle of a plate that is on its upper face.
fn upper(height: f64, thickness: f64) -> f64 {
    let t = (0.5 + height / thickness).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The end of a plate of two rows, 2 Δx thick, at [0.5, 0.5], with two particles at each place, and fluid at these cells from its end.
fn plate_end(fluid: &[[f64; 2]]) -> Set<2> {
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for (column, row, up) in
        (0..3).flat_map(|column| [-0.5, 0.5].map(|row| [(column, row, 1.0), (column, row, -1.0)])).flatten()
    {
        points.push([-f64::from(column), row]);
        faces.push((up, 1.0 - up * row));
    }
    let solids = points.len();
    points.extend_from_slice(fluid);
    let mut particles = common::particles(points.into_iter().map(|x| Vector::from(x).add_scalar(5.0) * SPACING).collect());
    for (i, (up, depth)) in faces.into_iter().enumerate() {
        (particles.normal[i], particles.depth[i]) = (Vector::from([0.0, up]), depth * SPACING);
    }
    particles.kind[..solids].fill(ParticleKind::Solid);
    Set::of(particles, &common::settings::<2>(SPACING, "none"), false)
}

#[test]
fn around_an_edge_the_shares_of_both_faces_change_smoothly() {
    let fluid = [[0.0, 2.0], [1.0, 0.5], [1.0, 0.0], [1.5, -0.25], [-1.0, -1.5], [2.0, 0.9]];
    let Set { particles, frame } = plate_end(&fluid);
    let solids = particles.real - fluid.len();
    let mut seen = 0;
    for i in 0..particles.real {
        let (row, lane) = frame.stencil.neighbours.row(i);
        for (entry, share) in row
            .solid_seen(lane)
            .filter(|(entry, _)| frame.stencil.is_near(&common::settings::<2>(SPACING, "none"), i, entry.j()))
        {
            let up = particles.normal[entry.j()][1];
            let expected = match i.checked_sub(solids) {
                Some(k) => upper(up * fluid[k][1], 2.0),
                // Solids see those of their own face.
                None => f64::from(particles.normal[i][1] == up),
            };
            assert!((share - expected).abs() < 1e-6, "{i} sees {share} of {}, {expected} is right", entry.j());
            seen += 1;
        }
        assert!(row.flowing_seen(lane).all(|(entry, share)| entry.j() == i || i < solids || share == 1.0));
    }
    assert!(seen > 100);
}

#[test]
fn particles_at_one_place_of_which_nothing_else_is_known_share_evenly() {
    let mut particles = common::particles([[0.5, 0.5], [0.5, 0.5], [0.6, 0.5]].map(Vector::from).to_vec());
    particles.kind[..2].fill(ParticleKind::Solid);
    let Set { frame, .. } = Set::of(particles, &common::settings::<2>(SPACING, "none"), false);
    let (row, lane) = frame.stencil.neighbours.row(2);
    assert_eq!(row.solid_seen(lane).map(|(_, share)| share).collect::<Vec<_>>(), [0.5, 0.5]);
}

#[test]
fn a_plate_hides_what_is_behind_it() {
    let Set { particles, frame } = plate_end(&[]);
    let solids: Vec<_> = (0..particles.real).collect();
    let sight = |a: [f64; 2], b: [f64; 2]| {
        let place = |x: [f64; 2]| Vector::from(x).add_scalar(5.0) * SPACING;
        frame.faces.sight(&particles, SPACING, &solids, &place(a), &place(b))
    };
    let partly = upper(0.75, 2.0) - upper(-0.5, 2.0);
    for (a, b, expected) in [
        // Through the plate, between its particles, and past its end, half a spacing to a whole one away.
        ([-1.0, 2.0], [-1.0, -2.0], 0.0),
        ([-0.5, 2.0], [-0.5, -2.0], 0.0),
        ([0.5, 2.0], [0.5, -2.0], 0.0),
        ([0.75, 2.0], [0.75, -2.0], 0.5),
        ([1.0, 2.0], [1.0, -2.0], 1.0),
        // On one side, however near.
        ([-2.0, 1.1], [0.0, 3.0], 1.0),
        // From one part of the edge to another.
        ([0.0, 0.75], [0.0, -0.5], 1.0 - partly * partly),
        // Not beyond the two places.
        ([2.0, 0.5], [1.0, -0.5], 1.0),
        ([1.0, -0.5], [2.0, 0.5], 1.0),
    ] {
        assert!((sight(a, b) - expected).abs() < 1e-9, "{} from {a:?} to {b:?}, {expected} is right", sight(a, b));
    }
}

/// Each place of a plate counts once in the volumes of the fluid and in its shift, whether it has one particle or two, and what is behind
/// the plate counts.
#[test]
fn two_particles_at_a_place_take_room_and_shift_the_fluid_as_one_does() {
    let [one, two] = [false, true].map(|faces| {
        let (value, mut particles) = two_streams(2, faces);
        for i in (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Fluid) {
            particles.position[i][1] += 0.1 * SPACING * (i as f64).sin();
            particles.velocity[i] = Vector::from([(3.0 * i as f64).sin(), (2.0 * i as f64).cos()]);
        }
        let settings = common::parse(&value);
        let mut set = Set::of(particles, &settings, false);
        let (mut walls, before) = (Walls::new(&settings), set.particles.clone());
        walls.viscous_velocity = vec![Vector::zeros(); before.len()];
        shift(&settings, &mut set.particles, &set.frame, &walls, 1e-3, 1.0, &mut Vec::new());
        let fluid = (0..before.real).filter(|&i| before.kind[i] == ParticleKind::Fluid);
        fluid.map(|i| (set.frame.stencil.volume[i], set.particles.position[i] - before.position[i])).collect::<Vec<_>>()
    });
    for ((volume, _), (of_two, _)) in one.iter().zip(&two) {
        assert!((volume / of_two - 1.0).abs() < 1e-5, "{volume} and {of_two}");
    }
    let longest = one.iter().map(|(_, shift)| shift.norm()).fold(0.0, f64::max);
    assert!(longest > 1e-6);
    let off = one.iter().zip(&two).map(|((_, a), (_, b))| (a - b).norm()).fold(0.0, f64::max);
    assert!(off < 1e-6 * longest, "{off:.1e} of {longest:.1e}");
}
