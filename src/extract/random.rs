//! Fills the empty land around a few drawn strokes with small random ridges and valleys (Liu & Benes 2025, 5.2).
//!
//! [`Sketch`] -> [`Sketch`] with more strokes, so that a drawing of three curves has lines as dense as those of the DEM
//! that the model was trained on. Random nodes get heights in [0.5, 1] and their minimum spanning tree offers ridges;
//! the vertices of their Voronoi diagram get heights in [0, 0.5] and their tree offers valleys (Argudo et al. 2019 call
//! this a dividing tree). A ridge is kept where it meets no drawn stroke, a valley where it meets neither a drawn stroke
//! nor a kept ridge. Heights are linear along each line.
//!
//! Departures: the paper normalises heights over the whole sketch, so here its unit interval is mapped to the range of
//! the drawn heights (or to a given range), or to a band around a surface ([`enhance_around`]): heights from the whole range make
//! walls and pits, the steeper the more lines there are. Lines also keep a clearance from each other, without which a ridge half a
//! cell beside a valley makes a cliff; ridges keep off drawn valleys too, not only off drawn ridges. Voronoi vertices
//! outside the map are left out. Cost: n log n for n nodes, plus (lines) x (drawn vertices) distance tests.

use crate::error::{Error, Result};
use crate::grid::{Cell, Grid};
use crate::seed::{Seed, Stream};
use crate::sketch::{Sketch, Stroke, StrokeKind, Vertex};
use petgraph::unionfind::UnionFind;
use rand::RngExt;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

/// How many random lines, how close and how high.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct RandomSketchConfig {
    /// Number of ridge nodes, n in the paper (which names no number); 0 adds nothing. The default of 40 suits 128x128
    /// cells: ridges about 13 cells long.
    pub(crate) nodes: usize,
    /// Least distance of a random line from a drawn stroke, and of a random valley from a random ridge, in cells; with 0
    /// they merely do not touch, as in the paper.
    pub(crate) clearance: f64,
    /// Heights (low, high) that the unit interval stands for, in the unit of the sketch; without it the lowest and the
    /// highest drawn vertex.
    pub(crate) height_range: Option<(f64, f64)>,
}

impl Default for RandomSketchConfig {
    fn default() -> Self {
        Self { nodes: 40, clearance: 2.0, height_range: None }
    }
}

impl RandomSketchConfig {
    /// The most nodes that are accepted.
    pub(crate) const MOST_NODES: usize = 100_000;

    /// # Errors
    /// When there are too many nodes, the clearance is negative or not finite, or the height range is not two finite
    /// heights, the lower one first.
    pub(crate) fn validate(&self) -> Result<()> {
        if self.nodes > Self::MOST_NODES {
            let allowed = format!("allowed: 0 to {}", Self::MOST_NODES);
            return Err(Error::value("random.nodes", self.nodes, allowed));
        }
        if !(self.clearance.is_finite() && self.clearance >= 0.0) {
            return Err(Error::value("random.clearance", self.clearance, "allowed: finite, at least 0"));
        }
        if let Some((low, high)) = self.height_range
            && !((low as f32).is_finite() && (high as f32).is_finite() && low < high)
        {
            return Err(Error::value(
                "random.height_range",
                format!("{low},{high}"),
                "allowed: two finite heights, the lower one first",
            ));
        }
        Ok(())
    }
}

/// The sketch with random ridges and valleys added: valleys, ridges, and last the drawn strokes as they were, so that
/// drawn cells stay drawn when the sketch is rasterized.
///
/// # Errors
/// When the sketch or the configuration is not valid, or no height range is given and the sketch has none (no stroke, or
/// all on one level).
pub(crate) fn enhance(sketch: &Sketch, config: &RandomSketchConfig, seed: Seed) -> Result<Sketch> {
    sketch.validate()?;
    config.validate()?;
    if config.nodes == 0 {
        return Ok(sketch.clone());
    }
    let (low, high) = match config.height_range.or(sketch.height_range()) {
        Some((low, high)) if low < high => (low, high),
        found => {
            let found = found.map_or("unknown: nothing is drawn".to_owned(), |(z, _)| format!("{z} to {z}"));
            return Err(Error::value(
                "height range of the sketch",
                found,
                "random lines need random.height_range, or strokes of different heights",
            ));
        }
    };
    with_lines(sketch, config, seed, &|node| low + node.height * (high - low))
}

