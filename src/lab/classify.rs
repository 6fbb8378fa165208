//! Of two engines that differ on a ray: which is wrong, if any.
//!
//! The primitives that any engine named are tested again by the [oracle](super::oracle), and for what rounding
//! [allows](super::rounding). Then the answers are held against that:
//!
//! - **Native** must be right in exact arithmetic: the primitive it names is met, none of the others is nearer by more
//!   than the bound of its t, and where it names none, none is met. Only t is granted a rounding (f64, then f32).
//! - **Embree** must be possible in f32 arithmetic, by the same rules.
//!
//! If both hold, the ray is a tie where both engines' primitives are met and rounding cannot order their t, and else a
//! boundary ray, on which either answer can be defended.
//!
//! Testing every primitive instead would decide more (both engines may miss the same one), at a cost of the whole scene
//! for every ray; brute force, as the third voice, does that on small scenes.

use super::oracle::{self, Id, Primitive};
use super::rounding::{Outcome, Precision, outcome};
use crate::ray::{Hit, Ray};
use crate::trace::World;

/// What two answers to one ray amount to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// The same primitive, or none.
    Agree,
    /// Two primitives at a t that rounding cannot order.
    Tie,
    /// The ray passes within rounding of an edge, a silhouette or an end of its range.
    Boundary,
    /// Native's answer is not that of exact arithmetic.
    NativeWrong,
    /// Embree's answer is not possible in f32 arithmetic.
    EmbreeWrong,
}

impl Class {
    /// All of them, in the order of the reports.
    pub const ALL: [Self; 5] = [Self::Agree, Self::Tie, Self::Boundary, Self::NativeWrong, Self::EmbreeWrong];

    /// As in the reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Agree => "agree",
            Self::Tie => "tie",
            Self::Boundary => "boundary",
            Self::NativeWrong => "native_wrong",
            Self::EmbreeWrong => "embree_wrong",
        }
    }
}

/// The nearest hit of one ray, by every engine that was asked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Answers {
    /// By the native engine.
    pub native: Option<Hit>,
    /// By Embree.
    pub embree: Option<Hit>,
    /// By brute force, where it was asked.
    pub brute: Option<Option<Hit>>,
}

impl Answers {
    fn named(&self) -> impl Iterator<Item = Hit> {
        [self.native, self.embree, self.brute.flatten()].into_iter().flatten()
    }
}

/// Steps of f32 between two numbers of which neither is NaN.
pub fn ulps(a: f32, b: f32) -> u32 {
    // The bits of positive f32 are in order; those of negative ones are mirrored.
    let order = |x: f32| {
        let bits = x.to_bits() as i32;
        i64::from(if bits < 0 { i32::MIN - bits } else { bits })
    };
    order(a).abs_diff(order(b)).min(u64::from(u32::MAX)) as u32
}

/// Judges the answers to a closest-hit query.
pub fn classify_closest(world: &World, ray: &Ray, answers: &Answers) -> Class {
    classify(world, ray, answers, true)
}

/// The same where native's t may be any, as that of a textbook's method is: what it names alone is judged.
pub fn classify_named(world: &World, ray: &Ray, answers: &Answers) -> Class {
    classify(world, ray, answers, false)
}

fn classify(world: &World, ray: &Ray, answers: &Answers, with_t: bool) -> Class {
    let Answers { native, embree, brute } = answers;
    let id = |hit: &Option<Hit>| hit.map(|h| h.id());
    let same = id(native) == id(embree);
    if same && brute.is_none_or(|b| id(&b) == id(native)) {
        // The primitive stands; native's t is held to its bound as well.
        let stands = !with_t || native.zip(*embree).is_none_or(|(a, b)| a.t == b.t || t_fits(world, ray, &a));
        return if stands { Class::Agree } else { Class::NativeWrong };
    }
    let involved = Involved::new(world, ray, answers.named());
    if !involved.explain_closest(ray, *native, |c| &c.exact, with_t) {
        return Class::NativeWrong;
    }
    if same {
        return Class::Agree;
    }
    if !involved.explain_closest(ray, *embree, |c| &c.single, false) {
        return Class::EmbreeWrong;
    }
    let tie = native.zip(*embree).is_some_and(|(a, b)| involved.tie(ray, a.id(), b.id()));
    if tie { Class::Tie } else { Class::Boundary }
}

