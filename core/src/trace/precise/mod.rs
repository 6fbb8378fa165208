//! Meshes and rays in f64, decided in f64.
//!
//! The trees are those of the native tracer, over the same triangles recentred, scaled by a power of two and rounded to
//! f32; and rays are rounded likewise (`frame`). How far all that may be off is known, so a tree only ever rejects what
//! is not hit, and what it knows to be hit is hit (`bvh/certain.rs`). What is in doubt is decided on the corners and
//! the ray as they were given, in f64 with an error bound and where that does not suffice in exact arithmetic; and so
//! is every t. So a hit depends on the f64 values alone: two triangles with a common edge leave no gap between them at
//! 1e9 either, where steps of f32 are 64.
//!
//! Trees over f64 boxes, the simpler alternative, would take twice the memory and half of the lanes.
//!
//! Where all coordinates are f32 to begin with, and lie well ([`PreciseScene::exact`]), the rounding is none, and rays
//! in f32 may ask the [`Bvh`] itself.

mod closed;
mod closest_point;
mod frame;
mod query;
mod repeats;

use std::fmt;
use std::sync::OnceLock;

use crate::error::{Error, Result};
use crate::math::{DAabb, DVec3, MAX_COORDINATE, Vec3};
use crate::ray::Hit;
use crate::scene::{Geometry, Material, Mesh, Scene};
use crate::shape::triangle::TriangleHit;
use crate::trace::World;
use crate::trace::bvh::{Bvh, Discs};
pub use closest_point::PreciseClosestPoint;
use frame::Frame;

/// Rays that start farther away, on any axis, miss.
pub const MAX_ORIGIN: f64 = 1e80;

/// A half-line in f64 with a valid range. A hit counts for `tmin <= t <= tmax`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreciseRay {
    /// Start, in the coordinates of the meshes.
    pub origin: DVec3,
    /// Direction; need not be a unit vector.
    pub direction: DVec3,
    /// Nearest valid t, at least 0.
    pub tmin: f64,
    /// Farthest valid t; may be infinite.
    pub tmax: f64,
}

/// A hit, with numbers in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreciseHit {
    /// Distance in units of the ray's direction; finite, and never -0.
    pub t: f64,
    /// Weight of the triangle's second corner.
    pub u: f64,
    /// Weight of the triangle's third corner.
    pub v: f64,
    /// Index of the triangle in its mesh.
    pub primitive: u32,
    /// Index of the mesh.
    pub geometry: u32,
    /// Index into [`Scene::instances`]; 0 in a scene of meshes.
    pub instance: u32,
}

impl PreciseRay {
    /// A ray over [0, infinity].
    pub const fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, tmin: 0.0, tmax: f64::INFINITY }
    }

    /// Whether it can hit anything: an origin whose largest component is not above 1e80 ([`MAX_ORIGIN`]), a direction
    /// whose largest component is neither below 1e-140 nor above 1e140, so that the square of one times the other holds
    /// in f64, and a range that is not empty. Any other ray misses.
    pub fn is_valid(&self) -> bool {
        let placed = self.origin.abs().max_element() <= MAX_ORIGIN && !self.origin.is_nan();
        let directed = (1e-140..=1e140).contains(&self.direction.abs().max_element()) && !self.direction.is_nan();
        placed && directed && self.tmin >= 0.0 && self.tmin <= self.tmax
    }

    fn has(&self, t: f64) -> bool {
        self.tmin <= t && t <= self.tmax && t.is_finite()
    }
}

impl PreciseHit {
    /// On the triangle of this (primitive, geometry, instance). Adding 0 makes one zero of the two: t decides before
    /// the id does.
    #[inline]
    pub(super) fn new(hit: TriangleHit, (primitive, geometry, instance): (u32, u32, u32)) -> Self {
        Self { t: hit.t + 0.0, u: hit.u, v: hit.v, primitive, geometry, instance }
    }

    /// The order that decides between hits at equal t: the lowest wins.
    pub const fn id(&self) -> (u32, u32, u32) {
        (self.instance, self.geometry, self.primitive)
    }

    /// By t, then by id.
    pub(super) fn order(&self, other: &Self) -> std::cmp::Ordering {
        self.t.total_cmp(&other.t).then(self.id().cmp(&other.id()))
    }

    pub(super) fn rounded(&self) -> Hit {
        let &Self { t, u, v, primitive, geometry, instance } = self;
        Hit { t: t as f32, u: u as f32, v: v as f32, primitive, geometry, instance }
    }
}

/// A mesh in f64.
#[derive(Clone, Debug, Default)]
pub struct PreciseMesh {
    /// Corners; triangles with one that is NaN, infinite or larger than 1.8e18 cannot be hit.
    pub positions: Vec<DVec3>,
    /// Indices of each triangle's corners.
    pub triangles: Vec<[u32; 3]>,
}

