//! One animation from surfaces that share nothing: `recover`.

use crate::refused::refused;
use crate::support::{Dir, mean, measure, polygons, read_frames};
use cager_demo::{Capture, Options};
use cager_geometry::mesh::{Model, Point, TriMesh, diagonal};
use cager_geometry::vector::{add, centroid, mean as average};
use cager_proto::container::ContainerReader;
use cager_shape::registration::{Observation, ObservationOptions};
use std::fmt::Write;

/// The built-in figure and some frames of it.
struct Dance {
    rest: Model,
    frames: Vec<Vec<f64>>,
}

impl Dance {
    fn new() -> Self {
        Self::of(8)
    }

    fn of(frames: usize) -> Self {
        let capture = Capture::new(&Options { points: 1500, frames: 40, cage_vertices: 120 });
        let mut frame = Vec::new();
        let frames = (0..frames).map(|t| {
            capture.frame(t, &mut frame);
            frame.clone()
        });
        let frames: Vec<Vec<f64>> = frames.collect();
        // The template is the figure as it stands in the first frame.
        let rest = Model { points: frames[0].as_chunks().0.to_vec(), ..capture.rest };
        Self { rest, frames }
    }

    fn posed(&self, frame: usize) -> Model {
        Model { points: self.frames[frame].as_chunks().0.to_vec(), ..self.rest.clone() }
    }

    /// Points drawn anew of a frame, with normals.
    fn seen(&self, frame: usize, points: usize) -> Observation {
        drawn(&self.posed(frame), frame, points)
    }
}

/// Points drawn on a model by the number of its frame, with normals.
fn drawn(model: &Model, frame: usize, points: usize) -> Observation {
    let mesh = TriMesh::from(model);
    let options = ObservationOptions { points, seed: 77 + frame as u64 };
    Observation::of_mesh(&mesh.vertices, &mesh.triangles, &options).expect("a surface").0
}

pub(crate) fn ply(seen: &Observation, normals: bool) -> String {
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", seen.points.len());
    let names: &[&str] = if normals { &["x", "y", "z", "nx", "ny", "nz"] } else { &["x", "y", "z"] };
    names.iter().for_each(|name| writeln!(text, "property float {name}").expect("text"));
    text += "end_header\n";
    for ([x, y, z], [a, b, c]) in seen.points.iter().zip(&seen.normals) {
        let end = if normals { format!(" {a} {b} {c}") } else { String::new() };
        writeln!(text, "{x} {y} {z}{end}").expect("text");
    }
    text
}

/// A mesh with other vertices than the model: the centre of each face, joined to its corners, each face's own, in another order, turned inwards if so asked.
fn remeshed(model: &Model, inwards: bool) -> Model {
    let (mut points, mut faces) = (Vec::<Point>::new(), Vec::new());
    let triangles = model.faces.triangulated();
    for triangle in triangles.iter().rev() {
        let corners = triangle.map(|v| model.points[v as usize]);
        let first = points.len() as u32;
        points.extend(corners);
        points.push(centroid(corners));
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let (a, b) = if inwards { (b, a) } else { (a, b) };
            faces.push(vec![first + a, first + b, first + 3]);
        }
    }
    Model { points, faces: polygons(faces), ..Model::default() }
}

/// Where the recovered points are, off the true ones, as a share of the diagonal: root mean square of each frame.
fn error(dir: &Dir, dance: &Dance) -> f64 {
    dir.cager("decode out.cager -o out.npy --overwrite").succeeds();
    let found = read_frames(&dir.path("out.npy"), dance.rest.points.len());
    assert_eq!(found.len(), dance.frames.len());
    mean(&measure(&dance.rest.points, &dance.frames, &found).l2)
}

const RECOVER: &str = "recover --template rest.obj --frames scan_*.ply -o out.cager";

