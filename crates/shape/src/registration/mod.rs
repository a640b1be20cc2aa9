//! A model, by its cage, laid onto a surface that shares nothing with it: no correspondence, other numbers of points, noise, holes. Once:
//! nothing of time, rigs or files. Plain data in, plain data out.

mod align;
mod anchors;
mod closeness;
mod dense_rows;
mod fit;
mod graph;
mod matching;
mod nearest;
mod normals;
mod observation;
mod orientation;
mod rigidity;
mod sampling;
mod score;
mod sparse_rows;
mod stages;
mod target;
mod template;

pub use align::{AlignOptions, Alignment, align, align_pairs, alignments, least_turned};
pub use anchors::Anchors;
pub use cager_geometry::mesh::welded;
pub use closeness::MeasuredSurface;
pub use fit::FitOptions;
pub use graph::NodeGraph;
pub use matching::{KnownMatches, OrientedPoints};
pub use nearest::NearestPoints;
pub use observation::{Observation, ObservationError, ObservationNotes, ObservationOptions};
pub use orientation::outward;
pub use sampling::{SurfacePoint, farthest, sample_surface, surface_vertices};
pub use stages::{Registration, StageOptions};
pub use target::Target;
pub use template::{RegistrationError, Template, TemplateOptions};
