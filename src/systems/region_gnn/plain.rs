//! The literal network of Eq. 1 and A.3 to A.5 in tensor operations, one row an edge: the oracle of [`fused`](super::fused).
//!
//! Every edge gets its concatenated input, both layers of `Enc` and its attention weight as tensors, so that gradients are
//! candle's own. About a hundred times the memory of the fused pass.

use super::config::{Pooling, RegionGnnConfig};
use super::edges::{BLOCK, PassEdges};
use super::fused::LEAK;
use crate::error::Result;
use crate::learn::ParamStore;
use candle_core::{D, DType, Device, Tensor};

const NORM_EPSILON: f64 = 1e-5;

/// Parameters by name and what does not change from layer to layer.
struct Plain<'a> {
    config: &'a RegionGnnConfig,
    params: &'a ParamStore,
    edges: &'a PassEdges,
    /// (edges) ends of the unmasked edges.
    pixels: Tensor,
    regions: Tensor,
    /// (edges, features + 1)
    features: Tensor,
    /// (regions, 2)
    kinds: Tensor,
    /// (regions, embedding)
    embedding: Option<&'a Tensor>,
}

/// As [`fused`](super::fused::fused): (pixels + 1).
pub(super) fn forward(
    config: &RegionGnnConfig,
    params: &ParamStore,
    edges: &PassEdges,
    embedding: Option<&Tensor>,
    first_regions: Vec<f32>,
) -> Result<Tensor> {
    states(config, params, edges, embedding, first_regions).map(|(heights, _)| heights)
}

/// [`forward`] with the last states of the regions, (regions, H).
pub(super) fn states(
    config: &RegionGnnConfig,
    params: &ParamStore,
    edges: &PassEdges,
    embedding: Option<&Tensor>,
    first_regions: Vec<f32>,
) -> Result<(Tensor, Tensor)> {
    let device = Device::Cpu;
    let graph = edges.graph();
    let (mut pixels, mut regions) = (Vec::new(), Vec::new());
    let kinds = graph.features();
    let (mut row, mut rows) = (vec![0.0; kinds.feature_count()], Vec::new());
    for block in 0..edges.block_count() {
        let some = edges.block(block);
        for (edge, region) in some.regions.iter().enumerate().take(some.len) {
            let slot = some.ends.iter().take_while(|end| **end as usize <= edge).count();
            pixels.push((block * BLOCK + slot) as u32);
            regions.push(*region);
            let values: Vec<f32> =
                some.columns.chunks_exact(some.stride).map(|column| column[edge]).collect();
            let (noise, stored) = values.split_last().unwrap_or_else(|| unreachable!("every edge has noise"));
            kinds.expand(stored, &graph.sizes()[*region as usize..], 1, &mut row);
            rows.extend_from_slice(&row);
            rows.push(*noise);
        }
    }
    let count = pixels.len();
    let net = Plain {
        config,
        params,
        edges,
        pixels: Tensor::from_vec(pixels, count, &device)?,
        regions: Tensor::from_vec(regions, count, &device)?,
        features: Tensor::from_vec(rows, (count, kinds.feature_count() + 1), &device)?,
        kinds: Tensor::from_vec(graph.kind_indicators(), (graph.region_count(), 2), &device)?,
        embedding,
    };
    let indicator = Tensor::from_slice(graph.indicator(), (graph.pixel_count(), 1), &device)?;
    let mut f = net.mlp("first", &indicator)?; // (pixels, H)
    let mut e = Tensor::from_vec(first_regions, (graph.region_count(), config.width), &device)?; // (regions, H)
    for t in 0..config.iterations {
        let name = format!("round{t}.to_regions");
        e = net.normalize(&name, &(&e + net.gather(&name, &f, &e, true)?)?)?;
        let name = format!("round{t}.to_pixels");
        f = net.normalize(&name, &net.gather(&name, &e, &f, false)?)?;
    }
    let far = net.mlp("first", &Tensor::zeros((1, 1), DType::F32, &device)?)?;
    Ok((net.mlp("last", &Tensor::cat(&[f, far], 0)?)?.squeeze(1)?, e)) // (pixels + 1), (regions, H)
}

