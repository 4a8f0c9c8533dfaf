//! Every test patch is rebuilt from its lines by every system (Liu & Benes 2025, 7.2: Figs. 8, 9, Table 1).

use super::losses;
use crate::error::Result;
use crate::experiment::protocol::{Finding, Protocol};
use crate::experiment::record::Record;
use crate::experiment::results::{Results, better, of_patches};
use crate::viz::report::{Column, Entry, Table, Text};

pub(super) struct Neighbours;

impl Protocol for Neighbours {
    fn findings(&self, results: &Results<'_>, _: &Record) -> Result<Vec<Finding>> {
        Ok([areas(results), losses::findings(results)].concat())
    }
}

/// A table for each sketch, a row for each area: SSIM / PSNR of the best interpolator and of every style's systems.
pub(super) fn areas(results: &Results<'_>) -> Vec<Finding> {
    let systems = results.style_systems();
    let with_best = !results.interpolators().is_empty();
    let mut findings = Vec::new();
    for sketch in &results.sketches {
        let mut heads = vec![Column::text("area"), Column::text("patches")];
        heads.extend(with_best.then(|| Column::text("best interpolator")));
        heads.extend(systems.iter().map(|&s| Column::text(Text::code(s))));
        let caption =
            format!("Sketch \"{sketch}\", SSIM / PSNR in dB, mean over patches and {}:", results.seeds());
        let mut table = Table::new(heads).caption(caption);
        for area in results.areas() {
            let best = |metric: &str| results.best_interpolator(area, sketch, metric);
            let patches = area.map_or_else(String::new, |area| {
                let of = |s: &&str| of_patches(&results.cells(s, area, sketch, "ssim")).len();
                systems.iter().map(of).max().unwrap_or(0).to_string()
            });
            let mut row = vec![Entry::from(area.unwrap_or("mean of areas")), Entry::from(patches)];
            row.extend(with_best.then(|| {
                let both = best("ssim").zip(best("psnr"));
                Entry::from(both.map(|(s, p)| format!("{:.4} ({}) / {:.2} ({})", s.1, s.0, p.1, p.0)))
            }));
            for system in &systems {
                let add = |text: Text, metric: &str, digits: usize| {
                    let Some(stat) = results.stat(system, area, sketch, metric) else {
                        return text.and("-", false);
                    };
                    let wins = best(metric).is_some_and(|(_, value)| better(metric, stat.mean, value));
                    text.and(format!("{:.digits$}", stat.mean), wins)
                };
                row.push(Entry::from(add(add(Text::default(), "ssim", 4).and(" / ", false), "psnr", 2)));
            }
            table = table.row(row);
        }
        findings.push(Finding::Table(table));
    }
    if with_best {
        findings.push(Finding::Words("Bold: above every interpolator's mean.".to_owned()));
    }
    findings
}
