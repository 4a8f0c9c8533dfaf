//! The report of the demo: pictures to files and into one page.

use super::results::{DemoResults, DemoStyle};
use crate::dem::{Dem, Normalization};
use crate::error::Result;
use crate::evaluate::{Rebuilt, aggregate};
use crate::grid::Grid;
use crate::viz::plot::{Better, Curves, Panel, ScorePlot, Svg};
use crate::viz::report::{Best, Column, Entry, Figure, Report, Table};
use crate::viz::{ColorBar, LineArt, LineStyle, Palette, Picture, Relief, Sheet, error_limit, error_map};
use std::path::Path;

/// Pixels of a cell in single pictures.
const SCALE: usize = 4;
/// Pixels of a cell in sheets.
const SHEET_SCALE: usize = 3;

/// All pictures, drawn.
pub(super) struct Page {
    styles: Vec<StylePictures>,
    drawing: Picture,
    drawings: Picture,
    variants: Picture,
    comparison: Picture,
    detail: Picture,
    errors: Picture,
    ssim: Svg,
    psnr: Svg,
}

struct StylePictures {
    exemplar: Picture,
    lines: Picture,
    rebuilt: Picture,
    by_network: Picture,
    drawn: Picture,
    random: Picture,
    enhanced: Picture,
    curves: Svg,
}

impl Page {
    /// Draws everything and writes each picture into the folder.
    pub(super) fn draw(results: &DemoResults, out: &Path) -> Result<Self> {
        let mut styles = Vec::new();
        for s in &results.styles {
            let pictures = StylePictures::draw(s)?;
            for (name, picture) in [
                ("exemplar", &pictures.exemplar),
                ("lines", &pictures.lines),
                ("rebuilt", &pictures.rebuilt),
                ("drawn-by-network", &pictures.by_network),
                ("drawn", &pictures.drawn),
                ("random-lines", &pictures.random),
                ("drawn-with-random-lines", &pictures.enhanced),
            ] {
                picture.write_png(&out.join(format!("{}-{name}.png", s.name)))?;
            }
            pictures.curves.write(&out.join(format!("{}-training.svg", s.name)))?;
            styles.push(pictures);
        }
        let drawing = LineArt::try_from(&results.drawing)?.on_paper(SCALE)?;
        let patch = &results.evaluation.patches[0];
        let (drawings, variants) = (drawings(results, &styles, &drawing)?, variants(results)?);
        let comparison = comparison(patch, results)?;
        let detail = detail(patch, results)?;
        let errors = errors(patch, results)?;
        let (ssim, psnr) =
            (scores(results, "SSIM", 3, |s| s.ssim)?, scores(results, "PSNR, dB", 2, |s| Some(s.psnr))?);
        overview(results, &styles, &drawing)?.write_png(&out.join("overview.png"))?;
        drawing.write_png(&out.join("drawing.png"))?;
        drawings.write_png(&out.join("drawings.png"))?;
        variants.write_png(&out.join("variants.png"))?;
        comparison.write_png(&out.join("comparison.png"))?;
        detail.write_png(&out.join("detail.png"))?;
        errors.write_png(&out.join("errors.png"))?;
        ssim.write(&out.join("ssim.svg"))?;
        psnr.write(&out.join("psnr.svg"))?;
        Ok(Self { styles, drawing, drawings, variants, comparison, detail, errors, ssim, psnr })
    }

