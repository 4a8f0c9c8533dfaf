//! Sparse detail on small ground.

use super::*;
use crate::metrics::psnr;
use std::sync::OnceLock;

/// Waves of several sizes, the finest of which a shrunk map does not show.
fn height(row: f32, col: f32) -> f32 {
    let (y, x) = (row * 0.045, col * 0.038);
    let sharp = |t: f32| 1.0 - t.sin().abs();
    0.3 + 0.2 * sharp(y + 0.6 * x)
        + 0.15 * sharp(1.7 * x - y)
        + 0.05 * sharp(5.0 * (x + y))
        + 0.02 * (9.0 * x).sin()
}

fn ground(rows: usize, cols: usize, from: f32) -> Grid<f32> {
    Grid::from_fn(rows, cols, |c| height(c.row as f32 + from, c.col as f32 + 0.7 * from))
}

fn config() -> SparseConfig {
    SparseConfig { atoms: 48, rounds: 6, ..SparseConfig::default() }
}

fn learned(config: &SparseConfig) -> SparseDetail {
    let quiet = &mut |_: &Progress<'_>| ();
    SparseDetail::learned(ground(96, 112, 0.0), config, Seed(1), &mut Control::new(quiet)).unwrap()
}

fn model() -> &'static SparseDetail {
    static MODEL: OnceLock<SparseDetail> = OnceLock::new();
    MODEL.get_or_init(|| learned(&config()))
}

fn worst(a: &Grid<f32>, b: &Grid<f32>) -> f32 {
    a.as_slice().iter().zip(b.as_slice()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn amplified_and_shrunk_is_the_map() {
    let map = shrunk(&ground(160, 132, 300.0), 4);
    for factor in [2, 4, 8, 16] {
        let fine = model().enlarged(&map, factor, 1.0, &Stop::new()).unwrap();
        assert_eq!(fine.shape(), (40 * factor, 33 * factor));
        let off = worst(&shrunk(&fine, factor), &map);
        assert!(off < 2e-4, "{factor}: {off} of {}", map.as_slice().iter().fold(0.0f32, |a, b| a.max(*b)));
    }
    // As published, the map is not kept.
    let published = learned(&SparseConfig { consistent: false, ..config() });
    let fine = published.enlarged(&map, 4, 1.0, &Stop::new()).unwrap();
    assert!(worst(&shrunk(&fine, 4), &map) > 5e-3);
}

#[test]
fn unseen_ground_is_nearer_than_the_bicubic_map() {
    let truth = ground(160, 160, 300.0);
    let (map, valid) = (shrunk(&truth, 4), truth.map(|_| true));
    let score = |fine: &Grid<f32>| psnr(fine, &truth, &valid, 1.0).unwrap();
    let bicubic = score(&resample(&map, 160, 160));
    let ours = score(&model().enlarged(&map, 4, 0.7, &Stop::new()).unwrap());
    let published = learned(&SparseConfig { consistent: false, symmetries: false, ..config() });
    let theirs = score(&published.enlarged(&map, 4, 1.0, &Stop::new()).unwrap());
    assert!(ours > bicubic + 0.3 && theirs < ours - 1.0, "{bicubic} {ours} {theirs}");
}

/// The blend as it is defined, disc by disc.
#[test]
fn the_published_form_is_the_blend_of_4_1() {
    let published = learned(&SparseConfig { consistent: false, symmetries: false, atoms: 20, ..config() });
    let map = shrunk(&ground(72, 60, 300.0), 4);
    let made = published.enlarged(&map, 4, 1.0, &Stop::new()).unwrap();
    let disc = SparseDetail::disc(&published.config).unwrap();
    let (inside, side, (down, right)) = (disc.inside(), disc.side(), disc.centres(map.shape()));
    let mut atoms = Vec::new();
    for place in &published.places {
        let fine = square(&published.exemplar, *place, side * FACTOR).unwrap();
        let mut low = vec![0.0; inside.len()];
        let mean = Disc::signal(shrunk(&fine, FACTOR).as_slice(), &inside, &mut low);
        let length = low.iter().map(|v| v * v).sum::<f32>().sqrt();
        atoms.push((low.iter().map(|v| v / length).collect::<Vec<_>>(), fine.map(|z| (z - mean) / length)));
    }
    let falloff = disc.falloff(FACTOR);
    let (mut sum, mut weights) = (made.map(|_| 0.0f64), made.map(|_| 0.0f64));
    let (mut around, mut signal) = (vec![0.0; side * side], vec![0.0; inside.len()]);
    for centre in 0..down * right {
        let (row, col) = (centre / right, centre % right);
        disc.square(&map, (row, col), &mut around);
        let mean = Disc::signal(&around, &inside, &mut signal);
        let product = |low: &[f32]| low.iter().zip(&signal).map(|(a, b)| a * b).sum::<f32>();
        let best = atoms.iter().max_by(|a, b| product(&a.0).abs().total_cmp(&product(&b.0).abs())).unwrap();
        let weight = product(&best.0);
        for (cell, z) in best.1.cells() {
            let row = disc.first(row) * FACTOR as isize + cell.row as isize;
            let col = disc.first(col) * FACTOR as isize + cell.col as isize;
            if row >= 0 && col >= 0 && (row as usize) < made.rows() && (col as usize) < made.cols() {
                let (to, alpha) =
                    (Cell::new(row as usize, col as usize), f64::from(falloff[best.1.index_of(cell)]));
                sum[to] += alpha * f64::from(mean + weight * z);
                weights[to] += alpha;
            }
        }
    }
    for (cell, z) in made.cells() {
        let want = sum[cell] / weights[cell];
        assert!((f64::from(*z) - want).abs() < 1e-4, "{cell:?} {z} {want}");
    }
}

#[test]
fn elevation_unit_and_threads_do_not_matter() {
    let map = shrunk(&ground(96, 96, 300.0), 4);
    let run = |map: &Grid<f32>, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| model().enlarged(map, 8, 1.0, &Stop::new()).unwrap())
    };
    let one = run(&map, 1);
    assert!(one == run(&map, 3));
    let moved = run(&map.map(|z| 64.0 * z + 1024.0), 1);
    assert!(worst(&moved.map(|z| (z - 1024.0) / 64.0), &one) < 1e-3);
}

