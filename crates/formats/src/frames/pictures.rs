//! Pictures of materials that each file of a capture names anew, in a file of materials of its own.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use cager_geometry::surface::{Channel, Material};

use super::PictureSequence;
use crate::mesh::{libraries_of, materials_of};

/// The pictures of OBJ files with different files of materials: those of a material are found by its
/// name, or where there is one alone. Where a file names none, the one before stays.
pub(super) fn of_files(files: &[PathBuf]) -> Vec<PictureSequence> {
    let libraries: Vec<Vec<PathBuf>> = files.iter().map(|file| libraries_of(file)).collect();
    if libraries.windows(2).all(|pair| pair[0] == pair[1]) {
        return Vec::new();
    }
    let mut found: HashMap<(String, Channel), Vec<String>> = HashMap::new();
    let mut only = None;
    for (frame, (file, libraries)) in files.iter().zip(&libraries).enumerate() {
        let materials: Vec<Material> = libraries.iter().flat_map(|library| materials_of(library)).collect();
        if frame == 0
            && let [material] = &materials[..]
        {
            only = Some(material.name.clone());
        }
        let folder = file.parent().unwrap_or(Path::new(""));
        let is_only = materials.len() == 1;
        for material in materials {
            let name = only.clone().filter(|_| is_only).unwrap_or(material.name);
            for texture in material.textures {
                let path = named_in(folder, &texture.path);
                let paths = found.entry((name.clone(), texture.channel)).or_default();
                // Of frames before the first one that has it, that one.
                let before = paths.last().unwrap_or(&path).clone();
                paths.resize(frame.max(paths.len()), before);
                if paths.len() == frame {
                    paths.push(path);
                }
            }
        }
    }
    let differs = |paths: &Vec<String>| paths.windows(2).any(|pair| pair[0] != pair[1]);
    let sequences = found.into_iter().filter(|(_, paths)| differs(paths));
    sequences.map(|((material, channel), paths)| PictureSequence { material, place: None, channel, paths }).collect()
}

/// A name of a file in a folder as seen from where the folder is named.
pub(crate) fn named_in(folder: &Path, path: &str) -> String {
    folder.join(path).to_string_lossy().into_owned()
}
