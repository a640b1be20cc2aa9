//! Mesh files as other programs write them.

use crate::refused::refused;
use crate::support::Dir;

const STRIPS: &str = "12-ply-triangle-strips";

fn encodes(dir: &Dir, rest: &str) -> String {
    let line = format!("encode --rest {rest} --cage cage.obj --frames frames.npy -o {rest}.cager --overwrite");
    dir.cager(&line).succeeds().stderr
}

#[test]
fn triangle_strips_are_unfolded() {
    let dir = Dir::with_case(STRIPS);
    encodes(&dir, "strips.ply");
    let facts = dir.cager("inspect strips.ply.cager --json").succeeds().stdout;
    assert!(facts.contains("320"), "{facts}");
}

#[test]
fn models_as_other_programs_write_them_are_read() {
    let dir = Dir::with_case("19-words");
    let rest = String::from_utf8(dir.read("rest.obj")).unwrap();
    let points: Vec<&str> = rest.lines().filter_map(|line| line.strip_prefix("v ")).collect();
    let faces: Vec<Vec<usize>> = rest
        .lines()
        .filter_map(|line| line.strip_prefix("f "))
        .map(|line| line.split(' ').map(|word| word.split('/').next().unwrap().parse::<usize>().unwrap() - 1).collect())
        .collect();
    let counts = format!("{} {} 0\n", points.len(), faces.len());
    let corners = |between: &str| {
        faces.iter().map(|f| format!("3{between}{}{between}{}\n{}\n", f[0], f[1], f[2])).collect::<String>()
    };
    dir.write("modelnet.off", format!("OFF{counts}{}\n{}", points.join("\n"), corners(" ")));
    encodes(&dir, "modelnet.off");
    dir.write("edges.obj", format!("{}l 1 2\np 3\nf 1 2\nf 5\n", rest.replace("\nf ", "\nfo ")));
    let told = encodes(&dir, "edges.obj");
    assert!(told.contains("edges.obj: left out 2 faces of fewer than three corners"), "{told}");
    assert_eq!(told.matches("left out").count(), 1, "{told}");
    assert!(dir.read("modelnet.off.cager") == dir.read("edges.obj.cager"), "the same model");
}

#[test]
fn a_text_that_was_cut_is_called_that() {
    let dir = Dir::with_case("19-words");
    let line = |file: &str| format!("cage --rest {file} --vertices 30 -o made.obj");
    let rest = String::from_utf8(dir.read("rest.obj")).unwrap();
    dir.write("cut.obj", rest.trim_end().rsplit_once(' ').unwrap().0);
    refused(&dir, &line("cut.obj"), &["cut.obj", "the file ends within this line"]);
    dir.write("cut.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1");
    refused(&dir, &line("cut.stl"), &["cut.stl", "line 6: the file ends within this line"]);
}

#[test]
fn decimal_commas_are_called_that() {
    let dir = Dir::with_case("19-words");
    let words = ["comma.obj", "has a decimal comma", "decimal points (the English number format)"];
    refused(&dir, "encode --rest comma.obj --cage cage.obj --frames frames.npy -o out.cager", &words);
}
