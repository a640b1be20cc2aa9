//! How quads make a cage: tubes between neighbours, caps at the ends, joints of limbs and trunk.

use std::sync::OnceLock;

/// Quads of a rig.
pub const QUADS: usize = 21;
/// Vertices of its cage.
pub const CAGE_VERTICES: usize = 4 * QUADS + 2;
/// Triangles of its cage: `2 (V − 2)` of a closed surface without handles.
pub const CAGE_FACES: usize = 168;

/// Names of the quads, in their order.
pub const QUAD_NAMES: [&str; QUADS] = [
    "pelvis",
    "waist",
    "chest",
    "neck",
    "head",
    "left shoulder",
    "left elbow",
    "left wrist",
    "left hand",
    "left hip",
    "left knee",
    "left ankle",
    "left toe",
    "right shoulder",
    "right elbow",
    "right wrist",
    "right hand",
    "right hip",
    "right knee",
    "right ankle",
    "right toe",
];

pub(crate) const PELVIS: usize = 0;
pub(crate) const WAIST: usize = 1;
pub(crate) const CHEST: usize = 2;
pub(crate) const NECK: usize = 3;
pub(crate) const HEAD: usize = 4;
/// The first quad of the left arm; shoulder, elbow, wrist and hand follow each other.
pub(crate) const LEFT_ARM: usize = 5;
/// The first quad of the left leg; hip, knee, ankle and toe follow each other.
pub(crate) const LEFT_LEG: usize = 9;
/// From a quad on the left to that on the right.
pub(crate) const TO_RIGHT: usize = 8;

/// Bones: pairs of quads whose joints stay at their distance.
pub(crate) const BONES: [[usize; 2]; 20] = [
    [PELVIS, WAIST],
    [WAIST, CHEST],
    [CHEST, NECK],
    [NECK, HEAD],
    [CHEST, 5],
    [5, 6],
    [6, 7],
    [7, 8],
    [PELVIS, 9],
    [9, 10],
    [10, 11],
    [11, 12],
    [CHEST, 13],
    [13, 14],
    [14, 15],
    [15, 16],
    [PELVIS, 17],
    [17, 18],
    [18, 19],
    [19, 20],
];

/// The quad that a vertex of the cage belongs to.
pub fn owner(vertex: usize) -> usize {
    if vertex < 4 * QUADS { vertex / 4 } else { PELVIS }
}

/// Triangles of the cage, closed and facing outwards.
pub fn triangles() -> &'static [[u32; 3]; CAGE_FACES] {
    static TRIANGLES: OnceLock<[[u32; 3]; CAGE_FACES]> = OnceLock::new();
    TRIANGLES.get_or_init(|| faces().try_into().unwrap_or_else(|faces: Vec<_>| unreachable!("{} faces", faces.len())))
}

fn ring(quad: usize) -> [u32; 4] {
    [0, 1, 2, 3].map(|k| (4 * quad + k) as u32)
}

/// All triangles, facing outwards.
fn faces() -> Vec<[u32; 3]> {
    let [front, back] = [4 * QUADS as u32, 4 * QUADS as u32 + 1];
    let [head, neck, chest, pelvis] = [HEAD, NECK, CHEST, PELVIS].map(ring);
    // Corners run from front left to front right, so that this order faces up.
    let mut faces = vec![[head[0], head[2], head[1]], [head[0], head[3], head[2]]];
    tube(&mut faces, pelvis, ring(WAIST), &[]);
    tube(&mut faces, ring(WAIST), chest, &[]);
    tube(&mut faces, chest, neck, &[1, 3]);
    tube(&mut faces, neck, head, &[]);
    faces.extend([[pelvis[1], front, pelvis[0]], [pelvis[3], back, pelvis[2]]]);
    for (side, first) in [(0, 0), (1, TO_RIGHT)] {
        let begun = faces.len();
        let [near_front, near_back] = if side == 0 { [0, 3] } else { [1, 2] };
        let shoulder = [chest[near_front], chest[near_back], neck[near_back], neck[near_front]];
        limb(&mut faces, shoulder, LEFT_ARM + first);
        let groin = [pelvis[near_front], front, back, pelvis[near_back]];
        limb(&mut faces, groin, LEFT_LEG + first);
        if side == 0 {
            // Rings run the other way about the limbs of this side.
            faces[begun..].iter_mut().for_each(|face| face.swap(1, 2));
        }
    }
    faces
}

/// Four quads one behind the other, and the cap of the last.
fn limb(faces: &mut Vec<[u32; 3]>, start: [u32; 4], first: usize) {
    let mut from = start;
    for quad in first..first + 4 {
        tube(faces, from, ring(quad), &[]);
        from = ring(quad);
    }
    faces.extend([[from[0], from[2], from[1]], [from[0], from[3], from[2]]]);
}

/// The sides between two rings, but for some.
fn tube(faces: &mut Vec<[u32; 3]>, a: [u32; 4], b: [u32; 4], without: &[usize]) {
    for i in (0..4).filter(|i| !without.contains(i)) {
        let j = (i + 1) % 4;
        faces.extend([[a[i], b[j], a[j]], [a[i], b[i], b[j]]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_geometry::topology::edges;

    #[test]
    fn the_cage_of_a_rig_is_closed_and_consistently_oriented() {
        let faces = triangles();
        assert_eq!((faces.len(), CAGE_VERTICES), (168, 86));
        assert!(edges(faces).values().all(|users| users.len() == 2 && users[0].1 != users[1].1));
        let mut used = [false; CAGE_VERTICES];
        faces.as_flattened().iter().for_each(|&v| used[v as usize] = true);
        assert!(used.iter().all(|&used| used));
        assert_eq!(CAGE_VERTICES + faces.len(), edges(faces).len() + 2, "Euler");
    }
}
