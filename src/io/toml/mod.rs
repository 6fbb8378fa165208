//! Twincast's own scene format: TOML (Preston-Werner and others, *TOML 1.1*), for whatever the renderer has.
//! docs/SCENES.md describes every key.
//!
//! The document is parsed into a tree that knows its places ([`table`]). The top of the file and each group are bodies:
//! [`primitives`], mesh files ([`include`]) and placements of groups, which are unrolled into one list of instances
//! ([`group`]); where there are very many, they are read in [`pieces`]. What is seen of it all, and from where, is in
//! [`look`]. A key that nobody reads is refused.

mod environment;
mod fog;
mod group;
mod include;
mod look;
mod material;
mod pieces;
mod primitives;
mod table;

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};

use ::toml::Spanned;
use ::toml::de::DeTable;
use rayon::prelude::*;

use self::group::{Body, Child, Groups, Place, Target};
use self::include::{Include, Includes};
use self::look::{Render, Shading};
use self::pieces::Cut;
use self::primitives::{SINGLES, Singles};
use self::table::{Fault, Read, Table, Value};
use super::finish::{bare, doubt_bare};
use super::parts::{Sorted, add_group};
use super::suggest::suggestion_or_all;
use super::texture;
use crate::error::{Error, Result, Warning, one_line};
use crate::math::Vec3;
use crate::memory::Mapped;
use crate::scene::{Attenuation, Camera, DefaultLighting, Geometry, Light, Material, Scene};
use crate::shape::Shape;

/// What stops the reading of a file: something in it, or in a file it names.
enum Stop {
    Here(Fault),
    Elsewhere {
        /// Where it is named: an offset into this file.
        at: usize,
        error: Error,
    },
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        Self::Here(fault)
    }
}

/// Reads a scene file.
pub(super) fn load(path: &Path, file: &Mapped<'_>, warnings: &mut Vec<Warning>) -> Result<Scene> {
    let line = |at: usize| format!("line {}", 1 + memchr::memchr_iter(b'\n', &file[..at.min(file.len())]).count());
    let fault = |at: usize, message: String| Error::input(path, line(at), message);
    let text = str::from_utf8(file).map_err(|e| fault(e.valid_up_to(), "bytes that are no UTF-8".to_owned()))?;
    let refused = |Fault { at, message }| fault(at, shortened(&message));
    let cut = Cut::new(text, &MANY);
    let mut document = parse(cut.as_ref().map_or(text, |cut| &cut.rest)).map_err(refused)?;
    let mut pieces = cut.as_ref().map_or(&[][..], |cut| &cut.pieces);
    if !pieces.is_empty() && MANY.iter().any(|&key| document.get_ref().contains_key(key)) {
        // Said twice, in two ways: for the parser to judge.
        document = parse(text).map_err(refused)?;
        pieces = &[];
    }
    let mut reader = Reader {
        folder: path.parent().unwrap_or(Path::new("")),
        scene: Scene::default(),
        warnings,
        materials: BTreeMap::new(),
        pictures: HashMap::new(),
        plain: None,
        includes: Includes::default(),
        bare: 0,
    };
    let read = || Apart::read(text, pieces).map_err(Stop::Here);
    match read().and_then(|apart| reader.read(Table::new(document.get_ref(), 0, "the file"), apart)) {
        Ok(()) => {
            let (scene, bare) = (reader.scene, reader.bare);
            warnings.extend(doubt_bare(path, bare));
            warnings.extend(fog::doubt(&scene).map(|doubt| Warning::new(path, "[fog]", doubt)));
            file.done(file);
            Ok(scene)
        }
        Err(Stop::Here(fault)) => Err(refused(fault)),
        Err(Stop::Elsewhere { at, error }) => Err(error.named_in(path, &line(at))),
    }
}

/// The tree of a text.
fn parse(text: &str) -> Read<Spanned<DeTable<'_>>> {
    DeTable::parse(text).map_err(|error| {
        // Its messages may span lines and quote the file.
        let message = format!("not TOML: {}", one_line(error.message()));
        Fault { at: error.span().map_or(0, |span| span.start), message }
    })
}

/// Lists of tables that files may have by the million.
const MANY: [&str; 1 + SINGLES.len()] = {
    let mut many = ["instance"; 1 + SINGLES.len()];
    let mut i = 0;
    while i < SINGLES.len() {
        many[1 + i] = SINGLES[i].0;
        i += 1;
    }
    many
};

/// What was cut out of a file.
#[derive(Default)]
struct Apart {
    placed: Vec<Child>,
    singles: Singles,
}