#[test]
fn a_figure_is_recovered_from_clouds_drawn_anew_in_every_frame() {
    let (dir, dance) = (Dir::new(), Dance::new());
    dir.model("rest.obj", &dance.rest);
    for frame in 0..dance.frames.len() {
        dir.write(&format!("scan_{}.ply", 5 + frame), ply(&dance.seen(frame, 4000 + 100 * frame), true));
    }
    let said = dir.cager(&format!("{RECOVER} --report report.json --fps 25")).succeeds();
    assert_eq!(said.stderr, "");
    assert!(said.stdout.contains("8 frames of") && said.stdout.contains("0 lost"), "{}", said.stdout);
    let moved = measure(&dance.rest.points, &dance.frames, &vec![dance.frames[0].clone(); 8]);
    let found = error(&dir, &dance);
    assert!(found < 0.006 && found < 0.15 * mean(&moved.l2), "{found} of {}", mean(&moved.l2));

    let report = dir.json("report.json");
    let frames = report["frames"].as_array().expect("frames");
    assert_eq!((frames.len(), frames[0]["number"].as_f64()), (8, Some(5.0)));
    assert!(frames.iter().all(|frame| frame["from_surface"]["mean"].as_f64().expect("a distance") < 0.002));
    assert!(report["lost"].as_array().expect("a list").is_empty());
    // The numbers of the files and the rate are those of the capture.
    let shown = dir.cager("inspect out.cager --json").succeeds();
    let shown: serde_json::Value = serde_json::from_str(&shown.stdout).expect("JSON");
    assert_eq!(shown["frame_rate"].as_f64(), Some(25.0));
    assert_eq!(shown["frame_numbers"][7].as_f64(), Some(12.0));

    // The same on any number of threads.
    let first = dir.read("out.cager");
    dir.cager(&format!("{RECOVER} --overwrite --threads 1 --fps 25")).succeeds();
    assert!(dir.read("out.cager") == first, "another number of threads gives another file");
}

#[test]
fn colours_of_the_surfaces_are_those_of_the_template_where_asked() {
    let (dir, dance) = (Dir::new(), Dance::of(4));
    dir.model("rest.obj", &dance.rest);
    let color = |p: &Point| if p[1] > 0.0 { [250, 20, 30] } else { [10, 20, 240] };
    let colors: Vec<[u8; 3]> = dance.rest.points.iter().map(color).collect();
    for frame in 0..4 {
        dir.model(&format!("scan_{frame}.obj"), &Model { colors: colors.clone(), ..dance.posed(frame) });
    }
    let plain = RECOVER.replace(".ply", ".obj");
    dir.cager(&plain).succeeds();
    let found = |dir: &Dir| {
        let file = std::fs::File::open(dir.path("out.cager")).expect("a container");
        ContainerReader::open(std::io::BufReader::new(file)).expect("a container").colors().expect("colours")
    };
    assert!(found(&dir).is_empty());
    assert_eq!(dir.cager(&format!("{plain} --colors --overwrite")).succeeds().stderr, "");
    let found = found(&dir);
    let same = found.iter().zip(&colors).filter(|(a, b)| a.iter().zip(*b).all(|(a, b)| a.abs_diff(*b) < 40)).count();
    assert!(found.len() == colors.len() && same * 100 > 95 * found.len(), "{same} of {}", found.len());
}

#[test]
fn inward_meshes_and_clouds_without_normals_are_followed_and_told() {
    let (dir, dance) = (Dir::new(), Dance::new());
    dir.model("rest.obj", &dance.rest);
    for frame in 0..dance.frames.len() {
        let name = format!("scan_{frame}.ply");
        if frame % 2 == 0 {
            cager_formats::write_model(&dir.path(&name), &remeshed(&dance.posed(frame), frame == 4)).expect("a mesh");
        } else {
            dir.write(&name, ply(&dance.seen(frame, 6000), false));
        }
    }
    let said = dir.cager(&format!("{RECOVER} --offsets --max-error 1e-3")).succeeds();
    assert!(said.stderr.contains("faced inwards, and was turned, in frames: 4\n"), "{}", said.stderr);
    assert!(said.stderr.contains("normals, so they were estimated, in frames: 1, 3, 5, 7\n"), "{}", said.stderr);
    let found = error(&dir, &dance);
    assert!(found < 0.008, "{found}");
}

