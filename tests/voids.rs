//! Voids never break anything: random ones, from a single cell to half of the raster, through every command that reads terrain.
//!
//! `MONADNOCK_VOID_CASES=1000 cargo test --release --test voids` runs more of them than the few that every test run has;
//! `MONADNOCK_VOID_CASES=500..600` those.

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
use monadnock::sketch::geojson;
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

/// Root mean square of what voids change beyond [`NEARBY`] in amplified terrain, as a share of the range of heights.
const FAR_CHANGE: f64 = 0.03;

/// How far a shaded picture may feel a void: its finest slopes are taken over the neighbours of a cell.
const NEARBY_SHADE: usize = 2;

/// Correlation of shades that only brightness and contrast distinguish; rounding to 256 levels is what is missing to 1.
const SAME_SHADES: f64 = 0.95;

/// The smallest training that goes through every step of it.
const TINY: [&str; 8] =
    ["--epochs", "2", "--set", "model.extractions=1", "--set", "model.splits=1", "--set", "model.width=16"];

/// One piece of terrain with voids, in a folder of its own, beside the same without.
struct Case {
    folder: tempfile::TempDir,
    /// As files have it.
    dem: Dem,
    whole: Dem,
    /// A style that was learned from terrain without voids.
    style: String,
    name: String,
}

type Checked = Result<(), String>;

impl Case {
    fn new(number: u64, style: &Path) -> Result<Self, String> {
        // Evaluation wants a whole patch.
        let side = if number % 16 == 7 { 128 } else { 44 + (lot(number, 0) * 28.0) as usize };
        let origin = |i: u64| (lot(number, i) * (511 - side) as f64) as usize;
        let whole = bundled::load("grand-canyon").unwrap();
        let whole = whole.crop(Window::square(Cell::new(origin(6), origin(7)), side)).unwrap();
        let mask = known(number, whole.shape());
        let dem = Dem::with_voids(whole.heights().clone(), mask, whole.cell_size());
        let dem = dem.map_err(|e| e.to_string())?.at(whole.georeference().copied());
        let folder = tempfile::tempdir().unwrap();
        write(&dem, &folder.path().join("d.tif"), &WriteOptions::default()).unwrap();
        write(&whole, &folder.path().join("whole.tif"), &WriteOptions::default()).unwrap();
        let kind = KINDS[number as usize % KINDS.len()];
        let name = format!("case {number} ({kind}, {side}x{side}, {} voids)", dem.void_count());
        Ok(Self { folder, dem, whole, style: style.to_str().unwrap().to_owned(), name })
    }

    /// Runs the program in the folder on one thread, as other cases have the others.
    fn run(&self, args: &[&str]) -> Result<String, String> {
        run(self.folder.path(), &[args, &["--threads", "1"]].concat()).map_err(|e| self.failed(e))
    }

    fn read(&self, name: &str) -> Result<Dem, String> {
        read(&self.folder.path().join(name), &ReadOptions::default()).map_err(|e| self.failed(e))
    }

    fn failed(&self, what: impl std::fmt::Display) -> String {
        format!("{}: {what}", self.name)
    }

    fn ensure(&self, holds: bool, what: impl FnOnce() -> String) -> Checked {
        if holds { Ok(()) } else { Err(self.failed(what())) }
    }

    /// `name` is terrain of this shape without a void, inside a range that it can have.
    fn ensure_whole(&self, name: &str, shape: (usize, usize)) -> Checked {
        let made = self.read(name)?;
        self.ensure(made.shape() == shape && made.void_count() == 0, || {
            format!("{name}: {:?}, {} voids", made.shape(), made.void_count())
        })?;
        let ((low, high), (from, to)) = (made.range(), self.whole.range());
        let spare = 3.0 * (to - from);
        self.ensure(low > from - spare && high < to + spare, || format!("{name}: {low} to {high} m"))
    }

    fn info(&self) -> Checked {
        let info: serde_json::Value =
            serde_json::from_str(&self.run(&["info", "d.tif", "--json"])?).map_err(|e| self.failed(e))?;
        self.ensure(info["voids"] == self.dem.void_count(), || {
            format!("info counts {} voids", info["voids"])
        })?;
        let told = ["lowest", "highest"].map(|end| info["elevation"][end].as_f64().unwrap() as f32);
        self.ensure(told == [self.dem.range().0, self.dem.range().1], || format!("info says {told:?}"))
    }

