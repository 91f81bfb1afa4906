//! Fixed chunks of particles: the unit of parallel work, and of sums that do not depend on the number of threads.
//!
//! Loops over pairs run through [`vectorised`], which compiles them a second time for AVX2 and picks at run time. No operation
//! is fused or reordered for it, so the results are the same to the last bit.

use rayon::prelude::*;
use std::ops::Range;

/// Particles a task. Fixed, because sums are formed chunk by chunk.
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

/// `f(i, &mut out[i])` for every entry, in parallel.
pub fn for_each<T: Send>(out: &mut [T], f: impl Fn(usize, &mut T) + Sync + Send) {
    out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
        for (k, value) in out.iter_mut().enumerate() {
            f(chunk * CHUNK + k, value);
        }
    });
}

/// Run `f`, compiled for the vector instructions that this machine has. `f` and all it calls must be inlined, so mark the
/// closure `#[inline(always)]`.
#[inline(always)]
pub fn vectorised<R>(f: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
    {
        // SAFETY: the machine has the features that `with_avx2` is compiled for.
        return unsafe { with_avx2(f) };
    }
    f()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn with_avx2<R>(f: impl FnOnce() -> R) -> R {
    f()
}
