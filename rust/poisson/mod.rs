//! The pressure Poisson equation −∇²x = f of the particles, with the compact Laplacian (16), matrix-free.
//!
//! Outlets have x = 0. Solid particles show the mean of the fluid around, ∂x/∂n = 0; what flux a wall has belongs to the right-hand side
//! ([`crate::boundary::add_wall_flux`]). Beside a free surface the neighbours that are missing are air, at x = 0. In a domain without outlet
//! and air x is found up to a constant, and f less its mean is solved.
//!
//! All sums are exact, so that neither the number of threads nor the order of the particles changes a bit.

mod level;
mod multigrid;
mod row;

use crate::base::{exact_sums, parallel};
use crate::boundary::{PressureRule, conditions, extrapolate_scalar};
use crate::discretisation::{Laplacian, LaplacianAndItsSum, LaplacianDiagonal};
use crate::frame::Frame;
use crate::particles::{Particles, Place};
use crate::settings::{Eigenvalues, Settings, Solver};
use crate::surface::Surface;
use multigrid::Multigrid;

pub use row::Row;

/// Steps of Chebyshev's iteration that a multigrid cycle ends with, and the interval of the eigenvalues that it damps over λ_max: what
/// the background grid does not see, and what disordered particles have beyond the lattice's.
const CHEBYSHEV_STEPS: usize = 3;
const CHEBYSHEV_INTERVAL: [f64; 2] = [1.0 / 6.0, 1.15];

/// How much larger λ_max is beside a surface, where the air counts more than neighbours do.
const AIR_MARGIN: f64 = 1.25;

/// A solve ends when the residual has not fallen by so much in so many iterations: what is left may have no solution.
const FALL: f64 = 0.99;
const PATIENCE: usize = 20;

/// How a solve ended.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solution {
    pub iterations: usize,
    /// ‖f + ∇²x‖ / ‖f‖, NaN where it was not looked at.
    pub residual: f64,
    pub within_tolerance: bool,
}

/// When a solve ends.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// Residual that is small enough; of Jacobi's iteration, whose residual falls slowly, the change of x in one, Σ|Δx| / Σ|x| (Muta,
    /// Ramachandran and Negi 2020). With none to reach, all iterations are taken, and what the last of them leaves is not looked at.
    pub tolerance: f64,
    pub max_iterations: usize,
    /// Damping of Jacobi's iteration.
    pub damping: f64,
}

#[derive(Debug, Default)]
pub struct Poisson<const D: usize> {
    rows: Vec<Row>,
    /// Whether no particle has x = 0.
    closed: bool,
    /// One over the rows' diagonals, for Jacobi's iteration.
    inverse_diagonal: Vec<f64>,
    multigrid: Multigrid<D>,
    residual: Vec<f64>,
    /// Fields with images, that the Laplacian reads.
    correction: Vec<f64>,
    second: Vec<f64>,
    /// Of the real particles.
    step: Vec<f64>,
    product: Vec<f64>,
    second_product: Vec<f64>,
    direction: Vec<f64>,
    shadow: Vec<f64>,
}

