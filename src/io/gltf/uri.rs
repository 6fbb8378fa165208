//! What a glTF file refers to: files beside it, or data within the reference itself.

use std::path::{Path, PathBuf};

use crate::io::Placeless;

/// Where a URI leads.
#[derive(Debug, PartialEq)]
pub(super) enum Target {
    /// A file.
    File(PathBuf),
    /// The bytes of a `data:` URI.
    Data(Vec<u8>),
}

/// Most bytes of a file's name: no system takes much more, and no message should hold them.
const LONGEST_NAME: usize = 1024;

/// Resolves a URI within the file `base` (RFC 3986, RFC 2397).
///
/// # Errors
/// What is wrong with it.
pub(super) fn resolve(base: &Path, uri: &str) -> Placeless<Target> {
    if let Some((_, rest)) = uri.split_at_checked(5).filter(|(scheme, _)| scheme.eq_ignore_ascii_case("data:")) {
        let (head, data) = rest.split_once(',').ok_or("a data URI without a comma")?;
        let last = head.rsplit_once(';').map_or("", |(_, last)| last);
        return match last.trim().eq_ignore_ascii_case("base64") {
            true if data.contains('%') => base64(&percent(data)?).map(Target::Data),
            true => base64(data.as_bytes()).map(Target::Data),
            false => percent(data).map(Target::Data),
        };
    }
    // A scheme: letters before a colon, more than the one of a drive.
    let scheme = uri.split(['/', '?', '#']).next().and_then(|first| first.split_once(':'));
    if let Some((scheme, _)) = scheme.filter(|(s, _)| s.len() > 1 && s.bytes().all(|b| b.is_ascii_alphanumeric())) {
        return Err(format!("URIs of the scheme {scheme:?} are not read; use a relative path or data:"));
    }
    let name = String::from_utf8(percent(uri)?).map_err(|_| "a file name that is not UTF-8")?;
    if name.is_empty() || name.contains('\0') {
        return Err("an empty file name, or one with a zero byte".into());
    }
    if name.len() > LONGEST_NAME {
        return Err(format!("a file name of {} bytes; data within the file begin with data:", name.len()));
    }
    let beside = |name: &str| base.parent().unwrap_or(Path::new("")).join(name);
    let file = beside(&name);
    // From Windows, against the specification.
    let is_foreign = name.contains('\\') && !file.exists();
    Ok(Target::File(if is_foreign { beside(&name.replace('\\', "/")) } else { file }))
}

/// Undoes percent-encoding.
fn percent(text: &str) -> Placeless<Vec<u8>> {
    let mut bytes = text.bytes();
    let mut out = Vec::with_capacity(text.len());
    while let Some(b) = bytes.next() {
        if b != b'%' {
            out.push(b);
            continue;
        }
        let mut digit = || bytes.next().and_then(|d| char::from(d).to_digit(16));
        let (Some(high), Some(low)) = (digit(), digit()) else {
            return Err("% without two hexadecimal digits in a URI".into());
        };
        out.push((high * 16 + low) as u8);
    }
    Ok(out)
}

/// Decodes base64 (RFC 4648, section 4), padded or not, in lines or not.
fn base64(text: &[u8]) -> Placeless<Vec<u8>> {
    if text.iter().any(u8::is_ascii_whitespace) {
        return base64(&text.iter().copied().filter(|b| !b.is_ascii_whitespace()).collect::<Vec<_>>());
    }
    let unpadded = text.iter().rposition(|&b| b != b'=').map_or(0, |last| last + 1);
    let mut out = Vec::with_capacity(unpadded / 4 * 3 + 2);
    for group in text[..unpadded].chunks(4) {
        let mut bits = 0u32;
        for &b in group {
            let digit = match b {
                b'A'..=b'Z' => b - b'A',
                b'a'..=b'z' => b - b'a' + 26,
                b'0'..=b'9' => b - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return Err(format!("{:?} is no base64 digit", char::from(b))),
            };
            bits = bits << 6 | u32::from(digit);
        }
        bits <<= 6 * (4 - group.len());
        let bytes = bits.to_be_bytes();
        match group.len() {
            1 => return Err("base64 data of an impossible length".into()),
            digits => out.extend_from_slice(&bytes[1..digits]),
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_as_in_its_specification() {
        // RFC 4648, section 10.
        let known =
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg==", "foob"), ("Zm9vYmE", "fooba")];
        for (encoded, plain) in known {
            assert_eq!(base64(encoded.as_bytes()).unwrap(), plain.as_bytes());
        }
        assert!(base64(b"Zm9vY").is_err());
        assert!(base64(b"Zm.9").is_err());
        assert_eq!(base64(b"Zm9v\r\n  Ym E=\n").unwrap(), b"fooba");
    }

    #[test]
    fn uris_lead_to_files_and_data() {
        let base = Path::new("models/a.gltf");
        assert_eq!(resolve(base, "my%20tex.png"), Ok(Target::File("models/my tex.png".into())));
        assert_eq!(resolve(base, "data:,a%2Cb"), Ok(Target::Data(b"a,b".to_vec())));
        assert_eq!(resolve(base, "data:;base64,Zm9%2FYg%3D%3D"), Ok(Target::Data(b"fo\x7fb".to_vec())));
        for head in ["data:image/png;base64", "data:;BASE64", "DATA:text/plain;charset=x; base64"] {
            assert_eq!(resolve(base, &format!("{head},Zg==")), Ok(Target::Data(b"f".to_vec())), "{head}");
        }
        assert_eq!(resolve(base, "data:base64,Zg=="), Ok(Target::Data(b"Zg==".to_vec())));
        assert_eq!(resolve(base, "maps\\a.png"), Ok(Target::File("models/maps/a.png".into())));
        for bad in ["http://example.org/a.png", "file:///a", "a%2", "data:x", "", &"a".repeat(1025)] {
            assert!(resolve(base, bad).is_err(), "{bad}");
        }
    }
}
