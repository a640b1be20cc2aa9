//! Layers of edits: `edit` adds, takes back, switches and flattens them; frames that nobody edited keep every bit, details beside the cages included.

use crate::refused::refused;
use crate::support::{Dir, ENCODE, Small, largest, measure, read_cages, read_frames};
use cager_core::cage::Cage;
use cager_core::coordinates::{self, ElementPlan};
use cager_proto::container::ContainerReader;
use serde_json::Value;
use std::io::Cursor;

/// The vertex that is moved, and its frames.
const VERTEX: usize = 7;
const EDITED: std::ops::Range<usize> = 3..17;

/// Moves the vertex in these frames as far as a hundredth of the model for each of them.
fn moved(cages: &[Vec<f64>], frames: std::ops::Range<usize>, size: f64) -> Vec<Vec<f64>> {
    let mut out = cages.to_vec();
    for (step, frame) in frames.enumerate() {
        for k in 0..3 {
            let x = &mut out[frame][3 * VERTEX + k];
            *x = f64::from((*x + 0.01 * size * (step + k + 1) as f64) as f32);
        }
    }
    out
}

/// Vertices of the cages, and positions.
fn decoded(dir: &Dir, small: &Small, file: &str) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    dir.cager(&format!("decode {file} --cages -o cages.npy --overwrite")).succeeds();
    dir.cager(&format!("decode {file} -o back.npy --overwrite")).succeeds();
    let rows = small.cage.vertices.len();
    (read_frames(&dir.path("cages.npy"), rows), read_frames(&dir.path("back.npy"), small.rest.points.len()))
}

fn farthest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn inspected(dir: &Dir, file: &str) -> Value {
    let said = dir.cager(&format!("inspect --json {file}")).succeeds().stdout;
    serde_json::from_str(&said).expect("JSON")
}

/// The column of the coordinates of the vertex, computed here.
fn column(dir: &Dir, file: &str) -> Vec<f64> {
    let mut reader = ContainerReader::open(Cursor::new(dir.read(file))).expect("a container");
    let system = coordinates::by_name(&reader.header().coordinates).expect("a system");
    let points = reader.rest().expect("a rest pose").points;
    let cage = Cage::new(reader.cage().expect("a cage")).expect("a cage");
    let plan = reader.elements().expect("elements").map(ElementPlan::from_bytes);
    let phi = system.coordinates(&cage, &points, plan.as_ref()).expect("coordinates").phi;
    (0..points.len()).map(|point| phi[(point, VERTEX)]).collect()
}

#[test]
fn an_edit_moves_the_model_by_its_coordinates_and_leaves_all_other_frames_alone() {
    let (dir, small) = Dir::with_capture();
    let size = cager_geometry::mesh::diagonal(&small.rest.points);
    for system in ["mvc", "harmonic", "green", "green-free"] {
        for coded in ["", " --max-error 1e-3"] {
            let what = format!("{system}{coded}");
            dir.cager(&format!("{ENCODE} --coordinates {system}{coded} --force")).succeeds();
            let (cages, before) = decoded(&dir, &small, "out.cager");
            let edited = moved(&cages, EDITED, size);
            dir.frames("edited.npy", &edited);
            let said = dir.cager("edit out.cager --with-cages edited.npy -o edited.cager --overwrite").succeeds();
            assert!(said.stdout.contains("20 frames, 14 of them with another cage; layer 1 moves 1 of"), "{said:?}");
            assert_eq!(said.stderr, "", "{what}");
            let (was, is) = (dir.read("out.cager"), dir.read("edited.cager"));
            assert!(is.len() < was.len() + 500, "{what}: {} bytes more", is.len() - was.len());
            let (now, after) = decoded(&dir, &small, "edited.cager");
            dir.cager("decode out.cager --with-cages edited.npy -o direct.npy --overwrite").succeeds();
            assert!(dir.read("direct.npy") == dir.read("back.npy"), "{what}: as edited cages decode directly");
            let phi = (system != "green").then(|| column(&dir, "out.cager"));
            for frame in 0..20 {
                if !EDITED.contains(&frame) {
                    assert!(before[frame] == after[frame] && cages[frame] == now[frame], "{what}: frame {frame}");
                    continue;
                }
                assert!(farthest(&now[frame], &edited[frame]) < 1e-6 * size, "{what}: the cage of frame {frame}");
                let Some(phi) = &phi else { continue };
                let change = |k: usize| now[frame][3 * VERTEX + k] - cages[frame][3 * VERTEX + k];
                let right: Vec<f64> =
                    before[frame].iter().enumerate().map(|(i, x)| x + phi[i / 3] * change(i % 3)).collect();
                let off = farthest(&after[frame], &right);
                assert!(off < 2e-6 * size, "{what}: frame {frame} is off by {off}");
                assert!(farthest(&after[frame], &before[frame]) > 1e-3 * size, "{what}: frame {frame}");
            }
            if system == "green" {
                // What is beside the cages is added as before.
                let cages_alone = |file: &str| {
                    dir.cager(&format!("decode {file} --layer cages -o alone.npy --overwrite")).succeeds();
                    read_frames(&dir.path("alone.npy"), small.rest.points.len())
                };
                let (old, new) = (cages_alone("out.cager"), cages_alone("edited.cager"));
                for frame in EDITED {
                    let right: Vec<f64> =
                        before[frame].iter().zip(&old[frame]).zip(&new[frame]).map(|((b, o), n)| b - o + n).collect();
                    assert!(farthest(&after[frame], &right) < 2e-6 * size, "frame {frame}");
                }
            }
            dir.cager("edit edited.cager --remove -o again.cager --overwrite").succeeds();
            assert!(dir.read("again.cager") == was, "{what}: taken back");
        }
    }
}