    /// The page as HTML.
    pub(super) fn html(&self, results: &DemoResults) -> String {
        let mut report = Report::new("Terrain from one example and a drawing")
            .summary(if results.quick {
                "monadnock demo --quick: styles trained briefly, so scores are below those of the full demo"
            } else {
                "monadnock demo: everything below was made by this run from the two embedded pieces of terrain"
            })
            .summary(format!("version {}", env!("CARGO_PKG_VERSION")));
        report = report.section("A drawing in two styles").paragraph(
            "The drawing of Liu & Benes (2025): a ridge like a lambda inside a ring of valleys. The same strokes become \
             terrain in the style of each exemplar; below, random ridges and valleys fill what the drawing leaves open.",
        );
        let mut figures = vec![Figure::new(
            &self.drawing,
            "The drawing: ridges orange, valleys blue, high strokes lighter",
        )];
        for (s, pictures) in results.styles.iter().zip(&self.styles) {
            figures.push(Figure::new(
                &pictures.by_network,
                format!("In the style of {}, by the network with detail", s.title),
            ));
            figures.push(Figure::new(&pictures.drawn, format!("In the style of {}, by synthesis", s.title)));
        }
        report = report
            .figures(figures)
            .figure(&self.drawings, "Four drawings in two styles, by synthesis: strokes beside terrain")
            .figure(
                &self.variants,
                "One drawing from three seeds: strokes hold, what lies between them is laid out anew",
            );
        let mut figures = Vec::new();
        for (s, pictures) in results.styles.iter().zip(&self.styles) {
            figures.push(Figure::new(&pictures.random, format!("With random lines, for {}", s.title)));
            figures
                .push(Figure::new(&pictures.enhanced, format!("Their terrain in the style of {}", s.title)));
        }
        report = report.figures(figures);
        for (s, pictures) in results.styles.iter().zip(&self.styles) {
            report = style_section(report, s, pictures);
        }
        report = self.comparison_section(report, results);
        report
            .section("How this was made")
            .paragraph("The same steps one by one; a sketch or DEM of your own goes in the same places.")
            .commands(&results.commands)
            .time_spent(results.times.iter().map(|(name, time)| (name.as_str(), *time)))
            .credits(results.styles.iter().map(|s| s.credit.as_str()))
            .finish()
    }

    fn comparison_section(&self, report: Report, results: &DemoResults) -> Report {
        let first = &results.styles[0];
        let patches = &results.evaluation.patches;
        let lines = aggregate(&results.evaluation.rows);
        let mut table = Table::new([
            Column::text("System"),
            Column::number("SSIM", 4).best(Best::Highest),
            Column::number("PSNR", 2).unit("dB").best(Best::Highest),
            Column::number("Mean slope", 3).unit("of the true one").best(Best::NearestToOne),
            Column::number("Spectrum", 2).unit("dB apart").best(Best::Lowest),
            Column::number("Ridges found again", 3).unit("F1").best(Best::Highest),
            Column::number("Valleys found again", 3).unit("F1").best(Best::Highest),
        ])
        .caption(format!("Mean ± standard deviation over {} patches", patches.len()));
        for line in &lines {
            let get = |name: &str| Entry::from(line.summary.get(name).map(|s| (s.mean, s.sd)));
            table = table.row([
                Entry::from(line.system.as_str()),
                get("ssim"),
                get("psnr"),
                get("mean_slope_ratio"),
                get("spectrum_distance"),
                get("ridge_f1"),
                get("valley_f1"),
            ]);
        }
        report
            .section("Neighbouring terrain from its own lines")
            .paragraph(format!(
                "Each 128x128 patch of {} beside the exemplar is put into 0 to 1 by its own range; its ridges and valleys are \
                 extracted from it alone; every system rebuilds it from those lines and their heights. The style was learned \
                 from one other patch; the interpolators know nothing but the lines.",
                first.title
            ))
            .table(&table)
            .figure(&self.detail, "One neighbouring patch: coarse, with detail, and the truth, in one light")
            .figure(&self.comparison, "One neighbouring patch: the truth, its lines, and every system's terrain")
            .figure(&self.errors, "Height error of the same terrain")
            .figures([
                Figure::new(self.ssim.clone(), "Structural similarity on every patch"),
                Figure::new(self.psnr.clone(), "Peak signal-to-noise ratio on every patch"),
            ])
    }
}

impl StylePictures {
    fn draw(s: &DemoStyle) -> Result<Self> {
        let relief = relief(s);
        let exemplar = relief.draw(&s.source.dem)?;
        let mut lines = exemplar.clone();
        LineArt::from(&s.lines).overlay(&mut lines, &LineStyle::default())?;
        Ok(Self {
            exemplar,
            lines,
            rebuilt: relief.draw(&s.rebuilt)?,
            by_network: relief.draw(&s.by_network)?,
            drawn: relief.draw(&s.drawn)?,
            random: LineArt::try_from(&s.enhanced.0)?.on_paper(SCALE)?,
            enhanced: relief.draw(&s.enhanced.1)?,
            curves: curves(s)?,
        })
    }
}

