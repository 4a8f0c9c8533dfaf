//! What a sketch asked for and what came (`generate --check`), and its variants side by side (`generate --variants`).

use super::Context;
use crate::dem::Dem;
use crate::error::{Error, Result};
use crate::file;
use crate::metrics::{Contract, ContractBounds};
use crate::sketch::Sketch;
use crate::viz::{LineArt, LineStyle, Relief, Sheet};
use std::path::{Path, PathBuf};

const CHECK: &str = "Check";

// What is said about the check; no doc comment, see args.rs.
#[derive(Debug, clap::Args)]
pub(super) struct CheckOptions {
    /// Hold the terrain against the sketch and print what came of every stroke
    #[arg(long, help_heading = CHECK)]
    check: bool,
    /// Write what --check finds
    #[arg(long, help_heading = CHECK, value_name = "CHECK.json")]
    pub(super) check_json: Option<PathBuf>,
    /// What is not accepted: height_error=METRES, pits=SHARE or unasked=SHARE at the most, found=SHARE or carries=SHARE at the
    /// least; the exit code is 3 when one is broken
    #[arg(long, help_heading = CHECK, value_name = "KEY=VALUE")]
    bound: Vec<String>,
}

impl CheckOptions {
    /// The bounds that were given.
    ///
    /// # Errors
    /// Names the one that is not understood.
    pub(super) fn bounds(&self) -> Result<ContractBounds> {
        let mut table = toml::Table::new();
        for bound in &self.bound {
            let read = bound
                .parse::<toml::Table>()
                .map_err(|_| Error::value("--bound", bound, "allowed: KEY=NUMBER, as in found=0.8"))?;
            table.extend(read);
        }
        table.try_into().map_err(|e: toml::de::Error| {
            let allowed = "allowed: height_error, found, carries, pits, unasked, each with a number";
            Error::value("--bound", e.message(), allowed)
        })
    }

    /// Holds `terrain`, written to `path`, against `sketch`, where that was asked for. `style_pits`: share of the style's terrain in pits.
    ///
    /// # Errors
    /// When the findings cannot be written; [`Error::Bound`] when a bound is broken.
    pub(super) fn run(
        &self,
        terrain: &Dem,
        sketch: &Sketch,
        style_pits: Option<f64>,
        path: &Path,
        context: &Context,
    ) -> Result<()> {
        if !self.check && self.check_json.is_none() && self.bound.is_empty() {
            return Ok(());
        }
        let found = Contract { style_pits, ..Contract::of(terrain.heights(), terrain.valid(), sketch)? };
        if self.check {
            context.console.line(found.table().trim_end());
        }
        if let Some(json) = &self.check_json {
            let plain = |e: serde_json::Error| Error::file(json, "findings", e, "they must be plain data");
            let text = serde_json::to_string_pretty(&found).map_err(plain)?;
            file::write_bytes(json, text.as_bytes())?;
        }
        match found.broken(&self.bounds()?).join(" ") {
            broken if broken.is_empty() => Ok(()),
            broken => Err(Error::Bound { path: path.to_owned(), broken }),
        }
    }
}

/// The file of a variant: `terrain.tif`, `terrain-2.tif`, and so on.
pub(super) fn variant_path(output: &Path, index: usize) -> PathBuf {
    if index == 0 { output.to_owned() } else { beside(output, &format!("{}", index + 1), None) }
}

/// The picture of all variants: `terrain-variants.png`.
pub(super) fn sheet_path(output: &Path) -> PathBuf {
    beside(output, "variants", Some("png"))
}

fn beside(output: &Path, what: &str, ending: Option<&str>) -> PathBuf {
    let text = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let ending = ending.map_or_else(|| text(output.extension()), str::to_owned);
    output.with_file_name(format!("{}-{what}.{ending}", text(output.file_stem())))
}

/// Draws the strokes and what each seed makes of them.
///
/// # Errors
/// When the picture cannot be written.
pub(super) fn draw_variants(variants: &[(String, Dem)], sketch: &Sketch, path: &Path) -> Result<()> {
    let relief = Relief::default();
    let mut sheet = Sheet::new(3);
    if let Some((_, first)) = variants.first() {
        let mut drawn = relief.draw(first)?;
        LineArt::try_from(sketch)?.overlay(&mut drawn, &LineStyle::default())?;
        sheet = sheet.panel(drawn, "strokes");
    }
    for (name, terrain) in variants {
        sheet = sheet.panel(relief.draw(terrain)?, name.as_str());
    }
    sheet.draw()?.write_png(path)
}
