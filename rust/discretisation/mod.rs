//! Derivatives at one set of positions: volumes, slopes and corrections (the stencil), and what passes over them sum (operators).

mod correction;
mod operator;
mod operators;
mod printed;
mod stencil;

pub use correction::Correction;
pub use operator::{Neighbours, Nothing, Operator};
pub use operators::{
    AdjointGradient, ConservativeGradient, Divergence, Gradient, GradientAndLaplacian, Laplacian, LaplacianAndGradient,
    LaplacianAndItsSum, LaplacianDiagonal, Largest, Roughness, Surroundings, VelocityGradient,
};
pub use printed::vector_laplacian;
pub use stencil::{Corrected, Stencil};
