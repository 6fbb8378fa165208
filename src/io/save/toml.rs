//! Twincast's own format, as docs/SCENES.md describes it. Groups that are placed more than once, or moved, are written
//! as groups; the others at the top of the file.

use std::collections::HashSet;
use std::io::{self, Write};

use super::{Unsayable, check_finite, is_colored};
use crate::image::Curve;
use crate::math::{DAffine3, DVec2, DVec3, Mat3, UVec3, Vec3};
use crate::scene::{
    Absorption, Accel, Alpha, AreaShape, Attenuation, Camera, DefaultLighting, Distortion, Fog, Fov, Geometry,
    Interface, Light, Material, Mesh, Projection, Request, Resolution, Scene, Specular, ThinLens,
};
use crate::shape::{Shape, Sphere, SphereMethod, TriangleMethod};

/// Whether the format has words for all of it: pictures are files of their own, and colours of vertices belong in
/// meshes.
pub(super) fn check(scene: &Scene) -> Result<(), Unsayable> {
    check_finite(scene)?;
    if scene.environment.is_some() {
        return Err("environments are not written; name the picture's file in [environment]".to_owned());
    }
    if !scene.textures.is_empty() || is_colored(scene) {
        return Err("textures and colours of vertices are not written; include the file they are in".to_owned());
    }
    Ok(())
}

pub(super) fn write(scene: &Scene, out: &mut dyn Write) -> io::Result<()> {
    render(scene, out)?;
    for (i, camera) in scene.cameras.iter().enumerate() {
        // Names tell cameras apart, and the first of a name is the one that is meant by it.
        let is_known = scene.cameras[..i].iter().any(|before| before.name == camera.name);
        write_camera(camera, if is_known { "" } else { &camera.name }, out)?;
    }
    for light in &scene.lights {
        write_light(light, out)?;
    }
    if let Some(Fog { absorption, color, reach }) = &scene.fog {
        writeln!(out, "[fog]\nabsorption = {}\ncolor = {}", list(*absorption), list(*color))?;
        if reach.is_finite() {
            writeln!(out, "reach = {reach}")?;
        }
        writeln!(out)?;
    }
    let names = names(&scene.materials);
    for (material, name) in scene.materials.iter().zip(&names) {
        write_material(material, name, out)?;
    }
    // At the top of the file things are placed once, as they are.
    let mut uses = vec![0; scene.groups.len()];
    for instance in &scene.instances {
        // One that moves its group counts as several.
        let stays = instance.transform == DAffine3::IDENTITY && instance.transform_end.is_none();
        uses[instance.group as usize] += if stays { 1 } else { 2 };
    }
    let tops: Vec<bool> = uses.into_iter().map(|uses| uses == 1).collect();
    for (group, &top) in (0..).zip(&tops) {
        let prefix = if top { String::new() } else { format!("group.g{group}.") };
        for (_, geometry) in scene.group_geometries(group) {
            match geometry {
                Geometry::Mesh(mesh) => write_mesh(mesh, &prefix, &names[mesh.material as usize], out)?,
                Geometry::Shapes { shapes, material } => {
                    for shape in shapes {
                        write_shape(shape, &prefix, out)?;
                        writeln!(out, "material = {}\n", quoted(&names[*material as usize]))?;
                    }
                }
            }
        }
    }
    for instance in scene.instances.iter().filter(|instance| !tops[instance.group as usize]) {
        writeln!(out, "[[instance]]\ngroup = \"g{}\"\nname = {}", instance.group, quoted(&instance.name))?;
        writeln!(out, "transform = {}", matrix(&instance.transform))?;
        if let Some(end) = &instance.transform_end {
            writeln!(out, "transform_end = {}", matrix(end))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// What materials are called: by their own names where these tell them apart.
fn names(materials: &[Material]) -> Vec<String> {
    let mut taken: HashSet<&str> = HashSet::new();
    let own: Vec<bool> = materials.iter().map(|m| !m.name.is_empty() && taken.insert(&m.name)).collect();
    let numbered = |i: usize| {
        let mut name = format!("m{i}");
        while taken.contains(&*name) {
            name.push('_');
        }
        name
    };
    let name = |(i, is_own): (usize, bool)| if is_own { materials[i].name.clone() } else { numbered(i) };
    own.into_iter().enumerate().map(name).collect()
}

/// A transform as one step, by rows.
fn matrix(transform: &DAffine3) -> String {
    let rows = [0, 1, 2].map(|i| {
        let row = transform.matrix3.row(i);
        format!("[{}, {}, {}, {}]", row.x, row.y, row.z, transform.translation[i])
    });
    format!("{{ matrix = [{}] }}", rows.join(", "))
}

/// A text in quotes, as TOML has them.
fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted += &format!("\\u{:04X}", u32::from(c)),
            c => quoted.push(c),
        }
    }
    quoted + "\""
}

