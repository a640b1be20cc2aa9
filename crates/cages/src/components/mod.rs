//! Cages of several components, each of which carries some parts of a model.

mod motion;

use crate::design::{MEASURED, check, design};
use crate::enclose::{EncloseError, EncloseOptions, enclose, extent};
use crate::{Design, DesignError, DesignOptions, Goal, Progress, Rates, Stage, Unseen};
use cager_core::cage::{Cage, CageError, Carrier};
use cager_geometry::mesh::{Model, Point, Polygons, TriMesh, bounds, diagonal};
use cager_geometry::vector::norm;
use std::ops::{ControlFlow, Range};

/// Vertices of a component at least, where its points determine so many: a box.
const LEAST: usize = 8;

/// Which parts of a model share a component of its cage.
#[derive(Clone, Debug)]
pub struct Components {
    groups: Vec<Group>,
    points: usize,
    diagonal: f64,
}

/// The parts of one component as a model of their own.
#[derive(Clone, Debug)]
struct Group {
    /// Its points among those of the model, ascending.
    points: Vec<Range<usize>>,
    rest: Model,
    /// Square root of the sum of squared distances to the affine images of the rest pose that are
    /// nearest to the frames, which a cage of four vertices gives: what more vertices are for.
    motion: f64,
}

impl Components {
    /// A component for each part; `parts` are their points in order, all points of the model.
    pub fn of_each(rest: &Model, frames: &[Vec<f64>], parts: &[Range<usize>]) -> Self {
        let parts = parts.iter().filter(|part| !part.is_empty());
        Self::of_groups(rest, frames, parts.map(|part| vec![part.clone()]).collect())
    }

