//! Sums of atoms on small signals.

use super::learning::residuals;
use super::pursuit::pursue;
use super::*;
use crate::control::Stop;
use crate::grid::Grid;
use crate::seed::Seed;
use ndarray::{Array2, ArrayView1, ArrayView2, Axis};
use rand::RngExt;

fn random(rows: usize, cols: usize, name: &str) -> Array2<f32> {
    let mut stream = Seed(5).stream(name);
    Array2::from_shape_fn((rows, cols), |_| stream.random::<f32>() - 0.5)
}

/// Two slow waves and a fast one.
fn ground(rows: usize, cols: usize) -> Grid<f32> {
    Grid::from_fn(rows, cols, |c| {
        let (y, x) = (c.row as f32 * 0.35, c.col as f32 * 0.28);
        100.0 + 20.0 * (0.5 * y).sin() + 15.0 * (0.4 * x + y).cos() + 4.0 * (4.3 * x).sin() * (3.9 * y).cos()
    })
}

/// Signals of all discs over a map, with their means.
fn signals(map: &Grid<f32>, disc: Disc) -> (Array2<f32>, Vec<f32>) {
    let (inside, (rows, cols)) = (disc.inside(), disc.centres(map.shape()));
    let mut square = vec![0.0; disc.side() * disc.side()];
    let (mut all, mut means) = (Array2::zeros((rows * cols, inside.len())), Vec::new());
    for (i, mut signal) in all.axis_iter_mut(Axis(0)).enumerate() {
        disc.square(map, (i / cols, i % cols), &mut square);
        means.push(Disc::signal(&square, &inside, signal.as_slice_mut().unwrap()));
    }
    (all, means)
}

/// The pursuit as it is defined: products with the residual itself, least squares by normal equations and Gauss.
fn plainly(signal: ArrayView1<'_, f32>, atoms: &Array2<f32>, sparsity: usize) -> Vec<(usize, f64)> {
    let dot =
        |a: ArrayView1<'_, f32>, b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| f64::from(*a) * b).sum() };
    let whole: Vec<f64> = signal.iter().map(|v| f64::from(*v)).collect();
    let (mut left, mut chosen, mut weights) = (whole.clone(), Vec::new(), Vec::new());
    for _ in 0..sparsity {
        let products: Vec<f64> = atoms.rows().into_iter().map(|a| dot(a, &left).abs()).collect();
        let best = (0..products.len()).max_by(|a, b| products[*a].total_cmp(&products[*b])).unwrap();
        chosen.push(best);
        let n = chosen.len();
        let mut m: Vec<Vec<f64>> = chosen
            .iter()
            .map(|i| {
                let row = chosen.iter().map(|j| {
                    let other: Vec<f64> = atoms.row(*j).iter().map(|v| f64::from(*v)).collect();
                    dot(atoms.row(*i), &other)
                });
                row.chain([dot(atoms.row(*i), &whole)]).collect()
            })
            .collect();
        for i in 0..n {
            for j in 0..n {
                if i != j {
                    let factor = m[j][i] / m[i][i];
                    (i..=n).for_each(|k| m[j][k] -= factor * m[i][k]);
                }
            }
        }
        weights = (0..n).map(|i| m[i][n] / m[i][i]).collect();
        left.clone_from(&whole);
        for (atom, weight) in chosen.iter().zip(&weights) {
            left.iter_mut().zip(atoms.row(*atom)).for_each(|(l, a)| *l -= weight * f64::from(*a));
        }
    }
    chosen.into_iter().zip(weights).collect()
}

#[test]
fn the_batch_form_is_the_plain_one() {
    // The second dictionary is too large for a Gram matrix.
    for (atoms, depth) in [(60, 20), (4200, 12)] {
        let (dictionary, signals) =
            (Dictionary::new(random(atoms, depth, "atoms")).unwrap(), random(300, depth, "signals"));
        for sparsity in [1, 2, 5] {
            let codes = pursue(signals.view(), &dictionary, Limits::atoms(sparsity), &Stop::new()).unwrap();
            for (i, signal) in signals.rows().into_iter().enumerate() {
                let plain = plainly(signal, dictionary.atoms(), sparsity);
                let found: Vec<(usize, f32)> = codes.of(i).collect();
                assert_eq!(found.len(), sparsity);
                for ((atom, weight), (want, w)) in found.into_iter().zip(plain) {
                    assert!(
                        atom == want && (f64::from(weight) - w).abs() < 1e-5,
                        "{i}: {atom} {want} {weight} {w}"
                    );
                }
            }
        }
    }
}

