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
const MOST_STORED: usize = 6;
/// Doublings of the local frame's frequency.
const FREQUENCIES: usize = 3;

/// Which numbers an edge stores and which features follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct EdgeFeatures {
    geometry: EdgeGeometry,
    height: bool,
}

/// What one edge stores: relative index and distance of the projection; in the local frame, position along and across and
/// number of cells; in the anchored frame, height above the base.
pub(super) type Stored = [f32; MOST_STORED];

impl EdgeFeatures {
    pub(super) fn of(config: &RegionGnnConfig) -> Self {
        Self { geometry: config.geometry, height: config.frame == HeightFrame::Anchored }
    }

    /// Number of stored values of an edge; those beyond it are 0.
    pub(super) fn stored_count(self) -> usize {
        self.geometry_stored() + usize::from(self.height)
    }

    fn geometry_stored(self) -> usize {
        match self.geometry {
            EdgeGeometry::Projection => 2,
            EdgeGeometry::LocalFrame => 5,
        }
    }

    /// Number of features, noise not counted.
    pub(super) fn feature_count(self) -> usize {
        let geometry = match self.geometry {
            EdgeGeometry::Projection => 2,
            EdgeGeometry::LocalFrame => 8 + 4 * FREQUENCIES,
        };
        geometry + usize::from(self.height)
    }

    /// The numbers of the edge from `pixel` to `region`. `height`: of the projection above the base, in units of the
    /// sketch's relief.
    pub(super) fn store(self, region: &Region, pixel: Cell, projection: Projection, height: f32) -> Stored {
        let mut out = [0.0; MOST_STORED];
        out[0] = region.relative_index(projection.index);
        out[1] = projection.distance;
        if self.geometry == EdgeGeometry::LocalFrame {
            let (along, across) = region.along_across(pixel);
            out[2] = along / 8.0;
            out[3] = across / 8.0;
            out[4] = region.cell_count() as f32 / 10.0;
        }
        if self.height {
            out[self.geometry_stored()] = height.clamp(-HEIGHT_LIMIT, HEIGHT_LIMIT);
        }
        out
    }

    /// Makes the features of many edges. `stored`: (stored, stride); `out`: (features, stride).
    ///
    /// Projection index, distance, then in the local frame position, distance on other scales, size of the part, sine and
    /// cosine of the position at [`FREQUENCIES`] frequencies; then the height.
    #[inline(always)]
    pub(super) fn expand(self, stored: &[f32], stride: usize, out: &mut [f32]) {
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
            fill(next(), distance, |d| exp(-d / 2.0));
            fill(next(), distance, |d| exp(-d / 6.0));
            next().copy_from_slice(&stored[4 * stride..5 * stride]);
            for frequency in 0..FREQUENCIES {
                let factor = (1 << frequency) as f32;
                for position in [along, across] {
                    fill_two(next(), next(), position, factor);
                }
            }
        }
        if self.height {
            let at = self.geometry_stored() * stride;
            next().copy_from_slice(&stored[at..at + stride]);
        }
    }
}

#[inline(always)]
fn fill(out: &mut [f32], x: &[f32], f: impl Fn(f32) -> f32) {
    for (out, x) in out.iter_mut().zip(x) {
        *out = f(*x);
    }
}

#[inline(always)]
fn fill_two(sines: &mut [f32], cosines: &mut [f32], x: &[f32], factor: f32) {
    for ((sine, cosine), x) in sines.iter_mut().zip(cosines).zip(x) {
        (*sine, *cosine) = sin_cos_quarter_turns(x * factor);
    }
}
