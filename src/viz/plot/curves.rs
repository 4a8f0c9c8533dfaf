//! Curves over a common x axis: how training went.

use super::axis::Axis;
use super::canvas::{Anchor, Canvas, GRID, INK, SERIES, SOFT_INK, Words, draw};
use super::svg::Svg;
use crate::error::{Error, Result};

/// One curve: (x, y) in rising x.
#[derive(Clone, Debug, PartialEq)]
struct Series {
    name: String,
    points: Vec<(f64, f64)>,
}

/// Curves of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Panel {
    quantity: String,
    log: bool,
    series: Vec<Series>,
}

impl Panel {
    /// An empty panel; `quantity` names the y axis with its unit ("PSNR, dB").
    #[must_use]
    pub(crate) fn new(quantity: impl Into<String>) -> Self {
        Self { quantity: quantity.into(), log: false, series: Vec::new() }
    }

    /// The same panel with a logarithmic y axis. Values of 0 or less have no place there: they are left out, and the
    /// plot says how many.
    #[must_use]
    pub(crate) fn log(self) -> Self {
        Self { log: true, ..self }
    }

    /// One more curve, through `points` (x, y) in the order given.
    #[must_use]
    pub(crate) fn curve(
        mut self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        self.series.push(Series { name: name.into(), points: points.into_iter().collect() });
        self
    }

    fn drawable(&self, y: f64) -> bool {
        !self.log || y > 0.0
    }
}

/// Panels of curves: the first one wide, the others below it, two a row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curves {
    title: String,
    x: String,
    panels: Vec<Panel>,
}

const WIDTH: f64 = 860.0;
const LEFT: f64 = 66.0;
const LABELS: f64 = 132.0;
const WIDE: f64 = 300.0;
const NARROW: f64 = 190.0;
const BELOW: f64 = 52.0;
const ABOVE: f64 = 30.0;

/// Where a panel's axes meet and end, in pixels.
struct Frame {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Curves {
    /// No panels yet; `x` names the common axis ("epoch").
    #[must_use]
    pub(crate) fn new(title: impl Into<String>, x: impl Into<String>) -> Self {
        Self { title: title.into(), x: x.into(), panels: Vec::new() }
    }

    /// One more panel.
    #[must_use]
    pub(crate) fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// The drawing.
    ///
    /// # Errors
    /// When there is no panel, a panel has no curve or a value is not finite.
    pub(crate) fn draw(&self) -> Result<Svg> {
        self.check()?;
        let rows = (self.panels.len() - 1).div_ceil(2);
        let height = 46.0 + ABOVE + WIDE + BELOW + rows as f64 * (ABOVE + NARROW + BELOW);
        let names: Vec<&str> = self.panels.iter().map(|p| p.quantity.as_str()).collect();
        let description = format!("{}: {} by {}", self.title, names.join("; "), self.x);
        Ok(draw(WIDTH as u32, height as u32, description, |canvas| {
            canvas.text((20.0, 26.0), &self.title, Words::new(17.0, INK, Anchor::Left).bold());
            let wide =
                Frame { left: LEFT, right: WIDTH - LABELS, top: 46.0 + ABOVE, bottom: 46.0 + ABOVE + WIDE };
            self.paint(canvas, &self.panels[0], &wide);
            for (i, panel) in self.panels.iter().enumerate().skip(1) {
                let (row, col) = ((i - 1) / 2, (i - 1) % 2);
                let top = wide.bottom + BELOW + ABOVE + row as f64 * (ABOVE + NARROW + BELOW);
                let left = LEFT + col as f64 * WIDTH / 2.0;
                // One narrow curve is named by its axis, several need room for labels.
                let right = (col + 1) as f64 * WIDTH / 2.0 - if panel.series.len() > 1 { 96.0 } else { 24.0 };
                self.paint(canvas, panel, &Frame { left, right, top, bottom: top + NARROW });
            }
        }))
    }

    fn check(&self) -> Result<()> {
        if self.panels.is_empty() {
            return Err(Error::value("number of panels", 0, "a plot of curves needs at least one"));
        }
        for panel in &self.panels {
            if panel.series.is_empty() {
                let name = format!("number of curves of \"{}\"", panel.quantity);
                return Err(Error::value(name, 0, "a panel needs at least one"));
            }
            for series in &panel.series {
                if let Some((i, (x, y))) =
                    series.points.iter().enumerate().find(|(_, (x, y))| !(x.is_finite() && y.is_finite()))
                {
                    let name = format!("point {i} of curve \"{}\"", series.name);
                    return Err(Error::value(name, format!("{x}, {y}"), "allowed: finite numbers"));
                }
            }
        }
        Ok(())
    }

