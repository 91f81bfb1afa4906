//! Errors of the operators on a manufactured field, as Markdown tables: `cargo run --release --example operator_errors`.
//!
//! The field is u_k = sin(2π(x ± y ...) + ½), the scalar the sum of its components. All particles carry the exact values, so
//! that what is measured is the operators alone.

use alsph::settings::Settings;
use common::manufactured::{Errors, OperatorErrors, laplacian_of_positions};
use common::set::Set;

#[path = "../tests/common/mod.rs"]
mod common;

const RATIO: f64 = 4.0 / 3.0;
const SIDES: [usize; 5] = [20, 40, 80, 160, 320];
/// Displacement of the particles of a perturbed lattice in spacings.
const DISORDER: f64 = 0.2;

/// Makes a set of particles from a number of spacings to a unit length and h/Δx, and says which of them are judged.
type Make<const D: usize> = fn(usize, f64) -> (Set<D>, Vec<usize>);

const PLANAR: [(&str, Make<2>); 3] =
    [("Lattice", lattice), ("Perturbed lattice", perturbed), ("Around a cylinder", cylinder)];
const SPATIAL: [(&str, Make<3>); 2] = [("Lattice, 3-D", lattice), ("Perturbed lattice, 3-D", perturbed)];

fn settings<const D: usize>(side: usize, ratio: f64) -> Settings {
    common::compact_settings::<D>(1.0 / side as f64, ratio)
}

fn box_of<const D: usize>(side: usize, ratio: f64, disorder: f64) -> (Set<D>, Vec<usize>) {
    let particles = common::particles(common::lattice(side, disorder));
    (Set::of(particles, &settings::<D>(side, ratio), true), (0..side.pow(D as u32)).collect())
}

fn lattice<const D: usize>(side: usize, ratio: f64) -> (Set<D>, Vec<usize>) {
    box_of(side, ratio, 0.0)
}

fn perturbed<const D: usize>(side: usize, ratio: f64) -> (Set<D>, Vec<usize>) {
    box_of(side, ratio, DISORDER)
}

/// Judged are the fluid particles with solid ones in their support.
fn cylinder(side: usize, ratio: f64) -> (Set<2>, Vec<usize>) {
    let settings = settings::<2>(side, ratio);
    let reach = settings.support_radius();
    let set = Set::of(common::cylinder(side, (reach * side as f64).ceil() as usize), &settings, true);
    let judged = common::fluid_near_cylinder(&set.particles, reach);
    (set, judged)
}

/// A table of the errors, one row for each (1/Δx, h/Δx), each with the observed orders from the row before if `orders`.
fn table<const D: usize>((title, make): (&str, Make<D>), rows: &[(usize, f64)], orders: bool) {
    println!("\n{title}:\n");
    println!("| Δx | h/Δx | ∇f | ∇·u | ∇²f | ∇²f, linear part removed | ∇²u + 2∇(∇·u), printed (16) |");
    println!("|---|---|---|---|---|---|---|");
    let mut before: Option<(usize, [Errors; 5])> = None;
    for &(side, ratio) in rows {
        let (set, judged) = make(side, ratio);
        let errors = OperatorErrors::of(&set, &judged).all();
        let cells: Vec<String> = (0..errors.len())
            .map(|k| {
                let order = before.filter(|_| orders).map(|(coarse, before)| {
                    let refined = (side as f64 / coarse as f64).ln();
                    format!(" ({:.1})", (before[k].mean / errors[k].mean).ln() / refined)
                });
                format!("{} / {}{}", percent(errors[k].mean), percent(errors[k].max), order.unwrap_or_default())
            })
            .collect();
        println!("| 1/{side} | {ratio:.2} | {} |", cells.join(" | "));
        before = Some((side, errors));
    }
}

/// Two significant digits, in percent.
fn percent(x: f64) -> String {
    let digits = (1.0 - (100.0 * x).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{:.digits$}", 100.0 * x)
}

/// What the compact Laplacian makes of a linear field with |∇f| = 1, times Δx, by distance from the cylinder.
fn linear_fields(side: usize) {
    println!("\n| distance/Δx | particles | rms \\|∇²x\\| Δx | max | mean n·∇²x Δx | rms V/Δx² − 1 | rms tr α − 2 |");
    println!("|---|---|---|---|---|---|---|");
    let (set, judged) = cylinder(side, RATIO);
    let (spacing, errors) = (1.0 / side as f64, laplacian_of_positions(&set));
    let stencil = &set.frame.stencil;
    for [from, to] in [[0.0, 0.5], [0.5, 1.0], [1.0, 2.0], [2.0, 3.0], [3.0, 4.0], [0.0, 4.0]] {
        let position = |i: usize| set.particles.position[i];
        let of_band = |i: &&usize| (from..to).contains(&(common::distance(&position(**i)) / spacing));
        let band: Vec<usize> = judged.iter().filter(of_band).copied().collect();
        let mean = |f: &dyn Fn(usize) -> f64| band.iter().map(|&i| f(i)).sum::<f64>() / band.len() as f64;
        let rms = mean(&|i| errors[i].norm_squared()).sqrt() * spacing;
        let max = band.iter().map(|&i| errors[i].norm()).fold(0.0, f64::max) * spacing;
        let normal = mean(&|i| errors[i].dot(&position(i).add_scalar(-0.5).normalize())) * spacing;
        let volume = mean(&|i| (stencil.volume[i] / spacing.powi(2) - 1.0).powi(2)).sqrt();
        let trace = mean(&|i| (-8.0 / stencil.correction[i].laplacian - 4.0).powi(2)).sqrt();
        println!("| {from} to {to} | {} | {rms:.3} | {max:.3} | {normal:.4} | {volume:.3} | {trace:.3} |", band.len());
    }
}

fn main() {
    println!("Relative errors in %, L2 and maximum, and in brackets the observed order in L2.");
    println!("\n### Refined at constant h/Δx");
    PLANAR.into_iter().for_each(|set| table(set, &SIDES.map(|side| (side, RATIO)), true));
    SPATIAL.into_iter().for_each(|set| table(set, &[10, 20, 40].map(|side| (side, RATIO)), true));
    println!("\n### More neighbours at constant Δx");
    PLANAR.into_iter().for_each(|set| table(set, &[1.0, 1.2, RATIO, 1.6, 2.0].map(|ratio| (80, ratio)), false));
    println!("\n### Both, h ~ √Δx");
    let both = [20, 40, 80, 160].map(|side| (side, (side as f64 / 20.0).sqrt()));
    PLANAR.into_iter().for_each(|set| table(set, &both, true));
    println!("\n### Linear fields near the cylinder");
    [40, 160].into_iter().for_each(linear_fields);
}
