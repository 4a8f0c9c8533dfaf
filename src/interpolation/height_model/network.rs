//! The points along strokes, how they hang together, and where the valleys' water goes.
//!
//! Strokes -> points every two cells -> links along strokes, at confluences (an end near another stroke of its kind) and at
//! crossings -> for every valley point the next one downstream. A group of valleys drains to the end that given heights make
//! the lowest, else to the one nearest to the frame of the map, else to where its first stroke was drawn to. Cost: quadratic in
//! the points, which are spread farther apart when there are many.

use crate::sketch::{Sketch, StrokeKind};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Distance between two points of a stroke, cells; more in a long drawing.
const STEP: f64 = 2.0;
/// Points that a drawing has about at most.
const MOST_POINTS: f64 = 20_000.0;
/// An end so near to another stroke of its kind, or to the other end of its own, is meant to touch it: a share of the map's
/// shorter side, and bounds of that in cells.
const TOUCHES: f64 = 0.03;
const TOUCHES_WITHIN: [f64; 2] = [4.0, 12.0];
/// Points of one stroke that are nearer than this many to each other along it do not touch.
const ALONG: usize = 8;
/// Strokes so near to each other cross or touch, cells: half a diagonal step, and half a cell to either side.
pub(super) const CROSSES: f64 = 1.5;
/// Ends whose distances to the frame differ by less are equally near, cells.
const AS_NEAR: f64 = 2.0;
/// Least length of a link, cells.
const SHORTEST: f64 = 0.3;
/// Places at which the map is asked for its nearest valley, about.
const PLACES: f64 = 4096.0;

/// A point of a stroke.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) kind: StrokeKind,
    pub(super) stroke: usize,
    /// The segment that it lies on, and how far along (0 to 1); the last vertex ends the last segment.
    pub(super) segment: usize,
    pub(super) share: f64,
    /// Height that is given: at a vertex, or between two that have one.
    pub(super) given: Option<f64>,
}

/// Two points that hang together, and how far they are apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Link {
    pub(super) a: usize,
    pub(super) b: usize,
    pub(super) length: f64,
    /// Of two strokes.
    pub(super) joins: bool,
}

/// Points and links of a sketch.
#[derive(Debug)]
pub(super) struct Network {
    pub(super) points: Vec<Point>,
    pub(super) links: Vec<Link>,
    /// Ridge points on valleys: (ridge point, valley point).
    pub(super) crossings: Vec<(usize, usize)>,
    /// For every ridge point off the valleys the nearest valley point and its distance.
    pub(super) beside: Vec<(usize, usize, f64)>,
    /// The next point downstream, and how far: of valley points that are no outlet.
    pub(super) downstream: Vec<Option<(usize, f64)>>,
    /// Valley points, the outlets first, every one after the next downstream.
    pub(super) upwards: Vec<usize>,
    /// Cells that drain through each valley point.
    pub(super) drained: Vec<f64>,
    /// Mean distance of the map's places to the nearest valley (without valleys: ridge), cells.
    pub(super) spacing: f64,
    /// Strokes at whose end the water was assumed to leave, because nothing given said so.
    pub(super) assumed_outlets: Vec<usize>,
    map: (f64, f64),
}

impl Network {
    pub(super) fn of(sketch: &Sketch, given: &[Vec<bool>]) -> Self {
        let points = points(sketch, given);
        let mut network = Self {
            links: Vec::new(),
            crossings: Vec::new(),
            beside: Vec::new(),
            downstream: vec![None; points.len()],
            upwards: Vec::new(),
            drained: vec![0.0; points.len()],
            spacing: 0.0,
            assumed_outlets: Vec::new(),
            map: (sketch.rows as f64, sketch.cols as f64),
            points,
        };
        network.link_strokes();
        network.link_kinds();
        network.drain();
        network.share_map();
        network
    }

    fn distance(&self, a: usize, b: usize) -> f64 {
        let (p, q) = (&self.points[a], &self.points[b]);
        (p.x - q.x).hypot(p.y - q.y)
    }

    fn of_kind(&self, kind: StrokeKind) -> Vec<usize> {
        (0..self.points.len()).filter(|&i| self.points[i].kind == kind).collect()
    }

    /// Whether the point begins or ends its stroke.
    fn is_end(&self, i: usize) -> bool {
        let stroke = |j: usize| self.points.get(j).map(|p| p.stroke);
        let here = stroke(i);
        i == 0 || stroke(i - 1) != here || stroke(i + 1) != here
    }

