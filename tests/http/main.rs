//! The service over HTTP, as its clients meet it.

mod listen;
mod openapi;
