//! The network that the lines form: end points and junctions, joined by strokes with a Strahler order.
//!
//! [`LineMap`] -> [`SketchGraph`] (petgraph). Source: Strahler order as in Liu & Benes 2025, 4.1 and Fig. 3 (Horton
//! 1945, Strahler 1952).
//!
//! Drawn lines have no flow, so the order is counted towards a root: of each connected network, the lowest end of a
//! valley network and the highest end of a ridge network (a ridge is a valley of -z). Where a network has rings, the
//! tree grows from the root over the lowest (ridges: highest) next point, and each line that would close a ring counts
//! as a tributary of order 1 where it meets the point nearer to the root; not so a line shorter than five cells (the
//! paper's shortest part), because strokes that meet at a sharp angle leave such eyelets on the raster. Cost: m log m in the number of lines.

#[cfg(test)]
use super::Sketch;
use super::chains::{Chain, Links};
use super::{LineMap, StrokeKind};
use crate::grid::{Cell, Grid, d8};
use petgraph::graph::{EdgeIndex, NodeIndex, UnGraph};
use petgraph::visit::EdgeRef;
use std::collections::BinaryHeap;

/// An end point, a junction, or a point of its own.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SketchNode {
    /// Ridge or valley.
    pub(crate) kind: StrokeKind,
    /// Where; of a junction of several cells the first in reading order.
    pub(crate) cell: Cell,
    /// Height there, in the unit of the lines.
    pub(crate) height: f32,
}

/// A line between two nodes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SketchEdge {
    /// Ridge or valley.
    pub(crate) kind: StrokeKind,
    /// The cells from node to node, both ends included.
    pub(crate) cells: Vec<Cell>,
    /// Height at each cell, in the unit of the lines.
    pub(crate) heights: Vec<f32>,
    /// Length in cells (a diagonal step counts sqrt 2).
    pub(crate) length: f64,
    /// Strahler order, from 1.
    pub(crate) order: u32,
}

/// Ridge and valley networks as one graph without links between the kinds.
#[derive(Clone, Debug)]
pub(crate) struct SketchGraph {
    graph: UnGraph<SketchNode, SketchEdge>,
    ridge_streams: Vec<usize>,
    valley_streams: Vec<usize>,
}

impl SketchGraph {
    /// The network of the lines.
    #[must_use]
    pub(crate) fn of(lines: &LineMap) -> Self {
        let mut graph = UnGraph::default();
        let mut streams = [StrokeKind::Ridge, StrokeKind::Valley].map(|kind| {
            let nodes: Vec<NodeIndex> = add_lines(&mut graph, lines, kind);
            order_lines(&mut graph, &nodes, kind)
        });
        let [ridge_streams, valley_streams] = streams.each_mut().map(std::mem::take);
        Self { graph, ridge_streams, valley_streams }
    }

    /// The network of a sketch on its raster.
    ///
    /// # Panics
    /// When the sketch is not valid.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn of_sketch(sketch: &Sketch) -> Self {
        Self::of(&sketch.rasterize())
    }

    /// Nodes and lines.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn graph(&self) -> &UnGraph<SketchNode, SketchEdge> {
        &self.graph
    }

    /// The lines of one kind.
    pub(crate) fn edges(&self, kind: StrokeKind) -> impl Iterator<Item = &SketchEdge> {
        self.graph.edge_weights().filter(move |e| e.kind == kind)
    }

    /// Summed length of the lines of one kind, in cells.
    #[must_use]
    pub(crate) fn length(&self, kind: StrokeKind) -> f64 {
        self.edges(kind).map(|e| e.length).sum()
    }

    /// Number of streams by Strahler order, order 1 first: a stream is a chain of lines of one order.
    #[must_use]
    pub(crate) fn stream_counts(&self, kind: StrokeKind) -> &[usize] {
        match kind {
            StrokeKind::Ridge => &self.ridge_streams,
            StrokeKind::Valley => &self.valley_streams,
        }
    }

    /// Mean over the orders of (streams of an order) / (streams of the next); natural river networks have 3 to 5.
    /// `None` when there is only one order.
    #[must_use]
    pub(crate) fn bifurcation_ratio(&self, kind: StrokeKind) -> Option<f64> {
        let ratios = self.stream_counts(kind).windows(2).map(|w| w[0] as f64 / w[1] as f64);
        let (sum, count) = ratios.fold((0.0, 0), |(sum, n), r| (sum + r, n + 1));
        (count > 0).then(|| sum / f64::from(count))
    }
}

