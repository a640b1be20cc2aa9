//! What users rely on when files are written.

mod support;

use std::fs;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use cager_formats::{AtomicDir, AtomicFile, Error, ScratchDir, Target, commit_together, read_model, write_model};
use cager_geometry::mesh::Model;
use proptest::prelude::*;
use support::*;
use tempfile::tempdir;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn models_come_back_as_they_were_written() {
    let folder = tempdir().unwrap();
    let mut hard = tetrahedron();
    hard.points[1] = [0.1, -1e-300, f64::MAX];
    hard.points[2] = [f64::MIN_POSITIVE, 5e-324, 1.0 / 3.0];
    let mut round = Model { points: vec![[1.0, 2.0, 3.0]; 300], ..Model::default() };
    round.faces.push(&(0..300).collect::<Vec<_>>());
    round.faces.push(&[0, 1, 2, 3]);
    let cloud = Model { points: POINTS.to_vec(), ..Model::default() };
    for model in [tetrahedron(), hard, round, cloud] {
        for name in ["a.obj", "a.ply", "a.off", "B.PLY"] {
            let path = folder.path().join(name);
            write_model(&path, &model).unwrap();
            assert_eq!(read_model(&path).unwrap(), model, "{name}");
        }
    }
    assert_eq!(names(folder.path()), ["B.PLY", "a.obj", "a.off", "a.ply"]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn every_finite_coordinate_survives_every_format(
        points in proptest::collection::vec(prop::array::uniform3(any::<f64>().prop_filter("finite", |x| x.is_finite())), 1..8)
    ) {
        let folder = tempdir().unwrap();
        let model = Model { points, ..Model::default() };
        for name in ["a.obj", "a.ply", "a.off"] {
            let path = folder.path().join(name);
            write_model(&path, &model).unwrap();
            let bits = |model: &Model| model.points.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(bits(&read_model(&path).unwrap()), bits(&model), "{}", name);
        }
    }
}

#[test]
fn ply_is_single_precision_where_that_loses_nothing() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let header = |model: &Model| {
        write_model(&path, model).unwrap();
        String::from_utf8_lossy(&fs::read(&path).unwrap()).into_owned()
    };
    let mut model = tetrahedron();
    assert!(header(&model).starts_with(
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    ));
    model.points[0][0] = 0.1;
    assert!(header(&model).contains("property double x\n"));
}

#[test]
fn models_that_could_not_be_read_back_are_not_written() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let mut nan = tetrahedron();
    nan.points[2][1] = f64::NAN;
    assert!(message(write_model(&path, &nan)).contains("vertex 2 has a coordinate that is NaN"));
    let mut loose = tetrahedron();
    loose.faces.push(&[0, 1, 9]);
    assert!(message(write_model(&path, &loose)).contains("face 4: the face names vertex 9"));
    assert!(message(write_model(&path, &Model::default())).contains("has no points"));
    assert!(message(write_model(&folder.path().join("a.glb"), &tetrahedron())).contains(".obj .ply .off"));
    assert!(names(folder.path()).is_empty());
}

#[test]
fn a_file_replaces_the_old_one_only_when_committed() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("out");
    fs::write(&path, "old").unwrap();
    let mut file = AtomicFile::create(&path).unwrap();
    file.write_all(b"half").unwrap();
    file.flush().unwrap();
    drop(file);
    assert_eq!((fs::read(&path).unwrap(), names(folder.path())), (b"old".to_vec(), vec!["out".to_owned()]));

    let mut file = AtomicFile::create(&path).unwrap();
    file.write_all(b"new file").unwrap();
    file.seek(SeekFrom::Start(0)).unwrap();
    file.write_all(b"N").unwrap();
    file.commit().unwrap();
    assert_eq!((fs::read(&path).unwrap(), names(folder.path())), (b"New file".to_vec(), vec!["out".to_owned()]));
}

fn begin(target: impl Into<Target>) -> AtomicFile {
    let mut file = AtomicFile::create(target).unwrap();
    file.write_all(b"new").unwrap();
    file
}

/// Files in a folder, hidden ones too, with their contents; those of folders are empty.
fn contents(folder: &Path) -> Vec<(String, String)> {
    let read = |name: String| (fs::read_to_string(folder.join(&name)).unwrap_or_default(), name);
    names(folder).into_iter().map(read).map(|(text, name)| (name, text)).collect()
}

fn expected(files: &[(&str, &str)]) -> Vec<(String, String)> {
    files.iter().map(|&(name, text)| (name.to_owned(), text.to_owned())).collect()
}

