//! A simulation: particles, settings and the order of the stages of a step.

mod checks;

use crate::base::error::{Error, Result, setting};
use crate::base::lanes::Instructions;
use crate::base::parallel;
use crate::base::{Matrix, Vector};
use crate::boundary;
use crate::breakdown::{self, Symptom};
use crate::discretisation::VelocityGradient;
use crate::flow::{Flow, Step};
use crate::forcing::Forcing;
use crate::frame::Travel;
use crate::interpolation::{ActingPressure, interpolate, smooth_acting_pressure};
use crate::loads::loads;
use crate::motion::{NUMBERS, Pose};
use crate::particles::{ParticleKind, Particles, Place};
use crate::report::{Clock, Report, angular_momentum, dissipation, potential_energy};
use crate::scheme::{self, Outcome, Scheme};
use crate::settings::Settings;
use crate::shifting::{Change, measures_divergence, shift};
use checks::check_particles;
use rayon::ThreadPool;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The adaptive time step may not fall below this fraction of the user's: by then the velocity has blown up.
const SMALLEST_TIME_STEP: f64 = 1e-4;

/// How far a particle that is alone in the air may fly in a step [Δx]: it has no pressure, and is not lost within Δx.
const FLIGHT: f64 = 0.8;

/// Particles are put into cell order once in so many steps, for speed: no result depends on their order.
const STEPS_BETWEEN_SORTS: u64 = 16;

pub struct Simulation<const D: usize> {
    settings: Settings,
    flow: Flow<D>,
    clock: Clock,
    scheme: Box<dyn Scheme<D>>,
    /// What is prescribed by place and time, beside the inflow.
    pub forcing: Forcing<D>,
    change: Vec<Change<D>>,
    /// Whether `frame` belongs to the present positions.
    prepared: bool,
    /// The particles as the step that broke down left them.
    failed: Option<Particles<D>>,
    history: Vec<Report<D>>,
    pool: Arc<ThreadPool>,
}

impl<const D: usize> Simulation<D> {
    /// A simulation that goes on from `particles` (no images) and `clock`, on `threads` threads (all cores if none given).
    pub fn new(settings: Settings, particles: Particles<D>, clock: Clock, threads: Option<usize>) -> Result<Self> {
        let scheme = scheme::build(&settings);
        Self::with_scheme(settings, particles, clock, threads, scheme)
    }

    /// The same with a scheme of the caller's in place of the one that the settings name.
    pub fn with_scheme(
        settings: Settings,
        mut particles: Particles<D>,
        clock: Clock,
        threads: Option<usize>,
        scheme: Box<dyn Scheme<D>>,
    ) -> Result<Self> {
        settings.validate()?;
        if settings.dimensions != D {
            return Err(setting("dimensions", format!("{} does not fit {D}-dimensional arrays", settings.dimensions)));
        }
        Instructions::chosen()?;
        if !(clock.time.is_finite() && clock.mass_in.is_finite() && clock.mass_out.is_finite()) {
            return Err(setting("state", format!("time and masses must be finite, not {clock:?}")));
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.unwrap_or(0))
            .build()
            .map_err(|e| setting("threads", e.to_string()))?;
        // Not with the threads that rayon shares, which a forked process does not have.
        pool.install(|| check_particles(&settings, &mut particles))?;
        Ok(Self {
            flow: Flow::new(&settings, particles),
            scheme,
            forcing: Forcing::default(),
            settings,
            clock,
            change: Vec::new(),
            prepared: false,
            failed: None,
            history: Vec::new(),
            pool: Arc::new(pool),
        })
    }

    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The particles; entries beyond `real` are images.
    pub fn particles(&self) -> &Particles<D> {
        &self.flow.particles
    }

    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Whether copies of particles, and what is kept from step to step to save its memory, are made NaN when they go stale, so that
    /// what reads them shows. It changes no result else. On from the start where debug assertions are.
    pub fn poison(&mut self, on: bool) {
        self.flow.frame.images.poisons = on;
    }

    /// The poses of the bodies, which free ones go on with through a restart; see [`Simulation::set_poses`].
    pub fn poses(&self) -> Vec<Pose> {
        self.flow.motion.poses()
    }

    /// Go on with free bodies in such poses, one for each body; before the first step.
    pub fn set_poses(&mut self, poses: &[Pose]) -> Result<()> {
        if poses.len() != self.settings.bodies.len() || !poses.iter().flat_map(Pose::numbers).all(f64::is_finite) {
            let problem = format!("must hold {NUMBERS} finite numbers for each of {} bodies", self.settings.bodies.len());
            return Err(Error::Array { name: "pose", problem });
        }
        self.flow.motion.set_poses(poses);
        Ok(())
    }

    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// One report a step since the last call.
    pub fn take_history(&mut self) -> Vec<Report<D>> {
        std::mem::take(&mut self.history)
    }

