//! Lets the module find Python's symbols where it is loaded, on systems whose linkers insist on them.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
