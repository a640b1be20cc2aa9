mod access;
mod limits;
mod overload;
mod problems;
mod restart;
mod stop;
mod unread;
