//! `KHR_draco_mesh_compression`: the triangles and attributes of a primitive, compressed together.
//!
//! The bitstream is read by the crate draco-core, which is Rust without `unsafe`, gives what Google's own library
//! gives, and refuses what would take more memory than it is told there is.

use std::collections::BTreeMap;

use draco_core::decode_limits::DecodeLimits;
use draco_core::decoder_buffer::DecoderBuffer;
use draco_core::mesh::Mesh;
use draco_core::mesh_decoder::MeshDecoder;
use serde::Deserialize;

use super::accessor;
use super::document::Document;
use super::schema::Primitive;
use crate::error::Result;

const NAME: &str = "KHR_draco_mesh_compression";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Extension {
    buffer_view: usize,
    /// From names to numbers in the compressed data.
    attributes: BTreeMap<String, u32>,
}

/// What a primitive's compressed data hold.
pub(super) struct Decoded {
    pub(super) triangles: Vec<[u32; 3]>,
    /// By name: 32-bit floats in the file's byte order, as what stands for them where their accessor is normalised.
    pub(super) attributes: BTreeMap<String, Vec<u8>>,
}

/// The data of a primitive; none where they are not compressed.
///
/// # Errors
/// What is wrong with the extension, the data, or the accessors that describe them.
pub(super) fn decode(document: &Document<'_>, primitive: &Primitive, pointer: &str) -> Result<Option<Decoded>> {
    let Some(value) = primitive.extensions.get(NAME) else { return Ok(None) };
    let pointer = format!("{pointer}/extensions/{NAME}");
    let fail = |message: String| document.error(&pointer, message);
    let extension = Extension::deserialize(value).map_err(|error| fail(format!("not valid: {error}")))?;
    if !extension.attributes.contains_key("POSITION") {
        return Err(fail("the compressed attributes have no POSITION".into()));
    }
    let (bytes, _) = document.view(extension.buffer_view).map_err(&fail)?;
    let left = document.left();
    let limits =
        DecodeLimits::default().with_max_points(left / 12).with_max_faces(left / 12).with_max_decoded_bytes(left);
    let mut mesh = Mesh::new();
    let decoded = MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh);
    decoded.map_err(|error| fail(format!("the data are broken: {error}")))?;
    let points = mesh.num_points();
    document.spend(&pointer, mesh.num_faces() as u64 * 12)?;
    let triangles: Vec<[u32; 3]> = mesh.faces().iter().map(|corners| corners.map(|point| point.0)).collect();
    if triangles.as_flattened().iter().any(|&point| point as usize >= points) {
        return Err(fail(format!("a triangle has a corner past the {points} points of the data")));
    }
    let mut attributes = BTreeMap::new();
    for (name, &id) in &extension.attributes {
        let Some(&index) = primitive.attributes.get(name) else {
            return Err(fail(format!("{name} is compressed, but is none of the primitive's attributes")));
        };
        let there = mesh.attribute_by_unique_id(id);
        let attribute = there.ok_or_else(|| fail(format!("{name} is attribute {id}, which the data do not have")))?;
        let form = accessor::form(document, index)?;
        if form.count != points {
            let message = format!("{} elements of {name}, where the compressed data have {points}", form.count);
            return Err(document.error(format!("/accessors/{index}/count"), message));
        }
        document.spend(&pointer, points as u64 * form.components as u64 * 8)?;
        let values = attribute.read_f32s(points, form.components);
        attributes.insert(name.clone(), values.iter().flat_map(|&x| form.value(x).to_le_bytes()).collect());
    }
    Ok(Some(Decoded { triangles, attributes }))
}
