//! Every kind of experiment from the outside, by its quick twin: rows, bounds, tables beside the scores, pictures, plots.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::experiment::areas::Terrain;
use crate::experiment::documents::{self, Form};
use crate::experiment::record::Record;
use crate::experiment::resolve::resolve;
use crate::experiment::rows::ScoreTable;
use crate::experiment::run::{RunOptions, run};
use crate::experiment::{ExperimentSpec, bounds, report};
use crate::viz::Picture;
use std::fs;
use std::path::Path;

/// A run of a quick twin.
struct Ran {
    folder: tempfile::TempDir,
    record: Record,
    scores: ScoreTable,
    page: String,
}

impl Ran {
    fn new(name: &str) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let spec = ExperimentSpec::read(&root.join(format!("experiments/quick/{name}.toml"))).unwrap();
        let resolved = resolve(&spec, &Terrain::default()).unwrap();
        // Nothing is left open: what a record holds can be run again.
        assert_eq!(resolve(&resolved.spec, &Terrain::default()).unwrap().spec, resolved.spec, "{name}");
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().to_owned();
        let outcome =
            run(&resolved, &RunOptions { out: out.clone(), jobs: 2, restart: false, styles: None }, &|_| {})
                .unwrap();
        let record = Record::new(&out);
        let scores = record.scores().unwrap();
        let failed: Vec<_> = scores.rows.iter().filter(|row| !row.error.is_empty()).collect();
        assert!(outcome.rows > 0 && failed.is_empty(), "{name}: {failed:?}");
        for verdict in bounds::check(&record.spec().unwrap(), &scores).unwrap() {
            assert!(verdict.is_kept(), "{name}: {verdict}");
        }
        let page = fs::read_to_string(report::write(&record).unwrap()).unwrap();
        Self { folder, record, scores, page }
    }

    /// The mean of a score over the rows of a system and sketch.
    fn mean(&self, system: &str, sketch: &str, metric: &str) -> f64 {
        let column = self.scores.column(metric).unwrap_or_else(|| panic!("no score {metric}"));
        let rows = self.scores.rows.iter().filter(|r| r.key.system == system && r.key.sketch == sketch);
        let values: Vec<f64> = rows.filter_map(|r| r.values[column]).collect();
        assert!(!values.is_empty(), "{system}, {sketch}: no {metric}");
        values.iter().sum::<f64>() / values.len() as f64
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.folder.path().join(name)).unwrap()
    }

    /// Pictures and plots by name.
    fn files(&self, folder: &str) -> Vec<String> {
        let files = self.record.list(folder).unwrap();
        files.iter().map(|p| p.file_name().unwrap().to_string_lossy().into_owned()).collect()
    }

    /// A picture that is not of one colour.
    fn picture(&self, name: &str) -> Picture {
        let bytes = fs::read(self.folder.path().join("pictures").join(name)).unwrap();
        let picture = Picture::from_png(&bytes).unwrap();
        let pixels = picture.pixels().as_slice();
        let colours: std::collections::HashSet<_> = pixels.iter().map(|c| (c.r, c.g, c.b)).collect();
        assert!(colours.len() > 500, "{name}: {} colours", colours.len());
        picture
    }
}

#[test]
fn every_patch_is_the_exemplar_once() {
    let ran = Ran::new("exemplar");
    let areas: std::collections::BTreeSet<&str> =
        ran.scores.rows.iter().map(|r| r.key.area.as_str()).collect();
    let expected = ["sierra-0-0", "sierra-0-128", "sierra-128-0", "sierra-128-128"];
    assert_eq!(areas.into_iter().collect::<Vec<_>>(), expected);
    let known = ran.text("exemplars.csv");
    assert_eq!(known.lines().count(), 5, "{known}");
    let tables = documents::of_record(&ran.record, Form::Markdown).unwrap();
    for words in ["| sierra | 4 |", "standard deviation", "relief_m", "rank correlation"] {
        assert!(tables.contains(words), "{words:?} is missing in: {tables}");
    }
    assert!(
        ran.page.contains("What tells a good exemplar")
            && ran.files("plots").contains(&"exemplars.svg".to_owned())
    );
}

#[test]
fn every_style_meets_every_sketch() {
    let ran = Ran::new("exchange");
    let mut pairs: Vec<(&str, &str)> = ran
        .scores
        .rows
        .iter()
        .filter(|r| r.key.system == "anchored")
        .map(|r| (r.key.area.as_str(), r.key.sketch.as_str()))
        .collect();
    pairs.sort_unstable();
    let [a, b] = ["grand-canyon", "sierra"];
    assert_eq!(pairs, [(a, a), (a, b), (b, a), (b, b)]);
    // The patch is that of the sketch's area: a row of both styles with the same relief and lines.
    let of = |area: &str| {
        let row = ran.scores.rows.iter().find(|r| r.key.area == area && r.key.sketch == b).unwrap();
        (row.key.row, row.key.col, row.relief, row.line_share)
    };
    assert_eq!(of(a), of(b));
    // An interpolator knows no style, but what it is held against does.
    let column = ran.scores.column("style_slope_ratio").unwrap();
    let value = |area: &str, metric: usize| {
        let of = |r: &&crate::experiment::rows::ScoreRow| {
            (r.key.system.as_str(), r.key.area.as_str(), r.key.sketch.as_str())
                == ("natural-neighbour", area, b)
        };
        ran.scores.rows.iter().find(of).unwrap().values[metric].unwrap()
    };
    assert!(value(a, column) != value(b, column));
    let ssim = ran.scores.column("ssim").unwrap();
    assert_eq!(value(a, ssim), value(b, ssim));
    let sheet = ran.picture("exchange.png");
    assert!(sheet.rows() > 4 * 256 && sheet.cols() > 3 * 256);
}

