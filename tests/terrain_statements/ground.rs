//! What a cell is on the ground: linear units, stretched projections, degrees.

use crate::crafted::Tiff;
use crate::{DEFAULT, US_FOOT, asc, at, case, cells, keys, projected, read_files, refused, tiff, told};
use monadnock::dem::CellSize;
use monadnock::dem::io::{CellSizeSource, ReadOptions, WriteOptions, read_described, write};

#[test]
fn linear_units_follow_from_codes() {
    if let Some(path) = case("clarke-foot.tif") {
        let (dem, _) = read_described(&path, &DEFAULT).unwrap();
        cells(&dem, 30.48, 30.48);
        let given = ReadOptions { cell_size: CellSize::square(30.0).ok(), ..DEFAULT };
        assert_eq!(read_described(&path, &given).unwrap().0.cell_size().x(), 30.0);
    }
    // Of the code alone: US feet, international feet, links.
    for (code, metres, x, y) in
        [(2227, US_FOOT, 6.5e6, 1.9e6), (2223, 0.3048, 7e5, 8e5), (3167, 20.116_756, 40_000.0, 22_000.0)]
    {
        let tiff = at(projected(code), 30.0, x, y);
        let (dem, said) = read_files(&[("a.tif", &tiff.bytes())], &DEFAULT).unwrap();
        assert!((dem.cell_size().x() / (30.0 * metres) - 1.0).abs() < 0.011, "{code}: {:?}", dem.cell_size());
        assert_eq!(said.cell_size_source, CellSizeSource::File);
        assert_eq!(dem.georeference().unwrap().epsg, Some(code));
    }
    // Of a key: a chain; one that defines its own; one that contradicts the code; one beside a code that nobody knows.
    let unit = |code: u32, unit: u32| {
        keys(at(tiff(), 30.0, 5e5, 4.1e6), &[(1024, 1), (1025, 1), (3072, code), (3076, unit)])
    };
    let side = |tiff: &Tiff| {
        read_files(&[("a.tif", &tiff.bytes())], &DEFAULT).map(|(dem, said)| (dem.cell_size().x(), said))
    };
    let (link, _) = side(&unit(32_767, 9098)).unwrap();
    assert!((link / (30.0 * 0.201_168) - 1.0).abs() < 1e-9, "{link}");
    let (feet, said) = side(&unit(32_611, 9002)).unwrap();
    assert!((feet / 9.144 - 1.0).abs() < 0.01, "{feet}");
    told(&said, &["EPSG:32611", "metre", "foot", "the file counts"]);
    let (feet, said) = side(&unit(29_999, 9003)).unwrap();
    assert!((feet / (30.0 * US_FOOT) - 1.0).abs() < 1e-9, "{feet}");
    told(&said, &["EPSG:29999", "US survey foot"]);
    let own = unit(32_767, 32_767).doubles(34736, &[2.5]);
    let own = own.short(
        34735,
        &[1, 1, 0, 5, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 32767, 3076, 0, 1, 32767, 3077, 34736, 1, 0],
    );
    assert_eq!(side(&own).unwrap().0, 75.0);
    refused(
        read_files(&[("a.tif", &unit(32_767, 9101).bytes())], &DEFAULT),
        &["ProjLinearUnitsGeoKey", "9101", "--cell-size"],
    );
    let given = ReadOptions { cell_size: CellSize::square(7.0).ok(), ..DEFAULT };
    let (dem, said) = read_files(&[("a.tif", &unit(32_767, 9101).bytes())], &given).unwrap();
    assert_eq!(dem.cell_size().x(), 7.0);
    told(&said, &["ProjLinearUnitsGeoKey is 9101", "not used"]);
    // An unknown code: metres are assumed, and every command says so.
    let (side, said) = side(&projected(29_999)).unwrap();
    assert_eq!((side, said.cell_size_source), (30.0, CellSizeSource::AssumedUnit));
    told(&said, &["EPSG:29999", "taken for metres", "--cell-size"]);
}

