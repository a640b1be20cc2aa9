//! What a file is by its first bytes, in words for messages.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::Error;

/// What the first bytes of a file say that it is.
///
/// No capture stored as plain little-endian `f32` begins like any of these: text is told by more
/// bytes than numbers that are all letters could fill, and the other beginnings would be numbers
/// near 1e-30 or 1e30.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Signature {
    /// A file with one of these extensions.
    File(&'static [&'static str]),
    /// The text of a mesh with this extension.
    MeshText(&'static str),
    /// Text that is none of the above.
    Text,
    /// Another program's scene or cache, by its name.
    Scene(&'static str),
    /// Packed, with the program of this name.
    Packed(&'static str),
    /// What may stand in place of any file: what it is, and what to do.
    StandIn(&'static str, &'static str),
}

const WEB_PAGE: Signature = Signature::StandIn("a web page", ", not the file itself; download the file itself");
const UTF16: Signature = Signature::StandIn("text in UTF-16", "; save it as UTF-8, or export it again");
const LFS_POINTER: Signature = Signature::StandIn("a Git LFS pointer", ", not the file itself; run git lfs pull");
const ANNEX_POINTER: Signature = Signature::StandIn("a git-annex pointer", ", not the file itself; run git annex get");

/// Beginnings that need no other look.
const BEGINNINGS: &[(&[u8], Signature)] = &[
    (b"\x93NUMPY", Signature::File(&["npy"])),
    (b"PK\x03\x04", Signature::File(&["npz", "usdz", "zip"])),
    (b"PK\x05\x06", Signature::File(&["npz", "usdz", "zip"])),
    (b"POINTCACHE2", Signature::File(&["pc2"])),
    (b"glTF\x01\0\0\0", Signature::File(&["glb"])),
    (b"glTF\x02\0\0\0", Signature::File(&["glb"])),
    (b"\x89CGR\r\n\x1a\n", Signature::File(&["cager"])),
    (b"Ogawa", Signature::File(&["abc"])),
    (b"\x89HDF\r\n\x1a\n", Signature::Scene("HDF5")),
    (b"PXR-USDC", Signature::File(&["usdc", "usd"])),
    (b"#usda", Signature::File(&["usda", "usd"])),
    (b"Kaydara FBX Binary", Signature::File(&["fbx"])),
    (b"; FBX", Signature::File(&["fbx"])),
    (b"BLENDER", Signature::Scene("Blender")),
    (b"\x28\xb5\x2f\xfd", Signature::Packed("zstd")),
    (b"\xfd7zXZ\0", Signature::Packed("xz")),
    (b"7z\xbc\xaf\x27\x1c", Signature::Packed("7-Zip")),
    (b"version https://git-lfs.github.com/spec/", LFS_POINTER),
    // The name of Git LFS before 2015.
    (b"version https://hawser.github.com/spec/", LFS_POINTER),
    (b"/annex/objects/", ANNEX_POINTER),
    (b"404: Not Found", WEB_PAGE),
];

/// Bytes of a file that are looked at.
const LOOKED_AT: usize = 1024;
/// Bytes that must be letters, digits, punctuation and white space in text.
const MIN_TEXT: usize = 12;

impl Signature {
    /// What a file that begins with these bytes is; a few hundred of them are enough.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let start = &bytes[..bytes.len().min(LOOKED_AT)];
        if let Some(&(_, found)) = BEGINNINGS.iter().find(|(beginning, _)| start.starts_with(beginning)) {
            return Some(found);
        }
        match start {
            [0x1f, 0x8b, 8, 0..0x20, ..] => return Some(Self::Packed("gzip")),
            [b'B', b'Z', b'h', _, b'1', b'A', b'Y', b'&', ..] => return Some(Self::Packed("bzip2")),
            _ if is_utf16(start) => return Some(UTF16),
            _ => {}
        }
        let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start).trim_ascii_start();
        let is_text = |b: &u8| matches!(b, b'\t' | b'\n' | b'\r' | b' '..=b'~') || *b >= 0x80;
        let checked = &text[..text.len().min(64)];
        if checked.len() < MIN_TEXT || !checked[..MIN_TEXT].is_ascii() || !checked.iter().all(is_text) {
            return None;
        }
        let begins = |word: &str| text.get(..word.len()).is_some_and(|t| t.eq_ignore_ascii_case(word.as_bytes()));
        if begins("<!doctype html") || begins("<html") || begins("<head") {
            return Some(WEB_PAGE);
        }
        Some(mesh_text(text).map_or(Self::Text, Self::MeshText))
    }

    /// Why a file named `.extension` is another kind of file, to follow its name.
    pub fn other_than(extension: &str, bytes: &[u8]) -> Option<String> {
        let found = Self::of(bytes)?;
        if extension == "abc" && found == Self::Scene("HDF5") {
            let what = "is an Alembic archive of the old kind, HDF5, which is not read; write it as Ogawa with \
                        abcconvert -toOgawa, or export it again";
            return Some(what.to_owned());
        }
        let is_own = match found {
            Self::File(extensions) => extensions.contains(&extension),
            Self::MeshText(found) => found == extension,
            _ => found == Self::Text,
        };
        found.stand_in().or_else(|| {
            (!is_own)
                .then(|| format!("is not a .{extension} file but {}; rename it, or give the right one", found.noun()))
        })
    }

    /// As [`Self::stand_in`], of a file; `None` too where it cannot be read.
    pub fn stand_in_of(path: &Path) -> Option<Error> {
        let mut start = Vec::new();
        File::open(path).ok()?.take(LOOKED_AT as u64).read_to_end(&mut start).ok()?;
        Self::of(&start)?.stand_in().map(|what| Error::Damaged { path: path.to_owned(), what })
    }

    /// As a noun phrase: `a .npy file`.
    pub fn noun(self) -> String {
        match self {
            Self::File(extensions) => format!("a file of the kind .{}", extensions.join(" or .")),
            Self::MeshText(extension) => format!("a file of the kind .{extension}"),
            Self::Text => "text".to_owned(),
            Self::Scene(name) => format!("a file of {name}"),
            Self::Packed(name) => format!("a file packed with {name}"),
            Self::StandIn(what, _) => what.to_owned(),
        }
    }

    /// For what may stand in place of any file: what it is and what to do.
    pub fn stand_in(self) -> Option<String> {
        match self {
            Self::StandIn(what, cure) => Some(format!("is {what}{cure}")),
            Self::Packed(name) => Some(format!("is packed with {name}; unpack it first")),
            _ => None,
        }
    }
}

