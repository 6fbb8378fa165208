//! Meshes: each becomes a group, each of its primitives that has area a geometry; of those that are deformed, one group
//! for each shape that they take.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use super::accessor::View;
use super::attributes::Attributes;
use super::component::Component;
use super::deform::{Deformation, Deformer};
use super::document::Document;
use super::material::Materials;
use super::morph::Displacements;
use super::pose::Pose;
use super::schema::Primitive;
use super::{draco, skin, triangles, variants};
use crate::error::{Result, Warning};
use crate::math::{DAffine3, DVec3, Vec2, Vec3, Vec4};
use crate::scene::compact::compact;
use crate::scene::{Geometry, Group, Mesh, Scene};

/// A mesh in one of its shapes.
#[derive(PartialEq, Eq, Hash)]
struct Shape {
    mesh: usize,
    /// Weights of morph targets, as bits; none where no target counts.
    weights: Vec<u32>,
    skin: Option<usize>,
    /// Whether a skinned mesh's node is mirrored.
    is_mirrored: bool,
}

/// The groups of a document's meshes, made when a node first shows them.
pub(super) struct Groups<'a> {
    document: &'a Document<'a>,
    materials: Materials<'a>,
    /// Of the materials.
    variant: Option<usize>,
    known: HashMap<Shape, Option<u32>>,
    /// By skin.
    joints: HashMap<usize, Arc<Vec<DAffine3>>>,
    /// Meshes whose parts without area are counted.
    counted: Vec<bool>,
    /// Points and lines.
    flat: usize,
    /// Primitives without positions.
    placeless: usize,
    /// Primitives without texture coordinates that their material needs.
    bare: usize,
    /// Primitives with colours in whole numbers that are not marked as shares.
    unmarked: usize,
}

impl<'a> Groups<'a> {
    pub(super) fn new(document: &'a Document<'a>, variant: Option<usize>) -> Self {
        Self {
            document,
            materials: Materials::new(document),
            variant,
            known: HashMap::new(),
            joints: HashMap::new(),
            counted: vec![false; document.root.meshes.len()],
            flat: 0,
            placeless: 0,
            bare: 0,
            unmarked: 0,
        }
    }

    /// The group of the mesh of the node `index`, as it is in `pose`; none where it has no area.
    pub(super) fn get(&mut self, scene: &mut Scene, mesh: usize, index: usize, pose: &Pose) -> Result<Option<u32>> {
        let document = self.document;
        let pointer = format!("/nodes/{index}");
        document.check_index(&format!("{pointer}/mesh"), mesh, document.root.meshes.len(), "mesh")?;
        let node = &document.root.nodes[index];
        let targets = document.root.meshes[mesh].primitives.iter().map(|p| p.targets.len()).max().unwrap_or(0);
        let (weights, told_by) = match pose.weights(index, node) {
            Some(weights) => (weights, pointer.clone()),
            None => (&document.root.meshes[mesh].weights[..], format!("/meshes/{mesh}")),
        };
        let weights = if targets == 0 { &[] } else { weights };
        if !weights.is_empty() && weights.len() != targets {
            let message = format!("{} weights for {targets} morph targets", weights.len());
            return Err(document.error(format!("{told_by}/weights"), message));
        }
        if !weights.iter().all(|weight| weight.is_finite()) {
            return Err(document.error(format!("{told_by}/weights"), "a weight that is not finite"));
        }
        let weights = if weights.iter().all(|weight| *weight == 0.0) { &[] } else { weights };
        // Where its node is does not matter to a skinned mesh, but which side of it is the front.
        let is_mirrored = node.skin.is_some() && pose.world(index).is_some_and(|at| at.matrix3.determinant() < 0.0);
        let bits = weights.iter().map(|weight| weight.to_bits()).collect();
        let shape = Shape { mesh, weights: bits, skin: node.skin, is_mirrored };
        if let Some(known) = self.known.get(&shape) {
            return Ok(*known);
        }
        let joints = node.skin.map(|skin| self.joints(skin, pose, &format!("{pointer}/skin"))).transpose()?;
        let deformation = Deformation { weights, skin: joints.as_deref().map(Vec::as_slice), is_mirrored };
        let group = self.make(scene, mesh, deformation)?;
        self.known.insert(shape, group);
        Ok(group)
    }

    fn joints(&mut self, skin: usize, pose: &Pose, pointer: &str) -> Result<Arc<Vec<DAffine3>>> {
        Ok(match self.joints.entry(skin) {
            Entry::Occupied(known) => known.get().clone(),
            Entry::Vacant(free) => free.insert(Arc::new(skin::matrices(self.document, skin, pose, pointer)?)).clone(),
        })
    }

