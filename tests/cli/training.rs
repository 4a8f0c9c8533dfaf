//! `train`, and what is done with its styles.

use super::{done, fails, run, temporary};
use serde_json::Value;
use std::path::Path;

#[test]
fn options_overrule_a_configuration_file() {
    let folder = temporary();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("plain.toml", "min_order = 3\nmin_accumulation = 30\n");
    write("section.toml", "[extraction]\nmin_order = 3\nmin_accumulation = 30\n[model]\nepochs = 5\n");
    let extract = |more: &[&str]| {
        done(folder.path(), &[&["extract", "sierra", "--crop", "0,0,128", "-o", "s.geojson"], more].concat());
        std::fs::read_to_string(folder.path().join("s.geojson")).unwrap()
    };
    let by_options = extract(&["--min-order", "3", "--accumulation", "30"]);
    assert_eq!(extract(&["--config", "plain.toml"]), by_options);
    assert_eq!(extract(&["--config", "section.toml"]), by_options);
    assert_ne!(extract(&["--config", "plain.toml", "--min-order", "2"]), by_options);

    write("typo.toml", "min_ordr = 3\n");
    let extract = ["extract", "sierra", "-o", "x.geojson", "--config"];
    fails(folder.path(), &[&extract[..], &["typo.toml"]].concat(), 1, &["typo.toml", "min_ordr"]);
    write("range.toml", "min_order = 99\n");
    fails(folder.path(), &[&extract[..], &["range.toml"]].concat(), 1, &["range.toml", "99", "1 to 30"]);
    fails(folder.path(), &[&extract[..], &["gone.toml"]].concat(), 1, &["gone.toml"]);
}

#[test]
fn a_style_is_trained_used_and_scored() {
    let folder = temporary();
    let at = folder.path();
    let train = ["train", "sierra", "-o", "s.safetensors", "--crop", "128,0,128", "--epochs", "3"];
    let settings = ["--set", "model.extractions=2", "--set", "model.splits=1", "--no-detail"];
    done(at, &[&train[..], &settings[..]].concat());
    let info: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    assert_eq!(info["training"]["epochs"], 3);
    assert!(info["training"]["ssim"].as_f64().unwrap() > 0.5);
    assert_eq!(info["exemplar"]["row"], 128);

    done(
        at,
        &["generate", "s.safetensors", "--sketch", "lambda-ring", "-o", "a.tif", "--elevation", "100,900"],
    );
    done(
        at,
        &["generate", "s.safetensors", "--sketch", "lambda-ring", "-o", "b.tif", "--elevation", "100,900"],
    );
    assert_eq!(std::fs::read(at.join("a.tif")).unwrap(), std::fs::read(at.join("b.tif")).unwrap());
    done(
        at,
        &["generate", "s.safetensors", "--sketch", "single-stroke", "-o", "c.tif", "--random-sketches", "12"],
    );

    sources_are_written(at);

    let eval = ["eval", "s.safetensors", "sierra", "--systems", "gnn,laplace,synthesis"];
    let files = ["--patches", "0,0;128,0;256,256", "--csv", "s.csv", "--json", "s.json", "--save", "rebuilt"];
    let answer = done(at, &[&eval[..], &files[..]].concat());
    assert!(answer.out.contains("1 patch overlaps the exemplar"), "{}", answer.out);
    let rows = std::fs::read_to_string(at.join("s.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + 2 * 3, "{rows}");
    let json: Value = serde_json::from_slice(&std::fs::read(at.join("s.json")).unwrap()).unwrap();
    assert_eq!(json["systems"].as_array().unwrap().len(), 3);
    // What is laid from the exemplar is audited by what it says itself.
    for kind in json["kinds"].as_array().unwrap() {
        let (share, repeats) = (kind["verbatim_share"].as_f64(), kind["most_uses"].as_f64());
        match kind["system"].as_str().unwrap() {
            "synthesis" => assert!(share.unwrap() < 0.9 && repeats.unwrap() >= 1.0, "{kind}"),
            _ => assert_eq!((share, repeats), (None, None), "{kind}"),
        }
    }
    for file in ["truth.tif", "sketch.geojson", "gnn.tif", "laplace.tif"] {
        assert!(at.join("rebuilt/0_0").join(file).exists(), "{file}");
    }

    fails(at, &["train", "sierra", "-o", "x.safetensors", "--crop", "0,0,16"], 1, &["16x16", "32"]);
    fails(at, &["train", "sierra", "-o", "x.safetensors", "--set", "model.width=33"], 1, &["width", "33"]);
    fails(at, &["train", "sierra", "-o", "x.safetensors", "--set", "model.widht=32"], 1, &["widht"]);
    fails(at, &["eval", "s.safetensors", "sierra", "--systems", "magic"], 1, &["magic", "natural-neighbour"]);
    fails(at, &["eval", "s.safetensors", "sierra", "--patches", "500,0"], 1, &["500", "512"]);
    fails(
        at,
        &["generate", "s.safetensors", "--sketch", "none.geojson", "-o", "d.tif"],
        1,
        &["none.geojson"],
    );
    fails(at, &["generate", "s.safetensors", "--sketch", "lambda-ring", "-o", "d.xyz"], 1, &["d.xyz"]);
    std::fs::write(at.join("torn.safetensors"), b"torn").unwrap();
    fails(
        at,
        &["generate", "torn.safetensors", "--sketch", "lambda-ring", "-o", "d.tif"],
        1,
        &["torn.safetensors"],
    );
}

/// `--sources` of the style in `at`, whose terrain is all of sierra.
fn sources_are_written(at: &Path) {
    fn generate<'a>(more: &[&'a str]) -> Vec<&'a str> {
        [&["generate", "s.safetensors", "--sketch", "single-stroke"], more].concat()
    }
    done(at, &generate(&["-o", "d.tif", "--sources", "d.npz"]));
    let mut npz = ndarray_npy::NpzReader::new(std::fs::File::open(at.join("d.npz")).unwrap()).unwrap();
    let mut read = |name: &str| -> ndarray::Array2<i32> { npz.by_name(name).unwrap() };
    let [row, col, symmetry, stroke] = ["row", "col", "symmetry", "stroke"].map(&mut read);
    let mut strokes = 0;
    for (at, &stroke) in stroke.indexed_iter() {
        let place = [row[at], col[at], symmetry[at]];
        if stroke == 1 {
            strokes += 1;
            assert_eq!(place, [-1; 3], "{at:?}");
        } else {
            assert!(
                stroke == 0 && (0..512).contains(&place[0]) && (0..512).contains(&place[1]),
                "{at:?} {place:?}"
            );
            assert!((0..8).contains(&place[2]), "{at:?} {place:?}");
        }
    }
    assert!(strokes > 20, "{strokes} cells of the stroke");
    // The same terrain as without, and a picture of it for every variant.
    done(at, &generate(&["-o", "e.tif"]));
    assert_eq!(std::fs::read(at.join("d.tif")).unwrap(), std::fs::read(at.join("e.tif")).unwrap());
    done(at, &generate(&["-o", "f.tif", "--variants", "2", "--sources", "f.png"]));
    let [one, two] = ["f.png", "f-2.png"].map(|name| std::fs::read(at.join(name)).unwrap());
    assert_ne!(one, two);
    // Before any work, and nothing is written.
    for method in ["network", "landscape"] {
        let args = generate(&["-o", "g.tif", "--sources", "g.npz", "--method", method]);
        fails(at, &args, 1, &["s.safetensors", "sources", "--method synthesis"]);
        assert!(!at.join("g.tif").exists() && !at.join("g.npz").exists());
    }
}

