//! What judges the rest.
