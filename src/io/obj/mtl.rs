//! MTL, the materials of an OBJ file (Wavefront 1995).
//!
//! Kd, Ks, Ke and Ka are taken as linear. A highlight is Blinn-Phong's; `illum 0` and `illum 1` have none. What is not
//! read (transparency, mirrors, the other maps) is named in a warning.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result, Warning, system_message};
use crate::io::Placeless;
use crate::io::text::{Lines, Words, before_comment, name, number, quoted, without_mark};
use crate::io::texture;
use crate::math::{Affine2, Mat3, Vec2, Vec3};
use crate::memory::Mapped;
use crate::scene::{Material, Scene, Texture, Wrap};

/// From CIE 1931 XYZ to linear sRGB (IEC 61966-2-1, 1999), column by column.
const XYZ_TO_RGB: Mat3 = Mat3::from_cols(
    Vec3::new(3.240_625, -0.968_931, 0.055_710),
    Vec3::new(-1.537_208, 1.875_756, -0.204_021),
    Vec3::new(-0.498_629, 0.041_518, 1.056_996),
);

/// The materials of all MTL files that one OBJ file names; the first of a name counts.
#[derive(Default)]
pub(super) struct Library {
    entries: HashMap<String, Entry>,
    /// The libraries, and the textures that they name, used or not, as far as they are there.
    files: Vec<PathBuf>,
}

/// The largest exponent that is usual.
const SHARPEST: f32 = 1000.0;
/// Up to this exponent a highlight would cover all that the light does: `Ns 0` of MeshLab and `Ns 1` of trimesh stand
/// beside a `Ks` that nobody is meant to see.
const BLUNTEST: f32 = 1.0;

#[derive(Default)]
struct Entry {
    file: PathBuf,
    ambient: Option<Vec3>,
    diffuse: Option<Vec3>,
    specular: Vec3,
    emission: Vec3,
    shininess: Option<f32>,
    roughness: Option<f32>,
    illumination: Option<i32>,
    /// The line that makes it transparent.
    transparent: Option<usize>,
    /// The line that makes it a mirror or glass.
    mirror: Option<usize>,
    map: Option<Map>,
}

/// `map_Kd` with its options.
#[derive(Clone)]
struct Map {
    line: usize,
    file: String,
    scale: Vec2,
    offset: Vec2,
    clamp: bool,
}

