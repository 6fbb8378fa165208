//! Scenes written by hand that lie far from zero: moved, they are hit as they are where they stand.

use twincast::io::save;
use twincast::math::{DAffine3, DVec3, Vec3};
use twincast::scene::{Geometry, Light, Scene};
use twincast::shade::{Attributes, SurfacePoint};
use twincast::trace::brute::Brute;
use twincast::trace::bvh::Bvh;
use twincast::{Ray, Shape, Tracer, World};

use super::{Files, refused_bytes};

/// A place on a map in metres: easting, northing, height.
const AWAY: DVec3 = DVec3::new(4500000.3, -1200000.7, 77.1);
const PLACES: [DVec3; 3] = [AWAY, DVec3::new(0.0, 0.0, 1e7), DVec3::new(-2000000.1, 3000000.7, 300.3)];
/// Of what is measured; 2 mm is a wire's thickness.
const SIZES: [f64; 3] = [1.0, 0.002, 300.0];

/// Writes points of a scene of size 1 about zero for one of another size elsewhere.
#[derive(Clone, Copy)]
struct Writer {
    place: DVec3,
    size: f64,
}

impl Writer {
    fn point(self, p: [f64; 3]) -> DVec3 {
        self.place + DVec3::from(p) * self.size
    }

    fn toml(self, p: [f64; 3]) -> String {
        let DVec3 { x, y, z } = self.point(p);
        format!("[{x}, {y}, {z}]")
    }

    fn words(self, p: [f64; 3]) -> String {
        let DVec3 { x, y, z } = self.point(p);
        format!("{x} {y} {z}")
    }
}

