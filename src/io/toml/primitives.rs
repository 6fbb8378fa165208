//! The primitives of a body: the top of the file, or a group. One table each.

use std::sync::Arc;

use super::table::{Fault, Read, Table, Value};
use crate::io::dshape::DShape;
use crate::io::parts::{Parts, Sorted};
use crate::math::{DMat3, DVec3, Vec2};
use crate::scene::{Geometry, Mesh};

/// How a primitive is read of its table; material and unknown keys are left to the caller.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    Shape(fn(&mut Table<'_>) -> Read<DShape>),
    Triangle,
}

/// The keys of single primitives.
pub(super) const SINGLES: [(&str, Kind); 9] = [
    ("sphere", Kind::Shape(sphere)),
    ("plane", Kind::Shape(plane)),
    ("disk", Kind::Shape(disk)),
    ("box", Kind::Shape(cuboid)),
    ("cylinder", Kind::Shape(cylinder)),
    ("cone", Kind::Shape(cone)),
    ("ellipsoid", Kind::Shape(ellipsoid)),
    ("polygon", Kind::Shape(polygon)),
    ("triangle", Kind::Triangle),
];

/// A primitive with a table of its own.
pub(super) struct Single {
    what: What,
    /// The name of its material, if it has one, and where that stands.
    material: Option<(Box<str>, usize)>,
    /// Where it stands in the text.
    at: usize,
}

enum What {
    Shape(DShape),
    Triangle([DVec3; 3]),
}

impl Single {
    fn read(kind: Kind, mut table: Table<'_>) -> Read<Self> {
        let what = match kind {
            Kind::Shape(read) => What::Shape(read(&mut table)?),
            Kind::Triangle => What::Triangle(triangle(&mut table)?),
        };
        let name = |value: Value<'_>| Ok((value.text()?.into(), value.at));
        let (material, at) = (table.optional("material", name)?, table.at());
        table.finish()?;
        Ok(Self { what, material, at })
    }

    /// The same, in a text in which `start` bytes come before.
    pub(super) fn after(self, start: usize) -> Self {
        Self { material: self.material.map(|(name, at)| (name, at + start)), at: self.at + start, ..self }
    }
}

/// Primitives for each of [`SINGLES`].
pub(super) type Singles = [Vec<Single>; SINGLES.len()];

/// Those of a body.
pub(super) fn singles(body: &mut Table<'_>) -> Read<Singles> {
    let mut singles = SINGLES.map(|_| Vec::new());
    for ((key, kind), singles) in SINGLES.into_iter().zip(&mut singles) {
        *singles = body.tables(key)?.into_iter().map(|table| Single::read(kind, table)).collect::<Read<_>>()?;
    }
    Ok(singles)
}

/// The same, sorted by what `material` makes of the names of their materials.
pub(super) fn sorted(singles: Singles, mut material: impl FnMut(Option<(&str, usize)>) -> Read<u32>) -> Read<Sorted> {
    let mut parts = Parts::default();
    for ((key, _), singles) in SINGLES.into_iter().zip(singles) {
        for Single { what, material: name, at } in singles {
            let material = material(name.as_ref().map(|(name, at)| (&**name, *at)))?;
            let added = match what {
                What::Shape(shape) => parts.shape(material, shape).map_err(|problem| format!("[[{key}]]: {problem}")),
                What::Triangle(corners) => parts.triangle(material, corners),
            };
            added.map_err(|message| Fault { at, message })?;
        }
    }
    Ok(parts.sorted())
}

/// The meshes of a body, with what `material` makes of the names of their materials.
pub(super) fn meshes(
    body: &mut Table<'_>,
    mut material: impl FnMut(Option<(&str, usize)>) -> Read<u32>,
) -> Read<Vec<Geometry>> {
    let mut geometries = Vec::new();
    for mut table in body.tables("mesh")? {
        let name = table.optional("material", |value| Ok((value.text()?, value.at)))?;
        let mesh = Mesh { material: material(name)?, ..mesh(&mut table)? };
        table.finish()?;
        geometries.push(Geometry::Mesh(mesh));
    }
    Ok(geometries)
}

