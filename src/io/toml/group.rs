//! Groups, and groups of groups, unrolled: the scene has one list of instances, each with the whole path of its names.

use std::collections::BTreeMap;

use super::include::Placed;
use super::table::{Fault, Read, Table, Value};
use crate::io::suggest::suggestion_or_all;
use crate::math::{self, DAffine3, DMat3, DVec3, placement_fault};
use crate::scene::{Instance, Scene};

/// Groups within groups within groups.
const DEEPEST: usize = 64;
/// Most placements of groups, unrolled: about 2 GB.
const MAX: u64 = 10_000_000;

/// What stands in a group, or at the top of the file.
#[derive(Default)]
pub(super) struct Body {
    /// Index into [`Scene::groups`] of its own primitives, if it has any.
    pub(super) own: Option<u32>,
    /// Groups of those that have local origins, with these.
    pub(super) far: Vec<(DVec3, u32)>,
    pub(super) children: Vec<Child>,
}

/// What is placed in a body.
pub(super) struct Child {
    pub(super) name: String,
    pub(super) place: Place,
    pub(super) target: Target,
    /// Where it stands in the text.
    pub(super) at: usize,
}

/// Where something stands, and where it moves to.
#[derive(Clone, Copy)]
pub(super) struct Place {
    start: DAffine3,
    end: Option<DAffine3>,
}

impl Place {
    const HERE: Self = Self { start: DAffine3::IDENTITY, end: None };

    /// The keys `transform` and `transform_end`.
    pub(super) fn read(table: &mut Table<'_>) -> Read<Self> {
        let start = table.optional("transform", transform)?.unwrap_or(DAffine3::IDENTITY);
        Ok(Self { start, end: table.optional("transform_end", transform)? })
    }

    /// Of what is relative to a local origin.
    fn at(origin: DVec3) -> Self {
        Self { start: DAffine3::from_translation(origin), end: None }
    }

    /// Of something within what stands here.
    fn of(&self, inner: &Self) -> Self {
        let end_of = |place: &Self| place.end.unwrap_or(place.start);
        let moves = self.end.is_some() || inner.end.is_some();
        Self { start: self.start * inner.start, end: moves.then(|| end_of(self) * end_of(inner)) }
    }

    fn instance(&self, name: String, group: u32) -> Instance {
        Instance { name, group, transform: self.start, transform_end: self.end }
    }
}

pub(super) enum Target {
    /// A group of the file.
    Group(String),
    /// What a mesh file holds.
    File(Vec<Placed>),
}

/// The bodies of a file; the top has no name.
pub(super) struct Groups<'a> {
    pub(super) top: Body,
    pub(super) named: BTreeMap<&'a str, Body>,
}

/// What a body comes to.
#[derive(Clone, Copy)]
struct Extent {
    /// Placements, its own and those in it.
    count: u64,
    /// Groups within groups.
    depth: usize,
}