/// A shape by its table, a `{}` for the prefix of its group.
type Table = (&'static str, fn(Writer) -> String);

const TABLES: [Table; 11] = [
    ("sphere", |w| format!("centre = {}\nradius = {}", w.toml([0.1, 0.2, -0.1]), 0.7 * w.size)),
    ("plane", |w| format!("point = {}\nnormal = [0.3, 1, -0.2]", w.toml([0.1, 0.2, -0.1]))),
    ("disk", |w| format!("centre = {}\nnormal = [0.3, 1, 0.4]\nradius = {}", w.toml([0.1, 0.0, 0.1]), 0.7 * w.size)),
    ("box", |w| format!("min = {}\nmax = {}", w.toml([-0.5, -0.3, -0.4]), w.toml([0.4, 0.6, 0.3]))),
    ("cylinder", |w| {
        format!("base = {}\napex = {}\nradius = {}", w.toml([-0.6, 0.0, 0.1]), w.toml([0.5, 0.1, 0.0]), 0.4 * w.size)
    }),
    ("cylinder", |w| {
        let (base, apex) = (w.toml([0.0, -0.6, 0.1]), w.toml([0.1, 0.6, 0.0]));
        format!("base = {base}\napex = {apex}\nradius = {}\ncapped = false", 0.6 * w.size)
    }),
    ("cone", |w| {
        let (base, apex) = (w.toml([0.0, -0.5, 0.1]), w.toml([0.1, 0.6, 0.0]));
        format!("base = {base}\nbase_radius = {}\napex = {apex}\napex_radius = {}", 0.7 * w.size, 0.2 * w.size)
    }),
    ("ellipsoid", |w| {
        let [a, b, c] = [0.7, 0.5, 0.4].map(|radius| radius * w.size);
        format!("centre = {}\nradii = [{a}, {b}, {c}]", w.toml([0.1, 0.0, -0.1]))
    }),
    ("polygon", |w| {
        let corners = [[-0.6, 0.0, -0.5], [0.7, 0.1, -0.5], [0.7, 0.1, 0.6], [0.1, 0.054, 0.0], [-0.6, 0.0, 0.5]];
        format!("corners = [{}]", corners.map(|p| w.toml([p[0], p[0] / 13.0, p[2]])).join(", "))
    }),
    ("triangle", |w| {
        format!("corners = [{}]", [[-0.7, 0.0, -0.5], [0.7, 0.1, -0.5], [0.0, 0.2, 0.6]].map(|p| w.toml(p)).join(", "))
    }),
    ("mesh", |w| {
        let positions = [[-0.7, 0.0, -0.5], [0.7, 0.1, -0.5], [0.0, 0.2, 0.6]].map(|p| w.toml(p)).join(", ");
        format!("positions = [{positions}]\ntriangles = [[0, 1, 2]]")
    }),
];

/// Tables in a group of this name, or at the top of the file.
fn tables(tables: &[Table], group: Option<&str>, writer: Writer) -> String {
    let prefix = group.map_or(String::new(), |name| format!("group.{name}."));
    tables.iter().map(|(kind, keys)| format!("[[{prefix}{kind}]]\n{}\n", keys(writer))).collect()
}

fn toml(text: &str) -> Scene {
    Files::one("a.toml", text).scene("a.toml")
}

/// What a ray meets: how far off, in units of the size, and the cosine between it and the normal there.
type Met = Option<(f64, f64)>;

/// What rays meet from all around at a time. A grid, slightly turned, so that none touches an edge.
fn distances(scene: &Scene, Writer { place, size }: Writer, time: f32) -> Vec<Met> {
    let world = World::new(scene).expect("a world");
    let (bvh, brute) = (Bvh::build(&world), Brute::new(&world));
    let sides = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let targets = (-3..=3).flat_map(|i| (-3..=3).map(move |k| (f64::from(i) * 0.107, f64::from(k) * 0.093)));
    let mut found = Vec::new();
    for (a, b) in targets {
        for direction in sides {
            let direction = direction + Vec3::new(0.03, -0.02, 0.05);
            let across = DVec3::new(a, b, 0.7 * a - 0.3 * b);
            let ray = world.ray(place + (across - direction.as_dvec3() * 3.0) * size, direction);
            let ray = Ray { time, ..ray };
            let hit = bvh.closest(&ray);
            assert_eq!(hit, brute.closest(&ray));
            found.push(hit.map(|hit| {
                let point = SurfacePoint::new(scene, &world, &ray, &hit, Attributes::default());
                (f64::from(hit.t) / size, point.normal.dot(direction.as_dvec3().normalize()).abs())
            }));
        }
    }
    found
}

/// Whether both are hit alike: within the tolerance across the surface, so that along a ray that grazes it there is
/// more.
#[track_caller]
fn assert_alike(what: &str, found: &[Met], expected: &[Met], tolerance: f64) {
    assert!(expected.iter().flatten().count() > 10, "{what}: too few hits");
    for (i, pair) in found.iter().zip(expected).enumerate() {
        let is_alike = match pair {
            (Some((found, _)), Some((expected, cosine))) => (found - expected).abs() * cosine <= tolerance,
            (None, None) => true,
            _ => false,
        };
        assert!(is_alike, "{what}, ray {i}: {pair:?}");
    }
}

fn writers() -> impl Iterator<Item = (Writer, Writer)> {
    let with_place = |place| SIZES.map(|size| (Writer { place: DVec3::ZERO, size }, Writer { place, size }));
    PLACES.into_iter().flat_map(with_place)
}

/// 1e-5 of the size, and what f64 keeps of the file's own decimals there.
fn tolerance(writer: Writer) -> f64 {
    1e-5 + 8.0 * f64::EPSILON * writer.place.length() / writer.size
}

#[test]
fn each_shape_of_a_toml_file() {
    for (zero, away) in writers() {
        // A plane has no middle of its own; it is among the others below.
        for table in TABLES.into_iter().filter(|(kind, _)| *kind != "plane") {
            let [near, far] = [zero, away].map(|writer| distances(&toml(&tables(&[table], None, writer)), writer, 0.0));
            let what = format!("{} of size {} at {}", table.0, away.size, away.place);
            assert_alike(&what, &far, &near, tolerance(away));
        }
    }
}

/// Shapes, triangles and meshes meet as they do at zero: what a ray hits first is the same.
#[test]
fn all_of_them_fit_together() {
    for (zero, away) in writers() {
        let [near, far] = [zero, away].map(|writer| toml(&tables(&TABLES, None, writer)));
        let [a, b] = [distances(&near, zero, 0.0), distances(&far, away, 0.0)];
        assert_alike(&format!("all, of size {} at {}", away.size, away.place), &b, &a, tolerance(away));
        assert_eq!(near.primitive_count(), far.primitive_count());
    }
}

#[test]
fn each_shape_of_an_nff_file() {
    let fill = "f 1 1 1 1 0 0 0 0\n";
    type Text = fn(Writer) -> String;
    let texts: [(&str, Text); 4] = [
        ("sphere", |w| format!("s {} {}\n", w.words([0.1, 0.2, -0.1]), 0.7 * w.size)),
        ("cylinder", |w| {
            let radius = 0.5 * w.size;
            format!("c\n{} {radius}\n{} {radius}\n", w.words([-0.6, 0.0, 0.1]), w.words([0.5, 0.1, 0.0]))
        }),
        ("cone", |w| {
            let [base, apex] = [[-0.6, 0.0, 0.1], [0.5, 0.1, 0.0]].map(|p| w.words(p));
            format!("c\n{base} {}\n{apex} {}\n", 0.7 * w.size, 0.3 * w.size)
        }),
        ("polygon", |w| {
            let corners = [[-0.6, 0.0, -0.5], [0.7, 0.0, -0.5], [0.7, 0.0, 0.6], [-0.6, 0.0, 0.5]];
            format!("p 4\n{}\n", corners.map(|p| w.words(p)).join("\n"))
        }),
    ];
    for (zero, away) in writers() {
        for (kind, text) in texts {
            let scene = |writer| Files::one("a.nff", format!("{fill}{}", text(writer))).scene("a.nff");
            let [near, far] = [zero, away].map(|writer| distances(&scene(writer), writer, 0.0));
            assert_alike(&format!("{kind} of size {} at {}", away.size, away.place), &far, &near, tolerance(away));
            // As it was, and no triangles.
            let Geometry::Shapes { shapes, .. } = &scene(away).geometries[0] else { panic!("{kind} is divided") };
            assert_eq!(shapes[0].name(), kind);
        }
    }
}

/// By their own numbers, and by the transform that places them; spheres that it makes ellipsoids of too.
#[test]
fn each_sphere_of_a_test_file() {
    for (zero, away) in writers() {
        for stretched in ["", "scale 1 1.5 0.5\n"] {
            let by_numbers = |w: Writer| format!("{stretched}sphere {} {}\n", w.words([0.1, 0.2, -0.1]), 0.7 * w.size);
            let by_transform = |w: Writer| {
                let at = w.words([0.1, 0.2, -0.1]);
                format!("pushTransform\ntranslate {at}\n{stretched}sphere 0 0 0 {}\npopTransform\n", 0.7 * w.size)
            };
            let scene = |text: String| Files::one("a.test", text).scene("a.test");
            let [near, far] = [zero, away].map(|writer| distances(&scene(by_transform(writer)), writer, 0.0));
            let what = format!("sphere of size {} at {}, {stretched:?}", away.size, away.place);
            assert_alike(&what, &far, &near, tolerance(away));
            if stretched.is_empty() {
                assert_alike(&what, &distances(&scene(by_numbers(away)), away, 0.0), &near, tolerance(away));
            }
        }
    }
}

/// Far shapes in groups that are brought back, turned, scaled and moved, in groups of groups, once and several times.
#[test]
fn groups_place_far_shapes() {
    let turn = "{ rotate = [1, 2, 3, 40] }, { scale = 1.2 }";
    for (_, away) in writers() {
        let back = format!("{{ translate = {} }}", Writer { place: -away.place, size: 1.0 }.toml([0.0; 3]));
        let zero = Writer { place: DVec3::ZERO, size: away.size };
        let step = |p: [f64; 3]| format!("{{ translate = {} }}", zero.toml(p));
        // The outer group scales and moves; the inner one brings back.
        let text = |writer: Writer, back: &str| {
            let shapes = tables(&TABLES[..9], Some("inner"), writer);
            let inner = format!("[[group.outer.instance]]\ngroup = \"inner\"\ntransform = [{}{back}]\n", "");
            let once = format!("[[instance]]\ngroup = \"outer\"\ntransform = [{turn}]\n");
            let twice = format!("[[instance]]\ngroup = \"outer\"\ntransform = [{}]\n", step([0.3, 0.1, 0.9]));
            let (start, end) = (step([-0.3, 0.2, 0.1]), step([0.5, -0.4, 0.3]));
            let moving = format!("[[instance]]\ngroup = \"outer\"\ntransform = [{start}]\n");
            let moving = format!("{moving}transform_end = [{end}, {turn}]\n");
            [once.clone(), once + &twice, moving].map(|placed| format!("{shapes}{inner}{placed}"))
        };
        for ((near, far), time) in text(zero, &step([0.0; 3])).iter().zip(&text(away, &back)).zip([0.0, 0.0, 0.375]) {
            let [a, b] = [near, far].map(|text| distances(&toml(text), zero, time));
            let what = format!("groups of size {} at {}, time {time}", away.size, away.place);
            assert_alike(&what, &b, &a, tolerance(away));
        }
    }
}

fn shapes(scene: &Scene) -> Vec<(DVec3, Shape)> {
    let placed = scene.instances.iter().flat_map(|instance| {
        let origin = instance.transform.translation;
        assert_eq!(instance.transform, DAffine3::from_translation(origin));
        scene.group_geometries(instance.group).map(move |(_, geometry)| (origin, geometry))
    });
    let shapes = placed.flat_map(|(origin, geometry)| match geometry {
        Geometry::Shapes { shapes, .. } => shapes.iter().map(|shape| (origin, shape.clone())).collect(),
        Geometry::Mesh(_) => Vec::new(),
    });
    shapes.collect()
}

/// The numbers of a file near zero are rounded as they stand, in one group; so are those elsewhere that f32 holds.
#[test]
fn nothing_near_has_a_local_origin() {
    let near = Writer { place: DVec3::new(100.3, -20.7, 7.1), size: 1.0 };
    let mut scenes = vec![toml(&tables(&TABLES, None, near))];
    for (name, text) in [("a.nff", super::nff::TEXT), ("a.toml", &super::toml::text())] {
        scenes.push(Files::one(name, text).scene(name));
    }
    scenes.push(toml(
        "[[sphere]]\ncentre = [4500000.5, 1e9, 0]\nradius = 1\n[[plane]]\npoint = [0, -1e9, 0]\nnormal = [0, 1, 0]\n",
    ));
    // A long wire about zero, a thin pane, and a sliver: none would have less to round elsewhere.
    scenes.push(toml(
        "[[cylinder]]\nbase = [-5000.1, 0, 0]\napex = [5000.3, 0.1, 0]\nradius = 0.001\n\
        [[box]]\nmin = [-10.3, 2.1, -10.3]\nmax = [20.1, 2.1001, 10.3]\n\
        [[polygon]]\ncorners = [[0.1, 0, 0], [9.7, 0, 0], [9.7, 0, 0.00001], [0.1, 0, 0.00001]]\n",
    ));
    for scene in &scenes {
        let instances = scene.instances.iter().filter(|instance| instance.name.is_empty());
        assert_eq!(instances.count(), 1);
    }
    let (_, Shape::Sphere(sphere)) = shapes(&scenes[0])[0] else { panic!("a sphere") };
    assert_eq!(sphere.centre, near.point([0.1, 0.2, -0.1]).as_vec3());
}

/// A wall of polygons of two sizes, whose edges are shared: no ray at one passes between them, near or far.
#[test]
fn polygons_that_share_edges_share_their_local_origin() {
    for place in [DVec3::new(30.3, 40.7, 0.0), AWAY, DVec3::new(4500000.3, 1200000.7, 0.0)] {
        for [large, small] in [[1.0, 0.1], [0.01, 0.0037], [0.003, 0.0011]] {
            let corner = |x: f64, y: f64| format!("[{}, {}, {}]", place.x + x, place.y + y, place.z);
            let tile = |x: [f64; 2], y: [f64; 2]| {
                let corners = [corner(x[0], y[0]), corner(x[1], y[0]), corner(x[1], y[1]), corner(x[0], y[1])];
                format!("[[polygon]]\ncorners = [{}]\n", corners.join(", "))
            };
            let steps = |edge: f64| (0..20).map(move |i| [edge * f64::from(i), edge * f64::from(i + 1)]);
            let below = steps(large).map(|x| tile(x, [-large, 0.0]));
            let above = steps(small).map(|x| tile(x, [0.0, small]));
            let scene = toml(&below.chain(above).collect::<String>());
            let world = World::new(&scene).expect("a world");
            let bvh = Bvh::build(&world);
            for i in 0..4000 {
                // Along the edge in common, and along those between neighbours.
                let along = small * 19.9 * (f64::from(i) + 0.5) / 4000.0;
                let between = small * f64::from(1 + i % 19);
                for at in [DVec3::new(along, 0.0, 0.0), DVec3::new(between, small * f64::from(i) / 4000.0, 0.0)] {
                    let direction = Vec3::new(0.01, -0.02, -1.0);
                    let ray = world.ray(place + at - direction.as_dvec3() * large, direction);
                    assert!(bvh.closest(&ray).is_some(), "{large} and {small} at {place}: {at}");
                }
            }
        }
    }
}

/// Small things about zero stay one group, whatever rounding is to them: the world is rounded there as well.
#[test]
fn small_things_about_zero_are_one_group() {
    let cylinder = |i: i32| {
        let (x, z) = (f64::from(i * 37 % 201) / 10.0 - 10.03, f64::from(i * 59 % 203) / 10.0 - 10.07);
        format!("[[cylinder]]\nbase = [{x}, 0, {z}]\napex = [{x}, 0.1, {z}]\nradius = 0.0005\n")
    };
    let scene = toml(&(0..500).map(cylinder).collect::<String>());
    assert_eq!((scene.instances.len(), scene.primitive_count()), (1, 500));
    assert_eq!(scene.instances[0].transform, DAffine3::IDENTITY);
}

/// All shapes of a group share an origin, and are named as they are near zero.
#[test]
fn neighbours_share_their_local_origin() {
    let mut text = String::from("[material.red]\n[material.blue]\n");
    for i in 0..1000 {
        let at = AWAY + DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100));
        let material = ["red", "blue"][i as usize % 2];
        text +=
            &format!("[[sphere]]\ncentre = [{}, {}, {}]\nradius = 0.3\nmaterial = \"{material}\"\n", at.x, at.y, at.z);
    }
    let scene = toml(&text);
    assert_eq!(shapes(&scene).len(), 1000);
    assert!(scene.instances.len() == 1 && scene.geometries.len() == 2, "{:?}", scene.instances);
    assert!(scene.instances.iter().all(|instance| instance.name.is_empty()));
    for (i, (origin, shape)) in shapes(&scene).into_iter().enumerate() {
        let Shape::Sphere(sphere) = shape else { panic!("{i}: {shape:?}") };
        assert!(sphere.radius == 0.3 && (origin - AWAY).length() < 10.0, "{i}: {origin}");
    }
    // In fewer parts than shapes, and on one level.
    let world = World::new(&scene).unwrap();
    assert!(world.placements.is_empty() && world.parts.len() == scene.geometries.len());
}

