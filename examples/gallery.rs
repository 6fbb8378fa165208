//! Makes `scenes/gallery/gallery.glb`, the scene of the README: parametric surfaces in a photographer's cove.
//!
//!     cargo run --release --no-default-features --example gallery -- scenes/gallery/gallery.glb

use std::f64::consts::{PI, TAU};
use std::io::Write as _;

use serde_json::{Value, json};
use twincast::math::{DAffine3, DQuat, DVec3, Vec3};
use twincast::scene::Camera;

fn main() -> std::io::Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "scenes/gallery/gallery.glb".into());
    let mut glb = Glb::default();
    furnish(&mut glb);
    glb.write(&path)
}

/// Everything that stands in the cove.
fn furnish(glb: &mut Glb) {
    let wall = glb.material("wall", [0.78, 0.73, 0.66], 0.0, 0.9);
    let stone = glb.material("stone", [0.55, 0.54, 0.56], 0.0, 0.7);
    let gold = glb.material("gold", [0.95, 0.64, 0.24], 0.35, 0.38);
    let glaze = glb.material("glaze", [0.03, 0.30, 0.36], 0.0, 0.3);
    let shell = glb.material("shell", [1.0, 1.0, 1.0], 0.0, 0.45);
    let plum = glb.material("plum", [0.42, 0.08, 0.22], 0.0, 0.35);

    glb.node("cove", Surface { u: 8, v: 120, ..Surface::default() }, wall, DVec3::ZERO, |u, v| {
        // Down the wall, round the bend of radius 3, forward along the floor.
        let x = 24.0 * (u - 0.5);
        let (along, bend) = (14.0 * v, 3.0 * PI / 2.0);
        if along < 5.0 {
            DVec3::new(x, 8.0 - along, -6.0)
        } else if along < 5.0 + bend {
            let turn = (along - 5.0) / 3.0;
            DVec3::new(x, 3.0 - 3.0 * turn.sin(), -3.0 - 3.0 * turn.cos())
        } else {
            DVec3::new(x, 0.0, -3.0 + (along - 5.0 - bend) * 3.0)
        }
    });

    for (name, x, z, radius, height) in [
        ("left plinth", -2.35, 0.1, 0.85, 0.55),
        ("middle plinth", 0.0, -0.9, 1.0, 0.95),
        ("right plinth", 2.3, 0.2, 0.85, 0.35),
    ] {
        let surface = Surface { u: 96, v: 40, closed_u: true, ..Surface::default() };
        glb.node(name, surface, stone, DVec3::new(x, 0.0, z), |u, v| revolve(u, plinth(v, radius, height)));
    }

    // A (2, 3) torus knot.
    let knot = |t: f64| {
        let r = 2.0 + (3.0 * t).cos();
        DVec3::new(r * (2.0 * t).cos(), r * (2.0 * t).sin(), -(3.0 * t).sin()) * 0.36
    };
    let surface = Surface { u: 48, v: 480, closed_u: true, closed_v: true };
    glb.node("knot", surface, gold, DVec3::new(0.0, 2.13, -0.9), |u, v| tube(&knot, TAU * v, TAU * u, 0.2));

    // A vase with twisted flutes.
    let surface = Surface { u: 240, v: 110, closed_u: true, ..Surface::default() };
    glb.node("vase", surface, glaze, DVec3::new(-2.35, 0.55, 0.1), |u, v| {
        let belly = 0.2 + 0.36 * (PI * (v * 0.92 + 0.05)).sin().powi(2) + 0.16 * (v - 0.72).max(0.0);
        let flute = 1.0 + 0.055 * (14.0 * TAU * u + 5.0 * v).cos() * (PI * v).sin();
        let p = revolve(u, (belly * flute, 1.75 * v));
        DVec3::new(p.x, p.y, p.z)
    });

    // A sea shell (d'Arcy Thompson 1917, On Growth and Form): a circle that grows as it turns.
    let surface = Surface { u: 56, v: 420, closed_u: true, ..Surface::default() };
    let stripes = |_: f64, v: f64| {
        let wave = 0.5 + 0.5 * (34.0 * TAU * v.powf(1.6)).sin();
        Vec3::new(0.93, 0.62, 0.48).lerp(Vec3::new(0.98, 0.93, 0.85), wave as f32)
    };
    glb.colored_node("shell", surface, shell, DVec3::new(2.12, 0.35, 0.15), stripes, |u, v| {
        let turn = TAU * 4.2 * v;
        let size = (0.36 * (turn - TAU * 4.2)).exp();
        let rib = 1.0 + 0.035 * (26.0 * turn).sin();
        let radius = 0.62 * size * rib;
        let out = 0.66 * size + radius * (TAU * u).cos();
        let up = 1.5 * (1.0 - size) + 0.6 + radius * (TAU * u).sin();
        DVec3::new(out * turn.cos(), up, out * turn.sin())
    });

    // A sphere with a slow wave on it.
    let surface = Surface { u: 140, v: 70, closed_u: true, ..Surface::default() };
    glb.node("blob", surface, plum, DVec3::new(-0.95, 0.5, 1.5), |u, v| {
        let (phi, theta) = (TAU * u, PI * (1e-4 + (1.0 - 2e-4) * (1.0 - v)));
        let r = 0.46 * (1.0 + 0.16 * (5.0 * phi).sin() * theta.sin().powi(5) + 0.08 * (4.0 * theta).cos());
        DVec3::new(r * theta.sin() * phi.cos(), r * theta.cos(), r * theta.sin() * phi.sin())
    });

    marbles(glb);
    let spot = json!({"innerConeAngle": 0.22, "outerConeAngle": 0.5});
    let key = json!({"type": "spot", "color": [1.0, 0.92, 0.80], "intensity": 420.0, "spot": spot});
    glb.light("key", key, DVec3::new(-5.0, 8.0, 7.5), DVec3::new(0.1, 0.9, 0.0));
    let fill = json!({"type": "directional", "color": [0.72, 0.84, 1.0], "intensity": 0.6});
    glb.light("fill", fill, DVec3::new(7.0, 5.0, 6.0), DVec3::ZERO);
    let front = json!({"type": "directional", "color": [1.0, 0.95, 0.9], "intensity": 0.28});
    glb.light("front", front, DVec3::new(-1.0, 2.0, 8.0), DVec3::ZERO);
    let rim = json!({"type": "point", "color": [1.0, 0.62, 0.42], "intensity": 16.0});
    glb.light("rim", rim, DVec3::new(5.2, 3.6, -2.0), DVec3::ZERO);
    glb.camera(DVec3::new(0.9, 2.7, 9.4), DVec3::new(0.05, 1.28, 0.0), 31f64.to_radians());
}

