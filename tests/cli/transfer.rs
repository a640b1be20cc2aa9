//! Other models moved by the cages of a capture: `decode --model`.

use crate::refused::refused;
use crate::support::{Dir, close, mean, measure, polygons, read_frames};
use cager_geometry::mesh::{Model, Point, diagonal};

/// Every quad of the model split at its centre: the original's points, then one for each face. Its motion follows the faces.
pub(crate) fn remeshed(rest: &Model) -> Model {
    let mut points = rest.points.clone();
    points.extend(centres(rest, rest.points.as_flattened()).as_chunks::<3>().0);
    let corner = |k: usize, face: &[u32]| face[k % face.len()];
    let faces = rest.faces.iter().enumerate().flat_map(|(f, face)| {
        let centre = (rest.points.len() + f) as u32;
        (0..face.len()).map(move |k| vec![corner(k, face), corner(k + 1, face), centre])
    });
    let faces = polygons(faces);
    Model { points, faces, ..Model::default() }
}

pub(crate) fn centres(rest: &Model, frame: &[f64]) -> Vec<f64> {
    let points: &[Point] = frame.as_chunks().0;
    let centre =
        |face: &[u32]| [0, 1, 2].map(|k| face.iter().map(|&i| points[i as usize][k]).sum::<f64>() / face.len() as f64);
    rest.faces.iter().flat_map(centre).collect()
}

#[test]
fn a_remeshed_copy_follows_the_cages_as_closely_as_the_original() {
    let (dir, small) = Dir::with_encoded();
    let copy = remeshed(&small.rest);
    dir.model("copy.obj", &copy);
    let said = dir.cager("decode out.cager --model copy.obj -o copy.npy").succeeds();
    assert!(said.stdout.contains("20 frames of 1,221 points") && copy.points.len() == 1221, "{}", said.stdout);
    assert_eq!(said.stderr, "");
    let truth: Vec<Vec<f64>> = small.frames.iter().map(|f| [f.clone(), centres(&small.rest, f)].concat()).collect();
    let found = measure(&copy.points, &truth, &read_frames(&dir.path("copy.npy"), copy.points.len()));
    let own = dir.json("report.json")["error"]["l2_mean"].as_f64().expect("an error");
    close("L2 of the copy", mean(&found.l2), own, 0.1);
    // The faces are those of the other model.
    dir.cager("decode out.cager --model copy.obj --frame 3 -o posed").succeeds();
    let posed = cager_formats::read_model(&dir.path("posed/frame_0003.obj")).expect("a pose");
    assert_eq!(posed.faces, copy.faces);
}

#[test]
fn the_model_itself_as_another_model_gives_the_same_positions() {
    let (dir, _) = Dir::with_encoded();
    for coordinates in ["mvc", "green", "harmonic"] {
        let line = "encode --rest rest.obj --cage cage.obj --frames frames.npy --frames-range 0-2";
        dir.cager(&format!("{line} --coordinates {coordinates} -o {coordinates}.cager")).succeeds();
        dir.cager(&format!("decode {coordinates}.cager -o own.npy --overwrite")).succeeds();
        dir.cager(&format!("decode {coordinates}.cager --model rest.obj -o other.npy --overwrite")).succeeds();
        assert_eq!(dir.read("own.npy"), dir.read("other.npy"), "{coordinates}");
    }
}

#[test]
fn edited_cages_move_other_models_too() {
    let (dir, small) = Dir::with_encoded();
    let few = Model { points: small.rest.points[..5].to_vec(), ..Model::default() };
    dir.model("few.obj", &few);
    dir.cager("decode out.cager --cages --range 4-6 -o cages.npy").succeeds();
    dir.cager("decode out.cager --with-cages cages.npy --model few.obj -o few.npy").succeeds();
    dir.cager("decode out.cager --range 4-6 -o own.npy").succeeds();
    let own = read_frames(&dir.path("own.npy"), small.rest.points.len());
    assert_eq!(read_frames(&dir.path("few.npy"), 5), own.iter().map(|f| f[..15].to_vec()).collect::<Vec<_>>());
}

#[test]
fn points_outside_the_rest_cage_are_counted_and_refused_where_coordinates_need_them_inside() {
    let (dir, small) = Dir::with_encoded();
    let far = 3.0 * diagonal(&small.rest.points);
    let with = |outside: usize| {
        let mut model = Model { points: small.rest.points.clone(), ..Model::default() };
        model.points[..outside].iter_mut().for_each(|p| p[0] += far);
        model
    };
    dir.model("two.obj", &with(2));
    let said = dir.cager("decode out.cager --model two.obj -o two.npy").succeeds().stderr;
    assert!(said.contains("two.obj: 2 of") && said.contains("outside the rest cage"), "{said}");
    dir.model("all.obj", &with(small.rest.points.len()));
    let said = dir.cager("decode out.cager --model all.obj -o all.npy").succeeds().stderr;
    assert!(said.contains("units, axes and place"), "{said}");
    let line = "encode --rest rest.obj --cage cage.obj --frames frames.npy --coordinates harmonic -o harmonic.cager";
    dir.cager(line).succeeds();
    refused(&dir, "decode harmonic.cager --model two.obj -o h.npy", &["two.obj", "2 points lie outside", "0, 1"]);
    let mut stray = with(0);
    stray.points[5][1] = 1e7 * far;
    dir.model("stray.obj", &stray);
    refused(
        &dir,
        "decode out.cager --model stray.obj -o h.npy",
        &["stray.obj", "point 5", "diagonals of the cage away"],
    );
    refused(&dir, "decode out.cager --model missing.obj -o h.npy", &["missing.obj"]);
    refused(&dir, "decode out.cager --model two.obj -o two.obj", &["two.obj", "is an input"]);
}

#[test]
fn a_single_point_is_a_model_to_be_moved() {
    // One point alone: an eye's centre, a locator.
    let (dir, small) = Dir::with_encoded();
    dir.model("locator.obj", &Model { points: vec![small.rest.points[17]], ..Model::default() });
    dir.cager("decode out.cager --model locator.obj -o locator.pc2").succeeds();
    assert_eq!(read_frames(&dir.path("locator.pc2"), 1).len(), 20);
}
