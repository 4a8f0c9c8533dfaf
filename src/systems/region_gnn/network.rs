//! The network: states of pixels and regions, T rounds of messages, heights (Liu & Benes 2025, Eq. 1, A.3, A.5).

use super::config::{HeightFrame, Kernel, RegionGnnConfig};
use super::edge_attention::edge_attention;
use super::edges::PassEdges;
use super::graph::feature_count;
use super::plain;
use super::pool::{Toward, pool};
use crate::error::Result;
use crate::learn::{ParamStore, layer_norm};
use crate::seed::Seed;
use candle_core::{Device, Tensor};
use rand::RngExt;
use rand_distr::StandardNormal;
use std::sync::Arc;

/// Parameters of the network and how they are joined. All shapes are (in, out).
#[derive(Debug)]
pub struct Network {
    config: RegionGnnConfig,
    params: ParamStore,
    /// MLP_0 (A1): indicator to first pixel state.
    first: Mlp,
    /// MLP_3: pixel state to height.
    last: Mlp,
    /// (parts of the exemplar, embedding); none when the configuration has no embedding.
    embedding: Option<Tensor>,
    rounds: Vec<[MessageLayer; 2]>,
}

/// Two linear layers with a ReLU between them.
#[derive(Debug)]
struct Mlp {
    hidden: (Tensor, Tensor),
    out: (Tensor, Tensor),
}

/// One `Enc` and one `Gathr` (A.5): the first layer of `Enc` by input, its second layer, attention, normalisation.
#[derive(Debug)]
pub(super) struct MessageLayer {
    /// (H, H) sending node.
    pub(super) node: Tensor,
    /// (features + 1, H) edge features and noise.
    pub(super) edge: Tensor,
    /// (2, H) ridge, valley.
    pub(super) kind: Tensor,
    /// (embedding, H)
    pub(super) embedding: Option<Tensor>,
    /// (H, H) pooled neighbours.
    pub(super) pool: Tensor,
    /// (H)
    pub(super) bias: Tensor,
    /// (H, H) second layer of `Enc`.
    pub(super) out: Tensor,
    /// (H)
    pub(super) out_bias: Tensor,
    /// (H, 1) attention on the message.
    pub(super) attend_message: Tensor,
    /// (H, 1) attention on the receiver.
    pub(super) attend_state: Tensor,
    /// (H), (H)
    norm: Option<(Tensor, Tensor)>,
}

/// What a forward pass gives.
#[derive(Debug)]
pub struct Output {
    /// (pixels) heights in the unit interval of the sketch.
    pub heights: Tensor,
    /// (pixels, H) first pixel states.
    pub first_states: Tensor,
    /// (regions, H) last region states.
    pub region_states: Tensor,
}

