//! Arguments that several verbs share, and how their values are written.

use super::console::Console;
use crate::dem::io::{self, Description, Format, Nodata, ReadOptions};
use crate::dem::{CellSize, Dem, Normalization, bundled};
use crate::error::{Error, Result};
use crate::file;
use crate::grid::{Cell, Window};
use crate::style::overlay;
use std::path::{Path, PathBuf};

// The structs that are flattened into verbs have no doc comments: clap would take them for the verb's description.

// A terrain argument with everything that may have to be said about the file.
#[derive(clap::Args, Clone, Debug)]
pub(super) struct DemInput {
    /// Terrain file, or the name of terrain that comes with the program (sierra, grand-canyon)
    #[arg(value_name = "DEM")]
    pub(super) dem: PathBuf,
    #[command(flatten)]
    pub(super) reading: DemReading,
    /// Work on cells that are not square as if they were, rather than on terrain resampled to square ones
    #[arg(long, help_heading = READING)]
    keep_cells: bool,
}

impl DemInput {
    /// The terrain, on square cells unless they are to be kept; says so on the console, and what the reader noticed.
    ///
    /// # Errors
    /// As [`DemReading::read`].
    pub(super) fn load(&self, console: &Console) -> Result<Dem> {
        let (dem, description) = self.reading.read(&self.dem)?;
        tell(&self.dem, &description, console);
        let (name, size) = (self.dem.display(), dem.cell_size());
        let sides = format!("cells are {}", size.in_words());
        if self.keep_cells {
            if !size.is_square() {
                console.warning(format!("{name}: {sides}, worked on as if they were square"));
            }
            return Ok(dem);
        }
        let Some(square) = dem.on_square_cells().map_err(|e| e.in_file(&self.dem))? else { return Ok(dem) };
        let (rows, cols) = square.shape();
        console.note(format!(
            "{name}: {sides}: resampled to {rows}x{cols} square cells of {}, in which windows, patches and sketches \
             are counted (--keep-cells leaves them)",
            square.cell_size().in_words()
        ));
        Ok(square)
    }
}

/// Heading in the help. Named by each option, because clap hands a struct's heading on to what follows it.
const READING: &str = "Reading terrain";

// What the file itself may leave open.
#[derive(clap::Args, Clone, Debug)]
pub(super) struct DemReading {
    /// Elevations of black and white, metres: for PNG only, needed for files of other programs
    #[arg(long, help_heading = READING, value_name = "MIN,MAX", value_parser = elevation, allow_hyphen_values = true)]
    elevation: Option<Normalization>,
    /// Cell size on the ground, metres: one side, or west-east and north-south; overrules the file
    #[arg(long, help_heading = READING, value_name = "M[,M]", value_parser = cell_size, allow_hyphen_values = true)]
    cell_size: Option<CellSize>,
    /// The stored number that means "no height here", or two of them, or `none`; overrules the file; in a PNG a grey level
    #[arg(long, help_heading = READING, value_name = "V[,V]", value_parser = nodata, allow_hyphen_values = true)]
    nodata: Option<Nodata>,
    /// Band of a GeoTIFF with several, counted from 1
    #[arg(long, help_heading = READING, value_name = "N")]
    band: Option<usize>,
    /// Metres in one unit of the stored heights (0.3048 for feet); overrules the file; not for PNG
    #[arg(long, help_heading = READING, value_name = "M", allow_hyphen_values = true)]
    metres_per_unit: Option<f64>,
}

impl DemReading {
    /// The options for the reader.
    pub(super) fn options(&self) -> ReadOptions {
        ReadOptions {
            elevation: self.elevation,
            cell_size: self.cell_size,
            band: self.band,
            nodata: self.nodata.unwrap_or_default(),
            metres_per_unit: self.metres_per_unit,
        }
    }