#[test]
fn templates_that_are_turned_or_of_another_size_are_refused_and_brought_to_the_first_surface_when_asked() {
    let (dir, dance) = (Dir::new(), Dance::new());
    for frame in 0..dance.frames.len() {
        dir.write(&format!("scan_{frame}.ply"), ply(&dance.seen(frame, 5000), true));
    }
    let (sine, cosine) = 1.2_f64.sin_cos();
    let changed = |scale: f64, turn: bool| {
        let place = |&[x, y, z]: &Point| {
            let [a, b] = if turn { [cosine * x - sine * y, sine * x + cosine * y] } else { [x, y] };
            add([a, b, z].map(|x| scale * x), [0.0, 0.1, 0.0])
        };
        Model { points: dance.rest.points.iter().map(place).collect(), ..dance.rest.clone() }
    };
    dir.model("rest.obj", &changed(1.0, true));
    refused(&dir, RECOVER, &["scan_0.ply", "turned by", "--align auto"]);
    dir.cager(&format!("{RECOVER} --align auto")).succeeds();
    let found = error(&dir, &dance);
    assert!(found < 0.008, "{found}");

    dir.model("rest.obj", &changed(1.15, false));
    dir.cager("decode out.cager -o before.npy").succeeds();
    refused(&dir, &format!("{RECOVER} --overwrite"), &["scan_0.ply", "times as large", "--scale auto"]);
    let said = dir.cager(&format!("{RECOVER} --overwrite --scale auto")).succeeds();
    assert!(said.stdout.contains("scaled by 0.8"), "{}", said.stdout);
    let found = error(&dir, &dance);
    assert!(found < 0.012, "{found}");
}

#[test]
fn surfaces_of_quite_another_size_or_place_are_refused_and_lost_where_forced() {
    let (dir, dance) = (Dir::new(), Dance::of(3));
    dir.model("rest.obj", &dance.rest);
    let write = |change: &dyn Fn(Point) -> Point| {
        for frame in 0..3 {
            let seen = dance.seen(frame, 4000);
            let points = seen.points.iter().map(|&p| change(p)).collect();
            dir.write(&format!("scan_{frame}.ply"), ply(&Observation { points, ..seen }, true));
        }
    };
    let times = |scale: f64| move |p: Point| p.map(|x| scale * x);
    for (scale, words) in [(1000.0, "about 1000 times as large"), (0.01, "about 100 times smaller")] {
        write(&times(scale));
        refused(&dir, RECOVER, &["scan_0.ply", words, "--scale auto"]);
        refused(&dir, &format!("{RECOVER} --align auto"), &["scan_0.ply", "times", "the template", "--scale auto"]);
    }
    let said = dir.cager(&format!("{RECOVER} --scale auto")).succeeds();
    assert!(said.stdout.contains("scaled by 0.0") && said.stdout.contains(" 0 lost"), "{}", said.stdout);
    write(&|p| add(p, [20.0, 0.0, 0.0]));
    let line = format!("{RECOVER} --overwrite");
    refused(&dir, &line, &["scan_0.ply", "away from the template", "times its diagonal", "--align auto"]);
    let said = dir.cager(&format!("{line} --align auto")).succeeds();
    assert!(said.stdout.contains(" 0 lost"), "{}", said.stdout);
    let said = dir.cager(&format!("{line} --force")).succeeds();
    assert!(
        said.stdout.contains(" 3 lost") && said.stderr.contains("frames: 0, 1, 2"),
        "{}{}",
        said.stdout,
        said.stderr
    );
}

