//! The literal message passing of Eq. 1 and A.5, one row an edge: the oracle of [`edge_attention`](super::edge_attention).
//!
//! Every edge gets its concatenated input, both layers of `Enc` and its attention weight as tensors, so that gradients are
//! candle's own. About a hundred times the memory of the fused pass.

use super::edges::PassEdges;
use super::network::{MessageLayer, reached};
use super::pool::Toward;
use crate::error::Result;
use candle_core::{Device, Tensor};

/// As `Network::gather`: (receivers, H).
#[allow(clippy::too_many_arguments, reason = "the terms of Eq. 1")]
pub(super) fn gather(
    layer: &MessageLayer,
    toward: Toward,
    edges: &PassEdges,
    sender: &Tensor,
    receiver: &Tensor,
    pooled: &Tensor,
    kinds: &Tensor,
    embedding: Option<&Tensor>,
) -> Result<Tensor> {
    let device = Device::Cpu;
    let graph = edges.graph();
    let (mut pixels, mut regions, mut features) = (Vec::new(), Vec::new(), Vec::new());
    for pixel in 0..graph.pixel_count() {
        for edge in edges.edges_of(pixel).filter(|edge| !edges.masked()[edge.region]) {
            pixels.push(pixel as u32);
            regions.push(edge.region as u32);
            features.extend_from_slice(edge.features);
            features.push(edge.noise);
        }
    }
    let count = pixels.len();
    let receivers = receiver.dims()[0];
    let (from, to) = if toward == Toward::Regions { (&pixels, &regions) } else { (&regions, &pixels) };
    let index = |ids: &[u32]| Tensor::from_slice(ids, count, &device);
    let (from, to_index, of_region) = (index(from)?, index(to)?, index(&regions)?);
    let features = Tensor::from_vec(features, (count, graph.feature_count() + 1), &device)?;

    let mut inputs = vec![
        sender.index_select(&from, 0)?,
        features,
        kinds.index_select(&of_region, 0)?,
        pooled.index_select(&to_index, 0)?,
    ];
    let mut weights = vec![layer.node.clone(), layer.edge.clone(), layer.kind.clone(), layer.pool.clone()];
    if let (Some(embedding), Some(weight)) = (embedding, &layer.embedding) {
        inputs.push(embedding.index_select(&of_region, 0)?);
        weights.push(weight.clone());
    }
    let input = Tensor::cat(&inputs, 1)?; // (edges, inputs)
    let hidden = input.matmul(&Tensor::cat(&weights, 0)?)?.broadcast_add(&layer.bias)?.relu()?; // (edges, H)
    let message = hidden.matmul(&layer.out)?.broadcast_add(&layer.out_bias)?; // (edges, H)

    let state = receiver.matmul(&layer.attend_state)?.index_select(&to_index, 0)?;
    let logit = (message.matmul(&layer.attend_message)? + state)?; // (edges, 1)
    let score = (logit.relu()? - (logit.neg()?.relu()? * f64::from(super::edge_kernel::LEAK))?)?;
    let mut highest = vec![f32::NEG_INFINITY; receivers];
    for (value, &node) in score.detach().flatten_all()?.to_vec1::<f32>()?.iter().zip(to) {
        highest[node as usize] = highest[node as usize].max(*value);
    }
    let highest: Vec<f32> = to.iter().map(|&node| highest[node as usize]).collect();
    let weight = (score - Tensor::from_vec(highest, (count, 1), &device)?)?.exp()?; // (edges, 1)
    let zeros = |columns: usize| Tensor::zeros((receivers, columns), candle_core::DType::F32, &device);
    let sum = zeros(message.dims()[1])?.index_add(&to_index, &message.broadcast_mul(&weight)?, 0)?;
    let total = zeros(1)?.index_add(&to_index, &weight, 0)?;
    // A node that nothing reaches divides zero by one.
    let missing: Vec<f32> = reached(edges, toward).iter().map(|r| 1.0 - r).collect();
    let total = (total + Tensor::from_vec(missing, (receivers, 1), &device)?)?;
    Ok(sum.broadcast_div(&total)?)
}
