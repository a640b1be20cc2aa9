//! What is said about files that are not read and arguments that do not fit.
