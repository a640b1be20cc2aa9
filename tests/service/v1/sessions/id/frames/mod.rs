mod any_order;
mod duplex;
mod encoded;
mod files;
mod in_order;
mod refused;
mod repeats;
mod vanished;
