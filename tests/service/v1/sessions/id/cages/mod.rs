mod follow;
mod forms;
mod ranges;
