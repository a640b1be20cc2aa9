//! Which joints of a skeleton are which bones of a person, by the names that exporters give them.

use super::error::PoseError;
use cager_formats::biovision::Skeleton;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Bones of a person that move quads. Those of the trunk turn about the joint named first; of
/// limbs, named `left` and `right`, a second joint says where the bone ends.
pub const BONES: [&str; 16] = [
    "pelvis",
    "abdomen",
    "chest",
    "head",
    "left upper arm",
    "left forearm",
    "left hand",
    "left thigh",
    "left shin",
    "left foot",
    "right upper arm",
    "right forearm",
    "right hand",
    "right thigh",
    "right shin",
    "right foot",
];

/// The joint that turns a bone, and the one at its end where it matters.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct BoneNames {
    /// The joint that turns it.
    pub joint: String,
    /// The joint at its end; hands and feet may lack one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<String>,
}

/// Names of the joints of all bones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Naming {
    /// Of each of [`BONES`].
    bones: Vec<BoneNames>,
}

/// The joints of the trunk, then shoulder, elbow, wrist, finger, hip, knee, ankle and toe, with
/// `{}` for the side, and names of the sides.
type Table = ([&'static str; 4], [&'static str; 8], [[&'static str; 2]; 2]);

/// CMU's names in conversions for Poser and DAZ, MotionBuilder and 3ds Max, and Mixamo's.
const TABLES: [Table; 5] = [
    (
        ["hip", "abdomen", "chest", "head"],
        ["{}Shldr", "{}ForeArm", "{}Hand", "{}Mid1", "{}Thigh", "{}Shin", "{}Foot", "{}Toe"],
        [["l", "l"], ["r", "r"]],
    ),
    (
        ["Hips", "Chest", "Chest2", "Head"],
        ["{}Shoulder", "{}Elbow", "{}Wrist", "{1}Fingers", "{}Hip", "{}Knee", "{}Ankle", "{}Toe"],
        [["Left", "L"], ["Right", "R"]],
    ),
    (
        ["Hips", "LowerBack", "Spine1", "Head"],
        ["{}Arm", "{}ForeArm", "{}Hand", "{}FingerBase", "{}UpLeg", "{}Leg", "{}Foot", "{}ToeBase"],
        [["Left", "L"], ["Right", "R"]],
    ),
    (
        ["Hips", "Spine", "Spine2", "Head"],
        ["{}Arm", "{}ForeArm", "{}Hand", "{}HandMiddle1", "{}UpLeg", "{}Leg", "{}Foot", "{}ToeBase"],
        [["Left", "Left"], ["Right", "Right"]],
    ),
    (
        ["Hips", "Spine", "Spine1", "Head"],
        ["{}Arm", "{}ForeArm", "{}Hand", "{}HandIndex1", "{}UpLeg", "{}Leg", "{}Foot", "{}ToeBase"],
        [["Left", "Left"], ["Right", "Right"]],
    ),
];

impl Naming {
    /// The known naming that a skeleton follows: CMU in three conversions, or Mixamo.
    ///
    /// # Errors
    /// [`PoseError::UnknownNames`] where it follows none.
    pub fn of(skeleton: &Skeleton) -> Result<Self, PoseError> {
        let known = TABLES.iter().map(Self::from_table);
        known.into_iter().find(|naming| naming.missing(skeleton).is_none()).ok_or_else(|| {
            let names: Vec<&str> = skeleton.joints.iter().take(12).map(|joint| joint.name.as_str()).collect();
            PoseError::UnknownNames(names.join(", "))
        })
    }

    /// A JSON object with an entry for each of [`BONES`], `{"joint": …, "end": …}`.
    ///
    /// # Errors
    /// Where it is no such object, has other bones or lacks one.
    pub fn from_json(bytes: &[u8]) -> Result<Self, PoseError> {
        let mut map: BTreeMap<String, BoneNames> =
            serde_json::from_slice(bytes).map_err(|error| PoseError::NamesSyntax(error.to_string()))?;
        let bones = BONES
            .iter()
            .map(|&bone| map.remove(bone).ok_or(PoseError::MissingBone(bone)))
            .collect::<Result<Vec<_>, _>>()?;
        if let Some((name, _)) = map.pop_first() {
            return Err(PoseError::UnknownBone(name));
        }
        for (bone, names) in BONES.iter().zip(&bones).skip(4) {
            let limb = ["upper arm", "forearm", "thigh", "shin"].iter().any(|limb| bone.ends_with(limb));
            if limb && names.end.is_none() {
                return Err(PoseError::NoEnd(bone));
            }
        }
        Ok(Self { bones })
    }

    /// The joint that turns each of [`BONES`], and that at its end, by number.
    ///
    /// # Errors
    /// [`PoseError::MissingJoint`] where the skeleton lacks one.
    pub fn joints(&self, skeleton: &Skeleton) -> Result<Vec<(usize, Option<usize>)>, PoseError> {
        if let Some(joint) = self.missing(skeleton) {
            return Err(PoseError::MissingJoint(joint.to_owned()));
        }
        let number = |name: &str| skeleton.joints.iter().position(|joint| bare(&joint.name) == bare(name));
        let of = |bone: &BoneNames| (number(&bone.joint).unwrap_or(0), bone.end.as_deref().and_then(number));
        Ok(self.bones.iter().map(of).collect())
    }

    /// The first name that a skeleton needs and lacks. Hands and feet can do without ends.
    fn missing(&self, skeleton: &Skeleton) -> Option<&str> {
        let there = |name: &str| skeleton.joints.iter().any(|joint| bare(&joint.name) == bare(name));
        BONES.iter().zip(&self.bones).find_map(|(bone, names)| {
            let optional = bone.ends_with("hand") || bone.ends_with("foot");
            let end = names.end.as_deref().filter(|_| !optional);
            [Some(names.joint.as_str()), end].into_iter().flatten().find(|name| !there(name))
        })
    }

    fn from_table((trunk, limbs, sides): &Table) -> Self {
        let alone = |name: &&str| BoneNames { joint: (*name).to_owned(), end: None };
        let mut bones: Vec<BoneNames> = trunk.iter().map(alone).collect();
        for [side, other] in sides {
            let name = |k: usize| limbs[k].replace("{}", side).replace("{1}", other);
            for (joint, end) in [(0, 1), (1, 2), (2, 3), (4, 5), (5, 6), (6, 7)] {
                bones.push(BoneNames { joint: name(joint), end: Some(name(end)) });
            }
        }
        Self { bones }
    }
}

/// A name without what exporters put before a colon.
fn bare(name: &str) -> &str {
    name.rsplit(':').next().unwrap_or(name)
}
