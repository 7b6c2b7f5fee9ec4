//! The left ventricle of a patient: a model fitted to the volume ([`model`], [`deform`], [`judge`], [`fit`]), the wall's
//! uptake ([`polar`]) and motion ([`beat`], during the scan [`views`]), compared with healthy people ([`normals`]), between rest and stress
//! ([`comparison`]) and over the years ([`serial`]), and drawn as a reader draws it ([`reader`]).

pub mod model;

pub mod deform;

pub mod judge;

pub mod fit;

pub mod polar;

pub mod views;

pub mod beat;

pub mod normals;

pub mod comparison;

pub mod serial;

pub mod reader;
