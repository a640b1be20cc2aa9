//! What scenes of USD are composed of: references, payloads, sublayers and instancers.

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use cager_formats::{
    CacheFormat, Error, FrameReader, MeshFormat, ReadModel, open_frames, open_frames_bytes, read_mesh, read_mesh_bytes,
};
use cager_geometry::surface::shown_in;
use support::{all, message, numbers};
use tempfile::{TempDir, tempdir};

/// A prototype that two prims refer to, and an instancer of it and of a mesh below itself.
const INSTANCES: &str = include_str!("usd/instances.usda");
/// The same, written by usd-core.
const INSTANCES_BINARY: &[u8] = include_bytes!("usd/instances.usdc");
/// Two joints and three meshes.
const ARM: &str = include_str!("usd/arm.usda");

const TRIANGLE: &str = "int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n\
                        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n";

fn open(text: &str, points: usize) -> Result<Box<dyn FrameReader + '_>, Error> {
    open_frames_bytes(CacheFormat::Usda, Path::new("a.usda"), text.as_bytes(), points)
}

fn paths(read: &ReadModel) -> Vec<&str> {
    read.model.surface.parts.iter().map(|part| part.path.as_str()).collect()
}

#[test]
fn instances_are_parts_where_and_when_they_are_shown() {
    for (mesh, format, bytes) in [
        (MeshFormat::Usda, CacheFormat::Usda, INSTANCES.as_bytes()),
        (MeshFormat::Usdc, CacheFormat::Usdc, INSTANCES_BINARY),
    ] {
        let read = read_mesh_bytes(mesh, Path::new("a.usd"), bytes).unwrap();
        assert_eq!(
            paths(&read),
            ["/world/a/m", "/world/b/m", "/world/trees/x_0/x", "/world/trees/tri_1/tri/m", "/world/trees/x_2/x"]
        );
        let surface = &read.model.surface;
        assert_eq!(surface.materials.iter().map(|material| &material.name).collect::<Vec<_>>(), ["red"]);
        assert!([0, 1, 3].iter().all(|&k| surface.parts[k].materials == [0]) && surface.parts[2].materials.is_empty());
        let mut reader = open_frames_bytes(format, Path::new("a.usd"), bytes, 15).unwrap();
        assert_eq!(numbers(&*reader), [1.0, 2.0, 3.0]);
        // The last one, whose id is 30, is hidden from the second frame on.
        let mut shown = vec![None; 4];
        shown.push(shown_in([true, false, false].into_iter()));
        assert_eq!(reader.shown(), shown);
        for (k, frame) in all(&mut *reader).iter().enumerate() {
            let z = 100.0 + k as f64;
            let expected = [
                [[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0]],
                // What it says itself takes the place of what the prototype says.
                [5.0, 6.0, 5.0].map(|x| x + k as f64).map(|x| [x, 0.0, 0.0]),
                [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z + 1.0]],
                // Above its place by 1, which is doubled and turned.
                [[-1.0, 0.0, z], [-1.0, 2.0, z], [-3.0, 0.0, z]],
                [[2.0, 0.0, z], [3.0, 0.0, z], [2.0, 1.0, z + 3.0]],
            ];
            let mut expected = expected;
            expected[1][2][1] = 1.0;
            // Quaternions of half precision.
            let near = |(a, b): (&f64, &f64)| (a - b).abs() < 2e-3;
            assert!(frame.iter().zip(expected.as_flattened().as_flattened()).all(near), "{k}: {frame:?}");
        }
    }
}

#[test]
fn instancers_that_are_too_large_or_wrong_are_refused() {
    let many = |count: usize| vec!["0"; count].join(", ");
    let moved = |from: &str, to: &str| {
        let text = INSTANCES.replacen(from, to, 1);
        assert_ne!(text, INSTANCES);
        message(open(&text, 15).and_then(|mut reader| reader.read_next(&mut Vec::new())))
    };
    for (from, to, what) in [
        ("[0, 1, 0]", format!("[{}]", many(9000)), "is a PointInstancer of 9000 instances, where 8192 in all are read"),
        ("[0, 1, 0]", "[0, 2, 0]".to_owned(), "a prototype that is not there"),
        ("(1, 0, 0), (2, 0, 0)]", "(1, 0, 0)]".to_owned(), "says of fewer instances where they are than there are"),
        (
            "protoIndices = [0, 1, 0]",
            "protoIndices.timeSamples = { 1: [0], 2: [0, 0] }".to_owned(),
            "come, go or change",
        ),
        ("</world/trees/p/x>", "</world>".to_owned(), "is its own prototype"),
    ] {
        let error = moved(from, &to);
        assert!(error.contains(what), "{error}\nnot: {what}");
    }
    // Of a mesh of a thousand points eight thousand are more than such a file may hold.
    let points = vec!["(0, 0, 0)"; 1000].join(",");
    let places = vec!["(1, 0, 0)"; 8000].join(",");
    let text = format!(
        "#usda 1.0\ndef PointInstancer \"i\" {{\nrel prototypes = </i/m>\nint[] protoIndices = [{}]\npoint3f[] \
         positions = [{places}]\n\
         def Mesh \"m\" {{\n{}\n}}\n}}\n",
        many(8000),
        TRIANGLE.replace("(0, 0, 0)", &points)
    );
    let error = message(open(&text, 8_016_000));
    assert!(error.contains("together; choose some with --prim"), "{error}");
}

