//! The GLB container: a header, then chunks; the first is the JSON, the second may be a buffer.

use crate::io::Placeless;

/// The JSON of a file, and the buffer that comes with it.
pub(super) struct Parts<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
    /// Bytes after the end that the header gives.
    pub(super) rest: usize,
}

/// Splits a file. A file that does not begin with GLB's magic number is JSON as a whole, whatever its suffix.
///
/// # Errors
/// The place and what is wrong.
pub(super) fn split(bytes: &[u8]) -> Result<Parts<'_>, (String, String)> {
    if !bytes.starts_with(b"glTF") {
        return Ok(Parts { json: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), binary: None, rest: 0 });
    }
    let fail = |at: usize| move |message: String| (format!("byte {at}"), message);
    let version = word(bytes, 4).map_err(fail(4))?;
    if version != 2 {
        return Err(fail(4)(format!("GLB version {version}; only 2 can be read")));
    }
    let length = word(bytes, 8).map_err(fail(8))? as usize;
    let there = bytes.len();
    let bytes = bytes
        .get(..length)
        .ok_or_else(|| fail(8)(format!("truncated GLB: the header promises {length} bytes, the file has {there}")))?;
    let rest = there - length;
    let (json, kind, next) = chunk(bytes, 12).map_err(fail(12))?;
    if kind != *b"JSON" {
        return Err(fail(16)("the first chunk of a GLB has to be JSON".into()));
    }
    if next + 8 > bytes.len() {
        return Ok(Parts { json, binary: None, rest });
    }
    // Chunks of other kinds are extensions, to be ignored.
    let (binary, kind, _) = chunk(bytes, next).map_err(fail(next))?;
    Ok(Parts { json, binary: (kind == *b"BIN\0").then_some(binary), rest })
}

/// The chunk at `at`: contents, kind, and where the next one begins.
fn chunk(bytes: &[u8], at: usize) -> Placeless<(&[u8], [u8; 4], usize)> {
    let length = word(bytes, at)? as usize;
    let kind = word(bytes, at + 4)?.to_le_bytes();
    let contents = bytes.get(at + 8..).and_then(|rest| rest.get(..length)).ok_or_else(|| {
        format!("truncated GLB: a chunk promises {length} bytes, {} are left", bytes.len().saturating_sub(at + 8))
    })?;
    Ok((contents, kind, (at + 8 + length).next_multiple_of(4)))
}

fn word(bytes: &[u8], at: usize) -> Placeless<u32> {
    let word = bytes.get(at..).and_then(|rest| rest.first_chunk());
    word.map(|word| u32::from_le_bytes(*word)).ok_or_else(|| "truncated GLB: the file ends within a header".into())
}
