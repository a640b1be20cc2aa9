//! The pictures that materials name: read from beside a model, and put beside an output.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ffi::OsStr;
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cager_geometry::surface::{MOST_PICTURES, Picture, Surface, TILES, tile};

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
    let names: Vec<String> = surface.picture_names().map(str::to_owned).collect();
    for name in names {
        if !known.insert(name.clone()) {
            continue;
        }
        for (path, file) in files(&name, folder) {
            if surface.pictures.len() == MOST_PICTURES {
                let what = format!("more than {MOST_PICTURES} pictures are not taken in, such as {}", file.display());
                warnings.push(format!("{}: {what}", model.display()));
                return warnings;
            }
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
    if is_picture(file, &bytes) { Ok(bytes) } else { Err("it is no picture that is known".to_owned()) }
}

/// Whether a file of this name has the bytes of a picture.
pub(crate) fn is_picture(file: &Path, bytes: &[u8]) -> bool {
    let is_targa = || file.extension().is_some_and(|found| found.eq_ignore_ascii_case("tga")) && bytes.len() > 18;
    SIGNATURES.iter().any(|(at, signature)| bytes.get(*at..).is_some_and(|b| b.starts_with(signature))) || is_targa()
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
    let Some((before, after)) = path.split_once(TILES) else { return one() };
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

/// Names the pictures of a surface as files in `folder`, equal ones as one, and takes their bytes by the names there.
pub(crate) fn rename(surface: &mut Surface, folder: &str) -> BTreeMap<String, Arc<[u8]>> {
    let pictures = std::mem::take(&mut surface.pictures);
    let bytes: BTreeMap<&str, &Arc<[u8]>> = pictures.iter().map(|found| (found.path.as_str(), &found.bytes)).collect();
    let (mut files, mut renamed) = (Files::default(), BTreeMap::new());
    for path in surface.picture_names() {
        if renamed.contains_key(path) {
            continue;
        }
        let name = match bytes.get(path) {
            Some(bytes) => Some(files.add(path, bytes)),
            None if path.contains(TILES) => {
                let is_tile = |found: &&Picture| tile(path, &found.path).is_some();
                files.add_tiles(path, &pictures.iter().filter(is_tile).collect::<Vec<_>>())
            }
            None => None,
        };
        renamed.extend(name.map(|name| (path.to_owned(), format!("{folder}/{name}"))));
    }
    for texture in surface.materials.iter_mut().flat_map(|material| &mut material.textures) {
        for path in std::iter::once(&mut texture.path).chain(&mut texture.frames) {
            if let Some(name) = renamed.get(path) {
                path.clone_from(name);
            }
        }
    }
    files.files
}

/// Files in one folder, by their names.
#[derive(Default)]
struct Files {
    files: BTreeMap<String, Arc<[u8]>>,
    /// Names by where the bytes lie, so that those of many names are looked at once.
    by_place: HashMap<Place, String>,
    by_bytes: HashMap<Arc<[u8]>, String>,
    /// Names of tiles by their numbers and where their bytes lie.
    by_tiles: HashMap<Vec<(String, Place)>, String>,
}

/// Where bytes lie, and how many they are.
type Place = (usize, usize);

fn place_of(bytes: &Arc<[u8]>) -> Place {
    (bytes.as_ptr().addr(), bytes.len())
}

impl Files {
    /// The name of the file with these bytes; of a new one that of `path`, unless another one has it.
    fn add(&mut self, path: &str, bytes: &Arc<[u8]>) -> String {
        let place = place_of(bytes);
        if let Some(name) = self.by_place.get(&place).or_else(|| self.by_bytes.get(bytes)) {
            return name.clone();
        }
        let name = plain(path.rsplit(['/', '\\']).next().unwrap_or_default());
        let (stem, extension) =
            name.rsplit_once('.').map_or((name.as_str(), String::new()), |(stem, end)| (stem, format!(".{end}")));
        let numbered = (1..).map(|k| if k == 1 { name.clone() } else { format!("{stem}_{k}{extension}") });
        let name = numbered.into_iter().find(|name| !self.files.contains_key(name)).unwrap_or_default();
        self.files.insert(name.clone(), Arc::clone(bytes));
        self.by_bytes.insert(Arc::clone(bytes), name.clone());
        self.by_place.insert(place, name.clone());
        name
    }

    /// The name of these tiles of `path`, whose numbers are in the names of their files; none where they are too many.
    fn add_tiles(&mut self, path: &str, tiles: &[&Picture]) -> Option<String> {
        let is_fit = !tiles.is_empty() && self.files.len() + tiles.len() <= MOST_PICTURES;
        let (before, after) = path.split_once(TILES).filter(|_| is_fit)?;
        let of_tile = |found: &Picture| tile(path, &found.path).unwrap_or_default().to_owned();
        let places = tiles.iter().map(|found| (of_tile(found), place_of(&found.bytes))).collect::<Vec<_>>();
        if let Some(name) = self.by_tiles.get(&places) {
            return Some(name.clone());
        }
        let before = harmless(before.rsplit(['/', '\\']).next().unwrap_or_default().trim_start_matches('.'));
        let after = harmless(after);
        let numbered = |number: u32| if number == 1 { before.clone() } else { format!("{number}_{before}") };
        let name = |number, of_tile: &str| format!("{}{of_tile}{after}", numbered(number));
        let is_free = |number: &u32| places.iter().all(|(tile, _)| !self.files.contains_key(&name(*number, tile)));
        let number = (1..).find(is_free)?;
        let bytes = tiles.iter().map(|found| Arc::clone(&found.bytes));
        self.files.extend(places.iter().map(|(tile, _)| name(number, tile)).zip(bytes));
        self.by_tiles.insert(places, name(number, TILES));
        Some(name(number, TILES))
    }
}

/// A name that any file system has, and that hides nothing.
fn plain(name: &str) -> String {
    let name = name.trim_start_matches('.');
    let (stem, end) = name.rsplit_once('.').unwrap_or((name, ""));
    let (stem, end) = (harmless(stem), harmless(end).chars().take(8).collect::<String>());
    match (stem.is_empty(), end.is_empty()) {
        (true, true) => "picture".to_owned(),
        (_, true) => stem,
        _ => format!("{stem}.{end}"),
    }
}

/// The beginning of a text, with `_` for what names of files should not have.
fn harmless(text: &str) -> String {
    const LONGEST: usize = 60;
    let is_odd = |c: char| {
        c.is_control()
            || "<>:\"|?*%/\\".contains(c)
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    text.chars().map(|c| if is_odd(c) { '_' } else { c }).take(LONGEST).collect()
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
    use super::*;
    use cager_geometry::surface::{Channel, Material, Texture};

    /// The names that textures of these names get, and the files.
    fn renamed(names: &[&str], pictures: &[(&str, &[u8])]) -> (Vec<String>, Vec<(String, Vec<u8>)>) {
        let textures = names.iter().map(|&name| Texture::new(Channel::BaseColor, name)).collect();
        let picture = |&(path, bytes): &(&str, &[u8])| Picture { path: path.to_owned(), bytes: Arc::from(bytes) };
        let mut surface = Surface {
            materials: vec![Material { textures, ..Material::default() }],
            pictures: pictures.iter().map(picture).collect(),
            ..Surface::default()
        };
        let files = rename(&mut surface, "t").into_iter().map(|(name, bytes)| (name, bytes.to_vec())).collect();
        (surface.picture_names().map(str::to_owned).collect(), files)
    }

    #[test]
    fn equal_pictures_are_one_file_and_others_of_a_name_are_numbered() {
        let given: [(&str, &[u8]); 5] =
            [("a/x.png", b"1"), ("b/y.png", b"1"), ("c/x.png", b"2"), ("d/../x.png", b"3"), ("unnamed.png", b"4")];
        let names = ["a/x.png", "b/y.png", "c/x.png", "d/../x.png", "missing.png"];
        let (names, files) = renamed(&names, &given);
        assert_eq!(names, ["t/x.png", "t/x.png", "t/x_2.png", "t/x_3.png", "missing.png"]);
        let named = |name: &str, bytes: &[u8]| (name.to_owned(), bytes.to_vec());
        assert_eq!(files, [named("x.png", b"1"), named("x_2.png", b"2"), named("x_3.png", b"3")]);
    }

    #[test]
    fn tiles_keep_their_numbers_even_where_they_are_equal() {
        let given: [(&str, &[u8]); 4] =
            [("a/s.1001.png", b"1"), ("a/s.1002.png", b"1"), ("b/s.1001.png", b"2"), ("c/s.1001.png", b"2")];
        let (names, files) = renamed(&["a/s.<UDIM>.png", "b/s.<UDIM>.png"], &given);
        assert_eq!(names, ["t/s.<UDIM>.png", "t/2_s.<UDIM>.png"]);
        let files: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(files, ["2_s.1001.png", "s.1001.png", "s.1002.png"]);
    }
}
