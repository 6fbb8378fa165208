//! Messages that quote a file, which may hold names of any length.

/// Most characters of what is quoted.
const MAX_QUOTED: usize = 60;
/// Most characters of a message.
const MAX: usize = 600;

/// A message in which what stands between quotes (`"` as Rust and serde write texts, `` ` `` as serde writes names) is
/// cut short.
pub(super) fn shortened(message: &str) -> String {
    let mut short = String::new();
    let mut rest = message;
    while let Some(start) = rest.find(['"', '`']) {
        let quote = rest[start..].chars().next().unwrap_or('"');
        let (before, quoted) = rest.split_at(start + 1);
        short.push_str(before);
        let end = end(quoted, quote);
        short.extend(quoted[..end].chars().take(MAX_QUOTED));
        if quoted[..end].chars().nth(MAX_QUOTED).is_some() {
            short.push('…');
        }
        let closed = (end + 1).min(quoted.len());
        short.push_str(&quoted[end..closed]);
        rest = &quoted[closed..];
    }
    short.push_str(rest);
    match short.char_indices().nth(MAX) {
        Some((end, _)) => format!("{}…", &short[..end]),
        None => short,
    }
}

/// What the JSON library says, in JSON's words for the types of Rust, where it does not quote the file.
pub(super) fn plain(message: &str) -> String {
    const WORDS: [(&str, &str); 12] = [
        ("expected usize", "expected a whole number from 0 on"),
        ("expected u64", "expected a whole number from 0 on"),
        ("expected u32", "expected a whole number from 0 on"),
        ("expected u16", "expected a whole number from 0 on"),
        ("expected u8", "expected a whole number from 0 to 255"),
        ("expected i32", "expected a whole number"),
        ("expected f32", "expected a number"),
        ("expected f64", "expected a number"),
        ("expected a sequence", "expected an array"),
        ("expected a map", "expected an object"),
        ("type: sequence", "type: array"),
        ("type: map", "type: object"),
    ];
    // The last words are the library's own, as are those before what it quotes; a structure has a name that is ours.
    let (before, expected) = message.rsplit_once(", ").unwrap_or(("", message));
    let expected = if expected.starts_with("expected struct ") { "expected an object" } else { expected };
    let told = |text: &str| {
        let word = WORDS.iter().find_map(|(word, plain)| Some((text.strip_suffix(word)?, plain)));
        word.map_or_else(|| text.to_owned(), |(head, plain)| format!("{head}{plain}"))
    };
    if before.is_empty() { told(expected) } else { format!("{}, {}", told(before), told(expected)) }
}

/// Where a quotation ends: at the next such mark that no backslash stands before, or with the message.
fn end(quoted: &str, quote: char) -> usize {
    let mut is_escaped = false;
    let ends = |character: char| {
        let ends = character == quote && !is_escaped;
        is_escaped = character == '\\' && !is_escaped;
        ends
    };
    quoted.find(ends).unwrap_or(quoted.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_quoted_is_cut_and_the_rest_stays() {
        let long = "x".repeat(5000);
        for quote in ['"', '`'] {
            let message = format!("invalid type: string {quote}{long}{quote}, expected a sequence");
            let expected = format!("invalid type: string {quote}{}…{quote}, expected a sequence", "x".repeat(60));
            assert_eq!(shortened(&message), expected);
        }
        let both = format!("{:?} and {:?}", "\"é\\".repeat(1000), "short");
        assert!(shortened(&both).ends_with("…\" and \"short\"") && shortened(&both).chars().count() < 90);
        for whole in
            ["nothing quoted", "it's `a` or \"b\"", "an odd \" mark", "unknown variant `x`, expected one of `y`, `z`"]
        {
            assert_eq!(shortened(whole), whole);
        }
        assert_eq!(shortened(&"é".repeat(5000)).chars().count(), MAX + 1);
    }
}
