//! Hand-drawn sketches that come with the program, 128x128 cells, heights normalised to 0 to 1.
//!
//! `lambda-ring` is the drawing of Liu & Benes 2025 (Fig. 5): a ridge like a lambda inside a closed ring of valleys. The
//! files and the script that drew them are in `data/sketches`.

use super::geojson::{ReadOptions, SketchReading, parse};
use crate::error::{Error, Result};

const SAMPLES: [(&str, &str); 11] = [
    ("a-circle", include_str!("../../data/sketches/a-circle.geojson")),
    ("empty-corner", include_str!("../../data/sketches/empty-corner.geojson")),
    ("fault-line", include_str!("../../data/sketches/fault-line.geojson")),
    ("lambda-ring", include_str!("../../data/sketches/lambda-ring.geojson")),
    ("meander", include_str!("../../data/sketches/meander.geojson")),
    ("p-valley", include_str!("../../data/sketches/p-valley.geojson")),
    ("range-and-river", include_str!("../../data/sketches/range-and-river.geojson")),
    ("single-stroke", include_str!("../../data/sketches/single-stroke.geojson")),
    ("three-peaks", include_str!("../../data/sketches/three-peaks.geojson")),
    ("valley-system", include_str!("../../data/sketches/valley-system.geojson")),
    ("volcano-ring", include_str!("../../data/sketches/volcano-ring.geojson")),
];

/// The names that [`load`] knows, in alphabetical order.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    SAMPLES.iter().map(|(name, _)| *name)
}

/// The sample called `name`, with its heights in 0 to 1.
///
/// # Errors
/// When there is no sample of that name.
pub fn load(name: &str) -> Result<SketchReading> {
    parse(text(name)?, &ReadOptions::default())
}

/// The GeoJSON text of the sample called `name`, to be written out as an example.
///
/// # Errors
/// When there is no sample of that name.
pub(crate) fn text(name: &str) -> Result<&'static str> {
    let sample = SAMPLES.iter().find(|(known, _)| *known == name);
    let allowed = || format!("allowed: {}", names().collect::<Vec<_>>().join(", "));
    Ok(sample.ok_or_else(|| Error::value("sample sketch", name, allowed()))?.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::sketch::geojson::HeightUnit;
    use crate::sketch::{PartLengths, SketchGraph, StrokeKind, split_parts};

    #[test]
    fn every_sample_is_a_clean_sketch() {
        for name in names() {
            let reading = load(name).unwrap();
            let clipped = name == "meander"; // its river enters and leaves the map
            assert_eq!(reading.warnings.len(), usize::from(clipped), "{name}: {:?}", reading.warnings);
            assert_eq!(reading.unit, HeightUnit::Normalised);
            assert_eq!((reading.sketch.rows, reading.sketch.cols), (128, 128));
            let (low, high) = reading.sketch.height_range().unwrap();
            assert!(low >= 0.0 && high <= 1.0 && high - low > 0.3, "{name}: {low} to {high}");
            let lines = reading.sketch.rasterize();
            let parts = split_parts(&lines, PartLengths::drawn(), Seed(1));
            assert_eq!(parts.iter().map(|p| p.cells.len()).sum::<usize>(), lines.line_count());
            let mean = |kind| {
                let z: Vec<f32> =
                    parts.iter().filter(|p| p.kind == kind).flat_map(|p| p.heights.clone()).collect();
                z.iter().sum::<f32>() / z.len().max(1) as f32
            };
            let has_both = !["single-stroke", "valley-system"].contains(&name);
            assert!(!has_both || mean(StrokeKind::Ridge) > mean(StrokeKind::Valley) + 0.2, "{name}");
        }
    }

    #[test]
    fn the_lambda_stands_inside_a_closed_ring() {
        let sketch = load("lambda-ring").unwrap().sketch;
        let graph = SketchGraph::of_sketch(&sketch);
        let ring: Vec<_> = graph.edges(StrokeKind::Valley).collect();
        assert_eq!(ring.len(), 1);
        assert_eq!(ring[0].cells.first(), ring[0].cells.last(), "closed");
        assert_eq!(graph.stream_counts(StrokeKind::Ridge), [2, 1], "two legs meet below the highest end");
    }

    #[test]
    fn the_river_runs_down() {
        let sketch = load("meander").unwrap().sketch;
        let river = &sketch.strokes[0].vertices;
        assert!(river.windows(2).all(|w| w[1].z <= w[0].z));
        let orders = SketchGraph::of_sketch(&sketch);
        assert_eq!(orders.stream_counts(StrokeKind::Valley), [6, 1], "a source and five brooks");
    }

    #[test]
    fn an_unknown_name_gets_the_list() {
        let message = load("omega").unwrap_err().to_string();
        assert!(message.contains("omega") && message.contains("lambda-ring, meander"), "{message}");
    }
}
