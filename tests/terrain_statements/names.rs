//! Names of tiles, and rasters in archives.

use crate::{DEFAULT, FEET_PRJ, US_FOOT, asc, case, cells, read_files, refused, told};
use monadnock::dem::CellSize;
use monadnock::dem::io::{ReadOptions, read_described};
use std::io::Write;

fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in files {
        archive.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn the_whole_name_of_an_srtm_tile_counts() {
    if let Some(path) = case("N45W074T86.hgt.gz") {
        refused(read_described(&path, &DEFAULT), &["N45W074T86", "\"T86\"", "--cell-size"]);
        let given = ReadOptions { cell_size: CellSize::square(10.0).ok(), ..DEFAULT };
        let (dem, said) = read_described(&path, &given).unwrap();
        assert_eq!((dem.cell_size().x(), dem.georeference()), (10.0, None));
        told(&said, &["no place"]);
    }
    let tile: Vec<u8> = (0..1201 * 1201u32).flat_map(|i| ((i % 1201) as i16).to_be_bytes()).collect();
    for name in ["n37w118.hgt", "N37W118.SRTMGL3.hgt", "NASADEM_HGT_n37w118.hgt"] {
        let (dem, _) = read_files(&[(name, &tile)], &DEFAULT).unwrap();
        let (x, y) = dem.georeference().unwrap().to_model(0.5, 0.5);
        assert!((x + 118.0).abs() < 1e-9 && (y - 38.0).abs() < 1e-9, "{name}: {x} {y}");
    }
    // A name that is no corner is not said to have something after it.
    for name in ["ASTGTMV003_N47E010_dem.hgt", "copy of N47E010.hgt", "47N010E.hgt"] {
        refused(read_files(&[(name, &tile)], &DEFAULT), &[name, "it names no corner", "--cell-size"]);
    }
    for name in ["N37W118_part2.hgt", "N37W118b.hgt", "tile.hgt", "N37W118 (1).hgt"] {
        refused(read_files(&[(name, &tile)], &DEFAULT), &[name, "N36W118.hgt", "--cell-size"]);
    }
}

#[test]
fn a_zip_with_one_raster_is_read() {
    let tile: Vec<u8> = (0..1201 * 1201u32).flat_map(|i| ((i % 1201) as i16).to_be_bytes()).collect();
    let nasadem = zipped(&[("n37w118.hgt", &tile), ("n37w118.num", &[1; 9]), ("n37w118.swb", &[0; 9])]);
    let (dem, said) = read_files(&[("NASADEM_HGT_n37w118.zip", &nasadem)], &DEFAULT).unwrap();
    assert_eq!((dem.shape(), said.packing.as_str()), ((1201, 1201), "zip"));
    assert_eq!(dem.georeference().unwrap().epsg, Some(4326));
    let ascii = asc("xllcorner 6500000\nyllcorner 1900000\ncellsize 100");
    let folder = zipped(&[("dem/readme.txt", b"hello"), ("dem/a.asc", &ascii), ("dem/a.prj", FEET_PRJ)]);
    let (dem, said) = read_files(&[("terrain.zip", &folder)], &DEFAULT).unwrap();
    cells(&dem, 100.0 * US_FOOT, 100.0 * US_FOOT);
    told(&said, &["a.prj"]);
    let two = zipped(&[("a.asc", &ascii), ("b.asc", &ascii)]);
    refused(read_files(&[("two.zip", &two)], &DEFAULT), &["two.zip", "a.asc, b.asc", "allowed: one"]);
    refused(read_files(&[("none.zip", &zipped(&[("a.txt", b"")]))], &DEFAULT), &["none.zip", "none"]);
    refused(read_files(&[("torn.zip", &folder[..folder.len() / 2])], &DEFAULT), &["torn.zip", "zip archive"]);
    refused(
        read_files(&[("bad.zip", &zipped(&[("b.asc", b"ncols x")]))], &DEFAULT),
        &["bad.zip", "b.asc", "ncols"],
    );
    // What other systems leave in archives.
    let mac = zipped(&[
        ("__MACOSX/dem/._a.asc", b"x"),
        ("__MACOSX/dem/a.asc", b"x"),
        ("dem/.DS_Store", b"x"),
        ("dem/a.asc", &ascii),
        ("dem/a.prj", FEET_PRJ),
    ]);
    cells(&read_files(&[("mac.zip", &mac)], &DEFAULT).unwrap().0, 100.0 * US_FOOT, 100.0 * US_FOOT);
}
