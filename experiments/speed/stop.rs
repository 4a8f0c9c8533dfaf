//! How long each call goes on after it was told to stop.
//!
//!     cargo bench --bench stop            # maps of 512x512 cells
//!     cargo bench --bench stop -- 1024    # another side
//!
//! Every call is stopped at several moments of its run; printed are how long it takes when nobody stops it (or "-" where it has no
//! end) and the longest time from the stop to the return. Bias: other work on the machine counts.
#![allow(clippy::print_stdout, reason = "a benchmark prints")]

use monadnock::control::{Control, Progress, Stop};
use monadnock::dem::bundled;
use monadnock::grid::{Cell, Grid, Window};
use monadnock::seed::Seed;
use monadnock::sketch::{LineMap, samples};
use monadnock::style::{GeneratorConfig, Recipe, Registry, Source, Style, StyleConfig, generators, learn};
use monadnock::systems::task::{DetailUse, SampleUse};
use monadnock::{Dem, Error, ExtractionConfig, Normalization, Result};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Moments at which a call is stopped, as shares of its run.
const MOMENTS: [f64; 8] = [0.02, 0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 0.95];
/// The run that is assumed of a call without an end.
const ENDLESS: Duration = Duration::from_secs(3);

fn main() -> Result<()> {
    let side = std::env::args().find_map(|a| a.parse::<usize>().ok()).unwrap_or(512);
    println!("{side}x{side} cells\n{:36} {:>10} {:>12}", "call", "run, ms", "stop, ms");
    let dem = bundled::load("sierra")?;
    let source = Source::new("sierra", &dem, Window::square(Cell::new(128, 128), 128))?;

    let mut endless = StyleConfig::default();
    endless.model.epochs = 1_000_000;
    let learned = |recipe: &Recipe, source: &Source, stop: &Stop| {
        learn(source, recipe, Control { stop: stop.clone(), ..Control::new(&mut |_: &Progress<'_>| ()) })
    };
    let network = Recipe::network(&endless, Seed(1))?;
    measure("learn: network", None, |stop| learned(&network, &source, stop));
    let mut short = StyleConfig::default();
    short.model.epochs = 2;
    let mut slow = Recipe::network(&short, Seed(1))?;
    let mut settings = GeneratorConfig::default();
    settings.steps = 1_000_000;
    slow.detail = Some(generators(settings)?);
    measure("learn: generators", None, |stop| learned(&slow, &source, stop));
    let patches = Recipe::network(&short, Seed(1))?.with_patches()?;
    measure("learn: patches", Some(()), |stop| learned(&patches, &source, stop));
    let whole = Source::whole("sierra", &dem)?;
    let drawings = Recipe::network(&short, Seed(1))?.with_systems_for_drawings()?;
    measure("learn: landscape and synthesis", Some(()), |stop| learned(&drawings, &whole, stop));

    let all = Recipe::network(&short, Seed(1))?.with_systems_for_drawings()?.with_patches()?;
    let style = learn(&source, &all, Control::new(&mut |_: &Progress<'_>| ()))?;
    let drawn = samples::load("lambda-ring")?.sketch.scaled_to(side, side).rasterize();
    let map =
        Grid::from_fn(side, side, |c| dem.heights()[Cell::new(c.row % dem.shape().0, c.col % dem.shape().1)]);
    let map = Dem::new(map, dem.cell_size())?;
    let range = Normalization::of(&map);
    let unit = range.normalize(&map);
    let extraction = ExtractionConfig::default();
    measure("extract", Some(()), |stop| {
        monadnock::extract::ridges_and_valleys_until(&unit, map.valid(), &extraction, stop)
    });
    let dense = monadnock::ridges_and_valleys(&unit, map.valid(), &extraction)?;
    for (kind, lines) in [("few strokes", &drawn), ("dense lines", &dense)] {
        systems(kind, &style, lines);
    }
    if let Some(detail) = &style.detail {
        let (how, sample) = (DetailUse::default(), SampleUse::new(side, side));
        measure("detail: patches", Some(()), |stop| detail.add(&unit, None, None, &how, Seed(1), stop));
        measure("sample: patches", Some(()), |stop| detail.sample(&sample, Seed(1), stop));
        let coarse = map.crop(Window::square(Cell::new(0, 0), side / 4))?;
        measure("amplify: patches, x4", Some(()), |stop| style.amplify(&coarse, 4, &how, Seed(1), stop));
    }
    Ok(())
}

fn systems(kind: &str, style: &Style, lines: &LineMap) {
    for (name, system) in Registry::default().all(style) {
        measure(&format!("{name}: {kind}"), Some(()), |stop| system.generate(lines, Seed(1), stop));
    }
}

/// A call with its end, or without one.
fn measure<T: Send>(name: &str, end: Option<()>, work: impl Fn(&Stop) -> Result<T> + Sync) {
    let run = match end {
        Some(()) => {
            let start = Instant::now();
            if let Err(error) = work(&Stop::new()) {
                println!("{name:36} fails: {error}");
                return;
            }
            start.elapsed()
        }
        None => ENDLESS,
    };
    let mut longest = Duration::ZERO;
    for share in MOMENTS {
        let stop = Stop::new();
        let (told, when) = mpsc::channel();
        let button = stop.clone();
        let ended = std::thread::scope(|scope| {
            scope.spawn(move || {
                std::thread::sleep(run.mul_f64(share));
                button.raise();
                told.send(Instant::now())
            });
            let ended = work(&stop);
            (ended, Instant::now())
        });
        // What ended before it was told is no measurement.
        if let ((Err(Error::Stopped), end), Ok(at)) = (ended, when.recv()) {
            longest = longest.max(end.saturating_duration_since(at));
        }
    }
    let run = end.map_or("-".to_owned(), |()| format!("{:.0}", 1e3 * run.as_secs_f64()));
    println!("{name:36} {run:>10} {:>12.1}", 1e3 * longest.as_secs_f64());
}
