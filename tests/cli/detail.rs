//! Detail from the command line: trained generators, patches, amplification, interrupted trainings.

use super::{done, fails, temporary, write_hill};
use serde_json::Value;
use std::path::Path;

/// Trains quickly on 64x64 cells of sierra, with detail.
const BRIEF: [&str; 12] = [
    "train",
    "sierra",
    "--crop",
    "192,192,64",
    "--epochs",
    "3",
    "--set",
    "model.extractions=2",
    "--set",
    "detail.steps=6",
    "-o",
    "s.safetensors",
];

fn heights(path: &Path) -> Vec<f32> {
    let dem = monadnock::dem::io::read(path, &monadnock::dem::io::ReadOptions::default()).unwrap();
    dem.heights().as_slice().to_vec()
}

#[test]
fn detail_is_trained_added_and_left_out() {
    let folder = temporary();
    let at = folder.path();
    let said = done(at, &BRIEF).out;
    assert!(said.contains("detail: ") && said.contains("scales"), "{said}");
    assert!(!at.join("s.safetensors.gnn-checkpoint").exists());
    assert!(!at.join("s.safetensors.generators-checkpoint").exists());
    let info = done(at, &["info", "s.safetensors"]).out;
    assert!(info.contains("scales, ") && info.contains("exemplar rebuilt with PSNR"), "{info}");
    let json: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    assert_eq!(json["detail"]["config"]["steps"], 6);

    // As the network makes it: what is drained is another matter.
    let base = [
        "generate",
        "s.safetensors",
        "--method",
        "network",
        "--drain=never",
        "--sketch",
        "lambda-ring",
        "-o",
    ];
    let make = |file: &str, more: &[&str]| {
        done(at, &[&base[..], &[file], more].concat());
        heights(&at.join(file))
    };
    let (with, without) = (make("with.tif", &[]), make("without.tif", &["--no-detail"]));
    assert_ne!(with, without);
    assert_eq!(make("none.tif", &["--detail-strength", "0"]), without);
    assert_ne!(make("other.tif", &["--seed", "2"]), with);
    assert_ne!(make("size.tif", &["--detail-size", "2"]), with);
    // The strokes are exact, with and without.
    let reading = monadnock::sketch::samples::load("lambda-ring").unwrap();
    let lines = reading.sketch.rasterize();
    let mut on_lines = 0;
    for (i, kind) in lines.kinds().as_slice().iter().enumerate() {
        if kind.is_some() {
            assert_eq!(with[i], without[i], "cell {i}");
            on_lines += 1;
        }
    }
    assert!(on_lines > 100 && on_lines < with.len() / 2);
    // A mask: detail in the west half only.
    let (rows, cols) = (reading.sketch.rows, reading.sketch.cols);
    let mut text = format!("ncols {cols}\nnrows {rows}\nxllcorner 0\nyllcorner 0\ncellsize 1\n");
    for _ in 0..rows {
        let row: Vec<&str> = (0..cols).map(|col| if col < cols / 2 { "1" } else { "0" }).collect();
        text += &(row.join(" ") + "\n");
    }
    std::fs::write(at.join("west.asc"), text).unwrap();
    let west = make("west.tif", &["--detail-mask", "west.asc"]);
    for (i, z) in west.iter().enumerate() {
        if i % cols >= cols / 2 {
            assert_eq!(*z, without[i], "cell {i}");
        }
    }
    assert_ne!(west, without);
    std::fs::write(
        at.join("small.asc"),
        "ncols 2\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 0\n0 1\n1 0\n",
    )
    .unwrap();
    let with_mask = [&base[..], &["x.tif", "--detail-mask", "small.asc"]].concat();
    fails(at, &with_mask, 1, &["small.asc", "3x2", "128x128"]);

    let eval = [
        "eval",
        "s.safetensors",
        "sierra",
        "--patches",
        "0,0",
        "--systems",
        "gnn,laplace",
        "--json",
        "s.json",
    ];
    let table = done(at, &eval).out;
    for word in ["gnn+detail", "patch dist", "landforms", "copied"] {
        assert!(table.contains(word), "{word} is missing in {table}");
    }
    let json: Value = serde_json::from_slice(&std::fs::read(at.join("s.json")).unwrap()).unwrap();
    let kinds = json["kinds"].as_array().unwrap();
    assert_eq!(kinds.len(), 3);
    assert!(kinds[1]["sliced_wasserstein"].as_f64().unwrap() > 0.0 && kinds[1]["copied_share"].is_f64());
}

