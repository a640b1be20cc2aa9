//! What users rely on when scenes of FBX are read.

use cager_formats::*;
use std::path::PathBuf;

fn character() -> Option<PathBuf> {
    let data = std::env::var_os("CAGER_CAPTURES")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from);
    Some(data.join("character")).filter(|folder| folder.join("robin.fbx").is_file())
}

#[test]
fn look() {
    let folder = character().unwrap();
    let path = folder.join("robin.fbx");
    let read = read_mesh(&path, &[]).unwrap();
    println!("{:?} {:?} {:?}", read.units, read.note, read.dropped);
    for part in &read.model.surface.parts {
        println!(
            "{} {} {} uv {:?} col {:?} normals {} hard? sub {:?} creases {} mats {:?} groups {:?} shown {:?}",
            part.path,
            part.points,
            part.faces,
            part.uv_sets.iter().map(|s| (&s.name, s.values.len())).collect::<Vec<_>>(),
            part.color_sets.iter().map(|s| (&s.name, s.values.len(), s.values.first())).collect::<Vec<_>>(),
            part.normals.len(),
            part.subdivision,
            part.creases.len(),
            part.materials.iter().collect::<std::collections::BTreeSet<_>>(),
            part.groups.len(),
            part.shown
        );
        println!("   {:?}", part.creases.first());
    }
    for m in &read.model.surface.materials {
        println!("{m:?}");
    }
    let frames = open_frames(&path, read.model.points.len()).unwrap();
    println!(
        "{} {:?} {} {:?} {:?}",
        frames.frames(),
        frames.frame_rate(),
        frames.number(0),
        frames.notes(),
        frames.shown()
    );
    println!("{:?}", &read.model.points[..3]);
}