    /// Pictures: shades beside a void may change, others keep their forms. (Colours and exaggeration follow the whole raster, so
    /// that shades are compared up to brightness and contrast.)
    fn render(&self) -> Checked {
        self.run(&["render", "d.tif", "-o", "d.png"])?;
        for name in ["d", "whole"] {
            self.run(&["render", &format!("{name}.tif"), "--grey", "-o", &format!("{name}-grey.png")])?;
        }
        let [one, other] =
            ["d-grey.png", "whole-grey.png"].map(|name| pixels(&self.folder.path().join(name)));
        let size = one.len() / self.dem.heights().len();
        let far: Vec<(f64, f64)> = (self.dem.valid().cells().enumerate())
            .filter(|(_, (cell, ok))| **ok && away(self.dem.valid(), *cell, NEARBY_SHADE) > NEARBY_SHADE)
            .map(|(i, _)| (f64::from(one[i * size]), f64::from(other[i * size])))
            .collect();
        if far.len() < 50 {
            return Ok(());
        }
        let alike = correlation(&far);
        if std::env::var_os("MONADNOCK_VOID_FIGURES").is_some() {
            eprintln!("{}", self.failed(format!("shades far from voids correlate by {alike:.5}")));
        }
        self.ensure(alike > SAME_SHADES, || format!("shades far from voids correlate by {alike:.5}"))
    }

    /// Lines lie on known cells, at their heights. False where voids leave none.
    fn extract(&self) -> Result<bool, String> {
        match self.run(&["extract", "d.tif", "-o", "d.geojson"]) {
            Err(e) if e.contains("number of ridges and valleys is 0") => return Ok(false),
            other => other?,
        };
        let path = self.folder.path().join("d.geojson");
        let text = std::fs::read_to_string(path).map_err(|e| self.failed(e))?;
        let sketch =
            geojson::parse(&text, &geojson::ReadOptions::default()).map_err(|e| self.failed(e))?.sketch;
        for vertex in sketch.strokes.iter().flat_map(|stroke| &stroke.vertices) {
            let cell = Cell::new(vertex.y.round() as usize, vertex.x.round() as usize);
            let height = f64::from(self.dem.heights()[cell]);
            self.ensure(self.dem.valid()[cell] && vertex.z == height, || {
                format!("a line of {} m at {cell:?}, which is {height} m, or void", vertex.z)
            })?;
        }
        Ok(true)
    }

    /// Voids stay voids, and far from them heights are those of the terrain without any.
    fn amplify(&self) -> Checked {
        for (from, to) in [("d.tif", "fine.tif"), ("whole.tif", "fine-whole.tif")] {
            self.run(&["amplify", &self.style, from, "--factor", "2", "-o", to])?;
        }
        let (fine, all) = (self.read("fine.tif")?, self.read("fine-whole.tif")?);
        let range = f64::from(self.whole.range().1 - self.whole.range().0);
        let (mut squares, mut count) = (0.0, 0);
        for (cell, &ok) in fine.valid().cells() {
            let old = Cell::new(cell.row / 2, cell.col / 2);
            self.ensure(ok == self.dem.valid()[old], || {
                format!("{cell:?} of the amplified terrain is {}", if ok { "no void" } else { "a void" })
            })?;
            if ok && cell.row % 2 == 0 && cell.col % 2 == 0 && away(self.dem.valid(), old, NEARBY) > NEARBY {
                let difference = f64::from(fine.heights()[cell]) - f64::from(all.heights()[cell]);
                (squares, count) = (squares + difference * difference, count + 1);
            }
        }
        let far = if count > 0 { (squares / f64::from(count)).sqrt() / range } else { 0.0 };
        if std::env::var_os("MONADNOCK_VOID_FIGURES").is_some() {
            eprintln!("{}", self.failed(format!("{far:.5} of the range over {count} far cells")));
        }
        self.ensure(far <= FAR_CHANGE, || format!("far from voids heights change by {far:.4} of the range"))
    }

