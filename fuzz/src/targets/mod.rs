//! All targets.

mod alembic;
mod bodies;
mod container;
mod fbx;
mod frames;
mod gltf;
mod meshes;
mod scenes;
mod settings;
mod skeletons;
mod store;
mod usd;

use crate::Target;

/// Everything that reads bytes from outside.
pub const TARGETS: &[Target] = &[
    meshes::OBJ,
    meshes::PLY,
    meshes::OFF,
    meshes::STL,
    meshes::GLB,
    meshes::MTX,
    skeletons::BVH,
    frames::NPY,
    frames::PC2,
    frames::MDD,
    frames::MCX,
    alembic::ABC,
    usd::USDC,
    usd::USDZ,
    usd::USDA,
    gltf::GLB_FRAMES,
    fbx::FBX,
    frames::NPZ,
    container::CONTAINER,
    bodies::RECORD,
    bodies::FRAMES,
    bodies::NEW_SESSION,
    bodies::NEW_CAGE,
    bodies::RANGE,
    settings::TOKENS,
    settings::CONFIG,
    store::SOLVER,
    store::SMALL_FILES,
];

/// Takes a byte off the front.
fn byte(bytes: &mut &[u8]) -> u8 {
    let Some((first, rest)) = bytes.split_first() else { return 0 };
    *bytes = rest;
    *first
}

/// Puts a checksum of some bytes behind them, where there is room.
fn mend(bytes: &mut [u8], from: usize, to: usize, at: usize) {
    if from <= to && to <= bytes.len() && at.checked_add(4).is_some_and(|end| end <= bytes.len()) {
        let crc = crc32c::crc32c(&bytes[from..to]);
        bytes[at..at + 4].copy_from_slice(&crc.to_le_bytes());
    }
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at.checked_add(8)?)?.try_into().ok()?))
}