impl Library {
    /// Reads the file (or, where no file has the whole name, the files) that `mtllib` on `line` of `obj` names.
    /// A missing one is a warning.
    pub(super) fn read(&mut self, obj: &Path, line: usize, names: &str, warnings: &mut Vec<Warning>) -> Result<()> {
        if names.trim().is_empty() {
            return Ok(());
        }
        // A name may contain spaces and more; the format also lets several names stand in a line, and comments behind
        // them.
        let one = |names: &str| vec![texture::beside(obj, names)];
        let each = |names: &str| names.split_whitespace().map(|name| texture::beside(obj, name)).collect::<Vec<_>>();
        let are_there = |files: &[PathBuf]| files.iter().all(|file| file.is_file());
        let plain = before_comment(names);
        let ways = [one(names), each(names), one(plain), each(plain)];
        let some = |files: &&Vec<PathBuf>| files.iter().any(|file| file.exists());
        let found = ways.iter().find(|files| are_there(files)).or_else(|| Some(&ways[3]).filter(some));
        let files = found.unwrap_or(&ways[2]).clone();
        for file in files {
            match Mapped::open(&file) {
                Ok(bytes) => {
                    self.parse(&file, &bytes, warnings)?;
                    self.files.push(file);
                }
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                    let message = format!("material library {:?} is missing; its materials are grey", file.display());
                    warnings.push(Warning::new(obj, format!("line {line}"), message));
                }
                Err(e) => {
                    let error = Error::input(file, "", system_message(&e));
                    return Err(error.named_in(obj, &format!("line {line}")));
                }
            }
        }
        Ok(())
    }

    fn parse(&mut self, file: &Path, bytes: &[u8], warnings: &mut Vec<Warning>) -> Result<()> {
        let mut entry: Option<(String, Entry)> = None;
        let mut ignored: Option<(usize, String)> = None;
        for (line, text) in Lines::new(without_mark(bytes)) {
            let mut words = Words::new(&text, line);
            let Some(keyword) = words.next() else { continue };
            let fail = |message: String| Error::input(file, format!("line {line}"), message);
            if keyword == b"newmtl" {
                self.add(entry.take());
                entry = Some((name(words.rest()), Entry { file: file.to_path_buf(), ..Entry::default() }));
            } else if !keyword.starts_with(b"#") {
                let Some((_, entry)) = &mut entry else {
                    return Err(fail(format!("{} comes before the first newmtl", quoted(keyword))));
                };
                if let Some(left_out) = entry.statement(keyword, line, &mut words).map_err(fail)? {
                    ignored.get_or_insert((line, left_out));
                }
                if is_map(keyword) {
                    self.files.extend(named_file(file, &text));
                }
            }
        }
        self.add(entry);
        if let Some((line, word)) = ignored {
            let message = format!("{word} is not supported and left out, as are any others like it");
            warnings.push(Warning::new(file, format!("line {line}"), message));
        }
        Ok(())
    }

    fn add(&mut self, entry: Option<(String, Entry)>) {
        if let Some((name, entry)) = entry {
            self.entries.entry(name).or_insert(entry);
        }
    }

    /// Hands `scene` the named materials, in that order, and their textures. `colored`: where the vertices have colours
    /// of their own, a material that the library does not have is white.
    pub(super) fn resolve(
        self,
        obj: &Path,
        names: Vec<String>,
        colored: bool,
        scene: &mut Scene,
        warnings: &mut Vec<Warning>,
    ) -> Result<()> {
        let mut textures = Textures::default();
        let mut materials = Vec::new();
        let plain = if colored { Vec3::ONE } else { Material::default().diffuse };
        // Transparent, mirrors.
        let mut first: [Option<(&Entry, usize)>; 2] = [None; 2];
        for name in names {
            let entry = self.entries.get(&name).or_else(|| {
                let plain = before_comment(&name);
                let is_same = |(other, _): &(&String, &Entry)| before_comment(other) == plain;
                self.entries.get(plain).or_else(|| self.entries.iter().find(is_same).map(|(_, entry)| entry))
            });
            let Some(entry) = entry else {
                // Without a usemtl, or without any library, grey is what is asked for; the library's absence is told.
                if !name.is_empty() && !self.files.is_empty() {
                    let message = format!("material {} is in no material library; it is grey", quoted(name.as_bytes()));
                    warnings.push(Warning::new(obj, "", message));
                }
                materials.push(Material { name, ambient: plain, diffuse: plain, ..Material::default() });
                continue;
            };
            for (first, line) in first.iter_mut().zip([entry.transparent, entry.mirror]) {
                *first = first.or(line.map(|line| (entry, line)));
            }
            let texture = match &entry.map {
                Some(map) => textures.get(&entry.file, map, warnings)?,
                None => None,
            };
            materials.push(entry.material(name, texture));
        }
        let messages = [
            "transparency (d, Tr) is not supported; everything is rendered opaque",
            "mirrors and glass (illum 3 and up) are not supported; everything is rendered without",
        ];
        for (first, message) in first.into_iter().zip(messages) {
            if let Some((entry, line)) = first {
                warnings.push(Warning::new(&entry.file, format!("line {line}"), message));
            }
        }
        scene.materials = materials;
        scene.textures = textures.list;
        scene.files = self.files;
        Ok(())
    }
}

