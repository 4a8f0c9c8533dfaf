//! The files beside a raster: world files, `.prj`, `.aux.xml`, `.msk`.
//!
//! In: names and contents. Out: what each says, or a warning that it is there and not read; a sidecar never makes a raster
//! unreadable. World file: six numbers, the centre of the north-west cell last (Esri). `.prj`: WKT, or Esri's older key words.
//! `.aux.xml`: GDAL's PAM (nodata, scale, offset, unit, transform, coordinate system). Cost: the text once.

use super::ReadOptions;
use super::place::Said;
use crate::dem::RasterSpace;
use crate::dem::crs::{Crs, Ellipsoid, unit_in_words, vertical_unit};
use crate::error::{Error, Result};
use crate::file;
use roxmltree::{Document, Node};
use std::ffi::OsStr;
use std::path::Path;

/// The largest sidecar that is read, except masks, which are rasters.
const LARGEST: u64 = 1 << 22;

/// Endings of files that say something about a raster, but nothing that is read here.
const UNREAD: [&str; 6] = [".aux", ".hdr", ".tab", ".qpj", ".points", ".gcp"];

/// A file beside a raster: its name and what is in it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sidecar {
    /// Name without folder.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// What the files beside a raster say.
#[derive(Debug, Default)]
pub(super) struct Sidecars {
    /// Name and transform (outer corner) of the world file.
    pub(super) world: Option<(String, [f64; 6])>,
    /// Name of the `.prj`, and its system.
    pub(super) projection: Option<(String, Crs)>,
    pub(super) pam: Option<Pam>,
    pub(super) pam_name: String,
    /// Name and content of the mask.
    pub(super) mask: Option<Sidecar>,
}

/// What `.aux.xml` says; of bands by their number from 1.
#[derive(Debug, Default)]
pub(super) struct Pam {
    pub(super) transform: Option<[f64; 6]>,
    pub(super) crs: Option<Crs>,
    pub(super) raster_space: Option<RasterSpace>,
    bands: Vec<(usize, PamBand)>,
}

/// What `.aux.xml` says about a band.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PamBand {
    pub(super) nodata: Option<f64>,
    pub(super) scale: Option<f64>,
    pub(super) offset: Option<f64>,
    pub(super) unit: Option<String>,
}

/// What a name is beside a raster's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    World,
    Projection,
    Pam,
    Mask,
    Unread,
}

/// What the file `name` is to the raster `raster` (both without folder, `raster` without the ending of a packer).
fn kind(raster: &str, name: &str) -> Option<Kind> {
    let (raster, name) = (raster.to_ascii_lowercase(), name.to_ascii_lowercase());
    if let Some(ending) = name.strip_prefix(&raster) {
        return match ending {
            ".aux.xml" => Some(Kind::Pam),
            ".msk" => Some(Kind::Mask),
            "w" => Some(Kind::World),
            ".aux" => Some(Kind::Unread),
            _ => None,
        };
    }
    let (stem, extension) = raster.rsplit_once('.').unwrap_or((&raster, ""));
    let ending = name.strip_prefix(stem)?;
    let letters: Vec<char> = extension.chars().collect();
    let short = match letters[..] {
        [first, .., last] => format!(".{first}{last}w"),
        _ => ".wld".to_owned(),
    };
    match ending {
        ".prj" => Some(Kind::Projection),
        ".wld" => Some(Kind::World),
        other if other == short => Some(Kind::World),
        other if UNREAD.contains(&other) => Some(Kind::Unread),
        _ => None,
    }
}

/// The files beside the raster at `path`, in the order of their names; a folder that cannot be listed has none.
///
/// # Errors
/// When one that counts cannot be read.
pub(crate) fn beside(path: &Path) -> Result<Vec<Sidecar>> {
    let raster = super::format::unpacked_name(path);
    let Some(raster) = raster.file_name().and_then(OsStr::to_str) else { return Ok(Vec::new()) };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut found = Vec::new();
    for beside in file::list(folder).unwrap_or_default() {
        let Some(name) = beside.file_name().and_then(OsStr::to_str) else { continue };
        let bytes = match kind(raster, name) {
            None => continue,
            Some(Kind::Unread) => Vec::new(),
            Some(Kind::Mask) => file::read_whole(&beside, super::MAX_FILE_BYTES)?,
            Some(_) => file::read_whole(&beside, LARGEST)?,
        };
        found.push(Sidecar { name: name.to_owned(), bytes });
    }
    Ok(found)
}

