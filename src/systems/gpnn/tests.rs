//! Detail from patches on small ground.

use super::clusters::Clusters;
use super::patches::turned;
use super::patches::{Layers, SIDE, Units, Waves, as_keys};
use super::search::{Table, least};
use super::*;
use crate::control::Stop;
use crate::grid::Mask;
use crate::interpolation::NaturalNeighbours;
use rand::RngExt;
use std::sync::OnceLock;

/// Two slow waves and a fast one.
fn height(row: f32, col: f32) -> f32 {
    let (y, x) = (row * 0.35, col * 0.28);
    0.5 + 0.2 * (0.5 * y).sin() + 0.15 * (0.4 * x + y).cos() + 0.04 * (4.3 * x).sin() * (3.9 * y).cos()
}

fn ground(side: usize) -> Grid<f32> {
    Grid::from_fn(side, side, |c| height(c.row as f32, c.col as f32))
}

/// Lines across the ground, six cells apart, with its heights.
fn lines(map: &Grid<f32>) -> LineMap {
    let mut lines = LineMap::empty(map.rows(), map.cols());
    for (cell, z) in map.cells().filter(|(cell, _)| cell.row % 6 == 2) {
        let kind = if cell.row % 12 == 2 { StrokeKind::Ridge } else { StrokeKind::Valley };
        lines.set(cell, kind, *z);
    }
    lines
}

fn surface(lines: &LineMap) -> Grid<f32> {
    let mask = lines.mask();
    let on_lines = lines.heights().as_slice().iter().zip(mask.as_slice());
    let values: Vec<f64> = on_lines.filter(|(_, line)| **line).map(|(z, _)| f64::from(*z)).collect();
    NaturalNeighbours::new(&mask).unwrap().interpolate(&values).map(|z| *z as f32)
}

fn model() -> &'static PatchDetail {
    static MODEL: OnceLock<PatchDetail> = OnceLock::new();
    MODEL.get_or_init(|| {
        let truth = ground(40);
        let lines = lines(&truth);
        PatchDetail::new(truth, surface(&lines), &lines).unwrap()
    })
}

fn still() -> DetailUse {
    DetailUse { noise: 0.0, ..DetailUse::default() }
}

fn miss(a: &Grid<f32>, b: &Grid<f32>) -> f64 {
    a.as_slice().iter().zip(b.as_slice()).map(|(a, b)| f64::from(a - b).powi(2)).sum()
}

#[test]
fn the_search_is_exact() {
    let mut stream = Seed(3).stream("table");
    let mut table = |rows: usize, depth: usize| Table {
        depth,
        values: (0..rows * depth).map(|_| stream.random::<f32>() - 0.5).collect(),
    };
    for (queries, keys, depth) in [(1, 1, 3), (130, 77, 5), (19, 1200, 45)] {
        let (queries, keys) = (table(queries, depth), table(keys, depth));
        for (q, (cost, key)) in queries.values.chunks(depth).zip(least(&queries, &keys, &Stop::new())) {
            let product = |k: &[f32]| q.iter().zip(k).map(|(a, b)| a * b).sum::<f32>();
            let all: Vec<f32> = keys.values.chunks(depth).map(product).collect();
            assert!((all[key as usize] - cost).abs() < 1e-4);
            assert!(all.iter().all(|c| cost <= c + 1e-4));
        }
    }
    let same = Table { depth: 2, values: [1.0, 2.0].repeat(70) };
    assert!(least(&same, &same, &Stop::new()).iter().all(|(_, key)| *key == 0), "the first of equal keys");
}

/// Rows of a search: random numbers that end in their squared norm and 1.
fn rows(count: usize, depth: usize, seed: Seed) -> Table {
    let mut stream = seed.stream("rows");
    let row = |_| {
        let values: Vec<f32> = (0..depth).map(|_| stream.random::<f32>() - 0.5).collect();
        let square = values.iter().map(|v| v * v).sum();
        [values, vec![square, 1.0]].concat()
    };
    Table { depth: depth + 2, values: (0..count).flat_map(row).collect() }
}

/// 496 to 498 of 500 over eight seeds, the same at every vector level.
#[test]
fn clusters_find_what_all_keys_have() {
    for (count, depth) in [(1, 4), (200, 4), (3000, 6)] {
        let (keys, queries) = (rows(count, depth, Seed(1)), rows(500, depth, Seed(2)));
        let weights: Vec<f32> = (0..count).map(|i| 1.0 + (i % 3) as f32 * 0.2).collect();
        let exact = least(&queries, &as_keys(&keys, &weights), &Stop::new());
        let found = Clusters::new(&keys, &weights, &Stop::new()).least(&queries, &Stop::new());
        let same = exact.iter().zip(&found).filter(|(exact, found)| exact.1 == found.1).count();
        // A query near the border of its clusters may miss; what it gets is a key's true distance all the same.
        assert!(same as f64 >= if count < 1000 { 500.0 } else { 450.0 }, "{count} keys: {same} of 500");
        for (q, (cost, key)) in queries.values.chunks(depth + 2).zip(&found) {
            let row = &keys.values[*key as usize * (depth + 2)..][..depth];
            let square: f32 = row.iter().zip(q).map(|(a, b)| (a - b).powi(2)).sum();
            assert!((weights[*key as usize] * square - cost).abs() < 1e-4);
        }
        assert!(exact.iter().zip(&found).all(|(exact, found)| exact.0 <= found.0 + 1e-5));
    }
}

