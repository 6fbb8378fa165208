//! What this render needs, and nothing else.
//!
//! | file | idea |
//! | --- | --- |
//! | `census` | what is in the scene, counted |
//! | `reach` | whether a light can reach anything |
//! | `integrator` | the cheapest integrator that shows everything |
//! | `reduction` | what is left out of the complete model, and how to put it back |
//! | `work` | the rays to expect |
//! | `build` | how well the tree is worth building |
//! | `text`, `report` | the plan in words, and as a document |
//!
//! [`Plan::new`] takes the census and switches off what no pixel can show: shadow rays where no light casts any,
//! texture coordinates where no texture is used, shading normals where no mesh in view of a light has them, the ambient
//! term, lights that are black or out of reach. What the plan decides the renderer reads there, and never decides
//! again; of the scene it takes materials, textures and the lights that are left.

mod brightness;
mod build;
mod census;
mod integrator;
mod reach;
mod reduction;
mod report;
mod text;
mod work;

pub use build::{BuildChoice, BuildRequest, EMBREE_BYTES, NotEnoughMemory};
pub use census::Census;
pub use reduction::{Complete, Reduction};
pub use report::PlanReport;
pub use work::{ROULETTE_MIN_DEPTH, Rays, Work};

use std::cell::OnceCell;

use crate::error::Result;
use crate::math::Vec3;
use crate::scene::{DefaultLighting, Fog, Integrator, Scene};
use crate::shade::Attributes;
use crate::shade::light::LightSource;
use crate::shade::lights::has_emitters;
use crate::trace::World;

/// Whether instances are traced as such.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Levels {
    /// Everything is fixed in world coordinates.
    One,
    /// Objects stand in several places by transforms.
    Two,
}

/// Where light comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Lighting {
    /// No surface reflects anything: no light is looked at.
    None,
    /// The scene has no light and is not meant to be dark, so that the viewer carries one; it needs no shadow rays.
    Headlight,
    /// The scene's lights by index, without those that are black or out of reach; each casts shadows.
    Lights(Vec<usize>),
}

/// How often rays are sent on by mirrors and glass where nobody says.
pub const DEFAULT_DEPTH: u32 = 5;
/// How often paths are scattered at most where nobody says; nearly all end earlier, by chance.
pub const DEFAULT_PATH_DEPTH: u32 = 64;

/// A share of the picture, in each channel, that is not worth the mirrored and refracted rays to what is white and less
/// which would add it: below half the smallest step of 8 bits, which in sRGB is 1 / 255 / 12.92. Where something may be
/// brighter, the share is as much smaller ([`Census::brightest`]).
pub const FAINT: f32 = 1e-4;

/// What is wanted of a render. What is none is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlanOptions {
    /// How far light is followed.
    pub integrator: Option<Integrator>,
    /// Stands in for the scene's own; linear RGB.
    pub background: Option<Vec3>,
    /// How often rays may be sent on.
    pub max_depth: Option<u32>,
    /// What is modelled whether it is needed or not.
    pub complete: Complete,
}

/// What a render will do.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// One level of tracing or two.
    pub levels: Levels,
    /// What must be known of a surface.
    pub attributes: Attributes,
    /// Where light comes from.
    pub lighting: Lighting,
    /// Whether rays have times: where something moves.
    pub motion: bool,
    /// Whether ambient light is added.
    pub ambient: bool,
    /// How far light is followed.
    pub integrator: Integrator,
    /// Why that far, in words.
    pub why: &'static str,
    /// Whether something glows that lights nothing else: only paths find that light, and nobody has said how far light
    /// is to be followed.
    pub idle_emitters: bool,
    /// How often rays may be sent on; 0 where nothing does.
    pub depth: u32,
    /// Mirrored and refracted rays are not followed whose shares come to no more than this for a sample, all together:
    /// [`FAINT`] by what is brightest, or 0.
    pub faint: f32,
    /// Whether textures bend normals.
    pub normal_maps: bool,
    /// Whether rays pass through surfaces that are not all there.
    pub alpha: bool,
    /// Whether light comes from all around.
    pub environment: bool,
    /// Fog between things; none where it would change nothing.
    pub fog: Option<Fog>,
    /// Linear RGB behind everything, which then is opaque; none leaves it transparent.
    pub background: Option<Vec3>,
    /// Primitives as placed.
    pub primitives: u64,
    /// Materials that something is made of.
    pub materials: usize,
    /// The rays that follow from those of the camera.
    pub work: Work,
}

