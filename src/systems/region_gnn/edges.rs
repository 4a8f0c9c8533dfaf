//! The edges of one forward pass: the fixed ones of the graph, random ones, noise and masked parts.

use super::graph::RegionGraph;
use crate::seed::Seed;
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Noise values of one stream: fixed, so that the same bytes come out on any number of threads.
const NOISE_CHUNK: usize = 16_384;

/// Pixels that the fused pass works on together: features and hidden states of their edges fit the first-level cache.
pub(super) const BLOCK: usize = 8;
/// Room for edges comes in multiples of the widest register.
const LANES: usize = 16;

/// What is drawn anew for every pass (4.2: random edges; A.2: masked parts; A.4: noise).
///
/// Unmasked edges lie in the order in which the passes read them: by blocks of a few pixels, in each block by pixel, fixed
/// ones first; what an edge stores, a column a number, so that vector code reads it as it lies.
#[derive(Debug)]
pub struct PassEdges {
    graph: Arc<RegionGraph>,
    /// Random edges of pixel p: `random_offsets[p]..random_offsets[p + 1]` of those drawn.
    random_offsets: Vec<u32>,
    /// Random edges by region: pixels.
    region_offsets: Vec<u32>,
    region_pixels: Vec<u32>,
    masked: Vec<bool>,
    lists: Lists,
    spare: Spare,
}

/// Memory that one pass leaves to the next, whatever their graphs.
#[derive(Clone, Debug, Default)]
pub(super) struct Spare(Arc<Mutex<Lists>>);

impl Spare {
    fn lists(&self) -> MutexGuard<'_, Lists> {
        // Whoever panicked meanwhile: what is there is overwritten before it is read.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The edges block by block.
#[derive(Debug, Default)]
struct Lists {
    /// Edges of every block, and where its room begins: the edges before it, each block rounded up to [`LANES`], which an empty
    /// one has too.
    lengths: Vec<u32>,
    starts: Vec<usize>,
    /// (room) region of every edge; 0 where there is no edge.
    regions: Vec<u32>,
    /// (pixels) where the edges of each end within its block.
    ends: Vec<u32>,
    /// By blocks: (stored + 1, room of the block), the last row for the noise; anything where there is no edge.
    columns: Vec<f32>,
}

/// The unmasked edges of [`BLOCK`] pixels in a row.
#[derive(Clone, Copy)]
pub(super) struct BlockEdges<'a> {
    /// Number of edges.
    pub(super) len: usize,
    /// Room for edges and length of a row of `columns`: a multiple of [`LANES`].
    pub(super) stride: usize,
    /// (stride) region; 0 beyond the edges.
    pub(super) regions: &'a [u32],
    /// (pixels of the block) where the edges of each end.
    pub(super) ends: &'a [u32],
    /// (stored + 1, stride), the last row for the noise; anything beyond the edges.
    pub(super) columns: &'a [f32],
}

/// Random edges by pixel, in the order in which they were drawn.
struct RandomEdges {
    offsets: Vec<u32>,
    regions: Vec<u32>,
}

/// Where the edges of one block go.
struct BlockRows<'a> {
    block: usize,
    regions: &'a mut [u32],
    ends: &'a mut [u32],
    columns: &'a mut [f32],
}

impl PassEdges {
    /// 1 for regions with an edge that is not masked, 0 for the others: a node that nothing reaches gathers nothing, not even a
    /// bias.
    pub(super) fn reached_regions(&self) -> Vec<f32> {
        let reached = |(region, masked): (usize, &bool)| !masked && self.region_degree(region) > 0;
        self.masked().iter().enumerate().map(|r| if reached(r) { 1.0 } else { 0.0 }).collect()
    }

    /// Draws `random` edges, noise of standard deviation `noise`, and masks each part with probability `masked`.
    #[must_use]
    pub fn draw(graph: &Arc<RegionGraph>, random: usize, noise: f64, masked: f64, seed: Seed) -> Self {
        Self::draw_into(&Spare::default(), graph, random, noise, masked, seed)
    }

