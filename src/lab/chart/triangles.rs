//! Ways to meet a triangle: nanoseconds a test, at four shares of hits, against rays that slip through between two
//! triangles.

use std::hint::black_box;
use std::time::Instant;

use rayon::prelude::*;

use super::rate::per_million;
use super::scatter::{Panel, Point, Scatter};
use super::{Figure, Setup, csv};
use crate::error::Result;
use crate::lab::bench::Spread;
use crate::lab::oracle::{Body, Primitive, meet};
use crate::math::{Random, Vec3};
use crate::ray::Ray;
use crate::shape::TriangleMethod;

/// Percent of the tests that are hits.
const HIT_RATES: [usize; 4] = [0, 10, 50, 90];
/// Tests that are timed together: few enough to stay in the second-level cache.
const TESTS: usize = 4096;
/// How often they are gone through each time.
const ROUNDS: usize = 16;
/// Rays at an edge that are made from one seed.
const CHUNK: u64 = 10_000;

type Test = (Ray, [Vec3; 3]);

/// Measures and draws.
pub(super) fn figure(setup: &Setup<'_>) -> Result<Figure> {
    setup.step("triangles: leaks")?;
    let chunks = setup.pick(40, 1000);
    let leaks = leaks(chunks);
    let rays: u64 = leaks.rays;
    setup.step("triangles: times")?;
    let turns = setup.pick(7, 31);
    let times = HIT_RATES.map(|percent| times(&tests(percent), turns));

    let names = TriangleMethod::ALL.map(TriangleMethod::name);
    let mut rows = Vec::new();
    let panels = HIT_RATES.iter().zip(&times).map(|(percent, times)| {
        let points = times.iter().zip(leaks.missed).zip(0..).map(|((&x, missed), group)| {
            let y = per_million(missed, rays);
            let numbers = [x.min, x.median, x.max].map(|ns| format!("{ns:.3}"));
            let [min, median, max] = numbers;
            let leaks = [y.median, y.min, y.max].map(|leaks| format!("{leaks:.4}"));
            let [rate, low, high] = leaks;
            let fields = [names[group].to_owned(), percent.to_string(), median, min, max];
            let [method, percent, median, min, max] = fields;
            rows.push([method, percent, median, min, max, missed.to_string(), rays.to_string(), rate, low, high]);
            Point { group, label: String::new(), x, y }
        });
        Panel { title: format!("{percent} % of the rays hit"), points: points.collect() }
    });
    let scatter = Scatter {
        title: "Ways to meet a triangle: time against leaks",
        legend: &names,
        x: "nanoseconds a test",
        y: "leaks in a million rays",
        more_is_better: false,
        joined: false,
        columns: 2,
        panels: panels.collect(),
    };
    let (drawing, size) = scatter.draw();
    let columns = [
        "method",
        "hit_percent",
        "ns",
        "ns_min",
        "ns_max",
        "leaks",
        "rays",
        "leaks_per_million",
        "leaks_low",
        "leaks_high",
    ];
    Ok(Figure {
        name: "triangles",
        title: scatter.title.to_owned(),
        caption: format!(
            "A leak is a ray, aimed at the edge that two random triangles share, which a method lets through between them though in exact \
             arithmetic it meets one; {rays} rays, bars: 95 % intervals (Wilson). Times are those of one thread, one ray and one triangle \
             after another, in f32 as the textbooks write them; medians of {turns} turns in which the methods alternate, bars from the \
             fastest to the slowest. {}",
            setup.made_by()
        ),
        csv: csv(columns, rows),
        drawing,
        size,
    })
}

/// Random triangles, and rays of which so many percent hit theirs, mixed.
fn tests(percent: usize) -> Vec<Test> {
    let mut random = Random::new(11, percent as u64);
    let wanted_hits = TESTS * percent / 100;
    let (mut hits, mut misses) = (Vec::new(), Vec::new());
    while hits.len() < wanted_hits || misses.len() < TESTS - wanted_hits {
        let corners = [(); 3].map(|()| random.vector());
        let [a, b, c] = corners;
        let (u, v) = (random.unit() * 2.0 - 0.5, random.unit() * 2.0 - 0.5);
        let origin = random.vector() * 4.0;
        let ray = Ray::new(origin, a + (b - a) * u + (c - a) * v - origin);
        let is_hit = TriangleMethod::Exact.intersect(&ray, corners).is_some();
        let (list, wanted) = if is_hit { (&mut hits, wanted_hits) } else { (&mut misses, TESTS - wanted_hits) };
        if list.len() < wanted {
            list.push((ray, corners));
        }
    }
    hits.append(&mut misses);
    // Fisher and Yates's shuffle, so that no processor learns the order.
    for i in (1..hits.len()).rev() {
        hits.swap(i, random.below(i as u64 + 1) as usize);
    }
    hits
}

