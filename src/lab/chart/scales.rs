//! Where ways to meet a triangle fail: by how large it is, and how far from the origin of coordinates.
//!
//! Rays are aimed at points of the triangle and of its surroundings, and an answer is wrong where exact arithmetic, of
//! the very corners and rays that the method was given, says otherwise. Far from the origin f32 has no room for small
//! triangles: corners fall on the same few numbers, which the oracle sees as well.

use rayon::prelude::*;

use super::heat::{Heat, Map};
use super::{Figure, Setup, csv};
use crate::error::Result;
use crate::lab::oracle::{Body, Primitive, meet};
use crate::math::Random;
use crate::ray::Ray;
use crate::shape::TriangleMethod;

/// Powers of ten: sizes, from the top; distances, from the left.
const SIZES: [i32; 13] = [6, 5, 4, 3, 2, 1, 0, -1, -2, -3, -4, -5, -6];
const DISTANCES: [i32; 9] = [0, 1, 2, 3, 4, 5, 6, 7, 8];
const METHODS: usize = TriangleMethod::ALL.len();

/// Wrong answers of each method.
type Wrong = [u64; METHODS];

/// Measures and draws.
pub(super) fn figure(setup: &Setup<'_>) -> Result<Figure> {
    setup.step("scales")?;
    let rays = setup.pick(400, 10_000);
    let cells: Vec<(i32, i32)> = SIZES.iter().flat_map(|&size| DISTANCES.map(|distance| (size, distance))).collect();
    let wrong: Vec<Wrong> = cells.par_iter().map(|&(size, distance)| wrong(size, distance, rays)).collect();
    let maps = TriangleMethod::ALL.iter().enumerate().map(|(i, method)| {
        let shares: Vec<f64> = wrong.iter().map(|wrong| wrong[i] as f64 / rays as f64).collect();
        Map { title: method.name().to_owned(), rows: shares.chunks(DISTANCES.len()).map(<[f64]>::to_vec).collect() }
    });
    let rows = cells.iter().zip(&wrong).flat_map(|(&(size, distance), wrong)| {
        TriangleMethod::ALL.iter().zip(wrong).map(move |(method, wrong)| {
            [
                method.name().to_owned(),
                format!("1e{size}"),
                format!("1e{distance}"),
                wrong.to_string(),
                rays.to_string(),
            ]
        })
    });
    let power = |power: &i32| format!("1e{power}");
    let heat = Heat {
        title: "Ways to meet a triangle: wrong answers by its size and its distance from the origin",
        columns: (DISTANCES.iter().map(power).collect(), "distance from the origin"),
        rows: (SIZES.iter().map(power).collect(), "size of the triangle"),
        maps: maps.collect(),
    };
    let (drawing, size) = heat.draw();
    Ok(Figure {
        name: "scales",
        title: heat.title.to_owned(),
        caption: format!(
            "The share of {rays} rays a cell that a method answers otherwise than exact arithmetic does for the same f32 corners and rays: \
             a hit for a miss, or a miss for a hit. Half of the rays are aimed at points within a hundredth of an edge, seen from a \
             few sizes away. White is none: the first cell of a column, from the top, that is not white is the first scale that fails at that \
             distance. {}",
            setup.made_by()
        ),
        csv: csv(["method", "size", "distance", "wrong", "rays"], rows),
        drawing,
        size,
    })
}

/// Of rays at triangles of a size, at a distance.
fn wrong(size: i32, distance: i32, rays: u64) -> Wrong {
    let mut random = Random::new(13, ((size + 100) as u64) << 32 | (distance + 100) as u64);
    let (size, distance) = (10f32.powi(size), 10f32.powi(distance));
    let mut wrong = Wrong::default();
    for i in 0..rays {
        let centre = random.direction() * distance;
        let corners = [(); 3].map(|()| centre + random.vector() * size);
        let [a, b, c] = corners;
        let (u, v) = if i % 2 == 0 {
            // Across the edge from the first corner to the second.
            (random.unit(), (random.unit() - 0.5) * 0.02)
        } else {
            (random.unit() * 1.4 - 0.2, random.unit() * 1.4 - 0.2)
        };
        let origin = centre + random.direction() * (size * (2.0 + random.unit()));
        let ray = Ray::new(origin, a + (b - a) * u + (c - a) * v - origin);
        let primitive = Primitive { body: Body::Triangle(corners), to_world: None };
        let expected = meet(&ray, &primitive).is_some_and(|meeting| meeting.in_range);
        for (method, wrong) in TriangleMethod::ALL.into_iter().zip(&mut wrong) {
            *wrong += u64::from(method.intersect(&ray, corners).is_some() != expected);
        }
    }
    wrong
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exact_test_is_never_wrong_and_the_textbooks_are_far_away() {
        let exact = TriangleMethod::ALL.iter().position(|&method| method == TriangleMethod::Exact).expect("one of all");
        for (size, distance) in [(6, 0), (0, 0), (0, 4), (-3, 3), (-6, 8)] {
            assert_eq!(wrong(size, distance, 300)[exact], 0, "{size} {distance}");
        }
        let (near, far) = (wrong(0, 0, 2000), wrong(0, 5, 2000));
        for i in (0..METHODS).filter(|&i| i != exact) {
            assert!(near[i] < 100, "{near:?}");
        }
        assert!((0..METHODS).any(|i| far[i] > 20), "{far:?}");
    }
}
