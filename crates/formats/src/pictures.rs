//! The pictures that materials name: read from beside a model, and put beside an output.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cager_geometry::surface::{Picture, Surface};

use crate::atomic::{AtomicFile, Target};
use crate::error::Error;

/// Bytes that the pictures of a model have at the most.
const MOST_BYTES: u64 = 4 << 30;

/// Reads the pictures that the materials name into the surface, from files beside the one of the
/// model, where it has no bytes of them; says what is not found.
pub fn take_pictures(surface: &mut Surface, model: &Path) -> Vec<String> {
    let folder = model.parent().unwrap_or(Path::new(""));
    let mut known: BTreeSet<String> = surface.pictures.iter().map(|picture| picture.path.clone()).collect();
    let (mut warnings, mut total) = (Vec::new(), 0);
    for texture in surface.materials.iter().flat_map(|material| &material.textures) {
        if !known.insert(texture.path.clone()) {
            continue;
        }
        for (path, file) in files(&texture.path, folder) {
            let length = fs::metadata(&file).map_or(0, |found| found.len());
            let read = || {
                if total + length > MOST_BYTES {
                    Err("are more than 4 GiB with it".to_owned())
                } else {
                    fs::read(&file).map_err(|cause| cause.to_string())
                }
            };
            match read() {
                Ok(bytes) => {
                    total += length;
                    surface.pictures.push(Picture { path, bytes: Arc::from(bytes) });
                }
                Err(cause) => warnings.push(format!(
                    "{}: the picture {} that its materials name is not taken in ({cause})",
                    model.display(),
                    file.display()
                )),
            }
        }
    }
    warnings
}

/// The files of a texture: one, or all tiles of one whose name has `<UDIM>`.
fn files(path: &str, folder: &Path) -> Vec<(String, PathBuf)> {
    let one = || vec![(path.to_owned(), folder.join(path))];
    let Some((before, after)) = path.split_once("<UDIM>") else { return one() };
    let tile = |number: u32| format!("{before}{number}{after}");
    let there = (1001..2000).map(tile).map(|path| (path.clone(), folder.join(path)));
    let there: Vec<_> = there.filter(|(_, file)| file.exists()).collect();
    if there.is_empty() { one() } else { there }
}

/// The folder for the pictures of an output, and how files of the output name it. A folder of files
/// appears as a whole, so that its pictures are beside it.
fn place(output: &Path) -> (PathBuf, String) {
    let is_pattern = output.file_name().is_none_or(|name| name.to_string_lossy().contains(['*', '#', '%']));
    let folder = if output.extension().is_none() {
        output
    } else if is_pattern {
        output.parent().unwrap_or(Path::new(""))
    } else {
        Path::new("")
    };
    let named = |path: &Path| format!("{}_textures", path.file_stem().unwrap_or_default().to_string_lossy());
    match folder.file_name() {
        Some(_) => (folder.with_file_name(named(folder)), format!("../{}", named(folder))),
        None if is_pattern => (PathBuf::from("textures"), "textures".to_owned()),
        None => (output.with_file_name(named(output)), named(output)),
    }
}

/// Names the pictures of a surface as files in `folder`, and takes their bytes by the names there.
pub(crate) fn rename(surface: &mut Surface, folder: &str) -> BTreeMap<String, Arc<[u8]>> {
    let mut names: BTreeMap<String, Arc<[u8]>> = BTreeMap::new();
    let mut renamed = BTreeMap::new();
    for Picture { path, bytes } in std::mem::take(&mut surface.pictures) {
        let name =
            path.rsplit(['/', '\\']).next().filter(|name| !matches!(*name, "" | "." | "..")).unwrap_or("picture");
        let name = name.replace(['\0', ':'], "_");
        let (stem, extension) =
            name.rsplit_once('.').map_or((name.as_str(), String::new()), |(stem, end)| (stem, format!(".{end}")));
        let numbered = (1..).map(|k| if k == 1 { name.clone() } else { format!("{stem}_{k}{extension}") });
        let free = numbered.into_iter().find(|name| names.get(name).is_none_or(|other| *other == bytes));
        let name = free.unwrap_or_else(|| name.clone());
        renamed.insert(path, format!("{folder}/{name}"));
        names.insert(name, bytes);
    }
    for texture in surface.materials.iter_mut().flat_map(|material| &mut material.textures) {
        if let Some(path) = renamed.get(&texture.path) {
            texture.path.clone_from(path);
        } else if let Some((before, after)) = texture.path.split_once("<UDIM>")
            && let Some((_, path)) = renamed.iter().find(|(old, _)| old.starts_with(before) && old.ends_with(after))
        {
            let name = format!("{}<UDIM>{after}", before.rsplit('/').next().unwrap_or_default());
            texture.path = format!("{}/{name}", path.rsplit_once('/').map_or("", |(folder, _)| folder));
        }
    }
    names
}

/// Files to be written beside an output.
pub(crate) struct Beside {
    files: Vec<(PathBuf, Arc<[u8]>)>,
    may_replace: bool,
}

impl Beside {
    /// Names the pictures of a surface as files in a folder beside `output`, and takes their bytes.
    pub(crate) fn of(surface: &mut Surface, target: &Target) -> Self {
        let (place, folder) = place(target.path());
        let names = rename(surface, &folder);
        let files = names.into_iter().map(|(name, bytes)| (place.join(name), bytes)).collect();
        Self { files, may_replace: target.replaces() }
    }

    /// Writes them; those that are there with the same bytes stay as they are.
    ///
    /// # Errors
    /// Another file of a name, unless files may be replaced; the disk.
    pub(crate) fn write(&self) -> Result<(), Error> {
        for (path, bytes) in &self.files {
            if fs::read(path).is_ok_and(|there| there[..] == bytes[..]) {
                continue;
            }
            if let Some(folder) = path.parent() {
                fs::create_dir_all(folder).map_err(|cause| Error::write(folder, cause))?;
            }
            let target = if self.may_replace { Target::Replacing(path.clone()) } else { Target::New(path.clone()) };
            let mut file = AtomicFile::create(&target)?;
            file.write_all(bytes).map_err(|cause| Error::write(path, cause))?;
            file.commit()?;
        }
        Ok(())
    }
}
