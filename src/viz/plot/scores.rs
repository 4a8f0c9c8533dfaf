//! Scores of several systems, every single one shown.

use super::axis::Axis;
use super::canvas::{Anchor, Canvas, GRID, INK, SERIES, SOFT_INK, Words, draw};
use super::svg::Svg;
use crate::error::{Error, Result};
use crate::viz::Rgb;
use crate::viz::ticks::number;

/// Which scores are good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Better {
    /// High ones.
    Higher,
    /// Low ones.
    Lower,
}

/// A row for each system: every score as a point, a box from the lower to the upper quartile with the median, whiskers
/// to the last score within 1.5 box lengths (Tukey 1977), a diamond at the mean, and mean ± standard deviation in
/// figures. Fewer than 5 scores get no box: quartiles of so few say nothing.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ScorePlot {
    title: String,
    quantity: String,
    better: Better,
    decimals: usize,
    systems: Vec<(String, Vec<f64>)>,
    highlight: Option<String>,
    marks: Vec<(String, f64)>,
}

const WIDTH: f64 = 860.0;
const RIGHT: f64 = 640.0;
const TOP: f64 = 62.0;
const ROW: f64 = 38.0;

impl ScorePlot {
    /// No systems yet; `quantity` names the score with its unit.
    #[must_use]
    pub(crate) fn new(title: impl Into<String>, quantity: impl Into<String>, better: Better) -> Self {
        Self {
            title: title.into(),
            quantity: quantity.into(),
            better,
            decimals: 2,
            systems: Vec::new(),
            highlight: None,
            marks: Vec::new(),
        }
    }

    /// A value from elsewhere to stand beside the scores: a line across all rows with its name.
    #[must_use]
    pub(crate) fn mark(mut self, name: impl Into<String>, value: f64) -> Self {
        self.marks.push((name.into(), value));
        self
    }

    /// How many decimals the figures have; 2 when not said.
    #[must_use]
    pub(crate) fn decimals(self, decimals: usize) -> Self {
        Self { decimals, ..self }
    }

    /// One more system with its scores.
    #[must_use]
    pub(crate) fn system(mut self, name: impl Into<String>, scores: impl IntoIterator<Item = f64>) -> Self {
        self.systems.push((name.into(), scores.into_iter().collect()));
        self
    }

    /// The system to be drawn in colour.
    #[must_use]
    pub(crate) fn highlight(self, name: impl Into<String>) -> Self {
        Self { highlight: Some(name.into()), ..self }
    }

