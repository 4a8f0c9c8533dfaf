//! Definitions of projections that `proj-core` does not know, as text.
//!
//! In: WKT or a PROJ string. Out: the PROJ string that `proj4wkt` makes of it (cylindrical equal area, sinusoidal, Mollweide,
//! Robinson, Esri's words for Albers, ...), with unit and ellipsoid as `proj4rs` reads them.

use super::Ellipsoid;
use proj4rs::Proj;
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

/// A definition that is kept as text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Text {
    /// As it was given.
    pub(super) given: &'static str,
    /// As a PROJ string.
    pub(super) proj: &'static str,
}

/// What the second library knows of a definition.
pub(super) struct Other {
    pub(super) text: Text,
    pub(super) ellipsoid: Ellipsoid,
    pub(super) metres: f64,
}

/// The PROJ string of a definition; `None` when it is of no known projection.
pub(super) fn proj_string(text: &str) -> Option<String> {
    if text.contains("+proj=") {
        return Some(text.to_owned());
    }
    proj4wkt::wkt_to_projstring(text).ok()
}

impl Other {
    /// The projected system of a PROJ string, `given` in other words perhaps; `None` when the library cannot undo it.
    pub(super) fn new(given: &str, proj: &str) -> Option<Self> {
        let known = Proj::from_proj_string(proj).ok()?;
        if known.is_latlong() || known.is_geocent() || !known.has_inverse() {
            return None;
        }
        // Of the degrees below it: some projections are of spheres only, and take the ellipsoid for one.
        let (semi_major, semi_minor) =
            Proj::from_proj_string(&degrees_below(proj)).ok()?.ellipse_parameters();
        let ellipsoid = Ellipsoid { semi_major, flattening: 1.0 - semi_minor / semi_major };
        let text = Text { given: kept(given), proj: kept(proj) };
        Some(Self { text, ellipsoid, metres: known.to_meter() })
    }
}

/// The longitudes and latitudes below a projection, counted from Greenwich, as a PROJ string.
pub(super) fn degrees_below(proj: &str) -> String {
    const SHAPE: [&str; 8] = ["+a=", "+b=", "+rf=", "+R=", "+ellps=", "+datum=", "+towgs84=", "+es="];
    let shape = proj.split_whitespace().filter(|word| SHAPE.iter().any(|key| word.starts_with(key)));
    shape.fold("+proj=longlat".to_owned(), |text, word| text + " " + word)
}

/// The text for as long as the program runs, once however often it is asked for: a [`Crs`] is copied freely.
fn kept(text: &str) -> &'static str {
    static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut all = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = all.get(text) {
        return known;
    }
    let new: &'static str = Box::leak(text.to_owned().into_boxed_str());
    all.insert(new);
    new
}
