//! The systems that turn a sketch into terrain, side by side: [`classical`] interpolators and [`region_gnn`].

pub mod task;
pub mod classical;
pub mod region_gnn;
pub mod singan;
pub mod registry;
