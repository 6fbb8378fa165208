//! Random numbers, rays and points for the tests of single files.

use crate::math::{self, Aabb, DVec3, Vec3};
use crate::ray::Ray;
use crate::trace::bvh::node::Child;
use crate::trace::bvh::simd::isa::Present;

/// [`math::Random`], about zero.
pub(super) struct Random(math::Random);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(math::Random::new(seed, 0))
    }

    /// In [-1, 1).
    pub fn unit(&mut self) -> f32 {
        2.0 * self.0.unit() - 1.0
    }

    pub fn vec3(&mut self) -> Vec3 {
        self.0.vector()
    }

    /// Of either sign and any size down to 2^-40 of `most`.
    fn number(&mut self, most: f32) -> f32 {
        self.unit() * most * (20.0 * (self.unit() - 1.0)).exp2()
    }

    fn numbers(&mut self, most: f32) -> Vec3 {
        Vec3::new(self.number(most), self.number(most), self.number(most))
    }

    /// A ray that has a single t, and a point that it meets there, no larger than f32 can tell: the smallest box with
    /// f32 bounds. Points and origins are of all sizes, axis by axis, some of them no normal numbers. The ray that is
    /// meant has a direction that differs by up to `turn` times the largest component. None where there is no valid
    /// one.
    pub fn ray_and_point(&mut self, turn: f32) -> Option<(Ray, Aabb)> {
        let mut size = || [1.0, 1e6, 1e-6, 1e-39][(2.0 * self.unit() + 2.0) as usize % 4];
        let (near, far) = (size(), size());
        let (origin, t) = (self.numbers(far), self.number(1e3).abs());
        let direction = (self.numbers(near) - origin) / t;
        let turned = self.vec3().as_dvec3() * f64::from(turn * direction.abs().max_element());
        let way = (direction.as_dvec3() + turned) * f64::from(t);
        // Off by less than 2^-50 of the larger of both terms.
        let (point, off) = (origin.as_dvec3() + way, (origin.abs().as_dvec3() + way.abs()) * 2f64.powi(-50));
        let below = |x: f64| if f64::from(x as f32) <= x { x as f32 } else { (x as f32).next_down() };
        let low = |v: DVec3| Vec3::new(below(v.x), below(v.y), below(v.z));
        let ray = Ray { tmin: t, tmax: t, ..Ray::new(origin, direction) };
        ray.is_valid().then(|| (ray, Aabb { min: low(point - off), max: -low(-point - off) }))
    }
}

/// On a stack of so many entries at most, the one at the bottom among them, what is beyond a limit goes, and all else
/// stays in its order, whatever the instruction set: `kept` has the entries above the bottom, each with where it is
/// entered (the lowest three bits are not part of that), and tells what the stack keeps of them.
pub(super) fn entries_beyond_a_limit_go(
    lens: impl IntoIterator<Item = usize>,
    mut kept: impl FnMut(Present, &[(u32, Child)], f32) -> Vec<(u32, Child)>,
) {
    let mut random = Random::new(4);
    for len in lens {
        for limit in [0.0, 0.3, 0.5, 1.0] {
            let entries: Vec<_> =
                (1..len as u32).map(|i| ((random.vec3().x.abs().to_bits() & !7) | (i % 8), Child::inner(i))).collect();
            let mut expected = entries.clone();
            expected.retain(|(near, _)| f32::from_bits(near & !7) <= limit);
            for isa in Present::all() {
                assert_eq!(kept(isa, &entries, limit), expected, "{isa:?}: {len} entries, up to {limit}");
            }
        }
    }
}