impl<const D: usize> Poisson<D> {
    /// Take the rows from the particles, and what `solver` needs of them.
    pub fn begin(&mut self, system: System<D>, solver: Solver) {
        let System { settings, particles, frame, surface, .. } = system;
        let condition = conditions(settings);
        let is_alone = |i: usize| surface.is_some_and(|surface| surface.place[i] == Place::Isolated);
        self.rows.resize(particles.real, Row::None);
        parallel::for_each(&mut self.rows, |i, row| {
            *row = match condition(particles.kind[i], &particles.position[i]).pressure {
                _ if is_alone(i) => Row::Zero,
                PressureRule::Solved | PressureRule::SolvedWithoutDivergence => Row::Solved,
                PressureRule::Zero => Row::Zero,
                PressureRule::FromFluid => Row::None,
            };
        });
        let sees_air = |surface: &Surface<D>| surface.place.iter().any(|place| place.sees_air());
        self.closed = !self.rows.contains(&Row::Zero) && !surface.is_some_and(sees_air);
        let Self { residual, correction, second, step, product, second_product, direction, shadow, .. } = self;
        for field in [residual, step, product, second_product, direction, shadow] {
            frame.images.blank(field, particles.real);
        }
        [correction, second].into_iter().for_each(|field| frame.images.blank(field, particles.len()));
        match solver {
            Solver::Jacobi => {
                let rows = &self.rows;
                self.inverse_diagonal.resize(particles.real, 0.0);
                frame.stencil.for_each_one(LaplacianDiagonal, &mut self.inverse_diagonal, |i, diagonal, inverse| {
                    let diagonal = surface.map_or(diagonal, |surface| surface.laplacian_diagonal(i, diagonal));
                    // As much as a particle may push with: where impacts press neighbours together a whole step is too much.
                    let share = surface.filter(|_| settings.splashes()).map_or(1.0, |surface| surface.weight[i]);
                    *inverse = if rows[i] == Row::Solved { -share / diagonal } else { 0.0 };
                });
            }
            Solver::Multigrid | Solver::Bicgstab => {
                self.multigrid.build(settings, particles, &frame.stencil.volume, &self.rows, surface.is_some());
            }
        }
    }

    /// Solve −∇²x = `source`, beginning with `x`, real particles and images. `x` of solids and images is left as the Laplacian sees it.
    pub fn solve(&mut self, system: System<D>, solver: Solver, goal: Goal, source: &mut [f64], x: &mut [f64]) -> Solution {
        let rows = &self.rows;
        parallel::for_each(source, |i, source| {
            if rows[i] != Row::Solved {
                *source = 0.0;
            }
        });
        if self.closed {
            take_mean_off(&self.rows, &system.frame.stencil.volume, source);
        }
        let scale = norm(source);
        let mut residual = std::mem::take(&mut self.residual);
        self.multiply(system, x, &mut residual);
        parallel::for_each(&mut residual, |i, residual| *residual = source[i] - *residual);
        self.residual = residual;
        let relative = |residual: &[f64]| if scale > 0.0 { norm(residual) / scale } else { 0.0 };
        let mut solution = Solution { iterations: 0, residual: relative(&self.residual), within_tolerance: false };
        solution.within_tolerance = solution.residual <= if solver == Solver::Jacobi { 0.0 } else { goal.tolerance };
        let mut state = Krylov::default();
        let mut least = (solution.residual, 0);
        while solution.iterations < goal.max_iterations.min(least.1 + PATIENCE)
            && solution.residual.is_finite()
            && !solution.within_tolerance
        {
            let last = goal.tolerance == 0.0 && solution.iterations + 1 == goal.max_iterations;
            match solver {
                Solver::Jacobi | Solver::Multigrid => {
                    self.find_step(system, solver, goal.damping);
                    parallel::for_each(system.frame.images.real(x), |i, x| *x += self.step[i]);
                    if !last {
                        self.renew_residual(system);
                    }
                }
                Solver::Bicgstab => {
                    if !self.bicgstab(system, &mut state, goal.tolerance * scale, x) {
                        break;
                    }
                }
            }
            solution.iterations += 1;
            solution.residual = if last && solver != Solver::Bicgstab { f64::NAN } else { relative(&self.residual) };
            solution.within_tolerance = match solver {
                Solver::Jacobi => goal.tolerance > 0.0 && self.change(x) <= goal.tolerance,
                Solver::Multigrid | Solver::Bicgstab => solution.residual <= goal.tolerance,
            };
            if solution.residual < FALL * least.0 {
                least = (solution.residual, solution.iterations);
            }
        }
        let System { settings, particles, frame, .. } = system;
        extrapolate_scalar(settings, frame, &particles.kind[..particles.real], x);
        solution
    }

