//! An object in its place, and rays in its coordinates.
//!
//! A transform keeps volumes' signs (or turns all of them round), t, u and v. So a ray can be held against an object's
//! own triangles in the object's coordinates, as long as it is known how far the ray that was computed is from the one
//! that is meant: its [`Blur`]. Moving the triangles into the world instead would take as much memory as the scene
//! without instances; moving every node's box, the other alternative, widens it.
//!
//! With A x + T the transform to the world, whose entries are f32 and exact, B the inverse and b the translation that
//! were computed in f64, R = 1 - B A, and norms the largest sums of a row, or component: A^-1 = (1 - R)^-1 B, so that
//! it differs from B by at most |R| / (1 - |R|) |B|. R is computed, which is off by gamma(5) |B| |A|, and so is b + B
//! T, by gamma(5) |B| |T|. With q the sum of that quotient and gamma(8), the moved origin is off by q |B| (|o| + |T|) +
//! |b + B T|, and the direction by q |B| |d|. Then both are rounded to f32. For a transform that is anywhere near a
//! rotation only this last step counts.

use crate::math::{Affine3, DAffine3, DMat3, UNIT_ROUNDOFF, Vec3, gamma64};
use crate::ray::Ray;
use crate::trace::Placement;
use crate::trace::bvh::reject::Blur;
use crate::trace::bvh::reject::ready::columns_of;
use crate::trace::bvh::simd::{Array, Doubles, Mask, PerRay, RAYS, Simd, Vector, size};
use crate::trace::leaf::InstanceTransform;
use crate::trace::world::object_ray;

/// An object in its place, while it stands still. Rays on their way into the object need the first two cache lines,
/// their hits the last two.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(in crate::trace::bvh) struct Place {
    /// To the object's coordinates: the columns of the matrix, and the translation.
    to_object: [f64; 12],
    /// |B|.
    stretch: f64,
    /// q |B|.
    relative: f64,
    /// |b + B T| + q |B| |T|.
    absolute: f64,
    /// As of [`Placement`].
    pub object: u32,
    /// As of [`Placement`].
    pub instance: u32,
    /// As of [`Placement`].
    pub to_world: Affine3,
    /// At least what the error of a corner in the world is relative to:
    /// [`Corners::slack`](crate::shape::triangle::Corners::slack).
    pub slack: f64,
    /// The [grain](super::triangles::TriangleTree::grain) of its triangles in the world, if [that of the
    /// object](Self::with_grain) was told.
    pub grain: f32,
}

const _: () = assert!(size_of::<Place>() == 3 * 64 && std::mem::offset_of!(Place, to_world) == 2 * 64);

impl Place {
    /// `reach` is that of the object's triangles.
    #[inline]
    pub fn new(placement: &Placement, reach: Vec3) -> Self {
        let to_world = placement.to_world.as_daffine3();
        let to_object = &placement.to_object;
        let (matrix, b) = (to_object.matrix3, to_object.translation);
        let norm = |m: DMat3| {
            let m = m.abs();
            (m.x_axis + m.y_axis + m.z_axis).max_element()
        };
        let stretch = norm(matrix);
        let residue = norm(DMat3::IDENTITY - matrix * to_world.matrix3) + gamma64(8) * stretch * norm(to_world.matrix3);
        // Also where it is NaN.
        let quotient = if residue < 0.5 { residue / (1.0 - residue) + gamma64(16) } else { f64::INFINITY };
        let away = to_world.translation.abs().max_element();
        let offset = (b + matrix * to_world.translation).abs().max_element();
        let farthest = to_world.matrix3.abs() * reach.as_dvec3() + to_world.translation.abs();
        Self {
            to_object: to_object.to_cols_array(),
            stretch,
            relative: quotient * stretch,
            absolute: offset + quotient * stretch * away,
            object: placement.object,
            instance: placement.instance,
            to_world: placement.to_world,
            slack: farthest.max_element(),
            grain: 0.0,
        }
    }

