//! Triangles, lines and discs into a depth buffer, several samples for each pixel.

use super::colour::Rgb;
use super::png::Png;
use cager_core::mesh::Point;

/// Samples of a pixel in each direction.
pub(super) const SAMPLES: usize = 3;

/// A picture in the making, at [`SAMPLES`] times its size in each direction.
pub(super) struct Canvas {
    width: usize,
    height: usize,
    /// Red, green, blue times opacity, and opacity.
    colours: Vec<[f32; 4]>,
    /// Larger is nearer.
    depths: Vec<f32>,
}

/// A corner of a triangle: place in samples and depth, and colour.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) place: Point,
    pub(super) colour: Rgb,
}

impl Canvas {
    /// An empty one for a picture of this size.
    pub(super) fn new(width: usize, height: usize) -> Self {
        let (width, height) = (SAMPLES * width, SAMPLES * height);
        Self { width, height, colours: vec![[0.0; 4]; width * height], depths: vec![f32::NEG_INFINITY; width * height] }
    }

    /// Size in samples.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// An opaque triangle; corners that are not finite leave nothing.
    pub(super) fn triangle(&mut self, corners: [Corner; 3]) {
        let [a, b, c] = corners.map(|corner| corner.place);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if !area.is_finite() || area == 0.0 {
            return;
        }
        let Some([left, right]) = span([a[0], b[0], c[0]], self.width) else { return };
        let Some([top, bottom]) = span([a[1], b[1], c[1]], self.height) else { return };
        // Depth and colour are linear over the triangle: their values at the first corner's place, and their slopes.
        let slopes = |f: [f64; 3]| {
            let (p, q) = (f[1] - f[0], f[2] - f[0]);
            [(p * (c[1] - a[1]) - q * (b[1] - a[1])) / area, (q * (b[0] - a[0]) - p * (c[0] - a[0])) / area]
        };
        let channel = |k: usize| corners.map(|corner| f64::from(corner.colour[k]));
        let values = [[a[2], b[2], c[2]], channel(0), channel(1), channel(2)];
        let slopes = values.map(slopes);
        for y in top..=bottom {
            let py = y as f64 + 0.5;
            let Some([first, last]) = row([a, b, c], py, area, [left, right]) else { continue };
            let start = [0, 1, 2, 3]
                .map(|k| values[k][0] + slopes[k][0] * (first as f64 + 0.5 - a[0]) + slopes[k][1] * (py - a[1]));
            for x in first..=last {
                let along = (x - first) as f64;
                let depth = (start[0] + along * slopes[0][0]) as f32;
                let at = y * self.width + x;
                if depth > self.depths[at] {
                    self.depths[at] = depth;
                    let mix = |k: usize| ((start[k] + along * slopes[k][0]) as f32).clamp(0.0, 1.0);
                    self.colours[at] = [mix(1), mix(2), mix(3), 1.0];
                }
            }
        }
    }

    /// A line of this width in samples. Where it is hidden by what is nearer than it by more than `slack`, it has the opacity
    /// `hidden` instead of one.
    pub(super) fn line(&mut self, a: Point, b: Point, colour: Rgb, width: f64, slack: f64, hidden: f32) {
        if !a.iter().chain(&b).all(|x| x.is_finite()) {
            return;
        }
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let steep = dy.abs() > dx.abs();
        let (from, along, across, slope, long, wide) = if steep {
            (a[1], dy, a[0], dx / dy, self.height, self.width)
        } else {
            (a[0], dx, a[1], if dx == 0.0 { 0.0 } else { dy / dx }, self.width, self.height)
        };
        // The stroke is wider across the axis than at right angles to itself.
        let half = 0.5 * width * (1.0 + slope * slope).sqrt();
        let Some([first, last]) = span([from, from + along, from], long) else { return };
        for step in first..=last {
            let t = if along == 0.0 { 0.0 } else { ((step as f64 + 0.5 - from) / along).clamp(0.0, 1.0) };
            let middle = across + slope * along * t;
            let depth = (a[2] + t * (b[2] - a[2]) + slack) as f32;
            let Some([low, high]) = span([middle - half + 0.5, middle + half - 0.5, middle], wide) else { continue };
            for other in low..=high {
                let at = if steep { step * self.width + other } else { other * self.width + step };
                let opacity = if depth >= self.depths[at] { 1.0 } else { hidden };
                self.blend(at, colour, opacity);
            }
        }
    }

