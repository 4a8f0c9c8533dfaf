//! Where the steps of a training run.

/// Runs `work` on one of the pool's own threads. A parallel loop that is begun elsewhere wakes a thread of the pool and is woken
/// by it at its end; a step has dozens of them, some no longer than that takes.
pub(crate) fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}
