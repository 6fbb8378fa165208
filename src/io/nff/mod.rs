//! Haines's Neutral File Format, `.nff` (Haines 1987, *A proposal for standard graphics environments*), which his
//! Standard Procedural Databases are written in. Not the format of World Toolkit, which has the same suffix.
//!
//! A statement takes a line; corners of polygons, ends of cones and parts of the view have a line each. Colours are
//! linear. Decided where the description leaves it open: the fill colour times Kd is the diffuse part; Ks is a white
//! Phong highlight and the share of the mirrored ray; T is the share of the refracted ray; lights do not weaken with
//! distance, and there is no ambient light, so a file without lights is dark. The camera has no near plane, so `hither`
//! is read and not used. All faces have two sides, so a negative radius, inside out, changes nothing but what a ray
//! through glass takes for outside: there it is told in a warning.
//!
//! Triangles become meshes. Polygons stay polygons, concave or not; what is no polygon of one plane is divided into
//! triangles, and told.

mod view;

use std::collections::HashMap;
use std::path::Path;

use self::view::View;
use super::Placeless;
use super::dshape::DShape;
use super::parts::Parts;
use super::polygon::triangulate;
use super::statement::{Statement, statements};
use super::text::quoted;
use crate::error::{Error, Result, Warning};
use crate::math::{DVec3, Vec3};
use crate::memory::Mapped;
use crate::scene::{Attenuation, DefaultLighting, Integrator, Light, Material, Scene, Specular};

/// What sets the material.
const FILL: &str = "f r g b Kd Ks Shine T index";

/// Every statement as it should look; the first word is the keyword.
const USAGES: [&str; 14] = [
    "v",
    "from x y z",
    "at x y z",
    "up x y z",
    "angle degrees",
    "hither distance",
    "resolution width height",
    "b r g b",
    "l x y z [r g b]",
    FILL,
    "c, then two lines: x y z radius",
    "s x y z radius",
    "p count, then a line for each corner: x y z",
    "pp count, then a line for each corner: x y z nx ny nz",
];

/// Reads an NFF file.
pub(super) fn load(path: &Path, file: &Mapped<'_>, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let mut reader = Reader::default();
    let mut lines = Lines { statements: statements(file), line: 0 };
    let read = loop {
        match lines.next() {
            None => break reader.end_view(),
            Some(mut statement) => {
                if let Err(message) = reader.read(&mut statement, &mut lines) {
                    break Err(message);
                }
            }
        }
    };
    read.map_err(|message| Error::input(path, format!("line {}", lines.line), message))?;
    file.done(file);
    for odd in [&reader.divided, &reader.inside_out] {
        if let Some((line, message)) = &odd.first {
            let message = format!("{} {message}", odd.count);
            warnings.push(Warning::new(path, format!("line {line}"), message));
        }
    }
    Ok(reader.finish())
}

/// Statements, and where reading is.
struct Lines<I> {
    statements: I,
    line: usize,
}

impl<'a, I: Iterator<Item = Statement<'a>>> Iterator for Lines<I> {
    type Item = Statement<'a>;

    fn next(&mut self) -> Option<Statement<'a>> {
        let statement = self.statements.next()?;
        self.line = statement.line;
        Some(statement)
    }
}

impl<'a, I: Iterator<Item = Statement<'a>>> Lines<I> {
    /// The numbers of a line that continues a statement.
    fn numbers<const N: usize>(&mut self, usage: &'static str) -> Placeless<[f64; N]> {
        let mut line = self.next().ok_or_else(|| format!("the file ends too early; expected {usage}"))?;
        line.usage = usage;
        let numbers = line.numbers()?;
        line.end()?;
        Ok(numbers)
    }
}

#[derive(Default)]
struct Reader {
    /// Its cameras, materials and request.
    scene: Scene,
    parts: Parts,
    /// Positions, and colours where they are given.
    lights: Vec<(DVec3, Option<Vec3>)>,
    /// While its lines are read.
    view: Option<View>,
    /// Index of the fill that holds.
    material: Option<u32>,
    materials: HashMap<[u32; 8], u32>,
    divided: Odd,
    inside_out: Odd,
}

