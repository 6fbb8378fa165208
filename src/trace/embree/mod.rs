//! Intel Embree (Wald, Woop, Benthin, Johnson, Ernst 2014, *Embree: a kernel framework for efficient CPU ray tracing*).
//!
//! [`Embree`] is the engine; below it, `device` owns what every scene shares, `scene` builds and commits, `single` and
//! `packet` lay rays out as Embree wants them, `lanes` turns four about, and `query` asks; `sah` measures the trees
//! that Embree's `builder` makes. Versions 3.13 and 4 are served by one source: the bindings are made from the header
//! that is installed, and the two layouts of a hit are told apart by their size alone.
//!
//! A scene under construction and a committed one are different types, so that a query on an uncommitted scene, which
//! Embree leaves undefined, does not compile. The simpler design, one type with a flag, would have cost a test and an
//! error path a ray.
//!
//! Embree's answers are passed on as they are. They bend the conventions of [`trace`](super) a little: t is not
//! correctly rounded, so a hit at exactly `tmin` or `tmax` may be missed, and at equal t any of the primitives may be
//! named. A ray with a coordinate beyond 1.8e18, which Embree refuses, misses.

mod builder;
mod device;
mod lanes;
mod packet;
mod query;
mod reach;
mod sah;
mod scene;
mod single;
mod sys;

use std::cell::Cell;
use std::slice;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::ray::{Hit, Ray};
use crate::shape::distance::Distance;
use crate::trace::accel::Accelerator;
use crate::trace::nearest::Nearest;
use crate::trace::unbounded::Unbounded;
use crate::trace::{Batch, Part, Primitives, Tracer, Width, World};
use device::Device;
use packet::{Active, Packet, RayHits, Rays, Recent};
use query::{Mode, PacketQuery, Packets};
use reach::Reach;
use scene::{Scene, SceneBuilder};
use single::{SingleRay, SingleRayHit};

pub use sah::sah_cost;
pub use sys::VERSION;

/// How Embree builds and what it may trade.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How much time the build may take.
    pub quality: Quality,
    /// Do not let rays slip between neighbouring triangles (`RTC_SCENE_FLAG_ROBUST`). Slower; `quality` beyond medium
    /// then has no effect.
    pub robust: bool,
    /// Save memory rather than time (`RTC_SCENE_FLAG_COMPACT`); `quality` beyond medium then has no effect.
    pub compact: bool,
    /// Threads that build; one for every processor by default. Queries run on the thread that asks.
    pub threads: Option<usize>,
    /// Which instructions it may use, to compare like with like.
    pub instructions: Instructions,
}

/// Which instructions Embree may use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instructions {
    /// The best that it finds.
    #[default]
    All,
    /// None beyond AVX2.
    Avx2,
    /// None beyond SSE2, which every x86-64 has.
    Sse2,
}

impl Default for Options {
    fn default() -> Self {
        Self { quality: Quality::Medium, robust: true, compact: false, threads: None, instructions: Instructions::All }
    }
}

/// How good a tree the build makes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quality {
    /// Fast to build: sorted along a space-filling curve.
    Low,
    /// Binned surface area heuristic.
    #[default]
    Medium,
    /// With spatial splits.
    High,
}

/// A world in Embree's hands.
pub struct Embree {
    scene: Scene,
    /// Who the geometries of Embree's scenes are: first the fixed parts, then those of the objects.
    parts: Vec<PartIds>,
    fixed: usize,
    placements: Vec<PlacementIds>,
    reach: Reach,
    unbounded: Unbounded,
    build_time: Duration,
    mesh_bytes: usize,
    untold_bytes: usize,
    device: Arc<Device>,
}

#[derive(Clone, Copy)]
struct PartIds {
    geometry: u32,
    instance: u32,
}

#[derive(Clone, Copy)]
struct PlacementIds {
    first_part: usize,
    instance: u32,
}

