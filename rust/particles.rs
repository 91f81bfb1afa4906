//! The particles: structure of arrays, real particles first, their images after them.

use crate::base::error::{Error, Result};
use crate::settings::Body;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::base::Vector;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum ParticleKind {
    /// Moved and solved for.
    Fluid = 0,
    /// Upstream buffer: moves with its prescribed velocity.
    Inlet = 1,
    /// Downstream buffer: keeps the velocity it left the domain with.
    Outlet = 2,
    /// Part of a body or wall.
    Solid = 3,
}

impl ParticleKind {
    pub const NAMES: [&str; 4] = ["fluid", "inlet", "outlet", "solid"];
}

impl TryFrom<u8> for ParticleKind {
    type Error = Error;

    fn try_from(value: u8) -> Result<Self> {
        match value {
            0 => Ok(Self::Fluid),
            1 => Ok(Self::Inlet),
            2 => Ok(Self::Outlet),
            3 => Ok(Self::Solid),
            _ => {
                Err(Error::Array { name: "kind", problem: format!("{value} is not 0 fluid, 1 inlet, 2 outlet or 3 solid") })
            }
        }
    }
}

/// Where a particle is beside a free surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Place {
    #[default]
    Inside = 0,
    /// Its support is cut, and it has particles at the surface in it.
    Near = 1,
    AtSurface = 2,
    /// It has no pressure: it flies, but for what others push it with.
    Isolated = 3,
}

impl Place {
    /// Whether part of what surrounds it is air.
    pub fn sees_air(self) -> bool {
        matches!(self, Self::Near | Self::AtSurface)
    }
}

impl TryFrom<u8> for Place {
    type Error = Error;

    fn try_from(value: u8) -> Result<Self> {
        match value {
            0 => Ok(Self::Inside),
            1 => Ok(Self::Near),
            2 => Ok(Self::AtSurface),
            3 => Ok(Self::Isolated),
            _ => {
                let problem = format!("{value} is not 0 inside, 1 near the surface, 2 at the surface or 3 isolated");
                Err(Error::Array { name: "place", problem })
            }
        }
    }
}

/// Arrays of one length. The first `real` entries are particles, the rest their images across walls and periodic sides.
#[derive(Clone, Debug, Default)]
pub struct Particles<const D: usize> {
    pub real: usize,
    pub position: Vec<Vector<D>>,
    pub velocity: Vec<Vector<D>>,
    pub pressure: Vec<f64>,
    pub kind: Vec<ParticleKind>,
    /// Index into the bodies; 0 for particles that are not solid.
    pub body: Vec<u16>,
    /// Outward unit normal of the body at a solid particle; zero elsewhere.
    pub normal: Vec<Vector<D>>,
    /// Distance of a solid particle below the surface of its body.
    pub depth: Vec<f64>,
    /// As the last step found it; all inside where the fluid fills its domain.
    pub place: Vec<Place>,
    /// What pushed them beside their pressure in the last step, which the pressure does not keep; zero where it keeps all.
    pub unkept_pressure: Vec<f64>,
    /// No two alike, and the same however the particles are stored; see [`follower`].
    pub id: Vec<u64>,
}

/// Evaluate `$f` for every array of `$particles`, which it knows as `$array` and by the name `$name`: the one list of them.
macro_rules! each_array {
    ($particles:ident, $array:ident => $f:expr) => {
        each_array!($particles, (&mut) $array, _name => $f)
    };
    ($particles:ident, ($($reference:tt)+) $array:ident, $name:ident => $f:expr) => {
        each_array!(@ $particles, ($($reference)+) $array, $name => $f; position velocity pressure kind body normal depth place unkept_pressure id)
    };
    (@ $particles:ident, $reference:tt $array:ident, $name:ident => $f:expr; $($field:ident)*) => {
        $(each_array!(@one $particles, $reference $array, $name => $f; $field);)*
    };
    (@one $particles:ident, ($($reference:tt)+) $array:ident, $name:ident => $f:expr; $field:ident) => {{
        let ($array, $name) = ($($reference)+ $particles.$field, stringify!($field));
        $f;
    }};
}
#[cfg(feature = "python")]
pub(crate) use each_array;

