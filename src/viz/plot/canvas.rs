//! A sheet on which plots are drawn in pixels; plotters turns it into SVG.
//!
//! plotters rounds every coordinate to a whole unit, so one pixel is [`FINENESS`] units.

use super::Svg;
use crate::viz::Rgb;
use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::DrawingArea;
use plotters::element::{Circle, PathElement, Polygon, Rectangle, Text};
use plotters::prelude::{Color, IntoDrawingArea, IntoFont, RGBAColor, ShapeStyle, TextStyle};
use plotters::style::FontStyle;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Drawing units per pixel.
const FINENESS: u32 = 8;

/// Paper of plots. A page may replace this colour and the next three for a dark theme.
pub(super) const PAPER: Rgb = Rgb::hex(0xff_ff_fe);
/// Text of plots.
pub(crate) const INK: Rgb = Rgb::hex(0x26_28_2c);
/// Secondary text and axes.
pub(crate) const SOFT_INK: Rgb = Rgb::hex(0x63_67_6f);
/// Grid lines.
pub(crate) const GRID: Rgb = Rgb::hex(0xe3_e4_e8);
/// Colours of data in their order: told apart on light and dark paper, and by people with the common forms of colour
/// blindness when neighbours in the list are compared.
pub(crate) const SERIES: [Rgb; 8] = [
    Rgb::hex(0x2f_78_d2),
    Rgb::hex(0xe0_7b_26),
    Rgb::hex(0x2f_9c_7d),
    Rgb::hex(0xc4_4f_8e),
    Rgb::hex(0x8a_8d_2b),
    Rgb::hex(0x7d_62_cf),
    Rgb::hex(0xc9_4a_45),
    Rgb::hex(0x7b_84_8f),
];

/// Which point of a text its position names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
}

/// How text is set.
#[derive(Clone, Copy, Debug)]
pub(super) struct Words {
    pub(super) size: f64,
    pub(super) colour: Rgb,
    pub(super) anchor: Anchor,
    pub(super) bold: bool,
}

impl Words {
    pub(super) const fn new(size: f64, colour: Rgb, anchor: Anchor) -> Self {
        Self { size, colour, anchor, bold: false }
    }

    pub(super) const fn bold(self) -> Self {
        Self { bold: true, ..self }
    }
}

/// The sheet. Coordinates are pixels, y downwards.
///
/// # Panics
/// None of its methods: drawing into a string cannot fail.
pub(super) struct Canvas<'a> {
    area: DrawingArea<SVGBackend<'a>, Shift>,
}

/// Draws a plot of `width` x `height` pixels.
pub(super) fn draw(width: u32, height: u32, description: String, paint: impl FnOnce(&Canvas<'_>)) -> Svg {
    let mut file = String::new();
    {
        let area =
            SVGBackend::with_string(&mut file, (width * FINENESS, height * FINENESS)).into_drawing_area();
        let canvas = Canvas { area };
        canvas.block((0.0, 0.0), (f64::from(width), f64::from(height)), PAPER, 1.0);
        paint(&canvas);
        canvas.area.present().expect("drawing into a string cannot fail");
    }
    // The backend's own <svg ...> and </svg> give way to ours.
    let start = file.find("<svg").and_then(|at| file[at..].find('>').map(|end| at + end + 1));
    let body = match (start, file.rfind("</svg>")) {
        (Some(start), Some(end)) => file[start..end].trim_start().to_owned(),
        _ => unreachable!("the SVG backend writes one svg element"),
    };
    Svg { width, height, fineness: FINENESS, body, description }
}

impl Canvas<'_> {
    fn unit(&self, (x, y): (f64, f64)) -> (i32, i32) {
        let units = |v: f64| (v * f64::from(FINENESS)).round() as i32;
        (units(x), units(y))
    }

    /// A line through `points`.
    pub(super) fn line(&self, points: &[(f64, f64)], colour: Rgb, width: f64) {
        let units: Vec<_> = points.iter().map(|&p| self.unit(p)).collect();
        let style = stroke(colour, 1.0, width);
        self.area.draw(&PathElement::new(units, style)).expect("drawing into a string cannot fail");
    }

    /// A filled rectangle.
    pub(super) fn block(&self, from: (f64, f64), to: (f64, f64), colour: Rgb, opacity: f64) {
        let style = ShapeStyle { color: shade(colour, opacity), filled: true, stroke_width: 0 };
        let corners = [self.unit(from), self.unit(to)];
        self.area.draw(&Rectangle::new(corners, style)).expect("drawing into a string cannot fail");
    }

    /// A filled disc.
    pub(super) fn disc(&self, centre: (f64, f64), radius: f64, colour: Rgb, opacity: f64) {
        let style = ShapeStyle { color: shade(colour, opacity), filled: true, stroke_width: 0 };
        let radius = (radius * f64::from(FINENESS)).round() as i32;
        let disc = Circle::new(self.unit(centre), radius, style);
        self.area.draw(&disc).expect("drawing into a string cannot fail");
    }

    /// A filled polygon.
    pub(super) fn polygon(&self, corners: &[(f64, f64)], colour: Rgb) {
        let units: Vec<_> = corners.iter().map(|&p| self.unit(p)).collect();
        let style = ShapeStyle { color: shade(colour, 1.0), filled: true, stroke_width: 0 };
        self.area.draw(&Polygon::new(units, style)).expect("drawing into a string cannot fail");
    }

    /// Text, centred on the height of its position.
    pub(super) fn text(&self, at: (f64, f64), text: &str, words: Words) {
        // plotters divides sizes by 1.24 on their way into SVG.
        let font = ("sans-serif", words.size * f64::from(FINENESS) * 1.24).into_font();
        let font = if words.bold { font.style(FontStyle::Bold) } else { font };
        let anchor = match words.anchor {
            Anchor::Left => HPos::Left,
            Anchor::Middle => HPos::Center,
            Anchor::Right => HPos::Right,
        };
        let colour = shade(words.colour, 1.0);
        let style = TextStyle::from(font).color(&colour).pos(Pos::new(anchor, VPos::Center));
        let element = Text::new(text.to_owned(), self.unit(at), style);
        self.area.draw(&element).expect("drawing into a string cannot fail");
    }
}

fn shade(colour: Rgb, opacity: f64) -> RGBAColor {
    plotters::style::RGBColor(colour.r, colour.g, colour.b).mix(opacity)
}

fn stroke(colour: Rgb, opacity: f64, width: f64) -> ShapeStyle {
    let stroke_width = (width * f64::from(FINENESS)).round() as u32;
    ShapeStyle { color: shade(colour, opacity), filled: false, stroke_width }
}
