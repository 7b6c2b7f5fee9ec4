//! The stages in order, from files to results: a model ([`pipeline`]), a segmentation, a beat ([`gated`]), rest and
//! stress, cohorts ([`evaluate`]); whose the DICOM objects of a result are ([`objects`]), and what to do about an error
//! ([`advice`]).

pub mod pipeline;

pub mod segmentation;

pub mod gated;

pub mod rest_stress;

pub mod evaluate;

pub mod objects;

pub mod advice;
