//! Curves and dots over two axes, as SVG that takes its colours from the page it stands in.
//!
//! A series names a class of the page's style sheet and draws in `currentColor`, so that a method has the same colour everywhere, in light and dark
//! mode.

use super::scale::{AxisRange, Scale};
use super::text::{escaped, short};
use std::fmt::Write;

/// Sizes in pixels of the drawing.
pub(super) const WIDTH: f64 = 520.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 508.0;
const PANEL: f64 = 214.0;
const LEGEND_ROW: f64 = 17.0;
/// Space above the legend with and without a title.
const TITLE: f64 = 24.0;
const NO_TITLE: f64 = 6.0;
/// Mean width of a character of the legend.
const CHARACTER: f64 = 6.4;
/// Up to this many points a line shows each as a dot.
const DOTS: usize = 24;
/// A line of more points is thinned to the least and the largest of each pixel column.
const MOST_POINTS: usize = 900;

/// One axis.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    /// What is measured, and its unit.
    pub(crate) label: String,
    /// How it covers the values.
    pub(crate) cover: AxisRange,
    /// Whether ticks are at whole numbers only.
    pub(crate) whole: bool,
}

impl Axis {
    /// An axis of measures.
    pub(crate) fn new(label: impl Into<String>, cover: AxisRange) -> Self {
        Self { label: label.into(), cover, whole: false }
    }

    /// An axis of frames, indices and the like.
    pub(crate) fn counting(label: impl Into<String>) -> Self {
        Self { label: label.into(), cover: AxisRange::Exactly, whole: true }
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mark {
    /// A line.
    Line,
    /// A dashed line.
    Dashes,
    /// Discs.
    Dots,
    /// A larger diamond for each point: what the plot is about.
    Diamonds,
}

/// One set of points.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    /// Its name in the legend.
    pub(crate) label: String,
    /// Class of the style sheet whose colour it takes.
    pub(crate) class: &'static str,
    /// How it is drawn.
    pub(crate) mark: Mark,
    /// Points; where one is not finite the line has a gap.
    pub(crate) points: Vec<(f64, f64)>,
}

/// A plot.
#[derive(Clone, Debug)]
pub(crate) struct Chart {
    /// Short title above it; the caption is the page's.
    pub(crate) title: String,
    /// Horizontal axis.
    pub(crate) x: Axis,
    /// Vertical axis.
    pub(crate) y: Axis,
    /// What is drawn; later ones lie on top.
    pub(crate) series: Vec<Series>,
}

impl Chart {
    /// The `svg` element, for a page with a style sheet.
    pub(crate) fn svg(&self) -> String {
        let (drawing, height) = self.drawing();
        let title = escaped(&self.title);
        format!(
            "<svg class=\"chart\" viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" aria-label=\"{title}\">\n{drawing}</svg>\n"
        )
    }

