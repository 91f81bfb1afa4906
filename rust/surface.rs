//! A free surface: which particles lie at it, and how much their neighbours can carry.
//!
//! Where the support of a particle is cut, α falls below the identity: its trace d to 0.6 D at a flat surface, its smallest eigenvalue λ to one
//! half. Both tell where the fluid ends (Lee et al. 2008, Marrone et al. 2010), and λ how far a gradient there can be trusted.

use crate::base::{Matrix, Tensor, Vector, parallel, symmetric_eigen};
use crate::boundary::{for_each_weighted, shepard};
use crate::discretisation::{Correction, Largest, Surroundings};
use crate::frame::Frame;
use crate::halo::Poison;
use crate::kernel::{Smoothing, with_kernel};
use crate::particles::{ParticleKind, Particles, Place, of_solids};
use crate::settings::Settings;

/// Of tr α over D: below it a particle is at the surface if nothing lies before it.
const CANDIDATE: f64 = 0.875;

/// Below it, it is so whatever lies before it.
const CERTAIN: f64 = 0.5;

/// Below it, it has too few neighbours for a pressure: in the plane a convex corner has 0.36, a row of particles 0.21, two rows have 0.47; in
/// space a corner has 0.254, a row 0.06.
const ISOLATED: [f64; 2] = [0.35, 0.25];

/// So has a particle whose smallest eigenvalue is below it: a sheet in space has 0, a corner 0.16.
const FLAT: f64 = 0.05;

/// Above it, nothing of its support is cut.
const WHOLE: f64 = 0.98;

/// Eigenvalues of α below it are taken for it in α⁻¹: a flat surface has one half, thinner parts get less than a whole correction.
const FLOOR: f64 = 0.5;

/// Cosine of the half angle of the cone along the normal in which a particle at the surface has no neighbours, and its length over h.
const CONE: f64 = std::f64::consts::FRAC_1_SQRT_2;
const CONE_LENGTH: f64 = 2.0;

/// Share of the space in front of a solid up to which it is dry, and from which on it is wet.
const DRY: f64 = 0.2;
const WET: f64 = 0.6;

/// What a missing neighbour counts of the pressure of a particle: it stands beyond the surface, on the line through the pressure of zero there.
/// With it a flat surface has that half a spacing above its last row, within 0.03 Δx for h/Δx = 1.2 to 1.5 (1 has it 0.65 Δx higher).
const AIR: f64 = 1.8;

/// Height over a surface [Δx] from which on something is in front of it; rounding would decide of zero.
const IN_FRONT: f64 = 1e-3;

/// At how many depths, up to the support's radius, it is known what there can be in front.
const FRONTS: usize = 65;

/// What the surface of one frame is.
#[derive(Debug, Default)]
pub struct Surface<const D: usize> {
    /// Of the real particles.
    pub place: Vec<Place>,
    /// How much of ∇·u a particle may push with, of the real particles: λ², and less where neighbours are so close that they would push too hard.
    pub weight: Vec<f64>,
    /// Σ W over all that can be in front of a solid, by its depth; empty without solids.
    front: Vec<f64>,
    found: Vec<Found<D>>,
    /// Of real particles and images: how hard neighbours push a particle over the lattice's, and 1 at the surface.
    strength: Vec<[f64; 2]>,
    /// The largest of that around each real particle.
    around: Vec<[f64; 2]>,
}

/// What a particle's own neighbours tell.
#[derive(Clone, Copy, Debug)]
struct Found<const D: usize> {
    /// tr α over D.
    trace: f64,
    /// Smallest eigenvalue of α.
    least: f64,
    /// Σ |slope|, and what that lacks of the lattice's.
    slopes: f64,
    missing: f64,
    /// α⁻¹, with a floor under the eigenvalues of α.
    inverse: Matrix<D>,
    /// Σ slope r_ij.
    first: Vector<D>,
}

impl<const D: usize> Poison for Found<D> {
    const POISON: Self = Self {
        trace: f64::NAN,
        least: f64::NAN,
        slopes: f64::NAN,
        missing: f64::NAN,
        inverse: Tensor::<D>::POISON.0,
        first: <Vector<D> as Poison>::POISON,
    };
}

impl<const D: usize> Surface<D> {
    /// Particles at the surface, and those that are alone.
    pub fn counts(&self) -> [usize; 2] {
        [Place::AtSurface, Place::Isolated].map(|place| self.place.iter().filter(|&&other| other == place).count())
    }

    /// Unit normal of the surface at particle `i`, out of the fluid; zero where nothing tells it.
    pub fn normal(&self, i: usize) -> Vector<D> {
        self.found[i].normal()
    }

