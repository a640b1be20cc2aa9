//! Detects whether the frames of a capture belong to a rest pose: units, axes, handedness and order
//! of points, by edge lengths, extents, the correlation of positions and the maps of regions.
//! Deformation changes these far less than a mix-up does.

mod cage;
mod faces;
mod hand;
pub mod watch;

pub use cage::cage_mismatch;
pub use hand::{Mirroring, SAME_AXES};

use cager_geometry::mesh::{Model, Point, bounds};
use cager_geometry::units::Up;
use cager_geometry::vector::distance;
use hand::{Regions, signed_permutations};
use std::fmt;

/// Number of evenly spaced frames to compare.
pub const FRAMES: usize = 5;

/// Most edges or pairs of points compared per frame.
const MAX_PAIRS: usize = 20_000;

/// Most distances computed to find nearest neighbours in a point cloud.
const MAX_DISTANCES: usize = 20_000_000;

/// A mismatch between a capture and its rest pose. Ratios are capture to rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mismatch {
    /// The order of points differs: median ratio of edge lengths in the first frame.
    Order(f64),
    /// All frames are scaled by about this factor.
    Units(f64),
    /// The axes y and z are exchanged: which points up in the capture, if a usual conversion leads
    /// there.
    Axes(Option<Up>),
    /// Left and right are exchanged in all frames: how the axes are, where that can be told.
    Mirrored(Option<Mirroring>),
}

impl Mismatch {
    /// What to do about it.
    pub fn advice(&self) -> String {
        match self {
            Self::Order(_) => "export both from one program with the order of the points kept".to_owned(),
            Self::Axes(_) => "export both with the same axes".to_owned(),
            Self::Units(_) => "scale one of them".to_owned(),
            Self::Mirrored(mirroring) => mirroring.map_or(SAME_AXES.to_owned(), |found| found.advice()),
        }
    }
}

/// Detects mismatches from some frames, including the first, points × 3 each; empty if the capture
/// plausibly belongs to the rest pose. All frames must agree, so that strong deformation is not
/// mistaken for a mismatch.
pub fn mismatches(rest: &Model, frames: &[Vec<f64>]) -> Vec<Mismatch> {
    let Some(rest_shape) = Shape::of(&rest.points) else { return Vec::new() };
    let pairs = neighbours(rest);
    let compared: Vec<FrameComparison> = frames
        .iter()
        .filter_map(|frame| FrameComparison::new(rest, &rest_shape, &pairs, frame.as_chunks().0))
        .collect();
    let Some(first) = compared.first() else { return Vec::new() };
    if compared.iter().all(FrameComparison::is_shuffled) {
        return vec![Mismatch::Order(first.edges)];
    }
    let mut found = Vec::new();
    if in_other_units(&compared) {
        found.push(Mismatch::Units(first.edges));
    }
    if let Some(mirrored) = mirrored(rest, frames) {
        found.push(mirrored);
        return found;
    }
    let exchanged: Vec<Mismatch> = compared.iter().filter_map(|frame| frame.turn.exchanged()).collect();
    if 5 * exchanged.len() >= 2 * compared.len() && !compared.iter().any(|frame| frame.turn.clearly_keeps_axes()) {
        found.push(exchanged[0]);
    }
    found
}

/// All frames that tell are mirrored, and there is one.
fn mirrored(rest: &Model, frames: &[Vec<f64>]) -> Option<Mismatch> {
    let regions = Regions::new(&rest.points);
    let hands: Vec<_> = frames.iter().filter_map(|frame| regions.hand(frame.as_chunks().0)).collect();
    let first = hands.first().filter(|_| hands.iter().all(|hand| hand.is_mirrored))?;
    Some(Mismatch::Mirrored(first.mirroring()))
}

