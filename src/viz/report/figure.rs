//! What a report shows.

use crate::viz::Picture;
use crate::viz::plot::Svg;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, PreEscaped, html};

/// Pixels or a vector drawing.
#[derive(Clone, Debug)]
pub(crate) enum Drawing {
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
pub(crate) struct Figure {
    drawing: Drawing,
    caption: String,
}

impl Figure {
    /// A drawing and the words below it.
    pub(crate) fn new(drawing: impl Into<Drawing>, caption: impl Into<String>) -> Self {
        Self { drawing: drawing.into(), caption: caption.into() }
    }

    pub(super) fn html(&self) -> Markup {
        html! {
            figure {
                @match &self.drawing {
                    Drawing::Picture(picture) => {
                        img src=(format!("data:image/png;base64,{}", STANDARD.encode(picture.to_png())))
                            width=(picture.cols()) height=(picture.rows())
                            alt=(&self.caption);
                    }
                    Drawing::Svg(svg) => { (PreEscaped(svg.inline())) }
                }
                @if !self.caption.is_empty() { figcaption { (self.caption) } }
            }
        }
    }
}
