//! All tests as one program: many programs take many times as long to build, as each has the engine's generic code compiled anew. Tests start
//! in the order of their names, and modules are named so that those come first that take least and notice most.
#![allow(clippy::duplicate_mod)] // each brings what it shares with the others

#[path = "settings.rs"]
mod a_settings;
#[path = "report.rs"]
mod b_report;
#[path = "sides.rs"]
mod c_sides;
#[path = "sums.rs"]
mod d_sums;
#[path = "breakdown.rs"]
mod e_breakdown;
#[path = "free_surface.rs"]
mod f_free_surface;
#[path = "interpolation.rs"]
mod f_interpolation;
#[path = "shift.rs"]
mod g_shift;
#[path = "step.rs"]
mod h_step;
#[path = "walls.rs"]
mod i_walls;
#[path = "simulation.rs"]
mod j_simulation;
#[path = "operators.rs"]
mod k_operators;
#[path = "neighbours.rs"]
mod l_neighbours;
#[path = "poisson.rs"]
mod l_poisson;
#[path = "first_instants.rs"]
mod m_first_instants;
#[path = "forcing.rs"]
mod m_forcing;
#[path = "custom_scheme.rs"]
mod n_custom_scheme;
#[path = "custom_kernel.rs"]
mod o_custom_kernel;
#[path = "loads.rs"]
mod p_loads;
#[path = "motion.rs"]
mod p_motion;
#[path = "faces.rs"]
mod q_faces;
#[path = "flows.rs"]
mod r_flows;
#[path = "restart.rs"]
mod s_restart;

/// A file of tests that is not named here would not be run.
#[test]
fn every_file_of_tests_is_named() {
    let files = std::fs::read_dir("tests").expect("tests are run from the root").flatten().map(|file| file.file_name());
    for name in files.filter_map(|name| name.into_string().ok()).filter(|name| name.ends_with(".rs")) {
        let named = include_str!("engine.rs").contains(&format!("\"{name}\""));
        assert!(named || ["engine.rs", "mutants.rs"].contains(&name.as_str()), "{name} is not named in tests/engine.rs");
    }
}
