//! Trees on small ground.

use super::bounds::{Bounds, Hierarchy};
use super::noise::noise;
use super::*;
use crate::grid::{Cell, Grid, Window};
use crate::metrics::psnr;
use crate::seed::Seed;
use rand::RngExt;

fn ground(rows: usize, cols: usize) -> Dem {
    let heights = Grid::from_fn(rows, cols, |c| {
        let (y, x) = (c.row as f32 * 0.12, c.col as f32 * 0.09);
        500.0 + 60.0 * (0.5 * y).sin() + 45.0 * (0.4 * x + y).cos() - 30.0 * (1.3 * x - y).sin().abs()
    });
    Dem::new(heights, CellSize::square(25.0).unwrap()).unwrap()
}

fn config(source: AtomSource, atoms: usize, sparsity: usize) -> FitConfig {
    FitConfig { atoms, sparsity, radius: 5.0, step: 6, source, rounds: 6 }
}

fn fitted(dem: &Dem, config: &FitConfig) -> Tree {
    Tree::of(fit(dem, config, Seed(1), &Stop::new(), &mut |_, _| ()).unwrap())
}

fn score(tree: &Tree, dem: &Dem) -> f64 {
    let (low, high) = dem.range();
    let drawn = tree.render(dem.cell_size().mean(), None, &Stop::new()).unwrap();
    assert_eq!(drawn.valid(), dem.valid());
    psnr(drawn.heights(), dem.heights(), dem.valid(), f64::from(high - low)).unwrap()
}

/// A tree over 1000 x 800 m.
fn tree(root: &str) -> Result<Tree> {
    let text = format!("extent = [1000.0, 800.0]\ncell = 10.0\n{root}");
    let text: Text = toml::from_str(&text).map_err(|e| Error::value("tree", e, ""))?;
    Tree { text, fields: BTreeMap::new() }.checked()
}

#[test]
fn more_atoms_are_nearer_and_files_keep_them() {
    let dem = ground(96, 120);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.toml");
    let mut scores = Vec::new();
    for sparsity in [1, 2, 4] {
        let tree = fitted(&dem, &config(AtomSource::Learned, 24, sparsity));
        scores.push(score(&tree, &dem));
        let bytes = tree.write(&path, 0.01).unwrap();
        let again = Tree::read(&path).unwrap();
        assert!((score(&again, &dem) - scores[scores.len() - 1]).abs() < 0.05);
        assert!(bytes < 4 * dem.heights().len(), "{bytes}");
        let side = 10 * 10;
        let n = tree.fields()["terrain"].means.len();
        assert_eq!(tree.fields()["terrain"].values(), side * 24 + n * (2 * sparsity + 2) + 1);
    }
    assert!(scores[0] > 20.0 && scores.windows(2).all(|w| w[1] > w[0] + 1.0), "{scores:?}");
}

/// 4.3: as many atoms as primitives, one each. Bicubic taps at rims are all that is between.
#[test]
fn a_tree_of_all_patches_is_the_terrain() {
    let dem = ground(40, 52);
    let n = crate::sparse::Disc::new(5.0, 6).unwrap().centres(dem.shape());
    let tree = fitted(&dem, &config(AtomSource::Patches, n.0 * n.1, 1));
    assert!(score(&tree, &dem) > 90.0, "{}", score(&tree, &dem));
}

#[test]
fn functions_become_terrain_and_stay_functions() {
    let dem = ground(60, 60);
    let folder = tempfile::tempdir().unwrap();
    for kind in [NoiseKind::Perlin, NoiseKind::Ridged, NoiseKind::RidgedMultifractal] {
        let few = fitted(&dem, &config(AtomSource::Noise(kind), 10, 1));
        let tree = fitted(&dem, &config(AtomSource::Noise(kind), 0, 1));
        let (less, all) = (score(&few, &dem), score(&tree, &dem));
        assert_eq!(few.fields()["terrain"].functions.len(), 10);
        assert!(all > 18.0 && all > less, "{kind:?}: {less} {all}");
        let path = folder.path().join("f.toml");
        tree.write(&path, 1e-4).unwrap();
        let again = Tree::read(&path).unwrap();
        assert_eq!(again.fields()["terrain"].functions, tree.fields()["terrain"].functions);
        assert!((score(&again, &dem) - all).abs() < 0.01);
    }
}

