//! Settings over the command line: see `src/config` for the rest.
