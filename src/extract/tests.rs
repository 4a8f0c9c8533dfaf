//! What must hold for lines of any terrain, and terrain whose lines are known.

use super::*;
use crate::grid::{Cell, Components, Grid, Mask, Window, d8, thinning};
use crate::seed::Seed;
use crate::sketch::{LineMap, StrokeKind};

/// Real terrain from the oracle's file: 64 x 64, metres.
fn real(area: &str) -> Grid<f32> {
    let areas: Vec<serde_json::Value> =
        serde_json::from_str(include_str!("../../tests/oracle/flow.json")).unwrap();
    let found = areas.iter().find(|a| a["area"] == area).unwrap();
    let heights = found["heights"].as_array().unwrap();
    Grid::from_vec(64, 64, heights.iter().map(|z| z.as_f64().unwrap() as f32).collect()).unwrap()
}

/// Rough terrain of any size: noise of several sizes, smooth enough to have lines.
fn rough(rows: usize, cols: usize, seed: u64) -> Grid<f32> {
    use rand::Rng;
    let mut stream = Seed(seed).stream("rough");
    let noise = Grid::from_fn(rows, cols, |_| stream.next_u32() as f32 / u32::MAX as f32);
    let valid = noise.map(|_| true);
    let layers: Vec<Grid<f32>> =
        [2.0, 5.0, 12.0].iter().map(|&s| crate::grid::gaussian::smooth(&noise, &valid, s)).collect();
    Grid::from_fn(rows, cols, |c| {
        layers.iter().zip([2.0f32, 5.0, 12.0]).map(|(l, s)| (l[c] - 0.5) * s * s).sum::<f32>() * 100.0
    })
}

fn lines(heights: &Grid<f32>, config: &ExtractionConfig) -> LineMap {
    ridges_and_valleys(heights, &heights.map(|_| true), config).unwrap()
}

fn default_lines(heights: &Grid<f32>) -> LineMap {
    lines(heights, &ExtractionConfig::default())
}

fn count(mask: &Mask) -> usize {
    mask.as_slice().iter().filter(|&&v| v).count()
}

/// Share of the cells of `a` with a cell of `b` within one row and column.
fn found_nearby(a: &Mask, b: &Mask) -> f64 {
    let near = crate::grid::morphology::dilate(b, 1);
    a.cells().filter(|(c, v)| **v && near[*c]).count() as f64 / count(a) as f64
}

fn assert_well_formed(map: &LineMap, heights: &Grid<f32>, min_length: usize) {
    for kind in [StrokeKind::Ridge, StrokeKind::Valley] {
        let mask = map.mask_of(kind);
        for (cell, _) in mask.cells().filter(|(_, v)| **v) {
            let around = (0..8u8).fold(0, |bits, code| {
                let there = d8::neighbour(cell, code, mask.rows(), mask.cols());
                bits | u8::from(there.is_some_and(|n| mask[n])) << code
            });
            assert!(!thinning::is_redundant(around), "{kind:?} at {cell:?} is wider than one cell");
            assert_eq!(map.heights()[cell], heights[cell]);
        }
        let pieces = Components::of(&mask);
        assert!(pieces.sizes().iter().all(|&n| n >= min_length), "{:?}", pieces.sizes());
    }
}

#[test]
fn lines_of_real_terrain_are_well_formed() {
    for area in ["sierra", "alps"] {
        let z = real(area);
        for min_order in 1..=4 {
            let map = lines(&z, &ExtractionConfig { min_order, ..Default::default() });
            assert_well_formed(&map, &z, 10);
        }
        let map = default_lines(&z);
        let share = map.line_count() as f64 / z.len() as f64;
        assert!((0.08..0.18).contains(&share), "{area}: lines on {share} of the cells");
        for kind in [StrokeKind::Ridge, StrokeKind::Valley] {
            assert!(count(&map.mask_of(kind)) > 100, "{area} has both kinds");
        }
        let paper = lines(&z, &ExtractionConfig::paper());
        assert_well_formed(&paper, &z, 10);
        assert_ne!(paper, map);
    }
}

#[test]
fn ridges_are_the_valleys_of_the_terrain_upside_down() {
    let z = rough(70, 90, 4);
    let (map, turned) = (default_lines(&z), default_lines(&z.map(|z| -z)));
    assert_eq!(map.mask_of(StrokeKind::Ridge), turned.mask_of(StrokeKind::Valley));
    assert_eq!(map.mask_of(StrokeKind::Valley), turned.mask_of(StrokeKind::Ridge));
}

#[test]
fn unit_and_zero_do_not_matter() {
    let z = real("sierra");
    let map = default_lines(&z);
    // Changes of unit that are exact in f32 give exactly the same lines.
    for (scale, offset) in [(1.0, 8000.0), (0.25, -3000.0), (64.0, 0.0), (1.0 / 4096.0, 0.0)] {
        assert_eq!(
            default_lines(&z.map(|z| z * scale + offset)).kinds(),
            map.kinds(),
            "{scale} z + {offset}"
        );
    }
    // Feet and the unit interval are rounded.
    let (low, high) = (*z.as_slice()).iter().fold((f32::MAX, f32::MIN), |(l, h), &z| (l.min(z), h.max(z)));
    for other in [z.map(|z| z / 0.3048), z.map(|z| (z - low) / (high - low))] {
        let other = default_lines(&other);
        assert!(
            found_nearby(&other.mask(), &map.mask()) > 0.99
                && found_nearby(&map.mask(), &other.mask()) > 0.99
        );
    }
}