impl Sidecars {
    /// Reads those of `files` that belong to the raster at `path`.
    pub(super) fn parse(path: &Path, files: &[Sidecar], said: &mut Said) -> Self {
        let raster = super::format::unpacked_name(path);
        let raster = raster.file_name().unwrap_or_default().to_string_lossy();
        let mut found = Self::default();
        for file in files {
            let text = || {
                std::str::from_utf8(&file.bytes)
                    .map(|text| text.trim_start_matches('\u{feff}'))
                    .map_err(|_| "it is not text in UTF-8".to_owned())
            };
            let read = match kind(&raster, &file.name) {
                Some(Kind::World) if found.world.is_none() => {
                    text().and_then(world).map(|t| found.world = Some((file.name.clone(), t)))
                }
                Some(Kind::Projection) => {
                    text().and_then(projection).map(|crs| found.projection = Some((file.name.clone(), crs)))
                }
                Some(Kind::Pam) => text().and_then(|text| Pam::parse(text, &file.name, said)).map(|pam| {
                    found.pam_name.clone_from(&file.name);
                    found.pam = Some(pam);
                }),
                Some(Kind::Mask) => {
                    found.mask = Some(file.clone());
                    Ok(())
                }
                Some(Kind::World) => Err("another world file comes first".to_owned()),
                Some(Kind::Unread) => Err("what such files say is not used".to_owned()),
                None => Ok(()),
            };
            if let Err(reason) = read {
                said.warnings.push(format!("{} is there and not read: {reason}", file.name));
            }
        }
        found
    }

    /// What `.aux.xml` says about a band, counted from 0.
    pub(super) fn band(&self, band: usize) -> PamBand {
        let bands = self.pam.iter().flat_map(|pam| &pam.bands);
        bands.into_iter().find(|(number, _)| *number == band + 1).map(|(_, b)| b.clone()).unwrap_or_default()
    }
}

impl Sidecars {
    /// Metres in a unit of the heights: the caller's, that of `.aux.xml`, the file's own, that of the `.prj`, else 1.
    ///
    /// # Errors
    /// When `.aux.xml` names a unit that is not known, and the caller gives none.
    pub(super) fn metres_per_height(
        &self,
        path: &Path,
        band: &PamBand,
        own: Option<f64>,
        options: &ReadOptions,
        said: &mut Said,
    ) -> Result<f64> {
        if let Some(given) = options.metres_per_unit {
            return Ok(given);
        }
        let beside = match &band.unit {
            Some(name) => Some(named_unit(&path.with_file_name(&self.pam_name), name)?),
            None => None,
        };
        let projection =
            self.pam.as_ref().and_then(|pam| pam.crs).or(self.projection.as_ref().map(|(_, crs)| *crs));
        let stated = beside.or(own).or_else(|| projection?.vertical_metres_per_unit());
        let metres = stated.unwrap_or(1.0);
        if metres != 1.0 {
            said.notes
                .push(format!("heights converted to metres: they are in units of {}", unit_in_words(metres)));
        }
        Ok(metres)
    }
}

/// Metres in a unit of heights that a file names.
///
/// # Errors
/// When the name is not known.
pub(super) fn named_unit(path: &Path, name: &str) -> Result<f64> {
    vertical_unit(name).ok_or_else(|| {
        let allowed = "allowed: metre, foot, US survey foot and the like; or say it with --metres-per-unit M";
        Error::file(path, "vertical unit", format!("{name:?}"), allowed)
    })
}

/// Six numbers: x and y per column, x and y per row (a, d, b, e), the centre of the north-west cell.
fn world(text: &str) -> Result<[f64; 6], String> {
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let [a, d, b, e, x, y] = numbers[..] else {
        return Err(format!("it has {} numbers, a world file six, with decimal points", numbers.len()));
    };
    if numbers.iter().any(|v| !v.is_finite()) || a * e == b * d {
        return Err("its numbers are no place".to_owned());
    }
    Ok([a, b, x - (a + b) / 2.0, d, e, y - (d + e) / 2.0])
}

