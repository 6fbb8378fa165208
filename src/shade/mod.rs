//! From hits to radiance.