impl Network {
    /// Fresh parameters. `parts`: number of exemplar parts (rows of the embedding).
    ///
    /// Linear layers start uniform in ±1/sqrt(inputs), attention vectors normal with deviation .2, the last bias at 1/2.
    ///
    /// # Errors
    /// When the configuration is out of range.
    pub fn new(config: &RegionGnnConfig, parts: usize, seed: Seed) -> Result<Self> {
        config.validate()?;
        let h = config.width;
        let mut params = ParamStore::new(seed.derive("parameters"));
        let embedding = match config.embedding {
            0 => None,
            width => Some(params.normal("embedding", (parts, width), 1.0)?),
        };
        let first = Mlp::new(&mut params, "first", 1, h, h)?;
        let rounds = (0..config.iterations)
            .map(|t| {
                Ok([
                    MessageLayer::new(&mut params, &format!("round{t}.to_regions"), config)?,
                    MessageLayer::new(&mut params, &format!("round{t}.to_pixels"), config)?,
                ])
            })
            .collect::<Result<_>>()?;
        let last = Mlp::new(&mut params, "last", h, h, 1)?;
        params.assign("last.out.bias", &[0.5])?;
        Ok(Self { config: config.clone(), params, first, last, embedding, rounds })
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &RegionGnnConfig {
        &self.config
    }

    /// The parameters.
    #[must_use]
    pub fn params(&self) -> &ParamStore {
        &self.params
    }

    /// The embedding of every exemplar part: (parts, embedding).
    #[must_use]
    pub fn embedding(&self) -> Option<&Tensor> {
        self.embedding.as_ref()
    }

    /// One pass. `embedding`: (regions, embedding) in place of the exemplar's own, for other sketches.
    ///
    /// # Errors
    /// When a tensor operation fails.
    ///
    /// # Panics
    /// When the model has embeddings, none are given, and the number of regions is not that of the exemplar.
    pub fn forward(&self, edges: &Arc<PassEdges>, embedding: Option<&Tensor>, seed: Seed) -> Result<Output> {
        let graph = edges.graph();
        let device = Device::Cpu;
        let (pixels, regions) = (graph.pixel_count(), graph.region_count());
        let embedding = embedding.or(self.embedding.as_ref()).filter(|_| self.config.embedding > 0);
        if let Some(embedding) = embedding {
            assert_eq!(embedding.dims()[0], regions, "one embedding a region");
        }
        let kinds = Tensor::from_vec(graph.kind_indicators(), (regions, 2), &device)?;
        let indicator = Tensor::from_slice(graph.indicator(), (pixels, 1), &device)?;
        let first_states = self.first.forward(&indicator)?; // (pixels, H)
        let mut f = first_states.clone();
        let mut e = self.first_region_states(regions, seed)?; // (regions, H)
        for [to_regions, to_pixels] in &self.rounds {
            let gathered = self.gather(to_regions, Toward::Regions, edges, &f, &e, &kinds, embedding)?;
            e = to_regions.normalize(&(e + gathered)?)?;
            let gathered = self.gather(to_pixels, Toward::Pixels, edges, &f, &e, &kinds, embedding)?;
            f = to_pixels.normalize(&gathered)?;
        }
        let height = self.last.forward(&f)?.squeeze(1)?; // (pixels)
        let heights = match (self.config.frame, graph.anchor_frame()) {
            (HeightFrame::Anchored, Some(anchor)) => {
                let base = Tensor::from_slice(&anchor.base, pixels, &device)?;
                (base + ((height - 0.5)? * f64::from(anchor.scale))?)?
            }
            _ => height,
        };
        Ok(Output { heights, first_states, region_states: e })
    }

    /// Heights that MLP_3 gives to first pixel states at `pixels`: the far-field value of l_further.
    ///
    /// # Errors
    /// When a tensor operation fails.
    pub fn far_field(&self, output: &Output, pixels: &[u32]) -> Result<Tensor> {
        let index = Tensor::from_slice(pixels, pixels.len(), &Device::Cpu)?;
        Ok(self.last.forward(&output.first_states.index_select(&index, 0)?)?.squeeze(1)?)
    }

    /// E^(0), normal (A.3).
    fn first_region_states(&self, regions: usize, seed: Seed) -> Result<Tensor> {
        let mut stream = seed.stream("first region states");
        let mut draw = || stream.sample::<f32, _>(StandardNormal) * self.config.noise as f32;
        let values: Vec<f32> = (0..regions * self.config.width).map(|_| draw()).collect();
        Ok(Tensor::from_vec(values, (regions, self.config.width), &Device::Cpu)?)
    }

    /// `Gathr({Enc(...)})` for every receiving node.
    #[allow(clippy::too_many_arguments, reason = "the terms of Eq. 1")]
    fn gather(
        &self,
        layer: &MessageLayer,
        toward: Toward,
        edges: &Arc<PassEdges>,
        f: &Tensor,
        e: &Tensor,
        kinds: &Tensor,
        embedding: Option<&Tensor>,
    ) -> Result<Tensor> {
        let (sender, receiver) = if toward == Toward::Regions { (f, e) } else { (e, f) };
        let pooled = pool(sender, edges, toward, self.config.pooling)?;
        if self.config.kernel == Kernel::Plain {
            return plain::gather(layer, toward, edges, sender, receiver, &pooled, kinds, embedding);
        }
        let mut region = kinds.matmul(&layer.kind)?.broadcast_add(&layer.bias)?;
        if let (Some(embedding), Some(weights)) = (embedding, &layer.embedding) {
            region = (region + embedding.matmul(weights)?)?;
        }
        let (sent, pooled) = (sender.matmul(&layer.node)?, pooled.matmul(&layer.pool)?);
        let (pixel, region) = match toward {
            Toward::Regions => (sent, (region + pooled)?),
            Toward::Pixels => (pooled, (region + sent)?),
        };
        // The second layer of Enc, pulled through the attention: a . (out h + b) = (out a) . h + a . b.
        let score = layer.out.matmul(&layer.attend_message)?; // (H, 1)
        let constant = layer.out_bias.unsqueeze(0)?.matmul(&layer.attend_message)?; // (1, 1)
        let bias = receiver.matmul(&layer.attend_state)?.broadcast_add(&constant)?; // (receivers, 1)
        let mean = edge_attention(edges, toward, &pixel, &region, &layer.edge, &score, &bias)?;
        let reached = Tensor::from_vec(reached(edges, toward), (mean.dims()[0], 1), &Device::Cpu)?;
        Ok((mean.matmul(&layer.out)? + reached.matmul(&layer.out_bias.unsqueeze(0)?)?)?) // (receivers, H)
    }
}

/// 1 for nodes with an unmasked edge, 0 for the others: a node that nothing reaches gathers nothing, not even a bias.
pub(super) fn reached(edges: &PassEdges, toward: Toward) -> Vec<f32> {
    let graph = edges.graph();
    let masked = edges.masked();
    let flag = |reached: bool| if reached { 1.0 } else { 0.0 };
    match toward {
        Toward::Regions => {
            (0..graph.region_count()).map(|r| flag(!masked[r] && edges.region_degree(r) > 0)).collect()
        }
        Toward::Pixels => {
            (0..graph.pixel_count()).map(|p| flag(edges.regions_of(p).any(|r| !masked[r]))).collect()
        }
    }
}

impl Mlp {
    fn new(params: &mut ParamStore, name: &str, input: usize, hidden: usize, output: usize) -> Result<Self> {
        let mut linear = |part: &str, inputs: usize, outputs: usize| -> Result<(Tensor, Tensor)> {
            let bound = (inputs as f64).sqrt().recip();
            Ok((
                params.uniform(&format!("{name}.{part}.weight"), (inputs, outputs), bound)?,
                params.uniform(&format!("{name}.{part}.bias"), outputs, bound)?,
            ))
        };
        Ok(Self { hidden: linear("hidden", input, hidden)?, out: linear("out", hidden, output)? })
    }

