//! How a scene is to be searched for what a ray hits: names and numbers alone, which scene files and flags share.
//! [`trace::accel`](crate::trace::accel) has what they stand for.

use crate::math::UVec3;
use crate::shape::{SphereMethod, TriangleMethod};

/// How a scene is searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Accel {
    /// The native [`Bvh`](crate::trace::bvh::Bvh), which is what renders.
    #[default]
    Bvh,
    /// Nothing: every primitive for every ray.
    Brute,
    /// A flat list of bounding volumes, one a geometry.
    Groups,
    /// A binary BVH.
    Binary,
    /// A uniform grid, nested where it is crowded.
    Grid,
    /// An octree.
    Octree,
    /// A kd-tree.
    Kd,
    /// A BSP tree of general planes.
    Bsp,
}

impl Accel {
    /// All of them.
    pub const ALL: [Self; 8] =
        [Self::Bvh, Self::Brute, Self::Groups, Self::Binary, Self::Grid, Self::Octree, Self::Kd, Self::Bsp];

    /// As flags, files and reports have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bvh => "bvh",
            Self::Brute => "brute",
            Self::Groups => "groups",
            Self::Binary => "binary-bvh",
            Self::Grid => "grid",
            Self::Octree => "octree",
            Self::Kd => "kd-tree",
            Self::Bsp => "bsp",
        }
    }

    /// Whether it can meet primitives by a method other than the exact one.
    pub const fn has_methods(self) -> bool {
        !matches!(self, Self::Bvh | Self::Brute)
    }
}

/// How many cells a grid has. Halved along all axes as often as it takes to have no more than
/// [`Resolution::MAX_CELLS`], and than a billion references to items.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// So many along the longest side; cubes.
    Longest(u32),
    /// So many along each axis.
    Axes(UVec3),
}

impl Resolution {
    /// Most cells along an axis.
    pub const MAX: u32 = 2048;
    /// Most cells: 1 GB of numbers that say where their items are.
    pub const MAX_CELLS: u64 = 1 << 28;

    /// Of one number, or of three.
    ///
    /// # Errors
    /// What was expected instead.
    pub fn of_sides(sides: &[u32]) -> Result<Self, String> {
        let most = Self::MAX;
        if !matches!(sides.len(), 1 | 3) || !sides.iter().all(|side| (1..=most).contains(side)) {
            return Err(format!("one number of cells or three, each 1 to {most}"));
        }
        match *sides {
            [x, y, z] if u64::from(x) * u64::from(y) * u64::from(z) > Self::MAX_CELLS => {
                Err(format!("at most {} cells in all", Self::MAX_CELLS))
            }
            [x, y, z] => Ok(Self::Axes(UVec3::new(x, y, z))),
            _ => Ok(Self::Longest(sides[0])),
        }
    }
}

/// What is asked of the search, as far as anything is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AcceleratorRequest {
    /// The accelerator.
    pub accel: Option<Accel>,
    /// Cells of a grid.
    pub grid: Option<Resolution>,
    /// How triangles are met.
    pub triangle_method: Option<TriangleMethod>,
    /// How spheres are met.
    pub sphere_method: Option<SphereMethod>,
}

impl AcceleratorRequest {
    /// What is said here, and what `other` says of the rest. Whoever names an accelerator says, too, that it is not the
    /// other's grid.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        let accel = self.accel.or(other.accel);
        Self {
            accel,
            grid: self.grid.or(other.grid.filter(|_| accel == Some(Accel::Grid))),
            triangle_method: self.triangle_method.or(other.triangle_method),
            sphere_method: self.sphere_method.or(other.sphere_method),
        }
    }

    /// Whether a method other than the exact one is asked for.
    pub fn asks_for_methods(&self) -> bool {
        self.triangle_method.unwrap_or_default() != TriangleMethod::Exact
            || self.sphere_method.unwrap_or_default() != SphereMethod::Exact
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_first_wins_and_the_rest_is_taken_over() {
        let file = AcceleratorRequest {
            accel: Some(Accel::Grid),
            grid: Some(Resolution::Longest(7)),
            triangle_method: Some(TriangleMethod::Woop),
            sphere_method: None,
        };
        assert_eq!(AcceleratorRequest::default().or(file), file);
        let flag = AcceleratorRequest {
            accel: Some(Accel::Kd),
            sphere_method: Some(SphereMethod::Accurate),
            ..AcceleratorRequest::default()
        };
        let both = flag.or(file);
        assert_eq!((both.accel, both.grid), (Some(Accel::Kd), None), "a kd-tree has no cells");
        assert_eq!((both.triangle_method, both.sphere_method), (file.triangle_method, flag.sphere_method));
        let finer = AcceleratorRequest { grid: Some(Resolution::Longest(9)), ..AcceleratorRequest::default() };
        assert_eq!(finer.or(file).grid, finer.grid);
        assert!(both.asks_for_methods() && !AcceleratorRequest::default().asks_for_methods());
    }

    #[test]
    fn resolutions_have_limits() {
        assert_eq!(Resolution::of_sides(&[64]), Ok(Resolution::Longest(64)));
        assert_eq!(Resolution::of_sides(&[1, 2048, 3]), Ok(Resolution::Axes(UVec3::new(1, 2048, 3))));
        for sides in [&[][..], &[0], &[2049], &[1, 2], &[2048, 2048, 2048]] {
            assert!(Resolution::of_sides(sides).is_err(), "{sides:?}");
        }
    }
}