#[test]
fn stretched_maps_are_measured_on_the_ground() {
    for name in ["mercator-3395.tif", "mercator-user.tif"] {
        let Some(path) = case(name) else { continue };
        let (dem, said) = read_described(&path, &DEFAULT).unwrap();
        let side = dem.cell_size().x();
        assert!((29.9..30.2).contains(&side), "{name}: {side}");
        told(&said, &["60 m", "on the ground"]);
    }
    let ground = |code: u32, side: f64, x: f64, y: f64| {
        let tiff = keys(at(tiff(), side, x, y), &[(1024, 1), (1025, 1), (3072, code)]);
        let (dem, said) = read_files(&[("a.tif", &tiff.bytes())], &DEFAULT).unwrap();
        (dem, said)
    };
    // At 60 N: Esri's code of world mercator, equirectangular, web mercator; near the pole nothing is stretched.
    cells(&ground(54_004, 60.0, 1e6, 8_362_698.5).0, 30.08, 30.08);
    let (plate, said) = ground(4087, 60.0, 1_113_195.0, 6_654_073.0);
    cells(&plate, 30.08, 60.0);
    told(&said, &["60 m", "30.08 m west-east, 60 m north-south on the ground"]);
    cells(&ground(3857, 60.0, 1e6, 8_399_738.0).0, 30.0, 30.0);
    let (polar, said) = ground(3413, 100.0, 0.0, -2_000_000.0);
    cells(&polar, 100.0, 100.0);
    assert!(said.notes.is_empty(), "{said:?}");
    cells(&ground(3413, 100.0, 0.0, 0.0).0, 103.1, 103.1);
    // A mercator that only its keys describe, true at 60 N.
    let user = at(tiff(), 60.0, 1e6, 4_190_000.0).doubles(34736, &[0.0, 60.0, 0.0, 0.0]);
    let user = user.short(
        34735,
        &[
            1, 1, 0, 9, 1024, 0, 1, 1, 1025, 0, 1, 1, 2048, 0, 1, 4326, 3072, 0, 1, 32767, 3075, 0, 1, 7,
            3076, 0, 1, 9001, 3078, 34736, 1, 1, 3080, 34736, 1, 0, 3082, 34736, 1, 2,
        ],
    );
    let (dem, said) = read_files(&[("a.tif", &user.bytes())], &DEFAULT).unwrap();
    cells(&dem, 60.0, 60.0);
    assert!(dem.georeference().unwrap().definition.is_some() && said.notes.is_empty(), "{said:?}");
    // Places that the projection does not have, or far beyond what it can show.
    let beyond = keys(at(tiff(), 30.0, 5e5, 4.1e6), &[(1024, 1), (1025, 1), (3072, 3167)]).bytes();
    refused(read_files(&[("a.tif", &beyond)], &DEFAULT), &["a.tif", "EPSG:3167", "--cell-size"]);
    let nowhere = keys(at(tiff(), 60.0, 9e9, 9e9), &[(1024, 1), (1025, 1), (3072, 3035)]).bytes();
    refused(read_files(&[("a.tif", &nowhere)], &DEFAULT), &["a.tif", "EPSG:3035", "--cell-size"]);
}

#[test]
fn degrees_are_not_taken_for_metres() {
    if let Some(path) = case("degrees-0.05.asc") {
        refused(read_described(&path, &DEFAULT), &["degrees-0.05.asc", "degrees", "--cell-size"]);
    }
    for (west, south, side) in [
        (-118.0, 36.0, 0.000_278),
        (8.0, 46.0, 0.0083),
        (-118.5, 36.5, 0.25),
        (-20.0, 30.0, 1.0),
        (170.0, -50.0, 2.5),
    ] {
        let grid = asc(&format!("xllcorner {west}\nyllcorner {south}\ncellsize {side}"));
        refused(
            read_files(&[("a.asc", &grid)], &DEFAULT),
            &["a.asc", "degrees", &side.to_string(), "--cell-size"],
        );
        let tif = at(tiff(), side, west, south + 12.0 * side).bytes();
        refused(read_files(&[("a.tif", &tif)], &DEFAULT), &["a.tif", "degrees", "--cell-size"]);
        let given = ReadOptions { cell_size: CellSize::square(30.0).ok(), ..DEFAULT };
        for (name, bytes) in [("a.asc", &grid), ("a.tif", &tif)] {
            assert_eq!(read_files(&[(name, bytes)], &given).unwrap().0.cell_size().x(), 30.0);
        }
    }
    // Degrees for the size of cells at a place in metres; small cells that are metres.
    let mixed = asc("xllcorner 500000\nyllcorner 4100000\ncellsize 0.000833");
    refused(read_files(&[("a.asc", &mixed)], &DEFAULT), &["degrees", "--cell-size"]);
    for header in
        ["xllcorner 500000\nyllcorner 4100000\ncellsize 0.5", "xllcorner 0\nyllcorner 0\ncellsize 1"]
    {
        let (_, said) = read_files(&[("a.asc", &asc(header))], &DEFAULT).unwrap();
        told(&said, &["no coordinate system is stated", "metres"]);
    }
}