    fn of_groups(rest: &Model, frames: &[Vec<f64>], groups: Vec<Vec<Range<usize>>>) -> Self {
        let (frames, groups) = (motion::some(frames), with_extent(&rest.points, groups));
        let group = |points: Vec<Range<usize>>| {
            let rest = submodel(rest, &points);
            let motion = motion::beyond_affine(&rest, &subframes(&frames, &points));
            Group { points, rest, motion }
        };
        let groups = groups.into_iter().map(group).collect();
        Self { groups, points: rest.points.len(), diagonal: diagonal(&rest.points) }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.groups.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Vertices of each component of a cage with so many: more for what moves more like no affine
    /// image of its rest pose.
    fn shares(&self, vertices: usize) -> Result<Vec<usize>, EncloseError> {
        let most = |group: &Group| (group.rest.points.len() / 2).max(4);
        let mut shares: Vec<usize> = self.groups.iter().map(|group| most(group).min(LEAST)).collect();
        let least = shares.iter().sum();
        let mut left = vertices.checked_sub(least).ok_or(EncloseError::TooFewVertices { vertices, least })?;
        // What a component cannot use goes to the others.
        loop {
            let open: Vec<usize> =
                (0..self.len()).filter(|&k| shares[k] < most(&self.groups[k]) && self.groups[k].motion > 0.0).collect();
            let total: f64 = open.iter().map(|&k| self.groups[k].motion).sum();
            let mut given = 0;
            for &k in &open {
                let share = (left as f64 * self.groups[k].motion / total) as usize;
                let share = share.min(most(&self.groups[k]) - shares[k]);
                shares[k] += share;
                given += share;
            }
            left -= given;
            if given == 0 {
                return Ok(shares);
            }
        }
    }

    /// Fewest vertices of a cage with these components.
    pub fn least_vertices(&self) -> usize {
        self.groups.iter().map(|group| (group.rest.points.len() / 2).clamp(4, LEAST)).sum()
    }

    /// [`Rates`] of cages with these components.
    ///
    /// # Errors
    /// Parts that no small cages enclose.
    pub fn rates(&self, frames: &[Vec<f64>], total: usize) -> Result<Rates, EncloseError> {
        let shares = self.shares(MEASURED.max(self.least_vertices()))?;
        let frames: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
        let part = |(group, vertices): (&Group, usize)| {
            let size = diagonal(&group.rest.points) / self.diagonal;
            (group.rest.clone(), subframes(&frames, &group.points), (vertices, size))
        };
        Rates::of_parts(self.groups.iter().zip(shares).map(part), total)
    }

    /// Cages of so many vertices at the most around each group at rest.
    fn around_each(&self, vertices: usize) -> Result<Vec<TriMesh>, EncloseError> {
        let around = |(group, vertices): (&Group, usize)| {
            enclose(&group.rest, &EncloseOptions { vertices, ..EncloseOptions::default() })
        };
        self.groups.iter().zip(self.shares(vertices)?).map(around).collect()
    }

    /// [`design`](crate::design()) of each component by itself, put together.
    ///
    /// # Errors
    /// See [`DesignError`].
    pub fn design(
        &self,
        rest: &Model,
        frames: &[Vec<f64>],
        options: &DesignOptions,
        watch: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Design, DesignError> {
        check(rest, frames)?;
        let shares = match options.goal {
            Goal::Vertices(vertices) => Some(self.shares(vertices)?),
            Goal::MeanError(_) => None,
        };
        let frames: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
        let mut found = Vec::with_capacity(self.len());
        for (k, group) in self.groups.iter().enumerate() {
            let own = diagonal(&group.rest.points);
            let goal = match (options.goal, &shares) {
                (Goal::MeanError(error), _) => Goal::MeanError(error * self.diagonal / own),
                (goal, shares) => shares.as_ref().map_or(goal, |shares| Goal::Vertices(shares[k])),
            };
            let time_limit = options.time_limit.map(|limit| limit.div_f64(self.len() as f64));
            let options = DesignOptions { goal, time_limit, ..options.clone() };
            let mut watch_all = |now: Progress<'_>| {
                let fraction = (k as f64 + now.fraction) / self.len() as f64;
                watch(Progress { fraction, error: None, better: None, ..now })
            };
            found.push(design(&group.rest, &subframes(&frames, &group.points), None, &options, &mut watch_all)?);
        }
        self.put_together(found)
    }

    fn put_together(&self, mut found: Vec<Design>) -> Result<Design, DesignError> {
        let cage = self.joined(found.iter_mut().map(|design| std::mem::take(&mut design.cage)).collect())?;
        // Mean squares over all points, by the diagonal of all.
        let all = |error: &dyn Fn(&Design) -> f64| {
            let square = |(group, design): (&Group, &Design)| {
                group.rest.points.len() as f64 * (error(design) * diagonal(&group.rest.points)).powi(2)
            };
            (self.groups.iter().zip(&found).map(square).sum::<f64>() / self.points as f64).sqrt() / self.diagonal
        };
        let last = |of: fn(&Stage) -> f64| move |design: &Design| design.stages.last().map_or(0.0, of);
        let best = Stage {
            name: "the best".to_owned(),
            vertices: cage.vertices().len(),
            training_error: all(&last(|stage| stage.training_error)),
            validation_error: all(&last(|stage| stage.validation_error)),
            condition_number: None,
            seconds: found.iter().map(last(|stage| stage.seconds)).sum(),
        };
        let unseen = found.iter().all(|design| design.unseen.is_some()).then(|| Unseen {
            error: all(&|design| design.unseen.as_ref().map_or(0.0, |unseen| unseen.error)),
            stretches: found[0].unseen.as_ref().map_or_else(Vec::new, |unseen| unseen.stretches.clone()),
        });
        Ok(Design {
            carriers: cage.carriers().to_vec(),
            cage: cage.mesh().clone(),
            stages: vec![best],
            unseen,
            timed_out: found.iter().any(|design| design.timed_out),
            missed: found.iter().any(|design| design.missed),
            warnings: found.into_iter().flat_map(|design| design.warnings).collect(),
        })
    }

    /// One mesh of the cages of all components, which carry their points.
    fn joined(&self, cages: Vec<TriMesh>) -> Result<Cage, CageError> {
        let (mut mesh, mut carriers) = (TriMesh::default(), Vec::new());
        for (group, cage) in self.groups.iter().zip(cages) {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(cage.vertices);
            mesh.triangles.extend(cage.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
            let vertices = first..mesh.vertices.len() as u32;
            let carrier = |points: &Range<usize>| Carrier {
                points: points.start as u32..points.end as u32,
                vertices: vertices.clone(),
            };
            carriers.extend(group.points.iter().map(carrier));
        }
        carriers.sort_unstable_by_key(|carrier| carrier.points.start);
        Cage::new(mesh)?.with_carriers(carriers)
    }
}

/// Groups of points, of which those whose points are all in one place join the nearest other one.
fn with_extent(points: &[Point], groups: Vec<Vec<Range<usize>>>) -> Vec<Vec<Range<usize>>> {
    let all = |group: &Vec<Range<usize>>| -> Vec<Point> {
        group.iter().flat_map(|range| &points[range.clone()]).copied().collect()
    };
    let is_wide = |group: &Vec<Range<usize>>| extent(&all(group)).is_ok();
    let (mut wide, flat): (Vec<_>, Vec<_>) = groups.into_iter().partition(is_wide);
    if wide.is_empty() {
        return flat;
    }
    let boxes: Vec<(Point, Point)> = wide.iter().map(|group| bounds(&all(group))).collect();
    for group in flat {
        let place = points[group[0].start];
        let distance = |(low, high): &(Point, Point)| {
            norm([0, 1, 2].map(|k| (low[k] - place[k]).max(place[k] - high[k]).max(0.0)))
        };
        let nearest = (0..wide.len()).min_by(|&a, &b| distance(&boxes[a]).total_cmp(&distance(&boxes[b])));
        let joined = &mut wide[nearest.unwrap_or_default()];
        joined.extend(group);
        joined.sort_unstable_by_key(|range| range.start);
    }
    wide
}

/// Some points of a model with the faces between them.
fn submodel(model: &Model, points: &[Range<usize>]) -> Model {
    const ELSEWHERE: u32 = u32::MAX;
    let mut names = vec![ELSEWHERE; model.points.len()];
    points.iter().cloned().flatten().zip(0..).for_each(|(point, name)| names[point] = name);
    let mut faces = Polygons::new();
    for face in model.faces.iter() {
        let face: Vec<u32> = face.iter().map(|&point| names[point as usize]).collect();
        if !face.contains(&ELSEWHERE) {
            faces.push(&face);
        }
    }
    let points = points.iter().flat_map(|range| &model.points[range.clone()]).copied().collect();
    Model { points, faces, ..Model::default() }
}

/// The same points of frames.
fn subframes(frames: &[&[f64]], points: &[Range<usize>]) -> Vec<Vec<f64>> {
    let of = |frame: &&[f64]| {
        points.iter().flat_map(|range| &frame[3 * range.start..3 * range.end]).copied().collect::<Vec<f64>>()
    };
    frames.iter().map(of).collect()
}