#[test]
fn drawings_are_made_in_variants() {
    let ran = Ran::new("drawings");
    let [plain, random] = ["lambda-ring", "lambda-ring, 40 random"];
    assert_eq!(ran.mean("natural-neighbour", plain, "diversity"), 0.0, "one drawing, no chance");
    assert!(ran.mean("natural-neighbour", random, "diversity") > 0.05, "other random lines");
    assert!(ran.mean("anchored", plain, "stroke_height_error") < 1e-3);
    let shares = |sketch: &str| ran.scores.rows.iter().find(|r| r.key.sketch == sketch).unwrap().line_share;
    assert!(shares(random) > 2.0 * shares(plain));
    assert_eq!(ran.files("pictures"), ["sierra-lambda-ring.png"]);
    let sheet = ran.picture("sierra-lambda-ring.png");
    assert!(sheet.rows() > 2 * 256 && sheet.cols() > 5 * 256, "two rows of lines and four variants");
}

#[test]
fn random_lines_are_scored_and_shown() {
    let ran = Ran::new("random");
    let rough = |sketch: &str| ran.mean("natural-neighbour", sketch, "roughness");
    assert!(rough("lambda-ring, 40 random") > rough("lambda-ring"));
    ran.picture("grand-canyon-lambda-ring.png");
}

#[test]
fn partial_sketches_lose_strokes() {
    let ran = Ran::new("partial");
    let share = |sketch: &str| ran.scores.rows.iter().find(|r| r.key.sketch == sketch).unwrap().line_share;
    assert!(share("1 longest") < share("8 longest") && share("8 longest") < share("all strokes"));
    assert!(ran.mean("anchored", "1 longest", "psnr") < ran.mean("anchored", "all strokes", "psnr"));
    let sheet = ran.files("pictures").into_iter().find(|name| name.contains("sketches")).unwrap();
    ran.picture(&sheet);
}

#[test]
fn quarter_turns_with_the_same_parts_are_exact() {
    let ran = Ran::new("invariance");
    let max = |system: &str, sketch: &str| ran.mean(system, sketch, "max_difference");
    assert!(max("quiet", "turned 90, same parts") < 1e-4);
    assert!(max("quiet-projection", "mirrored, same parts") < 1e-4);
    // The local frame tells left from right.
    assert!(max("quiet", "mirrored, same parts") > max("quiet-projection", "mirrored, same parts"));
    // What does not hold is not called exact: parts that are cut anew, angles between.
    assert!(max("quiet", "turned 90") > 1e-4 && max("quiet", "turned 45") > 1e-3);
    assert!(max("natural-neighbour", "turned 90") < 1e-4, "the interpolator has no parts");
    assert_eq!(max("natural-neighbour", "another seed"), 0.0);
    ran.picture("sierra-moved.png");
}

#[test]
fn region_states_are_scored_and_drawn() {
    let ran = Ran::new("disentanglement");
    let (pure, chance) =
        (ran.mean("anchored", "dense", "kind_purity"), ran.mean("anchored", "dense", "chance_purity"));
    // Of a network that is hardly trained the states mix as by chance.
    assert!((pure - chance).abs() < 0.1 && (0.4..0.7).contains(&chance), "{pure} {chance}");
    let states = ran.text("states.csv");
    let regions = ran.mean("anchored", "dense", "regions");
    assert_eq!(states.lines().count(), 1 + regions as usize);
    assert!(states.contains(",ridge,") && states.contains(",valley,"));
    assert!(ran.page.contains("t-SNE") && ran.files("plots").iter().any(|name| name.starts_with("states-")));
}

#[test]
fn coarser_cells_are_means() {
    let ran = Ran::new("resolution");
    let tables = documents::of_record(&ran.record, Form::Markdown).unwrap();
    assert!(tables.contains("| sierra-1x |") && tables.contains("| sierra-2x |"), "{tables}");
    let resolved = resolve(&ran.record.spec().unwrap(), &Terrain::default()).unwrap();
    let (fine, coarse) = (&resolved.areas[0].dem, &resolved.areas[1].dem);
    assert_eq!((coarse.shape().0 * 2, coarse.cell_size().x()), (fine.shape().0, fine.cell_size().x() * 2.0));
    let z = |row, col| f64::from(fine.heights()[crate::grid::Cell::new(row, col)]);
    let mean = (z(10, 20) + z(10, 21) + z(11, 20) + z(11, 21)) / 4.0;
    assert!((f64::from(coarse.heights()[crate::grid::Cell::new(5, 10)]) - mean).abs() < 1e-3);
}

