//! The pictures that comments name as textures (`TextureFile`, MeshLab), and the parts of a mesh that they are for.

use std::collections::HashMap;
use std::path::Path;

use super::header::Header;
use super::wedges::{self, NUMBER, Part};
use crate::error::{Result, Warning};
use crate::io::texture;
use crate::math::Vec3;
use crate::scene::{Geometry, Material, Mesh, Scene, Texture, Wrap};

/// The scene of a file's parts: a mesh and a material for each.
pub(super) fn scene(path: &Path, header: &Header, parts: Vec<Part>, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let named = named(path, header, &parts, warnings);
    let (mut geometries, mut materials) = (Vec::new(), Vec::new());
    let (mut textures, mut files) = (Vec::new(), Vec::new());
    // By name: what they have become, if anything.
    let mut known: HashMap<&str, Option<u32>> = HashMap::new();
    for (Part { mesh, texture }, material) in parts.into_iter().zip(0..) {
        let wanted = texture.and_then(|number| named.get(number as usize));
        let mut diffuse_texture = wanted.and_then(|(_, name)| known.get(name.as_str()).copied().flatten());
        if let Some((line, name)) = wanted.filter(|(_, name)| !known.contains_key(name.as_str())) {
            let (file, place) = (texture::beside(path, name), format!("line {line}"));
            match texture::open(&file).map_err(|error| error.named_in(path, &place))? {
                Ok(texture) => {
                    diffuse_texture = Some(textures.len() as u32);
                    textures.push(Texture { wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, ..texture });
                    files.push(file);
                }
                Err(why) => warnings.push(Warning::new(path, place, format!("{why}; the mesh is rendered without it"))),
            }
            known.insert(name, diffuse_texture);
        }
        let is_plain = mesh.colors.is_empty() && diffuse_texture.is_none();
        let base = if is_plain { Material::default().diffuse } else { Vec3::ONE };
        geometries.push(Geometry::Mesh(Mesh { material, ..mesh }));
        materials.push(Material { ambient: base, diffuse: base, diffuse_texture, ..Material::default() });
    }
    let mut scene = Scene::from_geometries(geometries, materials);
    scene.files.extend(files);
    Ok(Scene { textures, ..scene })
}

/// The lines and names of the pictures that the parts can have; where that is none or not all, a warning says why.
fn named<'a>(path: &Path, header: &'a Header, parts: &[Part], warnings: &mut Vec<Warning>) -> &'a [(usize, String)] {
    let Some((line, _)) = header.textures.first() else { return &[] };
    let is_numbered = wedges::heeded(header).is_some_and(|face| face.index(&[NUMBER]).is_some());
    let count = header.textures.len();
    let why = if parts.iter().all(|part| part.mesh.uvs.is_empty()) {
        "TextureFile would need texture coordinates, and neither vertices nor faces have them"
    } else if count > 1 && !is_numbered {
        "TextureFile names several textures, and faces have no texnumber that says which is theirs"
    } else {
        let is_stray = |part: &&Part| part.texture.is_some_and(|number| number as usize >= count);
        let strays: usize = parts.iter().filter(is_stray).map(|part| part.mesh.triangles.len()).sum();
        if strays > 0 {
            let message = format!(
                "{strays} triangles have a texnumber past the last TextureFile, {}; they are rendered without texture",
                count - 1
            );
            warnings.push(Warning::new(path, "", message));
        }
        return &header.textures;
    };
    warnings.push(Warning::new(path, format!("line {line}"), format!("{why}; the mesh is rendered without texture")));
    &[]
}
