//! The native BVH.
