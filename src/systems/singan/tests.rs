//! Training and use of the whole model on small ground.

use super::config::{Decay, View};
use super::scale::Inputs;
use super::scale::noise_field;
use super::train::turned;
use super::{Detail, DetailConfig, DetailInfo};
use crate::control::{Checkpoints, Control, Progress, Stop};
use crate::error::Result;
use crate::grid::{Cell, Grid, Mask, Window};
use crate::metrics::psnr;
use crate::seed::Seed;
use crate::systems::task::{DetailModel, DetailUse, SampleUse};
use std::sync::OnceLock;

fn ground(side: usize) -> Grid<f32> {
    Grid::from_fn(side, side, |c| {
        let (y, x) = (c.row as f32 * 0.35, c.col as f32 * 0.28);
        0.5 + 0.2 * (0.5 * y).sin() + 0.15 * (0.4 * x + y).cos() + 0.04 * (2.3 * x).sin() * (2.9 * y).cos()
    })
}

fn quick() -> DetailConfig {
    DetailConfig { coarsest: 16, steps: 12, ..DetailConfig::default() }
}

/// A training that is only watched.
fn train(
    heights: &Grid<f32>,
    twins: &[Grid<f32>],
    config: &DetailConfig,
    seed: Seed,
    mut progress: impl FnMut(&Progress<'_>),
) -> Result<Detail> {
    super::train(heights, twins, config, seed, Control::new(&mut progress))
}

/// One model for all tests that only use it.
fn model() -> &'static Detail {
    static MODEL: OnceLock<Detail> = OnceLock::new();
    MODEL.get_or_init(|| train(&ground(40), &[ground(40)], &quick(), Seed(1), |_| {}).unwrap())
}

#[test]
fn same_seed_same_bytes_on_any_number_of_threads() {
    for base in [quick(), DetailConfig { coarsest: 16, steps: 2, fine_width: 32, ..DetailConfig::paper() }] {
        let run = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let config = DetailConfig { steps: 2, ..base.clone() };
                let detail = train(&ground(24), &[ground(24)], &config, Seed(seed), |_| {}).unwrap();
                let map = detail
                    .add(&ground(50), None, None, &DetailUse::default(), Seed(2), &Stop::new())
                    .unwrap();
                // The description holds the seconds of the training.
                (detail.parts().1, map)
            })
        };
        let one = run(1, 1);
        assert!(one == run(3, 1));
        assert!(one.0 != run(1, 2).0);
    }
}

/// Over six seeds and two vector levels to .27 to .41 of the first error, and 33.6 to 35.6 dB.
#[test]
fn training_learns_to_rebuild_the_exemplar() {
    let heights = ground(40);
    let config = DetailConfig { coarsest: 16, steps: 150, ..DetailConfig::default() };
    let mut reports = Vec::new();
    let detail = train(&heights, &[], &config, Seed(1), |r| {
        reports.push(r.figure("reconstruction").unwrap());
    })
    .unwrap();
    assert_eq!(reports.len(), detail.sizes.len() * 150);
    assert!(reports[149] < 0.5 * reports[0], "{} {}", reports[0], reports[149]);
    let rebuilt = detail.reconstruct();
    let db = psnr(&rebuilt, &heights, &heights.map(|_| true), 1.0).unwrap();
    assert!(db > 28.0, "{db}");
}

#[test]
fn tiled_equals_untiled_to_the_bit() {
    let scale = model().scales.last().unwrap();
    let up = ground(61);
    let field = noise_field(scale.inputs, 61, 61, &mut Seed(5).stream("noise"));
    let whole = scale.apply_tiled(&up, Some(&field), 1.0, 1000);
    assert_ne!(whole, up);
    for tile in [7, 16, 61] {
        assert_eq!(scale.apply_tiled(&up, Some(&field), 1.0, tile), whole);
    }
}

