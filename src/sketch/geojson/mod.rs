//! Sketches as GeoJSON, the file that a geographic information system can draw and show.
//!
//! A `FeatureCollection` of lines with `[x, y, z]` positions and the property `kind`: `ridge` or `valley`, in any case
//! (`LineString`, `MultiLineString`; a point is a stroke of one cell, a polygon its outline). Everything else about the map
//! travels in one foreign member of the collection, so that a file stands on its own:
//!
//! ```json
//! {"type": "FeatureCollection",
//!  "monadnock": {"rows": 128, "cols": 128, "unit": "normalised"},
//!  "features": [
//!   {"type": "Feature", "properties": {"kind": "ridge"},
//!    "geometry": {"type": "LineString", "coordinates": [[10, 12, 0.9], [40, 30, 0.7]]}}]}
//! ```
//!
//! **Coordinates.** With a georeference (in the member, or given by the DEM that the sketch belongs to) x and y are
//! model coordinates of that system. Without one they are pixel units as in [`Vertex`](super::Vertex): x is the column,
//! y the row counted *from the top*, and whole numbers are cell centres, so the map reaches from -0.5 to cols - 0.5. (A
//! viewer whose y axis points up shows such a file mirrored.)
//!
//! **Heights.** `unit` says whether z is in `metres`, `feet` or `normalised`: 0 to 1 of the style's range of elevations.
//! A property (`z`, `elevation`, `height`, ...; `elev_ft` names its unit) holds the height of a whole line or a list of them;
//! it counts where the coordinates have none, or nothing but zeros. Numbers may be text with a unit (`"2500 ft"`).
//!
//! **Coordinate systems.** RFC 7946 knows only longitude and latitude on WGS 84; other systems need "prior arrangement".
//! We write, as GDAL and QGIS do, the older `crs` member with an EPSG urn, and check on reading that it is the map's.
//! Nothing is reprojected. A file that names a system, or looks like longitude and latitude, is refused without a map in it.
//!
//! [`ReadOptions`] overrules everything that a file says.

mod checks;
mod crs;
mod features;
#[cfg(test)]
mod found_tests;
mod heights;
mod member;
mod notes;
mod number;
mod options;
mod placing;
mod properties;
mod reading;
#[cfg(test)]
mod tests;
mod writing;

pub use member::HeightUnit;
pub use options::{Coordinates, MissingHeights, ReadOptions};
pub use placing::Bounds;
pub(crate) use reading::{Outline, outline};
pub use reading::{SketchReading, parse, read};
pub use writing::{to_text, write};