/// A vector as a list.
fn list(v: Vec3) -> String {
    format!("[{}, {}, {}]", v.x, v.y, v.z)
}

fn list_f64(v: DVec3) -> String {
    format!("[{}, {}, {}]", v.x, v.y, v.z)
}

fn lists<T>(items: &[T], list: impl Fn(&T) -> String) -> String {
    format!("[{}]", items.iter().map(list).collect::<Vec<_>>().join(", "))
}

fn render(scene: &Scene, out: &mut dyn Write) -> io::Result<()> {
    let Request { size, spp, seed, integrator, max_depth, output, exposure, white_balance, response, search } =
        &scene.request;
    writeln!(out, "[render]")?;
    if let Some([width, height]) = size {
        writeln!(out, "size = [{width}, {height}]")?;
    }
    let numbers = [("spp", spp.map(u64::from)), ("seed", *seed), ("max_depth", max_depth.map(u64::from))];
    for (key, number) in numbers.into_iter().filter_map(|(key, number)| Some((key, number?))) {
        writeln!(out, "{key} = {number}")?;
    }
    if let Some(integrator) = integrator {
        writeln!(out, "integrator = \"{integrator}\"")?;
    }
    if let Some(output) = output {
        writeln!(out, "output = {}", quoted(output))?;
    }
    for (key, number) in [("exposure", exposure), ("white_balance", white_balance)] {
        if let Some(number) = number {
            writeln!(out, "{key} = {number}")?;
        }
    }
    let names = [
        ("response", response.map(Curve::name)),
        ("accel", search.accel.map(Accel::name)),
        ("triangle_method", search.triangle_method.map(TriangleMethod::name)),
        ("sphere_method", search.sphere_method.map(SphereMethod::name)),
    ];
    for (key, name) in names.into_iter().filter_map(|(key, name)| Some((key, name?))) {
        writeln!(out, "{key} = \"{name}\"")?;
    }
    match search.grid {
        Some(Resolution::Longest(cells)) => writeln!(out, "grid = {cells}")?,
        Some(Resolution::Axes(UVec3 { x, y, z })) => writeln!(out, "grid = [{x}, {y}, {z}]")?,
        None => {}
    }
    if scene.default_lighting == DefaultLighting::None {
        writeln!(out, "headlight = false")?;
    }
    if let Some(background) = scene.background {
        writeln!(out, "background = {}", list(background))?;
    }
    writeln!(out, "ambient = {}\n", list(scene.ambient))
}

fn write_camera(camera: &Camera, name: &str, out: &mut dyn Write) -> io::Result<()> {
    let Camera { name: _, eye, frame, end, projection, shift, lens, distortion, shutter } = camera;
    writeln!(out, "[[camera]]\nname = {}\neye = {}", quoted(name), list_f64(*eye))?;
    let (at, up) = (camera.pose(0.0).target(1.0), frame.y_axis);
    writeln!(out, "look_at = {}\nup = {}", list_f64(at), list_f64(up))?;
    if let Some(end) = end {
        writeln!(out, "eye_end = {}\nlook_at_end = {}", list_f64(end.eye), list_f64(end.target(1.0)))?;
        writeln!(out, "up_end = {}", list_f64(end.frame.y_axis))?;
    }
    match projection {
        Projection::Perspective(Fov::Vertical(vertical)) => writeln!(out, "fov = {}", vertical.to_degrees())?,
        Projection::Perspective(Fov::Horizontal(horizontal)) => writeln!(out, "fov_x = {}", horizontal.to_degrees())?,
        Projection::Perspective(Fov::Both { horizontal, vertical }) => {
            writeln!(out, "fov_x = {}\nfov = {}", horizontal.to_degrees(), vertical.to_degrees())?;
        }
        Projection::Orthographic(height) => writeln!(out, "projection = \"orthographic\"\nheight = {height}")?,
        Projection::Equirectangular => writeln!(out, "projection = \"equirectangular\"")?,
    }
    if let Some(ThinLens { radius, focus, blades }) = lens {
        writeln!(out, "lens = {{ radius = {radius}, focus = {focus}, blades = {blades} }}")?;
    }
    if let Some(Distortion { k1, k2, k3, p1, p2 }) = distortion {
        writeln!(out, "distortion = [{k1}, {k2}, {k3}, {p1}, {p2}]")?;
    }
    if *shutter != [0.0, 1.0] {
        let [open, close] = shutter;
        writeln!(out, "shutter = [{open}, {close}]")?;
    }
    if *shift != DVec2::ZERO && *projection != Projection::Equirectangular {
        writeln!(out, "shift = [{}, {}]", shift.x, shift.y)?;
    }
    writeln!(out)
}

