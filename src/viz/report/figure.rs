//! What a report shows.

use super::markup::{base64, escape};
use crate::viz::Picture;
use crate::viz::plot::Svg;

/// Pixels or a vector drawing.
#[derive(Clone, Debug)]
pub enum Drawing {
    /// Goes in as PNG.
    Picture(Picture),
    /// Goes in as it is.
    Svg(Svg),
}

impl From<Picture> for Drawing {
    fn from(picture: Picture) -> Self {
        Self::Picture(picture)
    }
}

impl From<&Picture> for Drawing {
    fn from(picture: &Picture) -> Self {
        Self::Picture(picture.clone())
    }
}

impl From<Svg> for Drawing {
    fn from(svg: Svg) -> Self {
        Self::Svg(svg)
    }
}

/// A drawing with its caption.
#[derive(Clone, Debug)]
pub struct Figure {
    drawing: Drawing,
    caption: String,
    alt: Option<String>,
}

impl Figure {
    /// A drawing and the words below it.
    pub fn new(drawing: impl Into<Drawing>, caption: impl Into<String>) -> Self {
        Self { drawing: drawing.into(), caption: caption.into(), alt: None }
    }

    /// What the drawing shows, for those who cannot see it; without this, the caption (of a plot: its own description).
    #[must_use]
    pub fn alt(self, alt: impl Into<String>) -> Self {
        Self { alt: Some(alt.into()), ..self }
    }

    pub(super) fn html(&self) -> String {
        let caption = escape(&self.caption);
        let drawing = match &self.drawing {
            Drawing::Picture(picture) => format!(
                "<img src=\"data:image/png;base64,{}\" width=\"{}\" height=\"{}\" alt=\"{}\">",
                base64(&picture.to_png()),
                picture.cols(),
                picture.rows(),
                self.alt.as_deref().map_or_else(|| caption.clone(), escape),
            ),
            Drawing::Svg(svg) => svg.inline(),
        };
        let caption =
            if caption.is_empty() { caption } else { format!("<figcaption>{caption}</figcaption>") };
        format!("<figure>{drawing}{caption}</figure>\n")
    }
}