/// As [`enhance`], but with heights around a surface: ridges up to `relief` above it, valleys up to `relief` below. The surface
/// has the shape of the sketch; both in the unit of the sketch. `config.height_range` is not read.
///
/// # Errors
/// When the sketch or the configuration is not valid, the relief is negative or not finite, or the surface has another shape.
pub(crate) fn enhance_around(
    sketch: &Sketch,
    config: &RandomSketchConfig,
    surface: &Grid<f64>,
    relief: f64,
    seed: Seed,
) -> Result<Sketch> {
    sketch.validate()?;
    config.validate()?;
    if !(relief.is_finite() && relief >= 0.0) {
        return Err(Error::value("relief of random lines", relief, "allowed: finite, at least 0"));
    }
    if surface.shape() != (sketch.rows, sketch.cols) {
        let allowed = format!("the sketch is {:?}", (sketch.rows, sketch.cols));
        return Err(Error::value("surface of random lines", format!("{:?}", surface.shape()), allowed));
    }
    if config.nodes == 0 {
        return Ok(sketch.clone());
    }
    let ground = |node: Node| surface[Cell::new(node.y.round() as usize, node.x.round() as usize)];
    with_lines(sketch, config, seed, &|node| ground(node) + relief * (2.0 * node.height - 1.0))
}

fn with_lines(
    sketch: &Sketch,
    config: &RandomSketchConfig,
    seed: Seed,
    z: &dyn Fn(Node) -> f64,
) -> Result<Sketch> {
    let drawn: Vec<Segment> = sketch.strokes.iter().flat_map(segments_of).collect();
    let is_clear = |line: &Segment, others: &[Segment]| {
        others.iter().all(|other| !line.comes_within(other, config.clearance))
    };

    let nodes = random_nodes(sketch, config.nodes, seed);
    let mut ridges = spanning_tree(&nodes);
    ridges.retain(|line| is_clear(line, &drawn));
    let mut valleys = spanning_tree(&voronoi_vertices(&nodes, sketch, seed));
    valleys.retain(|line| is_clear(line, &drawn) && is_clear(line, &ridges));

    let stroke = |kind| {
        move |Segment(a, b): Segment| Stroke {
            kind,
            vertices: [a, b].map(|n| Vertex { x: n.x, y: n.y, z: z(n) }).to_vec(),
        }
    };
    let mut strokes: Vec<Stroke> = valleys.into_iter().map(stroke(StrokeKind::Valley)).collect();
    strokes.extend(ridges.into_iter().map(stroke(StrokeKind::Ridge)));
    strokes.extend(sketch.strokes.iter().cloned());
    Sketch::new(sketch.rows, sketch.cols, strokes)
}

/// A point of the map, in cells, with a height in the unit interval.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    x: f64,
    y: f64,
    height: f64,
}

impl HasPosition for Node {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.x, self.y)
    }
}

impl Node {
    /// On a lattice of a millionth of a cell: Voronoi vertices that coincide but for rounding become one.
    fn at(x: f64, y: f64, height: f64) -> Self {
        const LATTICE: f64 = (1 << 20) as f64;
        let snap = |v: f64| (v * LATTICE).round() / LATTICE;
        Self { x: snap(x), y: snap(y), height }
    }

    fn distance(self, other: Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }
}

fn random_nodes(sketch: &Sketch, count: usize, seed: Seed) -> Vec<Node> {
    let mut places = seed.stream("random ridge places");
    let mut heights = seed.stream("random ridge heights");
    let (east, south) = ((sketch.cols - 1) as f64, (sketch.rows - 1) as f64);
    let mut coordinate = |side: f64| -> f64 { places.random_range(0.0..=side) };
    (0..count)
        .map(|_| Node::at(coordinate(east), coordinate(south), heights.random_range(0.5..=1.0)))
        .collect()
}

fn voronoi_vertices(nodes: &[Node], sketch: &Sketch, seed: Seed) -> Vec<Node> {
    let mut heights: Stream = seed.stream("random valley heights");
    let (east, south) = ((sketch.cols - 1) as f64, (sketch.rows - 1) as f64);
    // The corners of the Voronoi cells are the centres of the circles around the Delaunay triangles.
    let centres = triangulation(nodes);
    let centres = centres.inner_faces().map(|face| face.circumcenter());
    let inside = centres.filter(|c| (0.0..=east).contains(&c.x) && (0.0..=south).contains(&c.y));
    inside.map(|c| Node::at(c.x, c.y, heights.random_range(0.0..=0.5))).collect()
}

fn triangulation(nodes: &[Node]) -> DelaunayTriangulation<Node> {
    let mut triangulation = DelaunayTriangulation::new();
    for &node in nodes {
        triangulation.insert(node).expect("coordinates on the lattice of the map are in spade's range");
    }
    triangulation
}