#[test]
fn the_gain_costs_no_likeness_on_unseen_halves() {
    let mut model = learned(&SparseConfig { atoms: 24, ..config() });
    let quiet = &mut |_: &Progress<'_>| ();
    model.calibrate(Seed(1), &mut Control::new(quiet)).unwrap();
    assert!(model.gain() > 0.2 && model.gain() <= 1.0, "{}", model.gain());
    let (info, mut arrays) = model.save().unwrap();
    assert_eq!(SparseDetail::load(info.clone(), &mut arrays.clone(), None).unwrap(), model);
    let mut outside = Arrays::default();
    outside.put_f32("exemplar", &[96, 112], &arrays.take_f32("exemplar").unwrap());
    outside.put_u32("places", &[1], &[96 * 112 - 1]);
    let refused = SparseDetail::load(info, &mut outside, None).unwrap_err().to_string();
    assert!(refused.contains("place of an atom"), "{refused}");
}

#[test]
fn detail_has_no_means_and_noise_becomes_terrain() {
    let map = ground(64, 80, 300.0);
    let how = DetailUse::default();
    let found = model().residual(&map, None, 4.0, &how, Seed(1), &Stop::new()).unwrap().unwrap();
    assert_eq!((found.added.shape(), found.smooth.shape()), (map.shape(), map.shape()));
    // Inside, where no cell is cut, what is added has no means.
    assert!(worst(&shrunk(&found.added, 4), &Grid::filled(16, 20, 0.0)) < 1e-3);
    assert!(mean_square_slope(&found.added) > 0.0);
    let level = Grid::filled(64, 64, 0.4);
    assert!(model().residual(&level, None, 4.0, &how, Seed(1), &Stop::new()).unwrap().is_none());
    let [one, same, other] =
        [1, 1, 2].map(|seed| model().sample(&SampleUse::new(70, 45), Seed(seed), &Stop::new()).unwrap());
    assert_eq!((one.shape(), &one), ((70, 45), &same));
    assert_ne!(one, other);
    let own = model()
        .sample(&SampleUse { variety: 0.0, ..SampleUse::new(96, 112) }, Seed(1), &Stop::new())
        .unwrap();
    let (mean, _) = moments(&own);
    assert!((mean - moments(&model().exemplar).0).abs() < 0.05);
}

#[test]
fn bad_input_is_named() {
    let refused = |config: SparseConfig| Checked::new(config).unwrap_err().to_string();
    assert!(refused(SparseConfig { step: 5, ..config() }).contains("sparse.step is 5"));
    assert!(refused(SparseConfig { radius: 0.5, ..config() }).contains("sparse.radius is 0.5"));
    assert!(refused(SparseConfig { sparsity: 0, ..config() }).contains("sparse.sparsity is 0"));
    let quiet = &mut |_: &Progress<'_>| ();
    let mut control = Control::new(quiet);
    let mut learn = |map, config: &SparseConfig| {
        SparseDetail::learned(map, config, Seed(1), &mut control).unwrap_err().to_string()
    };
    assert!(learn(ground(20, 80, 0.0), &config()).contains("20x80"));
    assert!(learn(Grid::filled(60, 60, 1.0), &config()).contains("sparse.atoms is 48"));
    assert!(learn(ground(200, 200, 0.0), &SparseConfig { atoms: 0, ..config() }).contains("complete"));
    let raised = Stop::new();
    raised.raise();
    assert!(matches!(model().enlarged(&ground(20, 20, 0.0), 4, 1.0, &raised), Err(Error::Stopped)));
    let refused =
        model().amplified(&ground(20, 20, 0.0), 3, &DetailUse::default(), &Stop::new()).unwrap_err();
    assert!(refused.to_string().contains("factor is 3"));
}
