//! Mesh files as other programs write them.
