//! The program as its users meet it: command lines in, files, words and exit statuses out.

mod decode;
mod demo;
mod encode;
mod inspect;
mod real_data;
mod refused;
mod support;
mod usage;
