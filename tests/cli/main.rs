//! The program as its users meet it: command lines in, files, words and exit statuses out.

mod bound;
mod cage;
mod cage_of_a_take;
mod cages_out;
mod cases;
mod coding;
mod compare;
mod components;
mod decode;
mod defaults;
mod demo;
mod edits;
mod encode;
mod explore;
mod farm;
#[cfg(unix)]
mod full_disk;
mod golden;
mod green;
mod harmonic;
mod inspect;
#[cfg(target_os = "linux")]
mod interrupted;
mod manners;
#[cfg(target_os = "linux")]
mod memory;
mod mistakes;
mod outputs;
mod ranges;
mod real_coding;
mod real_data;
mod real_green;
mod real_harmonic;
mod real_methods;
mod real_recover;
mod real_transfer;
mod recover;
mod refused;
mod support;
mod times;
mod transfer;
mod transfer_motion;
mod units;
mod usage;