/// A scale that varies is motion; one of all frames and edges is a unit.
fn in_other_units(compared: &[FrameComparison]) -> bool {
    let ratios = || compared.iter().map(|frame| frame.edges);
    let (least, most) = (ratios().fold(f64::INFINITY, f64::min), ratios().fold(0.0, f64::max));
    let alike = |frame: &FrameComparison| (frame.edges / frame.extent).ln().abs() < 0.7;
    let even = compared.iter().all(|frame| frame.log_quartile_ratio < 0.3) && most < 1.1 * least;
    let factor = if even { 2.2 } else { 5.0 };
    let away = least > factor || most < 1.0 / factor;
    away && most < 1.5 * least && compared.iter().all(alike)
}

/// Position and size of a point set.
struct Shape {
    centre: Point,
    /// Root mean square distance from the centre.
    radius: f64,
    diagonal: f64,
    /// Median distance of two points chosen at random.
    distance: f64,
}

impl Shape {
    /// `None` if the points coincide or are not finite.
    fn of(points: &[Point]) -> Option<Self> {
        let n = points.len() as f64;
        let (low, high) = bounds(points);
        let diagonal = distance(low, high);
        if !(diagonal.is_finite() && diagonal > 0.0) {
            return None;
        }
        let centre: Point = std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
        let radius = (points.iter().map(|&p| distance(p, centre).powi(2)).sum::<f64>() / n).sqrt();
        let count = points.len().min(2_000);
        // Multiplicative hashing picks pairs unrelated to the mesh's order.
        let other = |k: usize| k.wrapping_mul(0x9e37_79b9_7f4a_7c15) % points.len();
        let pairs = (1..=count).map(|k| distance(points[other(k)], points[other(k + count)])).collect();
        (radius.is_finite() && radius > 0.0).then_some(())?;
        Some(Self { centre, radius, diagonal, distance: quartiles(pairs)?[1] })
    }
}

/// Comparison of a frame with the rest pose.
struct FrameComparison {
    /// Median ratio of edge lengths.
    edges: f64,
    /// Natural logarithm of the ratio of upper to lower quartile of the edge ratios.
    log_quartile_ratio: f64,
    /// Ratio of the diagonals of the bounding boxes.
    extent: f64,
    /// Median edge length over the median distance of two random points, in the rest pose and in
    /// the frame; about 1 if edges are as long as random pairs.
    edge_in_rest: f64,
    edge_in_frame: f64,
    turn: AxisScores,
}

impl FrameComparison {
    fn new(rest: &Model, rest_shape: &Shape, pairs: &[[u32; 2]], frame: &[Point]) -> Option<Self> {
        let shape = Shape::of(frame)?;
        let length = |points: &[Point], [a, b]: [u32; 2]| distance(points[a as usize], points[b as usize]);
        let both: Vec<(f64, f64)> = pairs.iter().map(|&e| (length(&rest.points, e), length(frame, e))).collect();
        let [lower, edges, upper] = quartiles(both.iter().map(|(r, f)| f / r).collect())?;
        Some(Self {
            edges,
            log_quartile_ratio: (upper / lower.max(f64::MIN_POSITIVE)).ln(),
            extent: shape.diagonal / rest_shape.diagonal,
            edge_in_rest: quartiles(both.iter().map(|b| b.0).collect())?[1] / rest_shape.distance,
            edge_in_frame: quartiles(both.iter().map(|b| b.1).collect())?[1] / shape.distance,
            turn: AxisScores::new(&correlation((&rest.points, rest_shape), (frame, &shape))),
        })
    }

    fn is_shuffled(&self) -> bool {
        let longer = self.edges / self.extent;
        let like_any_two = self.edge_in_frame / self.edge_in_rest;
        let least = longer.min(like_any_two);
        let scattered = self.log_quartile_ratio > 1.0 && least > 2.0;
        let as_far_as_random_points = self.log_quartile_ratio > 0.5 && least > 2.5 && self.edge_in_frame > 0.5;
        // Crumpling preserves edge lengths.
        self.edges > 1.2 && (scattered || as_far_as_random_points)
    }
}

