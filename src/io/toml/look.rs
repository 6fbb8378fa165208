//! What is seen, and from where: lights, cameras, and what the file asks of a render.

use std::ffi::OsStr;
use std::path::Path;

use super::table::{Read, Table, Value};
use crate::image::{Curve, MAX_STOPS, TEMPERATURES};
use crate::math::{DVec2, DVec3, MAX_COORDINATE, Vec3};
use crate::scene::{
    Accel, AcceleratorRequest, AreaShape, Attenuation, Camera, DEFAULT_FOV, Distortion, Fov, Integrator, Light,
    MAX_DEPTH, MAX_SIDE, MAX_SPP, Pose, Projection, Request, Resolution, ThinLens,
};
use crate::shape::{SphereMethod, TriangleMethod};

/// What says where a camera is, and where it looks.
const NAMES: [&str; 3] = ["\"eye\"", "\"look_at\"", "\"up\""];

/// How lights and surfaces go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shading {
    /// Lights are those of the file.
    Phong,
    /// As in Heckbert's `minray`: spheres that glow are lights too, and who misses everything sees the ambient light.
    Minray,
}

/// `[render]`.
pub(super) struct Render {
    pub(super) request: Request,
    /// None for a transparent picture.
    pub(super) background: Option<Vec3>,
    pub(super) ambient: Vec3,
    pub(super) shading: Shading,
    pub(super) headlight: bool,
}

impl Render {
    pub(super) fn read(table: Option<Table<'_>>) -> Read<Self> {
        let mut render = Self {
            request: Request::default(),
            background: None,
            ambient: Vec3::ZERO,
            shading: Shading::Phong,
            headlight: true,
        };
        let Some(mut table) = table else { return Ok(render) };
        let side = |length: f64| {
            (length.fract() == 0.0 && (1.0..=f64::from(MAX_SIDE)).contains(&length)).then_some(length as u32)
        };
        render.request = Request {
            size: table.optional("size", |value| {
                let [width, height] = value.numbers::<2>()?.map(side);
                let size = width.zip(height).map(|(width, height)| [width, height]);
                size.ok_or_else(|| value.fault(format!("\"size\" wants two whole numbers from 1 to {MAX_SIDE}")))
            })?,
            spp: table.optional("spp", |value| value.whole(1..=MAX_SPP.into()))?.map(|spp| spp as u32),
            seed: table.optional("seed", |value| value.whole(0..=u64::MAX))?,
            integrator: table.optional("integrator", |value| value.choice(&integrators()))?.flatten(),
            max_depth: table
                .optional("max_depth", |value| value.whole(0..=MAX_DEPTH.into()))?
                .map(|depth| depth as u32),
            output: table.optional("output", picture_name)?,
            exposure: table.optional("exposure", |value| {
                let stops = value.number()? as f32;
                let inside = stops.abs() <= MAX_STOPS;
                if inside { Ok(stops) } else { Err(value.unlike(&format!("stops from -{MAX_STOPS} to {MAX_STOPS}"))) }
            })?,
            white_balance: table.optional("white_balance", |value| {
                let kelvin = value.number()? as f32;
                let (first, last) = (TEMPERATURES.start(), TEMPERATURES.end());
                let inside = TEMPERATURES.contains(&kelvin);
                if inside { Ok(kelvin) } else { Err(value.unlike(&format!("kelvin from {first} to {last}"))) }
            })?,
            response: table.optional("response", |value| value.one_of(Curve::ALL, Curve::name))?,
            search: search(&mut table)?,
        };
        render.ambient = table.optional("ambient", |value| value.color())?.unwrap_or_default();
        let background = table.optional("background", |value| value.color())?;
        let shadings = [("phong", Shading::Phong), ("minray", Shading::Minray)];
        render.shading = table.optional("shading", |value| value.choice(&shadings))?.unwrap_or(render.shading);
        render.headlight = table.optional("headlight", |value| value.flag())?.unwrap_or(true);
        render.background = background.or(match render.shading {
            Shading::Phong => None,
            Shading::Minray => Some(render.ambient),
        });
        table.finish()?;
        Ok(render)
    }
}

/// Where a picture goes: a file.
fn picture_name(value: Value<'_>) -> Read<String> {
    let name = value.text()?;
    // Of `out/` and `out/.` that would be the folder.
    let file = Path::new(name).file_name().and_then(OsStr::to_str);
    match file {
        Some(file) if name.ends_with(file) && !name.contains('\0') => Ok(name.to_owned()),
        _ => Err(value.unlike("the name of a picture, as in \"picture.exr\"")),
    }
}

