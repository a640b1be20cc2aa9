//! The service as its users meet it: over sockets, in a process of its own. The tree of modules is that of the addresses;
//! `process` has what concerns all of them.

mod openapi;
mod process;
mod proxies;
mod support;
mod v1;
