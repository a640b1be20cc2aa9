//! Scenes from bytes, and at a time, within a limit of memory.

use std::fs::File;
use std::path::{Path, PathBuf};

use cager_geometry::units::{Units, Up};
use ufbx::{
    AllocatorOpts, Anim, CoordinateAxes, CoordinateAxis, ErrorType, EvaluateOpts, FileFormat, IndexErrorHandling,
    LoadOpts, MirrorAxis, OpenFileCb, OpenFileInfo, OpenFileType, SceneRoot, SceneSettings, Stream,
};

use crate::error::Fault;
use crate::signature::Signature;

/// Bytes that a scene may take, once for good and once while it is read: so many whatever the file
/// is, and so many for each byte of it, as files are packed.
const FIXED: usize = 32 << 20;
const PER_BYTE: usize = 16;
/// Nodes above one another.
const DEEPEST: u32 = 1 << 10;

/// A scene as it is stored.
pub(super) struct Scene {
    pub(super) root: SceneRoot,
    pub(super) units: Units,
    /// What the user should know of how it is read.
    pub(super) note: Option<String>,
    limit: usize,
    /// Where geometry caches are.
    folder: Option<PathBuf>,
}

impl Scene {
    /// With the pictures that lie in it, where they are wanted.
    pub(super) fn load(bytes: &[u8], folder: Option<&Path>, has_pictures: bool) -> Result<Self, Fault> {
        let limit = FIXED.saturating_add(PER_BYTE.saturating_mul(bytes.len()));
        let load = |axes: Option<CoordinateAxes>| {
            let open = |path: &str, info: &OpenFileInfo| beside(folder, path, info);
            let options = LoadOpts {
                temp_allocator: allocator(limit),
                result_allocator: allocator(limit),
                file_format: FileFormat::Fbx,
                ignore_embedded: !has_pictures,
                skip_mesh_parts: true,
                // What is not there is told from what is.
                index_error_handling: IndexErrorHandling::NoIndex,
                use_blender_pbr_material: true,
                load_external_files: folder.is_some(),
                ignore_missing_external_files: true,
                node_depth_limit: DEEPEST,
                open_file_cb: OpenFileCb::Ref(&open),
                target_axes: axes.unwrap_or_default(),
                handedness_conversion_axis: axes.map_or(MirrorAxis::None, |_| MirrorAxis::X),
                ..LoadOpts::default()
            };
            ufbx::load_memory(bytes, options).map_err(|error| match Signature::other_than("fbx", bytes) {
                Some(other) => Fault::damaged(other),
                None => fault(&error, limit),
            })
        };
        let mut root = load(None)?;
        let (mut note, mut units) = (None, units(&root.settings));
        if !is_upright(root.settings.axes) {
            drop(root);
            root = load(Some(ufbx::axes_right_handed_y_up()))?;
            units.up = Some(Up::Y);
            note = Some("is not right-handed with Y or Z up, and is turned to Y up".to_owned());
        }
        Ok(Self { root, units, note, limit, folder: folder.map(Path::to_owned) })
    }

    /// All of it as an animation moves it.
    pub(super) fn at(&self, anim: &Anim, time: f64) -> Result<SceneRoot, Fault> {
        let open = |path: &str, info: &OpenFileInfo| beside(self.folder.as_deref(), path, info);
        let options = EvaluateOpts {
            temp_allocator: allocator(self.limit),
            result_allocator: allocator(self.limit),
            evaluate_skinning: true,
            evaluate_caches: self.folder.is_some(),
            load_external_files: self.folder.is_some(),
            open_file_cb: OpenFileCb::Ref(&open),
            ..EvaluateOpts::default()
        };
        ufbx::evaluate_scene(&self.root, anim, time, options).map_err(|error| fault(&error, self.limit))
    }
}

fn allocator(memory_limit: usize) -> AllocatorOpts {
    AllocatorOpts { memory_limit, ..AllocatorOpts::default() }
}

/// A file of a geometry cache, by its name alone, wherever it was when the scene was exported.
fn beside(folder: Option<&Path>, path: &str, info: &OpenFileInfo) -> Option<Stream> {
    let name = path.rsplit(['/', '\\']).next().filter(|name| !matches!(*name, "" | "." | ".."))?;
    let path = folder.filter(|_| info.type_ == OpenFileType::GeometryCache)?.join(name);
    let is_plain = path.metadata().is_ok_and(|found| found.is_file());
    File::open(path).ok().filter(|_| is_plain).map(Stream::File)
}

/// Whether axes are right-handed with Y or Z up, or say nothing.
fn is_upright(axes: CoordinateAxes) -> bool {
    let axis = |axis: CoordinateAxis| (axis as usize / 2, 1 - 2 * (axis as i32 % 2));
    let [(right, a), (up, b), (front, c)] = [axes.right, axes.up, axes.front].map(axis);
    let is_even = (right + 1) % 3 == up && (up + 1) % 3 == front;
    let is_right_handed = a * b * c == if is_even { 1 } else { -1 };
    let is_up = matches!(axes.up, CoordinateAxis::PositiveY | CoordinateAxis::PositiveZ);
    is_right_handed && is_up || !ufbx::coordinate_axes_valid(axes)
}

fn units(settings: &SceneSettings) -> Units {
    let up = match settings.axes.up {
        CoordinateAxis::PositiveY => Some(Up::Y),
        CoordinateAxis::PositiveZ => Some(Up::Z),
        _ => None,
    };
    Units { up, metres_per_unit: Some(settings.unit_meters).filter(|&unit| Units::is_length(unit)) }
}

fn fault(error: &ufbx::Error, limit: usize) -> Fault {
    let what = &error.description;
    match error.type_ {
        ErrorType::MemoryLimit | ErrorType::AllocationLimit | ErrorType::OutOfMemory => Fault::unsupported(format!(
            "takes more than {} MiB, far more than its size; export the mesh as USD or Alembic",
            limit >> 20
        )),
        ErrorType::NodeDepthLimit => {
            Fault::unsupported(format!("has more than {DEEPEST} nodes above one another; export the mesh alone"))
        }
        ErrorType::UnsupportedVersion => {
            Fault::unsupported("is of a version of FBX that is not read; export it as FBX 2010 or later")
        }
        ErrorType::UnrecognizedFileFormat => Fault::damaged("does not begin as a file of FBX does; export it again"),
        ErrorType::Unknown => {
            Fault::damaged("is not whole: a number in it names what is not there, or was cut; copy or export it again")
        }
        _ => Fault::damaged(format!("is not whole as FBX ({what}); copy or export it again")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_of_programs_are_upright_and_others_are_not() {
        use CoordinateAxis::{NegativeY, NegativeZ, PositiveX, PositiveY, PositiveZ};
        let is_upright = |right, up, front| is_upright(CoordinateAxes { right, up, front });
        assert!(is_upright(PositiveX, PositiveY, PositiveZ), "Maya and Blender");
        assert!(is_upright(PositiveX, PositiveZ, NegativeY), "3ds Max");
        assert!(!is_upright(PositiveX, PositiveY, NegativeZ), "left-handed");
        assert!(!is_upright(PositiveY, PositiveX, NegativeZ), "X up");
    }
}