    /// The same, given the grain of the object's triangles.
    #[inline]
    pub fn with_grain(self, grain: f32) -> Self {
        // About how much larger areas become: the mean square of what the axes are stretched by.
        let columns = self.to_world.matrix3;
        let squares =
            columns.x_axis.length_squared() + columns.y_axis.length_squared() + columns.z_axis.length_squared();
        Self { grain: grain * squares / 3.0, ..self }
    }

    pub fn through(&self) -> InstanceTransform<'_> {
        InstanceTransform { instance: self.instance, to_world: &self.to_world }
    }

    /// As [`Placement::object_ray`].
    #[inline]
    pub fn object_ray(&self, ray: &Ray) -> Ray {
        object_ray(&DAffine3::from_cols_array(&self.to_object), ray)
    }

    /// `ray` in the object's coordinates, at the same t.
    #[inline(always)]
    pub fn local<S: Simd>(&self, ray: &Ray) -> (Ray, Blur) {
        let ([ox, oy, oz, _], [dx, dy, dz, _]) = self.moved::<S>(ray);
        let local = Ray { origin: Vec3::new(ox, oy, oz), direction: Vec3::new(dx, dy, dz), ..*ray };
        match self.blur(ray, &local) {
            Some(blur) => (local, blur),
            None => (Ray { origin: Vec3::ZERO, direction: Vec3::ONE, ..local }, Blur::UNKNOWN),
        }
    }

    /// `ray` in the coordinates of what stands here, or as it is. No closure for `map_or`: the compiler need not inline
    /// that, and then makes it for processors without the instructions of `S`.
    #[inline(always)]
    pub fn local_or<S: Simd>(place: Option<&Self>, ray: &Ray) -> (Ray, Blur) {
        match place {
            Some(place) => place.local::<S>(ray),
            None => (*ray, Blur::NONE),
        }
    }

    /// Eight rays, field by field as [`columns`](crate::trace::bvh::reject::ready::columns) has them, in the object's
    /// coordinates at the same t.
    #[inline(always)]
    pub fn eight<S: Simd>(&self, world: [S::V8; 8]) -> EightRays<S::V8> {
        let splat = S::V8::splat;
        let [x, y, z, dx, dy, dz, tmin, tmax] = world;
        let (points, vectors) = eight_times::<S>(self.columns(), [x, y, z], [dx, dy, dz]);
        let [lx, ly, lz] = [S::V8::load(&points[0]), S::V8::load(&points[1]), S::V8::load(&points[2])];
        let [lp, lq, lr] = [S::V8::load(&vectors[0]), S::V8::load(&vectors[1]), S::V8::load(&vectors[2])];
        let [relative, absolute] = self.off();
        EightRays::new(world, [lx, ly, lz, lp, lq, lr, tmin, tmax], splat(relative), splat(absolute))
    }

    /// Eight rays, each in the coordinates of the object in a place of its own.
    #[inline(always)]
    pub fn each<S: Simd>(places: [&Self; 8], rays: [&Ray; 8]) -> EightRays<S::V8> {
        let (mut local, mut relative, mut absolute) = ([[0.0; 8]; 8], [0.0; 8], [0.0; 8]);
        for i in 0..8 {
            let (place, ray) = (places[i], rays[i]);
            let ([x, y, z, _], [dx, dy, dz, _]) = place.moved::<S>(ray);
            local[i] = [x, y, z, dx, dy, dz, ray.tmin, ray.tmax];
            [relative[i], absolute[i]] = place.off();
        }
        let load = S::V8::load;
        let [a, b, c, d, e, f, g, h] = &local;
        let local = S::transpose([load(a), load(b), load(c), load(d), load(e), load(f), load(g), load(h)]);
        EightRays::new(columns_of::<S>(rays), local, load(&relative), load(&absolute))
    }

    /// What [`EightRays::new`] takes: q |B| and |b + B T| + q |B| |T|.
    #[inline(always)]
    fn off(&self) -> [f32; 2] {
        // Written so that NaN stays.
        let is_tiny = self.relative < f64::from(f32::MIN_POSITIVE);
        [if is_tiny { f32::MIN_POSITIVE } else { self.relative as f32 }, self.absolute as f32]
    }

    /// None where nothing is known.
    #[inline(always)]
    fn blur(&self, ray: &Ray, local: &Ray) -> Option<Blur> {
        let largest = local.direction.abs().max_element();
        let noise = self.relative * f64::from(ray.direction.abs().max_element());
        let origin = self.origin_blur(ray.origin, local.origin);
        let direction = (noise / f64::from(largest)) as f32 + UNIT_ROUNDOFF;
        // Written so that NaN is unknown.
        let is_finite = (f32::MIN_POSITIVE..f32::INFINITY).contains(&largest) && origin < f32::MAX;
        (is_finite && direction <= Blur::MAX).then_some(Blur { origin, direction: direction * 1.01 })
    }

    /// How far an origin may be off, given where it was and is.
    #[inline(always)]
    fn origin_blur(&self, world: Vec3, local: Vec3) -> f32 {
        let computed = self.relative * f64::from(world.abs().max_element()) + self.absolute;
        (computed as f32 + UNIT_ROUNDOFF * local.abs().max_element()) * 1.01 + f32::MIN_POSITIVE
    }

    /// A point that is off by `blur` in each component, in the object's coordinates; and by how much it is off there.
    #[inline(always)]
    pub fn point<S: Simd>(&self, point: Vec3, blur: f32) -> (Vec3, f32) {
        let [x, y, z, b] = self.wide_columns::<S>();
        let [px, py, pz, _] = times::<S>([x, y, z], point).add(b).narrow().to_array();
        let local = Vec3::new(px, py, pz);
        (local, self.origin_blur(point, local) + self.stretch as f32 * blur * 1.01)
    }

    /// Directions in the object's coordinates; each component is off by the rounding to f32, and by the least component
    /// that is worth mentioning, which is the result.
    #[inline(always)]
    pub fn directions<S: Simd>(&self, world: &[PerRay; 3], local: &mut [PerRay; 3]) -> f32 {
        let [mx, my, mz, _] = self.columns();
        let mut largest = S::V4::splat(0.0);
        for i in 0..RAYS / 4 {
            let (x, y, z) = (four::<S>(&world[0], i), four::<S>(&world[1], i), four::<S>(&world[2], i));
            largest = size([x, y, z]).max(largest);
            let (x, y, z) = (S::D4::widen(x), S::D4::widen(y), S::D4::widen(z));
            for axis in 0..3 {
                let (a, b, c) = (S::D4::splat(mx[axis]), S::D4::splat(my[axis]), S::D4::splat(mz[axis]));
                let direction = row_times::<S>([a, b, c], [x, y, z]);
                local[axis].0.as_chunks_mut().0[i] = direction.narrow().to_array();
            }
        }
        (self.relative * f64::from(largest.largest())) as f32 * 1.01 + f32::MIN_POSITIVE
    }

    /// Origin and direction in the object's coordinates, and a number more of each.
    #[inline(always)]
    fn moved<S: Simd>(&self, ray: &Ray) -> ([f32; 4], [f32; 4]) {
        let [x, y, z, b] = self.wide_columns::<S>();
        let (origin, direction) = (times::<S>([x, y, z], ray.origin), times::<S>([x, y, z], ray.direction));
        (origin.add(b).narrow().to_array(), direction.narrow().to_array())
    }

    /// The columns of the matrix to the object's coordinates, and the translation.
    #[inline(always)]
    fn columns(&self) -> &[[f64; 3]; 4] {
        bytemuck::cast_ref(&self.to_object)
    }

    /// The same, and a number more of each.
    #[inline(always)]
    fn wide_columns<S: Simd>(&self) -> [S::D4; 4] {
        let [a, b, c, d, e, f, g, h, i, j, k, l] = self.to_object;
        [
            S::D4::load(&[a, b, c, d]),
            S::D4::load(&[d, e, f, g]),
            S::D4::load(&[g, h, i, j]),
            S::D4::load(&[j, k, l, 0.0]),
        ]
    }
}

