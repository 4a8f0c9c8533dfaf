//! Natural-neighbour (Sibson) interpolation between line cells, exact, with the raster's frame as the edge of the world.
//!
//! Line cells -> for every raster cell a few weights over the line cells, positive and summing to 1.
//!
//! Source: Sibson 1981, *A brief description of natural neighbour interpolation*: when the cell becomes a site of the
//! Voronoi diagram of the line cells, it takes some area from each of its neighbours; the weights are the shares of that
//! area. The prototype counts the stolen area on a raster of twice the resolution (Park et al. 2006, *Discrete Sibson
//! interpolation*); here the areas are those of the polygons themselves.
//!
//! The diagram is clipped to the frame (the outer edges of the border cells), which keeps every area finite, so that the
//! cells outside the convex hull of the lines have weights as well. Inside, away from the frame, plane data come back
//! exactly. What a cell steals from one site is that site's Voronoi polygon cut by one half-plane, and the robbed sites
//! are connected in the Delaunay graph: so a cell costs a walk to its nearest site and one cut a natural neighbour. Line
//! cells on one circle, which a raster is full of, only make polygon edges of length zero and need no special care.
//!
//! Cost: n log n for the n line cells, then some 30 ns for each weight. Dense sketches have about ten weights a row. A
//! cell in an empty region as wide as w cells sees of the order of w line cells, and so many weights it gets:
//! [`NaturalNeighbours::interpolate`] works without storing them and is the way to fill large, sparsely drawn maps.

use super::SparseMatrix;
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, Mask};
use rayon::prelude::*;
use spade::{DelaunayTriangulation, Point2, Triangulation};

/// The Voronoi diagram of the line cells inside the frame, ready to be asked for weights.
#[derive(Clone, Debug)]
pub struct NaturalNeighbours {
    rows: usize,
    cols: usize,
    /// Line cells, row by row.
    sites: Vec<Cell>,
    /// Index into `sites` by cell, or [`NO_SITE`].
    site_at: Vec<u32>,
    /// Voronoi polygons, corner after corner, counter-clockwise in (x = column, y = row), relative to their site.
    corners: Vec<[f64; 2]>,
    corner_offsets: Vec<u32>,
    areas: Vec<f64>,
    /// Delaunay graph in compressed rows.
    neighbours: Vec<u32>,
    neighbour_offsets: Vec<u32>,
}

const NO_SITE: u32 = u32::MAX;

/// Stolen areas below this (in cells) are rounding noise of polygons that only touch: a cell steals half a cell or more
/// in all, and coordinates reach a few thousand.
const NOISE_AREA: f64 = 1e-9;

/// Sibson weights of every raster cell over the line cells: (cells, line cells), both row by row.
///
/// Each row sums to 1; the rows of line cells are the identity. The weights are stored, so the matrix is for maps whose
/// cells lie near lines: see [`NaturalNeighbours`].
///
/// # Errors
/// When `lines` has no line cell.
///
/// # Panics
/// When there are more than 2^32 weights.
pub fn natural_neighbour_weights(lines: &Mask) -> Result<SparseMatrix> {
    Ok(NaturalNeighbours::new(lines)?.weights())
}

impl NaturalNeighbours {
    /// The diagram of the cells where `lines` is true.
    ///
    /// # Errors
    /// When there is none.
    ///
    /// # Panics
    /// Never: the coordinates are small whole numbers, which a triangulation always accepts.
    pub fn new(lines: &Mask) -> Result<Self> {
        let (rows, cols) = lines.shape();
        let mut site_at = vec![NO_SITE; lines.len()];
        let mut sites = Vec::new();
        for (i, _) in lines.as_slice().iter().enumerate().filter(|(_, line)| **line) {
            site_at[i] = sites.len() as u32;
            sites.push(lines.cell_at(i));
        }
        if sites.is_empty() {
            return Err(Error::value("number of line cells", 0, "interpolation needs at least one"));
        }
        let points = sites.iter().map(|s| Point2::new(s.col as f64, s.row as f64)).collect();
        let graph = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(points)
            .expect("whole numbers below 2^32 are valid coordinates");
        let mut neighbours = Vec::new();
        let mut neighbour_offsets = vec![0];
        for vertex in graph.vertices() {
            let start = neighbours.len();
            neighbours.extend(vertex.out_edges().map(|edge| edge.to().index() as u32));
            neighbours[start..].sort_unstable();
            neighbour_offsets.push(neighbours.len() as u32);
        }
        let mut this = Self {
            rows,
            cols,
            sites,
            site_at,
            corners: Vec::new(),
            corner_offsets: vec![0],
            areas: Vec::new(),
            neighbours,
            neighbour_offsets,
        };
        let polygons: Vec<Vec<[f64; 2]>> =
            (0..this.sites.len()).into_par_iter().map(|site| this.polygon(site)).collect();
        for polygon in polygons {
            this.areas.push(area_within(&polygon, [0.0, 0.0], f64::NEG_INFINITY));
            this.corners.extend(polygon);
            this.corner_offsets.push(this.corners.len() as u32);
        }
        Ok(this)
    }

