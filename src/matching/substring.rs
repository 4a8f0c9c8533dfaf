//! The longest common substring of two chain codes of at most 64 steps (Gusfield 1997, cited in 5.3).
//!
//! Bit-parallel: bit j of a word says that a common run ends at step j of the other chain, so that all offsets advance
//! at once. Cost: (steps of one) x (length of the answer + 1) word operations; a table of run lengths would cost the
//! product of both lengths.

/// Longest chain that fits a word.
pub(super) const LONGEST: usize = u64::BITS as usize;

/// For each of the eight codes, the steps of a chain at which it stands.
#[derive(Clone, Debug)]
pub(super) struct Positions([u64; 8]);

impl Positions {
    /// # Panics
    /// When the chain has more than [`LONGEST`] steps.
    pub(super) fn of(codes: &[u8]) -> Self {
        assert!(codes.len() <= LONGEST, "a chain code fits a machine word");
        let mut at = [0; 8];
        for (j, &code) in codes.iter().enumerate() {
            at[usize::from(code)] |= 1 << j;
        }
        Self(at)
    }

    /// Length of the longest run that `codes`, turned counter-clockwise by `turn` eighths, has in common with this chain.
    ///
    /// `ends` is working space, so that hundreds of thousands of calls share one allocation.
    pub(super) fn common_length(&self, codes: &[u8], turn: u8, ends: &mut Vec<u64>) -> usize {
        let equal = |code: u8| self.0[usize::from((code + turn) % 8)];
        // ends[i]: where runs of more than `length` steps end that end at step i of `codes`.
        ends.clear();
        ends.extend(codes.iter().map(|&code| equal(code)));
        let mut any = ends.iter().fold(0, |any, e| any | e);
        let mut length = 0;
        while any != 0 {
            length += 1;
            any = 0;
            for i in (length..codes.len()).rev() {
                ends[i] = (ends[i - 1] << 1) & equal(codes[i]);
                any |= ends[i];
            }
        }
        length
    }
}

/// Where the runs of `length` steps begin that `a`, turned by `turn`, and `b` have in common: (step of a, step of b).
pub(super) fn occurrences<'a>(
    a: &'a [u8],
    turn: u8,
    b: &'a [u8],
    length: usize,
) -> impl Iterator<Item = (usize, usize)> + 'a {
    let equal = move |i: usize, j: usize| (0..length).all(|s| (a[i + s] + turn) % 8 == b[j + s]);
    let starts = move |codes: &[u8]| 0..(codes.len() + 1).saturating_sub(length);
    starts(a).flat_map(move |i| starts(b).map(move |j| (i, j))).filter(move |&(i, j)| equal(i, j))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Straight from the definition: try every pair of starts.
    fn brute_force(a: &[u8], turn: u8, b: &[u8]) -> usize {
        let mut best = 0;
        for i in 0..a.len() {
            for j in 0..b.len() {
                let run = a[i..].iter().zip(&b[j..]).take_while(|&(&x, &y)| (x + turn) % 8 == y).count();
                best = best.max(run);
            }
        }
        best
    }

    #[test]
    fn known_runs() {
        let common = |a: &[u8], b: &[u8], turn| Positions::of(b).common_length(a, turn, &mut Vec::new());
        assert_eq!(common(&[0, 0, 1, 0], &[5, 0, 1, 0, 5], 0), 3);
        assert_eq!(common(&[0, 0, 1, 0], &[2, 2, 3, 2], 2), 4);
        assert_eq!(common(&[0, 0], &[4, 4], 0), 0);
        assert_eq!(common(&[], &[4, 4], 0), 0);
        assert_eq!(common(&[7; 64], &[0; 64], 1), 64, "a full word");
        assert_eq!(
            occurrences(&[0, 1, 0], 0, &[0, 1, 0, 1], 2).collect::<Vec<_>>(),
            [(0, 0), (0, 2), (1, 1)]
        );
    }

    proptest! {
        #[test]
        fn equals_brute_force(
            a in prop::collection::vec(0_u8..3, 0..64), b in prop::collection::vec(0_u8..8, 0..64), turn in 0_u8..8,
        ) {
            let length = Positions::of(&b).common_length(&a, turn, &mut Vec::new());
            prop_assert_eq!(length, brute_force(&a, turn, &b));
            prop_assert!(length == 0 || occurrences(&a, turn, &b, length).next().is_some());
            prop_assert!(occurrences(&a, turn, &b, length + 1).next().is_none());
        }
    }
}