impl Entry {
    /// Takes one statement. What of it changes the look but is not supported is given back.
    fn statement(&mut self, keyword: &[u8], line: usize, words: &mut Words<'_>) -> Placeless<Option<String>> {
        match keyword {
            b"Ka" | b"Kd" | b"Ks" | b"Ke" if next_is(words, b"spectral") => {
                return Ok(Some(quoted(&[keyword, b" spectral"].concat())));
            }
            b"Ka" => self.ambient = Some(color(keyword, words)?),
            b"Kd" => self.diffuse = Some(color(keyword, words)?),
            b"Ks" => self.specular = color(keyword, words)?,
            b"Ke" => self.emission = color(keyword, words)?,
            b"Ns" => self.shininess = Some(scalar(keyword, words)?.max(0.0)),
            b"Pr" => self.roughness = Some(scalar(keyword, words)?.clamp(0.0, 1.0)),
            b"d" | b"Tr" => {
                // `d -halo 0.5` is transparency too.
                let value = words
                    .filter_map(number::<f32>)
                    .last()
                    .ok_or_else(|| format!("{} needs a number", quoted(keyword)))?;
                let opacity = if keyword == b"d" { value } else { 1.0 - value };
                self.transparent = (opacity < 1.0).then_some(line);
            }
            b"illum" => {
                let model = words.number().ok_or("illum needs a whole number")?;
                self.illumination = Some(model);
                self.mirror = (3..=9).contains(&model).then_some(line);
            }
            b"map_Kd" => {
                if words.rest().is_empty() {
                    return Ok(Some("map_Kd without a file name".to_owned()));
                }
                let (map, left_out) = Map::parse(line, words)?;
                self.map = Some(map);
                return Ok(left_out);
            }
            // Physical values that Phong's model has no use for.
            b"Ni" | b"Tf" | b"sharpness" | b"Pm" | b"Ps" | b"Pc" | b"Pcr" | b"aniso" | b"anisor" => {}
            _ => return Ok(Some(quoted(keyword))),
        }
        Ok(None)
    }

    /// The exponent of the highlight; none where there is no highlight.
    fn shininess(&self) -> Option<f32> {
        // The same width as a lobe of GGX of that roughness (Walter et al. 2007, *Microfacet models for refraction
        // through rough surfaces*).
        let of_roughness = |roughness: f32| (2.0 / roughness.powi(4) - 2.0).min(SHARPEST);
        let exponent = self.shininess.or(self.roughness.map(of_roughness))?;
        (exponent > BLUNTEST).then_some(exponent)
    }

    fn material(&self, name: String, diffuse_texture: Option<u32>) -> Material {
        // A texture alone means the texture as it is.
        let plain = if diffuse_texture.is_some() { Vec3::ONE } else { Material::default().diffuse };
        let diffuse = self.diffuse.unwrap_or(plain);
        let shininess = self.shininess().filter(|_| !matches!(self.illumination, Some(0 | 1)));
        Material {
            name,
            ambient: self.ambient.unwrap_or(diffuse),
            diffuse,
            specular: if shininess.is_some() { self.specular } else { Vec3::ZERO },
            shininess: shininess.unwrap_or(Material::default().shininess),
            emission: self.emission,
            diffuse_texture,
            ..Material::default()
        }
    }
}

impl Map {
    /// The map, and the first of its options that changes the look but is not supported.
    fn parse(line: usize, words: &mut Words<'_>) -> Placeless<(Self, Option<String>)> {
        let mut left_out = None;
        let mut map = Self { line, file: String::new(), scale: Vec2::ONE, offset: Vec2::ZERO, clamp: false };
        loop {
            let rest = words.rest();
            let mut ahead = Words::new(rest, line);
            let option = ahead.next().ok_or("map_Kd needs a file name")?;
            // Options with 1 to 3 numbers, of which the later ones may be missing.
            let numbers = match option {
                b"-s" | b"-o" | b"-t" => 3,
                b"-mm" => 2,
                b"-clamp" | b"-blendu" | b"-blendv" | b"-cc" | b"-bm" | b"-boost" | b"-texres" | b"-imfchan"
                | b"-type" => 1,
                _ => {
                    map.file = name(rest);
                    return Ok((map, left_out));
                }
            };
            words.next();
            let neutral = match option {
                b"-s" => [1.0; 3],
                b"-mm" => [0.0, 1.0, 0.0],
                _ => [0.0; 3],
            };
            let mut values = neutral;
            for (k, value) in values.iter_mut().enumerate().take(numbers) {
                let next = Words::new(words.rest(), line).next();
                let Some(word) = next else { break };
                if matches!(option, b"-clamp" | b"-blendu" | b"-blendv" | b"-cc" | b"-imfchan" | b"-type") {
                    map.clamp |= option == b"-clamp" && word == b"on";
                } else if let Some(number) = number::<f32>(word).filter(|n| n.is_finite()) {
                    *value = number;
                } else if k == 0 {
                    return Err(format!("{} needs a number, not {}", quoted(option), quoted(word)));
                } else {
                    break;
                }
                words.next();
            }
            match option {
                b"-s" => map.scale = Vec2::new(values[0], values[1]),
                b"-o" => map.offset = Vec2::new(values[0], values[1]),
                b"-mm" | b"-t" if values != neutral => {
                    left_out.get_or_insert_with(|| format!("option {}", quoted(option)));
                }
                _ => {}
            }
        }
    }
}

