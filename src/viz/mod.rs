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
pub(crate) mod plot;
mod relief;
pub(crate) mod report;
mod sheet;
mod sources;
mod ticks;
mod upsample;

pub(crate) use color::Rgb;
pub(crate) use duration::duration;
pub(crate) use error_map::{error_limit, error_map};
pub(crate) use hillshade::Sun;
pub(crate) use legend::ColorBar;
pub(crate) use line_art::{LineArt, LineStyle};
pub(crate) use painter::Painter;
pub(crate) use palette::Palette;
pub(crate) use picture::Picture;
pub(crate) use relief::{Exaggeration, Relief};
pub(crate) use sheet::Sheet;
pub(crate) use sources::sources;