    /// Whether a particle, real or an image, is at the surface.
    pub fn is_at_surface(&self, i: usize) -> bool {
        self.strength[i][1] > 0.0
    }

    /// The Laplacian of particle `i` from that of its neighbours and its sum: next to the surface the air has the place of those that are
    /// missing, over whose value at the surface its own is by `above`.
    pub fn laplacian(&self, i: usize, (laplacian, sum): (f64, f64), above: f64) -> f64 {
        if self.place[i].sees_air() { sum - 2.0 * AIR * self.found[i].missing * above } else { laplacian }
    }

    /// What the value of the particle itself counts in that, if `inside` is that without air.
    pub fn laplacian_diagonal(&self, i: usize, inside: f64) -> f64 {
        let Found { missing, slopes, .. } = self.found[i];
        if self.place[i].sees_air() { -2.0 * (slopes + AIR * missing) } else { inside }
    }

    /// Find it in a frame, whose corrections it makes those of a cut support.
    pub fn find(&mut self, settings: &Settings, particles: &Particles<D>, frame: &mut Frame<D>) {
        self.wet(settings, particles, frame);
        self.look_around(settings, particles, frame);
        correct_solids(settings, particles, frame);
        self.place_particles(settings, particles, frame);
        self.weigh();
    }

    /// Give solids the volume of what is in front of them: nothing where that is air. What lies behind another wall there counts, too.
    fn wet(&mut self, settings: &Settings, particles: &Particles<D>, frame: &mut Frame<D>) {
        if settings.bodies.is_empty() {
            return;
        }
        if self.front.is_empty() {
            self.front = fronts::<D>(settings);
        }
        let (stencil, front) = (&frame.stencil, &self.front);
        let Particles { kind, normal, depth, .. } = particles;
        let share = |s: usize| {
            let mut sum = 0.0;
            let all = stencil.neighbours.row(s).0.all().iter().map(|entry| (*entry, 1.0));
            for_each_weighted(settings, stencil, s, all, |_, weight, r_sj| {
                if -r_sj.dot(&normal[s]) - depth[s] > IN_FRONT * settings.particle_spacing {
                    sum += weight;
                }
            });
            let place = depth[s] / settings.support_radius() * (FRONTS - 1) as f64;
            let full = front[(place.round() as usize).min(FRONTS - 1)];
            let fill = if full > 0.0 { sum / full } else { 0.0 };
            ((fill - DRY) / (WET - DRY)).clamp(0.0, 1.0)
        };
        let shares = of_solids(&kind[..particles.real], share);
        shares.into_iter().for_each(|(s, share)| frame.stencil.volume[s] *= share);
        frame.images.fill(&mut frame.stencil.volume);
    }

    /// What the neighbours of each particle tell, and corrections with a floor.
    fn look_around(&mut self, settings: &Settings, particles: &Particles<D>, frame: &mut Frame<D>) {
        let (sum, reach) = settings.lattice_sums();
        let (sum, reach) = (sum / settings.particle_spacing.powi(2), reach / settings.particle_spacing);
        frame.images.blank(&mut self.found, particles.real);
        frame.images.blank(&mut self.strength, particles.len());
        frame.stencil.correct_and_for_each(
            Surroundings,
            &mut self.found,
            frame.images.real(&mut self.strength),
            |i, (alpha, first, [slopes, lengths]), found, strength| {
                let (values, vectors) = symmetric_eigen(&alpha);
                let (least, inverse) = (values.min(), inverse_with_floor(&values, &vectors));
                let missing = (sum - slopes).max(0.0);
                *found = Found { trace: alpha.trace() / D as f64, least, slopes, missing, inverse, first };
                // Solids have no equations, and are as dense as they were placed.
                let is_fluid = particles.kind[i] == ParticleKind::Fluid;
                *strength = [if is_fluid { lengths / least.max(FLOOR) / reach } else { 0.0 }, 0.0];
            },
        );
        let found = &self.found;
        parallel::for_each(&mut frame.stencil.correction, |i, correction| {
            if particles.kind[i] == ParticleKind::Fluid {
                let Found { inverse, first, .. } = &found[i];
                *correction = Correction { inverse: *inverse, asymmetry: inverse * first, ..*correction };
            }
        });
    }

