//! `[[camera]]`: where it stands, what it projects, through which lens.

use super::table::{Read, Table, Value};
use crate::math::{DVec2, DVec3};
use crate::scene::{Camera, Distortion, Fov, Projection, ThinLens};

/// Vertical angle of view where none is given, degrees.
const USUAL_FOV: f64 = 40.0;

#[derive(Clone, Copy)]
enum Kind {
    Perspective,
    Orthographic,
    Equirectangular,
}

/// Reads a camera.
pub(super) fn camera(mut table: Table<'_>) -> Read<Camera> {
    let (eye, target) = (table.need("eye")?.vector()?, table.need("look_at")?.vector()?);
    let up = table.optional("up", Value::vector)?.unwrap_or(DVec3::Y);
    let mut camera = Camera::look_at(eye, target, up, USUAL_FOV.to_radians())
        .ok_or_else(|| table.fault("\"eye\" and \"look_at\" are one point, or \"up\" is zero"))?;
    camera.name = table.optional("name", Value::text)?.unwrap_or_default().to_owned();
    camera.shift = table.optional("shift", Value::numbers)?.map(DVec2::from_array).unwrap_or_default();
    let kinds = [
        ("perspective", Kind::Perspective),
        ("orthographic", Kind::Orthographic),
        ("equirectangular", Kind::Equirectangular),
    ];
    // Keys that a projection has no use for are not asked for, and so refused.
    match table.optional("projection", |value| value.choice(&kinds))?.unwrap_or(Kind::Perspective) {
        Kind::Perspective => {
            let (vertical, horizontal) = (table.optional("fov", angle)?, table.optional("fov_x", angle)?);
            camera.projection = Projection::Perspective(match (horizontal, vertical) {
                (None, vertical) => Fov::Vertical(vertical.unwrap_or(USUAL_FOV.to_radians())),
                (Some(horizontal), None) => Fov::Horizontal(horizontal),
                (Some(horizontal), Some(vertical)) => Fov::Both { horizontal, vertical },
            });
            camera.lens = lens(&mut table, eye.distance(target))?;
            camera.distortion = table.optional("distortion", distortion)?;
        }
        Kind::Orthographic => {
            camera.projection = Projection::Orthographic(above_zero(table.need("height")?)?);
            camera.lens = lens(&mut table, eye.distance(target))?;
        }
        Kind::Equirectangular => camera.projection = Projection::Equirectangular,
    }
    table.finish()?;
    Ok(camera)
}

/// The lens, sharp at `focus` unless it says otherwise.
fn lens(table: &mut Table<'_>, focus: f64) -> Read<Option<ThinLens>> {
    let Some(value) = table.get("lens") else { return Ok(None) };
    let mut table = value.table("\"lens\"".to_owned())?;
    let radius = above_zero(table.need("radius")?)?;
    let focus = table.optional("focus", above_zero)?.unwrap_or(focus);
    let blades = table.optional("blades", |value| value.whole(3..=1000))?.unwrap_or(0) as u32;
    table.finish()?;
    Ok(Some(ThinLens { radius, focus, blades }))
}

fn distortion(value: Value<'_>) -> Read<Distortion> {
    let mut table = value.table("\"distortion\"".to_owned())?;
    let mut number = |key| Ok(table.optional(key, Value::number)?.unwrap_or(0.0));
    let (k1, k2, k3, p1, p2) = (number("k1")?, number("k2")?, number("k3")?, number("p1")?, number("p2")?);
    table.finish()?;
    Ok(Distortion { k1, k2, k3, p1, p2 })
}

/// An angle of view, in radians.
fn angle(value: Value<'_>) -> Read<f64> {
    let degrees = value.number()?;
    let inside = degrees > 0.0 && degrees < 180.0;
    if inside { Ok(degrees.to_radians()) } else { Err(value.unlike("degrees above 0 and below 180")) }
}

fn above_zero(value: Value<'_>) -> Read<f64> {
    let length = value.number()?;
    if length > 0.0 { Ok(length) } else { Err(value.unlike("a number above 0")) }
}
