//! What a report shows.

use crate::viz::Picture;
use crate::viz::plot::Svg;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, PreEscaped, html};

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

    pub(super) fn html(&self) -> Markup {
        html! {
            figure {
                @match &self.drawing {
                    Drawing::Picture(picture) => {
                        img src=(format!("data:image/png;base64,{}", STANDARD.encode(picture.to_png())))
                            width=(picture.cols()) height=(picture.rows())
                            alt=(self.alt.as_deref().unwrap_or(&self.caption));
                    }
                    Drawing::Svg(svg) => { (PreEscaped(svg.inline())) }
                }
                @if !self.caption.is_empty() { figcaption { (self.caption) } }
            }
        }
    }
}
