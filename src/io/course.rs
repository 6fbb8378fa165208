//! The ray tracer course format, `.test`: what the homework of many computer graphics courses renders.
//!
//! One statement a line. A statement holds until it is changed, and what it changes is what follows: the transform, the
//! material, the attenuation of lights. Everything is computed in f64 and rounded once. Triangles are stored where the
//! transform puts them. A sphere stays one under a similarity; under any other transform it is the unit sphere of
//! its material, placed by an instance, which costs a transform a sphere and keeps it exact.
//!
//! Decided where courses differ: lights and cameras are not moved by the transform; `maxverts` and `maxvertnorms`
//! promise sizes that nobody needs, and are only read; colours are linear; a file without lights is lit by `ambient`
//! and `emission` alone; where nothing is hit the picture is black; all faces have two sides. `maxdepth` counts
//! mirrored rays, and a surface mirrors by its `specular`.

use std::collections::HashMap;
use std::path::Path;

use super::Placeless;
use super::dshape::DShape;
use super::parts::{Parts, add_group};
use super::statement::{Statement, statements};
use super::suggest::suggestion;
use super::text::{name, quoted};
use crate::error::{Error, Result};
use crate::math::{DAffine3, DMat3, DVec3, Vec3, can_place, is_invertible, rotation, similarity};
use crate::memory::Mapped;
use crate::scene::{
    Attenuation, Camera, DefaultLighting, Geometry, Instance, Integrator, Light, Material, Scene, Specular,
};
use crate::shape::{Shape, Sphere};

/// Every statement as it should look; the first word is the keyword.
const USAGES: [&str; 24] = [
    "size width height",
    "maxdepth bounces",
    "output file",
    "camera fromx fromy fromz atx aty atz upx upy upz fovy",
    "sphere x y z radius",
    "maxverts count",
    "maxvertnorms count",
    "vertex x y z",
    "vertexnormal x y z nx ny nz",
    "tri vertex vertex vertex",
    "trinormal vertexnormal vertexnormal vertexnormal",
    "translate x y z",
    "rotate x y z degrees",
    "scale x y z",
    "pushTransform",
    "popTransform",
    "directional x y z r g b",
    "point x y z r g b",
    "attenuation constant linear quadratic",
    "ambient r g b",
    "diffuse r g b",
    "specular r g b",
    "shininess exponent",
    "emission r g b",
];

/// Reads a `.test` file.
pub(super) fn load(path: &Path, file: &Mapped<'_>) -> Result<Scene> {
    let mut reader = Reader::default();
    for mut statement in statements(file) {
        let read = reader.read(&mut statement);
        read.map_err(|message| Error::input(path, format!("line {}", statement.line), message))?;
    }
    file.done(file);
    Ok(reader.finish())
}

/// What the statements so far have set.
#[derive(Default)]
struct Reader {
    /// Its lights, cameras, materials and request; primitives are added at the end.
    scene: Scene,
    parts: Parts,
    /// Unit spheres under transforms that make ellipsoids of them.
    balls: Vec<Ball>,
    vertices: Vec<DVec3>,
    /// Positions and normals.
    vertex_normals: Vec<[DVec3; 2]>,
    transform: DAffine3,
    stack: Vec<DAffine3>,
    attenuation: Option<Attenuation>,
    surface: Surface,
    /// The material of each surface that a primitive has had.
    materials: HashMap<[u32; 13], u32>,
}

struct Ball {
    line: usize,
    material: u32,
    transform: DAffine3,
}

/// The material of what follows.
struct Surface {
    ambient: Vec3,
    diffuse: Vec3,
    specular: Vec3,
    shininess: f32,
    emission: Vec3,
}

impl Default for Surface {
    fn default() -> Self {
        let (ambient, zero) = (Vec3::splat(0.2), Vec3::ZERO);
        Self { ambient, diffuse: zero, specular: zero, shininess: 0.0, emission: zero }
    }
}

fn usages() -> impl Iterator<Item = (&'static str, &'static str)> {
    let keyword = |usage: &'static str| usage.split(' ').next().unwrap_or_default();
    USAGES.into_iter().map(move |usage| (keyword(usage), usage))
}