#[test]
fn info_of_a_style_and_its_json() {
    let folder = temporary();
    let at = folder.path();
    done(
        at,
        &["train", "sierra", "-o", "s.safetensors", "--crop", "0,0,64", "--epochs", "3", "--no-detail", "-q"],
    );
    let text = done(at, &["info", "s.safetensors"]).out;
    for label in [
        "epochs",
        "seconds",
        "seconds per epoch",
        "SSIM",
        "PSNR",
        "l_gt",
        "last losses",
        "exemplar",
        "parameters",
    ] {
        assert!(text.contains(label), "{label:?} is missing in: {text}");
    }
    assert!(!text.contains("history"), "{text}");
    assert!(text.lines().count() < 75 && text.lines().all(|line| line.len() < 200), "{text}");
    let json: Value = serde_json::from_str(&done(at, &["info", "s.safetensors", "--json"]).out).unwrap();
    let history = json["training"]["history"].as_array().unwrap();
    assert_eq!(history.len(), 3);
    // The last losses are those of the last epoch.
    let last = history[2]["losses"]["ground_truth"].as_f64().unwrap();
    assert!(text.contains(&format!("{last:.2e}")), "{last:.2e} is missing in: {text}");
}

#[test]
fn a_diverged_training_keeps_its_last_good_state() {
    let folder = temporary();
    let at = folder.path();
    let common = ["train", "sierra", "-o", "s.safetensors", "--crop", "192,192,64", "--preset", "paper"];
    let settings = ["--set", "model.normalize=false", "--epochs", "200", "--checkpoint-every", "0s"];
    let train = |more: &[&'static str]| run(at, &[&common[..], &settings[..], more].concat());
    let wild = train(&["--set", "model.learning_rate=1"]);
    assert_eq!(wild.code, 1, "{}{}", wild.out, wild.err);
    for words in [
        "error: training diverged at epoch",
        "lower learning rate",
        "s.safetensors.gnn-checkpoint",
        "--resume",
    ] {
        assert!(wild.err.contains(words), "{words:?} is missing in: {}", wild.err);
    }
    assert!(!at.join("s.safetensors").exists() && at.join("s.safetensors.gnn-checkpoint").exists());

    // What was kept is good: the training goes on from there.
    let tame = train(&["--set", "model.learning_rate=1e-3", "--resume"]);
    assert_eq!(tame.code, 0, "{}{}", tame.out, tame.err);
    assert!(at.join("s.safetensors").exists() && !at.join("s.safetensors.gnn-checkpoint").exists());
}
