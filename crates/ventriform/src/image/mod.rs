//! Images: voxels with their place ([`grid`]), pictures of results ([`draw`]), files read and written ([`volume`]), and
//! where the heart is in a volume ([`locate`]).

pub mod grid;

pub mod draw;

pub mod volume;

pub mod locate;