#[test]
fn layers_stack_are_switched_taken_back_and_listed() {
    let (dir, small) = Dir::with_capture();
    let size = cager_geometry::mesh::diagonal(&small.rest.points);
    dir.cager(&format!("{ENCODE} --max-error 1e-3 --start 1001")).succeeds();
    let (cages, _) = decoded(&dir, &small, "out.cager");
    let one = moved(&cages, 3..5, size);
    dir.frames("one.npy", &one);
    dir.cager("edit out.cager --with-cages one.npy --name smile -o a.cager").succeeds();
    dir.frames("two.npy", &moved(&one, 4..20, 3.0 * size));
    dir.cager("edit a.cager --with-cages two.npy -o b.cager").succeeds();
    let told = dir.cager("inspect b.cager").succeeds().stdout;
    for line in ["layer 1   on smile: frames 1004 to 1005, 1 vertex", "layer 2   on: frames 1005 to 1020, 1 vertex"] {
        assert!(told.contains(line), "{told}");
    }
    assert!(told.contains("of the diagonal from the captured motion with its edits added;"), "{told}");
    assert!(told.contains("guaranteed") && told.contains("not measured") && told.contains("EDIT"), "{told}");
    let json = inspected(&dir, "b.cager");
    assert_eq!(json["layers"][0]["name"], "smile");
    assert_eq!(json["layers"][1]["first"], 1005.0);
    assert_eq!(json["layers"][1]["on"], true);
    let per_frame = json["error"]["per_frame"].as_array().expect("errors");
    assert_eq!(per_frame.iter().filter(|error| error["linf"].is_null()).count(), 17);

    let second = decoded(&dir, &small, "b.cager");
    let said = dir.cager("edit b.cager --off 1 -o off.cager").succeeds().stdout;
    assert_eq!(said, "off.cager: layer 1 (smile) is off\n");
    let off = decoded(&dir, &small, "off.cager");
    assert!(off.1[3] == decoded(&dir, &small, "out.cager").1[3] && off.1[9] == second.1[9]);
    assert!(dir.cager("inspect off.cager").succeeds().stdout.contains("layer 1   off smile"));
    dir.cager("edit off.cager --on 1 -o on.cager").succeeds();
    assert!(dir.read("on.cager") == dir.read("b.cager"));
    assert!(dir.cager("edit on.cager --on 1 -o same.cager").succeeds().stdout.contains("is on already"));
    // A damaged one is taken back by its number, and none of those that stay may be.
    let mut bytes = dir.read("b.cager");
    let at = bytes.windows(4).position(|tag| tag == b"EDIT").expect("a layer");
    bytes[at + 40] ^= 1;
    dir.write("hurt.cager", &bytes);
    dir.cager("edit b.cager --remove 1 -o sound.cager").succeeds();
    refused(&dir, "edit hurt.cager --off 2 -o x.cager", &["hurt.cager", "--remove 1 takes back just that"]);
    refused(&dir, "edit hurt.cager --remove 2 -o x.cager", &["hurt.cager: layer 1 is damaged", "--remove all"]);
    dir.cager("edit hurt.cager --remove 1 -o mended.cager").succeeds();
    assert!(dir.read("mended.cager") == dir.read("sound.cager"));
    // In any order, all at once, and in place of the file itself.
    dir.cager("edit b.cager --remove 1 -o second.cager").succeeds();
    dir.cager("edit second.cager --remove -o none.cager").succeeds();
    dir.cager("edit b.cager --remove all -o all.cager").succeeds();
    assert!(dir.read("none.cager") == dir.read("out.cager") && dir.read("all.cager") == dir.read("out.cager"));
    refused(&dir, "edit b.cager --remove 2 -o b.cager", &["b.cager", "--overwrite"]);
    dir.cager("edit b.cager --remove 2 -o ./b.cager --overwrite").succeeds();
    assert!(dir.read("b.cager") == dir.read("a.cager"));
    for (line, words) in [
        ("edit a.cager --remove 2 -o x.cager", ["a.cager: --remove 2", "the numbers 1 to 1"]),
        ("edit a.cager --off 0 -o x.cager", ["a.cager: --off 0", "the numbers 1 to 1"]),
        ("edit out.cager --remove -o x.cager", ["out.cager: has no layer of edits", "--with-cages"]),
    ] {
        refused(&dir, line, &words);
    }
    for line in [
        "edit a.cager --remove first -o x.cager",
        "edit a.cager --remove --on 1 -o x.cager",
        "edit a.cager --name smile -o x.cager",
        "edit a.cager -o x.cager",
    ] {
        assert_eq!(dir.cager(line).run().status, Some(2), "{line}");
    }
}

