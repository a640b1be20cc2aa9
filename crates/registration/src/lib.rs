//! A model, by its cage, laid onto a surface that shares nothing with it: no correspondence, other numbers of points, noise, holes. Once:
//! nothing of time, rigs or files. Plain data in, plain data out.

mod align;
mod dense_rows;
mod fit;
mod matching;
mod nearest;
mod normals;
mod observation;
mod orientation;
mod rigidity;
mod sampling;
mod score;
mod sparse_rows;
mod target;
mod template;

pub use align::{AlignOptions, Alignment, align};
pub use fit::FitOptions;
pub use matching::OrientedPoints;
pub use nearest::NearestPoints;
pub use observation::{Observation, ObservationError, ObservationNotes, ObservationOptions};
pub use orientation::{outward, welded};
pub use sampling::{SurfacePoint, farthest, sample_surface};
pub use target::Target;
pub use template::{RegistrationError, Template, TemplateOptions};
