//! The synthesis on small exemplars.

use super::*;
use crate::dem::{CellSize, Dem};
use crate::grid::{Cell, distance};
use crate::interpolation::Gradients;
use crate::metrics::{Origin, Provenance};
use crate::sketch::StrokeKind;

/// Hills of several sizes cut by valleys that fall to the south.
fn terrain(rows: usize, cols: usize) -> Grid<f32> {
    Grid::from_fn(rows, cols, |c| {
        let (y, x) = (c.row as f32, c.col as f32);
        let valley = 40.0 * (0.11 * x + 1.3 * (0.03 * y).sin()).sin().abs();
        let gullies = 12.0 * (0.35 * y + 2.0 * (0.11 * x).sin()).sin() * (0.3 * x).cos();
        let grain = ((c.row * 7919 + c.col * 104_729) % 97) as f32 * 0.02;
        600.0 + valley + gullies + grain - 0.4 * y
    })
}

fn dem(rows: usize, cols: usize) -> Dem {
    Dem::new(terrain(rows, cols), CellSize::square(30.0).unwrap()).unwrap()
}

/// A ridge and a valley across the map, with one end on the frame each.
fn drawing(rows: usize, cols: usize) -> LineMap {
    let mut lines = LineMap::empty(rows, cols);
    for row in 0..rows * 3 / 4 {
        lines.set(Cell::new(row, cols / 3), StrokeKind::Ridge, 640.0 - 0.4 * row as f32);
    }
    for row in rows / 5..rows {
        lines.set(Cell::new(row, cols * 2 / 3), StrokeKind::Valley, 600.0 - 0.4 * row as f32);
    }
    lines
}

fn synthesis(dem: &Dem) -> Synthesis {
    let mut config = SynthesisConfig::default();
    config.quilting.candidates = 3000;
    Synthesis::new(dem, &config).unwrap()
}

#[test]
fn strokes_are_met_on_any_shape_and_seeds_differ() {
    let synthesis = synthesis(&dem(96, 120));
    for (rows, cols) in [(64, 64), (37, 90), (9, 12)] {
        let lines = drawing(rows, cols);
        let run = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| synthesis.synthesize(&lines, Seed(seed), &Stop::new()).unwrap())
        };
        let one = run(1, 1);
        let two = run(2, 1);
        assert_eq!(one.heights, two.heights);
        assert_eq!(one.provenance, two.provenance);
        assert_eq!(one.heights.shape(), (rows, cols));
        for (cell, kind) in lines.kinds().cells() {
            assert!(one.heights[cell].is_finite());
            let drawn = lines.heights()[cell].to_bits();
            assert!(kind.is_none() || one.heights[cell].to_bits() == drawn, "{cell:?}");
        }
        if rows > 30 {
            // Far from strokes another seed makes another terrain.
            let other = run(2, 2).heights;
            let far = distance::squared(&lines.mask());
            let apart: Vec<f32> = far
                .cells()
                .filter(|(_, d)| **d > 64)
                .map(|(c, _)| (one.heights[c] - other[c]).abs())
                .collect();
            assert!(apart.iter().sum::<f32>() / apart.len() as f32 > 0.5);
        }
    }
}

/// What is written as the origin is where the forms come from: gradients between cells of one piece are the exemplar's, stretched.
#[test]
fn gradients_are_those_of_the_provenance() {
    let dem = dem(96, 120);
    let made = synthesis(&dem).synthesize(&drawing(96, 96), Seed(1), &Stop::new()).unwrap();
    let origins = made.provenance.origins();
    let own = Gradients::of(&made.heights).east;
    let (mut same, mut pieces) = ([0.0f64; 3], 0);
    for (here, origin) in origins.cells().filter(|(c, _)| c.col + 1 < 96) {
        let Origin::Exemplar { cell, symmetry } = *origin else { continue };
        let (down, right) = Provenance::step(symmetry, 0, 1);
        let there = Cell::new((cell.row as i32 + down) as usize, (cell.col as i32 + right) as usize);
        let Origin::Exemplar { cell: next, symmetry: other } = origins[Cell::new(here.row, here.col + 1)]
        else {
            continue;
        };
        if next != there || other != symmetry {
            continue;
        }
        let (a, b) = (f64::from(own[here]), f64::from(dem.heights()[there] - dem.heights()[cell]));
        same = [same[0] + a * b, same[1] + a * a, same[2] + b * b];
        pieces += 1;
    }
    let correlation = same[0] / (same[1] * same[2]).sqrt();
    assert!(pieces > 96 * 96 / 3, "{pieces} cells go on from their neighbour");
    assert!(correlation > 0.7, "{correlation}");
}

#[test]
fn voids_are_never_sources() {
    let heights = terrain(128, 128);
    let valid = Grid::from_fn(128, 128, |c| !(30..50).contains(&c.row) || c.col > 70);
    // Whatever stands in a void would be seen.
    let spoilt = Grid::from_fn(128, 128, |c| if valid[c] { heights[c] } else { -9e4 });
    let dem = Dem::with_voids(spoilt, valid.clone(), CellSize::square(30.0).unwrap()).unwrap();
    let made = synthesis(&dem).synthesize(&drawing(80, 80), Seed(1), &Stop::new()).unwrap();
    for (cell, origin) in made.provenance.origins().cells() {
        if let Origin::Exemplar { cell: source, .. } = origin {
            assert!(valid[*source], "{cell:?} comes from the void at {source:?}");
        }
    }
    assert!(made.heights.as_slice().iter().all(|z| (400.0..800.0).contains(z)));
}