#[test]
fn a_flattened_file_decodes_to_the_same_positions_without_layers() {
    let (dir, small) = Dir::with_capture();
    let size = cager_geometry::mesh::diagonal(&small.rest.points);
    for options in ["", " --max-error 1e-3"] {
        dir.cager(&format!("{ENCODE}{options}")).succeeds();
        let (cages, before) = decoded(&dir, &small, "out.cager");
        dir.frames("edited.npy", &moved(&cages, EDITED, size));
        dir.cager("edit out.cager --with-cages edited.npy -o edited.cager --overwrite").succeeds();
        dir.cager("edit edited.cager --flatten -o flat.cager --overwrite").succeeds();
        dir.cager("edit out.cager --with-cages edited.npy --flatten -o once.cager --overwrite").succeeds();
        assert!(dir.read("once.cager") == dir.read("flat.cager"), "{options}");
        let (layered, flat) = (decoded(&dir, &small, "edited.cager"), decoded(&dir, &small, "flat.cager"));
        assert!(layered.0 == flat.0, "{options}");
        for frame in 0..20 {
            assert!(farthest(&layered.1[frame], &flat.1[frame]) < 1e-6 * size, "{options}: frame {frame}");
        }
        let json = inspected(&dir, "flat.cager");
        assert_eq!(json["layers"].as_array().map(Vec::len), Some(0));
        assert!(json["error"]["per_frame"][5]["l2"].is_null() && json["error"]["per_frame"][1]["l2"].is_f64());
        // The bound still holds where nothing was edited.
        let errors = measure(&small.rest.points, &small.frames[..3], &flat.1[..3]);
        assert!(options.is_empty() || largest(&errors.linf) <= 1e-3, "{:?}", errors.linf);
        // Layers that are off are left out, and that is said.
        dir.cager("edit edited.cager --off 1 -o off.cager --overwrite").succeeds();
        let said = dir.cager("edit off.cager --flatten -o plain.cager --overwrite").succeeds();
        assert!(said.stderr.contains("off.cager: 1 layer switched off"), "{}", said.stderr);
        assert!(said.stdout.contains("no layer was on, so the layers are gone"), "{}", said.stdout);
        assert!(decoded(&dir, &small, "plain.cager").1 == before, "{options}");
    }
}

