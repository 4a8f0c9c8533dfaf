//! One scale of the generator: from the enlarged coarser map and noise to this scale's map, tile by tile.

use super::config::{DetailConfig, View};
use super::network::{Network, REACH, Shape, input_mut, tape};
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::learn::convolution::Plane;
use crate::seed::Stream;
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Cells of a tile's side: what a tile needs stays near 30 MB, whatever the map.
const TILE: usize = 160;

/// What a scale is beside its weights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ScaleInfo {
    /// Amplitude of the noise.
    pub(crate) noise: f32,
    /// Height of an output of 1.
    pub(crate) output: f32,
    /// Root mean square slope of the exemplar.
    pub(crate) slope: f32,
    /// The same of its coarse twins.
    pub(crate) slope_of_twins: f32,
}

/// How maps become inputs of the networks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inputs {
    pub(super) view: View,
    /// Reciprocal root mean square slope of the exemplar at this scale; 1 in the view of heights.
    pub(super) gain: f32,
}

impl Inputs {
    /// Channels of the generator's input.
    pub(super) const fn generator_inputs(self) -> usize {
        match self.view {
            View::Heights => 1,
            View::Slopes => 3,
        }
    }

    /// Channels of the critic's input.
    pub(super) const fn critic_inputs(self) -> usize {
        match self.view {
            View::Heights => 1,
            View::Slopes => 2,
        }
    }

    /// Cells that differences take from the southern and eastern edge.
    pub(super) const fn loss(self) -> usize {
        match self.view {
            View::Heights => 0,
            View::Slopes => 1,
        }
    }

    /// Sides of a map, framed for the generator.
    pub(super) const fn framed(self, rows: usize, cols: usize) -> (usize, usize) {
        (rows + 2 * REACH + self.loss(), cols + 2 * REACH + self.loss())
    }

    /// The map in a frame as wide as the generator's reach: zeros, or the edge repeated.
    pub(super) fn frame(self, map: &Grid<f32>) -> Grid<f32> {
        let (rows, cols) = map.shape();
        let (framed_rows, framed_cols) = self.framed(rows, cols);
        let values = map.as_slice();
        Grid::from_fn(framed_rows, framed_cols, |c| {
            let (r, k) = (c.row as isize - REACH as isize, c.col as isize - REACH as isize);
            let inside = |i: isize, side: usize| i.clamp(0, side as isize - 1);
            let (near_r, near_k) = (inside(r, rows), inside(k, cols));
            if self.view == View::Heights && (near_r, near_k) != (r, k) {
                return 0.0;
            }
            values[near_r as usize * cols + near_k as usize]
        })
    }

    /// The generator's input for the outputs of `tile.input`'s size whose first one is at (`row`, `col`) of the map; `framed`
    /// is the map in its frame and `noise` in the same frame.
    pub(super) fn look(
        self,
        framed: &Grid<f32>,
        noise: &Noise<'_>,
        row: usize,
        col: usize,
        input: &mut Plane,
    ) {
        let cols = framed.cols();
        let z = framed.as_slice();
        let channels = input.channels();
        for r in 0..input.rows() {
            let start = (row + r) * cols + col;
            for (c, pixel) in input.row_mut(r).chunks_exact_mut(channels).enumerate() {
                let i = start + c;
                let drawn = noise.field.map_or(0.0, |f| f.as_slice()[i]) * noise.amplitude;
                match self.view {
                    View::Heights => pixel[0] = z[i] + drawn,
                    View::Slopes => {
                        pixel[0] = self.gain * (z[i + 1] - z[i]);
                        pixel[1] = self.gain * (z[i + cols] - z[i]);
                        pixel[2] = drawn;
                    }
                }
            }
        }
    }

