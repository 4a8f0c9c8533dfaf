//! Several pictures side by side on one sheet, with words.
//!
//! Panels of one size -> grid with title, column and row heads, captions, and a footer of scale bar, colour bars and
//! keys -> one [`Picture`].

use super::legend::{ColorBar, INK, Legend, SOFT_INK};
use super::lettering::{Direction, Lettering, Weight};
use super::{Picture, Rgb};
use crate::error::{Error, Result};

/// The white of a sheet.
const SHEET: Rgb = Rgb::hex(0xfd_fc_fa);
/// The thin frame around a panel.
const FRAME: Rgb = Rgb::hex(0x9a_9c_a0);

/// A sheet in the making.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sheet {
    columns: usize,
    title: String,
    subtitle: String,
    panels: Vec<(Picture, String)>,
    column_heads: Vec<String>,
    row_heads: Vec<String>,
    legends: Vec<Legend>,
}

impl Sheet {
    /// An empty sheet with `columns` panels per row.
    #[must_use]
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            columns,
            title: String::new(),
            subtitle: String::new(),
            panels: Vec::new(),
            column_heads: Vec::new(),
            row_heads: Vec::new(),
            legends: Vec::new(),
        }
    }

    /// Large words at the top.
    #[must_use]
    pub(crate) fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Smaller words below the title.
    #[must_use]
    pub(crate) fn subtitle(mut self, subtitle: impl Into<String>) -> Self {
        self.subtitle = subtitle.into();
        self
    }

    /// The next panel, row by row, and the words below it (may be empty).
    #[must_use]
    pub(crate) fn panel(mut self, picture: Picture, caption: impl Into<String>) -> Self {
        self.panels.push((picture, caption.into()));
        self
    }

    /// Words above each column.
    #[must_use]
    pub(crate) fn column_heads<T: Into<String>>(mut self, heads: impl IntoIterator<Item = T>) -> Self {
        self.column_heads = heads.into_iter().map(Into::into).collect();
        self
    }

    /// Words at the left of each row, running upwards.
    #[must_use]
    pub(crate) fn row_heads<T: Into<String>>(mut self, heads: impl IntoIterator<Item = T>) -> Self {
        self.row_heads = heads.into_iter().map(Into::into).collect();
        self
    }

    /// A colour bar in the footer.
    #[must_use]
    pub(crate) fn color_bar(mut self, bar: ColorBar) -> Self {
        self.legends.push(Legend::Bar(bar));
        self
    }

    /// A scale bar in the footer, for panels in which a pixel is `metres` wide on the ground.
    #[must_use]
    pub(crate) fn scale_bar(mut self, metres: f64) -> Self {
        self.legends.push(Legend::Scale(metres));
        self
    }

    /// A key in the footer: colours and what they mean.
    #[must_use]
    pub(crate) fn key<T: Into<String>>(mut self, entries: impl IntoIterator<Item = (Rgb, T)>) -> Self {
        self.legends.push(Legend::Key(entries.into_iter().map(|(c, name)| (c, name.into())).collect()));
        self
    }

    /// The sheet. Text grows with the panels and with the sheet's width, from 13 to 26 pixels.
    ///
    /// # Errors
    /// When there is no column or no panel, panels differ in shape, heads do not fit the grid, or a scale is not
    /// positive and finite.
    pub(crate) fn draw(&self) -> Result<Picture> {
        self.check()?;
        let plan = Plan::of(self);
        let mut sheet = Picture::filled(plan.rows, plan.cols, SHEET);
        let left = plan.margin + plan.row_head;
        let mut top = plan.margin;
        for line in &plan.title {
            top += plan.title_text.line_height();
            let baseline = top - plan.title_text.line_height() / 3;
            plan.title_text.write(&mut sheet, baseline, plan.margin, line, Direction::Across);
        }
        for line in &plan.subtitle {
            top += plan.soft_text.line_height();
            let baseline = top - plan.soft_text.line_height() / 3;
            plan.soft_text.write(&mut sheet, baseline, plan.margin, line, Direction::Across);
        }
        if plan.title.len() + plan.subtitle.len() > 0 {
            top += plan.gap / 2;
        }
        for (column, lines) in plan.column_heads.iter().enumerate() {
            for (i, line) in lines.iter().enumerate() {
                // Heads stand on the panels: the last line is always the lowest.
                let up = (lines.len() - 1 - i) * plan.head_text.line_height();
                let baseline = top + plan.column_head - up - plan.head_text.line_height() / 2;
                let col = left + column * (plan.panel.1 + plan.gap);
                plan.head_text.write(&mut sheet, baseline, col, line, Direction::Across);
            }
        }
        top += plan.column_head;
        for (row, panels) in self.panels.chunks(self.columns).enumerate() {
            if let Some(head) = self.row_heads.get(row) {
                let start = top + (plan.panel.0 + plan.head_text.width(head)) / 2;
                let baseline = plan.margin + plan.head_text.line_height() * 2 / 3;
                plan.head_text.write(&mut sheet, start, baseline, head, Direction::Up);
            }
            for (column, (picture, _)) in panels.iter().enumerate() {
                let col = left + column * (plan.panel.1 + plan.gap);
                sheet.fill(top - 1, col - 1, plan.panel.0 + 2, plan.panel.1 + 2, FRAME);
                sheet.paste(picture, top, col);
                for (i, line) in plan.captions[row * self.columns + column].iter().enumerate() {
                    let baseline = top + plan.panel.0 + (i + 1) * plan.text.line_height();
                    plan.text.write(&mut sheet, baseline, col, line, Direction::Across);
                }
            }
            top += plan.panel.0 + plan.caption_height(row) + plan.gap;
        }
        for (legend, &(row, col)) in self.legends.iter().zip(&plan.legends) {
            legend.draw(&mut sheet, top + row, plan.margin + col, plan.text.size);
        }
        Ok(sheet)
    }

    fn check(&self) -> Result<()> {
        let first = match self.panels.first() {
            Some((picture, _)) if self.columns > 0 => picture.shape(),
            _ => {
                let found = format!("{} panels in {} columns", self.panels.len(), self.columns);
                return Err(Error::value("sheet", found, "allowed: at least one of each"));
            }
        };
        for (i, (picture, _)) in self.panels.iter().enumerate() {
            if picture.shape() != first {
                let found = format!("{}x{}", picture.rows(), picture.cols());
                let allowed = format!("allowed: {}x{}, the shape of panel 0", first.0, first.1);
                return Err(Error::value(format!("panel {i} of the sheet"), found, allowed));
            }
        }
        let rows = self.panels.len().div_ceil(self.columns);
        for (name, found, most) in [
            ("column heads", self.column_heads.len(), self.columns),
            ("row heads", self.row_heads.len(), rows),
        ] {
            if found > most {
                return Err(Error::value(
                    format!("number of {name}"),
                    found,
                    format!("allowed: up to {most}"),
                ));
            }
        }
        for legend in &self.legends {
            if let Legend::Scale(metres) = *legend
                && !(metres.is_finite() && metres > 0.0)
            {
                return Err(Error::value("metres a pixel", metres, "allowed: positive and finite"));
            }
        }
        Ok(())
    }
}

