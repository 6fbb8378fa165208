//! A triangle mesh.

use std::sync::Arc;

use rayon::prelude::*;

use crate::math::{Aabb, DAabb, DAffine3, DMat3, DVec3, MAX_COORDINATE, Vec2, Vec3, Vec4, cofactor, is_traceable};

/// Vertices or triangles that are worth a task of their own.
const TASK: usize = 1 << 14;

/// Triangles over shared vertices. Attribute lists are empty or as long as `positions`.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, for messages; may be empty.
    pub name: String,
    /// What every position is relative to. Loaders of formats with f64 or decimal coordinates choose it so that the
    /// offsets keep the mesh's shape ([`Mesh::set_positions`]); zero where the file holds f32.
    pub origin: DVec3,
    /// Vertex positions as offsets from `origin`. May hold NaN or infinities: such triangles are never hit.
    pub positions: Arc<Vec<Vec3>>,
    /// Unit shading normals; empty for flat shading.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, v up (OpenGL's and OBJ's convention, not glTF's).
    pub uvs: Vec<Vec2>,
    /// A second set of them, for textures that lie otherwise; empty where no texture does.
    pub second_uvs: Vec<Vec2>,
    /// Linear RGBA that multiplies the material's diffuse colour.
    pub colors: Vec<Vec4>,
    /// Corners of each triangle; every index is below `positions.len()` (loaders check).
    pub triangles: Arc<Vec<[u32; 3]>>,
    /// Index into [`Scene::materials`](crate::Scene::materials).
    pub material: u32,
}