/// The Euclidean minimum spanning tree: Kruskal's over the edges of the Delaunay triangulation, which contain it.
fn spanning_tree(nodes: &[Node]) -> Vec<Segment> {
    let triangulation = triangulation(nodes);
    let mut edges: Vec<(f64, [usize; 2])> = triangulation
        .undirected_edges()
        .map(|edge| (edge.length_2(), edge.vertices().map(|v| v.index())))
        .collect();
    edges.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut trees = UnionFind::<usize>::new(triangulation.num_vertices());
    edges.retain(|(_, [a, b])| trees.union(*a, *b));
    let vertices: Vec<Node> = triangulation.vertices().map(|v| *v.data()).collect();
    edges.into_iter().map(|(_, [a, b])| Segment(vertices[a], vertices[b])).collect()
}

/// A straight line between two nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Segment(Node, Node);

fn segments_of(stroke: &Stroke) -> impl Iterator<Item = Segment> + '_ {
    let node = |v: &Vertex| Node { x: v.x, y: v.y, height: 0.0 };
    let single =
        (stroke.vertices.len() == 1).then(|| Segment(node(&stroke.vertices[0]), node(&stroke.vertices[0])));
    single.into_iter().chain(stroke.vertices.windows(2).map(move |w| Segment(node(&w[0]), node(&w[1]))))
}

impl Segment {
    /// Whether some point of one is at most `reach` from some point of the other (0: they touch or cross).
    fn comes_within(&self, other: &Self, reach: f64) -> bool {
        let apart = |a: (f64, f64), b: (f64, f64)| a.0.min(a.1) - b.0.max(b.1) > reach;
        let (x, y) = ((self.0.x, self.1.x), (self.0.y, self.1.y));
        let (u, v) = ((other.0.x, other.1.x), (other.0.y, other.1.y));
        if apart(x, u) || apart(u, x) || apart(y, v) || apart(v, y) {
            return false;
        }
        self.crosses(other)
            || self.distance(other.0) <= reach
            || self.distance(other.1) <= reach
            || other.distance(self.0) <= reach
            || other.distance(self.1) <= reach
    }

    /// Whether each has its ends on both sides of the other.
    fn crosses(&self, other: &Self) -> bool {
        let side = |s: &Self, p: Node| (s.1.x - s.0.x) * (p.y - s.0.y) - (s.1.y - s.0.y) * (p.x - s.0.x);
        side(self, other.0) * side(self, other.1) < 0.0 && side(other, self.0) * side(other, self.1) < 0.0
    }