/// Where everything goes.
struct Plan {
    rows: usize,
    cols: usize,
    margin: usize,
    gap: usize,
    /// (rows, cols) of a panel.
    panel: (usize, usize),
    row_head: usize,
    column_head: usize,
    columns: usize,
    title: Vec<String>,
    subtitle: Vec<String>,
    column_heads: Vec<Vec<String>>,
    captions: Vec<Vec<String>>,
    /// (row, column) of each legend, from the north-west corner of the footer.
    legends: Vec<(usize, usize)>,
    title_text: Lettering,
    head_text: Lettering,
    soft_text: Lettering,
    text: Lettering,
}

impl Plan {
    fn of(sheet: &Sheet) -> Self {
        let panel = sheet.panels[0].0.shape();
        let used = sheet.columns.min(sheet.panels.len());
        let size = (panel.1 as f32 / 24.0).max((used * panel.1) as f32 / 85.0).clamp(13.0, 26.0);
        let title_text = Lettering::new(size * 1.5, Weight::SemiBold, INK);
        let head_text = Lettering::new(size, Weight::SemiBold, INK);
        let soft_text = Lettering::new(size, Weight::Regular, SOFT_INK);
        let text = Lettering::new(size, Weight::Regular, INK);
        let margin = (size * 1.8) as usize;
        let gap = (size * 1.1) as usize;
        let row_head = if sheet.row_heads.is_empty() { 0 } else { head_text.line_height() + gap / 2 };
        // A single narrow panel still leaves room for its legends.
        let widest = sheet.legends.iter().map(|l| l.shape(size).1).max().unwrap_or(0);
        let content = (row_head + used * panel.1 + (used - 1) * gap).max(widest);
        let wrap_all = |heads: &[String]| -> Vec<Vec<String>> {
            heads.iter().map(|head| head_text.wrap(head, panel.1)).collect()
        };
        let column_heads = wrap_all(&sheet.column_heads);
        let deepest = column_heads.iter().map(Vec::len).max().unwrap_or(0);
        let column_head =
            if deepest == 0 { 0 } else { deepest * head_text.line_height() + head_text.line_height() / 4 };
        let captions = sheet.panels.iter().map(|(_, caption)| text.wrap(caption, panel.1)).collect();
        let mut plan = Self {
            rows: 0,
            cols: 2 * margin + content,
            margin,
            gap,
            panel,
            row_head,
            column_head,
            columns: sheet.columns,
            title: title_text.wrap(&sheet.title, content),
            subtitle: soft_text.wrap(&sheet.subtitle, content),
            column_heads,
            captions,
            legends: Vec::new(),
            title_text,
            head_text,
            soft_text,
            text,
        };
        let footer = plan.place_legends(&sheet.legends, content);
        let grid_rows = sheet.panels.len().div_ceil(sheet.columns);
        let headings =
            plan.title.len() * title_text.line_height() + plan.subtitle.len() * soft_text.line_height();
        let below = if headings > 0 { gap / 2 } else { 0 };
        let grid: usize = (0..grid_rows).map(|row| panel.0 + plan.caption_height(row) + gap).sum();
        plan.rows = 2 * margin + headings + below + column_head + grid - gap + footer;
        plan
    }