#[test]
fn stages_are_timed_and_peers_join() {
    let ran = Ran::new("cost");
    let stages = ran.text("stages.csv");
    for stage in ["extraction", "parts and graph", "an epoch", "a training", "a terrain of 128x128 cells"] {
        assert!(stages.contains(stage), "{stage}: {stages}");
    }
    let seconds = |stage: &str| -> f64 {
        let line = stages.lines().find(|l| l.starts_with(stage)).unwrap();
        line.split(',').nth(3).unwrap().parse().unwrap()
    };
    assert!(seconds("an epoch") > 0.0 && seconds("a training") > seconds("an epoch"));
    assert!(!ran.text("scores.csv").contains("seconds"), "scores are the same bytes in every run");
    let peers = ran.folder.path().join("theirs.csv");
    fs::write(&peers, "stage,system,n,seconds,peak_memory_mb\nan epoch,PyTorch plain,3,1.25,900\n").unwrap();
    ran.record.add_peers(&peers).unwrap();
    let page = fs::read_to_string(report::write(&ran.record).unwrap()).unwrap();
    assert!(page.contains("PyTorch plain") && !ran.page.contains("PyTorch plain"));
    fs::write(&peers, "stage,seconds\n").unwrap();
    let message = ran.record.add_peers(&peers).unwrap_err().to_string();
    assert!(message.contains("theirs.csv") && message.contains("peak_memory_mb"), "{message}");
}

#[test]
fn lengths_of_parts_are_compared() {
    let ran = Ran::new("parts");
    let [short, long] = ["cells-5-10", "cells-15-20"].map(|s| ran.mean(s, "dense", "psnr"));
    assert!(short != long);
    assert!(
        documents::of_record(&ran.record, Form::Markdown).unwrap().contains("the difference to `cells-5-10`")
    );
}

#[test]
fn printed_numbers_and_losses_stand_in_the_report() {
    let ran = Ran::new("neighbours");
    assert!(ran.files("plots").contains(&"printed-grand-canyon-psnr.svg".to_owned()));
    assert!(ran.text("plots/printed-grand-canyon-psnr.svg").contains("Table 1: 15.81"));
    let tables = documents::of_record(&ran.record, Form::Markdown).unwrap();
    assert!(tables.contains("An interpolator has the higher PSNR"), "{tables}");
    let lost = ran.page.contains("An interpolator has the higher PSNR");
    // Whether there is a patch to list hangs on a training of seconds.
    let is_none_lost = ran.page.contains("on 0 of ");
    assert!(lost && ran.page.contains("error in the border") != is_none_lost);
}

#[test]
fn keys_of_other_kinds_are_refused() {
    let base = "title = 't'\nquestion = 'q'\nseeds = [1]\nbudget_minutes = 1\nmetrics = ['ssim']\n[[style]]\nname = 'one'\n\
                [[area]]\nname = 'sierra'\n";
    let drawing = base.replace("ssim", "diversity");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("e.toml");
    let refused = |text: String, words: &[&str]| {
        fs::write(&path, text).unwrap();
        let message = ExperimentSpec::read(&path).unwrap_err().to_string();
        words.iter().for_each(|word| assert!(message.contains(word), "{word:?} is missing in: {message}"));
    };
    let sketch = |kind: &str, base: &str, keys: &str| {
        format!("kind = '{kind}'\n{base}[[sketch]]\nname = 's'\n{keys}\n")
    };
    refused(sketch("neighbours", base, "turn = 90.0"), &["turn", "invariance"]);
    refused(sketch("neighbours", base, "drawing = 'meander'"), &["drawing", "drawings"]);
    refused(sketch("neighbours", base, "strokes = 0"), &["strokes", "at least 1"]);
    refused(sketch("exchange", base, ""), &["sketches", "exchange"]);
    refused(sketch("drawings", &drawing, "drawing = 'omega'"), &["omega", "lambda-ring"]);
    refused(sketch("drawings", &drawing, "drawing = 'meander'\norder = 3"), &["order", "drawing"]);
    refused(format!("kind = 'drawings'\n{drawing}"), &["drawings", "at least one drawing"]);
    let moved = base.replace("ssim", "max_difference");
    refused(sketch("invariance", &moved, "turn = 400.0"), &["turn", "-360 to 360"]);
    refused(sketch("invariance", &moved, "turn = 30.0\nsame_parts = true"), &["same_parts", "90 degrees"]);
    refused(sketch("invariance", &moved, "shift = [80, 0]"), &["shift", "-64 to 64"]);
    refused(format!("kind = 'neighbours'\n{base}coarser = 0\n"), &["coarser", "1 to 64"]);
    let states =
        base.replace("ssim", "kind_purity").replace("[[style]]", "interpolators = ['all']\n[[style]]");
    refused(format!("kind = 'disentanglement'\n{states}"), &["interpolators", "disentanglement"]);
}
