//! The errors of every frame as one self-contained SVG document.

use super::chart::{Axis, Chart, Mark, Series, WIDTH};
use super::scale::AxisRange;
use super::text::{escaped, short};

/// Errors that differ by more than this factor get a logarithmic axis.
const LINEAR_SPAN: f64 = 1000.0;

/// What a page's style sheet says for charts that stand in one. The colours are Okabe and Ito's, which stay apart for every kind of
/// colour vision and in grey.
const STYLE: &str = "\
text { font: 12px Helvetica, Arial, 'DejaVu Sans', sans-serif; fill: #555 } .t { font-size: 14px; font-weight: bold; fill: #111 }
.l { fill: #333 } .a { font-size: 11px } .g { stroke: #e2e2e2; fill: none } .b { stroke: #888; fill: none }
.c { fill: none; stroke: currentColor; stroke-width: 1.6; stroke-linejoin: round }
.l2 { color: #0072b2 } .linf { color: #d55e00 }";

/// Draws the errors of all frames, given as fractions of the rest diagonal.
///
/// L2 and L∞ differ tenfold, so each has its own chart. Values that are not finite (a frame that was not measured) leave a gap.
pub(crate) fn error_plot(title: &str, l2: &[f64], linf: &[f64]) -> String {
    let measures =
        [(title, "L2: root mean square over the points", "l2", l2), ("", "L∞: largest over the points", "linf", linf)];
    let (mut charts, mut top) = (String::new(), 4.0);
    for (title, label, class, errors) in measures {
        let (drawing, height) = chart(title, label, class, errors).drawing();
        charts.push_str(&format!("<g transform=\"translate(0 {top})\">\n{drawing}</g>\n"));
        top += height;
    }
    format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {top}" width="{}" height="{}" role="img">
<title>{}</title>
<style>{STYLE}</style>
<rect width="100%" height="100%" fill="#fff"/>
{charts}</svg>
"##,
        1.5 * WIDTH,
        1.5 * top,
        escaped(title)
    )
}

fn chart(title: &str, label: &str, class: &'static str, errors: &[f64]) -> Chart {
    let percent = || errors.iter().map(|error| 100.0 * error);
    let measured: Vec<f64> = percent().filter(|error| error.is_finite()).collect();
    let positive = || measured.iter().copied().filter(|&error| error > 0.0);
    let span = positive().fold(0.0, f64::max) / positive().fold(f64::INFINITY, f64::min);
    let cover = if span > LINEAR_SPAN { AxisRange::Logarithmic } else { AxisRange::FromZero };
    let points = percent().enumerate().map(|(frame, error)| (frame as f64, error)).collect();
    let curve = Series { label: label.to_owned(), class, mark: Mark::Line, points };
    let (last, mean) = ((errors.len().max(1) - 1) as f64, measured.iter().sum::<f64>() / measured.len() as f64);
    let mean = match measured.len() {
        0 => Series { label: "no frame was measured".to_owned(), class, mark: Mark::Dashes, points: Vec::new() },
        _ => Series {
            label: format!("mean {} %", short(mean)),
            class,
            mark: Mark::Dashes,
            points: vec![(0.0, mean), (last, mean)],
        },
    };
    Chart {
        title: title.to_owned(),
        x: Axis::counting("frame"),
        y: Axis::new("% of the rest diagonal", cover),
        series: vec![curve, mean],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_capture_gives_finite_coordinates() {
        let cases: [&[f64]; 6] =
            [&[], &[0.01], &[0.0; 50], &[1e-30, 1e30], &[0.01, f64::NAN, 0.02, f64::INFINITY], &[f64::NAN]];
        for values in cases {
            let svg = error_plot("t", values, &[0.01, 0.02]);
            let words = svg.split(|c: char| !c.is_alphanumeric());
            let mut words = words.map(|word| word.trim_start_matches(['M', 'L', 'H', 'V']));
            assert!(words.all(|word| word != "NaN" && word != "inf"), "{svg}");
            assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count());
        }
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
    fn a_frame_between_two_that_were_not_measured_is_a_dot() {
        let mut errors = vec![0.01; 100];
        (errors[49], errors[51]) = (f64::NAN, f64::NAN);
        assert_eq!(error_plot("", &errors, &[]).matches("<circle").count(), 1);
    }
}