/// Edges of a mesh, or nearest neighbours in a cloud, of non-zero length; some of many.
fn neighbours(rest: &Model) -> Vec<[u32; 2]> {
    let points = &rest.points;
    let apart = |&[a, b]: &[u32; 2]| distance(points[a as usize], points[b as usize]) > 0.0;
    let stride = rest.faces.indices().len().div_ceil(MAX_PAIRS).max(1);
    if rest.faces.is_empty() {
        let n = points.len();
        let count = (MAX_DISTANCES / n.max(1)).clamp(32, 500).min(n);
        let nearest = |a: usize| {
            let to = |b: usize| distance(points[a], points[b]);
            let others = (0..n).filter(|&b| to(b) > 0.0);
            others.min_by(|&b, &c| to(b).total_cmp(&to(c))).map(|b| [a as u32, b as u32])
        };
        return (0..count).filter_map(|k| nearest(k * n / count)).collect();
    }
    let sides = rest.faces.iter().flat_map(|face| (0..face.len()).map(|k| [face[k], face[(k + 1) % face.len()]]));
    sides.step_by(stride).filter(apart).collect()
}

/// `Σ p qᵀ` of corresponding points about their centres, divided by both radii and the number of
/// points; one third of the identity for an unmoved ball.
fn correlation((rest, of_rest): (&[Point], &Shape), (frame, of_frame): (&[Point], &Shape)) -> [Point; 3] {
    let mut sum = [[0.0; 3]; 3];
    let scale = 1.0 / (of_rest.radius * of_frame.radius * rest.len() as f64);
    for (p, q) in rest.iter().zip(frame) {
        for (i, row) in sum.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().enumerate() {
                *cell += scale * (p[i] - of_rest.centre[i]) * (q[j] - of_frame.centre[j]);
            }
        }
    }
    sum
}

/// How well signed permutations of the axes map the rest pose to a frame; 1 is a perfect match. A
/// rotation about the up axis does not exchange axes.
struct AxisScores {
    /// Best score of permutations that do not exchange y and z, reflections included.
    without: f64,
    /// Best score of rotations that exchange them.
    with: f64,
    /// Best score of reflections that exchange them.
    mirrored: f64,
    /// Up axis of the best such rotation, where it is one of the two usual conversions.
    up: Option<Up>,
}

impl AxisScores {
    fn new(correlation: &[Point; 3]) -> Self {
        let none = f64::NEG_INFINITY;
        let mut best = Self { without: none, with: none, mirrored: none, up: None };
        for (order, is_reflection) in signed_permutations() {
            let fit = order.fit(correlation);
            let is_up = |from: usize, to: usize| order.axis[from] == to && !order.negative[from];
            if order.axis[1] != 2 && order.axis[2] != 1 {
                best.without = best.without.max(fit);
            } else if is_reflection {
                best.mirrored = best.mirrored.max(fit);
            } else if fit > best.with {
                best.with = fit;
                best.up = match (is_up(1, 2), is_up(2, 1)) {
                    (true, false) => Some(Up::Z),
                    (false, true) => Some(Up::Y),
                    _ => None,
                };
            }
        }
        best
    }

    /// That y and z are exchanged, if they clearly are.
    fn exchanged(&self) -> Option<Mismatch> {
        let best = self.with.max(self.mirrored);
        let mirror = 1.0 - self.mirrored < 0.5 * (1.0 - self.with);
        Self::clearly(best, self.without).then_some(Mismatch::Axes(self.up.filter(|_| !mirror)))
    }

    fn clearly_keeps_axes(&self) -> bool {
        Self::clearly(self.without, self.with.max(self.mirrored))
    }

    fn clearly(better: f64, worse: f64) -> bool {
        better > 0.8 && 1.0 - worse > 3.0 * (1.0 - better)
    }
}

/// Lower quartile, median and upper quartile; `None` for an empty set or infinite values.
fn quartiles(mut values: Vec<f64>) -> Option<[f64; 3]> {
    values.sort_by(f64::total_cmp);
    let found = [1, 2, 3].map(|k| values.get(k * values.len() / 4).copied().unwrap_or(f64::NAN));
    found.iter().all(|x| x.is_finite()).then_some(found)
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Order(ratio) => write!(
                f,
                "its points come in another order: edges of the rest pose are {ratio:.0} times longer in frame 0"
            ),
            Self::Units(ratio) => {
                let size = relative_size(ratio);
                write!(f, "frame 0 is {size} than the rest pose, and so are the others, as with other units")
            }
            Self::Axes(Some(up)) => {
                let (up, other) = (up.name(), up.other().name());
                write!(f, "its axes y and z look exchanged: {up} is up where {other} is in the rest pose")
            }
            Self::Axes(None) => f.write_str("its axes look exchanged"),
            Self::Mirrored(mirroring) => {
                write!(f, "its frames are mirrored ({} in all of them)", described(mirroring))
            }
        }
    }
}