    /// What is in the `svg` element, and how high it is.
    pub(super) fn drawing(&self) -> (String, f64) {
        let all = |f: fn(&(f64, f64)) -> f64| -> Vec<f64> {
            self.series.iter().flat_map(|s| s.points.iter().map(f)).collect()
        };
        let (x, y) = (Scale::covering(self.x.cover, &all(|p| p.0)), Scale::covering(self.y.cover, &all(|p| p.1)));
        let top_of_legend = if self.title.is_empty() { NO_TITLE } else { TITLE };
        let (legend, rows) = self.legend(top_of_legend);
        let top = top_of_legend + LEGEND_ROW * rows as f64 + 8.0;
        let place = PlotArea { x, y, top };
        let mut svg = String::new();
        if !self.title.is_empty() {
            let _ = writeln!(svg, r#"<text class="t" x="{LEFT}" y="15">{}</text>"#, escaped(&self.title));
        }
        svg.push_str(&legend);
        self.grid(&mut svg, &place);
        for series in &self.series {
            draw(&mut svg, series, &place);
        }
        (svg, top + PANEL + 42.0)
    }

    /// The legend, and its number of rows.
    fn legend(&self, top: f64) -> (String, usize) {
        let mut svg = String::new();
        let (mut x, mut row) = (LEFT, 0);
        for series in self.series.iter().filter(|s| !s.label.is_empty()) {
            let width = 30.0 + CHARACTER * series.label.chars().count() as f64 + 14.0;
            if x > LEFT && x + width > WIDTH {
                (x, row) = (LEFT, row + 1);
            }
            let y = top + LEGEND_ROW * row as f64 + 11.0;
            let _ = write!(svg, r#"<g class="{}">"#, series.class);
            match series.mark {
                Mark::Line => stroke(&mut svg, x, y - 4.0, ""),
                Mark::Dashes => stroke(&mut svg, x, y - 4.0, r#" stroke-dasharray="5 3""#),
                Mark::Dots => dot(&mut svg, x + 11.0, y - 4.0, 3.2),
                Mark::Diamonds => diamond(&mut svg, x + 11.0, y - 4.0),
            }
            let _ = writeln!(
                svg,
                r#"<text class="l" x="{:.1}" y="{y:.1}">{}</text></g>"#,
                x + 28.0,
                escaped(&series.label)
            );
            x += width;
        }
        let any = self.series.iter().any(|s| !s.label.is_empty());
        (svg, if any { row + 1 } else { 0 })
    }

    fn grid(&self, svg: &mut String, place: &PlotArea) {
        let bottom = place.top + PANEL;
        let whole = |tick: &f64| tick.fract() == 0.0;
        for tick in place.y.ticks().into_iter().filter(|t| !self.y.whole || whole(t)) {
            let y = place.y_of(tick);
            let _ = writeln!(
                svg,
                r#"<path class="g" d="M{LEFT} {y:.1}H{RIGHT}"/><text class="a" x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#,
                LEFT - 7.0,
                y + 4.0,
                short(tick)
            );
        }
        for tick in place.x.ticks().into_iter().filter(|t| !self.x.whole || whole(t)) {
            let x = place.x_of(tick);
            let _ = writeln!(
                svg,
                r#"<path class="g" d="M{x:.1} {:.1}V{bottom:.1}"/><text class="a" x="{x:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
                place.top,
                bottom + 16.0,
                short(tick)
            );
        }
        let _ = writeln!(svg, r#"<path class="b" d="M{LEFT} {bottom:.1}H{RIGHT}"/>"#);
        let log = |scale: &Scale| if scale.logarithmic { " (log)" } else { "" };
        let _ = writeln!(
            svg,
            r#"<text class="n" x="{:.1}" y="{:.1}" text-anchor="middle">{}{}</text>"#,
            (LEFT + RIGHT) / 2.0,
            bottom + 35.0,
            escaped(&self.x.label),
            log(&place.x)
        );
        let middle = place.top + PANEL / 2.0;
        let _ = writeln!(
            svg,
            r#"<text class="n" transform="translate(13 {middle:.1}) rotate(-90)" text-anchor="middle">{}{}</text>"#,
            escaped(&self.y.label),
            log(&place.y)
        );
    }
}

/// From values to pixels.
struct PlotArea {
    x: Scale,
    y: Scale,
    top: f64,
}

impl PlotArea {
    fn x_of(&self, value: f64) -> f64 {
        LEFT + (RIGHT - LEFT) * self.x.position(value)
    }

    fn y_of(&self, value: f64) -> f64 {
        self.top + PANEL * (1.0 - self.y.position(value))
    }
}

fn draw(svg: &mut String, series: &Series, place: &PlotArea) {
    let _ = write!(svg, r#"<g class="{}">"#, series.class);
    match series.mark {
        Mark::Line | Mark::Dashes => {
            let dashes = if series.mark == Mark::Dashes { r#" stroke-dasharray="5 3""# } else { "" };
            let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
            let few = series.mark == Mark::Line && series.points.len() <= DOTS;
            let (mut path, mut dots) = (String::new(), String::new());
            for run in series.points.split(|p| !finite(p)) {
                // A line of one point would not be seen.
                for &(x, y) in run.iter().filter(|_| few || run.len() == 1) {
                    dot(&mut dots, place.x_of(x), place.y_of(y), 2.4);
                }
                for (i, &(x, y)) in thinned(run).iter().enumerate() {
                    let _ = write!(path, "{}{:.1} {:.1}", if i == 0 { 'M' } else { 'L' }, place.x_of(x), place.y_of(y));
                }
            }
            let _ = write!(svg, r#"<path class="c" d="{path}"{dashes}/>{dots}"#);
        }
        Mark::Dots | Mark::Diamonds => {
            for &(x, y) in series.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite()) {
                let (x, y) = (place.x_of(x), place.y_of(y));
                if series.mark == Mark::Dots { dot(svg, x, y, 3.2) } else { diamond(svg, x, y) }
            }
        }
    }
    svg.push_str("</g>\n");
}

/// The least and the largest value of every pixel column, where there are more points than pixels.
fn thinned(run: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if run.len() <= MOST_POINTS {
        return run.to_vec();
    }
    let mut kept = Vec::new();
    for block in run.chunks((2 * run.len()).div_ceil(MOST_POINTS)) {
        let by_value = |a: &usize, b: &usize| block[*a].1.total_cmp(&block[*b].1);
        let least = (0..block.len()).min_by(by_value).unwrap_or(0);
        let largest = (0..block.len()).max_by(by_value).unwrap_or(0);
        kept.push(block[least.min(largest)]);
        if least != largest {
            kept.push(block[least.max(largest)]);
        }
    }
    kept
}

fn stroke(svg: &mut String, x: f64, y: f64, dashes: &str) {
    let _ = write!(svg, r#"<path class="c" d="M{x:.1} {y:.1}h22"{dashes}/>"#);
}

fn dot(svg: &mut String, x: f64, y: f64, radius: f64) {
    let _ = write!(svg, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" fill="currentColor"/>"#);
}

fn diamond(svg: &mut String, x: f64, y: f64) {
    let _ = write!(svg, r#"<path d="M{x:.1} {:.1}l6 6l-6 6l-6 -6z" fill="currentColor"/>"#, y - 6.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: &[(f64, f64)], cover: AxisRange) -> Chart {
        let series =
            |label: &str, mark| Series { label: label.to_owned(), class: "k-all", mark, points: points.to_vec() };
        Chart {
            title: "a<b".to_owned(),
            x: Axis::counting("frame"),
            y: Axis::new("error, %", cover),
            series: vec![
                series("one", Mark::Line),
                series("two", Mark::Dashes),
                series("", Mark::Dots),
                series("four", Mark::Diamonds),
            ],
        }
    }

    #[test]
    fn any_points_give_finite_coordinates_inside_the_picture() {
        let cases: [Vec<(f64, f64)>; 7] = [
            vec![],
            vec![(0.0, 0.0)],
            vec![(3.0, f64::NAN), (4.0, f64::INFINITY)],
            vec![(0.0, 1e-300), (1.0, 1e300)],
            vec![(0.0, -5.0), (1.0, -5.0)],
            (0..5000).map(|i| (f64::from(i), (0.1 * f64::from(i)).sin())).collect(),
            vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 1.0)],
        ];
        for points in cases {
            for cover in [AxisRange::FromZero, AxisRange::Around, AxisRange::Exactly, AxisRange::Logarithmic] {
                let svg = chart(&points, cover).svg();
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{cover:?} {svg}");
                assert!(svg.contains("a&lt;b"));
                for path in svg.split("class=\"c\" d=\"M").skip(1) {
                    let numbers = path.split('"').next().unwrap_or("").replace(['M', 'L'], " ");
                    if numbers.contains('h') {
                        continue;
                    }
                    for (k, word) in numbers.split_whitespace().enumerate() {
                        let value: f64 = word.parse().unwrap_or_else(|_| panic!("{word} in {numbers}"));
                        assert!((0.0..=if k % 2 == 0 { WIDTH } else { 400.0 }).contains(&value), "{value}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_gap_in_the_points_is_a_gap_in_the_line() {
        let svg = chart(&[(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, 2.0), (4.0, 1.0)], AxisRange::FromZero).svg();
        let path = svg.split("class=\"c\" d=\"").nth(3).and_then(|rest| rest.split('"').next());
        assert_eq!(path.map(|path| path.matches('M').count()), Some(2), "{svg}");
    }

    #[test]
    fn long_lines_keep_their_peaks() {
        let mut points: Vec<(f64, f64)> = (0..10_000).map(|i| (f64::from(i), 1.0)).collect();
        points[7_777].1 = 3.0;
        assert_eq!(thinned(&points).iter().filter(|p| p.1 == 3.0).count(), 1);
        assert!(thinned(&points).len() <= MOST_POINTS);
    }

    #[test]
    fn logarithmic_axes_have_round_ticks() {
        let ticks = |values: &[f64]| {
            Scale::covering(AxisRange::Logarithmic, values).ticks().into_iter().map(short).collect::<Vec<_>>()
        };
        assert_eq!(ticks(&[1.5, 30.0]), ["1", "2", "5", "10", "20"]);
        assert_eq!(ticks(&[1e-6, 1.0]).len(), 5);
        let around = Scale::covering(AxisRange::Around, &[-399.0, -350.0]);
        assert_eq!(around.ticks(), [-400.0, -380.0, -360.0, -340.0]);
    }
}