/// Adds the lines of one kind, with order 0, and gives back their nodes.
fn add_lines(
    graph: &mut UnGraph<SketchNode, SketchEdge>,
    lines: &LineMap,
    kind: StrokeKind,
) -> Vec<NodeIndex> {
    let (rows, cols) = lines.shape();
    let links = Links::new(lines, kind);
    let mut node_at: Grid<Option<NodeIndex>> = Grid::filled(rows, cols, None);
    let mut nodes = Vec::new();
    let mut stack = Vec::new();
    for first in links.cells().filter(|&cell| links.is_end(cell)) {
        if node_at[first].is_some() {
            continue;
        }
        let node = graph.add_node(SketchNode { kind, cell: first, height: lines.heights()[first] });
        nodes.push(node);
        // Junction cells that touch are one junction: otherwise every thick crossing would be a maze of its own.
        node_at[first] = Some(node);
        stack.push(first);
        while let Some(cell) = stack.pop() {
            let is_junction = |c: Cell| links.linked(c).count() > 2;
            for (_, other) in links.linked(cell) {
                if is_junction(cell) && is_junction(other) && node_at[other].is_none() {
                    node_at[other] = Some(node);
                    stack.push(other);
                }
            }
        }
    }
    for Chain { mut cells, closed } in links.chains() {
        if closed {
            // A ring has no end of its own: it gets a node at its lowest (ridge: highest) cell.
            let key = |&i: &usize| Reach::of(kind, lines.heights()[cells[i]], i);
            let at = (0..cells.len()).max_by_key(key).unwrap_or(0);
            cells.rotate_left(at);
            cells.push(cells[0]);
            let node = graph.add_node(SketchNode { kind, cell: cells[0], height: lines.heights()[cells[0]] });
            node_at[cells[0]] = Some(node);
            nodes.push(node);
        }
        let ends = [cells[0], cells[cells.len() - 1]].map(|cell| node_at[cell]);
        let [Some(a), Some(b)] = ends else { continue }; // unreachable: chains end at nodes
        let inside_one_junction = a == b && cells.len() <= 2;
        if !inside_one_junction {
            let heights = cells.iter().map(|&cell| lines.heights()[cell]).collect();
            let step =
                |w: &[Cell]| d8::code_between(w[0], w[1]).map_or(0.0, |c| d8::DISTANCES[usize::from(c)]);
            let length = cells.windows(2).map(step).sum();
            graph.add_edge(a, b, SketchEdge { kind, cells, heights, length, order: 0 });
        }
    }
    nodes
}

/// How soon the tree takes a point: the lowest valley point, the highest ridge point; ties by the lower index.
#[derive(PartialEq)]
struct Reach {
    eagerness: f32,
    index: usize,
}

impl Reach {
    fn of(kind: StrokeKind, height: f32, index: usize) -> Self {
        let eagerness = if kind == StrokeKind::Ridge { height } else { -height };
        Self { eagerness, index }
    }
}

impl Eq for Reach {}

impl Ord for Reach {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.eagerness.total_cmp(&other.eagerness).then(other.index.cmp(&self.index))
    }
}

