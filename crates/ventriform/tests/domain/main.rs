//! The stages on real and simulated volumes, one file per stage or promise.
//!
//! One binary: linking the library once instead of nineteen times takes minutes off a build.

mod shared_data;

mod volume_dicom;
mod volume_odd_nifti;

mod surface_cohort;
mod surface_extract;

mod retile_paper;
mod retile_refined;

mod optimise_determinism;

mod export_formats;
mod mesh_files;
mod report_page;

mod deform_cohort;
mod deform_fit;
mod deform_invariance;
mod deform_oracle;
mod deform_varied;
mod flags;

mod comparison;
mod containers;
mod edges;
mod hot_neighbours;
mod orientation;
mod pipeline;
mod quality;
mod serial;

mod normals;
mod reader;

mod beat;
mod gates_without_a_word;

mod evaluate_reference;
mod examples;