    /// Where each particle is.
    fn place_particles(&mut self, settings: &Settings, particles: &Particles<D>, frame: &Frame<D>) {
        let Self { place, found, strength, around, .. } = self;
        let (stencil, found) = (&frame.stencil, &*found);
        let length = CONE_LENGTH * settings.smoothing_length();
        let cone_is_empty = |i: usize| {
            let normal = found[i].normal();
            stencil.neighbours.row(i).0.all().iter().all(|entry| {
                let way = stencil.position[entry.j()] - stencil.position[i];
                let distance = way.norm();
                distance >= length || distance == 0.0 || way.dot(&normal) <= CONE * distance
            })
        };
        place.resize(particles.real, Place::Inside);
        parallel::for_each(place, |i, place| {
            let Found { trace, least, .. } = found[i];
            *place = if particles.kind[i] != ParticleKind::Fluid {
                Place::Inside
            } else if trace < ISOLATED[D - 2] || least < FLAT {
                Place::Isolated
            } else if trace < CERTAIN || (trace < CANDIDATE && cone_is_empty(i)) {
                Place::AtSurface
            } else {
                Place::Inside
            };
        });
        parallel::for_each(frame.images.real(strength), |i, strength| {
            strength[1] = f64::from(u8::from(place[i] == Place::AtSurface));
        });
        frame.images.fill(strength);
        frame.images.blank(around, particles.real);
        stencil.for_each_one(Largest(strength), around, |_, value, around| *around = value);
        parallel::for_each(place, |i, place| {
            let is_cut = particles.kind[i] == ParticleKind::Fluid && found[i].trace < WHOLE;
            if *place == Place::Inside && is_cut && around[i][1] > 0.0 {
                *place = Place::Near;
            }
        });
    }

    fn weigh(&mut self) {
        let Self { place, found, around, weight, .. } = self;
        weight.resize(place.len(), 0.0);
        parallel::for_each(weight, |i, weight| {
            let most = found[i].least.powi(2).min(around[i][0].powi(-2)).min(1.0);
            *weight = if place[i] == Place::Isolated { 0.0 } else { most };
        });
    }
}

/// Σ W over a half space of particles, at such depths below it.
fn fronts<const D: usize>(settings: &Settings) -> Vec<f64> {
    let (spacing, radius) = (settings.particle_spacing, settings.support_radius());
    let reach = (radius / spacing).ceil() as i64 + 1;
    let side = 2 * reach + 1;
    with_kernel!(settings.kernel, kernel => {
        let kernel = Smoothing::new(kernel, settings.smoothing_length(), D);
        let below = |depth: f64| -> f64 {
            (0..side.pow(D as u32)).map(|cell| {
                let way: Vector<D> = Vector::from_fn(|axis, _| {
                    let k = cell / side.pow(axis as u32) % side - reach;
                    if axis == 0 { depth + (k as f64 + 0.5) * spacing } else { k as f64 * spacing }
                });
                if way[0] > depth { kernel.value(way.norm()) } else { 0.0 }
            }).sum()
        };
        (0..FRONTS).map(|k| below(radius * k as f64 / (FRONTS - 1) as f64)).collect()
    })
}

/// Solids show the mean correction of the fluid around, as images do that of their source.
fn correct_solids<const D: usize>(settings: &Settings, particles: &Particles<D>, frame: &mut Frame<D>) {
    if settings.bodies.is_empty() {
        return;
    }
    let mut tensor = Vec::new();
    frame.images.blank(&mut tensor, particles.len());
    parallel::for_each(frame.images.real(&mut tensor), |i, tensor| *tensor = Tensor(frame.stencil.correction[i].inverse));
    frame.images.fill(&mut tensor);
    let mean = |s: usize| {
        let entries = |j: usize| std::array::from_fn(|k| tensor[j].0.as_slice().get(k).copied().unwrap_or_default());
        let mean: Option<[f64; 9]> = shepard(settings, &frame.stencil, s, |j, _| entries(j));
        mean.map_or_else(Matrix::identity, |mean| Matrix::from_column_slice(&mean[..D * D]))
    };
    let means = of_solids(&particles.kind[..particles.real], mean);
    means.into_iter().for_each(|(s, mean)| frame.stencil.correction[s].inverse = mean);
}

impl<const D: usize> Found<D> {
    /// Unit normal out of the fluid; zero where nothing tells it.
    fn normal(&self) -> Vector<D> {
        -(self.inverse * self.first).try_normalize(0.0).unwrap_or_else(Vector::zeros)
    }
}

/// α⁻¹ from eigenvalues and eigenvectors of α, of which none counts less than [`FLOOR`].
fn inverse_with_floor<const D: usize>(values: &Vector<D>, vectors: &Matrix<D>) -> Matrix<D> {
    let inverse = Matrix::from_diagonal(&values.map(|value| 1.0 / value.max(FLOOR)));
    vectors * inverse * vectors.transpose()
}
