//! What the user sees: lines on standard output; progress, warnings and errors on standard error.

#![allow(clippy::print_stderr, reason = "the one place that prints")]

use crate::error::Error;
use crate::seed::Seed;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// What every verb gets.
#[derive(Clone, Debug)]
pub(super) struct Context {
    /// Where to print.
    pub(super) console: Console,
    /// The seed of the command line.
    pub(super) seed: Seed,
}

/// The user's terminal, or the file that stands for it.
#[derive(Clone, Debug)]
pub(super) struct Console {
    quiet: bool,
}

impl Console {
    pub(super) fn new(quiet: bool) -> Self {
        Self { quiet }
    }

    /// A line of the result; nothing when quiet. A reader that closed its end has seen enough.
    pub(super) fn line(&self, text: impl AsRef<str>) {
        if !self.quiet {
            self.output(text);
        }
    }

    /// What the user asked for, quiet or not.
    #[allow(clippy::unused_self, reason = "printing belongs to the console")]
    pub(super) fn output(&self, text: impl AsRef<str>) {
        let _ = writeln!(std::io::stdout().lock(), "{}", text.as_ref());
    }

    /// Something that the user should know.
    #[allow(clippy::unused_self, reason = "printing belongs to the console")]
    pub(super) fn warn(&self, text: impl AsRef<str>) {
        eprintln!("warning: {}", text.as_ref());
    }

    /// Why the program stops.
    #[allow(clippy::unused_self, reason = "printing belongs to the console")]
    pub(super) fn error(&self, error: &Error) {
        eprintln!("error: {error}");
    }

    /// A bar with the time left; without a terminal a line now and then; nothing when quiet.
    pub(super) fn progress(&self, total: u64, label: &str) -> Progress {
        let terminal = std::io::stderr().is_terminal();
        let bar = ProgressBar::with_draw_target(
            Some(total),
            if self.quiet || !terminal { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() },
        );
        let style = ProgressStyle::with_template("{prefix} {wide_bar} {pos}/{len}, {eta} left  {msg}");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        bar.set_prefix(label.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        Progress { bar, lines: !self.quiet && !terminal, label: label.to_owned(), started: Instant::now() }
    }
}

/// Lines of a progress without a terminal.
const LINES: u64 = 5;

/// A long step under way.
#[derive(Debug)]
pub(super) struct Progress {
    bar: ProgressBar,
    lines: bool,
    label: String,
    started: Instant,
}

impl Progress {
    /// `steps` more are done.
    pub(super) fn advance(&self, steps: u64) {
        self.advance_with(steps, String::new());
    }

    /// `steps` more are done; `state` says how it goes.
    pub(super) fn advance_with(&self, steps: u64, state: String) {
        let before = self.bar.position();
        self.bar.inc(steps);
        let (now, total) = (before + steps, self.bar.length().unwrap_or(1).max(1));
        if self.lines && now * LINES / total > before * LINES / total {
            let spent = self.started.elapsed().as_secs_f64();
            let left = spent * (total.saturating_sub(now)) as f64 / now as f64;
            let label = &self.label;
            eprintln!("{label}: {now}/{total}, {spent:.0} s, {left:.0} s left  {state}");
        }
        self.bar.set_message(state);
    }

    /// Clears the bar.
    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
