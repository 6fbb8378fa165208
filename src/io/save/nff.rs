//! Haines's Neutral File Format, as [`crate::io::nff`] reads it. Instances are written out one by one.

use std::io::{self, Write};

use super::{Unsayable, check_finite, is_colored, moves, placed, spaced, spaced_f64, wound};
use crate::math::{DAffine3, DMat3, DVec2, DVec3, Vec3};
use crate::scene::{
    Alpha, Attenuation, Camera, DefaultLighting, Fov, Geometry, Interface, Light, Material, Mesh, Projection, Scene,
    Specular, choose_origin,
};
use crate::shape::Shape;

/// Whether the format has words for all of it.
pub(super) fn check(scene: &Scene) -> Result<(), Unsayable> {
    check_finite(scene)?;
    let elsewhere = |what: String| Err(format!("NFF has no {what}; write .toml"));
    for (geometry, transform) in placed(scene) {
        let Geometry::Shapes { shapes, .. } = geometry else { continue };
        if transform.matrix3 != DMat3::IDENTITY {
            return elsewhere("shapes under transforms".to_owned());
        }
        for shape in shapes {
            match shape {
                Shape::Sphere(_) | Shape::Polygon(_) => {}
                Shape::Cylinder(cylinder) if !cylinder.capped => {}
                Shape::Cone(cone) if !cone.capped => {}
                other => return elsewhere(format!("{}", Plural(other))),
            }
        }
    }
    if is_colored(scene) {
        return Err("NFF has no colours of vertices; keep the file they are in".to_owned());
    }
    if moves(scene) || scene.cameras.iter().any(|camera| camera.end.is_some()) {
        return elsewhere("motion".to_owned());
    }
    if scene.fog.is_some() {
        return elsewhere("fog".to_owned());
    }
    if scene.environment.is_some() {
        return elsewhere("environments".to_owned());
    }
    let is_grey = |color: Vec3| color.x == color.y && color.y == color.z;
    for material in &scene.materials {
        let Material { ambient, specular, reflection, transmission, emission, .. } = *material;
        let sayable = specular == reflection && is_grey(specular) && is_grey(transmission);
        let has_more = ambient != Vec3::ZERO && scene.ambient != Vec3::ZERO
            || emission != Vec3::ZERO
            || material.textures().next().is_some()
            || material.alpha != Alpha::Opaque
            || material.interface != Interface::Shares
            || material.gloss.is_some()
            || material.absorption.is_some()
            || material.unlit
            || material.energy_conserving
            || material.model != Specular::Phong && specular != Vec3::ZERO;
        if !sayable || has_more {
            let what = "ambient light, emission, textures, Blinn's highlights, highlights that are not as mirrors, or glass by Fresnel";
            return elsewhere(format!("{what} (material {:?})", material.name));
        }
    }
    let is_plain = |camera: &Camera| {
        let square = matches!(camera.projection, Projection::Perspective(Fov::Vertical(_) | Fov::Horizontal(_)));
        square && camera.shift == DVec2::ZERO && camera.lens.is_none() && camera.distortion.is_none()
    };
    if !scene.cameras.iter().all(is_plain) {
        return elsewhere(
            "cameras with a shift, a lens or pixels that are not square, or without perspective".to_owned(),
        );
    }
    if scene.lights.is_empty() && scene.default_lighting == DefaultLighting::Headlight {
        return elsewhere("light from the viewer, which scenes without lights have elsewhere".to_owned());
    }
    let is_bare = |light: &Light| matches!(light, Light::Point { attenuation: Attenuation::NONE, range, radius, .. } if range.is_infinite() && *radius == 0.0);
    if scene.lights.iter().all(is_bare) {
        Ok(())
    } else {
        elsewhere("lights but points without attenuation and size".to_owned())
    }
}

struct Plural<'a>(&'a Shape);

impl std::fmt::Display for Plural<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = self.0.name();
        match name {
            "box" => write!(f, "boxes"),
            "cylinder" | "cone" => write!(f, "capped {name}s"),
            _ => write!(f, "{name}s"),
        }
    }
}