    /// Take up to `steps` steps, fewer if `wall` time passes first. Returns the number taken.
    pub fn advance(&mut self, steps: u64, wall: Option<Duration>) -> Result<u64> {
        let last = self.clock.step.saturating_add(steps);
        self.step_while(wall, |clock| clock.step < last)
    }

    /// Step until `time` is reached (true) or `wall` time has passed (false).
    pub fn advance_until(&mut self, time: f64, wall: Option<Duration>) -> Result<bool> {
        self.step_while(wall, |clock| clock.time < time)?;
        Ok(self.clock.time >= time)
    }

    fn step_while(&mut self, wall: Option<Duration>, more: impl Fn(&Clock) -> bool) -> Result<u64> {
        let (start, first) = (Instant::now(), self.clock.step);
        while more(&self.clock) {
            self.on_pool(Self::step)?;
            if wall.is_some_and(|wall| start.elapsed() >= wall) {
                break;
            }
        }
        Ok(self.clock.step - first)
    }

    /// Run `f` with the simulation's own threads.
    fn on_pool<R: Send>(&mut self, f: impl FnOnce(&mut Self) -> R + Send) -> R {
        let pool = Arc::clone(&self.pool);
        pool.install(|| f(self))
    }

    /// One time step: the stages of the method in order.
    fn step(&mut self) -> Result<()> {
        let Flow { particles, motion, .. } = &mut self.flow;
        let is_first = self.clock.step == 0;
        motion.start(&self.settings, particles, &mut self.forcing.motion, self.clock.time, is_first)?;
        let [fastest, velocity_max] = self.velocity_max();
        let time_step = self.time_step(velocity_max, fastest)?;
        let fraction = self.settings.derivative_frame.fraction();
        self.flow.motion.advance(&mut self.forcing.motion, self.clock.time, time_step, fraction)?;
        self.prepare_step(Travel { time_step, velocity_max: fastest, fraction });
        let step = Step { settings: &self.settings, time_step, velocity_max };
        let (flow, scheme) = (&mut self.flow, &mut self.scheme);
        if step.settings.free_surface.is_some() {
            flow.surface.find(step.settings, &flow.particles, &mut flow.frame);
        }
        let Flow { particles, frame, body_force, motion, .. } = &mut *flow;
        motion.accelerations(particles.real, &mut body_force.walls);
        let middle = self.clock.time + 0.5 * time_step;
        let prescribed = self.forcing.apply(step.settings, particles, frame, body_force, middle);
        let apart = motion.check_contact(step.settings, particles, &frame.stencil, self.clock.time);
        flow.remember();
        if let Err(error) = prescribed.and(apart) {
            flow.restore();
            self.prepared = false;
            return Err(error);
        }
        flow.motion.feel(flow.body_force.constant(), |i| flow.body_force.varying(i));

        let solved = scheme.solve(step, flow);
        let place = &flow.surface.place;
        if let Some(symptom) = breakdown::find(step.settings, &flow.particles, &flow.frame, place, time_step) {
            let error = self.diverged(symptom, time_step, velocity_max);
            self.failed = Some(self.flow.restore());
            self.prepared = false;
            return Err(error);
        }
        let pressure = |s: usize| scheme.pressure_force(step, flow, s);
        let loads = loads(step.settings, &flow.particles, &flow.frame, &flow.walls, &flow.motion, pressure);
        scheme.note_unkept_pressure(step, flow);
        let dissipated = dissipation(step, flow, &loads, |i| scheme.viscous_laplacian(step, i));
        let mut report = Report::new(step, flow, scheme.penalty(time_step), loads);
        report.dissipation = dissipated;
        report.taken = scheme.taken(step, flow);
        flow.advance_positions(step); // (12)
        report.potential_energy = potential_energy(step, flow);
        flow.walls.see_for_shift(step.settings, &flow.particles, &flow.frame);
        let Flow { particles, frame, walls, .. } = flow;
        shift(step.settings, particles, frame, walls, time_step, velocity_max, &mut self.change); // (18) (19)
        let measured = measures_divergence(step.settings);
        let divergence = |i: usize| if measured { self.change[i].divergence } else { scheme.divergence(i) };
        report.outcome = Outcome::new(step.settings, particles, solved, divergence);
        report.returning = self.end_step(time_step);
        let loads = &report.loads;
        let reach = self.scheme.reach(time_step) / self.settings.particle_spacing;
        self.flow.motion.end(time_step, reach, |body| loads[body].total());
        report.poses = self.flow.motion.poses();
        report.clock = self.clock;
        report.counts = self.flow.particles.counts();
        if self.settings.free_surface.is_some() {
            report.angular_momentum = angular_momentum(&self.settings, &self.flow.particles);
        }
        report.places = self.flow.surface.counts();
        self.history.push(report);
        Ok(())
    }

