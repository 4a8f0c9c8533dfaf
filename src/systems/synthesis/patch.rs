//! Patches of the map and of the exemplar, and how far they are from each other.
//!
//! The exemplar stays as it is and the *map's* patch is turned: a patch of the exemplar is then a few contiguous rows, and since a
//! square keeps its cells in every symmetry, mean and variance of each patch are known before. What is left of a distance
//! is one inner product for each channel. Rows are padded to a register of eight.

use super::source::{Source, TURNS, step_back};
use crate::grid::Grid;
use rayon::prelude::*;

/// Numbers of a row of a patch.
const LANES: usize = 8;
/// Numbers of a patch: rows of the widest one.
const AREA: usize = (2 * super::config::WIDEST + 1) * LANES;

/// A map of the exemplar with the mean and the variance of the patch around each cell.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    /// Row by row, with some zeros at the end: the last patch reads a whole register.
    values: Vec<f32>,
    cols: usize,
    radius: usize,
    /// (mean, variance); 0 where the patch leaves the map.
    moments: Vec<[f32; 2]>,
}

impl Channel {
    pub(super) fn new(map: &Grid<f32>, radius: usize) -> Self {
        let (rows, cols) = map.shape();
        let mut values = map.as_slice().to_vec();
        let mut moments = vec![[0.0; 2]; values.len()];
        let area = ((2 * radius + 1) * (2 * radius + 1)) as f64;
        moments.par_chunks_mut(cols).enumerate().for_each(|(row, out)| {
            if row < radius || row + radius >= rows {
                return;
            }
            for (col, out) in out.iter_mut().enumerate().take(cols.saturating_sub(radius)).skip(radius) {
                let centre = f64::from(values[row * cols + col]);
                let (mut sum, mut squares) = (0.0, 0.0);
                for line in row - radius..=row + radius {
                    for v in &values[line * cols + col - radius..=line * cols + col + radius] {
                        let v = f64::from(*v) - centre;
                        sum += v;
                        squares += v * v;
                    }
                }
                let mean = sum / area;
                *out = [(centre + mean) as f32, (squares / area - mean * mean).max(0.0) as f32];
            }
        });
        values.extend([0.0; LANES]);
        Self { values, cols, radius, moments }
    }

    /// Mean squared difference of a cell from its patch's mean, over the patches around `centres`: the strength of small forms.
    pub(super) fn strength(&self, centres: &[(u16, u16)]) -> f32 {
        let squares = centres.iter().map(|&(row, col)| {
            let (row, col) = (i32::from(row), i32::from(col));
            f64::from(self.at(row, col) - self.moments(row, col)[0]).powi(2)
        });
        (squares.sum::<f64>() / centres.len().max(1) as f64) as f32
    }

    #[inline(always)]
    pub(super) fn at(&self, row: i32, col: i32) -> f32 {
        self.values[row as usize * self.cols + col as usize]
    }

    /// (mean, variance) of the patch around a centre.
    #[inline(always)]
    fn moments(&self, row: i32, col: i32) -> [f32; 2] {
        self.moments[row as usize * self.cols + col as usize]
    }

    /// Sum of `weights` times the patch around a centre.
    #[inline(always)]
    fn product(&self, weights: &[f32; AREA], row: i32, col: i32) -> f32 {
        let mut lanes = [0.0f32; LANES];
        let start = (row as usize - self.radius) * self.cols + col as usize - self.radius;
        for (line, weights) in weights.chunks_exact(LANES).enumerate().take(2 * self.radius + 1) {
            let cells = &self.values[start + line * self.cols..][..LANES];
            for ((lane, w), v) in lanes.iter_mut().zip(weights).zip(cells) {
                *lane += w * v;
            }
        }
        (lanes[0] + lanes[4]) + (lanes[1] + lanes[5]) + ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]))
    }

    /// (mean, variance) over the cells where `mask` is 1, `count` of them.
    #[inline(always)]
    fn masked_moments(&self, mask: &[f32; AREA], count: f32, row: i32, col: i32) -> [f32; 2] {
        let centre = self.at(row, col);
        let start = (row as usize - self.radius) * self.cols + col as usize - self.radius;
        let (mut sum, mut squares) = (0.0, 0.0);
        for (line, mask) in mask.chunks_exact(LANES).enumerate().take(2 * self.radius + 1) {
            for (m, v) in mask.iter().zip(&self.values[start + line * self.cols..][..LANES]) {
                let v = m * (v - centre);
                sum += v;
                squares += v * v;
            }
        }
        let mean = sum / count;
        [centre + mean, (squares / count - mean * mean).max(0.0)]
    }
}

