//! The pictures that materials name: read from beside a model, and put beside an output.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cager_geometry::surface::{Picture, Surface};

use crate::atomic::{AtomicFile, Target};
use crate::error::{Error, Fault};

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
            match read(&file, MOST_BYTES - total) {
                Ok(bytes) => {
                    total += bytes.len() as u64;
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

/// The bytes of a picture, at most so many: materials of strangers may name any file.
fn read(file: &Path, most: u64) -> Result<Vec<u8>, String> {
    let plain = |cause: std::io::Error| cause.to_string();
    let found = fs::metadata(file).map_err(plain)?;
    if !found.is_file() {
        return Err("it is no file".to_owned());
    }
    if found.len() > most {
        return Err("the pictures are more than 4 GiB with it".to_owned());
    }
    let mut bytes = Vec::new();
    fs::File::open(file).map_err(plain)?.take(most).read_to_end(&mut bytes).map_err(plain)?;
    let has_signature =
        SIGNATURES.iter().any(|(at, signature)| bytes.get(*at..).is_some_and(|b| b.starts_with(signature)));
    let is_targa = file.extension().is_some_and(|found| found.eq_ignore_ascii_case("tga")) && bytes.len() > 18;
    if has_signature || is_targa { Ok(bytes) } else { Err("it is no picture that is known".to_owned()) }
}

/// What pictures begin with, and where: PNG, JPEG, WebP, KTX2, KTX, OpenEXR, TIFF, Radiance, BMP,
/// GIF, DDS, PSD, JPEG 2000, AVIF.
const SIGNATURES: [(usize, &[u8]); 15] = [
    (0, b"\x89PNG"),
    (0, b"\xff\xd8\xff"),
    (8, b"WEBP"),
    (0, b"\xabKTX 20"),
    (0, b"\xabKTX 11"),
    (0, b"\x76\x2f\x31\x01"),
    (0, b"II*\0"),
    (0, b"MM\0*"),
    (0, b"#?R"),
    (0, b"BM"),
    (0, b"GIF8"),
    (0, b"DDS "),
    (0, b"8BPS"),
    (4, b"jP  "),
    (4, b"ftypavif"),
];

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
fn place(output: &Path, is_folder: bool) -> (PathBuf, String) {
    let is_pattern = output.file_name().is_none_or(|name| name.to_string_lossy().contains(['*', '#', '%']));
    let parent = output.parent().unwrap_or(Path::new(""));
    let named = |name: &OsStr| format!("{}_textures", name.to_string_lossy());
    match (is_folder, is_pattern) {
        (false, false) => {
            let name = named(output.file_stem().unwrap_or_default());
            (parent.join(&name), name)
        }
        (true, false) if output.file_name().is_some() => {
            let name = named(output.file_name().unwrap_or_default());
            (parent.join(&name), format!("../{name}"))
        }
        _ => match parent.file_name() {
            Some(folder) => (parent.with_file_name(named(folder)), format!("../{}", named(folder))),
            None => (parent.join("textures"), "textures".to_owned()),
        },
    }
}

/// Names the pictures of a surface as files in `folder`, and takes their bytes by the names there.
pub(crate) fn rename(surface: &mut Surface, folder: &str) -> BTreeMap<String, Arc<[u8]>> {
    let mut names: BTreeMap<String, Arc<[u8]>> = BTreeMap::new();
    let mut renamed = BTreeMap::new();
    let textures = || surface.materials.iter().flat_map(|material| &material.textures);
    let named: BTreeSet<&str> = textures().map(|texture| texture.path.as_str()).collect();
    let tiles: Vec<(&str, &str)> = named.iter().filter_map(|path| path.split_once("<UDIM>")).collect();
    let is_named = |path: &str| {
        named.contains(path) || tiles.iter().any(|(before, after)| path.starts_with(before) && path.ends_with(after))
    };
    let mut pictures = surface.pictures.clone();
    pictures.retain(|picture| is_named(&picture.path));
    surface.pictures = Vec::new();
    for Picture { path, bytes } in pictures {
        let name = plain(path.rsplit(['/', '\\']).next().unwrap_or_default());
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

/// A name that any file system has, and that hides nothing.
fn plain(name: &str) -> String {
    const LONGEST: usize = 60;
    let is_odd = |c: char| {
        c.is_control()
            || "<>:\"|?*%".contains(c)
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    let name: String = name.trim_start_matches('.').chars().map(|c| if is_odd(c) { '_' } else { c }).collect();
    let (stem, end) = name.rsplit_once('.').unwrap_or((&name, ""));
    let stem: String = stem.chars().take(LONGEST).collect();
    let end: String = end.chars().take(8).collect();
    match (stem.is_empty(), end.is_empty()) {
        (true, true) => "picture".to_owned(),
        (_, true) => stem,
        _ => format!("{stem}.{end}"),
    }
}

/// Files to be written beside an output.
pub(crate) struct Beside {
    files: Vec<(PathBuf, Arc<[u8]>)>,
    may_replace: bool,
}

impl Beside {
    /// Names the pictures of a surface as files in a folder beside `output`, and takes their bytes.
    pub(crate) fn of(surface: &mut Surface, target: &Target, is_folder: bool) -> Self {
        let (place, folder) = place(target.path(), is_folder);
        let names = rename(surface, &folder);
        let files = names.into_iter().map(|(name, bytes)| (place.join(name), bytes)).collect();
        Self { files, may_replace: target.replaces() }
    }

    /// Refuses other files of these names, unless files may be replaced.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let is_other = |(path, bytes): &&(PathBuf, Arc<[u8]>)| {
            path.exists() && !fs::read(path).is_ok_and(|there| there[..] == bytes[..])
        };
        match self.files.iter().find(is_other).filter(|_| !self.may_replace) {
            Some((path, _)) => {
                let what =
                    "exists already, with another picture; pass --overwrite to replace it, or choose another output";
                Err(Fault::invalid(what).at(path))
            }
            None => Ok(()),
        }
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
