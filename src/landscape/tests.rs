//! Properties of the whole model.

use super::*;
use crate::control::Stop;
use crate::flow::{Surface, accumulate, route};
use crate::grid::{Cell, Grid, Mask, Window, d8};
use crate::seed::Seed;
use crate::sketch::{LineMap, StrokeKind};

/// The steady state of S = k A^-theta on square cells of 30 m, made by plain routing alone.
fn power_law(rows: usize, cols: usize, k: f64, theta: f64) -> Grid<f32> {
    let mut z = Grid::from_fn(rows, cols, |c| {
        let inward = c.row.min(c.col).min(rows - 1 - c.row).min(cols - 1 - c.col) as f32;
        10.0 * inward + ((c.row * 7919 + c.col * 104_729 + c.row * c.col) % 97) as f32
    });
    for _ in 0..12 {
        let directions = route(&Surface::new(z.clone(), z.map(|_| true)).unwrap());
        let areas = accumulate(&directions);
        let mut order: Vec<Cell> = z.cells().map(|(c, _)| c).collect();
        order.sort_by_key(|&c| std::cmp::Reverse(areas.counts()[c]));
        let mut next = Grid::filled(rows, cols, 0.0f32);
        for cell in order {
            if let Some(r) = directions.receiver(cell) {
                let distance = 30.0 * (cell.distance_squared(r) as f64).sqrt();
                let slope = k * f64::from(areas.counts()[cell]).powf(-theta);
                next[cell] = next[r] + (distance * slope) as f32;
            }
        }
        z = next;
    }
    z
}

fn fitted() -> LandscapeFit {
    let z = power_law(160, 192, 0.6, 0.4);
    LandscapeFit::of(&z, &z.map(|_| true), 30.0).unwrap()
}

fn line(lines: &mut LineMap, kind: StrokeKind, from: (i32, i32, f32), to: (i32, i32, f32)) {
    let steps = (to.0 - from.0).abs().max((to.1 - from.1).abs()).max(1);
    for step in 0..=steps {
        let share = step as f32 / steps as f32;
        let between = |a: i32, b: i32| (a as f32 + share * (b - a) as f32).round() as usize;
        let cell = Cell::new(between(from.0, to.0), between(from.1, to.1));
        lines.set(cell, kind, from.2 + share * (to.2 - from.2));
    }
}

/// A river through the map and a ridge on each side.
fn valley_and_ridges(rows: usize, cols: usize) -> LineMap {
    let mut lines = LineMap::empty(rows, cols);
    let (r, c) = (rows as i32, cols as i32);
    line(&mut lines, StrokeKind::Ridge, (r / 6, c / 5, 700.0), (r * 5 / 6, c / 4, 800.0));
    line(&mut lines, StrokeKind::Ridge, (r / 5, c * 4 / 5, 600.0), (r * 4 / 5, c * 3 / 4, 900.0));
    line(&mut lines, StrokeKind::Valley, (r - 1, c / 2, 100.0), (r / 8, c / 2, 250.0));
    lines
}

#[test]
fn the_exponent_of_a_power_law_is_recovered() {
    for (k, theta) in [(0.6, 0.4), (0.3, 0.2), (1.0, 0.55)] {
        let z = power_law(160, 192, k, theta);
        let fit = LandscapeFit::of(&z, &z.map(|_| true), 30.0).unwrap();
        assert!((fit.slope_area.theta - theta).abs() < 0.02, "{} for {theta}", fit.slope_area.theta);
        for area in [20.0, 200.0, 2000.0f64] {
            let (found, made) = (fit.slope_area.slope(area), k * area.powf(-theta));
            assert!((found / made - 1.0).abs() < 0.06, "slope {found} for {made} at {area}");
        }
        assert!(fit.is_fluvial());
    }
}

#[test]
fn voids_are_not_read() {
    let z = power_law(96, 96, 0.6, 0.4);
    let valid = Mask::from_fn(96, 96, |c| c.distance_squared(Cell::new(60, 40)) > 80);
    let with = |height: f32| {
        let z = Grid::from_fn(96, 96, |c| if valid[c] { z[c] } else { height });
        LandscapeFit::of(&z, &valid, 30.0).unwrap()
    };
    assert_eq!(with(0.0), with(-32768.0));
    assert_eq!(with(0.0), with(f32::NAN));
    assert_ne!(with(0.0), LandscapeFit::of(&z, &z.map(|_| true), 30.0).unwrap());
}

#[test]
fn unfit_exemplars_are_refused_by_name() {
    let level = Grid::filled(64, 64, 7.0f32);
    let everywhere = level.map(|_| true);
    let refused =
        |z: &Grid<f32>, valid: &Mask, cell: f64| LandscapeFit::of(z, valid, cell).unwrap_err().to_string();
    assert!(refused(&level, &everywhere, 30.0).contains("relief"));
    let z = power_law(64, 64, 0.6, 0.4);
    assert!(refused(&z, &everywhere, 0.0).contains("cell size"));
    let small = z.crop(Window::new(Cell::new(0, 0), 12, 64)).unwrap();
    assert!(refused(&small, &small.map(|_| true), 30.0).contains("12x64"));
    let holes = Mask::from_fn(64, 64, |c| c.row % 2 == 0 && c.col % 2 == 0);
    assert!(refused(&z, &holes, 30.0).contains("cells of the exemplar"));
}

