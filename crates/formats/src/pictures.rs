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
    let textures = || surface.materials.iter().flat_map(|material| &material.textures);
    let named: BTreeSet<String> = textures().map(|texture| texture.path.clone()).collect();
    let pictures = std::mem::take(&mut surface.pictures);
    let mut renamed = BTreeMap::new();
    for path in named {
        let (before, after) = path.split_once("<UDIM>").unwrap_or((&path, ""));
        // Of a picture in tiles all, with what stands between the rest of the name.
        let tile = |found: &Picture| {
            let tile = found.path.strip_prefix(before)?.strip_suffix(after)?.to_owned();
            (tile.is_empty() || path.len() > before.len()).then(|| (tile, Arc::clone(&found.bytes)))
        };
        let tiles: Vec<(String, Arc<[u8]>)> = pictures.iter().filter_map(tile).collect();
        if tiles.is_empty() {
            continue;
        }
        let file = before.rsplit(['/', '\\']).next().unwrap_or_default();
        let is_tiled = path.len() > before.len();
        let (stem, end) = match file.rsplit_once('.') {
            Some((stem, end)) if !is_tiled => (stem, format!(".{end}")),
            _ if is_tiled => {
                let stem = file.trim_end_matches(['.', '_', '-']);
                (stem, format!("{}<UDIM>{after}", &file[stem.len()..]))
            }
            _ => (file, String::new()),
        };
        let name = |k: usize, tile: &str| {
            let number = if k == 1 { String::new() } else { format!("_{k}") };
            let placed = |name: &str| name.replace("<UDIM>", tile);
            plain(&placed(&format!("{stem}{number}{end}")))
        };
        let is_free = |k: &usize| {
            let is_other =
                |(tile, bytes): &(String, Arc<[u8]>)| names.get(&name(*k, tile)).is_some_and(|there| there != bytes);
            !tiles.iter().any(is_other)
        };
        let k = (1..).find(is_free).unwrap_or(1);
        let told = name(k, "0000");
        let told = if is_tiled { told.replacen("0000", "<UDIM>", 1) } else { told };
        renamed.insert(path.clone(), format!("{folder}/{told}"));
        tiles.into_iter().for_each(|(tile, bytes)| drop(names.insert(name(k, &tile), bytes)));
    }
    for texture in surface.materials.iter_mut().flat_map(|material| &mut material.textures) {
        if let Some(path) = renamed.get(&texture.path) {
            texture.path.clone_from(path);
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

#[cfg(test)]
mod tests {
    use cager_geometry::surface::{Channel, Material, Texture};

    use super::*;

    #[test]
    fn tiles_of_one_name_in_two_folders_stay_apart() {
        let names = ["a/skin.<UDIM>.png", "b/skin.<UDIM>.png", "b/skin.png", "a/skin.png"];
        let textures = names.map(|path| Texture::new(Channel::BaseColor, path)).to_vec();
        let picture = |path: &str| Picture { path: path.to_owned(), bytes: Arc::from(path.as_bytes()) };
        let files =
            ["a/skin.1001.png", "a/skin.1002.png", "b/skin.1001.png", "b/skin.png", "a/skin.png", "c/other.png"];
        let mut surface = Surface {
            materials: vec![Material { textures, ..Material::default() }],
            pictures: files.map(picture).to_vec(),
            ..Surface::default()
        };
        let found = rename(&mut surface, "out");
        let told: Vec<&str> = surface.materials[0].textures.iter().map(|texture| texture.path.as_str()).collect();
        assert_eq!(told, ["out/skin.<UDIM>.png", "out/skin_2.<UDIM>.png", "out/skin_2.png", "out/skin.png"]);
        let bytes = |name: &str| String::from_utf8_lossy(&found[name]).into_owned();
        assert_eq!((bytes("skin.1002.png"), bytes("skin_2.1001.png")), (files[1].to_owned(), files[2].to_owned()));
        assert_eq!(
            (bytes("skin_2.png"), bytes("skin.png"), found.len()),
            (files[3].to_owned(), files[4].to_owned(), 5)
        );
    }
}
