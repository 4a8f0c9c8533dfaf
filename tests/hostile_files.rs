//! Files that lie, break off or make no sense: each is refused with a message that names the file, the field and the
//! value; none panics or makes the reader allocate what a header merely claims.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "test helpers fail by panicking"
)]

mod crafted;

use ::png::{BitDepth, ColorType};
use crafted::{Tiff, npy, npy_f32, png};
use monadnock::dem::io::{Nodata, ReadOptions, read};
use monadnock::dem::{CellSize, Normalization};
use std::io::Write;

fn attempt(name: &str, bytes: &[u8], options: &ReadOptions) -> monadnock::Result<monadnock::dem::Dem> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path, options)
}

#[track_caller]
fn refused_with(name: &str, bytes: &[u8], options: &ReadOptions, words: &[&str]) {
    let message = attempt(name, bytes, options).expect_err("must be refused").to_string();
    for word in [name].iter().chain(words) {
        assert!(message.contains(word), "{word:?} is not in: {message}");
    }
    assert!(message.len() < 300, "too long: {message}");
}

#[track_caller]
fn refused(name: &str, bytes: &[u8], words: &[&str]) {
    refused_with(name, bytes, &ReadOptions::default(), words);
}

fn sound() -> Tiff {
    Tiff::i16(4, 3, &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12])
}

fn ranged() -> ReadOptions {
    ReadOptions { elevation: Some(Normalization::new(0.0, 100.0).unwrap()), ..Default::default() }
}

#[test]
fn the_crafted_files_are_sound_before_they_lie() {
    assert_eq!(attempt("a.tif", &sound().bytes(), &ReadOptions::default()).unwrap().range(), (1.0, 12.0));
    let grey = png(2, 2, ColorType::Grayscale, BitDepth::Eight, &[0, 51, 102, 255]);
    assert_eq!(attempt("a.png", &grey, &ranged()).unwrap().heights().as_slice(), [0.0, 20.0, 40.0, 100.0]);
    let array = npy_f32("(2, 2)", &[1.0, 2.0, 3.0, 4.0]);
    assert_eq!(attempt("a.npy", &array, &ReadOptions::default()).unwrap().range(), (1.0, 4.0));
}

#[test]
fn empty_files_wrong_magic_unknown_formats() {
    for name in ["a.tif", "a.asc", "a.npy", "a"] {
        refused(name, b"", &["content is empty"]);
        refused(name, b"\xff\xfen\0c\0", &["text is in UTF-16", "UTF-8"]);
    }
    refused("a.tif", b"II", &["first bytes", "\"II\""]);
    refused("a.tif", b"<html><body>404</body></html>", &["first bytes", "<html>"]);
    refused("a.png", b"II\x2a\x00", &["at byte 4", "truncated"]);
    refused("a.npy", b"not numpy", &["first bytes"]);
    refused("a.xyz", b"whatever", &["format", "unknown", ".npy"]);
    refused("a.tif", b"MM\x00\x2b\x00\x09\x00\x00", &["BigTIFF"]);
    let dir = tempfile::tempdir().unwrap();
    let missing = read(&dir.path().join("none.tif"), &ReadOptions::default()).unwrap_err().to_string();
    assert!(missing.contains("none.tif"), "{missing}");
    let directory = read(dir.path(), &ReadOptions::default()).unwrap_err().to_string();
    assert!(directory.contains("directory"), "{directory}");
}

#[test]
fn every_truncation_of_a_tiff_is_refused() {
    let bytes = sound().bytes();
    for end in 0..bytes.len() {
        let message = attempt("cut.tif", &bytes[..end], &ReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains("cut.tif"), "{message}");
    }
    let packed = include_bytes!("fixtures/tiff/strips-deflate-p3-float32.tif");
    for end in (0..packed.len()).step_by(37) {
        assert!(attempt("cut.tif", &packed[..end], &ReadOptions::default()).is_err(), "{end}");
    }
}

