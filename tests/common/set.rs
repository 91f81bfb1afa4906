//! Particles with their frame, so that operators can be applied to fields given as functions.

use alsph::discretisation::Operator;
use alsph::frame::{Frame, Travel};
use alsph::settings::Settings;
use alsph::{Particles, Vector};

pub struct Set<const D: usize> {
    pub particles: Particles<D>,
    pub frame: Frame<D>,
}

impl<const D: usize> Set<D> {
    pub fn of(mut particles: Particles<D>, settings: &Settings, reorder: bool) -> Self {
        let mut frame = Frame::default();
        frame.search(settings, &mut particles, Travel::default(), reorder);
        frame.stencil.correct();
        Self { particles, frame }
    }

    /// The operator's value at every real particle.
    pub fn apply<O: Operator<D>>(&self, operator: O) -> Vec<O::Value>
    where
        O::Value: Clone + Send,
    {
        let mut values = vec![None; self.particles.real];
        self.frame.stencil.for_each_one(operator, &mut values, |_, value, out| *out = Some(value));
        values.into_iter().flatten().collect()
    }

    pub fn field<T>(&self, f: impl Fn(&Vector<D>) -> T) -> Vec<T> {
        self.particles.position.iter().map(f).collect()
    }
}
