//! What an edge knows (Liu & Benes 2025, A.4), in two forms: a few numbers that are stored, and the features made of them.
//!
//! Features are made anew in every pass, from numbers a quarter their size: reading the features would cost more time
//! than making them, and five times the memory (`docs/performance.md`).

use super::config::{EdgeGeometry, HeightFrame, RegionGnnConfig};
use super::region::{Projection, Region};
use crate::grid::Cell;
use crate::learn::{exp, ln, sin_cos_quarter_turns, tanh};

/// Heights on edges are cut here, in units of the sketch's relief.
const HEIGHT_LIMIT: f32 = 6.0;
/// Most numbers stored for an edge.
const MOST_STORED: usize = 8;
/// Doublings of the local frame's frequency.
const FREQUENCIES: usize = 3;

/// Which numbers an edge stores and which features follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct EdgeFeatures {
    geometry: EdgeGeometry,
    anchored: bool,
}

/// What one edge stores: relative index and distance of the projection; in the local frame, position along and across; in the
/// anchored frame, height above the base, distances to the nearest part and to the mean of the k nearest.
pub(super) type Stored = [f32; MOST_STORED];

/// What an anchored edge knows beyond its geometry.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Surroundings {
    /// Height of the projection above the base, in units of the sketch's relief.
    pub(super) height: f32,
    /// Distance of the pixel to the nearest part and mean distance to the k nearest, in cells.
    pub(super) nearest: f32,
    pub(super) mean: f32,
}

impl EdgeFeatures {
    pub(super) fn of(config: &RegionGnnConfig) -> Self {
        Self { geometry: config.geometry, anchored: config.frame == HeightFrame::Anchored }
    }

    /// Number of stored values of an edge; those beyond it are 0.
    pub(super) fn stored_count(self) -> usize {
        self.geometry_stored() + if self.anchored { 3 } else { 0 }
    }

    fn geometry_stored(self) -> usize {
        match self.geometry {
            EdgeGeometry::Projection => 2,
            EdgeGeometry::LocalFrame => 4,
        }
    }

    /// Number of features, noise not counted.
    pub(super) fn feature_count(self) -> usize {
        let geometry = match self.geometry {
            EdgeGeometry::Projection => 2,
            EdgeGeometry::LocalFrame => 8 + 4 * FREQUENCIES,
        };
        geometry + if self.anchored { 4 } else { 0 }
    }

    /// The numbers of the edge from `pixel` to `region`.
    pub(super) fn store(
        self,
        region: &Region,
        pixel: Cell,
        projection: Projection,
        surroundings: &Surroundings,
    ) -> Stored {
        let mut out = [0.0; MOST_STORED];
        out[0] = region.relative_index(projection.index);
        out[1] = projection.distance;
        if self.geometry == EdgeGeometry::LocalFrame {
            let (along, across) = region.along_across(pixel);
            // So that pixels far from thin lines do not run through many periods of the sines.
            let scaled = |v: f32| if self.anchored { (v / 8.0).asinh() } else { v / 8.0 };
            (out[2], out[3]) = (scaled(along), scaled(across));
        }
        if self.anchored {
            let at = self.geometry_stored();
            out[at] = surroundings.height.clamp(-HEIGHT_LIMIT, HEIGHT_LIMIT);
            out[at + 1] = surroundings.nearest;
            out[at + 2] = surroundings.mean;
        }
        out
    }

    /// What an edge knows of its part alone, and therefore does not store: the number of its cells.
    pub(super) fn size(region: &Region) -> f32 {
        region.cell_count() as f32 / 10.0
    }

    /// Makes the features of many edges. `stored`: (stored, stride); `sizes`: (stride) that of each edge's part, see
    /// [`size`](Self::size); `out`: (features, stride).
    ///
    /// Projection index, distance, then in the local frame position, distance on other scales, size of the part, sine and
    /// cosine of the position at [`FREQUENCIES`] frequencies; then the height and how far apart the lines are around the
    /// pixel: nearest, mean, and this edge against the nearest.
    #[inline(always)]
    pub(super) fn expand(self, stored: &[f32], sizes: &[f32], stride: usize, out: &mut [f32]) {
        out[..stride].copy_from_slice(&stored[..stride]);
        let distance = &stored[stride..2 * stride];
        let mut rows = out[stride..].chunks_exact_mut(stride);
        let mut next = || rows.next().unwrap_or_default();
        fill(next(), distance, |d| d / 16.0);
        if self.geometry == EdgeGeometry::LocalFrame {
            let (along, across) = (&stored[2 * stride..3 * stride], &stored[3 * stride..4 * stride]);
            fill(next(), along, tanh);
            fill(next(), across, tanh);
            fill(next(), distance, |d| ln(1.0 + d) / 2.0);
            let (near, wide) = (next(), next());
            fill(wide, distance, |d| exp(-d / 6.0));
            fill(near, wide, |wide| wide * wide * wide);
            next().copy_from_slice(&sizes[..stride]);
            let mut turns = [(next(), next()), (next(), next())];
            fill_two(&mut turns[0], along);
            fill_two(&mut turns[1], across);
            for _ in 1..FREQUENCIES {
                let mut twice = [(next(), next()), (next(), next())];
                twice.iter_mut().zip(&turns).for_each(|(twice, once)| double(twice, once));
                turns = twice;
            }
        }
        if self.anchored {
            let mut values = stored[self.geometry_stored() * stride..].chunks_exact(stride);
            let mut column = || values.next().unwrap_or_default();
            let (height, nearest, mean) = (column(), column(), column());
            next().copy_from_slice(height);
            fill(next(), nearest, |d| ln(1.0 + d) / 2.0);
            fill(next(), mean, |d| ln(1.0 + d) / 2.0);
            for ((out, d), nearest) in next().iter_mut().zip(distance).zip(nearest) {
                *out = ln(1.0 + d) - ln(1.0 + nearest);
            }
        }
    }
}

#[inline(always)]
fn fill(out: &mut [f32], x: &[f32], f: impl Fn(f32) -> f32) {
    for (out, x) in out.iter_mut().zip(x) {
        *out = f(*x);
    }
}

/// Sines and cosines of `x` quarter turns.
#[inline(always)]
fn fill_two((sines, cosines): &mut (&mut [f32], &mut [f32]), x: &[f32]) {
    for ((sine, cosine), x) in sines.iter_mut().zip(cosines.iter_mut()).zip(x) {
        (*sine, *cosine) = sin_cos_quarter_turns(*x);
    }
}

/// Sines and cosines of twice the angles.
#[inline(always)]
fn double((sines, cosines): &mut (&mut [f32], &mut [f32]), once: &(&mut [f32], &mut [f32])) {
    let given = once.0.iter().zip(once.1.iter());
    for ((sine, cosine), (s, c)) in sines.iter_mut().zip(cosines.iter_mut()).zip(given) {
        (*sine, *cosine) = (2.0 * s * c, 1.0 - 2.0 * s * s);
    }
}