/// Glass-coloured marbles, strewn by the golden angle: one mesh a colour, placed many times.
fn marbles(glb: &mut Glb) {
    let colors = [[0.80, 0.16, 0.12], [0.13, 0.32, 0.72], [0.90, 0.68, 0.12], [0.10, 0.48, 0.24]];
    let surface = Surface { u: 48, v: 24, closed_u: true, ..Surface::default() };
    let meshes = colors.map(|color| {
        let material = glb.material("marble", color, 0.0, 0.22);
        glb.mesh("marble", surface, material, None, |u, v| {
            let (phi, theta) = (TAU * u, PI * (1e-4 + (1.0 - 2e-4) * (1.0 - v)));
            DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
        })
    });
    for i in 0..26 {
        let angle = f64::from(i) * PI * (3.0 - 5f64.sqrt());
        let distance = 0.22 * f64::from(i).sqrt();
        let radius = 0.09 + 0.05 * (f64::from(i) * 2.4).sin();
        let place = DVec3::new(0.85 + 1.5 * distance * angle.cos(), radius, 2.1 + distance * angle.sin());
        glb.place("marble", meshes[i as usize % 4], place, radius);
    }
}

/// The point of a surface of revolution about y: `profile` is (radius, height).
fn revolve(u: f64, (radius, height): (f64, f64)) -> DVec3 {
    DVec3::new(radius * (TAU * u).cos(), height, -radius * (TAU * u).sin())
}

