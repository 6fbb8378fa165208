//! Writes the terrain that the figures of `docs/PERFORMANCE.md` are about as a file: `cargo run --release --example
//! terrain -- 3162 terrain.ply` for 20 million triangles. The suffix decides the format: .ply and .stl binary, .glb,
//! .obj.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use twincast::scene::{Mesh, terrain};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [n, path] = &arguments[..] else { return Err("usage: terrain N FILE, for 2 N^2 triangles".into()) };
    let (path, mesh) = (Path::new(path), terrain(n.parse()?));
    let mut out = BufWriter::with_capacity(1 << 20, File::create(path)?);
    match path.extension().and_then(|suffix| suffix.to_str()) {
        Some("ply") => ply(&mesh, &mut out)?,
        Some("stl") => stl(&mesh, &mut out)?,
        Some("glb") => glb(&mesh, &mut out)?,
        Some("obj") => obj(&mesh, &mut out)?,
        _ => return Err("the file has to end in .ply, .stl, .glb or .obj".into()),
    }
    Ok(out.flush()?)
}

fn ply(mesh: &Mesh, out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.len())?;
    write!(out, "property float x\nproperty float y\nproperty float z\nelement face {}\n", mesh.triangles.len())?;
    out.write_all(b"property list uchar int vertex_indices\nend_header\n")?;
    positions(mesh, out)?;
    for corners in mesh.triangles.iter() {
        out.write_all(&[3])?;
        out.write_all(&words(corners))?;
    }
    Ok(())
}

fn stl(mesh: &Mesh, out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    out.write_all(&[0; 80])?;
    out.write_all(&u32::try_from(mesh.triangles.len())?.to_le_bytes())?;
    for corners in mesh.triangles.iter() {
        // Facet normals may be zero: readers take them from the corners.
        out.write_all(&[0; 12])?;
        for &i in corners {
            out.write_all(&words(&mesh.positions[i as usize].to_array().map(f32::to_bits)))?;
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}

fn glb(mesh: &Mesh, out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    let (points, triangles) = (mesh.positions.len(), mesh.triangles.len());
    let (first, second) = (12 * points, 12 * triangles);
    let views =
        format!(r#"[{{"buffer":0,"byteLength":{first}}},{{"buffer":0,"byteOffset":{first},"byteLength":{second}}}]"#);
    let accessors =
        format!(
            r#"[{{"bufferView":0,"componentType":5126,"count":{points},"type":"VEC3","min":[0,-1,0],"max":[1,1,1]}},"#
        ) + &format!(r#"{{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}]"#, 3 * triangles);
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],"bufferViews":{views},"accessors":{accessors},"#,
        first + second
    ) + r#""meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"nodes":[{"mesh":0}],"#
        + r#""scenes":[{"nodes":[0]}],"scene":0}"#;
    json += &" ".repeat(json.len().next_multiple_of(4) - json.len());
    let whole = u32::try_from(12 + 8 + json.len() + 8 + first + second)?;
    out.write_all(b"glTF")?;
    out.write_all(&words(&[2, whole, u32::try_from(json.len())?]))?;
    write!(out, "JSON{json}")?;
    out.write_all(&u32::try_from(first + second)?.to_le_bytes())?;
    out.write_all(b"BIN\0")?;
    positions(mesh, out)?;
    for corners in mesh.triangles.iter() {
        out.write_all(&words(corners))?;
    }
    Ok(())
}

fn obj(mesh: &Mesh, out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    for p in mesh.positions.iter() {
        writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for corners in mesh.triangles.iter() {
        let [a, b, c] = corners.map(|i| i + 1);
        writeln!(out, "f {a} {b} {c}")?;
    }
    Ok(())
}

fn positions(mesh: &Mesh, out: &mut impl Write) -> std::io::Result<()> {
    mesh.positions.iter().try_for_each(|p| out.write_all(&words(&p.to_array().map(f32::to_bits))))
}

/// Three words in the byte order of all these formats.
fn words(words: &[u32; 3]) -> [u8; 12] {
    std::array::from_fn(|i| words[i / 4].to_le_bytes()[i % 4])
}
