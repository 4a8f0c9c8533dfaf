//! Voids never break anything: random ones, from a single cell to half of the raster, through every command that reads terrain.
//!
//! `MONADNOCK_VOID_CASES=1000 cargo test --release --test voids` runs more of them than the few that every test run has.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "test helpers fail by panicking"
)]

use assert_cmd::Command;
use monadnock::dem::io::{ReadOptions, WriteOptions, read, write};
use monadnock::dem::{Dem, bundled};
use monadnock::grid::{Cell, Mask, Window};
use rayon::prelude::*;
use std::path::Path;

/// Runs the program; its messages, or what it said before it failed.
fn run(folder: &Path, args: &[&str]) -> Result<String, String> {
    let output = Command::cargo_bin("monadnock").unwrap().current_dir(folder).args(args).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    if output.status.success() {
        Ok(text(output.stdout))
    } else {
        Err(format!("{args:?}: {}", text(output.stderr)))
    }
}

/// A number from 0 to 1 that follows from two (SplitMix64).
fn lot(case: u64, i: u64) -> f64 {
    let mut z = (case << 32 ^ i).wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ z >> 31) as f64 / u64::MAX as f64
}

/// The kinds of voids, in turn: one cell, scattered cells, blocks, a collar, a checkerboard.
const KINDS: [&str; 5] = ["one cell", "cells", "blocks", "collar", "checkerboard"];

/// True where a case leaves a height: 1 to 50 % are voids (one cell less).
fn known(case: u64, (rows, cols): (usize, usize)) -> Mask {
    let lot = |i: usize| lot(case, i as u64);
    let up_to = |i: usize, n: usize| (lot(i) * n as f64) as usize;
    let share = 0.01 + 0.49 * lot(1);
    match KINDS[case as usize % KINDS.len()] {
        "one cell" => {
            let void = Cell::new(up_to(2, rows), up_to(3, cols));
            Mask::from_fn(rows, cols, |c| c != void)
        }
        "cells" => Mask::from_fn(rows, cols, |c| lot(10 + c.row * cols + c.col) >= share),
        "blocks" => {
            let mut mask = Mask::from_fn(rows, cols, |_| true);
            let (mut voids, mut i) = (0, 10);
            while (voids as f64) < share * (rows * cols) as f64 {
                let (row, col) = (up_to(i, rows), up_to(i + 1, cols));
                let (down, right) = (1 + up_to(i + 2, rows / 3), 1 + up_to(i + 3, cols / 3));
                for r in row..(row + down).min(rows) {
                    for c in col..(col + right).min(cols) {
                        mask[Cell::new(r, c)] = false;
                    }
                }
                voids = mask.as_slice().iter().filter(|known| !**known).count();
                i += 4;
            }
            mask
        }
        "collar" => {
            // A frame of one width takes share s where (1 - 2w)^2 = 1 - s.
            let width = (1.0 - (1.0 - share).sqrt()) / 2.0;
            let (down, right) =
                ((width * rows as f64).ceil() as usize, (width * cols as f64).ceil() as usize);
            let sides = [lot(2), lot(3), lot(4), lot(5)].map(|side| side > 0.3);
            Mask::from_fn(rows, cols, |c| {
                !(sides[0] && c.row < down
                    || sides[1] && c.row >= rows - down
                    || sides[2] && c.col < right
                    || sides[3] && c.col >= cols - right)
            })
        }
        _ => {
            let side = 1 + up_to(2, 12);
            Mask::from_fn(rows, cols, |c| (c.row / side + c.col / side) % 2 == 0)
        }
    }
}

/// Steps to the nearest void, diagonals too; far where there is none within `most`.
fn away(valid: &Mask, cell: Cell, most: usize) -> usize {
    (1..=most)
        .find(|&d| {
            let rows = cell.row.saturating_sub(d)..(cell.row + d + 1).min(valid.rows());
            rows.flat_map(|r| {
                (cell.col.saturating_sub(d)..(cell.col + d + 1).min(valid.cols()))
                    .map(move |c| Cell::new(r, c))
            })
            .any(|c| !valid[c])
        })
        .unwrap_or(most + 1)
}

/// How far amplified terrain may feel a void: the solver's bridge and the patches that lean on it, in cells.
const NEARBY: usize = 12;