/// The world of a scene: one level where that is enough, unless `complete` says otherwise.
///
/// # Errors
/// Those of [`World::new`].
pub fn world(scene: &Scene, complete: Complete) -> Result<World> {
    if complete.has(Reduction::Levels) { World::placed(scene) } else { World::new(scene) }
}

impl Plan {
    /// The plan for a scene.
    pub fn new(scene: &Scene, world: &World, options: &PlanOptions) -> Self {
        Self::of_census(scene, world, options, &Census::new(scene, world))
    }

    /// The same of a scene that is counted already.
    pub fn of_census(scene: &Scene, world: &World, options: &PlanOptions, census: &Census) -> Self {
        let inputs = PlanInputs { scene, world, options, census, bodies: OnceCell::new() };
        let (integrator, why) = inputs.integrator();
        let depth = inputs.depth(integrator);
        let needed = inputs.lighting(integrator);
        let is_lit = integrator == Integrator::Path
            || census.environment
            || !matches!(&needed, Lighting::None) && needed != Lighting::Lights(vec![]);
        let lighting = inputs.completed(needed, integrator);
        // What ambient light stands for, paths find.
        let ambient = integrator != Integrator::Path && census.ambient && census.materials.ambient > 0;
        let has = |reduction| options.complete.has(reduction);
        let (attributes, normal_maps) = inputs.attributes(is_lit || depth > 0, ambient);
        let casting = match &lighting {
            Lighting::Lights(lights) => &lights[..],
            Lighting::None | Lighting::Headlight => &[],
        };
        let extended = casting.iter().filter(|&&i| scene.lights[i].is_extended()).count();
        let around = usize::from(census.environment && lighting != Lighting::None);
        let glowing = usize::from(integrator == Integrator::Path && inputs.has_bodies());
        Self {
            levels: if world.placements.is_empty() { Levels::One } else { Levels::Two },
            attributes,
            motion: world.moves() || has(Reduction::Motion),
            ambient,
            integrator,
            why,
            idle_emitters: inputs.has_idle_emitters(integrator),
            depth,
            faint: if has(Reduction::Faint) { 0.0 } else { FAINT / census.brightest },
            alpha: census.materials.alpha > 0 || has(Reduction::Alpha),
            normal_maps,
            environment: census.environment,
            fog: scene.fog.filter(|_| census.fog),
            background: inputs.background(),
            primitives: world.primitive_count(),
            materials: census.materials.used as usize,
            work: Work::new(&work::WorkInputs {
                integrator,
                depth,
                ways: census.ways,
                albedo: census.albedo,
                lights: [casting.len() - extended, extended + around + glowing],
            }),
            lighting,
        }
    }

    /// Whether any shadow ray will be traced.
    pub fn shadows(&self) -> bool {
        self.work.shadow + self.work.area_shadow > 0.0
    }

    /// What of the complete model is left out of this plan, which was made with `options`.
    pub fn left_out(&self, scene: &Scene, world: &World, options: &PlanOptions, census: &Census) -> Vec<Reduction> {
        let changes = |reduction: &Reduction| {
            let complete = options.complete.with(*reduction);
            match reduction {
                Reduction::Levels => !options.complete.has(Reduction::Levels) && !world.fixed.is_empty(),
                Reduction::Faint => {
                    self.faint > 0.0 && census.materials.sending_on > 0 && self.integrator == Integrator::Whitted
                }
                _ => Self::of_census(scene, world, &PlanOptions { complete, ..*options }, census) != *self,
            }
        };
        Reduction::ALL.into_iter().filter(changes).collect()
    }
}