/// The textures in use, each file and setting once.
#[derive(Default)]
struct Textures {
    list: Vec<Texture>,
    known: HashMap<(PathBuf, [u32; 4], bool), Option<u32>>,
}

impl Textures {
    fn get(&mut self, library: &Path, map: &Map, warnings: &mut Vec<Warning>) -> Result<Option<u32>> {
        let mut file = texture::beside(library, &map.file);
        if !file.is_file() {
            file = texture::beside(library, before_comment(&map.file));
        }
        let settings = [map.scale.x, map.scale.y, map.offset.x, map.offset.y].map(f32::to_bits);
        let key = (file, settings, map.clamp);
        if let Some(known) = self.known.get(&key) {
            return Ok(*known);
        }
        let place = format!("line {}", map.line);
        let texture = texture::open(&key.0).map_err(|error| error.named_in(library, &place))?;
        let without =
            |why| warnings.push(Warning::new(library, place, format!("{why}; the material is rendered without it")));
        let texture = texture.map_err(without).ok();
        let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
        let transform = Affine2::from_scale_angle_translation(map.scale, 0.0, map.offset);
        let index = texture.map(|texture| {
            let placed = Texture { transform, wrap_u: wrap, wrap_v: wrap, ..texture };
            self.list.push(placed);
            self.list.len() as u32 - 1
        });
        self.known.insert(key, index);
        Ok(index)
    }
}

/// Whether a statement names a texture, read or not.
fn is_map(keyword: &[u8]) -> bool {
    keyword.starts_with(b"map_") || [&b"bump"[..], b"disp", b"decal", b"refl", b"norm"].contains(&keyword)
}

/// The file that a statement names at its end: after its options, of whatever kind, and with spaces within the name.
fn named_file(file: &Path, statement: &[u8]) -> Option<PathBuf> {
    let statement = statement.trim_ascii();
    let begins = (1..statement.len()).filter(|&i| statement[i - 1].is_ascii_whitespace());
    begins.map(|i| texture::beside(file, &name(&statement[i..]))).find(|path| path.is_file())
}

fn scalar(keyword: &[u8], words: &mut Words<'_>) -> Placeless<f32> {
    let value = words.number::<f32>().filter(|v| v.is_finite());
    value.ok_or_else(|| format!("{} needs a finite number", quoted(keyword)))
}

fn next_is(words: &Words<'_>, word: &[u8]) -> bool {
    Words::new(words.rest(), words.line).next() == Some(word)
}

/// One number for a grey, or three: r, g and b, or `xyz` and CIE 1931's X, Y and Z. What those name beyond the colours
/// of a display is its nearest one.
fn color(keyword: &[u8], words: &mut Words<'_>) -> Placeless<Vec3> {
    let is_xyz = next_is(words, b"xyz");
    let names = if is_xyz { "x y z" } else { "r g b" };
    let problem = || format!("{} needs 3 numbers from 0 up, {names}", quoted(keyword));
    if is_xyz {
        words.next();
    }
    let r: f32 = words.number().ok_or_else(problem)?;
    let color = match words.next() {
        None => Vec3::splat(r),
        Some(comment) if comment.starts_with(b"#") => Vec3::splat(r),
        Some(g) => Vec3::new(r, number(g).ok_or_else(problem)?, words.number().ok_or_else(problem)?),
    };
    if !color.is_finite() || color.min_element() < 0.0 {
        return Err(problem());
    }
    Ok(if is_xyz { (XYZ_TO_RGB * color).max(Vec3::ZERO) } else { color })
}