    /// Bring order, images, neighbours and stencil up to the present positions.
    fn prepare(&mut self) {
        if self.prepared {
            return;
        }
        let [fastest, velocity_max] = self.velocity_max();
        let time_step = self.time_step(velocity_max, fastest).unwrap_or(self.settings.time_step);
        self.search(Travel { time_step, velocity_max: fastest, fraction: 0.0 });
        self.prepared = true;
    }

    /// The same at the positions that the derivatives of the step are taken at.
    fn prepare_step(&mut self, travel: Travel) {
        if !self.prepared || travel.fraction > 0.0 {
            self.search(travel);
        }
    }

    fn search(&mut self, travel: Travel) {
        let reorder = self.clock.step.is_multiple_of(STEPS_BETWEEN_SORTS);
        let Flow { particles, frame, motion, .. } = &mut self.flow;
        frame.search_around(&self.settings, particles, travel, reorder, motion);
    }

    /// Boundary crossings and clock. Returns how many particles come back in the buffers of outlets.
    fn end_step(&mut self, time_step: f64) -> usize {
        self.flow.particles.drop_images();
        if self.settings.free_surface.is_some() {
            self.flow.particles.place.copy_from_slice(&self.flow.surface.place);
        }
        self.flow.particles.go_round(&self.settings.bodies);
        let flow = boundary::end_step(&mut self.flow.particles, &self.settings, &self.flow.frame.grid, time_step);
        self.clock.mass_in += flow.inflow;
        self.clock.mass_out += flow.outflow;
        self.clock.time += time_step;
        self.clock.step += 1;
        self.prepared = false;
        flow.returning
    }

