//! Lanes in AVX registers.

use super::{LANES, Lanes, Real, Task, arithmetic};
use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, Div, Mul, Sub};

/// Lanes in one AVX register. Made nowhere but below [`run`], hence the unsafe blocks of this module: the machine has the
/// instructions.
#[derive(Clone, Copy)]
pub struct Avx2(__m256d);

#[derive(Clone, Copy)]
pub struct Singles(__m256);

/// # Safety
/// The machine must have the features named.
#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
pub unsafe fn run(task: impl Task) {
    task.run::<Avx2>();
}

impl Real for Avx2 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(unsafe { _mm256_set1_pd(value) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }

    #[inline(always)]
    fn positive(self) -> Self {
        Self(unsafe { _mm256_max_pd(self.0, _mm256_setzero_pd()) })
    }

    #[inline(always)]
    fn plus_product(self, a: Self, b: Self) -> Self {
        Self(unsafe { _mm256_fmadd_pd(a.0, b.0, self.0) })
    }

    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self::load(&self.store().map(f))
    }
}

impl Real for Singles {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(unsafe { _mm256_set1_ps(value as f32) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn positive(self) -> Self {
        Self(unsafe { _mm256_max_ps(self.0, _mm256_setzero_ps()) })
    }

    #[inline(always)]
    fn plus_product(self, a: Self, b: Self) -> Self {
        Self(unsafe { _mm256_fmadd_ps(a.0, b.0, self.0) })
    }

    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Avx2::load_singles(&Avx2::store_singles(self).map(|values| values.map(|value| f(value.into()) as f32)))
    }
}

impl Lanes for Avx2 {
    type Singles = Singles;

    #[inline(always)]
    fn join(first: Self, second: Self) -> Singles {
        Singles(unsafe { _mm256_set_m128(_mm256_cvtpd_ps(second.0), _mm256_cvtpd_ps(first.0)) })
    }

    #[inline(always)]
    fn split(singles: Singles) -> [Self; 2] {
        let (first, second) = unsafe { (_mm256_castps256_ps128(singles.0), _mm256_extractf128_ps::<1>(singles.0)) };
        unsafe { [Self(_mm256_cvtps_pd(first)), Self(_mm256_cvtps_pd(second))] }
    }

    #[inline(always)]
    fn load_singles(values: &[[f32; LANES]; 2]) -> Singles {
        Singles(unsafe { _mm256_loadu_ps(values.as_ptr().cast()) })
    }

    #[inline(always)]
    fn store_singles(singles: Singles) -> [[f32; LANES]; 2] {
        let mut values = [[0.0; LANES]; 2];
        unsafe { _mm256_storeu_ps(values.as_mut_ptr().cast(), singles.0) };
        values
    }

    #[inline(always)]
    fn load(values: &[f64; LANES]) -> Self {
        Self(unsafe { _mm256_loadu_pd(values.as_ptr()) })
    }

    #[inline(always)]
    fn load_single(values: &[f32; LANES]) -> Self {
        Self(unsafe { _mm256_cvtps_pd(_mm_loadu_ps(values.as_ptr())) })
    }

    #[inline(always)]
    fn store(self) -> [f64; LANES] {
        let mut values = [0.0; LANES];
        unsafe { _mm256_storeu_pd(values.as_mut_ptr(), self.0) };
        values
    }

    #[inline(always)]
    fn store_single(self) -> [f32; LANES] {
        let mut values = [0.0; LANES];
        unsafe { _mm_storeu_ps(values.as_mut_ptr(), _mm256_cvtpd_ps(self.0)) };
        values
    }

    #[inline(always)]
    fn below(self, limit: Self) -> Self {
        Self(unsafe { _mm256_and_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, limit.0), _mm256_set1_pd(1.0)) })
    }

    #[inline(always)]
    fn any_below(self, limit: Self) -> bool {
        unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, limit.0)) != 0 }
    }

    #[inline(always)]
    fn least(self, other: Self) -> Self {
        Self(unsafe { _mm256_min_pd(self.0, other.0) })
    }
}

arithmetic!(
    Avx2,
    Add add |a: Self, b: Self| Self(unsafe { _mm256_add_pd(a.0, b.0) }),
    Sub sub |a: Self, b: Self| Self(unsafe { _mm256_sub_pd(a.0, b.0) }),
    Mul mul |a: Self, b: Self| Self(unsafe { _mm256_mul_pd(a.0, b.0) }),
    Div div |a: Self, b: Self| Self(unsafe { _mm256_div_pd(a.0, b.0) })
);

arithmetic!(
    Singles,
    Add add |a: Self, b: Self| Self(unsafe { _mm256_add_ps(a.0, b.0) }),
    Sub sub |a: Self, b: Self| Self(unsafe { _mm256_sub_ps(a.0, b.0) }),
    Mul mul |a: Self, b: Self| Self(unsafe { _mm256_mul_ps(a.0, b.0) }),
    Div div |a: Self, b: Self| Self(unsafe { _mm256_div_ps(a.0, b.0) })
);