/// The exemplar's own lines on a map of its size give terrain that is nearer to it than the membrane is.
#[test]
fn own_strokes_give_the_exemplar_back() {
    let dem = dem(128, 128);
    let synthesis = synthesis(&dem);
    let lines = crate::extract::ridges_and_valleys(
        dem.heights(),
        dem.valid(),
        &crate::extract::ExtractionConfig { min_accumulation: 60, ..Default::default() },
    )
    .unwrap();
    let made = synthesis.synthesize(&lines, Seed(1), &Stop::new()).unwrap().heights;
    let membrane =
        crate::interpolation::harmonic(&lines.mask(), &lines.heights().map(|z| f64::from(*z))).unwrap();
    let slope = |z: &Grid<f32>| Gradients::of(z).mean_length();
    let (own, got, level) = (slope(dem.heights()), slope(&made), slope(&membrane.map(|z| *z as f32)));
    assert!((got / own - 1.0).abs() < (level / own - 1.0).abs(), "{own} {got} {level}");
    let error = |z: &dyn Fn(Cell) -> f64| {
        let squares = dem.heights().cells().map(|(c, t)| (z(c) - f64::from(*t)).powi(2));
        (squares.sum::<f64>() / dem.heights().len() as f64).sqrt()
    };
    let spread = error(&|_| {
        let all = dem.heights().as_slice();
        all.iter().map(|z| f64::from(*z)).sum::<f64>() / all.len() as f64
    });
    assert!(error(&|c| f64::from(made[c])) < 0.5 * spread, "{} of {spread}", error(&|c| f64::from(made[c])));
}

/// Narrow crests on level ground with pits between them: nothing that rivers made.
fn crests(sign: f32) -> Dem {
    let crest = |at: f32| 30.0 * (0.5 + 0.5 * (std::f32::consts::TAU * at).cos()).powi(6);
    let heights = Grid::from_fn(128, 128, |c| {
        let (y, x) = (c.row as f32, c.col as f32);
        let grain = ((c.row * 7919 + c.col * 104_729) % 97) as f32 * 0.02;
        sign * (crest((x + 3.0 * (0.2 * y).sin()) / 24.0) + crest(y / 31.0) + grain) + 300.0
    });
    Dem::new(heights, CellSize::square(30.0).unwrap()).unwrap()
}

#[test]
fn ground_lies_below_crests_and_above_furrows() {
    let lift = |sign| synthesis(&crests(sign)).drawn([6, 6]).unwrap().lift;
    let (below, above) = (lift(1.0), lift(-1.0));
    assert!(below < -0.1 && above > 0.1, "{below} {above}");
}

/// Without a landscape model the large forms are those of the strokes, and more so where the pull is not let go.
#[test]
fn large_forms_are_those_of_the_strokes() {
    let dem = crests(1.0);
    let mut lines = LineMap::empty(96, 96);
    for i in 0..96 {
        lines.set(Cell::new(i, 30), StrokeKind::Ridge, 330.0);
        lines.set(Cell::new(i, 80), StrokeKind::Valley, 300.0);
    }
    let membrane =
        crate::interpolation::harmonic(&lines.mask(), &lines.heights().map(|z| f64::from(*z))).unwrap();
    let large = |z: &Grid<f32>| crate::grid::gaussian::smooth(z, &z.map(|_| true), 12.0);
    let wanted = large(&membrane.map(|z| *z as f32));
    let error = |cut_alone: f64| {
        let mut config = SynthesisConfig { cut_alone, ..Default::default() };
        config.quilting.candidates = 3000;
        let synthesis = Synthesis::new(&dem, &config).unwrap();
        assert!(!synthesis.landscape().is_fluvial());
        let one = |seed| {
            let made = synthesis.synthesize(&lines, Seed(seed), &Stop::new()).unwrap();
            let apart =
                large(&made.heights).cells().map(|(c, z)| f64::from(z - wanted[c])).collect::<Vec<_>>();
            let mean = apart.iter().sum::<f64>() / apart.len() as f64;
            apart.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / apart.len() as f64
        };
        (1..=4).map(one).sum::<f64>()
    };
    let (pulled, free) = (error(48.0), error(1e6));
    assert!(pulled < 0.8 * free, "{pulled} {free}");
}

#[test]
fn what_cannot_be_is_named() {
    let config = SynthesisConfig::default();
    let fails = |dem: &Dem| Synthesis::new(dem, &config).err().unwrap().to_string();
    assert!(fails(&dem(20, 200)).contains("20x200"));
    let level = Dem::new(Grid::filled(64, 64, 5.0), CellSize::square(30.0).unwrap()).unwrap();
    assert!(fails(&level).contains("relief"));
    let holes = Grid::from_fn(64, 64, |c| (c.row + c.col) % 3 != 0);
    let holes = Dem::with_voids(terrain(64, 64), holes, CellSize::square(30.0).unwrap()).unwrap();
    assert!(fails(&holes).contains("whole patches"));
    let small = synthesis(&dem(40, 40));
    assert!(small.config().levels.len() < config.levels.len(), "a small exemplar begins at a finer size");
    let message = small.synthesize(&LineMap::empty(32, 32), Seed(1), &Stop::new()).unwrap_err().to_string();
    assert!(message.contains("line cells is 0"), "{message}");
    let stop = Stop::new();
    stop.raise();
    let stopped = small.synthesize(&drawing(32, 32), Seed(1), &stop);
    assert!(matches!(stopped, Err(crate::Error::Stopped)));
    let mut one = LineMap::empty(32, 40);
    one.set(Cell::new(0, 0), StrokeKind::Ridge, 610.0);
    assert_eq!(small.synthesize(&one, Seed(1), &Stop::new()).unwrap().heights[Cell::new(0, 0)], 610.0);
}
