//! Which part of the exemplar's lines resembles which drawn part (Liu & Benes 2025, 5.3, Algorithms A1 and A2).

mod align;
mod config;
mod substring;

pub(crate) use align::align;
pub(crate) use config::MatchConfig;
