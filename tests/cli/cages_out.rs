//! Cages out of a container, edited, and back: `decode --cages`, `decode --with-cages`, `edit`.

use crate::refused::refused;
use crate::support::{Dir, ENCODE, Small, as_model, read_cages, read_frames};
use cager_formats::{FrameOptions, create_frames, read_model};
use cager_geometry::mesh::TriMesh;
use cager_proto::container::ContainerReader;
use std::io::Cursor;

/// The cages of a file in double precision.
fn stored(dir: &Dir, name: &str) -> Vec<Vec<f64>> {
    read_cages(&dir.path(name)).iter().map(|cage| cage.iter().map(|&x| f64::from(x)).collect()).collect()
}

/// Text gives the shortest digits of an f32, which are that f32 again and no other.
pub(crate) fn same(found: &[Vec<f64>], wanted: &[Vec<f64>]) -> bool {
    let narrow = |frames: &[Vec<f64>]| frames.iter().map(|f| f.iter().map(|&x| x as f32).collect()).collect();
    let (found, wanted): (Vec<Vec<f32>>, Vec<Vec<f32>>) = (narrow(found), narrow(wanted));
    found == wanted
}

fn moved(cages: &[Vec<f64>], by: f64) -> Vec<Vec<f64>> {
    cages.iter().map(|cage| cage.iter().map(|x| x + by).collect()).collect()
}

#[test]
fn cages_are_written_in_every_format_with_the_rest_cage_and_its_faces_beside_them() {
    let (dir, small) = Dir::with_encoded();
    let cages = stored(&dir, "out.cager");
    let rows = small.cage.vertices.len();
    for (output, rest) in [
        ("cages.npy", "cages.cage.obj"),
        ("walk.pc2", "walk.cage.obj"),
        ("walk.mdd", "walk.cage.obj"),
        ("folder/", "folder.cage.obj"),
        ("binary/*.ply", "binary.cage.obj"),
        ("named/c.%03d.obj", "named.cage.obj"),
    ] {
        let said = dir.cager(&format!("decode out.cager --cages -o {output}")).succeeds().stdout;
        assert!(said.contains(rest) && said.contains(&format!("20 cages of {rows} vertices")), "{said}");
        assert!(same(&read_frames(&dir.path(output), rows), &cages), "{output}");
        let beside = read_model(&dir.path(rest)).expect(rest);
        assert_eq!(beside, as_model(&small.cage), "{rest}");
    }
    let posed = read_model(&dir.path("folder/frame_0007.obj")).expect("a cage");
    assert_eq!(posed.faces, as_model(&small.cage).faces);
    assert_eq!(dir.names("named")[19], "c.019.obj");
    // The same rest cage may lie there already; another one stays, unless it may be replaced.
    dir.cager("decode out.cager --cages -o cages.pc2").succeeds();
    dir.write("other.cage.obj", "v 0 0 0\n");
    refused(&dir, "decode out.cager --cages -o other.npy", &["other.cage.obj", "another file", "--overwrite"]);
    dir.cager("decode out.cager --cages -o other.npy --overwrite").succeeds();
    assert_eq!(dir.read("other.cage.obj"), dir.read("cages.cage.obj"));
}

#[test]
fn files_keep_the_colours_of_the_rest_pose_coded_and_edited() {
    let (dir, mut small) = (Dir::new(), Small::new());
    small.rest.colors = (0..small.rest.points.len()).map(|k| [k as u8, (k / 256) as u8, 255]).collect();
    dir.model("rest.obj", &small.rest);
    dir.model("cage.obj", &as_model(&small.cage));
    dir.frames("frames.npy", &small.frames);
    let colors = |name: &str| {
        let mut reader = ContainerReader::open(Cursor::new(dir.read(name))).expect("a container");
        reader.colors().expect("colours")
    };
    for options in ["", " --max-error 1e-2", " --target-size 30KB"] {
        dir.cager(&format!("{ENCODE}{options}")).succeeds();
        assert_eq!(colors("out.cager"), small.rest.colors, "{options}");
        dir.cager("decode out.cager --cages -o cages.npy --overwrite").succeeds();
        dir.cager("edit out.cager --with-cages cages.npy -o edited.cager --overwrite").succeeds();
        assert_eq!(colors("edited.cager"), small.rest.colors, "{options}");
    }
}

