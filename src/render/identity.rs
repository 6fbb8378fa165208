//! What a render is of, in words and digests: two renders with the same have the same bits.
//!
//! Every field of a scene and of the settings is named here, or named as what changes no pixel, so that a field that is
//! added is not forgotten.

use std::fmt::{self, Write};

use twox_hash::XxHash3_128;

use super::{Renderer, Settings};
use crate::image::{Image, Metadata};
use crate::scene::{Environment, Geometry, Instance, Mesh, Pixels, Scene, Texture};

/// What must be the same, each under a name that tells a reader what it is about.
pub(super) fn identity(renderer: &Renderer<'_>, engine: &str) -> Vec<(&'static str, String)> {
    vec![
        ("program", Metadata::default().software),
        ("engine", engine.to_owned()),
        ("settings", settings(&renderer.settings)),
        ("camera", format!("{:?}", renderer.camera)),
        ("scene", format!("{:032x}", scene(renderer.scene))),
    ]
}

/// All that decides a pixel.
fn settings(settings: &Settings) -> String {
    let Settings {
        width,
        height,
        spp,
        seed,
        sampling,
        filter,
        batch: _,
        tile_order: _,
        tile: _,
        background,
        light_samples,
        integrator,
        max_depth,
        crop,
        aovs,
        adaptive,
        complete,
    } = settings;
    let aovs: Vec<_> = aovs.iter().map(ToString::to_string).collect();
    let aovs = aovs.join(" ");
    format!(
        "size {width}x{height}; spp {spp}; seed {seed}; sampler {sampling}; filter {filter}; \
         background {background:?}; light samples {light_samples}; integrator {integrator:?}; depth {max_depth:?}; \
         crop {crop:?}; noise {adaptive:?}; aovs {aovs}; plan {complete:?}"
    )
}

/// Takes what is written into a digest.
struct Digest(XxHash3_128);

impl Write for Digest {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

impl Digest {
    /// Adds the debug form, which tells all numbers apart.
    fn add(&mut self, value: &dyn fmt::Debug) {
        // A digest takes everything.
        let _ = write!(self, "{value:?};");
    }

    /// Adds the elements of a long list.
    fn add_all<T: bytemuck::NoUninit>(&mut self, values: &[T]) {
        self.add(&values.len());
        self.0.write(bytemuck::cast_slice(values));
    }
}

/// The digest of a scene.
fn scene(scene: &Scene) -> u128 {
    let Scene {
        geometries,
        groups,
        instances,
        materials,
        textures,
        lights,
        default_lighting,
        cameras: _,
        ambient,
        environment,
        background,
        fog,
        request: _,
        files: _,
    } = scene;
    let mut digest = Digest(XxHash3_128::new());
    for geometry in geometries {
        match geometry {
            Geometry::Mesh(mesh) => {
                let Mesh { name, origin, positions, normals, uvs, second_uvs, colors, triangles, material } = mesh;
                digest.add(&(name, origin, material));
                digest.add_all(positions);
                digest.add_all(normals);
                digest.add_all(uvs);
                digest.add_all(second_uvs);
                digest.add_all(colors);
                digest.add_all(triangles);
            }
            Geometry::Shapes { shapes, material } => digest.add(&(shapes, material)),
        }
    }
    digest.add(groups);
    for Instance { name, group, transform, transform_end } in instances {
        digest.add(&(name, group));
        digest.add_all(&transform.to_cols_array());
        digest.add_all(&transform_end.map(|end| end.to_cols_array()).unwrap_or_default());
    }
    digest.add(&(materials, lights, default_lighting, ambient, background, fog));
    for Texture { name, width, height, pixels, wrap_u, wrap_v, filter, on_second_uvs, transform } in textures {
        digest.add(&(name, width, height, wrap_u, wrap_v, filter, on_second_uvs, transform));
        match pixels {
            Pixels::Eight(pixels) => digest.add_all(pixels),
            Pixels::Sixteen(pixels) => digest.add_all(pixels),
        }
    }
    if let Some(Environment { image, intensity, rotation }) = environment {
        let Image { width, height, pixels } = &**image;
        digest.add(&(width, height, intensity, rotation));
        digest.add_all(pixels);
    }
    digest.0.finish_128()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DAffine3, DVec3, Vec3};
    use crate::scene::{Fog, Material};

    #[test]
    fn what_shows_changes_the_digest_and_what_does_not_does_not() {
        let whole = || {
            let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
            Scene {
                textures: vec![Texture {
                    width: 1,
                    height: 1,
                    pixels: vec![[1u8, 2, 3, 4]].into(),
                    ..Texture::default()
                }],
                environment: Some(Environment::new(Image::new(2, 1))),
                ..Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()])
            }
        };
        let changes: [fn(&mut Scene); 11] = [
            |s| s.ambient = Vec3::X,
            |s| s.materials[0].ior = 1.25,
            |s| s.textures[0].pixels = vec![[1u8, 2, 9, 4]].into(),
            |s| s.textures[0].pixels = vec![[1u16, 2, 3, 4]].into(),
            |s| s.textures[0].pixels = vec![[1u16, 2, 9, 4]].into(),
            |s| s.instances[0].transform = DAffine3::from_translation(DVec3::X * 1e-300),
            |s| s.instances[0].transform_end = Some(DAffine3::IDENTITY),
            |s| s.background = Some(Vec3::ZERO),
            |s| s.fog = Some(Fog { absorption: Vec3::ONE, color: Vec3::ZERO, reach: 1.0 }),
            |s| s.environment = None,
            |s| {
                if let Geometry::Mesh(mesh) = &mut s.geometries[0] {
                    mesh.normals = vec![Vec3::Z; 3];
                }
            },
        ];
        let mut seen = std::collections::BTreeSet::from([scene(&whole())]);
        for (i, change) in changes.into_iter().enumerate() {
            let mut changed = whole();
            change(&mut changed);
            assert!(seen.insert(scene(&changed)), "change {i}");
        }
        assert!(!seen.insert(scene(&whole())));
    }
}
