//! A priority queue for small whole numbers that are never equal.
//!
//! A set of ranks as a tree of 64-bit words: every level above the cells' own says which words below are not empty
//! (a van Emde Boas tree with fan-out 64). Insert and pop touch four words for 16 million ranks, and the whole set takes
//! an eighth of a byte per cell, so it stays in the cache where a binary heap of 13 million cells does not.

/// A set of ranks below a fixed bound, from which the lowest can be taken.
pub(super) struct RankQueue {
    /// From the ranks themselves up to a single word.
    levels: Vec<Vec<u64>>,
}

impl RankQueue {
    /// An empty queue for ranks below `bound`.
    pub(super) fn new(bound: usize) -> Self {
        let mut levels = Vec::new();
        let mut words = bound;
        loop {
            words = words.div_ceil(64).max(1);
            levels.push(vec![0; words]);
            if words == 1 {
                return Self { levels };
            }
        }
    }

    /// Adds a rank; adding it twice is adding it once.
    pub(super) fn insert(&mut self, rank: u32) {
        let mut position = rank as usize;
        for level in &mut self.levels {
            let word = &mut level[position / 64];
            let was_empty = *word == 0;
            *word |= 1 << (position % 64);
            if !was_empty {
                return;
            }
            position /= 64;
        }
    }

    /// Takes the lowest rank.
    pub(super) fn pop(&mut self) -> Option<u32> {
        let (top, _) = self.levels.last()?.split_first()?;
        if *top == 0 {
            return None;
        }
        let lowest = self
            .levels
            .iter()
            .rev()
            .fold(0, |position, level| position * 64 + level[position].trailing_zeros() as usize);
        let mut position = lowest;
        for level in &mut self.levels {
            let word = &mut level[position / 64];
            *word &= !(1 << (position % 64));
            if *word != 0 {
                break;
            }
            position /= 64;
        }
        Some(lowest as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn behaves_like_a_sorted_set(bound in 1u32..300_000, steps in proptest::collection::vec((any::<u32>(), any::<bool>()), 1..400)) {
            let mut queue = RankQueue::new(bound as usize);
            let mut model = BTreeSet::new();
            for (value, pop) in steps {
                if pop {
                    prop_assert_eq!(queue.pop(), model.pop_first());
                } else {
                    queue.insert(value % bound);
                    model.insert(value % bound);
                }
            }
            while let Some(lowest) = model.pop_first() {
                prop_assert_eq!(queue.pop(), Some(lowest));
            }
            prop_assert_eq!(queue.pop(), None);
        }
    }
}