fn write_light(light: &Light, out: &mut dyn Write) -> io::Result<()> {
    let place = |out: &mut dyn Write, position: DVec3, attenuation: Attenuation, range: f64| {
        writeln!(out, "position = {}", list_f64(position))?;
        let Attenuation { constant, linear, quadratic } = attenuation;
        writeln!(out, "attenuation = [{constant}, {linear}, {quadratic}]")?;
        if range.is_finite() { writeln!(out, "range = {range}") } else { Ok(()) }
    };
    match light {
        Light::Directional { direction, color } => {
            writeln!(out, "[[light]]\ntype = \"directional\"\ncolor = {}", list(*color))?;
            writeln!(out, "direction = {}", list_f64(*direction))?;
        }
        Light::Point { position, color, attenuation, range, radius } => {
            writeln!(out, "[[light]]\ntype = \"point\"\ncolor = {}", list(*color))?;
            place(out, *position, *attenuation, *range)?;
            writeln!(out, "radius = {radius}")?;
        }
        Light::Area { shape, radiance } => {
            let (kind, keys) = match shape {
                AreaShape::Rectangle { centre, half_edges: [a, b] } => {
                    let (centre, a, b) = (list_f64(*centre), list_f64(*a), list_f64(*b));
                    ("rectangle", format!("position = {centre}\nhalf_edges = [{a}, {b}]"))
                }
                AreaShape::Disk { centre, normal, radius } => {
                    let (centre, normal) = (list_f64(*centre), list_f64(*normal));
                    ("disk", format!("position = {centre}\ndirection = {normal}\nradius = {radius}"))
                }
                AreaShape::Sphere { centre, radius } => {
                    ("sphere", format!("position = {}\nradius = {radius}", list_f64(*centre)))
                }
            };
            writeln!(out, "[[light]]\ntype = \"{kind}\"\nradiance = {}\n{keys}", list(*radiance))?;
        }
        Light::Spot { position, direction, color, attenuation, range, inner_angle, outer_angle } => {
            writeln!(out, "[[light]]\ntype = \"spot\"\ncolor = {}", list(*color))?;
            place(out, *position, *attenuation, *range)?;
            writeln!(out, "direction = {}", list_f64(*direction))?;
            writeln!(out, "inner_angle = {}", inner_angle.to_degrees())?;
            writeln!(out, "outer_angle = {}", outer_angle.to_degrees())?;
        }
    }
    writeln!(out)
}

fn write_material(material: &Material, name: &str, out: &mut dyn Write) -> io::Result<()> {
    let is_bare = !name.is_empty() && name.bytes().all(|c| c.is_ascii_alphanumeric() || b"_-".contains(&c));
    writeln!(out, "[material.{}]", if is_bare { name.to_owned() } else { quoted(name) })?;
    if material.unlit {
        let Material { diffuse, emission, .. } = material;
        writeln!(out, "type = \"unlit\"\ndiffuse = {}\nemission = {}", list(*diffuse), list(*emission))?;
    } else {
        write_lit(material, out)?;
    }
    match material.alpha {
        Alpha::Opaque => {}
        Alpha::Mask { cutoff } => {
            writeln!(out, "alpha = \"mask\"\nalpha_cutoff = {cutoff}\nopacity = {}", material.opacity)?
        }
        Alpha::Blend => writeln!(out, "alpha = \"blend\"\nopacity = {}", material.opacity)?,
    }
    if !material.unlit {
        writeln!(out, "energy_conserving = {}", material.energy_conserving)?;
    }
    writeln!(out)
}

