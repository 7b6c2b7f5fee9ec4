//! Pictures and pages, whatever they show.
//!
//! | in | out | module |
//! |---|---|---|
//! | pixels | a PNG file | [`image`] |
//! | polygons, lines, circles, labels, pictures | SVG, or pixels | [`vector`] |
//! | headings, sentences, figures, tables, pictures | one picture of a page | [`sheet`] |
//! | counts, series, bars | charts as inline SVG | [`chart`] |
//! | a triangle mesh | shaded pictures from three sides, and one to turn | [`views`] |
//! | headings, figures, tables | one self-contained HTML page | [`document`] |
//!
//! Markup is written by `maud`, which escapes every text and attribute. The same input gives the
//! same bytes. Nothing here knows what a volume, a model or a segmentation is.

pub mod chart;
pub mod document;
pub mod facets;
pub mod glyphs;
pub mod image;
pub mod sheet;
pub mod table;
pub mod text;
pub mod vector;
pub mod views;

pub use image::Image;
