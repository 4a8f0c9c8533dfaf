//! Where each parameter lies in the flat vector that the fused pass works on.

use crate::error::Result;
use crate::learn::ParamStore;
use candle_core::{DType, Device, Tensor};
use std::ops::Range;

/// The one parameter that travels apart, since other sketches bring their own.
pub(in super::super) const EMBEDDING: &str = "embedding";

/// Ranges of every layer in the flat vector: all parameters in their order, the embedding left out.
#[derive(Clone, Debug)]
pub(in super::super) struct Layout {
    pub(super) first: MlpRanges,
    pub(super) rounds: Vec<[MessageRanges; 2]>,
    pub(super) last: MlpRanges,
    /// Number of values.
    pub(super) len: usize,
}

/// Ranges of two linear layers.
#[derive(Clone, Debug)]
pub(super) struct MlpRanges {
    pub(super) hidden: Range<usize>,
    pub(super) hidden_bias: Range<usize>,
    pub(super) out: Range<usize>,
    pub(super) out_bias: Range<usize>,
}

/// Ranges of one message layer; shapes stand at `MessageLayer`.
#[derive(Clone, Debug)]
pub(super) struct MessageRanges {
    pub(super) node: Range<usize>,
    pub(super) edge: Range<usize>,
    pub(super) kind: Range<usize>,
    pub(super) embedding: Option<Range<usize>>,
    pub(super) pool: Range<usize>,
    pub(super) bias: Range<usize>,
    pub(super) out: Range<usize>,
    pub(super) out_bias: Range<usize>,
    pub(super) attend_message: Range<usize>,
    pub(super) attend_state: Range<usize>,
    /// Gain and offset of the normalisation.
    pub(super) norm: Option<(Range<usize>, Range<usize>)>,
}

impl Layout {
    /// The layout of a network's parameters.
    pub(in super::super) fn of(params: &ParamStore, rounds: usize) -> Self {
        let mut ranges = Vec::new();
        let mut len = 0;
        for (name, var) in params.iter().filter(|(name, _)| *name != EMBEDDING) {
            ranges.push((name, len..len + var.elem_count()));
            len += var.elem_count();
        }
        let find = |name: String| ranges.iter().find(|(n, _)| *n == name).map(|(_, range)| range.clone());
        let get = |name: String| find(name.clone()).unwrap_or_else(|| unreachable!("no parameter {name}"));
        let mlp = |name: &str| MlpRanges {
            hidden: get(format!("{name}.hidden.weight")),
            hidden_bias: get(format!("{name}.hidden.bias")),
            out: get(format!("{name}.out.weight")),
            out_bias: get(format!("{name}.out.bias")),
        };
        let message = |name: String| MessageRanges {
            node: get(format!("{name}.node")),
            edge: get(format!("{name}.edge")),
            kind: get(format!("{name}.kind")),
            embedding: find(format!("{name}.embedding")),
            pool: get(format!("{name}.pool")),
            bias: get(format!("{name}.bias")),
            out: get(format!("{name}.out")),
            out_bias: get(format!("{name}.out_bias")),
            attend_message: get(format!("{name}.attend_message")),
            attend_state: get(format!("{name}.attend_state")),
            norm: find(format!("{name}.gain")).zip(find(format!("{name}.offset"))),
        };
        let rounds = (0..rounds)
            .map(|t| [message(format!("round{t}.to_regions")), message(format!("round{t}.to_pixels"))])
            .collect();
        Self { first: mlp("first"), rounds, last: mlp("last"), len }
    }

    /// The parameters as one differentiable vector.
    pub(in super::super) fn flatten(params: &ParamStore) -> Result<Tensor> {
        let parts = params
            .iter()
            .filter(|(name, _)| *name != EMBEDDING)
            .map(|(_, var)| var.flatten_all())
            .collect::<candle_core::Result<Vec<_>>>()?;
        Ok(Tensor::cat(&parts, 0)?)
    }

    /// Stands for the embedding of a model that has none.
    pub(in super::super) fn no_embedding() -> Result<Tensor> {
        Ok(Tensor::zeros((1, 1), DType::F32, &Device::Cpu)?)
    }
}