#[test]
fn voids_stay_voids() {
    let dem = ground(48, 48);
    let valid = Grid::from_fn(48, 48, |c| !(10..20).contains(&c.row) || c.col > 9);
    let holed = Dem::with_voids(dem.heights().clone(), valid.clone(), dem.cell_size()).unwrap();
    let tree = fitted(&holed, &config(AtomSource::Learned, 16, 2));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.toml");
    tree.write(&path, 0.1).unwrap();
    let drawn = Tree::read(&path).unwrap().render(25.0, None, &Stop::new()).unwrap();
    assert_eq!(drawn.valid(), &valid);
}

#[test]
fn operators_do_what_they_say() {
    let disc = "kind = \"disc\"\ncentre = [500.0, 400.0]\nradius = 100.0\nheight = ";
    let with = |operator: &str, height: &str, weight: &str| {
        let text = format!(
            "[root]\nkind = \"{operator}\"\nweight = {weight}\n[root.terrain]\nkind = \"plane\"\nheight = 50.0\nslope = [0.1, 0.0]\n[root.by]\n{disc}{height}"
        );
        let tree = tree(&text).unwrap();
        [[500.0, 400.0], [550.0, 400.0], [700.0, 400.0]].map(|point| tree.height(point, 1.0).unwrap())
    };
    // Half a radius out alpha is (3/4)^3; beyond the rim nothing happens. The plane is at 100, 105 and 120.
    let alpha = 0.421_875;
    let near = |found: [f64; 3], want: [f64; 3]| {
        assert!(found.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} {want:?}");
    };
    near(with("replace", "40.0", "1.0"), [40.0, 105.0 - alpha * 65.0, 120.0]);
    near(with("add", "40.0", "0.5"), [120.0, 105.0 + 0.5 * alpha * 40.0, 120.0]);
    near(with("carve", "40.0", "1.0"), [40.0, 105.0 - alpha * 65.0, 120.0]);
    near(with("carve", "140.0", "1.0"), [100.0, 105.0, 120.0]);
    let blend = format!("[root]\nkind = \"blend\"\n[[root.of]]\n{disc}10.0\n[[root.of]]\n{disc}30.0");
    let blend = tree(&blend).unwrap();
    assert!((blend.height([550.0, 400.0], 1.0).unwrap() - 20.0).abs() < 1e-9);
    assert_eq!(blend.height([650.0, 400.0], 1.0), None);
    let drawn = blend.render(10.0, None, &Stop::new()).unwrap();
    assert_eq!(drawn.shape(), (80, 100));
    assert!(!drawn.valid()[Cell::new(0, 0)] && drawn.valid()[Cell::new(40, 50)]);
}

#[test]
fn rivers_follow_their_lines() {
    let river = "[root]\nkind = \"curve\"\npoints = [[100.0, 100.0, 50.0], [500.0, 100.0, 30.0], [500.0, 700.0, 20.0]]\nsection = [[0.0, -4.0], [20.0, 0.0]]\nreach = 60.0";
    let tree = tree(river).unwrap();
    let at = |x, y| tree.height([x, y], 1.0);
    assert!((at(300.0, 100.0).unwrap() - 36.0).abs() < 1e-9);
    assert!((at(300.0, 110.0).unwrap() - 38.0).abs() < 1e-9);
    assert!((at(500.0, 400.0).unwrap() - 21.0).abs() < 1e-9);
    assert!((at(540.0, 700.0).unwrap() - 20.0).abs() < 1e-9);
    assert_eq!(at(300.0, 161.0), None);
}

#[test]
fn the_hierarchy_finds_what_all_boxes_have() {
    let mut stream = Seed(3).stream("boxes");
    let mut draw = || -> [f64; 2] { [stream.random::<f64>() * 100.0, stream.random::<f64>() * 100.0] };
    let boxes: Vec<Bounds> = (0..200).map(|_| Bounds::around([draw()], 4.0)).collect();
    let hierarchy = Hierarchy::new(boxes.iter().copied());
    let mut hits = 0;
    for _ in 0..300 {
        let window = Bounds::around([draw()], 1.0);
        let mut found = Vec::new();
        hierarchy.meeting(&window, &mut |i| found.push(i));
        found.sort_unstable();
        let all: Vec<usize> = (0..boxes.len()).filter(|i| boxes[*i].meets(&window)).collect();
        assert_eq!(found, all);
        hits += all.len();
    }
    assert!(hits > 100, "{hits}");
}