    /// The terrain in the file `dem`, or when there is no such file the bundled terrain of that name.
    ///
    /// # Errors
    /// As [`io::read`]; a name that is neither file nor bundled terrain.
    pub(super) fn read(&self, dem: &Path) -> Result<(Dem, Description)> {
        let (terrain, description) = match bundled_name(dem) {
            Some(name) => bundled::read(name, &self.options()),
            None if !dem.exists() => Err(no_such_terrain(dem)),
            None => io::read_described(dem, &self.options()),
        }?;
        self.check_format(dem, description.format)?;
        Ok((terrain, description))
    }

    /// Refuses options that the reader of `format` does not look at.
    fn check_format(&self, dem: &Path, format: Format) -> Result<()> {
        let refuse = |option: &str, value: String, allowed: &str| {
            Err(Error::file(dem, option, value, format!("{allowed}; this is {format}")))
        };
        if let Some(band) = self.band.filter(|_| format != Format::GeoTiff) {
            return refuse(
                "--band",
                band.to_string(),
                "allowed: for GeoTIFF only, other formats hold one band",
            );
        }
        if let Some(range) = self.elevation.filter(|_| format != Format::Png) {
            let value = format!("{},{}", range.low(), range.high());
            return refuse("--elevation", value, "allowed: for PNG only, other formats hold heights");
        }
        if format != Format::Png {
            return Ok(());
        }
        if let Some(metres) = self.metres_per_unit {
            let allowed = "not for PNG: a PNG holds grey levels, whose heights --elevation gives in metres";
            return refuse("--metres-per-unit", metres.to_string(), allowed);
        }
        Ok(())
    }
}

/// A terrain file, or the bundled terrain of that name, whose numbers need not be heights: a mask, or the place alone.
///
/// # Errors
/// As [`io::read`].
pub(super) fn read_numbers(path: &Path, cell_size: Option<CellSize>) -> Result<(Dem, Description)> {
    let options = ReadOptions {
        elevation: Some(Normalization::new(0.0, 1.0)?),
        cell_size,
        band: Some(1),
        nodata: Nodata::Numbers,
        metres_per_unit: Some(1.0),
    };
    match bundled_name(path) {
        Some(name) => bundled::read(name, &options),
        None if !path.exists() => Err(no_such_terrain(path)),
        None => io::read_described(path, &options),
    }
}

/// What the reader of a terrain file noticed: what was assumed, what stands beside the file, what is strange.
pub(super) fn tell(dem: &Path, description: &Description, console: &Console) {
    for note in &description.notes {
        console.note(format!("{}: {note}", dem.display()));
    }
    for warning in &description.warnings {
        console.warning(format!("{}: {warning}", dem.display()));
    }
}

/// The bundled terrain that a terrain argument means: a file of the same name comes first.
pub(super) fn bundled_name(dem: &Path) -> Option<&'static str> {
    let name = dem.to_str().filter(|_| !dem.exists())?;
    bundled::names().find(|known| *known == name)
}

/// The name that stands for `dem` in reports and pictures: a file's name without extension.
pub(super) fn terrain_name(dem: &Path) -> String {
    dem.file_stem().unwrap_or(dem.as_os_str()).to_string_lossy().into_owned()
}

/// The names of bundled terrain, as they are listed in messages.
pub(super) fn bundled_terrain() -> String {
    bundled::names().collect::<Vec<_>>().join(", ")
}

fn no_such_terrain(dem: &Path) -> Error {
    let allowed = format!("allowed: a terrain file, or the name of bundled terrain ({})", bundled_terrain());
    Error::file(dem, "file", "not there", allowed)
}

// A window of the terrain.
#[derive(clap::Args, Clone, Copy, Debug)]
pub(super) struct CropOption {
    /// Only this window of the terrain: row and column of its north-west cell (from 0), then its side or ROWSxCOLS
    #[arg(long = "crop", value_name = "ROW,COL,SIZE", value_parser = window)]
    pub(super) window: Option<Window>,
}