#[test]
fn headers_that_claim_what_the_file_cannot_hold() {
    // 10^9 cells in under a kilobyte, as it is and in one strip that claims to be packed.
    let huge = sound().long(256, 31_623).long(257, 31_623);
    refused("a.tif", &huge.bytes(), &["raster size", "31623 rows x 31623 columns"]);
    let large = sound().long(256, 16_000).long(257, 16_000).long(278, 16_000);
    refused("a.tif", &large.bytes(), &["length of strip 0", "24 bytes", "512000000"]);
    refused("a.tif", &large.clone().short(259, &[8]).bytes(), &["length of strip 0", "24 bytes", "deflate"]);
    refused("a.tif", &large.clone().short(259, &[5]).bytes(), &["length of strip 0", "LZW"]);
    refused("a.tif", &large.clone().short(259, &[32773]).bytes(), &["length of strip 0", "PackBits"]);
    refused("a.tif", &sound().long(256, u32::MAX).bytes(), &["raster size", "4294967295"]);
    refused("a.tif", &sound().long(256, 0).bytes(), &["raster size", "0 columns"]);
    // One strip a row: the strip table would be the allocation.
    refused("a.tif", &large.long(278, 1).bytes(), &["StripOffsets", "1 values", "16000"]);
    let counted = sound().entry(273, crafted::LONG, u32::MAX, vec![8, 0, 0, 0, 0]);
    refused("a.tif", &counted.bytes(), &["StripOffsets", "4294967295"]);
    let mut entries = sound().bytes();
    entries.truncate(34);
    entries[32] = 0xff;
    entries[33] = 0xff;
    refused("a.tif", &entries, &["number of tags", "65535"]);
    let tiles = sound()
        .without(273)
        .without(278)
        .without(279)
        .long(322, 1 << 30)
        .long(323, 1 << 30)
        .long(324, 8)
        .long(325, 24);
    refused("a.tif", &tiles.bytes(), &["size of a strip or tile", "1073741824"]);
    let tiles = tiles.long(322, 1 << 16).long(323, 1 << 16);
    refused("a.tif", &tiles.bytes(), &["length of tile 0", "24 bytes"]);
    refused("a.tif", &tiles.long(323, 0).bytes(), &["size of a strip or tile"]);

    let mut header = png(2, 2, ColorType::Grayscale, BitDepth::Sixteen, &[0; 8]);
    refused_with("a.png", &resized(&mut header, 31_623), &ranged(), &["raster size", "31623"]);
    refused_with("a.png", &resized(&mut header, 16_000), &ranged(), &["raster size", "512000000"]);

    refused("a.npy", &npy_f32("(31623, 31623)", &[1.0]), &["raster size", "31623"]);
    refused("a.npy", &npy_f32("(16000, 16000)", &[1.0]), &["data", "4 bytes", "1024000000"]);
    refused("a.npy", &npy_f32("(18446744073709551615, 2)", &[1.0]), &["raster size"]);
    refused("a.npy", &npy_f32("(99999999999999999999999, 2)", &[1.0]), &["shape"]);

    let grid = |cols: u64, rows: u64| {
        format!("ncols {cols}\nnrows {rows}\nxllcorner 0\nyllcorner 0\ncellsize 30\n1 2 3 4\n").into_bytes()
    };
    refused("a.asc", &grid(31_623, 31_623), &["raster size", "31623"]);
    refused("a.asc", &grid(16_000, 16_000), &["ncols x nrows", "16000 x 16000"]);
}

/// The same PNG with another claim in its header, checksum corrected.
fn resized(bytes: &mut [u8], side: u32) -> Vec<u8> {
    bytes[16..20].copy_from_slice(&side.to_be_bytes());
    bytes[20..24].copy_from_slice(&side.to_be_bytes());
    let mut crc = flate2::Crc::new();
    crc.update(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.sum().to_be_bytes());
    bytes.to_vec()
}

