//! What a pass over the neighbours sums: the trait of all operators.

use crate::base::lanes::{LANES, Lanes};
use crate::discretisation::correction::Correction;
use crate::neighbours::Cluster;

/// A cluster and its neighbours as an operator sees them. It must go over every neighbour once, then ask for the corrections.
pub trait Neighbours<V: Lanes, const D: usize> {
    fn cluster(&self) -> Cluster;

    /// Call `add(j, slope, r_ij)` for each neighbour.
    fn for_each(&mut self, add: impl FnMut(usize, V, [V; D]));

    /// Call `add(j, slope, r_ij)` for each fluid or buffer neighbour.
    fn for_each_flowing(&mut self, add: impl FnMut(usize, V, [V; D]));

    /// Call `add(s, slope, r_is)` for each solid neighbour.
    fn for_each_solid(&mut self, add: impl FnMut(usize, V, [V; D]));

    /// The correction of each lane.
    fn corrections(&mut self) -> [Correction<D>; LANES];
}

/// A quantity formed from the neighbours of every particle.
pub trait Operator<const D: usize>: Sync {
    type Value;

    /// The value at the particle of each lane. Mark `#[inline(always)]`, see [`crate::base::lanes::Task`].
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [Self::Value; LANES];
}

/// Nothing, for what a pass over the neighbours does beside its operator.
pub struct Nothing;

impl<const D: usize> Operator<D> for Nothing {
    type Value = ();

    #[inline(always)]
    fn apply<V: Lanes>(&self, near: &mut impl Neighbours<V, D>) -> [(); LANES] {
        near.for_each(
            #[inline(always)]
            |_, _, _| (),
        );
        near.corrections();
        [(); LANES]
    }
}
