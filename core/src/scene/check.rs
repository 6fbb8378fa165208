//! The last check of a scene: what everything after the loaders relies on.
//!
//! Loaders check as they go, and can name the place in the file; this is the net beneath them, so that no index of any
//! format, old or new, reaches a tracer unchecked. Whoever makes a scene by hand has nothing else.

use std::f32::consts::FRAC_PI_2;
use std::ops::Range;

use rayon::prelude::*;

use super::{Alpha, AreaShape, Attenuation, Environment, Fog, Geometry, Group, Light, Material, Mesh, Scene};
use crate::error::{Error, Result};
use crate::math::{DVec3, MAX_COORDINATE, Vec3};

impl Scene {
    /// Whether all indices are in range, attributes match, and materials, shapes, placements and lights can be. What
    /// `io::load` gives has been checked; what is made by hand should be, for the tracers rely on it. Corners of
    /// triangles may be NaN or infinite: those are never hit. Whether a placement can be undone is for
    /// [`World::new`](crate::World::new) to say.
    ///
    /// # Errors
    /// [`Error::Scene`] with the first thing that is wrong.
    pub fn check(&self) -> Result<()> {
        fault(self).map_err(Error::Scene)
    }

    /// Whether its geometries are there.
    fn has_geometries(&self, group: &Group) -> bool {
        let Range { start, end } = group.geometries;
        self.geometries.get(start as usize..end as usize).is_some()
    }
}

/// What [`Scene::check`] says, as a message alone.
pub fn fault(scene: &Scene) -> std::result::Result<(), String> {
    references(scene)?;
    for geometry in &scene.geometries {
        if geometry.material() as usize >= scene.materials.len() {
            return Err(format!("material {} of {} does not exist", geometry.material(), scene.materials.len()));
        }
        match geometry {
            Geometry::Mesh(mesh) => check_mesh(mesh).map_err(|message| format!("mesh {:?}: {message}", mesh.name))?,
            Geometry::Shapes { shapes, .. } => {
                shapes
                    .iter()
                    .try_for_each(|shape| shape.check().map_err(|wrong| format!("{}: {wrong}", shape.name())))?;
            }
        }
    }
    for material in &scene.materials {
        check_material(material, scene.textures.len())
            .map_err(|message| format!("material {:?} {message}", material.name))?;
    }
    for texture in &scene.textures {
        check_pixels(texture.width, texture.height, texture.pixels.len())
            .map_err(|message| format!("texture {:?} {message}", texture.name))?;
    }
    for instance in &scene.instances {
        let transforms = [Some(instance.transform), instance.transform_end];
        if transforms.into_iter().flatten().any(|transform| !transform.is_finite()) {
            return Err(format!("instance {:?} has a transform that is not finite", instance.name));
        }
    }
    for (number, light) in scene.lights.iter().enumerate() {
        check_light(light).map_err(|message| format!("light {number}: {message}"))?;
    }
    for (what, light) in [("ambient light", Some(scene.ambient)), ("the background", scene.background)] {
        if let Some(color) = light.filter(|&color| !is_sound(color)) {
            return Err(format!("{what} is {color}"));
        }
    }
    if let Some(Fog { absorption, color, reach }) = scene.fog
        && !(is_sound(absorption) && is_sound(color) && reach >= 0.0)
    {
        return Err(format!("fog has the absorption {absorption}, the color {color} and the reach {reach}"));
    }
    if let Some(environment) = &scene.environment {
        check_environment(environment).map_err(|message| format!("the environment {message}"))?;
    }
    Ok(())
}

/// Whether the groups that are placed, and the geometries of all groups, are there.
pub fn references(scene: &Scene) -> std::result::Result<(), String> {
    if let Some(group) = scene.groups.iter().find(|group| !scene.has_geometries(group)) {
        return Err(format!("group {:?} has geometries that do not exist", group.name));
    }
    match scene.instances.iter().find(|instance| instance.group as usize >= scene.groups.len()) {
        Some(instance) => Err(format!("instance {:?} places a group that does not exist", instance.name)),
        None => Ok(()),
    }
}

