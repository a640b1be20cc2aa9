//! The pictures of a report.

use super::evaluation::second_differences;
use super::figures::SystemFigures;
use super::method_groups::data_alone;
use super::methods::Method;
use super::render::{Camera, Mesh, Png, Ramp, Scene, Shade, Up, diverging};
use super::sample::{Frame, Sample};
use super::system::SystemStudy;
use super::{CompareError, as_points, frames_of};
use cager_core::cage::Cage;
use cager_core::decode::Decoder;
use cager_core::inversion::SolverOptions;
use cager_core::mesh::{Point, TriMesh};
use cager_formats::FrameReader;
use rayon::prelude::*;

/// Pixels of a picture, about, and of that of the handles.
const PIXELS: f64 = 420.0 * 420.0;
const HANDLES_PIXELS: f64 = 4.0 * PIXELS;
/// A reconstruction with a larger error, over the diagonal, gets a separate view.
const LOST: f64 = 0.5;
/// Singular vectors with a smaller participation number are marked by discs.
const FEW: f64 = 12.0;
/// Width over height that pictures keep to.
const ASPECT: [f64; 2] = [0.6, 1.7];
/// Frames of the row that shows the capture.
const ROW: usize = 4;
/// Colours of the model, of cages, of their edges and of handles.
const MODEL: [f32; 3] = [0.80, 0.81, 0.83];
const CAGE: [f32; 3] = [0.16, 0.42, 0.70];
const EDGES: [f32; 3] = [0.46, 0.48, 0.52];
const HANDLES: [f32; 3] = [0.16, 0.62, 0.36];

/// A picture with what stands below it.
pub(crate) struct Picture {
    /// Title.
    pub(crate) title: String,
    /// A line of figures.
    pub(crate) note: String,
    /// The picture.
    pub(crate) png: Png,
}

/// All pictures of a system.
pub(crate) struct Pictures {
    /// Handles on the rest pose in its cage.
    pub(crate) handles: Picture,
    /// Frames of the capture, reconstructed, in their cages.
    pub(crate) row: Vec<Picture>,
    /// Cages of the shown frame, painted by their second temporal difference.
    pub(crate) cages: Vec<Picture>,
    /// Top of their scale, a fraction of the diagonal.
    pub(crate) cages_top: f64,
    /// The shown frame reconstructed, painted by its error.
    pub(crate) models: Vec<Picture>,
    /// Top of their scale, a fraction of the diagonal.
    pub(crate) models_top: f64,
    /// Singular vectors on the rest cage.
    pub(crate) vectors: Vec<Picture>,
}

/// What the pictures show.
pub(super) struct PictureInput<'a> {
    /// Model in its rest pose.
    pub(super) mesh: &'a TriMesh,
    /// Its cage.
    pub(super) cage: &'a Cage,
    /// The vertical axis, where it is not to be guessed.
    pub(super) up: Option<Up>,
}

/// Paints the same frames for every system.
pub(super) struct Painter<'a> {
    input: PictureInput<'a>,
    up: Up,
    edges: Vec<[u32; 2]>,
    /// Diagonal of the rest pose's bounding box.
    diagonal: f64,
    shown: usize,
    frames: Vec<Frame>,
    row: Vec<usize>,
}

impl<'a> Painter<'a> {
    /// Chooses the frame to show, and reads it and the row's frames.
    pub(super) fn new(
        input: PictureInput<'a>,
        open: &dyn Fn() -> Result<Box<dyn FrameReader>, cager_formats::Error>,
        sample: &Sample,
        figures: &SystemFigures,
    ) -> Result<Self, CompareError> {
        let shown = sample.measured()[frame_of_largest_spike(figures)];
        let measured = sample.measured();
        let count = measured.len().min(ROW);
        let row: Vec<usize> = (0..count).map(|k| measured[k * (measured.len() - 1) / (count - 1).max(1)]).collect();
        let mut wanted: Vec<usize> = row.iter().copied().chain(shown.saturating_sub(1)..=shown + 1).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let frames = frames_of(open()?.as_mut(), &wanted)?;
        let up = input.up.unwrap_or_else(|| Up::guess(&input.mesh.vertices));
        let edges = input.cage.edges().iter().map(|edge| edge.vertices).collect();
        let diagonal = cager_core::mesh::diagonal(&input.mesh.vertices);
        Ok(Self { input, up, edges, diagonal, shown, frames, row })
    }

