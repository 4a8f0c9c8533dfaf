//! From an exemplar to a style by a recipe: coarse systems, what they leave open, detail.

use super::{Origin, Recipe, Style, has_unseen, unseen_surface};
use crate::control::{Checkpoints, Control};
use crate::error::{Error, Result};
use crate::file;
use crate::metrics::mean_valid_slope;
use crate::systems::task::{Exemplar, Source};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Level ground is the one exemplar without a mean slope.
fn level(_: Error) -> Error {
    let allowed = "the exemplar shows no ridge or valley; choose a window with relief";
    Error::value("relief of the exemplar", "0 m", allowed)
}

/// Share of a long budget that coarse systems get before detail that is trained: both reach their plateau in about this proportion.
const COARSE_SHARE: f64 = 0.3;
/// Seconds in which a coarse system comes near its plateau on two cores; a short budget gives it half of itself, up to these.
const COARSE_SECONDS: f64 = 30.0;
/// Share of what trained detail gets of a budget in which its strength is measured.
const UNSEEN_SHARE: f64 = 0.15;
/// Share of a budget that coarse systems get before detail that is not trained; two halves of the exemplar take half as long
/// again, the rest is for measuring its strength.
const UNTRAINED_COARSE_SHARE: f64 = 0.6;

/// Learns a style.
///
/// A budget is for everything. With checkpoints, whose path is that of the style, the style is written after every part, so that
/// it can be used whatever happens, and the state of the part in work is kept beside it ([`unfinished`]). To resume is to take
/// the parts that are there and to go on with the one in work: the style is then the same as one that was never interrupted, unless
/// a budget ties it to the clock.
///
/// ```
/// # fn main() -> monadnock::Result<()> {
/// use monadnock::{Cell, Control, Recipe, Seed, Source, Window, dem::bundled, learn, style::StyleConfig};
///
/// let source = Source::new("sierra", &bundled::load("sierra")?, Window::square(Cell::new(128, 0), 48))?;
/// let mut config = StyleConfig::default();
/// (config.model.epochs, config.model.extractions) = (3, 2);
/// let mut epochs = 0;
/// let style = learn(&source, &Recipe::network(&config, Seed(1))?, Control::new(&mut |_| epochs += 1))?;
/// assert_eq!(epochs, 3);
/// assert_eq!(style.origin.exemplar.name, "sierra");
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// When the window is too small, level or without lines, a training diverges, what is resumed belongs to another recipe, or the
/// work is stopped. After a divergence the last good state is still there.
pub fn learn(source: &Source, recipe: &Recipe, control: Control<'_>) -> Result<Style> {
    let Control { progress, budget, checkpoints, stop } = control;
    let mut exemplar = Exemplar::new(source, &recipe.extraction, recipe.seed)?;
    let (rows, cols) = exemplar.heights.shape();
    let first = recipe.first()?;
    let is_measured = recipe.detail.is_some() && has_unseen(&**first, rows, cols);
    let is_trained = recipe.detail.as_ref().map(|detail| detail.takes_budget());
    let shares = budget.map(|all| shares(all, is_trained, is_measured));
    let is_loose = budget.is_some() || recipe.known.is_some();
    let known = known(source, recipe, checkpoints.as_ref(), budget.is_some())?;
    if let Some(kept) = checkpoints.as_ref().filter(|kept| !kept.resume) {
        recipe.names().iter().try_for_each(|name| file::remove(&checkpoint_of(&kept.path, name)))?;
    }
    let of_part = |name: &str| {
        checkpoints.as_ref().map(|kept| Checkpoints { path: checkpoint_of(&kept.path, name), ..kept.clone() })
    };
    let finished = |style: &Style, name: &str| -> Result<()> {
        let Some(kept) = &checkpoints else { return Ok(()) };
        style.save(&kept.path)?;
        file::remove(&checkpoint_of(&kept.path, name))
    };

    let mut style = Style {
        origin: Origin {
            seed: recipe.seed,
            normalization: exemplar.normalization,
            exemplar: source.info.clone(),
            mean_slope: Some(mean_valid_slope(&exemplar.heights, source.dem.valid()).map_err(level)?),
            extraction: recipe.extraction.clone(),
        },
        coarse: Vec::new(),
        detail: None,
        terrain: recipe.keep_terrain.then(|| source.terrain.clone()),
    };
    let timed = recipe.systems.iter().filter(|plan| plan.takes_budget()).count().max(1);
    for plan in &recipe.systems {
        let checkpoints = of_part(plan.name());
        let is_in_work = checkpoints.as_ref().is_some_and(|kept| kept.resume && kept.path.exists());
        let there = known.as_ref().filter(|_| !is_in_work);
        let there =
            there.and_then(|known| known.coarse.iter().find(|system| plan.made(&***system, is_loose)));
        let system = match there {
            Some(system) => system.clone(),
            None => {
                let budget = shares.map(|shares| shares[0] / timed as u32).filter(|_| plan.takes_budget());
                plan.learn(
                    &exemplar,
                    Control { progress: &mut *progress, budget, checkpoints, stop: stop.clone() },
                )?
            }
        };
        style.coarse.push(system);
        style.check_terrain()?;
        finished(&style, plan.name())?;
    }
    if let Some(detail) = &recipe.detail {
        let budget = shares.map(|shares| shares[1]);
        let control = Control { progress: &mut *progress, budget, checkpoints: None, stop: stop.clone() };
        exemplar.unseen = unseen_surface(&**first, &exemplar, control)?;
        exemplar.extractions = first.extractions();
        let budget = shares.map(|shares| shares[2]).filter(|_| detail.takes_budget());
        let checkpoints = of_part(detail.name());
        style.detail = Some(detail.learn(&exemplar, Control { progress, budget, checkpoints, stop })?);
        style.check_terrain()?;
        finished(&style, detail.name())?;
    }
    Ok(style)
}