impl Mesh {
    /// A bare mesh at the origin.
    pub fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        Self { positions: Arc::new(positions), triangles: Arc::new(triangles), ..Self::default() }
    }

    /// Stores f64 positions as f32 offsets from an origin in the middle of those that triangles name which rays can
    /// hit, where these are far from zero; in the middle of all of them where the mesh has no triangles yet.
    pub fn set_positions(&mut self, positions: &[DVec3]) {
        let bounds = if self.triangles.is_empty() {
            bounds_of(positions, |p| Some(*p))
        } else {
            bounds_of_triangles(&self.triangles, positions)
        };
        self.origin = choose_origin(&bounds);
        let offset = |p: &DVec3| (p - self.origin).as_vec3();
        self.positions = Arc::new(positions.par_iter().with_min_len(TASK).map(offset).collect());
    }

    /// Where a position is: the origin and the offset.
    #[inline]
    pub fn point(&self, offset: Vec3) -> DVec3 {
        self.origin + offset.as_dvec3()
    }

    /// The bounds of the traceable vertices under `transform`, those that no triangle names among them: reading a file
    /// leaves these out.
    pub fn bounds(&self, transform: &DAffine3) -> DAabb {
        let place = |p: Vec3| transform.transform_point3(self.point(p));
        let tasks = self.positions.par_chunks(TASK);
        let m = &transform.matrix3;
        let keeps_axes = (0..3).all(|row| (0..3).filter(|&column| m.col(column)[row] != 0.0).count() == 1);
        if !keeps_axes {
            let bounds = tasks.map(|part| {
                let traceable = part.iter().copied().filter(|&p| is_traceable(p));
                traceable.map(place).fold(DAabb::EMPTY, DAabb::include)
            });
            return bounds.reduce(|| DAabb::EMPTY, DAabb::union);
        }
        // Each coordinate is then a monotone function of one coordinate, and its rounding is monotone too: the extremes
        // are those of the extremes, at a fraction of the work.
        let bounds = tasks.map(|part| Aabb::around(part.iter().copied().filter(|&p| is_traceable(p))));
        let bounds = bounds.reduce(|| Aabb::EMPTY, Aabb::union);
        if bounds.is_empty() {
            return DAabb::EMPTY;
        }
        DAabb::EMPTY.include(place(bounds.min)).include(place(bounds.max))
    }

    /// A copy in the coordinates that `transform` leads to. It need not be invertible: what it presses flat is flat,
    /// and a normal along which it presses is zero, which shades as flat. Where it mirrors, corners go round the other
    /// way, so that fronts stay fronts.
    pub fn placed(&self, transform: &DAffine3) -> Self {
        let positions: Vec<DVec3> =
            self.positions.par_iter().map(|&offset| transform.transform_point3(self.point(offset))).collect();
        let turn = cofactor(&transform.matrix3);
        let normals = self.normals.par_iter().map(|normal| (turn * normal.as_dvec3()).normalize_or_zero().as_vec3());
        let mut placed = Self { normals: normals.collect(), ..self.clone() };
        placed.set_positions(&positions);
        if transform.matrix3.determinant() < 0.0 {
            Arc::make_mut(&mut placed.triangles).par_iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
        }
        placed
    }

    /// Whether any of its triangles has an area, and corners that can be traced.
    #[doc(hidden)]
    pub fn has_area(&self) -> bool {
        self.triangles.par_iter().with_min_len(TASK).any(|corners| {
            let corners = corners.map(|i| self.positions[i as usize]);
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            corners.into_iter().all(is_traceable) && (b - a).cross(c - a) != DVec3::ZERO
        })
    }

    /// Turns positions and normals, in place where nothing else holds them.
    pub(crate) fn turn(&mut self, turn: &DMat3) {
        self.origin = *turn * self.origin;
        let turn = turn.as_mat3();
        // Adding 0 makes one zero of the two.
        let apply = |v: &mut Vec3| *v = turn * *v + Vec3::ZERO;
        Arc::make_mut(&mut self.positions).par_iter_mut().with_min_len(TASK).for_each(apply);
        self.normals.par_iter_mut().with_min_len(TASK).for_each(apply);
    }

    /// How many triangles have a corner that is NaN, infinite or too large to trace.
    pub fn untraceable_triangles(&self) -> usize {
        // Where all vertices are fine, which is nearly always, nothing needs to be looked up.
        if self.positions.par_chunks(TASK).all(|part| part.iter().all(|&p| is_traceable(p))) {
            return 0;
        }
        let bad = |&i: &u32| !is_traceable(self.positions[i as usize]);
        self.triangles.par_iter().with_min_len(TASK).filter(|corners| corners.iter().any(bad)).count()
    }

    /// The largest component of a vertex's colour; 0 without colours.
    pub fn brightest_color(&self) -> f32 {
        self.colors.par_iter().with_min_len(TASK).map(|color| color.truncate().max_element()).reduce(|| 0.0, f32::max)
    }

    /// Gives the mesh smooth shading normals: at each vertex the mean of the adjacent triangles' normals, weighted by
    /// the angle at the corner (Thürmer and Wüthrich 1998, *Computing vertex normals from polygonal facets*). Vertices
    /// that no triangle with an area uses get the zero vector, which shades as flat. A triangle that no ray can hit has
    /// none.
    ///
    /// # Panics
    /// For a triangle that names a vertex that there is not.
    pub fn smooth_normals(&mut self) {
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        for corners in self.triangles.iter() {
            let p = corners.map(|i| self.positions[i as usize]);
            if !p.iter().all(|&p| is_traceable(p)) {
                continue;
            }
            let p = p.map(|p| p.as_dvec3());
            let normal = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
            for k in 0..3 {
                let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
                // The angle by its tangent: accurate for slivers too.
                sums[corners[k] as usize] += normal * libm::atan2(a.cross(b).length(), a.dot(b));
            }
        }
        self.normals = sums.into_par_iter().with_min_len(TASK).map(|n| n.normalize_or_zero().as_vec3()).collect();
    }
}

/// Whether a vertex that is not rounded yet may take part in tracing.
pub fn is_traceable_f64(p: &DVec3) -> bool {
    // Written so that NaN gives false.
    p.abs().cmple(DVec3::splat(MAX_COORDINATE.into())).all()
}

/// Around the triangles whose corners are there, finite and small enough to be traced.
fn bounds_of_triangles(triangles: &[[u32; 3]], positions: &[DVec3]) -> DAabb {
    let corner = |i: u32| positions.get(i as usize).copied().filter(is_traceable_f64);
    let around = |bounds: DAabb, &[a, b, c]: &[u32; 3]| match (corner(a), corner(b), corner(c)) {
        (Some(a), Some(b), Some(c)) => bounds.include(a).include(b).include(c),
        _ => bounds,
    };
    let tasks = triangles.par_chunks(TASK).map(|part| part.iter().fold(DAabb::EMPTY, around));
    tasks.reduce(|| DAabb::EMPTY, DAabb::union)
}