    /// Number of line cells.
    #[must_use]
    pub fn site_count(&self) -> usize {
        self.sites.len()
    }

    /// The weights of every cell: see [`natural_neighbour_weights`].
    ///
    /// # Panics
    /// When there are more than 2^32 weights.
    #[must_use]
    pub(crate) fn weights(&self) -> SparseMatrix {
        self.weights_until(&Stop::new()).expect("nobody stops it")
    }

    /// As [`weights`](Self::weights), unless it is stopped.
    ///
    /// # Errors
    /// When it is stopped.
    ///
    /// # Panics
    /// As there.
    pub(crate) fn weights_until(&self, stop: &Stop) -> Result<SparseMatrix> {
        let by_row: Vec<(Vec<u32>, Vec<u32>, Vec<f32>)> = (0..self.rows)
            .into_par_iter()
            .map_init(
                || Search::new(self.sites.len()),
                |search, row| {
                    let (mut counts, mut indices, mut values) = (Vec::new(), Vec::new(), Vec::new());
                    if stop.is_raised() {
                        return (counts, indices, values);
                    }
                    self.visit_row(row, search, |_, shares| {
                        counts.push(shares.len() as u32);
                        indices.extend(shares.iter().map(|s| s.0));
                        values.extend(shares.iter().map(|s| s.1 as f32));
                    });
                    (counts, indices, values)
                },
            )
            .collect();
        stop.check()?;
        let total: usize = by_row.iter().map(|(_, indices, _)| indices.len()).sum();
        assert!(u32::try_from(total).is_ok(), "more than 2^32 weights: interpolate without storing them");
        let mut offsets = Vec::with_capacity(self.site_at.len() + 1);
        offsets.push(0u32);
        let (mut indices, mut values) = (Vec::with_capacity(total), Vec::with_capacity(total));
        let mut end = 0;
        for (counts, row_indices, row_values) in by_row {
            for count in counts {
                end += count;
                offsets.push(end);
            }
            indices.extend(row_indices);
            values.extend(row_values);
        }
        let (rows, columns) = (self.site_at.len(), self.sites.len());
        Ok(SparseMatrix::from_compressed_rows(rows, columns, offsets, indices, values))
    }

    /// The weighted mean of `values`, one per line cell in row-major order, at every cell. Line cells keep their value.
    ///
    /// # Panics
    /// When the number of values is not that of the line cells.
    #[must_use]
    pub fn interpolate(&self, values: &[f64]) -> Grid<f64> {
        self.interpolate_until(values, &Stop::new()).expect("nobody stops it")
    }

    /// As [`interpolate`](Self::interpolate), unless it is stopped.
    ///
    /// # Errors
    /// When it is stopped.
    ///
    /// # Panics
    /// As there.
    pub fn interpolate_until(&self, values: &[f64], stop: &Stop) -> Result<Grid<f64>> {
        assert_eq!(values.len(), self.sites.len(), "one value a line cell");
        let mut out = Grid::filled(self.rows, self.cols, 0.0);
        out.as_mut_slice().par_chunks_mut(self.cols).enumerate().for_each_init(
            || Search::new(self.sites.len()),
            |search, (row, out)| {
                if stop.is_raised() {
                    return;
                }
                self.visit_row(row, search, |col, shares| {
                    out[col] = match shares {
                        [only] => values[only.0 as usize],
                        _ => shares.iter().map(|&(site, share)| share * values[site as usize]).sum(),
                    };
                });
            },
        );
        stop.check()?;
        Ok(out)
    }