/// A row for each drawing: its strokes, and its terrain in every style.
fn drawings(results: &DemoResults, styles: &[StylePictures], drawing: &Picture) -> Result<Picture> {
    let heads = results.styles.iter().map(|s| format!("in the style of {}", s.name));
    let mut sheet = Sheet::new(1 + styles.len())
        .column_heads(std::iter::once("strokes".to_owned()).chain(heads))
        .panel(drawing.shrunk(2), "");
    for pictures in styles {
        sheet = sheet.panel(pictures.drawn.shrunk(2), "");
    }
    for (i, sketch) in results.others.iter().enumerate() {
        sheet = sheet.panel(LineArt::try_from(sketch)?.on_paper(SCALE)?.shrunk(2), "");
        for s in &results.styles {
            sheet = sheet.panel(relief(s).draw(&s.others[i])?.shrunk(2), "");
        }
    }
    sheet.draw()
}

/// A row for each style: the strokes of one drawing, and its terrain from several seeds.
fn variants(results: &DemoResults) -> Result<Picture> {
    let mut sheet =
        Sheet::new(1 + results.styles[0].variants.len()).row_heads(results.styles.iter().map(|s| s.name));
    for s in &results.styles {
        sheet = sheet.panel(LineArt::try_from(&results.others[0])?.on_paper(SCALE)?.shrunk(2), "strokes");
        for (i, terrain) in s.variants.iter().enumerate() {
            let seed = s.style.origin.seed.0.wrapping_add(i as u64);
            sheet = sheet.panel(relief(s).draw(terrain)?.shrunk(2), format!("seed {seed}"));
        }
    }
    sheet.draw()
}

/// One light and one range for the exemplar and all that is made in its style.
fn relief(s: &DemoStyle) -> Relief {
    Relief::with_palette(palette(s.name)).scaled(SCALE).fixed_for(&s.source.dem)
}

/// Each style in a row: the exemplar, its lines, the drawing, and the drawing as terrain.
fn overview(results: &DemoResults, styles: &[StylePictures], drawing: &Picture) -> Result<Picture> {
    let mut sheet = Sheet::new(4)
        .column_heads(["one exemplar", "its ridges and valleys", "a drawing", "the drawing as terrain"])
        .row_heads(results.styles.iter().map(|s| s.name));
    for pictures in styles {
        for picture in [&pictures.exemplar, &pictures.lines, drawing, &pictures.drawn] {
            sheet = sheet.panel(picture.shrunk(2), "");
        }
    }
    sheet.draw()
}

fn palette(name: &str) -> Palette {
    if name == "grand-canyon" { Palette::Arid } else { Palette::Alpine }
}

fn curves(s: &DemoStyle) -> Result<Svg> {
    let training = s.style.network()?.training();
    let history = &training.history;
    let points = |f: &dyn Fn(&crate::style::LossValues) -> f64| -> Vec<(f64, f64)> {
        history.iter().map(|r| (r.epoch as f64, f(&r.losses))).collect()
    };
    Curves::new(format!("Training on {}, {} epochs", s.name, training.epochs), "epoch")
        .panel(
            Panel::new("loss")
                .log()
                .curve("l_gt", points(&|l| l.ground_truth))
                .curve("1 - SSIM", points(&|l| l.ssim))
                .curve("l_gradient", points(&|l| l.gradient))
                .curve("l_sketch", points(&|l| l.sketch))
                .curve("l_smooth", points(&|l| l.smooth)),
        )
        .panel(Panel::new("SSIM").curve("exemplar, with noise and masks", points(&|l| 1.0 - l.ssim)))
        .panel(
            Panel::new("PSNR, dB")
                .curve("exemplar, with noise and masks", points(&|l| -10.0 * l.ground_truth.log10())),
        )
        .draw()
}

fn style_section(report: Report, s: &DemoStyle, pictures: &StylePictures) -> Report {
    let e = &s.source.info;
    let learned = s.style.coarse.first().map(|system| system.account().text).unwrap_or_default();
    let range = s.style.origin.normalization;
    report
        .section(format!("The style of {}", s.title))
        .paragraph(format!(
            "{}x{} cells of {:.1} m at row {}, column {}; {:.0} to {:.0} m. {learned}.",
            e.rows,
            e.cols,
            s.source.dem.cell_size().mean(),
            e.row,
            e.col,
            range.low(),
            range.high(),
        ))
        .figures([
            Figure::new(&pictures.exemplar, "The exemplar"),
            Figure::new(&pictures.lines, "Its ridges and valleys"),
            Figure::new(&pictures.rebuilt, "Rebuilt from them"),
        ])
        .figure(pictures.curves.clone(), "The losses while training")
}

/// Unit heights of a rebuilt patch in metres.
fn metres(patch: &Rebuilt, unit: &Grid<f32>, results: &DemoResults) -> Result<Dem> {
    let range: Normalization = patch.normalization;
    Dem::new(range.denormalize(unit), results.compared.cell_size())
}

