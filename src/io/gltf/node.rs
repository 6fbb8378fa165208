//! What nodes carry: instances, lights and cameras, where they stand.

use super::document::Document;
use super::mesh::Groups;
use super::pose::{Hierarchy, Poses};
use super::schema::{Camera as CameraSource, Node};
use super::{instancing, punctual};
use crate::error::{Result, Warning};
use crate::math::{DAffine3, DMat3, DVec2, DVec3, cofactor};
use crate::scene::{Camera, Fov, Geometry, Group, Instance, Projection, Scene};

/// What a vertex takes in memory: position, normal, two sets of texture coordinates and a colour.
const BYTES_OF_A_VERTEX: usize = 12 + 12 + 2 * 8 + 16;

/// Where what nodes carry is put.
struct Stage<'s, 'd> {
    document: &'s Document<'d>,
    scene: &'s mut Scene,
    warnings: &'s mut Vec<Warning>,
}

/// Places everything that the document's scene shows.
pub(super) fn place(
    document: &Document<'_>,
    hierarchy: &Hierarchy,
    poses: &Poses,
    groups: &mut Groups<'_>,
    scene: &mut Scene,
    warnings: &mut Vec<Warning>,
) -> Result<()> {
    let root = &document.root;
    let lights = punctual::lights(document)?;
    let mut stage = Stage { document, scene, warnings };
    for &index in &hierarchy.order {
        let node = &root.nodes[index];
        let pointer = format!("/nodes/{index}");
        // Every node of the hierarchy has one.
        let Some(transform) = poses.start.world(index) else { continue };
        if let Some(mesh) = node.mesh
            && let Some(group) = groups.get(stage.scene, mesh, index, &poses.start)?
        {
            let end = poses.end.as_ref().and_then(|pose| pose.world(index)).filter(|end| *end != transform);
            stage.instances(node, &pointer, group, transform, end)?;
        }
        if let Some(camera) = node.camera {
            document.check_index(&format!("{pointer}/camera"), camera, root.cameras.len(), "camera")?;
            let made = make_camera(document, camera, &root.cameras[camera], node, &transform, stage.warnings)?;
            stage.scene.cameras.extend(made);
        }
        if let Some(light) = node.extensions.get("KHR_lights_punctual").and_then(|e| e.get("light")) {
            let pointer = format!("{pointer}/extensions/KHR_lights_punctual/light");
            let light = light.as_u64().and_then(|l| usize::try_from(l).ok()).unwrap_or(usize::MAX);
            document.check_index(&pointer, light, lights.len(), "light")?;
            let light = punctual::light(document, light, &lights[light])?;
            stage.scene.lights.push(punctual::move_light(&light, &transform));
        }
    }
    drop_unplaced(stage.scene);
    Ok(())
}

/// Leaves out groups that nothing places: of which only copies that are pressed flat stand in the scene, or not even
/// those.
fn drop_unplaced(scene: &mut Scene) {
    let mut is_placed = vec![false; scene.groups.len()];
    scene.instances.iter().for_each(|instance| is_placed[instance.group as usize] = true);
    if is_placed.iter().all(|is_placed| *is_placed) {
        return;
    }
    let (mut numbers, mut groups, mut geometries) = (Vec::new(), Vec::new(), Vec::new());
    // Each group's follow those of the one before.
    let mut all = std::mem::take(&mut scene.geometries).into_iter();
    for (group, is_placed) in std::mem::take(&mut scene.groups).into_iter().zip(is_placed) {
        numbers.push(groups.len() as u32);
        let own: Vec<Geometry> = all.by_ref().take(group.geometries.len()).collect();
        if is_placed {
            let begin = geometries.len() as u32;
            geometries.extend(own);
            groups.push(Group { geometries: begin..geometries.len() as u32, ..group });
        }
    }
    scene.instances.iter_mut().for_each(|instance| instance.group = numbers[instance.group as usize]);
    (scene.groups, scene.geometries) = (groups, geometries);
}

