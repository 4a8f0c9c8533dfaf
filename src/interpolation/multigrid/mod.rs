//! The linear solver behind smooth surfaces: conjugate gradients, preconditioned by a multigrid V-cycle.
//!
//! [`plane`] rasters with a mirrored margin -> [`energy`] the two operators on them -> [`raster`] with known and held cells ->
//! [`stencils`] the same operators on coarser rasters -> [`cycle`] the V-cycle -> [`solve`] conjugate gradients around it.

mod cycle;
mod energy;
mod plane;
mod raster;
mod solve;
mod stencils;

pub(super) use energy::Energy;
pub(super) use solve::{Held, solve};
