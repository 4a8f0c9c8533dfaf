//! The bipartite graph of pixels and regions (Liu & Benes 2025, 4.2): every pixel to its k nearest parts.

use super::config::{HeightFrame, RegionGnnConfig};
use super::edge_features::{EdgeFeatures, Stored, Surroundings};
use super::nearest::nearest_regions;
use super::region::{Projection, Region};
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::Cell;
use crate::sketch::{LineMap, SketchPart, StrokeKind};
use rayon::prelude::*;

/// A sketch as the network sees it: everything that does not change from epoch to epoch.
///
/// Edge `pixel * k + j` ties a pixel to its j-th nearest region. Memory: about 40 bytes an edge.
#[derive(Debug)]
pub struct RegionGraph {
    rows: usize,
    cols: usize,
    k: usize,
    regions: Vec<Region>,
    /// (regions) what an edge knows of its part alone.
    sizes: Vec<f32>,
    /// (pixels, k) region of each edge, nearest first, ties by index.
    nearest: Vec<u32>,
    /// (pixels, k) index of the nearest cell on that region.
    projections: Vec<u8>,
    /// (pixels, k) pixel of that cell.
    projected: Vec<u32>,
    /// (pixels, k) distance to it, in cells.
    distances: Vec<f32>,
    /// How many of them are positive.
    long_edges: usize,
    features: EdgeFeatures,
    /// (pixels, k, stored)
    stored: Vec<f32>,
    /// Edges ordered by region: `by_region[offsets[r]..offsets[r + 1]]` are pixels.
    region_offsets: Vec<u32>,
    region_pixels: Vec<u32>,
    /// +1 at ridges, -1 at valleys (A.3).
    indicator: Vec<f32>,
    /// Line cells, row-major.
    line_cells: Vec<u32>,
    /// Their heights.
    line_heights: Vec<f32>,
    anchor: Option<Anchor>,
    /// Ends the passes over it.
    stop: Stop,
}

/// What makes the anchored model independent of offset and scale.
#[derive(Clone, Debug)]
pub(crate) struct Anchor {
    /// Interpolation of the sketch, one value a pixel.
    pub(crate) base: Vec<f32>,
    /// Relief of the sketch: 4 rms(height of the nearest part - mean height of the other k - 1).
    pub(crate) scale: f32,
}

impl RegionGraph {
    /// Ties every pixel of `lines` to its nearest `parts`. `base`: the interpolation from which an anchored model
    /// deviates, one value a pixel.
    ///
    /// # Errors
    /// When there is no part.
    ///
    /// # Panics
    /// When an anchored model gets no base, or its length is not the number of pixels.
    pub fn new(
        lines: &LineMap,
        parts: &[SketchPart],
        base: Option<&[f32]>,
        config: &RegionGnnConfig,
    ) -> Result<Self> {
        Self::until(lines, parts, base, config, &Stop::new())
    }

