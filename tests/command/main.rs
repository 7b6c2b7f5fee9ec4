//! What the program's commands write and say: files, keys and errors that other programs rely on.

mod evaluate;
mod segment;
