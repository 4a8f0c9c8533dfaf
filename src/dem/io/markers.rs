//! Numbers that are probably no heights, although nothing says so: -9999, 65535, a collar of 0.
//!
//! In: the heights of a raster. Out: an error or a warning for each value at the low or the high end that stands alone: far
//! from the next one, compared with how far all the others lie apart. Terrain has neighbours, markers do not. Cost: one
//! pass, and one more for every value that is found.

use super::place::Said;
use super::samples::Rule;
use crate::error::{Error, Result};
use std::path::Path;

/// The lowest and the highest that ground can be, metres: a little beyond Challenger Deep and Everest.
const EARTH: std::ops::RangeInclusive<f64> = -11_000.0..=9000.0;

/// Stored numbers that are popular as markers, although they could be heights.
const POPULAR: [f64; 9] = [-9999.0, -9998.0, -10_000.0, -999.0, -99.0, -8888.0, 8888.0, 9999.0, 999.0];

/// A value outside [`EARTH`] stands alone when the next one is this far, metres.
const GAP_OUTSIDE: f64 = 100.0;

/// A popular marker stands alone when the next value is this far, metres, and this share of the others' range.
const GAP_POPULAR: (f64, f64) = (300.0, 0.1);

/// Any number is no height when the next one is this far, metres, and so many times the others' range; unless it fills a
/// larger share of the raster, as one side of a cliff does.
const GAP_CERTAIN: (f64, f64) = (1000.0, 2.0);
const SHARE_CERTAIN: f64 = 0.3;

/// Any other number of several cells, and of a single one: metres, and share of the others' range.
const GAP_SEVERAL: (f64, f64) = (50.0, 0.25);
const GAP_SINGLE: (f64, f64) = (100.0, 0.5);

/// So many lonely values are peeled off; a file with more has no heights worth the name.
const MOST: usize = 4;

/// The two lowest or highest values, and how many cells the first has.
#[derive(Clone, Copy)]
struct End {
    first: f64,
    count: usize,
    next: f64,
}

impl End {
    /// Takes in another value; for the high end, negated.
    fn add(&mut self, z: f64) {
        if z < self.first {
            *self = Self { first: z, count: 1, next: self.first };
        } else if z == self.first {
            self.count += 1;
        } else if z < self.next {
            self.next = z;
        }
    }
}

/// The low and the high end (negated) of those heights that are not `peeled`.
fn ends(heights: &[f32], valid: &[bool], peeled: &[f64]) -> (End, End) {
    let none = End { first: f64::INFINITY, count: 0, next: f64::INFINITY };
    let (mut low, mut high) = (none, none);
    for (&z, _) in heights.iter().zip(valid).filter(|(_, ok)| **ok) {
        let z = f64::from(z);
        if !peeled.contains(&z) {
            low.add(z);
            high.add(-z);
        }
    }
    (low, high)
}

/// Refuses or tells of values that stand alone.
pub(super) fn check(
    path: &Path,
    rule: &Rule,
    heights: &[f32],
    valid: &[bool],
    said: &mut Said,
) -> Result<()> {
    let mut peeled = Vec::new();
    while peeled.len() < MOST {
        let (low, high) = ends(heights, valid, &peeled);
        if !(low.next.is_finite() && high.next.is_finite()) {
            break;
        }
        // How far the others lie apart.
        let range = (-high.next - low.next).max(0.0);
        let lonely = |end: End, z: f64| {
            let share = end.count as f64 / valid.len() as f64;
            Lonely::new(rule, z, (end.count, share), end.next - end.first, range)
        };
        let Some(found) = lonely(low, low.first).or_else(|| lonely(high, -high.first)) else { break };
        peeled.push(found.metres);
        let others =
            if found.metres == low.first { (low.next, -high.first) } else { (low.first, -high.next) };
        found.tell(path, rule, others, said)?;
    }
    let (low, high) = ends(heights, valid, &peeled);
    let (low, high) = (low.first, -high.first);
    if low.is_finite() && !(EARTH.contains(&low) && EARTH.contains(&high)) {
        let units = [(0.3048, "feet"), (0.1, "decimetres"), (0.01, "centimetres"), (0.001, "millimetres")];
        let fits = |unit: f64| EARTH.contains(&(low * unit)) && EARTH.contains(&(high * unit));
        let remedy = match units.into_iter().find(|(unit, _)| fits(*unit)) {
            Some((unit, name)) => format!("--metres-per-unit {unit} if they are {name}"),
            None => "is it another unit, --metres-per-unit M, or another byte order?".to_owned(),
        };
        said.warnings.push(format!(
            "heights from {} to {} m: ground lies between {} and {} m ({remedy})",
            low as f32,
            high as f32,
            EARTH.start(),
            EARTH.end()
        ));
    }
    Ok(())
}

