//! The synthesis as a part of styles: the exemplar's whole terrain, prepared when it is first used.

use super::{Synthesis, SynthesisConfig, Synthesized};
use crate::arrays::Arrays;
use crate::checked::{Checked, Settings};
use crate::control::{Control, Progress, Stage, Stop};
use crate::dem::{Dem, Normalization};
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::metrics::Provenance;
use crate::seed::Seed;
use crate::sketch::LineMap;
use crate::systems::task::{Account, Exemplar, Part, SketchToTerrain, System};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Exemplars with a shorter side than this, cells, make rounder forms that repeat sooner (`docs/papers/synthesis.md`).
const SMALL: usize = 256;
/// Up to this share of line cells windows are told from real terrain less often than the region network's or nearly so, and slopes, spectrum
/// and landforms are nearer to it; PSNR is 1 to 2 dB lower (decision 12).
const SPARSE: f64 = 0.1;

/// What a style file says of the system; the terrain is the style's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SynthesisInfo {
    /// The settings.
    pub(crate) config: SynthesisConfig,
    /// Metres of the unit in which lines come and terrain goes.
    pub(crate) unit: Normalization,
    /// Seconds that the preparation took.
    pub(crate) seconds: f64,
}

/// Terrain by analogy with the exemplar. Heights of lines and terrain are in the unit interval of its [`SynthesisInfo::unit`];
/// cells are as large as the exemplar's.
pub(crate) struct SynthesisSystem {
    info: SynthesisInfo,
    terrain: Arc<Dem>,
    prepared: OnceLock<Synthesis>,
}

impl fmt::Debug for SynthesisSystem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SynthesisSystem").field("info", &self.info).finish_non_exhaustive()
    }
}

impl Settings for SynthesisConfig {
    fn validate(&self) -> Result<()> {
        Self::validate(self)
    }
}

impl SynthesisSystem {
    /// The prepared exemplar.
    fn prepared(&self) -> Result<&Synthesis> {
        if let Some(prepared) = self.prepared.get() {
            return Ok(prepared);
        }
        let made = Synthesis::new(&self.terrain, &self.info.config)?;
        Ok(self.prepared.get_or_init(|| made))
    }

    /// As [`generate`](SketchToTerrain::generate), with what is known about the answer: where every cell comes from, in rows and
    /// columns of the style's terrain. Its heights are metres.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn synthesize(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Synthesized> {
        let metres = lines.to_metres(self.info.unit);
        self.prepared()?.synthesize(&metres, seed, stop)
    }

    /// Terrain in the unit interval, and where every cell comes from.
    fn made(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<(Grid<f32>, Provenance)> {
        let Synthesized { heights: mut terrain, provenance, .. } = self.synthesize(lines, seed, stop)?;
        // Lines take their height itself: there and back again would round.
        let drawn = lines.kinds().as_slice().iter().zip(lines.heights().as_slice());
        for (z, (kind, &height)) in terrain.as_mut_slice().iter_mut().zip(drawn) {
            *z = if kind.is_some() { height } else { self.info.unit.to_unit(f64::from(*z)) as f32 };
        }
        Ok((terrain, provenance))
    }
}

impl SketchToTerrain for SynthesisSystem {
    fn generate(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Result<Grid<f32>> {
        Ok(self.made(lines, seed, stop)?.0)
    }

    fn traced(&self, lines: &LineMap, seed: Seed, stop: &Stop) -> Option<Result<(Grid<f32>, Provenance)>> {
        Some(self.made(lines, seed, stop))
    }
}

impl Part for SynthesisSystem {
    const NAME: &'static str = "synthesis";
    const NEEDS_TERRAIN: bool = true;
    type Config = SynthesisConfig;
    type Description = SynthesisInfo;

    /// Prepares the terrain around the window; nothing is random.
    fn learn(exemplar: &Exemplar, config: &Checked<Self::Config>, control: Control<'_>) -> Result<Self> {
        let start = Instant::now();
        control.stop.check()?;
        let terrain = exemplar.source.terrain.clone();
        let prepared = Synthesis::new(&terrain, config)?;
        let seconds = start.elapsed().as_secs_f64();
        let stage = Stage::Coarse(Self::NAME);
        (control.progress)(&Progress { stage, step: 1, steps: 1, share: 1.0, seconds, figures: &[] });
        let info = SynthesisInfo { config: (**config).clone(), unit: exemplar.normalization, seconds };
        Ok(Self { info, terrain, prepared: OnceLock::from(prepared) })
    }

    fn config(&self) -> &Self::Config {
        &self.info.config
    }

    fn account(&self) -> Account {
        let (rows, cols) = self.terrain.shape();
        let small = if rows.min(cols) < SMALL {
            format!(
                "; below {SMALL} cells a side its forms are rounder and repeat sooner: give it more terrain where there is some"
            )
        } else {
            String::new()
        };
        let text = format!(
            "patches of {rows}x{cols} cells of terrain, for drawings of a few strokes; prepared in {:.1} s{small}",
            self.info.seconds
        );
        Account { text, seconds: self.info.seconds, figures: Vec::new() }
    }

    fn save(&self) -> Result<(Self::Description, Arrays)> {
        Ok((self.info.clone(), Arrays::default()))
    }

    fn load(info: Self::Description, _: &mut Arrays, terrain: Option<&Arc<Dem>>) -> Result<Self> {
        info.config.validate()?;
        let Some(terrain) = terrain else {
            let allowed = "the synthesis makes terrain of it: train the style again without leaving it out";
            return Err(Error::value("terrain of the style", "none", allowed));
        };
        Ok(Self { info, terrain: terrain.clone(), prepared: OnceLock::new() })
    }
}

impl System for SynthesisSystem {
    fn meets_lines(_: &Self::Config) -> bool {
        true
    }

    fn check(config: &Self::Config, terrain: &Dem) -> Result<()> {
        Synthesis::check(terrain, config)
    }

    fn sparse_up_to(_: &Self::Config) -> f64 {
        SPARSE
    }

    fn is_complete(_: &Self::Config) -> bool {
        true
    }
}
