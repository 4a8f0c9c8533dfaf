//! Points in a plane, in groups told apart by colour.

use super::axis::Axis;
use super::canvas::{Anchor, Canvas, GRID, INK, SERIES, SOFT_INK, Words, draw};
use super::svg::Svg;
use crate::error::{Error, Result};
use crate::viz::Rgb;

/// Points (x, y) in groups.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scatter {
    title: String,
    x: String,
    y: String,
    groups: Vec<Group>,
}

#[derive(Clone, Debug, PartialEq)]
struct Group {
    name: String,
    points: Vec<(f64, f64)>,
    colour: Rgb,
}

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 520.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = 660.0;
const TOP: f64 = 62.0;
const BOTTOM: f64 = 460.0;

impl Scatter {
    /// No points yet; `x` and `y` name the axes with their units.
    #[must_use]
    pub(crate) fn new(title: impl Into<String>, x: impl Into<String>, y: impl Into<String>) -> Self {
        Self { title: title.into(), x: x.into(), y: y.into(), groups: Vec::new() }
    }

    /// One more group, in the next colour.
    #[must_use]
    pub(crate) fn group(self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let colour = SERIES[self.groups.len() % SERIES.len()];
        self.coloured(name, points, colour)
    }

    /// One more group in a colour of its own.
    #[must_use]
    pub(crate) fn coloured(
        mut self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (f64, f64)>,
        colour: Rgb,
    ) -> Self {
        self.groups.push(Group { name: name.into(), points: points.into_iter().collect(), colour });
        self
    }

    /// The drawing.
    ///
    /// # Errors
    /// When there is no point, or one is not finite.
    pub(crate) fn draw(&self) -> Result<Svg> {
        let all = || self.groups.iter().flat_map(|group| group.points.iter().copied());
        if all().next().is_none() {
            return Err(Error::value("number of points", 0, "a plot needs at least one"));
        }
        if let Some((x, y)) = all().find(|(x, y)| !x.is_finite() || !y.is_finite()) {
            return Err(Error::value("point", format!("({x}, {y})"), "allowed: finite numbers"));
        }
        let description = format!("{}: {} by {}", self.title, self.y, self.x);
        Ok(draw(WIDTH as u32, HEIGHT as u32, description, |canvas| {
            canvas.text((20.0, 26.0), &self.title, Words::new(17.0, INK, Anchor::Left).bold());
            let x = Axis::around(all().map(|p| p.0), false, LEFT, RIGHT);
            let y = Axis::around(all().map(|p| p.1), false, BOTTOM, TOP);
            self.frame(canvas, &x, &y);
            for (i, Group { name, points, colour }) in self.groups.iter().enumerate() {
                for &(px, py) in points {
                    canvas.disc((x.at(px), y.at(py)), 3.4, *colour, 0.75);
                }
                let row = TOP + 10.0 + 22.0 * i as f64;
                canvas.disc((RIGHT + 26.0, row), 5.0, *colour, 1.0);
                let words = format!("{name}, n = {}", points.len());
                canvas.text((RIGHT + 38.0, row), &words, Words::new(13.0, INK, Anchor::Left));
            }
        }))
    }

    fn frame(&self, canvas: &Canvas<'_>, x: &Axis, y: &Axis) {
        let small = |anchor| Words::new(12.0, SOFT_INK, anchor);
        for (at, name) in x.marks(7) {
            canvas.line(&[(at, TOP), (at, BOTTOM)], GRID, 1.0);
            canvas.text((at, BOTTOM + 16.0), &name, small(Anchor::Middle));
        }
        for (at, name) in y.marks(6) {
            canvas.line(&[(LEFT, at), (RIGHT, at)], GRID, 1.0);
            canvas.text((LEFT - 8.0, at), &name, small(Anchor::Right));
        }
        let bold = |anchor| Words::new(13.0, INK, anchor).bold();
        canvas.text(((LEFT + RIGHT) / 2.0, BOTTOM + 40.0), &self.x, bold(Anchor::Middle));
        canvas.text((20.0, TOP - 14.0), &self.y, bold(Anchor::Left));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_there_once() {
        let plot = Scatter::new("t", "x", "y").group("a", [(0.0, 1.0), (2.0, 3.0)]).group("b", [(1.0, 1.0)]);
        let file = plot.draw().unwrap().standalone();
        // Three points and a dot for each group's name.
        assert_eq!(file.matches("<circle").count(), 5);
        assert!(file.contains("a, n = 2") && file.contains("b, n = 1"));
        assert!(Scatter::new("t", "x", "y").draw().is_err());
        assert!(Scatter::new("t", "x", "y").group("a", [(f64::NAN, 0.0)]).draw().is_err());
    }
}