/// The keys of `[render]` that say how the scene is searched.
fn search(table: &mut Table<'_>) -> Read<AcceleratorRequest> {
    let accel = table.optional("accel", |value| value.one_of(Accel::ALL, Accel::name))?;
    let grid = table.optional("grid", |value| {
        let side = |value: Value<'_>| value.whole(1..=Resolution::MAX.into()).map(|side| side as u32);
        let sides =
            if value.is_list() { value.items()?.map(side).collect() } else { side(value).map(|side| vec![side]) };
        Resolution::of_sides(&sides?).map_err(|expected| value.fault(format!("\"grid\" wants {expected}")))
    })?;
    let fault = |table: &mut Table<'_>, key, remedy: &str| match table.get(key) {
        Some(value) => value.fault(format!("{key:?} {remedy}")),
        None => table.fault(remedy),
    };
    if grid.is_some() && accel != Some(Accel::Grid) {
        return Err(fault(table, "grid", "is the resolution of accel = \"grid\"; write that, too, or leave it out"));
    }
    let search = AcceleratorRequest {
        accel,
        grid,
        triangle_method: table
            .optional("triangle_method", |value| value.one_of(TriangleMethod::ALL, TriangleMethod::name))?,
        sphere_method: table.optional("sphere_method", |value| value.one_of(SphereMethod::ALL, SphereMethod::name))?,
    };
    if search.asks_for_methods() && !accel.unwrap_or_default().has_methods() {
        let key = if search.triangle_method.is_some() { "triangle_method" } else { "sphere_method" };
        let remedy =
            "is for the classic accelerators, bvh and brute are exact; write accel = \"binary-bvh\" or another, too";
        return Err(fault(table, key, remedy));
    }
    Ok(search)
}

