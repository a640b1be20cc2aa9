//! Whether a frame is mirrored: whether the best affine maps of the rest pose's regions onto it
//! have a negative determinant. Regions of a moving model, large or small, stay nearly rigid; those
//! that do not tell nothing, and neither do flat ones and sheets, whose waves are mirrored as they
//! pass.

use cager_geometry::linalg::symmetric_eigen;
use cager_geometry::mesh::Point;
use cager_geometry::vector::{cross, dot, mean, sub};
use std::fmt;
use std::ops::Range;

/// Points looked at, smallest regions at the most, and points looked at in a region.
const POINTS: usize = 4096;
const REGIONS: usize = 32;
const REGION_POINTS: usize = 256;
/// The fewest points of a region.
const LEAST_POINTS: usize = 8;
/// A region is flat whose thickness is less than this share of its length.
const FLAT: f64 = 0.03;
/// A region has two sides where this share of its points lie behind one another: so many times as
/// far apart along its thickness as across.
const TWO_SIDED: f64 = 0.35;
const BEHIND: f64 = 2.0;
/// It moves nearly rigidly where the map's residual is below this share of its thickness, and no
/// direction is scaled by more beside the others.
const RESIDUAL: f64 = 0.3;
const STRETCH: f64 = 3.0;
/// Shares of the regions that must agree, and of the smallest that must tell.
const AGREEING: f64 = 0.9;
const TELLING: f64 = 0.1;
/// A permutation of the axes is told where it is this near to the maps; 1 is equal.
const LIKE: f64 = 0.8;

/// What helps against any mirroring.
pub const SAME_AXES: &str = "export both with the same axes, right-handed or left-handed";

/// A signed permutation of the axes that exchanges left and right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mirroring {
    /// The axis of the rest pose that each axis of the frame is.
    pub(super) axis: [usize; 3],
    /// Whether it is negative.
    pub(super) negative: [bool; 3],
}

/// The regions of a rest pose: the whole, its halves, theirs, and so on.
#[derive(Debug)]
pub(super) struct Regions {
    solid: Vec<Region>,
    /// How many of the smallest there are, solid or not.
    smallest: usize,
}

#[derive(Debug)]
struct Region {
    points: Vec<u32>,
    /// From their centre, in the rest pose.
    arms: Vec<Point>,
    /// Inverse of their second moments `Σ p pᵀ`.
    inverse: [Point; 3],
    /// Distance of its sides, in the middle.
    thickness: f64,
    /// The smallest regions that are part of it.
    parts: Range<usize>,
}

/// How a frame relates to the rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hand {
    pub(super) is_mirrored: bool,
    /// Mean of the maps of its regions, each scaled to one.
    map: [Point; 3],
}

impl Regions {
    pub(super) fn new(rest: &[Point]) -> Self {
        let stride = rest.len().div_ceil(POINTS).max(1);
        let all: Vec<u32> = (0..rest.len() as u32).step_by(stride).collect();
        let mut regions = Self { solid: Vec::new(), smallest: 0 };
        regions.cut((all.len() / REGIONS).max(4 * LEAST_POINTS), all, rest);
        regions
    }

    /// Adds a region and its parts, cut across the longest extent, down to `most` points.
    fn cut(&mut self, most: usize, mut points: Vec<u32>, rest: &[Point]) {
        let first = self.smallest;
        let some = points.iter().step_by(points.len().div_ceil(REGION_POINTS).max(1)).copied().collect();
        if points.len() <= most {
            self.smallest += 1;
        } else {
            let at = |v: u32| rest[v as usize];
            let reach = |k: usize| {
                let (low, high) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| {
                    (low.min(at(v)[k]), high.max(at(v)[k]))
                });
                high - low
            };
            let longest = (0..3).max_by(|&i, &j| reach(i).total_cmp(&reach(j))).unwrap_or(0);
            let half = points.len() / 2;
            points.select_nth_unstable_by(half, |&v, &w| at(v)[longest].total_cmp(&at(w)[longest]).then(v.cmp(&w)));
            let mut other = points.split_off(half);
            points.sort_unstable();
            other.sort_unstable();
            self.cut(most, points, rest);
            self.cut(most, other, rest);
        }
        self.solid.extend(Region::new(some, rest, first..self.smallest));
    }

    /// Whether a frame is mirrored; `None` where it does not tell.
    pub(super) fn hand(&self, frame: &[Point]) -> Option<Hand> {
        let mut is_covered = vec![false; self.smallest];
        let mut maps: Vec<([Point; 3], bool)> = Vec::new();
        for region in &self.solid {
            if let Some(map) = region.map_to(frame) {
                is_covered[region.parts.clone()].fill(true);
                maps.push(map);
            }
        }
        let mirrored = maps.iter().filter(|(_, is_mirrored)| *is_mirrored).count();
        let is_mirrored = 2 * mirrored > maps.len();
        let agreeing = if is_mirrored { mirrored } else { maps.len() - mirrored };
        let covered = is_covered.iter().filter(|covered| **covered).count();
        let tells = covered as f64 >= TELLING * self.smallest as f64 && agreeing as f64 >= AGREEING * maps.len() as f64;
        let mut map = [[0.0; 3]; 3];
        for (one, _) in maps.iter().filter(|map| map.1 == is_mirrored) {
            for (sum, row) in map.iter_mut().zip(one) {
                (0..3).for_each(|k| sum[k] += row[k] / agreeing as f64);
            }
        }
        (tells && !maps.is_empty()).then_some(Hand { is_mirrored, map })
    }
}

