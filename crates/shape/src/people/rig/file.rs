//! Rig files, in JSON.

use super::{QUAD_NAMES, Quad, Rig, RigError};
use cager_geometry::mesh::Point;
use cager_geometry::vector::{dot, norm};
use serde::{Deserialize, Serialize};

/// What a rig file contains.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct RigFile {
    up: Point,
    forward: Point,
    quads: Vec<NamedQuad>,
    crotch: [Point; 2],
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct NamedQuad {
    name: String,
    joint: Point,
    corners: [Point; 4],
}

impl Rig {
    /// A rig from the bytes of its file.
    ///
    /// # Errors
    /// Where the file is not of this form, names quads that a rig does not have, or lacks one.
    pub fn from_json(bytes: &[u8]) -> Result<Self, RigError> {
        let file: RigFile = serde_json::from_slice(bytes).map_err(|error| RigError::Syntax(error.to_string()))?;
        let mut quads = [None; QUAD_NAMES.len()];
        for NamedQuad { name, joint, corners } in file.quads {
            let Some(number) = QUAD_NAMES.iter().position(|&known| known == name) else {
                return Err(RigError::UnknownQuad(name));
            };
            if quads[number].replace(Quad { joint, corners }).is_some() {
                return Err(RigError::RepeatedQuad(name));
            }
        }
        let quads: Vec<Quad> = quads
            .into_iter()
            .zip(QUAD_NAMES)
            .map(|(quad, name)| quad.ok_or(RigError::MissingQuad(name)))
            .collect::<Result<_, _>>()?;
        let rig = Self { quads, crotch: file.crotch, up: file.up, forward: file.forward };
        let points = rig.quads.iter().flat_map(|quad| quad.corners.into_iter().chain([quad.joint]));
        let finite = points.chain(rig.crotch).all(|p| p.iter().all(|x| x.is_finite()));
        let unit = |a: Point| (norm(a) - 1.0).abs() < 1e-6;
        if !finite || !unit(rig.up) || !unit(rig.forward) || dot(rig.up, rig.forward).abs() > 1e-6 {
            return Err(RigError::BadNumbers);
        }
        Ok(rig)
    }

    /// The file of the rig, with line breaks.
    pub fn to_json(&self) -> String {
        let quads = self.quads.iter().zip(QUAD_NAMES).map(|(quad, name)| NamedQuad {
            name: name.to_owned(),
            joint: quad.joint,
            corners: quad.corners,
        });
        let file = RigFile { up: self.up, forward: self.forward, quads: quads.collect(), crotch: self.crotch };
        serde_json::to_string_pretty(&file).unwrap_or_default()
    }
}