    /// A disc of this radius in samples, a little darker towards its edge.
    pub(super) fn disc(&mut self, centre: Point, colour: Rgb, radius: f64, slack: f64) {
        if !centre.iter().all(|x| x.is_finite()) {
            return;
        }
        let reach = |x: f64| [x - radius, x + radius, x];
        let Some([left, right]) = span(reach(centre[0]), self.width) else { return };
        let Some([top, bottom]) = span(reach(centre[1]), self.height) else { return };
        for y in top..=bottom {
            for x in left..=right {
                let (dx, dy) = ((x as f64 + 0.5 - centre[0]) / radius, (y as f64 + 0.5 - centre[1]) / radius);
                let far = dx * dx + dy * dy;
                let at = y * self.width + x;
                let depth = (centre[2] + slack) as f32;
                if far <= 1.0 && depth > self.depths[at] {
                    self.depths[at] = depth;
                    let shade = (1.0 - 0.35 * far) as f32;
                    self.colours[at] = [shade * colour[0], shade * colour[1], shade * colour[2], 1.0];
                }
            }
        }
    }

    fn blend(&mut self, at: usize, colour: Rgb, opacity: f32) {
        let under = self.colours[at];
        let over = [colour[0], colour[1], colour[2], 1.0];
        self.colours[at] = [0, 1, 2, 3].map(|k| opacity * over[k] + (1.0 - opacity) * under[k]);
    }

    /// The picture.
    pub(super) fn png(&self) -> Png {
        Png::new(self.width / SAMPLES, self.height / SAMPLES, &self.pixels())
    }

    /// Its pixels, rows from above, red, green, blue and opacity: the mean of each one's samples.
    pub(super) fn pixels(&self) -> Vec<[u8; 4]> {
        let (width, height) = (self.width / SAMPLES, self.height / SAMPLES);
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let mut sum = [0.0f32; 4];
                for j in 0..SAMPLES {
                    let row = &self.colours[(SAMPLES * y + j) * self.width + SAMPLES * x..][..SAMPLES];
                    for sample in row {
                        for k in 0..4 {
                            sum[k] += sample[k];
                        }
                    }
                }
                let opacity = sum[3];
                // Colours of PNG are not multiplied by opacity.
                let channel = |k: usize| if opacity > 0.0 { (255.0 * sum[k] / opacity).round() as u8 } else { 0 };
                let covered = (255.0 * opacity / (SAMPLES * SAMPLES) as f32).round() as u8;
                pixels.push([channel(0), channel(1), channel(2), covered]);
            }
        }
        pixels
    }
}

/// The samples of one row whose centres lie within a triangle, between two columns.
///
/// A centre on an edge belongs to the triangle to its right or below alone, so that neighbours never both draw it.
fn row([a, b, c]: [Point; 3], y: f64, area: f64, [left, right]: [usize; 2]) -> Option<[usize; 2]> {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for (p, q) in [(a, b), (b, c), (c, a)] {
        // Inside where rate · x + offset is not negative.
        let sign = if area > 0.0 { 1.0 } else { -1.0 };
        let rate = -sign * (q[1] - p[1]);
        let offset = sign * ((q[0] - p[0]) * (y - p[1]) + (q[1] - p[1]) * p[0]);
        if rate > 0.0 {
            low = low.max(-offset / rate);
        } else if rate < 0.0 {
            high = high.min(-offset / rate);
        } else if offset < 0.0 {
            return None;
        }
    }
    let first = (low - 0.5).ceil().max(left as f64);
    let last = (high - 0.5).ceil() - 1.0;
    let last = last.min(right as f64);
    (first <= last).then_some([first as usize, last as usize])
}

