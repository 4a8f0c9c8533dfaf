//! The network: parameters, and heights from edges (Liu & Benes 2025, Eq. 1, A.3 to A.5).

use super::config::{HeightFrame, Kernel, RegionGnnConfig};
use super::edge_features::EdgeFeatures;
use super::edges::PassEdges;
use super::fused::{Buffers, EMBEDDING, Layout, Pass, fused};
use super::plain;
use crate::error::Result;
use crate::learn::ParamStore;
use crate::seed::Seed;
use candle_core::{Device, Tensor};
use rand::RngExt;
use rand_distr::StandardNormal;
use std::sync::Arc;

/// The parameters of one model and the pass that uses them.
///
/// Weights have shape (in, out). `first` is MLP_0 (A1), from the indicator to the first pixel state; `last` is MLP_3, from
/// pixel state to height; `round<t>.to_regions` and `.to_pixels` are an `Enc` and a `Gathr` each (A.5), with H the width:
///
/// | parameter | shape | of |
/// |---|---|---|
/// | node, edge, kind, embedding, pool, bias | (H, H), (features + 1, H), (2, H), (embedding, H), (H, H), (H) | the first layer of `Enc`, by input: sender, edge features and noise, ridge or valley, embedding, pooled neighbours |
/// | out, out_bias | (H, H), (H) | its second layer |
/// | attend_message, attend_state | (H, 1) | attention on message and receiver |
/// | gain, offset | (H) | normalisation |
#[derive(Debug)]
pub struct Network {
    config: RegionGnnConfig,
    params: ParamStore,
    pass: Arc<Pass>,
    buffers: Buffers,
}

/// What a forward pass gives.
#[derive(Debug)]
pub struct Output {
    /// (pixels) heights in the unit interval of the sketch.
    pub heights: Tensor,
    /// (1) what MLP_3 makes of a pixel beside the lines that no message reaches: the far-field value of l_further.
    pub(crate) far_height: Tensor,
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
        if config.embedding > 0 {
            params.normal(EMBEDDING, (parts, config.embedding), 1.0)?;
        }
        add_mlp(&mut params, "first", 1, h, h)?;
        for t in 0..config.iterations {
            add_message_layer(&mut params, &format!("round{t}.to_regions"), config)?;
            add_message_layer(&mut params, &format!("round{t}.to_pixels"), config)?;
        }
        add_mlp(&mut params, "last", h, h, 1)?;
        params.assign("last.out.bias", &[0.5])?;
        let pass = Arc::new(Pass::new(config, Layout::of(&params, config.iterations)));
        Ok(Self { config: config.clone(), params, pass, buffers: Buffers::default() })
    }

    /// The configuration.
    #[must_use]
    pub(crate) fn config(&self) -> &RegionGnnConfig {
        &self.config
    }

    /// The parameters.
    #[must_use]
    pub fn params(&self) -> &ParamStore {
        &self.params
    }

    /// The embedding of every exemplar part: (parts, embedding).
    #[must_use]
    pub(crate) fn embedding(&self) -> Option<&Tensor> {
        self.params.get(EMBEDDING)
    }

    /// One pass. `embedding`: (regions, embedding) in place of the exemplar's own, for other sketches.
    ///
    /// # Errors
    /// When a tensor operation fails, or the graph's `stop` is raised.
    ///
    /// # Panics
    /// When the model has embeddings, none are given, and the number of regions is not that of the exemplar.
    pub fn forward(&self, edges: &Arc<PassEdges>, embedding: Option<&Tensor>, seed: Seed) -> Result<Output> {
        let graph = edges.graph();
        let pixels = graph.pixel_count();
        let embedding = embedding.or(self.embedding()).filter(|_| self.config.embedding > 0);
        if let Some(embedding) = embedding {
            assert_eq!(embedding.dims()[0], graph.region_count(), "one embedding a region");
        }
        let first_regions = self.first_region_states(graph.region_count(), seed);
        let all = match self.config.kernel {
            Kernel::Plain => plain::forward(&self.config, &self.params, edges, embedding, first_regions)?,
            Kernel::Fused => {
                let params = Layout::flatten(&self.params)?;
                let embedding = embedding.map_or_else(Layout::no_embedding, |e| Ok(e.clone()))?;
                fused(&self.pass, edges, &params, &embedding, first_regions, &self.buffers)?
            }
        }; // (pixels + 1)
        graph.stop().check()?;
        let (height, far_height) = (all.narrow(0, 0, pixels)?, all.narrow(0, pixels, 1)?);
        let heights = match (self.config.frame, graph.anchor_frame()) {
            (HeightFrame::Anchored, Some(anchor)) => {
                let base = Tensor::from_slice(&anchor.base, pixels, &Device::Cpu)?;
                (base + ((height - 0.5)? * f64::from(anchor.scale))?)?
            }
            _ => height,
        };
        Ok(Output { heights, far_height })
    }

    /// The states of the regions after the last message pass: (regions, H) values, region by region. By the literal
    /// formula, whatever the kernel.
    ///
    /// # Errors
    /// As [`forward`](Self::forward).
    pub(super) fn region_states(
        &self,
        edges: &PassEdges,
        embedding: Option<&Tensor>,
        seed: Seed,
    ) -> Result<Vec<Vec<f32>>> {
        let embedding = embedding.or(self.embedding()).filter(|_| self.config.embedding > 0);
        let first = self.first_region_states(edges.graph().region_count(), seed);
        let (_, states) = plain::states(&self.config, &self.params, edges, embedding, first)?;
        Ok(states.detach().to_vec2::<f32>()?)
    }

    /// E^(0), normal (A.3): (regions, H).
    fn first_region_states(&self, regions: usize, seed: Seed) -> Vec<f32> {
        let mut stream = seed.stream("first region states");
        let mut draw = || stream.sample::<f32, _>(StandardNormal) * self.config.noise as f32;
        (0..regions * self.config.width).map(|_| draw()).collect()
    }
}