    /// (N, in) -> (N, out)
    fn forward(&self, x: &Tensor) -> Result<Tensor> {
        let hidden = x.matmul(&self.hidden.0)?.broadcast_add(&self.hidden.1)?.relu()?;
        Ok(hidden.matmul(&self.out.0)?.broadcast_add(&self.out.1)?)
    }
}

impl MessageLayer {
    fn new(params: &mut ParamStore, name: &str, config: &RegionGnnConfig) -> Result<Self> {
        let (h, edge) = (config.width, feature_count(config) + 1);
        let bound = ((2 * h + edge + 2 + config.embedding) as f64).sqrt().recip();
        let out_bound = (h as f64).sqrt().recip();
        let mut uniform = |part: &str, inputs: usize, outputs: usize, bound: f64| {
            params.uniform(&format!("{name}.{part}"), (inputs, outputs), bound)
        };
        let node = uniform("node", h, h, bound)?;
        let edge = uniform("edge", edge, h, bound)?;
        let kind = uniform("kind", 2, h, bound)?;
        let embedding = match config.embedding {
            0 => None,
            width => Some(uniform("embedding", width, h, bound)?),
        };
        let pool = uniform("pool", h, h, bound)?;
        let out = uniform("out", h, h, out_bound)?;
        let bias = params.uniform(&format!("{name}.bias"), h, bound)?;
        let out_bias = params.uniform(&format!("{name}.out_bias"), h, out_bound)?;
        let attend_message = params.normal(&format!("{name}.attend_message"), (h, 1), 0.2)?;
        let attend_state = params.normal(&format!("{name}.attend_state"), (h, 1), 0.2)?;
        let norm = if config.normalize {
            Some((params.constant(&format!("{name}.gain"), h, 1.0)?, params.constant(&format!("{name}.offset"), h, 0.0)?))
        } else {
            None
        };
        Ok(Self { node, edge, kind, embedding, pool, bias, out, out_bias, attend_message, attend_state, norm })
    }

    fn normalize(&self, x: &Tensor) -> Result<Tensor> {
        match &self.norm {
            Some((gain, offset)) => layer_norm(x, gain, offset),
            None => Ok(x.clone()),
        }
    }
}