impl Embree {
    /// Hands `world` to Embree and builds its trees. Embree keeps copies of the triangles, not of the shapes.
    ///
    /// # Errors
    /// [`Error::Backend`] for a triangle with an index past the vertices, for more primitives than 32 bits count, as
    /// [`Embree::check`] does, and for everything that Embree reports (out of memory, an unsupported processor);
    /// [`Error::Unavailable`] where the library that was loaded lays out its hits in another way than the header that
    /// this build was made with.
    pub fn new(world: &World, options: &Options) -> Result<Self> {
        let device = Device::new(options.threads, options.instructions)?;
        let build = |parts: &[Part]| -> Result<SceneBuilder> {
            let mut builder = SceneBuilder::new(&device, options)?;
            for (id, part) in parts.iter().enumerate() {
                add_part(&mut builder, id, part)?;
            }
            Ok(builder)
        };
        let build_time = Cell::new(Duration::ZERO);
        let commit = |builder: SceneBuilder| timed(&build_time, || builder.commit());
        let objects = world.objects.iter().map(|parts| Ok(Arc::new(commit(build(&world.parts[parts.clone()])?)?)));
        let objects = objects.collect::<Result<Vec<_>>>()?;
        let fixed = &world.parts[world.fixed.clone()];
        let mut builder = build(fixed)?;
        // Now that it is known that indices are.
        let reach = Reach::of(world)?;
        // Embree's own work as well, and there is nothing to copy for it.
        let place = || {
            timed(&build_time, || {
                world.placements.iter().enumerate().try_for_each(|(i, placement)| {
                    let (object, end) =
                        (&objects[placement.object as usize], placement.motion.as_ref().map(|m| &m.end));
                    builder.add_instance(id(fixed.len() + i)?, object, &placement.to_world, end)
                })
            })
        };
        let (placed, untold_bytes) = device.untold_bytes(place);
        placed?;
        let part_ids = |part: &Part| PartIds { geometry: part.geometry, instance: part.instance };
        let placements = world.placements.iter().map(|placement| PlacementIds {
            first_part: world.objects[placement.object as usize].start,
            instance: placement.instance,
        });
        Ok(Self {
            scene: commit(builder)?,
            parts: world.parts.iter().map(part_ids).collect(),
            fixed: fixed.len(),
            placements: placements.collect(),
            reach,
            unbounded: Unbounded::new(world),
            build_time: build_time.get(),
            untold_bytes,
            mesh_bytes: world.parts.iter().map(|part| mesh_bytes(&part.primitives)).sum(),
            device,
        })
    }

    /// Whether its numbers suffice for a world.
    ///
    /// # Errors
    /// [`Error::Backend`] for an object that is placed by a transform which f32 cannot invert (scaled by 1e-13, say).
    pub fn check(world: &World) -> Result<()> {
        Reach::of(world).map(drop)
    }

    /// Bytes that Embree holds for this world: trees, placements and copies of the triangles.
    ///
    /// Of placements Embree's memory monitor tells nothing but what their tree takes. Their transforms, and what else
    /// an instance is (278 to 308 bytes in 3.13), are counted by what the C library's allocator hands out meanwhile, to
    /// whichever thread; where that is not glibc's they are left out.
    pub fn bytes(&self) -> usize {
        self.device.bytes() + self.untold_bytes
    }

    /// The same without the copies of vertices and indices.
    pub fn tree_bytes(&self) -> usize {
        self.bytes().saturating_sub(self.mesh_bytes)
    }

    /// How long Embree built: its trees and its instances, without the copies of the triangles made for it.
    pub fn build_time(&self) -> Duration {
        self.build_time
    }

    /// The version of the library that was loaded, as in `4.3.0`.
    pub fn version(&self) -> String {
        self.device.version()
    }

    /// Embree's ids turned into the scene's.
    #[inline(always)]
    fn ids(&self, geometry: u32, instance: Option<u32>) -> PartIds {
        match instance {
            None => self.parts[geometry as usize],
            Some(instance) => self.placed(geometry, instance),
        }
    }

    /// The ids of a geometry in a placed object; a call, so that scenes without any keep their registers.
    #[inline(never)]
    fn placed(&self, geometry: u32, instance: u32) -> PartIds {
        let placement = self.placements[instance as usize - self.fixed];
        PartIds { instance: placement.instance, ..self.parts[placement.first_part + geometry as usize] }
    }

    /// The nearest of `hit` and of what the ray hits that has no bounds, which Embree cannot hold.
    #[inline(never)]
    fn beyond_bounds(&self, ray: &Ray, hit: Option<Hit>) -> Option<Hit> {
        let mut nearest = Nearest::new(ray);
        if let Some(hit) = hit {
            nearest.offer(ray, Distance::itself(hit.t.into()), hit);
        }
        self.unbounded.offer(ray, &mut nearest);
        nearest.hit()
    }

    fn closest_singles(&self, rays: &[Ray], hits: &mut [Option<Hit>], mode: &mut Mode) {
        let mut query = SingleRayHit::new();
        single::each(rays, hits, None, &self.reach, |ray| {
            query.load(ray);
            query::intersect(&mut query, &self.scene, mode);
            query.hit(|geometry, instance| self.ids(geometry, instance))
        });
    }

    fn occluded_singles(&self, rays: &[Ray], occluded: &mut [bool], mode: &mut Mode) {
        let mut query = SingleRay::new();
        single::each(rays, occluded, false, &self.reach, |ray| {
            query.load(ray);
            query::occluded(&mut query, &self.scene, mode);
            query.tfar() < 0.0
        });
    }