fn comparison(patch: &Rebuilt, results: &DemoResults) -> Result<Picture> {
    let truth = metres(patch, &patch.truth, results)?;
    let relief = Relief::with_palette(palette(results.styles[0].name)).scaled(SHEET_SCALE).fixed_for(&truth);
    let drawn = relief.draw(&truth)?;
    let mut lined = drawn.clone();
    LineArt::from(&patch.lines).overlay(&mut lined, &LineStyle::default())?;
    let mut sheet = Sheet::new(3)
        .title(format!("{}, row {}, column {}", results.styles[0].name, patch.origin.row, patch.origin.col))
        .panel(drawn, "truth")
        .panel(lined, "its lines");
    for (name, output) in patch.outputs.iter().filter_map(|(n, o)| Some((n, o.as_ref()?))) {
        sheet = sheet.panel(relief.draw(&metres(patch, output, results)?)?, caption(results, patch, name));
    }
    let bar =
        ColorBar::new(relief.palette, patch.normalization.low(), patch.normalization.high(), "Height, m")?;
    sheet.color_bar(bar).scale_bar(results.compared.cell_size().x() / SHEET_SCALE as f64).draw()
}

/// Coarse, detailed, true side by side.
fn detail(patch: &Rebuilt, results: &DemoResults) -> Result<Picture> {
    let truth = metres(patch, &patch.truth, results)?;
    let relief = Relief::with_palette(palette(results.styles[0].name)).scaled(SCALE).fixed_for(&truth);
    let mut sheet = Sheet::new(3).title("What the detail adds");
    let uses = results.styles[0].style.uses();
    for (name, output) in patch.outputs.iter().filter_map(|(n, o)| Some((n, o.as_ref()?))) {
        if uses.iter().any(|(known, _)| known == name) {
            sheet =
                sheet.panel(relief.draw(&metres(patch, output, results)?)?, caption(results, patch, name));
        }
    }
    sheet.panel(relief.draw(&truth)?, "truth").draw()
}

fn errors(patch: &Rebuilt, results: &DemoResults) -> Result<Picture> {
    let truth = metres(patch, &patch.truth, results)?;
    let outputs: Vec<(&String, Dem)> = patch
        .outputs
        .iter()
        .filter_map(|(name, output)| Some((name, output.as_ref()?)))
        .map(|(name, output)| Ok((name, metres(patch, output, results)?)))
        .collect::<Result<_>>()?;
    // One scale for all, so that colours can be compared.
    let mut limit = 0.0f64;
    for (name, output) in &outputs {
        if name.as_str() != "nearest" {
            limit = limit.max(error_limit(output.heights(), truth.heights(), &patch.valid)?);
        }
    }
    let mut sheet = Sheet::new(3).title("Height error, output - truth");
    for (name, output) in &outputs {
        let map = error_map(output.heights(), truth.heights(), &patch.valid, limit, SHEET_SCALE)?;
        sheet = sheet.panel(map, caption(results, patch, name));
    }
    sheet.color_bar(ColorBar::difference(limit, "m")?).draw()
}

fn caption(results: &DemoResults, patch: &Rebuilt, system: &str) -> String {
    let rows = results.evaluation.rows.iter();
    let row =
        rows.filter(|r| r.row == patch.origin.row && r.col == patch.origin.col).find(|r| r.system == system);
    match row.and_then(|r| r.scores.as_ref()) {
        Some(s) => match s.ssim {
            Some(ssim) => format!("{system}: SSIM {ssim:.3}, {:.1} dB", s.psnr),
            None => format!("{system}: {:.1} dB", s.psnr),
        },
        None => system.to_owned(),
    }
}

fn scores(
    results: &DemoResults,
    quantity: &str,
    decimals: usize,
    value: impl Fn(&crate::metrics::Scores) -> Option<f64>,
) -> Result<Svg> {
    let rows = &results.evaluation.rows;
    let title = format!("{}: {} patches", results.styles[0].name, results.evaluation.patches.len());
    let mut plot = ScorePlot::new(title, quantity, Better::Higher).decimals(decimals).highlight("gnn");
    for line in aggregate(rows) {
        let of_system = rows.iter().filter(|r| r.system == line.system).filter_map(|r| r.scores.as_ref());
        plot = plot.system(line.system.clone(), of_system.filter_map(&value).collect::<Vec<_>>());
    }
    plot.draw()
}