/// What is odd: how often, and the first one's line and message.
#[derive(Default)]
struct Odd {
    count: usize,
    first: Option<(usize, String)>,
}

impl Odd {
    fn add(&mut self, line: usize, message: impl FnOnce() -> String) {
        self.count += 1;
        self.first.get_or_insert_with(|| (line, message()));
    }
}

impl Reader {
    fn read<'a>(
        &mut self,
        statement: &mut Statement<'a>,
        lines: &mut Lines<impl Iterator<Item = Statement<'a>>>,
    ) -> Placeless<()> {
        let word = statement.word()?;
        let is_keyword = |usage: &&str| usage.split([' ', ',']).next().is_some_and(|first| first.as_bytes() == word);
        statement.usage = USAGES.into_iter().find(is_keyword).ok_or_else(|| {
            format!("{} is no statement of an NFF file; expected v, b, l, f, c, s, p or pp", quoted(word))
        })?;
        if let b"from" | b"at" | b"up" | b"angle" | b"hither" | b"resolution" = word {
            let view = self.view.as_mut().ok_or_else(|| format!("{} before any v", quoted(word)))?;
            view.read(word, statement)?;
            return statement.end();
        }
        self.end_view()?;
        let (line, usage) = (statement.line, statement.usage);
        match word {
            b"v" => self.view = Some(View::default()),
            b"b" => self.scene.background = Some(statement.color()?),
            b"l" => {
                let position = statement.vector()?;
                let color = statement.has_more().then(|| statement.color()).transpose()?;
                self.lights.push((position, color));
            }
            b"f" => self.fill(statement)?,
            b"s" => {
                let (centre, radius) = (statement.vector()?, statement.number()?);
                self.shape(DShape::Sphere { centre, radius: radius.abs() }, radius < 0.0, line)?;
            }
            b"c" => {
                statement.end()?;
                let ends = [lines.numbers::<4>(usage)?, lines.numbers::<4>(usage)?];
                self.cone(ends, line)?;
            }
            b"p" => {
                let count = corner_count(statement)?;
                statement.end()?;
                let mut corners = Vec::new();
                for _ in 0..count {
                    corners.push(DVec3::from(lines.numbers::<3>(usage)?));
                }
                self.polygon(corners, line)?;
            }
            b"pp" => {
                let count = corner_count(statement)?;
                statement.end()?;
                let (mut corners, mut normals) = (Vec::new(), Vec::new());
                for _ in 0..count {
                    let [x, y, z, nx, ny, nz] = lines.numbers(usage)?;
                    corners.push(DVec3::new(x, y, z));
                    normals.push(DVec3::new(nx, ny, nz));
                }
                self.patch(&corners, &normals)?;
            }
            _ => unreachable!("{} is among the usages", quoted(word)),
        }
        statement.end()
    }

    /// Makes a camera of the view whose lines have been read, if there is one.
    fn end_view(&mut self) -> Placeless<()> {
        let Some(view) = self.view.take() else { return Ok(()) };
        let (camera, size) = view.camera()?;
        self.scene.cameras.push(camera);
        self.scene.request.size.get_or_insert(size);
        Ok(())
    }

    fn fill(&mut self, statement: &mut Statement<'_>) -> Placeless<()> {
        let color = statement.color()?;
        let (diffuse, specular, shine) = (statement.share()?, statement.share()?, statement.share()?);
        let (transmission, index) = (statement.share()?, statement.share()?);
        if transmission > 0.0 && index == 0.0 {
            return Err(format!("an index of 0, but T is {transmission}; what lets light through needs one above 0"));
        }
        let [r, g, b] = color.to_array();
        let key = [r, g, b, diffuse, specular, shine, transmission, index].map(f32::to_bits);
        let materials = &mut self.scene.materials;
        self.material = Some(*self.materials.entry(key).or_insert_with(|| {
            materials.push(Material {
                ambient: Vec3::ZERO,
                diffuse: color * diffuse,
                specular: Vec3::splat(specular),
                shininess: shine,
                reflection: Vec3::splat(specular),
                transmission: Vec3::splat(transmission),
                ior: if index == 0.0 { 1.0 } else { index },
                model: Specular::Phong,
                ..Material::default()
            });
            materials.len() as u32 - 1
        }));
        Ok(())
    }

    /// The material of a primitive that comes now.
    fn material(&self) -> Placeless<u32> {
        self.material.ok_or_else(|| format!("a primitive before any {FILL:?}, which says what it is made of"))
    }

    fn shape(&mut self, shape: DShape, is_inside_out: bool, line: usize) -> Placeless<()> {
        let material = self.material()?;
        if is_inside_out && self.scene.materials[material as usize].transmission != Vec3::ZERO {
            self.inside_out.add(line, || "surfaces of glass are inside out; they refract like others".to_owned());
        }
        self.parts.shape(material, shape)
    }

    fn cone(&mut self, ends: [[f64; 4]; 2], line: usize) -> Placeless<()> {
        let radii = ends.map(|[.., radius]| radius);
        let ends = ends.map(|[x, y, z, _]| DVec3::new(x, y, z));
        let [base_radius, apex_radius] = radii;
        if base_radius * apex_radius < 0.0 {
            return Err(format!("radii {base_radius} and {apex_radius}; both must have one sign"));
        }
        let is_inside_out = base_radius + apex_radius < 0.0;
        let radii = radii.map(f64::abs);
        // As what they become.
        let shape = if radii[0] as f32 == radii[1] as f32 {
            DShape::Cylinder { ends, radius: radii[0], capped: false }
        } else {
            DShape::Cone { ends, radii, capped: false }
        };
        self.shape(shape, is_inside_out, line)
    }

    fn polygon(&mut self, corners: Vec<DVec3>, line: usize) -> Placeless<()> {
        let material = self.material()?;
        if let &[a, b, c] = corners.as_slice() {
            return self.parts.triangle(material, [a, b, c]);
        }
        let Err(problem) = self.parts.shape(material, DShape::Polygon { corners: corners.clone() }) else {
            return Ok(());
        };
        self.divided.add(line, || format!("polygons are divided into triangles; the first: {problem}"));
        for triangle in triangles(&corners)? {
            self.parts.triangle(material, triangle.map(|i| corners[i as usize]))?;
        }
        Ok(())
    }

    fn patch(&mut self, corners: &[DVec3], normals: &[DVec3]) -> Placeless<()> {
        let material = self.material()?;
        for triangle in triangles(corners)? {
            let [p, n] = [corners, normals].map(|list| triangle.map(|i| list[i as usize]));
            self.parts.smooth_triangle(material, p, n)?;
        }
        Ok(())
    }

    /// The scene, once everything is read.
    fn finish(self) -> Scene {
        let mut scene = self.scene;
        self.parts.show(&mut scene);
        scene.request.integrator = Some(Integrator::Whitted);
        // A picture of this format is opaque.
        scene.background = scene.background.or(Some(Vec3::ZERO));
        let share = 1.0 / (self.lights.len() as f32).sqrt();
        let light = |(position, color): (DVec3, Option<Vec3>)| {
            let (color, attenuation) = (color.unwrap_or(Vec3::splat(share)), Attenuation::NONE);
            Light::Point { position, color, attenuation, range: f64::INFINITY, radius: 0.0 }
        };
        scene.lights = self.lights.into_iter().map(light).collect();
        scene.default_lighting = DefaultLighting::None;
        scene
    }
}

fn corner_count(statement: &mut Statement<'_>) -> Placeless<u32> {
    let count = statement.whole()?;
    if count >= 3 { Ok(count) } else { Err(format!("a polygon of {count} corners; it needs three at least")) }
}

fn triangles(corners: &[DVec3]) -> Placeless<Vec<[u32; 3]>> {
    let mut triangles = Vec::new();
    triangulate(corners, &mut triangles)?;
    Ok(triangles)
}
