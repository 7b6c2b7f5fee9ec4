//! Files to a heart in an image: voxels with their place ([`grid`]), pictures ([`draw`]), files to voxels and back
//! ([`volume`]), the heart in them ([`locate`]).

pub mod grid;

pub mod draw;

pub mod volume;

pub mod locate;
