//! The stages in order, from files to results: a model ([`pipeline`]), a segmentation, a beat ([`gated`]), rest and
//! stress, scans over the years ([`serial`]), what a reader states of a result ([`reading`]), cohorts ([`evaluate`]); the
//! patient and scan that DICOM objects name ([`objects`]), simulated scans ([`examples`]), and the advice for an error
//! ([`advice`]).

pub mod pipeline;

pub mod segmentation;

pub mod gated;

pub mod rest_stress;

pub mod serial;

pub mod reading;

pub mod evaluate;

pub mod objects;

pub mod examples;

pub mod advice;
