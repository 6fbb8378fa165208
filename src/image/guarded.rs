//! Decoders that panic.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// What a decoder makes of a file; words where it panics, as decoders do where nobody thought of what a file holds.
pub(crate) fn guarded<T, E: From<String>>(decode: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    // What it has in hand is given up with it.
    catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err("its decoder failed; the file is broken".to_owned().into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error() {
        assert_eq!(guarded(|| Ok::<_, String>(1)), Ok(1));
        let message = guarded(|| -> Result<(), String> { panic!("on purpose") }).unwrap_err();
        assert!(message.contains("broken"), "{message}");
    }
}
