//! Every file format of meshes and captures, for people who choose one.

/// What can be done with files of a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Listed {
    /// The file name extension, without the dot.
    pub extension: &'static str,
    /// What it is called.
    pub name: &'static str,
    /// Whether files are read.
    pub read: bool,
    /// Whether files are written.
    pub written: bool,
    /// Whether one file holds all frames of a capture.
    pub animated: bool,
    /// What files say of units, axes and times.
    pub says: &'static str,
}

/// All formats: those of one mesh first.
pub const FORMATS: &[Listed] = &[
    still("obj", "Wavefront OBJ", true),
    still("ply", "Polygon File Format", true),
    still("off", "Object File Format", true),
    still("stl", "Stereolithography", true),
    animated("npy", "NumPy array", true, "nothing"),
    animated("npz", "NumPy archive", false, "frame rate"),
    animated("pc2", "point cache of 3ds Max and Blender", true, "frame numbers"),
    animated("mdd", "point cache of LightWave", true, "times"),
    animated("mcx", "geometry cache of Maya", true, "frame rate, times"),
    animated("mc", "the same, older", true, "frame rate, times"),
    animated("abc", "Alembic (Ogawa)", true, "frame rate, times"),
    animated("usdc", "Universal Scene Description, binary", true, "unit, up axis, frame rate, times"),
    animated("usdz", "the same as a package", true, "unit, up axis, frame rate, times"),
    animated("usda", "the same as text", false, "unit, up axis, frame rate, times"),
    animated("usd", "the same, binary", true, "unit, up axis, frame rate, times"),
    animated("glb", "binary glTF", true, "metres, Y up, times"),
    animated("gltf", "the same as text and files", true, "metres, Y up, times"),
    Listed {
        read: cfg!(feature = "fbx"),
        ..animated("fbx", "FBX, binary and as text", false, "unit, up axis, frame rate, times")
    },
    Listed { read: false, ..animated("vat", "animation textures (OpenVAT)", true, "frame rate") },
];

const fn still(extension: &'static str, name: &'static str, written: bool) -> Listed {
    Listed { extension, name, read: true, written, animated: false, says: "nothing" }
}

const fn animated(extension: &'static str, name: &'static str, written: bool, says: &'static str) -> Listed {
    Listed { extension, name, read: true, written, animated: true, says }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CacheFormat, MeshFormat};

    #[test]
    fn every_format_that_is_read_is_listed() {
        let listed =
            |animated: bool| FORMATS.iter().filter(move |f| f.read && f.animated == animated).map(|f| f.extension);
        // Of glTF one mesh may be read, and all frames of a capture.
        let meshes = MeshFormat::STILL.into_iter().filter(|&format| format != MeshFormat::Glb);
        assert_eq!(listed(false).collect::<Vec<_>>(), meshes.map(MeshFormat::extension).collect::<Vec<_>>());
        let caches: Vec<_> = listed(true).filter(|&extension| extension != "npz").collect();
        let with_fbx = |format: &CacheFormat| cfg!(feature = "fbx") || *format != CacheFormat::Fbx;
        let all = CacheFormat::ALL.into_iter().filter(with_fbx);
        assert_eq!(caches, all.map(CacheFormat::extension).collect::<Vec<_>>());
    }
}