#[test]
fn absurd_tags() {
    for (tag, value, words) in [
        (258, 12, ["BitsPerSample", "12"]),
        (258, 1, ["BitsPerSample", "1"]),
        (258, 0, ["BitsPerSample", "0"]),
        (259, 7, ["Compression", "JPEG"]),
        (259, 50000, ["Compression", "Zstandard"]),
        (259, 999, ["Compression", "999"]),
        (262, 5, ["PhotometricInterpretation", "CMYK"]),
        (262, 3, ["PhotometricInterpretation", "palette"]),
        (277, 0, ["SamplesPerPixel", "0"]),
        (277, 2000, ["SamplesPerPixel", "2000"]),
        (284, 3, ["PlanarConfiguration", "3"]),
        (317, 9, ["Predictor", "9"]),
        (317, 3, ["Predictor", "integers"]),
        (339, 6, ["SampleFormat", "6"]),
    ] {
        refused("a.tif", &sound().short(tag, &[value]).bytes(), &words);
    }
    refused("a.tif", &sound().without(256).bytes(), &["ImageWidth", "absent"]);
    refused("a.tif", &sound().without(262).bytes(), &["PhotometricInterpretation", "absent"]);
    refused("a.tif", &sound().short(256, &[3, 4]).bytes(), &["ImageWidth", "[3, 4]"]);
    refused("a.tif", &sound().doubles(256, &[3.0]).bytes(), &["ImageWidth", "type 12"]);
    refused("a.tif", &sound().long(273, 1 << 30).bytes(), &["position of strip 0", "1073741824"]);
    refused("a.tif", &sound().long(279, 1 << 30).bytes(), &["position of strip 0", "1073741824"]);
    refused("a.tif", &sound().long(278, 0).bytes(), &["size of a strip or tile", "0 rows"]);
    refused("a.tif", &sound().doubles(33550, &[30.0]).bytes(), &["ModelPixelScale", "1 numbers"]);
    refused("a.tif", &sound().doubles(33922, &[0.0; 5]).bytes(), &["ModelTiepoint", "5 numbers"]);
    refused("a.tif", &sound().doubles(34264, &[0.0; 4]).bytes(), &["ModelTransformation", "4 numbers"]);
    refused("a.tif", &sound().doubles(34264, &[f64::NAN; 16]).bytes(), &["ModelTransformation", "NaN"]);
    refused("a.tif", &sound().doubles(34264, &[0.0; 16]).bytes(), &["cell size", "0 x 0"]);
    refused("a.tif", &sound().text(42113, "none at all").bytes(), &["GDAL_NODATA", "none at all"]);
    refused("a.tif", &sound().short(34735, &[1, 1]).bytes(), &["GeoKeyDirectory"]);
    refused("a.tif", &sound().short(34735, &[1, 1, 0, 999]).bytes(), &["GeoKeyDirectory", "999 keys"]);
    let keys =
        |more: &[u32]| sound().short(34735, &[&[1, 1, 0, more.len() as u32 / 4], more].concat()).bytes();
    refused("a.tif", &keys(&[1024, 0, 1, 3]), &["GTModelTypeGeoKey", "geocentric"]);
    refused("a.tif", &keys(&[1025, 0, 1, 7]), &["GTRasterTypeGeoKey", "7"]);
    refused("a.tif", &keys(&[1024, 0, 1, 1, 3076, 0, 1, 9999]), &["ProjLinearUnitsGeoKey", "9999"]);
    refused("a.tif", &keys(&[2057, 34736, 1, 50]), &["GeoKeyDirectory", "double 50"]);
    refused("a.tif", &keys(&[1024, 0, 1, 2, 2048, 0, 1, 4326]), &["latitude", "240"]);
    let scale = r#"<Item name="SCALE" sample="0" role="scale">zero</Item>"#;
    refused("a.tif", &sound().text(42112, scale).bytes(), &["GDAL_METADATA scale", "zero"]);
    let size = r#"<Item name="MONADNOCK_CELL_SIZE">0 0 30 30</Item>"#;
    refused("a.tif", &sound().text(42112, size).bytes(), &["cell size", "0 x 0"]);
    let size = r#"<Item name="MONADNOCK_CELL_SIZE">large</Item>"#;
    refused("a.tif", &sound().text(42112, size).bytes(), &["MONADNOCK_CELL_SIZE", "large"]);
    let unit = r#"<Item name="UNITTYPE" sample="0" role="unittype">furlong</Item>"#;
    refused("a.tif", &sound().text(42112, unit).bytes(), &["vertical unit", "furlong"]);
}