    /// As [`draw`](Self::draw), in memory that an earlier pass has left.
    pub(super) fn draw_into(
        spare: &Spare,
        graph: &Arc<RegionGraph>,
        random: usize,
        noise: f64,
        masked: f64,
        seed: Seed,
    ) -> Self {
        let (pixels, regions) = (graph.pixel_count(), graph.region_count());
        let mut stream = seed.stream("random edges");
        let drawn: Vec<(u32, u32)> = (0..random)
            .map(|_| (stream.random_range(0..pixels as u32), stream.random_range(0..regions as u32)))
            .collect();
        let (offsets, random_regions) = sorted_by(&drawn, pixels, |e| e.0, |e| e.1);
        let (region_offsets, region_pixels) = sorted_by(&drawn, regions, |e| e.1, |e| e.0);
        let mut values = vec![0.0f32; pixels * graph.k() + random];
        values.par_chunks_mut(NOISE_CHUNK).enumerate().for_each(|(chunk, values)| {
            if graph.stop().is_raised() {
                return;
            }
            let mut stream = seed.derive_indexed("edge noise", chunk).stream("values");
            for value in values {
                *value = stream.sample::<f32, _>(StandardNormal) * noise as f32;
            }
        });
        let mut stream = seed.stream("masked parts");
        let masked = (0..regions).map(|_| stream.random_bool(masked)).collect();
        let mut edges = Self {
            graph: Arc::clone(graph),
            random_offsets: Vec::new(),
            region_offsets,
            region_pixels,
            masked,
            lists: std::mem::take(&mut spare.lists()),
            spare: spare.clone(),
        };
        edges.lay_out(RandomEdges { offsets, regions: random_regions }, &values);
        edges
    }

    /// Puts all edges that are not masked into their places.
    fn lay_out(&mut self, random: RandomEdges, noise: &[f32]) {
        let rows = self.graph.features().stored_count() + 1;
        let blocks = self.graph.pixel_count().div_ceil(BLOCK);
        let mut lists = std::mem::take(&mut self.lists);
        let count = |block| {
            let mut count = 0;
            self.each_drawn(block, &random, |_, _, _| count += 1);
            count
        };
        (0..blocks).into_par_iter().with_min_len(64).map(count).collect_into_vec(&mut lists.lengths);
        lists.starts.clear();
        lists.starts.push(0);
        let mut room = 0;
        for length in &lists.lengths {
            room += (*length as usize).max(1).next_multiple_of(LANES);
            lists.starts.push(room);
        }
        let Lists { starts, regions, ends, columns, .. } = &mut lists;
        regions.resize(room, 0);
        ends.clear();
        ends.resize(self.graph.pixel_count(), 0);
        columns.resize(room * rows, 0.0);
        let mut parts = Vec::with_capacity(blocks);
        let mut rest = (regions.as_mut_slice(), columns.as_mut_slice());
        for (block, ends) in ends.chunks_mut(BLOCK).enumerate() {
            let size = starts[block + 1] - starts[block];
            let (regions, rest_of_regions) = rest.0.split_at_mut(size);
            let (columns, rest_of_columns) = rest.1.split_at_mut(size * rows);
            rest = (rest_of_regions, rest_of_columns);
            parts.push(BlockRows { block, regions, ends, columns });
        }
        parts.into_par_iter().with_min_len(64).for_each(|part| {
            if !self.graph.stop().is_raised() {
                self.fill(part, &random, noise);
            }
        });
        self.lists = lists;
        self.random_offsets = random.offsets;
    }

    /// Writes the edges of one block.
    fn fill(&self, part: BlockRows<'_>, random: &RandomEdges, noise: &[f32]) {
        let (graph, fixed) = (&self.graph, self.graph.nearest().len());
        let n = graph.features().stored_count();
        let stride = part.regions.len();
        let mut ids = Vec::with_capacity(stride);
        self.each_drawn(part.block, random, |slot, region, edge| {
            part.regions[ids.len()] = region;
            ids.push(edge);
            part.ends[slot] = ids.len() as u32;
        });
        let at = ids.len();
        let (stored, noises) = part.columns.split_at_mut(n * stride);
        for (row, column) in stored.chunks_exact_mut(stride).enumerate() {
            for (value, edge) in column.iter_mut().zip(&ids).filter(|(_, edge)| **edge < fixed) {
                *value = graph.stored()[edge * n + row];
            }
        }
        for i in (0..at).filter(|&i| ids[i] >= fixed) {
            let slot = part.ends.iter().take_while(|end| **end as usize <= i).count();
            let pixel = part.block * BLOCK + slot;
            let drawn = graph.stored_for(pixel, part.regions[i] as usize);
            stored[i..].iter_mut().step_by(stride).zip(&drawn[..n]).for_each(|(to, value)| *to = *value);
        }
        for (value, edge) in noises.iter_mut().zip(&ids) {
            *value = noise[*edge];
        }
        part.regions[at..].fill(0);
        // Pixels without an edge end where the one before them does.
        for slot in 1..part.ends.len() {
            part.ends[slot] = part.ends[slot].max(part.ends[slot - 1]);
        }
    }