/// A value that stands alone.
struct Lonely {
    metres: f64,
    stored: f64,
    count: usize,
    /// A marker almost certainly.
    certain: bool,
}

impl Lonely {
    fn new(rule: &Rule, metres: f64, (count, share): (usize, f64), gap: f64, range: f64) -> Option<Self> {
        let stored = rule.stored(metres);
        let beyond = |(least, share): (f64, f64)| gap >= least.max(share * range);
        let outside = !EARTH.contains(&metres) && gap >= GAP_OUTSIDE;
        let popular = POPULAR.contains(&stored) && beyond(GAP_POPULAR);
        let strange = beyond(if count > 1 { GAP_SEVERAL } else { GAP_SINGLE });
        let far = beyond(GAP_CERTAIN) && share < SHARE_CERTAIN;
        let certain = outside || popular || far;
        (certain || strange).then_some(Self { metres, stored, count, certain })
    }

    fn tell(&self, path: &Path, rule: &Rule, (low, high): (f64, f64), said: &mut Said) -> Result<()> {
        let Self { stored, count, .. } = *self;
        let cells = if count == 1 { "1 cell".to_owned() } else { format!("{count} cells") };
        // With the digits of the file, which has them in single precision.
        let others = format!("far from all other heights ({} to {} m)", low as f32, high as f32);
        // What is void already stays so.
        let keep = match rule.nodata().filter(|v| v.is_finite()) {
            Some(declared) => format!("{declared},{stored}"),
            None => stored.to_string(),
        };
        if self.certain && rule.is_strict() {
            let means = match rule.nodata() {
                Some(declared) => format!("the file declares {declared} as nodata, not this"),
                None => "the file declares no nodata".to_owned(),
            };
            return Err(Error::file(
                path,
                format!("height of {cells}"),
                format!("{stored}, {others}"),
                format!(
                    "{means}: say what it means, --nodata {keep} if there is no height, --nodata none if it is one"
                ),
            ));
        }
        said.warnings
            .push(format!("{cells} of {stored}, {others}: if there is no height, say --nodata {keep}"));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Nodata, ReadOptions};
    use super::*;

    /// Heights of a slope from 1500 to 2500 m, and `strange` in the first cells.
    fn told(strange: &[f32], nodata: Nodata, declared: Option<f64>) -> Result<Vec<String>> {
        let mut heights: Vec<f32> = (0..1000u16).map(|i| 1500.0 + f32::from(i)).collect();
        heights[..strange.len()].copy_from_slice(strange);
        let (path, mut said) = (Path::new("x"), Said::default());
        let rule = Rule::new(path, &ReadOptions { nodata, ..Default::default() }, declared, 1.0)?;
        check(path, &rule, &heights, &vec![true; 1000], &mut said)?;
        Ok(said.warnings)
    }

