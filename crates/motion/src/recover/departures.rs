//! Parts of a template that leave the surface, of surfaces that no template explains, and of a
//! template that are stretched as by no motion: told by what usual frames have, since noise and fit
//! differ.

use super::distances::Looked;
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::vector::distance;
use cager_shape::registration::{NearestPoints, SurfacePoint};
use serde::Serialize;

/// A part that is not where it should be. Lengths are shares of the template's diagonal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Departure {
    /// `off_surface`: points of the template far from the surface. `unexplained`: a part of the
    /// surface far from the template. `stretched`: points whose surroundings are longer than at
    /// rest.
    pub what: &'static str,
    /// The number of the first frame, of the last one, and of the worst.
    pub from: f64,
    /// See `from`.
    pub to: f64,
    /// See `from`.
    pub worst: f64,
    /// How many frames in between.
    pub frames: usize,
    /// Points of the template in the worst frame; of an unexplained part those nearest to it.
    pub points: usize,
    /// The point of the template that is there, or nearest.
    pub vertex: usize,
    /// Where it is in the worst frame, in the frames' unit; of an unexplained part on the surface.
    pub position: Point,
    /// The largest distance in it; of a stretched part how many times as long it is as at rest.
    pub largest: f64,
}

/// The three ways to be apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    OffSurface,
    Unexplained,
    Stretched,
}

const WAYS: [Way; 3] = [Way::OffSurface, Way::Unexplained, Way::Stretched];

/// What is apart, at the least: a share of the diagonal, and how many times its length.
const LEAST: [f64; 3] = [0.01, 0.012, 2.5];
/// So many times what 95 of 100 points have on the usual frame.
const TIMES: [f64; 3] = [5.0, 5.0, 1.6];
/// What is noted on the way, as a share of what is apart at the least.
const NOTED: f64 = 0.6;
/// Samples of a part, at the least.
const FEWEST: usize = 4;
/// Samples this many times as far from each other as usual neighbours are one part.
const JOINED: f64 = 2.5;
/// Frames that a part may be near again for, and still be the same.
const PAUSE: usize = 2;
/// A part of a single frame is told where it is so many times as far as is far.
const ALONE: f64 = 2.0;
/// Parts that are told, at the most: those that are farthest.
const MOST: usize = 20;

/// A place that may be apart in a frame.
#[derive(Clone, Copy)]
struct Noted {
    /// The sample that it is, or is nearest to.
    sample: u16,
    amount: f32,
    place: [f32; 3],
}

/// A frame: what may be apart in it, and what 95 of 100 points have.
struct Frame {
    noted: [Vec<Noted>; 3],
    usual: [Option<f64>; 3],
}

/// Looks at frames as they are finished, in any order.
pub(super) struct Departures {
    samples: Vec<Sample>,
    /// Where they are at rest.
    rest: Vec<Point>,
    /// The sample nearest to each vertex at rest.
    sample_of: Vec<u16>,
    /// How near to each other samples of a part are at rest.
    reach: f64,
    frames: Vec<(usize, Frame)>,
}

/// A sample: the corners of its triangle, the nearest first, and the inverse of its edges in its
/// plane.
struct Sample {
    corners: [u32; 3],
    inverse: Option<[[f64; 2]; 2]>,
}

impl Departures {
    /// For samples of a template at rest.
    pub(super) fn new(rest: &TriMesh, samples: &[SurfacePoint]) -> Self {
        let places: Vec<Point> = samples.iter().map(|sample| sample.at(&rest.vertices, &rest.triangles)).collect();
        let of = |sample: &SurfacePoint| {
            let mut corners = rest.triangles[sample.face as usize];
            let at = corners.map(|v| rest.vertices[v as usize]);
            let heaviest = (0..3).max_by(|&a, &b| sample.weights[a].total_cmp(&sample.weights[b])).unwrap_or(0);
            corners.rotate_left(heaviest);
            let at = [0, 1, 2].map(|k| at[(k + heaviest) % 3]);
            Sample { corners, inverse: inverse_edges(at) }
        };
        let (mut reach, mut sample_of) = (0.0, vec![0; rest.vertices.len()]);
        if places.len() > 1 {
            let tree = NearestPoints::new(places.iter().copied());
            let mut spacing: Vec<f64> =
                places.iter().map(|&p| tree.several(2, p).last().map_or(0.0, |&k| distance(places[k], p))).collect();
            spacing.sort_by(f64::total_cmp);
            // Neighbours of random points are half as far as those of a grid.
            reach = JOINED * 2.0 * spacing[spacing.len() / 2];
            sample_of = rest.vertices.iter().map(|&p| tree.nearest(p).0 as u16).collect();
        }
        Self { samples: samples.iter().map(of).collect(), rest: places, sample_of, reach, frames: Vec::new() }
    }