/// What a plan follows from.
struct PlanInputs<'a> {
    scene: &'a Scene,
    world: &'a World,
    options: &'a PlanOptions,
    census: &'a Census,
    /// [`PlanInputs::has_bodies`], once it has been asked for.
    bodies: OnceCell<bool>,
}

impl PlanInputs<'_> {
    fn background(&self) -> Option<Vec3> {
        self.options.background.or(self.scene.background)
    }

    /// Whether what is behind everything is light to paths.
    fn shines(&self) -> bool {
        self.background().is_some_and(|color| color != Vec3::ZERO)
    }

    /// Whether anything glows that light comes from, and is no light's body.
    fn has_bodies(&self) -> bool {
        let Self { scene, world, census, .. } = self;
        let source = |&i: &usize| LightSource::new(&scene.lights[i], world.centre);
        let sources = || census.lights.bright.iter().map(source).collect::<Vec<_>>();
        *self.bodies.get_or_init(|| census.materials.glowing > 0 && has_emitters(scene, world, &sources()))
    }

    /// Whether what glows would light something if paths were traced, which is left to whoever asks for them.
    fn has_idle_emitters(&self, integrator: Integrator) -> bool {
        let is_chosen = self.options.integrator.is_none() && integrator != Integrator::Path;
        is_chosen && self.census.materials.lit > 0 && self.has_bodies()
    }

    /// How far light is followed, and why.
    fn integrator(&self) -> (Integrator, &'static str) {
        let Self { scene, options, census, .. } = self;
        let has_lights = !scene.lights.is_empty() || scene.environment.is_some();
        let is_meant_dark = scene.default_lighting == DefaultLighting::None || has_lights;
        let asked = integrator::Needs {
            sends_on: census.materials.sending_on > 0,
            is_lit: census.materials.lit > 0,
            is_dark: is_meant_dark && census.lights.bright.is_empty() && !census.environment && !census.ambient,
            emitters: &|| self.shines() || self.has_bodies(),
        };
        let (chosen, why) = integrator::choose(options.integrator, &asked);
        let is_free = chosen == Integrator::RayCast && options.integrator.is_none();
        let sends_on = is_free && options.complete.has(Reduction::Recursion);
        (if sends_on { Integrator::Whitted } else { chosen }, why)
    }

    /// Whether light that arrives is asked for anywhere.
    fn reflects(&self, integrator: Integrator) -> bool {
        let materials = &self.census.materials;
        materials.lit > 0 || integrator == Integrator::Path && materials.sending_on > 0
    }

    /// The lights that are needed.
    fn lighting(&self, integrator: Integrator) -> Lighting {
        let Self { scene, census, .. } = self;
        if !self.reflects(integrator) {
            return Lighting::None;
        }
        let is_unlit = scene.default_lighting == DefaultLighting::Headlight
            && scene.lights.is_empty()
            && scene.environment.is_none();
        let finds_light = || integrator == Integrator::Path && (self.shines() || self.has_bodies());
        if is_unlit && !finds_light() { Lighting::Headlight } else { Lighting::Lights(census.lights.reaching.clone()) }
    }

    /// The lights that are asked, needed or not.
    fn completed(&self, needed: Lighting, integrator: Integrator) -> Lighting {
        match needed {
            Lighting::None | Lighting::Lights(_) if self.options.complete.has(Reduction::Lights) => {
                // The bodies of black lights would be mistaken for them by paths.
                let is_path = integrator == Integrator::Path;
                let all = || (0..self.scene.lights.len()).collect();
                Lighting::Lights(if is_path { self.census.lights.bright.clone() } else { all() })
            }
            needed => needed,
        }
    }

    /// How often rays are sent on.
    fn depth(&self, integrator: Integrator) -> u32 {
        let Self { options, census, .. } = self;
        let always = options.complete.has(Reduction::Recursion);
        match integrator {
            Integrator::Whitted if census.materials.sending_on > 0 || always => {
                options.max_depth.unwrap_or(DEFAULT_DEPTH)
            }
            Integrator::Path if self.reflects(integrator) || always => options.max_depth.unwrap_or(DEFAULT_PATH_DEPTH),
            Integrator::RayCast | Integrator::Whitted | Integrator::Path => 0,
        }
    }

    /// What is interpolated where a ray hits, and whether normals are mapped. `is_shaded`: whether light is asked for
    /// there, or rays go on.
    fn attributes(&self, is_shaded: bool, ambient: bool) -> (Attributes, bool) {
        let Census { materials, meshes, .. } = self.census;
        let all = self.options.complete.has(Reduction::Surfaces);
        let normal_maps = all || is_shaded && materials.normal_mapped > 0;
        let is_coloured = is_shaded || ambient || materials.alpha > 0;
        let attributes = Attributes {
            normals: all || is_shaded && meshes.normals > 0,
            uvs: normal_maps || (is_coloured || materials.shown_unlit > 0) && materials.textured > 0,
            colors: all || (is_coloured || materials.unlit > 0) && meshes.colors > 0,
        };
        (attributes, normal_maps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::math::{DVec3, Vec2, Vec4};
    use crate::scene::{Attenuation, Environment, Geometry, Light, Material, Mesh};

    fn scene() -> Scene {
        let mesh = Mesh {
            uvs: vec![Vec2::ZERO; 3],
            normals: vec![Vec3::Z; 3],
            ..Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])
        };
        Scene::from_geometries(vec![Geometry::Mesh(mesh)], vec![Material::default()])
    }

    fn plan(scene: &Scene) -> Plan {
        wished(scene, &PlanOptions::default())
    }

    fn wished(scene: &Scene, options: &PlanOptions) -> Plan {
        Plan::new(scene, &World::new(scene).unwrap(), options)
    }

    #[test]
    fn a_bare_scene_needs_a_headlight_and_no_shadow_rays() {
        let plan = plan(&scene());
        assert_eq!((plan.lighting.clone(), plan.shadows()), (Lighting::Headlight, false));
        assert_eq!(plan.attributes, Attributes { normals: true, uvs: false, colors: false });
        assert_eq!((plan.levels, plan.primitives, plan.background), (Levels::One, 1, None));
    }

    #[test]
    fn a_scene_that_is_meant_to_be_dark_has_no_headlight() {
        let dark = Scene { default_lighting: DefaultLighting::None, ..scene() };
        assert_eq!(plan(&dark).lighting, Lighting::Lights(Vec::new()));
        assert!(!plan(&dark).shadows() && plan(&dark).to_string().contains("no light"));
    }

    /// Paths ask surfaces that glow as they ask lights.
    #[test]
    fn what_glows_is_asked_by_paths() {
        let mut scene = scene();
        scene.materials[0].emission = Vec3::ONE;
        let by = |integrator| PlanOptions { integrator: Some(integrator), ..PlanOptions::default() };
        assert!(!wished(&scene, &by(Integrator::Whitted)).shadows());
        let paths = wished(&scene, &by(Integrator::Path));
        assert!(paths.shadows() && paths.work.rays(100, 1).shadow > 100, "{:?}", paths.work);
    }

    #[test]
    fn black_lights_and_unused_textures_cost_nothing() {
        let mut scene = scene();
        let light = |color| Light::Directional { direction: DVec3::NEG_Y, color };
        scene.lights = vec![light(Vec3::ZERO), light(Vec3::ONE)];
        scene.materials.push(Material { diffuse_texture: Some(0), ..Material::default() });
        let plan = plan(&scene);
        assert_eq!(plan.lighting, Lighting::Lights(vec![1]));
        assert!(plan.shadows() && !plan.attributes.uvs, "the textured material is not used");
        scene.lights.pop();
        assert!(!self::plan(&scene).shadows());
    }

    #[test]
    fn an_environment_without_light_is_none() {
        let around = |pixel: Vec4, intensity: f32| {
            let image = Image { pixels: vec![Vec4::W, pixel], ..Image::new(2, 1) };
            plan(&Scene { environment: Some(Environment { intensity, ..Environment::new(image) }), ..scene() })
        };
        for (pixel, intensity) in [(Vec4::W, 1.0), (Vec4::ONE, 0.0)] {
            let plan = around(pixel, intensity);
            // It is the file's light all the same, as a black lamp is.
            assert_eq!(
                (plan.environment, plan.lighting),
                (false, Lighting::Lights(vec![])),
                "{pixel} times {intensity}"
            );
        }
        assert!(around(Vec4::Z, 1.0).environment);
        // With it, what glows is the only light, as where all lamps are black.
        let mut glowing = scene();
        glowing.materials[0].emission = Vec3::ONE;
        let around = |environment| plan(&Scene { environment, ..glowing.clone() }).integrator;
        let black = Environment::new(Image { pixels: vec![Vec4::W; 2], ..Image::new(2, 1) });
        assert_eq!([around(None), around(Some(black))], [Integrator::RayCast, Integrator::Path]);
    }

    #[test]
    fn depth_is_for_mirrors_and_glass_that_are_there() {
        let mut scene = scene();
        scene.materials.push(Material { reflection: Vec3::ONE, ..Material::default() });
        assert_eq!(plan(&scene).depth, 0, "nothing is made of the mirror");
        let black = Material { diffuse: Vec3::ZERO, ..Material::default() };
        scene.materials[0] = Material { transmission: Vec3::X, ..black };
        let plan = plan(&scene);
        assert_eq!((plan.depth, plan.lighting), (5, Lighting::None));
        assert!(plan.attributes.normals, "they bend the ray");
    }

    #[test]
    fn the_cheapest_integrator_that_shows_everything_is_chosen() {
        let of = |scene: &Scene| plan(scene).integrator;
        let mut lit = scene();
        assert_eq!(of(&lit), Integrator::RayCast);
        lit.materials[0].reflection = Vec3::X;
        assert_eq!(of(&lit), Integrator::Whitted);
        // Darkness, and something that glows: nothing else lights the scene.
        let mut dark = scene();
        dark.lights = vec![Light::Directional { direction: DVec3::NEG_Y, color: Vec3::ZERO }];
        assert_eq!(of(&dark), Integrator::RayCast);
        dark.materials[0].emission = Vec3::ONE;
        assert_eq!((of(&dark), plan(&dark).depth), (Integrator::Path, DEFAULT_PATH_DEPTH));
        assert!(!plan(&dark).idle_emitters);
        dark.ambient = Vec3::ONE;
        assert_eq!(of(&dark), Integrator::RayCast, "ambient light lights it too");
        assert!(plan(&dark).idle_emitters && plan(&dark).to_string().contains("glows"), "{}", plan(&dark));
        assert!(!plan(&lit).idle_emitters, "nothing glows");
        dark.lights.clear();
        assert_eq!(plan(&dark).lighting, Lighting::Headlight);
        for integrator in Integrator::ALL {
            let options = PlanOptions { integrator: Some(integrator), max_depth: Some(7), ..PlanOptions::default() };
            let plan = wished(&lit, &options);
            assert_eq!(plan.integrator, integrator);
            assert!(!wished(&dark, &options).idle_emitters, "it was asked for");
            assert_eq!(plan.depth, if integrator == Integrator::RayCast { 0 } else { 7 });
        }
        let options = PlanOptions { integrator: Some(Integrator::Path), ..PlanOptions::default() };
        let path = wished(&dark, &options);
        assert_eq!((path.lighting, path.ambient), (Lighting::Lights(vec![]), false), "what glows is light enough");
    }

    #[test]
    fn a_surface_that_only_glows_is_not_lit() {
        let mut scene = scene();
        scene.materials[0] = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        let plan = plan(&scene);
        assert_eq!((plan.lighting, plan.attributes), (Lighting::None, Attributes::default()));
    }

    #[test]
    fn lights_out_of_reach_are_not_asked() {
        let mut scene = scene();
        let near = |range| {
            let (color, attenuation) = (Vec3::ONE, Attenuation::NONE);
            Light::Point { position: DVec3::Z * 5.0, color, attenuation, range, radius: 0.0 }
        };
        scene.lights = vec![near(4.0), near(6.0)];
        assert_eq!(plan(&scene).lighting, Lighting::Lights(vec![1]));
        let complete = Complete::NOTHING.with(Reduction::Lights);
        let full = wished(&scene, &PlanOptions { complete, ..PlanOptions::default() });
        assert_eq!(full.lighting, Lighting::Lights(vec![0, 1]));
        assert_eq!((plan(&scene).work.shadow, full.work.shadow), (1.0, 2.0));
        // A plane is within reach of whatever shines on it, though no box holds it.
        let plane = crate::shape::Plane::new(Vec3::Y * -9.0, Vec3::Y).expect("a plane").into();
        scene.geometries.push(Geometry::Shapes { shapes: vec![plane], material: 0 });
        scene.groups[0].geometries = 0..2;
        assert_eq!(plan(&scene).lighting, Lighting::Lights(vec![0, 1]));
    }

    /// Its map is read by uvs, whatever else there is.
    #[test]
    fn a_mirror_with_a_normal_map_keeps_its_uvs() {
        let mut scene = scene();
        scene.lights = vec![Light::Directional { direction: DVec3::X, color: Vec3::ZERO }];
        scene.materials[0] = Material { diffuse: Vec3::ZERO, reflection: Vec3::ONE, ..Material::default() };
        scene.materials[0].normal_texture = Some(0);
        scene.textures = vec![crate::scene::Texture::default()];
        let plan = plan(&scene);
        assert!(plan.normal_maps && plan.attributes.uvs, "{plan:?}");
    }

    #[test]
    fn the_complete_model_is_all_of_it_and_what_is_left_out_is_named() {
        let scene = scene();
        let all = PlanOptions { complete: Complete::ALL, ..PlanOptions::default() };
        let full = wished(&scene, &all);
        assert_eq!((full.integrator, full.depth, full.faint), (Integrator::Whitted, DEFAULT_DEPTH, 0.0));
        assert_eq!(full.attributes, Attributes::ALL);
        assert!(full.motion && full.alpha && full.normal_maps);
        let asked = PlanOptions { integrator: Some(Integrator::RayCast), ..all };
        assert_eq!(wished(&scene, &asked).integrator, Integrator::RayCast, "what is asked for stays");

        let world = World::new(&scene).unwrap();
        let census = Census::new(&scene, &world);
        let options = PlanOptions::default();
        use Reduction::{Alpha, Faint, Levels, Motion, Recursion, Surfaces};
        // The headlight is all the light there is, and nothing is faint where nothing mirrors.
        let left_out = plan(&scene).left_out(&scene, &world, &options, &census);
        assert_eq!(left_out, [Levels, Surfaces, Motion, Recursion, Alpha]);
        let mut mirror = scene.clone();
        mirror.materials[0].reflection = Vec3::X;
        let left_out = plan(&mirror).left_out(&mirror, &world, &options, &Census::new(&mirror, &world));
        assert_eq!(left_out, [Levels, Surfaces, Motion, Alpha, Faint]);
        assert!(full.left_out(&scene, &world, &all, &census).is_empty());
    }
}
