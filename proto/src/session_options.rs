//! The options of a session.

use crate::object::Object;
use crate::options::options;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

options! {
    /// The JSON part `options` of a session's creation. What is left out has its default.
    pub coded struct SessionOptions {
        /// A name for people, at most 200 characters.
        #[schema(max_length = 200)]
        name: Option<String>,
        /// Coordinate system: `mvc`, `harmonic`, `green` (normals follow from the vertices) or
        /// `green-free` (normals are unknowns).
        #[schema(pattern = "^(mvc|harmonic|green|green-free)$")]
        coordinates: Option<String>,
        /// Points the inversion reads: `spread`, `maxvol`, `rectangular` or `all`. Where it is left
        /// out `spread`, or `all` where frames are coded (except with `green`).
        #[schema(pattern = "^(maxvol|rectangular|spread|all)$")]
        handles: Option<String>,
        /// How many points `rectangular` and `spread` read; by default twice the unknowns.
        #[schema(minimum = 1)]
        handle_count: Option<u32>,
        /// Treatment of the unstable end of the spectrum: `differential` (where it is left out:
        /// keeps the shape of the rest cage), `laplacian`, `temporal` (frames have to come in
        /// order), `matrix` (with a part `regularizer_matrix`), `none`, `truncated-svd`, `tikhonov`
        /// or `global`.
        #[schema(pattern = "^(laplacian|differential|temporal|matrix|none|truncated-svd|tikhonov|global)$")]
        regularizer: Option<String>,
        /// Spectrum threshold: how many of the last singular directions are regularised; 20, or a
        /// sixteenth of the unknowns where that is less, where it is left out. Where frames are
        /// coded (except with `green`) and neither it, `lambda` nor another regularizer than
        /// `differential` is given, all are, with a `lambda` of 0.001.
        #[serde(deserialize_with = "threshold")]
        spectrum: Option<u32>,
        /// Weight of the regularisation; 1 where it is left out, but see `spectrum`.
        #[schema(minimum = 0)]
        lambda: Option<f64>,
        /// Where the cage comes from if none is sent; by default it is made from the rest pose.
        #[serde(deserialize_with = "cage_source")]
        cage: Option<CageSource>,
        /// Turn a cage inside out whose faces all point inwards.
        flip_cage: bool,
        /// Frames per second, written into the container.
        #[schema(exclusive_minimum = 0)]
        frame_rate: Option<f64>,
        /// Number of frames of the capture, where it is known: a frame with this number or a higher
        /// one is then refused at once, instead of when the session is completed.
        #[schema(minimum = 1)]
        frames: Option<u32>,
    }
}

/// A cage that is not sent. At most one of its fields is given.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct CageSource {
    /// The cage is made around the rest pose, with at most so many vertices; 350 where it is left
    /// out, or half as many as the model has points.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 4, maximum = 20000)]
    pub vertices: Option<u32>,
    /// The cage is that of this completed design, see `POST /v1/cages`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
}

fn cage_source<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<CageSource>, D::Error> {
    Ok(Option::<Object<CageSource>>::deserialize(deserializer)?.map(|Object(source)| source))
}

/// A threshold; the command line's `auto` needs frames to measure.
fn threshold<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<u32>, D::Error> {
    struct Threshold;

    impl<'de> serde::de::Visitor<'de> for Threshold {
        type Value = Option<u32>;

        fn expecting(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            out.write_str("a number of singular directions as spectrum")
        }

        fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Self::Value, E> {
            u32::try_from(value).map(Some).map_err(|_| E::invalid_value(serde::de::Unexpected::Unsigned(value), &self))
        }

        fn visit_str<E: serde::de::Error>(self, value: &str) -> Result<Self::Value, E> {
            if value == "auto" {
                let text = "spectrum auto is chosen by frames, and a service prepares before it sees any; give a number, or encode with the command line, without --server";
                return Err(E::custom(text));
            }
            Err(E::invalid_value(serde::de::Unexpected::Str(value), &self))
        }

        fn visit_unit<E: serde::de::Error>(self) -> Result<Self::Value, E> {
            Ok(None)
        }
    }

    deserializer.deserialize_any(Threshold)
}