#[test]
fn points_far_from_all_others_are_left_out_and_told() {
    let (dir, dance) = (Dir::new(), Dance::of(3));
    dir.model("rest.obj", &dance.rest);
    let write = |strays: bool| {
        for frame in 0..3 {
            let mut seen = dance.seen(frame, 4000);
            if strays && frame != 1 {
                seen.points.push([1e6; 3]);
                seen.normals.push([0.0, 0.0, 1.0]);
            }
            dir.write(&format!("scan_{frame}.ply"), ply(&seen, true));
        }
    };
    write(false);
    assert_eq!(dir.cager(RECOVER).succeeds().stderr, "");
    // A frame that is missing among the names is told of.
    std::fs::rename(dir.path("scan_2.ply"), dir.path("scan_3.ply")).expect("a file");
    let said = dir.cager(&format!("{RECOVER} --overwrite")).succeeds().stderr;
    assert!(said.contains("missing frames: 2;"), "{said}");
    std::fs::rename(dir.path("scan_3.ply"), dir.path("scan_2.ply")).expect("a file");
    dir.cager(&format!("{RECOVER} --overwrite")).succeeds();
    let without = dir.read("out.cager");
    write(true);
    let said = dir.cager(&format!("{RECOVER} --overwrite --report report.json")).succeeds();
    assert!(said.stderr.contains("were left out, 2 together, in frames: 0, 2\n"), "{}", said.stderr);
    assert!(dir.read("out.cager") == without, "strays change what is found");
    let report = dir.json("report.json");
    assert!(report["from_surface"].as_f64().expect("a distance") < 0.002);
    assert_eq!((&report["frames"][0]["strays"], &report["frames"][1]["strays"]), (&1.into(), &0.into()));
}

#[test]
fn frames_without_a_surface_are_refused_by_name_and_passed_over_by_force() {
    let (dir, dance) = (Dir::new(), Dance::new());
    dir.model("rest.obj", &dance.rest);
    for frame in 0..4 {
        dir.write(&format!("scan_{frame}.ply"), ply(&dance.seen(frame, 4000), true));
    }
    let line = Observation { points: vec![[1.0, 2.0, 3.0]; 50], normals: vec![[0.0; 3]; 50] };
    for (text, words) in [
        (ply(&line, false), ["scan_2.ply", "frame 2", "one line only"]),
        (ply(&line, true), ["scan_2.ply", "frame 2", "no normal at vertex 0"]),
        (
            ply(&Observation { points: vec![[0.0; 3]; 3], normals: vec![[0.0; 3]; 3] }, false),
            ["scan_2.ply", "3 points", "at least"],
        ),
        (
            ply(&dance.seen(2, 100), true).replacen("\n0.", "\nnan ", 1).replacen("\n-0.", "\nnan ", 1),
            ["scan_2.ply", "NaN", "repair"],
        ),
    ] {
        dir.write("scan_2.ply", text);
        refused(&dir, RECOVER, &words);
    }
    let place = Observation { points: vec![[1.0, 2.0, 3.0]; 50], normals: vec![[0.0, 1.0, 0.0]; 50] };
    let huge = dance.seen(2, 200);
    let huge = Observation { points: huge.points.iter().map(|p| p.map(|x| 1e160 * x)).collect(), ..huge };
    for (cloud, word) in [(place, "one line only"), (huge, "scale it")] {
        dir.write("scan_2.ply", ply(&cloud, true));
        refused(&dir, RECOVER, &["scan_2.ply", word]);
    }
    let nan = ply(&dance.seen(2, 100), true).replacen("\n0.", "\nnan ", 1).replacen("\n-0.", "\nnan ", 1);
    dir.write("scan_2.ply", "");
    refused(&dir, RECOVER, &["scan_2.ply", "empty", "--force"]);
    for text in [ply(&line, false), nan, String::new()] {
        dir.write("scan_2.ply", text);
        let said = dir.cager(&format!("{RECOVER} --force --overwrite")).succeeds();
        assert!(said.stderr.contains("stays as it was, in frames: 2\n"), "{}", said.stderr);
    }
    let names: Vec<String> = dir.names("");
    assert_eq!(names, ["out.cager", "rest.obj", "scan_0.ply", "scan_1.ply", "scan_2.ply", "scan_3.ply"]);
}

#[test]
fn what_is_no_template_and_what_holds_no_frames_is_refused() {
    let (dir, dance) = (Dir::new(), Dance::new());
    dir.model("cloud.obj", &Model { points: dance.rest.points.clone(), ..Model::default() });
    dir.model("rest.obj", &dance.rest);
    dir.write("scan_0.ply", ply(&dance.seen(0, 4000), true));
    refused(&dir, &RECOVER.replace("rest.obj", "cloud.obj"), &["cloud.obj", "no faces"]);
    refused(&dir, &RECOVER.replace("scan_*", "other_*"), &["other_*.ply", "no mesh files"]);
}

