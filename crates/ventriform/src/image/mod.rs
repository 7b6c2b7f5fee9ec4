//! Images: voxels with their place ([`grid`]), pictures of results ([`draw`]), volumes made of projections
//! ([`reconstruct`]), files read and written ([`volume`]), and where the heart is in a volume ([`locate`]).

pub mod grid;

pub mod draw;

pub mod reconstruct;

pub mod volume;

pub mod locate;