/// The samples that lie between the least and the largest of the values, if any do.
fn span(values: [f64; 3], end: usize) -> Option<[usize; 2]> {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let inside = low < end as f64 && high >= 0.0;
    inside.then(|| [low.max(0.0) as usize, (high as usize).min(end - 1)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    const RED: Rgb = [1.0, 0.0, 0.0];
    const BLUE: Rgb = [0.0, 0.0, 1.0];

    fn square(canvas: &mut Canvas, x: f64, size: f64, depth: f64, colour: Rgb) {
        let corner = |i: f64, j: f64| Corner { place: [x + i * size, x + j * size, depth], colour };
        canvas.triangle([corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0)]);
        canvas.triangle([corner(0.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)]);
    }

    fn covered(canvas: &Canvas, colour: Rgb) -> usize {
        canvas.colours.iter().filter(|c| c[3] == 1.0 && c[..3] == colour).count()
    }

    #[test]
    fn a_square_covers_its_area_once_whichever_way_it_is_split() {
        let mut canvas = Canvas::new(10, 10);
        square(&mut canvas, 3.0, 12.0, 0.0, RED);
        assert_eq!(covered(&canvas, RED), 144);
    }

    #[test]
    fn what_is_nearer_hides_what_is_farther_in_any_order() {
        for order in [[(1.0, RED), (2.0, BLUE)], [(2.0, BLUE), (1.0, RED)]] {
            let mut canvas = Canvas::new(10, 10);
            for (depth, colour) in order {
                square(&mut canvas, 0.0, 30.0, depth, colour);
            }
            assert_eq!((covered(&canvas, RED), covered(&canvas, BLUE)), (0, 900));
        }
    }

    #[test]
    fn a_line_is_faint_behind_and_full_before() {
        let mut canvas = Canvas::new(10, 10);
        square(&mut canvas, 0.0, 30.0, 5.0, RED);
        canvas.line([2.0, 15.0, 9.0], [14.0, 15.0, 9.0], BLUE, 3.0, 0.0, 0.25);
        canvas.line([16.0, 15.0, 1.0], [28.0, 15.0, 1.0], BLUE, 3.0, 0.0, 0.25);
        let at = |x: usize| canvas.colours[15 * 30 + x];
        assert_eq!((at(8), at(22)), ([0.0, 0.0, 1.0, 1.0], [0.75, 0.0, 0.25, 1.0]));
        assert_eq!(at(0), [1.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn lines_have_their_width_in_every_direction() {
        for angle in [0.0f64, 0.3, FRAC_PI_4, 1.2, FRAC_PI_2, 2.5, 4.0] {
            let mut canvas = Canvas::new(40, 40);
            let (sin, cos) = angle.sin_cos();
            let end = |s: f64| [60.0 + 40.0 * s * cos, 60.0 + 40.0 * s * sin, 0.0];
            canvas.line(end(-1.0), end(1.0), RED, 4.0, 0.0, 0.0);
            let area = covered(&canvas, RED) as f64;
            assert!((area / 320.0 - 1.0).abs() < 0.3, "{angle}: {area}");
        }
    }

    #[test]
    fn nothing_outside_or_not_finite_does_harm() {
        let mut canvas = Canvas::new(8, 8);
        let far = 1e12;
        for x in [f64::NAN, f64::INFINITY, -far, far] {
            let corner = |p: Point| Corner { place: p, colour: RED };
            canvas.triangle([corner([x, 0.0, 0.0]), corner([0.0, x, 0.0]), corner([x, x, 0.0])]);
            canvas.line([x, 3.0, 0.0], [5.0, x, 0.0], BLUE, 3.0, 0.0, 0.5);
            canvas.disc([x, 1.0, 0.0], BLUE, 4.0, 0.0);
        }
        // A line that only passes through.
        canvas.line([-far, 12.0, 0.0], [far, 12.0, 0.0], BLUE, 3.0, 0.0, 0.5);
        assert!(canvas.colours.iter().flatten().all(|x| x.is_finite()));
        assert_eq!(canvas.colours[12 * 24 + 12], [0.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn edges_are_smooth_and_the_rest_is_clear() {
        let mut canvas = Canvas::new(2, 1);
        square(&mut canvas, 0.0, 2.0, 0.0, RED);
        let whole = canvas.colours.iter().filter(|c| c[3] == 1.0).count();
        assert_eq!(whole, 4);
        let picture = canvas.png();
        let alone = Png::new(2, 1, &[[255, 0, 0, 113], [0, 0, 0, 0]]);
        assert_eq!(picture.data_url(), alone.data_url());
    }
}