/// A model and a small copy of it at a point, which moves with that: another topology.
fn with_puppet(model: &Model, hand: usize) -> Model {
    let Model { points, faces, .. } = model;
    let (middle, at) = (average(points), points[hand]);
    let small = |p: &Point| [0, 1, 2].map(|k| at[k] + 0.3 * (p[k] - middle[k]));
    let count = points.len() as u32;
    let both =
        faces.iter().map(<[u32]>::to_vec).chain(faces.iter().map(|face| face.iter().map(|v| v + count).collect()));
    Model {
        faces: polygons(both),
        points: points.iter().copied().chain(points.iter().map(small)).collect(),
        ..Model::default()
    }
}

#[test]
fn where_the_topology_changes_a_second_template_goes_on_and_a_report_says_where_that_is() {
    let (dir, dance) = (Dir::new(), Dance::of(14));
    let side = |v: &usize| dance.rest.points[*v][0];
    let hand = (0..dance.rest.points.len()).max_by(|a, b| side(a).total_cmp(&side(b))).expect("points");
    let posed = |frame| if frame < 7 { dance.posed(frame) } else { with_puppet(&dance.posed(frame), hand) };
    for frame in 0..14 {
        dir.write(&format!("scan_{}.ply", 5 + frame), ply(&drawn(&posed(frame), frame, 6000), true));
    }
    dir.model("rest.obj", &dance.rest);
    dir.model("second.obj", &posed(7));
    let said = dir.cager(&format!("{RECOVER} --report report.json")).succeeds();
    assert!(said.stderr.contains("from frame 12 to the end") && said.stderr.contains("12:OTHER"), "{}", said.stderr);
    assert_eq!(dir.json("report.json")["changed_from"].as_f64(), Some(12.0));

    let two = "recover --template rest.obj --template 12:second.obj --frames scan_*.ply -o two.cager";
    let said = dir.cager(&format!("{two} --report two.json --fps 25")).succeeds();
    assert_eq!(said.stderr, "");
    assert!(said.stdout.contains("two-1.cager: 7 frames") && said.stdout.contains("two-2.cager: 7"), "{}", said.stdout);
    for (k, frames) in [(1, 0..7), (2, 7..14)] {
        dir.cager(&format!("decode two-{k}.cager -o two-{k}.npy")).succeeds();
        let truth: Vec<Vec<f64>> = frames.map(|t| posed(t).points.into_flattened()).collect();
        let rest = posed(7 * (k - 1)).points;
        let found = mean(&measure(&rest, &truth, &read_frames(&dir.path(&format!("two-{k}.npy")), rest.len())).l2);
        assert!(found < 0.008, "{k}: {found}");
        assert!(dir.json(&format!("two-{k}.json"))["changed_from"].is_null());
    }
    // They play as one: numbers and rate go on from one file to the next.
    let list = dir.json("two.stretches.json");
    assert_eq!(list["stretches"][1]["file"], "two-2.cager");
    assert_eq!(
        (list["stretches"][1]["first_frame"].as_f64(), list["stretches"][0]["frames"].as_u64()),
        (Some(12.0), Some(7))
    );
    let shown = dir.cager("inspect two.stretches.json --json").succeeds();
    let shown: serde_json::Value = serde_json::from_str(&shown.stdout).expect("JSON");
    let numbers =
        |k: usize| shown[k]["frame_numbers"].as_array().expect("numbers").iter().filter_map(serde_json::Value::as_f64);
    assert_eq!(numbers(0).chain(numbers(1)).collect::<Vec<_>>(), (5..19).map(f64::from).collect::<Vec<_>>());
    assert_eq!(shown[1]["frame_rate"].as_f64(), Some(25.0));

    decoded_as_one(&dir);

    let two = two.replace("two.cager", "three.cager");
    refused(&dir, &two.replace("12:", "40:"), &["second.obj", "numbered 5 to 18"]);
    refused(&dir, &two.replace("12:", ""), &["FRAME:second.obj"]);
    refused(&dir, &two.replace("three.cager", "-"), &["standard output"]);
    refused(&dir, &format!("{two} --cage rest.obj"), &["2 templates and 1 cages"]);
}