#[test]
fn files_take_their_names_together_over_old_ones_and_beside_them() {
    for old in [false, true] {
        let folder = tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        if old {
            fs::write(&a, "old").unwrap();
            fs::write(&b, "old").unwrap();
        }
        let mut files = vec![begin(&a), begin(&b)];
        assert_eq!((files[0].path().to_owned(), files[0].complete().unwrap()), (a, 3));
        commit_together(files).unwrap();
        assert_eq!(contents(folder.path()), expected(&[("a", "new"), ("b", "new")]), "{old}");
    }
}

#[test]
fn where_one_file_cannot_have_its_name_all_is_as_before() {
    for old in [false, true] {
        let folder = tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        if old {
            fs::write(&a, "old").unwrap();
        }
        let files = vec![begin(&a), begin(&b)];
        // Someone takes the second name for what no file replaces.
        fs::create_dir(&b).unwrap();
        let error = commit_together(files).unwrap_err().to_string();
        assert!(error.starts_with(&format!("{}: cannot be written (", b.display())), "{error}");
        assert!(!error.contains(".cager-"), "{error}");
        let before: &[_] = if old { &[("a", "old"), ("b", "")] } else { &[("b", "")] };
        assert_eq!(contents(folder.path()), expected(before), "{old}");
    }
}

#[test]
fn a_new_file_takes_the_name_of_none_that_appeared_meanwhile() {
    let folder = tempdir().unwrap();
    let [a, b, c] = ["a", "b", "c"].map(|name| folder.path().join(name));
    begin(Target::New(a.clone())).commit().unwrap();
    assert_eq!(contents(folder.path()), expected(&[("a", "new")]));
    let files = vec![begin(Target::New(b)), begin(Target::New(c.clone()))];
    fs::write(c, "theirs").unwrap();
    let error = commit_together(files).unwrap_err().to_string();
    assert!(error.ends_with("c: is there already; name another file"), "{error}");
    assert_eq!(contents(folder.path()), expected(&[("a", "new"), ("c", "theirs")]));
    let error = AtomicFile::create(Target::New(a)).unwrap_err();
    assert!(matches!(error, Error::Target { .. }), "{error}");
}

#[test]
fn a_scratch_folder_goes_although_others_still_write_into_it() {
    let around = tempdir().unwrap();
    let scratch = ScratchDir::create(around.path()).unwrap();
    let inner = scratch.path().join("inner");
    fs::create_dir(&inner).unwrap();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut k = 0;
            while !stop.load(Ordering::Relaxed) {
                // Fails from the moment on in which the folder is on its way out.
                let _ = fs::write(inner.join(k.to_string()), "x");
                k += 1;
            }
        });
        while names(&inner).len() < 20 {}
        drop(scratch);
        stop.store(true, Ordering::Relaxed);
    });
    assert!(names(around.path()).is_empty());

    let missing = around.path().join("missing");
    let error = ScratchDir::create(&missing).unwrap_err().to_string();
    assert!(error.starts_with(&missing.display().to_string()), "{error}");
}

#[cfg(unix)]
#[test]
fn files_and_folders_have_the_permissions_of_any_new_one() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempdir().unwrap();
    let mode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
    fs::write(folder.path().join("plain"), "").unwrap();
    AtomicFile::create(folder.path().join("ours")).unwrap().commit().unwrap();
    assert_eq!(mode("ours"), mode("plain"));
    fs::create_dir(folder.path().join("plain dir")).unwrap();
    AtomicDir::create(folder.path().join("our dir"), |_| false).unwrap().commit().unwrap();
    assert_eq!(mode("our dir"), mode("plain dir"));
}

#[cfg(unix)]
#[test]
fn a_file_that_replaces_another_keeps_its_mode_and_its_links() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = tempdir().unwrap();
    let [old, link, dangling] = ["old", "link", "dangling"].map(|name| folder.path().join(name));
    fs::write(&old, "old").unwrap();
    fs::set_permissions(&old, fs::Permissions::from_mode(0o640)).unwrap();
    symlink("old", &link).unwrap();
    symlink("made", &dangling).unwrap();
    commit_together(vec![begin(&link), begin(&dangling)]).unwrap();
    assert_eq!(fs::metadata(&old).unwrap().permissions().mode() & 0o777, 0o640);
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink() && fs::symlink_metadata(&dangling).unwrap().is_symlink());
    assert_eq!(
        (fs::read(&old).unwrap(), fs::read(folder.path().join("made")).unwrap()),
        (b"new".into(), b"new".into())
    );
}