impl Stage<'_, '_> {
    /// Adds the instances of a node's group.
    fn instances(
        &mut self,
        node: &Node,
        pointer: &str,
        group: u32,
        transform: DAffine3,
        end: Option<DAffine3>,
    ) -> Result<()> {
        let instance = |transform, transform_end| Instance { name: node.name.clone(), group, transform, transform_end };
        if node.skin.is_some() {
            // It lies where its joints are.
            self.scene.instances.push(instance(DAffine3::IDENTITY, None));
            return Ok(());
        }
        let places = instancing::placements(self.document, node, pointer)?;
        let places = places.unwrap_or_else(|| vec![DAffine3::IDENTITY]);
        let (mut flat, mut far, mut gone, mut stopped) = (0, 0, 0, 0);
        for place in &places {
            let (start, end) = (transform * *place, end.map(|end| end * *place));
            if !is_held(&start) {
                far += 1;
                continue;
            }
            let goes_far = end.is_some_and(|end| !is_held(&end));
            let end = end.filter(is_held);
            gone += usize::from(goes_far);
            if !is_invertible(&start) {
                match self.pressed(group, &start, pointer)? {
                    Some(group) => {
                        stopped += usize::from(end.is_some_and(|end| end != start));
                        self.scene.instances.push(Instance { group, ..instance(DAffine3::IDENTITY, None) });
                    }
                    None => flat += 1,
                }
                continue;
            }
            let moves_to = end.filter(is_invertible);
            stopped += usize::from(end.is_some() && moves_to.is_none());
            self.scene.instances.push(instance(start, moves_to));
        }
        let mut warn = |message| self.warnings.push(self.document.warning(pointer, message));
        let reasons =
            [("placed farther away, or larger, than f32 holds", far, gone), ("scaled by zero", flat, stopped)];
        for (why, left_out, standing) in reasons {
            if left_out > 0 && left_out == places.len() {
                warn(format!("node {:?} is {why}, and left out", node.name));
            } else if left_out > 0 {
                warn(format!("{left_out} instances of node {:?} are {why}, and left out", node.name));
            }
            if standing > 0 {
                warn(format!("node {:?} is {why} while the shutter is open; it stands still", node.name));
            }
        }
        Ok(())
    }

    /// A copy of a group where `transform` presses it flat, by a scale of zero along one axis: rays cannot be taken
    /// back through that. None where nothing is left that has an area.
    fn pressed(&mut self, group: u32, transform: &DAffine3, pointer: &str) -> Result<Option<u32>> {
        let Scene { geometries, groups, .. } = &mut *self.scene;
        let begin = geometries.len() as u32;
        let Group { name, geometries: range } = groups[group as usize].clone();
        let keeps_areas = transform.is_finite() && cofactor(&transform.matrix3) != DMat3::ZERO;
        for index in if keeps_areas { range } else { 0..0 } {
            let Geometry::Mesh(mesh) = &geometries[index as usize] else { continue };
            self.document.spend(pointer, (mesh.positions.len() * BYTES_OF_A_VERTEX) as u64)?;
            let placed = mesh.placed(transform);
            if placed.has_area() {
                geometries.push(Geometry::Mesh(placed));
            }
        }
        let end = geometries.len() as u32;
        if begin == end {
            return Ok(None);
        }
        groups.push(Group { name, geometries: begin..end });
        Ok(Some(groups.len() as u32 - 1))
    }
}

/// Whether f32 holds it, in whatever unit.
fn is_held(transform: &DAffine3) -> bool {
    transform.as_affine3().is_finite()
}

/// What can be traced: see [`World`](crate::World). With room for a change of units.
fn is_invertible(transform: &DAffine3) -> bool {
    let small = DAffine3::from_scale(DVec3::splat(1e-4)) * *transform;
    small.matrix3.determinant() != 0.0 && small.inverse().is_finite() && small.as_affine3().inverse().is_finite()
}

fn make_camera(
    document: &Document<'_>,
    index: usize,
    source: &CameraSource,
    node: &Node,
    transform: &DAffine3,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Camera>> {
    let projection = match (&source.perspective, &source.orthographic) {
        (Some(perspective), _) => Projection::Perspective(Fov::Vertical(perspective.yfov)),
        // Half the height before any scale of the node, which is left out as for angles of view.
        (None, Some(orthographic)) => Projection::Orthographic(2.0 * orthographic.ymag.abs()),
        (None, None) => {
            let message = "neither perspective nor orthographic; the camera needs one of them";
            return Err(document.error(format!("/cameras/{index}"), message));
        }
    };
    if projection.half_extent(1.0).is_none() {
        let (what, message) = match projection {
            Projection::Perspective(_) => ("perspective/yfov", "an angle of view that does not lie between 0 and pi"),
            _ => ("orthographic/ymag", "a height of 0 or one that is not finite"),
        };
        return Err(document.error(format!("/cameras/{index}/{what}"), message));
    }
    let back = transform.transform_vector3(DVec3::Z).try_normalize();
    let right = back.and_then(|b| transform.transform_vector3(DVec3::Y).cross(b).try_normalize());
    let (Some(back), Some(right)) = (back, right) else {
        let message = format!("the camera of node {:?} is scaled by zero, and left out", node.name);
        warnings.push(document.warning(format!("/cameras/{index}"), message));
        return Ok(None);
    };
    let name = if node.name.is_empty() { source.name.clone() } else { node.name.clone() };
    let frame = DMat3::from_cols(right, back.cross(right), back);
    let eye = transform.translation;
    Ok(Some(Camera {
        name,
        eye,
        frame,
        end: None,
        projection,
        shift: DVec2::ZERO,
        lens: None,
        distortion: None,
        shutter: [0.0, 1.0],
    }))
}