    /// Calls `f` with every column of `row` and the (site, share) pairs of that cell, sites rising.
    fn visit_row(&self, row: usize, search: &mut Search, mut f: impl FnMut(usize, &[(u32, f64)])) {
        let mut nearest = 0;
        for col in 0..self.cols {
            let here = self.site_at[row * self.cols + col];
            if here == NO_SITE {
                nearest = self.nearest_from(nearest, Cell { row, col });
                self.find_shares(nearest, Cell { row, col }, search);
            } else {
                nearest = here;
                search.shares.clear();
                search.shares.push((here, 1.0));
            }
            f(col, &search.shares);
        }
    }

    /// The site nearest to `cell`, by downhill steps in the Delaunay graph, in which there are no dead ends.
    fn nearest_from(&self, start: u32, cell: Cell) -> u32 {
        let mut best = start;
        let mut distance = self.sites[start as usize].distance_squared(cell);
        loop {
            let here = best;
            for &next in self.neighbours_of(here) {
                let there = self.sites[next as usize].distance_squared(cell);
                if there < distance {
                    (best, distance) = (next, there);
                }
            }
            if best == here {
                return best;
            }
        }
    }

    /// Fills `search.shares` for a cell that is not a site, whose nearest site is `nearest`.
    fn find_shares(&self, nearest: u32, cell: Cell, search: &mut Search) {
        search.begin();
        search.meet(nearest);
        while let Some(site) = search.pending.pop() {
            let s = self.sites[site as usize];
            let step = [cell.col as f64 - s.col as f64, cell.row as f64 - s.row as f64];
            let (i, span) = (site as usize, &self.corner_offsets[site as usize..]);
            let polygon = &self.corners[span[0] as usize..span[1] as usize];
            let stolen = self.stolen(polygon, self.areas[i], step);
            if stolen > NOISE_AREA {
                search.shares.push((site, stolen));
                for &next in self.neighbours_of(site) {
                    search.meet(next);
                }
            }
        }
        search.shares.sort_unstable_by_key(|share| share.0);
        let total: f64 = search.shares.iter().map(|share| share.1).sum();
        for share in &mut search.shares {
            share.1 /= total;
        }
    }

    /// The part of a site's polygon that is nearer to the point at `step` from the site than to the site.
    fn stolen(&self, polygon: &[[f64; 2]], area: f64, step: [f64; 2]) -> f64 {
        let bar = 0.5 * (step[0] * step[0] + step[1] * step[1]);
        if polygon.iter().all(|c| step[0] * c[0] + step[1] * c[1] >= bar) {
            area
        } else {
            area_within(polygon, step, bar)
        }
    }

    fn neighbours_of(&self, site: u32) -> &[u32] {
        let span = &self.neighbour_offsets[site as usize..];
        &self.neighbours[span[0] as usize..span[1] as usize]
    }

    /// The Voronoi polygon of `site`, clipped to the frame: the frame cut by the bisectors with the Delaunay neighbours.
    fn polygon(&self, site: usize) -> Vec<[f64; 2]> {
        let here = self.sites[site];
        let (west, north) = (-0.5 - here.col as f64, -0.5 - here.row as f64);
        let (east, south) = (west + self.cols as f64, north + self.rows as f64);
        let mut polygon = vec![[west, north], [east, north], [east, south], [west, south]];
        let mut around: Vec<Cell> =
            self.neighbours_of(site as u32).iter().map(|&n| self.sites[n as usize]).collect();
        // Near ones first: the polygon is small before the many far ones of a lonely site come.
        around.sort_unstable_by_key(|&there| (here.distance_squared(there), there));
        let mut cut = Vec::new();
        for there in around {
            let step = [there.col as f64 - here.col as f64, there.row as f64 - here.row as f64];
            let bar = 0.5 * (step[0] * step[0] + step[1] * step[1]);
            cut.clear();
            for_each_kept(&polygon, [-step[0], -step[1]], -bar, |corner| cut.push(corner));
            std::mem::swap(&mut polygon, &mut cut);
        }
        polygon
    }
}

/// Scratch of one worker's searches through the Delaunay graph.
struct Search {
    /// The search that met each site last.
    met: Vec<u32>,
    current: u32,
    pending: Vec<u32>,
    shares: Vec<(u32, f64)>,
}

impl Search {
    fn new(sites: usize) -> Self {
        Self { met: vec![0; sites], current: 0, pending: Vec::new(), shares: Vec::new() }
    }

