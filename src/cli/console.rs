//! What the program shows: reports on standard output, warnings and progress on standard error.
//!
//! The only place that prints. A reader that stops listening (`monadnock info x | head -1`) is no failure; a report
//! that cannot be written for any other reason (a full disk) is, but only after the work is done.

use crate::error::{Error, Result};
use crate::viz::duration;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Where a verb reports what it did and how far it is.
pub(super) struct Console {
    quiet: bool,
    bars: MultiProgress,
    /// The first failure to write to standard output.
    failure: OnceLock<std::io::Error>,
}

impl Console {
    pub(super) fn new(quiet: bool) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        Self { quiet, bars: MultiProgress::with_draw_target(target), failure: OnceLock::new() }
    }

    /// A line of the report, on standard output; nothing when quiet.
    pub(super) fn line(&self, text: impl AsRef<str>) {
        if !self.quiet {
            self.result(format!("{}\n", text.as_ref()));
        }
    }

    /// A thing noticed that is no failure, on standard error; nothing when quiet.
    pub(super) fn warning(&self, text: impl AsRef<str>) {
        if !self.quiet {
            self.bars.suspend(|| to_stderr(&format!("warning: {}\n", text.as_ref())));
        }
    }

    /// What the user asked to be printed, as it is, on standard output; even when quiet.
    pub(super) fn result(&self, text: impl AsRef<str>) {
        let mut out = std::io::stdout().lock();
        let written =
            self.bars.suspend(|| out.write_all(text.as_ref().as_bytes()).and_then(|()| out.flush()));
        if let Err(error) = written
            && error.kind() != ErrorKind::BrokenPipe
        {
            // Only the first one counts: the others follow from it.
            let _ = self.failure.set(error);
        }
    }

    /// A bar with the time left for `total` steps of what `label` names; on a standard error that is no terminal, a line
    /// at most every tenth of the way; nothing when quiet. It goes away when it is dropped.
    pub(super) fn progress(&self, total: u64, label: &str) -> Progress {
        let bar = self.bars.add(ProgressBar::new(total));
        let template = "{prefix} [{bar:30}] {pos}/{len}, {eta} left  {wide_msg}";
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style.progress_chars("=> "));
        bar.set_prefix(label.to_owned());
        bar.tick();
        let plain = !self.quiet && !std::io::stderr().is_terminal();
        let log = plain.then(|| Log { label: label.to_owned(), told: Mutex::new(Milestones::new(total)) });
        Progress { bar, total, done: AtomicU64::new(0), started: Instant::now(), log }
    }

    /// Tells whether everything could be printed.
    ///
    /// # Errors
    /// When standard output failed.
    pub(super) fn finish(&self) -> Result<()> {
        match self.failure.get() {
            None => Ok(()),
            Some(e) => {
                let copy = std::io::Error::new(e.kind(), e.to_string());
                Err(Error::io(Path::new("standard output"), "write the report")(copy))
            }
        }
    }
}

/// Prints the error that ends the program.
pub(super) fn print_error(error: &Error) {
    to_stderr(&format!("error: {error}\n"));
}

fn to_stderr(text: &str) {
    // There is no other place left to complain.
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// How far a long step is. May be told from any thread.
pub(super) struct Progress {
    bar: ProgressBar,
    total: u64,
    done: AtomicU64,
    started: Instant,
    log: Option<Log>,
}

struct Log {
    label: String,
    told: Mutex<Milestones>,
}

impl Progress {
    /// `steps` more are done.
    pub(super) fn advance(&self, steps: u64) {
        let done = self.done.fetch_add(steps, Ordering::Relaxed) + steps;
        self.show(done);
    }

    /// As many steps are done as that, unless more are already; told from one thread.
    pub(super) fn reach(&self, done: u64) {
        self.advance(done.min(self.total).saturating_sub(self.done.load(Ordering::Relaxed)));
    }

    /// Figures to show beside the bar ("loss 0.0123").
    pub(super) fn note(&self, text: impl Into<String>) {
        self.bar.set_message(text.into());
    }

    fn show(&self, done: u64) {
        self.bar.set_position(done);
        let Some(log) = &self.log else { return };
        let elapsed = self.started.elapsed();
        let mut told = log.told.lock().unwrap_or_else(PoisonError::into_inner);
        if told.reaches_next(done, elapsed) {
            let (all, note) = (self.total, self.bar.message());
            let left = elapsed.mul_f64(all.saturating_sub(done) as f64 / done.max(1) as f64);
            let note = if note.is_empty() { String::new() } else { format!("; {note}") };
            let (label, left) = (&log.label, duration(left));
            to_stderr(&format!(
                "{label}: {done} of {all}, {} so far, {left} left{note}\n",
                duration(elapsed)
            ));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Which tenths of the way have been told, so that a log stays short.
struct Milestones {
    total: u64,
    tenths: u64,
    last: Duration,
}

impl Milestones {
    /// Steps that are over sooner need no word.
    const PAUSE: Duration = Duration::from_secs(3);

    fn new(total: u64) -> Self {
        Self { total, tenths: 0, last: Duration::ZERO }
    }

    /// Whether a new tenth is reached, not too soon after the last one that was told.
    fn reaches_next(&mut self, done: u64, elapsed: Duration) -> bool {
        let tenths = (u128::from(done) * 10 / u128::from(self.total.max(1))).min(10) as u64;
        let due = tenths > self.tenths && elapsed >= self.last + Self::PAUSE;
        if due {
            (self.tenths, self.last) = (tenths, elapsed);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_has_at_most_ten_lines() {
        let told = |total: u64, pace: f64| {
            let mut milestones = Milestones::new(total);
            (1..=total)
                .filter(|&i| milestones.reaches_next(i, Duration::from_secs_f64(i as f64 * pace)))
                .count()
        };
        assert_eq!(told(1000, 1.0), 10);
        assert_eq!(told(3, 100.0), 3);
        assert_eq!(told(1000, 0.01), 3, "ten seconds have room for three pauses");
        assert_eq!(told(1000, 0.001), 0);
        assert_eq!(told(0, 1.0), 0);
    }

    #[test]
    fn progress_may_be_told_from_many_threads() {
        let progress = Console::new(true).progress(64, "counting");
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| (0..16).for_each(|_| progress.advance(1)));
            }
        });
        assert_eq!(progress.done.load(Ordering::Relaxed), 64);
        assert_eq!(progress.bar.position(), 64);
    }
}