#[test]
fn cell_sizes_that_are_none() {
    refused("a.tif", &sound().doubles(33550, &[0.0, 30.0, 0.0]).bytes(), &["ModelPixelScale", "0 x 30"]);
    refused("a.tif", &sound().doubles(33550, &[30.0, -30.0, 0.0]).bytes(), &["ModelPixelScale", "30 x -30"]);
    refused(
        "a.tif",
        &sound().doubles(33550, &[f64::INFINITY, 3.0, 0.0]).bytes(),
        &["ModelPixelScale", "inf"],
    );
    refused(
        "a.tif",
        &sound().doubles(33550, &[8e-4, 8e-4, 0.0]).doubles(33922, &[0.0, 0.0, 0.0, 8.0, 47.0, 0.0]).bytes(),
        &["cell size", "degrees"],
    );
    let points = [0.0, 0.0, 0.0, 8.0, 47.0, 0.0, 3.0, 0.0, 0.0, 9.0, 47.0, 0.0];
    refused("a.tif", &sound().without(33550).doubles(33922, &points).bytes(), &["2 ground control points"]);
    for (size, words) in [("0", "cellsize"), ("-30", "-30"), ("nan", "NaN"), ("inf", "inf")] {
        let grid = format!("ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize {size}\n1 2 3 4\n");
        refused("a.asc", grid.as_bytes(), &["cellsize", words]);
    }
}