/// Coarse rasters have no forms below their cells, and the means of fine ones.
#[test]
fn detail_follows_the_cells() {
    let noise = tree("[root]\nkind = \"noise\"\nnoise = \"ridged\"\nwavelength = 200.0\namplitude = 10.0\noctaves = 8\nseed = 4").unwrap();
    let draw = |cell: f64| noise.render(cell, None, &Stop::new()).unwrap();
    let (fine, coarse) = (draw(2.0), draw(40.0));
    let means = crate::grid::pyramid::shrunk(fine.heights(), 20);
    let point = |c: Cell| [(c.col as f64 + 0.5) * 40.0, (c.row as f64 + 0.5) * 40.0];
    let points = Grid::from_fn(20, 25, |c| noise.height(point(c), 1e-3).unwrap() as f32);
    let off = |map: &Grid<f32>| -> f32 {
        means.as_slice().iter().zip(map.as_slice()).map(|(a, b)| (a - b).powi(2)).sum()
    };
    let (limited, sampled) = (off(coarse.heights()), off(&points));
    assert!(limited < 0.9 * sampled, "{limited} {sampled}");
    let dem = ground(64, 64);
    let field = fitted(&dem, &config(AtomSource::Learned, 16, 2));
    let whole = field.render(25.0, None, &Stop::new()).unwrap();
    let part = field.render(25.0, Some([500.0, 250.0, 250.0, 500.0]), &Stop::new()).unwrap();
    assert_eq!(
        part.heights(),
        &whole.heights().crop(Window::new(Cell::new(10, 20), 20, 10)).unwrap(),
        "windows are parts"
    );
    let far = field.render(400.0, None, &Stop::new()).unwrap();
    assert_eq!(far.shape(), (4, 4));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| field.render(10.0, None, &Stop::new()).unwrap())
    };
    assert!(run(1).heights() == run(3).heights());
}

#[test]
fn noise_is_bounded_and_not_the_same_twice() {
    for kind in [NoiseKind::Perlin, NoiseKind::Ridged, NoiseKind::RidgedMultifractal] {
        let values: Vec<f64> = (0..4000)
            .map(|i| noise(kind, 1, [f64::from(i) * 0.137 - 99.0, f64::from(i % 83) * 0.311], 8, 0.0))
            .collect();
        assert!(values.iter().all(|v| (-2.5..=2.5).contains(v)));
        let mean = values.iter().sum::<f64>() / 4000.0;
        let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 4000.0).sqrt();
        assert!(deviation > 0.1, "{kind:?} {deviation}");
        assert!(noise(kind, 1, [0.3, 0.4], 8, 0.0) != noise(kind, 2, [0.3, 0.4], 8, 0.0));
    }
}

#[test]
fn bad_trees_are_named() {
    let refused = |text: &str| tree(text).unwrap_err().to_string();
    assert!(refused("[root]\nkind = \"sparse\"\nfield = \"gone\"").contains("root.field is gone"));
    assert!(
        refused("[root]\nkind = \"disc\"\ncentre = [0.0, 0.0]\nradius = -1.0\nheight = 1.0")
            .contains("root.radius is -1")
    );
    assert!(refused("[root]\nkind = \"magic\"").contains("magic"));
    assert!(refused("[root]\nkind = \"plane\"\nheight = 1.0\nhieght = 2.0").contains("hieght"));
    let carve = "[root]\nkind = \"carve\"\n[root.terrain]\nkind = \"plane\"\nheight = 1.0\n[root.by]\nkind = \"curve\"\npoints = [[0.0, 0.0, 0.0]]\nsection = [[0.0, 0.0]]\nreach = 9.0";
    assert!(refused(carve).contains("root.by.points is 1"), "{}", refused(carve));
    let plane = tree("[root]\nkind = \"plane\"\nheight = 1.0").unwrap();
    assert!(plane.render(1e-9, None, &Stop::new()).unwrap_err().to_string().contains("window"));
    let stop = Stop::new();
    stop.raise();
    assert!(matches!(plane.render(10.0, None, &stop), Err(Error::Stopped)));
    // Numbers that were cut off.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.toml");
    fitted(&ground(40, 40), &config(AtomSource::Learned, 8, 1)).write(&path, 0.1).unwrap();
    let text = std::fs::read_to_string(&path).unwrap().replace("terrain", "other");
    std::fs::write(&path, text).unwrap();
    assert!(Tree::read(&path).unwrap_err().to_string().contains("root.field is other"));
    std::fs::remove_file(numbers(&path)).unwrap();
    assert!(Tree::read(&path).unwrap_err().to_string().contains("t.safetensors"));
}
