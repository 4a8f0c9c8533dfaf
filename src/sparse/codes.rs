//! Sparse coefficients: a few atoms and their weights for each signal.

/// The columns X_i of the coefficients (Guérin et al. 2016, Eq. 1), at most `each` atoms a signal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Codes {
    each: usize,
    /// (signals, `each`); a free place has weight 0.
    atoms: Vec<u32>,
    weights: Vec<f32>,
}

impl Codes {
    /// No atom for any of `signals`.
    pub(crate) fn none(signals: usize, each: usize) -> Self {
        Self { each, atoms: vec![0; signals * each], weights: vec![0.0; signals * each] }
    }

    /// From (signals, `each`) numbers of atoms and weights.
    ///
    /// # Panics
    /// When the lengths differ or fill no whole signal.
    pub(crate) fn from_parts(each: usize, atoms: Vec<u32>, weights: Vec<f32>) -> Self {
        assert!(each > 0 && atoms.len() == weights.len() && atoms.len().is_multiple_of(each));
        Self { each, atoms, weights }
    }

    /// All codes one after another.
    ///
    /// # Panics
    /// When they have other numbers of places.
    pub(crate) fn joined(each: usize, parts: Vec<Self>) -> Self {
        let mut all = Self::none(0, each);
        for part in parts {
            assert_eq!(part.each, each);
            all.atoms.extend(part.atoms);
            all.weights.extend(part.weights);
        }
        all
    }

    /// Most atoms of a signal.
    pub(crate) const fn each(&self) -> usize {
        self.each
    }

    /// Number of signals.
    pub(crate) fn signals(&self) -> usize {
        self.atoms.len() / self.each
    }

    /// Atoms and weights of a signal.
    pub(crate) fn of(&self, signal: usize) -> impl Iterator<Item = (usize, f32)> {
        let places = signal * self.each..(signal + 1) * self.each;
        let both = self.atoms[places.clone()].iter().zip(&self.weights[places]);
        both.filter(|(_, weight)| **weight != 0.0).map(|(atom, weight)| (*atom as usize, *weight))
    }

    /// Numbers of atoms, (signals, [`each`](Self::each)).
    pub(crate) fn atoms(&self) -> &[u32] {
        &self.atoms
    }

    /// Weights, (signals, [`each`](Self::each)).
    pub(crate) fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// Puts an atom into a place of a signal.
    pub(super) fn set(&mut self, signal: usize, place: usize, atom: usize, weight: f32) {
        self.atoms[signal * self.each + place] = atom as u32;
        self.weights[signal * self.each + place] = weight;
    }

    /// Takes a signal's code from `other`.
    pub(super) fn copy_signal(&mut self, signal: usize, other: &Self) {
        let places = signal * self.each..(signal + 1) * self.each;
        self.atoms[places.clone()].copy_from_slice(&other.atoms[places.clone()]);
        self.weights[places.clone()].copy_from_slice(&other.weights[places]);
    }

    /// The weight in a place of a signal.
    pub(super) fn weight(&self, signal: usize, place: usize) -> f32 {
        self.weights[signal * self.each + place]
    }

    /// Atoms and weights of a signal beside that in a place.
    pub(super) fn of_except(&self, signal: usize, place: usize) -> impl Iterator<Item = (usize, f32)> {
        let others = (0..self.each).filter(move |other| *other != place);
        let both =
            others.map(move |other| (self.atoms[signal * self.each + other], self.weight(signal, other)));
        both.filter(|(_, weight)| *weight != 0.0).map(|(atom, weight)| (atom as usize, weight))
    }

    /// Signal and place of every use of an atom.
    pub(super) fn uses_of(&self, atom: usize) -> Vec<(usize, usize)> {
        let all = self.atoms.iter().zip(&self.weights).enumerate();
        let own = all.filter(|(_, (a, weight))| **a as usize == atom && **weight != 0.0);
        own.map(|(i, _)| (i / self.each, i % self.each)).collect()
    }

    /// Number of weights that are not 0.
    pub(crate) fn count(&self) -> usize {
        self.weights.iter().filter(|weight| **weight != 0.0).count()
    }
}
