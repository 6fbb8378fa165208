//! Rays that are no bundle as a whole, divided by the octant that they run into.

use crate::math::Vec3;
use crate::ray::Ray;
use crate::trace::bvh::simd::RAYS;

/// Fewer rays than this are better traced one by one.
const FEWEST: u32 = 6;

/// For each octant that is still to come, a bit for each ray that runs into it.
pub(super) struct Octants([u64; 8]);

impl Octants {
    /// Those of up to 64 rays; rays that are not valid are in none.
    pub fn new(rays: &[Ray]) -> Self {
        let mut octants = [0; 8];
        for (i, ray) in rays.iter().enumerate() {
            let d = ray.direction;
            let octant = usize::from(d.x < 0.0) | usize::from(d.y < 0.0) << 1 | usize::from(d.z < 0.0) << 2;
            octants[octant] |= u64::from(ray.is_valid()) << i;
        }
        Self(octants)
    }
}

impl Iterator for Octants {
    type Item = u64;

    /// The rays of the next octant with enough of them.
    fn next(&mut self) -> Option<u64> {
        let next = self.0.iter_mut().find(|members| members.count_ones() >= FEWEST)?;
        Some(std::mem::take(next))
    }
}

/// Some of the rays, side by side.
pub(super) struct Part {
    pub rays: [Ray; RAYS],
    /// Which each of them is.
    index: [u8; RAYS],
    pub count: usize,
}

impl Part {
    pub fn new() -> Self {
        Self { rays: [Ray::new(Vec3::ZERO, Vec3::X); RAYS], index: [0; RAYS], count: 0 }
    }

    /// Takes those of the bit mask, of which there are some.
    pub fn gather(&mut self, rays: &[Ray], members: u64) {
        let mut rest = members;
        self.count = 0;
        while rest != 0 {
            let index = rest.trailing_zeros();
            (self.index[self.count], self.rays[self.count]) = (index as u8, rays[index as usize]);
            rest &= rest - 1;
            self.count += 1;
        }
        // What fills the last group is traced, and forgotten.
        let last = self.rays[self.count - 1];
        self.rays[self.count..].fill(last);
    }

    /// Which of all those are of the bit mask, whose bits are of the part.
    pub fn members(&self, mut mask: u64) -> u64 {
        let mut members = 0;
        while mask != 0 {
            members |= 1 << self.index[mask.trailing_zeros() as usize];
            mask &= mask - 1;
        }
        members
    }

    /// Brings what belongs to each of them to where it belongs among all.
    pub fn scatter<T: Copy>(&self, from: &[T; RAYS], to: &mut [T]) {
        for (&index, &value) in self.index[..self.count].iter().zip(from) {
            to[usize::from(index)] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_are_those_that_were_gathered() {
        let rays: Vec<Ray> = (0..12_u8).map(|i| Ray::new(Vec3::splat(i.into()), Vec3::X)).collect();
        let mut part = Part::new();
        part.gather(&rays, 0b1011_0100_0010);
        assert_eq!((part.count, part.members(0b1_1111)), (5, 0b1011_0100_0010));
        for (place, &index) in [1, 6, 8, 9, 11].iter().enumerate() {
            assert_eq!(part.members(1 << place), 1 << index);
            assert_eq!(part.rays[place], rays[index]);
        }
    }
}
