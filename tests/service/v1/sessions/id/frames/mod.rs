mod any_order;
mod duplex;
mod in_order;
mod refused;
mod repeats;
mod vanished;