    /// The drawing.
    ///
    /// # Errors
    /// When there is no system, one has no scores, a score is not finite, or the highlighted one is not there.
    pub(crate) fn draw(&self) -> Result<Svg> {
        self.check()?;
        let bottom = TOP + self.systems.len() as f64 * ROW;
        let direction = match self.better {
            Better::Higher => "higher is better →",
            Better::Lower => "← lower is better",
        };
        let names: Vec<&str> = self.systems.iter().map(|(name, _)| name.as_str()).collect();
        let description = format!("{}: {} of {}", self.title, self.quantity, names.join(", "));
        // Names stand left of the axis; without the viewer's font their width is a guess on the wide side.
        let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        let left = (longest as f64 * 7.4 + 40.0).clamp(120.0, 360.0);
        Ok(draw(WIDTH as u32, (bottom + 62.0) as u32, description, |canvas| {
            let scores = self.systems.iter().flat_map(|(_, s)| s.iter().copied());
            let x = Axis::around(scores.chain(self.marks.iter().map(|m| m.1)), false, left, RIGHT);
            canvas.text((20.0, 26.0), &self.title, Words::new(17.0, INK, Anchor::Left).bold());
            for (at, name) in x.marks(7) {
                canvas.line(&[(at, TOP), (at, bottom)], GRID, 1.0);
                canvas.text((at, bottom + 16.0), &name, Words::new(12.0, SOFT_INK, Anchor::Middle));
            }
            for (i, (name, value)) in self.marks.iter().enumerate() {
                let (at, top) = (x.at(*value), TOP - 14.0 * i as f64);
                canvas.line(&[(at, top), (at, bottom)], SERIES[6], 1.6);
                let anchor = if at > (left + RIGHT) / 2.0 { Anchor::Right } else { Anchor::Left };
                let aside = if anchor == Anchor::Right { -6.0 } else { 6.0 };
                canvas.text((at + aside, top - 7.0), name, Words::new(12.0, SERIES[6], anchor));
            }
            let below = ((left + RIGHT) / 2.0, bottom + 38.0);
            let heading = format!("{}   ({direction})", self.quantity);
            canvas.text(below, &heading, Words::new(13.0, INK, Anchor::Middle).bold());
            canvas.text((RIGHT + 22.0, TOP - 10.0), "mean ± sd", Words::new(12.0, SOFT_INK, Anchor::Left));
            for (i, (name, scores)) in self.systems.iter().enumerate() {
                let y = TOP + (i as f64 + 0.5) * ROW;
                let chosen = self.highlight.as_deref() == Some(name);
                let colour = if chosen { SERIES[1] } else { SERIES[0] };
                let words = Words::new(13.0, INK, Anchor::Right);
                canvas.text((left - 14.0, y), name, if chosen { words.bold() } else { words });
                self.paint_row(canvas, &x, y, scores, colour, chosen);
            }
        }))
    }

    fn paint_row(&self, canvas: &Canvas<'_>, x: &Axis, y: f64, scores: &[f64], colour: Rgb, chosen: bool) {
        let summary = Summary::of(scores);
        if scores.len() >= 5 {
            let [low, lower, median, upper, high] = summary.five.map(|v| x.at(v));
            canvas.line(&[(low, y), (lower, y)], colour, 1.4);
            canvas.line(&[(upper, y), (high, y)], colour, 1.4);
            for end in [low, high] {
                canvas.line(&[(end, y - 5.0), (end, y + 5.0)], colour, 1.4);
            }
            canvas.block((lower, y - 10.0), (upper, y + 10.0), colour, 0.22);
            canvas.line(&[(median, y - 10.0), (median, y + 10.0)], colour, 2.4);
        }
        for (i, &score) in scores.iter().enumerate() {
            // The golden ratio spreads neighbours without chance: the same scores give the same picture.
            let jitter = (i as f64 * 0.618_033_988_75).fract() - 0.5;
            canvas.disc((x.at(score), y + 15.0 * jitter), 2.3, colour, 0.6);
        }
        let (mean, r) = (x.at(summary.mean), 5.5);
        let ring = [(mean - r, y), (mean, y - r), (mean + r, y), (mean, y + r)];
        canvas.polygon(&ring, INK);
        let core = ring.map(|(px, py)| (mean + (px - mean) * 0.6, y + (py - y) * 0.6));
        canvas.polygon(&core, colour);
        let figures = match summary.deviation {
            Some(sd) => format!("{} ± {}", number(summary.mean, self.decimals), number(sd, self.decimals)),
            None => number(summary.mean, self.decimals),
        };
        let words = Words::new(13.0, INK, Anchor::Left);
        canvas.text((RIGHT + 22.0, y), &figures, if chosen { words.bold() } else { words });
        let count = format!("n = {}", scores.len());
        canvas.text((WIDTH - 20.0, y), &count, Words::new(12.0, SOFT_INK, Anchor::Right));
    }

