//! Some frames of a capture, and names with a place for the number: `--frames-range`, `--frame`, `--range`, `%04d`, `####`.

use crate::cages_out::same;
use crate::refused::refused;
use crate::support::{Dir, ENCODE, read_cages, read_frames};

#[test]
fn encode_takes_a_range_of_frames_and_decode_gives_one() {
    let (dir, small) = Dir::with_encoded();
    let points = small.rest.points.len();
    let whole = read_cages(&dir.path("out.cager"));
    for (range, frames) in [("0-19", (0..20).collect()), ("4-9", (4..10).collect()), ("3-18x5", vec![3, 8, 13, 18])] {
        dir.cager(&ENCODE.replace("out.cager", &format!("part.cager --frames-range {range}"))).succeeds();
        let wanted: Vec<_> = frames.iter().map(|&k: &usize| whole[k].clone()).collect();
        assert_eq!(read_cages(&dir.path("part.cager")), wanted, "{range}");
        dir.cager(&format!("decode out.cager --range {range} -o part.npy --overwrite")).succeeds();
        dir.cager("decode part.cager -o direct.npy --overwrite").succeeds();
        assert_eq!(dir.read("part.npy"), dir.read("direct.npy"), "{range}");
    }
    dir.cager("decode out.cager -o all.npy").succeeds();
    let all = read_frames(&dir.path("all.npy"), points);
    dir.cager("decode out.cager --frame 7 -o one.npy").succeeds();
    assert_eq!(read_frames(&dir.path("one.npy"), points), [all[7].clone()]);
    // Cages, and edited ones, have ranges too.
    dir.cager("decode out.cager --cages --range 2-4 -o cages.npy").succeeds();
    dir.cager("decode out.cager --with-cages cages.npy --frame 1 -o edited.npy").succeeds();
    assert_eq!(read_frames(&dir.path("edited.npy"), points), [all[3].clone()]);
}

#[test]
fn files_of_a_range_keep_the_numbers_of_their_frames() {
    let (dir, _) = Dir::with_encoded();
    dir.cager("decode out.cager --range 3-18x5 -o part").succeeds();
    assert_eq!(dir.names("part"), ["frame_0003.obj", "frame_0008.obj", "frame_0013.obj", "frame_0018.obj"]);
    dir.cager("decode out.cager --frame 12 -o one/*.ply").succeeds();
    assert_eq!(dir.names("one"), ["frame_0012.ply"]);
}

#[test]
fn printf_and_hash_patterns_name_sequences_in_and_out() {
    let (dir, small) = Dir::with_encoded();
    let points = small.rest.points.len();
    dir.cager("decode out.cager -o all.npy").succeeds();
    let all = read_frames(&dir.path("all.npy"), points);
    for (output, third) in
        [("a/walk.%04d.obj", "walk.0003.obj"), ("b/walk_##.ply", "walk_03.ply"), ("c/%d.obj", "3.obj")]
    {
        dir.cager(&format!("decode out.cager -o {output}")).succeeds();
        assert!(dir.names(&output[..1]).contains(&third.to_owned()), "{:?}", dir.names(&output[..1]));
        // Other files in the folder are no frames.
        dir.write(&format!("{}/walk.rest.obj", &output[..1]), "v 0 0 0\n");
        dir.write(&format!("{}/notes.txt", &output[..1]), "none");
        assert!(same(&read_frames(&dir.path(output), points), &all), "{output}");
    }
    for (frames, output) in [("a/walk.%04d.obj", "printf"), ("a/walk.####.obj", "hashes")] {
        dir.cager(&format!("encode --rest rest.obj --cage cage.obj --frames {frames} -o {output}.cager")).succeeds();
    }
    assert_eq!(dir.read("printf.cager"), dir.read("hashes.cager"));
}

