//! A disk as a point sees it: a spherical ellipse, whose directions are chosen nearly evenly by the solid angle that it
//! fills. Seen along the axis of the cone through it, it is an ellipse (Guillén, Ureña, King, Fajardo, Georgiev,
//! López-Moreno, Jarabo 2017, *Area-preserving parameterizations for spherical ellipses*).

use std::f64::consts::TAU;

use crate::math::{DVec2, DVec3, tangents};

/// The part of the unit sphere around a point that a disk fills.
pub(super) struct SphericalEllipse {
    /// Unit vectors along the axes of the ellipse, and along that of the cone.
    axes: [DVec3; 3],
    /// Sines of the half angles that the ellipse fills along its axes.
    half: DVec2,
    /// Across the disk, away from the point; how far off its plane is, and its farthest point.
    across: DVec3,
    height: f64,
    farthest: f64,
}

impl SphericalEllipse {
    /// What `point` sees of the disk. None where it turns its back, for a point in its plane, and where it is far away
    /// for its size: there an even choice by area is nearly one by solid angle.
    pub(super) fn seen_from(point: DVec3, centre: DVec3, normal: DVec3, radius: f64) -> Option<Self> {
        let (offset, across) = (centre - point, -normal);
        let height = offset.dot(across);
        let along = offset - across * height;
        let middle = along.length();
        // Half edges of rectangles are held against as much.
        let nearest = (middle - radius).max(0.0).powi(2) + height * height;
        if nearest > 16.0 * radius * radius || height < 1e-6 * radius {
            return None;
        }
        // Straight above the middle what is left is rounding, and any way is outward. Elsewhere as little of `across`
        // is left in it as f64 can tell.
        let outward = if middle > 1e-9 * height {
            let outward = along / middle;
            (outward - across * outward.dot(across)).normalize()
        } else {
            tangents(across)[0]
        };
        // The nearest and the farthest end, in the plane through the point and the disk's axis. That of the cone
        // divides the angle between them in halves, and so the diameter in the ratio of their distances.
        let ends = [middle - radius, middle + radius].map(|end| DVec2::new(end, height));
        let [near, far] = ends.map(DVec2::length);
        let met = DVec2::new(ends[0].x + 2.0 * radius * near / (near + far), height);
        let half_chord = 2.0 * radius * (near * far).sqrt() / (near + far);
        let z = (outward * met.x + across * met.y) / met.length();
        let x = across.cross(outward);
        let half =
            DVec2::new(half_chord / half_chord.hypot(met.length()), (ends[0] / near - ends[1] / far).length() / 2.0);
        Some(Self { axes: [x, z.cross(x), z], half, across, height, farthest: far })
    }

    /// From the point to where a direction meets the disk, which `xi`, a point of the unit square, chooses, and how
    /// densely such directions are chosen, per steradian.
    pub(super) fn at(&self, xi: DVec2) -> (DVec3, f64) {
        let angle = xi.x * TAU;
        let rim = self.half * DVec2::new(libm::cos(angle), libm::sin(angle));
        let squared = rim.length_squared();
        // 1 - cos of the angle off the axis, evenly up to the rim.
        let off = xi.y * squared / (1.0 + cosine(squared));
        let side = rim * ((off * (2.0 - off)).max(0.0) / squared).sqrt();
        let [x, y, z] = self.axes;
        let direction = x * side.x + y * side.y + z * (1.0 - off);
        let distance = self.height / direction.dot(self.across);
        // At the rim rounding may lead past the disk, or nearly along it.
        let distance = if distance > 0.0 { distance.min(self.farthest) } else { self.farthest };
        (direction * distance, self.pdf_to_rim(squared))
    }

    /// How densely [`Self::at`] chooses the direction of `offset`, which meets the disk, per steradian.
    pub(super) fn pdf(&self, offset: DVec3) -> f64 {
        let [x, y, _] = self.axes;
        let side = DVec2::new(offset.dot(x), offset.dot(y));
        let share = (side / self.half).length_squared();
        self.pdf_to_rim(if share > 0.0 { side.length_squared() / share } else { self.half.x * self.half.x })
    }

