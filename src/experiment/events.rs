//! What a run tells while it goes on, and what it makes of faults.

use crate::error::{Error, Result};

/// What happens while an experiment runs; told from several threads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// So many styles are to be trained, in so many steps.
    Training {
        /// Styles.
        styles: usize,
        /// Styles that an earlier run has trained.
        cached: usize,
        /// Steps of all that are left.
        steps: u64,
    },
    /// So many steps of a training more are done.
    Steps(u64),
    /// So many rows are to be scored.
    Scoring {
        /// Rows left.
        rows: u64,
        /// Rows that an earlier run has scored.
        kept: u64,
    },
    /// So many rows more are scored.
    Scored(u64),
    /// Something failed, which is a row with its error.
    Failed(String),
}

/// What `work` gives; a fault of ours in one cell of a long run is that cell's error and not the end of all.
pub(super) fn without_panic<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
        let found = format!("a panic ({})", text.unwrap_or_else(|| "without a word".to_owned()));
        Err(Error::value("state of the program", found, "a fault of monadnock: please report it"))
    })
}