fn check_material(material: &Material, textures: usize) -> std::result::Result<(), &'static str> {
    let cutoff = if let Alpha::Mask { cutoff } = material.alpha { cutoff } else { 0.0 };
    let values = [
        material.ambient,
        material.diffuse,
        material.specular,
        material.reflection,
        material.transmission,
        material.emission,
        Vec3::new(material.shininess, material.ior, material.gloss.unwrap_or(0.0)),
        Vec3::new(material.opacity, cutoff, 0.0),
        material.absorption.map_or(Vec3::ZERO, |medium| medium.color),
    ];
    // A normal map may be turned inside out.
    if !values.into_iter().all(is_sound) || material.ior == 0.0 || !material.normal_scale.is_finite() {
        return Err("has values that are negative or not finite");
    }
    let physical = material.physical.as_ref().map_or([Vec3::ZERO; 4], |physical| physical.workflow.values());
    if !physical.into_iter().all(is_sound) {
        return Err("has physical values that are negative or not finite");
    }
    if material.opacity > 1.0 {
        return Err("has an opacity above 1");
    }
    if material
        .absorption
        .is_some_and(|medium| medium.distance.is_nan() || medium.distance <= 0.0 || medium.color.max_element() > 1.0)
    {
        return Err("absorbs light over no distance, or lets more through than there is");
    }
    match material.textures().all(|texture| (texture as usize) < textures) {
        true => Ok(()),
        false => Err("has a texture that does not exist"),
    }
}

fn check_environment(environment: &Environment) -> std::result::Result<(), String> {
    let Environment { image, intensity, rotation } = environment;
    check_pixels(image.width, image.height, image.pixels.len())?;
    if !(intensity.is_finite() && *intensity >= 0.0 && rotation.is_finite()) {
        return Err(format!("has the intensity {intensity} and the rotation {rotation}"));
    }
    Ok(())
}

/// Whether values, such as a color's, are finite and not negative.
fn is_sound(values: Vec3) -> bool {
    values.is_finite() && values.min_element() >= 0.0
}

fn check_pixels(width: u32, height: u32, found: usize) -> std::result::Result<(), String> {
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || pixels != found as u64 { Err(format!("has {found} of {pixels} pixels")) } else { Ok(()) }
}

fn check_light(light: &Light) -> std::result::Result<(), String> {
    match light {
        Light::Directional { direction, color } => {
            check_color("color", *color).and_then(|()| check_direction(*direction))
        }
        Light::Point { position, color, attenuation, range, radius } => {
            check_color("color", *color)?;
            check_source(*position, attenuation, *range)?;
            if !(radius.is_finite() && *radius >= 0.0) {
                return Err(format!("its radius is {radius}"));
            }
            Ok(())
        }
        Light::Spot { position, direction, color, attenuation, range, inner_angle: inner, outer_angle: outer } => {
            check_color("color", *color)?;
            check_direction(*direction)?;
            check_source(*position, attenuation, *range)?;
            if !(0.0 <= *inner && inner < outer && *outer <= FRAC_PI_2) {
                return Err(format!("its cone has the half-angles {inner}, inside, and {outer}"));
            }
            Ok(())
        }
        Light::Area { shape, radiance } => check_color("radiance", *radiance).and_then(|()| check_area(shape)),
    }
}

fn check_color(name: &str, color: Vec3) -> std::result::Result<(), String> {
    if is_sound(color) { Ok(()) } else { Err(format!("its {name} is {color}")) }
}

fn check_direction(direction: DVec3) -> std::result::Result<(), String> {
    if is_unit(direction) { Ok(()) } else { Err(format!("its direction is {direction}")) }
}

fn check_source(position: DVec3, attenuation: &Attenuation, range: f64) -> std::result::Result<(), String> {
    let Attenuation { constant, linear, quadratic } = *attenuation;
    let terms = [constant, linear, quadratic];
    if !position.is_finite() {
        return Err(format!("its position is {position}"));
    }
    if !terms.into_iter().all(|term| term.is_finite() && term >= 0.0) || terms == [0.0; 3] {
        return Err(format!("its attenuation is {constant}, {linear}, {quadratic}"));
    }
    if range.is_nan() || range <= 0.0 {
        return Err(format!("its range is {range}"));
    }
    Ok(())
}