/// Nanoseconds a test, by method.
fn times(tests: &[Test], turns: usize) -> [Spread; TriangleMethod::ALL.len()] {
    let mut samples = [(); TriangleMethod::ALL.len()].map(|()| Vec::new());
    for turn in 0..=turns {
        for (method, samples) in TriangleMethod::ALL.into_iter().zip(&mut samples) {
            let start = Instant::now();
            let mut hits = 0;
            for _ in 0..ROUNDS {
                for (ray, corners) in black_box(tests) {
                    hits += usize::from(method.intersect(ray, *corners).is_some());
                }
            }
            black_box(hits);
            // The first turn warms up.
            if turn > 0 {
                samples.push(start.elapsed().as_secs_f64() * 1e9 / (tests.len() * ROUNDS) as f64);
            }
        }
    }
    samples.each_ref().map(|samples| Spread::of(samples))
}

/// Rays at edges, and how many of them each method let through.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Leaks {
    rays: u64,
    missed: [u64; TriangleMethod::ALL.len()],
}

fn leaks(chunks: u64) -> Leaks {
    let sum = |a: Leaks, b: Leaks| {
        let mut missed = a.missed;
        missed.iter_mut().zip(b.missed).for_each(|(a, b)| *a += b);
        Leaks { rays: a.rays + b.rays, missed }
    };
    (0..chunks).into_par_iter().map(leaks_of_chunk).reduce(Leaks::default, sum)
}

fn leaks_of_chunk(chunk: u64) -> Leaks {
    let mut random = Random::new(12, chunk);
    let mut leaks = Leaks::default();
    while leaks.rays < CHUNK {
        let [a, b, c, d] = [(); 4].map(|()| random.vector());
        let origin = random.vector() * 4.0;
        // The third corners on opposite sides of the plane of origin and edge: seen from there it is no silhouette.
        let side = |p: Vec3| (a - origin).cross(b - origin).dot(p - origin);
        let ray = Ray::new(origin, a.lerp(b, 0.05 + 0.9 * random.unit()) - origin);
        if side(c) * side(d) > -1e-3 {
            continue;
        }
        let triangles = [[a, b, c], [b, a, d]];
        leaks.rays += 1;
        let mut is_met = None;
        for (method, missed) in TriangleMethod::ALL.into_iter().zip(&mut leaks.missed) {
            if triangles.iter().all(|corners| method.intersect(&ray, *corners).is_none()) {
                *missed += u64::from(*is_met.get_or_insert_with(|| meets_any(&ray, &triangles)));
            }
        }
    }
    leaks
}

/// Whether the ray meets a triangle, in exact arithmetic.
fn meets_any(ray: &Ray, triangles: &[[Vec3; 3]]) -> bool {
    triangles.iter().any(|corners| {
        let primitive = Primitive { body: Body::Triangle(*corners), to_world: None };
        meet(ray, &primitive).is_some_and(|meeting| meeting.in_range)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hits_are_as_many_as_were_asked_for() {
        for percent in HIT_RATES {
            let tests = tests(percent);
            let hits = tests.iter().filter(|(ray, corners)| meets_any(ray, std::slice::from_ref(corners))).count();
            assert_eq!((tests.len(), hits), (TESTS, TESTS * percent / 100));
        }
    }

    #[test]
    fn the_textbooks_leak_and_the_exact_test_does_not() {
        let leaks = leaks(4);
        assert_eq!((leaks.rays, leaks), (4 * CHUNK, self::leaks(4)));
        let of = |method: TriangleMethod| {
            leaks.missed[TriangleMethod::ALL.iter().position(|&m| m == method).expect("one of all")]
        };
        assert!(of(TriangleMethod::MoellerTrumbore) > 100 && of(TriangleMethod::SidePlanes) > 100, "{leaks:?}");
        assert_eq!(of(TriangleMethod::Exact), 0);
    }
}