/// scikit-learn's `orthogonal_mp` (`tests/oracle/sparse.py`).
#[test]
fn pursuit_agrees_with_scikit_learn() {
    let all: serde_json::Value =
        serde_json::from_str(include_str!("../../tests/oracle/sparse.json")).unwrap();
    let matrix = |name: &str| {
        let rows: Vec<Vec<f32>> = serde_json::from_value(all[name].clone()).unwrap();
        let shape = (rows.len(), rows[0].len());
        Array2::from_shape_vec(shape, rows.concat()).unwrap()
    };
    let (dictionary, signals) = (Dictionary::new(matrix("atoms")).unwrap(), matrix("signals"));
    for sparsity in [1, 2, 4] {
        let codes = pursue(signals.view(), &dictionary, Limits::atoms(sparsity), &Stop::new()).unwrap();
        let want = matrix(&format!("weights {sparsity}"));
        for (i, want) in want.rows().into_iter().enumerate() {
            let mut found = vec![0.0; dictionary.len()];
            codes.of(i).for_each(|(atom, weight)| found[atom] = weight);
            assert!(found.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-5), "{sparsity}, {i}");
        }
    }
}

#[test]
fn a_pursuit_ends_at_its_error() {
    let (dictionary, signals) = (Dictionary::new(random(40, 9, "atoms")).unwrap(), random(200, 9, "signals"));
    let run = |limits| pursue(signals.view(), &dictionary, limits, &Stop::new()).unwrap();
    let codes = run(Limits { sparsity: 6, error: 0.2 });
    let left = residuals(signals.view(), &dictionary, &codes);
    let mut short = 0;
    for i in 0..signals.nrows() {
        let (length, used) = (dictionary::norm(left.row(i)), codes.of(i).count());
        assert!(length <= 0.2 + 1e-5 || used == 6, "{i}: {length} with {used}");
        short += usize::from(used < 6);
    }
    assert!(short > 150, "{short}");
    // One atom less would not have been enough.
    let fewer = run(Limits::atoms(codes.of(0).count() - 1));
    assert!(dictionary::norm(residuals(signals.view(), &dictionary, &fewer).row(0)) > 0.2);
}

#[test]
fn learning_lowers_the_error_in_every_round() {
    let (signals, _) = signals(&ground(90, 90), Disc::new(3.0, 2).unwrap());
    for (update, least) in [(Update::SingularVector, 0.85), (Update::Signal, 0.95)] {
        for sparsity in [1, 3] {
            let config = LearningConfig { atoms: 16, sparsity, rounds: 8, update };
            let mut heard = Vec::new();
            let mut hear = |_, error| heard.push(error);
            let learned = learn(signals.view(), config, Seed(1), None, &Stop::new(), &mut hear).unwrap();
            assert_eq!(heard, learned.errors);
            assert!(heard.len() > 2 && heard.windows(2).all(|w| w[1] <= w[0] * (1.0 + 1e-6)), "{heard:?}");
            assert!(heard[heard.len() - 1] < least * heard[0], "{update:?} {heard:?}");
            if let Some(chosen) = learned.chosen {
                for (atom, signal) in learned.dictionary.atoms().rows().into_iter().zip(chosen) {
                    let unit = signals.row(signal).mapv(|v| v / dictionary::norm(signals.row(signal)) as f32);
                    assert!((&atom - &unit).iter().all(|d| d.abs() < 1e-5), "atoms are patches");
                }
            }
        }
    }
}