#[test]
fn cages_decode_to_the_same_positions_and_edited_ones_to_moved_ones() {
    let (dir, small) = Dir::with_encoded();
    let points = small.rest.points.len();
    dir.cager("decode out.cager -o model.npy").succeeds();
    let truth = read_frames(&dir.path("model.npy"), points);
    for edited in ["cages.npy", "cages.pc2", "cages/"] {
        dir.cager(&format!("decode out.cager --cages -o {edited}")).succeeds();
        let line = format!("decode out.cager --with-cages {edited} -o same.npy --overwrite");
        dir.cager(&line).succeeds();
        assert!(same(&read_frames(&dir.path("same.npy"), points), &truth), "{edited}");
    }
    // Cages moved as a whole move the model; there may be more or fewer of them.
    let cages = stored(&dir, "out.cager");
    for frames in [3, 20, 40] {
        let edited: Vec<_> = moved(&cages, 2.0).into_iter().cycle().take(frames).collect();
        dir.frames("edited.npy", &edited);
        dir.cager("decode out.cager --with-cages edited.npy -o moved.npy --overwrite").succeeds();
        let found = read_frames(&dir.path("moved.npy"), points);
        assert_eq!(found.len(), frames);
        for (found, truth) in found.iter().zip(truth.iter().cycle()) {
            let worst = found.iter().zip(truth).map(|(a, b)| (a - b - 2.0).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-5, "{worst}");
        }
    }
}

#[test]
fn a_coded_file_stays_as_it_is_where_no_cage_is_edited_and_says_what_other_frames_leave_out() {
    let (dir, _) = Dir::with_capture();
    dir.cager(&format!("{ENCODE} --max-error 1e-3")).succeeds();
    let mut cages = stored(&dir, "out.cager");
    dir.frames("edited.npy", &cages);
    let said = dir.cager("edit out.cager --with-cages edited.npy -o same.cager").succeeds();
    assert_eq!(
        (said.stdout.as_str(), said.stderr.as_str()),
        ("same.cager: 20 frames, none of them with another cage\n", "")
    );
    assert!(dir.read("same.cager") == dir.read("out.cager"));
    cages.pop();
    dir.frames("edited.npy", &cages);
    for line in
        ["edit out.cager --with-cages edited.npy -o edited.cager", "decode out.cager --with-cages edited.npy -o b.npy"]
    {
        let said = dir.cager(line).succeeds();
        assert!(said.stderr.contains("belong to its own frames and are left out"), "{line}: {}", said.stderr);
    }
    let said = dir.cager("inspect edited.cager").succeeds().stdout;
    assert!(!said.contains("guaranteed") && said.contains("not measured"), "{said}");
}

#[test]
fn edited_cages_are_kept_in_a_container_that_decodes_is_inspected_and_is_edited_again() {
    let (dir, small) = Dir::with_encoded();
    let points = small.rest.points.len();
    // Frames 5 to 9 are edited, the others are not.
    let mut cages = stored(&dir, "out.cager");
    cages[5..10].iter_mut().flatten().for_each(|x| *x += 0.5);
    dir.frames("edited.npy", &cages);
    let said = dir.cager("edit out.cager --with-cages edited.npy -o edited.cager").succeeds().stdout;
    assert!(said.contains("20 frames, 5 of them with another cage"), "{said}");
    assert_eq!(stored(&dir, "edited.cager"), cages.iter().map(|c| narrow(c)).collect::<Vec<_>>());
    dir.cager("decode edited.cager -o kept.npy").succeeds();
    dir.cager("decode out.cager --with-cages edited.npy -o direct.npy").succeeds();
    assert_eq!(dir.read("kept.npy"), dir.read("direct.npy"));
    assert_eq!(read_frames(&dir.path("kept.npy"), points).len(), 20);

    let told = dir.cager("inspect edited.cager").succeeds();
    assert!(told.stdout.contains("not measured") && !told.stdout.contains("NaN"), "{}", told.stdout);
    assert!(told.stdout.contains("layer 1   on: frames 5 to 9, 62 vertices"), "{}", told.stdout);
    let json = |name: &str| -> serde_json::Value {
        let said = dir.cager(&format!("inspect --json {name}")).succeeds().stdout;
        serde_json::from_str(&said).expect("JSON")
    };
    let (before, after) = (json("out.cager"), json("edited.cager"));
    assert!(after["error"]["l2_mean"].is_null());
    for frame in 0..20 {
        let (old, new) = (&before["error"]["per_frame"][frame], &after["error"]["per_frame"][frame]);
        assert!(if (5..10).contains(&frame) { new["l2"].is_null() } else { old == new }, "frame {frame}: {new}");
    }
    for key in ["points", "cage_vertices", "coordinates", "singular_values", "frames"] {
        assert_eq!(before[key], after[key], "{key}");
    }

    dir.frames("two.npy", &cages[..2]);
    dir.cager("edit edited.cager --with-cages two.npy -o again.cager").succeeds();
    assert_eq!(json("again.cager")["frames"], 2);
    assert_eq!(json("again.cager")["layers"].as_array().map(Vec::len), Some(0));
    let told = dir.cager("inspect again.cager").succeeds().stderr;
    assert!(told.contains("were edited"), "{told}");
}