#[test]
fn references_that_lead_in_circles_or_to_nothing_are_refused() {
    let itself = format!(
        "#usda 1.0\ndef Xform \"a\" {{\ndef \"b\" ( references = </a> ) {{ }}\ndef Mesh \"m\" {{\n{TRIANGLE}}}\n}}\n"
    );
    assert!(message(open(&itself, 3)).contains("nests deeper than 256"));
    let circle = format!(
        "#usda 1.0\ndef \"a\" ( references = </b> ) {{ }}\ndef \"b\" ( references = </a> ) {{ }}\ndef Mesh \"m\" \
         {{\n{TRIANGLE}}}\n"
    );
    assert!(message(open(&circle, 3)).contains("one that refers to itself"));
    let nothing = format!("#usda 1.0\ndef \"a\" ( references = </b> ) {{ }}\ndef Mesh \"m\" {{\n{TRIANGLE}}}\n");
    assert!(message(open(&nothing, 3)).contains("/a has references, which are not read"));
    // Twice as many in each step.
    let steps = (0..40).map(|k| {
        let next = k + 1;
        format!(
            "over \"p{k}\" {{\ndef \"x\" ( references = </p{next}> ) {{ }}\ndef \"y\" ( references = </p{next}> ) \
             {{ }}\n}}\n"
        )
    });
    let doubling = format!(
        "#usda 1.0\ndef \"a\" ( references = </p0> ) {{ }}\n{}def Mesh \"p40\" {{\n{TRIANGLE}}}\n",
        steps.collect::<String>()
    );
    assert!(message(open(&doubling, 3)).contains("is composed of more prims than its files hold"));
}

/// A folder with files of these names.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    folder
}

const SHOT: &str = "#usda 1.0\n(\ntimeCodesPerSecond = 48\nupAxis = \"Z\"\n)\n\
    def \"one\" ( references = @./parts/shot.usda@</root> (offset = 5) ) {\n\
    over \"aside\" {\nover \"free\" {\ndouble3 xformOp:translate = (1, 2, 3)\nuniform token[] xformOpOrder = \
           [\"xformOp:translate\"]\n}\n}\n}\n\
    def Xform \"two\" {\ndouble3 xformOp:translate = (1000, 0, 0)\nuniform token[] xformOpOrder = \
                [\"xformOp:translate\"]\n\
    def \"in\" ( payload = @parts/body.usda@ ) { }\n}\n";
const PART: &str = "#usda 1.0\n( subLayers = [@./over.usda@, @../lib/arm.usda@ (offset = 10; scale = 2)] )\n";
const OVER: &str = "#usda 1.0\nover \"root\" {\nover \"aside\" {\nover \"box\" ( active = false ) { }\n}\n}\n";

