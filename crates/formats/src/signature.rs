//! What a file is by its first bytes, in words for messages: files under another's name, and what stands in place of files.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::Error;

/// What the first bytes of a file say that it is.
///
/// No capture stored as plain little-endian `f32` begins like any of these: text is told by more bytes than numbers that are all
/// letters could fill, and the other beginnings would be numbers near 1e-30 or 1e30.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Signature {
    /// A NumPy array.
    Npy,
    /// A zip archive, `.npz` among them.
    Zip,
    /// A point cache of 3ds Max and Blender.
    Pc2,
    /// Alembic in the Ogawa container.
    Abc,
    /// Universal Scene Description in binary.
    Usdc,
    /// Universal Scene Description as text.
    Usda,
    /// Wavefront OBJ.
    Obj,
    /// Polygon File Format.
    Ply,
    /// Object File Format.
    Off,
    /// Stereolithography in ASCII; binary files cannot be told.
    Stl,
    /// Binary glTF.
    Glb,
    /// A `.cager` file.
    Cager,
    /// Another program's scene or cache, by its name.
    Scene(&'static str),
    /// Packed, with the program of this name.
    Packed(&'static str),
    /// What git stores in place of a large file.
    LfsPointer,
    /// What git-annex stores in place of a file.
    AnnexPointer,
    /// What a server answers in place of a file.
    WebPage,
    /// Text in UTF-16.
    Utf16,
    /// Text that is none of the above.
    Text,
}

/// Beginnings that need no other look.
const BEGINNINGS: &[(&[u8], Signature)] = &[
    (b"\x93NUMPY", Signature::Npy),
    (b"PK\x03\x04", Signature::Zip),
    (b"PK\x05\x06", Signature::Zip),
    (b"POINTCACHE2", Signature::Pc2),
    (b"glTF\x01\0\0\0", Signature::Glb),
    (b"glTF\x02\0\0\0", Signature::Glb),
    (b"\x89CGR\r\n\x1a\n", Signature::Cager),
    (b"Ogawa", Signature::Abc),
    (b"\x89HDF\r\n\x1a\n", Signature::Scene("HDF5")),
    (b"PXR-USDC", Signature::Usdc),
    (b"#usda", Signature::Usda),
    (b"Kaydara FBX Binary", Signature::Scene("FBX")),
    (b"; FBX", Signature::Scene("FBX")),
    (b"BLENDER", Signature::Scene("Blender")),
    (b"\x28\xb5\x2f\xfd", Signature::Packed("zstd")),
    (b"\xfd7zXZ\0", Signature::Packed("xz")),
    (b"7z\xbc\xaf\x27\x1c", Signature::Packed("7-Zip")),
    (b"version https://git-lfs.github.com/spec/", Signature::LfsPointer),
    // The name of Git LFS before 2015.
    (b"version https://hawser.github.com/spec/", Signature::LfsPointer),
    (b"/annex/objects/", Signature::AnnexPointer),
    (b"404: Not Found", Signature::WebPage),
];

/// Bytes of a file that are looked at.
const LOOKED_AT: usize = 1024;
/// Bytes that must be letters, digits, punctuation and white space in text.
const MIN_TEXT: usize = 12;

impl Signature {
    /// What a file that begins with these bytes is; a few hundred of them are enough. `None` for bytes that say nothing.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let start = &bytes[..bytes.len().min(LOOKED_AT)];
        if let Some(&(_, found)) = BEGINNINGS.iter().find(|(beginning, _)| start.starts_with(beginning)) {
            return Some(found);
        }
        match start {
            [0x1f, 0x8b, 8, 0..0x20, ..] => return Some(Self::Packed("gzip")),
            [b'B', b'Z', b'h', _, b'1', b'A', b'Y', b'&', ..] => return Some(Self::Packed("bzip2")),
            _ if is_utf16(start) => return Some(Self::Utf16),
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
            return Some(Self::WebPage);
        }
        Some(mesh_text(text).unwrap_or(Self::Text))
    }

    /// Why a file named `.extension` that begins with `bytes` is another kind of file, if it is: a sentence to follow its name.
    pub fn other_than(extension: &str, bytes: &[u8]) -> Option<String> {
        let found = Self::of(bytes)?;
        if extension == "abc" && found == Self::Scene("HDF5") {
            let what = "is an Alembic archive of the old kind, HDF5, which is not read; write it as Ogawa with abcconvert -toOgawa, or export it again";
            return Some(what.to_owned());
        }
        let is_own = found.extensions().contains(&extension) || found == Self::Text;
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
        match (self, self.extensions()) {
            (Self::Scene(name), _) => format!("a file of {name}"),
            (Self::Packed(name), _) => format!("a file packed with {name}"),
            (Self::LfsPointer, _) => "a Git LFS pointer".to_owned(),
            (Self::AnnexPointer, _) => "a git-annex pointer".to_owned(),
            (Self::WebPage, _) => "a web page".to_owned(),
            (Self::Utf16, _) => "text in UTF-16".to_owned(),
            (_, []) => "text".to_owned(),
            (_, extensions) => format!("a file of the kind .{}", extensions.join(" or .")),
        }
    }

    /// Those that files of this kind have, as far as they are read.
    fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Npy => &["npy"],
            Self::Zip => &["npz", "usdz", "zip"],
            Self::Pc2 => &["pc2"],
            Self::Abc => &["abc"],
            Self::Usdc => &["usdc", "usd"],
            Self::Usda => &["usda", "usd"],
            Self::Obj => &["obj"],
            Self::Ply => &["ply"],
            Self::Off => &["off"],
            Self::Stl => &["stl"],
            Self::Glb => &["glb"],
            Self::Cager => &["cager"],
            _ => &[],
        }
    }

    /// For what may stand in place of any file: what it is and what to do, to follow the file's name.
    pub fn stand_in(self) -> Option<String> {
        Some(match self {
            Self::LfsPointer => "is a Git LFS pointer, not the file itself; run git lfs pull".to_owned(),
            Self::AnnexPointer => "is a git-annex pointer, not the file itself; run git annex get".to_owned(),
            Self::WebPage => "is a web page, not the file itself; download the file itself".to_owned(),
            Self::Utf16 => "is text in UTF-16; save it as UTF-8, or export it again".to_owned(),
            Self::Packed(name) => format!("is packed with {name}; unpack it first"),
            _ => return None,
        })
    }
}