/// The mesh with the parameters of each triangle as texture coordinates: the weights of the second and the third
/// corner, as shapes have their own.
pub(super) fn with_parameters(mesh: &Mesh) -> Mesh {
    let corners = mesh.triangles.as_flattened();
    let triangles = (0..mesh.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh {
        positions: Arc::new(corners.iter().map(|&i| mesh.positions[i as usize]).collect()),
        uvs: [Vec2::ZERO, Vec2::X, Vec2::Y].repeat(mesh.triangles.len()),
        triangles: Arc::new(triangles),
        ..mesh.clone()
    }
}

fn list<'t, T>(value: Value<'t>, read: impl Fn(Value<'t>) -> Read<T>) -> Read<Vec<T>> {
    value.items()?.map(read).collect()
}

fn point(table: &mut Table<'_>, key: &'static str) -> Read<DVec3> {
    table.need(key)?.vector()
}

fn length(table: &mut Table<'_>, key: &'static str) -> Read<f64> {
    table.need(key)?.number()
}

fn capped(table: &mut Table<'_>) -> Read<bool> {
    Ok(table.optional("capped", Value::flag)?.unwrap_or(true))
}

fn sphere(table: &mut Table<'_>) -> Read<DShape> {
    Ok(DShape::Sphere { centre: point(table, "centre")?, radius: length(table, "radius")? })
}

fn plane(table: &mut Table<'_>) -> Read<DShape> {
    Ok(DShape::Plane { point: point(table, "point")?, normal: point(table, "normal")? })
}

fn disk(table: &mut Table<'_>) -> Read<DShape> {
    let (centre, normal) = (point(table, "centre")?, point(table, "normal")?);
    Ok(DShape::Disk { centre, normal, radius: length(table, "radius")? })
}

fn cuboid(table: &mut Table<'_>) -> Read<DShape> {
    Ok(DShape::Cuboid { corners: [point(table, "min")?, point(table, "max")?] })
}

fn cylinder(table: &mut Table<'_>) -> Read<DShape> {
    let (ends, radius) = ([point(table, "base")?, point(table, "apex")?], length(table, "radius")?);
    Ok(DShape::Cylinder { ends, radius, capped: capped(table)? })
}

fn cone(table: &mut Table<'_>) -> Read<DShape> {
    let (base, base_radius) = (point(table, "base")?, length(table, "base_radius")?);
    let (apex, apex_radius) = (point(table, "apex")?, table.optional("apex_radius", Value::number)?);
    let radii = [base_radius, apex_radius.unwrap_or(0.0)];
    Ok(DShape::Cone { ends: [base, apex], radii, capped: capped(table)? })
}

fn ellipsoid(table: &mut Table<'_>) -> Read<DShape> {
    let centre = point(table, "centre")?;
    let radii = table.optional("radii", |value| {
        let radii = value.vector()?;
        if radii.cmpgt(DVec3::ZERO).all() {
            Ok(radii)
        } else {
            Err(value.fault("\"radii\" wants three numbers above 0"))
        }
    })?;
    let axes = table.optional("axes", |value| list(value, Value::vector))?;
    let axes = match (radii, axes.as_deref()) {
        (Some(radii), None) => DMat3::from_diagonal(radii),
        (None, Some(&[x, y, z])) => DMat3::from_cols(x, y, z),
        _ => {
            return Err(table.fault("an [[ellipsoid]] has either \"radii\", three numbers, or \"axes\", three vectors"));
        }
    };
    Ok(DShape::Ellipsoid { centre, axes })
}

fn triangle(table: &mut Table<'_>) -> Read<[DVec3; 3]> {
    let corners = list(table.need("corners")?, Value::vector)?;
    corners.try_into().map_err(|_| table.fault("a [[triangle]] has three \"corners\""))
}

fn polygon(table: &mut Table<'_>) -> Read<DShape> {
    Ok(DShape::Polygon { corners: list(table.need("corners")?, Value::vector)? })
}

/// `[[mesh]]`, without its material.
fn mesh(table: &mut Table<'_>) -> Read<Mesh> {
    let positions = list(table.need("positions")?, Value::vector)?;
    let corner = |value: Value<'_>| {
        let last = positions.len().checked_sub(1).ok_or_else(|| value.fault("\"triangles\" without \"positions\""))?;
        value.whole(0..=last as u64).map(|index| index as u32)
    };
    let triangle = |value: Value<'_>| -> Read<[u32; 3]> {
        let corners = list(value, corner)?;
        corners.try_into().map_err(|_| value.fault("a triangle is a list of three indices"))
    };
    let triangles = list(table.need("triangles")?, triangle)?;
    let normals = table.optional("normals", |value| {
        let normals = list(value, |normal| Ok(normal.vector()?.normalize_or_zero().as_vec3()))?;
        as_many(value, "normals", normals, positions.len())
    })?;
    let uvs = table.optional("uvs", |value| {
        let uvs = list(value, |uv| Ok(Vec2::from_array(uv.numbers::<2>()?.map(|x| x as f32))))?;
        as_many(value, "uvs", uvs, positions.len())
    })?;
    let mut mesh = Mesh {
        name: table.optional("name", Value::text)?.unwrap_or_default().to_owned(),
        normals: normals.unwrap_or_default(),
        uvs: uvs.unwrap_or_default(),
        triangles: Arc::new(triangles),
        ..Mesh::default()
    };
    mesh.set_positions(&positions);
    Ok(mesh)
}

/// Whether an attribute is there for every vertex.
fn as_many<T>(value: Value<'_>, what: &str, list: Vec<T>, positions: usize) -> Result<Vec<T>, Fault> {
    let count = list.len();
    if count == positions { Ok(list) } else { Err(value.fault(format!("{count} {what} for {positions} positions"))) }
}
