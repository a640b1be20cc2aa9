//! The mesh that images move: binary glTF with each point's texel as its texture coordinates.

use std::io::{self, Write};

use super::Scene;
use super::layout::Layout;
use crate::glb::write_head;
use crate::normals::vertex_normals;
use crate::scene::bounds;

/// Writes positions, normals, texture coordinates and corners. Shaders take the second set of
/// coordinates; the first one is the same, as glTF has no second one without.
pub(super) fn write(out: &mut impl Write, positions: &[f32], layout: &Layout, scene: &Scene) -> io::Result<()> {
    let points = layout.points;
    let mut normals = Vec::new();
    vertex_normals(positions, &scene.triangles, &mut normals);
    let places: Vec<f32> = (0..points).flat_map(|point| layout.place(point)).collect();
    let numbers = positions.iter().chain(normals.as_flattened()).chain(&places).flat_map(|x| x.to_le_bytes());
    let data: Vec<u8> = numbers.chain(scene.triangles.as_flattened().iter().flat_map(|x| x.to_le_bytes())).collect();
    let [low, high] = bounds(positions);
    let corners = 3 * scene.triangles.len();
    let (name, origin) = (&scene.name, scene.origin);
    let view = |start: usize, length: usize, target: u32| {
        format!(r#"{{"buffer":0,"byteOffset":{start},"byteLength":{length},"target":{target}}}"#)
    };
    let mut views =
        vec![view(0, 12 * points, 34962), view(12 * points, 12 * points, 34962), view(24 * points, 8 * points, 34962)];
    let mut accessors = vec![
        format!(
            r#"{{"bufferView":0,"componentType":5126,"count":{points},"type":"VEC3","min":{low:?},"max":{high:?}}}"#
        ),
        format!(r#"{{"bufferView":1,"componentType":5126,"count":{points},"type":"VEC3"}}"#),
        format!(r#"{{"bufferView":2,"componentType":5126,"count":{points},"type":"VEC2"}}"#),
    ];
    let mut faces = r#""mode":0"#;
    if corners > 0 {
        views.push(view(32 * points, 4 * corners, 34963));
        accessors.push(format!(r#"{{"bufferView":3,"componentType":5125,"count":{corners},"type":"SCALAR"}}"#));
        faces = r#""indices":3"#;
    }
    let json = format!(
        r#"{{"asset":{{"version":"2.0","generator":"cager"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"name":"{name}","mesh":0,"translation":{origin:?}}}],"meshes":[{{"name":"{name}","primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2,"TEXCOORD_1":2}},{faces}}}]}}],"accessors":[{}],"bufferViews":[{}],"buffers":[{{"byteLength":{}}}]}}"#,
        accessors.join(","),
        views.join(","),
        data.len()
    );
    write_head(out, json, data.len())?;
    out.write_all(&data)
}