    fn begin(&mut self) {
        if self.current == u32::MAX {
            self.met.fill(0);
            self.current = 0;
        }
        self.current += 1;
        self.pending.clear();
        self.shares.clear();
    }

    fn meet(&mut self, site: u32) {
        if self.met[site as usize] != self.current {
            self.met[site as usize] = self.current;
            self.pending.push(site);
        }
    }
}

/// Calls `f` with the corners of the part of a convex polygon where `normal . x >= bar`, in order.
fn for_each_kept(polygon: &[[f64; 2]], normal: [f64; 2], bar: f64, mut f: impl FnMut([f64; 2])) {
    let height = |c: [f64; 2]| normal[0] * c[0] + normal[1] * c[1] - bar;
    let Some(&(mut from)) = polygon.last() else { return };
    let mut height_from = height(from);
    for &to in polygon {
        let height_to = height(to);
        if (height_from < 0.0) != (height_to < 0.0) {
            let t = height_from / (height_from - height_to);
            f([from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])]);
        }
        if height_to >= 0.0 {
            f(to);
        }
        (from, height_from) = (to, height_to);
    }
}

/// Area of the part of a convex polygon where `normal . x >= bar`.
fn area_within(polygon: &[[f64; 2]], normal: [f64; 2], bar: f64) -> f64 {
    let mut ends: Option<([f64; 2], [f64; 2])> = None;
    let mut doubled = 0.0;
    for_each_kept(polygon, normal, bar, |corner| {
        // A fan from the first corner: differences of near points, so thin far slivers keep their digits.
        if let Some((first, previous)) = ends {
            doubled += (previous[0] - first[0]) * (corner[1] - first[1])
                - (corner[0] - first[0]) * (previous[1] - first[1]);
            ends = Some((first, corner));
        } else {
            ends = Some((corner, corner));
        }
    });
    0.5 * doubled
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mask(rows: usize, cols: usize, lines: &[(usize, usize)]) -> Mask {
        Mask::from_fn(rows, cols, |c| lines.contains(&(c.row, c.col)))
    }

    fn masks() -> impl Strategy<Value = Mask> {
        (1usize..18, 1usize..18, 0.01f64..0.9).prop_flat_map(|(rows, cols, share)| {
            let cells = proptest::collection::vec(0.0f64..1.0, rows * cols);
            (cells, 0..rows * cols).prop_map(move |(cells, sure)| {
                let lines = cells.iter().enumerate().map(|(i, &u)| i == sure || u < share).collect();
                Grid::from_vec(rows, cols, lines).unwrap()
            })
        })
    }

    /// Shares by counting the points of a lattice, `fine` x `fine` in each cell, that each line cell loses.
    fn by_counting(lines: &Mask, cell: Cell, fine: usize) -> Vec<f64> {
        let sites: Vec<Cell> = lines.cells().filter(|(_, line)| **line).map(|(c, _)| c).collect();
        let mut lost = vec![0.0; sites.len()];
        let at = |i: usize| (i as f64 + 0.5) / fine as f64 - 0.5;
        let squared = |c: Cell, y: f64, x: f64| (c.row as f64 - y).powi(2) + (c.col as f64 - x).powi(2);
        for y in (0..lines.rows() * fine).map(at) {
            for x in (0..lines.cols() * fine).map(at) {
                let distances: Vec<f64> = sites.iter().map(|&s| squared(s, y, x)).collect();
                let distance = distances.iter().copied().fold(f64::INFINITY, f64::min);
                // Diagonal borders run through the lattice: a point on a border is shared.
                let near: Vec<usize> = (0..sites.len()).filter(|&i| distances[i] - distance < 1e-9).collect();
                let gain = distance - squared(cell, y, x);
                let gained = if gain.abs() < 1e-9 { 0.5 } else { f64::from(u8::from(gain > 0.0)) };
                near.iter().for_each(|&i| lost[i] += gained / near.len() as f64);
            }
        }
        let total: f64 = lost.iter().sum();
        lost.iter().map(|l| l / total).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn shares_are_the_areas_that_are_lost(lines in masks(), pick in 0usize..1000) {
            let weights = natural_neighbour_weights(&lines).unwrap();
            prop_assert_eq!((weights.rows(), weights.cols()),
                (lines.len(), lines.as_slice().iter().filter(|l| **l).count()));
            let mut site = 0;
            for i in 0..lines.len() {
                let sum: f64 = weights.row(i).map(|(_, w)| f64::from(w)).sum();
                prop_assert!((sum - 1.0).abs() < 1e-6);
                prop_assert!(weights.row(i).all(|(_, w)| w > 0.0));
                if lines.as_slice()[i] {
                    prop_assert_eq!(weights.row(i).collect::<Vec<_>>(), vec![(site, 1.0)]);
                    site += 1;
                }
            }
            let i = pick % lines.len();
            if !lines.as_slice()[i] {
                let mut dense = vec![0.0; weights.cols()];
                weights.row(i).for_each(|(c, w)| dense[c] = f64::from(w));
                for (got, want) in dense.iter().zip(by_counting(&lines, lines.cell_at(i), 12)) {
                    prop_assert!((got - want).abs() < 0.02, "cell {}: {} and {}", i, got, want);
                }
            }
        }

        #[test]
        fn stored_weights_and_direct_interpolation_agree(lines in masks(), seed in 0usize..1000) {
            let diagram = NaturalNeighbours::new(&lines).unwrap();
            let values: Vec<f32> = (0..diagram.site_count()).map(|i| ((i * 37 + seed) % 101) as f32).collect();
            let stored = diagram.weights().product(&values);
            let direct = diagram.interpolate(&values.iter().map(|&v| f64::from(v)).collect::<Vec<_>>());
            for (a, b) in stored.iter().zip(direct.as_slice()) {
                prop_assert!((f64::from(*a) - b).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_plane_comes_back_where_the_frame_is_far() {
        // Scattered sites, among them many on common circles; a cell is inside when its own new polygon cannot reach the
        // frame, which holds 12 cells from it here.
        let lines = Mask::from_fn(60, 70, |c| {
            (c.row * 31 + c.col * 17 + c.row * c.col) % 9 == 0 || c.row % 7 == c.col % 7
        });
        let plane = |c: Cell| 3.0 + 0.25 * c.row as f64 - 1.5 * c.col as f64;
        let values: Vec<f64> = lines.cells().filter(|(_, line)| **line).map(|(c, _)| plane(c)).collect();
        let got = NaturalNeighbours::new(&lines).unwrap().interpolate(&values);
        let inside = |c: Cell| (12..48).contains(&c.row) && (12..58).contains(&c.col);
        for (cell, z) in got.cells().filter(|(cell, _)| inside(*cell)) {
            assert!((z - plane(cell)).abs() < 1e-9, "{cell:?}: {z} and {}", plane(cell));
        }
    }

    #[test]
    fn symmetric_sites_share_evenly() {
        let corners = mask(9, 9, &[(0, 0), (0, 8), (8, 0), (8, 8)]);
        let weights = natural_neighbour_weights(&corners).unwrap();
        let centre: Vec<(usize, f32)> = weights.row(4 * 9 + 4).collect();
        assert_eq!(centre.iter().map(|w| w.0).collect::<Vec<_>>(), [0, 1, 2, 3]);
        assert!(centre.iter().all(|w| (w.1 - 0.25).abs() < 1e-6));
    }

    #[test]
    fn lines_without_a_triangle_are_enough() {
        let one = natural_neighbour_weights(&mask(5, 7, &[(3, 1)])).unwrap();
        assert!(one.product(&[42.0]).iter().all(|&z| z == 42.0));
        // Two points on a row: the share falls linearly between them, by the width of the stolen strip.
        let two = natural_neighbour_weights(&mask(1, 9, &[(0, 0), (0, 8)])).unwrap();
        let got = two.product(&[0.0, 8.0]);
        assert!((got[4] - 4.0).abs() < 1e-6 && got[1] < got[2] && got[2] < got[3]);
        let column: Vec<(usize, usize)> = (0..40).map(|row| (row, 3)).collect();
        let values: Vec<f32> = (0..40).map(|row| row as f32).collect();
        let got = natural_neighbour_weights(&mask(40, 9, &column)).unwrap().product(&values);
        assert!((got[20 * 9] - 20.0).abs() < 1e-4 && (got[20 * 9 + 8] - 20.0).abs() < 1e-4);
        assert!(natural_neighbour_weights(&mask(4, 4, &[])).is_err());
    }
}