#[test]
fn files_below_a_layer_are_read_with_it() {
    let body = format!(
        "#usda 1.0\n( defaultPrim = \"body\" )\ndef Mesh \"body\" {{\n{TRIANGLE}rel material:binding = </body/skin>\n\
         def Material \"skin\" {{\ntoken outputs:surface.connect = </body/skin/s.outputs:surface>\n\
         def Shader \"s\" {{\nuniform token info:id = \"UsdPreviewSurface\"\n\
         color3f inputs:diffuseColor.connect = </body/skin/t.outputs:rgb>\ntoken outputs:surface\n}}\n\
         def Shader \"t\" {{\nuniform token info:id = \"UsdUVTexture\"\nasset inputs:file = @./skin.png@\nfloat3 \
                      outputs:rgb\n}}\n}}\n}}\n"
    );
    let files = [
        ("shot.usda", SHOT),
        ("parts/shot.usda", PART),
        ("parts/over.usda", OVER),
        ("lib/arm.usda", ARM),
        ("parts/body.usda", &body),
    ];
    let folder = folder(&files);
    let path = folder.path().join("shot.usda");
    let read = read_mesh(&path, &[]).unwrap();
    assert_eq!(paths(&read), ["/one/aside/arm", "/one/aside/free", "/two/in"]);
    // Pictures lie beside the file that names them.
    let textures: Vec<&str> = read.model.surface.materials[0].textures.iter().map(|texture| &*texture.path).collect();
    assert_eq!(textures, ["parts/skin.png"]);
    let mut reader = open_frames(&path, 9).unwrap();
    // From 1 and 3: doubled and moved by 10, doubled as time codes pass twice as fast, and moved by 5.
    assert_eq!(numbers(&*reader), (29..38).map(f64::from).collect::<Vec<_>>());
    let frames = all(&mut *reader);
    let near = |found: &[f64], expected: [f64; 3]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5);
    // Within what is referred to, skeletons and shapes are those there.
    assert!(near(&frames[0][6..9], [3.0, 101.0, 12.0]) && near(&frames[8][6..9], [1.0, 101.0, 12.0]));
    assert!(near(&frames[8][9..12], [8.0 - 7.0 + 3.0 + 7.0, 9.0, 24.0]), "{:?}", &frames[8][9..12]);
    assert_eq!(frames[8][18..], [1000.0, 0.0, 0.0, 1001.0, 0.0, 0.0, 1000.0, 1.0, 0.0]);
    // As an upload it has no files.
    assert!(message(open(SHOT, 9)).contains("/one has references, which are not read"));
    for (name, what) in [("parts/body.usda", "/two/in has payloads"), ("lib/arm.usda", "/one has references")] {
        fs::remove_file(folder.path().join(name)).unwrap();
        let error = message(open_frames(&path, 9));
        assert!(error.contains(what), "{error}");
        let text = files.iter().find(|(file, _)| *file == name).unwrap().1;
        fs::write(folder.path().join(name), text).unwrap();
    }
    fs::write(folder.path().join("lib/arm.usda"), "#usda 1.0\ndef Mesh {").unwrap();
    assert!(message(open_frames(&path, 9)).contains("lib/arm.usda"));
}

/// A model of two sets of variants, of which it chooses a small mesh and, of the other, nothing.
const LOOK: &str = include_str!("usd/look.usda");
/// The same, written by usd-core.
const LOOK_BINARY: &[u8] = include_bytes!("usd/look.usdc");

#[test]
fn variants_are_those_that_are_chosen_outermost() {
    for (format, bytes) in [(MeshFormat::Usda, LOOK.as_bytes()), (MeshFormat::Usdc, LOOK_BINARY)] {
        let read = read_mesh_bytes(format, Path::new("a.usd"), bytes).unwrap();
        assert_eq!(paths(&read), ["/model/m"]);
        assert_eq!(read.model.points, [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]);
    }
    let refers = |name: &str, chosen: &str| {
        format!("def \"{name}\" (\nreferences = @look.usdc@\nvariants = {{ {chosen} }}\n) {{ }}\n")
    };
    let large = "string size = \"large\"";
    let scene = format!(
        "#usda 1.0\n{}{}{}",
        refers("one", ""),
        refers("two", large),
        refers("three", &format!("{large}; string \"kind\" = \"a\""))
    );
    let folder = folder(&[("scene.usda", &scene)]);
    fs::write(folder.path().join("look.usdc"), LOOK_BINARY).unwrap();
    let read = read_mesh(&folder.path().join("scene.usda"), &[]).unwrap();
    assert_eq!(paths(&read), ["/one/m", "/two/m", "/two/n", "/three/n"]);
    // The model itself says where it is, whatever its variants say.
    assert_eq!(read.model.points[4], [10.0, 0.0, 1.0]);
    // Where none is chosen, there is none.
    let none = LOOK.replace("string size = \"small\"", "");
    let error = message(read_mesh_bytes(MeshFormat::Usda, Path::new("a.usda"), none.as_bytes()));
    assert!(error.contains("holds no polygon mesh"), "{error}");
}