    /// Looks at a frame: where the template is in it, and how far what is from what, in diagonals.
    pub(super) fn look(&mut self, frame: usize, template: &TriMesh, points: &[Point], looked: &Looked, diagonal: f64) {
        let mut noted = [const { Vec::new() }; 3];
        let mut usual = [None; 3];
        let floor = |way: Way| NOTED * LEAST[way as usize];
        let single = |p: Point| p.map(|x| x as f32);
        let mut note = |way: Way, found: &mut dyn Iterator<Item = (usize, f64, Point)>| {
            let mut all = Vec::new();
            for (sample, amount, place) in found {
                all.push(amount);
                if amount > floor(way) {
                    let (sample, amount) = (sample as u16, amount as f32);
                    noted[way as usize].push(Noted { sample, amount, place: single(place) });
                }
            }
            all.sort_by(f64::total_cmp);
            usual[way as usize] = all.get(all.len() * 95 / 100).copied();
        };
        note(Way::OffSurface, &mut looked.beside().map(|(k, d)| (k, d / diagonal, points[k])));
        let back = looked.back.iter().map(|&(place, d, vertex)| {
            let sample = self.sample_of[vertex as usize];
            (usize::from(sample), d / diagonal, place)
        });
        note(Way::Unexplained, &mut back.into_iter());
        let stretched = self.samples.iter().enumerate().filter_map(|(k, sample)| {
            let stretch = stretch(sample.inverse?, sample.corners.map(|v| template.vertices[v as usize]));
            Some((k, stretch, points[k]))
        });
        note(Way::Stretched, &mut stretched.into_iter());
        self.frames.push((frame, Frame { noted, usual }));
    }