/// With or without a mark of byte order. Low byte first, numbers of those bytes would be far below 1e-37; high byte first, it takes
/// several characters to tell them from numbers.
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
fn mesh_text(text: &[u8]) -> Option<Signature> {
    let line = text.split(|b| b"\r\n".contains(b)).map(<[u8]>::trim_ascii).find(|l| !l.is_empty() && l[0] != b'#')?;
    let word = line.split(u8::is_ascii_whitespace).next()?;
    Some(match word {
        b"ply" => Signature::Ply,
        b"v" | b"vn" | b"vt" | b"vp" | b"f" | b"o" | b"g" | b"s" | b"mtllib" | b"usemtl" => Signature::Obj,
        _ if word.eq_ignore_ascii_case(b"solid") => Signature::Stl,
        _ if is_off(word) => Signature::Off,
        _ => return None,
    })
}

/// `OFF`, with the letters before it that say what points have, and the digits that some programs write behind it.
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
            (b"\x93NUMPY\x01\0v\0{'descr'", Some(Signature::Npy)),
            (b"PK\x03\x04\x14\0\0\0", Some(Signature::Zip)),
            (b"POINTCACHE2\0\x01\0\0\0", Some(Signature::Pc2)),
            (b"# a comment\n\nv 0 0 0\n", Some(Signature::Obj)),
            (b"v 0.5 1 -2\r\nv 1", Some(Signature::Obj)),
            (b"ply\nformat ascii 1.0\n", Some(Signature::Ply)),
            (b"OFF490 518 0\n1 2 3\n", Some(Signature::Off)),
            (b"solid of some program\n", Some(Signature::Stl)),
            (b"glTF\x02\0\0\0\x10\0\0\0", Some(Signature::Glb)),
            (lfs.as_bytes(), Some(Signature::LfsPointer)),
            (b"\n <!DOCTYPE html>\n<html>", Some(Signature::WebPage)),
            (&utf16("\u{feff}v 0 0 0\n"), Some(Signature::Utf16)),
            (&utf16("v 0 0 0\n"), Some(Signature::Utf16)),
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