    /// The critic's input for a whole map.
    pub(super) fn judge(self, map: &Grid<f32>, input: &mut Plane) {
        let cols = map.cols();
        let z = map.as_slice();
        for r in 0..input.rows() {
            for (c, pixel) in input.row_mut(r).chunks_exact_mut(self.critic_inputs()).enumerate() {
                let i = r * cols + c;
                match self.view {
                    View::Heights => pixel[0] = z[i],
                    View::Slopes => {
                        pixel[0] = self.gain * (z[i + 1] - z[i]);
                        pixel[1] = self.gain * (z[i + cols] - z[i]);
                    }
                }
            }
        }
    }

    /// The gradient of the map, from that of the critic's input.
    pub(super) fn judge_adjoint(self, d_input: &Plane, rows: usize, cols: usize) -> Vec<f32> {
        let mut d_map = vec![0.0; rows * cols];
        for r in 0..d_input.rows() {
            for (c, d) in d_input.row(r).chunks_exact(self.critic_inputs()).enumerate() {
                let i = r * cols + c;
                match self.view {
                    View::Heights => d_map[i] += d[0],
                    View::Slopes => {
                        let (x, y) = (self.gain * d[0], self.gain * d[1]);
                        d_map[i + 1] += x;
                        d_map[i + cols] += y;
                        d_map[i] -= x + y;
                    }
                }
            }
        }
        d_map
    }
}

/// Noise of one pass.
#[derive(Clone, Copy)]
pub(super) struct Noise<'a> {
    /// Unit normal values in the generator's frame; none is no noise.
    pub(super) field: Option<&'a Grid<f32>>,
    pub(super) amplitude: f32,
}

/// What the network's output is worth: heights a unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Residual {
    pub(super) view: View,
    pub(super) scale: f32,
    /// Root mean square slope of the exemplar at this scale, heights a cell.
    pub(super) slope_of_exemplar: f32,
    /// The same of its coarse twins, whose slopes those of a coarse map are measured against; the exemplar's without any.
    pub(super) slope_of_twins: f32,
}

impl Residual {
    /// The height that an output adds (SinGAN, Eq. 4; tanh as in the published code).
    pub(super) fn height(self, out: f32) -> f32 {
        match self.view {
            View::Heights => out.tanh(),
            View::Slopes => self.scale * out,
        }
    }

    /// Its derivative.
    pub(super) fn slope(self, out: f32) -> f32 {
        match self.view {
            View::Heights => 1.0 - out.tanh() * out.tanh(),
            View::Slopes => self.scale,
        }
    }
}

/// A trained scale.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    /// Without batch normalisation: folded.
    pub(super) net: Network,
    pub(super) inputs: Inputs,
    pub(super) residual: Residual,
    /// Amplitude of the noise.
    pub(super) noise: f32,
}

impl Scale {
    /// What it is beside its weights.
    pub(super) fn info(&self) -> ScaleInfo {
        let r = self.residual;
        ScaleInfo {
            noise: self.noise,
            output: r.scale,
            slope: r.slope_of_exemplar,
            slope_of_twins: r.slope_of_twins,
        }
    }

    /// The scale `index` that [`info`](Self::info) and `values` came from.
    pub(super) fn from_info(
        config: &DetailConfig,
        index: usize,
        info: &ScaleInfo,
        values: Vec<f32>,
    ) -> Result<Self> {
        let view = config.view;
        let gain = if view == View::Slopes { info.slope.recip() } else { 1.0 };
        let inputs = Inputs { view, gain };
        let width = if index < 4 { config.width } else { config.fine_width };
        let shape = Shape { inputs: inputs.generator_inputs(), width, batch_norm: false };
        let net = shape.net();
        let good = values.len() == net.value_count() && values.iter().all(|v| v.is_finite());
        let slopes = [info.slope, info.slope_of_twins];
        let positive = slopes.iter().all(|s| s.is_finite() && *s > 0.0);
        if !(good && positive && info.noise.is_finite() && info.output.is_finite()) {
            let allowed = format!("allowed: {} finite values and positive slopes", net.value_count());
            return Err(Error::value(format!("detail of scale {index}"), values.len(), allowed));
        }
        let residual = Residual {
            view,
            scale: info.output,
            slope_of_exemplar: info.slope,
            slope_of_twins: info.slope_of_twins,
        };
        let net = Network { net, values };
        Ok(Self { net, inputs, residual, noise: info.noise })
    }

