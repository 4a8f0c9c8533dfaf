//! Draws strokes onto the raster.
//!
//! [`Sketch`] -> [`LineMap`]: each stroke becomes an 8-connected line of cells; each cell takes the height of the point
//! of the stroke that is nearest to its centre, interpolated linearly between the vertices.
//!
//! A stroke is followed through every cell that it enters, and a cell that it merely clips at a corner is left out: one
//! whose two neighbours on the stroke touch each other while the stroke misses the diamond |dx| + |dy| < 1/2 around its
//! centre (on a straight line this is Bresenham's choice). Unlike drawing from rounded vertex to rounded vertex this
//! stays one cell wide when a stroke has many vertices to a cell. Cost: linear in vertices plus cells passed inside the
//! map, however far a stroke reaches outside.

use super::{LineMap, Sketch, Stroke, Vertex};
use crate::grid::Cell;

impl Sketch {
    /// The cells that the strokes pass inside the map, with their heights.
    ///
    /// Strokes are painted in their order: where two cross, the cell belongs to the later one. A stroke that leaves the
    /// map is cut at the frame (the outer edge of the outermost cells); the frame does not change its heights.
    ///
    /// # Panics
    /// When the sketch is not [valid](Sketch::validate).
    #[must_use]
    pub fn rasterize(&self) -> LineMap {
        let mut lines = LineMap::empty(self.rows, self.cols);
        for stroke in &self.strokes {
            for visit in visits(stroke, self.rows, self.cols) {
                lines.set(visit.cell, stroke.kind, visit.height as f32);
            }
        }
        lines
    }
}

impl Stroke {
    /// The cells that the stroke passes on a map of `rows` x `cols` cells, in order, with their heights.
    pub fn cells(&self, rows: usize, cols: usize) -> Vec<(Cell, f64)> {
        visits(self, rows, cols).into_iter().map(|visit| (visit.cell, visit.height)).collect()
    }

    /// Whether any point of the stroke lies on a map of `rows` x `cols` cells, and whether all of them do.
    #[must_use]
    pub fn lies_on(&self, rows: usize, cols: usize) -> (bool, bool) {
        let frame = Frame { rows, cols };
        let all = self.vertices.iter().all(|&v| frame.contains(v));
        let any = all || segments(self).any(|(a, b)| frame.clip(a, b).is_some());
        (any, all)
    }
}

/// A cell on the way of a stroke.
struct Visit {
    cell: Cell,
    /// Height of the stroke's point nearest to the centre.
    height: f64,
    /// Squared distance of that point.
    nearest: f64,
    /// Whether the stroke enters the diamond around the centre.
    enters_diamond: bool,
}

fn visits(stroke: &Stroke, rows: usize, cols: usize) -> Vec<Visit> {
    let frame = Frame { rows, cols };
    let mut path = Path { visits: Vec::new(), run_start: 0 };
    for (a, b) in segments(stroke) {
        let Some((p, q)) = frame.clip(a, b) else { continue };
        // A segment that comes in from outside does not continue what was drawn before.
        if p != a {
            path.run_start = path.visits.len();
        }
        path.follow(frame, p, q);
    }
    path.visits
}

/// Consecutive vertices; a stroke of one vertex is a segment of length zero.
fn segments(stroke: &Stroke) -> impl Iterator<Item = (Vertex, Vertex)> + '_ {
    let single = (stroke.vertices.len() == 1).then(|| (stroke.vertices[0], stroke.vertices[0]));
    single.into_iter().chain(stroke.vertices.windows(2).map(|w| (w[0], w[1])))
}

#[derive(Clone, Copy)]
struct Frame {
    rows: usize,
    cols: usize,
}

impl Frame {
    fn bounds(self) -> [(f64, f64); 2] {
        [(-0.5, self.cols as f64 - 0.5), (-0.5, self.rows as f64 - 0.5)]
    }

    fn contains(self, v: Vertex) -> bool {
        let [(west, east), (north, south)] = self.bounds();
        (west..=east).contains(&v.x) && (north..=south).contains(&v.y)
    }

    fn cell_of(self, v: Vertex) -> Cell {
        // A float to integer cast saturates, so the closed frame maps onto the outermost cells.
        let index = |x: f64, len: usize| ((x + 0.5).floor() as usize).min(len - 1);
        Cell::new(index(v.y, self.rows), index(v.x, self.cols))
    }