/// Judges the answers to an any-hit query, of which brute force's may be missing; `closest` asks every engine for its
/// nearest hit of the same ray, and is called only where the answers differ.
pub fn classify_occluded(
    world: &World,
    ray: &Ray,
    native: bool,
    embree: bool,
    brute: Option<bool>,
    closest: impl FnOnce() -> Answers,
) -> Class {
    if native == embree && brute.is_none_or(|b| b == native) {
        return Class::Agree;
    }
    let judge = |involved: &Involved| {
        if !involved.explain_occluded(ray, native, |c| &c.exact) {
            Class::NativeWrong
        } else if native == embree {
            Class::Agree
        } else if !involved.explain_occluded(ray, embree, |c| &c.single) {
            Class::EmbreeWrong
        } else {
            Class::Boundary
        }
    };
    match judge(&Involved::new(world, ray, closest().named())) {
        class @ (Class::Boundary | Class::Agree) => class,
        // An engine's any-hit may rest on a primitive that its closest-hit query does not name.
        _ => judge(&Involved::all(world, ray)),
    }
}

/// Whether the ray passes within f32 rounding of an edge, a silhouette or an end of its range at the primitive that
/// `hit` names.
pub fn is_boundary(world: &World, ray: &Ray, hit: &Hit) -> bool {
    oracle::primitive(world, hit, ray.moment()).is_some_and(|primitive| {
        let outcome = outcome(ray, &primitive, Precision::Single);
        outcome.may_hit(ray) && outcome.may_miss(ray)
    })
}

/// Whether the ray starts on the primitive that `hit` names, up to f32 rounding: its t is then nothing but rounding.
pub fn starts_on(world: &World, ray: &Ray, hit: &Hit) -> bool {
    oracle::primitive(world, hit, ray.moment())
        .is_some_and(|primitive| outcome(ray, &primitive, Precision::Single).span(ray).0 <= 0.0)
}

/// Whether the t of a native hit is within its bound.
fn t_fits(world: &World, ray: &Ray, hit: &Hit) -> bool {
    oracle::primitive(world, hit, ray.moment()).is_some_and(|primitive| {
        let (low, high) = outcome(ray, &primitive, Precision::Double).span(ray);
        (low..=high).contains(&f64::from(hit.t))
    })
}

/// A primitive that some engine named.
struct Candidate {
    id: Id,
    /// What native may answer: exact but for t.
    exact: Outcome,
    /// What Embree may answer.
    single: Outcome,
    /// Whether the ray meets it, exactly.
    is_hit: bool,
}

struct Involved(Vec<Candidate>);

impl Involved {
    fn new(world: &World, ray: &Ray, hits: impl Iterator<Item = Hit>) -> Self {
        let mut all: Vec<Candidate> = Vec::new();
        for hit in hits {
            if all.iter().all(|c| c.id != hit.id()) {
                all.extend(
                    oracle::primitive(world, &hit, ray.moment())
                        .map(|primitive| Candidate::new(ray, hit.id(), &primitive)),
                );
            }
        }
        Self(all)
    }

    /// Every primitive of the world that some engine might find hit.
    fn all(world: &World, ray: &Ray) -> Self {
        let possible =
            oracle::primitives(world, ray.moment()).filter(|(_, p)| outcome(ray, p, Precision::Single).may_hit(ray));
        Self(possible.map(|(id, primitive)| Candidate::new(ray, id, &primitive)).collect())
    }

    fn get(&self, id: Id) -> Option<&Candidate> {
        self.0.iter().find(|c| c.id == id)
    }

    /// Whether `answer` may be the nearest hit, given what is allowed for each primitive; `with_t`: and its t, too.
    fn explain_closest(
        &self,
        ray: &Ray,
        answer: Option<Hit>,
        allowed: fn(&Candidate) -> &Outcome,
        with_t: bool,
    ) -> bool {
        let Some(hit) = answer else { return self.0.iter().all(|c| allowed(c).may_miss(ray)) };
        // No candidate: a primitive that does not exist.
        let Some(named) = self.get(hit.id()) else { return false };
        let (low, high) = allowed(named).span(ray);
        let t_fits = (low..=high).contains(&f64::from(hit.t));
        let is_behind = |c: &Candidate| low > allowed(c).span(ray).1;
        let overlooked = |c: &Candidate| c.id != hit.id() && !allowed(c).may_miss(ray) && is_behind(c);
        allowed(named).may_hit(ray) && (t_fits || !with_t) && !self.0.iter().any(overlooked)
    }

    fn explain_occluded(&self, ray: &Ray, answer: bool, allowed: fn(&Candidate) -> &Outcome) -> bool {
        if answer {
            self.0.iter().any(|c| allowed(c).may_hit(ray))
        } else {
            self.0.iter().all(|c| allowed(c).may_miss(ray))
        }
    }

