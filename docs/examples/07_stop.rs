//! Progress, a budget, and a stop from another thread: what an editor or a job server needs.
//!
//!     cargo run --release --example 07_stop
#![allow(clippy::print_stdout, reason = "an example says what it did")]

use monadnock::dem::bundled;
use monadnock::style::StyleConfig;
use monadnock::{Cell, Control, Error, Progress, Recipe, Result, Seed, Source, Stop, Window, learn};
use std::time::{Duration, Instant};

fn main() -> Result<()> {
    let dem = bundled::load("sierra")?;
    let source = Source::new("sierra", &dem, Window::square(Cell::new(0, 0), 128))?;
    let mut config = StyleConfig::default();
    config.model.epochs = 1_000_000;
    let recipe = Recipe::network(&config, Seed(1))?;

    // Somebody presses "stop" after half a second.
    let stop = Stop::new();
    let from_outside = stop.clone();
    let button = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(500));
        from_outside.raise();
        Instant::now()
    });
    let mut last = 0;
    let mut watch = |now: &Progress<'_>| last = now.step;
    let ended = learn(&source, &recipe, Control { stop, ..Control::new(&mut watch) });
    let pressed = button.join().expect("the thread only sleeps");
    assert!(matches!(ended, Err(Error::Stopped)));
    println!("stopped in epoch {last}, {:.0} ms after the button", 1e3 * pressed.elapsed().as_secs_f64());

    // A budget ends a training with the best style so far.
    let mut quiet = |_: &Progress<'_>| ();
    let control = Control { budget: Some(Duration::from_secs(2)), ..Control::new(&mut quiet) };
    let style = learn(&source, &recipe, control)?;
    println!("a style after two seconds: {} epochs", style.network()?.training().epochs);
    Ok(())
}