pub(super) fn write(scene: &Scene, out: &mut dyn Write) -> io::Result<()> {
    let [width, height] = scene.request.size.unwrap_or([512, 512]);
    for camera in &scene.cameras {
        view(camera, width, height, out)?;
    }
    writeln!(out, "b {}", spaced(scene.background.unwrap_or_default()))?;
    for light in &scene.lights {
        if let Light::Point { position, color, .. } = light {
            writeln!(out, "l {} {}", spaced_f64(*position), spaced(*color))?;
        }
    }
    let mut last = None;
    for (geometry, transform) in placed(scene) {
        let index = geometry.material();
        if last.replace(index) != Some(index) {
            fill(&scene.materials[index as usize], out)?;
        }
        match geometry {
            Geometry::Mesh(mesh) => write_mesh(mesh, transform, out)?,
            Geometry::Shapes { shapes, .. } => {
                for shape in shapes {
                    write_shape(shape, transform.translation, out)?;
                }
            }
        }
    }
    Ok(())
}

fn view(camera: &Camera, width: u32, height: u32, out: &mut dyn Write) -> io::Result<()> {
    // From the edges of the picture to the centres of its first and last row.
    let rows = f64::from(height);
    let half = camera.projection.half_extent(f64::from(width) / rows).map_or(1.0, |half| half.y);
    let share = if height > 1 { (rows - 1.0) / rows } else { 1.0 };
    let angle = 2.0 * libm::atan(half * share);
    let at = camera.pose(0.0).target(1.0);
    writeln!(out, "v\nfrom {}\nat {}", spaced_f64(camera.eye), spaced_f64(at))?;
    writeln!(out, "up {}\nangle {}\nhither 0", spaced_f64(camera.frame.y_axis), angle.to_degrees())?;
    writeln!(out, "resolution {width} {height}")
}

/// Kd is 1 and the colour the diffuse one.
fn fill(material: &Material, out: &mut dyn Write) -> io::Result<()> {
    let Material { diffuse, specular, shininess, transmission, ior, .. } = material;
    writeln!(out, "f {} 1 {} {shininess} {} {ior}", spaced(*diffuse), specular.x, transmission.x)
}

fn write_mesh(mesh: &Mesh, transform: &DAffine3, out: &mut dyn Write) -> io::Result<()> {
    // As loaders decide whether f32 holds it.
    let is_far = choose_origin(&mesh.bounds(transform)) != DVec3::ZERO;
    let place = |i: u32| {
        let point = transform.transform_point3(mesh.point(mesh.positions[i as usize]));
        if is_far { spaced_f64(point) } else { spaced(point.as_vec3()) }
    };
    let for_normals = transform.matrix3.inverse().transpose();
    for corners in mesh.triangles.iter() {
        writeln!(out, "{} 3", if mesh.normals.is_empty() { "p" } else { "pp" })?;
        for i in wound(*corners, transform) {
            match mesh.normals.get(i as usize) {
                None => writeln!(out, "{}", place(i))?,
                Some(normal) => {
                    let normal = (for_normals * normal.as_dvec3()).normalize_or_zero().as_vec3();
                    writeln!(out, "{} {}", place(i), spaced(normal))?;
                }
            }
        }
    }
    Ok(())
}

/// A shape that is moved by `offset`, which may be farther than f32 takes it without a change.
fn write_shape(shape: &Shape, offset: DVec3, out: &mut dyn Write) -> io::Result<()> {
    let place = |p: Vec3| if offset == DVec3::ZERO { spaced(p) } else { spaced_f64(p.as_dvec3() + offset) };
    match shape {
        Shape::Sphere(sphere) => writeln!(out, "s {} {}", place(sphere.centre), sphere.radius),
        Shape::Cylinder(c) => {
            writeln!(out, "c\n{} {}\n{} {}", place(c.base), c.radius, place(c.apex), c.radius)
        }
        Shape::Cone(c) => {
            writeln!(out, "c\n{} {}\n{} {}", place(c.base), c.base_radius, place(c.apex), c.apex_radius)
        }
        Shape::Polygon(polygon) => {
            writeln!(out, "p {}", polygon.corners().len())?;
            polygon.corners().iter().try_for_each(|corner| writeln!(out, "{}", place(*corner)))
        }
        // Refused by the check.
        Shape::Plane(_) | Shape::Disk(_) | Shape::Cuboid(_) | Shape::Ellipsoid(_) => Ok(()),
    }
}