/// A list is decoded to mesh files whose numbers go on, each with the faces of its stretch.
fn decoded_as_one(dir: &Dir) {
    let said = dir.cager("decode two.stretches.json -o whole/").succeeds();
    assert!(said.stdout.contains("14 frames of 2 files"), "{}", said.stdout);
    let names: Vec<String> = (5..19).map(|number| format!("frame_{number:04}.obj")).collect();
    assert_eq!(dir.names("whole"), names);
    for (k, frames) in [(1, 5..12), (2, 12..19)] {
        dir.cager(&format!("decode two-{k}.cager -o alone-{k}/")).succeeds();
        for number in frames {
            let read =
                |folder: &str| std::fs::read(dir.path(&format!("{folder}/frame_{number:04}.obj"))).expect("file");
            assert!(read("whole") == read(&format!("alone-{k}")), "{number}");
        }
    }
    dir.cager("decode two.stretches.json -o some/a.####.ply --range 5-13x3 --start 105").succeeds();
    assert_eq!(dir.names("some"), ["a.0110.ply", "a.0113.ply", "a.0116.ply"]);
    dir.cager("decode two.stretches.json -o one.stl --frame 9").succeeds();
    dir.cager("decode two.stretches.json -o begin.npy --range 0-6").succeeds();
    assert!(dir.path("one.stl").exists() && dir.path("begin.npy").exists());
    let dry = dir.cager("decode two.stretches.json -o none/ --dry-run").succeeds();
    assert!(dry.stdout.contains("would be written: 14 frames of 2 files"), "{}", dry.stdout);

    refused(dir, "decode two.stretches.json -o whole.npy", &["whole.npy", "one mesh", "folder"]);
    refused(dir, "decode two.stretches.json -o whole.abc", &["whole.abc", "one mesh"]);
    refused(dir, "decode two.stretches.json -o none/ --frame 14", &["counted from 0", "0 to 13"]);
    refused(dir, "decode two.stretches.json -o none/ --model rest.obj", &["--model", "one by one"]);
    refused(dir, "decode two.stretches.json -o none/ --cages", &["--cages", "one by one"]);
    let list = std::fs::read_to_string(dir.path("two.stretches.json")).expect("list");
    let wrong = |of: &str, by: &str| dir.write("wrong.stretches.json", list.replace(of, by));
    for (of, by, words) in [
        ("two-2.cager", "gone.cager", ["gone.cager", "not there"]),
        ("\"frames\": 7", "\"frames\": 8", ["has 8 frames of", "that has 7"]),
        ("two-1.cager", "two-2.cager", ["from 5 on", "from 12 on"]),
    ] {
        wrong(of, by);
        refused(dir, "decode wrong.stretches.json -o none/", &words);
    }
    let twice = list.replace("two-1.cager", "two-2.cager").replace("5.0", "12.0");
    dir.write("wrong.stretches.json", twice);
    refused(dir, "decode wrong.stretches.json -o none/", &["begins with frame 12", "ends with frame 18"]);
    dir.write("wrong.stretches.json", r#"{"version": 1, "stretches": []}"#);
    refused(dir, "inspect wrong.stretches.json", &["lists no files"]);
    assert!(!dir.path("none").exists() && !dir.path("whole.npy").exists());
}

/// A closed ball of triangles around a point.
fn ball(centre: Point, radius: f64) -> Model {
    let (rings, around) = (10u32, 16u32);
    let mut points = Vec::new();
    for i in 0..=rings {
        let (sin, cos) = (std::f64::consts::PI * f64::from(i) / f64::from(rings)).sin_cos();
        for k in 0..around {
            let (y, x) = (std::f64::consts::TAU * f64::from(k) / f64::from(around)).sin_cos();
            points.push([centre[0] + radius * sin * x, centre[1] + radius * sin * y, centre[2] + radius * cos]);
        }
    }
    let at = |i: u32, k: u32| i * around + k % around;
    let faces =
        (0..rings).flat_map(|i| (0..around).map(move |k| vec![at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)]));
    Model { faces: polygons(faces), points, ..Model::default() }
}

