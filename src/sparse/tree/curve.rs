//! A cross-section along a line.

use super::bounds::{Bounds, Hierarchy};
use crate::sparse::disc::falloff;

/// A line that is ready to be asked.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    points: Vec<[f64; 3]>,
    section: Vec<[f64; 2]>,
    reach: f64,
    segments: Hierarchy,
}

impl Curve {
    /// From at least two points and a section of at least one.
    pub(super) fn new(points: &[[f64; 3]], section: &[[f64; 2]], reach: f64) -> Self {
        let segment = |w: &[[f64; 3]]| Bounds::around(w.iter().map(|[x, y, _]| [*x, *y]), reach);
        let segments = Hierarchy::new(points.windows(2).map(segment));
        Self { points: points.to_vec(), section: section.to_vec(), reach, segments }
    }

    pub(super) const fn bounds(&self) -> Bounds {
        self.segments.bounds()
    }

    /// Height and weight at a point; none beyond the reach.
    pub(super) fn at(&self, point: [f64; 2]) -> Option<(f64, f64)> {
        let mut nearest = (f64::INFINITY, 0.0);
        self.segments.meeting(&Bounds { from: point, to: point }, &mut |segment| {
            let ([ax, ay, az], [bx, by, bz]) = (self.points[segment], self.points[segment + 1]);
            let (dx, dy) = (bx - ax, by - ay);
            let squared = dx * dx + dy * dy;
            let along =
                if squared > 0.0 { ((point[0] - ax) * dx + (point[1] - ay) * dy) / squared } else { 0.0 };
            let along = along.clamp(0.0, 1.0);
            let distance = (point[0] - ax - along * dx).hypot(point[1] - ay - along * dy);
            if distance < nearest.0 {
                nearest = (distance, az + along * (bz - az));
            }
        });
        let (distance, height) = nearest;
        if distance >= self.reach {
            return None;
        }
        let whole = self.section.last().map_or(0.0, |last| last[0]);
        let fade = if distance <= whole { 0.0 } else { (distance - whole) / (self.reach - whole) };
        Some((height + self.profile(distance), falloff(fade * fade)))
    }

    /// The section at a distance, level before its first and beyond its last point.
    fn profile(&self, distance: f64) -> f64 {
        let next = self.section.partition_point(|[d, _]| *d < distance);
        match (next.checked_sub(1).map(|i| self.section[i]), self.section.get(next)) {
            (Some([a, low]), Some([b, high])) => low + (high - low) * (distance - a) / (b - a),
            (Some(end), None) => end[1],
            (None, Some(end)) => end[1],
            (None, None) => 0.0,
        }
    }
}