    /// The frame that cages and errors are shown of.
    pub(super) fn shown(&self) -> usize {
        self.shown
    }

    /// Paints a system.
    pub(super) fn paint(&self, study: &SystemStudy<'_>) -> Result<Pictures, CompareError> {
        let figures = &study.figures;
        let (cages, cages_top) = self.cages(study);
        let (models, models_top) = self.models(study)?;
        let row = match figures.method(|m| m.is_cager() && m.curve) {
            Some(usual) => self.row(study, usual.method.options()),
            None => Vec::new(),
        };
        Ok(Pictures {
            handles: self.handles(study),
            row,
            cages,
            cages_top,
            models,
            models_top,
            vectors: self.vectors(study),
        })
    }

    fn frame(&self, number: usize) -> Option<&Frame> {
        self.frames.iter().find(|frame| frame.number == number)
    }

    /// A camera on these points, and the size of its pictures.
    fn camera(&self, points: &[Point], pixels: f64) -> (Camera, usize, usize) {
        let rest = &self.input.mesh.vertices;
        let square = Camera::fitting(points, rest, self.up, 1.0);
        let seen: Vec<Point> = points.iter().map(|p| square.project(*p, [1000, 1000])).collect();
        let (low, high) = cager_core::mesh::bounds(&seen);
        let aspect = (high[0] - low[0]) / (high[1] - low[1]);
        let aspect = if aspect.is_finite() { aspect.clamp(ASPECT[0], ASPECT[1]) } else { 1.0 };
        let (width, height) = ((pixels * aspect).sqrt() as usize, (pixels / aspect).sqrt() as usize);
        (Camera::fitting(points, rest, self.up, width as f64 / height as f64), width, height)
    }

    fn handles(&self, study: &SystemStudy<'_>) -> Picture {
        let (mesh, cage) = (self.input.mesh, self.input.cage);
        let both: Vec<Point> = mesh.vertices.iter().chain(cage.vertices()).copied().collect();
        let (camera, width, height) = self.camera(&both, HANDLES_PIXELS);
        let mut scene = Scene::new(camera, width, height);
        scene.surface(model(&mesh.vertices, mesh), Shade::Plain(MODEL), true);
        scene.lines(cage.vertices(), &self.edges, CAGE);
        let handles = &study.analysis.handles().rows;
        for &row in handles {
            scene.dot(mesh.vertices[row as usize], HANDLES, 4.5, false);
        }
        Picture {
            title: "handles".to_owned(),
            note: format!("{} points of maximum volume", handles.len()),
            png: scene.png(),
        }
    }

    fn row(&self, study: &SystemStudy<'_>, usual: SolverOptions) -> Vec<Picture> {
        let mesh = self.input.mesh;
        let decoder = study.analysis.decoder();
        let shots: Vec<(usize, Vec<Point>, Vec<Point>)> = self
            .row
            .iter()
            .filter_map(|&number| {
                let cage = study.invert(usual, &[self.frame(number)?.points.as_slice()])?.pop()?;
                let decoded = decode(decoder, &cage);
                Some((number, as_points(&cage[..3 * decoder.positions()]), as_points(&decoded)))
            })
            .collect();
        shots
            .par_iter()
            .map(|(number, cage, points)| {
                let both: Vec<Point> = points.iter().chain(cage).copied().collect();
                let (camera, width, height) = self.camera(&both, PIXELS);
                let mut scene = Scene::new(camera, width, height);
                scene.surface(model(points, mesh), Shade::Plain(MODEL), true);
                scene.lines(cage, &self.edges, CAGE);
                Picture { title: format!("frame {number}"), note: String::new(), png: scene.png() }
            })
            .collect()
    }