#[cfg(unix)]
#[test]
fn devices_are_never_replaced() {
    let error = AtomicFile::create("/dev/null").unwrap_err();
    assert_eq!(error.to_string(), "/dev/null: is not a regular file; name one");
}

#[test]
fn a_place_that_cannot_be_written_is_named_as_the_user_named_it() {
    let folder = tempdir().unwrap();
    let inside = folder.path().join("missing/out.obj");
    let error = message(write_model(&inside, &tetrahedron()));
    assert!(error.starts_with(&format!("{}: cannot be written (", inside.display())), "{error}");
    assert!(error.ends_with("; create its folder first") && !error.contains(".cager-"), "{error}");

    let error = AtomicFile::create(folder.path()).unwrap_err();
    assert!(matches!(error, Error::Target { .. }) && error.to_string().ends_with("is a folder; name a file in it"));
}

#[cfg(unix)]
#[test]
fn a_folder_closed_to_writing_is_an_error_that_names_the_output() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempdir().unwrap();
    let closed = folder.path().join("closed");
    fs::create_dir(&closed).unwrap();
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o555)).unwrap();
    // Root may write anywhere.
    if fs::write(closed.join("probe"), "").is_ok() {
        eprintln!("skipped: this user may write to closed folders");
        return;
    }
    let path = closed.join("out.obj");
    let error = message(write_model(&path, &tetrahedron()));
    assert!(error.starts_with(&format!("{}: cannot be written (", path.display())), "{error}");
    assert!(error.ends_with("choose a folder that you may write to") && !error.contains(".cager-"), "{error}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_system_that_takes_no_files_is_an_error_that_names_the_output() {
    let error = message(write_model("/proc/out.obj".as_ref(), &tetrahedron()));
    assert!(error.starts_with("/proc/out.obj: cannot be written (") && !error.contains(".cager-"), "{error}");
}

#[test]
fn a_folder_appears_only_when_committed_and_never_over_files() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("frames");
    let dir = AtomicDir::create(&path, |_| false).unwrap();
    fs::write(dir.folder().join("a"), "1").unwrap();
    drop(dir);
    assert!(names(folder.path()).is_empty());

    fs::create_dir(&path).unwrap();
    let dir = AtomicDir::create(&path, |_| false).unwrap();
    fs::write(dir.folder().join("a"), "1").unwrap();
    assert!(names(&path).is_empty());
    dir.commit().unwrap();
    assert_eq!((names(&path), names(folder.path())), (vec!["a".to_owned()], vec!["frames".to_owned()]));

    let error = AtomicDir::create(&path, |_| false).unwrap_err();
    assert!(
        error.to_string().ends_with("is a folder that is not empty, as it holds a; empty it or name another"),
        "{error}"
    );
    let error = AtomicDir::create(path.join("a"), |_| false).unwrap_err();
    assert!(error.to_string().contains("is a file; name a folder"), "{error}");
}

#[test]
fn files_that_others_put_in_the_folder_meanwhile_are_kept() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("frames");
    let dir = AtomicDir::create(&path, |_| false).unwrap();
    fs::create_dir(&path).unwrap();
    fs::write(path.join("theirs"), "1").unwrap();
    assert!(matches!(dir.commit(), Err(Error::Target { .. })));
    assert_eq!((names(&path), names(folder.path())), (vec!["theirs".to_owned()], vec!["frames".to_owned()]));
}

#[test]
fn a_folder_of_files_that_may_be_replaced_is_replaced_as_a_whole() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("frames");
    let begin = || AtomicDir::create(&path, |name| name.ends_with(".obj"));
    fs::create_dir(&path).unwrap();
    for name in ["a.obj", "b.obj"] {
        fs::write(path.join(name), "old").unwrap();
    }
    let dir = begin().unwrap();
    fs::write(dir.folder().join("c.obj"), "new").unwrap();
    assert_eq!(names(&path), ["a.obj", "b.obj"]);
    dir.commit().unwrap();
    assert_eq!((names(&path), names(folder.path())), (vec!["c.obj".to_owned()], vec!["frames".to_owned()]));

    // One that appears during the work is not.
    let dir = begin().unwrap();
    fs::write(path.join("d.obj"), "theirs").unwrap();
    assert!(matches!(dir.commit(), Err(Error::Target { .. })));
    assert_eq!(
        (names(&path), names(folder.path())),
        (vec!["c.obj".to_owned(), "d.obj".to_owned()], vec!["frames".to_owned()])
    );

    fs::create_dir(path.join("e.obj")).unwrap();
    assert!(matches!(begin(), Err(Error::Target { .. })));
}