/// 4.3: with the terrain's own patches as atoms, one atom each is enough.
#[test]
fn a_complete_dictionary_is_exact_with_one_atom() {
    let (map, disc) = (ground(31, 40), Disc::new(5.0, 6).unwrap());
    let (signals, means) = signals(&map, disc);
    let dictionary = Dictionary::new(signals.clone()).unwrap();
    let codes = pursue(signals.view(), &dictionary, Limits::atoms(1), &Stop::new()).unwrap();
    let (shares, inside, cols) = (disc.shares(1), disc.inside(), disc.centres(map.shape()).1);
    let mut sum = map.map(|_| 0.0f32);
    for (i, mean) in means.iter().enumerate() {
        let [(atom, weight)] = codes.of(i).collect::<Vec<_>>()[..] else { panic!("one atom each") };
        let corner = (disc.first(i / cols), disc.first(i % cols));
        for (value, place) in dictionary.atoms().row(atom).iter().zip(&inside) {
            let (row, col) =
                (corner.0 + (place / disc.side()) as isize, corner.1 + (place % disc.side()) as isize);
            if (0..31).contains(&row) && (0..40).contains(&col) {
                let cell = crate::grid::Cell::new(row as usize, col as usize);
                sum[cell] += shares[*place] * (mean + weight * value);
            }
        }
    }
    let worst = sum.as_slice().iter().zip(map.as_slice()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-4, "{worst} m of 80 m");
}

#[test]
fn discs_cover_all_ground_and_their_shares_are_one() {
    for (radius, step, fine) in [(5.0, 6, 1), (3.0, 3, 4), (2.5, 2, 2), (5.5, 2, 1)] {
        let disc = Disc::new(radius, step).unwrap();
        let (side, rows, cols) = (disc.side() * fine, 20, 17);
        let mut sum = Grid::filled(rows * fine, cols * fine, 0.0f32);
        let shares = disc.shares(fine);
        let (down, right) = disc.centres((rows, cols));
        for centre in 0..down * right {
            let corner = [disc.first(centre / right), disc.first(centre % right)].map(|c| c * fine as isize);
            for (i, share) in shares.iter().enumerate() {
                let (row, col) = (corner[0] + (i / side) as isize, corner[1] + (i % side) as isize);
                if (0..(rows * fine) as isize).contains(&row) && (0..(cols * fine) as isize).contains(&col) {
                    sum[crate::grid::Cell::new(row as usize, col as usize)] += share;
                }
            }
        }
        assert!(sum.as_slice().iter().all(|s| (s - 1.0).abs() < 1e-5), "{radius} {step}");
    }
    let refused = |radius, step| Disc::new(radius, step).unwrap_err().to_string();
    assert!(refused(3.0, 5).contains("step is 5") && refused(f64::NAN, 1).contains("radius is NaN"));
}

#[test]
fn beyond_the_frame_slopes_go_on() {
    let plane = Grid::from_fn(12, 9, |c| 3.0 * c.row as f32 - 2.0 * c.col as f32);
    let disc = Disc::new(3.0, 3).unwrap();
    let mut square = vec![0.0; 36];
    for centre in [(0, 0), (4, 3), (0, 2), (2, 1)] {
        disc.square(&plane, centre, &mut square);
        for (i, z) in square.iter().enumerate() {
            let (row, col) =
                (disc.first(centre.0) + (i / 6) as isize, disc.first(centre.1) + (i % 6) as isize);
            assert_eq!(*z, 3.0 * row as f32 - 2.0 * col as f32);
        }
    }
}

#[test]
fn learning_depends_on_no_thread() {
    let (signals, _) = signals(&ground(50, 50), Disc::new(3.0, 2).unwrap());
    for update in [Update::SingularVector, Update::Signal] {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let config = LearningConfig { atoms: 12, sparsity: 2, rounds: 3, update };
            pool.install(|| {
                learn(signals.view(), config, Seed(1), None, &Stop::new(), &mut |_, _| ()).unwrap()
            })
        };
        let (one, three) = (run(1), run(3));
        assert!(one.dictionary == three.dictionary && one.errors == three.errors);
    }
    let stop = Stop::new();
    stop.raise();
    let config = LearningConfig { atoms: 12, sparsity: 2, rounds: 3, update: Update::Signal };
    assert!(matches!(
        learn(signals.view(), config, Seed(1), None, &stop, &mut |_, _| ()),
        Err(crate::Error::Stopped)
    ));
    let none: ArrayView2<'_, f32> = signals.view();
    let many = LearningConfig { atoms: 100_000, ..config };
    assert!(
        learn(none, many, Seed(1), None, &Stop::new(), &mut |_, _| ())
            .unwrap_err()
            .to_string()
            .contains("100000")
    );
}
