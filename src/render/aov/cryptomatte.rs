//! Which objects and materials cover how much of each pixel: Cryptomatte (Friedman and Jones 2015, *Fully automatic ID
//! mattes with support for motion blur and transparency*; specification 1.2).
//!
//! A name's hash is its id, and its bits are written as those of a floating number. Of each pixel the six ids that
//! cover most stand with their shares in three layers of two, the largest first. The names are in the file's header,
//! those of which anything is seen: a manifest of a million instances would be larger than the picture.

use std::collections::{BTreeMap, BTreeSet};

use super::murmur::murmur3;
use crate::image::Channel;
use crate::ray::Hit;
use crate::scene::{Geometry, Scene};

/// Ids of a pixel that are written.
const RANKS: usize = 6;

/// A number and a share for each.
pub(super) const CHANNELS: usize = 2 * RANKS;

/// Layers, before their ranks.
const OBJECTS: &str = "CryptoObject";
const MATERIALS: &str = "CryptoMaterial";

/// Whether a layer of that name is one of these.
pub(super) fn is_layer(name: &str) -> bool {
    let rank = [OBJECTS, MATERIALS].iter().find_map(|layer| name.strip_prefix(layer));
    rank.is_some_and(|rank| rank.len() == 2 && rank.bytes().all(|byte| byte.is_ascii_digit()))
}

/// What covers a pixel: ids and the weights of the samples that hit them, in the order in which they were hit first.
pub(in crate::render) type Coverage = Vec<(u32, f32)>;

/// The ids of everything in a scene.
#[derive(Clone, Debug)]
pub(in crate::render) struct Mattes {
    pub(in crate::render) has_objects: bool,
    pub(in crate::render) has_materials: bool,
    /// For each instance the place of its first geometry's id, and the number of that geometry.
    instances: Vec<(usize, u32)>,
    objects: Vec<u32>,
    /// By geometry.
    materials: Vec<u32>,
}

impl Mattes {
    pub(super) fn new(scene: &Scene, has_objects: bool, has_materials: bool) -> Self {
        let (mut instances, mut objects) = (Vec::new(), Vec::new());
        if has_objects {
            for (i, instance) in scene.instances.iter().enumerate() {
                instances.push((objects.len(), scene.groups[instance.group as usize].geometries.start));
                let geometries = scene.group_geometries(instance.group);
                objects.extend(geometries.map(|(g, geometry)| id(&object_name(scene, i, g, geometry))));
            }
        }
        let material = |geometry: &Geometry| id(&material_name(scene, geometry.material()));
        let materials = if has_materials { scene.geometries.iter().map(material).collect() } else { Vec::new() };
        Self { has_objects, has_materials, instances, objects, materials }
    }

    pub(super) fn object(&self, hit: &Hit) -> u32 {
        let (first, geometry) = self.instances[hit.instance as usize];
        self.objects[first + (hit.geometry - geometry) as usize]
    }

    pub(super) fn material(&self, hit: &Hit) -> u32 {
        self.materials[hit.geometry as usize]
    }

    /// Channels and header entries: of objects, of materials, or both.
    pub(in crate::render) fn layers(
        &self,
        scene: &Scene,
        objects: &[Coverage],
        materials: &[Coverage],
        weights: &[f32],
    ) -> (Vec<Channel>, Vec<(String, String)>) {
        let (mut channels, mut texts) = (Vec::new(), Vec::new());
        let mut put = |layer: &str, coverage: &[Coverage], names: &mut dyn Iterator<Item = String>| {
            channels.extend(ranked(layer, coverage, weights));
            let seen: BTreeSet<u32> = coverage.iter().flatten().map(|(id, _)| *id).collect();
            let seen_names = names.map(|name| (id(&name), name)).filter(|(id, _)| seen.contains(id));
            let manifest: BTreeMap<String, String> = seen_names.map(|(id, name)| (name, format!("{id:08x}"))).collect();
            texts.extend(header(layer, &manifest));
        };
        if self.has_objects {
            let names = scene.instances.iter().enumerate().flat_map(|(i, instance)| {
                scene.group_geometries(instance.group).map(move |(g, geometry)| object_name(scene, i, g, geometry))
            });
            put(OBJECTS, objects, &mut { names });
        }
        if self.has_materials {
            let names = scene.geometries.iter().map(|geometry| material_name(scene, geometry.material()));
            put(MATERIALS, materials, &mut { names });
        }
        (channels, texts)
    }
}

