//! Stretches of frames that have a template each: how they are told and cut, what their files are
//! called, and the list of them.

use anyhow::{Context, Result, bail};
use cager_capture::decode::{self, Container, DecodeError};
use cager_formats::MeshSequence;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// A template, and the number of the frame from which on it holds where that is not the first.
#[derive(Clone, Debug)]
pub(super) struct KeyTemplate {
    pub(super) from: Option<f64>,
    pub(super) path: PathBuf,
}

impl From<OsString> for KeyTemplate {
    /// `120:body.obj`, or a path alone.
    fn from(text: OsString) -> Self {
        let told = text.to_str().and_then(|text| text.split_once(':')).and_then(|(number, path)| {
            let from = number.parse().ok().filter(|number: &f64| number.is_finite())?;
            Some(Self { from: Some(from), path: path.into() })
        });
        told.unwrap_or_else(|| Self { from: None, path: text.into() })
    }
}

/// The frames of each template.
pub(super) fn cut(files: MeshSequence, templates: &[KeyTemplate]) -> Result<Vec<MeshSequence>> {
    if let [KeyTemplate { from: None, .. }] = templates {
        return Ok(vec![files]);
    }
    let count = files.files.len();
    let numbers = files.numbers.unwrap_or_else(|| (0..count).map(|k| k as f64).collect());
    let begins = |key: &KeyTemplate| numbers.partition_point(|&number| key.from.is_some_and(|from| number < from));
    let mut starts: Vec<usize> = templates.iter().map(begins).collect();
    starts.push(count);
    let range = format!("frames are numbered {} to {}", numbers[0], numbers[count - 1]);
    if let Some(key) = templates[1..].iter().find(|key| key.from.is_none()) {
        let path = key.path.display();
        bail!(
            "--template {path}: is not the first, so say from which frame on it holds: --template FRAME:{path}; {range}"
        );
    }
    if starts[0] > 0 {
        bail!(
            "--template {}: no template holds before it; leave out the frame of the first; {range}",
            templates[0].path.display()
        );
    }
    if let Some(k) = (0..templates.len()).find(|&k| starts[k] >= starts[k + 1]) {
        let path = templates[k].path.display();
        bail!("--template {path}: there is no frame for it; give templates in the order of their frames; {range}");
    }
    let stretch = |own: &[usize]| MeshSequence {
        files: files.files[own[0]..own[1]].to_vec(),
        numbers: Some(numbers[own[0]..own[1]].to_vec()),
        notes: Vec::new(),
    };
    Ok(starts.windows(2).map(stretch).collect())
}

/// `dance.cager` of the first stretch, counted from 0, is `dance-1.cager`.
pub(super) fn numbered(path: &Path, stretch: usize) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{}", stretch + 1));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// Containers that play one after the other.
#[derive(Debug, Deserialize, Serialize)]
pub(super) struct StretchList {
    version: u32,
    pub(super) stretches: Vec<Stretch>,
}

/// A container in a list.
#[derive(Debug, Deserialize, Serialize)]
pub(super) struct Stretch {
    /// Beside the list.
    pub(super) file: PathBuf,
    /// Number of its first frame.
    pub(super) first_frame: f64,
    /// Frames that it holds.
    pub(super) frames: usize,
    /// Frames per second, where known.
    pub(super) frame_rate: Option<f64>,
}

impl StretchList {
    /// Where the list of this output is.
    pub(super) fn path(output: &Path) -> PathBuf {
        output.with_extension("stretches.json")
    }

    pub(super) fn new(stretches: Vec<Stretch>) -> Self {
        Self { version: 1, stretches }
    }