/// Boxes, cylinders and polygons that are thinner than a step of f32 where they stand.
#[test]
fn sizes_stay() {
    let texts = [
        "[[cylinder]]\nbase = [1e7, 0, 0]\napex = [10000000.002, 0, 0]\nradius = 0.002\n",
        "[[box]]\nmin = [4500000.2, -0.1, 0]\nmax = [4500000.4, 0.1, 0.2]\n",
        // Nothing of it is left at zero.
        "[[box]]\nmin = [20.1, 0, 0]\nmax = [20.1000001, 0.0000001, 10]\n[[sphere]]\ncentre = [-20, 0, 0]\nradius = 1\n",
        "[[cone]]\nbase = [0, 1e7, 0]\napex = [0, 10000000.001, 0]\nbase_radius = 0.003\n",
        "[[polygon]]\ncorners = [[4500000.2, 0, 0], [4500000.4, 0, 0], [4500000.4, 0.1, 0], [4500000.2, 0.1, 0]]\n",
    ];
    let bounds = |shape: &Shape| shape.bounds().size().as_dvec3();
    let close = |a: DVec3, b: [f64; 3]| (a - DVec3::from(b)).abs().max_element() < 1e-4 * DVec3::from(b).max_element();
    let found = texts.iter().flat_map(|text| shapes(&toml(text)));
    let mut found: Vec<_> = found.map(|(_, shape)| (shape.name(), bounds(&shape))).collect();
    found.sort_by(|a, b| a.0.cmp(b.0).then(a.1.z.total_cmp(&b.1.z)));
    for ((name, size), (kind, expected)) in found.into_iter().zip([
        ("box", [0.2, 0.2, 0.2]),
        ("box", [1e-7, 1e-7, 10.0]),
        ("cone", [0.006, 0.001, 0.006]),
        ("cylinder", [0.002, 0.004, 0.004]),
        ("polygon", [0.2, 0.1, 0.0]),
        ("sphere", [2.0; 3]),
    ]) {
        assert!(name == kind && close(size, expected), "{name}: {size}");
    }
}