    fn distance(&self, p: Node) -> f64 {
        let (dx, dy) = (self.1.x - self.0.x, self.1.y - self.0.y);
        let along = ((p.x - self.0.x) * dx + (p.y - self.0.y) * dy) / (dx * dx + dy * dy);
        // Not a number on a segment without length, whose only point is its end.
        let along = if along.is_nan() { 0.0 } else { along.clamp(0.0, 1.0) };
        p.distance(Node { x: self.0.x + along * dx, y: self.0.y + along * dy, height: 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Points = &'static [(f64, f64, f64)];

    fn drawn(strokes: &[(StrokeKind, Points)]) -> Sketch {
        let stroke = |(kind, points): &(StrokeKind, Points)| Stroke {
            kind: *kind,
            vertices: points.iter().map(|&(x, y, z)| Vertex { x, y, z }).collect(),
        };
        Sketch::new(128, 128, strokes.iter().map(stroke).collect()).unwrap()
    }

    fn cross() -> Sketch {
        drawn(&[
            (StrokeKind::Ridge, &[(10.0, 64.0, 900.0), (70.0, 50.0, 2000.0), (118.0, 64.0, 1200.0)]),
            (StrokeKind::Valley, &[(64.0, 5.0, 500.0), (60.0, 120.0, 400.0)]),
        ])
    }

    /// The random strokes of one kind.
    fn random(enhanced: &Sketch, kind: StrokeKind, drawn: usize) -> Vec<&Stroke> {
        let count = enhanced.strokes.len() - drawn;
        enhanced.strokes[..count].iter().filter(|s| s.kind == kind).collect()
    }

    #[test]
    fn ridges_rise_and_valleys_sink_by_at_most_the_relief() {
        let sketch = cross();
        let surface = Grid::from_fn(128, 128, |c| 10.0 * c.row as f64 + c.col as f64);
        let config = RandomSketchConfig::default();
        let around = |relief| enhance_around(&sketch, &config, &surface, relief, Seed(1)).unwrap();
        let lines = |sketch: &Sketch| -> Vec<(f64, f64)> {
            sketch.strokes.iter().flat_map(|s| s.vertices.iter().map(|v| (v.x, v.y))).collect()
        };
        assert_eq!(lines(&around(30.0)), lines(&enhance(&sketch, &config, Seed(1)).unwrap()));
        for (kind, sign) in [(StrokeKind::Ridge, 1.0), (StrokeKind::Valley, -1.0)] {
            let rises: Vec<f64> = random(&around(30.0), kind, 2)
                .iter()
                .flat_map(|s| s.vertices.iter())
                .map(|v| sign * (v.z - surface[Cell::new(v.y.round() as usize, v.x.round() as usize)]))
                .collect();
            assert!(rises.iter().all(|rise| (0.0..=30.0).contains(rise)));
            assert!(rises.iter().any(|rise| *rise > 15.0));
        }
        let wrong = enhance_around(&sketch, &config, &Grid::filled(4, 4, 0.0), 1.0, Seed(1));
        assert!(wrong.unwrap_err().to_string().contains("(128, 128)"));
        assert!(enhance_around(&sketch, &config, &surface, f64::NAN, Seed(1)).is_err());
    }

    #[test]
    fn a_drawing_gets_many_lines_and_keeps_its_own() {
        let sketch = cross();
        let enhanced = enhance(&sketch, &RandomSketchConfig::default(), Seed(1)).unwrap();
        assert_eq!(enhanced.strokes[enhanced.strokes.len() - 2..], sketch.strokes);
        let counts = [StrokeKind::Ridge, StrokeKind::Valley].map(|k| random(&enhanced, k, 2).len());
        assert!(counts.iter().all(|&n| n >= 10), "{counts:?}");
        let (before, after) = (sketch.rasterize(), enhanced.rasterize());
        for (cell, kind) in before.kinds().cells().filter(|(_, k)| k.is_some()) {
            assert_eq!((after.kinds()[cell], after.heights()[cell]), (*kind, before.heights()[cell]));
        }
        assert!(after.line_count() > 2 * before.line_count());
    }

    #[test]
    fn heights_are_linear_within_half_the_range() {
        for (range, expected) in [(None, (400.0, 2000.0)), (Some((-1.0, 1.0)), (-1.0, 1.0))] {
            let config = RandomSketchConfig { height_range: range, ..RandomSketchConfig::default() };
            let enhanced = enhance(&cross(), &config, Seed(2)).unwrap();
            let middle = (expected.0 + expected.1) / 2.0;
            for (kind, low, high) in
                [(StrokeKind::Ridge, middle, expected.1), (StrokeKind::Valley, expected.0, middle)]
            {
                for stroke in random(&enhanced, kind, 2) {
                    assert_eq!(stroke.vertices.len(), 2, "two ends: linear between them");
                    assert!(stroke.vertices.iter().all(|v| (low..=high).contains(&v.z)));
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_filled_is_refused_with_the_remedy() {
        let flat = drawn(&[(StrokeKind::Ridge, &[(1.0, 1.0, 5.0), (9.0, 1.0, 5.0)])]);
        for sketch in [&flat, &drawn(&[])] {
            let message = enhance(sketch, &RandomSketchConfig::default(), Seed(1)).unwrap_err().to_string();
            assert!(message.contains("random.height_range"), "{message}");
            let config =
                RandomSketchConfig { height_range: Some((0.0, 1.0)), ..RandomSketchConfig::default() };
            assert!(enhance(sketch, &config, Seed(1)).unwrap().strokes.len() > 20);
        }
        let bad = [
            RandomSketchConfig { nodes: 100_001, ..RandomSketchConfig::default() },
            RandomSketchConfig { clearance: f64::NAN, ..RandomSketchConfig::default() },
            RandomSketchConfig { height_range: Some((1.0, 1.0)), ..RandomSketchConfig::default() },
        ];
        for (config, name) in bad.iter().zip(["nodes", "clearance", "height_range"]) {
            assert!(enhance(&flat, config, Seed(1)).unwrap_err().to_string().contains(name));
        }
    }

    #[test]
    fn few_nodes_and_thin_maps_are_no_trouble() {
        for (rows, cols) in [(1, 1), (1, 40), (40, 1), (2, 2)] {
            let sketch = Sketch::new(rows, cols, Vec::new()).unwrap();
            for nodes in [0, 1, 2, 3, 30] {
                let config = RandomSketchConfig { nodes, height_range: Some((0.0, 1.0)), clearance: 0.0 };
                let enhanced = enhance(&sketch, &config, Seed(3)).unwrap();
                assert_eq!(enhanced.rasterize().shape(), (rows, cols));
            }
        }
    }

    #[test]
    fn segments_know_their_distance() {
        let s = |a: (f64, f64), b: (f64, f64)| Segment(Node::at(a.0, a.1, 0.0), Node::at(b.0, b.1, 0.0));
        let base = s((0.0, 0.0), (10.0, 0.0));
        assert!(base.comes_within(&s((5.0, -5.0), (6.0, 5.0)), 0.0), "crossing");
        assert!(base.comes_within(&s((5.0, 0.0), (6.0, 5.0)), 0.0), "touching");
        assert!(base.comes_within(&s((12.0, 0.0), (14.0, 0.0)), 2.0), "in line");
        assert!(!base.comes_within(&s((12.0, 0.0), (14.0, 0.0)), 1.9));
        assert!(!base.comes_within(&s((0.0, 3.0), (10.0, 3.0)), 2.9), "beside");
        assert!(base.comes_within(&s((4.0, 1.0), (4.0, 1.0)), 1.0), "a point");
    }

    /// The length of the tree by Prim's algorithm on all pairs.
    fn tree_length(nodes: &[Node]) -> f64 {
        let mut reach: Vec<f64> = nodes.iter().map(|n| n.distance(nodes[0])).collect();
        let mut open: Vec<usize> = (1..nodes.len()).collect();
        let mut total = 0.0;
        while !open.is_empty() {
            let next = (0..open.len()).min_by(|&a, &b| reach[open[a]].total_cmp(&reach[open[b]])).unwrap();
            let taken = open.swap_remove(next);
            total += reach[taken];
            for &i in &open {
                reach[i] = reach[i].min(nodes[i].distance(nodes[taken]));
            }
        }
        total
    }

    fn is_forest(lines: &[&Stroke]) -> bool {
        let key = |v: &Vertex| (v.x.to_bits(), v.y.to_bits());
        let mut ends: Vec<_> = lines.iter().flat_map(|s| s.vertices.iter().map(key)).collect();
        ends.sort_unstable();
        ends.dedup();
        let mut trees = UnionFind::<usize>::new(ends.len());
        let id = |v: &Vertex| ends.binary_search(&key(v)).unwrap();
        lines.iter().all(|s| trees.union(id(&s.vertices[0]), id(&s.vertices[1])))
    }

    /// Whether two strokes come within `clearance`, by walking along both: independent of the test that chose them.
    fn meet(a: &Stroke, b: &Stroke, clearance: f64) -> bool {
        let points = |s: &Stroke| -> Vec<(f64, f64)> {
            let walk = |w: &[Vertex]| {
                let (v, w) = (w[0], w[1]);
                (0..=60)
                    .map(move |i| f64::from(i) / 60.0)
                    .map(move |t| (v.x + t * (w.x - v.x), v.y + t * (w.y - v.y)))
            };
            s.vertices.windows(2).flat_map(walk).collect()
        };
        let (a, b) = (points(a), points(b));
        a.iter().any(|p| b.iter().any(|q| (p.0 - q.0).hypot(p.1 - q.1) < clearance))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        #[test]
        fn lines_are_trees_that_keep_off_each_other(seed: u64, nodes in 2_usize..80) {
            let config = RandomSketchConfig { nodes, ..RandomSketchConfig::default() };
            let sketch = cross();
            let enhanced = enhance(&sketch, &config, Seed(seed)).unwrap();
            prop_assert_eq!(&enhanced, &enhance(&sketch, &config, Seed(seed)).unwrap());
            let [ridges, valleys] = [StrokeKind::Ridge, StrokeKind::Valley].map(|k| random(&enhanced, k, 2));
            prop_assert!(ridges.len() < nodes && is_forest(&ridges) && is_forest(&valleys));
            for own in &sketch.strokes {
                prop_assert!(!ridges.iter().chain(&valleys).any(|s| meet(s, own, config.clearance)));
            }
            for valley in &valleys {
                prop_assert!(!ridges.iter().any(|ridge| meet(ridge, valley, config.clearance)));
            }
            for v in enhanced.strokes.iter().flat_map(|s| &s.vertices) {
                prop_assert!((0.0..=127.0).contains(&v.x) && (0.0..=127.0).contains(&v.y));
            }
        }

        #[test]
        fn the_tree_is_the_shortest(seed: u64, count in 2_usize..60) {
            let nodes = random_nodes(&cross(), count, Seed(seed));
            let tree = spanning_tree(&nodes);
            prop_assert_eq!(tree.len(), count - 1);
            let length: f64 = tree.iter().map(|Segment(a, b)| a.distance(*b)).sum();
            prop_assert!((length - tree_length(&nodes)).abs() < 1e-6);
        }
    }
}
