//! The protocols of experiments, one file each ([`Protocol`](super::protocol::Protocol)).

pub(super) mod ablation;
pub(super) mod cost;
pub(super) mod disentanglement;
pub(super) mod drawings;
pub(super) mod exchange;
pub(super) mod exemplar;
pub(super) mod fit;
mod general;
pub(super) mod invariance;
mod losses;
pub(super) mod neighbours;
pub(super) mod sparse;
