//! The edges of one forward pass: the fixed ones of the graph, random ones, noise and masked parts.

use super::graph::RegionGraph;
use crate::seed::Seed;
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use std::sync::Arc;

/// Noise values of one stream: fixed, so that the same bytes come out on any number of threads.
const NOISE_CHUNK: usize = 16_384;

/// What is drawn anew for every pass (4.2: random edges; A.2: masked parts; A.4: noise).
#[derive(Debug)]
pub struct PassEdges {
    graph: Arc<RegionGraph>,
    /// Random edges sorted by pixel: those of pixel p are `random_offsets[p]..random_offsets[p + 1]`.
    random_offsets: Vec<u32>,
    random_regions: Vec<u32>,
    /// (random edges, features)
    random_features: Vec<f32>,
    /// The same edges by region: pixels.
    region_offsets: Vec<u32>,
    region_pixels: Vec<u32>,
    /// One value an edge: fixed edges, then random ones.
    noise: Vec<f32>,
    masked: Vec<bool>,
}

/// One edge as the kernels see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge<'a> {
    pub(super) region: usize,
    /// (features)
    pub(super) features: &'a [f32],
    pub(super) noise: f32,
}

impl PassEdges {
    /// Draws `random` edges, noise of standard deviation `noise`, and masks each part with probability `masked`.
    #[must_use]
    pub fn draw(graph: &Arc<RegionGraph>, random: usize, noise: f64, masked: f64, seed: Seed) -> Self {
        let (pixels, regions, n) = (graph.pixel_count(), graph.region_count(), graph.feature_count());
        let mut stream = seed.stream("random edges");
        let drawn: Vec<(u32, u32)> = (0..random)
            .map(|_| (stream.random_range(0..pixels as u32), stream.random_range(0..regions as u32)))
            .collect();
        let (random_offsets, random_regions) = sorted_by(&drawn, pixels, |e| e.0, |e| e.1);
        let (region_offsets, region_pixels) = sorted_by(&drawn, regions, |e| e.1, |e| e.0);
        let mut owner = Vec::with_capacity(random);
        for pixel in 0..pixels {
            owner.extend((random_offsets[pixel]..random_offsets[pixel + 1]).map(|_| pixel));
        }
        let mut random_features = vec![0.0; random * n];
        random_features.par_chunks_mut(n).enumerate().for_each(|(edge, out)| {
            graph.edge_features(owner[edge], random_regions[edge] as usize, out);
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
        Self { graph, random_offsets, random_regions, random_features, region_offsets, region_pixels, noise: values, masked }
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

    /// All regions tied to a pixel, fixed edges first.
    pub(super) fn regions_of(&self, pixel: usize) -> impl Iterator<Item = usize> {
        self.edges_of(pixel).map(|edge| edge.region)
    }

    /// All pixels tied to a region, fixed edges first.
    pub(super) fn pixels_of(&self, region: usize) -> impl Iterator<Item = usize> {
        let random = self.region_offsets[region] as usize..self.region_offsets[region + 1] as usize;
        self.graph.pixels_of(region).iter().chain(&self.region_pixels[random]).map(|&p| p as usize)
    }

    /// All edges of a pixel, fixed ones first.
    pub(super) fn edges_of(&self, pixel: usize) -> impl Iterator<Item = Edge<'_>> {
        let (k, n) = (self.graph.k(), self.graph.feature_count());
        let fixed_count = self.graph.pixel_count() * k;
        let fixed = (pixel * k..pixel * k + k).map(move |i| Edge {
            region: self.graph.nearest()[i] as usize,
            features: &self.graph.features()[i * n..i * n + n],
            noise: self.noise[i],
        });
        let random = self.random_offsets[pixel] as usize..self.random_offsets[pixel + 1] as usize;
        fixed.chain(random.map(move |i| Edge {
            region: self.random_regions[i] as usize,
            features: &self.random_features[i * n..i * n + n],
            noise: self.noise[fixed_count + i],
        }))
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
