//! Whether terrain is of the same kind, by its small patches, and whether it is a copy.
//!
//! A patch is a 7x7 window of heights minus their mean, so that elevation does not matter. Cost: of
//! [`sliced_wasserstein`] 64 dot products and a sort per patch and scale; of [`copy_audit`] a search over all patches of the
//! exemplar for every patch looked at (0.2 s for two rasters of 128x128).

use super::{check_one, check_pair};
use crate::error::{Error, Result};
use crate::grid::resample::resample;
use crate::grid::{Grid, Mask};
use crate::seed::Seed;
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Side of a patch, cells (Karras et al. 2018, 5: patches of 7x7).
const SIDE: usize = 7;
const AREA: usize = SIDE * SIDE;
/// Directions on which patches are projected.
const DIRECTIONS: usize = 64;
/// The raster is looked at in full, half and quarter size.
const SCALES: u32 = 3;
/// Every so many cells along both axes a patch of the output is audited.
const AUDIT_STEP: usize = 3;
/// A patch nearer than this share of the exemplar's patch deviation to one of the exemplar's is a copy.
const COPY: f32 = 0.05;

type Patch = [f32; AREA];

/// Mean-free patches without voids, `step` cells apart, row by row.
fn patches(terrain: &Grid<f32>, valid: &Mask, step: usize) -> Vec<Patch> {
    let (rows, cols) = terrain.shape();
    let (z, ok) = (terrain.as_slice(), valid.as_slice());
    let mut patches = Vec::new();
    for row in (0..(rows + 1).saturating_sub(SIDE)).step_by(step) {
        for col in (0..(cols + 1).saturating_sub(SIDE)).step_by(step) {
            let mut patch = [0.0; AREA];
            let mut whole = true;
            for (i, value) in patch.iter_mut().enumerate() {
                let at = (row + i / SIDE) * cols + col + i % SIDE;
                *value = z[at];
                whole &= ok[at];
            }
            if whole {
                let mean = patch.iter().sum::<f32>() / AREA as f32;
                patch.iter_mut().for_each(|v| *v -= mean);
                patches.push(patch);
            }
        }
    }
    patches
}

/// Root mean square of all values of all patches.
fn deviation(patches: &[Patch]) -> f32 {
    let sum: f64 = patches.iter().flatten().map(|v| f64::from(v * v)).sum();
    (sum / (patches.len() * AREA) as f64).sqrt() as f32
}

/// Patches that deviate less than rounding does are level.
fn level(terrain: &Grid<f32>) -> f32 {
    1e-6 * terrain.as_slice().iter().fold(0.0, |m: f32, z| m.max(z.abs()))
}

/// Unit directions, the same in every call.
fn directions() -> Vec<Patch> {
    let mut stream = Seed(0).stream("directions of the sliced Wasserstein distance");
    let draw = |_| {
        let mut direction = [0.0; AREA];
        direction.fill_with(|| stream.sample::<f32, _>(StandardNormal));
        let length = direction.iter().map(|v| v * v).sum::<f32>().sqrt();
        direction.map(|v| v / length)
    };
    (0..DIRECTIONS).map(draw).collect()
}

