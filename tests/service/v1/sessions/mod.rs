mod concurrent;
mod create;
mod geometry;
mod id;
mod idempotency;
mod list;
