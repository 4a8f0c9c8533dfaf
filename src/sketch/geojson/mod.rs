//! Sketches as GeoJSON, the file that a geographic information system can draw and show.
//!
//! A `FeatureCollection` of `LineString`s (also `MultiLineString`, and `Point` for a single spot) with `[x, y, z]`
//! positions and the property `kind`: `ridge` or `valley`. Everything else about the map travels in one foreign member
//! of the collection, so that a file stands on its own:
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
//! **Heights.** `unit` says whether z is in `metres` or `normalised`: 0 to 1 of the style's range of elevations.
//!
//! **Coordinate systems.** RFC 7946 knows only longitude and latitude on WGS 84; other systems need "prior arrangement".
//! We write, as GDAL and QGIS do, the older `crs` member with an EPSG urn, and check on reading that it is the DEM's.
//! Nothing is reprojected.

mod features;
mod member;
mod reading;
#[cfg(test)]
mod tests;
mod writing;

pub use member::HeightUnit;
pub use reading::{MissingHeights, ReadOptions, SketchReading, is_placed, parse, read};
pub use writing::{to_text, write};