/// Slopes .76 to .89 of the exemplar's over eight seeds, heights -.04 to .98; the same at every vector level.
#[test]
fn terrain_from_noise_has_the_forms_of_the_exemplar() {
    let model = model();
    let [one, same, other] =
        [1, 1, 2].map(|seed| model.sample(&SampleUse::new(40, 57), Seed(seed), &Stop::new()).unwrap());
    assert_eq!((one.shape(), &one), ((40, 57), &same));
    assert_ne!(one, other);
    let slope = |map: &Grid<f32>| mean_square_slope(map).sqrt();
    for map in [&one, &other] {
        let ratio = slope(map) / slope(&model.truth);
        assert!((0.6..1.4).contains(&ratio), "{ratio}");
        assert!(map.as_slice().iter().all(|z| (-0.5..1.5).contains(z)));
    }
    assert!(model.sample(&SampleUse::new(15, 40), Seed(1), &Stop::new()).is_err());
    assert!(
        model
            .sample(&SampleUse::new(6000, 6000), Seed(1), &Stop::new())
            .unwrap_err()
            .to_string()
            .contains("at most")
    );
}

/// The less variety, the nearer to the exemplar; without any, the coarsest patches are its own. Over eight seeds .035 to .048 of
/// half the variety's error, and that .27 to .40 of the whole one's; the same at every vector level.
#[test]
fn variety_says_how_much_of_the_layout_is_new() {
    let model = model();
    let (rows, cols) = model.truth.shape();
    let error = |variety: f32| {
        let map = model.sample(&SampleUse { rows, cols, variety }, Seed(3), &Stop::new()).unwrap();
        let pairs = map.as_slice().iter().zip(model.truth.as_slice());
        pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
    };
    let [none, some, all] = [0.0, 0.5, 1.0].map(error);
    assert!(none < 0.5 * some && some < 0.8 * all, "{none} {some} {all}");
}

/// Distances of the rows are those of smooth patches in heights, in the units that are given.
#[test]
fn rows_have_the_distances_of_their_patches() {
    let smooth = Grid::from_fn(20, 22, |c| 1000.0 + height(0.2 * c.row as f32, 0.3 * c.col as f32));
    let layers = Layers { ground: smooth.clone(), residual: None, marks: None };
    let waves = Waves::new();
    let units = Units { slope: 0.5, residual: 1.0, contrast: 1e6 };
    let places = [(0, 0), (5, 9), (13, 15)];
    let (table, contrasts) = layers.table(&waves, units, &places);
    let found = least(&table, &as_keys(&table, &[1.0; 3]), &Stop::new());
    assert!(found.iter().enumerate().all(|(i, (_, key))| *key == i as u32), "each is its own nearest");
    let patch = |(row, col): (usize, usize)| {
        let cells = (0..SIDE * SIDE).map(|i| smooth[Cell::new(row + i / SIDE, col + i % SIDE)]);
        let cells: Vec<f32> = cells.collect();
        let mean = cells.iter().sum::<f32>() / cells.len() as f32;
        cells.into_iter().map(|z| z - mean).collect::<Vec<_>>()
    };
    let want: f32 = patch(places[0]).iter().zip(patch(places[1])).map(|(a, b)| (a - b).powi(2)).sum();
    let row = |i: usize| &table.values[i * table.depth..(i + 1) * table.depth - 2];
    // Where contrast hardly counts, all rows are divided by the same number.
    let scale = 0.3f32.recip();
    let got: f32 = row(0).iter().zip(row(1)).map(|(a, b)| ((a - b) / scale).powi(2)).sum();
    assert!((got / want - 1.0).abs() < 0.02, "{got} {want}");
    assert!(contrasts.iter().all(|c| (c / 3e5 - 1.0).abs() < 1e-3));
}

#[test]
fn the_eight_symmetries_are_all_there() {
    let map = Grid::from_fn(3, 4, |c| c.row * 10 + c.col).map(|v| *v as f32);
    let all: Vec<Grid<f32>> = (0..8).map(|turn| turned(&map, turn)).collect();
    assert_eq!(all[0], map);
    for (i, a) in all.iter().enumerate() {
        assert!(all[..i].iter().all(|b| b != a));
        let mut cells = a.clone().into_vec();
        cells.sort_by(f32::total_cmp);
        assert!(cells.windows(2).all(|w| w[0] < w[1]));
    }
}

