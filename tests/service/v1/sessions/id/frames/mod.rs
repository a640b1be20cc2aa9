mod any_order;
mod duplex;
mod refused;
mod repeats;
mod vanished;
