//! Normals from a texture (Blinn 1978, *Simulation of wrinkled surfaces*), in the frame that texture coordinates make,
//! as glTF has it.
//!
//! The frame is that of the triangle, or of the shape: u and v as directions along its surface. Tangents that a file
//! gives at its vertices are not read: they are these, smoothed, and all but the files that were baked with others look
//! the same. Where a map is turned or scaled on the surface, so is the frame: what it shows is bent as it is seen.

use super::{SurfacePoint, texture};
use crate::math::{DAffine3, DVec3, Mat3, Vec2, tangents};
use crate::ray::Hit;
use crate::scene::{Geometry, Material, Scene, Texture};
use crate::shape::Shape;
use crate::trace::{Primitives, World};

/// From a point to those where a shape's parameters are compared, as a share of its size.
const STEP: f64 = 1e-5;

/// Bends the shading normal of `point`, which `hit` names, as the material's texture has it. Meshes without texture
/// coordinates keep theirs, and so do shapes where their parameters have no direction, as at poles.
pub fn bend(point: &mut SurfacePoint, scene: &Scene, world: &World, hit: &Hit, material: &Material) {
    let map = material.normal_texture.and_then(|i| scene.textures.get(i as usize));
    let Some(map) = map else { return };
    let Some([u, v]) = directions(scene, world, hit, map, point) else { return };
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

/// The directions along a surface, where it is at the time of `point`, in which u and v of the map grow, of any length.
fn directions(scene: &Scene, world: &World, hit: &Hit, map: &Texture, point: &SurfacePoint) -> Option<[DVec3; 2]> {
    let (part, placement) = world.locate(hit);
    let placement = placement.map(|placement| placement.at(point.time));
    let to_world = placement.as_ref().map_or(DAffine3::IDENTITY, |p| p.to_world.as_daffine3());
    match (&part.primitives, &scene.geometries[hit.geometry as usize]) {
        (Primitives::Triangles { positions, triangles }, Geometry::Mesh(mesh)) => {
            let corners = triangles[hit.primitive as usize].map(|i| i as usize);
            let uvs = if map.on_second_uvs { &mesh.second_uvs } else { &mesh.uvs };
            along_triangle(corners.map(|i| to_world.transform_point3(positions[i].as_dvec3())), corners, uvs, map)
        }
        (Primitives::Shapes(shapes), _) => {
            let at = placement.map_or(point.position, |p| p.to_object.transform_point3(point.position));
            let along = along_shape(&shapes[hit.primitive as usize], at, map)?;
            Some(along.map(|direction| to_world.transform_vector3(direction)))
        }
        _ => None,
    }
}

/// The same along a triangle; `corners` are the places of its vertices in `uvs`.
fn along_triangle([a, b, c]: [DVec3; 3], corners: [usize; 3], uvs: &[Vec2], map: &Texture) -> Option<[DVec3; 2]> {
    let uv = |k: usize| uvs.get(corners[k]).map(|uv| map.transform.transform_point2(*uv).as_dvec2());
    let (first, second) = (uv(1)? - uv(0)?, uv(2)? - uv(0)?);
    let area = first.perp_dot(second);
    let ([e1, e2], sign) = ([b - a, c - a], area.signum());
    (area != 0.0).then(|| [(e1 * second.y - e2 * first.y) * sign, (e2 * first.x - e1 * second.x) * sign])
}

/// The same along a shape at a point of it, in the shape's coordinates: by how its parameters change from one side of
/// the point to the other.
fn along_shape(shape: &Shape, at: DVec3, map: &Texture) -> Option<[DVec3; 2]> {
    // Steps are to be small against its radius of curvature, or against the whole of what is flat. And where parameters
    // run around it, they begin again at 0 on the way.
    let size = || f64::from(shape.bounds().size().max_element());
    let (size, runs_around) = match shape {
        Shape::Plane(_) => (1.0, false),
        Shape::Cuboid(_) | Shape::Polygon(_) => (size(), false),
        Shape::Sphere(sphere) => (f64::from(sphere.radius), true),
        Shape::Disk(disk) => (f64::from(disk.radius), true),
        Shape::Cylinder(cylinder) => (f64::from(cylinder.radius), true),
        Shape::Cone(cone) => (f64::from(cone.base_radius.max(cone.apex_radius)), true),
        Shape::Ellipsoid(ellipsoid) => {
            let Mat3 { x_axis, y_axis, z_axis } = ellipsoid.axes;
            (f64::from(x_axis.length().min(y_axis.length()).min(z_axis.length())), true)
        }
    };
    let step = STEP * size;
    let sides = tangents(shape.normal(at).try_normalize()?);
    let [p, q] = sides.map(|side| {
        let [before, after] = [-step, step].map(|step| shape.uv(at + side * step));
        let difference = after - before;
        let difference = if runs_around { difference - difference.round() } else { difference };
        map.transform.matrix2.as_dmat2() * difference
    });
    // The inverse of the matrix of p and q, whose columns are u and v along the two sides.
    let area = p.perp_dot(q);
    let ([x, y], sign) = (sides, area.signum());
    (area != 0.0 && area.is_finite()).then(|| [(x * q.y - y * p.y) * sign, (y * p.x - x * q.x) * sign])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::shape::{Cone, Cuboid, Cylinder, Disk, Ellipsoid, Plane, Polygon, Sphere};

    /// A step in the direction of u leaves v as it is, and the other way round.
    #[test]
    fn directions_along_shapes_are_those_of_their_parameters() {
        let centre = Vec3::new(1.0, 2.0, -3.0);
        let axes = Mat3::from_cols(Vec3::new(2.0, 0.3, 0.0), Vec3::new(0.0, 1.0, 0.2), Vec3::new(0.1, 0.0, 0.5));
        let square = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 1.0), Vec3::new(0.0, 1.0, 1.0)].map(|p| p + centre);
        let shapes: [Shape; 8] = [
            Sphere { centre, radius: 2.0 }.into(),
            Plane::new(centre, Vec3::new(0.3, 1.0, 0.5)).unwrap().into(),
            Disk::new(centre, Vec3::new(0.3, 1.0, 0.5), 2.0).unwrap().into(),
            Cuboid::new(centre - 1.0, centre + Vec3::new(1.0, 3.0, 2.0)).unwrap().into(),
            Cylinder::new(centre, centre + Vec3::new(1.0, 2.0, 0.0), 0.4, false).unwrap().into(),
            Cone::new(centre, 1.5, centre + Vec3::new(0.0, 2.0, 1.0), 0.3, false).unwrap().into(),
            Ellipsoid::new(centre, axes).unwrap().into(),
            Polygon::new(square.to_vec()).unwrap().into(),
        ];
        let map = Texture::default();
        for shape in &shapes {
            let mut met = 0;
            for direction in [Vec3::X, Vec3::new(-1.0, 0.2, 0.4), Vec3::new(0.3, -1.0, 0.2), Vec3::new(0.2, 0.5, -1.0)]
            {
                for aside in [0.1, 0.23] {
                    let origin = centre + Vec3::new(0.5, 0.4, 0.3) + Vec3::splat(aside) - direction * 20.0;
                    let Some(hit) = shape.intersect(&crate::Ray::new(origin, direction)) else { continue };
                    met += 1;
                    let at = origin.as_dvec3() + direction.as_dvec3() * hit.t;
                    let [u, v] = along_shape(shape, at, &map).unwrap();
                    let change = |along: DVec3| {
                        let step = along.normalize() * 2e-3;
                        shape.uv(at + step) - shape.uv(at - step)
                    };
                    let (by_u, by_v) = (change(u), change(v));
                    assert!(by_u.x > 0.0 && by_u.y.abs() < 0.01 * by_u.x, "{}: {by_u}", shape.name());
                    assert!(by_v.y > 0.0 && by_v.x.abs() < 0.01 * by_v.y, "{}: {by_v}", shape.name());
                }
            }
            assert!(met >= 2, "{}: {met}", shape.name());
        }
    }

    /// Flat ones that lie along the axes, and wires: far away, what they are in one direction is next to nothing there.
    #[test]
    fn thin_shapes_have_directions() {
        let map = Texture::default();
        for (place, axis) in [(0.0, Vec3::Y), (100.0, Vec3::Y), (3.0, Vec3::Z)] {
            let centre = Vec3::splat(place);
            let disk = Shape::from(Disk::new(centre, axis, 1.0).unwrap());
            let out = tangents(axis.as_dvec3())[0];
            let [u, v] = along_shape(&disk, centre.as_dvec3() + out * 0.5, &map).expect("it is not the middle");
            assert!(v.normalize().dot(out) > 1.0 - 1e-9 && u.normalize().dot(out).abs() < 1e-6, "{place}: {u} {v}");
        }
        let flat = Shape::from(Cuboid::new(Vec3::ZERO, Vec3::new(1.0, 1e-5, 1.0)).unwrap());
        let [u, v] = along_shape(&flat, DVec3::new(0.3, 1e-5, 0.6), &map).expect("its upper side");
        assert!(u.normalize().dot(DVec3::Z) > 1.0 - 1e-9 && v.normalize().dot(DVec3::X) > 1.0 - 1e-9, "{u} {v}");
        let along = Vec3::new(1.0, 1.0, 1.0).normalize();
        let wire = Shape::from(Cylinder::new(Vec3::ZERO, along * 100.0, 0.001, false).unwrap());
        let side = tangents(along.as_dvec3())[0];
        let [u, v] = along_shape(&wire, along.as_dvec3() * 40.0 + side * 0.001, &map).expect("its side");
        assert!(v.normalize().dot(along.as_dvec3()) > 1.0 - 1e-6 && u.normalize().dot(side).abs() < 1e-4, "{u} {v}");
    }
}