#[test]
fn a_given_cell_size_overrules_what_does_not_parse() {
    let given = ReadOptions { cell_size: CellSize::new(20.0, 25.0).ok(), ..DEFAULT };
    let skewed = [30.0, 10.0, 0.0, 0.0, 0.0, -30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    for (what, bytes) in [
        ("ModelPixelScale", tiff().doubles(33550, &[0.0, -1.0, 0.0]).bytes()),
        ("ModelTiepoint", tiff().doubles(33922, &[0.0, 1.0]).bytes()),
        ("GTModelTypeGeoKey", keys(tiff(), &[(1024, 3)]).bytes()),
        ("GTRasterTypeGeoKey", keys(tiff(), &[(1025, 7)]).bytes()),
        ("GeoKeyDirectory", tiff().short(34735, &[1, 1, 0, 9]).bytes()),
        ("GeogAngularUnitsGeoKey", keys(tiff(), &[(1024, 2), (2048, 4326), (2054, 9001)]).bytes()),
        ("MONADNOCK_CELL_SIZE", tiff().text(42112, r#"<Item name="MONADNOCK_CELL_SIZE">x</Item>"#).bytes()),
    ] {
        refused(read_files(&[("a.tif", &bytes)], &DEFAULT), &["a.tif", what]);
        let (dem, said) = read_files(&[("a.tif", &bytes)], &given).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((dem.cell_size().x(), dem.cell_size().y()), (20.0, 25.0));
        told(&said, &[what, "not used, as --cell-size is given"]);
    }
    let skewed = tiff().doubles(34264, &skewed).bytes();
    refused(read_files(&[("a.tif", &skewed)], &DEFAULT), &["skewed", "--cell-size"]);
    assert_eq!(read_files(&[("a.tif", &skewed)], &given).unwrap().0.cell_size().x(), 20.0);
    for header in
        ["xllcorner west\nyllcorner 0\ncellsize 30", "cellsize 30", "xllcorner 0\nyllcorner 0\ncellsize 0"]
    {
        refused(read_files(&[("a.asc", &asc(header))], &DEFAULT), &["a.asc"]);
        let (dem, _) = read_files(&[("a.asc", &asc(header))], &given).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((dem.cell_size().y(), dem.georeference()), (25.0, None));
    }
}

/// Esri's WKT of a projected system on WGS 84.
fn esri(projection: &str, parameters: &[(&str, f64)]) -> String {
    let parameters: Vec<String> =
        parameters.iter().map(|(name, value)| format!("PARAMETER[\"{name}\",{value:?}],")).collect();
    format!(
        "PROJCS[\"x\",GEOGCS[\"GCS_WGS_1984\",DATUM[\"D_WGS_1984\",SPHEROID[\"WGS_1984\",6378137.0,298.257223563]],\
         PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"{projection}\"],{}UNIT[\"Meter\",1.0]]",
        parameters.concat()
    )
}

/// The words of Esri and of GDAL for projections, and projections that the first library does not have. Ground against map by
/// PROJ 9.5 (geodesics of a kilometre through the middle).
#[test]
fn projections_of_any_library_are_measured() {
    let albers = [
        ("Central_Meridian", 132.0),
        ("Standard_Parallel_1", -18.0),
        ("Standard_Parallel_2", -36.0),
        ("Latitude_Of_Origin", 0.0),
    ];
    // As GDAL writes it: its words alone would be those of an ellipsoidal mercator.
    let web = r#"PROJCS["WGS 84 / Pseudo-Mercator",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],
        PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Mercator_1SP"],PARAMETER["central_meridian",0],
        PARAMETER["scale_factor",1],PARAMETER["false_easting",0],PARAMETER["false_northing",0],UNIT["metre",1],
        EXTENSION["PROJ4","+proj=merc +a=6378137 +b=6378137 +lat_ts=0 +lon_0=0 +x_0=0 +y_0=0 +k=1 +units=m +nadgrids=@null +wktext +no_defs"],
        AUTHORITY["EPSG","3857"]]"#;
    let lambert = r#"PROJCRS["ETRS89-extended / LCC Europe",BASEGEOGCRS["ETRS89",DATUM["European Terrestrial Reference System 1989",
        ELLIPSOID["GRS 1980",6378137,298.257222101,LENGTHUNIT["metre",1]]],PRIMEM["Greenwich",0,ANGLEUNIT["degree",0.0174532925199433]]],
        CONVERSION["Europe",METHOD["Lambert Conic Conformal (2SP)",ID["EPSG",9802]],
        PARAMETER["Latitude of false origin",52,ANGLEUNIT["degree",0.0174532925199433]],
        PARAMETER["Longitude of false origin",10,ANGLEUNIT["degree",0.0174532925199433]],
        PARAMETER["Latitude of 1st standard parallel",35,ANGLEUNIT["degree",0.0174532925199433]],
        PARAMETER["Latitude of 2nd standard parallel",65,ANGLEUNIT["degree",0.0174532925199433]],
        PARAMETER["Easting at false origin",4000000,LENGTHUNIT["metre",1]],
        PARAMETER["Northing at false origin",2800000,LENGTHUNIT["metre",1]]],CS[Cartesian,2],
        AXIS["northing (N)",north,ORDER[1]],AXIS["easting (E)",east,ORDER[2]],LENGTHUNIT["metre",1]]"#;
    for (definition, x, y, across, down) in [
        (esri("Albers", &albers), 199_000.0, -2_760_000.0, 1.011_867, 0.988_272),
        (
            esri("Stereographic_North_Pole", &[("Central_Meridian", -45.0), ("Standard_Parallel_1", 70.0)]),
            0.0,
            -3_323_000.0,
            0.962_074,
            0.962_074,
        ),
        (web.to_owned(), 1_113_000.0, 8_400_000.0, 0.5004, 0.5004),
        (lambert.to_owned(), 4e6, 5e6, 0.950_248, 0.950_248),
        (esri("Sinusoidal", &[("Central_Meridian", 0.0)]), 558_000.0, 6_654_000.0, 1.0, 1.011_358),
        (
            esri("Cylindrical_Equal_Area", &[("Central_Meridian", 0.0), ("Standard_Parallel_1", 30.0)]),
            965_000.0,
            6_351_000.0,
            0.578_434,
            1.728_805,
        ),
        (esri("Mollweide", &[("Central_Meridian", 0.0)]), 324_000.0, 6_877_000.0, 0.860_339, 1.167_59),
        (esri("Robinson", &[("Central_Meridian", 0.0)]), 377_000.0, 6_336_000.0, 0.739_576, 1.137_132),
        ("+proj=sinu +lon_0=0 +R=6371007.181".to_owned(), 56_000.0, 6_672_000.0, 1.0, 1.0),
        ("EPSG:6933".to_owned(), 965_000.0, 6_351_000.0, 0.578_434, 1.728_805),
        ("EPSG:3410".to_owned(), 963_000.0, 6_371_000.0, 0.577_412, 1.731_865),
        ("EPSG:10622".to_owned(), -14_000.0, 22_000.0, 0.304_801, 0.304_801),
        ("EPSG:2048".to_owned(), 0.0, 3_320_000.0, 1.0, 1.0),
    ] {
        let grid = asc(&format!("xllcorner {}\nyllcorner {}\ncellsize 100", x - 500.0, y - 600.0));
        let (dem, said) = read_files(&[("a.asc", &grid), ("a.prj", definition.as_bytes())], &DEFAULT)
            .unwrap_or_else(|e| panic!("{definition}: {e}"));
        let (found, near) = (dem.cell_size(), |a: f64, b: f64| (a / b - 1.0).abs() < 2e-3);
        assert!(near(found.x(), 100.0 * across) && near(found.y(), 100.0 * down), "{definition}: {found:?}");
        assert_eq!(said.cell_size_source, CellSizeSource::File, "{definition}: {said:?}");
        let notes = said.notes.join("; ");
        assert!(!notes.contains("not known"), "{definition}: {notes}");
        let slanted = definition.contains("Sinusoidal")
            || definition.contains("Mollweide")
            || definition.contains("Robinson");
        assert_eq!(notes.contains("rows and columns meet at"), slanted, "{definition}: {notes}");
    }
}

