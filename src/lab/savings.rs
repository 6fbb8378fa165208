//! What a plan saves: the picture with no more than the scene needs, against the same with one thing after another put
//! back.
//!
//! The two renders of a pair take turns, so that whatever else the machine does touches both; a saving is the median of
//! those of each turn. The pictures are compared as well: what is left out must not be seen.

use std::fmt;
use std::time::Instant;

use serde::Serialize;

use super::bench::Spread;
use crate::error::Result;
use crate::plan::{self, Complete, Reduction};
use crate::render::{Control, Renderer, Settings};
use crate::scene::{Camera, Scene};
use crate::trace::bvh::Bvh;

/// What is measured.
pub struct Setup<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Where it is seen from.
    pub camera: &'a Camera,
    /// What picture.
    pub settings: &'a Settings,
    /// How often each is rendered.
    pub repeat: usize,
    /// How it is watched.
    pub control: Control<'a>,
}

/// What one reduction saves. Serialises as a part of the document of `plan --measure --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Saving {
    /// The reduction, or `all` of them.
    pub name: &'static str,
    /// Seconds of a render with no more than the scene needs.
    pub needed_seconds: Spread,
    /// Seconds of a render with this put back.
    pub complete_seconds: Spread,
    /// The share of time that is saved, the median of all turns.
    pub saved: f64,
    /// Bytes of the tree that are saved, as a share.
    pub memory_saved: f64,
    /// Whether no channel of any pixel differs.
    pub identical: bool,
    /// The largest difference of any channel.
    pub largest_difference: f64,
}

/// A way to render.
struct Way {
    complete: Complete,
    world: crate::trace::World,
}

impl Setup<'_> {
    /// Measures each of `reductions`, and then all of them at once.
    ///
    /// # Errors
    /// Those of rendering.
    pub fn run(&self, reductions: &[Reduction]) -> Result<Vec<Saving>> {
        let needed = self.settings.complete;
        let mut rows = Vec::new();
        for &reduction in reductions {
            rows.push(self.measure(reduction.name(), needed.with(reduction))?);
        }
        rows.push(self.measure("all", Complete::ALL)?);
        Ok(rows)
    }

    fn measure(&self, name: &'static str, complete: Complete) -> Result<Saving> {
        let way = |complete| -> Result<Way> { Ok(Way { complete, world: plan::world(self.scene, complete)? }) };
        let ways = [way(self.settings.complete)?, way(complete)?];
        let trees = [Bvh::build(&ways[0].world), Bvh::build(&ways[1].world)];
        let renderer = |way: usize| {
            let Way { complete, world } = &ways[way];
            let settings = Settings { complete: *complete, ..self.settings.clone() };
            Renderer::new(self.scene, world, self.camera.clone(), settings)
        };
        let renderers = [renderer(0)?, renderer(1)?];
        let mut seconds = [Vec::new(), Vec::new()];
        let mut difference = None;
        // The first turn warms caches and allocator, and is not counted.
        for turn in 0..=self.repeat {
            let mut pictures = Vec::new();
            for way in if turn % 2 == 0 { [0, 1] } else { [1, 0] } {
                let start = Instant::now();
                let picture = renderers[way].render(&trees[way], self.control)?;
                if turn > 0 {
                    seconds[way].push(start.elapsed().as_secs_f64());
                }
                pictures.push(picture);
            }
            difference = Some(pictures[0].difference(&pictures[1])?);
        }
        let [needed, complete] = seconds;
        let shares: Vec<f64> = needed.iter().zip(&complete).map(|(needed, complete)| 1.0 - needed / complete).collect();
        let bytes = trees.map(|tree| tree.bytes() as f64);
        let largest_difference = difference.map_or(0.0, |difference| difference.max_abs);
        Ok(Saving {
            name,
            needed_seconds: Spread::of(&needed),
            complete_seconds: Spread::of(&complete),
            saved: Spread::of(&shares).median,
            memory_saved: 1.0 - bytes[0] / bytes[1].max(1.0),
            identical: largest_difference == 0.0,
            largest_difference,
        })
    }
}