impl CropOption {
    /// The window of `dem`, or all of it.
    pub(super) fn window_of(self, dem: &Dem) -> Window {
        self.window.unwrap_or(Window::whole(dem.shape()))
    }

    /// What the window shows of `dem`.
    ///
    /// # Errors
    /// When the window reaches past the frame or holds voids only.
    pub(super) fn apply(self, dem: Dem) -> Result<Dem> {
        match self.window {
            None => Ok(dem),
            Some(window) => dem.crop(window).map_err(|e| name_option(e, "--crop")),
        }
    }
}

/// The same complaint about a value, saying which option it came from.
fn name_option(error: Error, option: &str) -> Error {
    match error {
        Error::Value { name, value, allowed } => {
            Error::Value { name: format!("{name} (of {option})"), value, allowed }
        }
        other => other,
    }
}

/// `ROW,COL,SIZE` or `ROW,COL,ROWSxCOLS`.
///
/// # Errors
/// Says what is allowed.
pub(super) fn window(text: &str) -> Result<Window, String> {
    let allowed =
        || "allowed: ROW,COL,SIZE or ROW,COL,ROWSxCOLS, as in 0,128,256 or 0,128,256x512".to_owned();
    let fields: Vec<&str> = text.split(',').collect();
    let [row, col, side] = fields[..] else { return Err(allowed()) };
    let number = |text: &str| text.trim().parse::<usize>().map_err(|_| allowed());
    let (rows, cols) = size(side).map_err(|_| allowed())?;
    Ok(Window::new(Cell::new(number(row)?, number(col)?), rows, cols))
}

/// `N` or `ROWSxCOLS`, at least 1 each: (rows, columns).
///
/// # Errors
/// Says what is allowed.
pub(super) fn size(text: &str) -> Result<(usize, usize), String> {
    let (rows, cols) = text.split_once(['x', 'X']).unwrap_or((text, text));
    match (rows.trim().parse(), cols.trim().parse()) {
        (Ok(rows), Ok(cols)) if rows > 0 && cols > 0 => Ok((rows, cols)),
        _ => Err("allowed: a side or ROWSxCOLS, at least 1 each, as in 256 or 256x512".to_owned()),
    }
}

/// `MIN,MAX` in metres.
///
/// # Errors
/// Says what is allowed.
pub(super) fn elevation(text: &str) -> Result<Normalization, String> {
    let allowed = "allowed: MIN,MAX in metres, the lower one first, as in -50,2400";
    let (low, high) = text.split_once(',').ok_or(allowed)?;
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| allowed);
    Ok(Normalization::new(number(low)?, number(high)?).map_err(|_| allowed)?)
}

/// `M` or `M,M` in metres.
///
/// # Errors
/// Says what is allowed.
pub(super) fn cell_size(text: &str) -> Result<CellSize, String> {
    let allowed = "allowed: metres above 0, one side or two, as in 30 or 24.2,30.9";
    let (x, y) = text.split_once(',').unwrap_or((text, text));
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| allowed);
    Ok(CellSize::new(number(x)?, number(y)?).map_err(|_| allowed)?)
}

fn nodata(text: &str) -> Result<Nodata, String> {
    if text.eq_ignore_ascii_case("none") {
        return Ok(Nodata::None);
    }
    let number = |text: &str| {
        text.trim().parse().map_err(|_| "allowed: a number, two with a comma between, or `none`".to_owned())
    };
    match text.split_once(',') {
        None => number(text).map(Nodata::Value),
        Some((one, other)) => Ok(Nodata::Either([number(one)?, number(other)?])),
    }
}

/// The largest configuration file that is read, bytes.
const LARGEST_CONFIG: u64 = 1 << 20;

/// The text of a TOML file as a table.
///
/// # Errors
/// When the file cannot be read or is not TOML.
pub(super) fn read_toml(path: &Path) -> Result<toml::Table> {
    let bytes = file::read_whole(path, LARGEST_CONFIG)?;
    let text =
        String::from_utf8(bytes).map_err(|e| Error::file(path, "text", e, "allowed: TOML in UTF-8"))?;
    text.parse().map_err(|e: toml::de::Error| config_error(path, &e))
}