/// GeoTIFF's own words: a code of a projection, or Esri's WKT where there is no such code (as GDAL writes Mollweide). A system
/// below it in degrees does not make degrees of it.
#[test]
fn projections_without_keys_are_read_from_words() {
    let words =
        esri("Mollweide", &[("False_Easting", 0.0), ("False_Northing", 0.0), ("Central_Meridian", 0.0)]);
    let text = format!("ESRI PE String = {words}|");
    let length = text.len() as u32;
    let moll = |model: u32, x: f64, y: f64| {
        at(tiff(), 100.0, x, y).text(34737, &text).short(
            34735,
            &[
                1, 1, 0, 5, 1024, 0, 1, model, 1025, 0, 1, 1, 2048, 0, 1, 4326, 3073, 34737, length, 0, 3076,
                0, 1, 9001,
            ],
        )
    };
    let (dem, _) = read_files(&[("a.tif", &moll(32_767, 324_000.0, 6_877_000.0).bytes())], &DEFAULT).unwrap();
    cells(&dem, 86.03, 116.76);
    // Near the middle of the map its numbers could be degrees.
    let (dem, _) = read_files(&[("a.tif", &moll(32_767, 10.0, 20.0).bytes())], &DEFAULT).unwrap();
    assert!((80.0..120.0).contains(&dem.cell_size().x()), "{:?}", dem.cell_size());
    // Written and read, the words stay.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("b.tif");
    write(&dem, &path, &WriteOptions::default()).unwrap();
    let again = read_described(&path, &DEFAULT).unwrap().0;
    assert_eq!(again.georeference().unwrap().crs(), dem.georeference().unwrap().crs());
    assert_eq!(again.cell_size(), dem.cell_size());
    // Sinusoidal and cylindrical equal area by their codes, on a sphere and an ellipsoid.
    let own = |projection: u32, doubles: &[f64], keys: &[u32]| {
        let head = [
            1,
            1,
            0,
            5 + keys.len() as u32 / 4,
            1024,
            0,
            1,
            1,
            1025,
            0,
            1,
            1,
            2048,
            0,
            1,
            4326,
            3072,
            0,
            1,
            32_767,
        ];
        let last = [3075, 0, 1, projection];
        at(tiff(), 100.0, 965_000.0, 6_351_000.0)
            .doubles(34736, doubles)
            .short(34735, &[&head[..], &last, keys].concat())
    };
    let equal_area = own(28, &[30.0, 0.0], &[3078, 34736, 1, 0, 3080, 34736, 1, 1]);
    let (dem, said) = read_files(&[("a.tif", &equal_area.bytes())], &DEFAULT).unwrap();
    cells(&dem, 57.84, 172.88);
    told(&said, &["cells of 100 m on it are 57.86 m west-east, 172.83 m north-south on the ground"]);
    let sinusoidal = own(24, &[0.0], &[3088, 34736, 1, 0]);
    let (dem, said) = read_files(&[("a.tif", &sinusoidal.bytes())], &DEFAULT).unwrap();
    cells(&dem, 100.0, 102.72);
    told(&said, &["rows and columns meet at"]);
    write(&dem, &path, &WriteOptions::default()).unwrap();
    assert_eq!(read_described(&path, &DEFAULT).unwrap().0.cell_size(), dem.cell_size());
}
