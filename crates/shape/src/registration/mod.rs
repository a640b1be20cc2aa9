//! A model, by its cage, laid onto a surface that shares nothing with it: no correspondence, other
//! numbers of points, noise, holes.

mod align;
mod anchors;
mod closeness;
mod conjugate_gradients;
mod dense_rows;
mod fit;
mod graph;
mod matching;
mod nearest;
mod normals;
mod observation;
mod orientation;
mod planes;
mod rigidity;
mod sampling;
mod score;
mod sparse_rows;
mod stages;
mod target;
mod template;

pub(crate) use align::align_pairs;
pub use align::{AlignOptions, Alignment, alignments, least_turned};
pub use anchors::Anchors;
pub use closeness::MeasuredSurface;
pub(crate) use conjugate_gradients::conjugate_gradients;
pub use fit::FitOptions;
pub(crate) use graph::NodeGraph;
pub use matching::{KnownMatches, OrientedPoints};
pub use nearest::NearestPoints;
pub use observation::{Observation, ObservationError, ObservationNotes, ObservationOptions};
pub use orientation::outward;
pub(crate) use planes::{MatchWeights, PlaneDistances};
pub(crate) use rigidity::StrainGraph;
pub use sampling::{SurfacePoint, farthest, sample_surface, surface_vertices};
pub use stages::Registration;
pub use target::Target;
pub(crate) use template::check_coordinates;
pub use template::{RegistrationError, Template};

pub use crate::points::welded;
