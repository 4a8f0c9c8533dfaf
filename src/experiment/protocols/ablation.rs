//! As `neighbours`, with variations of one style against a baseline.

use super::general::head;
use crate::error::Result;
use crate::experiment::protocol::check;
use crate::experiment::protocol::{Finding, Protocol};
use crate::experiment::record::Record;
use crate::experiment::results::Results;
use crate::experiment::spec::ExperimentSpec;
use crate::viz::report::{Column, Entry, Table, Text};

pub(super) struct Ablation;

impl Protocol for Ablation {
    fn validate(&self, spec: &ExperimentSpec) -> Result<()> {
        let found = spec.style.len();
        check(found > 1, "number of styles", found, "an ablation compares at least 2")
    }

    /// For each sketch a row for each system: the mean of all areas and the difference to the baseline.
    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        let spec = results.spec;
        let baseline = spec.baseline.as_ref().unwrap_or(&results.highlight);
        let areas: Vec<&str> = spec.area.iter().map(|a| a.name.as_str()).collect();
        let mut findings = Vec::new();
        for sketch in &results.sketches {
            let heads = std::iter::once(Column::text("system")).chain(spec.metrics.iter().map(|m| head(m)));
            let (areas, seeds) = (areas.join(", "), results.seeds());
            let caption = format!(
                "Sketch \"{sketch}\", mean of {areas} ({seeds}), and the difference to `{baseline}`:"
            );
            let mut table = Table::new(heads).caption(caption);
            for system in results.style_systems() {
                let mut row = vec![Entry::from(Text::code(system))];
                row.extend(spec.metrics.iter().map(|metric| {
                    let mean = |name: &str| results.stat(name, None, sketch, metric).map(|s| s.mean);
                    let base = mean(baseline).filter(|_| system != baseline);
                    Entry::from(mean(system).map(|own| match base {
                        Some(base) => format!("{own:.4} ({:+.4})", own - base),
                        None => format!("{own:.4}"),
                    }))
                }));
                table = table.row(row);
            }
            findings.push(Finding::Table(table));
        }
        Ok(findings)
    }
}