impl Style {
    /// Whether every part has the terrain that it needs.
    fn check_terrain(&self) -> Result<()> {
        if self.terrain.is_some() || !self.needs_terrain() {
            return Ok(());
        }
        let allowed = "a system of this style needs the exemplar's terrain when it is used";
        Err(Error::value("terrain of the style", "left out", allowed))
    }
}

/// The style from which parts are taken: the recipe's, or that of the run which is resumed.
fn known(source: &Source, recipe: &Recipe, kept: Option<&Checkpoints>, timed: bool) -> Result<Option<Style>> {
    if let Some(style) = &recipe.known {
        recipe.continues(style, source, true)?;
        return Ok(Some(style.clone()));
    }
    let Some(kept) = kept.filter(|kept| kept.resume && kept.path.exists()) else { return Ok(None) };
    let there = recipe.registry.load(&kept.path);
    match there.and_then(|style| recipe.continues(&style, source, timed).map(|()| style)) {
        Ok(style) => Ok(Some(style)),
        // Detail that was begun cannot go on without the coarse systems of its run.
        Err(error)
            if recipe.detail.as_ref().is_some_and(|d| checkpoint_of(&kept.path, d.name()).exists()) =>
        {
            Err(error.in_file(&kept.path))
        }
        Err(_) => Ok(None),
    }
}

/// Where the state of a part is kept while a style is learned.
fn checkpoint_of(style: &Path, part: &str) -> PathBuf {
    let mut name = style.as_os_str().to_owned();
    name.push(format!(".{part}-checkpoint"));
    name.into()
}

/// The part of `recipe` whose training was interrupted when the style at that path was learned, and its checkpoint.
#[must_use]
pub(crate) fn unfinished(style: &Path, recipe: &Recipe) -> Option<(&'static str, PathBuf)> {
    let all = recipe.names().into_iter().map(|name| (name, checkpoint_of(style, name)));
    all.into_iter().find(|(_, path)| path.exists())
}

/// What coarse systems, unseen terrain and detail get of a budget. `detail`: none, or whether it is trained.
fn shares(all: Duration, detail: Option<bool>, measured: bool) -> [Duration; 3] {
    let none = Duration::ZERO;
    match detail {
        None => [all, none, none],
        Some(false) => {
            let (coarse, halves) =
                (all.mul_f64(UNTRAINED_COARSE_SHARE), all.mul_f64(0.5 * UNTRAINED_COARSE_SHARE));
            if measured { [coarse, halves, none] } else { [coarse + halves, none, none] }
        }
        Some(true) => {
            let coarse = coarse_share(all);
            let halves = if measured { (all - coarse).mul_f64(UNSEEN_SHARE) } else { none };
            [coarse, halves, all - coarse - halves]
        }
    }
}

/// What coarse systems get of a budget before detail that is trained.
fn coarse_share(all: Duration) -> Duration {
    let seconds = all.as_secs_f64();
    Duration::from_secs_f64((COARSE_SHARE * seconds).max((0.5 * seconds).min(COARSE_SECONDS)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_budgets_go_to_the_detail() {
        let share = |seconds: u64| coarse_share(Duration::from_secs(seconds)).as_secs_f64();
        assert_eq!([20, 60, 100].map(share), [10.0, 30.0, 30.0]);
        assert!((share(300) - 90.0).abs() < 1e-9);
    }

    #[test]
    fn a_budget_is_shared_among_the_steps_taken() {
        let minute = Duration::from_secs(60);
        let of = |detail, measured| shares(minute, detail, measured).map(|part| part.as_secs_f64());
        assert_eq!(of(None, true), [60.0, 0.0, 0.0]);
        assert_eq!(of(Some(false), true), [36.0, 18.0, 0.0]);
        assert_eq!(of(Some(false), false), [54.0, 0.0, 0.0]);
        assert_eq!(of(Some(true), true), [30.0, 4.5, 25.5]);
        assert_eq!(of(Some(true), false), [30.0, 0.0, 30.0]);
    }
}