impl Apart {
    /// What stands in pieces of a text.
    fn read(text: &str, pieces: &[Range<usize>]) -> Read<Self> {
        let read = |piece: &Range<usize>| {
            let tree = parse(&text[piece.clone()])?;
            let mut table = Table::new(tree.get_ref(), 0, "the file");
            let apart = Self { placed: instances(&mut table)?, singles: primitives::singles(&mut table)? };
            table.finish().map(|()| apart)
        };
        let read: Vec<Read<Self>> = pieces.par_iter().map(read).collect();
        let mut all = Self::default();
        for (apart, Range { start, .. }) in read.into_iter().zip(pieces) {
            // Of several faults the first.
            let apart = apart.map_err(|fault| Fault { at: fault.at + start, ..fault })?;
            all.placed.extend(apart.placed.into_iter().map(|child| Child { at: child.at + start, ..child }));
            for (all, singles) in all.singles.iter_mut().zip(apart.singles) {
                all.extend(singles.into_iter().map(|single| single.after(*start)));
            }
        }
        Ok(all)
    }
}

/// The placements of `[[instance]]`.
fn instances(table: &mut Table<'_>) -> Read<Vec<Child>> {
    let read = |mut instance: Table<'_>| {
        let value = instance.need("group")?;
        let group = value.text()?;
        let name = instance.optional("name", Value::text)?.unwrap_or(group).to_owned();
        let place = Place::read(&mut instance)?;
        instance.finish()?;
        Ok(Child { name, place, target: Target::Group(group.to_owned()), at: value.at })
    };
    table.tables("instance")?.into_iter().map(read).collect()
}

/// Names in a file may be of any length; messages may not.
fn shortened(message: &str) -> String {
    let mut short = String::new();
    for c in message.chars().take(600) {
        // Names may hold what would move the cursor or colour the rest.
        if c.is_control() { short.extend(c.escape_debug()) } else { short.push(c) }
    }
    if message.chars().nth(600).is_some() {
        short.push('…');
    }
    short
}

struct Reader<'a> {
    /// What names of files are relative to.
    folder: &'a Path,
    scene: Scene,
    warnings: &'a mut Vec<Warning>,
    /// Indices by name.
    materials: BTreeMap<String, u32>,
    /// Indices of textures by the files of their pictures.
    pictures: HashMap<PathBuf, u32>,
    /// The index of the material of primitives that name none, once there is one.
    plain: Option<u32>,
    includes: Includes,
    /// Meshes of this file without the texture coordinates that their materials want.
    bare: usize,
}

