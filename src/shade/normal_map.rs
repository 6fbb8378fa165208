//! Normals from a texture (Blinn 1978, *Simulation of wrinkled surfaces*), in the frame that texture coordinates make, as glTF has it.
//!
//! The frame is that of the triangle: u and v as directions along its surface. Tangents that a file gives at its
//! vertices are not read: they are these, smoothed, and all but the files that were baked with others look the same. Where a map is
//! turned or scaled on the surface, so is the frame: what it shows is bent as it is seen.

use super::{SurfacePoint, texture};
use crate::math::{DAffine3, DVec3};
use crate::ray::Hit;
use crate::scene::{Geometry, Material, Scene, Texture};
use crate::trace::{Primitives, World};

/// Bends the shading normal of `point`, which `hit` names, as the material's texture has it. Meshes without texture
/// coordinates, and shapes, keep theirs.
pub fn bend(point: &mut SurfacePoint, scene: &Scene, world: &World, hit: &Hit, material: &Material) {
    let map = material.normal_texture.and_then(|i| scene.textures.get(i as usize));
    let Some(map) = map else { return };
    let Some([u, v]) = directions(scene, world, hit, map, point.time) else { return };
    // The map is for who sees the front.
    let side = if point.front { 1.0 } else { -1.0 };
    let normal = point.shading_normal * side;
    let along = |direction: DVec3| (direction - normal * normal.dot(direction)).try_normalize();
    let (Some(u), Some(v)) = (along(u), along(v)) else { return };
    let texel = texture::numbers(map, point.uv_of(map)).truncate().as_dvec3() * 2.0 - 1.0;
    let scale = f64::from(material.normal_scale);
    if let Some(bent) = (u * (texel.x * scale) + v * (texel.y * scale) + normal * texel.z).try_normalize() {
        point.shading_normal = bent * side;
    }
}

/// The directions along a triangle, where it is at a time, in which u and v of the map grow, of any length.
fn directions(scene: &Scene, world: &World, hit: &Hit, map: &Texture, time: f32) -> Option<[DVec3; 2]> {
    let Geometry::Mesh(mesh) = &scene.geometries[hit.geometry as usize] else { return None };
    let (part, placement) = world.locate(hit);
    let Primitives::Triangles { positions, triangles } = &part.primitives else { return None };
    let corners = triangles[hit.primitive as usize].map(|i| i as usize);
    let to_world = placement.map_or(DAffine3::IDENTITY, |p| p.at(time).to_world.as_daffine3());
    let [a, b, c] = corners.map(|i| to_world.transform_point3(positions[i].as_dvec3()));
    let uvs = if map.on_second_uvs { &mesh.second_uvs } else { &mesh.uvs };
    let uv = |k: usize| uvs.get(corners[k]).map(|uv| map.transform.transform_point2(*uv).as_dvec2());
    let (first, second) = (uv(1)? - uv(0)?, uv(2)? - uv(0)?);
    let area = first.perp_dot(second);
    let ([e1, e2], sign) = ([b - a, c - a], area.signum());
    (area != 0.0).then(|| [(e1 * second.y - e2 * first.y) * sign, (e2 * first.x - e1 * second.x) * sign])
}
