//! The only place that opens terrain files.
