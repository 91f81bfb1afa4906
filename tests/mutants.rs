//! All tests as one program, for `cargo mutants`: many programs take it many times as long to build, as each has the engine's generic code
//! compiled anew. Tests run in the order of their names, and modules are named so that those come first that take least and kill most.
#![allow(clippy::duplicate_mod)] // each brings what it shares with the others

use std::io::{Write, stderr};

#[path = "settings.rs"]
mod b_settings;
#[path = "report.rs"]
mod c_report;
#[path = "sides.rs"]
mod d_sides;
#[path = "breakdown.rs"]
mod e_breakdown;
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
#[path = "loads.rs"]
mod m_loads;
#[path = "faces.rs"]
mod n_faces;
#[path = "flows.rs"]
mod o_flows;
#[path = "restart.rs"]
mod p_restart;

/// A file of tests that is not named here would kill nothing.
#[test]
fn every_file_of_tests_is_named() {
    let files = std::fs::read_dir("tests").expect("tests are run from the root").flatten().map(|file| file.file_name());
    for name in files.filter_map(|name| name.into_string().ok()).filter(|name| name.ends_with(".rs") && name != "mutants.rs")
    {
        assert!(include_str!("mutants.rs").contains(&format!("\"{name}\"")), "{name} is not named in tests/mutants.rs");
    }
}

/// One test that fails is enough to kill a mutant: from here on the first ends the program.
#[test]
fn a_failure_ends_the_run() {
    std::panic::set_hook(Box::new(|failure| {
        let thread = std::thread::current();
        _ = writeln!(stderr(), "{}: {failure}", thread.name().unwrap_or("a thread of the engine"));
        std::process::exit(101);
    }));
}
