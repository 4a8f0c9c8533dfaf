//! Where trainings are kept while they run.

use std::path::PathBuf;
use std::time::Duration;

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