/// The profile of a plinth with rounded rims, from the bottom to the middle of the top.
fn plinth(v: f64, radius: f64, height: f64) -> (f64, f64) {
    let rim = 0.06;
    let (side, arc, top) = (height - rim, rim * PI / 2.0, radius - rim);
    let along = v * (side + arc + top);
    if along < side {
        (radius, along)
    } else if along < side + arc {
        let turn = (along - side) / rim;
        (radius - rim + rim * turn.cos(), side + rim * turn.sin())
    } else {
        ((top - (along - side - arc)).max(1e-4), height)
    }
}

/// A point of the tube of the given radius around a closed curve.
fn tube(curve: &dyn Fn(f64) -> DVec3, t: f64, around: f64, radius: f64) -> DVec3 {
    let step = 1e-4;
    let (before, here, after) = (curve(t - step), curve(t), curve(t + step));
    let tangent = (after - before).normalize();
    let normal = (after - here - (here - before)).reject_from(tangent).normalize();
    here + (normal * around.cos() + tangent.cross(normal) * around.sin()) * radius
}

/// The grid a parametric surface over the unit square is sampled on.
#[derive(Clone, Copy, Default)]
struct Surface {
    u: usize,
    v: usize,
    closed_u: bool,
    closed_v: bool,
}

/// A binary glTF file in the making.
#[derive(Default)]
struct Glb {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    lights: Vec<Value>,
    cameras: Vec<Value>,
    nodes: Vec<Value>,
}

impl Glb {
    fn material(&mut self, name: &str, color: [f64; 3], metallic: f64, roughness: f64) -> usize {
        self.materials.push(json!({"name": name, "pbrMetallicRoughness": {
            "baseColorFactor": [color[0], color[1], color[2], 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}}));
        self.materials.len() - 1
    }

    fn node(&mut self, name: &str, grid: Surface, material: usize, at: DVec3, point: impl Fn(f64, f64) -> DVec3) {
        let mesh = self.mesh(name, grid, material, None, point);
        self.place(name, mesh, at, 1.0);
    }

    fn colored_node(
        &mut self,
        name: &str,
        grid: Surface,
        material: usize,
        at: DVec3,
        color: impl Fn(f64, f64) -> Vec3,
        point: impl Fn(f64, f64) -> DVec3,
    ) {
        let mesh = self.mesh(name, grid, material, Some(&color), point);
        self.place(name, mesh, at, 1.0);
    }

    fn place(&mut self, name: &str, mesh: usize, at: DVec3, scale: f64) {
        self.nodes
            .push(json!({"name": name, "mesh": mesh, "translation": at.to_array(), "scale": [scale, scale, scale]}));
    }

    /// Samples a surface, with normals from its derivatives.
    fn mesh(
        &mut self,
        name: &str,
        grid: Surface,
        material: usize,
        color: Option<&dyn Fn(f64, f64) -> Vec3>,
        point: impl Fn(f64, f64) -> DVec3,
    ) -> usize {
        let columns = if grid.closed_u { grid.u } else { grid.u + 1 };
        let rows = if grid.closed_v { grid.v } else { grid.v + 1 };
        let (mut positions, mut normals, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        for j in 0..rows {
            for i in 0..columns {
                let (u, v) = (i as f64 / grid.u as f64, j as f64 / grid.v as f64);
                let h = 1e-5;
                let (low, high) = if grid.closed_v { (v - h, v + h) } else { ((v - h).max(0.0), (v + h).min(1.0)) };
                let (du, dv) = (point(u + h, v) - point(u - h, v), point(u, high) - point(u, low));
                positions.push(point(u, v).as_vec3());
                normals.push(du.cross(dv).normalize_or(DVec3::Y).as_vec3());
                if let Some(color) = color {
                    colors.push(color(u, v));
                }
            }
        }
        let mut indices = Vec::new();
        for j in 0..grid.v {
            for i in 0..grid.u {
                let at = |i: usize, j: usize| ((j % rows) * columns + i % columns) as u32;
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
                indices.extend([a, b, d, a, d, c]);
            }
        }
        let index = self.indices(&indices, positions.len());
        let bounds = (
            positions.iter().copied().fold(Vec3::INFINITY, Vec3::min),
            positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max),
        );
        let position = self.vectors(&positions, Some(bounds));
        let normal = self.vectors(&normals, None);
        let mut attributes = json!({"POSITION": position, "NORMAL": normal});
        if color.is_some() {
            attributes["COLOR_0"] = self.vectors(&colors, None).into();
        }
        self.meshes.push(
            json!({"name": name, "primitives": [{"attributes": attributes, "indices": index, "material": material}]}),
        );
        self.meshes.len() - 1
    }

    fn indices(&mut self, indices: &[u32], vertices: usize) -> usize {
        let (bytes, kind): (Vec<u8>, u32) = if vertices <= usize::from(u16::MAX) {
            (indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect(), 5123)
        } else {
            (indices.iter().flat_map(|&i| i.to_le_bytes()).collect(), 5125)
        };
        self.accessor(&bytes, 34963, json!({"componentType": kind, "count": indices.len(), "type": "SCALAR"}))
    }

    fn vectors(&mut self, vectors: &[Vec3], bounds: Option<(Vec3, Vec3)>) -> usize {
        let bytes: Vec<u8> = vectors.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes).collect();
        let mut description = json!({"componentType": 5126, "count": vectors.len(), "type": "VEC3"});
        if let Some((min, max)) = bounds {
            description["min"] = json!(min.to_array());
            description["max"] = json!(max.to_array());
        }
        self.accessor(&bytes, 34962, description)
    }