#[test]
fn turning_the_terrain_turns_the_lines() {
    let turn =
        |z: &Grid<f32>| Grid::from_fn(z.cols(), z.rows(), |c| z[Cell::new(c.col, z.cols() - 1 - c.row)]);
    // Terrain without equal heights: what remains is the choice between equally central cells when thinning.
    let z = rough(80, 100, 9);
    let (map, turned) = (default_lines(&z), default_lines(&turn(&z)));
    for kind in [StrokeKind::Ridge, StrokeKind::Valley] {
        let a = turned.mask_of(kind);
        let b = {
            let m = map.mask_of(kind);
            Grid::from_fn(m.cols(), m.rows(), |c| m[Cell::new(c.col, m.cols() - 1 - c.row)])
        };
        let same = a.as_slice().iter().zip(b.as_slice()).filter(|(x, y)| **x && **y).count();
        let exact = same as f64 / count(&a) as f64;
        eprintln!(
            "turned by 90 degrees: {exact:.3} of the {kind:?} cells exactly alike, {:.3} within a cell",
            found_nearby(&a, &b)
        );
        assert!(exact > 0.8 && found_nearby(&a, &b) > 0.98 && found_nearby(&b, &a) > 0.98);
    }
}

#[test]
fn a_straight_valley() {
    let z = Grid::from_fn(60, 61, |c| 3.0 * c.col.abs_diff(30) as f32 + 0.3 * c.row as f32);
    let map = default_lines(&z);
    assert_eq!(count(&map.mask_of(StrokeKind::Ridge)), 0);
    let valley = map.mask_of(StrokeKind::Valley);
    assert!(
        valley.cells().all(|(c, &on)| on == (c.col == 30)),
        "the thalweg from frame to frame and nothing else"
    );
}

#[test]
fn a_pyramid_has_four_ridges() {
    let z = Grid::from_fn(81, 81, |c| -(c.row.abs_diff(40).max(c.col.abs_diff(40)) as f32));
    let map = default_lines(&z);
    assert_eq!(count(&map.mask_of(StrokeKind::Valley)), 0);
    let ridges = map.mask_of(StrokeKind::Ridge);
    let off = |c: Cell| c.row.abs_diff(40).abs_diff(c.col.abs_diff(40));
    assert!(ridges.cells().all(|(c, &on)| !on || off(c) <= 1), "only along the diagonals");
    for (row, col) in [(10, 10), (10, 70), (70, 10), (70, 70), (40, 40)] {
        let corner = Grid::from_fn(81, 81, |c| c == Cell::new(row, col));
        assert_eq!(found_nearby(&corner, &ridges), 1.0, "the ridge towards row {row}, column {col}");
    }
}

#[test]
fn a_lake_carries_one_line() {
    // Rough ground around a wide lake; the level is a whole number, as in real tiles.
    let bed = rough(140, 180, 3);
    let z = Grid::from_fn(140, 180, |c| {
        let (dr, dc) = ((c.row as f32 - 70.0) / 45.0, (c.col as f32 - 90.0) / 65.0);
        (bed[c] * 0.3 + 100.0 * (dr.hypot(dc) - 1.0)).max(-30.0)
    });
    let lake = z.map(|&z| z == -30.0);
    let open_water = crate::grid::morphology::erode(&lake, 4);
    assert!(count(&open_water) > 2000, "{}", count(&open_water));
    for min_order in [1, 2] {
        let map = lines(&z, &ExtractionConfig { min_order, ..Default::default() });
        let on_water = |kind| map.mask_of(kind).cells().filter(|(c, on)| **on && open_water[*c]).count();
        assert_eq!(on_water(StrokeKind::Ridge), 0);
        let valley = on_water(StrokeKind::Valley);
        assert!(
            valley < 200,
            "one line is at most about as long as the lake is wide and high: {valley} cells"
        );
    }
}

#[test]
fn no_lines_run_along_the_frame() {
    let mut frame = [0, 0];
    let mut inside = [0, 0];
    let terrain = (0..6).map(|seed| rough(96, 96, seed)).chain(["sierra", "alps"].map(real));
    for z in terrain {
        let map = default_lines(&z);
        let (rows, cols) = z.shape();
        for (c, kind) in map.kinds().cells() {
            let edge = c.row.min(c.col).min(rows - 1 - c.row).min(cols - 1 - c.col);
            let tally = if edge < 2 { &mut frame } else { &mut inside };
            tally[0] += usize::from(kind.is_some());
            tally[1] += 1;
        }
    }
    let [frame, inside] = [frame, inside].map(|[lines, cells]| lines as f64 / cells as f64);
    eprintln!("lines on {frame:.3} of the two outer rows and columns, on {inside:.3} of the rest");
    assert!(frame < 1.1 * inside && frame > 0.5 * inside);
}

