//! Makes the tiles in `data/` again from the evaluation areas beside the repository.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "test helpers fail by panicking"
)]

use monadnock::dem::io::{ReadOptions, SampleType, WriteOptions, read, write};
use monadnock::grid::{Cell, Window};
use std::path::Path;

/// (name, row and column of the north-west cell).
const CROPS: [(&str, usize, usize); 2] = [("sierra", 128, 256), ("grand-canyon", 0, 0)];

#[test]
#[ignore = "writes into data/; run when the tiles shall change, then put the new hashes into the manifest"]
fn make_the_tiles_again() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (name, row, col) in CROPS {
        let source = root.join("../shared/data/areas").join(name).with_extension("tif");
        if !source.exists() {
            eprintln!("skipped: no {}", source.display());
            continue;
        }
        let dem = read(&source, &ReadOptions::default()).unwrap();
        let crop = dem.crop(Window::square(Cell::new(row, col), 512)).unwrap();
        let target = root.join("data").join(name).with_extension("tif");
        let options = WriteOptions { sample_type: SampleType::Int16, ..Default::default() };
        write(&crop, &target, &options).unwrap();
        let back = read(&target, &ReadOptions::default()).unwrap();
        assert_eq!(back, crop, "the sources are whole metres, so that nothing is lost");
        println!("{}: elevation = {:?}", target.display(), crop.range());
    }
}
