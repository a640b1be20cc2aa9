//! The JSON bodies of shape spaces: poses of one model, and the shapes between them.

use crate::options::options;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

options! {
    /// The JSON part `options` of `POST /v1/shapespaces`. What is left out has its default.
    pub struct ShapeSpaceOptions {
        /// A name for people, at most 200 characters.
        #[schema(max_length = 200)]
        name: Option<String>,
        /// Where shapes are found.
        on: Option<ShapesOn>,
        /// Completed session whose frames are the poses, in place of files.
        source_session: Option<String>,
        /// The frames that are the poses, of a session or the part `source`, from 0.
        frames: Vec<u32>,
    }
}

/// Where shapes between poses are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum ShapesOn {
    /// On a cage: a few milliseconds a shape.
    #[default]
    Cage,
    /// On the model itself: exact, and slower.
    Mesh,
}

/// Poses of one model in memory, which a restart or a while without a request forgets.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct ShapeSpace {
    /// Identifier, part of every address below it.
    pub id: String,
    /// Name given at creation.
    pub name: Option<String>,
    /// Creation time, seconds since 1970.
    pub created: f64,
    /// Points of the model.
    pub points: u32,
    /// Poses; a shape takes as many weights.
    pub poses: u32,
    /// Where shapes are found.
    pub on: ShapesOn,
    /// Vertices of the cage, where they are found on one.
    pub cage_vertices: Option<u32>,
    /// What is subtracted from the positions of shapes, where the model lies far from the origin.
    pub origin: Option<[f64; 3]>,
}

/// The shape spaces of a tenant, newest first.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct ShapeSpaceList {
    /// The shape spaces.
    pub shapespaces: Vec<ShapeSpace>,
}
