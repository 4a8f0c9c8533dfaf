//! What is looked for in the strokes as a whole: which lie off the map, and which contradict each other.

use super::notes::Notes;
use crate::error::{Error, Result};
use crate::grid::Cell;
use crate::sketch::{Sketch, Stroke, StrokeKind};
use std::collections::{BTreeMap, HashMap};

/// A stroke with where it stands in the file, and which of its vertices have a height that the file gives.
#[derive(Debug)]
pub(super) struct Named {
    pub(super) name: String,
    pub(super) stroke: Stroke,
    pub(super) given: Vec<bool>,
}

/// Leaves out strokes that lie wholly off the map; `advice` is said when none is left.
pub(super) fn on_the_map(
    strokes: Vec<Named>,
    (rows, cols): (usize, usize),
    advice: impl FnOnce() -> String,
    notes: &mut Notes,
) -> Result<Vec<Named>> {
    let mut kept = Vec::with_capacity(strokes.len());
    let (mut off, mut cut) = (Vec::new(), Vec::new());
    let mut reach = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for named in strokes {
        for v in &named.stroke.vertices {
            reach = [reach[0].min(v.x), reach[1].max(v.x), reach[2].min(v.y), reach[3].max(v.y)];
        }
        match named.stroke.lies_on(rows, cols) {
            (false, _) => off.push(named.name),
            (true, all) => {
                if !all {
                    cut.push(named.name.clone());
                }
                kept.push(named);
            }
        }
    }
    if kept.is_empty() {
        let [west, east, north, south] = reach;
        return Err(Error::value(
            "number of strokes on the map",
            0,
            format!(
                "the map has columns 0 to {}, rows 0 to {}; the strokes reach from column {west:.6} to {east:.6}, row \
                 {north:.6} to {south:.6}{}",
                cols - 1,
                rows - 1,
                advice()
            ),
        ));
    }
    for name in &off {
        notes.line(&format!("off the map of {rows}x{cols}: left out"), name);
    }
    for name in &cut {
        notes.line(&format!("partly off the map of {rows}x{cols}: cut at its frame"), name);
    }
    Ok(kept)
}

/// Names strokes with two heights at one point.
pub(super) fn name_steps(strokes: &[Named], notes: &mut Notes) {
    for named in strokes {
        let vertices = named.stroke.vertices.windows(2).zip(named.given.windows(2));
        let mut both = vertices.filter(|(_, given)| given[0] && given[1]).map(|(w, _)| w);
        if both.any(|w| (w[0].x, w[0].y) == (w[1].x, w[1].y) && w[0].z != w[1].z) {
            notes.line("with two heights at one point: the later one counts", &named.name);
        }
    }
}

/// Cells that a ridge and a valley may share where they cross.
const CROSSING: usize = 3;

/// Names ridges and valleys that run over the same cells, further than where they cross.
pub(super) fn name_overlaps(strokes: &[Named], (rows, cols): (usize, usize), notes: &mut Notes) {
    let is_ridge = |named: &Named| named.stroke.kind == StrokeKind::Ridge;
    if strokes.iter().all(is_ridge) || !strokes.iter().any(is_ridge) {
        return;
    }
    let mut owners: [HashMap<Cell, usize>; 2] = Default::default();
    let mut shared: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let mut lengths = Vec::with_capacity(strokes.len());
    for (i, named) in strokes.iter().enumerate() {
        let cells = named.stroke.cells(rows, cols);
        lengths.push(cells.len());
        let own = usize::from(is_ridge(named));
        for (cell, _) in cells {
            if let Some(&other) = owners[1 - own].get(&cell) {
                *shared.entry((other, i)).or_default() += 1;
            }
            owners[own].insert(cell, i);
        }
    }
    for ((first, later), count) in shared {
        let shorter = lengths[first].min(lengths[later]);
        if count > CROSSING || (count >= shorter && shorter > 1) {
            let name = format!("{} and {}: {count} cells", strokes[first].name, strokes[later].name);
            notes.line(
                "of a ridge and a valley that run over the same cells: the later one counts there",
                &name,
            );
        }
    }
}

/// The parts of a reading that a sketch is made of, in the order of the file.
pub(super) fn apart(
    strokes: Vec<Named>,
    rows: usize,
    cols: usize,
) -> Result<(Sketch, Vec<Vec<bool>>, Vec<String>)> {
    let (mut plain, mut given, mut names) = (Vec::new(), Vec::new(), Vec::new());
    for named in strokes {
        plain.push(named.stroke);
        given.push(named.given);
        names.push(named.name);
    }
    Ok((Sketch::new(rows, cols, plain)?, given, names))
}