/// Eight rays in an object's coordinates, where they may be off.
pub(in crate::trace::bvh) struct EightRays<V> {
    /// Origin, direction, tmin, tmax.
    pub columns: [V; 8],
    /// In each component of the origin.
    pub off: V,
    /// In each component of the direction, relative to the largest of them.
    pub turn: V,
    /// A bit for each of which both are known.
    pub known: u32,
}

impl<V: Vector> EightRays<V> {
    /// Rays in the world and in the object; how far the latter are off relative to origins and directions, and besides
    /// ([`Place::off`]).
    #[inline(always)]
    fn new(world: [V; 8], local: [V; 8], relative: V, absolute: V) -> Self {
        let splat = V::splat;
        let [x, y, z, dx, dy, dz, ..] = world;
        let [lx, ly, lz, lp, lq, lr, ..] = local;
        // As [`Place::blur`], in f32, for which the hundredth more has room. Neither factor of a product is so small
        // that it vanishes where the other is large.
        let largest = size([lp, lq, lr]);
        let ratio = size([dx, dy, dz]).div(largest).max(splat(f32::MIN_POSITIVE));
        let turn = ratio.mul_add(relative, splat(UNIT_ROUNDOFF));
        let computed = size([x, y, z]).mul_add(relative, absolute);
        let off = size([lx, ly, lz]).mul_add(splat(UNIT_ROUNDOFF), computed);
        let off = off.mul_add(splat(1.01), splat(4.0 * f32::MIN_POSITIVE));
        let known = splat(f32::MIN_POSITIVE).at_most(largest).and(largest.less(splat(f32::INFINITY)));
        let known = known.and(off.less(splat(f32::MAX))).and(turn.at_most(splat(Blur::MAX)));
        Self { columns: local, off, turn: turn.mul(splat(1.01)), known: known.bits() }
    }
}