#[test]
fn strength_mask_and_seed_do_what_they_say() {
    let map = ground(50);
    let add = |how: &DetailUse, mask: Option<&Mask>, seed: u64| {
        model().add(&map, None, mask, how, Seed(seed), &Stop::new()).unwrap()
    };
    let how = DetailUse::default();
    // A model trained for twelve steps may find this ground rough enough: what is tested is not how much is added.
    let how = DetailUse { calibrated: false, ..how };
    let one = add(&how, None, 1);
    assert_eq!(one, add(&how, None, 1));
    assert_ne!(one, add(&how, None, 2));
    let still = DetailUse { noise: 0.0, likely: 1.0, ..how.clone() };
    assert_eq!(add(&still, None, 1), add(&still, None, 2));
    // Without strength and with all of its own forms the map stays itself.
    let none = DetailUse { strength: 0.0, keep: 1.0, ..how.clone() };
    assert_eq!(add(&none, None, 1), map);
    let free = DetailUse { calibrated: false, ..how.clone() };
    let twice = add(&DetailUse { strength: 2.0, ..free.clone() }, None, 1);
    let once = add(&free, None, 1);
    for ((m, a), b) in map.as_slice().iter().zip(once.as_slice()).zip(twice.as_slice()) {
        assert!((2.0 * (a - m) - (b - m)).abs() < 1e-5);
    }
    let mask = Mask::from_fn(50, 50, |c| c.row < 25);
    let masked = add(&how, Some(&mask), 1);
    for (cell, z) in masked.cells() {
        if !mask[cell] || cell.row <= 21 {
            assert_eq!(*z, if mask[cell] { one[cell] } else { map[cell] });
        }
    }
}

/// What was learned is blind to elevation, and with the relief matched also to the unit of heights.
#[test]
fn detail_does_not_depend_on_elevation_or_unit() {
    let map = ground(48);
    let moved = map.map(|z| 0.25 * z + 3.0);
    let add =
        |map: &Grid<f32>| model().add(map, None, None, &DetailUse::default(), Seed(1), &Stop::new()).unwrap();
    let (a, b) = (add(&map), add(&moved));
    for (a, b) in a.as_slice().iter().zip(b.as_slice()) {
        assert!((0.25 * a + 3.0 - b).abs() < 1e-4, "{a} {b}");
    }
}

/// With less variety terrain from noise is nearer to the exemplar, in either view and wherever it lies in a larger map: the mean of
/// six drawings, since single ones differ by half from each other.
///
/// Over six seeds and two vector levels, errors without variety over those with half and all of it, and half over all: slopes
/// .48 to .67, .28 to .41, .51 to .69, in a larger map .66 to .81, .41 to .49, .60 to .68; heights .34 to .79, .19 to .36, .31 to .75,
/// in a larger map .68 to .93, .51 to .83, .57 to .95. Of the same seed, two levels differ by up to .26 (heights).
#[test]
fn variety_says_how_much_of_the_layout_is_new() {
    let heights = ground(40);
    let ours = DetailConfig { steps: 300, ..quick() };
    let published = DetailConfig { coarsest: 16, fine_width: 32, steps: 50, ..DetailConfig::paper() };
    for config in [ours, published] {
        let detail = train(&heights, &[], &config, Seed(1), |_| {}).unwrap();
        let error = |side: usize, variety: f32, seed: u64| {
            let what = SampleUse { rows: side, cols: side, variety };
            let map = detail.sample(&what, Seed(seed), &Stop::new()).unwrap();
            let middle = map.crop(Window::square(Cell::new((side - 40) / 2, (side - 40) / 2), 40)).unwrap();
            let level = |map: &Grid<f32>| map.as_slice().iter().sum::<f32>() / map.len() as f32;
            let base = level(&middle) - level(&heights);
            let pairs = middle.as_slice().iter().zip(heights.as_slice());
            pairs.map(|(a, b)| f64::from(a - b - base).powi(2)).sum::<f64>().sqrt()
        };
        for side in [40, 72] {
            let mean = |variety| (3..9).map(|seed| error(side, variety, seed)).sum::<f64>() / 6.0;
            let [none, some, all] = [0.0, 0.5, 1.0].map(mean);
            let what = format!("{:?}, {side}: {none} {some} {all}", config.view);
            match (config.view, side) {
                (_, 40) => assert!(none < 0.9 * some && none < 0.55 * all && some < 0.9 * all, "{what}"),
                (View::Slopes, _) => assert!(none < 0.65 * all && some < 0.85 * all, "{what}"),
                // The frame of zeros, which held the middle, is not there.
                (View::Heights, _) => assert!(none < all, "{what}"),
            }
        }
    }
}

