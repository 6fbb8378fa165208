//! What this render needs, and nothing else.