/// With or without a mark of byte order. Low byte first, numbers of those bytes would be far below
/// 1e-37; high byte first, it takes several characters to tell them from numbers.
fn is_utf16(start: &[u8]) -> bool {
    let is_character = |b: u8| matches!(b, b'\t' | b'\n' | b'\r' | b' '..=b'~');
    let all = |text: &[u8], low: usize, least: usize| {
        let characters = text.as_chunks::<2>().0;
        characters.len() >= least && characters.iter().take(6).all(|c| is_character(c[low]) && c[1 - low] == 0)
    };
    match start {
        [0xff, 0xfe, text @ ..] => all(text, 0, 1),
        [0xfe, 0xff, text @ ..] => all(text, 1, 4),
        text => all(text, 0, 2) || all(text, 1, 6),
    }
}

/// The mesh format that a text begins as.
fn mesh_text(text: &[u8]) -> Option<&'static str> {
    let line = text.split(|b| b"\r\n".contains(b)).map(<[u8]>::trim_ascii).find(|l| !l.is_empty() && l[0] != b'#')?;
    let word = line.split(u8::is_ascii_whitespace).next()?;
    Some(match word {
        b"ply" => "ply",
        b"v" | b"vn" | b"vt" | b"vp" | b"f" | b"o" | b"g" | b"s" | b"mtllib" | b"usemtl" => "obj",
        _ if word.eq_ignore_ascii_case(b"solid") => "stl",
        _ if is_off(word) => "off",
        _ => return None,
    })
}

/// `OFF`, with letters before it, and the digits that some programs write behind it.
fn is_off(word: &[u8]) -> bool {
    let letters = word.iter().position(u8::is_ascii_digit).map_or(word, |digit| &word[..digit]);
    letters.strip_suffix(b"OFF").is_some_and(|prefix| prefix.iter().all(|b| b"STCN".contains(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_told_by_their_first_bytes() {
        let utf16 = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
        let lfs = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n";
        let cases: &[(&[u8], Option<Signature>)] = &[
            (b"\x93NUMPY\x01\0v\0{'descr'", Some(Signature::File(&["npy"]))),
            (b"PK\x03\x04\x14\0\0\0", Some(Signature::File(&["npz", "usdz", "zip"]))),
            (b"POINTCACHE2\0\x01\0\0\0", Some(Signature::File(&["pc2"]))),
            (b"# a comment\n\nv 0 0 0\n", Some(Signature::MeshText("obj"))),
            (b"v 0.5 1 -2\r\nv 1", Some(Signature::MeshText("obj"))),
            (b"ply\nformat ascii 1.0\n", Some(Signature::MeshText("ply"))),
            (b"OFF490 518 0\n1 2 3\n", Some(Signature::MeshText("off"))),
            (b"solid of some program\n", Some(Signature::MeshText("stl"))),
            (b"glTF\x02\0\0\0\x10\0\0\0", Some(Signature::File(&["glb"]))),
            (lfs.as_bytes(), Some(LFS_POINTER)),
            (b"\n <!DOCTYPE html>\n<html>", Some(WEB_PAGE)),
            (&utf16("\u{feff}v 0 0 0\n"), Some(UTF16)),
            (&utf16("v 0 0 0\n"), Some(UTF16)),
            (b"{\"asset\": {\"version\": 2}}", Some(Signature::Text)),
            (b"short", None),
            (b"", None),
        ];
        for (bytes, found) in cases {
            assert_eq!(Signature::of(bytes), *found, "{}", String::from_utf8_lossy(bytes));
        }
    }

    #[test]
    fn numbers_are_no_file() {
        // Among them such as begin with the bytes of a mark of byte order, and all whole numbers.
        let values = (0..200_000).map(|k| [k as f32, -0.001 * k as f32, f32::from_bits(0x3f00_feff + k)]);
        for point in values {
            let bytes: Vec<u8> = point.iter().flat_map(|x| x.to_le_bytes()).collect();
            assert_eq!(Signature::of(&bytes), None, "{point:?}");
            assert_eq!(Signature::of(&bytes[8..]), None, "{point:?}");
        }
    }
}
