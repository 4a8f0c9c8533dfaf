//! Pictures of terrain, sketches, errors and scores, and the self-contained report that holds them.
//!
//! Everything here is a pure function from data to pixels ([`Picture`], PNG), vector drawings ([`plot::Svg`]) or text
//! ([`report::Report`], HTML): the same input gives the same bytes.

mod color;
mod hillshade;
mod palette;
mod picture;
mod relief;
mod upsample;

pub use color::Rgb;
pub use hillshade::{Gradient, Sun, gradients, hillshade};
pub use palette::Palette;
pub use picture::Picture;
pub use relief::{Exaggeration, Relief};