/// One channel of a patch of the map, in the symmetries asked so far.
struct Side {
    mean: f32,
    variance: f32,
    /// Without the mean, in the map's own order; 0 outside the map.
    upright: [f32; AREA],
    turned: [[f32; AREA]; TURNS as usize],
}

/// The maps that patches of the drawing are cut from; all of one shape.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    pub(super) heights: &'a Grid<f32>,
    /// Membrane, or the smoothed surface.
    pub(super) smooth: Option<&'a Grid<f32>>,
    pub(super) landscape: Option<&'a Grid<f32>>,
    /// Nearness of ridges and of valleys.
    pub(super) strokes: Option<[&'a Grid<f32>; 2]>,
}

/// The same maps of the exemplar; those that depend on its drawings once for each.
#[derive(Clone)]
pub(super) struct Given<'a> {
    pub(super) heights: &'a Channel,
    pub(super) sets: Vec<Set<'a>>,
}

/// What one drawing of the exemplar says.
#[derive(Clone, Copy)]
pub(super) struct Set<'a> {
    pub(super) smooth: Option<&'a Channel>,
    pub(super) landscape: Option<&'a Channel>,
    pub(super) strokes: Option<[&'a Channel; 2]>,
}

/// Weights of a distance.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Weights {
    pub(super) heights: f32,
    pub(super) smooth: f32,
    pub(super) landscape: f32,
    pub(super) strokes: f32,
    pub(super) elevation: f32,
    pub(super) floor: f32,
    /// Least and most that a patch's heights are stretched.
    pub(super) stretch: [f32; 2],
}

impl Weights {
    /// The stretch that brings a patch of the energy `other` to `own`, within the limits.
    #[inline(always)]
    pub(super) fn stretch(&self, own: f32, other: f32) -> f32 {
        let [least, most] = self.stretch;
        (own / other.max(f32::MIN_POSITIVE)).sqrt().clamp(least, most)
    }
}

/// The patch of the map around a cell, ready to be compared.
pub(super) struct Patch {
    radius: usize,
    /// Cells inside the map.
    count: f32,
    is_whole: bool,
    inside: [f32; AREA],
    inside_turned: [[f32; AREA]; TURNS as usize],
    /// Which symmetries have been made.
    ready: u8,
    heights: Side,
    smooth: Side,
    landscape: Side,
    ridges: Side,
    valleys: Side,
}

impl Side {
    const EMPTY: Self =
        Self { mean: 0.0, variance: 0.0, upright: [0.0; AREA], turned: [[0.0; AREA]; TURNS as usize] };
}

impl Patch {
    pub(super) const fn new(radius: usize) -> Self {
        Self {
            radius,
            count: 0.0,
            is_whole: false,
            inside: [0.0; AREA],
            inside_turned: [[0.0; AREA]; TURNS as usize],
            ready: 0,
            heights: Side::EMPTY,
            smooth: Side::EMPTY,
            landscape: Side::EMPTY,
            ridges: Side::EMPTY,
            valleys: Side::EMPTY,
        }
    }

    /// Takes the patch around (`row`, `col`).
    #[inline(always)]
    pub(super) fn load(&mut self, maps: &Asked<'_>, row: usize, col: usize) {
        let (rows, cols) = maps.heights.shape();
        let r = self.radius as i32;
        self.ready = 0;
        self.is_whole =
            row >= self.radius && col >= self.radius && row + self.radius < rows && col + self.radius < cols;
        self.count = 0.0;
        for down in -r..=r {
            for right in -r..=r {
                let there = (row as i32 + down, col as i32 + right);
                let on = there.0 >= 0 && there.1 >= 0 && there.0 < rows as i32 && there.1 < cols as i32;
                self.inside[index(r, down, right)] = f32::from(u8::from(on));
                self.count += f32::from(u8::from(on));
            }
        }
        let (inside, count) = (&self.inside, self.count);
        let take = |side: &mut Side, map: &Grid<f32>| {
            let z = map.as_slice();
            let centre = z[row * cols + col];
            let (mut sum, mut squares) = (0.0, 0.0);
            for down in -r..=r {
                for right in -r..=r {
                    let i = index(r, down, right);
                    if inside[i] > 0.0 {
                        let at = (row as i32 + down) as usize * cols + (col as i32 + right) as usize;
                        let v = z[at] - centre;
                        side.upright[i] = v;
                        sum += v;
                        squares += v * v;
                    }
                }
            }
            let mean = sum / count;
            side.mean = centre + mean;
            side.variance = (squares / count - mean * mean).max(0.0);
            side.upright.iter_mut().zip(inside).for_each(|(v, on)| *v = on * (*v - mean));
        };
        take(&mut self.heights, maps.heights);
        if let Some(map) = maps.smooth {
            take(&mut self.smooth, map);
        }
        if let Some(map) = maps.landscape {
            take(&mut self.landscape, map);
        }
        if let Some([ridges, valleys]) = maps.strokes {
            take(&mut self.ridges, ridges);
            take(&mut self.valleys, valleys);
        }
    }

