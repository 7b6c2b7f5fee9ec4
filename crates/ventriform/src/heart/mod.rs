//! A model and a volume to what a physician asks: the fitted wall ([`model`], [`deform`], [`judge`], [`fit`]), its uptake
//! ([`polar`]), its motion ([`beat`]), and each against others ([`normals`], [`comparison`], [`reader`]).

pub mod model;

pub mod deform;

pub mod judge;

pub mod fit;

pub mod polar;

pub mod beat;

pub mod normals;

pub mod comparison;

pub mod reader;
