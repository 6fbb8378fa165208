//! Every primitive for every ray: the yardstick.
