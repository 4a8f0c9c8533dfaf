//! Linear interpolation on the Delaunay triangles of the line cells.
//!
//! Lines with heights -> terrain: planes over the triangles inside the convex hull of the line cells, the nearest line cell
//! outside (and everywhere, when the line cells lie on one straight line and there is no triangle). Where four line cells
//! lie on one circle the diagonal is not determined, and another program may choose the other one.
//!
//! Cost: n log n for n line cells; then every triangle fills its own cells, with whole-number inside tests.

use super::line_cells::LineCells;
use crate::error::Result;
use crate::grid::{Cell, Grid};
use crate::sketch::LineMap;
use rayon::prelude::*;
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// Piecewise linear on Delaunay triangles, the nearest line cell outside their hull. (rows, cols), in the unit of the heights.
///
/// # Errors
/// When there is no line cell.
///
/// # Panics
/// Never: the coordinates are small whole numbers, which a triangulation always accepts.
pub(crate) fn delaunay_linear(lines: &LineMap) -> Result<Grid<f32>> {
    let line_cells = LineCells::of(lines)?;
    let points = line_cells.cells.iter().map(|c| Point2::new(c.col as f64, c.row as f64)).collect();
    let triangles = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(points)
        .expect("whole numbers below 2^32 are valid coordinates");
    let mut terrain: Grid<Option<f32>> = Grid::filled(lines.shape().0, lines.shape().1, None);
    for face in triangles.inner_faces() {
        let corners = face.vertices().map(|vertex| vertex.index());
        let cells = corners.map(|i| line_cells.cells[i]);
        let heights = corners.map(|i| f64::from(line_cells.heights[i]));
        fill_triangle(cells, |cell, [a, b, c], area| {
            let z = (a as f64 * heights[0] + b as f64 * heights[1] + c as f64 * heights[2]) / area as f64;
            terrain[cell] = Some(z as f32);
        });
    }
    for (&cell, &height) in line_cells.cells.iter().zip(&line_cells.heights) {
        terrain[cell] = Some(height);
    }
    let cols = terrain.cols();
    let filled = terrain.as_slice().par_iter().enumerate();
    let filled =
        filled.map(|(i, z)| z.unwrap_or_else(|| line_cells.nearest(Cell { row: i / cols, col: i % cols })));
    Grid::from_vec(lines.shape().0, cols, filled.collect())
}

/// Calls `f` with every cell of a triangle, border included, its three barycentric coordinates and their sum, all in units
/// of half a square cell.
fn fill_triangle(corners: [Cell; 3], mut f: impl FnMut(Cell, [i64; 3], i64)) {
    let at = corners.map(|c| (c.col as i64, c.row as i64));
    let cross =
        |o: (i64, i64), a: (i64, i64), b: (i64, i64)| (a.0 - o.0) * (b.1 - o.1) - (b.0 - o.0) * (a.1 - o.1);
    let area = cross(at[0], at[1], at[2]);
    let sign = area.signum();
    let range = |side: fn(&Cell) -> usize| {
        let sides = corners.each_ref().map(side);
        sides[0].min(sides[1]).min(sides[2])..=sides[0].max(sides[1]).max(sides[2])
    };
    for row in range(|c| c.row) {
        for col in range(|c| c.col) {
            let here = (col as i64, row as i64);
            let shares = [cross(here, at[1], at[2]), cross(here, at[2], at[0]), cross(here, at[0], at[1])]
                .map(|s| s * sign);
            if shares.iter().all(|&s| s >= 0) {
                f(Cell { row, col }, shares, area * sign);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sketch::StrokeKind;

    #[test]
    fn a_plane_inside_the_hull_and_the_nearest_outside() {
        let plane = |c: Cell| 2.0 + 0.5 * c.row as f32 - 0.25 * c.col as f32;
        let mut lines = LineMap::empty(40, 40);
        let corners = [(5, 5), (5, 34), (34, 5), (34, 34)].map(|(r, c)| Cell::new(r, c));
        let scattered = (0..30).map(|i| Cell::new(6 + i * 11 % 27, 6 + i * 17 % 26));
        for cell in corners.into_iter().chain(scattered) {
            lines.set(cell, StrokeKind::Ridge, plane(cell));
        }
        let got = delaunay_linear(&lines).unwrap();
        for (cell, &z) in got.cells() {
            if (5..=34).contains(&cell.row) && (5..=34).contains(&cell.col) {
                assert!((z - plane(cell)).abs() < 1e-5, "{cell:?}");
            }
        }
        assert_eq!(got[Cell::new(0, 0)], plane(Cell::new(5, 5)));
        assert_eq!(got[Cell::new(39, 39)], plane(Cell::new(34, 34)));
    }

    #[test]
    fn a_triangle_owns_its_border() {
        let mut cells = Vec::new();
        fill_triangle([Cell::new(0, 0), Cell::new(2, 0), Cell::new(0, 2)], |cell, shares, area| {
            assert_eq!(shares.iter().sum::<i64>(), area);
            cells.push((cell.row, cell.col));
        });
        assert_eq!(cells, [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (2, 0)]);
    }
}