/// WKT, or the key words of ArcInfo (`Projection UTM`, `Units METERS`), of which the unit counts.
fn projection(text: &str) -> Result<Crs, String> {
    if !text.trim_start().to_ascii_lowercase().starts_with("projection") {
        return Crs::parse(text).map_err(|e| e.to_string());
    }
    let value = |key: &str| {
        let mut lines = text.lines().map(str::split_whitespace);
        lines.find_map(|mut words| words.next().filter(|w| w.eq_ignore_ascii_case(key)).and(words.next()))
    };
    let unknown =
        |unit: &str| format!("its unit is {unit:?}; allowed: METERS, FEET, a number of units per metre, DD");
    let heights = value("Zunits").filter(|z| !z.eq_ignore_ascii_case("no"));
    let unit = value("Units").unwrap_or("METERS");
    let crs = match unit.to_ascii_uppercase().as_str() {
        "DD" => Ok(Crs::geographic(Ellipsoid::WGS84)),
        "METERS" => Crs::projected_in(1.0),
        // ArcInfo's foot is the American one.
        "FEET" => Crs::projected_in(1200.0 / 3937.0),
        number => {
            let per_metre: f64 = number.parse().map_err(|_| unknown(unit))?;
            Crs::projected_in(1.0 / per_metre)
        }
    };
    let vertical = heights.and_then(|z| match z.to_ascii_uppercase().as_str() {
        "FEET" => Some(1200.0 / 3937.0),
        other => vertical_unit(other),
    });
    crs.map(|crs| crs.with_heights(vertical)).map_err(|e| e.to_string())
}

impl Pam {
    fn parse(text: &str, name: &str, said: &mut Said) -> Result<Self, String> {
        let document = Document::parse(text).map_err(|e| e.to_string())?;
        let root = document.root_element();
        if !root.has_tag_name("PAMDataset") {
            return Err(format!("its root is <{}>, not <PAMDataset>", root.tag_name().name()));
        }
        let text_of = |parent: Node<'_, '_>, tag: &str| -> Option<String> {
            let text = parent.children().find(|n| n.has_tag_name(tag))?.text()?.trim();
            (!text.is_empty()).then(|| text.to_owned())
        };
        let mut warn = |what: &str, found: &str| {
            said.warnings.push(format!("{name}: {what} is {found:?} and not used: it is not understood"));
        };
        let mut pam = Self::default();
        if let Some(text) = text_of(root, "GeoTransform") {
            let numbers: Vec<f64> = text.split(',').filter_map(|v| v.trim().parse().ok()).collect();
            match numbers[..] {
                [c, a, b, f, d, e] if numbers.iter().all(|v| v.is_finite()) && a * e != b * d => {
                    pam.transform = Some([a, b, c, d, e, f]);
                }
                _ => warn("GeoTransform", &text),
            }
        }
        if let Some(text) = text_of(root, "SRS") {
            match Crs::parse(&text) {
                Ok(crs) => pam.crs = Some(crs),
                Err(_) => warn("SRS", &text.chars().take(60).collect::<String>()),
            }
        }
        let items = root.descendants().filter(|n| n.has_tag_name("MDI"));
        let space = items.filter(|n| n.attribute("key") == Some("AREA_OR_POINT")).find_map(|n| n.text());
        pam.raster_space = match space.map(str::trim) {
            Some("Point") => Some(RasterSpace::PixelIsPoint),
            Some("Area") => Some(RasterSpace::PixelIsArea),
            _ => None,
        };
        for band in root.children().filter(|n| n.has_tag_name("PAMRasterBand")) {
            let number = band.attribute("band").and_then(|n| n.parse().ok()).unwrap_or(1);
            let mut value = |tag: &str, read: fn(&str) -> Option<f64>| {
                let text = text_of(band, tag)?;
                let found = read(&text);
                if found.is_none() {
                    warn(tag, &text);
                }
                found
            };
            let finite = |text: &str| text.parse::<f64>().ok().filter(|v| v.is_finite());
            let described = PamBand {
                nodata: value("NoDataValue", super::samples::nodata_number),
                scale: value("Scale", finite).filter(|scale| *scale != 0.0),
                offset: value("Offset", finite),
                unit: text_of(band, "UnitType"),
            };
            pam.bands.push((number, described));
        }
        Ok(pam)
    }
}