/// What a configuration file says, as a `T`.
///
/// # Errors
/// When the file has a field that `T` does not know, or a value of the wrong kind.
pub(super) fn config_of<T: serde::de::DeserializeOwned>(path: &Path, table: toml::Table) -> Result<T> {
    table.try_into().map_err(|e| config_error(path, &e))
}

fn config_error(path: &Path, error: &toml::de::Error) -> Error {
    let found = error.to_string().trim_end().to_owned();
    Error::file(path, "configuration", "not understood", format!("the reader says: {found}"))
}

// Settings that overrule presets.
#[derive(clap::Args, Clone, Debug)]
pub(super) struct SettingsOptions {
    /// Configuration file
    #[arg(long, value_name = "F.toml")]
    pub(super) config: Option<PathBuf>,
    /// One setting, such as model.width=64; may be given several times
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl SettingsOptions {
    /// What `read` makes of the file's settings with the single ones over them. It reads the file's alone before, so that a bad key
    /// there names the file.
    ///
    /// # Errors
    /// When the file is not TOML or a setting has no value, and what `read` refuses.
    pub(super) fn read<T>(&self, read: impl Fn(&toml::Table) -> Result<T>) -> Result<T> {
        let mut over = toml::Table::new();
        if let Some(path) = &self.config {
            over = read_toml(path)?;
            read(&over).map_err(|e| e.in_file(path))?;
        }
        for setting in &self.set {
            let allowed = "allowed: KEY=VALUE such as model.width=64 or model.base=\"laplace\"";
            let Some((key, value)) = setting.split_once('=') else {
                return Err(Error::value("--set", setting, allowed));
            };
            // A bare word is a string, so that `model.base=laplace` works in a shell.
            let table: toml::Table = toml::from_str(&format!("{key}={value}"))
                .or_else(|_| toml::from_str(&format!("{key}=\"{value}\"")))
                .map_err(|_| Error::value("--set", setting, allowed))?;
            overlay(&mut over, &table);
        }
        read(&over)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_read_in_both_spellings() {
        let cell = Cell::new(3, 40);
        assert_eq!(window("3,40,128"), Ok(Window::square(cell, 128)));
        assert_eq!(window(" 3, 40, 128x64"), Ok(Window::new(cell, 128, 64)));
        for bad in ["", "3,40", "3,40,0", "3,40,5x", "-1,0,5", "3,40,5,6", "a,b,c", "3,40,1.5"] {
            assert!(window(bad).unwrap_err().contains("ROWSxCOLS"), "{bad}");
        }
    }

    #[test]
    fn elevations_cell_sizes_and_nodata_are_checked() {
        assert_eq!(elevation("-50, 2400").unwrap(), Normalization::new(-50.0, 2400.0).unwrap());
        for bad in ["5", "9,3", "3,3", "nan,3", "1,inf", "1,2,3"] {
            assert!(elevation(bad).unwrap_err().contains("MIN,MAX"), "{bad}");
        }
        assert_eq!(cell_size("30").unwrap(), CellSize::square(30.0).unwrap());
        assert_eq!(cell_size("24.2,30.9").unwrap(), CellSize::new(24.2, 30.9).unwrap());
        for bad in ["0", "-3", "nan", "x", "3,0"] {
            assert!(cell_size(bad).unwrap_err().contains("metres"), "{bad}");
        }
        assert_eq!(nodata("none"), Ok(Nodata::None));
        assert_eq!(nodata("-9999"), Ok(Nodata::Value(-9999.0)));
        assert_eq!(nodata("-32768,32767"), Ok(Nodata::Either([-32768.0, 32767.0])));
        assert!(nodata("void").is_err() && nodata("1,").is_err() && nodata("1,2,3").is_err());
    }
}
