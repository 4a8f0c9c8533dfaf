//! A bounding-volume hierarchy over things in the plane: which of them may matter at a point or in a window.

/// An axis-parallel box, metres: [x, y] from and to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) from: [f64; 2],
    pub(crate) to: [f64; 2],
}

impl Bounds {
    /// All of the plane.
    pub(crate) const EVERYWHERE: Self = Self { from: [f64::NEG_INFINITY; 2], to: [f64::INFINITY; 2] };

    /// The box around points, `reach` wider on all sides.
    pub(crate) fn around(points: impl IntoIterator<Item = [f64; 2]>, reach: f64) -> Self {
        let nowhere = Self { from: [f64::INFINITY; 2], to: [f64::NEG_INFINITY; 2] };
        let point = |[x, y]: [f64; 2]| Self { from: [x - reach, y - reach], to: [x + reach, y + reach] };
        points.into_iter().map(point).fold(nowhere, Self::with)
    }

    /// The box around both.
    pub(crate) fn with(self, other: Self) -> Self {
        let both = |f: fn(f64, f64) -> f64, a: [f64; 2], b: [f64; 2]| [f(a[0], b[0]), f(a[1], b[1])];
        Self { from: both(f64::min, self.from, other.from), to: both(f64::max, self.to, other.to) }
    }

    /// Whether both have a point in common.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        (0..2).all(|i| self.from[i] <= other.to[i] && other.from[i] <= self.to[i])
    }

    fn middle(&self, axis: usize) -> f64 {
        // Halves first: the sum of two infinities of different sign is no number.
        let middle = 0.5 * self.from[axis] + 0.5 * self.to[axis];
        if middle.is_finite() { middle } else { 0.0 }
    }
}

/// Most things of a leaf.
const LEAF: usize = 4;

/// Boxes of things, halved at the median until few are left.
#[derive(Clone, Debug)]
pub(super) struct Hierarchy {
    bounds: Bounds,
    inside: Inside,
}

#[derive(Clone, Debug)]
enum Inside {
    Things(Vec<(usize, Bounds)>),
    Halves(Box<[Hierarchy; 2]>),
}

impl Hierarchy {
    /// Of things with these boxes, which are known by their numbers.
    pub(super) fn new(boxes: impl IntoIterator<Item = Bounds>) -> Self {
        Self::of(boxes.into_iter().enumerate().collect())
    }

    fn of(mut things: Vec<(usize, Bounds)>) -> Self {
        let bounds = things.iter().fold(Bounds::around([], 0.0), |all, (_, one)| all.with(*one));
        if things.len() <= LEAF {
            return Self { bounds, inside: Inside::Things(things) };
        }
        let spread = |axis: usize| {
            let middles = things.iter().map(|(_, b)| b.middle(axis));
            let (low, high) =
                middles.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), m| (l.min(m), h.max(m)));
            high - low
        };
        let axis = usize::from(spread(1) > spread(0));
        things.sort_by(|a, b| a.1.middle(axis).total_cmp(&b.1.middle(axis)).then(a.0.cmp(&b.0)));
        let rest = things.split_off(things.len() / 2);
        Self { bounds, inside: Inside::Halves(Box::new([Self::of(things), Self::of(rest)])) }
    }

    /// The box around all.
    pub(super) const fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Hears the number of every thing whose box meets a window.
    pub(super) fn meeting(&self, window: &Bounds, heard: &mut impl FnMut(usize)) {
        if !self.bounds.meets(window) {
            return;
        }
        match &self.inside {
            Inside::Things(things) => {
                things.iter().filter(|(_, bounds)| bounds.meets(window)).for_each(|(i, _)| heard(*i));
            }
            Inside::Halves(halves) => halves.iter().for_each(|half| half.meeting(window, heard)),
        }
    }
}
