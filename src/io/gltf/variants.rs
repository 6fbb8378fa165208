//! `KHR_materials_variants`: other materials for the same meshes, by name.

use serde::Deserialize;

use super::document::Document;
use super::schema::{Extensions, Primitive};
use crate::error::Result;

const NAME: &str = "KHR_materials_variants";

/// Of the file.
#[derive(Deserialize)]
struct Variants {
    variants: Vec<Variant>,
}

#[derive(Deserialize)]
struct Variant {
    name: String,
}

/// Of a primitive.
#[derive(Deserialize)]
struct Mappings {
    mappings: Vec<Mapping>,
}

/// A material, and the variants in which it is used.
#[derive(Deserialize)]
struct Mapping {
    material: usize,
    variants: Vec<usize>,
}

/// The index of the variant with this name; none where none is asked for.
///
/// # Errors
/// Where the file has no such variant, with those that it has.
pub(super) fn chosen(document: &Document<'_>, name: Option<&str>) -> Result<Option<usize>> {
    let Some(name) = name else { return Ok(None) };
    let pointer = format!("/extensions/{NAME}");
    let all: Vec<Variant> = match document.root.extensions.get(NAME) {
        None => Vec::new(),
        Some(value) => {
            let read = Variants::deserialize(value);
            read.map_err(|error| document.error(&pointer, format!("not valid: {error}")))?.variants
        }
    };
    let found = all.iter().position(|variant| variant.name == name).map(Some);
    found.ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|variant| format!("{:?}", variant.name)).collect();
        let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        document.error(pointer, format!("no variant {name:?} of the materials; the file has {known}"))
    })
}

/// The material of a primitive at `pointer` in a variant.
pub(super) fn material(
    document: &Document<'_>,
    primitive: &Primitive,
    variant: Option<usize>,
    pointer: &str,
) -> Result<Option<usize>> {
    let Some(variant) = variant else { return Ok(primitive.material) };
    let Some(mappings) = read(document, &primitive.extensions, pointer)? else { return Ok(primitive.material) };
    let Some(i) = mappings.mappings.iter().position(|mapping| mapping.variants.contains(&variant)) else {
        return Ok(primitive.material);
    };
    let material = mappings.mappings[i].material;
    let pointer = format!("{pointer}/extensions/{NAME}/mappings/{i}/material");
    document.check_index(&pointer, material, document.root.materials.len(), "material")?;
    Ok(Some(material))
}

fn read(document: &Document<'_>, extensions: &Extensions, pointer: &str) -> Result<Option<Mappings>> {
    let Some(value) = extensions.get(NAME) else { return Ok(None) };
    let told = |error| document.error(format!("{pointer}/extensions/{NAME}"), format!("not valid: {error}"));
    Mappings::deserialize(value).map(Some).map_err(told)
}