#[test]
fn cages_that_no_program_changed_are_no_edit_in_any_format() {
    let (dir, small) = Dir::with_capture();
    dir.cager(
        &format!("{ENCODE} --max-error 1e-3 --unit cm --frames-up z --rest-up z")
            .replace(" --frames-up z --rest-up z", ""),
    )
    .succeeds();
    let (cages, _) = decoded(&dir, &small, "out.cager");
    for name in ["c.npy", "c.pc2", "c.mdd", "c.mcx", "c.abc", "c.usdc", "c/", "p/*.ply"] {
        dir.cager(&format!("decode out.cager --cages -o {name} --overwrite")).succeeds();
        let said =
            dir.cager(&format!("edit out.cager --with-cages {name} -o same.cager --overwrite")).succeeds().stdout;
        assert!(said.contains("none of them with another cage"), "{name}: {said}");
        assert!(dir.read("same.cager") == dir.read("out.cager"), "{name}");
    }
    // What other programs write as text has six decimals.
    let mut rounded = moved(&cages, 4..5, 1.0);
    rounded.iter_mut().flatten().for_each(|x| *x = (*x * 1e6).round() / 1e6);
    dir.write("six.npy", crate::support::npy_f64(&rounded));
    let said = dir.cager("edit out.cager --with-cages six.npy -o six.cager").succeeds().stdout;
    assert!(said.contains("1 of them with another cage; layer 1 moves 1 of"), "{said}");
    assert!(read_cages(&dir.path("six.cager"))[3] == read_cages(&dir.path("out.cager"))[3]);
}

#[test]
fn a_part_of_the_frames_is_edited_alone() {
    let (dir, small) = Dir::with_capture();
    dir.cager(&format!("{ENCODE} --max-error 1e-3 --coordinates green-free")).succeeds();
    let (cages, _) = decoded(&dir, &small, "out.cager");
    let all = moved(&cages, 0..20, 1.0);
    dir.frames("all.npy", &all);
    dir.frames("part.npy", &all[5..9]);
    let line = "edit out.cager --frames-range 5-8";
    dir.cager(&format!("{line} --with-cages all.npy -o a.cager")).succeeds();
    dir.cager(&format!("{line} --with-cages part.npy -o b.cager")).succeeds();
    assert!(dir.read("a.cager") == dir.read("b.cager"));
    let layer = &inspected(&dir, "a.cager")["layers"][0];
    assert_eq!((&layer["first"], &layer["last"], &layer["frames"]), (&5.0.into(), &8.0.into(), &4.into()));
    dir.frames("two.npy", &all[..2]);
    refused(
        &dir,
        &format!("{line} --with-cages two.npy -o c.cager"),
        &["two.npy", "has 2 frames", "4 are edited of 20"],
    );
    let line = "edit out.cager --with-cages all.npy --frames-range 18-20 -o c.cager";
    refused(&dir, line, &["out.cager", "has frames 0 to 19"]);
    // Frames that are added have no normals.
    refused(
        &dir,
        "edit out.cager --with-cages two.npy -o c.cager",
        &["two.npy", "no normals", "green or mvc coordinates"],
    );
    dir.cager("decode out.cager --with-cages all.npy -o moved.npy").succeeds();
    refused(&dir, "decode out.cager --with-cages two.npy -o x.npy", &["two.npy", "no normals"]);
}

