//! Which integrator renders a scene: the cheapest that shows everything in it.
//!
//! Indirect light is in every scene that is not black, so it is no reason to trace paths: light that comes from nothing
//! but surfaces that glow is, for without paths the picture would be dark.

use crate::scene::Integrator;

/// What the choice depends on.
pub(super) struct Needs<'a> {
    /// Whether anything mirrors or refracts.
    pub(super) sends_on: bool,
    /// Whether anything is matte or has highlights.
    pub(super) is_lit: bool,
    /// Whether the scene has no light but what glows, and no headlight is added.
    pub(super) is_dark: bool,
    /// Whether anything glows that is no light's body, or the background does. Asked only where it matters.
    pub(super) emitters: &'a dyn Fn() -> bool,
}

/// The integrator, and why.
pub(super) fn choose(wish: Option<Integrator>, needs: &Needs<'_>) -> (Integrator, &'static str) {
    if let Some(wish) = wish {
        return (wish, "asked for");
    }
    if needs.is_dark && needs.is_lit && (needs.emitters)() {
        (Integrator::Path, "only what glows, or is behind everything, lights the scene")
    } else if needs.sends_on {
        (Integrator::Whitted, "mirrors or glass send rays on")
    } else {
        (Integrator::RayCast, "nothing sends rays on")
    }
}