#[test]
fn files_elsewhere_or_that_name_each_other_are_not_followed() {
    let of = |asset: &str| format!("#usda 1.0\ndef Mesh \"m\" ( references = @{asset}@</m> ) {{\n{TRIANGLE}}}\n");
    let folder = folder(&[("in/a.usda", ""), ("b.usda", &of("a.usda")), ("in/c.usda", &of("c.usda"))]);
    let path = folder.path().join("in/a.usda");
    let outside = folder.path().join("b.usda").display().to_string();
    for asset in ["../b.usda", "https://example.com/b.usda", "in.usdz[b.usda]", &outside, "gone.usda"] {
        fs::write(&path, of(asset)).unwrap();
        assert!(message(open_frames(&path, 3)).contains("/m has references"), "{asset}");
    }
    assert!(message(open_frames(folder.path().join("in/c.usda"), 3)).contains("refers to itself"));
    fs::write(&path, "#usda 1.0\n( subLayers = [@a.usda@] )\n").unwrap();
    assert!(message(open_frames(&path, 3)).contains("the layer has sublayers"));
}

/// Value clips of both kinds of layers, written by `tests/peers/usd.py clips`, and their points.
fn clips(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/usd/clips").join(name)
}

#[test]
fn value_clips_are_read_one_after_another() {
    let told = fs::read_to_string(clips("shot.txt")).unwrap();
    let expected: Vec<Vec<f64>> =
        told.lines().map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect();
    for kind in ["usda", "usdc"] {
        let path = clips("shot").with_extension(kind);
        let mut reader = open_frames(&path, 3).unwrap();
        assert_eq!(numbers(&*reader), (101..107).map(f64::from).collect::<Vec<_>>());
        assert_eq!(reader.shown(), [Some(vec![0..2, 4..6])]);
        assert_eq!(all(&mut *reader), expected, "{kind}");
        let read = read_mesh(&path, &[]).unwrap();
        assert_eq!((paths(&read), read.model.faces.len()), (vec!["/model/m"], 1));
        // As an upload it has no files.
        let format = MeshFormat::from_path(&path).unwrap();
        let error = message(read_mesh_bytes(format, Path::new("a.usd"), &fs::read(&path).unwrap()));
        assert!(error.contains("/model has value clips, which are not read"), "{error}");
    }
}

/// A layer with the metadata of its clips, whose own points are weaker than theirs.
fn clipped(metadata: &str) -> String {
    format!(
        "#usda 1.0\n( subLayers = [@base.usda@] )\ndef \"model\" (\nclips = {{\ndictionary default = {{\n{metadata}\n}}\n}}\n) {{ }}\n"
    )
}

#[test]
fn clips_of_a_template_are_those_that_are_there() {
    let base = format!("#usda 1.0\ndef Xform \"model\" {{\ndef Mesh \"m\" {{\n{TRIANGLE}}}\n}}\n");
    let clip = |z: u32| {
        format!(
            "#usda 1.0\nover \"model\" {{\nover \"m\" {{\npoint3f[] points.timeSamples = {{ {z}: [(0, 0, {z}), (1, 0, 0), (0, 1, 0)] }}\n}}\n}}\n"
        )
    };
    let template = "string templateAssetPath = \"./in/clip.##.usda\"\ndouble templateStartTime = 7\n\
                    double templateEndTime = 10\ndouble templateStride = 1\nstring primPath = \"/model\"";
    let [a, b, c] = [7, 8, 10].map(clip);
    let shot = clipped(template);
    let folder = folder(&[
        ("shot.usda", &shot),
        ("base.usda", &base),
        ("in/clip.07.usda", &a),
        ("in/clip.08.usda", &b),
        ("in/clip.10.usda", &c),
    ]);
    let path = folder.path().join("shot.usda");
    let mut reader = open_frames(&path, 3).unwrap();
    assert_eq!(numbers(&*reader), [7.0, 8.0, 9.0, 10.0]);
    let heights: Vec<f64> = all(&mut *reader).iter().map(|frame| frame[2]).collect();
    assert_eq!(heights, [7.0, 8.0, 9.0, 10.0]);
    // One by one, the second file later and twice as fast.
    let listed = "double2[] active = [(0, 0), (5, 1)]\nasset[] assetPaths = [@in/clip.07.usda@, @in/clip.08.usda@]\n\
                  double2[] times = [(0, 7), (5, 7), (5, 8), (6, 8)]\nstring primPath = \"/model\"";
    fs::write(&path, clipped(listed)).unwrap();
    let heights: Vec<f64> = all(&mut *open_frames(&path, 3).unwrap()).iter().map(|frame| frame[2]).collect();
    assert_eq!(heights, [7.0, 7.0, 7.0, 7.0, 7.0, 8.0, 8.0]);
    for (from, to, what) in [
        ("in/clip.08.usda", "in/gone.usda", "in/gone.usda: is a value clip that is not there"),
        ("in/clip.08.usda", "../clip.08.usda", "../clip.08.usda: is a value clip that is not there"),
        ("in/clip.08.usda", "base.usda", "has value clips of which base.usda has no samples of points"),
        ("(5, 1)", "(5, 2)", "/model has value clips, which are not read"),
        ("\"/model\"", "\"model\"", "/model has value clips, which are not read"),
        ("double2[] times", "double2[] stage", "/model has value clips, which are not read"),
    ] {
        fs::write(&path, clipped(&listed.replacen(from, to, 1))).unwrap();
        let error = message(open_frames(&path, 3));
        assert!(error.contains(what), "{error}\nnot: {what}");
    }
    // A clip that lacks what the other one has.
    for lacking in ["in/clip.08.usda", "in/clip.07.usda"] {
        fs::write(folder.path().join("in/clip.07.usda"), &a).unwrap();
        fs::write(folder.path().join(lacking), "#usda 1.0\nover \"model\" { }\n").unwrap();
        fs::write(&path, clipped(listed)).unwrap();
        let error = message(open_frames(&path, 3));
        assert!(error.contains(&format!("has value clips of which {lacking} has no samples of points")), "{error}");
        fs::write(folder.path().join("in/clip.08.usda"), &b).unwrap();
    }
    // One that is a sublayer too.
    fs::write(folder.path().join("in/clip.07.usda"), &a).unwrap();
    fs::write(&path, clipped(listed).replace("[@base.usda@]", "[@in/clip.08.usda@, @base.usda@]")).unwrap();
    let heights: Vec<f64> = all(&mut *open_frames(&path, 3).unwrap()).iter().map(|frame| frame[2]).collect();
    assert_eq!(heights, [7.0, 7.0, 7.0, 7.0, 7.0, 8.0, 8.0]);
}

