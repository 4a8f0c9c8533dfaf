//! The edges of one forward pass: the fixed ones of the graph, random ones, noise and masked parts.

use super::graph::RegionGraph;
use crate::seed::Seed;
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Noise values of one stream: fixed, so that the same bytes come out on any number of threads.
const NOISE_CHUNK: usize = 16_384;

/// Pixels that the fused pass works on together: features and hidden states of their edges fit the first-level cache.
pub(super) const BLOCK: usize = 8;

/// What is drawn anew for every pass (4.2: random edges; A.2: masked parts; A.4: noise).
#[derive(Debug)]
pub struct PassEdges {
    graph: Arc<RegionGraph>,
    /// Random edges sorted by pixel: those of pixel p are `random_offsets[p]..random_offsets[p + 1]`.
    random_offsets: Vec<u32>,
    random_regions: Vec<u32>,
    /// Most random edges of [`BLOCK`] pixels in a row.
    most_random: u32,
    /// (random edges, stored)
    random_stored: Vec<f32>,
    /// The same edges by region: pixels.
    region_offsets: Vec<u32>,
    region_pixels: Vec<u32>,
    /// One value an edge: fixed edges, then random ones.
    noise: Vec<f32>,
    masked: Vec<bool>,
}

impl PassEdges {
    /// Draws `random` edges, noise of standard deviation `noise`, and masks each part with probability `masked`.
    #[must_use]
    pub fn draw(graph: &Arc<RegionGraph>, random: usize, noise: f64, masked: f64, seed: Seed) -> Self {
        let (pixels, regions, n) =
            (graph.pixel_count(), graph.region_count(), graph.features().stored_count());
        let mut stream = seed.stream("random edges");
        let drawn: Vec<(u32, u32)> = (0..random)
            .map(|_| (stream.random_range(0..pixels as u32), stream.random_range(0..regions as u32)))
            .collect();
        let (random_offsets, random_regions) = sorted_by(&drawn, pixels, |e| e.0, |e| e.1);
        let (region_offsets, region_pixels) = sorted_by(&drawn, regions, |e| e.1, |e| e.0);
        let last = |start: usize| (start + BLOCK).min(pixels);
        let in_block = |start: usize| random_offsets[last(start)] - random_offsets[start];
        let most_random = (0..pixels).map(in_block).max().unwrap_or(0);
        let mut owner = Vec::with_capacity(random);
        for pixel in 0..pixels {
            owner.extend((random_offsets[pixel]..random_offsets[pixel + 1]).map(|_| pixel));
        }
        let mut random_stored = vec![0.0; random * n];
        random_stored.par_chunks_mut(n).enumerate().for_each(|(edge, out)| {
            let values = graph.stored_for(owner[edge], random_regions[edge] as usize);
            out.copy_from_slice(&values[..n]);
        });
        let mut values = vec![0.0f32; pixels * graph.k() + random];
        values.par_chunks_mut(NOISE_CHUNK).enumerate().for_each(|(chunk, values)| {
            let mut stream = seed.derive_indexed("edge noise", chunk).stream("values");
            for value in values {
                *value = stream.sample::<f32, _>(StandardNormal) * noise as f32;
            }
        });
        let mut stream = seed.stream("masked parts");
        let masked = (0..regions).map(|_| stream.random_bool(masked)).collect();
        let graph = Arc::clone(graph);
        Self {
            graph,
            random_offsets,
            random_regions,
            most_random,
            random_stored,
            region_offsets,
            region_pixels,
            noise: values,
            masked,
        }
    }

    /// The graph whose edges these are.
    #[must_use]
    pub fn graph(&self) -> &RegionGraph {
        &self.graph
    }

    /// Which regions are masked in this pass.
    #[must_use]
    pub fn masked(&self) -> &[bool] {
        &self.masked
    }

    /// Number of edges of a pixel, masked ones included.
    #[must_use]
    pub fn pixel_degree(&self, pixel: usize) -> usize {
        self.graph.k() + (self.random_offsets[pixel + 1] - self.random_offsets[pixel]) as usize
    }

    /// Number of edges of a region.
    #[must_use]
    pub fn region_degree(&self, region: usize) -> usize {
        let random = (self.region_offsets[region + 1] - self.region_offsets[region]) as usize;
        self.graph.pixels_of(region).len() + random
    }

    /// All pixels tied to a region, fixed edges first.
    pub(super) fn pixels_of(&self, region: usize) -> impl Iterator<Item = usize> {
        let random = self.region_offsets[region] as usize..self.region_offsets[region + 1] as usize;
        self.graph.pixels_of(region).iter().chain(&self.region_pixels[random]).map(|&p| p as usize)
    }

    /// Calls `f` with region, noise and stored values of every unmasked edge of a pixel, fixed ones first.
    #[inline(always)]
    pub(super) fn each_of(&self, pixel: usize, mut f: impl FnMut(u32, f32, &[f32])) {
        let (k, n) = (self.graph.k(), self.graph.features().stored_count());
        let mut some = |edges: Range<usize>, ends: &[u32], stored: &[f32], noise: &[f32]| {
            let stored = &stored[edges.start * n..edges.end * n];
            let ends = ends[edges.clone()].iter().zip(&noise[edges]);
            for ((&region, &noise), stored) in ends.zip(stored.chunks_exact(n)) {
                if !self.masked[region as usize] {
                    f(region, noise, stored);
                }
            }
        };
        let (fixed, random) = self.noise.split_at(self.graph.pixel_count() * k);
        some(pixel * k..(pixel + 1) * k, self.graph.nearest(), self.graph.stored(), fixed);
        let drawn = self.random_offsets[pixel] as usize..self.random_offsets[pixel + 1] as usize;
        some(drawn, &self.random_regions, &self.random_stored, random);
    }

    /// Most edges that [`BLOCK`] pixels in a row have.
    pub(super) fn most_edges_of_a_block(&self) -> usize {
        BLOCK * self.graph.k() + self.most_random as usize
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
