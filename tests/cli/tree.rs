//! Sparse detail and construction trees from the command line.

use super::{done, fails, temporary, write_hill};
use monadnock::dem::Dem;
use monadnock::dem::io::{ReadOptions, read};
use std::path::Path;

fn terrain(path: &Path) -> Dem {
    read(path, &ReadOptions::default()).unwrap()
}

#[test]
fn sparse_detail_amplifies_and_shrinks_back() {
    let folder = temporary();
    let at = folder.path();
    let train = ["train", "sierra", "--crop", "192,192,96", "-o", "s.safetensors", "--systems", "landscape"];
    let sparse = ["--detail-model", "sparse", "--set", "sparse.atoms=32", "--set", "sparse.rounds=3"];
    let said = done(at, &[&train[..], &sparse].concat()).out;
    assert!(said.contains("detail: 32 atoms"), "{said}");
    assert!(done(at, &["info", "s.safetensors"]).out.contains("32 atoms"));
    write_hill(&at.join("hill.asc"), 20);
    let amplify = ["amplify", "s.safetensors", "hill.asc", "--factor"];
    for factor in [4, 16, 32] {
        let name = factor.to_string();
        done(at, &[&amplify[..], &[&name, "-o", "fine.tif"]].concat());
        let (coarse, fine) = (terrain(&at.join("hill.asc")), terrain(&at.join("fine.tif")));
        assert_eq!(fine.shape(), (20 * factor, 20 * factor));
        for (cell, z) in coarse.heights().cells() {
            let part = fine.crop(monadnock::grid::Window::square(
                monadnock::grid::Cell::new(cell.row * factor, cell.col * factor),
                factor,
            ));
            let part = part.unwrap();
            let mean = part.heights().as_slice().iter().map(|z| f64::from(*z)).sum::<f64>()
                / (factor * factor) as f64;
            // Of 250 m.
            assert!((mean - f64::from(*z)).abs() < 0.1, "{cell:?}: {mean} {z}");
        }
    }
    fails(at, &[&amplify[..], &["3", "-o", "x.tif"]].concat(), 2, &["2, 4, 8"]);
    done(at, &["sample", "s.safetensors", "--size", "40x60", "-o", "noise.tif"]);
    assert_eq!(terrain(&at.join("noise.tif")).shape(), (40, 60));
    let small = ["train", "sierra", "--crop", "0,0,64", "-o", "x.safetensors", "--detail-model", "sparse"];
    fails(at, &[&small[..], &["--set", "sparse.step=5"]].concat(), 1, &["sparse.step is 5"]);
}

#[test]
fn trees_are_fitted_edited_and_drawn() {
    let folder = temporary();
    let at = folder.path();
    write_hill(&at.join("hill.asc"), 60);
    let fit = ["tree", "fit", "hill.asc", "-o", "t.toml", "--atoms", "20", "--sparsity", "2"];
    let said = done(at, &fit).out;
    assert!(said.contains("PSNR") && said.contains("paper's count"), "{said}");
    std::fs::write(
        at.join("river.toml"),
        "kind = \"curve\"\npoints = [[0.0, 700.0, 300.0], [1500.0, 700.0, 300.0]]\nsection = [[0.0, 0.0], [40.0, 0.0]]\nreach = 100.0\n",
    )
    .unwrap();
    done(at, &["tree", "edit", "t.toml", "--carve", "river.toml", "-o", "r.toml"]);
    let said = done(at, &["tree", "info", "r.toml"]).out;
    assert!(said.contains("carve(sparse, curve)") && said.contains("20 data atoms"), "{said}");
    done(at, &["tree", "render", "r.toml", "-o", "r.tif", "--cell", "12.5"]);
    done(at, &["tree", "render", "t.toml", "-o", "t.tif", "--cell", "12.5"]);
    let (river, bare) = (terrain(&at.join("r.tif")), terrain(&at.join("t.tif")));
    assert_eq!(river.shape(), (120, 120));
    for ((cell, with), without) in river.heights().cells().zip(bare.heights().as_slice()) {
        let distance = ((cell.row as f64 + 0.5) * 12.5 - 700.0).abs();
        if distance < 40.0 {
            assert!((with - 300.0).abs() < 0.01, "{cell:?} {with}");
        } else if distance > 100.0 {
            assert_eq!(with, without);
        }
    }
    fails(at, &["tree", "edit", "t.toml", "-o", "x.toml"], 2, &["--carve"]);
    fails(
        at,
        &["tree", "edit", "t.toml", "--carve", "river.toml", "--weight", "2", "-o", "x.toml"],
        1,
        &["weight is 2"],
    );
    fails(at, &["tree", "render", "t.toml", "-o", "x.tif", "--window", "1,2"], 2, &["X,Y,W,H"]);
    fails(at, &["tree", "fit", "hill.asc", "-o", "x.toml", "--step", "9"], 1, &["step is 9"]);
    std::fs::write(at.join("bad.toml"), "kind = \"volcano\"").unwrap();
    fails(at, &["tree", "edit", "t.toml", "--add", "bad.toml", "-o", "x.toml"], 1, &["bad.toml", "volcano"]);
}