#[test]
fn parts_survive_storage_and_damage_is_named() {
    let (info, weights) = model().parts();
    let text = serde_json::to_string(&info).unwrap();
    let stored: DetailInfo = serde_json::from_str(&text).unwrap();
    let find = |name: &str| Ok(weights.iter().find(|(n, _)| n == name).unwrap().1.clone());
    let again = Detail::from_parts(stored.clone(), find).unwrap();
    let sample = |d: &Detail| d.sample(&SampleUse::new(40, 60), Seed(3), &Stop::new()).unwrap();
    assert_eq!(sample(&again), sample(model()));
    assert_eq!(sample(&again).shape(), (40, 60));
    assert!(
        Detail::from_parts(stored.clone(), |_| Ok(vec![0.0; 3])).unwrap_err().to_string().contains("scale 0")
    );
    let nan = |name: &str| find(name).map(|v: Vec<f32>| vec![f32::NAN; v.len()]);
    assert!(Detail::from_parts(stored.clone(), nan).is_err());
    let other = DetailInfo { sizes: vec![(40, 40)], ..stored };
    assert!(Detail::from_parts(other, find).is_err());
}

#[test]
fn bad_input_and_divergence_are_named() {
    let fails = |heights: &Grid<f32>, config: &DetailConfig| {
        train(heights, &[], config, Seed(1), |_| {}).unwrap_err().to_string()
    };
    assert!(fails(&ground(12), &quick()).contains("12x12"));
    assert!(fails(&Grid::filled(24, 24, 0.5), &quick()).contains("relief"));
    // At the first step of the second scale, over six seeds and two vector levels.
    let wild = DetailConfig { learning_rate: 1.0, decay: Decay::Late, ..quick() };
    let wild = DetailConfig { steps: 400, momentum: 0.0, penalty: 1e6, ..wild };
    assert!(fails(&ground(24), &wild).contains("diverged"));
    let mut hole = ground(40);
    hole[Cell::new(3, 4)] = f32::NAN;
    let message =
        model().add(&hole, None, None, &DetailUse::default(), Seed(1), &Stop::new()).unwrap_err().to_string();
    assert!(message.contains("row 3, column 4"));
    assert!(model().sample(&SampleUse::new(8, 80), Seed(1), &Stop::new()).is_err());
    let odd = train(&ground(40), &[ground(24)], &quick(), Seed(1), |_| {}).unwrap_err().to_string();
    assert!(odd.contains("twin"));
}

/// <judge x, y> = <x, adjoint y> for both views.
#[test]
fn the_critics_view_has_its_adjoint() {
    for view in [View::Heights, View::Slopes] {
        let inputs = Inputs { view, gain: 1.7 };
        let map = ground(12);
        let (side, channels) = (12 - inputs.loss(), inputs.critic_inputs());
        let mut seen = crate::learn::convolution::Plane::zeros(side, side, channels, 0);
        inputs.judge(&map, &mut seen);
        let toward: Vec<f32> = (0..seen.values().len()).map(|i| ((i * 37) % 11) as f32 - 5.0).collect();
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        let forward = dot(seen.values(), &toward);
        seen.values_mut().copy_from_slice(&toward);
        let back = dot(map.as_slice(), &inputs.judge_adjoint(&seen, 12, 12));
        assert!((forward - back).abs() < 1e-3 * forward.abs().max(1.0), "{forward} {back}");
    }
}

