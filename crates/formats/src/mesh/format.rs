//! Formats of mesh files, by the extensions of their names.

use std::path::Path;

use crate::error::{Error, Fault};

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// Polygon File Format, also called Stanford: ASCII or binary.
    Ply,
    /// Object File Format, ASCII.
    Off,
    /// Stereolithography: ASCII or binary. Corners with the same position become one point.
    Stl,
    /// Binary glTF 2.0.
    Glb,
    /// Alembic in the Ogawa container: the first frame of its mesh.
    Abc,
    /// Universal Scene Description in binary: the first frame of its mesh.
    Usdc,
    /// The same as a package.
    Usdz,
    /// The same as text.
    Usda,
    /// Universal Scene Description of any kind.
    Usd,
    /// glTF 2.0 as text, with its data in it or in files beside it.
    Gltf,
    /// FBX: the first frame of its meshes; not written.
    Fbx,
}

impl MeshFormat {
    /// All formats.
    pub const ALL: [Self; 12] = {
        use MeshFormat::*;
        [Obj, Ply, Off, Stl, Glb, Abc, Usdc, Usdz, Usda, Usd, Gltf, Fbx]
    };

    /// Formats of one mesh that stands still, of which each file of a folder may be a frame.
    pub(crate) const STILL: [Self; 5] = [Self::Obj, Self::Ply, Self::Off, Self::Stl, Self::Glb];

    /// The file name extension, without the dot.
    pub fn extension(self) -> &'static str {
        ["obj", "ply", "off", "stl", "glb", "abc", "usdc", "usdz", "usda", "usd", "gltf", "fbx"][self as usize]
    }

    /// The format that the extension of `path` stands for, in upper or lower case.
    ///
    /// # Errors
    /// [`Error::Unsupported`] lists the extensions that are read.
    pub fn from_path(path: &Path) -> Result<Self, Error> {
        if let Some(format) = Self::among(&Self::ALL, path) {
            return Ok(format);
        }
        let found = match path.extension() {
            Some(found) => format!(
                ".{} is not a mesh format that is read; convert it to one of {}",
                found.display(),
                extensions(&Self::ALL)
            ),
            None if path.is_dir() => "is a folder; name a file of a mesh".to_owned(),
            None => format!("has no file name extension; give it one of {}", extensions(&Self::ALL)),
        };
        Err(Fault::unsupported(found).at(path))
    }

    /// Whether a file has a whole scene, which may have several meshes and other files.
    pub(super) fn is_scene(self) -> bool {
        !Self::STILL.contains(&self)
    }

    /// The format of a file of one mesh that stands still, by its name.
    pub(crate) fn guess(path: &Path) -> Option<Self> {
        Self::among(&Self::STILL, path)
    }

    fn among(formats: &[Self], path: &Path) -> Option<Self> {
        let found = path.extension()?;
        formats.iter().copied().find(|format| found.eq_ignore_ascii_case(format.extension()))
    }
}

/// Extensions as a list for messages.
pub(crate) fn extensions(formats: &[MeshFormat]) -> String {
    let list: Vec<_> = formats.iter().map(|format| format!(".{}", format.extension())).collect();
    list.join(" ")
}