    /// As [`new`](Self::new), unless it is stopped; passes over the graph then end as well, with anything for a result.
    ///
    /// # Errors
    /// As there, and when it is stopped.
    ///
    /// # Panics
    /// As there.
    pub(crate) fn until(
        lines: &LineMap,
        parts: &[SketchPart],
        base: Option<&[f32]>,
        config: &RegionGnnConfig,
        stop: &Stop,
    ) -> Result<Self> {
        if parts.is_empty() {
            return Err(Error::value(
                "number of sketch parts",
                0,
                "at least one ridge or valley part is needed",
            ));
        }
        let (rows, cols) = lines.shape();
        let regions: Vec<Region> = parts.iter().map(Region::new).collect();
        let k = config.neighbours.min(regions.len());
        let ties = nearest_regions(&regions, rows, cols, k, stop);
        stop.check()?;
        let nearest: Vec<u32> = ties.iter().map(|(region, _)| *region).collect();
        let projections = ties.iter().map(|(_, p)| p.index as u8).collect();
        let pixel_of = |(region, p): &(u32, Projection)| {
            let cell = regions[*region as usize].cell(p.index);
            (cell.row * cols + cell.col) as u32
        };
        let projected = ties.iter().map(pixel_of).collect();
        let distances: Vec<f32> = ties.iter().map(|(_, p)| p.distance).collect();
        let long_edges = distances.iter().filter(|distance| **distance > 0.0).count();
        let (region_offsets, region_pixels) = by_region(&nearest, k, regions.len());
        let kinds = lines.kinds().as_slice();
        let indicator = kinds
            .iter()
            .map(|kind| match kind {
                Some(StrokeKind::Ridge) => 1.0,
                Some(StrokeKind::Valley) => -1.0,
                None => 0.0,
            })
            .collect();
        let line_cells: Vec<u32> =
            (0..kinds.len()).filter(|&i| kinds[i].is_some()).map(|i| i as u32).collect();
        let line_heights = line_cells.iter().map(|&i| lines.heights().as_slice()[i as usize]).collect();
        let mut graph = Self {
            rows,
            cols,
            k,
            sizes: regions.iter().map(EdgeFeatures::size).collect(),
            regions,
            nearest,
            projections,
            projected,
            distances,
            long_edges,
            features: EdgeFeatures::of(config),
            stored: Vec::new(),
            region_offsets,
            region_pixels,
            indicator,
            line_cells,
            line_heights,
            anchor: None,
            stop: stop.clone(),
        };
        if config.frame == HeightFrame::Anchored {
            let base = base.expect("an anchored model has a base");
            assert_eq!(base.len(), graph.pixel_count(), "one base height a pixel");
            graph.anchor = Some(Anchor { base: base.to_vec(), scale: graph.relief() });
        }
        graph.stored = graph.store_fixed();
        stop.check()?;
        Ok(graph)
    }

    /// 4 rms(height of the nearest part - mean height of the other k - 1), over all pixels.
    fn relief(&self) -> f32 {
        let mut sum = 0.0f64;
        for pixel in 0..self.pixel_count() {
            let height = |j: usize| f64::from(self.projected_height(pixel * self.k + j));
            let others = (1..self.k).map(height).sum::<f64>() / (self.k - 1).max(1) as f64;
            sum += if self.k > 1 { (height(0) - others).powi(2) } else { 0.0 };
        }
        let relief = 4.0 * (sum / self.pixel_count() as f64).sqrt();
        // A sketch at one height has no relief of its own: any scale gives the same heights back, so take the unit.
        if relief > 1e-9 { relief as f32 } else { 1.0 }
    }

    fn store_fixed(&self) -> Vec<f32> {
        let n = self.features.stored_count();
        let mut stored = vec![0.0; self.nearest.len() * n];
        stored.par_chunks_mut(n).enumerate().for_each(|(edge, out)| {
            if self.stop.is_raised() {
                return;
            }
            let (index, distance) = (usize::from(self.projections[edge]), self.distances[edge]);
            let projection = Projection { index, distance };
            let values = self.store(edge / self.k, self.nearest[edge] as usize, projection);
            out.copy_from_slice(&values[..n]);
        });
        stored
    }

    /// What the edge from `pixel` to `region`, which may be any pair (for random edges), stores.
    pub(super) fn stored_for(&self, pixel: usize, region: usize) -> Stored {
        self.store(pixel, region, self.regions[region].project(self.cell(pixel)))
    }

    fn store(&self, pixel: usize, region: usize, projection: Projection) -> Stored {
        let region = &self.regions[region];
        let surroundings = match &self.anchor {
            Some(anchor) => {
                let near = &self.distances[pixel * self.k..(pixel + 1) * self.k];
                Surroundings {
                    height: (region.height(projection.index) - anchor.base[pixel]) / anchor.scale,
                    nearest: near[0],
                    mean: near.iter().sum::<f32>() / self.k as f32,
                }
            }
            None => Surroundings::default(),
        };
        self.features.store(region, self.cell(pixel), projection, &surroundings)
    }

    /// What ends the passes over it.
    #[must_use]
    pub(crate) fn stop(&self) -> &Stop {
        &self.stop
    }