    /// Makes a symmetry of every channel, unless it is there.
    #[inline(always)]
    fn turn(&mut self, maps: &Asked<'_>, turn: u8) {
        if self.ready >> turn & 1 == 1 {
            return;
        }
        self.ready |= 1 << turn;
        let r = self.radius as i32;
        let mut order = [0; AREA];
        for down in -r..=r {
            for right in -r..=r {
                let (there, beside) = step_back(turn, down, right);
                order[index(r, down, right)] = index(r, there, beside);
            }
        }
        let rows = (2 * self.radius + 1) * LANES;
        let width = 2 * self.radius + 1;
        let make = |upright: &[f32; AREA], turned: &mut [f32; AREA]| {
            for line in (0..rows).step_by(LANES) {
                for i in line..line + width {
                    turned[i] = upright[order[i]];
                }
            }
        };
        let turn = turn as usize;
        make(&self.heights.upright, &mut self.heights.turned[turn]);
        if !self.is_whole {
            make(&self.inside, &mut self.inside_turned[turn]);
        }
        if maps.smooth.is_some() {
            make(&self.smooth.upright, &mut self.smooth.turned[turn]);
        }
        if maps.landscape.is_some() {
            make(&self.landscape.upright, &mut self.landscape.turned[turn]);
        }
        if maps.strokes.is_some() {
            make(&self.ridges.upright, &mut self.ridges.turned[turn]);
            make(&self.valleys.upright, &mut self.valleys.turned[turn]);
        }
    }

    /// (mean, variance, product with the map's without the means) of a channel at a source.
    #[inline(always)]
    fn compare(&self, side: &Side, channel: &Channel, source: Source) -> (f32, f32, f32) {
        let (row, col, turn) = (i32::from(source.row), i32::from(source.col), source.turn as usize);
        let [mean, variance] = if self.is_whole {
            channel.moments(row, col)
        } else {
            channel.masked_moments(&self.inside_turned[turn], self.count, row, col)
        };
        (mean, variance, channel.product(&side.turned[turn], row, col) / self.count)
    }

    /// Distance to the exemplar's patch at a source, whose heights may be stretched: squared differences without the means over
    /// the joint energy, so that smooth patches are not favoured; the difference of mean heights; the nearness of strokes.
    /// Anything above `most` may be any number above it. With the distance the stretch that makes it least.
    #[inline(always)]
    pub(super) fn distance(
        &mut self,
        maps: &Asked<'_>,
        given: &Given<'_>,
        weights: &Weights,
        source: Source,
        most: f32,
    ) -> (f32, f32) {
        self.turn(maps, source.turn);
        let set = &given.sets[source.set as usize];
        let (mean, variance, product) = self.compare(&self.heights, given.heights, source);
        let mut own = weights.heights * self.heights.variance;
        let mut other = weights.heights * variance;
        let mut common = weights.heights * product;
        if let (Some(channel), true) = (set.smooth, maps.smooth.is_some()) {
            let (_, variance, product) = self.compare(&self.smooth, channel, source);
            own += weights.smooth * self.smooth.variance;
            other += weights.smooth * variance;
            common += weights.smooth * product;
        }
        if let (Some(channel), true) = (set.landscape, maps.landscape.is_some()) {
            let (_, variance, product) = self.compare(&self.landscape, channel, source);
            own += weights.landscape * self.landscape.variance;
            other += weights.landscape * variance;
            common += weights.landscape * product;
        }
        let stretch = weights.stretch(own, other);
        let other = stretch * stretch * other;
        let missed = (own + other - 2.0 * stretch * common).max(0.0);
        let above = self.heights.mean - mean;
        let mut distance = missed / (own + other + weights.floor) + weights.elevation * above * above;
        if distance > most {
            return (distance, stretch);
        }
        if let (Some([ridges, valleys]), true) = (set.strokes, maps.strokes.is_some()) {
            for (side, channel) in [(&self.ridges, ridges), (&self.valleys, valleys)] {
                let (mean, variance, product) = self.compare(side, channel, source);
                let apart = side.mean - mean;
                let difference = (side.variance + variance - 2.0 * product).max(0.0);
                distance += weights.strokes * (difference + apart * apart);
            }
        }
        (distance, stretch)
    }
}

