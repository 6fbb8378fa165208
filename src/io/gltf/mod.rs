//! glTF 2.0 and GLB (Khronos Group 2021, *glTF 2.0 specification*).
//!
//! The JSON is read into [`schema`], buffers are mapped or decoded ([`Document`]), and from then on every index is
//! compared with what it points into at the moment it is used, so that each error has its JSON pointer and nothing
//! unused is refused. A mesh becomes a group, each primitive with area a geometry of it, each node with a mesh an
//! instance. A mesh that is deformed, by a skin or morph targets, becomes a group for each of its shapes.
//!
//! [`pose`] says where nodes are, at a time of an animation or as the file stores them. What moves as a whole moves
//! while the shutter is open too; what is deformed has the shape of the moment when it opens.
//!
//! Not rendered, and told in warnings: points and lines.

mod accessor;
mod attributes;
mod component;
mod container;
mod deform;
mod document;
mod draco;
mod extension;
mod instancing;
mod material;
mod means;
mod mesh;
mod meshopt;
mod morph;
mod node;
mod pose;
mod punctual;
mod quotes;
mod schema;
mod skin;
mod textures;
mod triangles;
mod uri;
mod variants;

use std::path::Path;

use self::document::Document;
use self::quotes::shortened;
use super::LoadOptions;
use crate::error::{Error, Result, Warning};
use crate::memory::Mapped;
use crate::scene::Scene;

/// Extensions of which a picture shows nothing: how polygons were split, and who made the file.
const UNSEEN_EXTENSIONS: [&str; 3] = ["FB_ngon_encoding", "KHR_xmp", "KHR_xmp_json_ld"];

/// The extensions that are honoured; a file that requires another is refused.
pub(super) const SUPPORTED_EXTENSIONS: [&str; 16] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
];

/// Reads a glTF or GLB file.
pub(super) fn load(
    path: &Path,
    file: &Mapped<'_>,
    options: &LoadOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Scene> {
    let before = warnings.len();
    let scene = read(path, file, options, warnings);
    for warning in &mut warnings[before..] {
        warning.message = shortened(&warning.message);
    }
    scene.map_err(|error| match error {
        Error::Input { path, place, message } => Error::input(path, place, shortened(&message)),
        other => other,
    })
}

/// The same, with messages of any length.
fn read(path: &Path, file: &Mapped<'_>, options: &LoadOptions, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let parts = container::split(file).map_err(|(place, message)| Error::input(path, place, message))?;
    if parts.rest > 0 {
        let message = format!("{} bytes after the end that the header gives are ignored", parts.rest);
        warnings.push(Warning::new(path, format!("byte {}", file.len() - parts.rest), message));
    }
    let root = schema::parse(parts.json).map_err(|e| {
        let place = if e.line() > 0 { format!("line {}, column {}", e.line(), e.column()) } else { String::new() };
        // The place is in the library's own message too.
        let message = e.to_string();
        let short = quotes::plain(message.split(" at line ").next().unwrap_or_default());
        Error::input(path, place, format!("not valid glTF: {short}"))
    })?;
    check_version(path, &root, warnings)?;
    let document = Document::open(path, root, file, parts.binary)?;
    let hierarchy = pose::Hierarchy::new(&document)?;
    let poses = pose::poses(&document, &hierarchy, &options.animation, warnings)?;
    let mut scene = Scene::default();
    let variant = variants::chosen(&document, options.variant.as_deref())?;
    let mut groups = mesh::Groups::new(&document, variant);
    node::place(&document, &hierarchy, &poses, &mut groups, &mut scene, warnings)?;
    groups.finish(&mut scene, warnings);
    scene.files = document.files();
    Ok(scene)
}

fn check_version(path: &Path, root: &schema::Root, warnings: &mut Vec<Warning>) -> Result<()> {
    if !root.asset.version.starts_with("2.") {
        let message = format!("glTF version {:?}; only 2.x can be read", root.asset.version);
        return Err(Error::input(path, "/asset/version", message));
    }
    // The version counts for those alone that do not have it: what is left out below it may be read.
    if let Some(least) = root.asset.min_version.as_ref().filter(|least| *least != "2.0") {
        let message = format!("needs a reader of glTF {least:?}, and this one reads 2.0");
        return Err(Error::input(path, "/asset/minVersion", message));
    }
    let is_unknown = |name: &&String| !SUPPORTED_EXTENSIONS.contains(&name.as_str());
    if let Some(index) = root.extensions_required.iter().position(|name| is_unknown(&name)) {
        let message = format!(
            "requires the extension {:?}, which is not supported; supported are {}",
            root.extensions_required[index],
            SUPPORTED_EXTENSIONS.join(", ")
        );
        return Err(Error::input(path, format!("/extensionsRequired/{index}"), message));
    }
    let is_seen = |name: &&String| is_unknown(name) && !UNSEEN_EXTENSIONS.contains(&name.as_str());
    let unknown: Vec<&str> = root.extensions_used.iter().filter(is_seen).map(String::as_str).collect();
    if !unknown.is_empty() {
        let message = format!("uses extensions that are not supported and left out: {}", unknown.join(", "));
        warnings.push(Warning::new(path, "/extensionsUsed", message));
    }
    Ok(())
}
