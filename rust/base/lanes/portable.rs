//! Lanes for any machine.

use super::{LANES, Lanes, Real, arithmetic};
use std::ops::{Add, AddAssign, Div, Mul, Sub};

/// Lanes for any machine.
#[derive(Clone, Copy)]
pub struct Portable([f64; LANES]);

#[derive(Clone, Copy)]
pub struct PortableSingles([f32; 2 * LANES]);

/// A type of lanes as an array of numbers.
macro_rules! portable {
    ($Lanes:ident, $number:ty) => {
        impl $Lanes {
            #[inline(always)]
            fn with(self, other: Self, f: impl Fn($number, $number) -> $number) -> Self {
                Self(std::array::from_fn(|lane| f(self.0[lane], other.0[lane])))
            }
        }

        impl Real for $Lanes {
            #[inline(always)]
            fn splat(value: f64) -> Self {
                Self([value as $number; _])
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(self.0.map(<$number>::sqrt))
            }

            #[inline(always)]
            fn positive(self) -> Self {
                Self(self.0.map(|value| if value > 0.0 { value } else { 0.0 }))
            }

            #[inline(always)]
            fn plus_product(self, a: Self, b: Self) -> Self {
                Self(std::array::from_fn(|lane| a.0[lane].mul_add(b.0[lane], self.0[lane])))
            }

            #[inline(always)]
            fn map(self, f: impl Fn(f64) -> f64) -> Self {
                Self(self.0.map(|value| f(value.into()) as $number))
            }
        }

        arithmetic!(
            $Lanes,
            Add add |a: Self, b| a.with(b, |a, b| a + b),
            Sub sub |a: Self, b| a.with(b, |a, b| a - b),
            Mul mul |a: Self, b| a.with(b, |a, b| a * b),
            Div div |a: Self, b| a.with(b, |a, b| a / b)
        );
    };
}

portable!(Portable, f64);
portable!(PortableSingles, f32);

impl Lanes for Portable {
    type Singles = PortableSingles;

    #[inline(always)]
    fn join(first: Self, second: Self) -> PortableSingles {
        PortableSingles(std::array::from_fn(|lane| [first, second][lane / LANES].0[lane % LANES] as f32))
    }

    #[inline(always)]
    fn split(singles: PortableSingles) -> [Self; 2] {
        [0, LANES].map(|start| Self(std::array::from_fn(|lane| f64::from(singles.0[start + lane]))))
    }

    #[inline(always)]
    fn load_singles(values: &[[f32; LANES]; 2]) -> PortableSingles {
        PortableSingles(std::array::from_fn(|lane| values[lane / LANES][lane % LANES]))
    }

    #[inline(always)]
    fn store_singles(singles: PortableSingles) -> [[f32; LANES]; 2] {
        [0, LANES].map(|start| std::array::from_fn(|lane| singles.0[start + lane]))
    }

    #[inline(always)]
    fn load(values: &[f64; LANES]) -> Self {
        Self(*values)
    }

    #[inline(always)]
    fn load_single(values: &[f32; LANES]) -> Self {
        Self(values.map(f64::from))
    }

    #[inline(always)]
    fn store(self) -> [f64; LANES] {
        self.0
    }

    #[inline(always)]
    fn store_single(self) -> [f32; LANES] {
        self.0.map(|value| value as f32)
    }

    #[inline(always)]
    fn below(self, limit: Self) -> Self {
        self.with(limit, |value, limit| f64::from(u8::from(value < limit)))
    }

    #[inline(always)]
    fn any_below(self, limit: Self) -> bool {
        self.0.iter().zip(limit.0).any(|(value, limit)| *value < limit)
    }

    #[inline(always)]
    fn least(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }
}