#[test]
fn a_style_without_detail_says_what_it_lacks() {
    let folder = temporary();
    let at = folder.path();
    done(at, &[&BRIEF[..], &["--no-detail"]].concat());
    assert!(done(at, &["info", "s.safetensors"]).out.contains("--no-detail"));
    let base = ["generate", "s.safetensors", "--method", "network", "--sketch", "lambda-ring", "-o"];
    done(at, &[&base[..], &["a.tif"]].concat());
    done(at, &[&base[..], &["b.tif", "--no-detail"]].concat());
    assert_eq!(heights(&at.join("a.tif")), heights(&at.join("b.tif")));
    fails(at, &[&base[..], &["c.tif", "--detail-strength", "2"]].concat(), 1, &["detail", "s.safetensors"]);
    fails(at, &["amplify", "s.safetensors", "sierra", "--factor", "2", "-o", "c.tif"], 1, &["--no-detail"]);
    fails(at, &["sample", "s.safetensors", "--size", "64", "-o", "c.tif"], 1, &["--no-detail"]);
    fails(at, &[&BRIEF[..], &["--set", "detail.stepps=6"]].concat(), 1, &["stepps"]);
    fails(at, &[&BRIEF[..], &["--set", "detail.width=33"]].concat(), 1, &["detail.width is 33"]);
}

#[test]
fn terrain_is_amplified_and_drawn_from_noise() {
    let folder = temporary();
    let at = folder.path();
    done(at, &[&BRIEF[..], &["-q"]].concat());
    // 30x30 cells of 25 m in Swiss coordinates with a hole of two cells.
    let mut text =
        "ncols 30\nnrows 30\nxllcorner 600000\nyllcorner 200000\ncellsize 25\nNODATA_value -9999\n"
            .to_owned();
    for row in 0..30 {
        for col in 0..30 {
            let z = 500.0 + 80.0 * (f64::from(col) / 5.0).sin() * (f64::from(row) / 6.0).cos();
            text += &if row == 4 && (7..9).contains(&col) { "-9999 ".to_owned() } else { format!("{z:.2} ") };
        }
        text.push('\n');
    }
    std::fs::write(at.join("coarse.asc"), text).unwrap();
    done(at, &["amplify", "s.safetensors", "coarse.asc", "--factor", "4", "-o", "fine.tif"]);
    let read = |file: &str| {
        monadnock::dem::io::read(&at.join(file), &monadnock::dem::io::ReadOptions::default()).unwrap()
    };
    let (coarse, fine) = (read("coarse.asc"), read("fine.tif"));
    assert_eq!(fine.shape(), (120, 120));
    assert_eq!(fine.cell_size().x(), 6.25);
    assert_eq!(fine.void_count(), 2 * 16);
    assert!(
        !fine.valid()[monadnock::grid::Cell::new(16, 28)] && fine.valid()[monadnock::grid::Cell::new(16, 27)]
    );
    let (a, b) = (coarse.georeference().unwrap(), fine.georeference().unwrap());
    assert_eq!(a.to_model(0.0, 0.0), b.to_model(0.0, 0.0));
    assert_eq!(a.to_model(30.0, 30.0), b.to_model(120.0, 120.0));
    // The large forms stay: means of 4x4 cells are the old heights nearly.
    for cell in [(10, 10), (20, 3), (25, 25)] {
        let old = coarse.heights()[monadnock::grid::Cell::new(cell.0, cell.1)];
        let sum: f32 = (0..16)
            .map(|i| fine.heights()[monadnock::grid::Cell::new(4 * cell.0 + i / 4, 4 * cell.1 + i % 4)])
            .sum();
        assert!((sum / 16.0 - old).abs() < 16.0, "{cell:?}: {} {old}", sum / 16.0);
    }
    done(at, &["--seed", "2", "amplify", "s.safetensors", "coarse.asc", "--factor", "4", "-o", "other.tif"]);
    assert_ne!(heights(&at.join("fine.tif")), heights(&at.join("other.tif")));
    fails(at, &["amplify", "s.safetensors", "coarse.asc", "--factor", "3", "-o", "x.tif"], 2, &["2, 4, 8"]);

    done(at, &["sample", "s.safetensors", "--size", "80x96", "-o", "a.tif"]);
    done(at, &["sample", "s.safetensors", "--size", "80x96", "-o", "b.tif", "--threads", "1"]);
    assert_eq!(read("a.tif").shape(), (80, 96));
    assert_eq!(heights(&at.join("a.tif")), heights(&at.join("b.tif")));
    fails(at, &["sample", "s.safetensors", "--size", "8", "-o", "x.tif"], 1, &["8x8", "16x16"]);
    let near = ["sample", "s.safetensors", "--size", "80x96", "-o", "near.tif", "--variety"];
    done(at, &[&near[..], &["0.2"]].concat());
    assert_ne!(heights(&at.join("a.tif")), heights(&at.join("near.tif")));
    fails(at, &[&near[..], &["1.5"]].concat(), 1, &["variety is 1.5", "0 to 1"]);
}