/// Integrators by name; "auto" is none.
fn integrators() -> [(&'static str, Option<Integrator>); 4] {
    let [a, b, c] = Integrator::ALL.map(|integrator| (integrator.name(), Some(integrator)));
    [("auto", None), a, b, c]
}

#[derive(Clone, Copy)]
enum Kind {
    Directional,
    Point,
    Spot,
    Rectangle,
    Disk,
    Sphere,
}

/// `[[light]]`.
pub(super) fn light(mut table: Table<'_>) -> Read<Light> {
    let kinds = [
        ("directional", Kind::Directional),
        ("point", Kind::Point),
        ("spot", Kind::Spot),
        ("rectangle", Kind::Rectangle),
        ("disk", Kind::Disk),
        ("sphere", Kind::Sphere),
    ];
    let kind = table.need("type")?.choice(&kinds)?;
    let light = match kind {
        Kind::Directional => {
            Light::Directional { direction: table.need("direction")?.direction()?, color: color(&mut table)? }
        }
        Kind::Point => {
            let color = color(&mut table)?;
            let (position, attenuation, range) = place(&mut table)?;
            let radius = table.optional("radius", |value| value.share())?.unwrap_or(0.0).into();
            Light::Point { position, color, attenuation, range, radius }
        }
        Kind::Spot => {
            let color = color(&mut table)?;
            let (position, attenuation, range) = place(&mut table)?;
            let direction = table.need("direction")?.direction()?;
            let outer = table.need("outer_angle")?;
            let outer_angle = outer.share()?;
            let inner_angle = table.optional("inner_angle", |value| value.share())?.unwrap_or(0.0);
            if !(inner_angle < outer_angle && outer_angle <= 90.0) {
                return Err(outer.fault(format!(
                    "\"outer_angle\" of {outer_angle} degrees; it must be above \"inner_angle\", {inner_angle}, and at most 90"
                )));
            }
            let (inner_angle, outer_angle) = (inner_angle.to_radians(), outer_angle.to_radians());
            Light::Spot { position, direction, color, attenuation, range, inner_angle, outer_angle }
        }
        Kind::Rectangle => {
            let centre = table.need("position")?.vector()?;
            let value = table.need("half_edges")?;
            let edges = value.items()?.map(|edge| edge.vector()).collect::<Read<Vec<_>>>()?;
            let is_held = |edge: &DVec3| edge.abs().max_element() <= MAX_COORDINATE.into();
            if !edges.iter().all(is_held) {
                return Err(value.fault(format!("\"half_edges\" wants lengths of at most {MAX_COORDINATE:e}")));
            }
            let half_edges = match edges[..] {
                [a, b] if a.cross(b).length() > 0.0 => [a, b],
                _ => return Err(value.unlike("two vectors that are not parallel")),
            };
            area(AreaShape::Rectangle { centre, half_edges }, &mut table)?
        }
        Kind::Disk => {
            let (centre, normal) = (table.need("position")?.vector()?, table.need("direction")?.direction()?);
            area(AreaShape::Disk { centre, normal, radius: extent(table.need("radius")?)? }, &mut table)?
        }
        Kind::Sphere => {
            let centre = table.need("position")?.vector()?;
            area(AreaShape::Sphere { centre, radius: extent(table.need("radius")?)? }, &mut table)?
        }
    };
    table.finish()?;
    Ok(light)
}

/// What a light without a surface shows.
fn color(table: &mut Table<'_>) -> Read<Vec3> {
    Ok(table.optional("color", |value| value.color())?.unwrap_or(Vec3::ONE))
}

/// A light with a surface.
fn area(shape: AreaShape, table: &mut Table<'_>) -> Read<Light> {
    table.refuse("color", "is for lights without a surface; this one has \"radiance\"")?;
    Ok(Light::Area { shape, radiance: table.need("radiance")?.color()? })
}

/// Position, attenuation and range of a light.
fn place(table: &mut Table<'_>) -> Read<(DVec3, Attenuation, f64)> {
    let position = table.need("position")?.vector()?;
    let attenuation = table.optional("attenuation", |value| {
        if !value.is_list() {
            return Err(value.unlike("three numbers [c0, c1, c2], of 1 / (c0 + c1 d + c2 d^2)"));
        }
        let [constant, linear, quadratic] = value.color()?.to_array();
        let is_zero = constant + linear + quadratic == 0.0;
        if is_zero {
            return Err(value.fault("\"attenuation\" divides by zero; one number must be above 0"));
        }
        Ok(Attenuation { constant, linear, quadratic })
    })?;
    let range = table.optional("range", |value| {
        let range = value.number()?;
        if range > 0.0 { Ok(range) } else { Err(value.fault("\"range\" wants a number above 0")) }
    })?;
    Ok((position, attenuation.unwrap_or(Attenuation::NONE), range.unwrap_or(f64::INFINITY)))
}

/// `[[camera]]`.
pub(super) fn camera(mut table: Table<'_>) -> Read<Camera> {
    let (eye, target) = (place_of(table.need("eye")?)?, table.need("look_at")?.vector()?);
    let up = table.optional("up", |value| value.vector())?.unwrap_or(DVec3::Y);
    let mut camera =
        Camera::look_at(eye, target, up, 1.0).ok_or_else(|| table.fault(Camera::no_look(NAMES, [eye, target, up])))?;
    camera.end = end(&mut table, [eye, target, up])?;
    camera.projection = projection(&mut table)?;
    camera.lens = table.optional("lens", lens)?;
    if let (Some(value), Projection::Equirectangular) = (table.get("lens"), camera.projection) {
        return Err(value
            .fault("\"lens\" is not for equirectangular cameras: a view of the whole sphere has no plane of focus"));
    }
    let bends = table.get("distortion");
    if let (Some(value), false) = (bends, matches!(camera.projection, Projection::Perspective(_))) {
        return Err(value.fault("\"distortion\" is for perspective cameras alone"));
    }
    camera.distortion = bends
        .map(|value| {
            let [k1, k2, k3, p1, p2] = value.numbers()?;
            Ok(Distortion { k1, k2, k3, p1, p2 })
        })
        .transpose()?;
    camera.name = table.optional("name", |value| value.text())?.unwrap_or_default().to_owned();
    if let Some(value) = table.get("shutter") {
        camera.shutter = value.numbers()?.map(|time| time as f32);
        let [open, close] = camera.shutter;
        if !(0.0 <= open && open <= close && close <= 1.0) {
            return Err(value.fault("\"shutter\" wants two times from 0 to 1, the earlier first"));
        }
    }
    if camera.projection == Projection::Equirectangular {
        table.refuse("shift", "is not for equirectangular cameras, which see the whole sphere; turn the camera")?;
    }
    camera.shift = table.optional("shift", shift)?.unwrap_or_default();
    table.finish()?;
    Ok(camera)
}

fn shift(value: Value<'_>) -> Read<DVec2> {
    let shift = DVec2::from_array(value.numbers()?);
    let inside = shift.abs().max_element() <= Camera::MAX_SHIFT;
    if inside { Ok(shift) } else { Err(value.unlike(&format!("shares of at most {}", Camera::MAX_SHIFT))) }
}

/// A place that rays can start from.
fn place_of(value: Value<'_>) -> Read<DVec3> {
    let place = value.vector()?;
    let is_held = place.abs().max_element() <= MAX_COORDINATE.into();
    if is_held { Ok(place) } else { Err(value.unlike(&format!("a place: coordinates of at most {MAX_COORDINATE:e}"))) }
}

/// Where a camera goes; what is not said stays as it is.
fn end(table: &mut Table<'_>, start: [DVec3; 3]) -> Read<Option<Pose>> {
    let (mut first, mut said) = (None, start);
    for (key, vector) in ["eye_end", "look_at_end", "up_end"].into_iter().zip(&mut said) {
        if let Some(value) = table.get(key) {
            *vector = if key == "eye_end" { place_of(value)? } else { value.vector()? };
            first = first.or(Some(value));
        }
    }
    let (Some(value), [eye, target, up]) = (first, said) else { return Ok(None) };
    let camera = Camera::look_at(eye, target, up, 1.0)
        .ok_or_else(|| value.fault(format!("at time 1 {}", Camera::no_look(NAMES, [eye, target, up]))))?;
    Ok(Some(camera.pose(0.0)))
}

fn projection(table: &mut Table<'_>) -> Read<Projection> {
    let kinds = ["perspective", "orthographic", "equirectangular"].map(|name| (name, name));
    let kind = table.optional("projection", |value| value.choice(&kinds))?.unwrap_or(kinds[0].0);
    if kind != "orthographic" {
        table.refuse(
            "height",
            "is for orthographic cameras alone; write projection = \"orthographic\", or leave it out",
        )?;
    }
    if kind != "perspective" {
        for key in ["fov", "fov_x"] {
            table.refuse(key, "is for perspective cameras alone; leave it out")?;
        }
    }
    match kind {
        "orthographic" => Ok(Projection::Orthographic(extent(table.need("height")?)?)),
        "equirectangular" => Ok(Projection::Equirectangular),
        _ => {
            let vertical = table.optional("fov", angle)?;
            let horizontal = table.optional("fov_x", angle)?;
            Ok(Projection::Perspective(match (horizontal, vertical) {
                (None, vertical) => Fov::Vertical(vertical.unwrap_or(DEFAULT_FOV.to_radians())),
                (Some(horizontal), None) => Fov::Horizontal(horizontal),
                (Some(horizontal), Some(vertical)) => Fov::Both { horizontal, vertical },
            }))
        }
    }
}

/// `lens = { radius, focus, blades }`.
fn lens(value: Value<'_>) -> Read<ThinLens> {
    let mut table = value.table("\"lens\"".to_owned())?;
    let (radius, focus) = (extent(table.need("radius")?)?, extent(table.need("focus")?)?);
    let blades = table.optional("blades", |value| match value.whole(0..=100)? {
        blades @ (1 | 2) => {
            Err(value.fault(format!("{blades} blades shut out all light; 3 or more, or 0 for a round opening")))
        }
        blades => Ok(blades as u32),
    })?;
    let blades = blades.unwrap_or(0);
    table.finish()?;
    Ok(ThinLens { radius, focus, blades })
}

fn length(value: Value<'_>) -> Read<f64> {
    let length = value.number()?;
    if length > 0.0 { Ok(length) } else { Err(value.unlike("a length above 0")) }
}

/// A length that is no larger than coordinates may be.
fn extent(value: Value<'_>) -> Read<f64> {
    let radius = length(value)?;
    let is_held = radius <= MAX_COORDINATE.into();
    if is_held { Ok(radius) } else { Err(value.unlike(&format!("a length of at most {MAX_COORDINATE:e}"))) }
}

/// An angle of view, in radians.
fn angle(value: Value<'_>) -> Read<f64> {
    let degrees = value.number()?;
    let inside = degrees > 0.0 && degrees < 180.0;
    if inside { Ok(degrees.to_radians()) } else { Err(value.unlike("degrees above 0 and below 180")) }
}
