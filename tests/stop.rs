//! Every long call can be told to stop from another thread, and leaves nothing half written.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use monadnock::control::{Checkpoints, Control, Progress, Stop};
use monadnock::dem::bundled;
use monadnock::evaluate::{EvaluationConfig, evaluate};
use monadnock::extract::{ExtractionConfig, ridges_and_valleys_until};
use monadnock::grid::{Cell, Grid, Window};
use monadnock::interpolation::{NaturalNeighbours, biharmonic_until, harmonic_until};
use monadnock::seed::Seed;
use monadnock::sketch::{LineMap, samples};
use monadnock::style::{
    Exemplar, GeneratorConfig, Method, Recipe, Source, Style, StyleConfig, generators, learn, unseen_surface,
};
use monadnock::systems::task::{DetailUse, SampleUse};
use monadnock::{Error, Result};
use std::path::Path;
use std::time::Duration;

/// More steps than any test waits for.
const FOREVER: usize = 1_000_000;

/// Starts work that lasts much longer than a moment, and stops it after one.
fn stops<T>(what: &str, work: impl FnOnce(&Stop) -> Result<T>) {
    let stop = Stop::new();
    let ended = std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(60));
            stop.raise();
        });
        work(&stop)
    });
    assert!(matches!(ended, Err(Error::Stopped)), "{what} went on to its end, or failed");
}

fn source(side: usize) -> Source {
    Source::new("sierra", &bundled::load("sierra").unwrap(), Window::square(Cell::new(128, 128), side))
        .unwrap()
}

fn config(epochs: usize) -> StyleConfig {
    let mut config = StyleConfig::default();
    (config.model.epochs, config.model.extractions) = (epochs, 1);
    config
}

/// Learns under `stop`.
fn learned(recipe: &Recipe, side: usize, checkpoints: Option<Checkpoints>, stop: &Stop) -> Result<Style> {
    let mut quiet = |_: &Progress<'_>| ();
    let control = Control { checkpoints, stop: stop.clone(), ..Control::new(&mut quiet) };
    learn(&source(side), recipe, control)
}

fn with_patches() -> Style {
    let recipe = Recipe::network(&config(2), Seed(1)).unwrap().with_patches().unwrap();
    learned(&recipe, 64, None, &Stop::new()).unwrap()
}

fn with_generators(steps: usize) -> Recipe {
    let mut settings = GeneratorConfig::default();
    (settings.steps, settings.coarsest, settings.factor) = (steps, 16, 0.5);
    let mut recipe = Recipe::network(&config(2), Seed(1)).unwrap();
    recipe.detail = Some(generators(settings).unwrap());
    recipe
}

fn kept(path: &Path, resume: bool) -> Option<Checkpoints> {
    Some(Checkpoints { path: path.to_owned(), interval: Duration::ZERO, resume })
}

/// A few strokes on a map of that side, in metres.
fn strokes(side: usize) -> LineMap {
    samples::load("lambda-ring").unwrap().sketch.scaled_to(side, side).rasterize()
}

#[test]
fn trainings_stop_and_can_be_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.safetensors");
    let endless = Recipe::network(&config(FOREVER), Seed(1)).unwrap();
    // In the third step, however fast the machine is: a state is kept after each.
    let stop = Stop::new();
    let mut steps = 0;
    let mut watch = |_: &Progress<'_>| {
        steps += 1;
        if steps == 3 {
            stop.raise();
        }
    };
    let control = Control { checkpoints: kept(&path, false), stop: stop.clone(), ..Control::new(&mut watch) };
    assert!(matches!(learn(&source(64), &endless, control), Err(Error::Stopped)));
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["s.safetensors.gnn-checkpoint"], "the state, whole, and no style");
    let short = Recipe::network(&config(2), Seed(1)).unwrap();
    learned(&short, 64, kept(&path, true), &Stop::new()).unwrap();

    stops("training of generators", |stop| learned(&with_generators(FOREVER), 64, kept(&path, true), stop));
    let style = Style::load(&path).unwrap();
    assert!(style.detail.is_none(), "what was finished before can be used");
    let exemplar = Exemplar::new(&source(96), &ExtractionConfig::default(), Seed(1)).unwrap();
    stops("calibration", |stop| {
        let mut quiet = |_: &Progress<'_>| ();
        let control = Control { stop: stop.clone(), ..Control::new(&mut quiet) };
        unseen_surface(&*config(FOREVER).plan().unwrap(), &exemplar, control)
    });
}

#[test]
fn generation_and_detail_stop() {
    let style = with_patches();
    let (lines, range) = (strokes(768), style.origin.normalization);
    stops("generation", |stop| style.generate(&lines, &Method::default(), Some(range), Seed(1), stop));
    for (name, system) in style.uses() {
        stops(&name, |stop| system.generate(&lines, Seed(1), stop));
    }
    let dem = bundled::load("sierra").unwrap();
    let (patches, systems, config) = (vec![Cell::new(0, 0); 64], style.uses(), EvaluationConfig::default());
    stops("evaluation", |stop| evaluate(&dem, &patches, &systems, &config, Seed(1), stop, || ()));
    let map = Grid::from_fn(768, 768, |c| (c.row as f32 * 0.05).sin() * (c.col as f32 * 0.03).cos());
    let generated = learned(&with_generators(2), 64, None, &Stop::new()).unwrap();
    for (name, style) in [("patches", &style), ("generators", &generated)] {
        let detail = style.detail.as_ref().unwrap();
        stops(&format!("detail of {name}"), |stop| {
            detail.add(&map, None, None, &DetailUse::default(), Seed(1), stop)
        });
        stops(&format!("sample of {name}"), |stop| detail.sample(&SampleUse::new(1024, 1024), Seed(1), stop));
        stops(&format!("amplification by {name}"), |stop| {
            style.amplify(&dem, 4, &DetailUse::default(), Seed(1), stop)
        });
    }
}

#[test]
fn solvers_and_extraction_stop() {
    let lines = strokes(2048);
    let (mask, heights) = (lines.mask(), lines.heights().map(|z| f64::from(*z)));
    stops("membrane", |stop| harmonic_until(&mask, &heights, stop));
    stops("plate", |stop| biharmonic_until(&mask, &heights, stop));
    let diagram = NaturalNeighbours::new(&mask).unwrap();
    let values = vec![0.5; diagram.site_count()];
    stops("natural neighbours", |stop| diagram.interpolate_until(&values, stop));
    let terrain = Grid::from_fn(2048, 2048, |c| {
        let (y, x) = (c.row as f32 * 0.11, c.col as f32 * 0.07);
        y.sin() * x.cos() + 0.3 * (2.3 * x + y).sin()
    });
    let valid = terrain.map(|_| true);
    stops("extraction", |stop| {
        ridges_and_valleys_until(&terrain, &valid, &ExtractionConfig::default(), stop)
    });
}