    /// Makes a group of a mesh, if it has area.
    fn make(&mut self, scene: &mut Scene, m: usize, deformation: Deformation<'_>) -> Result<Option<u32>> {
        let document = self.document;
        let mesh = &document.root.meshes[m];
        let begin = scene.geometries.len() as u32;
        let counts = !std::mem::replace(&mut self.counted[m], true);
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let pointer = format!("/meshes/{m}/primitives/{p}");
            let mode = primitive.mode.unwrap_or(4);
            match mode {
                0..=3 => self.flat += usize::from(counts),
                _ if !primitive.attributes.contains_key("POSITION") => self.placeless += usize::from(counts),
                4..=6 => {
                    let read = self.read(primitive, mode, deformation, &pointer)?;
                    scene.geometries.push(Geometry::Mesh(Mesh { name: mesh.name.clone(), ..read }));
                }
                _ => return Err(document.error(format!("{pointer}/mode"), format!("mode {mode} is none of 0 to 6"))),
            }
        }
        let geometries = begin..scene.geometries.len() as u32;
        if geometries.is_empty() {
            return Ok(None);
        }
        scene.groups.push(Group { name: mesh.name.clone(), geometries });
        Ok(Some(scene.groups.len() as u32 - 1))
    }

    /// Hands materials and textures over to the scene.
    pub(super) fn finish(self, scene: &mut Scene, warnings: &mut Vec<Warning>) {
        let mut warn = |message| warnings.push(self.document.warning("/meshes", message));
        if self.flat > 0 {
            warn(format!("{} primitives are points or lines, which have no area, and are left out", self.flat));
        }
        if self.placeless > 0 {
            warn(format!("{} primitives have no POSITION and are left out", self.placeless));
        }
        if self.bare > 0 {
            warn(format!(
                "{} primitives lack texture coordinates that their materials want: one point of each texture is seen",
                self.bare
            ));
        }
        if self.unmarked > 0 {
            let what =
                "colours in whole numbers that are not marked as normalized, so that all from 1 on are full strength";
            warn(format!("{} primitives have {what}", self.unmarked));
        }
        self.materials.finish(scene, warnings);
    }

    fn read(&mut self, primitive: &Primitive, mode: u32, deformation: Deformation<'_>, pointer: &str) -> Result<Mesh> {
        let document = self.document;
        let packed = draco::decode(document, primitive, pointer)?;
        let (mut attributes, positions) = Attributes::new(document, primitive, packed.as_ref(), pointer)?;
        let material = variants::material(document, primitive, self.variant, pointer)?;
        let is_colored = primitive.attributes.contains_key("COLOR_0");
        let (material, sets) = self.materials.get(material, is_colored, pointer)?;
        let normals = attributes.find("NORMAL", &["VEC3"])?;
        let colors = attributes.find("COLOR_0", &["VEC3", "VEC4"])?;
        let mut triangles = match &packed {
            Some(packed) => packed.triangles.clone(),
            None => triangles::read(document, primitive, mode, positions.count, pointer)?,
        };
        let uv_names = [sets.0[0].or(Some(0)), sets.0[1]].map(|set| set.map(|set| format!("TEXCOORD_{set}")));
        let uvs = uv_names.each_ref().map(|name| match name {
            Some(name) => attributes.find(name, &["VEC2"]),
            None => Ok(None),
        });
        let [uvs, second_uvs] = uvs;
        let (uvs, second_uvs) = (uvs?, second_uvs?);
        let [uv_name, second_uv_name] = uv_names.map(Option::unwrap_or_default);
        let lacks = |set: Option<u32>, view: &Option<View<'_>>| set.is_some() && view.is_none();
        self.bare += usize::from(lacks(sets.0[0], &uvs) || lacks(sets.0[1], &second_uvs));

        if deformation.is_mirrored {
            triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        attributes.used = compact(triangles.as_flattened_mut(), positions.count);
        // Positions 12, normals 12, uvs 8 a set, colours 16, what deforms 48, and 12 a triangle.
        let is_deformed = deformation.skin.is_some() || !deformation.weights.is_empty();
        let vertex = 48 + if second_uvs.is_some() { 8 } else { 0 } + if is_deformed { 48 } else { 0 };
        document.spend(pointer, attributes.count() as u64 * vertex + triangles.len() as u64 * 12)?;

        // glTF's v points down, ours up.
        let uv = |uv: [f32; 2]| Vec2::from(uv) * Vec2::new(1.0, -1.0) + Vec2::new(0.0, 1.0);
        let targets = (primitive, deformation.weights);
        let uvs_of = |view: Option<View<'_>>, name: &str| match view {
            Some(view) => Displacements::read(&attributes, targets, (name, &["VEC2"]), &view, uv),
            None => Ok(Vec::new()),
        };
        let colors = match colors {
            Some(view) => {
                let alpha = if view.components() == 4 { Vec4::ZERO } else { Vec4::W };
                // With what displaces them they may leave the range of colours, which the specification cuts either
                // way.
                let accessor =
                    primitive.attributes.get("COLOR_0").and_then(|&index| document.root.accessors.get(index));
                let is_unmarked = accessor.is_some_and(|own| {
                    Component::from_code(own.component_type) != Ok(Component::F32) && !own.normalized
                });
                self.unmarked += usize::from(is_unmarked);
                let color = |color| (Vec4::from(color) + alpha).clamp(Vec4::ZERO, Vec4::ONE);
                Displacements::read(&attributes, targets, ("COLOR_0", &["VEC3", "VEC4"]), &view, color)?
            }
            None => Vec::new(),
        };
        let mut mesh = Mesh {
            positions: Arc::default(),
            normals: Vec::new(),
            uvs: uvs_of(uvs, &uv_name)?,
            second_uvs: uvs_of(second_uvs, &second_uv_name)?,
            colors,
            triangles: Arc::new(triangles),
            material,
            ..Mesh::default()
        };
        if is_deformed {
            let deformer = Deformer::new(document, &attributes, primitive, deformation, pointer)?;
            deformer.apply(&attributes, &positions, normals.as_ref(), &mut mesh);
        } else {
            let normal = |n: [f32; 3]| DVec3::from(n.map(f64::from)).normalize_or_zero().as_vec3();
            mesh.positions = Arc::new(match &attributes.used {
                None => positions.vectors(Vec3::from),
                Some(_) => attributes.read(&positions, Vec3::from),
            });
            mesh.normals = normals.map_or(Vec::new(), |v| attributes.read(&v, normal));
        }
        Ok(mesh)
    }
}