/// Two models in one.
fn together(a: &Model, b: &Model) -> Model {
    let count = a.points.len() as u32;
    let moved = b.faces.iter().map(|face| face.iter().map(|v| v + count).collect::<Vec<u32>>());
    let faces = polygons(a.faces.iter().map(<[u32]>::to_vec).chain(moved));
    Model { faces, points: [a.points.clone(), b.points.clone()].concat(), ..Model::default() }
}

#[test]
fn parts_that_leave_their_surface_in_frames_that_are_not_lost_are_told_with_frame_and_place() {
    let (dir, dance) = (Dir::new(), Dance::of(12));
    let size = diagonal(&dance.rest.points);
    let side = |v: &usize| dance.rest.points[*v][0];
    let hand = (0..dance.rest.points.len()).max_by(|a, b| side(a).total_cmp(&side(b))).expect("points");
    // A ball in the hand.
    let held = |frame: usize, away: f64| {
        let [x, y, z] = dance.frames[frame].as_chunks::<3>().0[hand];
        ball([x + (0.02 + away) * size, y, z], 0.035 * size)
    };
    let tell = |name: &str, scans: &dyn Fn(usize) -> Model, template: &Model| {
        dir.model("rest.obj", template);
        for frame in 0..12 {
            dir.model(&format!("scan_{}.obj", 5 + frame), &remeshed(&scans(frame), false));
        }
        let line = "recover --template rest.obj --frames scan_*.obj --overwrite";
        let said = dir.cager(&format!("{line} -o {name}.cager --report {name}.json")).succeeds();
        (said, dir.json(&format!("{name}.json"))["departures"].clone())
    };
    let with = |frame: usize| together(&dance.posed(frame), &held(frame, 0.0));

    // It stays: nothing is told.
    let (said, departures) = tell("stays", &with, &with(0));
    assert!(
        !said.stderr.contains("of the diagonal") && departures.as_array().expect("a list").is_empty(),
        "{departures}"
    );
    assert!(said.stdout.contains("0 lost\n"), "{}", said.stdout);

    // It is let go of, and is gone: the template's ball is where nothing is.
    let (said, departures) = tell("gone", &|frame| if frame < 7 { with(frame) } else { dance.posed(frame) }, &with(0));
    let told = &departures[0];
    let (from, to) = (told["from"].as_f64().expect("a number"), told["to"].as_f64());
    // What lies near at first is told when it is far.
    assert!(told["what"] == "off_surface" && (12.0..=13.0).contains(&from) && to == Some(16.0), "{departures}");
    let vertex = told["vertex"].as_u64().expect("a vertex") as usize;
    assert!(vertex >= dance.rest.points.len(), "{told}");
    assert!(
        told["largest"].as_f64().expect("a share") > 0.012 && told["points"].as_u64().expect("points") > 20,
        "{told}"
    );
    assert!(
        said.stderr.contains(&format!("from frame {from} to 16, ")) && said.stderr.contains("away from the surface"),
        "{}",
        said.stderr
    );
    assert!(said.stdout.contains(" leave"), "{}", said.stdout);

    // Something is there that the template has not.
    let (said, departures) = tell(
        "new",
        &|frame| if frame < 7 { dance.posed(frame) } else { together(&dance.posed(frame), &held(frame, 0.2)) },
        &dance.rest,
    );
    let told = departures.as_array().expect("a list").iter().find(|told| told["what"] == "unexplained");
    let told = told.unwrap_or_else(|| panic!("{departures}"));
    assert_eq!((told["from"].as_f64(), told["to"].as_f64()), (Some(12.0), Some(16.0)));
    let place: Vec<f64> =
        told["position"].as_array().expect("a place").iter().filter_map(serde_json::Value::as_f64).collect();
    let worst = told["worst"].as_f64().expect("a frame") as usize - 5;
    let off = (0..3).map(|k| (place[k] - average(&held(worst, 0.2).points)[k]).powi(2)).sum::<f64>().sqrt();
    assert!(off < 0.06 * size, "{told}");
    assert!(said.stderr.contains("nowhere near part of the surface"), "{}", said.stderr);
}
