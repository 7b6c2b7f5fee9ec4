//! Tests stand in the next commit.
