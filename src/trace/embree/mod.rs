//! Intel Embree.
