//! What the options of a transfer say.

use crate::preparation::{VERTICES, check_told, goal, vertices_detail};
use crate::problem::{self, ApiError};
use cager_cages::DesignOptions;
use cager_capture::coding::Goal;
use cager_capture::design::default_vertices;
use cager_core::coordinates::{self, CoordinateSystem, MeanValue};
use cager_geometry::mesh::Point;
use cager_motion::transfer::{MethodChoice, words};
use cager_proto::messages::SessionOptions;
use cager_proto::transfer_messages::{TransferMethod, TransferOptions};
use cager_shape::transfer::Pose;
use cager_shape::transfer::alignment::AlignBy;

/// Validated options.
#[derive(Clone, Copy)]
pub(super) struct ValidOptions {
    pub(super) method: MethodChoice,
    pub(super) pose: Pose,
    pub(super) align: AlignBy,
    pub(super) up: Option<Point>,
    pub(super) system: &'static dyn CoordinateSystem,
    /// What the container is to meet; without it cages alone are stored.
    pub(super) goal: Option<Goal>,
}

/// Validates options alone.
///
/// # Errors
/// An option that is out of range, not available, or contradicts another.
pub(crate) fn check_options(options: &TransferOptions) -> Result<(), ApiError> {
    ValidOptions::of(options, false).map(|_| ())
}

impl ValidOptions {
    /// Validates the options.
    ///
    /// # Errors
    /// An option that is out of range, not available, or contradicts another.
    pub(super) fn of(options: &TransferOptions, has_cage: bool) -> Result<Self, ApiError> {
        let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        check_told(options.name.as_deref(), options.frame_rate, options.start)?;
        if options.frames == Some(0) {
            return refuse("frames: a motion has at least one frame".to_owned());
        }
        if let Some(vertices) = options.cage_vertices.filter(|vertices| !VERTICES.contains(vertices)) {
            return refuse(format!("cage_{}", vertices_detail(vertices)));
        }
        if options.cage_vertices.is_some() && options.mean_error.is_some() {
            return refuse(
                "cage_vertices and mean_error: give the number of vertices or the error, not both".to_owned(),
            );
        }
        let name = options.coordinates.as_deref().unwrap_or(MeanValue.name());
        let Some(system) = coordinates::by_name(name) else {
            let known = "mvc, harmonic, green and green-free";
            return refuse(format!("coordinates: {name:?} is not available; give one of {known}"));
        };
        let TransferOptions { public, rigidity, align, matrix, .. } = *options;
        let method = options.method.unwrap_or_default();
        if method == TransferMethod::Fitted && (public.is_some() || options.coordinates.is_some() || options.detail) {
            let detail = "public, coordinates and detail: belong to the methods public and rigid; leave them out";
            return refuse(detail.to_owned());
        }
        if method != TransferMethod::Fitted && options.pose.is_some() {
            return refuse("pose: belongs to the method fitted; leave it out".to_owned());
        }
        if method != TransferMethod::Rigid && rigidity.is_some() {
            return refuse("rigidity: belongs to the method rigid; leave it out".to_owned());
        }
        if let Some(rigidity) = rigidity.filter(|rigidity| !(rigidity.is_finite() && *rigidity >= 0.0)) {
            return refuse(format!("rigidity: is {rigidity}; give a number, 0 or more"));
        }
        if public.is_some() && has_cage {
            return refuse("public: a cage is sent as well; leave out the part or the option".to_owned());
        }
        if method == TransferMethod::Rigid && system.name() == "green" {
            let detail = "coordinates: with the method rigid, green has normals that follow from the vertices; take mvc or harmonic";
            return refuse(detail.to_owned());
        }
        if align.is_some() && matrix.is_some() {
            return refuse("align and matrix: give one of them".to_owned());
        }
        let Some(align) = words::align(align, matrix) else {
            let detail = "matrix: does more than turn, scale evenly and move; give one without mirroring and shear, whose last row is 0 0 0 1";
            return refuse(detail.to_owned());
        };
        let TransferOptions { max_error, mean_error, target_size, .. } = *options;
        let quality = options.quality.clone();
        // Their number is known.
        let frames = Some(1);
        let coded = SessionOptions { max_error, mean_error, target_size, quality, frames, ..SessionOptions::default() };
        Ok(Self {
            method: words::method(method, (has_cage, public), rigidity),
            pose: words::pose(options.pose),
            align,
            up: options.up.map(words::axis),
            system,
            goal: goal(&coded)?,
        })
    }
}

/// How the cage of a target of so many points is designed.
pub(super) fn design_of(options: &TransferOptions, points: usize) -> DesignOptions {
    let vertices = options.cage_vertices.map_or(default_vertices(points), |n| n as usize);
    let goal = options.mean_error.map_or(cager_cages::Goal::Vertices(vertices), cager_cages::Goal::MeanError);
    DesignOptions { goal, ..DesignOptions::default() }
}
