//! Triangles: mostly one byte each, which says what edge and what vertex met lately they are made of.

use super::stream::{Stream, zigzag};
use crate::io::Placeless;

const HEADER: u8 = 0xe1;

/// The last 16 of something, the latest first.
struct Recent<T> {
    items: [T; 16],
    next: usize,
}

impl<T: Copy> Recent<T> {
    fn push(&mut self, item: T) {
        self.items[self.next % 16] = item;
        self.next = (self.next + 1) % 16;
    }

    /// The one that came `age` before the latest, below 16.
    fn get(&self, age: usize) -> T {
        self.items[(self.next + 15 - age) % 16]
    }
}

struct Decoder<'a> {
    data: Stream<'a>,
    /// The lowest index that was not met.
    next: u32,
    /// The last that was spelled out.
    last: u32,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
}

/// `count` indices, a multiple of 3.
pub(super) fn decode(source: &[u8], count: usize) -> Placeless<Vec<u32>> {
    let (mut data, table) = Stream::open(source, HEADER, 16)?;
    let codes = data.bytes(count / 3)?;
    // What no triangle has pushed is past all vertices.
    let mut decoder = Decoder {
        data,
        next: 0,
        last: 0,
        edges: Recent { items: [[u32::MAX; 2]; 16], next: 0 },
        vertices: Recent { items: [u32::MAX; 16], next: 0 },
    };
    let mut indices = Vec::with_capacity(count);
    for code in codes {
        indices.extend(decoder.triangle(*code, table)?);
    }
    decoder.data.finish()?;
    Ok(indices)
}

impl Decoder<'_> {
    fn triangle(&mut self, code: u8, table: &[u8]) -> Placeless<[u32; 3]> {
        let (edge, vertex) = (code >> 4, code & 15);
        if edge < 15 {
            let [a, b] = self.edges.get(edge.into());
            let c = match vertex {
                0 => self.fresh(),
                1..=12 => self.vertices.get(vertex.into()),
                13 => self.spelled_out(self.last.wrapping_sub(1)),
                14 => self.spelled_out(self.last.wrapping_add(1)),
                _ => self.explicit()?,
            };
            if !(1..=12).contains(&vertex) {
                self.vertices.push(c);
            }
            self.edges.push([c, b]);
            self.edges.push([a, c]);
            return Ok([a, b, c]);
        }
        let pair = if vertex < 14 { table[usize::from(vertex)] } else { self.data.byte()? };
        let [second, third] = [pair >> 4, pair & 15];
        if vertex < 14 && (second == 15 || third == 15) {
            return Err("the table of triangle codes has a code that it must not have".into());
        }
        if vertex >= 14 && pair == 0 {
            self.next = 0;
        }
        let a = if vertex == 15 { self.explicit()? } else { self.fresh() };
        let b = self.named(second)?;
        let c = self.named(third)?;
        self.vertices.push(a);
        for (name, index) in [(second, b), (third, c)] {
            if matches!(name, 0 | 15) {
                self.vertices.push(index);
            }
        }
        self.edges.push([b, a]);
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok([a, b, c])
    }

    /// The vertex that four bits name. Those of a triangle are pushed after it, so that ages count from before.
    fn named(&mut self, name: u8) -> Placeless<u32> {
        match name {
            0 => Ok(self.fresh()),
            15 => self.explicit(),
            age => Ok(self.vertices.get(usize::from(age) - 1)),
        }
    }

    fn fresh(&mut self) -> u32 {
        let index = self.next;
        self.next = self.next.wrapping_add(1);
        index
    }

    fn explicit(&mut self) -> Placeless<u32> {
        let index = self.last.wrapping_add(zigzag(self.data.number()?));
        Ok(self.spelled_out(index))
    }

    fn spelled_out(&mut self, index: u32) -> u32 {
        self.last = index;
        index
    }
}
