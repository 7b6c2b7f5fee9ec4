//! Limits from the maps of healthy people.