impl Groups<'_> {
    /// Adds an instance for each placement to the scene.
    pub(super) fn unroll(&self, scene: &mut Scene) -> Read<()> {
        // First, so that nothing is unrolled that never ends or never fits.
        let mut extents = BTreeMap::new();
        for (name, body) in &self.named {
            if !extents.contains_key(name) {
                self.extent(body, &mut vec![name], &mut extents)?;
            }
        }
        let Extent { count, .. } = self.extent(&self.top, &mut Vec::new(), &mut extents)?;
        if count > MAX {
            let message = format!("{count} placements of groups, those in groups counted; at most {MAX} are unrolled");
            return Err(Fault { at: 0, message });
        }
        self.place(&self.top, "", &Place::HERE, scene)
    }

    /// What a body comes to. `path` names the groups that are being looked at.
    fn extent<'s>(
        &'s self,
        body: &'s Body,
        path: &mut Vec<&'s str>,
        known: &mut BTreeMap<&'s str, Extent>,
    ) -> Read<Extent> {
        let mut sum = Extent { count: 1 + body.far.len() as u64, depth: 0 };
        for child in &body.children {
            let fault = |message| Fault { at: child.at, message };
            let inner = match &child.target {
                Target::File(placed) => Extent { count: placed.len() as u64, depth: 0 },
                Target::Group(name) if path.contains(&name.as_str()) => {
                    return Err(fault(format!("group {name:?} contains itself: {} > {name}", path.join(" > "))));
                }
                Target::Group(name) => match known.get(name.as_str()) {
                    Some(&extent) => extent,
                    // The recursion ends there, and the depth that is known to be too large below.
                    None if path.len() > DEEPEST => Extent { count: 0, depth: DEEPEST },
                    None => {
                        let (name, inner) = self.find(name, child.at)?;
                        path.push(name);
                        let extent = self.extent(inner, path, known)?;
                        path.pop();
                        extent
                    }
                },
            };
            sum.count = sum.count.saturating_add(inner.count);
            sum.depth = sum.depth.max(inner.depth + 1);
            if sum.depth > DEEPEST {
                return Err(fault(format!("groups are nested more than {DEEPEST} deep")));
            }
        }
        if let Some(name) = path.last() {
            known.insert(name, sum);
        }
        Ok(sum)
    }

    fn find(&self, name: &str, at: usize) -> Read<(&str, &Body)> {
        self.named.get_key_value(name).map(|(name, body)| (*name, body)).ok_or_else(|| {
            let near = suggestion_or_all(name, self.named.keys().copied(), "[group.NAME]");
            Fault { at, message: format!("no [group.{name}]{near}") }
        })
    }

    fn place(&self, body: &Body, path: &str, place: &Place, scene: &mut Scene) -> Read<()> {
        if let Some(group) = body.own {
            scene.instances.push(place.instance(path.to_owned(), group));
        }
        // Under the same name: that they have groups of their own is nothing that the file says.
        for &(origin, group) in &body.far {
            scene.instances.push(place.of(&Place::at(origin)).instance(path.to_owned(), group));
        }
        for child in &body.children {
            let (name, place) = (joined(path, &child.name), place.of(&child.place));
            let fault = placement_fault(&place.start).or_else(|| placement_fault(&place.end?));
            if let Some(fault) = fault {
                let what = if child.name.is_empty() { "this".to_owned() } else { format!("{name:?}") };
                return Err(Fault { at: child.at, message: format!("{what} {fault}") });
            }
            match &child.target {
                Target::Group(group) => self.place(self.find(group, child.at)?.1, &name, &place, scene)?,
                Target::File(placed) => scene.instances.extend(placed.iter().map(|inner| {
                    let within = Place { start: inner.transform, end: None };
                    place.of(&within).instance(joined(&name, &inner.name), inner.group)
                })),
            }
        }
        Ok(())
    }
}

fn joined(path: &str, name: &str) -> String {
    match (path, name) {
        ("", name) => name.to_owned(),
        (path, "") => path.to_owned(),
        (path, name) => format!("{path}/{name}"),
    }
}

/// The value of `transform`: a step, or a list of steps of which the last is applied to the group first, as with the
/// matrix stacks of graphics libraries.
pub(super) fn transform(value: Value<'_>) -> Read<DAffine3> {
    if !value.is_list() {
        return step(value);
    }
    let mut transform = DAffine3::IDENTITY;
    for item in value.items()? {
        transform *= step(item)?;
    }
    Ok(transform)
}

/// One of `{ translate = [x, y, z] }`, `{ rotate = [x, y, z, degrees] }`, `{ scale = s }` (or three factors) and
/// `{ matrix = [[...], [...], [...]] }`, by rows of four.
fn step(value: Value<'_>) -> Read<DAffine3> {
    let mut table: Table<'_> = value.table("a step of \"transform\"".to_owned())?;
    let steps = [
        table.optional("translate", |value| Ok(DAffine3::from_translation(value.vector()?)))?,
        table.optional("rotate", rotation)?,
        table.optional("scale", |value| {
            let factors = if value.is_list() { value.vector()? } else { DVec3::splat(value.number()?) };
            Ok(DAffine3::from_scale(factors))
        })?,
        table.optional("matrix", |value| {
            let rows = value.items()?.map(Value::numbers::<4>).collect::<Read<Vec<_>>>()?;
            let &[x, y, z] = rows.as_slice() else {
                return Err(value.fault("\"matrix\" wants three rows of four numbers"));
            };
            let column = |k: usize| DVec3::new(x[k], y[k], z[k]);
            let matrix = DMat3::from_cols(column(0), column(1), column(2));
            Ok(DAffine3::from_mat3_translation(matrix, column(3)))
        })?,
    ];
    let mut given = steps.into_iter().flatten();
    let (first, second) = (given.next(), given.next());
    match (first, second) {
        (Some(step), None) => table.finish().map(|()| step),
        (Some(_), Some(_)) => Err(value.fault("a step does one thing; write [{ translate = ... }, { scale = ... }]")),
        (None, _) => {
            table.finish()?;
            Err(value.fault("an empty step; it may be translate, rotate, scale or matrix"))
        }
    }
}

fn rotation(value: Value<'_>) -> Read<DAffine3> {
    let [x, y, z, degrees] = value.numbers()?;
    let axis = DVec3::new(x, y, z).try_normalize();
    let axis = axis.ok_or_else(|| value.fault("\"rotate\" wants an axis, not all 0, and degrees"))?;
    Ok(DAffine3::from_quat(math::rotation(axis, degrees)))
}
