//! The systems that turn a sketch into terrain, side by side: [`classical`] interpolators, [`region_gnn`], the [`landscape`] model and [`synthesis`];
//! [`singan`] (trained), [`gpnn`] (the exemplar's own patches) and [`sparse`] (sums of its forms) add detail to what they make, and the room `style` puts both together.

pub mod task;
pub(crate) mod classical;
pub mod region_gnn;
pub mod synthesis;
pub(crate) mod singan;
pub(crate) mod gpnn;
pub(crate) mod sparse;
pub(crate) mod landscape;
