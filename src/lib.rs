//! Twincast casts rays with two engines that know nothing of each other: Intel's Embree, and a native BVH.
//!
//! Data flows one way: [`io`] reads a file into a [`Scene`], [`World`] makes it ready for tracing, a
//! [`Tracer`] answers [`Hit`]s, [`Renderer`] turns them into an [`Image`].
//!
//! ```
//! use twincast::math::{DVec3, Vec3};
//! use twincast::scene::{Camera, Geometry, Material, Mesh};
//! use twincast::shade::{Attributes, SurfacePoint};
//! use twincast::trace::bvh::Bvh;
//! use twincast::{Renderer, Scene, Settings, Tracer, World};
//!
//! let triangle = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
//! let scene = Scene::from_geometries(vec![Geometry::Mesh(triangle)], vec![Material::default()]);
//! let world = World::new(&scene)?;
//! let bvh = Bvh::build(&world);
//!
//! // Tracers know the scene recentred, so rays are made by the world, not by `Ray::new` alone.
//! let ray = world.ray(DVec3::new(0.25, 0.5, 2.0), Vec3::NEG_Z);
//! let hit = bvh.closest(&ray).expect("it passes inside");
//! assert_eq!((hit.t, hit.u, hit.v), (2.0, 0.25, 0.5));
//! // The rest is computed for who wants it: position, normals, uvs, colour.
//! let surface = SurfacePoint::new(&scene, &world, &ray, &hit, Attributes::ALL);
//! assert_eq!(world.to_scene(surface.position), DVec3::new(0.25, 0.5, 0.0));
//!
//! let camera = Camera::look_at(DVec3::new(0.3, 0.3, 2.0), DVec3::new(0.3, 0.3, 0.0), DVec3::Y, 1.0).expect("not upwards");
//! let settings = Settings { width: 64, height: 64, ..Settings::default() };
//! let image = Renderer::new(&scene, &world, camera, settings)?.render(&bvh, Default::default())?;
//! assert_eq!(image.pixels[32 * 64 + 32].w, 1.0, "the middle is covered");
//! # let folder = tempfile::tempdir().expect("a folder");
//! # let picture = folder.path().join("triangle.png");
//! twincast::image::write(&picture, &image, &Default::default(), &Default::default())?;
//! # Ok::<(), twincast::Error>(())
//! ```
#![deny(unsafe_code)]
#![warn(missing_docs)]

#[doc(hidden)]
pub mod cli;
pub mod image;
pub mod io;
pub mod lab;
pub mod render;
pub mod trace;

pub use image::Image;
pub use render::{Control, Renderer, Settings};
#[doc(inline)]
pub use twincast_core::{
    Batch, Cone, Cuboid, Cylinder, Disk, Ellipsoid, Error, Hit, InvalidShape, Plane, Polygon, Ray, Result, Scene,
    Shape, ShapeHit, Sphere, SphereMethod, Tracer, TriangleHit, TriangleMethod, Warning, Width, World, math, output,
    plan, scene, shade,
};
use twincast_core::{error, memory, ray, shape};

/// The README's example runs as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