    /// Towards a point of the rim, as its direction is chosen evenly around the ellipse. It differs by a factor of 2 at
    /// most.
    fn pdf_to_rim(&self, squared: f64) -> f64 {
        (1.0 + cosine(squared)) / (TAU * self.half.x * self.half.y)
    }
}

/// Of the angle off the axis, by its sine squared.
fn cosine(squared: f64) -> f64 {
    (1.0 - squared).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CENTRE: DVec3 = DVec3::new(0.3, -0.2, 0.5);
    const RADIUS: f64 = 1.7;

    fn normal() -> DVec3 {
        DVec3::new(0.6, -0.3, 0.8).normalize()
    }

    /// From the disk's middle, in units of its radius: along it, and off its plane.
    fn place(right: f64, up: f64, away: f64) -> DVec3 {
        let [x, y] = tangents(normal());
        CENTRE + (x * right + y * up + normal() * away) * RADIUS
    }

    /// The solid angle of a disk around a place, by triangles around its middle (van Oosterom, Strackee 1983).
    fn by_triangles(point: DVec3, [right, up]: [f64; 2], share: f64) -> f64 {
        let corner = |i: i32| {
            let angle = f64::from(i) / 20_000.0 * TAU;
            (place(right + share * angle.cos(), up + share * angle.sin(), 0.0) - point).normalize()
        };
        let middle = (place(right, up, 0.0) - point).normalize();
        let triangle = |i: i32| {
            let (b, c) = (corner(i), corner(i + 1));
            2.0 * middle.cross(b).dot(c).atan2(1.0 + middle.dot(b) + b.dot(c) + c.dot(middle))
        };
        (0..20_000).map(triangle).sum::<f64>().abs()
    }

    const PLACES: [[f64; 3]; 7] = [
        [0.0, 0.0, 1.0],
        [0.0, 0.0, 1e-4],
        [0.3, -0.6, 0.2],
        [1.2, 0.5, 0.05],
        [0.7, 0.7, 0.003],
        [-2.5, 1.0, 0.4],
        [0.4, 0.2, 3.5],
    ];

    /// Directions, each for as much as the pdf says, fill the solid angle of the disk and of each part of it.
    #[test]
    fn disks_and_their_parts_fill_their_solid_angles() {
        for [right, up, away] in PLACES {
            let point = place(right, up, away);
            let seen = SphericalEllipse::seen_from(point, CENTRE, normal(), RADIUS).expect("it is near");
            let parts = [([0.0, 0.0], 1.0), ([0.3, 0.4], 0.4), ([-0.5, 0.2], 0.3), ([0.0, -0.6], 0.39)];
            let (side, mut sums) = (600, [0.0; 4]);
            for k in 0..side * side {
                let xi = (DVec2::new(f64::from(k % side), f64::from(k / side)) + 0.5) / f64::from(side);
                let (offset, pdf) = seen.at(xi);
                let at = point + offset;
                assert!((at - CENTRE).length() < RADIUS * (1.0 + 1e-9), "{right} {up} {away}: {at}");
                assert!((at - CENTRE).dot(normal()).abs() < 1e-9, "{right} {up} {away}: {at}");
                let again = seen.pdf(offset);
                assert!((again / pdf - 1.0).abs() < 1e-6, "{right} {up} {away}: {again} {pdf}");
                for (sum, ([right, up], share)) in sums.iter_mut().zip(parts) {
                    if (at - place(right, up, 0.0)).length() <= share * RADIUS * (1.0 + 1e-9) {
                        *sum += 1.0 / pdf / f64::from(side * side);
                    }
                }
            }
            for (sum, (middle, share)) in sums.into_iter().zip(parts) {
                let expected = by_triangles(point, middle, share);
                assert!((sum - expected).abs() < 0.002 * sums[0], "{right} {up} {away}, {middle:?}: {sum} {expected}");
            }
        }
    }

    #[test]
    fn what_is_far_or_seen_from_the_side_or_from_behind_is_left_to_others() {
        for [right, up, away] in [[0.0, 0.0, 4.5], [1.5, 0.0, 0.0], [0.1, 0.2, -0.5]] {
            assert!(SphericalEllipse::seen_from(place(right, up, away), CENTRE, normal(), RADIUS).is_none());
        }
    }
}
