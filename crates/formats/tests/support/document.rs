//! Documents of glTF whose accessors are put together one by one.

use super::{POINTS, glb_file};

/// A document that grows: each accessor has a view of its own.
#[derive(Default)]
pub struct Built {
    pub views: Vec<String>,
    pub accessors: Vec<String>,
    pub data: Vec<u8>,
}

impl Built {
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#, self.data.len(), bytes.len()));
        self.data.extend(bytes);
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    pub fn add(&mut self, kind: u32, count: usize, shape: &str, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":{kind},"count":{count},"type":"{shape}","normalized":{}}}"#,
            kind != 5126 && shape == "VEC4"
        ));
        self.accessors.len() - 1
    }

    pub fn floats(&mut self, shape: &str, numbers: &[f32]) -> usize {
        let width = match shape {
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            _ => 1,
        };
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.add(5126, numbers.len() / width, shape, &bytes)
    }

    /// Vectors of up to four numbers.
    pub fn vectors<const N: usize>(&mut self, numbers: &[[f32; N]]) -> usize {
        self.floats(["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1], numbers.as_flattened())
    }

    /// Those of the tetrahedron.
    pub fn points(&mut self) -> usize {
        self.floats("VEC3", &POINTS.map(|p| p.map(|x| x as f32)).concat())
    }

    pub fn file(&self, rest: &str) -> Vec<u8> {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
            self.data.len(),
            self.views.join(","),
            self.accessors.join(",")
        );
        glb_file(&json, &self.data)
    }
}
