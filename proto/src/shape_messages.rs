//! The JSON bodies of shape spaces: poses of one model, and the shapes between them.

use serde::{Deserialize, Serialize};

/// What a shape space is made from, the JSON part `options` of `POST /v1/shapespaces`. What is left out has its default.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ShapeSpaceOptions {
    /// A name for people, at most 200 characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(max_length = 200))]
    pub name: Option<String>,
    /// Where shapes are found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<ShapesOn>,
    /// Completed session whose frames are the poses, in place of files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source_session: Option<String>,
    /// The frames that are the poses, of a session or of the part `source`, from 0; two or more.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<u32>,
}

/// Where shapes between poses are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum ShapesOn {
    /// On a cage: a few milliseconds a shape.
    #[default]
    Cage,
    /// On the model itself: exact, and slower.
    Mesh,
}

/// Poses of one model, and the shapes between them. It is in memory alone: a restart forgets it, and so does a while without a request.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ShapeSpaceList {
    /// The shape spaces.
    pub shapespaces: Vec<ShapeSpace>,
}