impl Reader<'_> {
    /// The whole file, of which some stands apart.
    fn read(&mut self, mut top: Table<'_>, apart: Apart) -> std::result::Result<(), Stop> {
        let render = Render::read(top.get("render").map(|value| value.table("[render]".to_owned())).transpose()?)?;
        (self.scene.ambient, self.scene.background) = (render.ambient, render.background);
        self.scene.request = render.request;
        for table in top.tables("camera")? {
            let twice = table.fault("");
            let camera = look::camera(table)?;
            let is_known = |known: &Camera| !known.name.is_empty() && known.name == camera.name;
            if self.scene.cameras.iter().any(is_known) {
                let message =
                    format!("a camera before this one has the name {:?}, too; call it something else", camera.name);
                return Err(Fault { message, ..twice }.into());
            }
            self.scene.cameras.push(camera);
        }
        for table in top.tables("light")? {
            self.scene.lights.push(look::light(table)?);
        }
        if let Some(value) = top.get("environment") {
            self.scene.environment = Some(environment::environment(value, self.folder, &mut self.scene.files)?);
        }
        if let Some(value) = top.get("fog") {
            self.scene.fog = Some(fog::fog(value.table("[fog]".to_owned())?)?);
        }
        for (name, table) in top.named_tables("material")? {
            self.material(name, table)?;
        }
        let mut named = BTreeMap::new();
        for (name, mut table) in top.named_tables("group")? {
            let singles = primitives::singles(&mut table)?;
            let body = self.body(name, &mut table, singles)?;
            table.finish()?;
            named.insert(name, body);
        }
        let mut singles = primitives::singles(&mut top)?;
        // Each list is all here or all there.
        singles.iter_mut().zip(apart.singles).for_each(|(here, apart)| here.extend(apart));
        let mut body = self.body("", &mut top, singles)?;
        body.children.extend(apart.placed);
        top.finish()?;
        Groups { top: body, named }.unroll(&mut self.scene)?;
        if render.shading == Shading::Minray {
            let lamps = lamps(&self.scene);
            self.scene.lights.extend(lamps);
        }
        if !render.headlight || render.shading == Shading::Minray {
            self.scene.default_lighting = DefaultLighting::None;
        }
        Ok(())
    }

    fn material(&mut self, name: &str, mut table: Table<'_>) -> std::result::Result<(), Stop> {
        let mut material = material::material(name, &mut table)?;
        material.diffuse_texture = self.texture(table.get("texture"))?;
        material.emission_texture = self.texture(table.get("emission_texture"))?;
        material.normal_texture = self.texture(table.get("normal_texture"))?;
        if let (Some(scale), None) = (table.get("normal_scale"), material.normal_texture) {
            return Err(scale.fault("\"normal_scale\" is for a \"normal_texture\", which is missing").into());
        }
        table.finish()?;
        self.materials.insert(name.to_owned(), self.scene.materials.len() as u32);
        self.scene.materials.push(material);
        Ok(())
    }

    /// The index of a picture that a value names, which is read the first time.
    fn texture(&mut self, value: Option<Value<'_>>) -> std::result::Result<Option<u32>, Stop> {
        let Some(value) = value else { return Ok(None) };
        let path = self.folder.join(value.text()?);
        if let Some(known) = self.pictures.get(&path) {
            return Ok(Some(*known));
        }
        let picture = texture::open(&path).map_err(|error| Stop::Elsewhere { at: value.at, error })?;
        let picture = picture.map_err(|why| value.fault(why))?;
        self.scene.textures.push(picture);
        self.scene.files.push(path.clone());
        let index = self.scene.textures.len() as u32 - 1;
        self.pictures.insert(path, index);
        Ok(Some(index))
    }

    /// What stands in a group, or at the top of the file, and the primitives of it.
    fn body(&mut self, name: &str, table: &mut Table<'_>, singles: Singles) -> std::result::Result<Body, Stop> {
        let Sorted { mut near, far } = primitives::sorted(singles, |name| self.material_of(name))?;
        for geometry in &mut near {
            if let Geometry::Mesh(mesh) = geometry
                && self.scene.materials[mesh.material as usize].textures().next().is_some()
            {
                *mesh = primitives::with_parameters(mesh);
            }
        }
        let meshes = primitives::meshes(table, |name| self.material_of(name))?;
        self.bare += bare(&meshes, &self.scene.materials);
        near.extend(meshes);
        let mut body = Body::default();
        for mut file in table.tables("file")? {
            body.children.push(self.file(&mut file)?);
            file.finish()?;
        }
        body.children.extend(instances(table)?);
        if !near.is_empty() {
            body.own = Some(add_group(&mut self.scene, name, near));
        }
        let add = |(origin, geometries)| (origin, add_group(&mut self.scene, name, geometries));
        body.far = far.into_iter().map(add).collect();
        Ok(body)
    }

    fn file(&mut self, table: &mut Table<'_>) -> std::result::Result<Child, Stop> {
        let material = table.get("material").map(|value| self.named_material(value.text()?, value.at)).transpose()?;
        let include = Include::read(table, self.folder, material)?;
        let at = table.need("path")?.at;
        let name = table.optional("name", Value::text)?.unwrap_or_default().to_owned();
        let place = Place::read(table)?;
        let placed = self.includes.add(include, &mut self.scene, self.warnings);
        let placed = placed.map_err(|error| Stop::Elsewhere { at, error })?;
        Ok(Child { name, place, target: Target::File(placed), at })
    }

    /// The material of a name that stands somewhere, or the plain one.
    fn material_of(&mut self, name: Option<(&str, usize)>) -> Read<u32> {
        match name {
            Some((name, at)) => self.named_material(name, at),
            None => Ok(*self.plain.get_or_insert_with(|| {
                self.scene.materials.push(Material::default());
                self.scene.materials.len() as u32 - 1
            })),
        }
    }

    fn named_material(&self, name: &str, at: usize) -> Read<u32> {
        let found = self.materials.get(name).copied();
        found.ok_or_else(|| {
            let near = suggestion_or_all(name, self.materials.keys().map(String::as_str), "[material.NAME]");
            Fault { at, message: format!("no [material.{name}]{near}") }
        })
    }
}

/// A light for each sphere that glows, where it stands: the light at its middle, the sphere its lamp.
fn lamps(scene: &Scene) -> Vec<Light> {
    let mut lamps = Vec::new();
    for instance in &scene.instances {
        let scale = instance.transform.matrix3.determinant().abs().cbrt();
        for (_, geometry) in scene.group_geometries(instance.group) {
            let Geometry::Shapes { shapes, material } = geometry else { continue };
            let color = scene.materials[*material as usize].emission;
            let spheres = shapes.iter().filter_map(|shape| match shape {
                Shape::Sphere(sphere) if color != Vec3::ZERO => Some(sphere),
                _ => None,
            });
            lamps.extend(spheres.map(|sphere| Light::Point {
                position: instance.transform.transform_point3(sphere.centre.as_dvec3()),
                color,
                attenuation: Attenuation::NONE,
                range: f64::INFINITY,
                radius: f64::from(sphere.radius) * scale,
            }));
        }
    }
    lamps
}
