//! Which points are inside, by rays that are counted.

use twincast::math::DVec3;
use twincast::trace::precise::{PreciseRay, PreciseScene};

use crate::scene::Scene;

/// Directions without a simple relation to axes or to each other: of a spiral on the sphere. The first is trimesh's.
fn direction(sample: usize) -> DVec3 {
    if sample == 0 {
        return DVec3::new(0.439_506_445_5, 0.617_598_629_942, 0.652_231_566_745);
    }
    let (share, turn) = (sample as f64 * 0.754_877_666_246_692_8, sample as f64 * 3.883_222_077_450_933);
    let z = 1.0 - 2.0 * share.fract();
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * turn.cos(), r * turn.sin(), z)
}

impl Scene {
    /// Whether each point is inside of meshes that are closed when they are [`counted`](Scene::counted); `squares` are
    /// the points' squared distances from these, or NaN. A ball around a point that holds no triangle is all inside or
    /// all outside, so of points along a curve few need be asked.
    pub fn are_inside_closed(&self, counted: &PreciseScene, points: &[DVec3], squares: &[f64], inside: &mut [bool]) {
        // Points that are asked, and of each point which of them tells.
        let (mut asked, mut tells) = (Vec::new(), Vec::with_capacity(points.len()));
        let mut last = (DVec3::NAN, 0.0);
        for (&point, &distance_squared) in points.iter().zip(squares) {
            let clearance = self.precise.clearance(point, distance_squared);
            let (other, other_clearance): (DVec3, f64) = last;
            let is_same = (point - other).length() * (1.0 + 1e-9) < clearance.max(other_clearance);
            if !is_same {
                asked.push(point);
            }
            tells.push(asked.len() - 1);
            last = (point, clearance);
        }
        let odd = are_odd(counted, &asked, direction(0));
        inside.iter_mut().zip(tells).for_each(|(inside, tells)| *inside = odd[tells]);
    }
}

/// Whether each point is inside, by the vote of so many rays; see [`Scene`]'s `inside`.
pub fn are_inside(counted: &PreciseScene, points: &[DVec3], samples: usize, both_ways: bool, inside: &mut [bool]) {
    let mut votes = vec![0; points.len()];
    for sample in 0..samples {
        let mut odd = are_odd(counted, points, direction(sample));
        if both_ways {
            // Only of those that may still be inside.
            let open: Vec<usize> = (0..points.len()).filter(|&i| odd[i]).collect();
            let some: Vec<DVec3> = open.iter().map(|&i| points[i]).collect();
            for (i, is_odd) in open.into_iter().zip(are_odd(counted, &some, -direction(sample))) {
                odd[i] = is_odd;
            }
        }
        votes.iter_mut().zip(odd).for_each(|(votes, odd)| *votes += usize::from(odd));
    }
    inside.iter_mut().zip(votes).for_each(|(inside, votes)| *inside = 2 * votes > samples);
}

/// Whether a ray from each point crosses the meshes an odd number of times.
fn are_odd(counted: &PreciseScene, points: &[DVec3], direction: DVec3) -> Vec<bool> {
    let rays: Vec<PreciseRay> = points.iter().map(|&point| PreciseRay::new(point, direction)).collect();
    let mut counts = vec![0; rays.len()];
    counted.count_batch(&rays, &mut counts);
    counts.iter().map(|count| count % 2 == 1).collect()
}