#[test]
fn faults_name_the_numbers_of_the_file() {
    for (text, words) in [
        (
            "[[cylinder]]\nbase = [4500000.3, 0, 0]\napex = [4500000.3, 0, 0]\nradius = 1\n",
            "both ends are [4500000.3, 0, 0]",
        ),
        (
            "[[box]]\nmin = [4500000.3, 0, 0]\nmax = [4500000.2, 1, 1]\n",
            "the corner [4500000.3, 0, 0] is not the smallest",
        ),
        (
            "[[box]]\nmin = [4500000.3, 0, 0]\nmax = [4500000.3, 0, 1]\n",
            "between [4500000.3, 0, 0] and [4500000.3, 0, 1]",
        ),
        ("[[sphere]]\ncentre = [1e30, 0, 0]\nradius = 1\n", "may be up to 1.844e18"),
        ("[[sphere]]\ncentre = [4500000.3, 0, 0]\nradius = 1e-50\n", "above 0 and at most 1.844e18, in f32 too"),
        ("[[cone]]\nbase = [4500000.3, 0, 0]\napex = [0, 0, 0]\nbase_radius = -0.1\n", "a radius is -0.1"),
        ("[[plane]]\npoint = [4500000.3, 0, 0]\nnormal = [0, 0, 0]\n", "it must be finite and not zero"),
        (
            "[[polygon]]\ncorners = [[4500000.3, 0, 0], [4500001.3, 0, 0], [4500001.3, 1, 0.5], [4500000.3, 1, 0]]\n",
            "[4500000.3, ",
        ),
    ] {
        refused_bytes("a.toml", text, "line 1", words);
    }
    // Of any length but 0.
    for normal in ["[0, 1e-50, 0]", "[0, 1e300, 0]"] {
        let scene = toml(&format!("[[plane]]\npoint = [0, 0, 0]\nnormal = {normal}\n"));
        assert_eq!(shapes(&scene)[0].1.normal(DVec3::ZERO), DVec3::Y);
    }
}