#[test]
fn a_recorded_cell_size_is_for_its_own_transform() {
    for (steps, side) in [("30 30", 21.5), ("60 60", 30.0)] {
        let item = format!(r#"<Item name="MONADNOCK_CELL_SIZE">21.5 21.5 {steps}</Item>"#);
        let file = sound().text(42112, &item).bytes();
        let dem = attempt("a.tif", &file, &ReadOptions::default()).unwrap();
        assert_eq!(dem.cell_size(), CellSize::square(side).unwrap());
    }
}

#[test]
fn rasters_without_terrain() {
    refused("a.tif", &Tiff::i16(1, 1, &[7]).bytes(), &["raster size", "1 rows x 1 columns"]);
    refused("a.npy", &npy_f32("(1, 1)", &[7.0]), &["raster size", "1 rows x 1 columns"]);
    refused("a.npy", &npy_f32("(0, 5)", &[]), &["raster size", "0 rows"]);
    let one = png(1, 1, ColorType::Grayscale, BitDepth::Eight, &[7]);
    refused_with("a.png", &one, &ranged(), &["raster size", "1 rows"]);
    refused("a.asc", b"ncols 1\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 3\n7\n", &["raster size"]);
    let void = Tiff::i16(2, 2, &[-32768; 4]).text(42113, "-32768");
    refused("a.tif", &void.bytes(), &["number of valid heights", "0"]);
    refused("a.tif", &Tiff::f32(2, 2, &[f32::NAN; 4]).bytes(), &["number of valid heights", "0"]);
    refused("a.npy", &npy_f32("(2, 2)", &[f32::INFINITY; 4]), &["number of valid heights", "0"]);
    refused("N36W118.hgt", &[0x80, 0].repeat(1201 * 1201), &["number of valid heights", "0"]);
    // A TIFF of nothing but absent tiles.
    let absent = sound().long(273, 0).long(279, 0);
    refused("a.tif", &absent.bytes(), &["number of valid heights", "0"]);
}

#[test]
fn heights_that_are_none() {
    let some = Tiff::f32(2, 3, &[1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 5.0, 6.0]);
    let dem = attempt("a.tif", &some.bytes(), &ReadOptions::default()).unwrap();
    assert_eq!((dem.void_count(), dem.range()), (3, (1.0, 6.0)));
    let undeclared = Tiff::f32(2, 2, &[1.0, 2.0, -9999.0, 4.0]);
    refused("a.tif", &undeclared.bytes(), &["-9999", "nodata", "1 cell"]);
    let explained = ReadOptions { nodata: Nodata::Value(-9999.0), ..Default::default() };
    assert_eq!(attempt("a.tif", &undeclared.bytes(), &explained).unwrap().void_count(), 1);
    refused("a.tif", &Tiff::f32(2, 2, &[1.0, 2.0, 3.0, -3.4e38]).bytes(), &["row 1, column 1", "nodata"]);
    refused("a.tif", &Tiff::i16(2, 2, &[100, 200, -32768, 300]).bytes(), &["-32768", "nodata"]);
    refused("a.npy", &npy_f32("(2, 2)", &[1.0, 2.0, 1e20, 4.0]), &["row 1, column 0", "nodata"]);
    refused("a.asc", b"ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 3\n1 2 3 1e300\n", &["row 1"]);
}

#[test]
fn pictures_that_are_not_terrain() {
    let rgb = png(2, 2, ColorType::Rgb, BitDepth::Eight, &[9; 12]);
    refused_with("a.png", &rgb, &ranged(), &["colour type", "Rgb"]);
    let alpha = png(2, 2, ColorType::Rgba, BitDepth::Sixteen, &[9; 32]);
    refused_with("a.png", &alpha, &ranged(), &["colour type", "Rgba"]);
    let nothing = png(2, 2, ColorType::GrayscaleAlpha, BitDepth::Eight, &[9, 0, 8, 0, 7, 0, 6, 0]);
    refused_with("a.png", &nothing, &ranged(), &["valid heights", "0"]);
    let bits = png(2, 2, ColorType::Grayscale, BitDepth::Four, &[9; 2]);
    refused_with("a.png", &bits, &ranged(), &["bit depth", "4"]);
    let grey = png(2, 2, ColorType::Grayscale, BitDepth::Eight, &[9; 4]);
    refused("a.png", &grey, &["elevation range", "not given", "255"]);
    for end in 8..grey.len() {
        refused_with("a.png", &grey[..end], &ranged(), &["PNG data"]);
    }
    let mut flipped = grey.clone();
    flipped[45] ^= 0x40;
    refused_with("a.png", &flipped, &ranged(), &["PNG data"]);
    let rgb = Tiff::i16(2, 6, &[9; 12]).long(256, 2).short(277, &[3]).short(258, &[16; 3]).short(262, &[2]);
    refused("a.tif", &rgb.bytes(), &["number of bands", "3"]);
}

#[test]
fn numpy_headers_that_lie() {
    let four = [0; 16];
    for (header, words) in [
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2, 1), }", ["shape", "3 dimensions"]),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (4,), }", ["shape", "1 dimensions"]),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (), }", ["shape", "0 dimensions"]),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (-2, 2), }", ["shape", "-2"]),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2", ["shape", "(2, 2"]),
        ("{'descr': '<f4', 'fortran_order': Maybe, 'shape': (2, 2), }", ["fortran_order", "Maybe"]),
        ("{'descr': '<f4', 'shape': (2, 2), }", ["fortran_order", "absent"]),
        ("{'fortran_order': False, 'shape': (2, 2), }", ["descr", "absent"]),
        ("{'descr': '<c8', 'fortran_order': False, 'shape': (2, 2), }", ["dtype", "<c8"]),
        ("{'descr': '|O', 'fortran_order': False, 'shape': (2, 2), }", ["dtype", "|O"]),
        ("{'descr': '', 'fortran_order': False, 'shape': (2, 2), }", ["dtype", "\"\""]),
        ("{'descr': 'é4', 'fortran_order': False, 'shape': (2, 2), }", ["dtype", "é4"]),
        ("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (2, 2), }", ["dtype", "'x'"]),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }", ["data", "16 bytes"]),
        ("{'descr': '<f2', 'fortran_order': False, 'shape': (2, 2), }", ["data", "16 bytes"]),
        ("", ["descr", "absent"]),
    ] {
        refused("a.npy", &npy(header, &four), &words);
    }
    let sound = npy_f32("(2, 2)", &[1.0, 2.0, 3.0, 4.0]);
    for end in 6..sound.len() {
        refused("a.npy", &sound[..end], &[]);
    }
    refused("a.npy", &[sound.clone(), vec![0]].concat(), &["data", "17 bytes"]);
    let mut long = sound.clone();
    long[8..10].copy_from_slice(&u16::MAX.to_le_bytes());
    refused("a.npy", &long, &["header length", "65535"]);
    let mut version = sound.clone();
    version[6] = 9;
    refused("a.npy", &version, &["format version", "9"]);
    let mut version = sound;
    version[6] = 2;
    refused("a.npy", &version, &["header length"]);
    // Every type, order and endianness that is allowed.
    for (descr, raw) in [
        ("<i2", vec![1u8, 0, 2, 0, 3, 0, 4, 0]),
        (">i2", vec![0, 1, 0, 2, 0, 3, 0, 4]),
        ("|u1", vec![1, 2, 3, 4]),
        ("<i8", [1i64, 2, 3, 4].iter().flat_map(|v| v.to_le_bytes()).collect()),
        (">f8", [1f64, 2.0, 3.0, 4.0].iter().flat_map(|v| v.to_be_bytes()).collect()),
    ] {
        for (order, expected) in [("False", [1.0, 2.0, 3.0, 4.0]), ("True", [1.0, 3.0, 2.0, 4.0])] {
            let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': (2, 2), }}");
            let dem = attempt("a.npy", &npy(&header, &raw), &ReadOptions::default()).unwrap();
            assert_eq!(dem.heights().as_slice(), expected, "{descr} {order}");
        }
    }
}