fn add_mlp(params: &mut ParamStore, name: &str, input: usize, hidden: usize, output: usize) -> Result<()> {
    for (part, inputs, outputs) in [("hidden", input, hidden), ("out", hidden, output)] {
        let bound = (inputs as f64).sqrt().recip();
        params.uniform(&format!("{name}.{part}.weight"), (inputs, outputs), bound)?;
        params.uniform(&format!("{name}.{part}.bias"), outputs, bound)?;
    }
    Ok(())
}

fn add_message_layer(params: &mut ParamStore, name: &str, config: &RegionGnnConfig) -> Result<()> {
    let (h, edge) = (config.width, EdgeFeatures::of(config).feature_count() + 1);
    let bound = ((2 * h + edge + 2 + config.embedding) as f64).sqrt().recip();
    let out_bound = (h as f64).sqrt().recip();
    params.uniform(&format!("{name}.node"), (h, h), bound)?;
    params.uniform(&format!("{name}.edge"), (edge, h), bound)?;
    params.uniform(&format!("{name}.kind"), (2, h), bound)?;
    if config.embedding > 0 {
        params.uniform(&format!("{name}.embedding"), (config.embedding, h), bound)?;
    }
    params.uniform(&format!("{name}.pool"), (h, h), bound)?;
    params.uniform(&format!("{name}.out"), (h, h), out_bound)?;
    params.uniform(&format!("{name}.bias"), h, bound)?;
    params.uniform(&format!("{name}.out_bias"), h, out_bound)?;
    params.normal(&format!("{name}.attend_message"), (h, 1), 0.2)?;
    params.normal(&format!("{name}.attend_state"), (h, 1), 0.2)?;
    if config.normalize {
        params.constant(&format!("{name}.gain"), h, 1.0)?;
        params.constant(&format!("{name}.offset"), h, 0.0)?;
    }
    Ok(())
}