/// The rows as a table.
pub struct Table<'a>(pub &'a [Saving]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<11} {:>9} {:>9} {:>8} {:>8}  picture", "left out", "needed s", "full s", "time", "memory")?;
        for row in self.0 {
            let Saving { name, needed_seconds, complete_seconds, saved, memory_saved, .. } = row;
            let (needed, complete) = (needed_seconds.median, complete_seconds.median);
            let (time, memory) = (100.0 * saved, 100.0 * memory_saved);
            write!(f, "{name:<11} {needed:>9.4} {complete:>9.4} {time:>6.1} % {memory:>6.1} %  ")?;
            if row.identical {
                writeln!(f, "the same")?;
            } else {
                writeln!(f, "differs by up to {:.1e}", row.largest_difference)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::math::{DAffine3, DVec3, Vec2, Vec3};
    use crate::plan::{Census, Plan};
    use crate::scene::{Alpha, AreaShape, Attenuation, Geometry, Instance, Integrator, Light, Material, Mesh};
    use crate::shape::{Cuboid, Shape};
    use crate::trace::World;

    /// A floor, and above it a tilted square of another material, before a blue sky, lit by the sun and a lamp; without
    /// anything but flat, matte surfaces.
    fn plain() -> Scene {
        let square = |half: f32, height: f32, tilt: f32, material| {
            let corner = |x: f32, z: f32| Vec3::new(x * half, height + tilt * x, z * half);
            let positions = vec![corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)];
            let uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
            Geometry::Mesh(Mesh { uvs, material, ..Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]]) })
        };
        let matte = |color| Material { diffuse: Vec3::from(color), ambient: Vec3::ZERO, ..Material::default() };
        let materials = vec![matte([0.8, 0.6, 0.4]), matte([0.3, 0.5, 0.7])];
        let mut scene = Scene::from_geometries(vec![square(3.0, 0.0, 0.0, 0), square(1.0, 1.0, 0.3, 1)], materials);
        // So that mirrors have something to show.
        scene.background = Some(Vec3::new(0.1, 0.2, 0.3));
        scene.lights = vec![
            Light::Directional { direction: DVec3::new(0.3, -1.0, 0.2).normalize(), color: Vec3::splat(0.7) },
            lamp(DVec3::new(-2.0, 3.0, 1.0), f64::INFINITY, Vec3::ONE),
        ];
        scene
    }

    fn lamp(position: DVec3, range: f64, color: Vec3) -> Light {
        Light::Point { position, color, attenuation: Attenuation::INVERSE_SQUARE, range, radius: 0.0 }
    }

    fn camera() -> Camera {
        Camera::look_at(DVec3::new(1.0, 4.0, 5.0), DVec3::Y * 0.5, DVec3::Y, 0.9).expect("a view")
    }

    fn settings() -> Settings {
        Settings { width: 40, height: 32, spp: 4, ..Settings::default() }
    }

    fn picture(scene: &Scene, settings: &Settings) -> (Image, Plan) {
        let world = plan::world(scene, settings.complete).expect("sound");
        let renderer = Renderer::new(scene, &world, camera(), settings.clone()).expect("a view");
        let image = renderer.render(&Bvh::build(&world), Control::default()).expect("nobody interrupts");
        (image, renderer.plan().clone())
    }

    fn complete(complete: Complete) -> Settings {
        Settings { complete, ..settings() }
    }

    /// The scene that needs what a reduction leaves out of others.
    fn needing(reduction: Reduction) -> Scene {
        let mut scene = plain();
        match reduction {
            Reduction::Levels => {
                let transform = DAffine3::from_translation(DVec3::new(1.0, 0.75, -1.0));
                scene.instances.push(Instance { transform, ..scene.instances[0].clone() });
            }
            // Near enough, though it has an end.
            Reduction::Lights => scene.lights.push(lamp(DVec3::new(1.0, 2.0, 1.0), 4.0, Vec3::ONE)),
            Reduction::Surfaces => {
                let Geometry::Mesh(mesh) = &mut scene.geometries[0] else { unreachable!("it is a mesh") };
                mesh.normals = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::Y].to_vec();
            }
            Reduction::Motion => {
                scene.instances[0].transform_end = Some(DAffine3::from_translation(DVec3::Y * 0.5));
            }
            Reduction::Recursion => scene.materials[0].reflection = Vec3::splat(0.5),
            Reduction::Alpha => {
                (scene.materials[1].alpha, scene.materials[1].opacity) = (Alpha::Blend, 0.4);
            }
            // Once mirrored and then again, a few hundred thousandths are left.
            Reduction::Faint => scene.materials.iter_mut().for_each(|m| m.reflection = Vec3::splat(0.008)),
        }
        scene
    }

    /// What a plan says of the part that a reduction leaves out.
    fn is_planned(plan: &Plan, reduction: Reduction) -> bool {
        match reduction {
            Reduction::Levels => plan.levels == plan::Levels::Two,
            Reduction::Lights => plan.lighting == plan::Lighting::Lights(vec![0, 1, 2]),
            Reduction::Surfaces => plan.attributes.normals,
            Reduction::Motion => plan.motion,
            Reduction::Recursion => plan.depth > 0,
            Reduction::Alpha => plan.alpha,
            Reduction::Faint => plan.faint == 0.0,
        }
    }

    #[test]
    fn what_a_scene_does_not_need_is_left_out_and_changes_no_bit() {
        let (expected, lean) = picture(&plain(), &settings());
        assert!(expected.pixels.iter().any(|pixel| pixel.x > 0.1));
        for reduction in Reduction::ALL {
            assert!(reduction == Reduction::Lights || !is_planned(&lean, reduction), "{reduction:?}");
            let (image, plan) = picture(&plain(), &complete(Complete::NOTHING.with(reduction)));
            assert_eq!(image, expected, "{reduction:?}");
            // There is no third light to put back.
            assert!(reduction == Reduction::Lights || is_planned(&plan, reduction), "{reduction:?}");
        }
        assert_eq!(picture(&plain(), &complete(Complete::ALL)).0, expected);
    }

    #[test]
    fn where_a_scene_needs_it_it_is_planned_and_can_be_seen() {
        let (without, _) = picture(&plain(), &settings());
        for reduction in Reduction::ALL.into_iter().filter(|&reduction| reduction != Reduction::Faint) {
            let scene = needing(reduction);
            let (image, plan) = picture(&scene, &settings());
            assert!(is_planned(&plan, reduction), "{reduction:?}");
            assert_ne!(image, without, "{reduction:?}");
            let (full, _) = picture(&scene, &complete(Complete::ALL));
            assert_eq!(full, image, "{reduction:?}: what is needed is modelled already");
        }
    }

    #[test]
    fn lights_that_cannot_reach_change_no_bit() {
        let (expected, _) = picture(&plain(), &settings());
        let mut scene = plain();
        scene.lights.push(lamp(DVec3::Y * 50.0, 20.0, Vec3::ONE));
        scene.lights.push(lamp(DVec3::Y * 5.0, f64::INFINITY, Vec3::ZERO));
        let spot = |direction, position| Light::Spot {
            position,
            direction,
            color: Vec3::ONE,
            attenuation: Attenuation::NONE,
            range: f64::INFINITY,
            inner_angle: 0.2,
            outer_angle: 0.3,
        };
        scene.lights.push(spot(DVec3::Y, DVec3::Y * 20.0));
        let shape = AreaShape::Disk { centre: DVec3::Y * 9.0, normal: DVec3::Y, radius: 1.0 };
        scene.lights.push(Light::Area { shape, radiance: Vec3::ONE });
        let (lean, plan) = picture(&scene, &settings());
        assert_eq!(plan.lighting, plan::Lighting::Lights(vec![0, 1]));
        let (full, plan) = picture(&scene, &complete(Complete::ALL));
        assert_eq!(plan.lighting, plan::Lighting::Lights((0..6).collect()));
        assert_eq!((&lean, &full), (&expected, &expected));
        // The same spot light turned round is seen.
        scene.lights[4] = spot(DVec3::NEG_Y, DVec3::Y * 20.0);
        assert_ne!(picture(&scene, &settings()).0, expected);
    }

    #[test]
    fn what_is_too_faint_is_below_half_a_step_of_eight_bits() {
        let scene = needing(Reduction::Faint);
        let (lean, _) = picture(&scene, &settings());
        let (full, plan) = picture(&scene, &complete(Complete::NOTHING.with(Reduction::Faint)));
        assert_eq!(plan.faint, 0.0);
        let difference = lean.difference(&full).expect("of one size").max_abs;
        let step = 1.0 / 255.0 / 12.92;
        assert!(difference > 0.0 && difference < 0.5 * step, "{difference:e}");
        // However many there are: three panes in a row split rays again and again.
        let pane = |z: f32| Cuboid::new(Vec3::new(-30.0, -30.0, z), Vec3::new(30.0, 30.0, z + 1.0)).expect("a box");
        let shapes = [0.0, -2.0, -4.0].map(|z| Shape::Cuboid(pane(z))).to_vec();
        let mut panes =
            Scene::from_geometries(vec![Geometry::Shapes { shapes, material: 0 }], vec![Material::glass(1.5)]);
        panes.background = Some(Vec3::ONE);
        let deep = |complete| Settings { complete, max_depth: Some(16), width: 8, height: 6, spp: 1, ..settings() };
        let lean = picture(&panes, &deep(Complete::NOTHING)).0;
        let full = picture(&panes, &deep(Complete::NOTHING.with(Reduction::Faint))).0;
        let difference = lean.difference(&full).expect("of one size").max_abs;
        assert!(difference > 0.0 && difference < 0.5 * step, "{difference:e}");
        // Where something is a hundred times as bright as white, a hundredth of that share is seen.
        let mut bright = needing(Reduction::Faint);
        bright.lights.push(Light::Directional { direction: DVec3::NEG_Y, color: Vec3::splat(100.0) });
        let full = picture(&bright, &complete(Complete::NOTHING.with(Reduction::Faint))).0;
        let difference = picture(&bright, &settings()).0.difference(&full).expect("of one size").max_abs;
        assert!(difference < 0.5 * step, "{difference:e}");
        // Mirrors that matter to the last are followed as far either way.
        let half = needing(Reduction::Recursion);
        assert_eq!(picture(&half, &settings()).0, picture(&half, &complete(Complete::ALL)).0);
    }

    /// Paths choose among the lights there are, so that the noise is another and the mean is the same.
    #[test]
    fn paths_come_to_the_same_light_with_and_without_what_cannot_reach() {
        let mut scene = plain();
        scene.lights.push(lamp(DVec3::Y * 50.0, 20.0, Vec3::ONE));
        let paths = |lights| Settings {
            integrator: Some(Integrator::Path),
            spp: 256,
            width: 16,
            height: 12,
            complete: lights,
            ..settings()
        };
        let (lean, _) = picture(&scene, &paths(Complete::NOTHING));
        let (full, plan) = picture(&scene, &paths(Complete::NOTHING.with(Reduction::Lights)));
        assert_eq!(plan.lighting, plan::Lighting::Lights(vec![0, 1, 2]));
        let mean = |image: &Image| image.pixels.iter().map(|pixel| f64::from(pixel.x)).sum::<f64>() / 192.0;
        assert!((mean(&lean) / mean(&full) - 1.0).abs() < 0.02, "{} {}", mean(&lean), mean(&full));
    }

    #[test]
    fn savings_are_measured_and_pictures_compared() {
        let (scene, settings, camera) = (plain(), settings(), camera());
        let setup =
            Setup { scene: &scene, camera: &camera, settings: &settings, repeat: 2, control: Control::default() };
        let world = World::new(&scene).expect("sound");
        let (census, options) = (Census::new(&scene, &world), settings.plan_options());
        let left_out = Plan::new(&scene, &world, &options).left_out(&scene, &world, &options, &census);
        let rows = setup.run(&left_out).expect("rendered");
        assert_eq!(rows.len(), left_out.len() + 1);
        assert!(rows.iter().all(|row| row.identical && row.needed_seconds.min > 0.0 && row.saved < 1.0));
        let table = Table(&rows).to_string();
        assert!(table.lines().count() == rows.len() + 1 && table.contains("alpha") && table.contains("the same"));
    }
}