impl Plain<'_> {
    fn get(&self, name: &str) -> &Tensor {
        self.params.get(name).unwrap_or_else(|| unreachable!("no parameter {name}"))
    }

    /// (N, in) -> (N, out)
    fn mlp(&self, name: &str, x: &Tensor) -> Result<Tensor> {
        let get = |part: &str| self.get(&format!("{name}.{part}"));
        let hidden = x.matmul(get("hidden.weight"))?.broadcast_add(get("hidden.bias"))?.relu()?;
        Ok(hidden.matmul(get("out.weight"))?.broadcast_add(get("out.bias"))?)
    }

    /// Layer normalisation (Ba, Kiros, Hinton 2016) where the configuration has it.
    fn normalize(&self, name: &str, x: &Tensor) -> Result<Tensor> {
        if !self.config.normalize {
            return Ok(x.clone());
        }
        let centred = x.broadcast_sub(&x.mean_keepdim(D::Minus1)?)?;
        let deviation = (centred.sqr()?.mean_keepdim(D::Minus1)? + NORM_EPSILON)?.sqrt()?;
        let unit = centred.broadcast_div(&deviation)?.broadcast_mul(self.get(&format!("{name}.gain")))?;
        Ok(unit.broadcast_add(self.get(&format!("{name}.offset")))?)
    }

    /// `Gathr({Enc(...)})` for every receiving node: (receivers, H).
    fn gather(&self, name: &str, sender: &Tensor, receiver: &Tensor, to_regions: bool) -> Result<Tensor> {
        let device = Device::Cpu;
        let get = |part: &str| self.get(&format!("{name}.{part}"));
        let graph = self.edges.graph();
        let (from, to) =
            if to_regions { (&self.pixels, &self.regions) } else { (&self.regions, &self.pixels) };
        let count = from.elem_count();
        let receivers = receiver.dims()[0];
        let zeros = |columns: usize| Tensor::zeros((receivers, columns), DType::F32, &device);

        let sent = sender.index_select(from, 0)?;
        let sum = zeros(self.config.width)?.index_add(to, &sent, 0)?;
        let degree = |node: usize| match (self.config.pooling, to_regions) {
            (Pooling::Sum, _) => 1,
            (Pooling::Mean, true) => self.edges.region_degree(node).max(1),
            (Pooling::Mean, false) => self.edges.pixel_degree(node).max(1),
        };
        let share: Vec<f32> = (0..receivers).map(|node| 1.0 / degree(node) as f32).collect();
        let pooled = sum.broadcast_mul(&Tensor::from_vec(share, (receivers, 1), &device)?)?;

        let mut inputs = vec![
            sent,
            self.features.clone(),
            self.kinds.index_select(&self.regions, 0)?,
            pooled.index_select(to, 0)?,
        ];
        let mut weights = vec![get("node"), get("edge"), get("kind"), get("pool")];
        if let Some(embedding) = self.embedding {
            inputs.push(embedding.index_select(&self.regions, 0)?);
            weights.push(get("embedding"));
        }
        let input = Tensor::cat(&inputs, 1)?; // (edges, inputs)
        let hidden = input.matmul(&Tensor::cat(&weights, 0)?)?.broadcast_add(get("bias"))?.relu()?;
        let message = hidden.matmul(get("out"))?.broadcast_add(get("out_bias"))?; // (edges, H)

        let state = receiver.matmul(get("attend_state"))?.index_select(to, 0)?;
        let logit = (message.matmul(get("attend_message"))? + state)?; // (edges, 1)
        let score = (logit.relu()? - (logit.neg()?.relu()? * f64::from(LEAK))?)?;
        let nodes = to.to_vec1::<u32>()?;
        let mut highest = vec![f32::NEG_INFINITY; receivers];
        for (value, &node) in score.detach().flatten_all()?.to_vec1::<f32>()?.iter().zip(&nodes) {
            highest[node as usize] = highest[node as usize].max(*value);
        }
        let highest: Vec<f32> = nodes.iter().map(|&node| highest[node as usize]).collect();
        let weight = (score - Tensor::from_vec(highest, (count, 1), &device)?)?.exp()?; // (edges, 1)
        let sum = zeros(self.config.width)?.index_add(to, &message.broadcast_mul(&weight)?, 0)?;
        let total = zeros(1)?.index_add(to, &weight, 0)?;
        // A node that nothing reaches divides zero by one.
        let reached = if to_regions {
            self.edges.reached_regions()
        } else {
            let mut reached = vec![0.0; graph.pixel_count()];
            nodes.iter().for_each(|&pixel| reached[pixel as usize] = 1.0);
            reached
        };
        let missing: Vec<f32> = reached.iter().map(|r| 1.0 - r).collect();
        let total = (total + Tensor::from_vec(missing, (receivers, 1), &device)?)?;
        Ok(sum.broadcast_div(&total)?)
    }
}