    fn paint(&self, canvas: &Canvas<'_>, panel: &Panel, frame: &Frame) {
        let xs = || self.panels.iter().flat_map(|p| &p.series).flat_map(|s| s.points.iter().map(|p| p.0));
        let ys = panel.series.iter().flat_map(|s| s.points.iter().map(|p| p.1));
        let x = Axis::exactly(xs(), frame.left, frame.right);
        let y = Axis::around(ys.filter(|&y| panel.drawable(y)), panel.log, frame.bottom, frame.top);
        let small = |anchor| Words::new(12.0, SOFT_INK, anchor);
        for (at, name) in y.marks(((frame.bottom - frame.top) / 36.0) as usize) {
            canvas.line(&[(frame.left, at), (frame.right, at)], GRID, 1.0);
            canvas.text((frame.left - 9.0, at), &name, small(Anchor::Right));
        }
        for (at, name) in x.marks(((frame.right - frame.left) / 80.0) as usize) {
            canvas.line(&[(at, frame.bottom), (at, frame.bottom + 5.0)], SOFT_INK, 1.0);
            canvas.text((at, frame.bottom + 16.0), &name, small(Anchor::Middle));
        }
        canvas.line(&[(frame.left, frame.bottom), (frame.right, frame.bottom)], SOFT_INK, 1.0);
        canvas.text(((frame.left + frame.right) / 2.0, frame.bottom + 35.0), &self.x, small(Anchor::Middle));
        let log = if panel.log { " (log scale)" } else { "" };
        let heading = format!("{}{log}", panel.quantity);
        canvas.text(
            (frame.left - 46.0, frame.top - 16.0),
            &heading,
            Words::new(13.0, INK, Anchor::Left).bold(),
        );
        let (mut labels, mut notes) = (Vec::new(), Vec::new());
        for (i, series) in panel.series.iter().enumerate() {
            let colour = SERIES[i % SERIES.len()];
            let mut shown: Vec<(f64, f64)> = Vec::new();
            // A value that a logarithmic axis cannot show interrupts the curve.
            for run in series.points.split(|p| !panel.drawable(p.1)) {
                shown = run.iter().map(|p| (x.at(p.0), y.at(p.1))).collect::<Vec<_>>();
                match shown.as_slice() {
                    [] => {}
                    [only] => canvas.disc(*only, 2.0, colour, 1.0),
                    many => canvas.line(many, colour, 1.7),
                }
            }
            let hidden = series.points.iter().filter(|p| !panel.drawable(p.1)).count();
            if hidden > 0 {
                notes.push(format!("{}: {hidden} values of 0 or less not shown", series.name));
            }
            let end = shown.last().map_or(frame.bottom, |p| p.1);
            labels.push((end, series.name.clone(), colour));
        }
        if !notes.is_empty() {
            canvas.text((frame.right, frame.top - 16.0), &notes.join("; "), small(Anchor::Right));
        }
        if panel.series.len() > 1 {
            for (at, name, colour) in spread(labels, frame.top, frame.bottom) {
                canvas.text((frame.right + 8.0, at), &name, Words::new(12.0, colour, Anchor::Left).bold());
            }
        }
    }
}

/// Moves labels apart so that none overlaps another, as near to where they belong as their order allows.
fn spread<T>(mut labels: Vec<(f64, String, T)>, top: f64, bottom: f64) -> Vec<(f64, String, T)> {
    const LINE: f64 = 15.0;
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut free = top;
    for label in &mut labels {
        label.0 = label.0.max(free);
        free = label.0 + LINE;
    }
    let mut limit = bottom.max(top + LINE * labels.len() as f64);
    for label in labels.iter_mut().rev() {
        label.0 = label.0.min(limit);
        limit = label.0 - LINE;
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(factor: f64) -> Vec<(f64, f64)> {
        (0..40).map(|i| (f64::from(i), factor / f64::from(i + 1))).collect()
    }

    #[test]
    fn a_plot_names_axes_and_curves_and_repeats() {
        let plot = || {
            Curves::new("Training of <alps>", "epoch")
                .panel(Panel::new("loss").log().curve("height", curve(1.0)).curve("SSIM", curve(0.3)))
                .panel(Panel::new("SSIM").curve("SSIM", curve(1.0)))
                .panel(Panel::new("PSNR, dB").curve("PSNR", curve(30.0)))
                .draw()
                .unwrap()
        };
        let file = plot().standalone();
        for words in ["Training of &lt;alps&gt;", "epoch", "loss (log scale)", "height", "PSNR, dB", "0.01"] {
            assert!(file.contains(words), "{words}");
        }
        assert!(!file.contains("<alps>"));
        assert_eq!(file, plot().standalone());
        assert!(!plot().inline().contains("http"));
    }

    #[test]
    fn zeros_on_a_log_axis_are_counted_in_a_note() {
        let mut points = curve(1.0);
        points[3].1 = 0.0;
        points[7].1 = 0.0;
        let panel = Panel::new("loss").log().curve("further", points).curve("other", curve(2.0));
        let file = Curves::new("t", "epoch").panel(panel).draw().unwrap().standalone();
        assert!(file.contains("further: 2 values of 0 or less not shown"));
    }

    #[test]
    fn bad_input_is_named() {
        let fails = |plot: Curves, words: &str| {
            let message = plot.draw().unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        };
        fails(Curves::new("t", "x"), "number of panels");
        fails(Curves::new("t", "x").panel(Panel::new("loss")), "loss");
        let broken = Panel::new("loss").curve("height", [(0.0, 1.0), (1.0, f64::NAN)]);
        fails(Curves::new("t", "x").panel(broken), "point 1 of curve \"height\"");
    }

    #[test]
    fn labels_keep_apart_and_inside() {
        let labels = (0..6).map(|i| (95.0 + f64::from(i) * 0.1, String::new(), ())).collect();
        let placed = spread(labels, 0.0, 100.0);
        for pair in placed.windows(2) {
            assert!(pair[1].0 - pair[0].0 >= 15.0 - 1e-9);
        }
        assert!(placed[0].0 >= 0.0 && placed[5].0 <= 100.0);
    }
}
