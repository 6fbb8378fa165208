//! `KHR_lights_punctual`: lights without a surface.

use super::document::Document;
use super::schema::{Light as Source, Lights};
use crate::error::Result;
use crate::math::{DAffine3, DVec3, Vec3};
use crate::scene::{Attenuation, Light};

const POINTER: &str = "/extensions/KHR_lights_punctual";

/// The lights of `KHR_lights_punctual`, as the file has them.
pub(super) fn lights(document: &Document<'_>) -> Result<Vec<Source>> {
    let Some(extension) = document.root.extensions.get("KHR_lights_punctual") else { return Ok(Vec::new()) };
    let lights: Lights = serde::Deserialize::deserialize(extension)
        .map_err(|e: serde_json::Error| document.error(POINTER, format!("not valid: {e}")))?;
    Ok(lights.lights)
}

/// The light `source`, whose number is `index`, at the origin, along -z.
pub(super) fn light(document: &Document<'_>, index: usize, source: &Source) -> Result<Light> {
    let fail = |message: String| document.error(format!("{POINTER}/lights/{index}"), message);
    // Lux and candela: a white matte surface sends on 1 / pi of what reaches it.
    let color = Vec3::from(source.color) * (source.intensity * std::f32::consts::FRAC_1_PI);
    if !(color.is_finite() && color.min_element() >= 0.0) {
        return Err(fail("colour and intensity have to be finite and from 0 up".into()));
    }
    let (position, direction) = (DVec3::ZERO, DVec3::NEG_Z);
    let (attenuation, range) = (Attenuation::INVERSE_SQUARE, source.range.unwrap_or(f64::INFINITY));
    if range.is_nan() || range <= 0.0 {
        return Err(fail(format!("a range of {range}; it has to be above 0")));
    }
    match source.kind.as_str() {
        "directional" => Ok(Light::Directional { direction, color }),
        "point" => Ok(Light::Point { position, color, attenuation, range, radius: 0.0 }),
        "spot" => {
            let (inner_angle, outer_angle) = (source.spot.inner_cone_angle, source.spot.outer_cone_angle);
            let is_cone = outer_angle > 0.0 && outer_angle <= std::f32::consts::FRAC_PI_2;
            if !(is_cone && inner_angle >= 0.0 && inner_angle <= outer_angle) {
                return Err(fail("cone angles have to be 0 <= inner <= outer and 0 < outer <= pi / 2".into()));
            }
            // Exporters write cones with a hard edge so, although the extension has them apart.
            let inner_angle = inner_angle.min(outer_angle.next_down());
            Ok(Light::Spot { position, direction, color, attenuation, range, inner_angle, outer_angle })
        }
        kind => Err(fail(format!("type {kind:?} is none of directional, point, spot"))),
    }
}

/// A light as placed by a node. Its range is in scene units whatever the node's scale, as the extension has it.
pub(super) fn move_light(light: &Light, transform: &DAffine3) -> Light {
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
