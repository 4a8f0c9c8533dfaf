//! What a run tells while it goes on.

/// What happens while an experiment runs; told from several threads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Event {
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