impl Reader {
    fn read(&mut self, statement: &mut Statement<'_>) -> Placeless<()> {
        let word = statement.word()?;
        let Some((keyword, usage)) = usages().find(|(keyword, _)| keyword.as_bytes() == word) else {
            let near = suggestion(&name(word), usages().map(|(keyword, _)| keyword));
            return Err(format!("{} is no statement of a .test file{near}", quoted(word)));
        };
        statement.usage = usage;
        match keyword {
            "size" => self.scene.request.size = Some(statement.picture_size()?),
            "maxdepth" => self.scene.request.max_depth = Some(statement.depth()?),
            "output" => self.scene.request.output = Some(name(statement.word()?)),
            "maxverts" | "maxvertnorms" => drop(statement.whole()?),
            "camera" => self.camera(statement)?,
            "directional" | "point" => self.light(keyword, statement)?,
            "attenuation" => self.attenuation = Some(attenuation(statement)?),
            "ambient" => self.surface.ambient = statement.color()?,
            "diffuse" => self.surface.diffuse = statement.color()?,
            "specular" => self.surface.specular = statement.color()?,
            "emission" => self.surface.emission = statement.color()?,
            "shininess" => self.surface.shininess = statement.share()?,
            "vertex" => self.vertices.push(statement.vector()?),
            "vertexnormal" => self.vertex_normals.push([statement.vector()?, statement.vector()?]),
            "tri" => self.triangle(statement)?,
            "trinormal" => self.triangle_with_normals(statement)?,
            "sphere" => self.sphere(statement)?,
            "pushTransform" => self.stack.push(self.transform),
            "popTransform" => {
                let top = self.stack.pop();
                self.transform = top.ok_or("popTransform where no pushTransform is left to undo")?;
            }
            "translate" | "rotate" | "scale" => self.multiply_transform(keyword, statement)?,
            _ => unreachable!("{keyword} is among the usages"),
        }
        statement.end()
    }

    fn camera(&mut self, statement: &mut Statement<'_>) -> Placeless<()> {
        let (from, at, up) = (statement.vector()?, statement.vector()?, statement.vector()?);
        let fov_y = statement.angle_of_view()?.to_radians();
        let camera = Camera::look_at(from, at, up, fov_y);
        let camera = camera.ok_or_else(|| Camera::no_look(["from", "at", "up"], [from, at, up]))?;
        self.scene.cameras.push(camera);
        Ok(())
    }

    fn light(&mut self, keyword: &str, statement: &mut Statement<'_>) -> Placeless<()> {
        let light = if keyword == "directional" {
            // The file has the direction towards the light.
            let direction = -statement.direction()?;
            Light::Directional { direction, color: statement.color()? }
        } else {
            let (position, color) = (statement.vector()?, statement.color()?);
            let attenuation = self.attenuation.unwrap_or(Attenuation::NONE);
            Light::Point { position, color, attenuation, range: f64::INFINITY, radius: 0.0 }
        };
        self.scene.lights.push(light);
        Ok(())
    }

    /// `translate`, `rotate` or `scale`: multiplies the transform from the right, so that it comes first for what
    /// follows.
    fn multiply_transform(&mut self, keyword: &str, statement: &mut Statement<'_>) -> Placeless<()> {
        let step = match keyword {
            "translate" => DAffine3::from_translation(statement.vector()?),
            "rotate" => DAffine3::from_quat(rotation(statement.direction()?, statement.number()?)),
            _ => DAffine3::from_scale(statement.vector()?),
        };
        let transform = self.transform * step;
        if !is_invertible(&transform) {
            return Err(format!("this {keyword} leaves a transform that nothing undoes; no factor may be 0"));
        }
        self.transform = transform;
        Ok(())
    }

    fn triangle(&mut self, statement: &mut Statement<'_>) -> Placeless<()> {
        let corners = corners(statement, "vertex", &self.vertices)?;
        let material = self.material();
        self.parts.triangle(material, corners.map(|p| self.transform.transform_point3(p)))
    }

