//! Experiments as the program runs them: their files, records and reports, and every kind by its quick twin.

mod kinds;
mod runs;