#[test]
fn the_eight_symmetries_differ() {
    let map = Grid::from_fn(3, 3, |c| (3 * c.row + c.col) as f32);
    let all: Vec<Grid<f32>> = (0..8).map(|turn| turned(&map, turn)).collect();
    assert_eq!(all[0], map);
    for (i, a) in all.iter().enumerate() {
        assert!(all[i + 1..].iter().all(|b| a != b));
    }
    let wide = Grid::from_fn(2, 5, |c| (5 * c.row + c.col) as f32);
    assert!((0..4).all(|turn| turned(&wide, turn).shape() == (2, 5)));
    assert_eq!(turned(&wide, 4).shape(), (5, 2));
}

/// A training that is stopped at any step and resumed ends with the same weights.
#[test]
fn a_resumed_training_ends_with_the_same_weights() {
    let folder = tempfile::tempdir().unwrap();
    let checkpoints = |resume| Checkpoints {
        path: folder.path().join("kept"),
        interval: std::time::Duration::ZERO,
        resume,
    };
    for base in [quick(), DetailConfig { coarsest: 16, fine_width: 32, ..DetailConfig::paper() }] {
        let config = DetailConfig { steps: 3, ..base };
        let whole = train(&ground(24), &[ground(24)], &config, Seed(1), |_| {}).unwrap();
        // Stopped by a panic in the middle of the second scale.
        let stopped = std::panic::catch_unwind(|| {
            let mut progress = |report: &Progress<'_>| assert!(report.step < 5, "stop");
            let control = Control { checkpoints: Some(checkpoints(false)), ..Control::new(&mut progress) };
            super::train(&ground(24), &[ground(24)], &config, Seed(1), control).map(|_| ())
        });
        assert!(stopped.is_err());
        let mut first = None;
        let mut progress = |report: &Progress<'_>| {
            first.get_or_insert(report.step);
        };
        let control = Control { checkpoints: Some(checkpoints(true)), ..Control::new(&mut progress) };
        let resumed = super::train(&ground(24), &[ground(24)], &config, Seed(1), control).unwrap();
        assert_eq!(first, Some(5));
        assert!(resumed.parts().1 == whole.parts().1);
        let mut quiet = |_: &Progress<'_>| {};
        let control = Control { checkpoints: Some(checkpoints(true)), ..Control::new(&mut quiet) };
        let other = super::train(&ground(24), &[], &config, Seed(1), control).unwrap_err().to_string();
        assert!(other.contains("another one"), "{other}");
        std::fs::remove_file(folder.path().join("kept")).unwrap();
    }
}

#[test]
fn lines_stay_exact_and_masks_fade() {
    let map = ground(50);
    let mut lines = crate::sketch::LineMap::empty(50, 50);
    for i in 5..45 {
        let cell = Cell::new(i, 20 + i / 5);
        lines.set(cell, crate::sketch::StrokeKind::Ridge, map[cell] + 0.01);
    }
    for how in [
        DetailUse::default(),
        DetailUse { keep: 0.0, likely: 1.0, calibrated: false, ..DetailUse::default() },
    ] {
        let out = model().add(&map, Some(&lines), None, &how, Seed(1), &Stop::new()).unwrap();
        for (cell, height) in lines.heights().cells() {
            if lines.kinds()[cell].is_some() {
                assert_eq!(out[cell], *height);
            }
        }
    }
    let wrong = crate::sketch::LineMap::empty(9, 9);
    assert!(
        model().add(&map, Some(&wrong), None, &DetailUse::default(), Seed(1), &Stop::new()).is_ok(),
        "no line, no shape"
    );
}
