//! Arrays as NumPy users save them.
