//! File names with a place for the number of a frame: `walk.%04d.obj`, `walk.####.obj`.

use std::path::Path;

use super::numbers::padded;
use crate::mesh::MeshFormat;

/// A file name with a place for a number.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct NumberedNames {
    before: String,
    /// Least number of digits, filled up with zeros.
    digits: usize,
    after: String,
}

impl NumberedNames {
    /// The numbered name in a path of mesh files; a point cache holds all frames in one file.
    pub(super) fn of(path: &Path) -> Option<Self> {
        MeshFormat::guess(path)?;
        Self::parse(path.file_name()?.to_str()?)
    }

    /// Files that are called so many digits after `before`, then `after`.
    pub(super) fn new(before: &str, digits: usize, after: &str) -> Self {
        Self { before: before.to_owned(), digits, after: after.to_owned() }
    }

    pub(super) fn parse(name: &str) -> Option<Self> {
        let start = name.find(['%', '#'])?;
        let (before, rest) = name.split_at(start);
        let (digits, after) = match rest.strip_prefix('%') {
            Some(rest) => {
                let (width, after) = rest.split_once('d')?;
                // `%d` asks for no zeros; a width without the leading 0 would ask for blanks.
                let digits = if width.is_empty() { 1 } else { width.strip_prefix('0')?.parse().ok()? };
                (digits, after)
            }
            None => {
                let after = rest.trim_start_matches('#');
                (rest.len() - after.len(), after)
            }
        };
        let usual = (1..=19).contains(&digits) && !after.contains(['%', '#']);
        usual.then(|| Self::new(before, digits, after))
    }

    pub(super) fn extension_is(&self, extension: &str) -> bool {
        Path::new(&self.after).extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
            || self.after.strip_prefix('.').is_some_and(|found| found.eq_ignore_ascii_case(extension))
    }

    pub(super) fn name(&self, number: f64) -> String {
        format!("{}{}{}", self.before, padded(number, self.digits), self.after)
    }

    /// The name of the file of materials that all of them share.
    pub(super) fn library(&self) -> String {
        let name = self.before.trim_end_matches(|c: char| !c.is_alphanumeric());
        format!("{}.mtl", if name.is_empty() { "materials" } else { name })
    }

    /// The name of a file of materials for one number alone.
    pub(super) fn own_library(&self, number: f64) -> String {
        let name = self.name(number);
        format!("{}.mtl", name.strip_suffix(self.extension()).unwrap_or(&name))
    }

    /// Whether a name is one of these.
    pub(super) fn is_own_library(&self, name: &str) -> bool {
        let stem = name.strip_suffix(".mtl");
        stem.is_some_and(|stem| self.number(&format!("{stem}{}", self.extension())).is_some())
    }

    /// With its dot.
    fn extension(&self) -> &str {
        &self.after[self.after.rfind('.').unwrap_or(0)..]
    }

    /// The glob pattern of such names, and of others with something else in place of the number.
    pub(super) fn glob(&self) -> String {
        format!("{}*{}", glob::Pattern::escape(&self.before), glob::Pattern::escape(&self.after))
    }

    /// The number in a name of this form.
    pub(super) fn number(&self, name: &str) -> Option<i64> {
        let middle = name.strip_prefix(self.before.as_str())?.strip_suffix(self.after.as_str())?;
        let digits = middle.strip_prefix('-').unwrap_or(middle);
        // A sign counts as a digit in `printf`, and beside the digits elsewhere.
        let filled = middle.len() == self.digits || digits.len() == self.digits;
        let longer = digits.len() > self.digits && !digits.starts_with('0');
        let number = digits.bytes().all(|c| c.is_ascii_digit()) && (filled || longer);
        number.then(|| middle.parse().ok()).flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printf_and_hash_patterns_name_the_same_files() {
        for pattern in ["walk.%04d.obj", "walk.####.obj"] {
            let names = NumberedNames::of(Path::new(pattern)).unwrap();
            assert_eq!(names.name(7.0), "walk.0007.obj");
            assert_eq!(names.name(12345.0), "walk.12345.obj");
            assert!(names.extension_is("obj") && !names.extension_is("ply"));
            for (name, number) in [
                ("walk.0007.obj", Some(7)),
                ("walk.12345.obj", Some(12345)),
                ("walk.-001.obj", Some(-1)),
                ("walk.-0001.obj", Some(-1)),
                ("walk.7.obj", None),
                ("walk.00007.obj", None),
                ("walk.007a.obj", None),
                ("run.0007.obj", None),
                ("walk.0007.obj.bak", None),
            ] {
                assert_eq!(names.number(name), number, "{name}");
            }
        }
        assert_eq!(NumberedNames::of(Path::new("f%d.ply")).unwrap().number("f12.ply"), Some(12));
    }

    #[test]
    fn other_names_are_no_patterns() {
        for name in ["walk.obj", "walk.%s.obj", "walk.%4d.obj", "walk.####.npy", "a.##.b.##.obj", "100%.obj"] {
            assert_eq!(NumberedNames::of(Path::new(name)), None, "{name}");
        }
    }
}
