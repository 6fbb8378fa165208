//! `[fog]`: what fills the space between things.

use super::table::{Read, Table};
use crate::math::Vec3;
use crate::scene::{Fog, Light, Scene};

/// The fog of a table.
pub(super) fn fog(mut table: Table<'_>) -> Read<Fog> {
    let absorption = table.need("absorption")?.color()?;
    let color = table.optional("color", |value| value.color())?.unwrap_or_default();
    let reach = table.optional("reach", |value| {
        let reach = value.share()?;
        if reach > 0.0 { Ok(reach) } else { Err(value.unlike("metres above 0")) }
    })?;
    table.finish()?;
    Ok(Fog { absorption, color, reach: reach.unwrap_or(f32::INFINITY) })
}

/// What a scene's fog hides that was probably meant to be seen.
pub(super) fn doubt(scene: &Scene) -> Option<&'static str> {
    let fog = scene.fog.as_ref().filter(|fog| fog.reach == f32::INFINITY && fog.absorption != Vec3::ZERO)?;
    let is_far = |light: &Light| matches!(light, Light::Directional { .. });
    let hidden = scene.environment.is_some() || scene.lights.iter().any(is_far);
    (hidden && fog.absorption.min_element() > 0.0).then_some(
        "no light of the environment or of directional lights gets through fog without end; say its \"reach\"",
    )
}
