//! Four numbers side by side, one for each particle of a cluster: what the loops over pairs compute with.
//!
//! [`run`] picks the vector instructions at run time ([`Instructions`]), so that one build is fast on every machine. All versions round alike
//! (the same operations are fused, none is reordered), so the results are the same to the last bit.

use crate::base::error::{Result, setting};
use std::ops::{Add, AddAssign, Div, Mul, Sub};
use std::sync::OnceLock;

#[cfg(target_arch = "x86_64")]
mod avx2;
mod portable;
mod vectors;

pub use portable::Portable;
pub use vectors::{add_product, from, matrices, norm_squared, vectors};

/// Particles a cluster.
pub const LANES: usize = 4;

/// A real number, or several side by side.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + AddAssign
{
    fn splat(value: f64) -> Self;
    fn sqrt(self) -> Self;
    /// Its positive part: max(self, 0).
    fn positive(self) -> Self;
    /// `self + a b`. Lanes round once, after the sum.
    fn plus_product(self, a: Self, b: Self) -> Self;
    /// `f` of each number, one at a time.
    fn map(self, f: impl Fn(f64) -> f64) -> Self;

    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
}

/// Four numbers side by side.
pub trait Lanes: Real {
    /// Two sets of lanes side by side in single precision, for what needs no more: it takes half the time.
    type Singles: Real;

    fn join(first: Self, second: Self) -> Self::Singles;
    fn split(singles: Self::Singles) -> [Self; 2];
    fn load_singles(values: &[[f32; LANES]; 2]) -> Self::Singles;
    fn store_singles(singles: Self::Singles) -> [[f32; LANES]; 2];
    fn load(values: &[f64; LANES]) -> Self;
    fn load_single(values: &[f32; LANES]) -> Self;
    fn store(self) -> [f64; LANES];
    fn store_single(self) -> [f32; LANES];
    /// 1 where `self` is below `limit`, else 0.
    fn below(self, limit: Self) -> Self;
    fn any_below(self, limit: Self) -> bool;
    /// The smaller of the two.
    fn least(self, other: Self) -> Self;
}

/// Work that is compiled for each kind of vector instructions. Mark `run`, and all that takes or gives `V`,
/// `#[inline(always)]`: instructions are chosen where the work is inlined.
pub trait Task {
    fn run<V: Lanes>(self);
}

/// The vector instructions that [`run`] may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// Those that every machine of the architecture has.
    Portable,
    /// AVX2 with FMA, BMI1 and BMI2.
    Avx2,
}

/// Environment variable that pins the instructions: ``portable`` or ``avx2``.
pub const PIN: &str = "ALSPH_INSTRUCTIONS";

impl Instructions {
    /// Those that are used from the first call on: what [`PIN`] says, or else the best that this machine has.
    pub fn chosen() -> Result<Self> {
        static CHOSEN: OnceLock<std::result::Result<Instructions, String>> = OnceLock::new();
        CHOSEN
            .get_or_init(|| Self::choose(std::env::var(PIN).ok().as_deref()))
            .clone()
            .map_err(|problem| setting(PIN, problem))
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
        }
    }

    fn choose(pin: Option<&str>) -> std::result::Result<Self, String> {
        match pin {
            None | Some("") => Ok(if has_avx2() { Self::Avx2 } else { Self::Portable }),
            Some("portable") => Ok(Self::Portable),
            Some("avx2") if has_avx2() => Ok(Self::Avx2),
            Some("avx2") => Err("this machine has no avx2 with fma, bmi1 and bmi2; use portable, or leave it unset".into()),
            Some(other) => Err(format!("must be portable or avx2, not {other}")),
        }
    }
}

fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

/// Run `task` with the chosen vector instructions.
pub fn run(task: impl Task) {
    #[cfg(target_arch = "x86_64")]
    if matches!(Instructions::chosen(), Ok(Instructions::Avx2)) {
        // SAFETY: avx2 is only chosen where the machine has the features that `avx2::run` is compiled for.
        return unsafe { avx2::run(task) };
    }
    task.run::<Portable>();
}

impl Real for f64 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn positive(self) -> Self {
        // f64::max would also look for NaN.
        if self > 0.0 { self } else { 0.0 }
    }

    #[inline(always)]
    fn plus_product(self, a: Self, b: Self) -> Self {
        // Fused it would be a call on most machines.
        self + a * b
    }

    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        f(self)
    }
}

/// Arithmetic of a type of lanes, from functions of two.
macro_rules! arithmetic {
    ($Lanes:ty, $($Trait:ident $method:ident $combine:expr),*) => {
        $(impl $Trait for $Lanes {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                $combine(self, other)
            }
        })*

        impl AddAssign for $Lanes {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
    };
}
use arithmetic;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Every operation on two sets of lanes.
    struct All<'a> {
        a: [f64; LANES],
        b: [f64; LANES],
        out: &'a mut Vec<u64>,
    }

    impl Task for All<'_> {
        #[inline(always)]
        fn run<V: Lanes>(self) {
            let (a, b) = (V::load(&self.a), V::load(&self.b));
            let mut sum = a;
            sum += V::load_single(&b.store_single());
            let singles = V::load_singles(&V::store_singles(V::join(a, b)));
            let [third, _] = V::split(singles.plus_product(singles, singles.positive()));
            let [first, second] =
                V::split(singles * singles.positive().sqrt() + V::Singles::splat(0.1) - V::Singles::splat(0.3) / singles);
            let results = [
                [a + b, a - b, a * b, a / b, a.positive()],
                [a.positive().sqrt(), a.plus_product(b, sum), a.least(b), a.below(b), V::splat(self.a[0])],
                [V::zero(), sum, first, second, third],
            ]
            .concat();
            // The sign of a NaN is nobody's promise.
            let bits = |value: f64| if value.is_nan() { f64::NAN.to_bits() } else { value.to_bits() };
            self.out.extend(results.iter().flat_map(|lanes| lanes.store()).map(bits));
            self.out.push(u64::from(a.any_below(b)));
        }
    }

    fn check(a: [f64; LANES], b: [f64; LANES]) {
        let (mut machine, mut portable) = (Vec::new(), Vec::new());
        run(All { a, b, out: &mut machine });
        All { a, b, out: &mut portable }.run::<Portable>();
        assert_eq!(machine, portable);
    }

    #[test]
    fn special_values_give_the_same_everywhere() {
        let special =
            [0.0, -0.0, 1.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, 1e-300, 1e-45, f64::MIN_POSITIVE];
        for a in special {
            special.chunks(LANES).for_each(|b| check([a; LANES], std::array::from_fn(|lane| b[lane % b.len()])));
        }
    }

    proptest! {
        #[test]
        fn the_machines_lanes_agree_with_the_portable_ones(
            a in proptest::array::uniform4(-1e3..1e3f64), b in proptest::array::uniform4(1e-3..1e3f64)
        ) {
            check(a, b);
        }
    }
}
