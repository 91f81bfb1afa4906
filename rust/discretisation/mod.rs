//! Derivatives at one set of positions: volumes, slopes and corrections (the stencil), and what passes over them sum (operators).

mod operators;
mod stencil;

pub use operators::{
    Divergence, Gradient, GradientAndLaplacian, LaplacianAndGradient, Neighbours, Nothing, Operator, VelocityGradient,
    vector_laplacian,
};
pub use stencil::{Corrected, Correction, Stencil};