    /// Opens the containers of a list that was read from this file, and compares them with what it says of them.
    pub(super) fn containers(&self, list: &Path) -> Result<Vec<(PathBuf, Container)>> {
        let mut found: Vec<(PathBuf, Container)> = Vec::with_capacity(self.stretches.len());
        let mut last = f64::NEG_INFINITY;
        for Stretch { file, first_frame, frames, .. } in &self.stretches {
            let path = list.with_file_name(file);
            let (named, shown) = (list.display(), path.display());
            if !path.exists() {
                bail!("{named}: lists {shown}, which is not there; put it beside the list, or recover it again");
            }
            let mut container = decode::open(&path)?;
            let numbers = container.frame_numbers().map_err(|cause| DecodeError::container(&path, cause))?;
            let (first, count) = (numbers.first().copied().unwrap_or(0.0), container.frames());
            if (first, count) != (*first_frame, *frames) {
                bail!(
                    "{named}: has {frames} frames of {shown} from {first_frame} on, but that has {count} from {first} \
                     on; recover them again"
                );
            }
            let rate = container.header().frame_rate;
            if found.first().is_some_and(|(_, first)| first.header().frame_rate != rate) {
                bail!("{named}: {shown} has another frame rate than the files before it; recover them again");
            }
            if first <= last {
                bail!(
                    "{named}: {shown} begins with frame {first}, and what is listed before it ends with frame {last}; \
                     list files in the order of their frames, each frame once"
                );
            }
            last = numbers.last().copied().unwrap_or(count.saturating_sub(1) as f64);
            found.push((path, container));
        }
        Ok(found)
    }

    /// Reads a list; none where the name is not that of one.
    pub(super) fn read(path: &Path) -> Result<Option<Self>> {
        if path.extension().is_none_or(|extension| extension != "json") {
            return Ok(None);
        }
        let named = || path.display().to_string();
        let list: Self = serde_json::from_slice(&std::fs::read(path).with_context(named)?).with_context(|| {
            format!("{}: is no list of stretches; give the .stretches.json that recover wrote", named())
        })?;
        if list.version != 1 {
            bail!(
                "{}: is a list of version {}, and this program reads version 1; use a newer cager",
                named(),
                list.version
            );
        }
        if list.stretches.is_empty() {
            bail!("{}: lists no files; recover them again", named());
        }
        Ok(Some(list))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(told: &[&str]) -> Vec<KeyTemplate> {
        told.iter().map(|&text| KeyTemplate::from(OsString::from(text))).collect()
    }

    fn counts(numbers: Option<Vec<f64>>, told: &[&str]) -> Result<Vec<(usize, Option<f64>)>, String> {
        let files = (0..6).map(|k| format!("{k}.ply").into()).collect();
        let cut = cut(MeshSequence { files, numbers, notes: Vec::new() }, &keys(told));
        let told = |s: &MeshSequence| (s.files.len(), s.numbers.as_ref().map(|numbers| numbers[0]));
        cut.map(|all| all.iter().map(told).collect()).map_err(|error| error.to_string())
    }

    #[test]
    fn templates_hold_from_their_frame_to_the_next() {
        let numbered = || Some(vec![5.0, 6.0, 7.0, 9.0, 10.0, 11.0]);
        assert_eq!(counts(None, &["a.obj"]), Ok(vec![(6, None)]));
        assert_eq!(counts(None, &["a.obj", "2:b.obj"]), Ok(vec![(2, Some(0.0)), (4, Some(2.0))]));
        assert_eq!(counts(numbered(), &["5:a.obj", "8:b.obj", "11:c.obj"]).unwrap()[1], (2, Some(9.0)));
        assert_eq!(keys(&["C:/a.obj", "1:C:/b.obj"])[0].path, Path::new("C:/a.obj"));
        for (told, word) in [
            (&["a.obj", "b.obj"][..], "FRAME:b.obj"),
            (&["6:a.obj", "8:b.obj"], "leave out"),
            (&["a.obj", "12:b.obj"], "numbered 5 to 11"),
            (&["a.obj", "10:b.obj", "7:c.obj"], "order"),
        ] {
            let error = counts(numbered(), told).unwrap_err();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn files_of_stretches_are_numbered_beside_their_list() {
        assert_eq!(numbered(Path::new("a.b/dance.cager"), 1), Path::new("a.b/dance-2.cager"));
        assert_eq!(StretchList::path(Path::new("a.b/dance.cager")), Path::new("a.b/dance.stretches.json"));
    }
}
