mod background;
mod create;
mod id;
mod idempotency;
mod list;
mod refused;
mod restart;
