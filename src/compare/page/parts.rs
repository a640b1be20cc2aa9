//! Building blocks of the page: sections, figures, tables, pictures.

use crate::compare::pictures::Picture;
use crate::plot::{Chart, escaped};
use std::fmt::Write;

/// Pixels of pictures are this many times those of the page, for screens with small pixels.
const DENSITY: usize = 2;

/// Least width of a picture's caption, in pixels of the page.
const TILE: usize = 168;

/// A page in the making.
#[derive(Default)]
pub(super) struct Html {
    /// What there is so far.
    pub(super) text: String,
    /// Sections: address and title.
    contents: Vec<(&'static str, String)>,
}

impl Html {
    /// Begins a section.
    pub(super) fn section(&mut self, id: &'static str, title: &str) {
        let _ = writeln!(self.text, r#"<h2 id="{id}">{}</h2>"#, escaped(title));
        self.contents.push((id, title.to_owned()));
    }

    /// A smaller heading.
    pub(super) fn heading(&mut self, title: &str) {
        let _ = writeln!(self.text, "<h3>{}</h3>", escaped(title));
    }

    /// A paragraph of markup.
    pub(super) fn paragraph(&mut self, markup: &str) {
        let _ = writeln!(self.text, "<p>{markup}</p>");
    }

    /// Plots side by side with a caption: what is shown, how to read it, and the paper's figure.
    pub(super) fn plots(&mut self, charts: &[Chart], what: &str, reading: &str, paper: &str) {
        self.text.push_str("<figure><div class=\"plots\">\n");
        for chart in charts {
            self.text.push_str(&chart.svg());
        }
        self.text.push_str("</div>\n");
        self.caption(what, reading, paper);
        self.text.push_str("</figure>\n");
    }

    /// Pictures side by side with a caption, and a colour scale where there is one.
    pub(super) fn pictures(&mut self, pictures: &[Picture], scale: &str, what: &str, reading: &str, paper: &str) {
        self.text.push_str("<figure><div class=\"tiles\">\n");
        for picture in pictures {
            let (width, height) = (picture.png.width / DENSITY, picture.png.height / DENSITY);
            let _ = writeln!(
                self.text,
                r#"<div class="tile" style="width:{}px"><img width="{width}" height="{height}" alt="{title}" src="{}"/><b>{title}</b><span>{}</span></div>"#,
                width.max(TILE),
                picture.png.data_url(),
                escaped(&picture.note),
                title = escaped(&picture.title),
            );
        }
        self.text.push_str("</div>\n");
        self.text.push_str(scale);
        self.caption(what, reading, paper);
        self.text.push_str("</figure>\n");
    }

    fn caption(&mut self, what: &str, reading: &str, paper: &str) {
        let _ = writeln!(self.text, "<figcaption><b>{what}</b> {reading} <i>{paper}</i></figcaption>");
    }

    /// A table.
    pub(super) fn table(&mut self, table: &Table) {
        self.text.push_str("<div class=\"wide\"><table>\n<thead><tr>");
        for (k, header) in table.headers.iter().enumerate() {
            let _ = write!(self.text, "<th{}>{header}</th>", table.class(k));
        }
        self.text.push_str("</tr></thead>\n<tbody>\n");
        for (class, row) in &table.rows {
            let _ = write!(
                self.text,
                "<tr{}>",
                if class.is_empty() { String::new() } else { format!(r#" class="{class}""#) }
            );
            for (k, cell) in row.iter().enumerate() {
                let _ = write!(self.text, "<td{}>{cell}</td>", table.class(k));
            }
            self.text.push_str("</tr>\n");
        }
        self.text.push_str("</tbody></table></div>\n");
    }

    /// A table that opens when asked to.
    pub(super) fn folded(&mut self, title: &str, table: &Table) {
        let _ = writeln!(self.text, "<details><summary>{}</summary>", escaped(title));
        self.table(table);
        self.text.push_str("</details>\n");
    }

    /// Links to all sections so far.
    pub(super) fn contents(&self) -> String {
        let mut nav = "<nav>".to_owned();
        for (id, title) in &self.contents {
            let _ = write!(nav, r##"<a href="#{id}">{}</a>"##, escaped(title));
        }
        nav + "</nav>\n"
    }
}

/// A table: the first columns hold words, the others figures.
pub(super) struct Table {
    headers: Vec<String>,
    words: usize,
    paragraphs: &'static [usize],
    rows: Vec<(&'static str, Vec<String>)>,
}

impl Table {
    /// With these headers, of which the first `words` are of columns of words. Headers and cells are markup.
    pub(super) fn new(headers: &[&str], words: usize) -> Self {
        let headers = headers.iter().map(|&header| header.to_owned()).collect();
        Self { headers, words, paragraphs: &[], rows: Vec::new() }
    }

    /// Whose cells in these columns may run over several lines.
    pub(super) fn with_paragraphs(mut self, columns: &'static [usize]) -> Self {
        self.paragraphs = columns;
        self
    }

    /// Adds a row.
    pub(super) fn row(&mut self, cells: Vec<String>) {
        self.rows.push(("", cells));
    }

    /// Adds a row with a class of the style sheet.
    pub(super) fn row_of(&mut self, class: &'static str, cells: Vec<String>) {
        self.rows.push((class, cells));
    }

    fn class(&self, column: usize) -> &'static str {
        match (column < self.words, self.paragraphs.contains(&column)) {
            (true, true) => r#" class="w p""#,
            (true, false) => r#" class="w""#,
            _ => "",
        }
    }
}

/// A fraction in percent with so many decimals; a dash for what does not exist.
pub(super) fn percent(fraction: f64, decimals: usize) -> String {
    if fraction.is_finite() { format!("{:.decimals$}", 100.0 * fraction) } else { "–".to_owned() }
}

/// A number with so many decimals; a dash for what does not exist.
pub(super) fn number(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}") } else { "–".to_owned() }
}

/// A condition number.
pub(super) fn condition(value: f64) -> String {
    match value {
        _ if !value.is_finite() => "–".to_owned(),
        0.0..1e5 => format!("{value:.1}"),
        _ => format!("{value:.1e}"),
    }
}

/// Seconds with a unit people read.
pub(super) fn seconds(value: f64) -> String {
    match value {
        _ if !value.is_finite() => "–".to_owned(),
        0.0..1e-3 => format!("{:.1} µs", 1e6 * value),
        1e-3..1.0 => format!("{:.1} ms", 1e3 * value),
        _ => format!("{value:.2} s"),
    }
}

/// A name with the colour it has in all plots.
pub(super) fn coloured(class: &str, name: &str) -> String {
    format!(r#"<i class="dot {class}"></i>{}"#, escaped(name))
}

/// A legend of a colour map.
pub(super) fn scale(low: &str, high: &str, stops: &str) -> String {
    format!(
        "<div class=\"scale\">{}<i style=\"background:linear-gradient(90deg,{stops})\"></i>{}</div>\n",
        escaped(low),
        escaped(high)
    )
}
