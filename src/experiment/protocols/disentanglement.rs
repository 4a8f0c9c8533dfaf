//! The states of ridge and valley regions after message passing: do they lie apart (Liu & Benes 2025, Fig. 13)?
//!
//! The paper shows a t-SNE. Here numbers stand beside it: the share of the ten nearest states that are of a state's own kind
//! (and what that would be by chance), and the silhouette (Rousseeuw 1987) of ridge against valley. Kind is an input of the
//! network, so that some separation is given; how much is left after averaging over pixels is what the numbers say.

use super::general;
use crate::error::{Error, Result};
use crate::evaluate::patch_seed;
use crate::experiment::measure::{Measured, Systems, Task, patch_of, without_truth};
use crate::experiment::pictures::{Gallery, plain};
use crate::experiment::protocol::{Finding, Finished, Plot, Protocol, not_for};
use crate::experiment::record::Record;
use crate::experiment::results::Results;
use crate::experiment::spec::ExperimentSpec;
use crate::metrics::{Labelled, separation, tsne};
use crate::seed::Seed;
use crate::sketch::{LineMap, StrokeKind};
use crate::style::Named;
use crate::viz::plot::Scatter;
use serde::{Deserialize, Serialize};

/// The scores.
const COLUMNS: [&str; 4] = ["kind_purity", "chance_purity", "kind_silhouette", "regions"];
/// The table of places in the record.
const TABLE: &str = "states.csv";

pub(super) struct Disentanglement;

/// The place of a region's state: a row of `states.csv`.
#[derive(Serialize, Deserialize)]
struct StateRow {
    system: String,
    area: String,
    patch: String,
    kind: StrokeKind,
    x: f64,
    y: f64,
}

impl Protocol for Disentanglement {
    fn columns(&self) -> Vec<&'static str> {
        COLUMNS.to_vec()
    }

    fn validate(&self, spec: &ExperimentSpec) -> Result<()> {
        if spec.interpolators.is_empty() {
            return Ok(());
        }
        Err(not_for(spec.kind, "interpolators", "given", "interpolators have no region states"))
    }

    fn measure(&self, task: &Task<'_>) -> Result<Vec<Measured>> {
        without_truth(task, |named, patch, seed| {
            let found = states_of(named, task.systems, &patch.lines, seed)?;
            let apart = separation(&found);
            let values = [apart.purity, apart.chance, apart.silhouette, found.len() as f64];
            Ok(COLUMNS.into_iter().zip(values.map(Some)).collect())
        })
    }

    /// Places of the region states of the first patch of each area in two dimensions (t-SNE).
    fn after_scoring(&self, finished: &Finished<'_>) -> Result<()> {
        let spec = &finished.resolved.spec;
        let (seed, sketch) = (spec.seeds[0], &spec.sketches()[0]);
        let mut rows = Vec::new();
        for area in &finished.resolved.areas {
            let systems = finished.styles.systems(area, seed, false)?;
            let Some(&cell) = area.patches.first() else { continue };
            let Ok(patch) = patch_of(spec, area, cell, sketch) else { continue };
            for named in &systems.named {
                let states = states_of(named, &systems, &patch.lines, patch_seed(Seed(seed), cell));
                let Ok(states) = states else { continue };
                let places = tsne(&states, Seed(seed));
                rows.extend(states.iter().zip(places).map(|((kind, _), (x, y))| StateRow {
                    system: named.0.clone(),
                    area: area.name.clone(),
                    patch: format!("{},{}", cell.row, cell.col),
                    kind: *kind,
                    x: (x * 1e5).round() / 1e5,
                    y: (y * 1e5).round() / 1e5,
                }));
            }
        }
        finished.record.write_table(TABLE, &rows)
    }

    fn pictures(&self, _: &Gallery<'_>) -> Result<()> {
        Ok(())
    }

    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        Ok(general::means(results, false))
    }

    fn plots(&self, _: &Results<'_>, record: &Record) -> Result<Vec<Plot>> {
        let rows: Vec<StateRow> = record.table(TABLE)?;
        let mut plots: Vec<Plot> = Vec::new();
        for of in rows.chunk_by(|a, b| (&a.system, &a.area) == (&b.system, &b.area)) {
            let StateRow { system, area, patch, .. } = &of[0];
            let mut plot = Scatter::new(format!("{system}, {area} {patch}"), "t-SNE 1", "t-SNE 2");
            for (name, kind) in [("valley", StrokeKind::Valley), ("ridge", StrokeKind::Ridge)] {
                plot = plot.group(name, of.iter().filter(|row| row.kind == kind).map(|row| (row.x, row.y)));
            }
            let caption =
                "A point for each region of the patch after message passing; axes of a t-SNE have no unit.";
            plots.push((
                format!("states-{}-{}", plain(system), plain(area)),
                plot.draw()?,
                caption.to_owned(),
            ));
        }
        Ok(plots)
    }
}

/// The states of a sketch's regions.
fn states_of(
    (name, _): &Named,
    systems: &Systems<'_>,
    lines: &LineMap,
    seed: Seed,
) -> Result<Vec<Labelled<StrokeKind>>> {
    let style = systems.style_of(name)?;
    let states = style.network()?.model().region_states(lines, &style.config().generation, seed)?;
    let has = |kind| states.iter().any(|(k, _)| *k == kind);
    if !has(StrokeKind::Ridge) || !has(StrokeKind::Valley) {
        return Err(Error::value("kinds of region", 1, "ridges and valleys are needed to tell them apart"));
    }
    Ok(states)
}