    /// Largest velocity modulus of all particles, and of those that are not alone in the air: what u_max stands for in r_AL and in the
    /// stability law. A drop of a splash does not hold up the others.
    fn velocity_max(&self) -> [f64; 2] {
        let particles = &self.flow.particles;
        let larger = |a: [f64; 2], b: [f64; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        let squares = |i: usize| {
            let square = particles.velocity[i].norm_squared();
            [square, if particles.place[i] == Place::Isolated { 0.0 } else { square }]
        };
        let largest = |range: Range<usize>| range.map(squares).fold([0.0; 2], larger);
        parallel::reduce(particles.real, largest, larger).unwrap_or_default().map(f64::sqrt)
    }

    /// Δt of the next step, u_max and the speed of the fastest particle being these.
    fn time_step(&self, velocity_max: f64, fastest: f64) -> Result<f64> {
        let settings = &self.settings;
        let motion = &self.flow.motion;
        if !settings.adaptive_time_step || settings.adaptive_until.is_some() {
            motion.check_step(settings)?; // at once, not when the adaptive steps end
        }
        if !settings.adaptive_time_step || settings.adaptive_until.is_some_and(|end| self.clock.time >= end) {
            return Ok(settings.time_step);
        }
        let limits = self.scheme.limits(settings, velocity_max);
        let flight =
            if settings.free_surface.is_some() { FLIGHT * settings.particle_spacing / fastest } else { f64::INFINITY };
        let fastest_waves = limits.courant.min(settings.time_step_safety * limits.penalty).min(limits.acoustic).min(flight);
        if fastest_waves < SMALLEST_TIME_STEP * settings.time_step {
            let velocity = &self.flow.particles.velocity[..self.flow.particles.real];
            let particle =
                (0..velocity.len()).max_by(|&a, &b| velocity[a].norm_squared().total_cmp(&velocity[b].norm_squared()));
            let symptom = Symptom { particle: particle.unwrap_or(0), field: "velocity", value: fastest };
            return Err(self.diverged(symptom, fastest_waves, velocity_max));
        }
        let bodies = motion.step_limit(settings);
        Ok(settings.time_step.min(fastest_waves).min(limits.viscous).min(limits.body_force).min(bodies))
    }

    fn diverged(&self, symptom: Symptom, time_step: f64, velocity_max: f64) -> Error {
        let (settings, particles) = (&self.settings, &self.flow.particles);
        let Symptom { particle: i, field, value } = symptom;
        let limits = self.scheme.limits(settings, velocity_max);
        let cause = breakdown::likely_cause(settings, particles, symptom, time_step, limits);
        let position = particles.position[i].as_slice().to_vec();
        let Clock { time, step, .. } = self.clock;
        Error::Diverged { step: step + 1, time, particle: particles.id[i], position, field, value, cause }
    }

    /// `look` at the simulation as the step that broke down left it, at the positions before that step; None if none has.
    pub fn look_at_failed<R>(&mut self, look: impl FnOnce(&mut Self) -> R) -> Option<R> {
        let good = std::mem::replace(&mut self.flow.particles, self.failed.take()?);
        self.prepared = false;
        let result = look(self);
        self.flow.particles.drop_images();
        self.failed = Some(std::mem::replace(&mut self.flow.particles, good));
        self.prepared = false;
        Some(result)
    }

    /// The derived fields of the real particles, in the order of `particles()` after the call.
    pub fn snapshot(&mut self) -> Snapshot<D> {
        self.on_pool(|simulation| {
            simulation.prepare();
            simulation.flow.frame.stencil.correct();
            let particles = &simulation.flow.particles;
            let mut gradient = vec![Matrix::zeros(); particles.real];
            let operator = VelocityGradient(&particles.velocity);
            simulation.flow.frame.stencil.for_each_one(operator, &mut gradient, |_, value, gradient| *gradient = value);
            let mut pressure = smooth_acting_pressure(&simulation.settings, particles, &simulation.flow.frame, |_| true);
            pressure.truncate(particles.real);
            let volume = simulation.flow.frame.stencil.volume[..particles.real].to_vec();
            Snapshot { pressure, volume, velocity_gradient: gradient }
        })
    }

    /// Fluid pressure and velocity at `points`; NaN where no fluid is near.
    pub fn sample(&mut self, points: &[Vector<D>]) -> Vec<(f64, Vector<D>)> {
        self.on_pool(|simulation| {
            simulation.prepare();
            if simulation.settings.pressure_alternates() {
                simulation.flow.frame.stencil.correct();
            }
            let Self { settings, flow: Flow { particles, frame, .. }, .. } = &*simulation;
            let pressure = ActingPressure::near(settings, particles, frame, points);
            let mut values = vec![(f64::NAN, Vector::repeat(f64::NAN)); points.len()];
            parallel::for_each(&mut values, |k, value| {
                if let Some(sample) = interpolate(settings, particles, frame, &pressure, &points[k]) {
                    *value = sample;
                }
            });
            values
        })
    }

    /// Positions of the inlet buffer particles, by id.
    pub fn inflow_position(&self) -> Vec<Vector<D>> {
        self.inlet_particles().into_iter().map(|i| self.flow.particles.position[i]).collect()
    }

    /// Prescribe the velocities of the inlet buffer particles, in the order of `inflow_position`.
    pub fn set_inflow(&mut self, velocity: &[Vector<D>]) -> Result<()> {
        let inlet = self.inlet_particles();
        if velocity.len() != inlet.len() {
            let problem = format!("{} rows for {} inlet particles", velocity.len(), inlet.len());
            return Err(Error::Array { name: "inflow velocity", problem });
        }
        if let Some(bad) = velocity.iter().find(|u| !u.iter().all(|x| x.is_finite())) {
            return Err(Error::Array { name: "inflow velocity", problem: format!("{:?} is not finite", bad.as_slice()) });
        }
        for (i, u) in inlet.into_iter().zip(velocity) {
            self.flow.particles.velocity[i] = *u;
        }
        // Images carry velocities too.
        self.prepared = false;
        Ok(())
    }

    /// By id, because the order of storage changes whenever the particles are sorted.
    fn inlet_particles(&self) -> Vec<usize> {
        let particles = &self.flow.particles;
        let mut inlet: Vec<_> = (0..particles.real).filter(|&i| particles.kind[i] == ParticleKind::Inlet).collect();
        inlet.sort_unstable_by_key(|&i| particles.id[i]);
        inlet
    }
}

/// Fields derived from the particles at one time.
pub struct Snapshot<const D: usize> {
    /// The pressure that acts; see [`smooth_acting_pressure`].
    pub pressure: Vec<f64>,
    pub volume: Vec<f64>,
    /// ∂u_k/∂x_l as the entry (k, l).
    pub velocity_gradient: Vec<Matrix<D>>,
}