    /// What was apart, the farthest first; of frames from which the origin was subtracted.
    pub(super) fn found(mut self, numbers: &[f64], origin: Option<Point>) -> Vec<Departure> {
        self.frames.sort_by_key(|(frame, _)| *frame);
        let mut found: Vec<(f64, Departure)> = Vec::new();
        for way in WAYS {
            let mut usual: Vec<f64> = self.frames.iter().filter_map(|(_, frame)| frame.usual[way as usize]).collect();
            usual.sort_by(f64::total_cmp);
            let Some(usual) = usual.get(usual.len() / 2) else { continue };
            let far = LEAST[way as usize].max(TIMES[way as usize] * usual);
            for run in self.runs(way, far) {
                let departure = run.told(way, &self, numbers, origin);
                if departure.frames > 1 || self.frames.len() == 1 || departure.largest > ALONE * far {
                    found.push((departure.largest / far, departure));
                }
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found.into_iter().take(MOST).map(|(_, departure)| departure).collect()
    }

    /// Parts that are farther than this, from frame to frame.
    fn runs(&self, way: Way, far: f64) -> Vec<Run> {
        let (mut open, mut closed): (Vec<Run>, Vec<Run>) = (Vec::new(), Vec::new());
        for (at, (_, frame)) in self.frames.iter().enumerate() {
            let (ended, going): (Vec<Run>, Vec<Run>) = open.into_iter().partition(|run| run.last + PAUSE + 1 < at);
            closed.extend(ended);
            open = going;
            let noted: Vec<Noted> =
                frame.noted[way as usize].iter().filter(|noted| f64::from(noted.amount) > far).copied().collect();
            for part in self.parts(&noted) {
                let (same, others): (Vec<Run>, Vec<Run>) = open.into_iter().partition(|run| self.meet(run, &part));
                open = others;
                open.push(Run::joined(same, at, part));
            }
        }
        closed.extend(open);
        closed
    }

    /// Connected parts of what is noted, by samples at rest, but those of a few samples.
    fn parts(&self, noted: &[Noted]) -> Vec<Vec<Noted>> {
        let mut left: Vec<Noted> = noted.to_vec();
        let mut parts = Vec::new();
        while let Some(first) = left.pop() {
            let mut part = vec![first];
            let mut at = 0;
            while at < part.len() {
                let here = self.rest[usize::from(part[at].sample)];
                let is_near = |other: &Noted| distance(self.rest[usize::from(other.sample)], here) <= self.reach;
                let (near, far): (Vec<Noted>, Vec<Noted>) = left.into_iter().partition(is_near);
                part.extend(near);
                left = far;
                at += 1;
            }
            if part.len() >= FEWEST {
                parts.push(part);
            }
        }
        parts
    }

    /// Whether a part of the next frame is that of a run.
    fn meet(&self, run: &Run, part: &[Noted]) -> bool {
        let near = |a: u16, b: u16| distance(self.rest[usize::from(a)], self.rest[usize::from(b)]) <= self.reach;
        part.iter().any(|noted| run.samples.iter().any(|&sample| near(sample, noted.sample)))
    }
}

/// A part over frames that follow each other.
struct Run {
    first: usize,
    last: usize,
    frames: usize,
    /// Those of the last frame.
    samples: Vec<u16>,
    /// The worst frame, and what is apart in it.
    worst: usize,
    most: f32,
    part: Vec<Noted>,
}

impl Run {
    /// A part of a frame, with the runs that it goes on.
    fn joined(same: Vec<Self>, at: usize, part: Vec<Noted>) -> Self {
        let most = part.iter().map(|noted| noted.amount).fold(0.0, f32::max);
        let samples = part.iter().map(|noted| noted.sample).collect();
        let mut all = Self { first: at, last: at, frames: 1, samples, worst: at, most, part };
        for run in same {
            all.first = all.first.min(run.first);
            // Parts of one frame may be one in the next.
            all.frames = all.frames.max(run.frames + usize::from(run.last < at));
            if run.last == at {
                all.samples.extend(&run.samples);
            }
            if run.most > all.most {
                (all.worst, all.most, all.part) = (run.worst, run.most, run.part);
            }
        }
        all
    }

    fn told(self, way: Way, departures: &Departures, numbers: &[f64], origin: Option<Point>) -> Departure {
        let number = |at: usize| numbers[departures.frames[at].0];
        let mut samples: Vec<u16> = self.part.iter().map(|noted| noted.sample).collect();
        samples.sort_unstable();
        let peak = self.part.iter().max_by(|a, b| a.amount.total_cmp(&b.amount));
        let (sample, place) = peak.map_or((0, [0.0; 3]), |peak| (peak.sample, peak.place));
        let origin = origin.unwrap_or_default();
        Departure {
            what: ["off_surface", "unexplained", "stretched"][way as usize],
            from: number(self.first),
            to: number(self.last),
            worst: number(self.worst),
            frames: self.frames,
            points: departures.sample_of.iter().filter(|sample| samples.binary_search(sample).is_ok()).count(),
            vertex: departures.samples[usize::from(sample)].corners[0] as usize,
            position: std::array::from_fn(|k| f64::from(place[k]) + origin[k]),
            largest: f64::from(self.most),
        }
    }
}

/// Parts that are told one by one; the report has more.
const TOLD: usize = 3;

/// What is said of parts that are apart.
pub(super) fn told(departures: &[Departure]) -> Vec<String> {
    let mut said: Vec<String> = departures.iter().take(TOLD).map(Departure::sentence).collect();
    if departures.len() > TOLD {
        let more = departures.len() - TOLD;
        said.push(format!(
            "{more} more parts leave the surface or are stretched; the report (--report) has all, by frame and place"
        ));
    }
    said
}

impl Departure {
    fn sentence(&self) -> String {
        let Self { from, to, worst, points, vertex, position, largest, .. } = self;
        let [x, y, z] = position.map(significant);
        let (when, at) = if from == to {
            (format!("in frame {from}"), format!("at {x} {y} {z}"))
        } else {
            (format!("from frame {from} to {to}"), format!("frame {worst}, at {x} {y} {z}"))
        };
        let percent = 100.0 * largest;
        match self.what {
            "off_surface" => format!(
                "{when}, {points} points of the template around point {vertex} are up to {percent:.1} % of the diagonal away from the surface ({at}): part of it may be lost"
            ),
            "unexplained" => format!(
                "{when}, the template lies nowhere near part of the surface, by up to {percent:.1} % of the diagonal ({at}; nearest are {points} points around point {vertex}): what is there is lost"
            ),
            _ => format!(
                "{when}, {points} points of the template around point {vertex} are stretched up to {largest:.1} times ({at}): the surface may have changed there"
            ),
        }
    }
}

/// With four digits that count.
fn significant(x: f64) -> String {
    let digits = if x == 0.0 { 0 } else { (3 - x.abs().log10().floor() as i32).clamp(0, 12) };
    format!("{x:.*}", digits as usize)
}

/// The inverse of a triangle's edges in its plane; none of one without an area.
fn inverse_edges([a, b, c]: [Point; 3]) -> Option<[[f64; 2]; 2]> {
    use cager_geometry::vector::{dot, norm, sub};
    let (u, v) = (sub(b, a), sub(c, a));
    let length = norm(u);
    let along = dot(u, v) / length;
    let height = (dot(v, v) - along * along).max(0.0).sqrt();
    // Of slivers, it is noise.
    (height > 0.1 * length.max(along.abs())).then(|| [[1.0 / length, -along / (length * height)], [0.0, 1.0 / height]])
}

/// How many times as long as at rest a triangle is where it is longest.
fn stretch(inverse: [[f64; 2]; 2], [a, b, c]: [Point; 3]) -> f64 {
    use cager_geometry::vector::{dot, sub};
    let (u, v) = (sub(b, a), sub(c, a));
    let column = |k: usize| -> Point { std::array::from_fn(|i| inverse[0][k] * u[i] + inverse[1][k] * v[i]) };
    let (x, y) = (column(0), column(1));
    let (xx, xy, yy) = (dot(x, x), dot(x, y), dot(y, y));
    (0.5 * (xx + yy) + (0.25 * (xx - yy).powi(2) + xy * xy).sqrt()).sqrt()
}
