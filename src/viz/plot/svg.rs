//! A finished vector drawing.

use crate::error::Result;
use crate::file;
use maud::html;
use std::path::Path;

/// A drawing of `width` x `height` pixels at its natural size, with a description for those who cannot see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Svg {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Drawing units per pixel.
    pub(super) fineness: u32,
    /// The elements inside `<svg>`.
    pub(super) body: String,
    /// Plain text: what is drawn.
    pub(super) description: String,
}

impl Svg {
    /// The drawing as a part of an HTML page: as wide as the page allows, up to its natural size.
    #[must_use]
    pub(crate) fn inline(&self) -> String {
        self.element("class=\"plot\"")
    }

    /// The drawing as a file of its own.
    #[must_use]
    pub(crate) fn standalone(&self) -> String {
        let element = self.element("xmlns=\"http://www.w3.org/2000/svg\"");
        format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{element}\n")
    }

    /// Writes the drawing as a file of its own: whole or not at all.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        file::write_bytes(path, self.standalone().as_bytes())
    }

    fn element(&self, attributes: &str) -> String {
        format!(
            "<svg {attributes} width=\"{}\" height=\"{}\" viewBox=\"0 0 {} {}\" role=\"img\" \
             aria-label=\"{}\">\n{}</svg>",
            self.width,
            self.height,
            self.width * self.fineness,
            self.height * self.fineness,
            html! { (self.description) }.into_string(),
            self.body,
        )
    }
}