/// A row of a matrix times vectors.
#[inline(always)]
fn row_times<S: Simd>([a, b, c]: [S::D4; 3], [x, y, z]: [S::D4; 3]) -> S::D4 {
    a.mul(x).add(b.mul(y)).add(c.mul(z))
}

/// Points and vectors, eight of each, times a matrix: its columns, and a translation that counts for points alone. Sums
/// are added up in the order of [`DAffine3::transform_point3`].
#[inline(always)]
pub(in crate::trace::bvh) fn eight_times<S: Simd>(
    [mx, my, mz, b]: &[[f64; 3]; 4],
    [x, y, z]: [S::V8; 3],
    [dx, dy, dz]: [S::V8; 3],
) -> ([[f32; 8]; 3], [[f32; 8]; 3]) {
    let origin = [halves::<S>(x), halves::<S>(y), halves::<S>(z)];
    let direction = [halves::<S>(dx), halves::<S>(dy), halves::<S>(dz)];
    let (mut points, mut vectors) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
    for axis in 0..3 {
        let m = [S::D4::splat(mx[axis]), S::D4::splat(my[axis]), S::D4::splat(mz[axis])];
        let offset = S::D4::splat(b[axis]);
        for half in 0..2 {
            let point = row_times::<S>(m, [origin[0][half], origin[1][half], origin[2][half]]).add(offset);
            points[axis].as_chunks_mut().0[half] = point.narrow().to_array();
            let vector = row_times::<S>(m, [direction[0][half], direction[1][half], direction[2][half]]);
            vectors[axis].as_chunks_mut().0[half] = vector.narrow().to_array();
        }
    }
    (points, vectors)
}

/// A matrix, column by column, times a vector.
#[inline(always)]
fn times<S: Simd>([x, y, z]: [S::D4; 3], v: Vec3) -> S::D4 {
    let (vx, vy, vz) = (S::D4::splat(v.x.into()), S::D4::splat(v.y.into()), S::D4::splat(v.z.into()));
    x.mul(vx).add(y.mul(vy)).add(z.mul(vz))
}

#[inline(always)]
fn halves<S: Simd>(v: S::V8) -> [S::D4; 2] {
    let values = v.to_array();
    let [low, high] = values.as_chunks().0 else { unreachable!("eight are twice four") };
    [S::D4::widen(S::V4::load(low)), S::D4::widen(S::V4::load(high))]
}

