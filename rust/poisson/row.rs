//! The rows of the system.

/// What row of the system a particle has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Row {
    /// −∇²x = f.
    Solved,
    /// x = 0.
    Zero,
    /// None: x is that of the fluid around.
    None,
}