#[test]
fn an_interrupted_detail_training_is_resumed() {
    let folder = temporary();
    let at = folder.path();
    done(at, &[&BRIEF[..], &["-q"]].concat());
    let whole = std::fs::read(at.join("s.safetensors")).unwrap();
    // Killed in the middle of the detail: it is the longer part here.
    let slow = ["--set", "detail.steps=4000", "--checkpoint-every", "0s", "-q"];
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_monadnock"))
        .current_dir(at)
        .args([&BRIEF[..], &slow].concat())
        .spawn()
        .unwrap();
    let kept = at.join("s.safetensors.generators-checkpoint");
    let begun = std::time::Instant::now();
    while !kept.exists() {
        assert!(begun.elapsed().as_secs() < 300 && child.try_wait().unwrap().is_none(), "no checkpoint");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    // Usable already, without detail.
    done(at, &["generate", "s.safetensors", "--method", "network", "--sketch", "lambda-ring", "-o", "a.tif"]);
    fails(at, &[&BRIEF[..], &["--resume", "--set", "detail.penalty=0.2"]].concat(), 1, &["to resume"]);
    fails(at, &[&BRIEF[..], &["--resume", "--seed", "3"]].concat(), 1, &["to resume"]);
    // The interrupted one had another schedule: begun anew it is the first one to the bit, tensors and all but the times.
    let answer = done(at, &BRIEF);
    assert!(answer.err.contains("starts over"), "{}", answer.err);
    let tensors = |bytes: &[u8]| {
        let file = safetensors::SafeTensors::deserialize(bytes).unwrap();
        let mut all: Vec<(String, Vec<u8>)> =
            file.tensors().into_iter().map(|(name, view)| (name, view.data().to_vec())).collect();
        all.sort();
        all
    };
    assert_eq!(tensors(&whole), tensors(&std::fs::read(at.join("s.safetensors")).unwrap()));

    let mut short: Vec<&str> = BRIEF.to_vec();
    short.drain(4..6);
    done(at, &[&short[..], &["--budget", "4s", "-q"]].concat());
    let json: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    let seconds = json["detail"]["record"]["seconds"].as_f64().unwrap();
    // The six steps of each scale that the configuration asks for take well under a second; a step more than the budget a scale
    // may take long on a machine with other work.
    assert!((2.0..30.0).contains(&seconds), "{seconds}");
}

#[test]
fn patches_are_detail_that_needs_no_training() {
    let folder = temporary();
    let at = folder.path();
    done(at, &[&BRIEF[..], &["--no-detail", "-q"]].concat());
    let take = ["train", "sierra", "--crop", "192,192,64", "--epochs", "3", "--set", "model.extractions=2"];
    let patches = ["-o", "p.safetensors"];
    let said = done(at, &[&take[..], &patches[..]].concat()).out;
    assert!(said.contains("detail: patches of 64x64 cells"), "{said}");
    assert!(done(at, &["info", "p.safetensors"]).out.contains("patches of the exemplar, 64 x 64 cells"));

    // From the same coarse model, without training it again: the same bytes.
    let without_epochs: Vec<&str> =
        take.iter().copied().filter(|word| !["--epochs", "3"].contains(word)).collect();
    let reused = ["--set", "model.epochs=3", "--coarse", "s.safetensors", "--detail-model", "patches", "-o"];
    done(at, &[&without_epochs[..], &reused[..], &["q.safetensors", "-q"]].concat());
    let make = |style: &str, file: &str, more: &[&str]| {
        done(
            at,
            &[
                &[
                    "generate",
                    style,
                    "--method",
                    "network",
                    "--drain=never",
                    "--sketch",
                    "lambda-ring",
                    "-o",
                    file,
                ],
                more,
            ]
            .concat(),
        );
        heights(&at.join(file))
    };
    let with = make("p.safetensors", "a.tif", &[]);
    assert_eq!(with, make("q.safetensors", "b.tif", &["--threads", "1"]));
    // A training that was stopped between both goes on with the detail.
    done(at, &[&take[..], &["-o", "r.safetensors", "--no-detail", "-q"]].concat());
    let resumed = done(at, &[&take[..], &["-o", "r.safetensors", "--resume"]].concat()).out;
    assert!(resumed.contains("detail: patches") && !resumed.contains("from the start"), "{resumed}");
    assert_eq!(with, make("r.safetensors", "r.tif", &[]));
    let without = make("s.safetensors", "c.tif", &[]);
    assert_eq!(without, make("p.safetensors", "d.tif", &["--no-detail"]));
    assert_ne!(with, without);
    assert_ne!(with, make("p.safetensors", "e.tif", &["--seed", "2"]));

    done(at, &["eval", "p.safetensors", "sierra", "--patches", "0,0", "--systems", "gnn", "--csv", "s.csv"]);
    assert!(std::fs::read_to_string(at.join("s.csv")).unwrap().contains("gnn+detail"));
    write_hill(&at.join("hill.asc"), 48);
    done(at, &["amplify", "p.safetensors", "hill.asc", "--factor", "2", "-o", "f.tif"]);
    assert_eq!(heights(&at.join("f.tif")).len(), 96 * 96);

    done(at, &["sample", "p.safetensors", "--size", "40x64", "-o", "g.tif"]);
    assert_eq!(heights(&at.join("g.tif")).len(), 40 * 64);
    fails(at, &["sample", "p.safetensors", "--size", "12", "-o", "x.tif"], 1, &["12x12", "16x16"]);

    let other = [&without_epochs[..], &reused[..], &["x.safetensors", "--seed", "2"]].concat();
    fails(at, &other, 1, &["s.safetensors", "seed", "coarse model"]);
    let settings = ["--set", "detail.steps=9", "--detail-model", "patches", "-o", "x.safetensors"];
    fails(at, &[&take[..], &settings[..]].concat(), 1, &["patches", "[detail]"]);
    // Refused before anything is trained, when nothing else was asked for.
    let large = ["train", "sierra", "--crop", "0,0,300", "--detail-model", "patches", "-o", "x.safetensors"];
    fails(at, &large, 1, &["300x300", "65536"]);
    assert!(!at.join("x.safetensors").exists());
}

#[test]
fn strength_is_measured_on_unseen_terrain() {
    use monadnock::control::{Control, Progress};
    use monadnock::dem::Dem;
    use monadnock::grid::{Cell, Window};
    use monadnock::seed::Seed;
    use monadnock::style::{Exemplar, Source, StyleConfig, unseen_surface};

    let sierra = monadnock::dem::bundled::load("sierra").unwrap();
    let mut config = StyleConfig::default();
    (config.model.epochs, config.model.extractions) = (4, 1);
    let shares = |dem: &Dem, side: usize| {
        let source = Source::new("sierra", dem, Window::square(Cell::new(192, 192), side)).unwrap();
        let exemplar = Exemplar::new(&source, &config.extraction, Seed(1)).unwrap();
        let mut shares = Vec::new();
        let mut progress = |done: &Progress<'_>| shares.push(done.share);
        let control = Control::new(&mut progress);
        let unseen = unseen_surface(&*config.plan().unwrap(), &exemplar, control).unwrap();
        assert_eq!(unseen.is_some(), shares.last() == Some(&1.0));
        shares
    };
    // Two epochs of each half.
    assert_eq!(shares(&sierra, 96), [0.25, 0.5, 0.75, 1.0]);
    // Halves too small to learn from, or void: the surface through the lines serves.
    assert!(shares(&sierra, 64).is_empty());
    let mut valid = sierra.valid().clone();
    for row in 192..288 {
        for col in 192..240 {
            valid[Cell::new(row, col)] = false;
        }
    }
    let holed = Dem::with_voids(sierra.heights().clone(), valid, sierra.cell_size()).unwrap();
    assert!(shares(&holed, 96).is_empty());
}