#[test]
fn ascii_grids_that_do_not_add_up() {
    let head = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 30\n";
    let grid = |body: &str| format!("{head}{body}").into_bytes();
    refused("a.asc", &grid("11 22 33"), &["number of heights", "3", "4"]);
    refused("a.asc", &grid("1 2 3 4 5"), &["after the last height", "\"5\"", "line 6"]);
    refused("a.asc", &grid("1 2\n3 x4\n"), &["row 1, column 1 (line 7)", "x4"]);
    refused("a.asc", &[head.as_bytes(), b"1 2\n3 \xff\n"].concat(), &["row 1, column 1"]);
    refused("a.asc", &grid("1,5 2 3 4"), &["row 0, column 0", "1,5"]);
    refused("a.asc", &grid("nodata_value"), &["nodata_value", "missing"]);
    refused("a.asc", &grid("ncols 3\n1 2 3 4"), &["ncols (line 6)", "given twice"]);
    refused("a.asc", &grid("colour 3\n1 2 3 4"), &["header key", "colour"]);
    refused("a.asc", &grid("dx 3\n1 2 3 4"), &["cell size", "given twice"]);
    refused("a.asc", &grid("xllcenter 3\n1 2 3 4"), &["xllcorner", "given twice"]);
    refused("a.asc", b"ncols 2\nnrows 2\nyllcorner 0\ncellsize 30\n1 2 3 4", &["xllcorner", "absent"]);
    refused("a.asc", b"ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\n1 2 3 4", &["cellsize", "absent"]);
    refused("a.asc", b"ncols two\n", &["ncols (line 1)", "two"]);
    refused("a.asc", b"ncols 2.5\nnrows 2\n", &["ncols", "2.5"]);
    refused("a.asc", b"ncols -2\nnrows 2\n", &["ncols", "-2"]);
    refused("a.asc", b"ncols 1e30\nnrows 2\n", &["ncols", "1e30"]);
    refused("a.asc", b"ncols", &["ncols", "missing"]);
    refused("a.asc", b"NCOLS 2 NROWS 2 XLLCORNER nan YLLCORNER 0 CELLSIZE 3 1 2 3 4", &["xllcorner", "NaN"]);
    refused("a.asc", &grid("1,5 2 3 4"), &["decimal point"]);
    // An editor's byte order mark, with and without an extension that tells the format.
    let marked = [b"\xef\xbb\xbf", &grid("1 2 3 4")[..]].concat();
    for name in ["a.asc", "a.txt"] {
        assert_eq!(attempt(name, &marked, &ReadOptions::default()).unwrap().range(), (1.0, 4.0));
    }
    // The lowest float, rounded in the header as it is written by hand.
    let dem = attempt("a.asc", &grid("nodata_value -3.4e38\n-3.4028235e+38 2 3 4"), &ReadOptions::default());
    assert_eq!((dem.as_ref().unwrap().void_count(), dem.unwrap().range()), (1, (2.0, 4.0)));
    refused(
        "a.asc",
        &grid("nodata_value -3.4e38\n3.4028235e+38 2 3 4"),
        &["row 0, column 0", "3.4028235e38"],
    );
    // Sound, though odd: upper case, centres, dx and dy, nan, Windows line ends.
    let odd = "NROWS 2\r\nNCOLS 2\r\nXLLCENTER 1000\r\nYLLCENTER 2000\r\nDX 2\r\nDY 4\r\nnan 2\r\n-3e1 4\r\n";
    let dem = attempt("a.txt", odd.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!((dem.void_count(), dem.range()), (1, (-30.0, 4.0)));
    assert_eq!((dem.cell_size().x(), dem.cell_size().y()), (2.0, 4.0));
    assert_eq!(dem.georeference().unwrap().to_model(0.5, 1.5), (1000.0, 2000.0));
}

#[test]
fn hgt_tiles_of_the_wrong_size_or_name() {
    refused("N36W118.hgt", &[0; 1000], &["file size", "1000 bytes", "1201 x 1201"]);
    refused("N36W118.hgt", &[], &["file size", "0 bytes"]);
    let tile = [1, 0].repeat(1201 * 1201);
    refused("N36W118.hgt", &tile[1..], &["file size", "2884801"]);
    refused("terrain.hgt", &tile, &["file name", "N36W118"]);
    let options = ReadOptions { cell_size: Some(CellSize::square(90.0).unwrap()), ..Default::default() };
    let dem = attempt("terrain.hgt", &tile, &options).unwrap();
    assert_eq!((dem.range(), dem.georeference()), ((256.0, 256.0), None));
    refused("N99W118.hgt", &tile, &["file name"]);
}

fn gzip(content: &[u8]) -> Vec<u8> {
    let mut packing = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packing.write_all(content).unwrap();
    packing.finish().unwrap()
}

#[test]
fn files_packed_with_gzip() {
    let plain = |name: &str, bytes: &[u8]| attempt(name, bytes, &ReadOptions::default()).unwrap();
    let tile: Vec<u8> = (0..1201u32 * 1201).flat_map(|i| ((i % 3000) as i16).to_be_bytes()).collect();
    assert_eq!(plain("N36W118.hgt.gz", &gzip(&tile)), plain("N36W118.hgt", &tile));
    let tiff = sound().bytes();
    assert_eq!(plain("a.tif.GZ", &gzip(&tiff)), plain("a.tif", &tiff));
    // Several members are one content.
    let halves = [gzip(&tiff[..50]), gzip(&tiff[50..])].concat();
    assert_eq!(plain("a.tif.gz", &halves), plain("a.tif", &tiff));

    let packed = gzip(&tile);
    refused("N36W118.hgt.gz", &packed[..packed.len() / 2], &["gzip stream", "truncated"]);
    refused("N36W118.hgt.gz", &tile, &["gzip stream"]);
    refused("a.tif.gz", &[], &["a.tif.gz"]);
    refused("a.xyz.gz", &gzip(b"hello"), &["format", "hello"]);
    // An .hgt may begin like gzip: its heights are no packing.
    let high = [0x1f, 0x8b].repeat(1201 * 1201);
    assert_eq!(plain("N36W118.hgt", &high).range(), (8075.0, 8075.0));
}

/// Runs the tests above again in a process that is not allowed more than 600 MB of address space: an allocation of
/// what the headers claim (1 to 16 GB) would end it.
#[cfg(target_os = "linux")]
#[test]
fn no_header_makes_the_reader_allocate() {
    let me = std::env::current_exe().unwrap();
    for test in ["headers_that_claim_what_the_file_cannot_hold", "numpy_headers_that_lie", "absurd_tags"] {
        let script = format!("ulimit -v 600000; exec \"$0\" --exact {test} --test-threads 1");
        let run = std::process::Command::new("sh").arg("-c").arg(script).arg(&me).output().unwrap();
        let said = String::from_utf8_lossy(&run.stdout);
        assert!(run.status.success() && said.contains("1 passed"), "{said}{:?}", run.stderr);
    }
}