    /// Whether both are hit and their t differ by no more than the sum of their f32 bounds.
    fn tie(&self, ray: &Ray, a: Id, b: Id) -> bool {
        let hit = |id: Id| self.get(id).filter(|c| c.is_hit).map(|c| c.single.span(ray));
        hit(a).zip(hit(b)).is_some_and(|(a, b)| a.0 <= b.1 && b.0 <= a.1)
    }
}

impl Candidate {
    fn new(ray: &Ray, id: Id, primitive: &Primitive) -> Self {
        let meeting = oracle::meet(ray, primitive);
        let double = outcome(ray, primitive, Precision::Double);
        let exact = match primitive.is_decided_exactly() {
            true => Outcome { may_meet: meeting.is_some(), may_pass: meeting.is_none(), ..double },
            false => double,
        };
        let single = outcome(ray, primitive, Precision::Single);
        Self { id, exact, single, is_hit: meeting.is_some_and(|m| m.in_range || m.at_range_end) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::scene::{Geometry, Mesh};
    use crate::shape::{Cylinder, Shape, Sphere};

    /// Two unit squares of two triangles each, at z = 0 (0, 1) and z = -1 (2, 3), and at z = -1 a copy (4) of 2.
    fn world() -> World {
        let square = |z: f32| [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Vec3::new(x, y, z));
        let positions = [square(0.0), square(-1.0)].concat();
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [4, 5, 6]]);
        World::new(&crate::Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Default::default()])).unwrap()
    }

    fn hit(primitive: u32, t: f32) -> Option<Hit> {
        Some(Hit { t, u: 0.0, v: 0.0, primitive, geometry: 0, instance: 0 })
    }

    fn down(x: f32, y: f32) -> Ray {
        Ray::new(Vec3::new(x, y, 1.0), Vec3::NEG_Z)
    }

    fn closest(ray: Ray, native: Option<Hit>, embree: Option<Hit>) -> Class {
        classify_closest(&world(), &ray, &Answers { native, embree, brute: None })
    }

    #[test]
    fn in_the_clear_one_of_them_is_wrong() {
        let clear = down(0.75, 0.25);
        assert_eq!(closest(clear, hit(0, 1.0), hit(0, 1.0)), Class::Agree);
        assert_eq!(closest(clear, hit(0, 1.0), None), Class::EmbreeWrong);
        assert_eq!(closest(clear, hit(0, 1.0), hit(2, 2.0)), Class::EmbreeWrong);
        assert_eq!(closest(clear, hit(0, 1.0), hit(1, 1.0)), Class::EmbreeWrong);
        assert_eq!(closest(clear, None, hit(0, 1.0)), Class::NativeWrong);
        assert_eq!(closest(clear, hit(2, 2.0), hit(0, 1.0)), Class::NativeWrong);
        assert_eq!(closest(clear, hit(1, 1.0), hit(0, 1.0)), Class::NativeWrong);
        assert_eq!(closest(clear, hit(9, 1.0), hit(0, 1.0)), Class::NativeWrong);
    }

    #[test]
    fn a_wrong_distance_of_native_shows_even_where_the_primitive_is_right() {
        let clear = down(0.75, 0.25);
        let off = 1.0 + 3.0 * f32::EPSILON;
        assert_eq!(closest(clear, hit(0, off), hit(0, 1.0)), Class::NativeWrong);
        assert_eq!(closest(clear, hit(0, 1.0), hit(0, off)), Class::Agree);
        // Of a textbook's method what it names is judged.
        let named = |native, embree| classify_named(&world(), &clear, &Answers { native, embree, brute: None });
        assert_eq!(named(hit(0, off), hit(0, 1.0)), Class::Agree);
        assert_eq!(named(hit(2, 2.0), hit(0, 1.0)), Class::NativeWrong);
        assert_eq!(named(None, hit(0, 1.0)), Class::NativeWrong);
    }

    #[test]
    fn on_the_shared_edge_either_triangle_is_a_tie() {
        assert_eq!(closest(down(0.5, 0.5), hit(0, 1.0), hit(1, 1.0)), Class::Tie);
        assert_eq!(closest(down(0.75, 0.25), hit(2, 2.0), hit(4, 2.0)), Class::Tie);
    }

    #[test]
    fn near_an_edge_embree_may_err_and_native_may_not() {
        // A hair inside the outer edge x = 1, and a hair outside.
        let (inside, outside) = (down(1f32.next_down(), 0.25), down(1f32.next_up(), 0.25));
        assert_eq!(closest(inside, hit(0, 1.0), None), Class::Boundary);
        assert_eq!(closest(inside, hit(0, 1.0), hit(2, 2.0)), Class::Boundary);
        assert_eq!(closest(inside, None, hit(0, 1.0)), Class::NativeWrong);
        assert_eq!(closest(outside, None, hit(0, 1.0)), Class::Boundary);
        assert_eq!(closest(outside, hit(0, 1.0), None), Class::NativeWrong);
    }

    #[test]
    fn the_end_of_the_range_is_a_boundary_for_both() {
        let ends = Ray { tmax: 1.0, ..down(0.75, 0.25) };
        assert_eq!(closest(ends, None, hit(0, 1.0)), Class::Boundary);
        assert_eq!(closest(ends, hit(0, 1.0), None), Class::Boundary);
        let short = Ray { tmax: 0.999, ..down(0.75, 0.25) };
        assert_eq!(closest(short, None, hit(0, 1.0)), Class::EmbreeWrong);
    }

    #[test]
    fn at_a_silhouette_native_may_not_err_either() {
        let world = |shape| {
            let geometry = Geometry::Shapes { shapes: vec![shape], material: 0 };
            World::new(&crate::Scene::from_geometries(vec![geometry], vec![Default::default()])).unwrap()
        };
        let judge = |world: &World, [x, y]: [f32; 2], native, embree| {
            let ray = Ray::new(Vec3::new(x, y, 100.0), Vec3::NEG_Z);
            classify_closest(world, &ray, &Answers { native, embree, brute: None })
        };
        // Past the unit sphere by 1.4e-14 and into it by 1.2e-12: nothing that f64 could tell from 100 away.
        let (past, into) = ([0.799_706_94, 0.600_390_55], [0.650_676_13, 0.759_355_37]);
        let ball = world(Shape::Sphere(Sphere { centre: Vec3::ZERO, radius: 1.0 }));
        let (base, apex) = (Vec3::NEG_Z, Vec3::Z);
        let can = world(Shape::Cylinder(Cylinder { base, apex, radius: 1.0, capped: true }));
        for (world, t, of_embree) in [(ball, 100.0, Class::Boundary), (can, 99.0, Class::EmbreeWrong)] {
            for (at, right, wrong) in [(past, None, hit(0, t)), (into, hit(0, t), None)] {
                assert_eq!(judge(&world, at, right, wrong), of_embree, "{at:?}");
                assert_eq!(judge(&world, at, wrong, right), Class::NativeWrong, "{at:?}");
            }
        }
    }

    #[test]
    fn brute_force_is_heard_where_the_two_agree() {
        let answers = Answers { native: hit(2, 2.0), embree: hit(2, 2.0), brute: Some(hit(0, 1.0)) };
        assert_eq!(classify_closest(&world(), &down(0.75, 0.25), &answers), Class::NativeWrong);
        let answers = Answers { native: None, embree: None, brute: Some(hit(0, 1.0)) };
        assert_eq!(classify_closest(&world(), &down(0.75, 0.25), &answers), Class::NativeWrong);
    }

    #[test]
    fn shadow_rays_are_decided_even_where_no_primitive_is_named() {
        let none = Answers::default;
        let judge = |ray, native, embree| classify_occluded(&world(), &ray, native, embree, None, none);
        assert_eq!(judge(down(0.75, 0.25), true, true), Class::Agree);
        assert_eq!(judge(down(0.75, 0.25), true, false), Class::EmbreeWrong);
        assert_eq!(judge(down(0.75, 0.25), false, true), Class::NativeWrong);
        assert_eq!(judge(down(2.0, 0.25), false, true), Class::EmbreeWrong);
        assert_eq!(judge(down(2.0, 0.25), true, false), Class::NativeWrong);
        assert_eq!(judge(down(1f32.next_up(), 0.25), false, true), Class::Boundary);
        assert_eq!(judge(down(1f32.next_down(), 0.25), true, false), Class::Boundary);
        assert_eq!(judge(down(1f32.next_down(), 0.25), false, true), Class::NativeWrong);
        let with_brute = classify_occluded(&world(), &down(0.75, 0.25), false, false, Some(true), || Answers {
            brute: Some(hit(0, 1.0)),
            ..Answers::default()
        });
        assert_eq!(with_brute, Class::NativeWrong);
    }

    #[test]
    fn ulps_count_steps_across_zero() {
        assert_eq!(ulps(1.0, 1f32.next_up()), 1);
        assert_eq!(ulps(0.0, -0.0), 0);
        assert_eq!(ulps(f32::from_bits(1), -f32::from_bits(2)), 3);
        assert_eq!(ulps(f32::MAX, f32::MIN), 2 * 0x7f7f_ffff);
    }
}