/// What a surface has on which light falls.
fn write_lit(material: &Material, out: &mut dyn Write) -> io::Result<()> {
    // All are named, so that whoever adds one decides here what becomes of it.
    let Material {
        ambient,
        diffuse,
        specular,
        shininess,
        model,
        reflection,
        transmission,
        ior,
        interface,
        absorption,
        gloss,
        emission,
        // Of every surface.
        name: _,
        unlit: _,
        energy_conserving: _,
        alpha: _,
        opacity: _,
        // Scenes with textures are refused, and without these the rest says what a physical surface looks like.
        diffuse_texture: _,
        emission_texture: _,
        normal_texture: _,
        normal_scale: _,
        physical: _,
    } = material;
    writeln!(out, "ambient = {}\ndiffuse = {}", list(*ambient), list(*diffuse))?;
    writeln!(out, "specular = {}\nshininess = {shininess}", list(*specular))?;
    let model = match model {
        Specular::Phong => "phong",
        Specular::BlinnPhong => "blinn-phong",
    };
    writeln!(out, "model = \"{model}\"\nreflection = {}", list(*reflection))?;
    writeln!(out, "transmission = {}\nior = {ior}\nemission = {}", list(*transmission), list(*emission))?;
    match interface {
        Interface::Shares => {}
        Interface::Fresnel => writeln!(out, "type = \"glass\"")?,
        Interface::Thin => writeln!(out, "type = \"glass\"\nthin = true")?,
    }
    let has_inside = *transmission != Vec3::ZERO && *interface != Interface::Thin;
    if let Some(Absorption { color, distance }) = absorption.filter(|_| has_inside) {
        writeln!(out, "attenuation_color = {}\nattenuation_distance = {distance}", list(color))?;
    }
    // Of what sends nothing on nothing is seen of it, and it is refused.
    if let Some(gloss) = gloss.filter(|_| material.sends_on()) {
        writeln!(out, "gloss = {gloss}")?;
    }
    Ok(())
}

fn write_mesh(mesh: &Mesh, prefix: &str, material: &str, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "[[{prefix}mesh]]\nname = {}\nmaterial = {}", quoted(&mesh.name), quoted(material))?;
    // One item a line: a mesh in one line is more than editors take.
    fn column<T>(out: &mut dyn Write, key: &str, items: &[T], line: impl Fn(&T) -> String) -> io::Result<()> {
        writeln!(out, "{key} = [")?;
        items.iter().try_for_each(|item| writeln!(out, "    {},", line(item)))?;
        writeln!(out, "]")
    }
    column(out, "positions", &mesh.positions, |&p| list_f64(mesh.point(p)))?;
    column(out, "triangles", &mesh.triangles, |[a, b, c]| format!("[{a}, {b}, {c}]"))?;
    if !mesh.normals.is_empty() {
        column(out, "normals", &mesh.normals, |n| list(*n))?;
    }
    if !mesh.uvs.is_empty() {
        column(out, "uvs", &mesh.uvs, |uv| format!("[{}, {}]", uv.x, uv.y))?;
    }
    writeln!(out)
}

/// The table of a shape, all but its material.
fn write_shape(shape: &Shape, prefix: &str, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "[[{prefix}{}]]", shape.name())?;
    match shape {
        Shape::Sphere(Sphere { centre, radius }) => writeln!(out, "centre = {}\nradius = {radius}", list(*centre)),
        Shape::Plane(plane) => writeln!(out, "point = {}\nnormal = {}", list(plane.point), list(plane.normal)),
        Shape::Disk(disk) => {
            writeln!(out, "centre = {}\nnormal = {}\nradius = {}", list(disk.centre), list(disk.normal), disk.radius)
        }
        Shape::Cuboid(cuboid) => writeln!(out, "min = {}\nmax = {}", list(cuboid.min), list(cuboid.max)),
        Shape::Cylinder(c) => {
            writeln!(out, "base = {}\napex = {}\nradius = {}", list(c.base), list(c.apex), c.radius)?;
            writeln!(out, "capped = {}", c.capped)
        }
        Shape::Cone(c) => {
            writeln!(out, "base = {}\nbase_radius = {}", list(c.base), c.base_radius)?;
            writeln!(out, "apex = {}\napex_radius = {}\ncapped = {}", list(c.apex), c.apex_radius, c.capped)
        }
        Shape::Ellipsoid(ellipsoid) => {
            let Mat3 { x_axis, y_axis, z_axis } = ellipsoid.axes;
            let axes = lists(&[x_axis, y_axis, z_axis], |axis| list(*axis));
            writeln!(out, "centre = {}\naxes = {axes}", list(ellipsoid.centre))
        }
        Shape::Polygon(polygon) => writeln!(out, "corners = {}", lists(polygon.corners(), |p| list(*p))),
    }
}