impl PreciseMesh {
    /// Those of each triangle, so that what several share comes as often.
    fn corners(&self) -> impl Iterator<Item = DVec3> {
        self.triangles.iter().flatten().map(|&i| self.positions[i as usize])
    }
}

/// Meshes in f64, ready to be asked.
pub struct PreciseScene {
    meshes: Vec<PreciseMesh>,
    bvh: Bvh,
    bounds: DAabb,
    /// Made for the first point that is asked for and finite.
    discs: OnceLock<Discs>,
    /// Found out when it is first asked.
    closed: OnceLock<bool>,
    /// Found out when it is first asked; nothing where no triangle is repeated.
    distinct: OnceLock<Option<Box<PreciseScene>>>,
    frame: Frame,
}

impl fmt::Debug for PreciseScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { meshes, bvh, bounds, .. } = self;
        let triangles: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
        f.debug_struct("PreciseScene")
            .field("meshes", &meshes.len())
            .field("triangles", &triangles)
            .field("bounds", bounds)
            .field("bvh", bvh)
            .finish_non_exhaustive()
    }
}

impl PreciseScene {
    /// Builds the tree, on rayon's current thread pool.
    ///
    /// # Errors
    /// [`Error::Scene`] for a triangle that names a vertex that is not there, with its number; and for too many
    /// triangles.
    pub fn new(meshes: Vec<PreciseMesh>) -> Result<Self> {
        for (number, mesh) in meshes.iter().enumerate() {
            check_indices(number, mesh)?;
        }
        let bounds = traceable_bounds(&meshes);
        let frame = Frame::around(&meshes, bounds);
        // What lies elsewhere is too large to trace, or no triangle's: it must not move the world, nor make it coarse.
        let point = |&p: &DVec3| if bounds.contains(&DAabb { min: p, max: p }) { frame.point(p) } else { Vec3::NAN };
        let rounded = |mesh: &PreciseMesh| {
            let positions: Vec<Vec3> = mesh.positions.iter().map(point).collect();
            Geometry::Mesh(Mesh::new(positions, mesh.triangles.clone()))
        };
        let scene = Scene::from_geometries(meshes.iter().map(rounded).collect(), vec![Material::default()]);
        let world = World::new(&scene)?;
        debug_assert_eq!(world.centre, DVec3::ZERO, "the frame lies around zero");
        // Not the high preset: a piece of a triangle is off by what its corners are, and boxes know only of their own
        // coordinates.
        let (discs, closed, distinct) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
        Ok(Self { bvh: Bvh::build(&world), bounds, discs, closed, distinct, meshes, frame })
    }

    /// The meshes as they were given.
    pub fn meshes(&self) -> &[PreciseMesh] {
        &self.meshes
    }

    /// The box around all corners of triangles that are not NaN, infinite or too large; empty where there is none.
    pub fn bounds(&self) -> DAabb {
        self.bounds
    }

    /// The tracer over the meshes as they are, if f32 holds them: for rays in f32 it gives the same answers, but for
    /// hits at a t that f32 does not hold.
    pub fn exact(&self) -> Option<&Bvh> {
        self.frame.is_identity().then_some(&self.bvh)
    }

    /// The corners of a triangle.
    ///
    /// # Panics
    /// For a mesh or a triangle that there is not.
    #[inline]
    pub fn corners(&self, geometry: u32, primitive: u32) -> [DVec3; 3] {
        let mesh = &self.meshes[geometry as usize];
        mesh.triangles[primitive as usize].map(|i| mesh.positions[i as usize])
    }
}

/// Whether a corner is one that triangles with it can be hit.
fn is_traceable(p: DVec3) -> bool {
    p.abs().max_element() <= f64::from(MAX_COORDINATE) && !p.is_nan()
}

/// Vertices that are no triangle's do not count: one that lies far away would leave f32 nothing of what is near.
fn traceable_bounds(meshes: &[PreciseMesh]) -> DAabb {
    meshes.iter().flat_map(PreciseMesh::corners).filter(|&p| is_traceable(p)).fold(DAabb::EMPTY, DAabb::include)
}