    /// Calls `f` with slot, region and number of every unmasked edge of a block: fixed ones count from 0, random ones after them.
    fn each_drawn(&self, block: usize, random: &RandomEdges, mut f: impl FnMut(usize, u32, usize)) {
        let (k, nearest) = (self.graph.k(), self.graph.nearest());
        for pixel in block * BLOCK..self.graph.pixel_count().min((block + 1) * BLOCK) {
            let fixed = pixel * k..(pixel + 1) * k;
            let drawn = random.offsets[pixel] as usize..random.offsets[pixel + 1] as usize;
            for (regions, edges, before) in [(nearest, fixed, 0), (&random.regions[..], drawn, nearest.len())]
            {
                for (edge, &region) in edges.clone().zip(&regions[edges]) {
                    if !self.masked[region as usize] {
                        f(pixel % BLOCK, region, before + edge);
                    }
                }
            }
        }
    }

    /// The graph whose edges these are.
    #[must_use]
    pub(crate) fn graph(&self) -> &RegionGraph {
        &self.graph
    }

    /// Which regions are masked in this pass.
    #[must_use]
    pub(crate) fn masked(&self) -> &[bool] {
        &self.masked
    }

    /// Number of edges of a pixel, masked ones included.
    #[must_use]
    pub(crate) fn pixel_degree(&self, pixel: usize) -> usize {
        self.graph.k() + (self.random_offsets[pixel + 1] - self.random_offsets[pixel]) as usize
    }

    /// Number of edges of a region.
    #[must_use]
    pub(crate) fn region_degree(&self, region: usize) -> usize {
        let random = (self.region_offsets[region + 1] - self.region_offsets[region]) as usize;
        self.graph.pixels_of(region).len() + random
    }

    /// All pixels tied to a region, fixed edges first.
    pub(super) fn pixels_of(&self, region: usize) -> impl Iterator<Item = usize> {
        let random = self.region_offsets[region] as usize..self.region_offsets[region + 1] as usize;
        self.graph.pixels_of(region).iter().chain(&self.region_pixels[random]).map(|&p| p as usize)
    }

    /// The unmasked edges of pixels `block * BLOCK` and the following.
    pub(super) fn block(&self, block: usize) -> BlockEdges<'_> {
        let rows = self.graph.features().stored_count() + 1;
        let lists = &self.lists;
        let room = lists.starts[block]..lists.starts[block + 1];
        let pixels = block * BLOCK..self.graph.pixel_count().min((block + 1) * BLOCK);
        BlockEdges {
            len: lists.lengths[block] as usize,
            stride: room.len(),
            regions: &lists.regions[room.clone()],
            ends: &lists.ends[pixels],
            columns: &lists.columns[room.start * rows..room.end * rows],
        }
    }

    /// Where the edges of whole blocks of pixels lie in a list with room for all edges.
    pub(super) fn room(&self, pixels: &Range<usize>) -> Range<usize> {
        let starts = &self.lists.starts;
        starts[pixels.start / BLOCK]..starts[pixels.end.div_ceil(BLOCK)]
    }

    /// Number of blocks.
    pub(super) fn block_count(&self) -> usize {
        self.lists.lengths.len()
    }

    /// Longest row of a block's columns.
    pub(super) fn longest_stride(&self) -> usize {
        self.lists.starts.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0)
    }
}

impl Drop for PassEdges {
    fn drop(&mut self) {
        *self.spare.lists() = std::mem::take(&mut self.lists);
    }
}

