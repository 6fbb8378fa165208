//! The part of glTF's JSON that this renderer reads.
//!
//! The `gltf` crate has all of it, but holds transforms in f32, which moves a model that a node places at 1e7, and
//! insists on fields that the specification lets a file leave out.

mod look;
mod motion;

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::{Map, Value};

pub(super) use look::{Camera, Image, Light, Lights, Material, MetallicRoughness, Sampler, Texture, TextureInfo};
pub(super) use motion::{Animation, AnimationSampler, Skin};

pub(super) type Extensions = Map<String, Value>;

/// Reads the JSON of a file.
///
/// # Errors
/// What is wrong with it, and where.
pub(super) fn parse(json: &[u8]) -> serde_json::Result<Root> {
    serde_json::from_slice(json).or_else(|error| {
        // Whole numbers may be written as `3.0` or `5.126e3`, and of a key that is there twice the last counts: both
        // are rare enough for a second look.
        let Ok(value) = serde_json::from_slice(json) else { return Err(error) };
        // The first error knows its place; the second is of what is wrong apart from how numbers are written.
        let what =
            |error: &serde_json::Error| error.to_string().split(" at line ").next().unwrap_or_default().to_owned();
        serde_json::from_value(plain(value))
            .map_err(|second| if what(&second) == what(&error) { error } else { second })
    })
}

/// The members of an object, with whole numbers written as that.
fn plain_members<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Extensions, D::Error> {
    let members = Extensions::deserialize(deserializer)?;
    Ok(members.into_iter().map(|(key, value)| (key, plain(value))).collect())
}

/// The same with whole numbers written as that.
fn plain(value: Value) -> Value {
    match value {
        Value::Number(number) => match number.as_f64() {
            Some(whole) if number.is_f64() && whole.trunc() == whole && whole.abs() < 9e15 => Value::from(whole as i64),
            _ => Value::Number(number),
        },
        Value::Array(values) => values.into_iter().map(plain).collect(),
        Value::Object(members) => members.into_iter().map(|(key, value)| (key, plain(value))).collect(),
        other => other,
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Root {
    pub(super) asset: Asset,
    pub(super) scene: Option<usize>,
    #[serde(default)]
    pub(super) extensions_required: Vec<String>,
    #[serde(default)]
    pub(super) extensions_used: Vec<String>,
    #[serde(default, deserialize_with = "plain_members")]
    pub(super) extensions: Extensions,
    #[serde(default)]
    pub(super) scenes: Vec<Scene>,
    #[serde(default)]
    pub(super) nodes: Vec<Node>,
    #[serde(default)]
    pub(super) meshes: Vec<Mesh>,
    #[serde(default)]
    pub(super) accessors: Vec<Accessor>,
    #[serde(default)]
    pub(super) buffer_views: Vec<BufferView>,
    #[serde(default)]
    pub(super) buffers: Vec<Buffer>,
    #[serde(default)]
    pub(super) materials: Vec<Material>,
    #[serde(default)]
    pub(super) textures: Vec<Texture>,
    #[serde(default)]
    pub(super) images: Vec<Image>,
    #[serde(default)]
    pub(super) samplers: Vec<Sampler>,
    #[serde(default)]
    pub(super) cameras: Vec<Camera>,
    #[serde(default)]
    pub(super) animations: Vec<Animation>,
    #[serde(default)]
    pub(super) skins: Vec<Skin>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Asset {
    pub(super) version: String,
    pub(super) min_version: Option<String>,
}

#[derive(Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub(super) nodes: Vec<usize>,
}

#[derive(Deserialize)]
pub(super) struct Node {
    #[serde(default)]
    pub(super) name: String,
    #[serde(default)]
    pub(super) children: Vec<usize>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) mesh: Option<usize>,
    pub(super) camera: Option<usize>,
    pub(super) skin: Option<usize>,
    /// Of morph targets.
    pub(super) weights: Option<Vec<f32>>,
    #[serde(default, deserialize_with = "plain_members")]
    pub(super) extensions: Extensions,
}

#[derive(Deserialize)]
pub(super) struct Mesh {
    #[serde(default)]
    pub(super) name: String,
    pub(super) primitives: Vec<Primitive>,
    /// Of morph targets.
    #[serde(default)]
    pub(super) weights: Vec<f32>,
}

#[derive(Deserialize)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, usize>,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: Option<u32>,
    /// Accessors of displacements, by attribute.
    #[serde(default)]
    pub(super) targets: Vec<BTreeMap<String, usize>>,
    #[serde(default, deserialize_with = "plain_members")]
    pub(super) extensions: Extensions,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) sparse: Option<Sparse>,
}

#[derive(Deserialize)]
pub(super) struct Sparse {
    pub(super) count: u64,
    pub(super) indices: SparsePart,
    pub(super) values: SparsePart,
}

/// Sparse indices; or sparse values, which have no component type of their own.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparsePart {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: Option<u32>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
    #[serde(default, deserialize_with = "plain_members")]
    pub(super) extensions: Extensions,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: u64,
    #[serde(default, deserialize_with = "plain_members")]
    pub(super) extensions: Extensions,
}
