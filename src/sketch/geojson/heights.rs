//! The heights of a sketch's lines: their unit, which of them are missing, and zeros that nobody meant.

use super::features::RawLine;
use super::member::{HeightUnit, MapMember};
use super::notes::Notes;
use super::options::{MissingHeights, ReadOptions};
use crate::dem::crs::unit_in_words;
use crate::error::{Error, Result};
use crate::sketch::Vertex;

/// The unit of the heights, and what one stored number is in it; `vertical` is what the file's coordinate system says of it,
/// in metres.
pub(super) fn unit(
    member: Option<&MapMember>,
    options: &ReadOptions,
    lines: &[RawLine],
    vertical: Option<f64>,
    notes: &mut Notes,
) -> Result<(HeightUnit, f64)> {
    let heights = || lines.iter().flat_map(|line| line.points.iter().filter_map(|p| p.z));
    let in_metres = lines.iter().find(|line| line.points.iter().any(|p| p.z.is_some_and(|z| z.in_metres)));
    let stated = match (options.metres_per_unit, options.unit) {
        (Some(metres), _) => Some((HeightUnit::Metres, metres)),
        (None, Some(unit)) => Some((unit, 1.0)),
        (None, None) => member.map_or(Ok(None), MapMember::unit)?,
    };
    if let (Some((HeightUnit::Normalised, _)), Some(line)) = (stated, in_metres) {
        return Err(Error::value(
            format!("height of {}", line.name),
            "a length with its unit",
            "allowed: 0 to 1 without a unit, as the sketch's heights are normalised",
        ));
    }
    if let Some(stated) = stated {
        return Ok(stated);
    }
    if let (Some(metres), true) = (vertical, heights().any(|z| !z.in_metres)) {
        let unit = unit_in_words(metres);
        notes.say(format!("The file's vertical coordinate system is in {unit}: so are its heights taken."));
        return Ok((HeightUnit::Metres, metres));
    }
    let (unit, why) = match in_metres {
        Some(_) if heights().all(|z| z.in_metres) => return Ok((HeightUnit::Metres, 1.0)),
        Some(_) => (HeightUnit::Metres, "metres where they name no unit themselves"),
        None if heights().next().is_none() => return Ok((HeightUnit::Metres, 1.0)),
        None if heights().all(|z| (0.0..=1.0).contains(&z.value)) => {
            (HeightUnit::Normalised, "0 to 1 of the style's range, because all lie between 0 and 1")
        }
        None => (HeightUnit::Metres, "metres, because some lie outside 0 to 1"),
    };
    notes.say(format!("The file states no height unit; its heights are taken as {why}."));
    Ok((unit, 1.0))
}

/// The vertices of `line` at their places on the raster, and which of them have a height that the file gives.
///
/// A missing height is refused, interpolated or left at 0 as `missing` says.
pub(super) fn vertices(
    line: &RawLine,
    missing: MissingHeights,
    per_unit: f64,
    place: impl Fn(f64, f64) -> (f64, f64),
) -> Result<(Vec<Vertex>, Vec<bool>)> {
    let heights: Vec<Option<f64>> = line
        .points
        .iter()
        .map(|p| p.z.map(|z| if z.in_metres { z.value } else { z.value * per_unit }))
        .collect();
    let given: Vec<bool> = heights.iter().map(Option::is_some).collect();
    if let Some(i) = given.iter().position(|given| !given) {
        let without_any = given.iter().all(|given| !given);
        let refused = match missing {
            MissingHeights::Refuse => true,
            MissingHeights::Interpolate => without_any,
            MissingHeights::Leave => false,
        };
        if refused {
            let allowed = if without_any {
                "allowed: [x, y, z], or the height of the whole line as property `z`"
            } else {
                "allowed: [x, y, z], or missing heights interpolated along the line by option"
            };
            let name = format!("height of {}, vertex {}", line.name, i + 1);
            return Err(Error::value(name, "missing", allowed));
        }
    }
    let placed: Vec<(f64, f64)> = line.points.iter().map(|p| place(p.x, p.y)).collect();
    if let Some(i) = placed.iter().position(|(x, y)| !(x.is_finite() && y.is_finite())) {
        return Err(Error::value(
            format!("position of {}, vertex {}", line.name, i + 1),
            format!("({}, {})", line.points[i].x, line.points[i].y),
            "allowed: coordinates that the map's georeference can place",
        ));
    }
    let filled = match missing {
        MissingHeights::Leave => heights.iter().map(|z| z.unwrap_or(0.0)).collect(),
        _ => interpolated(&placed, &heights),
    };
    let vertices = placed.into_iter().zip(filled).map(|((x, y), z)| Vertex { x, y, z }).collect();
    Ok((vertices, given))
}

/// Fills the gaps between given heights linearly by the length along the line; beyond the first and the last given
/// height the line is level. At least one is given.
fn interpolated(points: &[(f64, f64)], heights: &[Option<f64>]) -> Vec<f64> {
    let mut along = vec![0.0];
    for w in points.windows(2) {
        along.push(along[along.len() - 1] + (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1));
    }
    let known: Vec<(usize, f64)> = heights.iter().enumerate().filter_map(|(i, z)| Some((i, (*z)?))).collect();
    let at = |i: usize| {
        let after = known.partition_point(|&(j, _)| j < i);
        match (after.checked_sub(1).map(|b| known[b]), known.get(after)) {
            (_, Some(&(j, z))) if j == i => z,
            (Some((a, from)), Some(&(b, to))) => {
                let share = (along[i] - along[a]) / (along[b] - along[a]);
                // Not a number when the whole gap has no length, or a length beyond all numbers.
                from + (to - from) * if share.is_finite() { share } else { 0.0 }
            }
            (Some((_, z)), None) | (None, Some(&(_, z))) => z,
            (None, None) => unreachable!("a line without any height was refused"),
        }
    };
    (0..points.len()).map(at).collect()
}

/// Names lines whose heights are 0 where those of the others are not: drawing programs write that when nobody gave one.
/// Normalised heights may well be 0.
pub(super) fn name_zeros(unit: HeightUnit, lines: &[RawLine], notes: &mut Notes) {
    let given = |line: &RawLine| line.points.iter().filter_map(|p| p.z).map(|z| z.value).collect::<Vec<_>>();
    let all: Vec<Vec<f64>> = lines.iter().map(given).collect();
    let mut heights = all.iter().flatten();
    if heights.clone().next().is_some() && heights.all(|z| *z == 0.0) {
        notes.say("Every height of the sketch is 0: drawing tools write that when none was given.");
        return;
    }
    if unit == HeightUnit::Normalised {
        return;
    }
    for (line, heights) in lines.iter().zip(&all) {
        let others = || heights.iter().copied().filter(|z| *z != 0.0);
        let (zeros, count) = (heights.len() - others().count(), heights.len());
        if zeros == 0 {
            continue;
        }
        if zeros == count {
            let what = "with the height 0 from end to end, which drawing tools write when none was given: kept as 0 m; \
                        write null, or leave z out, where it is not known";
            notes.line(what, &line.name);
            continue;
        }
        let (low, high) = others().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
        // Farther from all other heights than these are from each other.
        if (low > 0.0 && low > high - low) || (high < 0.0 && -high > high - low) {
            let what = "with single vertices at height 0 far from all others, which drawing tools write for added \
                        vertices: kept as 0 m; write null, or leave z out, where it is not known";
            notes.line(what, &line.name);
        }
    }
}
