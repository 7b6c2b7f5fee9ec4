//! The version of the file, and how many people a group needs.

/// The version of the JSON that is written and read.
pub const NORMALS_SCHEMA_VERSION: u32 = 1;
/// Fewest healthy people of a group.
pub const FEWEST_CASES: usize = 12;
/// Number of healthy people below which a group is flagged.
pub const FEW_CASES: usize = 30;
