//! A model, by its cage, laid onto a surface that shares nothing with it: no correspondence, other numbers of points, noise, holes. Once:
//! nothing of time, rigs or files. Plain data in, plain data out.

mod fit;
mod matching;
mod nearest;
mod normals;
mod observation;
mod orientation;
mod rigidity;
mod sampling;
mod sparse_rows;
mod template;

pub use fit::{FitOptions, Target};
pub use matching::OrientedPoints;
pub use nearest::NearestPoints;
pub use observation::{Observation, ObservationError, ObservationNotes, ObservationOptions};
pub use sampling::{SurfacePoint, farthest, sample_surface};
pub use template::{RegistrationError, Template, TemplateOptions};