/// As usd-core has it.
#[test]
fn a_part_is_hidden_by_a_clip_behind_one_that_says_nothing() {
    let clip = |first: u32, own: &str| {
        let at = |z: u32| format!("{z}: [(0, 0, {z}), (1, 0, 0), (0, 1, 0)]");
        let samples = format!("point3f[] points.timeSamples = {{ {}, {} }}", at(first), at(first + 1));
        format!("#usda 1.0\nover \"model\" {{\nover \"m\" {{\n{samples}\n{own}\n}}\n}}\n")
    };
    let base = |own: &str| format!("#usda 1.0\ndef Xform \"model\" {{\ndef Mesh \"m\" {{\n{TRIANGLE}{own}\n}}\n}}\n");
    let hidden = "token visibility.timeSamples = { 3: \"invisible\" }";
    let listed = "double2[] active = [(1, 0), (3, 1), (5, 2)]\nasset[] assetPaths = [@a.usda@, @b.usda@, @c.usda@]\n\
                  string primPath = \"/model\"";
    let folder = folder(&[
        ("shot.usda", &clipped(listed)),
        ("base.usda", &base("")),
        ("a.usda", &clip(1, "")),
        ("b.usda", &clip(3, hidden)),
        ("c.usda", &clip(5, "")),
    ]);
    let shown = || open_frames(folder.path().join("shot.usda"), 3).unwrap().shown();
    assert_eq!(shown(), [Some(vec![0..2, 4..6])]);
    // What is weaker than the clips is as if it were not there.
    fs::write(folder.path().join("base.usda"), base("token visibility = \"invisible\"")).unwrap();
    assert_eq!(shown(), [Some(vec![0..2, 4..6])]);
    fs::write(folder.path().join("b.usda"), clip(3, "")).unwrap();
    assert_eq!(shown(), [Some(vec![])]);
}

#[test]
fn damaged_scenes_are_errors_at_the_most() {
    let mut random = support::random(5);
    for _ in 0..500 {
        for (format, whole) in [
            (CacheFormat::Usda, INSTANCES.as_bytes()),
            (CacheFormat::Usdc, INSTANCES_BINARY),
            (CacheFormat::Usda, LOOK.as_bytes()),
            (CacheFormat::Usdc, LOOK_BINARY),
        ] {
            let points = if whole == LOOK.as_bytes() || whole == LOOK_BINARY { 3 } else { 15 };
            let mut bytes = whole.to_vec();
            for _ in 0..=random() % 3 {
                let at = random() % bytes.len();
                bytes[at] = [b"0123456789-\"]),<>"[random() % 17], random() as u8][random() % 2];
            }
            let Ok(mut reader) = open_frames_bytes(format, Path::new("a.usd"), &bytes, points) else { continue };
            let (mut out, most) = (Vec::new(), reader.frames().min(16));
            let _ = (0..most).all(|_| reader.read_next(&mut out).is_ok());
        }
    }
}
