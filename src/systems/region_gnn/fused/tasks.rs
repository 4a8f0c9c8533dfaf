//! How a pass is cut into tasks: the same way on every machine.

use super::super::edges::{BLOCK, PassEdges};
use std::ops::Range;

/// Number of parallel tasks and partial sums: fixed, so that every number of threads gives the same bytes.
const TASKS: usize = 16;

/// Pixels of one task: whole blocks.
pub(super) fn task_size(pixels: usize) -> usize {
    pixels.div_ceil(TASKS).next_multiple_of(BLOCK)
}

pub(super) fn tasks(pixels: usize) -> Vec<Range<usize>> {
    let size = task_size(pixels);
    (0..pixels.div_ceil(size)).map(|i| i * size..pixels.min((i + 1) * size)).collect()
}

/// The list cut into the rooms of the tasks' edges.
pub(super) fn rooms<'a>(edges: &PassEdges, mut list: &'a mut [f32]) -> Vec<&'a mut [f32]> {
    let cut = |pixels: Range<usize>| {
        let (room, rest) = std::mem::take(&mut list).split_at_mut(edges.room(&pixels).len());
        list = rest;
        room
    };
    tasks(edges.graph().pixel_count()).into_iter().map(cut).collect()
}
