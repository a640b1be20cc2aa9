//! Folders and patterns: which files are frames, and in which order.