impl Region {
    /// `None` of a flat one, and of one with too few points.
    fn new(points: Vec<u32>, rest: &[Point], parts: Range<usize>) -> Option<Self> {
        let at: Vec<Point> = points.iter().map(|&v| rest[v as usize]).collect();
        let centre = mean(&at);
        let arms: Vec<Point> = at.iter().map(|&p| sub(p, centre)).collect();
        let moments = products(&arms, &arms);
        let (values, axes) = symmetric_eigen(moments);
        let [longest, _, thinnest] = values.map(|x| x.max(0.0).sqrt());
        if points.len() < LEAST_POINTS || !(thinnest > FLAT * longest && longest.is_finite()) {
            return None;
        }
        let thickness = thickness(&arms, &axes)?;
        let inverse = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).map(|k| axes[k][i] * axes[k][j] / values[k]).sum::<f64>())
        });
        Some(Self { points, arms, inverse, thickness, parts })
    }

    /// The best affine map onto a frame, scaled to one, and whether it mirrors; `None` where it is
    /// not nearly rigid.
    fn map_to(&self, frame: &[Point]) -> Option<([Point; 3], bool)> {
        let at: Vec<Point> = self.points.iter().map(|&v| frame[v as usize]).collect();
        let centre = mean(&at);
        let arms: Vec<Point> = at.iter().map(|&p| sub(p, centre)).collect();
        let mixed = products(&arms, &self.arms);
        // The inverse is symmetric.
        let map: [Point; 3] = mixed.map(|row| std::array::from_fn(|j| dot(row, self.inverse[j])));
        let left: f64 = arms
            .iter()
            .zip(&self.arms)
            .map(|(&to, &from)| {
                let d = sub(to, map.map(|row| dot(row, from)));
                dot(d, d)
            })
            .sum();
        let columns: [Point; 3] = std::array::from_fn(|j| map.map(|row| row[j]));
        let determinant = dot(cross(columns[0], columns[1]), columns[2]);
        let scale = determinant.abs().cbrt();
        let (squares, _) = symmetric_eigen(products(&map, &map));
        let [most, _, least] = squares.map(|x| x.max(0.0).sqrt());
        let is_even = most < STRETCH * scale && scale < STRETCH * least;
        let residual = (left / arms.len() as f64).sqrt();
        let is_rigid = is_even && residual < RESIDUAL * scale * self.thickness;
        is_rigid.then(|| (map.map(|row| row.map(|x| x / scale)), determinant < 0.0))
    }
}

/// Median distance of points that lie behind one another along the last axis; `None` where few do.
fn thickness(arms: &[Point], axes: &[Point; 3]) -> Option<f64> {
    let at: Vec<Point> = arms.iter().map(|&p| axes.map(|axis| dot(axis, p))).collect();
    let across = |p: Point, q: Point| (p[0] - q[0]).hypot(p[1] - q[1]);
    let mut behind: Vec<f64> = Vec::new();
    for (i, &p) in at.iter().enumerate() {
        let others = at.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, &q)| q);
        let nearest = others.min_by(|&q, &r| across(p, q).total_cmp(&across(p, r)))?;
        let apart = (nearest[2] - p[2]).abs();
        if apart > BEHIND * across(p, nearest) {
            behind.push(apart);
        }
    }
    behind.sort_by(f64::total_cmp);
    (behind.len() as f64 >= TWO_SIDED * at.len() as f64).then(|| behind[behind.len() / 2])
}

/// `Σ a bᵀ`.
fn products(a: &[Point], b: &[Point]) -> [Point; 3] {
    let mut sum = [[0.0; 3]; 3];
    for (a, b) in a.iter().zip(b) {
        for (row, x) in sum.iter_mut().zip(a) {
            (0..3).for_each(|k| row[k] += x * b[k]);
        }
    }
    sum
}

impl Hand {
    /// The exchange of axes that the frame looks like, where it looks like one.
    pub(super) fn mirroring(&self) -> Option<Mirroring> {
        let reflections = signed_permutations().filter(|(_, is_reflection)| *is_reflection);
        let fits = reflections.map(|(mirroring, _)| (mirroring.fit(&self.map) / 3.0, mirroring));
        fits.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(fit, _)| *fit > LIKE).map(|(_, mirroring)| mirroring)
    }
}