    /// This scale's map from the enlarged coarser one. `field`: noise in the generator's frame.
    pub(super) fn apply(&self, up: &Grid<f32>, field: Option<&Grid<f32>>, amplitude: f32) -> Grid<f32> {
        self.apply_tiled(up, field, amplitude, TILE)
    }

    /// As [`apply`](Self::apply), unless it is stopped.
    ///
    /// # Errors
    /// When it is stopped.
    pub(super) fn apply_until(
        &self,
        up: &Grid<f32>,
        field: Option<&Grid<f32>>,
        amplitude: f32,
        stop: &Stop,
    ) -> Result<Grid<f32>> {
        let map = self.in_tiles(up, field, amplitude, TILE, stop);
        stop.check().map(|()| map)
    }

    /// The same with another side of the tiles, rounded up to an even one: the convolution's sums are those of the untiled map
    /// where a tile begins in an even row and column.
    pub(super) fn apply_tiled(
        &self,
        up: &Grid<f32>,
        field: Option<&Grid<f32>>,
        amplitude: f32,
        tile: usize,
    ) -> Grid<f32> {
        self.in_tiles(up, field, amplitude, tile, &Stop::new())
    }

    fn in_tiles(
        &self,
        up: &Grid<f32>,
        field: Option<&Grid<f32>>,
        amplitude: f32,
        tile: usize,
        stop: &Stop,
    ) -> Grid<f32> {
        let (rows, cols) = up.shape();
        let tile = tile.next_multiple_of(2);
        let framed = self.inputs.frame(up);
        let noise = Noise { field, amplitude: amplitude * self.noise };
        let corners: Vec<(usize, usize)> = (0..rows.div_ceil(tile))
            .flat_map(|r| (0..cols.div_ceil(tile)).map(move |c| (r * tile, c * tile)))
            .collect();
        let tiles: Vec<Plane> = corners
            .par_iter()
            .map(|&(row, col)| {
                let (rows, cols) = (tile.min(rows - row), tile.min(cols - col));
                let mut tape = tape(&self.net.net, rows, cols);
                if !stop.is_raised() {
                    self.inputs.look(&framed, &noise, row, col, input_mut(&mut tape));
                    tape.forward(&self.net.values, None);
                }
                tape.output(0).clone()
            })
            .collect();
        let mut map = up.clone();
        let values = map.as_mut_slice();
        for (&(row, col), tile) in corners.iter().zip(&tiles) {
            for r in 0..tile.rows() {
                let start = (row + r) * cols + col;
                for (z, out) in values[start..start + tile.cols()].iter_mut().zip(tile.row(r)) {
                    *z += self.residual.height(*out);
                }
            }
        }
        map
    }
}

/// A frame of unit normal values for a scale's generator.
pub(super) fn noise_field(inputs: Inputs, rows: usize, cols: usize, stream: &mut Stream) -> Grid<f32> {
    let (framed_rows, framed_cols) = inputs.framed(rows, cols);
    let inside = |i: usize, side: usize| (REACH..REACH + side).contains(&i);
    Grid::from_fn(framed_rows, framed_cols, |c| {
        // The published padding is zeros around noise and map alike.
        if inputs.view == View::Heights && !(inside(c.row, rows) && inside(c.col, cols)) {
            return 0.0;
        }
        stream.sample::<f32, _>(StandardNormal)
    })
}

/// The name of the stream that draws the reconstruction's noise.
pub(super) const FIXED_NOISE: &str = "fixed noise";