    /// Links along strokes, and to the nearest point of another stroke of the kind: from ends that touch it, and where the
    /// two cross.
    fn link_strokes(&mut self) {
        let along = self.points.windows(2).enumerate().filter(|(_, w)| w[0].stroke == w[1].stroke);
        let mut links: Vec<Link> = along
            .map(|(i, _)| Link {
                a: i,
                b: i + 1,
                length: self.distance(i, i + 1).max(SHORTEST),
                joins: false,
            })
            .collect();
        let touches = (TOUCHES * self.map.0.min(self.map.1)).clamp(TOUCHES_WITHIN[0], TOUCHES_WITHIN[1]);
        let joins = (0..self.points.len()).into_par_iter().filter_map(|i| {
            let reach = if self.is_end(i) { touches } else { CROSSES };
            let other = |&j: &usize| {
                let (p, q) = (&self.points[i], &self.points[j]);
                p.kind == q.kind && (p.stroke != q.stroke || i.abs_diff(j) > ALONG)
            };
            let near = (0..self.points.len()).filter(other).map(|j| (j, self.distance(i, j)));
            let (j, d) = near.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, d)| *d <= reach)?;
            // Once for both directions, unless the other one reaches less far.
            Some(Link { a: i, b: j, length: if d < 1e-9 { 0.0 } else { d.max(SHORTEST) }, joins: true })
        });
        links.extend(joins.collect::<Vec<_>>());
        self.links = links;
    }

    /// What ridge points lie on, or beside.
    fn link_kinds(&mut self) {
        let valleys = self.of_kind(StrokeKind::Valley);
        let nearest = |i: usize| {
            let all = valleys.iter().map(|&j| (j, self.distance(i, j)));
            all.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(j, d)| (i, j, d))
        };
        let found: Vec<_> = self.of_kind(StrokeKind::Ridge).into_par_iter().filter_map(nearest).collect();
        for (i, j, d) in found {
            if d <= CROSSES { self.crossings.push((i, j)) } else { self.beside.push((i, j, d)) }
        }
    }

    /// Finds where the water of every valley point goes.
    fn drain(&mut self) {
        let mut neighbours: Vec<Vec<(usize, f64)>> = vec![Vec::new(); self.points.len()];
        for link in self.links.iter().filter(|link| self.points[link.a].kind == StrokeKind::Valley) {
            neighbours[link.a].push((link.b, link.length));
            neighbours[link.b].push((link.a, link.length));
        }
        let mut seen = vec![false; self.points.len()];
        for start in self.of_kind(StrokeKind::Valley) {
            if seen[start] {
                continue;
            }
            let group = ways(&neighbours, start);
            group.iter().for_each(|way| seen[way.point] = true);
            let members: Vec<usize> = group.iter().map(|way| way.point).collect();
            let outlet = self.outlet(&members, &neighbours);
            for way in ways(&neighbours, outlet) {
                self.downstream[way.point] = way.from;
                self.upwards.push(way.point);
            }
        }
    }

    /// The point of a group at which its water leaves.
    fn outlet(&mut self, members: &[usize], neighbours: &[Vec<(usize, f64)>]) -> usize {
        // An end that touches another stroke is a confluence.
        let joined = |i: usize| self.links.iter().any(|link| link.joins && (link.a == i || link.b == i));
        let mut ends: Vec<usize> =
            members.iter().copied().filter(|&i| self.is_end(i) && !joined(i)).collect();
        if ends.is_empty() {
            ends = members.to_vec(); // rings
        }
        ends.sort_unstable();
        let known: Vec<usize> = members.iter().copied().filter(|&i| self.points[i].given.is_some()).collect();
        let range = known.iter().filter_map(|&i| self.points[i].given);
        let (low, high) = range.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
        if high > low {
            // The end from which given heights rise most consistently.
            let rise = |&end: &usize| {
                let ways = ways(neighbours, end);
                let of_known: Vec<(f64, f64)> =
                    ways.iter().filter_map(|w| Some((w.length, self.points[w.point].given?))).collect();
                correlation(&of_known)
            };
            let rises: Vec<(usize, f64)> = ends.iter().map(|end| (*end, rise(end))).collect();
            let best = rises.iter().copied().reduce(|a, b| if b.1 > a.1 + 1e-9 { b } else { a });
            return best.map_or(members[0], |(end, _)| end);
        }
        let (rows, cols) = self.map;
        let to_frame = |i: usize| {
            let p = &self.points[i];
            [p.x + 0.5, cols - 0.5 - p.x, p.y + 0.5, rows - 0.5 - p.y]
                .into_iter()
                .fold(f64::INFINITY, f64::min)
        };
        let nearest = ends.iter().map(|&i| to_frame(i)).fold(f64::INFINITY, f64::min);
        // As people draw rivers: the last point is the mouth.
        let last = |i: usize| self.points.get(i + 1).is_none_or(|next| next.stroke != self.points[i].stroke);
        let near: Vec<usize> =
            ends.iter().copied().filter(|&i| to_frame(i) <= nearest.max(0.0) + AS_NEAR).collect();
        let outlet = near.iter().copied().find(|&i| last(i)).unwrap_or(near[0]);
        self.assumed_outlets.push(self.points[outlet].stroke);
        outlet
    }

    /// Shares the map's cells out to the nearest valley points, and adds them up downstream.
    fn share_map(&mut self) {
        let (rows, cols) = self.map;
        let valleys = self.of_kind(StrokeKind::Valley);
        let lines = if valleys.is_empty() { (0..self.points.len()).collect() } else { valleys };
        let step = (rows * cols / PLACES).sqrt().max(1.0);
        let count = |side: f64| (side / step).ceil().max(1.0) as usize;
        let (down, across) = (count(rows), count(cols));
        let place = |i: usize, n: usize, side: f64| (i as f64 + 0.5) * side / n as f64 - 0.5;
        let found: Vec<(usize, f64)> = (0..down * across)
            .into_par_iter()
            .filter_map(|i| {
                let (y, x) = (place(i / across, down, rows), place(i % across, across, cols));
                let away = |&j: &usize| (j, (self.points[j].x - x).hypot(self.points[j].y - y));
                lines.iter().map(away).min_by(|a, b| a.1.total_cmp(&b.1))
            })
            .collect();
        let cells = rows * cols / (down * across) as f64;
        self.spacing = found.iter().map(|(_, d)| d).sum::<f64>() / found.len().max(1) as f64;
        for (point, _) in found {
            self.drained[point] += cells;
        }
        for &i in self.upwards.iter().rev() {
            if let Some((next, _)) = self.downstream[i] {
                self.drained[next] += self.drained[i];
            }
        }
    }
}