/// Counting sort of pairs by a key below `count`: (offsets, values), stable.
fn sorted_by(
    pairs: &[(u32, u32)],
    count: usize,
    key: impl Fn(&(u32, u32)) -> u32,
    value: impl Fn(&(u32, u32)) -> u32,
) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; count + 1];
    for pair in pairs {
        offsets[key(pair) as usize + 1] += 1;
    }
    for i in 0..count {
        offsets[i + 1] += offsets[i];
    }
    let mut next = offsets.clone();
    let mut values = vec![0u32; pairs.len()];
    for pair in pairs {
        let slot = &mut next[key(pair) as usize];
        values[*slot as usize] = value(pair);
        *slot += 1;
    }
    (offsets, values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;
    use crate::sketch::{LineMap, SketchPart, StrokeKind};
    use crate::systems::region_gnn::RegionGnnConfig;

    /// Parts along some rows of a map.
    fn graph(rows: usize, cols: usize) -> Arc<RegionGraph> {
        let mut lines = LineMap::empty(rows, cols);
        let parts: Vec<SketchPart> = (1..rows)
            .step_by(3)
            .map(|row| {
                let kind = if row % 2 == 0 { StrokeKind::Ridge } else { StrokeKind::Valley };
                let cells: Vec<Cell> = (row % 4..row % 4 + 6).map(|col| Cell::new(row, col)).collect();
                let heights: Vec<f32> = (0..6).map(|i| 0.1 * (row + i) as f32).collect();
                cells.iter().zip(&heights).for_each(|(&c, &z)| lines.set(c, kind, z));
                SketchPart { kind, cells, heights }
            })
            .collect();
        let config = RegionGnnConfig { neighbours: 3, ..RegionGnnConfig::paper() };
        Arc::new(RegionGraph::new(&lines, &parts, None, &config).unwrap())
    }

    /// (region, stored, noise) of every edge, by pixel.
    fn by_pixel(edges: &PassEdges) -> Vec<Vec<(u32, Vec<f32>, f32)>> {
        let mut all = Vec::new();
        for index in 0..edges.block_count() {
            let block = edges.block(index);
            assert!(block.stride.is_multiple_of(LANES) && block.len <= block.stride);
            let mut start = 0;
            for end in block.ends {
                let one = |edge: usize| {
                    let values: Vec<f32> = block.columns.chunks(block.stride).map(|c| c[edge]).collect();
                    let (noise, stored) = values.split_last().unwrap();
                    (block.regions[edge], stored.to_vec(), *noise)
                };
                all.push((start..*end as usize).map(one).collect());
                start = *end as usize;
            }
            assert_eq!(start, block.len);
        }
        all
    }

    #[test]
    fn every_unmasked_edge_lies_at_its_pixel_once() {
        let graph = graph(13, 13);
        let edges = PassEdges::draw(&graph, 90, 1.0, 0.4, Seed(3));
        let (k, n) = (graph.k(), graph.features().stored_count());
        let found = by_pixel(&edges);
        assert_eq!(found.len(), graph.pixel_count());
        assert!(edges.masked().contains(&true) && edges.masked().contains(&false));
        let mut random = vec![Vec::new(); graph.pixel_count()];
        for region in (0..graph.region_count()).filter(|r| !edges.masked()[*r]) {
            let fixed = graph.pixels_of(region).len();
            edges.pixels_of(region).skip(fixed).for_each(|pixel| random[pixel].push(region as u32));
        }
        assert!(random.iter().any(|regions| regions.len() > 1));
        for (pixel, found) in found.iter().enumerate() {
            let open = |region: &u32| !edges.masked()[*region as usize];
            let fixed: Vec<u32> =
                graph.nearest()[pixel * k..(pixel + 1) * k].iter().copied().filter(open).collect();
            let (near, far) = found.split_at(fixed.len());
            assert_eq!(near.iter().map(|e| e.0).collect::<Vec<_>>(), fixed);
            let mut regions: Vec<u32> = far.iter().map(|e| e.0).collect();
            regions.sort_unstable();
            assert_eq!(regions, random[pixel]);
            for (region, stored, noise) in found {
                assert_eq!(stored[..], graph.stored_for(pixel, *region as usize)[..n]);
                assert!(*noise != 0.0 && noise.abs() < 6.0);
            }
        }
    }

    #[test]
    fn memory_of_another_pass_changes_nothing() {
        let (small, large) = (graph(13, 13), graph(40, 31));
        let spare = Spare::default();
        drop(PassEdges::draw_into(&spare, &large, 500, 1.0, 0.0, Seed(1)));
        let reused = PassEdges::draw_into(&spare, &small, 90, 1.0, 0.4, Seed(3));
        assert_eq!(by_pixel(&reused), by_pixel(&PassEdges::draw(&small, 90, 1.0, 0.4, Seed(3))));
        for index in 0..reused.block_count() {
            let block = reused.block(index);
            assert!(block.regions[block.len..].iter().all(|region| *region == 0));
        }
    }
}