fn narrow(cage: &[f64]) -> Vec<f64> {
    cage.iter().map(|&x| f64::from(x as f32)).collect()
}

#[test]
fn edited_cages_that_do_not_fit_are_refused_in_one_sentence() {
    let (dir, small) = Dir::with_encoded();
    let rows = small.cage.vertices.len();
    let mut cages = stored(&dir, "out.cager");
    dir.frames("model.npy", &small.frames);
    let mut fewer = cages.clone();
    fewer.iter_mut().for_each(|cage| cage.truncate(3 * rows - 3));
    dir.frames("fewer.npy", &fewer);
    dir.write("huge.npy", {
        cages[3][3 * 7] = 1e300;
        crate::support::npy_f64(&cages)
    });
    let good = as_model(&small.cage);
    dir.model("posed/1.obj", &good);
    let mut cut = TriMesh::from(&good);
    cut.vertices.pop();
    cut.triangles.retain(|t| t.iter().all(|&v| (v as usize) < rows - 1));
    dir.model("posed/2.obj", &as_model(&cut));
    let (have, want) = (format!("{} points", rows - 1), format!("{rows} vertices"));
    for command in ["decode out.cager -o back.npy", "edit out.cager -o back.cager"] {
        for (file, words) in [
            ("fewer.npy", vec!["fewer.npy", &have, &want]),
            ("model.npy", vec!["model.npy", "frames of the model", &want]),
            ("huge.npy", vec!["huge.npy", "frame 3", "vertex 7", "single precision"]),
            ("posed", vec!["2.obj", "frame 1", &have, &want]),
            ("missing.npy", vec!["missing.npy", "cannot be read"]),
        ] {
            refused(&dir, &format!("{command} --with-cages {file}"), &words);
        }
    }
    refused(
        &dir,
        "edit out.cager --with-cages fewer.npy -o out.cager",
        &["out.cager", "is there already", "--overwrite"],
    );
    dir.frames("cages.npy", &stored(&dir, "out.cager"));
    refused(&dir, "decode out.cager --with-cages cages.npy -o cages.npy", &["cages.npy", "is an input"]);
    assert_eq!(dir.cager("decode out.cager --cages --with-cages cages.npy -o b.npy").run().status, Some(2));
    assert_eq!(dir.cager("edit out.cager -o b.cager").run().status, Some(2));
}

#[test]
fn cages_of_green_coordinates_are_edited() {
    let (dir, small) = Dir::with_capture();
    let rows = small.cage.vertices.len();
    let encode = "encode --rest rest.obj --cage cage.obj --frames frames.npy --frames-range 0-2";
    dir.cager(&format!("{encode} --coordinates green -o green.cager")).succeeds();
    dir.cager("decode green.cager --cages -o green.npy").succeeds();
    dir.cager("decode green.cager --with-cages green.npy -o same.npy").succeeds();
    dir.cager("decode green.cager -o own.npy").succeeds();
    assert_eq!(dir.read("same.npy"), dir.read("own.npy"));
    dir.cager(&format!("{encode} --coordinates green-free -o free.cager")).succeeds();
    let said = dir.cager("decode free.cager --cages -o free.npy").succeeds();
    assert!(said.stderr.contains("normals of each cage are left out"), "{}", said.stderr);
    assert_eq!(read_frames(&dir.path("free.npy"), rows).len(), 3);
    // Its normals stay.
    dir.cager("decode free.cager --with-cages free.npy -o same.npy --overwrite").succeeds();
    dir.cager("decode free.cager -o own.npy --overwrite").succeeds();
    assert_eq!(dir.read("same.npy"), dir.read("own.npy"));
}

#[test]
fn the_frame_rate_of_a_capture_is_kept_through_its_cages() {
    let (dir, small) = Dir::with_encoded();
    let path = dir.path("walk.mdd");
    let options = FrameOptions { fps: 60.0, ..FrameOptions::default() };
    let mut writer = create_frames(&path, small.rest.points.len(), 20, &small.rest.faces, &options).expect("a cache");
    for frame in &small.frames {
        writer.write_frame(&frame.iter().map(|&x| x as f32).collect::<Vec<_>>()).expect("a frame");
    }
    writer.finish().expect("a cache");
    dir.cager("encode --rest rest.obj --cage cage.obj --frames walk.mdd -o walk.cager").succeeds();
    dir.cager("decode walk.cager --cages -o cages.mdd").succeeds();
    dir.cager("edit walk.cager --with-cages cages.mdd -o edited.cager").succeeds();
    dir.cager("decode edited.cager -o back.mdd").succeeds();
    let times = 8..8 + 4 * 20;
    assert_eq!(dir.read("cages.mdd")[times.clone()], dir.read("walk.mdd")[times.clone()]);
    assert_eq!(dir.read("back.mdd")[times.clone()], dir.read("walk.mdd")[times]);
}