    fn closest_packets<const G: usize>(&self, rays: &[Ray], hits: &mut [Option<Hit>], mode: &mut Mode)
    where
        Packets: PacketQuery<G>,
    {
        let (mut packet, mut active, mut recent) = (RayHits::new(), Active::new(), Recent::NONE);
        packet::each(rays, hits, |rays: &Packet<Ray, G>, hits: &mut Packet<Option<Hit>, G>| {
            packet.load(rays, &self.reach, &mut active);
            Packets::intersect(&mut packet, &active, &self.scene, mode);
            for (group, hits) in hits.iter_mut().enumerate() {
                packet.hits(group, hits, &mut recent, |geometry, instance| self.ids(geometry, instance));
            }
        });
    }

    fn occluded_packets<const G: usize>(&self, rays: &[Ray], occluded: &mut [bool], mode: &mut Mode)
    where
        Packets: PacketQuery<G>,
    {
        let (mut packet, mut active) = (Rays::new(), Active::new());
        packet::each(rays, occluded, |rays: &Packet<Ray, G>, occluded: &mut Packet<bool, G>| {
            packet.load(rays, &self.reach, &mut active);
            Packets::occluded(&mut packet, &active, &self.scene, mode);
            for (group, occluded) in occluded.iter_mut().enumerate() {
                *occluded = packet.occluded(group);
            }
        });
    }
}

impl Accelerator for Embree {}

impl Tracer for Embree {
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut hit = None;
        self.closest_batch(slice::from_ref(ray), slice::from_mut(&mut hit), Batch::default());
        hit
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let mut occluded = false;
        self.occluded_batch(slice::from_ref(ray), slice::from_mut(&mut occluded), Batch::default());
        occluded
    }

    fn closest_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>], batch: Batch) {
        assert_eq!(rays.len(), hits.len(), "one hit a ray");
        let mode = &mut Mode::new(batch.coherent);
        match batch.width {
            Width::One => self.closest_singles(rays, hits, mode),
            Width::Four => self.closest_packets::<1>(rays, hits, mode),
            Width::Eight => self.closest_packets::<2>(rays, hits, mode),
            Width::Sixteen => self.closest_packets::<4>(rays, hits, mode),
        }
        if !self.unbounded.is_empty() {
            for (ray, hit) in rays.iter().zip(hits) {
                *hit = self.beyond_bounds(ray, *hit);
            }
        }
        self.scene.check_panic();
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool], batch: Batch) {
        assert_eq!(rays.len(), occluded.len(), "one answer a ray");
        // Embree's coherent traversal of 16 shadow rays among instances was seen to loop for ever (3.13.5, AVX-512, on
        // valid rays; the cause is not known). The hint is only a hint, so it is not given there.
        let may_hang = batch.width == Width::Sixteen && !self.placements.is_empty();
        let mode = &mut Mode::new(batch.coherent && !may_hang);
        match batch.width {
            Width::One => self.occluded_singles(rays, occluded, mode),
            Width::Four => self.occluded_packets::<1>(rays, occluded, mode),
            Width::Eight => self.occluded_packets::<2>(rays, occluded, mode),
            Width::Sixteen => self.occluded_packets::<4>(rays, occluded, mode),
        }
        if !self.unbounded.is_empty() {
            for (ray, occluded) in rays.iter().zip(occluded) {
                *occluded = *occluded || self.beyond_bounds(ray, None).is_some();
            }
        }
        self.scene.check_panic();
    }
}

/// Does something, and adds the time it takes to `total`.
fn timed<T>(total: &Cell<Duration>, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let done = work();
    total.set(total.get() + start.elapsed());
    done
}

/// Adds `part` as geometry `index` of Embree's scene; nothing where it has no primitives.
fn add_part(builder: &mut SceneBuilder, index: usize, part: &Part) -> Result<()> {
    let added = match &part.primitives {
        primitives if primitives.is_empty() => Ok(()),
        Primitives::Triangles { positions, triangles } => builder.add_triangles(id(index)?, positions, triangles),
        Primitives::Shapes(shapes) => builder.add_shapes(id(index)?, shapes),
    };
    added.map_err(|e| match e {
        Error::Backend { backend, message } => {
            Error::Backend { backend, message: format!("geometry {}: {message}", part.geometry) }
        }
        e => e,
    })
}

/// Bytes of the buffers that a part's triangles are copied to.
fn mesh_bytes(primitives: &Primitives) -> usize {
    match primitives {
        Primitives::Triangles { triangles, .. } if triangles.is_empty() => 0,
        Primitives::Triangles { positions, triangles } => {
            size_of_val(positions.as_slice()) + size_of_val(triangles.as_slice())
        }
        Primitives::Shapes(_) => 0,
    }
}

/// `count` as Embree counts; its largest number means "none".
fn id(count: usize) -> Result<u32> {
    let number = u32::try_from(count).ok().filter(|&number| number != sys::INVALID_ID);
    number.ok_or_else(|| backend(format!("{count} is more than Embree can count: ids have 32 bits")))
}

fn backend(message: impl Into<String>) -> Error {
    Error::Backend { backend: "embree", message: message.into() }
}
