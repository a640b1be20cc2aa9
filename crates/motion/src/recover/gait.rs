//! How high ankles and toes are over time, and a picture of it.

use super::RecoveryReport;
use cager_geometry::mesh::Point;
use cager_geometry::vector::dot;
use cager_shape::people::rig::QUAD_NAMES;
use serde::Serialize;
use std::fmt::Write;

/// The height of a joint in every frame.
#[derive(Debug, Serialize)]
pub struct GaitCurve {
    /// `left ankle`, `right ankle`, `left toe`, `right toe`.
    pub joint: &'static str,
    /// Along the rig's up axis, above the lowest place that any of these joints comes to.
    pub heights: Vec<f64>,
}

const JOINTS: [&str; 4] = ["left ankle", "right ankle", "left toe", "right toe"];

/// Curves of the joints of a rig in every frame.
pub(super) fn gait(frames: &[Vec<Point>], up: Point) -> Vec<GaitCurve> {
    let of = |joint: &'static str| {
        let quad = QUAD_NAMES.iter().position(|&name| name == joint)?;
        Some(GaitCurve { joint, heights: frames.iter().map(|joints| dot(joints[quad], up)).collect() })
    };
    let mut curves: Vec<GaitCurve> = JOINTS.into_iter().filter_map(of).collect();
    let lowest = curves.iter().flat_map(|curve| &curve.heights).copied().fold(f64::INFINITY, f64::min);
    curves.iter_mut().flat_map(|curve| &mut curve.heights).for_each(|height| *height -= lowest);
    curves
}

const WIDTH: f64 = 860.0;
/// Where panels are from left to right, their height, and where the first begins.
const SPAN: [f64; 2] = [64.0, 844.0];
const PANEL: f64 = 170.0;
const TOP: f64 = 46.0;
const GAP: f64 = 58.0;
const COLORS: [(&str, &str); 2] = [("left", "#0b6bcb"), ("right", "#c2410c")];

/// The curves of a report as SVG: ankles above, toes below, over frames or seconds; lost frames
/// shaded.
pub fn gait_svg(report: &RecoveryReport, frame_rate: Option<f64>) -> String {
    let times: Vec<f64> = report.frames.iter().map(|frame| frame.number / frame_rate.unwrap_or(1.0)).collect();
    let (first, last) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
    let along = Axis { from: first, to: if last > first { last } else { first + 1.0 }, place: SPAN };
    let height = TOP + 2.0 * PANEL + GAP + 48.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" font-family=\"system-ui, sans-serif\" font-size=\"12\" fill=\"#333\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    );
    for (k, (side, color)) in COLORS.into_iter().enumerate() {
        let x = SPAN[1] - 130.0 + 64.0 * k as f64;
        let _ = writeln!(
            svg,
            "<path d=\"M{x} 20h18\" stroke=\"{color}\" stroke-width=\"2\"/><text x=\"{}\" y=\"24\">{side}</text>",
            x + 24.0
        );
    }
    for (k, part) in ["ankle", "toe"].into_iter().enumerate() {
        let top = TOP + k as f64 * (PANEL + GAP);
        let curves = report.gait.iter().filter(|curve| curve.joint.ends_with(part));
        let most = curves.clone().flat_map(|curve| &curve.heights).copied().fold(0.0, f64::max);
        let up = Axis { from: 0.0, to: if most > 0.0 { 1.08 * most } else { 1.0 }, place: [top + PANEL, top] };
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" font-weight=\"600\">Height of the {part}s</text>",
            SPAN[0],
            top - 10.0
        );
        let half = 0.5 * (along.at(along.to) - along.at(along.from)) / times.len().max(2) as f64;
        for (time, _) in times.iter().zip(&report.frames).filter(|(_, frame)| frame.outcome == "lost") {
            let (from, to) = ((along.at(*time) - half).max(SPAN[0]), (along.at(*time) + half).min(SPAN[1]));
            let _ = writeln!(
                svg,
                "<rect x=\"{from:.1}\" y=\"{top}\" width=\"{:.1}\" height=\"{PANEL}\" fill=\"#e5e5e5\"><title>lost</title></rect>",
                to - from
            );
        }
        for (tick, text) in up.ticks(5.0) {
            let y = up.at(tick);
            let _ = writeln!(
                svg,
                "<path d=\"M{} {y:.1}H{}\" stroke=\"#e3e3e3\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
                SPAN[0],
                SPAN[1],
                SPAN[0] - 8.0,
                y + 4.0
            );
        }
        for (tick, text) in along.ticks(10.0) {
            let x = along.at(tick);
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {}v4\" stroke=\"#888\"/><text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{text}</text>",
                top + PANEL,
                top + PANEL + 18.0
            );
        }
        let _ = writeln!(svg, "<path d=\"M{} {}H{}\" stroke=\"#888\"/>", SPAN[0], top + PANEL, SPAN[1]);
        for curve in curves {
            let color =
                COLORS.into_iter().find(|(side, _)| curve.joint.starts_with(side)).map_or("#333", |(_, color)| color);
            let points = times.iter().zip(&curve.heights).map(|(&t, &h)| format!("{:.1},{:.1}", along.at(t), up.at(h)));
            let _ = writeln!(
                svg,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-linejoin=\"round\"><title>{}</title></polyline>",
                points.collect::<Vec<_>>().join(" "),
                curve.joint
            );
        }
    }
    let what = if frame_rate.is_some() { "seconds" } else { "frame" };
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{what}</text>\n</svg>",
        0.5 * (SPAN[0] + SPAN[1]),
        height - 10.0
    );
    svg
}

/// Values along a line of the picture.
struct Axis {
    from: f64,
    to: f64,
    place: [f64; 2],
}

impl Axis {
    fn at(&self, value: f64) -> f64 {
        self.place[0] + (value - self.from) / (self.to - self.from) * (self.place[1] - self.place[0])
    }

    /// Up to about so many round values, and what is written there.
    fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        let rough = (self.to - self.from) / count;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|x| x * power).into_iter().find(|&step| step >= rough).unwrap_or(rough);
        let digits = (-step.log10().floor()).max(0.0) as usize;
        let ticks = ((self.from / step).ceil() as i64)..=((self.to / step).floor() as i64);
        ticks.map(|k| (k as f64 * step, format!("{:.digits$}", k as f64 * step))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_above_the_lowest_along_up_and_ticks_are_round() {
        let joints = |lift: f64| (0..QUAD_NAMES.len()).map(|quad| [9.0, 0.0, 2.0 + lift + quad as f64]).collect();
        let curves = gait(&[joints(0.0), joints(0.5)], [0.0, 0.0, 1.0]);
        assert_eq!(curves.iter().map(|curve| curve.joint).collect::<Vec<_>>(), JOINTS);
        assert_eq!(curves[0].heights, [0.0, 0.5]);
        assert_eq!(curves[3].heights, [9.0, 9.5]);
        let axis = Axis { from: 0.0, to: 0.23, place: [100.0, 0.0] };
        assert_eq!(
            axis.ticks(5.0).iter().map(|(_, text)| text.as_str()).collect::<Vec<_>>(),
            ["0.00", "0.05", "0.10", "0.15", "0.20"]
        );
        assert!((axis.at(0.115) - 50.0).abs() < 1e-9);
    }
}