impl<const D: usize> Particles<D> {
    /// Number of real particles and images.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    pub fn drop_images(&mut self) {
        let real = self.real;
        each_array!(self, array => array.truncate(real));
    }

    /// Put the real particles into the order `order[new] = old`. Images must have been dropped.
    pub fn reorder(&mut self, order: &[u32]) {
        if order.iter().enumerate().all(|(new, &old)| new == old as usize) {
            return;
        }
        each_array!(self, array => *array = order.iter().map(|&old| array[old as usize]).collect());
    }

    /// Keep the real particles for which `keep` holds, in order. Images must have been dropped.
    pub fn retain(&mut self, keep: &[bool]) {
        each_array!(self, array => {
            let mut flags = keep.iter();
            array.retain(|_| *flags.next().unwrap_or(&true));
        });
        self.real = self.position.len();
    }

    /// Append a copy of particle `source`; the caller changes what differs. Returns its index.
    pub fn push_copy(&mut self, source: usize) -> usize {
        each_array!(self, array => array.push(array[source]));
        self.len() - 1
    }

    /// Whether particle `i` stays where it is: a solid of a body that does not move.
    pub fn is_fixed(&self, i: usize, bodies: &[Body]) -> bool {
        self.kind[i] == ParticleKind::Solid && !bodies[self.body[i] as usize].moves
    }

    /// Take what has passed the end of its body's belt back to the beginning.
    pub fn go_round(&mut self, bodies: &[Body]) {
        let own = |body: &Body| Some((body.belt?, Vector::<D>::from_column_slice(body.velocity.as_deref()?)));
        let belts: Vec<_> = bodies.iter().map(own).collect();
        for i in (0..self.real).filter(|&i| self.kind[i] == ParticleKind::Solid) {
            let Some(([from, to], velocity)) = belts[self.body[i] as usize] else { continue };
            let along = velocity.normalize();
            if along.dot(&self.position[i]) > to {
                self.position[i] -= along * (to - from);
            }
        }
    }

    /// Number of real particles of each kind: fluid, inlet, outlet, solid.
    pub fn counts(&self) -> [usize; 4] {
        let mut counts = [0; 4];
        for kind in &self.kind[..self.real] {
            counts[*kind as usize] += 1;
        }
        counts
    }
}

/// What `of` says of each solid among particles of such kinds, in parallel, with its index.
pub fn of_solids<T: Send>(kind: &[ParticleKind], of: impl Fn(usize) -> T + Sync) -> Vec<(usize, T)> {
    let solids = (0..kind.len()).into_par_iter().filter(|&i| kind[i] == ParticleKind::Solid);
    solids.map(|i| (i, of(i))).collect()
}

/// Bits of an id that an inlet particle shares with those that follow it; those above count them.
const LINEAGE_BITS: u32 = 40;

/// How many particles may have followed each other before a simulation begins: as many may then follow.
const MOST_FOLLOWERS: u64 = 1 << 23;

/// The id of the particle that follows an inlet particle at the far end of its buffer.
pub fn follower(id: u64) -> u64 {
    id + (1 << LINEAGE_BITS)
}

/// Set in the ids of the particles that fill the buffers of outlets.
const FILLS: u64 = 1 << (LINEAGE_BITS - 1);

/// So many ids that none of the particles `ids` has, nor any that will follow an inlet particle.
pub fn fresh_ids(ids: &[u64], count: usize) -> impl Iterator<Item = u64> + use<> {
    let last = if count == 0 { None } else { ids.iter().filter(|&id| id & FILLS != 0).max() };
    let next = last.map_or(0, |id| (id >> LINEAGE_BITS) + 1);
    (0..count as u64).map(move |rank| (next << LINEAGE_BITS) | FILLS | rank)
}

/// Whether so many have followed each other that ids might run out.
pub fn is_late(id: u64) -> bool {
    id >> LINEAGE_BITS >= MOST_FOLLOWERS
}

/// What an id shares with those that follow it.
pub fn lineage(id: u64) -> u64 {
    id & ((1 << LINEAGE_BITS) - 1)
}
