//! Sums that do not depend on the order of their terms, nor on how they are split: every term is added as the whole number of the least
//! f64 that it is (Kulisch), in digits that integer addition merges.

use crate::base::parallel;

/// Digits of 32 bits: enough for all that an f64 can be, 2^-1074 to 2^1024, and for the carries of as many terms as an i64 counts.
const DIGITS: usize = 68;

/// Power of two of the lowest digit.
const LOWEST: i32 = -1074;

/// A sum of f64; fewer than 2^31 terms, in all that is merged.
#[derive(Clone, Debug)]
pub struct ExactSum {
    /// Not normalised: each holds the sum of the parts of all terms.
    digits: [i64; DIGITS],
    /// Sum of the terms that are no numbers, or infinite.
    irregular: f64,
}

impl Default for ExactSum {
    fn default() -> Self {
        Self { digits: [0; DIGITS], irregular: 0.0 }
    }
}

impl ExactSum {
    #[inline]
    pub fn add(&mut self, term: f64) {
        let bits = term.to_bits();
        let exponent = (bits >> 52 & 0x7ff) as usize;
        if exponent == 0x7ff {
            self.irregular += term;
            return;
        }
        let fraction = bits & ((1 << 52) - 1);
        // Numbers below the least normal one lack the leading one, and stand where that does.
        let (mantissa, place) = if exponent == 0 { (fraction, 0) } else { (fraction | 1 << 52, exponent - 1) };
        let parts = u128::from(mantissa) << (place % 32);
        let sign = if bits >> 63 == 0 { 1 } else { -1 };
        for (k, digit) in self.digits[place / 32..][..3].iter_mut().enumerate() {
            *digit += sign * i64::from((parts >> (32 * k)) as u32);
        }
    }

    pub fn merge(&mut self, other: &Self) {
        self.digits.iter_mut().zip(&other.digits).for_each(|(digit, other)| *digit += other);
        self.irregular += other.irregular;
    }

    /// The sum, rounded once.
    pub fn value(&self) -> f64 {
        if self.irregular != 0.0 {
            return self.irregular;
        }
        let negative = carried(&self.digits)[DIGITS - 1] < 0;
        let digits = if negative { carried(&self.digits.map(|digit| -digit)) } else { carried(&self.digits) };
        let Some(top) = digits.iter().rposition(|&digit| digit != 0) else { return 0.0 };
        let first = top.saturating_sub(2);
        let leading = digits[first..=top].iter().rev().fold(0u128, |sum, &digit| sum << 32 | digit as u128);
        // What lies below the leading digits tells on which side of a half they are.
        let rest = digits[..first].iter().any(|&digit| digit != 0);
        let magnitude = scaled((leading | u128::from(rest)) as f64, LOWEST + 32 * first as i32);
        if negative { -magnitude } else { magnitude }
    }
}

/// All digits but the last from 0 to 2^32 − 1.
fn carried(digits: &[i64; DIGITS]) -> [i64; DIGITS] {
    let (mut digits, mut carry) = (*digits, 0);
    for digit in &mut digits[..DIGITS - 1] {
        let sum = *digit + carry;
        (*digit, carry) = (sum & 0xffff_ffff, sum >> 32);
    }
    digits[DIGITS - 1] += carry;
    digits
}

/// `value` 2^`power`, in two factors that are numbers.
fn scaled(value: f64, power: i32) -> f64 {
    value * 2f64.powi(power / 2) * 2f64.powi(power - power / 2)
}

/// The N sums over `0..count` of what `terms` gives for an index, if anything, in parallel.
pub fn exact_sums<const N: usize>(count: usize, terms: impl Fn(usize) -> Option<[f64; N]> + Sync + Send) -> [f64; N] {
    let none = || std::array::from_fn::<_, N, _>(|_| ExactSum::default());
    let add = |sums: &mut [ExactSum; N], i: usize| {
        if let Some(terms) = terms(i) {
            sums.iter_mut().zip(terms).for_each(|(sum, term)| sum.add(term));
        }
    };
    parallel::accumulate(count, none, add, |sums, part| {
        sums.iter_mut().zip(&part).for_each(|(sum, part)| sum.merge(part));
    })
    .map(|sum| sum.value())
}