    /// Cages of the shown frame by the methods whose cages the paper shows.
    fn cages(&self, study: &SystemStudy<'_>) -> (Vec<Picture>, f64) {
        let Some(frame) = self.frame(self.shown) else { return (Vec::new(), 1.0) };
        let three = [self.shown.checked_sub(1), Some(self.shown), Some(self.shown + 1)];
        let three: Option<Vec<&[f64]>> =
            three.map(|number| Some(self.frame(number?)?.points.as_slice())).into_iter().collect();
        let mut shots = Vec::new();
        for found in study.figures.methods.iter().filter(|found| shows_cage(&found.method, &study.figures)) {
            let count = study.analysis.decoder().positions();
            let frames = three.clone().unwrap_or_else(|| vec![frame.points.as_slice()]);
            let Some(mut cages) = study.invert(found.method.options(), &frames) else { continue };
            let differences = match &cages[..] {
                [a, b, c] => second_differences([a, b, c], count).iter().map(|x| x / self.diagonal).collect(),
                _ => vec![0.0; count],
            };
            let cage = cages.swap_remove(cages.len() / 2);
            shots.push((found.method.name(), as_points(&cage[..3 * count]), differences));
        }
        let all: Vec<f64> =
            shots.iter().flat_map(|(_, _, differences): &(_, _, Vec<f64>)| differences).copied().collect();
        let ramp = Ramp::over(all.iter());
        let model_points = as_points(&frame.points);
        // Spikes may leave the picture; the cages of the paper's own method do not.
        let reference_cage = shots.last().map_or(&[][..], |shot| &shot.1);
        let fitted: Vec<Point> = model_points.iter().chain(reference_cage).copied().collect();
        let (camera, width, height) = self.camera(&fitted, PIXELS);
        let faces: Vec<[u32; 3]> = self.input.cage.mesh().triangles.clone();
        let pictures = shots
            .par_iter()
            .map(|(title, points, differences)| {
                let colours: Vec<[f32; 3]> = differences.iter().map(|x| ramp.colour(*x)).collect();
                let mut scene = Scene::new(camera, width, height);
                scene.surface(Mesh { points, triangles: &faces }, Shade::PerPoint(&colours), false);
                scene.lines(points, &self.edges, EDGES);
                let (mean, max) = (
                    differences.iter().sum::<f64>() / differences.len() as f64,
                    differences.iter().copied().fold(0.0, f64::max),
                );
                let note = format!("mean {:.3} %, largest {:.2} %", 100.0 * mean, 100.0 * max);
                Picture { title: title.clone(), note, png: scene.png() }
            })
            .collect();
        (pictures, ramp.top)
    }

    /// The shown frame as the methods reconstruct it.
    fn models(&self, study: &SystemStudy<'_>) -> Result<(Vec<Picture>, f64), CompareError> {
        let Some(frame) = self.frame(self.shown) else { return Ok((Vec::new(), 1.0)) };
        let frames = [frame.points.as_slice()];
        let decoder = study.analysis.decoder();
        let mut cages = Vec::new();
        if let Some((name, rows)) = &study.median_draw {
            let usual = study.figures.method(|m| m.is_cager() && m.curve).map(|m| m.method.options());
            let handle_system = study.analysis.handle_system_of(rows)?;
            let method = handle_system.factored(usual.unwrap_or_else(data_alone))?;
            let found = handle_system.cages(&method, None, &handle_system.project(&frames), &frames);
            cages.extend(found.into_iter().map(|cage| (format!("{name}, sub-spectral"), cage)));
        }
        for found in study.figures.methods.iter().filter(|found| shows_model(&found.method)) {
            let inverted = study.invert(found.method.options(), &frames).unwrap_or_default();
            cages.extend(inverted.into_iter().map(|cage| (found.method.name(), cage)));
        }
        let shots: Vec<(String, Vec<Point>, Vec<f64>)> = cages
            .into_iter()
            .map(|(title, cage)| {
                let decoded = as_points(&decode(decoder, &cage));
                let truth = frame.points.as_chunks::<3>().0;
                let error = |(p, q): (&Point, &Point)| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
                let errors = decoded.iter().zip(truth).map(|pair| error(pair) / self.diagonal).collect();
                (title, decoded, errors)
            })
            .collect();
        // Without the random draw, whose errors would dominate the scale.
        let ramp = Ramp::over(shots.iter().skip(usize::from(shots.len() > 1)).flat_map(|shot| &shot.2));
        let (camera, width, height) = self.camera(&as_points(&frame.points), PIXELS);
        let pictures = shots
            .par_iter()
            .map(|(title, points, errors)| {
                let colours: Vec<[f32; 3]> = errors.iter().map(|x| ramp.colour(*x)).collect();
                let linf = errors.iter().copied().fold(0.0, f64::max);
                // Points alone where the reconstruction fails: its triangles would hide each other.
                let (view, mesh) = match linf > LOST {
                    true => (self.camera(&most(points), PIXELS), Mesh { points, triangles: &[] }),
                    false => ((camera, width, height), model(points, self.input.mesh)),
                };
                let mut scene = Scene::new(view.0, view.1, view.2);
                scene.surface(mesh, Shade::PerPoint(&colours), true);
                let l2 = (errors.iter().map(|x| x * x).sum::<f64>() / errors.len() as f64).sqrt();
                let note = format!("L2 {:.3} %, L∞ {:.2} %", 100.0 * l2, 100.0 * linf);
                Picture { title: title.clone(), note, png: scene.png() }
            })
            .collect();
        Ok((pictures, ramp.top))
    }