fn check_indices(number: usize, mesh: &PreciseMesh) -> Result<()> {
    let count = mesh.positions.len();
    let wrong = mesh.triangles.iter().position(|corners| corners.iter().any(|&i| i as usize >= count));
    match wrong {
        None => Ok(()),
        Some(i) => {
            let message = format!(
                "triangle {i} of mesh {number} names the vertices {:?}, of which there are {count}",
                mesh.triangles[i]
            );
            Err(Error::Scene(message))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::bvh::{NearestTriangle, Sought, Surveyor};

    /// What is looked at in f64: of a ray its candidates, of a point the triangles that are measured.
    struct Count<'a> {
        precise: &'a PreciseScene,
        point: Option<DVec3>,
        measured: std::cell::Cell<usize>,
    }

    impl Surveyor for Count<'_> {
        fn next(&mut self, _: usize, _: Option<NearestTriangle>) -> Option<Sought> {
            let point = self.point.take()?;
            let (local, error) = self.precise.frame.blurred_point(point);
            Some(Sought { point, local, error: error as f32 * 1.01 })
        }
        fn corners(&self, geometry: u32, primitive: u32) -> [DVec3; 3] {
            self.measured.set(self.measured.get() + 1);
            self.precise.corners(geometry, primitive)
        }
        fn is_exact(&self) -> bool {
            self.precise.frame.is_identity()
        }
        fn scale(&self) -> f64 {
            self.precise.frame.scale()
        }
    }

    /// Hills of small triangles above the rim of one that is ten million or ten thousand million times as large: hardly
    /// more of them are looked at than without it; those in one block with it, which is as coarse as it is large.
    #[test]
    fn what_is_far_away_makes_nothing_near_uncertain() {
        const SIDE: u32 = 50;
        let at = |i: u32, k: u32| {
            let (x, y) = (0.1 * f64::from(i), 0.1 * f64::from(k));
            DVec3::new(x, y, 0.3 * (x + 0.2).sin() * y.cos())
        };
        let quads = (0..SIDE - 1).flat_map(|i| (0..SIDE - 1).map(move |k| SIDE * i + k));
        let triangles: Vec<_> = quads.flat_map(|k| [[k, k + 1, k + SIDE], [k + 1, k + SIDE + 1, k + SIDE]]).collect();
        let hills = PreciseMesh { positions: (0..SIDE * SIDE).map(|k| at(k / SIDE, k % SIDE)).collect(), triangles };
        let mut counts = Vec::new();
        for far in [0.0, 1e6, 1e9] {
            let ground = [[-0.1, 0.0, -3.0], [far, -far, -3.0], [far, far, -3.1]].map(DVec3::from).to_vec();
            let ground = PreciseMesh { positions: ground, triangles: vec![[0, 1, 2]] };
            let precise = PreciseScene::new(vec![hills.clone(), ground]).expect("meshes");
            let (mut candidates, mut measured) = (0, 0);
            for k in 0..200 {
                let point = DVec3::new(0.0237 * f64::from(k), 0.0219 * f64::from(k), 1.0);
                let ray = PreciseRay::new(point, DVec3::new(0.01, -0.02, -1.0));
                let local = precise.frame.ray(&ray).expect("a valid ray");
                precise.bvh.candidates(&local.ray, local.blur, &mut |geometry, _| {
                    candidates += u32::from(geometry == 0);
                    Some(f32::INFINITY)
                });
                let mut count = Count { precise: &precise, point: Some(point), measured: 0.into() };
                precise.bvh.nearest_triangles(&precise.bvh.discs(), 1, &mut count);
                measured += count.measured.get();
            }
            counts.push((candidates, measured));
        }
        let [(candidates, measured), others @ ..] = &counts[..] else { unreachable!("three") };
        let is_more = |&(c, m): &(u32, usize)| c > candidates + 7 * 200 || m > measured + 7 * 200;
        assert!(*candidates >= 190 && !others.iter().any(is_more), "{counts:?}");
    }

    /// Vertices that are no triangle's, far away or not numbers, neither make the tree coarse nor keep what is f32 from
    /// being traced so.
    #[test]
    fn vertices_of_no_triangle_change_nothing() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [0.0, 1.0, 0.25]].map(DVec3::from);
        let strays = [1e9, -1e7, 0.1, f64::NAN, 1e300].map(DVec3::splat);
        for scale in [1.0, 0.1] {
            let mesh = |strays: &[DVec3]| {
                let positions = corners.map(|p| p * scale).into_iter().chain(strays.iter().copied()).collect();
                PreciseScene::new(vec![PreciseMesh { positions, triangles: vec![[0, 1, 2]] }]).expect("a triangle")
            };
            let (plain, strewn) = (mesh(&[]), mesh(&strays));
            assert_eq!(strewn.bounds(), plain.bounds());
            assert_eq!((strewn.frame.scale(), strewn.frame.farthest()), (plain.frame.scale(), plain.frame.farthest()));
            assert_eq!([strewn.exact().is_some(), plain.exact().is_some()], [scale == 1.0; 2]);
            let ray = PreciseRay::new(DVec3::new(0.2, 0.3, 4.0) * scale, -DVec3::Z);
            let [mut of_plain, mut of_strewn] = [[None]; 2];
            plain.closest_batch(&[ray], &mut of_plain);
            strewn.closest_batch(&[ray], &mut of_strewn);
            assert!(of_plain[0].is_some() && of_strewn == of_plain, "{of_strewn:?}, not {of_plain:?}");
        }
    }
}