/// Position in a patch of reach `r`.
#[inline(always)]
const fn index(r: i32, down: i32, right: i32) -> usize {
    (down + r) as usize * LANES + (right + r) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;

    fn map(k: usize) -> Grid<f32> {
        Grid::from_fn(20, 23, |c| 700.0 + ((c.row * 31 + c.col * k + c.row * c.col) % 37) as f32)
    }

    /// The distance written out, cell by cell.
    fn written_out(asked: &Asked<'_>, given: [&Grid<f32>; 5], w: &Weights, at: Cell, source: Source) -> f32 {
        let (rows, cols) = asked.heights.shape();
        let r = 2i32;
        let cells: Vec<(Cell, Cell)> = (-r..=r)
            .flat_map(|down| (-r..=r).map(move |right| (down, right)))
            .filter_map(|(down, right)| {
                let here = (at.row as i32 + down, at.col as i32 + right);
                let there = source.moved(down, right);
                ((0..rows as i32).contains(&here.0) && (0..cols as i32).contains(&here.1)).then(|| {
                    let cell = |(row, col): (i32, i32)| Cell::new(row as usize, col as usize);
                    (cell(here), cell(there))
                })
            })
            .collect();
        let n = cells.len() as f64;
        let moments = |a: &Grid<f32>, b: &Grid<f32>| {
            let (a, b): (Vec<f64>, Vec<f64>) =
                cells.iter().map(|(x, y)| (f64::from(a[*x]), f64::from(b[*y]))).unzip();
            let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
            let (ma, mb) = (mean(&a), mean(&b));
            let variance = |v: &[f64], m: f64| v.iter().map(|v| (v - m).powi(2)).sum::<f64>() / n;
            let apart: f64 = a.iter().zip(&b).map(|(x, y)| ((x - ma) - (y - mb)).powi(2)).sum::<f64>() / n;
            let raw: f64 = a.iter().zip(&b).map(|(x, y)| (x - y).powi(2)).sum::<f64>() / n;
            let (own, other) = (variance(&a, ma), variance(&b, mb));
            (own, other, 0.5 * (own + other - apart), ma - mb, raw)
        };
        let (mut own, mut other, mut common) = (0.0, 0.0, 0.0);
        let pairs = [
            (asked.heights, given[0], w.heights),
            (asked.smooth.unwrap(), given[1], w.smooth),
            (asked.landscape.unwrap(), given[2], w.landscape),
        ];
        for (a, b, weight) in pairs {
            let (a, b, product, ..) = moments(a, b);
            own += f64::from(weight) * a;
            other += f64::from(weight) * b;
            common += f64::from(weight) * product;
        }
        let stretch = (own / other).sqrt().clamp(0.9, 1.2);
        let missed = own + stretch * stretch * other - 2.0 * stretch * common;
        let energy = own + stretch * stretch * other + f64::from(w.floor);
        let above = moments(asked.heights, given[0]).3;
        let [ridges, valleys] = asked.strokes.unwrap();
        let strokes = moments(ridges, given[3]).4 + moments(valleys, given[4]).4;
        (missed / energy + f64::from(w.elevation) * above * above + f64::from(w.strokes) * strokes) as f32
    }

    #[test]
    fn distances_are_those_written_out() {
        let maps: Vec<Grid<f32>> = (3..13).map(map).collect();
        let asked = Asked {
            heights: &maps[0],
            smooth: Some(&maps[1]),
            landscape: Some(&maps[2]),
            strokes: Some([&maps[3], &maps[4]]),
        };
        let channels: Vec<Channel> = maps[5..].iter().map(|map| Channel::new(map, 2)).collect();
        let set = Set {
            smooth: Some(&channels[1]),
            landscape: Some(&channels[2]),
            strokes: Some([&channels[3], &channels[4]]),
        };
        let given = Given { heights: &channels[0], sets: vec![set] };
        let w = Weights {
            heights: 0.5,
            smooth: 0.3,
            landscape: 0.2,
            strokes: 0.01,
            elevation: 0.001,
            floor: 0.4,
            stretch: [0.9, 1.2],
        };
        let mut patch = Patch::new(2);
        for at in [Cell::new(9, 9), Cell::new(0, 1), Cell::new(19, 22), Cell::new(2, 2)] {
            patch.load(&asked, at.row, at.col);
            for turn in 0..TURNS {
                for (row, col) in [(2, 2), (17, 20), (10, 5)] {
                    let source = Source::new(row, col, turn, 0);
                    let got = patch.distance(&asked, &given, &w, source, f32::INFINITY).0;
                    let five = [&maps[5], &maps[6], &maps[7], &maps[8], &maps[9]];
                    let want = written_out(&asked, five, &w, at, source);
                    assert!((got - want).abs() < 1e-3 * (1.0 + want), "{at:?} {source:?}: {got} {want}");
                }
            }
        }
    }
}