    fn check(&self) -> Result<()> {
        if self.systems.is_empty() {
            return Err(Error::value("number of systems", 0, "a plot of scores needs at least one"));
        }
        for (name, scores) in &self.systems {
            if scores.is_empty() {
                return Err(Error::value(format!("number of scores of \"{name}\""), 0, "at least one"));
            }
            if let Some((i, bad)) = scores.iter().enumerate().find(|(_, s)| !s.is_finite()) {
                return Err(Error::value(format!("score {i} of \"{name}\""), bad, "allowed: finite numbers"));
            }
        }
        if let Some((name, bad)) = self.marks.iter().find(|(_, value)| !value.is_finite()) {
            return Err(Error::value(format!("mark \"{name}\""), bad, "allowed: finite numbers"));
        }
        match &self.highlight {
            Some(name) if !self.systems.iter().any(|(n, _)| n == name) => {
                Err(Error::value("highlighted system", name, "allowed: one of the systems in the plot"))
            }
            _ => Ok(()),
        }
    }
}

/// What a row shows besides the scores themselves.
struct Summary {
    /// Lower whisker, lower quartile, median, upper quartile, upper whisker.
    five: [f64; 5],
    mean: f64,
    /// Sample standard deviation; none for a single score.
    deviation: Option<f64>,
}

impl Summary {
    fn of(scores: &[f64]) -> Self {
        let mut sorted = scores.to_vec();
        sorted.sort_by(f64::total_cmp);
        let quantile = |q: f64| {
            let at = q * (sorted.len() - 1) as f64;
            let (below, above) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
            below + (above - below) * at.fract()
        };
        let (lower, median, upper) = (quantile(0.25), quantile(0.5), quantile(0.75));
        let reach = 1.5 * (upper - lower);
        let low = sorted.iter().copied().find(|&s| s >= lower - reach).unwrap_or(lower);
        let high = sorted.iter().rev().copied().find(|&s| s <= upper + reach).unwrap_or(upper);
        let n = scores.len() as f64;
        let mean = scores.iter().sum::<f64>() / n;
        let squares = scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>();
        let deviation = (scores.len() > 1).then(|| (squares / (n - 1.0)).sqrt());
        Self { five: [low, lower, median, upper, high], mean, deviation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_is_the_textbook_one() {
        let summary = Summary::of(&[9.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 40.0]);
        assert_eq!(summary.five, [1.0, 3.25, 5.5, 7.75, 9.0]);
        assert_eq!(summary.mean, 8.5);
        // Sum of squares 1885, less 10 x 8.5^2.
        let expected = (1162.5f64 / 9.0).sqrt();
        assert!((summary.deviation.unwrap() - expected).abs() < 1e-12);
        assert_eq!(Summary::of(&[3.0]).deviation, None);
    }

    #[test]
    fn every_score_is_a_point_and_the_figures_are_there() {
        let scores: Vec<f64> = (0..24).map(|i| 30.0 + f64::from(i) * 0.1).collect();
        let plot = ScorePlot::new("Alps", "PSNR, dB", Better::Higher)
            .system("laplace", scores.clone())
            .system("few", [29.0, 31.0])
            .highlight("few");
        let file = plot.draw().unwrap().standalone();
        assert_eq!(file.matches("<circle").count(), 26);
        for words in ["31.15 ± 0.71", "30.00 ± 1.41", "n = 24", "n = 2", "higher is better", "PSNR, dB"] {
            assert!(file.contains(words), "{words}");
        }
        assert_eq!(file, plot.draw().unwrap().standalone());
        let marked = plot.mark("printed: 18.1", 18.1).draw().unwrap().standalone();
        assert!(marked.contains("printed: 18.1") && marked.matches("<circle").count() == 26);
    }

    #[test]
    fn bad_input_is_named() {
        let empty = ScorePlot::new("t", "q", Better::Lower);
        assert!(empty.clone().draw().is_err());
        let message = |plot: ScorePlot| plot.draw().unwrap_err().to_string();
        assert!(message(empty.clone().system("a", [])).contains("scores of \"a\""));
        assert!(message(empty.clone().system("a", [f64::NAN])).contains("score 0 of \"a\""));
        assert!(message(empty.system("a", [1.0]).highlight("b")).contains("highlighted system is b"));
    }
}