#[inline(always)]
fn four<S: Simd>(values: &PerRay, i: usize) -> S::V4 {
    S::V4::load(&values.0.as_chunks().0[i % (RAYS / 4)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::expansion::Expansion;
    use crate::math::number::{cross, dot};
    use crate::math::{DVec3, Mat3};
    use crate::trace::bvh::random::Random;
    use crate::trace::bvh::reject::ready::columns;
    use crate::trace::bvh::simd::Portable;
    use crate::trace::bvh::simd::isa::{Kernel, Present, dispatch};

    /// The solution of A x = v, by Cramer's rule in exact arithmetic.
    fn solve(matrix: &Mat3, v: &[Expansion; 3]) -> DVec3 {
        let column = |c: Vec3| c.to_array().map(Expansion::from);
        let [x, y, z] = [column(matrix.x_axis), column(matrix.y_axis), column(matrix.z_axis)];
        let determinant = dot(&x, &cross(&y, &z)).estimate();
        let [p, q, r] = [(&y, &z), (&z, &x), (&x, &y)].map(|(a, b)| dot(v, &cross(a, b)).estimate() / determinant);
        DVec3::new(p, q, r)
    }

    struct Case {
        place: Place,
        shear: f32,
        /// About so large are coordinates in the world.
        away: f32,
    }

    impl Case {
        fn new(number: usize, random: &mut Random) -> Self {
            let shear = [0.0, 1e2, 1e5, 1e7][number % 4];
            let away = [0.0, 1.0, 1e3, 1e6][number / 4 % 4];
            let scale = [1.0, 1e-20, 1e20][number / 16 % 3];
            let rotation = Mat3::from_quat(glam::Quat::from_scaled_axis(random.vec3() * 3.0)) * scale;
            let mut matrix = rotation;
            matrix.x_axis = rotation.x_axis + rotation.y_axis * shear;
            let to_world = Affine3 { matrix3: matrix, translation: random.vec3() * away };
            let to_object = to_world.as_daffine3().inverse();
            let placement = Placement { instance: 0, object: 0, to_world, to_object, motion: None };
            Self { place: Place::new(&placement, Vec3::ONE), shear, away }
        }
    }

    /// Eight rays, each in a place of its own: together, and each by itself.
    struct Each<'a>([&'a Place; 8], [&'a Ray; 8]);

    /// The columns of a ray, and how far it is off.
    type Row = [f32; 10];

    fn row<V: Array<8>>(rays: EightRays<V>, i: usize) -> (Row, bool) {
        let EightRays { columns: [a, b, c, d, e, f, g, h], off, turn, known } = rays;
        ([a, b, c, d, e, f, g, h, off, turn].map(|column| column.to_array()[i]), known >> i & 1 != 0)
    }

    impl Kernel for Each<'_> {
        type Output = [[(Row, bool); 8]; 2];

        #[inline(always)]
        fn run<S: Simd>(self) -> Self::Output {
            let Self(places, rays) = self;
            let alone = |i: usize| row(places[i].eight::<S>(columns::<S>(&[*rays[i]; 8])), 0);
            [std::array::from_fn(|i| row(Place::each::<S>(places, rays), i)), std::array::from_fn(alone)]
        }
    }

    /// Eight rays, each in a place of its own, are what they are where all eight are in one place.
    #[test]
    fn each_ray_is_in_its_own_place() {
        let mut random = Random::new(2);
        let (mut known, mut unknown) = (0, 0);
        for group in 0..600 {
            let cases: [Case; 8] = std::array::from_fn(|i| Case::new(9 * group + i, &mut random));
            let rays = cases.each_ref().map(|case| {
                let ray = Ray::new(random.vec3() * case.away.max(3.0), random.vec3());
                Ray { tmin: random.unit().abs(), tmax: 1.0 + random.unit().abs(), ..ray }
            });
            for isa in Present::all() {
                let [together, alone] = dispatch(isa, Each(cases.each_ref().map(|case| &case.place), rays.each_ref()));
                for (i, ((numbers, is_known), (expected, is_expected))) in together.into_iter().zip(alone).enumerate() {
                    assert_eq!(is_known, is_expected, "{group} {i} {isa:?}");
                    let is_same =
                        numbers == expected || !is_known && numbers.map(f32::to_bits) == expected.map(f32::to_bits);
                    assert!(is_same, "{group} {i} {isa:?}: {numbers:?}, not {expected:?}");
                    *if is_known { &mut known } else { &mut unknown } += 1;
                }
            }
        }
        assert!(known > 2000 && unknown > 100, "{known} known, {unknown} not");
    }

    /// From turned and scaled objects to shears that f64 all but loses: nowhere is a ray farther off than its blur
    /// says, and for an object that is merely turned the blur is not much more than the rounding to f32.
    #[test]
    fn rays_are_no_farther_off_than_their_blur() {
        let mut random = Random::new(1);
        let (mut known, mut worst) = (0, 0.0f64);
        for case in 0..4000 {
            let Case { place, shear, away } = Case::new(case, &mut random);
            let to_world = place.to_world;
            let rays = [0; 8].map(|_| Ray::new(random.vec3() * away.max(3.0), random.vec3()));
            let eight = place.eight::<Portable>(columns::<Portable>(&rays));
            for (i, ray) in rays.iter().enumerate() {
                let (from, to) = (ray.origin.to_array(), to_world.translation.to_array());
                let relative = [0, 1, 2].map(|i| &Expansion::from(from[i]) - &Expansion::from(to[i]));
                let origin = solve(&to_world.matrix3, &relative);
                let direction = solve(&to_world.matrix3, &ray.direction.to_array().map(Expansion::from));
                let check = |local: [Vec3; 2], blur: Blur| {
                    let off = (local[0].as_dvec3() - origin).abs().max_element();
                    assert!(off <= blur.origin.into(), "{case}: origin off by {off}, not {}", blur.origin);
                    let largest = f64::from(local[1].abs().max_element());
                    let off = (local[1].as_dvec3() - direction).abs().max_element() / largest;
                    assert!(off <= blur.direction.into(), "{case}: direction off by {off}, not {}", blur.direction);
                };
                let (local, blur) = place.local::<Portable>(ray);
                let is_known = eight.known >> i & 1 != 0;
                if blur == Blur::UNKNOWN {
                    assert!(!is_known, "{case}: of one of eight nothing is known that is not of it by itself");
                    continue;
                }
                check([local.origin, local.direction], blur);
                if !is_known {
                    continue;
                }
                known += 1;
                let [x, y, z, dx, dy, dz, ..] = eight.columns.map(|column| column.to_array()[i]);
                let (off, turn) = (eight.off.to_array()[i], eight.turn.to_array()[i]);
                let [origin, direction] = [Vec3::new(x, y, z), Vec3::new(dx, dy, dz)];
                assert_eq!([origin, direction], [local.origin, local.direction], "{case}");
                check([origin, direction], Blur { origin: off, direction: turn });
                if shear == 0.0 {
                    worst = worst.max(f64::from(blur.direction)).max(f64::from(turn));
                }
            }
        }
        assert!(known > 16_000, "{known} of 32000");
        assert!(worst < 1.1 * f64::from(UNIT_ROUNDOFF), "{worst}");
    }

    /// What f64 cannot turn round is traced all the same, as a ray that may be anywhere.
    #[test]
    fn a_transform_that_f64_loses_leaves_everything_open() {
        let matrix = Mat3::from_cols(Vec3::X, Vec3::new(1.0, f32::EPSILON, 0.0) * 1e30, Vec3::Z * 1e-30);
        let to_world = Affine3 { matrix3: matrix, translation: Vec3::ZERO };
        let to_object = to_world.as_daffine3().inverse();
        let placement = Placement { instance: 0, object: 0, to_world, to_object, motion: None };
        let place = Place::new(&placement, Vec3::ONE);
        let (_, blur) = place.local::<Portable>(&Ray::new(Vec3::ONE, Vec3::new(1.0, 1.0, 1e30)));
        assert_eq!(blur, Blur::UNKNOWN);
    }
}
