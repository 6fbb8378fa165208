//! Digests of large arrays, by all threads: each stretch has its own, and these are digested in order.
//!
//! XXH3 (Collet 2019, *xxHash: extremely fast non-cryptographic hash algorithm*), 128 bits, finds damage and tells
//! meshes apart at the speed of memory. It does not withstand whoever looks for two meshes of one digest, and need not:
//! what a file holds is compared with the mesh as well (`check`). A cryptographic digest would take longer than the
//! rest of the reading.

use rayon::prelude::*;
use twox_hash::XxHash3_128;

use crate::trace::bvh::build::preset::Preset;
use crate::trace::{Part, Primitives};

/// 128 bits, little endian.
pub(super) type Digest = [u8; 16];

/// Bytes of a stretch.
const STRETCH: usize = 1 << 20;

/// Of a few bytes.
pub(super) fn of_few(bytes: &[u8]) -> Digest {
    XxHash3_128::oneshot(bytes).to_le_bytes()
}

/// Of any number of bytes.
pub(super) fn of(bytes: &[u8]) -> Digest {
    let stretches: Vec<Digest> = bytes.par_chunks(STRETCH).map(of_few).collect();
    of_few(stretches.as_flattened())
}

/// Of all that decides the trees over the triangles of `levels`: positions as traced, corners, the order of the parts,
/// and how trees are built. Neither threads nor instruction sets decide anything.
pub(super) fn of_levels(levels: &[&[Part]], preset: Preset) -> Digest {
    let mut words = preset.name().as_bytes().to_vec();
    for parts in levels {
        words.extend((parts.len() as u64).to_le_bytes());
        for part in *parts {
            match &part.primitives {
                Primitives::Triangles { positions, triangles } => {
                    words.extend((positions.len() as u64).to_le_bytes());
                    words.extend((triangles.len() as u64).to_le_bytes());
                    words.extend(of(bytemuck::cast_slice(positions)));
                    words.extend(of(bytemuck::cast_slice(triangles)));
                }
                // Trees over shapes are built anew: only that there is no mesh matters.
                Primitives::Shapes(_) => words.extend(u64::MAX.to_le_bytes()),
            }
        }
    }
    of_few(&words)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Arc;

    use super::*;
    use crate::math::Vec3;

    #[test]
    fn every_bit_counts_in_every_stretch() {
        // The published test vector of XXH3, 128 bits, for nothing.
        assert_eq!(u128::from_le_bytes(of_few(b"")), 0x99aa_06d3_0147_98d8_6001_c324_468d_497f);
        let mut bytes: Vec<u8> = (0..2 * STRETCH + 100).map(|i| (i % 251) as u8).collect();
        let whole = of(&bytes);
        let mut seen = BTreeSet::from([whole, of(&bytes[1..]), of(&bytes[..STRETCH])]);
        for at in [0, STRETCH - 1, STRETCH, 2 * STRETCH, 2 * STRETCH + 99] {
            bytes[at] ^= 16;
            assert!(seen.insert(of(&bytes)), "byte {at}");
            bytes[at] ^= 16;
        }
        assert_eq!(of(&bytes), whole);
    }

    #[test]
    fn what_decides_a_tree_changes_the_key() {
        let part = |positions: &[f32], triangles: &[[u32; 3]]| {
            let positions = Arc::new(positions.chunks_exact(3).map(Vec3::from_slice).collect());
            Part {
                geometry: 0,
                instance: 0,
                primitives: Primitives::Triangles { positions, triangles: Arc::new(triangles.to_vec()) },
            }
        };
        let shapes = || Part { geometry: 0, instance: 0, primitives: Primitives::Shapes(Arc::new(Vec::new())) };
        let a = || part(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], &[[0, 1, 2]]);
        let turned = part(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], &[[1, 2, 0]]);
        let moved = part(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, -0.0], &[[0, 1, 2]]);
        let keys = [
            of_levels(&[], Preset::Default),
            of_levels(&[&[]], Preset::Default),
            of_levels(&[&[a()]], Preset::Default),
            of_levels(&[&[a()]], Preset::High),
            of_levels(&[&[a(), a()]], Preset::Default),
            of_levels(&[&[a()], &[a()]], Preset::Default),
            of_levels(&[&[shapes(), a()]], Preset::Default),
            of_levels(&[&[a(), shapes()]], Preset::Default),
            of_levels(&[&[turned]], Preset::Default),
            of_levels(&[&[moved]], Preset::Default),
        ];
        assert_eq!(BTreeSet::from(keys).len(), keys.len());
        let other = Part { geometry: 7, instance: 3, ..a() };
        assert_eq!(of_levels(&[&[other]], Preset::Default), keys[2], "names of the parts are not in the tree");
    }
}