/// The ways to exchange and negate axes, and whether each is a reflection.
pub(super) fn signed_permutations() -> impl Iterator<Item = (Mirroring, bool)> {
    const ORDERS: [([usize; 3], bool); 6] = [
        ([0, 1, 2], false),
        ([0, 2, 1], true),
        ([1, 0, 2], true),
        ([1, 2, 0], false),
        ([2, 0, 1], false),
        ([2, 1, 0], true),
    ];
    ORDERS.into_iter().flat_map(|(axis, is_odd)| {
        (0..8_u32).map(move |signs| {
            let negative = [0, 1, 2].map(|k| signs >> k & 1 == 1);
            (Mirroring { axis, negative }, is_odd != (signs.count_ones() % 2 == 1))
        })
    })
}

impl Mirroring {
    /// How well a map has these axes: the sum of its entries there, with these signs.
    pub(super) fn fit(&self, map: &[Point; 3]) -> f64 {
        (0..3).map(|k| map[k][self.axis[k]] * if self.negative[k] { -1.0 } else { 1.0 }).sum()
    }

    /// What makes up for it.
    pub fn advice(&self) -> String {
        const NAMES: [char; 3] = ['x', 'y', 'z'];
        let changed: Vec<usize> = (0..3).filter(|&k| self.axis[k] != k).collect();
        let negative: Vec<String> = (0..3).filter(|&k| self.negative[k]).map(|k| NAMES[k].to_string()).collect();
        match (&changed[..], negative.is_empty()) {
            ([], _) => format!("negate {} in one of them", joined(&negative)),
            ([a, b], true) => format!("exchange {} and {} in one of them", NAMES[*a], NAMES[*b]),
            _ => SAME_AXES.to_owned(),
        }
    }
}

impl fmt::Display for Mirroring {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const NAMES: [char; 3] = ['x', 'y', 'z'];
        // By axes of the rest pose.
        let (mut from, mut to) = (Vec::new(), Vec::new());
        for axis in 0..3 {
            let k = (0..3).find(|&k| self.axis[k] == axis).unwrap_or(axis);
            if k != axis || self.negative[k] {
                from.push(NAMES[axis].to_string());
                to.push(format!("{}{}", if self.negative[k] { "-" } else { "" }, NAMES[k]));
            }
        }
        let are = if from.len() == 1 { "is" } else { "are" };
        write!(f, "{} of the rest pose {are} {}", joined(&from), joined(&to))
    }
}

fn joined(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [word] => word.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::tube;
    use super::*;

    #[test]
    fn waves_of_sheets_and_slabs_are_not_mirrored() {
        for (side, frequency, height, thickness) in [
            (20, 0.5, 1.0, 0.0),
            (40, 0.3, 2.0, 0.0),
            (30, 0.6, 3.0, 0.0),
            (20, 0.5, 1.0, 0.5),
            (20, 1.0, 1.0, 1.5),
            (100, 0.1, 10.0, 0.1),
        ] {
            let wave = |phase: f64| -> Vec<Point> {
                let grid = (0..side * side).map(|k| [f64::from(k % side), f64::from(k / side)]);
                let sheet = grid
                    .map(|[x, y]| [x, y, height * (frequency * x + phase).sin() * (0.7 * frequency * y + 0.3).cos()]);
                let sheet: Vec<Point> = sheet.collect();
                let other = sheet.iter().map(|&[x, y, z]| [x, y, z - thickness]).filter(|_| thickness > 0.0);
                sheet.iter().copied().chain(other).collect()
            };
            let regions = Regions::new(&wave(0.3));
            for step in 0..20 {
                let hand = regions.hand(&wave(0.3 + f64::from(step) * std::f64::consts::PI / 10.0));
                assert!(!hand.is_some_and(|hand| hand.is_mirrored), "{side} {frequency} {height} {thickness}: {step}");
            }
        }
    }

    #[test]
    fn exchanges_of_axes_are_named_by_the_axes_of_the_rest_pose() {
        let rest = tube().points;
        let regions = Regions::new(&rest);
        let told = |change: fn(Point) -> Point| {
            let frame: Vec<Point> = rest.iter().map(|&p| change(p)).collect();
            let hand = regions.hand(&frame).expect("a verdict");
            assert!(hand.is_mirrored);
            hand.mirroring().map(|found| (found.to_string(), found.advice()))
        };
        let told = |change| told(change).expect("an exchange");
        assert_eq!(told(|[x, y, z]| [-x, y, z]).0, "x of the rest pose is -x");
        assert_eq!(told(|[x, y, z]| [x, y, -3.0 * z].map(|x| 7.0 + x)).1, "negate z in one of them");
        assert_eq!(told(|[x, y, z]| [-x, -y, -z]).1, "negate x, y and z in one of them");
        let (what, advice) = told(|[x, y, z]| [z, y, x]);
        assert_eq!(what, "x and z of the rest pose are z and x");
        assert_eq!(advice, "exchange x and z in one of them");
        assert_eq!(told(|[x, y, z]| [x, z, y]).0, "y and z of the rest pose are z and y");
        let (what, advice) = told(|[x, y, z]| [y, z, -x]);
        assert_eq!(what, "x, y and z of the rest pose are -z, x and y");
        assert_eq!(advice, SAME_AXES);
    }
}
