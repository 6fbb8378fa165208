//! The node hierarchy: instances, lights and cameras, where they stand.
//!
//! Walked with a list of our own: a hierarchy may be deeper than the call stack.

use super::Document;
use super::schema::{Camera as CameraSource, Lights, Node};
use crate::error::{Result, Warning};
use crate::math::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, Vec3};
use crate::scene::{Attenuation, Camera, Fov, Instance, Light, Projection, Scene};

/// Places everything that the document's scene (the first, where it names none) shows. `groups` has the group of each
/// mesh.
pub(super) fn place(
    document: &Document<'_>,
    groups: &[Option<u32>],
    scene: &mut Scene,
    warnings: &mut Vec<Warning>,
) -> Result<()> {
    let root = &document.root;
    let lights = lights(document)?;
    let first = root.scene.unwrap_or(0);
    if root.scenes.is_empty() {
        return Err(document.error("/scenes", "nothing to render: the file has no scene"));
    }
    document.check_index("/scene", first, root.scenes.len(), "scene")?;

    let mut seen = vec![false; root.nodes.len()];
    let mut left = Vec::new();
    for (k, &node) in root.scenes[first].nodes.iter().enumerate().rev() {
        let pointer = format!("/scenes/{first}/nodes/{k}");
        document.check_index(&pointer, node, root.nodes.len(), "node")?;
        left.push((node, DAffine3::IDENTITY, pointer));
    }
    let mut skinned = 0;
    while let Some((index, parent, named_by)) = left.pop() {
        if std::mem::replace(&mut seen[index], true) {
            let message = format!("node {index} is a child of itself or of two nodes; nodes have to form trees");
            return Err(document.error(named_by, message));
        }
        let node = &root.nodes[index];
        let pointer = format!("/nodes/{index}");
        let transform = parent * local(document, node, &pointer)?;
        if !transform.is_finite() {
            return Err(document.error(pointer, "the transform is not finite, or its product with the parents' is not"));
        }
        skinned += usize::from(node.skin.is_some() && node.mesh.is_some());
        if let Some(mesh) = node.mesh {
            document.check_index(&format!("{pointer}/mesh"), mesh, groups.len(), "mesh")?;
            if let Some(group) = groups[mesh] {
                if is_invertible(&transform) {
                    scene.instances.push(Instance { name: node.name.clone(), group, transform, transform_end: None });
                } else {
                    let message = format!("node {:?} is scaled by zero, and left out", node.name);
                    warnings.push(document.warning(&pointer, message));
                }
            }
        }
        if let Some(camera) = node.camera {
            document.check_index(&format!("{pointer}/camera"), camera, root.cameras.len(), "camera")?;
            let made = make_camera(document, camera, &root.cameras[camera], node, &transform, warnings)?;
            scene.cameras.extend(made);
        }
        if let Some(light) = node.extensions.get("KHR_lights_punctual").and_then(|e| e.get("light")) {
            let pointer = format!("{pointer}/extensions/KHR_lights_punctual/light");
            let light = light.as_u64().and_then(|l| usize::try_from(l).ok()).unwrap_or(usize::MAX);
            document.check_index(&pointer, light, lights.len(), "light")?;
            scene.lights.push(move_light(&lights[light], &transform));
        }
        for (k, &child) in node.children.iter().enumerate().rev() {
            let pointer = format!("/nodes/{index}/children/{k}");
            document.check_index(&pointer, child, root.nodes.len(), "node")?;
            left.push((child, transform, pointer));
        }
    }
    if skinned > 0 {
        let message = format!("{skinned} meshes have skins; they are rendered in the pose they are stored in");
        warnings.push(document.warning("/skins", message));
    }
    Ok(())
}

/// What can be traced: see [`World`](crate::World). With room for a change of units.
fn is_invertible(transform: &DAffine3) -> bool {
    let small = DAffine3::from_scale(DVec3::splat(1e-4)) * *transform;
    small.matrix3.determinant() != 0.0 && small.inverse().is_finite() && small.as_affine3().inverse().is_finite()
}

fn local(document: &Document<'_>, node: &Node, pointer: &str) -> Result<DAffine3> {
    if let Some(matrix) = node.matrix {
        let matrix = DMat4::from_cols_array(&matrix);
        if matrix.row(3) != DMat4::IDENTITY.row(3) {
            return Err(document.error(format!("{pointer}/matrix"), "the last row has to be 0 0 0 1"));
        }
        return Ok(DAffine3::from_mat4(matrix));
    }
    let rotation = match node.rotation {
        None => DQuat::IDENTITY,
        Some(q) => {
            let q = DQuat::from_array(q);
            if !(q.length() > 1e-6 && q.is_finite()) {
                return Err(document.error(format!("{pointer}/rotation"), "the rotation has to be a unit quaternion"));
            }
            q.normalize()
        }
    };
    let scale = node.scale.map_or(DVec3::ONE, DVec3::from);
    let translation = node.translation.map_or(DVec3::ZERO, DVec3::from);
    Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
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

/// The lights of `KHR_lights_punctual`, at the origin, along -z.
fn lights(document: &Document<'_>) -> Result<Vec<Light>> {
    const POINTER: &str = "/extensions/KHR_lights_punctual";
    let Some(extension) = document.root.extensions.get("KHR_lights_punctual") else { return Ok(Vec::new()) };
    let lights: Lights = serde::Deserialize::deserialize(extension)
        .map_err(|e: serde_json::Error| document.error(POINTER, format!("not valid: {e}")))?;
    let convert = |(index, light): (usize, &super::schema::Light)| {
        let fail = |message: String| document.error(format!("{POINTER}/lights/{index}"), message);
        // Lux and candela: a white matte surface sends on 1 / pi of what reaches it.
        let color = Vec3::from(light.color) * (light.intensity * std::f32::consts::FRAC_1_PI);
        if !(color.is_finite() && color.min_element() >= 0.0) {
            return Err(fail("colour and intensity have to be finite and from 0 up".into()));
        }
        let (position, direction) = (DVec3::ZERO, DVec3::NEG_Z);
        let (attenuation, range) = (Attenuation::INVERSE_SQUARE, light.range.unwrap_or(f64::INFINITY));
        if range.is_nan() || range <= 0.0 {
            return Err(fail(format!("a range of {range}; it has to be above 0")));
        }
        match light.kind.as_str() {
            "directional" => Ok(Light::Directional { direction, color }),
            "point" => Ok(Light::Point { position, color, attenuation, range, radius: 0.0 }),
            "spot" => {
                let (inner_angle, outer_angle) = (light.spot.inner_cone_angle, light.spot.outer_cone_angle);
                if !(inner_angle >= 0.0 && inner_angle < outer_angle && outer_angle <= std::f32::consts::FRAC_PI_2) {
                    return Err(fail("cone angles have to be 0 <= inner < outer <= pi / 2".into()));
                }
                Ok(Light::Spot { position, direction, color, attenuation, range, inner_angle, outer_angle })
            }
            kind => Err(fail(format!("type {kind:?} is none of directional, point, spot"))),
        }
    };
    lights.lights.iter().enumerate().map(convert).collect()
}

/// A light as placed by a node. Its range is in scene units whatever the node's scale, as the extension has it.
fn move_light(light: &Light, transform: &DAffine3) -> Light {
    let along = transform.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
    let mut moved = light.clone();
    match &mut moved {
        Light::Directional { direction, .. } => *direction = along,
        // No extension has any.
        Light::Area { .. } => {}
        Light::Point { position, .. } => *position = transform.translation,
        Light::Spot { position, direction, .. } => (*position, *direction) = (transform.translation, along),
    }
    moved
}
