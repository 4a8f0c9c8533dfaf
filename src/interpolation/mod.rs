//! Filling the plane between lines: natural neighbours, Delaunay triangles, harmonic and biharmonic surfaces, the surface of given
//! gradients, and the correction that makes any terrain pass through its sketch; heights for strokes that have none.

mod correction;
mod delaunay;
pub mod height_model;
pub(crate) mod line_cells;
mod multigrid;
mod natural_neighbour;
mod screened_poisson;
mod smooth_surface;
mod sparse_matrix;

pub(crate) use correction::{Correction, CorrectionKind};
pub(crate) use delaunay::delaunay_linear;
pub use natural_neighbour::{NaturalNeighbours, natural_neighbour_weights};
pub(crate) use screened_poisson::{Gradients, ScreenedPoisson};
pub use smooth_surface::{biharmonic, biharmonic_until, harmonic, harmonic_until};
pub(crate) use sparse_matrix::SparseMatrix;