    fn triangle_with_normals(&mut self, statement: &mut Statement<'_>) -> Placeless<()> {
        let corners = corners(statement, "vertexnormal", &self.vertex_normals)?;
        let material = self.material();
        let for_normals = self.transform.matrix3.inverse().transpose();
        let positions = corners.map(|[p, _]| self.transform.transform_point3(p));
        self.parts.smooth_triangle(material, positions, corners.map(|[_, n]| for_normals * n))
    }

    fn sphere(&mut self, statement: &mut Statement<'_>) -> Placeless<()> {
        let (centre, radius) = (statement.vector()?, statement.number()?);
        let material = self.material();
        if let Some(scale) = similarity(&self.transform.matrix3, 1e-12) {
            let centre = self.transform.transform_point3(centre);
            return self.parts.shape(material, DShape::Sphere { centre, radius: radius * scale });
        }
        // The same test, of what the file says.
        DShape::Sphere { centre, radius }.check()?;
        let place = DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::splat(radius)), centre);
        let transform = self.transform * place;
        if !can_place(&transform) {
            return Err("the sphere is too small under its transform".into());
        }
        self.balls.push(Ball { line: statement.line, material, transform });
        Ok(())
    }

    /// The index of the material of a primitive that comes now.
    fn material(&mut self) -> u32 {
        let Surface { ambient, diffuse, specular, shininess, emission } = self.surface;
        let mut key = [0; 13];
        let numbers = [ambient, diffuse, specular, emission].map(|color| color.to_array());
        for (bits, number) in key.iter_mut().zip(numbers.as_flattened().iter().chain([&shininess])) {
            *bits = number.to_bits();
        }
        let materials = &mut self.scene.materials;
        *self.materials.entry(key).or_insert_with(|| {
            materials.push(Material {
                ambient,
                diffuse,
                specular,
                shininess,
                reflection: specular,
                emission,
                model: Specular::BlinnPhong,
                ..Material::default()
            });
            materials.len() as u32 - 1
        })
    }

    /// The scene, once everything is read.
    fn finish(self) -> Scene {
        let mut scene = self.scene;
        // The file's ambient colours stand for the surface and the light at once.
        scene.ambient = Vec3::ONE;
        scene.background = Some(Vec3::ZERO);
        // Of which the format's formula is the first terms.
        scene.request.integrator = Some(Integrator::Whitted);
        scene.default_lighting = DefaultLighting::None;
        self.parts.show(&mut scene);
        // One unit sphere for each material that needs it.
        let mut groups = HashMap::new();
        for Ball { line, material, transform } in self.balls {
            let group = *groups.entry(material).or_insert_with(|| {
                let shapes = vec![Shape::Sphere(UNIT)];
                add_group(&mut scene, "sphere", vec![Geometry::Shapes { shapes, material }])
            });
            scene.instances.push(Instance {
                name: format!("sphere of line {line}"),
                group,
                transform,
                transform_end: None,
            });
        }
        scene
    }
}

const UNIT: Sphere = Sphere { centre: Vec3::ZERO, radius: 1.0 };

fn attenuation(statement: &mut Statement<'_>) -> Placeless<Attenuation> {
    let (constant, linear, quadratic) = (statement.share()?, statement.share()?, statement.share()?);
    if constant + linear + quadratic == 0.0 {
        return Err("attenuation 0 0 0 divides by zero; one number must be above 0".into());
    }
    Ok(Attenuation { constant, linear, quadratic })
}

/// The corners that a triangle's three indices name.
fn corners<T: Copy + Default>(statement: &mut Statement<'_>, what: &str, pile: &[T]) -> Placeless<[T; 3]> {
    let mut corners = [T::default(); 3];
    for corner in &mut corners {
        let index = statement.whole()?;
        let found = pile.get(index as usize);
        *corner = *found.ok_or_else(|| match pile.len() {
            0 => format!("index {index}, but no {what} stands above"),
            count => format!("index {index}, but the last {what} above is {}", count - 1),
        })?;
    }
    Ok(corners)
}
