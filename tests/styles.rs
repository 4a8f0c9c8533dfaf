//! Styles from the outside: files of older versions still give their terrain, and a system of one's own is trained, stored, used,
//! scored and listed like those that come with the program.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod toy;

use monadnock::control::{Control, Progress, Stop};
use monadnock::dem::bundled;
use monadnock::dem::io::{self, ReadOptions};
use monadnock::grid::{Cell, Window};
use monadnock::seed::Seed;
use monadnock::sketch::samples;
use monadnock::style::{Choices, DetailChoice, Method, Recipe, Registry, Source, Style, add_detail, learn};
use monadnock::systems::task::{DetailUse, SampleUse};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use toy::Plateau;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/styles").join(name)
}

fn heights(path: &Path) -> Vec<f32> {
    io::read(path, &ReadOptions::default()).unwrap().heights().as_slice().to_vec()
}

/// Written by the program of version 1: `train sierra --crop 128,0,48 --epochs 5 --set model.extractions=2`, with patches, with
/// generators (`--set detail.steps=2 --set detail.coarsest=25 --set detail.factor=0.5`), and with `--preset paper`; the terrain by
/// `generate --sketch lambda-ring --size 48x40` and `sample --size 40x48`.
#[test]
fn styles_of_version_1_give_their_terrain() {
    let stop = Stop::new();
    for name in ["patches", "generators", "paper"] {
        let style = Style::load(&fixture(&format!("{name}.safetensors"))).unwrap();
        let (range, seed) = (style.origin.normalization, Seed(1));
        let sketch = samples::load("lambda-ring").unwrap().sketch.scaled_to(48, 40);
        let lines = sketch.map_heights(|z| range.to_metres(z)).rasterize();
        let coarse = style.generate(&lines, &Method::default(), None, seed, &stop).unwrap();
        let (made, sampled) = match &style.detail {
            Some(detail) => {
                let (how, what) = (DetailUse::default(), SampleUse::new(40, 48));
                let made = add_detail(&coarse, &**detail, range, Some(&lines), None, &how, seed, &stop);
                (made.unwrap(), Some(detail.sample(&what, seed, &stop).unwrap()))
            }
            None => (coarse, None),
        };
        // Vector levels differ in the last bits.
        let near = |made: &[f32], file: &str| {
            let kept = heights(&fixture(file));
            assert_eq!(made.len(), kept.len(), "{file}");
            let off = made.iter().zip(&kept).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 0.05, "{file}: {off} m of {} m off", range.high() - range.low());
        };
        near(made.as_slice(), &format!("{name}.npy"));
        if let Some(unit) = sampled {
            let metres = range.denormalize(&unit);
            near(metres.as_slice(), &format!("sample-{name}.npy"));
        }
        // Written again, it is the same style in today's format.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("again.safetensors");
        style.save(&path).unwrap();
        let again = Style::load(&path).unwrap();
        assert_eq!(again.describe().unwrap(), style.describe().unwrap());
        assert_eq!(
            again.generate(&lines, &Method::default(), None, seed, &stop).unwrap(),
            style.generate(&lines, &Method::default(), None, seed, &stop).unwrap()
        );
    }
}

fn with_toy() -> Registry {
    Registry::default().system::<Plateau>()
}

fn toy_style() -> Style {
    let dem = bundled::load("sierra").unwrap();
    let source = Source::new("sierra", &dem, Window::square(Cell::new(0, 0), 64)).unwrap();
    let (systems, settings) = (Some(vec!["plateau".to_owned()]), "plateau.steps = 3".parse().unwrap());
    let choices = Choices { systems, settings, detail: DetailChoice::Without, ..Choices::default() };
    let recipe = Recipe::new(&with_toy(), &choices, (64, 64), Seed(1)).unwrap();
    let mut steps = Vec::new();
    let mut watch = |done: &Progress<'_>| steps.push(done.step);
    let made = learn(&source, &recipe, Control::new(&mut watch)).unwrap();
    let left_out = Recipe { keep_terrain: false, ..recipe };
    let refused = learn(&source, &left_out, Control::new(&mut |_| ())).unwrap_err().to_string();
    assert!(refused.contains("left out"), "{refused}");
    assert_eq!(steps, [1, 2, 3]);
    made
}

#[test]
fn a_system_of_ones_own_is_part_of_a_style() {
    let made = toy_style();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("toy.safetensors");
    made.save(&path).unwrap();
    let read = with_toy().load(&path).unwrap();
    let terrain = read.terrain.as_deref().map(|dem| dem.heights().clone());
    let whole = bundled::load("sierra").unwrap();
    assert_eq!(terrain.as_ref(), Some(whole.heights()), "stored for the system that needs it");
    let lines = samples::load("lambda-ring").unwrap().sketch.rasterize();
    let terrain =
        |style: &Style| style.generate(&lines, &Method::default(), None, Seed(1), &Stop::new()).unwrap();
    assert_eq!(terrain(&made), terrain(&read));
    // A program without the system says so, and settings out of range are not taken.
    let unknown = Style::load(&path).unwrap_err().to_string();
    assert!(unknown.contains("plateau") && unknown.contains("allowed: gnn"), "{unknown}");
    let refused = |table: &str| with_toy().plan("plateau", &table.parse().unwrap()).unwrap_err().to_string();
    assert!(refused("steps = 0").contains("plateau.steps is 0"), "{}", refused("steps = 0"));
    assert!(refused("stpes = 1").contains("stpes"));
}

#[test]
fn a_system_of_ones_own_is_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let run = |args: &[&str]| {
        let words = ["monadnock", "-q"].iter().chain(args).map(|word| (*word).into());
        monadnock::cli::run_with(with_toy(), words.collect::<Vec<_>>().into_iter())
    };
    let (style, terrain, scores) = (at("s.safetensors"), at("t.npy"), at("s.csv"));
    let train = ["train", "sierra", "--crop", "0,0,64", "-o", &style, "--systems", "plateau,gnn"];
    let brief = ["--epochs", "2", "--set", "model.extractions=1", "--set", "plateau.steps=2"];
    assert_eq!(run(&[&train[..], &brief].concat()), ExitCode::SUCCESS);
    let unknown = ["train", "sierra", "-o", &scores, "--systems", "magic"];
    assert_eq!(run(&unknown), ExitCode::FAILURE);
    assert_eq!(run(&["generate", &style, "--sketch", "lambda-ring", "-o", &terrain]), ExitCode::SUCCESS);
    assert_eq!(heights(Path::new(&terrain)).len(), 128 * 128);
    let eval = ["eval", &style, "sierra", "--patches", "128,128", "--csv", &scores, "--systems"];
    assert_eq!(run(&[&eval[..], &["plateau,gnn,laplace"]].concat()), ExitCode::SUCCESS);
    let text = std::fs::read_to_string(&scores).unwrap();
    for name in ["plateau", "plateau+detail", "gnn", "gnn+detail", "laplace"] {
        assert!(text.contains(&format!(",{name},")), "{name} is missing in {text}");
    }
    assert_eq!(run(&[&eval[..], &["magic"]].concat()), ExitCode::FAILURE);
    let select = with_toy().select(&with_toy().load(Path::new(&style)).unwrap(), "magic");
    let listed = select.err().unwrap().to_string();
    assert!(listed.contains("all, plateau, plateau+detail, gnn, gnn+detail, nearest"), "{listed}");
}
