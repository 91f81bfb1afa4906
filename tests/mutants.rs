//! For `cargo mutants`: all tests, of which the first that fails ends the program.

use std::io::{Write, stderr};

#[path = "engine.rs"]
mod engine;

/// One test that fails is enough to kill a mutant: from here on the first ends the program.
#[test]
fn a_failure_ends_the_run() {
    std::panic::set_hook(Box::new(|failure| {
        let thread = std::thread::current();
        _ = writeln!(stderr(), "{}: {failure}", thread.name().unwrap_or("a thread of the engine"));
        std::process::exit(101);
    }));
}