    fn vectors(&self, study: &SystemStudy<'_>) -> Vec<Picture> {
        let cage = self.input.cage;
        let (camera, width, height) = self.camera(cage.vertices(), PIXELS);
        let (v, sigma) = (study.analysis.handle_vectors(), study.analysis.handle_spectrum());
        let painted = &study.figures.vectors.painted;
        painted
            .par_iter()
            .map(|&k| {
                let values: Vec<f64> = (0..cage.vertices().len()).map(|j| v[(j, k)]).collect();
                let top = values.iter().copied().fold(0.0, |a: f64, x| a.max(x.abs()));
                let colours: Vec<[f32; 3]> = values.iter().map(|x| diverging(signed_root(*x, top))).collect();
                let mut scene = Scene::new(camera, width, height);
                scene.surface(
                    Mesh { points: cage.vertices(), triangles: &cage.mesh().triangles },
                    Shade::PerPoint(&colours),
                    false,
                );
                scene.lines(cage.vertices(), &self.edges, EDGES);
                if study.figures.vectors.spread[k] < FEW {
                    for (j, vertex) in cage.vertices().iter().enumerate().filter(|(j, _)| values[*j].abs() > 0.25 * top)
                    {
                        scene.dot(*vertex, colours[j], 6.0, true);
                    }
                }
                let note = match sigma.get(k) {
                    Some(sigma) => {
                        format!("singular value {sigma:.3}, on {:.0} unknowns", study.figures.vectors.spread[k])
                    }
                    None => "no singular value: beyond the rank".to_owned(),
                };
                Picture { title: format!("vector {} of {}", k + 1, v.ncols()), note, png: scene.png() }
            })
            .collect()
    }
}

/// Position of the frame where full least squares spikes most; where nothing spikes, of its largest error.
fn frame_of_largest_spike(figures: &SystemFigures) -> usize {
    let Some(full) = figures.method(Method::is_full_least_squares) else { return 0 };
    let largest = |values: &[f64]| {
        (0..values.len())
            .filter(|&i| values[i].is_finite())
            .max_by(|&a, &b| values[a].total_cmp(&values[b]).then(b.cmp(&a)))
    };
    largest(&full.per_frame.spike_max).or_else(|| largest(&full.per_frame.linf)).unwrap_or(0)
}

/// The points between the 2nd and 98th percentile along every axis.
fn most(points: &[Point]) -> Vec<Point> {
    let ends = [0, 1, 2].map(|k| {
        let mut sorted: Vec<f64> = points.iter().map(|p| p[k]).collect();
        sorted.sort_by(f64::total_cmp);
        [sorted[sorted.len() / 50], sorted[sorted.len() - 1 - sorted.len() / 50]]
    });
    points.iter().filter(|p| (0..3).all(|k| (ends[k][0]..=ends[k][1]).contains(&p[k]))).copied().collect()
}

/// The value over `top` with the small ones raised, so that they are seen.
fn signed_root(value: f64, top: f64) -> f64 {
    if top > 0.0 { (value.abs() / top).sqrt().copysign(value) } else { 0.0 }
}

fn shows_cage(method: &Method, figures: &SystemFigures) -> bool {
    let strongest = figures.methods.iter().filter(|m| m.method.is_cager()).map(|m| m.method.spectrum).max();
    method.curve || method.is_cager() && Some(method.spectrum) == strongest
}

fn shows_model(method: &Method) -> bool {
    method.curve
}

fn model<'a>(points: &'a [Point], mesh: &'a TriMesh) -> Mesh<'a> {
    Mesh { points, triangles: &mesh.triangles }
}

fn decode(decoder: &Decoder, cage: &[f32]) -> Vec<f32> {
    let mut out = [Vec::new()];
    decoder.decode(&[cage], &mut out);
    let [points] = out;
    points
}