#[test]
fn dunes_and_craters_are_not_fluvial() {
    let z = Grid::from_fn(128, 128, |c| {
        ((c.row as f32 * 0.3).sin() + (c.col as f32 * 0.27).cos()) * 40.0 + 0.01 * c.row as f32
    });
    assert!(!LandscapeFit::of(&z, &z.map(|_| true), 30.0).unwrap().is_fluvial());
}

#[test]
fn lines_are_nearly_met_and_then_pinned() {
    let fit = fitted();
    let lines = valley_and_ridges(96, 120);
    for seed in 1..4 {
        let landscape = solve(&fit, &lines, 30.0, &LandscapeConfig::default(), Seed(seed)).unwrap();
        let heights = landscape.heights(1).unwrap();
        let misses = lines.kinds().cells().filter(|(_, kind)| kind.is_some());
        let misses: Vec<f32> = misses.map(|(c, _)| (heights[c] - lines.heights()[c]).abs()).collect();
        let mean = misses.iter().sum::<f32>() / misses.len() as f32;
        assert!(mean < 8.0, "mean miss of {mean} m in 800");
        let pinned = pin(&heights, &lines).unwrap();
        for (cell, _) in lines.kinds().cells().filter(|(_, kind)| kind.is_some()) {
            assert_eq!(pinned[cell].to_bits(), lines.heights()[cell].to_bits());
        }
        // And nowhere moved by more than the worst miss.
        let worst = misses.iter().copied().fold(0.0, f32::max);
        let moved = pinned.as_slice().iter().zip(heights.as_slice()).map(|(a, b)| (a - b).abs());
        assert!(moved.fold(0.0, f32::max) < 3.0 * worst + 1.0);
    }
}

/// Steps of steepest descent from every cell end at a base.
fn drains(z: &Grid<f32>, is_base: impl Fn(Cell) -> bool) -> Result<(), Cell> {
    let (rows, cols) = z.shape();
    for (start, _) in z.cells() {
        let mut here = start;
        loop {
            if is_base(here) || here.row == 0 || here.col == 0 || here.row + 1 == rows || here.col + 1 == cols
            {
                break;
            }
            let lower = (0..8).filter_map(|code| d8::neighbour(here, code, rows, cols));
            match lower.filter(|n| z[*n] < z[here]).min_by(|a, b| z[*a].total_cmp(&z[*b])) {
                Some(next) => here = next,
                None => return Err(here),
            }
        }
    }
    Ok(())
}

#[test]
fn breaching_drains_every_cell_and_leaves_the_lines() {
    let lines = valley_and_ridges(80, 90);
    let rough = Grid::from_fn(80, 90, |c| {
        300.0 + c.col.abs_diff(45) as f32 * 3.0 + ((c.row * 31 + c.col * 17 + c.row * c.col) % 29) as f32
    });
    let pinned = pin(&rough, &lines).unwrap();
    let is_valley = |c: Cell| lines.kinds()[c] == Some(StrokeKind::Valley);
    assert!(drains(&pinned, is_valley).is_err(), "there is something to do");
    let thorough = BreachConfig { depths: vec![0.02, 0.1, 1.0, 1.0, 1.0], longest: 10_000, pit_share: 0.0 };
    let breached = breach(&pinned, &lines, &thorough, &Stop::new()).unwrap();
    assert!(breached.cuts > 0 && breached.pits_after < breached.pits_before);
    let is_line = |c: Cell| lines.kinds()[c].is_some();
    assert_eq!(drains(&breached.heights, is_line), Ok(()));
    for (cell, _) in lines.kinds().cells().filter(|(_, kind)| kind.is_some()) {
        assert_eq!(breached.heights[cell].to_bits(), lines.heights()[cell].to_bits());
    }
    let highest_river = 260.0;
    for (cell, &new) in breached.heights.cells() {
        assert!(new <= pinned[cell] || new < highest_river, "only moats of the river are filled: {cell:?}");
    }
}

#[test]
fn solutions_drain_but_for_a_few_cells() {
    let (fit, lines) = (fitted(), valley_and_ridges(128, 128));
    let landscape = solve(&fit, &lines, 30.0, &LandscapeConfig::default(), Seed(3)).unwrap();
    let pinned = pin(&landscape.heights(1).unwrap(), &lines).unwrap();
    let breached = breach(&pinned, &lines, &BreachConfig::default(), &Stop::new()).unwrap();
    assert!(breached.pits_after <= 0.003, "{} of the cells in pits", breached.pits_after);
}

