//! Captures whose points change their order or their unit after the first frame.
