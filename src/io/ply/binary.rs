//! The body of a binary PLY file, of either byte order.

use super::Items;
use super::header::{Element, Scalar};
use crate::io::Placeless;

/// Values, big-endian or little-endian.
pub(super) struct Binary<'a, const BIG: bool> {
    rest: &'a [u8],
    end: usize,
}

impl<'a, const BIG: bool> Binary<'a, BIG> {
    /// The body, which begins at the given byte of the file.
    pub(super) fn new(body: &'a [u8], begin: usize) -> Self {
        Self { rest: body, end: begin + body.len() }
    }

    #[inline]
    fn take<const N: usize>(&mut self) -> Placeless<[u8; N]> {
        let Some((bytes, rest)) = self.rest.split_first_chunk::<N>() else {
            return Err(format!("the file ends before its last element; {N} more bytes are needed"));
        };
        self.rest = rest;
        let mut bytes = *bytes;
        if BIG {
            bytes.reverse();
        }
        Ok(bytes)
    }
}

impl<const BIG: bool> Items for Binary<'_, BIG> {
    fn place(&self) -> String {
        format!("byte {}", self.end - self.rest.len())
    }

    fn remaining(&self) -> usize {
        self.rest.len()
    }

    fn least_size(&self, element: &Element) -> usize {
        element.properties.iter().map(|p| p.list.unwrap_or(p.scalar).size()).sum()
    }

    #[inline]
    fn scalar(&mut self, scalar: Scalar) -> Placeless<f64> {
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.take()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.take()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.take()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.take()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.take()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.take()?).into(),
            Scalar::F32 => f32::from_le_bytes(self.take()?).into(),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    /// What nearly every large file has: nothing but lists of three 4-byte indices, a byte for the length. Ends at the
    /// first face that is anything else; the general code reads on from there.
    fn triangles(&mut self, element: &Element, most: usize) -> Vec<[u32; 3]> {
        let [property] = &element.properties[..] else { return Vec::new() };
        let plain = matches!(property.list, Some(Scalar::U8 | Scalar::I8))
            && matches!(property.scalar, Scalar::U32 | Scalar::I32);
        if !plain {
            return Vec::new();
        }
        // A face takes 13 bytes, so this is no more than the file.
        let mut triangles = Vec::with_capacity(most.min(self.rest.len() / 13));
        while triangles.len() < most {
            let Some(([3, corners @ ..], rest)) = self.rest.split_first_chunk::<13>() else { break };
            let index = |k: usize| {
                let bytes = [corners[k], corners[k + 1], corners[k + 2], corners[k + 3]];
                if BIG { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
            };
            triangles.push([index(0), index(4), index(8)]);
            self.rest = rest;
        }
        triangles
    }
}
