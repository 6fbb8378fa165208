//! Small glTF files, accessor by accessor.

use serde_json::{Value, json};

use super::{Files, gltf::data_uri};

/// A file in the making: its JSON, and the bytes of its one buffer.
pub struct Maker {
    pub json: Value,
    bytes: Vec<u8>,
}

/// Type codes of components.
pub const I8: u32 = 5120;
pub const U8: u32 = 5121;
pub const I16: u32 = 5122;
pub const U16: u32 = 5123;
pub const F32: u32 = 5126;

impl Maker {
    /// A file with one scene, which shows node 0, and nothing else yet.
    pub fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
            "accessors": [], "bufferViews": [], "buffers": [],
        });
        Self { json, bytes: Vec::new() }
    }

    /// The same with a triangle, (0, 0, 0), (1, 0, 0), (0, 1, 0), as mesh 0, which node 0 shows.
    pub fn triangle() -> Self {
        let mut maker = Self::new();
        let positions = maker.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        maker.json["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": positions}}]}]);
        maker.json["nodes"] = json!([{"mesh": 0}]);
        maker
    }

    /// The triangle, whose node is animated: `path` by keys at `times`.
    pub fn animated(path: &str, interpolation: &str, times: &[f32], kind: &str, values: &[f32]) -> Self {
        let mut maker = Self::triangle();
        let input = maker.floats("SCALAR", times);
        let output = maker.floats(kind, values);
        maker.json["animations"] = json!([{
            "channels": [{"sampler": 0, "target": {"node": 0, "path": path}}],
            "samplers": [{"input": input, "output": output, "interpolation": interpolation}],
        }]);
        maker
    }

    /// An accessor of floats; gives its index.
    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(kind, F32, false, values.len(), &bytes)
    }

    /// An accessor of any component type, of so many components.
    pub fn accessor(&mut self, kind: &str, component: u32, normalized: bool, components: usize, bytes: &[u8]) -> usize {
        let width = match kind {
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            _ => 1,
        };
        let view = self.view(bytes);
        let accessors = self.json["accessors"].as_array_mut().expect("a list");
        accessors.push(json!({
            "bufferView": view, "componentType": component, "normalized": normalized, "count": components / width, "type": kind,
        }));
        accessors.len() - 1
    }

    /// A buffer view of these bytes.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let views = self.json["bufferViews"].as_array_mut().expect("a list");
        views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend(bytes);
        views.len() - 1
    }

    /// The file, `a.gltf`.
    pub fn files(&self) -> Files {
        let mut json = self.json.clone();
        json["buffers"] =
            json!([{"byteLength": self.bytes.len(), "uri": data_uri("application/octet-stream", &self.bytes)}]);
        Files::one("a.gltf", json.to_string())
    }
}
