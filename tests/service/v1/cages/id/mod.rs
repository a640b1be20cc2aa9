mod cage_obj;
mod delete;
mod events;
