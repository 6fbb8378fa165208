//! What a word that is not known was probably meant to be.

use super::text::quoted;

/// Bytes of a word that may be a misspelt one.
const LONGEST: usize = 40;

/// `; did you mean "..."?` for the known word that is nearest, nothing where none is near.
pub(super) fn suggestion<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    // A name is not compared as a whole story: nothing that long is a misspelt keyword.
    if word.len() > LONGEST {
        return String::new();
    }
    let near = known.into_iter().map(|known| (distance(word, known), known));
    // A third of the letters wrong is a slip; more is another word.
    let near =
        near.filter(|(distance, known)| 3 * distance <= known.len().max(3)).min_by_key(|(distance, _)| *distance);
    near.map(|(_, known)| format!("; did you mean {known:?}?")).unwrap_or_default()
}

/// The same; and where none is near, all there are, if they are few: names that `table` gives, as in `[material.NAME]`.
pub(super) fn suggestion_or_all<'a>(word: &str, known: impl IntoIterator<Item = &'a str>, table: &str) -> String {
    const FEW: usize = 12;
    let mut known: Vec<&str> = known.into_iter().collect();
    let near = suggestion(word, known.iter().copied());
    if !near.is_empty() {
        return near;
    }
    known.sort_unstable();
    let names: Vec<String> = known.iter().take(FEW).map(|name| quoted(name.as_bytes())).collect();
    let more = if known.len() > FEW { " ..." } else { "" };
    match names[..] {
        [] => format!("; there is no {table} in this file"),
        _ => format!("; there are {}{more}", names.join(", ")),
    }
}

/// Whether a word is a known one with a slip of a finger or two: not where it may well be another.
pub(super) fn is_slip(word: &str, known: &str) -> bool {
    word.len() <= LONGEST && distance(word, known) <= (known.len() / 3).min(2)
}

/// Letters to insert, delete, replace or exchange with their neighbour to make one word of the other, in any case
/// (Damerau 1964, *A technique for computer detection and correction of spelling errors*; by the recurrence of Wagner
/// and Fischer 1974, *The string-to-string correction problem*).
fn distance(a: &str, b: &str) -> usize {
    let [a, b] = [a, b].map(|word| word.chars().flat_map(char::to_lowercase).collect::<Vec<_>>());
    // Rows of the table for one and two letters less of `a`.
    let mut above: Vec<usize> = (0..=b.len()).collect();
    let mut two_above = above.clone();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replaced = above[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replaced.min(above[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(two_above[j - 2] + 1);
            }
        }
        two_above = std::mem::replace(&mut above, row);
    }
    above[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_told_from_other_words() {
        for (a, b, expected) in [("", "abc", 3), ("kitten", "sitting", 3), ("ab", "ba", 1), ("Size", "size", 0)] {
            assert_eq!((distance(a, b), distance(b, a)), (expected, expected), "{a} {b}");
        }
        let known = ["diffuse", "specular", "size", "tri"];
        assert_eq!(suggestion("difuse", known), "; did you mean \"diffuse\"?");
        assert_eq!(suggestion("specluar", known), "; did you mean \"specular\"?");
        assert_eq!(suggestion("tree", known), "");
        assert_eq!(suggestion("zzz", known), "");
        assert_eq!(suggestion_or_all("sizw", known, "[a.NAME]"), "; did you mean \"size\"?");
        let all = "; there are \"diffuse\", \"size\", \"specular\", \"tri\"";
        assert_eq!(suggestion_or_all("zzz", known, "[a.NAME]"), all);
        assert_eq!(suggestion_or_all("zzz", [], "[a.NAME]"), "; there is no [a.NAME] in this file");
        assert_eq!(suggestion(&"x".repeat(1 << 20), known), "");
    }
}
