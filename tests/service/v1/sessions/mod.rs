mod coded;
mod concurrent;
mod create;
mod geometry;
mod id;
mod idempotency;
mod list;
mod without_cage;