    /// (rows, columns) of the map.
    #[must_use]
    pub(crate) fn shape(&self) -> (usize, usize) {
        (self.rows, self.cols)
    }

    /// Number of pixels.
    #[must_use]
    pub(crate) fn pixel_count(&self) -> usize {
        self.rows * self.cols
    }

    /// Number of regions.
    #[must_use]
    pub fn region_count(&self) -> usize {
        self.regions.len()
    }

    /// Nearest regions kept for each pixel: at most the number of regions.
    #[must_use]
    pub fn k(&self) -> usize {
        self.k
    }

    /// The regions.
    #[must_use]
    pub fn regions(&self) -> &[Region] {
        &self.regions
    }

    /// (pixels, k) region of each fixed edge, nearest first.
    #[must_use]
    pub fn nearest(&self) -> &[u32] {
        &self.nearest
    }

    /// (pixels, k) distance of each fixed edge, in cells.
    #[must_use]
    pub fn distances(&self) -> &[f32] {
        &self.distances
    }

    /// Number of fixed edges of positive length.
    pub(super) fn long_edges(&self) -> usize {
        self.long_edges
    }

    /// Pixels of the fixed edges of one region.
    #[must_use]
    pub(crate) fn pixels_of(&self, region: usize) -> &[u32] {
        &self.region_pixels[self.region_offsets[region] as usize..self.region_offsets[region + 1] as usize]
    }

    /// (regions) what an edge knows of its part alone.
    pub(super) fn sizes(&self) -> &[f32] {
        &self.sizes
    }

    /// How the features of edges are made.
    pub(super) fn features(&self) -> EdgeFeatures {
        self.features
    }

    /// (pixels, k, stored) of the fixed edges.
    pub(super) fn stored(&self) -> &[f32] {
        &self.stored
    }

    /// +1 at ridges, -1 at valleys, 0 elsewhere; one value a pixel (A.3).
    #[must_use]
    pub(crate) fn indicator(&self) -> &[f32] {
        &self.indicator
    }

    /// Line cells by pixel index, row-major.
    #[must_use]
    pub(crate) fn line_cells(&self) -> &[u32] {
        &self.line_cells
    }

    /// Heights of [`line_cells`](Self::line_cells).
    #[must_use]
    pub(crate) fn line_heights(&self) -> &[f32] {
        &self.line_heights
    }

    /// The frame of the anchored model.
    #[must_use]
    pub(crate) fn anchor_frame(&self) -> Option<&Anchor> {
        self.anchor.as_ref()
    }

    /// Pixel index of the cell on which a fixed edge projects.
    #[must_use]
    pub(crate) fn projected_pixel(&self, edge: usize) -> usize {
        self.projected[edge] as usize
    }

    /// Height of the sketch where a fixed edge projects.
    #[must_use]
    pub(crate) fn projected_height(&self, edge: usize) -> f32 {
        self.regions[self.nearest[edge] as usize].height(usize::from(self.projections[edge]))
    }

    /// (1 per ridge, 1 per valley) indicator of each region: (regions, 2).
    #[must_use]
    pub(crate) fn kind_indicators(&self) -> Vec<f32> {
        let one_hot = |r: &Region| if r.kind() == StrokeKind::Ridge { [1.0, 0.0] } else { [0.0, 1.0] };
        self.regions.iter().flat_map(one_hot).collect()
    }

    fn cell(&self, pixel: usize) -> Cell {
        Cell::new(pixel / self.cols, pixel % self.cols)
    }
}

/// Counting sort of the edges by region: (offsets, pixels).
fn by_region(nearest: &[u32], k: usize, regions: usize) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; regions + 1];
    for &r in nearest {
        offsets[r as usize + 1] += 1;
    }
    for r in 0..regions {
        offsets[r + 1] += offsets[r];
    }
    let mut next = offsets.clone();
    let mut pixels = vec![0u32; nearest.len()];
    for (edge, &r) in nearest.iter().enumerate() {
        pixels[next[r as usize] as usize] = (edge / k) as u32;
        next[r as usize] += 1;
    }
    (offsets, pixels)
}
