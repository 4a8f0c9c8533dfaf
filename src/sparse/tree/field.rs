//! Sparse primitives on a regular grid: z_i + sum_j x_ij d_j on discs (Guérin et al. 2016, 4.1), from data or functions.

use super::noise::{NoiseKind, OCTAVES, noise};
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Cell, Grid, Mask};
use crate::sparse::disc::falloff;
use crate::sparse::{Codes, Disc};

/// A function as an atom: noise, seen through a disc. Eight octaves with two coefficients each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FunctionAtom {
    /// Which noise.
    pub(crate) kind: NoiseKind,
    /// Which draw.
    pub(crate) seed: u32,
    /// Wavelength of the first octave, cells of the field.
    pub(crate) wavelength: f64,
    /// Direction of its axes, radians.
    pub(crate) angle: f64,
    /// Where in the noise the disc lies, wavelengths.
    pub(crate) offset: [f64; 2],
    /// What the disc's mean is, and the length of the rest.
    pub(crate) mean: f64,
    pub(crate) length: f64,
}

impl FunctionAtom {
    /// The noise at a place relative to the disc's centre, cells, without wavelengths below `finest` cells.
    pub(crate) fn raw(&self, [x, y]: [f64; 2], finest: f64) -> f64 {
        let (sin, cos) = self.angle.sin_cos();
        let place = [
            (cos * x - sin * y) / self.wavelength + self.offset[0],
            (sin * x + cos * y) / self.wavelength + self.offset[1],
        ];
        noise(self.kind, self.seed, place, OCTAVES, finest / self.wavelength)
    }

    fn at(&self, place: [f64; 2], finest: f64) -> f64 {
        (self.raw(place, finest) - self.mean) / self.length
    }
}

/// Terrain as sparse primitives.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Field {
    /// Rows and columns of the raster that it stands for.
    pub(crate) shape: (usize, usize),
    /// Metres of a cell.
    pub(crate) cell: f64,
    pub(crate) disc: Disc,
    /// Data atoms, squares around the disc; they come first.
    pub(crate) grids: Vec<Grid<f32>>,
    /// Function atoms.
    pub(crate) functions: Vec<FunctionAtom>,
    /// z_i
    pub(crate) means: Vec<f32>,
    /// x_ij
    pub(crate) codes: Codes,
    /// Cells of the raster without a height, where there are some.
    pub(crate) voids: Option<Mask>,
}

/// A field that is ready to be asked at a level of detail.
#[derive(Clone, Debug)]
pub(super) struct FieldLevel<'a> {
    field: &'a Field,
    /// Data atoms at a cell size that the level can show; none when discs are smaller than its cells.
    grids: Option<Vec<Grid<f32>>>,
    /// Wavelength of functions, cells of the field, at which they have faded: half a cell of the raster.
    finest: f64,
}

impl Field {
    /// Values that the paper counts for it: t = K N + n (2 s + 2) + 1 (5.1); K of functions is 16.
    pub(crate) fn values(&self) -> usize {
        let (side, n) = (self.disc.side(), self.means.len());
        side * side * self.grids.len()
            + 2 * OCTAVES * self.functions.len()
            + n * (2 * self.codes.each() + 2)
            + 1
    }

    /// Metres east and south.
    pub(super) fn extent(&self) -> [f64; 2] {
        [self.shape.1 as f64 * self.cell, self.shape.0 as f64 * self.cell]
    }

    /// For cells of so many metres: atoms are band-limited to what these can show.
    pub(super) fn level(&self, cell: f64) -> FieldLevel<'_> {
        let coarser = (cell / self.cell).max(1.0);
        let side = self.disc.side();
        let left = (side as f64 / coarser).round() as usize;
        let grids = (coarser < self.disc.radius()).then(|| {
            self.grids
                .iter()
                .map(|g| if left < side { resample(g, left.max(1), left.max(1)) } else { g.clone() })
                .collect()
        });
        FieldLevel { field: self, grids, finest: 0.5 * cell / self.cell }
    }
}