#[test]
fn numbered_names_in_a_folder_that_holds_others_are_written_beside_them() {
    let (dir, small) = Dir::with_encoded();
    let points = small.rest.points.len();
    let others = dir.contents();
    let kept = |dir: &Dir| others.iter().all(|(path, bytes)| dir.contents().get(path) == Some(bytes));
    dir.cager("decode out.cager -o all.npy").succeeds();
    let all = read_frames(&dir.path("all.npy"), points);
    std::fs::create_dir(dir.path("sub")).expect("a folder");
    dir.write("sub/notes.txt", "kept");
    for pattern in ["d.####.obj", "./e.%04d.ply", "sub/f_##.obj"] {
        dir.cager(&format!("decode out.cager -o {pattern}")).succeeds();
        assert!(same(&read_frames(&dir.path(pattern), points), &all) && kept(&dir), "{pattern}");
        // Those that are there are replaced with --overwrite alone, and none that would stay among the new ones goes.
        let first = pattern.replace("####", "0003").replace("%04d", "0003").replace("##", "03");
        let line = format!("decode out.cager --range 3-5 -o {pattern}");
        refused(&dir, &line, &["is there already", pattern, "--overwrite"]);
        let there = dir.contents();
        refused(
            &dir,
            &format!("{line} --overwrite"),
            &["and 16 more with such a name are no frames of what is written"],
        );
        assert!(dir.contents() == there, "{pattern}");
        dir.cager(&format!("decode out.cager -o {pattern} --overwrite")).succeeds();
        assert_eq!(read_frames(&dir.path(pattern), points).len(), 20, "{pattern}");
        assert!(dir.path(&first).exists() && kept(&dir), "{pattern}");
    }
    // Also in a folder with nothing but frames, and of more digits than are written.
    dir.cager("decode out.cager --range 3-5 -o own/d.####.obj").succeeds();
    dir.cager("decode out.cager --range 3-5 -o own/d.####.obj --overwrite").succeeds();
    dir.write("own/d.12345.obj", "v 0 0 0\n");
    let line = "decode out.cager --range 3-5 -o own/d.####.obj --overwrite";
    refused(&dir, line, &["d.12345.obj: is no frame of what is written"]);
    assert_eq!(dir.names("own").len(), 4);
    let said = dir.cager("decode out.cager --frame 3 -o i.####.npy").succeeds();
    assert!(said.stderr.contains("i.####.npy: a file of this format holds all frames"), "{}", said.stderr);
    assert!(said.stdout.contains("1 frame of "), "{}", said.stdout);
    assert!(dir.path("sub/notes.txt").exists());
    // Read from there again, and not written over what is read.
    dir.cager("decode out.cager --cages -o c.####.obj").succeeds();
    refused(
        &dir,
        "decode out.cager --with-cages c.####.obj -o c.####.obj --overwrite",
        &["c.####.obj: names ", "an input"],
    );
    dir.cager("encode --rest rest.obj --cage cage.obj --frames d.####.obj -o again.cager").succeeds();
    let names: Vec<String> = dir.names("").into_iter().filter(|name| name.starts_with(".cager")).collect();
    assert!(names.is_empty(), "{names:?}");
}

#[test]
fn ranges_and_patterns_that_name_nothing_are_refused() {
    let (dir, _) = Dir::with_encoded();
    let encode = ENCODE.replace("out.cager", "part.cager");
    refused(&dir, &format!("{encode} --frames-range 5-20"), &["frames.npy", "has frames 0 to 19", "5-20"]);
    refused(&dir, "decode out.cager --range 5-20 -o part.npy", &["out.cager", "has frames 0 to 19", "5-20"]);
    refused(&dir, "decode out.cager --frame 20 -o part.npy", &["out.cager", "has frames 0 to 19", "frame 20"]);
    refused(&dir, "decode out.cager --cages --frame 20 -o part.npy", &["out.cager", "frame 20"]);
    refused(&dir, &encode.replace("frames.npy", "f.####.obj"), &["f.####.obj", "matches no file"]);
    refused(&dir, "decode out.cager -o part/f.####.stl", &["f.####.stl", ".obj or .ply"]);
    for wrong in [
        format!("{encode} --frames-range 9-5"),
        format!("{encode} --frames-range 5"),
        "decode out.cager --range 1-9x0 -o part.npy".to_owned(),
        "decode out.cager --frame 1 --range 1-9 -o part.npy".to_owned(),
    ] {
        assert_eq!(dir.cager(&wrong).run().status, Some(2), "{wrong}");
    }
}