#[test]
fn threads_change_no_bit_and_seeds_do() {
    let (fit, lines) = (fitted(), valley_and_ridges(72, 61));
    let run = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let landscape = solve(&fit, &lines, 30.0, &LandscapeConfig::default(), Seed(seed)).unwrap();
            let pinned = pin(&landscape.heights(1).unwrap(), &lines).unwrap();
            breach(&pinned, &lines, &BreachConfig::default(), &Stop::new()).unwrap()
        })
    };
    let one = run(1, 5);
    assert_eq!(one, run(2, 5));
    assert_eq!(one, run(7, 5));
    assert_ne!(one.heights, run(2, 6).heights);
}

#[test]
fn every_drawing_has_terrain() {
    let fit = fitted();
    let mut drawings = Vec::new();
    type End = (i32, i32, f32);
    let draw = |rows: usize, cols: usize, strokes: &[(StrokeKind, End, End)]| {
        let mut lines = LineMap::empty(rows, cols);
        strokes.iter().for_each(|&(kind, from, to)| line(&mut lines, kind, from, to));
        lines
    };
    use StrokeKind::{Ridge, Valley};
    drawings.push(draw(16, 16, &[(Ridge, (8, 2, 500.0), (8, 13, 600.0))]));
    drawings.push(draw(16, 16, &[(Valley, (15, 8, 100.0), (2, 8, 200.0))]));
    drawings.push(draw(40, 17, &[(Valley, (0, 0, 100.0), (39, 0, 90.0))]));
    drawings.push(draw(33, 70, &[(Ridge, (10, 10, 100.0), (10, 10, 100.0))]));
    drawings.push(draw(
        50,
        50,
        &[(Ridge, (10, 10, 300.0), (40, 40, 300.0)), (Valley, (10, 40, 300.0), (40, 10, 300.0))],
    ));
    let square = [(10, 10, 400.0), (10, 40, 420.0), (40, 40, 400.0), (40, 10, 380.0), (10, 10, 400.0)];
    for kind in [Ridge, Valley] {
        let sides: Vec<_> = square.windows(2).map(|w| (kind, w[0], w[1])).collect();
        drawings.push(draw(50, 50, &sides));
    }
    drawings.push(draw(1, 1, &[(Ridge, (0, 0, 5.0), (0, 0, 5.0))]));
    for (n, lines) in drawings.iter().enumerate() {
        for cell_size in [3.0, 30.0, 300.0] {
            let solved = solve(&fit, lines, cell_size, &LandscapeConfig::default(), Seed(1)).unwrap();
            for factor in [1, 2, 4] {
                let heights = solved.heights(factor).unwrap();
                let (rows, cols) = lines.shape();
                assert_eq!(heights.shape(), (rows.div_ceil(factor), cols.div_ceil(factor)), "drawing {n}");
                assert!(heights.as_slice().iter().all(|z| z.is_finite()), "drawing {n}");
            }
            let pinned = pin(&solved.heights(1).unwrap(), lines).unwrap();
            breach(&pinned, lines, &BreachConfig::default(), &Stop::new()).unwrap();
        }
    }
    let solve_empty =
        |cell: f64| solve(&fit, &LineMap::empty(20, 20), cell, &LandscapeConfig::default(), Seed(1));
    assert!(solve_empty(30.0).unwrap_err().to_string().contains("line cells is 0"));
    assert!(solve_empty(-1.0).unwrap_err().to_string().contains("cell size"));
}

#[test]
fn the_guide_is_the_coarse_part_of_the_landscape() {
    let (fit, lines) = (fitted(), valley_and_ridges(100, 90));
    let guide = solve(&fit, &lines, 30.0, &LandscapeConfig::guide(), Seed(2)).unwrap();
    assert_eq!(guide.factor, 2);
    let whole = solve(&fit, &lines, 30.0, &LandscapeConfig::default(), Seed(2)).unwrap();
    let (a, b) = (guide.heights(8).unwrap(), whole.heights(8).unwrap());
    let apart =
        a.as_slice().iter().zip(b.as_slice()).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32;
    assert!(apart < 60.0, "{apart} m apart in 800");
    assert!(guide.heights(3).is_err() && guide.heights(64).is_err());
}

#[test]
fn settings_out_of_range_are_named() {
    let config = LandscapeConfig { amplitude: -1.0, ..LandscapeConfig::default() };
    assert!(config.validate().unwrap_err().to_string().contains("amplitude"));
    for levels in [vec![], vec![(1, 8), (2, 8)], vec![(3, 8)], vec![(4, 0)]] {
        let levels = levels.into_iter().map(|(factor, iterations)| Level { factor, iterations }).collect();
        assert!(LandscapeConfig { levels, ..LandscapeConfig::default() }.validate().is_err());
    }
    let text = serde_json::to_string(&LandscapeConfig::default()).unwrap();
    assert_eq!(serde_json::from_str::<LandscapeConfig>(&text).unwrap(), LandscapeConfig::default());
    let text = serde_json::to_string(&fitted()).unwrap();
    assert_eq!(serde_json::from_str::<LandscapeFit>(&text).unwrap(), fitted());
}