/// .172 of what is missing remains, at every vector level; without noise the seed does not matter.
#[test]
fn the_exemplar_gets_its_own_detail_back() {
    let model = model();
    let lines = lines(&model.truth);
    let rebuilt = model.add(&model.twin, Some(&lines), None, &still(), Seed(1), &Stop::new()).unwrap();
    let (after, before) = (miss(&rebuilt, &model.truth), miss(&model.twin, &model.truth));
    assert!(after < 0.35 * before, "{after} {before}");
    let bare = DetailUse { strength: 0.0, ..still() };
    assert_eq!(model.add(&model.twin, Some(&lines), None, &bare, Seed(1), &Stop::new()).unwrap(), model.twin);
}

#[test]
fn lines_are_exact_and_a_mask_keeps_what_it_hides() {
    let model = model();
    let map = Grid::from_fn(36, 44, |c| height(c.row as f32 + 100.0, c.col as f32 + 60.0));
    let lines = lines(&map);
    let coarse = surface(&lines);
    let mask = Mask::from_fn(36, 44, |c| c.col >= 20);
    let detailed =
        model.add(&coarse, Some(&lines), Some(&mask), &DetailUse::default(), Seed(1), &Stop::new()).unwrap();
    let mut changed = 0;
    for (cell, z) in detailed.cells() {
        if lines.kinds()[cell].is_some() && mask[cell] {
            assert_eq!(*z, lines.heights()[cell]);
        }
        if !mask[cell] {
            assert_eq!(*z, coarse[cell]);
        }
        changed += usize::from(*z != coarse[cell]);
    }
    assert!(changed > 300, "{changed}");
}

#[test]
fn same_seed_same_bytes_on_any_number_of_threads() {
    let map = ground(33);
    for lines in [None, Some(lines(&map))] {
        let coarse = lines.as_ref().map_or_else(|| map.clone(), surface);
        let run = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let add = || {
                model().add(&coarse, lines.as_ref(), None, &DetailUse::default(), Seed(seed), &Stop::new())
            };
            pool.install(|| add().unwrap())
        };
        let one = run(1, 1);
        assert!(one == run(3, 1));
        assert!(one != run(1, 2), "every seed draws others");
    }
}

#[test]
fn elevation_and_unit_do_not_matter() {
    let map = Grid::from_fn(33, 40, |c| (c.row as f32 * 0.2).sin() + (c.col as f32 * 0.15).cos());
    let one = model().add(&map, None, None, &still(), Seed(1), &Stop::new()).unwrap();
    assert!(miss(&one, &map) > 1e-3);
    let moved = map.map(|z| 64.0 * z + 1024.0);
    let other = model().add(&moved, None, None, &still(), Seed(1), &Stop::new()).unwrap();
    for (a, b) in one.as_slice().iter().zip(other.as_slice()) {
        assert!((64.0 * a + 1024.0 - b).abs() < 0.5, "{a} {b}");
    }
}

/// Gains 2.3 to 2.9 over eight seeds, the same at every vector level.
#[test]
fn calibration_is_on_what_the_exemplar_does_not_know() {
    let mut model = model().clone();
    let lines = lines(&model.truth);
    let twin = model.twin.clone();
    model.calibrate(&twin, &lines, Seed(1), &Stop::new()).unwrap();
    let gain = model.record.gain;
    assert!(gain > 1.2 && gain < 4.0, "{gain}");
    assert_eq!(model.gain(), gain);
    let (info, tensors) = model.parts();
    let back = PatchDetail::from_parts(&info, |name| {
        let found = tensors.iter().find(|(n, _)| n == name);
        Ok(found.unwrap().1.clone())
    });
    assert_eq!(back.unwrap(), model);
}

#[test]
fn bad_input_is_named() {
    let (truth, none) = (ground(40), LineMap::empty(40, 40));
    let message = |r: Result<PatchDetail>| r.unwrap_err().to_string();
    assert!(message(PatchDetail::new(truth.clone(), truth.clone(), &none)).contains("line"));
    let (small, small_lines) = (ground(20), lines(&ground(20)));
    assert!(message(PatchDetail::new(small.clone(), small, &small_lines)).contains("20x20"));
    let few = lines(&truth);
    assert!(message(PatchDetail::new(truth.clone(), ground(41), &few)).contains("41"));
    let flat = Grid::filled(40, 40, 0.5);
    assert!(message(PatchDetail::new(flat.clone(), flat.clone(), &few)).contains("level"));
    let large = Grid::filled(6000, 6000, 0.0);
    let message = model().add(&large, None, None, &still(), Seed(1), &Stop::new()).unwrap_err().to_string();
    assert!(message.contains("36000000") && message.contains("at most"), "{message}");
    assert_eq!(model().add(&flat, None, None, &DetailUse::default(), Seed(1), &Stop::new()).unwrap(), flat);
    let tiny = Grid::from_fn(9, 9, |c| c.row as f32);
    assert_eq!(model().add(&tiny, None, None, &DetailUse::default(), Seed(1), &Stop::new()).unwrap(), tiny);
}
