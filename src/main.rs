//! The `ventriform` command.

fn main() {}