/// Around the finite ones of the points of these items.
pub fn bounds_of<T: Sync>(items: &[T], point: impl Fn(&T) -> Option<DVec3> + Sync) -> DAabb {
    let finite = |item: &T| point(item).filter(|p| p.is_finite());
    let tasks = items.par_chunks(TASK).map(|part| part.iter().filter_map(finite).fold(DAabb::EMPTY, DAabb::include));
    tasks.reduce(|| DAabb::EMPTY, DAabb::union)
}

/// The origin for positions within `bounds`: zero where f32 keeps the shape anyway, else the middle. "Anyway" is
/// within 8 radii of zero, where at most 3 bits of the 24 are spent on the distance.
pub fn choose_origin(bounds: &DAabb) -> DVec3 {
    let centre = bounds.centre();
    if centre.abs().max_element() <= 8.0 * bounds.radius() { DVec3::ZERO } else { centre }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bump of 8 x 8 squares.
    fn bump(place: impl Fn(DVec3) -> DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let at = |i: u32| f64::from(i) * 0.25 - 1.0;
        let height = |x: f64, y: f64| (-(x * x + y * y)).exp();
        let positions = (0..81).map(|i| (at(i % 9), at(i / 9))).map(|(x, y)| place(DVec3::new(x, y, height(x, y))));
        let corners = (0..64u32).map(|i| i % 8 + i / 8 * 9);
        (positions.collect(), corners.flat_map(|i| [[i, i + 1, i + 10], [i, i + 10, i + 9]]).collect())
    }

    /// A normal by the corners' order and one that is kept lie on one side, wherever the mesh is brought.
    #[test]
    fn a_mirrored_copy_has_its_front_outside() {
        let (positions, triangles) = bump(|p| p);
        let mut mesh = Mesh { triangles: Arc::new(triangles), ..Mesh::default() };
        mesh.set_positions(&positions);
        mesh.smooth_normals();
        for scale in [DVec3::new(-1.0, 1.0, 1.0), DVec3::new(-2.0, -1.0, -0.5), DVec3::new(-1.0, 3.0, -1.0)] {
            let placed = mesh.placed(&DAffine3::from_scale(scale));
            for corners in placed.triangles.iter() {
                let [a, b, c] = corners.map(|i| placed.positions[i as usize]);
                let normal = placed.normals[corners[0] as usize];
                assert!((b - a).cross(c - a).dot(normal) > 0.0, "{scale} {corners:?}");
            }
        }
        let flat = mesh.placed(&DAffine3::from_scale(DVec3::new(-1.0, 1.0, 0.0)));
        assert_eq!(flat.triangles, mesh.triangles);
    }

    /// A triangle that no ray can hit neither bends normals nor takes from others' precision.
    #[test]
    fn what_cannot_be_hit_changes_nothing() {
        let (positions, triangles) = bump(|p| p + DVec3::new(5e6, 0.0, -5e6));
        let make = |positions: &[DVec3], triangles: Vec<[u32; 3]>| {
            let mut mesh = Mesh { triangles: Arc::new(triangles), ..Mesh::default() };
            mesh.set_positions(positions);
            mesh.smooth_normals();
            mesh.drop_strays();
            let before = mesh.normals.clone();
            mesh.smooth_normals();
            assert_eq!(mesh.normals, before);
            mesh
        };
        let alone = make(&positions, triangles.clone());
        assert!(alone.normals.iter().all(|normal| normal.is_normalized()));
        for bad in [f64::NAN, f64::INFINITY, 1e19, 1e300] {
            let more = [&positions[..], &[DVec3::ZERO, DVec3::new(bad, 0.0, 0.0)]].concat();
            let mesh = make(&more, [&triangles[..], &[[40, 81, 82]]].concat());
            assert_eq!((mesh.untraceable_triangles(), mesh.triangles.len()), (1, 129));
            assert_eq!(
                (mesh.origin, &mesh.positions[..81], &mesh.normals[..81]),
                (alone.origin, &alone.positions[..], &alone.normals[..])
            );
            let [found, expected] = [&mesh, &alone].map(|mesh| mesh.bounds(&DAffine3::IDENTITY));
            assert_eq!((found.min, found.max), (expected.min, expected.max), "{bad}");
        }
    }
}
