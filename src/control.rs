//! How long work is watched, bounded, kept and stopped: one [`Control`] for everything that takes more than a moment.
//!
//! Whoever starts the work holds a clone of its [`Stop`] and may ask for the end from any thread. The work polls it every few
//! milliseconds and ends with [`Error::Stopped`]; what it would have written is then not written.

use crate::error::{Error, Result};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A flag by which work is asked to end. Clones are the same flag.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// A flag of its own, not raised.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks all work with this flag to end.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the work is to end: for loops that cannot fail and leave their result to be thrown away.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// The end of the work, when it is asked for.
    ///
    /// # Errors
    /// [`Error::Stopped`] after [`raise`](Self::raise).
    pub fn check(&self) -> Result<()> {
        if self.is_raised() { Err(Error::Stopped) } else { Ok(()) }
    }
}

/// Where an unfinished training is kept.
#[derive(Clone, Debug)]
pub struct Checkpoints {
    /// The file; replaced as a whole each time.
    pub path: PathBuf,
    /// Time between two checkpoints: what a kill can cost at most.
    pub interval: Duration,
    /// Continue from the file, where there is one.
    pub resume: bool,
}

/// A part of the work on a style.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The training of the coarse system of that name.
    Coarse(&'static str),
    /// The measurement of what a coarse system leaves open in terrain that it has not seen.
    Calibration,
    /// The training of the detail of that name.
    Detail(&'static str),
}

/// What a long call says of itself.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// What is being done.
    pub stage: Stage,
    /// Steps done.
    pub step: usize,
    /// Steps in all; an estimate where a budget decides.
    pub steps: usize,
    /// Share of the stage's work that is done, 0 to 1.
    pub share: f64,
    /// Seconds of the stage, those before a resumption included.
    pub seconds: f64,
    /// Figures of this step by name, such as its losses.
    pub figures: &'a [(&'static str, f64)],
}

impl Progress<'_> {
    /// A figure of this step.
    #[must_use]
    pub fn figure(&self, name: &str) -> Option<f64> {
        self.figures.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }
}

/// Hears of every step.
pub(crate) type Watch<'a> = dyn FnMut(&Progress<'_>) + 'a;

/// How a training is watched, bounded, kept and stopped.
pub struct Control<'a> {
    /// Hears of every step.
    pub progress: &'a mut Watch<'a>,
    /// Time for all of it: schedules follow the clock, and numbers of steps in configurations are not looked at. How many
    /// steps fit depends on the machine.
    pub budget: Option<Duration>,
    /// Where the state is kept meanwhile.
    pub checkpoints: Option<Checkpoints>,
    /// Ends the work.
    pub stop: Stop,
}

impl<'a> Control<'a> {
    /// No budget, no checkpoints, a flag that nobody else holds.
    pub fn new(progress: &'a mut Watch<'a>) -> Self {
        Self { progress, budget: None, checkpoints: None, stop: Stop::new() }
    }
}

/// What `work` gives; a fault of ours in one cell of a long run is that cell's error and not the end of all.
pub(crate) fn without_panic<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
        let found = format!("a panic ({})", text.unwrap_or_else(|| "without a word".to_owned()));
        Err(Error::value("state of the program", found, "a fault of monadnock: please report it"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raised_flag_is_seen_by_its_clones_alone() {
        let (stop, other) = (Stop::new(), Stop::new());
        let clone = stop.clone();
        clone.check().unwrap();
        std::thread::spawn(move || stop.raise()).join().unwrap();
        assert!(matches!(clone.check(), Err(Error::Stopped)));
        other.check().unwrap();
    }
}