impl FieldLevel<'_> {
    /// Height at a point, metres; none outside the frame.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let Field { shape, cell, disc, grids: all, functions, means, codes, voids } = self.field;
        let (col, row) = (x / cell, y / cell);
        let inside = |v: f64, side: usize| (0.0..=side as f64).contains(&v);
        if !inside(row, shape.0) || !inside(col, shape.1) {
            return None;
        }
        let own = Cell::new((row as usize).min(shape.0 - 1), (col as usize).min(shape.1 - 1));
        if voids.as_ref().is_some_and(|voids| voids[own]) {
            return None;
        }
        let (down, right) = disc.centres(*shape);
        let near = |v: f64, count: usize| {
            let at =
                |edge: f64| (edge / disc.step() as f64 + disc.margin() as f64).clamp(0.0, (count - 1) as f64);
            at(v - disc.radius()).ceil() as usize..=at(v + disc.radius()).floor() as usize
        };
        let half = disc.side() as f64 / 2.0;
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in near(row, down) {
            for j in near(col, right) {
                let centre = |i: usize| disc.first(i) as f64 + half;
                let (dx, dy) = (col - centre(j), row - centre(i));
                let weight = falloff((dx * dx + dy * dy) / (disc.radius() * disc.radius()));
                if weight == 0.0 {
                    continue;
                }
                let primitive = i * right + j;
                let mut height = f64::from(means[primitive]);
                for (atom, x) in codes.of(primitive) {
                    let value = match (atom.checked_sub(all.len()), &self.grids) {
                        (Some(function), _) => functions[function].at([dx, dy], self.finest),
                        (None, Some(grids)) => {
                            bicubic(&grids[atom], (dy + half) / (2.0 * half), (dx + half) / (2.0 * half))
                        }
                        (None, None) => 0.0,
                    };
                    height += f64::from(x) * value;
                }
                sum += weight * height;
                weights += weight;
            }
        }
        Some(sum / weights)
    }
}

/// A raster at a place, 0 to 1 from frame to frame, by cubic convolution (Keys 1981); beyond the outer cells' centres it goes on level.
fn bicubic(grid: &Grid<f32>, down: f64, right: f64) -> f64 {
    let taps = |t: f64, side: usize| {
        let at = t * side as f64 - 0.5;
        let (first, u) = (at.floor(), at - at.floor());
        let weights = [
            ((-0.5 * u + 1.0) * u - 0.5) * u,
            (1.5 * u - 2.5) * u * u + 1.0,
            ((-1.5 * u + 2.0) * u + 0.5) * u,
            (0.5 * u - 0.5) * u * u,
        ];
        let index = |k: isize| (first as isize + k - 1).clamp(0, side as isize - 1) as usize;
        ([index(0), index(1), index(2), index(3)], weights)
    };
    let ((rows, a), (cols, b)) = (taps(down, grid.rows()), taps(right, grid.cols()));
    let row = |r: usize| cols.iter().zip(b).map(|(c, w)| w * f64::from(grid[Cell::new(r, *c)])).sum::<f64>();
    rows.iter().zip(a).map(|(r, w)| w * row(*r)).sum()
}

/// Checks that a field's parts belong together.
///
/// # Errors
/// Names what does not fit.
pub(super) fn check(field: &Field) -> Result<()> {
    let (down, right) = field.disc.centres(field.shape);
    let atoms = field.grids.len() + field.functions.len();
    for (name, found) in [("means", field.means.len()), ("codes", field.codes.signals())] {
        if found != down * right {
            return Err(Error::value(
                format!("number of {name}"),
                found,
                format!("the grid has {}", down * right),
            ));
        }
    }
    if let Some(atom) = field.codes.atoms().iter().find(|atom| **atom as usize >= atoms.max(1)) {
        return Err(Error::value("number of an atom", atom, format!("there are {atoms}")));
    }
    let numbers = field.means.iter().chain(field.codes.weights());
    if let Some(v) = numbers.chain(field.grids.iter().flat_map(|g| g.as_slice())).find(|v| !v.is_finite()) {
        return Err(Error::value("number of a field", v, "allowed: finite"));
    }
    let whole = |f: &FunctionAtom| {
        [f.wavelength, f.length].iter().all(|v| *v > 0.0 && v.is_finite())
            && [f.angle, f.mean, f.offset[0], f.offset[1]].iter().all(|v| v.is_finite())
    };
    match field.functions.iter().position(|f| !whole(f)) {
        Some(i) => Err(Error::value(
            format!("function atom {i}"),
            "not finite",
            "allowed: finite, wavelength and length above 0",
        )),
        None => Ok(()),
    }
}