    /// Height of the captions under a row of panels.
    fn caption_height(&self, row: usize) -> usize {
        let row_captions = self.captions.iter().skip(row * self.columns).take(self.columns);
        let lines = row_captions.map(Vec::len).max().unwrap_or(0);
        lines * self.text.line_height() + if lines > 0 { self.text.line_height() / 3 } else { 0 }
    }

    /// Lets the legends flow from left to right, then down; returns the footer's height with the gap above it.
    fn place_legends(&mut self, legends: &[Legend], content: usize) -> usize {
        let (mut row, mut col, mut tallest) = (0, 0, 0);
        for legend in legends {
            let (height, width) = legend.shape(self.text.size);
            if col > 0 && col + width > content {
                (row, col, tallest) = (row + tallest + self.gap, 0, 0);
            }
            self.legends.push((row, col));
            col += width + 2 * self.gap;
            tallest = tallest.max(height);
        }
        if legends.is_empty() { 0 } else { self.gap + row + tallest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Cell;

    fn panel(colour: u32) -> Picture {
        Picture::filled(120, 160, Rgb::hex(colour))
    }

    #[test]
    fn every_panel_is_on_the_sheet_whole_and_unchanged() {
        let colours = [0xaa_10_10, 0x10_aa_10, 0x10_10_aa, 0x77_77_10, 0x10_77_77];
        let mut sheet = Sheet::new(3)
            .title("A title that is rather long and has to be broken into several lines to fit the sheet")
            .column_heads(["one", "two, which is so long that it needs several lines", "three"])
            .row_heads(["first", "second"])
            .color_bar(ColorBar::difference(20.0, "Error, m").unwrap())
            .scale_bar(22.5)
            .key([(Rgb::BLACK, "ridge"), (Rgb::WHITE, "valley")]);
        for colour in colours {
            sheet = sheet.panel(panel(colour), "a caption");
        }
        let drawn = sheet.draw().unwrap();
        for colour in colours {
            let cells: Vec<Cell> =
                drawn.pixels().cells().filter(|(_, p)| **p == Rgb::hex(colour)).map(|(c, _)| c).collect();
            assert_eq!(cells.len(), 120 * 160, "{colour:06x}");
            let (a, b) = (cells[0], cells[cells.len() - 1]);
            assert_eq!((b.row - a.row, b.col - a.col), (119, 159));
        }
        // Nothing is cut: the outermost ring is blank.
        for (cell, &pixel) in drawn.pixels().cells() {
            if cell.row < 5 || cell.col < 5 || cell.row + 5 >= drawn.rows() || cell.col + 5 >= drawn.cols() {
                assert_eq!(pixel, SHEET, "{cell:?}");
            }
        }
        assert_eq!(drawn, sheet.draw().unwrap());
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let fails = |sheet: Sheet, words: &str| {
            let message = sheet.draw().unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        };
        fails(Sheet::new(2), "0 panels");
        fails(Sheet::new(0).panel(panel(0), ""), "0 columns");
        let odd = Picture::filled(3, 3, Rgb::BLACK);
        fails(Sheet::new(2).panel(panel(0), "").panel(odd, ""), "panel 1 of the sheet is 3x3");
        fails(Sheet::new(1).panel(panel(0), "").column_heads(["a", "b"]), "column heads is 2");
        fails(Sheet::new(1).panel(panel(0), "").scale_bar(0.0), "metres a pixel");
    }
}