/// The instance's name, or its group's; with the geometry's where a group has several.
fn object_name(scene: &Scene, instance: usize, geometry: u32, described: &Geometry) -> String {
    let placed = &scene.instances[instance];
    let group = &scene.groups[placed.group as usize];
    let own = match described {
        Geometry::Mesh(mesh) => mesh.name.as_str(),
        Geometry::Shapes { .. } => "",
    };
    let whole = [&placed.name, &group.name].into_iter().find(|name| !name.is_empty());
    match (whole, own, group.geometries.len()) {
        (Some(whole), _, 0 | 1) => whole.clone(),
        (Some(whole), "", _) => format!("{whole}/{geometry}"),
        (Some(whole), own, _) => format!("{whole}/{own}"),
        (None, "", _) => format!("object-{instance}/{geometry}"),
        (None, own, _) => own.to_owned(),
    }
}

fn material_name(scene: &Scene, material: u32) -> String {
    match scene.materials.get(material as usize) {
        Some(material) if !material.name.is_empty() => material.name.clone(),
        _ => format!("material-{material}"),
    }
}

/// The id of a name: its hash, with a bit of the exponent turned where that would make no ordinary floating number.
fn id(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes(), 0);
    let exponent = hash >> 23 & 0xff;
    if exponent == 0 || exponent == 0xff { hash ^ 1 << 23 } else { hash }
}

/// The channels of a layer.
fn ranked(layer: &str, coverage: &[Coverage], weights: &[f32]) -> Vec<Channel> {
    let mut planes = vec![vec![0.0; coverage.len()]; CHANNELS];
    for (i, (covers, weight)) in coverage.iter().zip(weights).enumerate() {
        // A filter may be negative in parts; a share that comes out so is none.
        let mut covers: Coverage = covers.iter().copied().filter(|(_, share)| *share > 0.0).collect();
        covers.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        for (rank, (id, share)) in covers.into_iter().take(RANKS).enumerate() {
            planes[2 * rank][i] = f32::from_bits(id);
            planes[2 * rank + 1][i] = share / weight.max(1.0);
        }
    }
    let named = planes.into_iter().enumerate().map(|(k, plane)| {
        let component = ["R", "G", "B", "A"][k % 4];
        Channel::float(format!("{layer}{:02}.{component}", k / 4), plane)
    });
    named.collect()
}

/// What the header says of a layer.
fn header(layer: &str, manifest: &BTreeMap<String, String>) -> [(String, String); 4] {
    let key = format!("{:08x}", id(layer));
    let entry = |what: &str, text: String| (format!("cryptomatte/{}/{what}", &key[..7]), text);
    [
        entry("name", layer.to_owned()),
        entry("hash", "MurmurHash3_32".to_owned()),
        entry("conversion", "uint32_to_float32".to_owned()),
        entry("manifest", serde_json::json!(manifest).to_string()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The specification's own test vectors.
    #[test]
    fn ids_are_those_of_the_specification() {
        for (name, expected) in [
            ("hello", 6.070_562_710_24e-17),
            ("cube", -4.084_619_125_19e15),
            ("sphere", 2.790_186_043_83e15),
            ("plane", 3.665_576_175_93e-11),
            ("равнина", -1.319_263_121_24e-25),
            ("mädchen", 6.236_129_821_16e25),
        ] {
            let found = f64::from(f32::from_bits(id(name)));
            assert!((found / expected - 1.0).abs() < 1e-11, "{name}: {found:e}");
        }
    }

    #[test]
    fn ids_are_ordinary_numbers_and_the_largest_shares_come_first() {
        for i in 0..100_000 {
            assert!(f32::from_bits(id(&i.to_string())).is_normal(), "{i}");
        }
        let coverage = vec![vec![(7, 1.0), (9, 2.0), (8, 1.0), (6, -0.5)], Vec::new()];
        let channels = ranked("X", &coverage, &[4.0, 4.0]);
        let names: Vec<_> = channels.iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(names[..5], ["X00.R", "X00.G", "X00.B", "X00.A", "X01.R"]);
        assert_eq!((names.len(), names[11]), (12, "X02.A"));
        let of = |k: usize| match &channels[k].plane {
            crate::image::Plane::Float(values) => (values[0].to_bits(), values[1]),
            crate::image::Plane::Uint(_) => panic!("no floats"),
        };
        assert_eq!([of(0).0, of(2).0, of(4).0, of(6).0], [9, 7, 8, 0]);
        assert_eq!([of(1), of(3)], [(0.5f32.to_bits(), 0.0), (0.25f32.to_bits(), 0.0)]);
    }
}
