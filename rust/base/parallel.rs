//! Fixed chunks of particles: the unit of parallel work, and of sums that do not depend on the number of threads.

use rayon::prelude::*;
use std::ops::Range;

/// Particles a task, a whole number of clusters. Fixed, because sums are formed chunk by chunk.
pub const CHUNK: usize = 256;

/// Map each chunk of `0..count` in parallel, then fold the results in order.
pub fn reduce<R: Send>(count: usize, map: impl Fn(Range<usize>) -> R + Sync + Send, fold: impl Fn(R, R) -> R) -> Option<R> {
    (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| map(chunk * CHUNK..((chunk + 1) * CHUNK).min(count)))
        .collect::<Vec<R>>()
        .into_iter()
        .reduce(fold)
}

/// Add every index of `0..count` to one of several of what `none` begins with, in parallel, and merge these: for sums that no order
/// and no split changes.
pub fn accumulate<R: Send>(
    count: usize,
    none: impl Fn() -> R + Sync + Send,
    add: impl Fn(&mut R, usize) + Sync + Send,
    merge: impl Fn(&mut R, R) + Sync + Send,
) -> R {
    let chunks = (0..count.div_ceil(CHUNK)).into_par_iter().map(|chunk| {
        let mut sum = none();
        (chunk * CHUNK..((chunk + 1) * CHUNK).min(count)).for_each(|i| add(&mut sum, i));
        sum
    });
    chunks.reduce(&none, |mut sum, part| {
        merge(&mut sum, part);
        sum
    })
}

/// `f(i, &mut out[i])` for every entry, in parallel.
pub fn for_each<T: Send>(out: &mut [T], f: impl Fn(usize, &mut T) + Sync + Send) {
    out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
        for (k, value) in out.iter_mut().enumerate() {
            f(chunk * CHUNK + k, value);
        }
    });
}

/// The indices of `0..count` for which `holds`, in order, sought in parallel.
pub fn filter(count: usize, holds: impl Fn(usize) -> bool + Sync + Send) -> Vec<usize> {
    let chunk = |range: Range<usize>| range.filter(|&i| holds(i)).collect::<Vec<_>>();
    let join = |mut all: Vec<usize>, mut part: Vec<usize>| {
        all.append(&mut part);
        all
    };
    reduce(count, chunk, join).unwrap_or_default()
}
