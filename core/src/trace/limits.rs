//! How large a scene may be: told before any tree is built.

use super::Part;
use crate::error::{Error, Result};

/// Primitives that may stand in one system of coordinates, that of the world or of an object: what a leaf of the native
/// tracer's trees can name.
pub(crate) const MAX_PRIMITIVES: u64 = (1 << 29) - 1;

/// Whether `what`, which has these parts, can be traced.
///
/// # Errors
/// [`Error::Scene`] for more than [`MAX_PRIMITIVES`], with the number.
pub(super) fn check(parts: &[Part], what: &str) -> Result<()> {
    check_count(parts.iter().map(|part| part.primitives.len() as u64).sum(), what)
}

fn check_count(count: u64, what: &str) -> Result<()> {
    if count <= MAX_PRIMITIVES {
        return Ok(());
    }
    let remedy = "simplify it, or store what repeats once and place it as instances";
    Err(Error::Scene(format!("{what} has {count} primitives, more than {MAX_PRIMITIVES}; {remedy}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_many_primitives_are_an_error_with_their_number() {
        assert!(check_count(MAX_PRIMITIVES, "the scene").is_ok());
        let error = check_count(600_000_000, "the scene").expect_err("too many");
        assert_eq!(error.exit_code(), 3);
        let message = error.to_string();
        assert!(
            message.contains("600000000") && message.contains("536870911") && message.contains("simplify"),
            "{message}"
        );
    }
}