impl PartialOrd for Reach {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Sets the Strahler order of every line of one kind and counts the streams of each order.
fn order_lines(
    graph: &mut UnGraph<SketchNode, SketchEdge>,
    nodes: &[NodeIndex],
    kind: StrokeKind,
) -> Vec<usize> {
    let reach = |graph: &UnGraph<SketchNode, SketchEdge>, node: NodeIndex| {
        Reach::of(kind, graph[node].height, node.index())
    };
    // Roots: real ends before junctions, so that a network drains at an end where it has one.
    let mut roots = nodes.to_vec();
    roots.sort_by_key(|&n| std::cmp::Reverse((graph.edges(n).count() <= 1, reach(graph, n))));

    // Every node in the order in which the trees take it, and the line that leads from it towards the root.
    let mut place = vec![usize::MAX; graph.node_count()];
    let mut outlet: Vec<Option<EdgeIndex>> = vec![None; graph.node_count()];
    let mut taken = Vec::new();
    for root in roots {
        let mut front = BinaryHeap::from([(reach(graph, root), root, None)]);
        while let Some((_, node, via)) = front.pop() {
            if place[node.index()] != usize::MAX {
                continue;
            }
            place[node.index()] = taken.len();
            outlet[node.index()] = via;
            taken.push(node);
            for edge in graph.edges(node) {
                let next = if edge.source() == node { edge.target() } else { edge.source() };
                if place[next.index()] == usize::MAX {
                    front.push((reach(graph, next), next, Some(edge.id())));
                }
            }
        }
    }

    // Against that order, every tributary of a node has its order before the node's own outlet asks for it.
    const SHORTEST_TO_CLOSE_A_RING: f64 = 5.0;
    let mut streams = Vec::new();
    let mut count_stream = |order: u32| {
        let index = order as usize - 1;
        streams.resize(streams.len().max(index + 1), 0);
        streams[index] += 1;
    };
    for &node in taken.iter().rev() {
        let own = outlet[node.index()];
        let mut tributaries: Vec<(EdgeIndex, u32)> = Vec::new();
        let mut eyelets = Vec::new();
        for edge in graph.edges(node) {
            let other = if edge.source() == node { edge.target() } else { edge.source() };
            let arrives = place[other.index()] >= place[node.index()] && Some(edge.id()) != own;
            if arrives && !tributaries.iter().any(|&(id, _)| id == edge.id()) {
                // A line that closes a ring has no order yet: it begins here.
                let closes = outlet[other.index()] != Some(edge.id());
                if closes && other != node && edge.weight().length < SHORTEST_TO_CLOSE_A_RING {
                    eyelets.push(edge.id());
                } else {
                    tributaries.push((edge.id(), if closes { 1 } else { edge.weight().order }));
                }
            }
        }
        let highest = tributaries.iter().map(|t| t.1).max().unwrap_or(0);
        let equals = tributaries.iter().filter(|t| t.1 == highest).count();
        let order = if equals >= 2 || highest == 0 { highest + 1 } else { highest };
        for &(id, tributary) in &tributaries {
            graph[id].order = tributary;
            // A stream ends where the order changes, and at the root.
            if own.is_none() || order != tributary {
                count_stream(tributary);
            }
        }
        for id in eyelets {
            graph[id].order = 1;
        }
        if let Some(own) = own {
            graph[own].order = order;
        }
    }
    streams
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::{Stroke, Vertex};
    use proptest::prelude::*;

    fn sketch(kind: StrokeKind, strokes: &[&[(f64, f64, f64)]]) -> SketchGraph {
        let stroke = |points: &&[(f64, f64, f64)]| Stroke {
            kind,
            vertices: points.iter().map(|&(x, y, z)| Vertex { x, y, z }).collect(),
        };
        SketchGraph::of_sketch(&Sketch::new(64, 64, strokes.iter().map(stroke).collect()).unwrap())
    }

    /// Four sources, two confluences of order 2, one of order 3, and the mouth at the south.
    const RIVER: [&[(f64, f64, f64)]; 5] = [
        &[(32.0, 60.0, 0.0), (32.0, 40.0, 2.0)],
        &[(32.0, 40.0, 2.0), (16.0, 24.0, 4.0), (8.0, 8.0, 8.0)],
        &[(32.0, 40.0, 2.0), (48.0, 24.0, 4.0), (56.0, 8.0, 8.0)],
        &[(16.0, 24.0, 4.0), (24.0, 8.0, 9.0)],
        &[(48.0, 24.0, 4.0), (40.0, 8.0, 9.0)],
    ];

    #[test]
    fn a_river_of_four_sources_has_order_three() {
        let graph = sketch(StrokeKind::Valley, &RIVER);
        assert_eq!((graph.graph().node_count(), graph.graph().edge_count()), (8, 7));
        let mut orders: Vec<u32> = graph.edges(StrokeKind::Valley).map(|e| e.order).collect();
        orders.sort_unstable();
        assert_eq!(orders, [1, 1, 1, 1, 2, 2, 3]);
        assert_eq!(graph.stream_counts(StrokeKind::Valley), [4, 2, 1]);
        assert_eq!(graph.bifurcation_ratio(StrokeKind::Valley), Some(2.0));
        let trunk = graph.edges(StrokeKind::Valley).find(|e| e.order == 3).unwrap();
        assert_eq!(trunk.length, 20.0);
        assert!(graph.edges(StrokeKind::Ridge).next().is_none());
    }

    #[test]
    fn ridges_are_counted_towards_their_highest_end() {
        // As a ridge the same tree drains, on -z, to one of the two highest ends: three sources join one after another.
        let graph = sketch(StrokeKind::Ridge, &RIVER);
        let mut orders: Vec<u32> = graph.edges(StrokeKind::Ridge).map(|e| e.order).collect();
        orders.sort_unstable();
        assert_eq!(orders, [1, 1, 1, 1, 2, 2, 2]);
        assert_eq!(graph.stream_counts(StrokeKind::Ridge), [4, 1]);
    }

    #[test]
    fn a_side_stream_does_not_raise_a_higher_order() {
        let mut strokes = RIVER.to_vec();
        strokes.push(&[(32.0, 50.0, 1.0), (12.0, 50.0, 5.0)]);
        let graph = sketch(StrokeKind::Valley, &strokes);
        assert_eq!(graph.stream_counts(StrokeKind::Valley), [5, 2, 1], "both trunk lines are one stream");
    }

    #[test]
    fn the_eyelet_of_a_sharp_confluence_is_no_tributary() {
        let mut lines = LineMap::empty(8, 24);
        let main = (0..=20).map(|col| (5, col));
        let brook = [(0, 10), (1, 10), (2, 10), (3, 10), (4, 9), (3, 11), (4, 12)];
        for (row, col) in main.chain(brook) {
            lines.set(Cell::new(row, col), StrokeKind::Valley, 100.0 - row as f32 - col as f32);
        }
        let graph = SketchGraph::of(&lines);
        assert_eq!(graph.graph().edge_count(), 6, "the eyelet is on the graph");
        assert_eq!(
            graph.stream_counts(StrokeKind::Valley),
            [2, 1],
            "a source, a brook, and what they become"
        );
    }

    #[test]
    fn rings_points_and_loops_have_orders_too() {
        let ring: Vec<(f64, f64, f64)> = (0..=40)
            .map(|i| f64::from(i) * std::f64::consts::TAU / 40.0)
            .map(|a| (30.0 + 15.0 * a.cos(), 30.0 + 15.0 * a.sin(), 5.0 - a.sin()))
            .collect();
        let graph = sketch(StrokeKind::Valley, &[&ring, &[(2.0, 2.0, 1.0)]]);
        assert_eq!((graph.graph().node_count(), graph.graph().edge_count()), (2, 1));
        let edge = graph.edges(StrokeKind::Valley).next().unwrap();
        assert_eq!(edge.order, 1);
        assert_eq!(edge.cells.first(), edge.cells.last());
        assert_eq!(edge.cells[0], Cell::new(45, 30), "the ring's node is its lowest cell");

        let lasso = sketch(StrokeKind::Valley, &[&ring, &[(45.0, 30.0, 1.0), (62.0, 30.0, 0.0)]]);
        assert_eq!(lasso.stream_counts(StrokeKind::Valley), [1], "a loop and its stem are one stream");
    }

    proptest! {
        #[test]
        fn every_line_cell_is_in_the_graph_and_orders_obey_strahler(
            cells in prop::collection::vec((0_u8..3, 0.0_f32..1.0), 12 * 13),
        ) {
            let mut lines = LineMap::empty(12, 13);
            for (i, &(_, z)) in cells.iter().enumerate().filter(|(_, (c, _))| *c == 0) {
                lines.set(Cell::new(i / 13, i % 13), StrokeKind::Valley, z);
            }
            let built = SketchGraph::of(&lines);
            let graph = built.graph();
            let on_graph = graph.edge_weights().flat_map(|e| e.cells.iter().copied());
            let mut seen = Grid::filled(12, 13, false);
            on_graph.for_each(|cell| seen[cell] = true);
            for (cell, _) in lines.mask().cells().filter(|(_, on)| **on) {
                let links = Links::new(&lines, StrokeKind::Valley);
                prop_assert!(seen[cell] || links.is_end(cell), "an inner cell lies on a line");
            }
            prop_assert!(graph.edge_weights().all(|e| e.order >= 1));
            let total: usize = built.stream_counts(StrokeKind::Valley).iter().sum();
            prop_assert!(total <= graph.edge_count() && (total > 0) == (graph.edge_count() > 0));
            // An order w needs two streams of order w - 1.
            prop_assert!(built.stream_counts(StrokeKind::Valley).windows(2).all(|w| w[0] >= 2 * w[1]));
        }
    }
}