fn case(number: u64, style: &Path) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let kind = KINDS[number as usize % KINDS.len()];
    // Evaluation wants a whole patch.
    let side = if number % 8 == 7 { 128 } else { 56 + (lot(number, 0) * 40.0) as usize };
    let origin = Cell::new(
        (lot(number, 6) * (511 - side) as f64) as usize,
        (lot(number, 7) * (511 - side) as f64) as usize,
    );
    let whole = bundled::load("grand-canyon").unwrap().crop(Window::square(origin, side)).unwrap();
    let mask = known(number, whole.shape());
    let dem = Dem::with_voids(whole.heights().clone(), mask, whole.cell_size()).map_err(|e| e.to_string())?;
    let dem = dem.at(whole.georeference().copied());
    write(&dem, &at.join("d.tif"), &WriteOptions::default()).unwrap();
    let failed =
        |what: String| format!("case {number} ({kind}, {side}x{side}, {} voids): {what}", dem.void_count());
    let done = |args: &[&str]| run(at, args).map_err(&failed);

    let info: serde_json::Value = serde_json::from_str(&done(&["info", "d.tif", "--json"])?).unwrap();
    if info["voids"] != dem.void_count() {
        return Err(failed(format!("info counts {} voids", info["voids"])));
    }
    done(&["render", "d.tif", "-o", "d.png"])?;
    // Where voids leave no line at all there is no sketch, and nothing to train on.
    let lines = match run(at, &["extract", "d.tif", "-o", "d.geojson"]) {
        Err(e) if e.contains("number of ridges and valleys is 0") => false,
        other => other.map(|_| true).map_err(&failed)?,
    };
    let style = style.to_str().unwrap();
    done(&["amplify", style, "d.tif", "--factor", "2", "-o", "fine.tif"])?;
    let fine = read(&at.join("fine.tif"), &ReadOptions::default()).map_err(|e| failed(e.to_string()))?;
    write(&whole, &at.join("whole.tif"), &WriteOptions::default()).unwrap();
    done(&["amplify", style, "whole.tif", "--factor", "2", "-o", "fine-whole.tif"])?;
    let all = read(&at.join("fine-whole.tif"), &ReadOptions::default()).map_err(|e| failed(e.to_string()))?;
    let range = f64::from(whole.range().1 - whole.range().0);
    let (mut squares, mut count) = (0.0, 0);
    for (cell, &ok) in fine.valid().cells() {
        let old = Cell::new(cell.row / 2, cell.col / 2);
        if ok != dem.valid()[old] {
            return Err(failed(format!(
                "{cell:?} of the amplified terrain is {}",
                if ok { "no void" } else { "a void" }
            )));
        }
        if ok && cell.row % 2 == 0 && cell.col % 2 == 0 && away(dem.valid(), old, NEARBY) > NEARBY {
            let difference = f64::from(fine.heights()[cell]) - f64::from(all.heights()[cell]);
            (squares, count) = (squares + difference * difference, count + 1);
        }
    }
    let far = if count > 0 { (squares / f64::from(count)).sqrt() / range } else { 0.0 };
    if std::env::var_os("MONADNOCK_VOID_FIGURES").is_some() {
        eprintln!("{}", failed(format!("{far:.5} of the range over {count} far cells")));
    }
    if far > FAR_CHANGE {
        return Err(failed(format!("far from voids heights change by {far:.4} of the range")));
    }
    if number % 4 == 3 && lines {
        let settings = ["--epochs", "2", "--set", "model.extractions=1", "--set", "model.splits=1"];
        done(&[&["train", "d.tif", "-o", "d.safetensors"], &settings[..]].concat())?;
    }
    if side == 128 {
        match run(at, &["eval", style, "d.tif", "--systems", "gnn,laplace", "--save", "rebuilt"]) {
            Err(e) if !lines && e.contains("0") => {}
            other => {
                other.map_err(&failed)?;
                let truth = read(&at.join("rebuilt/0_0/truth.tif"), &ReadOptions::default()).unwrap();
                if truth.valid() != dem.valid() {
                    return Err(failed("the saved truth has other voids".to_owned()));
                }
            }
        }
    }
    Ok(())
}

/// Root mean square of what voids change beyond [`NEARBY`] in amplified terrain, as a share of the range of heights.
const FAR_CHANGE: f64 = 0.01;

#[test]
fn random_voids_pass_every_command() {
    let cases = std::env::var("MONADNOCK_VOID_CASES").map_or(8, |n| n.parse().expect("a number of cases"));
    let folder = tempfile::tempdir().unwrap();
    let style = folder.path().join("sierra.safetensors");
    let settings = ["--epochs", "20", "--crop", "128,128,96"];
    run(folder.path(), &[&["train", "sierra", "-o", "sierra.safetensors"], &settings[..]].concat()).unwrap();
    let failed: Vec<String> = (0..cases).into_par_iter().filter_map(|n| case(n, &style).err()).collect();
    assert!(failed.is_empty(), "{} of {cases}:\n{}", failed.len(), failed.join("\n"));
}

#[test]
fn the_voids_are_what_they_are_called() {
    for number in 0..50 {
        let mask = known(number, (60, 80));
        let share = mask.as_slice().iter().filter(|known| !**known).count() as f64 / 4800.0;
        assert!(share > 0.0 && share < 0.75, "{number}: {share}");
    }
}