    /// The piece of the segment inside the frame (Liang & Barsky 1984); ends that lie inside come back unchanged.
    fn clip(self, a: Vertex, b: Vertex) -> Option<(Vertex, Vertex)> {
        if self.contains(a) && self.contains(b) {
            return Some((a, b));
        }
        // Where along the segment (0 to 1) the frame is entered and left, and at which border.
        let (mut enter, mut leave) = ((0.0_f64, None), (1.0_f64, None));
        for (axis, ((low, high), (from, to))) in
            self.bounds().into_iter().zip([(a.x, b.x), (a.y, b.y)]).enumerate()
        {
            if from == to {
                if from < low || from > high {
                    return None;
                }
                continue;
            }
            // Quartered (exactly), because the difference of two huge coordinates may not be a number.
            let at = |bound: f64| (bound * 0.25 - from * 0.25) / (to * 0.25 - from * 0.25);
            let (first, second) = if from < to { (low, high) } else { (high, low) };
            if at(first) > enter.0 {
                enter = (at(first), Some((axis, first)));
            }
            if at(second) < leave.0 {
                leave = (at(second), Some((axis, second)));
            }
        }
        if enter.0 > leave.0 {
            return None;
        }
        let [(west, east), (north, south)] = self.bounds();
        let at = |(t, border): (f64, Option<(usize, f64)>)| {
            let (mut x, mut y) = (a.x * (1.0 - t) + b.x * t, a.y * (1.0 - t) + b.y * t);
            // On the border itself, even where t is too coarse to say so (a vertex 1e300 cells away).
            match border {
                Some((0, bound)) => x = bound,
                Some((_, bound)) => y = bound,
                None => {}
            }
            Vertex { x: x.clamp(west, east), y: y.clamp(north, south), z: a.z * (1.0 - t) + b.z * t }
        };
        let p = if self.contains(a) { a } else { at(enter) };
        let q = if self.contains(b) { b } else { at(leave) };
        Some((p, q))
    }
}

struct Path {
    visits: Vec<Visit>,
    /// Where the connected run began to which the next cell belongs.
    run_start: usize,
}

impl Path {
    /// Visits every cell from `p` to `q` in order (Amanatides & Woo 1987); both lie inside the frame.
    fn follow(&mut self, frame: Frame, p: Vertex, q: Vertex) {
        let (mut cell, end) = (frame.cell_of(p), frame.cell_of(q));
        self.visit(cell, p, q);
        // Where along the segment (0 to 1) the k-th border between columns, or rows, is crossed.
        let crossing = |start: usize, from: f64, to: f64, k: usize| {
            let sign = if to > from { 1.0 } else { -1.0 };
            (start as f64 + sign * (k as f64 + 0.5) - from) / (to - from)
        };
        let start = cell;
        let (across, along) = (start.col.abs_diff(end.col), start.row.abs_diff(end.row));
        let (mut i, mut j) = (0, 0);
        while i < across || j < along {
            let x = if i < across { crossing(start.col, p.x, q.x, i) } else { f64::INFINITY };
            let y = if j < along { crossing(start.row, p.y, q.y, j) } else { f64::INFINITY };
            if x <= y {
                cell.col = if end.col > start.col { cell.col + 1 } else { cell.col - 1 };
                i += 1;
            }
            if y <= x {
                cell.row = if end.row > start.row { cell.row + 1 } else { cell.row - 1 };
                j += 1;
            }
            self.visit(cell, p, q);
        }
    }

    fn visit(&mut self, cell: Cell, p: Vertex, q: Vertex) {
        let (dx, dy) = (q.x - p.x, q.y - p.y);
        let (to_x, to_y) = (cell.col as f64 - p.x, cell.row as f64 - p.y);
        let offset = |t: f64| (to_x - dx * t, to_y - dy * t);
        // Not a number where the segment has no extent: its later end then.
        let unit = |t: f64| if t.is_nan() { 1.0 } else { t.clamp(0.0, 1.0) };

        let t = unit((to_x * dx + to_y * dy) / (dx * dx + dy * dy));
        let (ox, oy) = offset(t);
        // |dx| + |dy| is convex along the segment: its least value lies at an end or where one of the two vanishes.
        let enters_diamond = [0.0, 1.0, unit(to_x / dx), unit(to_y / dy)].into_iter().any(|t| {
            let (ox, oy) = offset(t);
            ox.abs() + oy.abs() < 0.5
        });
        self.push(Visit {
            cell,
            height: p.z * (1.0 - t) + q.z * t,
            nearest: ox * ox + oy * oy,
            enters_diamond,
        });
    }

