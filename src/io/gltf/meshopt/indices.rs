//! Indices in any order: each as the difference from one of two that came before.

use super::stream::{Stream, zigzag};
use crate::io::Placeless;

const HEADER: u8 = 0xd1;

/// `count` indices.
pub(super) fn decode(source: &[u8], count: usize) -> Placeless<Vec<u32>> {
    let (mut stream, _) = Stream::open(source, HEADER, 4)?;
    let mut last = [0u32; 2];
    let mut indices = Vec::new();
    for _ in 0..count {
        let code = stream.number()?;
        let last = &mut last[(code & 1) as usize];
        *last = last.wrapping_add(zigzag(code >> 1));
        indices.push(*last);
    }
    stream.finish()?;
    Ok(indices)
}
