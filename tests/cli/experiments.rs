//! `experiment` and `data` from the outside: run, list, report, and terrain of one's own.

use super::{run, temporary};
use std::fs;
use std::path::Path;

/// Two systems beside an interpolator on two patches with two seeds, in a few seconds.
const SMALL: &str = include_str!("../fixtures/small-experiment.toml");

fn answer(folder: &Path, args: &[&str]) -> (i32, String, String) {
    let answer = run(folder, args);
    (answer.code, answer.out, answer.err)
}

#[test]
fn the_program_runs_lists_and_reports_experiments() {
    let folder = temporary();
    let at = folder.path();
    for kind in ["full", "quick"] {
        fs::create_dir_all(at.join("experiments").join(kind)).unwrap();
    }
    let full = SMALL.replace("seeds = [1, 2]", "seeds = [1, 2, 3]").replace("epochs = 2", "epochs = 200");
    let quick = SMALL.replace("seeds = [1, 2]", "seeds = [1]");
    fs::write(at.join("experiments/full/small.toml"), full).unwrap();
    fs::write(at.join("experiments/quick/small.toml"), quick).unwrap();
    let (code, out, err) = answer(at, &["experiment", "run", "experiments/full/small.toml", "--quick"]);
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("6 rows, 0 failed") && out.contains("kept    one: ssim"), "{out}");
    let record = at.join("experiments/records/quick/small");
    let page = fs::read_to_string(record.join("report.html")).unwrap();
    for words in [
        "Does it run?",
        "SSIM",
        "PSNR, dB",
        "patches x 1 seeds",
        "Kept",
        "data:image/png",
        "<svg",
        "cores",
        "epochs = 2",
    ] {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("http") && !page.contains(at.to_str().unwrap()));
    assert!(fs::read_to_string(record.join("plots/ssim-dense.svg")).unwrap().contains("<svg"));
    let (code, out, _) = answer(at, &["experiment", "list"]);
    assert_eq!(code, 0);
    assert!(out.contains("not run") && out.contains("6 rows, 1 of 1 bounds kept"), "{out}");

    fs::write(at.join("README.md"), "<!-- experiment small -->\n<!-- /experiment small -->\n").unwrap();
    fs::remove_file(record.join("report.html")).unwrap();
    let file = "experiments/quick/small.toml";
    let (code, out, err) = answer(at, &["experiment", "report", file, "--splice", "README.md"]);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("tables written") && record.join("report.html").is_file(), "{out}");
    assert!(fs::read_to_string(at.join("README.md")).unwrap().contains("| sierra |"));

    // A bound that is broken is exit code 1, and the record is there all the same.
    let hopeless = SMALL.replace("seeds = [1, 2]", "seeds = [1]").replace("min = 0.5", "min = 0.9999");
    fs::write(at.join("hopeless.toml"), hopeless).unwrap();
    let (code, out, err) = answer(at, &["experiment", "run", "hopeless.toml"]);
    assert_eq!(code, 1);
    assert!(out.contains("BROKEN") && err.contains("hopeless.toml: broken bounds is 1"), "{out}{err}");
    assert!(at.join("records/hopeless/report.html").is_file());
    let fails = |args: &[&str], words: &[&str]| {
        let (code, _, err) = answer(at, args);
        assert_eq!(code, 1, "{args:?}: {err}");
        words.iter().for_each(|word| assert!(err.contains(word), "{word:?} is missing in: {err}"));
    };
    fails(&["experiment", "run", "hopeless.toml", "--quick"], &["--quick", "no twin"]);
    fails(&["experiment", "run", "gone.toml"], &["gone.toml"]);
    fails(&["experiment", "run", "records/hopeless/resolved.toml"], &["--out"]);
    fails(&["experiment", "run", "hopeless.toml", "--data", "nowhere"], &["nowhere", "manifest.toml"]);
    fails(&["experiment", "report", "experiments/full/small.toml"], &["small", "resolved.toml"]);
    fails(&["experiment", "report", "all"], &["experiments/full", "records"]);
    fails(&["experiment", "list", "records"], &["records"]);
}

#[test]
fn terrain_of_ones_own_joins_by_a_manifest() {
    let folder = temporary();
    let at = folder.path();
    fs::create_dir(at.join("mine")).unwrap();
    fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("data/grand-canyon.tif"), at.join("mine/canyon.tif"))
        .unwrap();
    let add = ["data", "add", "mine/canyon.tif", "--what", "a canyon", "--licence", "free"];
    let (code, out, err) = answer(at, &add);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("name = \"canyon\"") && out.contains("elevation = [479.0, 2347.0]"), "{out}");
    let (code, _, err) = answer(at, &add);
    assert!(code == 1 && err.contains("canyon") && err.contains("mine/manifest.toml"), "{err}");
    let (code, out, _) = answer(at, &["data", "list", "mine/manifest.toml"]);
    assert!(code == 0 && out.contains("512 x 512 cells of 61.7 m") && out.contains("a canyon"), "{out}");
    let small = SMALL.replace("\"sierra\"", "\"canyon\"").replace("seeds = [1, 2]", "seeds = [1]");
    fs::write(at.join("own.toml"), small).unwrap();
    let (code, _, err) = answer(at, &["experiment", "run", "own.toml"]);
    assert!(code == 1 && err.contains("canyon") && err.contains("--data"), "{err}");
    let (code, out, err) = answer(at, &["experiment", "run", "own.toml", "--data", "mine"]);
    assert_eq!(code, 0, "{out}{err}");
    // What was assumed of an area is said, once.
    assert_eq!(
        err.matches("canyon.tif: no coordinate system is stated: its unit is taken for metres").count(),
        1,
        "{err}"
    );
    let mut bytes = fs::read(at.join("mine/canyon.tif")).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(at.join("mine/canyon.tif"), bytes).unwrap();
    let (code, _, err) = answer(at, &["data", "list", "mine/manifest.toml"]);
    assert!(code == 1 && err.contains("sha256") && err.contains("canyon.tif"), "{err}");
}