/// Lamps of minray's scenes stand where their spheres are.
#[test]
fn lamps_are_in_the_middle_of_far_spheres() {
    let scene = toml(
        "[render]\nshading = \"minray\"\n[material.lamp]\nemission = 1\n\
         [[sphere]]\ncentre = [4500000.3, -1200000.7, 77.1]\nradius = 0.5\nmaterial = \"lamp\"\n",
    );
    let [Light::Point { position, radius, .. }] = scene.lights[..] else { panic!("{:?}", scene.lights) };
    assert!((position - AWAY).length() < 1e-5 && radius == 0.5, "{position}");
}

#[test]
fn far_shapes_come_back_from_files() {
    let away = Writer { place: AWAY, size: 0.1 };
    let all = tables(&TABLES, None, away);
    // What NFF has no words for left out.
    let nff: Vec<Table> = [0, 5, 8, 9, 10].map(|i| TABLES[i]).to_vec();
    let black =
        "[render]\nheadlight = false\nambient = 0\n[material.m]\nspecular = 0\nambient = 0\nmodel = \"phong\"\n";
    let some = tables(&nff, None, away).replace("\n[[", "\nmaterial = \"m\"\n[[") + "material = \"m\"\n" + black;
    for (name, text) in [("again.toml", all), ("again.nff", some)] {
        let files = Files::one("a.toml", text);
        let scene = files.scene("a.toml");
        save(&scene, &files.path(name)).unwrap_or_else(|error| panic!("{error}"));
        let again = files.scene(name);
        let placed = |scene: &Scene| {
            let mut placed: Vec<_> =
                shapes(scene).iter().map(|(origin, shape)| format!("{origin} {shape:?}")).collect();
            placed.sort();
            placed
        };
        assert_eq!(placed(&again), placed(&scene), "{name}");
        assert_alike(name, &distances(&again, away, 0.0), &distances(&scene, away, 0.0), 1e-6);
    }
}