    /// −∇²x.
    fn multiply(&self, system: System<D>, x: &mut [f64], out: &mut [f64]) {
        let System { settings, particles, frame, surface, .. } = system;
        let rows = &self.rows;
        parallel::for_each(frame.images.real(x), |i, x| {
            if rows[i] == Row::Zero {
                *x = 0.0;
            }
        });
        extrapolate_scalar(settings, frame, &particles.kind[..particles.real], x);
        let x = &*x;
        let row = |i: usize, laplacian: f64| if rows[i] == Row::Solved { -laplacian } else { 0.0 };
        match surface {
            None => frame.stencil.for_each_one(Laplacian(x), out, |i, value, out| *out = row(i, value)),
            Some(surface) => frame.stencil.for_each_one(LaplacianAndItsSum(x), out, |i, value, out| {
                *out = row(i, surface.laplacian(i, value, x[i]));
            }),
        }
        if self.closed {
            take_mean_off(rows, &frame.stencil.volume, out);
        }
    }

    /// Set the step to the damped Jacobi iteration's, or to a multigrid cycle's correction.
    fn find_step(&mut self, system: System<D>, solver: Solver, damping: f64) {
        if solver == Solver::Jacobi {
            let (residual, inverse) = (&self.residual, &self.inverse_diagonal);
            return parallel::for_each(&mut self.step, |i, step| *step = damping * inverse[i] * residual[i]);
        }
        let mut correction = std::mem::take(&mut self.correction);
        let residual = std::mem::take(&mut self.residual);
        self.precondition(system, &residual, &mut correction);
        (self.correction, self.residual) = (correction, residual);
        let correction = &self.correction;
        parallel::for_each(&mut self.step, |i, step| *step = correction[i]);
    }

    /// Σ|Δx| / Σ|x| of the step.
    fn change(&self, x: &[f64]) -> f64 {
        let [changes, sizes] = exact_sums(self.step.len(), |i| Some([self.step[i].abs(), x[i].abs()]));
        if changes > 0.0 { changes / sizes } else { 0.0 }
    }

    /// What the step does to the residual.
    fn renew_residual(&mut self, system: System<D>) {
        let mut correction = std::mem::take(&mut self.correction);
        let step = &self.step;
        parallel::for_each(system.frame.images.real(&mut correction), |i, correction| *correction = step[i]);
        let mut product = std::mem::take(&mut self.product);
        self.multiply(system, &mut correction, &mut product);
        parallel::for_each(&mut self.residual, |i, residual| *residual -= product[i]);
        (self.correction, self.product) = (correction, product);
    }

    /// Set `out` to about the solution of −∇²x = `residual`: the background grid's, and Chebyshev's iteration for the short waves.
    fn precondition(&mut self, system: System<D>, residual: &[f64], out: &mut [f64]) {
        let System { settings, particles, frame, surface, largest } = system;
        let real = frame.images.real(out);
        self.multigrid.correct(&particles.position, &frame.stencil.volume, residual, self.closed, real);
        let margin = if surface.is_some() { AIR_MARGIN } else { 1.0 };
        let largest = margin * largest.laplacian / settings.particle_spacing.powi(2);
        let [low, high] = CHEBYSHEV_INTERVAL.map(|share| share * largest);
        let (center, half) = (0.5 * (high + low), 0.5 * (high - low));
        let mut product = std::mem::take(&mut self.product);
        let mut last = half / center;
        for step in 0..CHEBYSHEV_STEPS {
            self.multiply(system, out, &mut product);
            let next = 1.0 / (2.0 * center / half - last);
            let [keep, add] = if step == 0 { [0.0, 1.0 / center] } else { [next * last, 2.0 * next / half] };
            if step > 0 {
                last = next;
            }
            let (rows, product) = (&self.rows, &product);
            parallel::for_each(&mut self.step, |i, step| {
                let keep = if keep == 0.0 { 0.0 } else { keep * *step };
                *step = if rows[i] == Row::Solved { keep + add * (residual[i] - product[i]) } else { 0.0 };
            });
            let step = &self.step;
            parallel::for_each(frame.images.real(out), |i, out| {
                *out = if rows[i] == Row::Solved { *out + step[i] } else { 0.0 };
            });
        }
        self.product = product;
    }