fn check_area(shape: &AreaShape) -> std::result::Result<(), String> {
    let (centre, is_whole) = match *shape {
        AreaShape::Rectangle { centre, half_edges: [a, b] } => {
            let area = a.cross(b);
            (centre, area.is_finite() && area != DVec3::ZERO)
        }
        AreaShape::Disk { centre, normal, radius } => (centre, is_unit(normal) && is_radius(radius)),
        AreaShape::Sphere { centre, radius } => (centre, is_radius(radius)),
    };
    if centre.is_finite() && is_whole { Ok(()) } else { Err(format!("it shines from {shape:?}")) }
}

/// Whether a vector's length is 1, as near as who has rounded it to f32 can tell.
fn is_unit(vector: DVec3) -> bool {
    (vector.length() - 1.0).abs() < 1e-6
}

fn is_radius(radius: f64) -> bool {
    radius > 0.0 && radius <= MAX_COORDINATE.into()
}

fn check_mesh(mesh: &Mesh) -> std::result::Result<(), String> {
    let count = mesh.positions.len();
    let attributes = [
        ("normals", mesh.normals.len()),
        ("uvs", mesh.uvs.len()),
        ("second uvs", mesh.second_uvs.len()),
        ("colors", mesh.colors.len()),
    ];
    for (name, length) in attributes {
        if length != 0 && length != count {
            return Err(format!("{length} {name} for {count} positions"));
        }
    }
    if u32::try_from(count.max(mesh.triangles.len())).is_err() {
        return Err(format!("{count} vertices, {} triangles; at most 2^32 - 1 of each", mesh.triangles.len()));
    }
    if !mesh.origin.is_finite() {
        return Err("its origin is not finite".into());
    }
    if mesh.colors.iter().any(|color| !color.is_finite() || color.min_element() < 0.0) {
        return Err("colors that are negative or not finite".into());
    }
    let highest = mesh.triangles.as_flattened().par_chunks(1 << 14).filter_map(|part| part.iter().max()).max();
    match highest.filter(|&&i| i as usize >= count) {
        Some(i) => Err(format!("index {i} is past its {count} vertices")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::scene::{Absorption, Material, MetallicRoughness, Physical, PhysicalTextures, Texture, Workflow};
    use crate::shape::{Shape, Sphere};

    fn good() -> Scene {
        let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()])
    }

    #[test]
    fn finds_every_fault() {
        assert_eq!(fault(&good()), Ok(()));
        type Breaks = fn(&mut Scene, &mut Mesh);
        let physical = |change: fn(&mut MetallicRoughness)| {
            let plain = MetallicRoughness {
                base: Vec3::ONE,
                metalness: 0.0,
                roughness: 0.5,
                ior: None,
                specular: 1.0,
                specular_color: Vec3::ONE,
                transmission: 0.0,
            };
            let mut changed = plain;
            change(&mut changed);
            let made =
                |it| Physical { workflow: Workflow::MetallicRoughness(it), textures: PhysicalTextures::default() };
            let mut scene = good();
            scene.materials[0].physical = Some(made(plain));
            assert_eq!(fault(&scene), Ok(()));
            scene.materials[0].physical = Some(made(changed));
            fault(&scene).unwrap_err()
        };
        for change in [
            (|it| it.roughness = f32::NAN) as fn(&mut MetallicRoughness),
            |it| it.base.y = -1.0,
            |it| it.transmission = -0.5,
            |it| it.specular_color = Vec3::INFINITY,
        ] {
            assert!(physical(change).contains("physical values"));
        }
        let faults: [(&str, Breaks); 27] = [
            ("opacity above 1", |scene, _| scene.materials[0].opacity = 2.0),
            ("over no distance", |scene, _| {
                scene.materials[0].absorption = Some(Absorption { color: Vec3::ONE, distance: -0.0 });
            }),
            ("more through than there is", |scene, _| {
                scene.materials[0].absorption = Some(Absorption { color: Vec3::splat(2.0), distance: 1.0 });
            }),
            ("sphere: the radius is -1", |scene, _| {
                let shapes = vec![Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: -1.0 })];
                scene.geometries.push(Geometry::Shapes { shapes, material: 0 });
            }),
            ("does not exist", |_, mesh| mesh.material = 1),
            ("past its 3 vertices", |_, mesh| mesh.triangles = vec![[0, 1, 3]].into()),
            ("2 normals for 3", |_, mesh| mesh.normals = vec![Vec3::X; 2]),
            ("1 uvs for 3", |_, mesh| mesh.uvs = vec![Default::default()]),
            ("not finite", |_, mesh| mesh.origin = DVec3::NAN),
            ("does not exist", |scene, _| scene.instances[0].group = 1),
            ("do not exist", |scene, _| scene.groups[0].geometries = 0..2),
            ("group \"unused\" has geometries that do not exist", |scene, _| {
                scene.groups.push(Group { name: "unused".into(), geometries: 5..9 });
            }),
            ("transform that is not finite", |scene, _| scene.instances[0].transform.translation.x = f64::NAN),
            ("ambient light is", |scene, _| scene.ambient = Vec3::NAN),
            ("the background is", |scene, _| scene.background = Some(Vec3::NEG_ONE)),
            ("the reach -1", |scene, _| {
                scene.fog = Some(Fog { absorption: Vec3::ONE, color: Vec3::ONE, reach: -1.0 });
            }),
            ("environment has 0 of 2 pixels", |scene, _| {
                let image = Image { pixels: Vec::new(), ..Image::new(2, 1) };
                scene.environment = Some(Environment::new(image));
            }),
            ("the intensity -1", |scene, _| {
                scene.environment = Some(Environment { intensity: -1.0, ..Environment::new(Image::new(2, 1)) });
            }),
            ("light 0: its color is", |scene, _| {
                scene.lights.push(Light::Directional { direction: DVec3::X, color: Vec3::new(0.0, -1.0, 0.0) });
            }),
            ("light 1: its direction is", |scene, _| {
                scene.lights =
                    [DVec3::X, DVec3::ZERO].map(|direction| Light::Directional { direction, color: Vec3::ONE }).into();
            }),
            ("its attenuation is 0, 0, 0", |scene, _| {
                let attenuation = Attenuation { constant: 0.0, ..Attenuation::NONE };
                let (position, color, range, radius) = (DVec3::ZERO, Vec3::ONE, f64::INFINITY, 0.0);
                scene.lights.push(Light::Point { position, color, attenuation, range, radius });
            }),
            ("its cone has the half-angles 0.5", |scene, _| {
                scene.lights.push(Light::Spot {
                    position: DVec3::ZERO,
                    direction: DVec3::X,
                    color: Vec3::ONE,
                    attenuation: Attenuation::NONE,
                    range: f64::INFINITY,
                    inner_angle: 0.5,
                    outer_angle: 0.25,
                });
            }),
            ("it shines from Sphere", |scene, _| {
                let shape = AreaShape::Sphere { centre: DVec3::ZERO, radius: -1.0 };
                scene.lights.push(Light::Area { shape, radiance: Vec3::ONE });
            }),
            ("negative or not finite", |scene, _| scene.materials[0].diffuse = Vec3::NEG_ONE),
            ("negative or not finite", |scene, _| scene.materials[0].alpha = Alpha::Mask { cutoff: f32::NAN }),
            ("negative or not finite", |scene, _| scene.materials[0].normal_scale = f32::INFINITY),
            ("0 of 1 pixels", |scene, _| scene.textures.push(Texture { width: 1, height: 1, ..Texture::default() })),
        ];
        for (expected, fault) in faults {
            let mut scene = good();
            let Geometry::Mesh(mut mesh) = scene.geometries.remove(0) else { unreachable!() };
            fault(&mut scene, &mut mesh);
            scene.geometries.push(Geometry::Mesh(mesh));
            let message = scene.check().unwrap_err().to_string();
            assert!(message.contains(expected), "{message} has no {expected}");
        }
    }
}
