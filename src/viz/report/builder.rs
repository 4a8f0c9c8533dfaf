//! The report, piece by piece.

use super::figure::{Drawing, Figure};
use super::table::Table;
use crate::viz::duration;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use std::time::Duration;

/// A report in the making; [`finish`](Self::finish) gives the HTML file.
#[derive(Clone, Debug)]
pub(crate) struct Report {
    title: String,
    summary: Vec<String>,
    sections: Vec<String>,
    body: Vec<Markup>,
}

impl Report {
    /// An empty report.
    pub(crate) fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), summary: Vec::new(), sections: Vec::new(), body: Vec::new() }
    }

    /// A line under the title.
    #[must_use]
    pub(crate) fn summary(mut self, line: impl Into<String>) -> Self {
        self.summary.push(line.into());
        self
    }

    /// Starts a section.
    #[must_use]
    pub(crate) fn section(mut self, heading: impl Into<String>) -> Self {
        let heading = heading.into();
        self.sections.push(heading.clone());
        let id = format!("s{}", self.sections.len());
        self.push(html! { h2 id=(id) { (heading) } })
    }

    /// Starts a part of a section.
    #[must_use]
    pub(crate) fn subsection(self, heading: impl AsRef<str>) -> Self {
        self.push(html! { h3 { (heading.as_ref()) } })
    }

    /// A paragraph of plain text.
    #[must_use]
    pub(crate) fn paragraph(self, text: impl AsRef<str>) -> Self {
        self.push(html! { p { (text.as_ref()) } })
    }

    /// A picture or plot with a caption.
    #[must_use]
    pub(crate) fn figure(self, drawing: impl Into<Drawing>, caption: impl Into<String>) -> Self {
        self.figures([Figure::new(drawing, caption)])
    }

    /// Figures beside each other, as far as the page is wide enough.
    #[must_use]
    pub(crate) fn figures(self, figures: impl IntoIterator<Item = Figure>) -> Self {
        let figures: Vec<Figure> = figures.into_iter().collect();
        let class = if figures.len() > 1 { "figures several" } else { "figures" };
        self.push(html! { div class=(class) { @for figure in &figures { (figure.html()) } } })
    }

    /// A table.
    #[must_use]
    pub(crate) fn table(self, table: &Table) -> Self {
        let html = table.html();
        self.push(html)
    }

    /// The commands that made what stands above, one per line.
    #[must_use]
    pub(crate) fn commands<T: AsRef<str>>(self, commands: impl IntoIterator<Item = T>) -> Self {
        let commands: Vec<T> = commands.into_iter().collect();
        self.push(html! {
            pre { code {
                @for (i, command) in commands.iter().enumerate() {
                    @if i > 0 { "\n" }
                    span.command { (command.as_ref()) }
                }
            } }
        })
    }

    /// Text that keeps its lines and spaces, such as a configuration.
    #[must_use]
    pub(crate) fn listing(self, text: impl AsRef<str>) -> Self {
        self.push(html! { pre { code { (text.as_ref().trim_end()) } } })
    }

    /// How long each step took, with the sum and a bar for its share.
    #[must_use]
    pub(crate) fn time_spent<T: AsRef<str>>(self, steps: impl IntoIterator<Item = (T, Duration)>) -> Self {
        let steps: Vec<(T, Duration)> = steps.into_iter().collect();
        let total: Duration = steps.iter().map(|(_, time)| *time).sum();
        let percent = |time: Duration| {
            if total.is_zero() { 0.0 } else { 100.0 * time.as_secs_f64() / total.as_secs_f64() }
        };
        self.push(html! {
            div.scroll {
                table.times {
                    thead { tr { th scope="col" { "Step" } th.number scope="col" { "Time" } th scope="col" { "Share" } } }
                    tbody {
                        @for (step, time) in &steps {
                            @let share = percent(*time);
                            tr {
                                td { (step.as_ref()) }
                                td.number { (duration(*time)) }
                                td.share { span style=(format!("width:{share:.1}%")) {} (format!("{share:.0} %")) }
                            }
                        }
                        tr.total { td { "Together" } td.number { (duration(total)) } td {} }
                    }
                }
            }
        })
    }

    /// Where data come from, one line each.
    #[must_use]
    pub(crate) fn credits<T: AsRef<str>>(self, lines: impl IntoIterator<Item = T>) -> Self {
        let lines: Vec<T> = lines.into_iter().collect();
        self.push(html! { ul.credits { @for line in &lines { li { (line.as_ref()) } } } })
    }

    /// The whole page: opens from the disk, asks no network for anything.
    #[must_use]
    pub(crate) fn finish(self) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (self.title) }
                    style { (PreEscaped(include_str!("report.css"))) }
                }
                body {
                    main {
                        header {
                            h1 { (self.title) }
                            @if !self.summary.is_empty() {
                                div.summary { @for line in &self.summary { p { (line) } } }
                            }
                        }
                        // A short report needs no table of contents.
                        @if self.sections.len() > 2 {
                            nav aria-label="Contents" {
                                ol {
                                    @for (i, name) in self.sections.iter().enumerate() {
                                        li { a href=(format!("#s{}", i + 1)) { (name) } }
                                    }
                                }
                            }
                        }
                        @for part in &self.body { (part) "\n" }
                    }
                    footer { "Made by monadnock " (env!("CARGO_PKG_VERSION")) "." }
                }
            }
        };
        page.into_string()
    }

    fn push(mut self, part: Markup) -> Self {
        self.body.push(part);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viz::plot::{Better, Curves, Panel, ScorePlot};
    use crate::viz::report::{Column, Entry};
    use crate::viz::{Picture, Rgb};

    const NASTY: &str = "</style><script>alert(\"1\")</script> & 'more'";

    fn full(text: &str) -> String {
        let picture = || Picture::filled(20, 30, Rgb::hex(0x33_66_55));
        let curves = Curves::new(text, text).panel(Panel::new(text).curve(text, [(0.0, 1.0), (1.0, 2.0)]));
        let scores = ScorePlot::new(text, text, Better::Lower).system(text, [1.0, 2.0]);
        let table = Table::new([Column::text(text).unit(text)]).caption(text).row([Entry::from(text)]);
        Report::new(text)
            .summary(text)
            .section(text)
            .subsection(text)
            .paragraph(text)
            .figure(picture(), text)
            .figures([Figure::new(picture(), text), Figure::new(curves.draw().unwrap(), text)])
            .section(text)
            .figure(scores.draw().unwrap(), text)
            .table(&table)
            .commands([text, text])
            .listing(text)
            .section(text)
            .time_spent([(text, Duration::from_millis(1234)), (text, Duration::from_secs(100))])
            .credits([text])
            .finish()
    }

    #[test]
    fn no_text_gets_through_as_markup() {
        let page = full(NASTY);
        assert!(!page.contains("<script") && page.matches("</style>").count() == 1);
        assert!(page.contains("&lt;script&gt;"));
        // The same tags, whatever the text: what differs in number was made by the text.
        let tags = |page: &str| page.matches('<').count();
        assert_eq!(tags(&page), tags(&full("plain")));
        let quotes = |page: &str| page.matches('"').count();
        assert_eq!(quotes(&page), quotes(&full("plain")));
    }

    #[test]
    fn the_page_asks_for_nothing_from_elsewhere() {
        let page = full("plain");
        for word in ["http", "//", "<script", "<link", "@import", "url("] {
            let found = page.match_indices(word).find(|(at, _)| {
                // Base64 may spell anything; look outside the data only.
                page[..*at].rfind("base64,").is_none_or(|data| page[data..*at].contains('>'))
            });
            assert!(found.is_none(), "{word} at {found:?}");
        }
    }

    #[test]
    fn pictures_are_inlined_and_described() {
        let page = full("plain");
        assert_eq!(page.matches("data:image/png;base64,iVBORw0KGgo").count(), 2);
        assert_eq!(page.matches(" alt=\"plain\"").count(), 2);
        assert_eq!(page.matches("role=\"img\"").count(), 2);
        assert_eq!(page, full("plain"));
    }

    #[test]
    fn every_tag_is_closed() {
        let page = full("plain");
        for tag in [
            "html",
            "head",
            "body",
            "main",
            "header",
            "footer",
            "nav",
            "ol",
            "ul",
            "figure",
            "table",
            "thead",
            "tbody",
            "tr",
            "td",
            "div",
            "pre",
            "code",
            "h1",
            "h2",
            "h3",
            "p",
            "style",
            "svg",
            "span",
            "figcaption",
        ] {
            let opened =
                page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
            assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
        }
    }
}
