//! `[material.NAME]`.

use super::table::{Read, Table};
use crate::math::Vec3;
use crate::scene::{Absorption, Alpha, Interface, Material, Specular};

/// What kinds there are.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Phong,
    Glass,
    Unlit,
}

/// The material of a table. A texture is left to the caller.
pub(super) fn material(name: &str, table: &mut Table<'_>) -> Read<Material> {
    let kinds = [("phong", Kind::Phong), ("glass", Kind::Glass), ("unlit", Kind::Unlit)];
    let kind = table.optional("type", |value| value.choice(&kinds))?.unwrap_or(Kind::Phong);
    if kind == Kind::Unlit {
        for key in LIT {
            table.refuse(
                key,
                "means nothing to type = \"unlit\", which shows \"diffuse\" as it is; leave one of them out",
            )?;
        }
    }
    let plain = match kind {
        Kind::Phong | Kind::Unlit => Material::default(),
        Kind::Glass => Material::glass(Material::default().ior),
    };
    let mut color = |key| table.optional(key, |value| value.color());
    let diffuse = color("diffuse")?.unwrap_or(plain.diffuse);
    let (ambient, specular) = (color("ambient")?.unwrap_or(diffuse), color("specular")?.unwrap_or(plain.specular));
    let reflection = color("reflection")?.unwrap_or(plain.reflection);
    let transmission = color("transmission")?.unwrap_or(plain.transmission);
    let emission = color("emission")?.unwrap_or_default();
    let (alpha, interface) = (alpha(table)?, interface(table, kind)?);
    let models = [("phong", Specular::Phong), ("blinn-phong", Specular::BlinnPhong)];
    Ok(Material {
        name: name.to_owned(),
        ambient,
        diffuse,
        specular,
        shininess: table.optional("shininess", |value| value.share())?.unwrap_or(plain.shininess),
        model: table.optional("model", |value| value.choice(&models))?.unwrap_or(plain.model),
        energy_conserving: table.optional("energy_conserving", |value| value.flag())?.unwrap_or(false),
        reflection,
        transmission,
        ior: above_zero(table, "ior")?.unwrap_or(plain.ior),
        gloss: gloss(table, reflection, transmission)?,
        interface,
        absorption: absorption(table, transmission, interface)?,
        unlit: kind == Kind::Unlit,
        normal_scale: table.optional("normal_scale", |value| value.number())?.unwrap_or(1.0) as f32,
        alpha,
        opacity: opacity(table, alpha)?,
        emission,
        ..plain
    })
}

/// `gloss`, of which nothing is seen where nothing is mirrored or let through.
fn gloss(table: &mut Table<'_>, reflection: Vec3, transmission: Vec3) -> Read<Option<f32>> {
    match (table.optional("gloss", |value| value.share())?, table.get("gloss")) {
        (Some(_), Some(value)) if reflection == Vec3::ZERO && transmission == Vec3::ZERO => Err(value
            .fault("\"gloss\" blurs what is mirrored or let through: give it a \"reflection\" or a \"transmission\"")),
        (gloss, _) => Ok(gloss),
    }
}

/// What only a surface has on which light falls.
const LIT: [&str; 13] = [
    "ambient",
    "specular",
    "shininess",
    "model",
    "energy_conserving",
    "reflection",
    "transmission",
    "ior",
    "gloss",
    "normal_texture",
    "normal_scale",
    "attenuation_color",
    "attenuation_distance",
];

fn interface(table: &mut Table<'_>, kind: Kind) -> Read<Interface> {
    let Some(thin) = table.get("thin") else {
        return Ok(if kind == Kind::Glass { Interface::Fresnel } else { Interface::Shares });
    };
    match (kind, thin.flag()?) {
        (Kind::Glass, true) => Ok(Interface::Thin),
        (Kind::Glass, false) => Ok(Interface::Fresnel),
        (Kind::Phong | Kind::Unlit, _) => Err(thin.fault("\"thin\" is for type = \"glass\" alone")),
    }
}

/// `alpha` and `alpha_cutoff`.
fn alpha(table: &mut Table<'_>) -> Read<Alpha> {
    let modes = [("opaque", Alpha::Opaque), ("mask", Alpha::Mask { cutoff: 0.5 }), ("blend", Alpha::Blend)];
    let mode = table.optional("alpha", |value| value.choice(&modes))?.unwrap_or_default();
    let cutoff = unit(table, "alpha_cutoff")?;
    match (mode, cutoff) {
        (Alpha::Mask { .. }, Some(cutoff)) => Ok(Alpha::Mask { cutoff }),
        (Alpha::Opaque | Alpha::Blend, Some(_)) => Err(table.fault("\"alpha_cutoff\" is for alpha = \"mask\" alone")),
        (mode, None) => Ok(mode),
    }
}

/// `opacity`, of which nothing is seen where `alpha` is opaque.
fn opacity(table: &mut Table<'_>, alpha: Alpha) -> Read<f32> {
    let opacity = unit(table, "opacity")?.unwrap_or(1.0);
    match table.get("opacity") {
        Some(value) if alpha == Alpha::Opaque && opacity < 1.0 => {
            Err(value.fault("\"opacity\" is seen with alpha = \"blend\" or \"mask\" alone; write one of them, too"))
        }
        _ => Ok(opacity),
    }
}

/// A number from 0 to 1.
fn unit(table: &mut Table<'_>, key: &'static str) -> Read<Option<f32>> {
    table.optional(key, |value| {
        let number = value.share()?;
        if number <= 1.0 { Ok(number) } else { Err(value.unlike("a number from 0 to 1")) }
    })
}

/// `attenuation_color` and `attenuation_distance`, which stand together, for what lets light through.
fn absorption(table: &mut Table<'_>, transmission: Vec3, interface: Interface) -> Read<Option<Absorption>> {
    let color = table.optional("attenuation_color", |value| {
        let color = value.color()?;
        if color.cmple(Vec3::ONE).all() { Ok(color) } else { Err(value.unlike("shares from 0 to 1")) }
    })?;
    let distance = above_zero(table, "attenuation_distance")?;
    match (color, distance) {
        (Some(_), Some(_)) if transmission == Vec3::ZERO => {
            Err(table.fault("\"attenuation_color\" is for what lets light through: give it a \"transmission\""))
        }
        (Some(_), Some(_)) if interface == Interface::Thin => Err(table.fault(
            "\"attenuation_color\" is for what has an inside, and \"thin\" glass has none; leave out one of the two",
        )),
        (Some(color), Some(distance)) => Ok(Some(Absorption { color, distance })),
        (None, None) => Ok(None),
        _ => Err(table.fault("\"attenuation_color\" and \"attenuation_distance\" go together; one of them is missing")),
    }
}

fn above_zero(table: &mut Table<'_>, key: &'static str) -> Read<Option<f32>> {
    table.optional(key, |value| {
        let number = value.number()? as f32;
        // What is less cannot be divided by.
        let inside = number.is_finite() && number >= f32::MIN_POSITIVE;
        if inside { Ok(number) } else { Err(value.unlike("a number above 0, from 1.2e-38 up")) }
    })
}