/// `about 100 times larger`: a ratio, or that of two common units within 5 %.
fn relative_size(ratio: f64) -> String {
    const UNITS: [f64; 11] = [2.54, 3.28, 10.0, 12.0, 25.4, 30.48, 39.37, 100.0, 304.8, 1000.0, 1e6];
    let (times, how) = if ratio > 1.0 { (ratio, "larger") } else { (1.0 / ratio, "smaller") };
    match UNITS.into_iter().find(|unit| (times / unit - 1.0).abs() < 0.05) {
        Some(unit) => format!("about {unit} times {how}"),
        None => format!("{times:.1} times {how}"),
    }
}

/// What is mirrored, as far as that is known.
fn described(mirroring: Option<Mirroring>) -> String {
    mirroring.map_or("left is right".to_owned(), |found| found.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bent and uneven tube standing along y, as a mesh of quads.
    pub(super) fn tube() -> Model {
        let (rings, sides) = (40, 12);
        let mut model = Model::default();
        for ring in 0..rings {
            let y = f64::from(ring) / 10.0;
            for side in 0..sides {
                let angle = std::f64::consts::TAU * f64::from(side) / f64::from(sides);
                let radius = 0.4 + 0.1 * (3.0 * y).sin();
                model.points.push([0.1 * y * y + radius * angle.cos(), y, 0.6 * radius * angle.sin()]);
            }
        }
        for ring in 1..rings {
            for side in 0..sides {
                let (a, b) = (ring * sides + side, ring * sides + (side + 1) % sides);
                model.faces.push(&[a - sides, b - sides, b, a].map(|v| v as u32));
            }
        }
        model
    }

    fn frames(model: &Model, change: impl Fn(usize, Point) -> Point) -> Vec<Vec<f64>> {
        (0..3).map(|t| model.points.iter().flat_map(|&p| change(t, p)).collect()).collect()
    }

    fn found(change: impl Fn(usize, Point) -> Point) -> [Vec<Mismatch>; 2] {
        let mesh = tube();
        let cloud = Model { points: mesh.points.clone(), ..Model::default() };
        let frames = frames(&mesh, change);
        [mismatches(&mesh, &frames), mismatches(&cloud, &frames)]
    }

    #[test]
    fn motion_however_strong_is_no_mistake() {
        let none = [Vec::new(), Vec::new()];
        assert_eq!(found(|_, p| p), none);
        assert_eq!(found(|_, p| p.map(|x| x + 1e6)), none, "far away");
        assert_eq!(found(|t, [x, y, z]| [x + (t as f64 * y).sin(), y, z]), none, "bent");
        assert_eq!(found(|_, [x, y, z]| [3.0 * x, 0.2 * y, 3.0 * z]), none, "squashed");
        assert_eq!(found(|t, p| p.map(|x| x * f64::from(1 + 4 * t as u32))), none, "growing");
        assert_eq!(found(|_, [x, y, z]| [z, y, -x]), none, "facing another way");
        assert_eq!(found(|t, p| if t == 1 { [0.0; 3] } else { p }), none, "a frame in one place");
        let first = |t: usize, [x, y, z]: Point| if t == 0 { [x, -z, y] } else { [x, y, z] };
        assert_eq!(found(first), none, "lying in one frame");
        let noise = |_, p: Point| {
            let mut random = fastrand::Rng::with_seed(p[0].to_bits() ^ p[1].to_bits() ^ p[2].to_bits());
            p.map(|x| x + 0.8 * (random.f64() - 0.5))
        };
        assert!(!found(noise).concat().iter().any(|m| matches!(m, Mismatch::Mirrored(_))), "noise");
        let halves = |_, [x, y, z]: Point| if y < 2.0 { [x, y, z] } else { [-x, y, z] };
        assert_eq!(found(halves), none, "one half mirrored");
        let pressed = |_, [x, y, z]: Point| [x, y, -0.01 * z];
        assert_eq!(found(pressed), none, "pressed flat");
    }

    #[test]
    fn mirrored_frames_are_recognised_however_they_move_and_of_flat_models_nothing_is() {
        let changes: [fn(Point) -> Point; 4] =
            [|[x, y, z]| [-x, y, z], |[x, y, z]| [x, -y, z], |[x, y, z]| [z, y, x], |[x, y, z]| [x, z, y]];
        for change in changes {
            for found in
                found(|t, [x, y, z]| change([x + 0.3 * (t as f64 + y).sin(), y, z + 0.1 * (2.0 * t as f64).cos()]))
            {
                assert!(matches!(found[..], [Mismatch::Mirrored(Some(_))]), "{found:?}");
            }
            let turned = |t: usize, p: Point| {
                let ([x, y, z], (sin, cos)) = (change(p), (0.7 + t as f64).sin_cos());
                [100.0 * (cos * x - sin * y), 100.0 * (sin * x + cos * y), 100.0 * z]
            };
            for found in found(turned) {
                assert!(matches!(found[..], [Mismatch::Units(_), Mismatch::Mirrored(_)]), "{found:?}");
            }
            let mut flat = tube();
            flat.points.iter_mut().for_each(|p| p[2] = 1e-3 * p[0].sin());
            assert!(
                !mismatches(&flat, &frames(&flat, |_, [x, y, z]| [-x, y, z]))
                    .iter()
                    .any(|m| matches!(m, Mismatch::Mirrored(_)))
            );
        }
    }

    #[test]
    fn tiny_parts_and_too_few_points_are_no_mistake() {
        let one = Model { points: vec![[1.0, 2.0, 3.0]], ..Model::default() };
        assert!(mismatches(&one, &[vec![4.0, 5.0, 6.0]]).is_empty());
        assert!(mismatches(&Model::default(), &[Vec::new()]).is_empty());
        assert!(mismatches(&tube(), &[]).is_empty());
        assert!(mismatches(&tube(), &frames(&tube(), |_, p| p.map(|x| x * 1e200))).len() <= 1);
    }

    #[test]
    fn units_axes_and_orders_are_recognised_with_and_without_edges() {
        for factor in [100.0, 2.54, 0.01, 1.0 / 39.37] {
            for found in found(|t, [x, y, z]| [x + 0.1 * (t as f64 * y).sin(), y, z].map(|x| factor * x)) {
                assert!(
                    matches!(found[..], [Mismatch::Units(f)] if (f / factor - 1.0).abs() < 0.05),
                    "{factor}: {found:?}"
                );
            }
        }
        assert_eq!(found(|_, [x, y, z]| [x, -z, y]), [[Mismatch::Axes(Some(Up::Z))], [Mismatch::Axes(Some(Up::Z))]]);
        assert_eq!(found(|_, [x, y, z]| [x, z, -y]), [[Mismatch::Axes(Some(Up::Y))], [Mismatch::Axes(Some(Up::Y))]]);
        let mesh = tube();
        let n = mesh.points.len();
        let shuffled: Vec<f64> = (0..n).flat_map(|i| mesh.points[(i * 7919 + 13) % n]).collect();
        assert!(matches!(mismatches(&mesh, &[shuffled])[..], [Mismatch::Order(ratio)] if ratio > 3.0));
    }

    #[test]
    fn what_was_found_is_told_with_its_size() {
        assert_eq!(
            Mismatch::Units(0.0254).to_string(),
            "frame 0 is about 39.37 times smaller than the rest pose, and so are the others, as with other units"
        );
        assert!(Mismatch::Order(40.2).to_string().contains("edges of the rest pose are 40 times longer in frame 0"));
    }
}