/// Sliced Wasserstein-1 distance of the 7x7 patches, mean over full, half and quarter size: the earth mover's distance of
/// the patches' projections on 64 random directions, over the root mean square projection of the truth's patches. 0 for
/// equal distributions; 1 is about that of flat ground. Scales that a void reaches keep the patches beside it.
///
/// # Errors
/// When the shapes differ, a valid value is not finite, no scale has a whole patch, or the truth is flat.
pub fn sliced_wasserstein(output: &Grid<f32>, truth: &Grid<f32>, valid: &Mask) -> Result<f64> {
    check_pair(output, truth, valid)?;
    let clean = |z: &Grid<f32>| {
        let mut z = z.clone();
        for (z, ok) in z.as_mut_slice().iter_mut().zip(valid.as_slice()) {
            *z = if *ok { *z } else { 0.0 };
        }
        z
    };
    let (output, truth) = (clean(output), clean(truth));
    let known = valid.map(|ok| f32::from(u8::from(*ok)));
    let directions = directions();
    let (mut sum, mut scales) = (0.0, 0);
    for scale in 0..SCALES {
        let (rows, cols) = (truth.rows() >> scale, truth.cols() >> scale);
        if rows.min(cols) < SIDE {
            break;
        }
        let sized = |z: &Grid<f32>| resample(z, rows, cols);
        let whole = sized(&known).map(|k| (k - 1.0).abs() < 1e-4);
        let (a, b) = (patches(&sized(&output), &whole, 1), patches(&sized(&truth), &whole, 1));
        let spread = f64::from(deviation(&b));
        if b.is_empty() || spread <= f64::from(level(&truth)) {
            continue;
        }
        let distances: Vec<f64> = directions
            .par_iter()
            .map(|direction| {
                let project = |patches: &[Patch]| {
                    let mut line: Vec<f32> =
                        patches.iter().map(|p| p.iter().zip(direction).map(|(v, d)| v * d).sum()).collect();
                    line.sort_unstable_by(f32::total_cmp);
                    line
                };
                let pairs = project(&a).into_iter().zip(project(&b));
                pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / b.len() as f64
            })
            .collect();
        sum += distances.iter().sum::<f64>() / DIRECTIONS as f64 / spread;
        scales += 1;
    }
    if scales == 0 {
        return Err(Error::value("whole patches with relief", 0, "a patch distance needs at least one"));
    }
    Ok(sum / f64::from(scales))
}

/// What a copy audit found.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CopyAudit {
    /// Mean distance of an output patch to the nearest exemplar patch: root mean square over its cells, over the exemplar's
    /// patch deviation. 0 is a copy.
    pub(crate) mean_distance: f64,
    /// Share of the output's patches nearer than 5 % of that deviation.
    pub copied_share: f64,
}

/// Compares every third patch of the output (along both axes) with all patches of the exemplar.
///
/// # Errors
/// When the output is smaller than a patch, or the exemplar is, or is flat; when a value is not finite.
pub fn copy_audit(output: &Grid<f32>, exemplar: &Grid<f32>) -> Result<CopyAudit> {
    let everywhere = |z: &Grid<f32>| z.map(|_| true);
    check_one("output", output, &everywhere(output))?;
    check_one("exemplar", exemplar, &everywhere(exemplar))?;
    let made = patches(output, &everywhere(output), AUDIT_STEP);
    let known = patches(exemplar, &everywhere(exemplar), 1);
    let spread = if known.is_empty() { 0.0 } else { deviation(&known) };
    if made.is_empty() || spread <= level(exemplar) {
        return Err(Error::value("patches with relief", 0, "a copy audit needs 7x7 cells of both rasters"));
    }
    let distances: Vec<f32> = made
        .par_iter()
        .map(|patch| {
            let square =
                |other: &Patch| -> f32 { patch.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum() };
            let nearest = known.iter().map(square).fold(f32::INFINITY, f32::min);
            (nearest / AREA as f32).sqrt() / spread
        })
        .collect();
    let copies = distances.iter().filter(|d| **d < COPY).count();
    Ok(CopyAudit {
        mean_distance: distances.iter().map(|d| f64::from(*d)).sum::<f64>() / distances.len() as f64,
        copied_share: copies as f64 / distances.len() as f64,
    })
}