    fn accessor(&mut self, bytes: &[u8], target: u32, mut description: Value) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views
            .push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target}));
        self.bytes.extend_from_slice(bytes);
        description["bufferView"] = json!(self.views.len() - 1);
        self.accessors.push(description);
        self.accessors.len() - 1
    }

    fn light(&mut self, name: &str, mut light: Value, at: DVec3, target: DVec3) {
        light["name"] = json!(name);
        self.lights.push(light);
        let light = self.lights.len() - 1;
        let mut node = posed(name, at, target);
        node["extensions"] = json!({"KHR_lights_punctual": {"light": light}});
        self.nodes.push(node);
    }

    fn camera(&mut self, at: DVec3, target: DVec3, fov_y: f64) {
        self.cameras.push(json!({"type": "perspective", "perspective": {"yfov": fov_y, "znear": 0.1}}));
        let mut node = posed("camera", at, target);
        node["camera"] = json!(self.cameras.len() - 1);
        self.nodes.push(node);
    }

    fn write(mut self, path: &str) -> std::io::Result<()> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let document = json!({
            "asset": {"version": "2.0", "generator": "twincast, examples/gallery.rs"},
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {"KHR_lights_punctual": {"lights": self.lights}},
            "scene": 0, "scenes": [{"nodes": (0..self.nodes.len()).collect::<Vec<_>>()}],
            "nodes": self.nodes, "meshes": self.meshes, "materials": self.materials, "cameras": self.cameras,
            "accessors": self.accessors, "bufferViews": self.views, "buffers": [{"byteLength": self.bytes.len()}],
        });
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
        let length = 12 + 8 + text.len() + 8 + self.bytes.len();
        for word in [0x4654_6c67, 2, length as u32, text.len() as u32, 0x4e4f_534a] {
            file.write_all(&u32::to_le_bytes(word))?;
        }
        file.write_all(&text)?;
        for word in [self.bytes.len() as u32, 0x004e_4942] {
            file.write_all(&u32::to_le_bytes(word))?;
        }
        file.write_all(&self.bytes)?;
        file.flush()
    }
}

/// A node that stands at a point and looks, along its -z, at another.
fn posed(name: &str, at: DVec3, target: DVec3) -> Value {
    let view = Camera::look_at(at, target, DVec3::Y, 1.0).expect("nothing looks straight down");
    let pose = DAffine3::from_rotation_translation(DQuat::from_mat3(&view.frame), at);
    let (_, rotation, translation) = pose.to_scale_rotation_translation();
    json!({"name": name, "rotation": rotation.to_array(), "translation": translation.to_array()})
}
