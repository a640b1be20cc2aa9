mod any_order;
mod duplex;
mod encoded;
mod in_order;
mod refused;
mod repeats;
mod vanished;
