//! What the demo makes, as its report shows it.

use crate::dem::Dem;
use crate::evaluate::Evaluation;
use crate::sketch::{LineMap, Sketch};
use crate::style::{Source, Style};
use std::time::Duration;

/// One style of the demo with what was made of it.
pub(super) struct DemoStyle {
    pub(super) name: &'static str,
    pub(super) title: String,
    pub(super) credit: String,
    pub(super) source: Source,
    /// Lines of the exemplar, metres.
    pub(super) lines: LineMap,
    pub(super) style: Style,
    /// The exemplar rebuilt from its own lines, metres.
    pub(super) rebuilt: Dem,
    /// The drawing as terrain, by the network with detail and by the synthesis.
    pub(super) by_network: Dem,
    pub(super) drawn: Dem,
    /// The other drawings as terrain, by the synthesis.
    pub(super) others: Vec<Dem>,
    /// The first of them from several seeds.
    pub(super) variants: Vec<Dem>,
    /// The drawing with random lines (metres), and its terrain.
    pub(super) enhanced: (Sketch, Dem),
}

/// Everything that the report shows.
pub(super) struct DemoResults {
    pub(super) quick: bool,
    pub(super) styles: Vec<DemoStyle>,
    /// The drawing in metres of the first style.
    pub(super) drawing: Sketch,
    /// The other drawings, likewise.
    pub(super) others: Vec<Sketch>,
    pub(super) evaluation: Evaluation,
    /// Cell size of the compared patches, and their DEM's name.
    pub(super) compared: Dem,
    pub(super) times: Vec<(String, Duration)>,
    pub(super) commands: Vec<String>,
}
