//! Reports to look at in a browser, of one HTML file each: the page of `web/src/report`, which the
//! program holds, with figures and geometry as JSON in it.

mod numbers;
mod shown_mesh;
mod up;

pub(crate) use numbers::floats;
pub use numbers::{Box3, Quantised};
pub use shown_mesh::{ShownCage, ShownMesh};
pub use up::Up;

use serde::Serialize;
use serde_json::ser::Formatter;
use std::io::{self, Write};

/// What stands before the place of the JSON in the page.
const BEFORE: &str = "<script type=\"application/json\" id=\"report\">";

/// Why there is no page, and how to get one.
pub const NO_PAGE: &str = "this program was built without the page of its reports; to get it, install Node 20.19 or later, run make web where the program is built, and build the program again";

/// What a page holds: `figures` in diagonals of the rest pose, `geometry` in the unit of the files.
#[derive(Serialize)]
pub struct Contents<'a, F: Serialize, G: Serialize> {
    /// Which report it is.
    pub kind: ReportKind,
    /// Version of the program.
    pub program: &'static str,
    /// The figures.
    pub figures: &'a F,
    /// What is drawn.
    pub geometry: &'a G,
}

/// The reports there are.
#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReportKind {
    /// Of `cager compare`.
    Comparison,
    /// Of `cager demo`.
    Demo,
    /// Of `cager cage`.
    Cage,
}

/// The page without its contents.
pub struct ReportPage {
    html: &'static [u8],
}

impl ReportPage {
    /// The one that was built into the program, if any.
    pub fn built_in() -> Option<Self> {
        let html = include_bytes!(concat!(env!("OUT_DIR"), "/report.html"));
        (!html.is_empty()).then_some(Self { html })
    }

    /// The page as a file.
    ///
    /// # Errors
    /// Of the figures, where JSON cannot hold them.
    pub fn with<F: Serialize, G: Serialize>(&self, contents: &Contents<'_, F, G>) -> serde_json::Result<Vec<u8>> {
        let html = self.html;
        let place = html.windows(BEFORE.len()).position(|part| part == BEFORE.as_bytes());
        let (before, after) = html.split_at(place.map_or(html.len(), |place| place + BEFORE.len()));
        let mut page = before.to_vec();
        contents.serialize(&mut serde_json::Serializer::with_formatter(&mut page, ForPages))?;
        page.extend_from_slice(after);
        Ok(page)
    }
}

/// Writes numbers in single precision, and no character that would end a script element.
struct ForPages;

impl Formatter for ForPages {
    fn write_f64<W: ?Sized + Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        let single = value as f32;
        let fits = single.is_normal() || value == 0.0;
        if fits { self.write_f32(writer, single) } else { write!(writer, "{value:e}") }
    }

    fn write_string_fragment<W: ?Sized + Write>(&mut self, writer: &mut W, fragment: &str) -> io::Result<()> {
        for (k, part) in fragment.split('<').enumerate() {
            if k > 0 {
                writer.write_all(b"\\u003c")?;
            }
            writer.write_all(part.as_bytes())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn filled(figures: &Value) -> String {
        let html = format!("<!doctype html>\n{BEFORE}</script>\n<p>end</p>\n");
        let page = ReportPage { html: html.into_bytes().leak() };
        let contents = Contents { kind: ReportKind::Comparison, program: "0", figures, geometry: &() };
        String::from_utf8(page.with(&contents).expect("a page")).expect("UTF-8")
    }

    fn contents_of(page: &str) -> Value {
        let (_, rest) = page.split_once(BEFORE).expect("the place of the JSON");
        let (text, after) = rest.split_once("</script>").expect("its end");
        assert_eq!(after, "\n<p>end</p>\n");
        serde_json::from_str(text).expect("JSON")
    }

    #[test]
    fn what_names_say_stays_in_the_json() {
        let hostile = json!({ "</script><b>": "<!--<script>]]>\u{2028}\"&'\\ </SCRIPT " });
        let page = filled(&hostile);
        assert_eq!(contents_of(&page)["figures"], hostile);
        assert_eq!(page.matches('<').count(), 5, "{page}");
    }

    #[test]
    fn numbers_keep_seven_digits_and_stay_numbers() {
        let values = [0.1, -1.0 / 3.0, 0.0, 120.0, 1e-12, 4.5e15, 1e-300, f64::MIN_POSITIVE, f64::MAX, -1e300];
        let found = contents_of(&filled(&json!(values)));
        for (k, value) in values.into_iter().enumerate() {
            let read = found["figures"][k].as_f64().expect("a number");
            assert!((read - value).abs() <= 1.3e-7 * value.abs(), "{value:e} became {read:e}");
        }
        assert_eq!(contents_of(&filled(&json!([f64::NAN])))["figures"], json!([null]));
    }
}
