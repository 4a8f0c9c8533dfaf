//! The report, piece by piece.

use super::figure::{Drawing, Figure};
use super::markup::escape;
use super::table::Table;
use crate::viz::ticks::number;
use std::time::Duration;

/// A report in the making; [`finish`](Self::finish) gives the HTML file.
///
/// ```
/// use monadnock::viz::{Picture, Rgb, report::Report};
/// let page = Report::new("Two plains")
///     .summary("Both are flat.")
///     .section("The plains")
///     .figure(Picture::filled(64, 64, Rgb::hex(0x88_99_77)), "The first plain.")
///     .commands(["monadnock render plain.tif -o plain.png"])
///     .finish();
/// assert!(page.starts_with("<!doctype html>") && !page.contains("http"));
/// ```
#[derive(Clone, Debug)]
pub struct Report {
    title: String,
    summary: Vec<String>,
    sections: Vec<String>,
    body: String,
}

impl Report {
    /// An empty report.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), summary: Vec::new(), sections: Vec::new(), body: String::new() }
    }

    /// A line under the title.
    #[must_use]
    pub fn summary(mut self, line: impl Into<String>) -> Self {
        self.summary.push(line.into());
        self
    }

    /// Starts a section.
    #[must_use]
    pub fn section(mut self, heading: impl Into<String>) -> Self {
        let heading = heading.into();
        self.sections.push(heading.clone());
        let number = self.sections.len();
        self.push(format!("<h2 id=\"s{number}\">{}</h2>\n", escape(&heading)))
    }

    /// Starts a part of a section.
    #[must_use]
    pub fn subsection(self, heading: impl AsRef<str>) -> Self {
        self.push(format!("<h3>{}</h3>\n", escape(heading.as_ref())))
    }

    /// A paragraph of plain text.
    #[must_use]
    pub fn paragraph(self, text: impl AsRef<str>) -> Self {
        self.push(format!("<p>{}</p>\n", escape(text.as_ref())))
    }

    /// A picture or plot with a caption.
    #[must_use]
    pub fn figure(self, drawing: impl Into<Drawing>, caption: impl Into<String>) -> Self {
        self.figures([Figure::new(drawing, caption)])
    }

    /// Figures beside each other, as far as the page is wide enough.
    #[must_use]
    pub fn figures(self, figures: impl IntoIterator<Item = Figure>) -> Self {
        let figures: Vec<String> = figures.into_iter().map(|figure| figure.html()).collect();
        let class = if figures.len() > 1 { "figures several" } else { "figures" };
        self.push(format!("<div class=\"{class}\">\n{}</div>\n", figures.concat()))
    }

    /// A table.
    #[must_use]
    pub fn table(self, table: &Table) -> Self {
        let html = table.html();
        self.push(html)
    }

    /// The commands that made what stands above, one a line.
    #[must_use]
    pub fn commands<T: AsRef<str>>(self, commands: impl IntoIterator<Item = T>) -> Self {
        let lines: Vec<String> = commands
            .into_iter()
            .map(|c| format!("<span class=\"command\">{}</span>", escape(c.as_ref())))
            .collect();
        self.push(format!("<pre><code>{}</code></pre>\n", lines.join("\n")))
    }

    /// Text that keeps its lines and spaces, such as a configuration.
    #[must_use]
    pub fn listing(self, text: impl AsRef<str>) -> Self {
        self.push(format!("<pre><code>{}</code></pre>\n", escape(text.as_ref().trim_end())))
    }

    /// How long each step took, with the sum and a bar for its share.
    #[must_use]
    pub fn time_spent<T: AsRef<str>>(self, steps: impl IntoIterator<Item = (T, Duration)>) -> Self {
        let steps: Vec<(T, Duration)> = steps.into_iter().collect();
        let total: Duration = steps.iter().map(|(_, time)| *time).sum();
        let mut html = String::from(
            "<div class=\"scroll\"><table class=\"times\"><thead><tr><th scope=\"col\">Step</th>\
             <th scope=\"col\" class=\"number\">Time</th><th scope=\"col\">Share</th></tr></thead>\n<tbody>\n",
        );
        for (step, time) in &steps {
            let share = if total.is_zero() { 0.0 } else { 100.0 * time.as_secs_f64() / total.as_secs_f64() };
            html += &format!(
                "<tr><td>{}</td><td class=\"number\">{}</td><td class=\"share\"><span style=\"width:{share:.1}%\">\
                 </span>{share:.0} %</td></tr>\n",
                escape(step.as_ref()),
                readable(*time),
            );
        }
        html += &format!(
            "<tr class=\"total\"><td>Together</td><td class=\"number\">{}</td><td></td></tr>\n\
             </tbody></table></div>\n",
            readable(total),
        );
        self.push(html)
    }

    /// Where data come from, one line each.
    #[must_use]
    pub fn credits<T: AsRef<str>>(self, lines: impl IntoIterator<Item = T>) -> Self {
        let lines: Vec<String> =
            lines.into_iter().map(|line| format!("<li>{}</li>\n", escape(line.as_ref()))).collect();
        self.push(format!("<ul class=\"credits\">\n{}</ul>\n", lines.concat()))
    }

    /// The whole page: opens from the disk, asks no network for anything.
    #[must_use]
    pub fn finish(self) -> String {
        let title = escape(&self.title);
        let summary: Vec<String> =
            self.summary.iter().map(|line| format!("<p>{}</p>\n", escape(line))).collect();
        let summary = match summary.as_slice() {
            [] => String::new(),
            lines => format!("<div class=\"summary\">\n{}</div>\n", lines.concat()),
        };
        // A short report needs no table of contents.
        let contents = if self.sections.len() < 3 {
            String::new()
        } else {
            let links = self.sections.iter().enumerate();
            let links: Vec<String> = links
                .map(|(i, name)| format!("<li><a href=\"#s{}\">{}</a></li>\n", i + 1, escape(name)))
                .collect();
            format!("<nav aria-label=\"Contents\"><ol>\n{}</ol></nav>\n", links.concat())
        };
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n\
             <style>\n{}</style>\n</head>\n<body>\n<main>\n<header>\n<h1>{title}</h1>\n{summary}</header>\n\
             {contents}{}</main>\n<footer>Made by monadnock {}.</footer>\n</body>\n</html>\n",
            include_str!("report.css"),
            self.body,
            env!("CARGO_PKG_VERSION"),
        )
    }

    fn push(mut self, html: String) -> Self {
        self.body += &html;
        self
    }
}

/// A duration as people say it.
fn readable(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    if seconds < 0.9995 {
        return format!("{} ms", number(seconds * 1000.0, if seconds < 0.01 { 1 } else { 0 }));
    }
    if seconds < 59.95 {
        return format!("{} s", number(seconds, 1));
    }
    let whole = seconds.round() as u64;
    let (hours, minutes, seconds) = (whole / 3600, whole / 60 % 60, whole % 60);
    if hours > 0 { format!("{hours} h {minutes} min") } else { format!("{minutes} min {seconds} s") }
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
            .figures([Figure::new(picture(), text).alt(text), Figure::new(curves.draw().unwrap(), text)])
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

    #[test]
    fn durations_read_well() {
        let cases = [
            (0.0042, "4.2 ms"),
            (0.35, "350 ms"),
            (1.0, "1.0 s"),
            (59.9, "59.9 s"),
            (59.96, "1 min 0 s"),
            (83.0, "1 min 23 s"),
            (7300.0, "2 h 1 min"),
        ];
        for (seconds, words) in cases {
            assert_eq!(readable(Duration::from_secs_f64(seconds)), words);
        }
    }
}