    /// One step of BiCGSTAB (van der Vorst 1992), preconditioned; false where it cannot go on.
    fn bicgstab(&mut self, system: System<D>, state: &mut Krylov, small: f64, x: &mut [f64]) -> bool {
        let count = self.residual.len();
        if state.steps == 0 {
            self.shadow.copy_from_slice(&self.residual);
            self.direction.copy_from_slice(&self.residual);
            [state.projection] = exact_sums(count, |i| Some([self.residual[i] * self.shadow[i]]));
        }
        state.steps += 1;
        let mut first = std::mem::take(&mut self.correction);
        let direction = std::mem::take(&mut self.direction);
        self.precondition(system, &direction, &mut first);
        self.direction = direction;
        let mut first_product = std::mem::take(&mut self.second_product);
        self.multiply(system, &mut first, &mut first_product);
        let [along] = exact_sums(count, |i| Some([first_product[i] * self.shadow[i]]));
        let alpha = state.projection / along;
        let mut second = std::mem::take(&mut self.second);
        let mut residual = std::mem::take(&mut self.residual);
        let mut ends = !alpha.is_finite();
        if !ends {
            parallel::for_each(&mut residual, |i, residual| *residual -= alpha * first_product[i]);
            if small > 0.0 && norm(&residual) <= small {
                parallel::for_each(system.frame.images.real(x), |i, x| *x += alpha * first[i]);
            } else {
                self.precondition(system, &residual, &mut second);
                let mut product = std::mem::take(&mut self.product);
                self.multiply(system, &mut second, &mut product);
                let [overlap, square] = exact_sums(count, |i| Some([product[i] * residual[i], product[i] * product[i]]));
                let omega = if square > 0.0 { overlap / square } else { 0.0 };
                parallel::for_each(system.frame.images.real(x), |i, x| *x += alpha * first[i] + omega * second[i]);
                parallel::for_each(&mut residual, |i, residual| *residual -= omega * product[i]);
                let [projection] = exact_sums(count, |i| Some([residual[i] * self.shadow[i]]));
                let beta = projection / state.projection * (alpha / omega);
                state.projection = projection;
                parallel::for_each(&mut self.direction, |i, direction| {
                    *direction = residual[i] + beta * (*direction - omega * first_product[i]);
                });
                self.product = product;
                ends = !beta.is_finite();
            }
        }
        (self.correction, self.second, self.second_product, self.residual) = (first, second, first_product, residual);
        !ends || state.steps == 1
    }
}

/// What a product of the system's matrix reads.
#[derive(Clone, Copy, Debug)]
pub struct System<'a, const D: usize> {
    pub settings: &'a Settings,
    pub particles: &'a Particles<D>,
    pub frame: &'a Frame<D>,
    /// The surface, where one is free.
    pub surface: Option<&'a Surface<D>>,
    pub largest: Eigenvalues,
}

/// What BiCGSTAB takes from step to step beside its fields.
#[derive(Debug, Default)]
struct Krylov {
    steps: usize,
    /// The residual's product with the first one.
    projection: f64,
}

fn norm(field: &[f64]) -> f64 {
    let [square] = exact_sums(field.len(), |i| Some([field[i] * field[i]]));
    square.sqrt()
}

/// Take the mean over the volume of the rows that are solved off them.
fn take_mean_off(rows: &[Row], volume: &[f64], field: &mut [f64]) {
    let solved = |i: usize| rows[i] == Row::Solved;
    let [sum, total] = exact_sums(field.len(), |i| solved(i).then(|| [volume[i] * field[i], volume[i]]));
    let mean = sum / total;
    parallel::for_each(field, |i, value| {
        if solved(i) {
            *value -= mean;
        }
    });
}
