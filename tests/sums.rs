//! Sums that do not depend on the order of their terms.

use alsph::base::{ExactSum, exact_sums};
use proptest::prelude::*;

fn sum(terms: &[f64]) -> f64 {
    let mut sum = ExactSum::default();
    terms.iter().for_each(|&term| sum.add(term));
    sum.value()
}

/// Any f64 that is finite, of any size.
fn number() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |x| x.is_finite())
}

#[test]
fn what_rounding_loses_is_kept() {
    assert_eq!(sum(&[]), 0.0);
    assert_eq!(sum(&[1e16, 1.0, -1e16]), 1.0);
    assert_eq!(sum(&[1e300, 3.25, -1e300, -1e-300]), 3.25);
    assert_eq!(sum(&[f64::MAX, f64::MAX, -f64::MAX]), f64::MAX);
    assert_eq!(sum(&[f64::MAX, f64::MAX]), f64::INFINITY);
    assert_eq!(sum(&[f64::from_bits(1); 5]), f64::from_bits(5));
    assert_eq!(sum(&[f64::MIN_POSITIVE, -f64::from_bits(1)]), f64::from_bits((1 << 52) - 1));
    // Rounded once: half of the last place to even, and a hair more up.
    let last = f64::EPSILON;
    assert_eq!(sum(&[1.0, last / 2.0]), 1.0);
    assert_eq!(sum(&[1.0, last / 2.0, 1e-300]), 1.0 + last);
    assert_eq!(sum(&[-1.0, -last / 2.0, -1e-300]), -1.0 - last);
    assert_eq!(sum(&[1.0, last / 2.0, -1e-300]), 1.0);
}

#[test]
fn what_is_no_number_shows() {
    assert!(sum(&[1.0, f64::NAN, 2.0]).is_nan());
    assert_eq!(sum(&[1.0, f64::INFINITY]), f64::INFINITY);
    assert!(sum(&[f64::INFINITY, f64::NEG_INFINITY]).is_nan());
}

#[test]
fn sums_in_parallel_are_those_of_one_thread() {
    let term = |i: usize| (!i.is_multiple_of(3)).then(|| [(i as f64).sin() * 10f64.powi(i as i32 % 30 - 15), 1.0]);
    let terms: Vec<_> = (0..20_000).filter_map(term).collect();
    let whole = [0, 1].map(|k| sum(&terms.iter().map(|term| term[k]).collect::<Vec<_>>()));
    assert_eq!(exact_sums(20_000, term), whole);
}

proptest! {
    /// However the terms are ordered and split.
    #[test]
    fn no_order_and_no_split_changes_a_sum(
        (terms, other) in prop::collection::vec(number(), 0..40)
            .prop_flat_map(|terms| (Just(terms.clone()), Just(terms).prop_shuffle())),
        split in 0..40usize,
    ) {
        let (first, second) = other.split_at(split.min(other.len()));
        let [mut all, mut rest] = [ExactSum::default(), ExactSum::default()];
        first.iter().for_each(|&term| all.add(term));
        second.iter().for_each(|&term| rest.add(term));
        all.merge(&rest);
        prop_assert_eq!(all.value().to_bits(), sum(&terms).to_bits());
    }

    /// Of two terms, the sum that the processor rounds; and the opposite terms give the opposite sum.
    #[test]
    fn two_terms_are_rounded_as_the_processor_does(a in number(), b in number(), near in -3..3i32) {
        let c = a * 2f64.powi(near);
        for (a, b) in [(a, b), (a, c)] {
            prop_assert_eq!(sum(&[a, b]), a + b);
            prop_assert_eq!(sum(&[-a, -b]), -(a + b));
        }
    }
}
