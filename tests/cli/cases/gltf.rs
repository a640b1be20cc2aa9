//! Models in `.glb` files as the specification lets them be written.