    /// Appends a visit, after taking back the corners that the stroke has cut to get there.
    fn push(&mut self, visit: Visit) {
        if self.top().is_none_or(|top| top.cell != visit.cell) {
            while let [.., before, top] = &self.visits[self.run_start..] {
                if top.enters_diamond || !before.cell.touches(visit.cell) {
                    break;
                }
                self.visits.pop();
            }
        }
        match self.visits[self.run_start..].last_mut() {
            Some(top) if top.cell == visit.cell => {
                top.enters_diamond |= visit.enters_diamond;
                if visit.nearest <= top.nearest {
                    (top.nearest, top.height) = (visit.nearest, visit.height);
                }
            }
            _ => self.visits.push(visit),
        }
    }

    fn top(&self) -> Option<&Visit> {
        self.visits[self.run_start..].last()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::StrokeKind;
    use proptest::prelude::*;

    fn stroke(points: &[(f64, f64, f64)]) -> Stroke {
        let vertices = points.iter().map(|&(x, y, z)| Vertex { x, y, z }).collect();
        Stroke { kind: StrokeKind::Ridge, vertices }
    }

    fn cells(points: &[(f64, f64, f64)], rows: usize, cols: usize) -> Vec<(usize, usize, f32)> {
        visits(&stroke(points), rows, cols)
            .iter()
            .map(|v| (v.cell.row, v.cell.col, v.height as f32))
            .collect()
    }

    #[test]
    fn a_shallow_line_takes_bresenhams_cells() {
        let drawn = cells(&[(0.0, 0.0, 0.0), (5.0, 2.0, 29.0)], 9, 9);
        let plain: Vec<_> = drawn.iter().map(|&(r, c, _)| (r, c)).collect();
        assert_eq!(plain, [(0, 0), (0, 1), (1, 2), (1, 3), (2, 4), (2, 5)]);
        // The nearest point to (col, row) on the line lies at t = (5 col + 2 row) / 29.
        for (r, c, z) in drawn {
            assert!((z - (5 * c + 2 * r) as f32).abs() < 1e-4, "{r} {c} {z}");
        }
    }

    #[test]
    fn a_single_point_and_repeated_points_are_one_cell() {
        assert_eq!(cells(&[(2.4, 1.6, 7.0)], 5, 5), [(2, 2, 7.0)]);
        assert_eq!(cells(&[(2.0, 1.0, 7.0), (2.0, 1.0, 7.0), (2.0, 1.0, 8.0)], 5, 5), [(1, 2, 8.0)]);
    }

    #[test]
    fn the_point_nearest_to_the_centre_gives_the_height() {
        // Three segments touch the second cell; the vertex at its centre counts, not the one passed last.
        let drawn = cells(&[(0.0, 0.0, 0.0), (1.0, 0.0, 5.0), (1.4, 0.0, 9.0), (3.0, 0.0, 9.0)], 1, 4);
        assert_eq!(drawn, [(0, 0, 0.0), (0, 1, 5.0), (0, 2, 9.0), (0, 3, 9.0)]);
    }

    #[test]
    fn a_stroke_that_leaves_makes_no_corner() {
        // It leaves over a corner of (0, 2) and comes back down column 1.
        let stroke = [(1.0, 1.0, 1.0), (2.0, -1.2, 1.0), (1.0, -3.0, 1.0), (1.0, 0.0, 1.0)];
        let plain: Vec<_> = cells(&stroke, 3, 5).iter().map(|&(r, c, _)| (r, c)).collect();
        assert_eq!(plain, [(1, 1), (0, 1), (0, 2), (0, 1)]);
    }

    #[test]
    fn the_frame_cuts_without_changing_heights() {
        // From 10 cells west of the map to 10 cells east of it, 0 to 240 m: height = 10 (x + 10).
        let drawn = cells(&[(-10.0, 2.0, 0.0), (14.0, 2.0, 240.0)], 5, 5);
        assert_eq!(drawn, [0, 1, 2, 3, 4].map(|c| (2, c, 100.0 + 10.0 * c as f32)));
    }

    #[test]
    fn a_stroke_may_leave_and_come_back() {
        let drawn = cells(&[(1.0, 1.0, 1.0), (1.0, -9.0, 1.0), (3.0, -9.0, 2.0), (3.0, 1.0, 2.0)], 3, 5);
        assert_eq!(drawn, [(1, 1, 1.0), (0, 1, 1.0), (0, 3, 2.0), (1, 3, 2.0)]);
        assert!(cells(&[(-5.0, 1.0, 1.0), (-1.0, -6.0, 1.0)], 3, 5).is_empty());
        let s = stroke(&[(-5.0, 1.0, 1.0), (9.0, 1.0, 1.0)]);
        assert_eq!(s.lies_on(3, 5), (true, false), "both ends lie outside and the middle inside");
    }

    #[test]
    fn absurdly_far_vertices_are_cut_like_near_ones() {
        let far = f64::MAX;
        let drawn = cells(&[(-far, 2.0, 5.0), (far, 2.0, 5.0)], 5, 5);
        assert_eq!(drawn.len(), 5);
        assert!(drawn.iter().all(|&(r, _, z)| r == 2 && z == 5.0));
        let slanted = cells(&[(-far, 0.0, 0.0), (far, 4.0, 10.0)], 5, 5);
        assert_eq!(slanted, [0, 1, 2, 3, 4].map(|c| (2, c, 5.0)), "half-way along");
        assert_eq!(cells(&[(2.0, 2.0, 5.0), (1e300, 2.0, 6.0)], 5, 5).len(), 3);
    }

    #[test]
    fn where_strokes_cross_the_later_one_wins() {
        let mut valley = stroke(&[(2.0, 0.0, -1.0), (2.0, 4.0, -1.0)]);
        valley.kind = StrokeKind::Valley;
        let sketch =
            Sketch { rows: 5, cols: 5, strokes: vec![stroke(&[(0.0, 2.0, 1.0), (4.0, 2.0, 1.0)]), valley] };
        let lines = sketch.rasterize();
        assert_eq!(lines.line_count(), 9);
        assert_eq!(lines.kinds()[Cell::new(2, 2)], Some(StrokeKind::Valley));
        assert_eq!(lines.heights()[Cell::new(2, 2)], -1.0);
    }

    #[test]
    fn a_curve_of_many_vertices_is_one_cell_wide() {
        let circle: Vec<_> = (0..=100_000)
            .map(|i| f64::from(i) / 100_000.0 * std::f64::consts::TAU)
            .map(|a| (64.0 + 50.3 * a.cos(), 64.0 + 50.3 * a.sin(), 1.0))
            .collect();
        let drawn = visits(&stroke(&circle), 128, 128);
        for w in drawn.windows(3) {
            assert!(!w[0].cell.touches(w[2].cell), "{:?} is a needless corner", w[1].cell);
        }
        // A thin digital circle of radius r has 4 sqrt(2) r cells.
        let expected = 4.0 * std::f64::consts::SQRT_2 * 50.3;
        assert!((drawn.len() as f64 - expected).abs() < 6.0, "{} cells", drawn.len());
    }

    #[test]
    fn corners_that_were_drawn_stay() {
        let staircase = [(0.0, 0.0, 1.0), (1.0, 0.0, 2.0), (1.0, 1.0, 3.0), (2.0, 1.0, 4.0)];
        assert_eq!(cells(&staircase, 3, 3), [(0, 0, 1.0), (0, 1, 2.0), (1, 1, 3.0), (1, 2, 4.0)]);
    }

    proptest! {
        #[test]
        fn strokes_inside_are_connected_and_stay_near(
            points in prop::collection::vec((-0.5_f64..19.5, -0.5_f64..14.5, 0.0_f64..1.0), 1..12),
        ) {
            let drawn = visits(&stroke(&points), 15, 20);
            prop_assert!(drawn.windows(2).all(|w| w[0].cell != w[1].cell && w[0].cell.touches(w[1].cell)));
            prop_assert!(drawn.iter().all(|v| v.nearest <= 0.5 + 1e-9), "never farther than a cell's corner");
            prop_assert!(drawn.iter().all(|v| (0.0..=1.0).contains(&v.height)));
            for &(x, y, _) in &points {
                let near = |v: &Visit| (v.cell.col as f64 - x).hypot(v.cell.row as f64 - y) < 1.5;
                prop_assert!(drawn.iter().any(near), "a cell near every vertex");
            }
        }
    }
}