    #[test]
    fn markers_are_refused_until_explained() {
        for marker in [
            -9999.0f32, 32767.0, -32767.0, 65535.0, 55537.0, 10_000.0, -10_000.0, 9999.0, -999.0, -500.0, 1e5,
        ] {
            for declared in [None, Some(-1.0)] {
                let message = told(&[marker; 3], Nodata::AsDeclared, declared).unwrap_err().to_string();
                let wanted = ["3 cells", &marker.to_string(), "--nodata", "1503 to 2499"];
                assert!(wanted.iter().all(|w| message.contains(w)), "{message}");
            }
            // Explained to be a height, or something else to be none: no more than told.
            for nodata in [Nodata::None, Nodata::Value(7.0)] {
                assert!(told(&[marker], nodata, None).unwrap()[0].contains("1 cell of"));
            }
        }
        let message = told(&[32767.0], Nodata::AsDeclared, Some(-32768.0)).unwrap_err().to_string();
        assert!(message.contains("--nodata -32768,32767"), "{message}");
    }

    #[test]
    fn a_collar_of_zeros_and_a_lone_spike_are_told() {
        assert!(told(&[0.0; 41], Nodata::AsDeclared, None).unwrap()[0].contains("41 cells of 0"));
        assert!(told(&[4000.0], Nodata::AsDeclared, None).unwrap()[0].contains("1 cell of 4000"));
        let both = told(&[0.0, 0.0, 4000.0], Nodata::AsDeclared, None).unwrap();
        assert_eq!(both.len(), 2, "{both:?}");
    }

    #[test]
    fn terrain_is_left_in_peace() {
        // A sea beside hills, a trench down to -9999, a mountain of Mars.
        let plain = |heights: Vec<f32>| {
            let (path, mut said) = (Path::new("x"), Said::default());
            let rule = Rule::new(path, &ReadOptions::default(), None, 1.0).unwrap();
            check(path, &rule, &heights, &vec![true; heights.len()], &mut said).unwrap();
            said.warnings
        };
        assert!(plain((0..900u16).map(|i| (f32::from(i) - 300.0).max(0.0)).collect()).is_empty());
        assert!(plain((0..900u16).map(|i| -9999.0 + 3.0 * f32::from(i)).collect()).is_empty());
        assert!(plain(vec![5.0; 40]).is_empty());
        // A cliff: two heights, and nothing between.
        assert_eq!(plain([vec![0.0; 40], vec![3000.0; 40]].concat()).len(), 1);
        let mars = plain((0..900u16).map(|i| 25.0 * f32::from(i)).collect());
        assert!(mars.len() == 1 && mars[0].contains("0 to 22475"), "{mars:?}");
    }

    /// Heights that are none of metres: in which unit they would fit, when in any.
    #[test]
    fn strange_ranges_are_told_with_a_remedy() {
        let warned = |lowest: f32, step: f32| {
            let heights: Vec<f32> = (0..900u16).map(|i| lowest + step * f32::from(i)).collect();
            let (path, mut said) = (Path::new("x"), Said::default());
            let rule = Rule::new(path, &ReadOptions::default(), None, 1.0).unwrap();
            check(path, &rule, &heights, &vec![true; heights.len()], &mut said).unwrap();
            said.warnings.join("; ")
        };
        for (lowest, step, remedy) in [
            (10_000.0, 15.0, "--metres-per-unit 0.3048 if they are feet"),
            (31_000.0, 50.0, "--metres-per-unit 0.1 if they are decimetres"),
            (155_002.0, 20.0, "--metres-per-unit 0.01 if they are centimetres"),
            (-32_000.0, 60.0, "--metres-per-unit 0.3048"),
            (-120_000.0, 95.0, "--metres-per-unit 0.01"),
        ] {
            let said = warned(lowest, step);
            assert!(said.contains(remedy), "{lowest}: {said}");
        }
        assert!(warned(-90_000_000.0, 96.0).contains("byte order"), "nothing fits");
        // With the digits that the file has, not those of a wider float.
        assert!(warned(20_000.1, 1.0).contains("heights from 20000.1 to"), "{}", warned(20_000.1, 1.0));
    }
}