#[test]
fn voids_carry_no_lines_and_are_not_read() {
    let z = real("alps");
    let valid = Grid::from_fn(64, 64, |c| c.distance_squared(Cell::new(30, 30)) > 60 && c.row + c.col > 3);
    let config = ExtractionConfig::default();
    let fill_voids = |value: f32| Grid::from_fn(64, 64, |c| if valid[c] { z[c] } else { value });
    let map = ridges_and_valleys(&fill_voids(f32::NAN), &valid, &config).unwrap();
    assert_eq!(map, ridges_and_valleys(&fill_voids(-32768.0), &valid, &config).unwrap());
    assert!(map.kinds().cells().all(|(c, kind)| kind.is_none() || valid[c]));
    assert!(map.line_count() > 200);
}

#[test]
fn level_and_tiny_terrain_has_no_lines() {
    for (rows, cols) in [(1, 1), (1, 40), (2, 2), (40, 1), (50, 50)] {
        assert_eq!(default_lines(&Grid::filled(rows, cols, 812.5)).line_count(), 0);
    }
    assert_eq!(default_lines(&Grid::from_fn(3, 3, |c| (c.row * c.col) as f32)).line_count(), 0);
}

#[test]
fn bad_input_is_named() {
    let z = Grid::filled(4, 4, 1.0f32);
    let config = ExtractionConfig::default();
    let message = |z: &Grid<f32>, valid: &Mask, config: &ExtractionConfig| {
        ridges_and_valleys(z, valid, config).unwrap_err().to_string()
    };
    assert!(message(&z, &Grid::filled(4, 4, false), &config).contains("number of valid heights"));
    assert!(message(&z, &Grid::filled(4, 5, true), &config).contains("void mask"));
    let hot = z.map(|_| f32::INFINITY);
    assert!(message(&hot, &z.map(|_| true), &config).contains("height at row 0, column 0"));
    let wild = ExtractionConfig { min_order: 0, ..config };
    assert!(message(&z, &z.map(|_| true), &wild).contains("min_order"));
}

#[test]
fn threads_do_not_matter() {
    let z = rough(150, 170, 21);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| extract(&z, &z.map(|_| true), &ExtractionConfig::default()).unwrap())
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn orders_thin_the_sketch_out() {
    let z = rough(160, 160, 5);
    let at = |min_order: u8| {
        let config = ExtractionConfig { min_order, ..Default::default() };
        extract(&z, &z.map(|_| true), &config).unwrap()
    };
    let extractions: Vec<Extraction> = (1..=4).map(at).collect();
    let lengths: Vec<usize> = extractions.iter().map(|e| e.lines.line_count()).collect();
    assert!(lengths.is_sorted_by(|a, b| a > b) && lengths[3] > 0, "{lengths:?}");
    for (extraction, lowest) in extractions.iter().zip(1..) {
        for (cell, kind) in extraction.lines.kinds().cells() {
            let order = extraction.orders[cell];
            assert!(if kind.is_some() { order >= lowest } else { order == 0 });
        }
    }
    let sparse = extractions[3].lines.mask();
    assert!(found_nearby(&sparse, &extractions[1].lines.mask()) > 0.97);
}

#[test]
fn variants_differ_and_start_with_the_base() {
    let z = rough(128, 128, 8);
    let base = ExtractionConfig::default();
    let configs = base.variants(10, Seed(3));
    let all = variants(&z, &z.map(|_| true), &base, 10, Seed(3)).unwrap();
    assert_eq!(all[0], default_lines(&z));
    for (i, a) in all.iter().enumerate() {
        assert_well_formed(a, &z, base.min_length);
        assert_eq!(*a, lines(&z, &configs[i]));
        assert!(all[i + 1..].iter().all(|b| a != b), "variant {i} is one of its own");
    }
    assert!(variants(&z, &z.map(|_| true), &base, 0, Seed(3)).is_err());
}

#[test]
fn a_window_with_context_shows_the_lines_of_the_whole() {
    let z = rough(150, 150, 13);
    let config = ExtractionConfig::default();
    let window = Window::new(Cell::new(40, 30), 64, 80);
    let map = crop_lines(&default_lines(&z), window, config.min_length).unwrap();
    let crop = z.crop(window).unwrap();
    assert_well_formed(&map, &crop, config.min_length);
    let whole = default_lines(&z).kinds().crop(window).unwrap();
    assert!(map.kinds().cells().all(|(c, k)| k.is_none() || *k == whole[c]));
    let kept = map.line_count() as f64 / whole.as_slice().iter().flatten().count() as f64;
    assert!(kept > 0.85, "{kept}");
    // From the window alone most lines are the same, because the margin continues the terrain.
    let alone = default_lines(&crop);
    assert!(found_nearby(&alone.mask(), &map.mask()) > 0.8, "{}", found_nearby(&alone.mask(), &map.mask()));
    assert!(crop_lines(&default_lines(&z), Window::square(Cell::new(100, 0), 64), 1).is_err());
}