/// How different variants of one terrain are: the mean over cells of the standard deviation over the variants, over the
/// standard deviation of the heights of the first. 0 for equal variants (SinGAN, section 3: diversity).
///
/// # Errors
/// When there are fewer than two, their shapes differ, a value is not finite, or the first is flat.
pub fn diversity(variants: &[Grid<f32>]) -> Result<f64> {
    let [first, others @ ..] = variants else {
        return Err(Error::value("number of variants", 0, "diversity needs at least two"));
    };
    if others.is_empty() {
        return Err(Error::value("number of variants", 1, "diversity needs at least two"));
    }
    let everywhere = first.map(|_| true);
    variants.iter().try_for_each(|v| check_one("variant", v, &everywhere))?;
    let spread = |values: &mut dyn Iterator<Item = f64>| {
        let values: Vec<f64> = values.collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64).sqrt()
    };
    let scale = spread(&mut first.as_slice().iter().map(|z| f64::from(*z)));
    if scale <= 0.0 {
        return Err(Error::value(
            "relief of the first variant",
            0,
            "flat ground has nothing to compare with",
        ));
    }
    let cell = |i: usize| spread(&mut variants.iter().map(|v| f64::from(v.as_slice()[i])));
    Ok((0..first.len()).map(cell).sum::<f64>() / first.len() as f64 / scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Cell, Window};

    fn hills(side: usize, rough: f32) -> Grid<f32> {
        Grid::from_fn(side, side, |c| {
            let (y, x) = (c.row as f32, c.col as f32);
            0.5 + 0.3 * (0.21 * y).sin() * (0.17 * x).cos() + rough * (1.9 * y + 0.3 * x * x).sin()
        })
    }

    #[test]
    fn equal_kinds_are_near_and_others_far() {
        let truth = hills(40, 0.02);
        let valid = truth.map(|_| true);
        assert_eq!(sliced_wasserstein(&truth, &truth, &valid).unwrap(), 0.0);
        let raised = truth.map(|z| z + 3.0);
        assert!(sliced_wasserstein(&raised, &truth, &valid).unwrap() < 1e-4);
        let far = sliced_wasserstein(&hills(40, 0.0), &truth, &valid).unwrap();
        let near = sliced_wasserstein(&hills(40, 0.015), &truth, &valid).unwrap();
        assert!(near < 0.5 * far, "{near} {far}");
        assert!(sliced_wasserstein(&truth, &Grid::filled(40, 40, 0.5), &valid).is_err());
        // W1 of twice the heights is the mean size of a projection: of normal values .8 of their deviation.
        let doubled = sliced_wasserstein(&truth.map(|z| 2.0 * z), &truth, &valid).unwrap();
        assert!((0.6..1.0).contains(&doubled), "{doubled}");
        let (mut holed, mut some) = (truth.clone(), valid.clone());
        (holed[Cell::new(20, 20)], some[Cell::new(20, 20)]) = (1e9, false);
        assert_eq!(sliced_wasserstein(&holed, &truth, &some).unwrap(), 0.0);
    }

    #[test]
    fn copies_are_found() {
        let exemplar = hills(40, 0.02);
        let window = exemplar.crop(Window::square(Cell::new(5, 8), 20)).unwrap().map(|z| z + 0.7);
        let audit = copy_audit(&window, &exemplar).unwrap();
        assert_eq!(audit.copied_share, 1.0);
        assert!(audit.mean_distance < 1e-4);
        let noise =
            Grid::from_fn(20, 20, |c| ((c.row * 37 + c.col * 61 + c.row * c.col * 7) % 23) as f32 / 22.0);
        let audit = copy_audit(&noise, &exemplar).unwrap();
        assert!(audit.copied_share == 0.0 && audit.mean_distance > 1.0, "{audit:?}");
        assert!(copy_audit(&Grid::filled(5, 5, 0.0), &exemplar).is_err());
    }

    #[test]
    fn diversity_is_the_spread_over_variants() {
        let one = hills(20, 0.0);
        assert_eq!(diversity(&[one.clone(), one.clone()]).unwrap(), 0.0);
        let mean = one.as_slice().iter().sum::<f32>() / one.len() as f32;
        let deviation = one.as_slice().iter().map(|z| (z - mean).powi(2)).sum::<f32>() / one.len() as f32;
        let moved = one.map(|z| z + 2.0 * deviation.sqrt());
        assert!((diversity(&[one.clone(), moved]).unwrap() - 1.0).abs() < 1e-3);
        assert!(diversity(&[one]).is_err());
    }
}
