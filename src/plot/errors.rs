//! The per-frame error as a picture: one self-contained SVG.

use super::scale::{Scale, nice_step};
use super::text::{escaped, grouped, line, short, text};
use std::fmt::Write;

/// Size of the picture and the left, right and upper edges of its panels, in pixels.
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 478.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 652.0;
const TOPS: [f64; 2] = [76.0, 276.0];
const PANEL: f64 = 136.0;
/// Up to this many frames each gets its own dot.
const DOTS: usize = 60;
/// Characters of the title that fit above the panels.
const TITLE_CHARACTERS: usize = 78;

/// Draws the errors of all frames, given as fractions of the rest diagonal, as an SVG document.
///
/// L2 and L∞ differ tenfold, so each has its own panel; they share the frame axis. Values that are not finite (a frame that was
/// not measured) leave a gap.
pub(crate) fn error_plot(title: &str, l2: &[f64], linf: &[f64]) -> String {
    // Colours of Okabe and Ito, which stay apart for every kind of colour vision and in grey.
    let panels = [
        ("L2", "root mean square over the points", "#0072b2", percent(l2)),
        ("L∞", "largest over the points", "#d55e00", percent(linf)),
    ];
    let frames = l2.len().max(linf.len());
    let mut svg = String::new();
    open(&mut svg, title);
    for ((name, meaning, colour, values), top) in panels.into_iter().zip(TOPS) {
        let frame_axis = FrameAxis { frames };
        let panel = Panel { top, colour, scale: Scale::over(&values), frame_axis, values };
        panel.legend(&mut svg, name, meaning);
        panel.grid(&mut svg);
        panel.curve(&mut svg);
        panel.mean(&mut svg);
    }
    text(&mut svg, (LEFT + RIGHT) / 2.0, HEIGHT - 16.0, "middle", "#333", "frame");
    let middle = (TOPS[0] + TOPS[1] + PANEL) / 2.0;
    let _ = writeln!(
        svg,
        r##"<text transform="translate(19 {middle}) rotate(-90)" text-anchor="middle" fill="#333">error, % of the rest diagonal</text>"##
    );
    svg.push_str("</svg>\n");
    svg
}

fn percent(fractions: &[f64]) -> Vec<f64> {
    fractions.iter().map(|fraction| 100.0 * fraction).collect()
}