    /// A style of terrain with voids, and what is made with it: everywhere, and in its range.
    fn learn(&self) -> Checked {
        self.run(&[&["train", "d.tif", "-o", "d.safetensors"], &TINY[..]].concat())?;
        let style: serde_json::Value =
            serde_json::from_str(&self.run(&["info", "d.safetensors", "--json"])?)
                .map_err(|e| self.failed(e))?;
        let told = ["low", "high"].map(|end| style["normalization"][end].as_f64().unwrap() as f32);
        self.ensure(told == [self.dem.range().0, self.dem.range().1], || {
            format!("the style spans {told:?}")
        })?;
        // Dense lines by the network, a single one from patches of the terrain, both on its map.
        for sketch in ["d.geojson", "single-stroke"] {
            let generate =
                ["generate", "d.safetensors", "--sketch", sketch, "--like", "d.tif", "-o", "made.tif"];
            self.run(&generate)?;
            self.ensure_whole("made.tif", self.dem.shape())?;
        }
        self.run(&["sample", "d.safetensors", "--size", "48", "-o", "sample.tif"])?;
        self.ensure_whole("sample.tif", (48, 48))?;
        // Strokes without heights get those of this style.
        let open = r#"{"type":"Feature","properties":{"kind":"valley"},"geometry":{"type":"LineString","coordinates":
            [[8,8],[30,24],[44,44]]}}"#;
        std::fs::write(self.folder.path().join("open.geojson"), open).unwrap();
        let fill =
            ["sketch", "fill", "open.geojson", "--style", "d.safetensors", "--like", "d.tif", "--pixels"];
        match self.run(&[&fill[..], &["-o", "filled.geojson"]].concat()) {
            // Too few lines are left to learn from.
            Err(e) if e.contains("ridges and valleys with some relief are needed") => Ok(()),
            other => other.map(drop),
        }
    }

    /// Every system's terrain is whole; the truth beside it is the terrain to the bit.
    fn evaluate(&self, has_lines: bool) -> Checked {
        match self.run(&["eval", &self.style, "d.tif", "--systems", "gnn,laplace", "--save", "rebuilt"]) {
            Err(e) if !has_lines && e.contains('0') => return Ok(()),
            // A patch without lines is rebuilt by nobody, which is said, and not saved.
            Ok(_) if !has_lines => return Ok(()),
            other => other?,
        };
        let truth = self.read("rebuilt/0_0/truth.tif")?;
        self.ensure(truth.valid() == self.dem.valid(), || "the saved truth has other voids".to_owned())?;
        let place = self.read("d.tif")?.georeference().copied();
        self.ensure(truth.georeference().copied() == place, || {
            format!("the saved truth lies at {:?}, not at {place:?}", truth.georeference())
        })?;
        for (cell, _) in self.dem.valid().cells().filter(|(_, ok)| **ok) {
            let (one, other) = (truth.heights()[cell], self.dem.heights()[cell]);
            self.ensure((one - other).abs() < 1e-3, || {
                format!("{cell:?} of the saved truth: {one}, not {other}")
            })?;
        }
        self.ensure_whole("rebuilt/0_0/laplace.tif", self.dem.shape())?;
        self.ensure_whole("rebuilt/0_0/gnn.tif", self.dem.shape())
    }

    /// As an area of a folder with a manifest, in an experiment.
    fn experiment(&self) -> Checked {
        let added = self.run(&["data", "add", "d.tif"])?;
        self.ensure(added.contains("manifest.toml: added"), || added.clone())?;
        self.run(&["data", "list", "manifest.toml"])?;
        let side = self.dem.shape().0;
        let text = format!(
            r#"
            kind = "fit"
            title = "t"
            question = "q"
            analysis = "a"
            seeds = [1]
            budget_minutes = 1
            metrics = ["ssim"]
            interpolators = ["laplace"]
            [overrides.model]
            epochs = 1
            extractions = 1
            splits = 1
            width = 16
            [[style]]
            name = "s"
            preset = "anchored"
            [[area]]
            name = "d"
            exemplar = [0, 0, {side}]
            "#
        );
        std::fs::write(self.folder.path().join("x.toml"), text).unwrap();
        let said = self.run(&["experiment", "run", "x.toml", "--data", ".", "--out", "record"])?;
        self.ensure(said.contains(" 0 failed"), || said.clone())
    }

    fn check(&self, number: u64) -> Checked {
        self.info()?;
        self.render()?;
        self.amplify()?;
        let has_lines = self.extract()?;
        // Without any line there is nothing to learn from.
        if has_lines {
            self.learn()?;
        }
        // Reads as `data` does and learns as `train` does: a quarter of the cases is enough.
        if has_lines && number % 4 == 1 {
            self.experiment()?;
        }
        if self.dem.shape() == (128, 128) { self.evaluate(has_lines) } else { Ok(()) }
    }
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>();
    let both = sum(&|p| (p.0 - x) * (p.1 - y));
    both / (sum(&|p| (p.0 - x) * (p.0 - x)) * sum(&|p| (p.1 - y) * (p.1 - y))).sqrt()
}

fn pixels(path: &Path) -> Vec<u8> {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

/// How many cases from the first on, or which, as `500..600`.
fn cases(text: &str) -> std::ops::Range<u64> {
    let number = |text: &str| text.parse().expect("a number of cases, or from..to");
    match text.split_once("..") {
        Some((from, to)) => number(from)..number(to),
        None => 0..number(text),
    }
}

#[test]
fn random_voids_pass_every_command() {
    let wanted = std::env::var("MONADNOCK_VOID_CASES");
    let cases: Vec<u64> = cases(wanted.as_deref().unwrap_or("8")).collect();
    let folder = tempfile::tempdir().unwrap();
    let style = folder.path().join("sierra.safetensors");
    let settings = ["--epochs", "20", "--crop", "128,128,96"];
    run(folder.path(), &[&["train", "sierra", "-o", "sierra.safetensors"], &settings[..]].concat()).unwrap();
    let case = |number| {
        let failed = Case::new(number, &style).and_then(|case| case.check(number)).err();
        failed.inspect(|what| eprintln!("{what}"))
    };
    let failed: Vec<String> = cases.par_iter().copied().filter_map(case).collect();
    assert!(failed.is_empty(), "{} of {} cases:\n{}", failed.len(), cases.len(), failed.join("\n"));
}

#[test]
fn the_voids_are_what_they_are_called() {
    for number in 0..50 {
        let mask = known(number, (60, 80));
        let share = mask.as_slice().iter().filter(|known| !**known).count() as f64 / 4800.0;
        assert!(share > 0.0 && share < 0.75, "{number}: {share}");
    }
}