#[test]
fn every_command_that_reads_a_file_sees_its_edits() {
    let (dir, small) = Dir::with_capture();
    let size = cager_geometry::mesh::diagonal(&small.rest.points);
    dir.cager(&format!("{ENCODE} --max-error 1e-3")).succeeds();
    let (cages, unedited) = decoded(&dir, &small, "out.cager");
    dir.frames("edited.npy", &moved(&cages, 0..20, 0.3 * size));
    dir.cager("edit out.cager --with-cages edited.npy -o edited.cager").succeeds();
    let (_, positions) = decoded(&dir, &small, "edited.cager");
    let points = small.rest.points.len();
    for name in ["e.pc2", "e.mdd", "e.mcx", "e.abc", "e.usdc", "e.glb", "e/"] {
        dir.cager(&format!("decode edited.cager -o {name}")).succeeds();
        let found = read_frames(&dir.path(name), points);
        let off = found.iter().zip(&positions).map(|(a, b)| farthest(a, b)).fold(0.0, f64::max);
        // Of a .glb, targets are rounded.
        assert!(off < 2e-4 * size && found.len() == 20, "{name}: {off}");
    }
    dir.cager("decode edited.cager -o with.usdc --with-cage").succeeds();
    dir.cager("decode edited.cager --model rest.obj -o model.npy").succeeds();
    dir.cager("decode edited.cager --layer cages -o alone.npy").succeeds();
    dir.cager("decode out.cager --layer cages -o before.npy").succeeds();
    let read = |name: &str| read_frames(&dir.path(name), points);
    let (model, alone, before) = (read("model.npy"), read("alone.npy"), read("before.npy"));
    for frame in 0..20 {
        // The model in the file is off by what its steps leave.
        assert!(farthest(&model[frame], &alone[frame]) < 2e-3 * size, "frame {frame}");
        let right = (0..3 * points).map(|k| alone[frame][k] + unedited[frame][k] - before[frame][k]);
        assert!(farthest(&positions[frame], &right.collect::<Vec<_>>()) < 2e-6 * size, "frame {frame}");
    }
    // Moved onto itself by a coarse cage, the model follows the edits.
    for file in ["out.cager", "edited.cager"] {
        dir.cager(&format!("transfer --source {file} --target rest.obj --method rigid -o moved-{file}")).succeeds();
    }
    let [was, is] = ["moved-out", "moved-edited"].map(|file| {
        dir.cager(&format!("decode {file}.cager -o {file}.npy")).succeeds();
        read(&format!("{file}.npy"))
    });
    let (mut most, mut off) = (0.0_f64, 0.0_f64);
    for frame in 0..20 {
        let change = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>();
        let (right, found) = (change(&positions[frame], &unedited[frame]), change(&is[frame], &was[frame]));
        off = off.max(farthest(&found, &right));
        most = most.max(farthest(&right, &vec![0.0; right.len()]));
    }
    assert!(off < 0.5 * most, "{off} of {most}");
}

#[test]
fn a_file_that_was_cut_in_its_layers_has_its_frames_and_says_what_is_lost() {
    let (dir, small) = Dir::with_capture();
    dir.cager(&format!("{ENCODE} --max-error 1e-3")).succeeds();
    let (cages, before) = decoded(&dir, &small, "out.cager");
    let one = moved(&cages, 3..5, 1.0);
    dir.frames("one.npy", &one);
    dir.cager("edit out.cager --with-cages one.npy -o a.cager").succeeds();
    dir.frames("two.npy", &moved(&one, 8..9, 1.0));
    dir.cager("edit a.cager --with-cages two.npy -o b.cager").succeeds();
    let (_, after) = decoded(&dir, &small, "b.cager");
    let bytes = dir.read("b.cager");
    let at = bytes.windows(4).enumerate().filter(|(_, tag)| tag == b"EDIT").map(|(at, _)| at).collect::<Vec<_>>();
    dir.write("cut.cager", &bytes[..at[1] + 50]);
    let said = dir.cager("decode cut.cager --salvage -o cut.npy").succeeds().stderr;
    assert!(said.contains("cut.cager: its end is missing or damaged: layers of edits"), "{said}");
    let found = read_frames(&dir.path("cut.npy"), small.rest.points.len());
    assert!(found[3] == after[3] && found[8] == before[8]);
    let mut damaged = bytes;
    damaged[at[0] + 45] ^= 1;
    dir.write("damaged.cager", &damaged);
    refused(&dir, "decode damaged.cager -o x.npy", &["damaged.cager", "is damaged at byte"]);
    refused(&dir, "inspect damaged.cager", &["damaged.cager", "is damaged at byte"]);
    let said = dir.cager("decode damaged.cager --salvage -o whole.npy").succeeds().stderr;
    assert!(said.contains("damaged.cager: 1 of its layers of edits are damaged and left out"), "{said}");
    let found = read_frames(&dir.path("whole.npy"), small.rest.points.len());
    assert!(found[3] == before[3] && found[8] == after[8]);
}
