//! NumPy's archives: a zip file with one `.npy` file for each array.

use std::fs::File;
use std::io::{self, BufReader, Seek};
use std::path::Path;

use zip::ZipArchive;
use zip::result::ZipError;

use crate::error::{Error, Fault};

/// Unpacks the only array of an archive into a file without a name, so that memory does not grow with it; gives its length too.
pub(super) fn only_array(path: &Path) -> Result<(File, u64), Error> {
    let file = File::open(path).map_err(|cause| Error::read(path, cause))?;
    let failed = |cause| match cause {
        ZipError::Io(cause) if cause.kind() != io::ErrorKind::UnexpectedEof => Error::read(path, cause),
        cause => {
            Fault::damaged(format!("cannot be unpacked ({cause}); save the array again with numpy.savez")).at(path)
        }
    };
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(failed)?;
    if archive.len() != 1 {
        let names: Vec<String> = archive
            .file_names()
            .take(6)
            .filter_map(|name| Some(name.ok()?.trim_end_matches(".npy").to_owned()))
            .collect();
        let what = format!(
            "has {} arrays ({}); save the frames alone with numpy.save(path, numpy.load(archive)[name])",
            archive.len(),
            names.join(", ")
        );
        return Err(Fault::unsupported(what).at(path));
    }
    let mut packed = archive.by_index(0).map_err(failed)?;
    let mut unpacked = tempfile::tempfile().map_err(|cause| Error::write(&std::env::temp_dir(), cause))?;
    // What is wrong with the packed bytes shows as an error of reading; a full disk as one of writing, which names another place.
    let length = io::copy(&mut packed, &mut unpacked).map_err(|cause| match cause.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Error::write(&std::env::temp_dir(), cause),
        _ => failed(ZipError::Io(cause)),
    })?;
    unpacked.rewind().map_err(|cause| Error::read(path, cause))?;
    Ok((unpacked, length))
}
