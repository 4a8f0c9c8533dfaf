//! Pictures of terrain, sketches, errors and scores, and the self-contained report that holds them.
//!
//! Everything here is a pure function from data to pixels ([`Picture`], PNG), vector drawings ([`plot::Svg`]) or text
//! ([`report::Report`], HTML): the same input gives the same bytes.

mod color;
mod duration;
mod error_map;
mod hillshade;
mod legend;
mod lettering;
mod line_art;
mod painter;
mod palette;
mod picture;
pub mod plot;
mod relief;
pub mod report;
mod sheet;
mod sources;
mod ticks;
mod upsample;

pub use color::Rgb;
pub(crate) use duration::duration;
pub use error_map::{error_limit, error_map};
pub use hillshade::{Gradient, Sun, gradients, hillshade};
pub use legend::ColorBar;
pub use line_art::{LineArt, LineStyle};
pub(crate) use painter::Painter;
pub use palette::Palette;
pub use picture::Picture;
pub use relief::{Exaggeration, Relief};
pub use sheet::Sheet;
pub(crate) use sources::sources;