fn open(svg: &mut String, title: &str) {
    let full = escaped(title);
    let _ = writeln!(
        svg,
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img" font-family="Helvetica, Arial, 'DejaVu Sans', sans-serif" font-size="12">
<title>{full}</title>
<rect width="100%" height="100%" fill="#fff"/>"##
    );
    let mut shown: String = title.chars().take(TITLE_CHARACTERS).collect();
    if shown.len() < title.len() {
        shown.push('…');
    }
    let shown = escaped(&shown);
    let _ = writeln!(svg, r##"<text x="{LEFT}" y="32" font-size="16" font-weight="bold" fill="#111">{shown}</text>"##);
}

/// One measure over all frames.
struct Panel {
    top: f64,
    colour: &'static str,
    scale: Scale,
    frame_axis: FrameAxis,
    /// Errors in percent.
    values: Vec<f64>,
}

impl Panel {
    fn bottom(&self) -> f64 {
        self.top + PANEL
    }

    fn y(&self, value: f64) -> f64 {
        self.bottom() - PANEL * self.scale.position(value)
    }

    fn legend(&self, svg: &mut String, name: &str, meaning: &str) {
        let y = self.top - 12.0;
        let style = format!(r#"stroke="{}" stroke-width="2.5""#, self.colour);
        line(svg, [LEFT, y - 4.0], [LEFT + 22.0, y - 4.0], &style);
        let scale = if self.scale.logarithmic { ", logarithmic" } else { "" };
        let content = format!(
            r##"<tspan font-weight="bold" fill="{}">{name}</tspan><tspan dx="6">{meaning}{scale}</tspan>"##,
            self.colour
        );
        text(svg, LEFT + 30.0, y, "start", "#555", &content);
    }

    fn grid(&self, svg: &mut String) {
        let bottom = self.bottom();
        for frame in self.frame_axis.ticks() {
            let x = self.frame_axis.x(frame as f64);
            line(svg, [x, self.top], [x, bottom], r##"stroke="#eee""##);
            text(svg, x, bottom + 16.0, "middle", "#555", &grouped(frame));
        }
        for value in self.scale.ticks() {
            let y = self.y(value);
            line(svg, [LEFT, y], [RIGHT, y], r##"stroke="#e2e2e2""##);
            text(svg, LEFT - 8.0, y + 4.0, "end", "#555", &short(value));
        }
        line(svg, [LEFT, bottom], [RIGHT, bottom], r##"stroke="#888""##);
    }

    fn curve(&self, svg: &mut String) {
        let colour = self.colour;
        let bottom = self.bottom();
        let mut dots = String::new();
        for run in self.runs() {
            let mut path = String::new();
            for (i, &(frame, value)) in run.iter().enumerate() {
                let _ = write!(
                    path,
                    "{}{:.1} {:.1}",
                    if i == 0 { 'M' } else { 'L' },
                    self.frame_axis.x(frame),
                    self.y(value)
                );
            }
            let (first, last) = (self.frame_axis.x(run[0].0), self.frame_axis.x(run[run.len() - 1].0));
            if !self.scale.logarithmic {
                // An area means something only above a zero.
                let _ = writeln!(
                    svg,
                    r#"<path d="{path}L{last:.1} {bottom}L{first:.1} {bottom}Z" fill="{colour}" fill-opacity="0.10"/>"#
                );
            }
            let _ = writeln!(
                svg,
                r#"<path d="{path}" fill="none" stroke="{colour}" stroke-width="1.5" stroke-linejoin="round"/>"#
            );
            if run.len() == 1 || self.frame_axis.frames <= DOTS {
                for &(frame, value) in &run {
                    let radius = if run.len() == 1 { 3.5 } else { 2.2 };
                    let (x, y) = (self.frame_axis.x(frame), self.y(value));
                    let _ = writeln!(dots, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" fill="{colour}"/>"#);
                }
            }
        }
        svg.push_str(&dots);
    }

    /// Stretches of measured frames, each thinned to the least and the largest value of a pixel column.
    fn runs(&self) -> Vec<Vec<(f64, f64)>> {
        let columns = (RIGHT - LEFT) as usize;
        let per_column = self.frame_axis.frames.div_ceil(columns);
        let mut runs = Vec::new();
        let mut start = 0;
        for stretch in self.values.split(|value| !value.is_finite()) {
            let mut run = Vec::new();
            for (k, block) in stretch.chunks(if per_column > 2 { per_column } else { 1 }).enumerate() {
                let at = start + k * if per_column > 2 { per_column } else { 1 };
                let by_value = |a: &usize, b: &usize| block[*a].total_cmp(&block[*b]);
                let least = (0..block.len()).min_by(by_value).unwrap_or(0);
                let largest = (0..block.len()).max_by(by_value).unwrap_or(0);
                run.push(((at + least.min(largest)) as f64, block[least.min(largest)]));
                if least != largest {
                    run.push(((at + least.max(largest)) as f64, block[least.max(largest)]));
                }
            }
            if !run.is_empty() {
                runs.push(run);
            }
            start += stretch.len() + 1;
        }
        runs
    }

    fn mean(&self, svg: &mut String) {
        let measured: Vec<f64> = self.values.iter().copied().filter(|value| value.is_finite()).collect();
        if measured.is_empty() {
            text(svg, (LEFT + RIGHT) / 2.0, self.top + PANEL / 2.0, "middle", "#888", "no frame was measured");
            return;
        }
        let count = measured.len() as f64;
        // Dividing first keeps the sum of huge values finite.
        let mean: f64 = measured.iter().map(|value| value / count).sum();
        let y = self.y(mean);
        let style = format!(r#"stroke="{}" stroke-dasharray="5 4" stroke-opacity="0.8""#, self.colour);
        line(svg, [LEFT, y], [RIGHT, y], &style);
        text(svg, RIGHT + 8.0, y + 4.0, "start", self.colour, &format!("mean {} %", short(mean)));
    }
}

/// The shared horizontal axis.
struct FrameAxis {
    frames: usize,
}

impl FrameAxis {
    fn x(&self, frame: f64) -> f64 {
        match self.frames {
            0 | 1 => (LEFT + RIGHT) / 2.0,
            frames => LEFT + (RIGHT - LEFT) * frame / (frames - 1) as f64,
        }
    }

    fn ticks(&self) -> Vec<usize> {
        let last = self.frames.saturating_sub(1);
        let step = (nice_step(last as f64, 8.0) as usize).max(1);
        (0..self.frames).step_by(step).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(frames: usize) -> Vec<f64> {
        (0..frames).map(|t| 0.008 + 0.003 * (0.1 * t as f64).sin()).collect()
    }

    /// Numbers of all paths' points.
    fn path_points(svg: &str) -> usize {
        svg.lines().filter(|l| l.starts_with("<path")).map(|l| l.matches(['M', 'L']).count()).sum()
    }

    #[test]
    fn any_capture_gives_finite_coordinates() {
        let huge: Vec<f64> = (-300..300).map(|e| 10_f64.powi(e)).collect();
        let gaps = [0.01, f64::NAN, 0.02, f64::INFINITY, 0.01, 0.02];
        let tiny = [f64::MIN_POSITIVE / 4.0; 3];
        let cases: [&[f64]; 9] =
            [&[], &[0.01], &[0.0], &[0.0; 50], &huge, &gaps, &[f64::NAN], &tiny, &[f64::MAX, f64::MAX]];
        for values in cases {
            let svg = error_plot("t", values, &wave(values.len()));
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            assert_eq!(svg.matches("<svg").count(), svg.matches("</svg>").count());
        }
    }

    #[test]
    fn long_captures_keep_their_peaks_in_a_small_picture() {
        let mut values = wave(10_000);
        values[7_777] = 0.02;
        let svg = error_plot("long", &values, &values);
        assert!(path_points(&svg) < 10_000);
        assert!(svg.len() < 120_000, "{} bytes", svg.len());
        let peak = TOPS[0] + PANEL * (1.0 - Scale::over(&percent(&values)).position(2.0));
        assert!(svg.contains(&format!(" {peak:.1}L")));
    }

    #[test]
    fn titles_cannot_break_the_document() {
        let svg = error_plot("a<b> & \"c\" \u{1} 'd'", &[0.1], &[0.2]);
        assert!(svg.contains("a&lt;b&gt; &amp; &quot;c&quot;   &#39;d&#39;"));
    }

    #[test]
    fn means_are_given_in_percent_of_the_diagonal() {
        let svg = error_plot("", &[0.001, 0.003], &[0.01, f64::NAN]);
        assert!(svg.contains("mean 0.2 %") && svg.contains("mean 1 %"));
    }

    #[test]
    fn ticks_are_round_and_short() {
        assert_eq!(
            [0.0, 0.25, 1.0, 12345.0, 3.2e-7, 0.000_12, 99.95].map(short),
            ["0", "0.25", "1", "12345", "3.2e-7", "0.00012", "100"]
        );
        let ticks = |values: &[f64]| Scale::over(values).ticks().into_iter().map(short).collect::<Vec<_>>();
        assert_eq!(ticks(&[0.85]), ["0", "0.5", "1"]);
        assert_eq!(ticks(&[7.3]), ["0", "2", "4", "6", "8"]);
        assert_eq!(ticks(&[1e-6, 1.0]), ["1e-6", "0.0001", "0.01", "1"]);
        assert_eq!(FrameAxis { frames: 175 }.ticks(), [0, 50, 100, 150]);
    }
}