/// A point with the next one on the shortest way to the start, and the length of that way.
struct Way {
    point: usize,
    from: Option<(usize, f64)>,
    length: f64,
}

/// The shortest ways to `start` from everywhere that hangs together with it, nearest first (Dijkstra 1959).
fn ways(neighbours: &[Vec<(usize, f64)>], start: usize) -> Vec<Way> {
    let mut lengths = vec![f64::INFINITY; neighbours.len()];
    let mut from: Vec<Option<(usize, f64)>> = vec![None; neighbours.len()];
    let mut done = vec![false; neighbours.len()];
    // The bits of numbers that are not negative are in their order.
    let mut queue = BinaryHeap::from([Reverse((0_u64, start))]);
    lengths[start] = 0.0;
    let mut found = Vec::new();
    while let Some(Reverse((bits, point))) = queue.pop() {
        if std::mem::replace(&mut done[point], true) {
            continue;
        }
        let length = f64::from_bits(bits);
        found.push(Way { point, from: from[point], length });
        for &(next, step) in &neighbours[point] {
            if length + step < lengths[next] {
                (lengths[next], from[next]) = (length + step, Some((point, step)));
                queue.push(Reverse(((length + step).to_bits(), next)));
            }
        }
    }
    found
}

/// Pearson's; 0 where it does not exist.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len().max(1) as f64;
    let (x, y) = pairs.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let sum = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>();
    let (xx, yy) = (sum(&|p| (p.0 - x).powi(2)), sum(&|p| (p.1 - y).powi(2)));
    let xy = sum(&|p| (p.0 - x) * (p.1 - y));
    if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}

/// Points along the strokes, inside the map and near it; every vertex is one.
fn points(sketch: &Sketch, given: &[Vec<bool>]) -> Vec<Point> {
    let (rows, cols) = (sketch.rows as f64, sketch.cols as f64);
    // What lies far off the map is as if it lay a map's side away.
    let place = |x: f64, side: f64| x.clamp(-side, 2.0 * side);
    let at = |v: &crate::sketch::Vertex| (place(v.x, cols), place(v.y, rows));
    let length = |s: &crate::sketch::Stroke| {
        s.vertices
            .windows(2)
            .map(|w| (at(&w[0]), at(&w[1])))
            .map(|(a, b)| (a.0 - b.0).hypot(a.1 - b.1))
            .sum::<f64>()
    };
    let step = (sketch.strokes.iter().map(length).sum::<f64>() / MOST_POINTS).max(STEP);
    let mut points = Vec::new();
    for (stroke, (s, given)) in sketch.strokes.iter().zip(given).enumerate() {
        let height = |i: usize| given[i].then_some(s.vertices[i].z);
        let mut push = |segment: usize, share: f64, (x, y): (f64, f64), given: Option<f64>| {
            points.push(Point { x, y, kind: s.kind, stroke, segment, share, given });
        };
        push(0, 0.0, at(&s.vertices[0]), height(0));
        for segment in 0..s.vertices.len() - 1 {
            let (a, b) = (at(&s.vertices[segment]), at(&s.vertices[segment + 1]));
            let drawn = |v: usize, at: (f64, f64)| (s.vertices[v].x, s.vertices[v].y) == at;
            // A segment to somewhere far off the map is not cut: its points would not lie on it.
            let cut = drawn(segment, a) && drawn(segment + 1, b);
            let pieces = if cut { ((a.0 - b.0).hypot(a.1 - b.1) / step).ceil().max(1.0) as usize } else { 1 };
            for piece in 1..=pieces {
                let t = piece as f64 / pieces as f64;
                let between = height(segment).zip(height(segment + 1)).map(|(p, q)| p + (q - p) * t);
                let known = if piece == pieces { height(segment + 1) } else { between };
                push(segment, t, (a.0 + (b.0 - a.0) * t, a.1 + (b.1 - a.1) * t), known);
            }
        }
    }
    points
}
