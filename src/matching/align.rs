//! Gives each drawn part the exemplar part that it resembles (Liu & Benes 2025, 5.3, Algorithms A1 and A2).
//!
//! Drawn parts x exemplar parts, heights in the unit interval -> one [`PartMatch`] a drawn part. Every part is walked
//! from low to high; the drawn one is turned so that the directions from first to last cell agree as nearly as the
//! allowed angles permit; the longest runs of equal steps go on; among them height decides.
//!
//! Departures: where the longest run occurs at several places the one with the smallest height difference counts, not
//! the first; parts without any common step (a single drawn point) compare by mean height. The text's "mean and
//! variance" of heights appears nowhere in the algorithm; the mean absolute difference on the common cells is taken.
//! Cost: drawn x exemplar x 5-10 cells in bit-parallel words, on all threads.

use super::config::{Choice, MatchConfig, RotationStep};
use super::substring::{LONGEST, Positions, occurrences};
use crate::error::{Error, Result};
use crate::seed::Seed;
use crate::sketch::{PartId, SketchPart, StrokeKind};
use rand::RngExt;
use rayon::prelude::*;

/// The exemplar part that a drawn part was given.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct PartMatch {
    /// Index in the exemplar's list of parts.
    pub(crate) part: PartId,
    /// Length of the common shape, in steps (one fewer than cells).
    pub(crate) common_length: usize,
    /// Mean absolute height difference on the common cells, in the unit of the heights given.
    pub(crate) height_difference: f32,
    /// Eighth turns counter-clockwise, 0 to 7, that take the drawn part to the direction of the exemplar part.
    pub(crate) rotation: u8,
}

/// Finds an exemplar part for every drawn part; the answer is in the order of `drawn`.
///
/// Heights of both are compared as they are: give both in the unit interval of their own map, as the paper does. The
/// choice among the finalists comes from a stream of its own for each drawn part.
///
/// # Errors
/// When the configuration or a part is not valid, a part has more than 65 cells, or there is something to match and the
/// exemplar has no part (of the same kind, where the configuration asks for that).
pub(crate) fn align(
    drawn: &[SketchPart],
    exemplar: &[SketchPart],
    config: &MatchConfig,
    seed: Seed,
) -> Result<Vec<PartMatch>> {
    config.validate()?;
    let exemplar = shapes(exemplar, "exemplar")?;
    let drawn = shapes(drawn, "drawn")?;
    for kind in [StrokeKind::Ridge, StrokeKind::Valley] {
        let fits = |s: &Shape| !config.same_kind || s.kind == kind;
        if drawn.iter().any(|s| s.kind == kind) && !exemplar.iter().any(fits) {
            return Err(Error::value(
                format!("number of exemplar parts that a drawn {kind:?} part may match"),
                0,
                "an exemplar with lines of that kind is needed, or match.same_kind = false",
            ));
        }
    }
    let choice = |(i, shape): (usize, &Shape)| {
        let finalists = finalists(shape, &exemplar, config);
        let chosen = match config.choice {
            Choice::Closest => 0,
            Choice::Random => {
                seed.derive_indexed("alignment", i).stream("choice").random_range(0..finalists.len())
            }
        };
        finalists[chosen]
    };
    Ok(drawn.par_iter().enumerate().map(choice).collect())
}

/// The best matches by height, best first; at least one, because the caller has made sure of candidates.
fn finalists(drawn: &Shape, exemplar: &[Shape], config: &MatchConfig) -> Vec<PartMatch> {
    // The longest common shapes so far, longest first, among equals the one with the lower index.
    let mut longest: Vec<(usize, usize, u8)> = Vec::with_capacity(config.candidates + 1);
    let mut working_space = Vec::new();
    for (id, other) in exemplar.iter().enumerate() {
        if config.same_kind && other.kind != drawn.kind {
            continue;
        }
        let turn = turn_between(drawn, other, config.rotation);
        let length = other.positions.common_length(&drawn.codes, turn, &mut working_space);
        if longest.len() < config.candidates || longest.last().is_some_and(|worst| length > worst.0) {
            let place = longest.partition_point(|better| better.0 >= length);
            longest.insert(place, (length, id, turn));
            longest.truncate(config.candidates);
        }
    }
    let mut matches: Vec<PartMatch> = longest
        .into_iter()
        .map(|(length, id, turn)| PartMatch {
            part: PartId(id as u32),
            common_length: length,
            height_difference: height_difference(drawn, &exemplar[id], turn, length),
            rotation: turn,
        })
        .collect();
    // Stable: among equal differences the longer shape, then the lower index, stays first.
    matches.sort_by(|a, b| a.height_difference.total_cmp(&b.height_difference));
    matches.truncate(config.finalists);
    matches
}

/// A part, walked from low to high, in the form in which it is compared.
struct Shape {
    kind: StrokeKind,
    codes: Vec<u8>,
    positions: Positions,
    heights: Vec<f32>,
    /// From the first to the last cell, (east, north).
    direction: (i64, i64),
}

fn shapes(parts: &[SketchPart], whose: &str) -> Result<Vec<Shape>> {
    let shape = |(i, part): (usize, &SketchPart)| {
        let named = |e: Error| match e {
            Error::Value { name, value, allowed } => {
                Error::Value { name: format!("{whose} part {i}: {name}"), value, allowed }
            }
            other => other,
        };
        part.validate().map_err(named)?;
        if part.cells.len() > LONGEST + 1 {
            return Err(Error::value(
                format!("number of cells of {whose} part {i}"),
                part.cells.len(),
                format!("allowed: at most {}", LONGEST + 1),
            ));
        }
        let part = part.rising();
        let (first, last) = (part.cells[0], part.cells[part.cells.len() - 1]);
        let direction = (last.col as i64 - first.col as i64, first.row as i64 - last.row as i64);
        let codes = part.codes();
        Ok(Shape {
            kind: part.kind,
            positions: Positions::of(&codes),
            codes,
            heights: part.heights,
            direction,
        })
    };
    parts.iter().enumerate().map(shape).collect()
}

/// Eighth turns, 0 to 7, from the direction of `a` to that of `b`, rounded to the allowed angles (Algorithm A1, lines
/// 8 to 11). A part of one cell has no direction and is not turned.
fn turn_between(a: &Shape, b: &Shape, step: RotationStep) -> u8 {
    let ((ax, ay), (bx, by)) = (a.direction, b.direction);
    // conj(a) b, whose angle is the one between: whole numbers, so that turned copies of both give the same answer, and
    // comparisons instead of an arc tangent, because this runs for every pair of parts.
    let (along, across) = (ax * bx + ay * by, ax * by - ay * bx);
    match step {
        RotationStep::EighthTurn => {
            const TAN_OF_SIXTEENTH_TURN: f64 = std::f64::consts::SQRT_2 - 1.0; // irrational: no pair is half-way
            let (x, y) = (along.abs() as f64, across.abs() as f64);
            if y <= TAN_OF_SIXTEENTH_TURN * x {
                if along >= 0 { 0 } else { 4 }
            } else if x <= TAN_OF_SIXTEENTH_TURN * y {
                if across > 0 { 2 } else { 6 }
            } else {
                match (along > 0, across > 0) {
                    (true, true) => 1,
                    (false, true) => 3,
                    (false, false) => 5,
                    (true, false) => 7,
                }
            }
        }
        // Exactly half-way goes counter-clockwise.
        RotationStep::QuarterTurn if -along <= across && across < along => 0,
        RotationStep::QuarterTurn if -across < along && along <= across => 2,
        RotationStep::QuarterTurn if along < across && across <= -along => 4,
        RotationStep::QuarterTurn if along == 0 && across == 0 => 0,
        RotationStep::QuarterTurn => 6,
    }
}

fn height_difference(a: &Shape, b: &Shape, turn: u8, length: usize) -> f32 {
    let mean = |values: &[f32]| values.iter().copied().map(f64::from).sum::<f64>() / values.len() as f64;
    if length == 0 {
        return (mean(&a.heights) - mean(&b.heights)).abs() as f32;
    }
    let cells = length + 1;
    let difference = |(i, j): (usize, usize)| {
        let pairs = a.heights[i..i + cells].iter().zip(&b.heights[j..j + cells]);
        pairs.map(|(&p, &q)| (f64::from(p) - f64::from(q)).abs()).sum::<f64>() / cells as f64
    };
    occurrences(&a.codes, turn, &b.codes, length).map(difference).fold(f64::INFINITY, f64::min) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::{Cell, d8};
    use proptest::prelude::*;

    /// A part that starts in the middle of a large map, takes the given steps and rises by `slope` a cell.
    fn part(kind: StrokeKind, codes: &[u8], base: f32, slope: f32) -> SketchPart {
        let mut cells = vec![Cell::new(500, 500)];
        for &code in codes {
            cells.push(d8::neighbour(cells[cells.len() - 1], code % 8, 1000, 1000).unwrap());
        }
        let heights = (0..cells.len()).map(|i| base + slope * i as f32).collect();
        SketchPart { kind, cells, heights }
    }

    fn ridge(codes: &[u8], base: f32) -> SketchPart {
        part(StrokeKind::Ridge, codes, base, 0.01)
    }

    fn turned(codes: &[u8], eighths: u8) -> Vec<u8> {
        codes.iter().map(|c| (c + eighths) % 8).collect()
    }

    fn closest() -> MatchConfig {
        MatchConfig { choice: Choice::Closest, ..MatchConfig::default() }
    }

    const BEND: [u8; 7] = [0, 0, 1, 0, 0, 7, 0];
    const WAVE: [u8; 7] = [0, 1, 0, 1, 7, 0, 7];
    const HOOK: [u8; 7] = [0, 0, 0, 1, 1, 2, 2];

    #[test]
    fn a_copy_turned_by_any_eighth_is_found_whole() {
        for eighths in 0..8 {
            let exemplar =
                [ridge(&turned(&WAVE, eighths), 0.2), ridge(&turned(&BEND, eighths), 0.2), ridge(&HOOK, 0.2)];
            let config = MatchConfig { candidates: 1, finalists: 1, ..closest() };
            let found = align(&[ridge(&BEND, 0.2)], &exemplar, &config, Seed(1)).unwrap()[0];
            assert_eq!((found.part, found.common_length, found.rotation), (PartId(1), 7, eighths));
            assert_eq!(found.height_difference, 0.0);
        }
    }

    #[test]
    fn quarter_turns_find_only_copies_turned_by_quarters() {
        let config = MatchConfig { rotation: RotationStep::QuarterTurn, ..closest() };
        for eighths in 0..8 {
            let exemplar = [ridge(&turned(&BEND, eighths), 0.2)];
            let found = align(&[ridge(&BEND, 0.2)], &exemplar, &config, Seed(1)).unwrap()[0];
            assert_eq!(found.rotation % 2, 0);
            assert_eq!(found.common_length == 7, eighths % 2 == 0, "turned by {eighths} eighths");
        }
    }

    #[test]
    fn a_part_drawn_from_high_to_low_is_the_same_part() {
        let mut reversed = ridge(&BEND, 0.2);
        reversed.cells.reverse();
        reversed.heights.reverse();
        let exemplar = [ridge(&HOOK, 0.2), ridge(&BEND, 0.2), ridge(&WAVE, 0.2)];
        let one = align(&[ridge(&BEND, 0.2)], &exemplar, &closest(), Seed(1)).unwrap();
        assert_eq!(one, align(&[reversed], &exemplar, &closest(), Seed(1)).unwrap());
        assert_eq!(one[0].part, PartId(1));
    }

    #[test]
    fn among_equal_shapes_height_decides() {
        let exemplar = [ridge(&BEND, 0.6), ridge(&BEND, 0.3), ridge(&BEND, 0.1)];
        let found = align(&[ridge(&BEND, 0.25)], &exemplar, &closest(), Seed(1)).unwrap()[0];
        assert_eq!(found.part, PartId(1));
        assert!((found.height_difference - 0.05).abs() < 1e-6);
    }

    #[test]
    fn the_best_place_of_a_repeated_run_counts() {
        // A straight drawn part of 3 steps at heights that a longer straight part passes near its upper end.
        let exemplar = [part(StrokeKind::Ridge, &[0; 9], 0.0, 0.1)];
        let drawn = [part(StrokeKind::Ridge, &[0; 3], 0.5, 0.1)];
        let found = align(&drawn, &exemplar, &closest(), Seed(1)).unwrap()[0];
        assert_eq!(found.common_length, 3);
        assert!(found.height_difference < 1e-6, "{}", found.height_difference);
    }

    #[test]
    fn kinds_match_their_own_unless_allowed() {
        let exemplar = [ridge(&BEND, 0.2), part(StrokeKind::Valley, &HOOK, 0.2, 0.01)];
        let drawn = [part(StrokeKind::Valley, &BEND, 0.2, 0.01)];
        let own = align(&drawn, &exemplar, &closest(), Seed(1)).unwrap()[0];
        assert_eq!(own.part, PartId(1));
        let config = MatchConfig { same_kind: false, candidates: 1, finalists: 1, ..closest() };
        assert_eq!(align(&drawn, &exemplar, &config, Seed(1)).unwrap()[0].part, PartId(0));
        let refused = align(&drawn, &exemplar[..1], &closest(), Seed(1)).unwrap_err().to_string();
        assert!(refused.contains("Valley") && refused.contains("same_kind"), "{refused}");
    }

    #[test]
    fn shape_picks_the_candidates_before_height() {
        // Ten whole copies far too high, and an eleventh part of another shape at exactly the right height.
        let mut exemplar = vec![ridge(&HOOK, 0.2)];
        exemplar.extend((0..10).map(|i| ridge(&BEND, 0.5 + 0.01 * i as f32)));
        let found = align(&[ridge(&BEND, 0.2)], &exemplar, &closest(), Seed(1)).unwrap()[0];
        assert_eq!(found.part, PartId(1));
    }

    #[test]
    fn only_finalists_are_chosen_and_each_by_some_seed() {
        let exemplar: Vec<_> = (0..12).map(|i| ridge(&BEND, 0.9 - 0.05 * i as f32)).collect();
        let mut seen = [0; 12];
        for seed in 0..200 {
            let found =
                align(&[ridge(&BEND, 0.2)], &exemplar, &MatchConfig::default(), Seed(seed)).unwrap()[0];
            seen[found.part.0 as usize] += 1;
        }
        // Candidates are the ten first of twelve equal shapes; the five lowest of those are the closest in height.
        assert!(seen[5..10].iter().all(|&n| n > 15), "{seen:?}");
        assert_eq!(seen[5..10].iter().sum::<i32>(), 200);
    }

    #[test]
    fn a_single_point_matches_by_height() {
        let exemplar = [ridge(&BEND, 0.8), ridge(&BEND, 0.2)];
        let found = align(&[ridge(&[], 0.3)], &exemplar, &closest(), Seed(1)).unwrap()[0];
        assert_eq!((found.part, found.common_length, found.rotation), (PartId(1), 0, 0));
    }

    #[test]
    fn nothing_drawn_is_no_error_and_bad_parts_are() {
        let good = [ridge(&BEND, 0.2)];
        assert!(align(&[], &[], &closest(), Seed(1)).unwrap().is_empty());
        assert!(align(&good, &[], &closest(), Seed(1)).is_err());
        let mut bad = good[0].clone();
        bad.cells[2] = Cell::new(0, 0);
        let message = align(&good, &[bad], &closest(), Seed(1)).unwrap_err().to_string();
        assert!(message.contains("exemplar part 0") && message.contains("neighbour"), "{message}");
        let mut bad = good[0].clone();
        bad.heights.pop();
        assert!(align(&[bad], &good, &closest(), Seed(1)).unwrap_err().to_string().contains("7 heights"));
        let long = ridge(&[0; 65], 0.0);
        assert!(align(&[long], &good, &closest(), Seed(1)).unwrap_err().to_string().contains("66"));
        let config = MatchConfig { finalists: 11, ..closest() };
        assert!(align(&good, &good, &config, Seed(1)).unwrap_err().to_string().contains("finalists is 11"));
    }

    #[test]
    fn the_configuration_refuses_unknown_keys() {
        let config: MatchConfig =
            toml::from_str("rotation = \"quarter-turn\"\nchoice = \"closest\"").unwrap();
        assert_eq!(config, MatchConfig { rotation: RotationStep::QuarterTurn, ..closest() });
        assert!(toml::from_str::<MatchConfig>("rotations = 3").is_err());
    }

    #[test]
    fn turns_round_to_the_nearest_allowed_angle() {
        let towards = |x: i64, y: i64| Shape {
            kind: StrokeKind::Ridge,
            codes: Vec::new(),
            positions: Positions::of(&[]),
            heights: vec![0.0],
            direction: (x, y),
        };
        for x in -9_i64..=9 {
            for y in -9_i64..=9 {
                let eighths = (y as f64).atan2(x as f64) / std::f64::consts::FRAC_PI_4;
                let expected = |step: f64| ((eighths / step + 0.5).floor() * step) as i64;
                for (rotation, step) in [(RotationStep::EighthTurn, 1.0), (RotationStep::QuarterTurn, 2.0)] {
                    let turn = turn_between(&towards(3, 3), &towards(3 * (x - y), 3 * (x + y)), rotation);
                    assert_eq!(i64::from(turn), expected(step).rem_euclid(8), "{x} {y} {rotation:?}");
                }
            }
        }
    }

    fn any_parts(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<SketchPart>> {
        let one =
            (prop::collection::vec(0_i8..3, 4..10), 0_u8..8, any::<bool>(), 0.0_f32..1.0, -0.1_f32..0.1);
        let one = one.prop_map(|(bends, start, valley, base, slope)| {
            let codes: Vec<u8> = bends.iter().map(|b| (start as i8 + b - 1).rem_euclid(8) as u8).collect();
            part(if valley { StrokeKind::Valley } else { StrokeKind::Ridge }, &codes, base, slope)
        });
        prop::collection::vec(one, count)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn turning_the_drawing_by_quarters_changes_only_the_rotation(
            drawn in any_parts(1..8), exemplar in any_parts(1..40), quarters in 1_u8..4,
        ) {
            let config = MatchConfig { same_kind: false, ..MatchConfig::default() };
            let quarter = |c: &Cell| Cell::new(1000 - c.col, c.row); // counter-clockwise
            let mut turned = drawn.clone();
            for _ in 0..quarters {
                turned.iter_mut().for_each(|p| p.cells = p.cells.iter().map(quarter).collect());
            }
            let before = align(&drawn, &exemplar, &config, Seed(9)).unwrap();
            let after = align(&turned, &exemplar, &config, Seed(9)).unwrap();
            for ((a, b), p) in before.iter().zip(&after).zip(&drawn) {
                let expected = if p.cells.len() > 1 { (a.rotation + 8 - 2 * quarters) % 8 } else { a.rotation };
                prop_assert_eq!(*b, PartMatch { rotation: expected, ..*a });
            }
        }

        #[test]
        fn the_number_of_threads_does_not_matter(drawn in any_parts(1..30), exemplar in any_parts(1..30)) {
            let config = MatchConfig { same_kind: false, ..MatchConfig::default() };
            let on = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| align(&drawn, &exemplar, &config, Seed(4)).unwrap())
            };
            prop_assert_eq!(on(1), on(3));
        }
    }

    #[test]
    #[ignore = "a timing to read: cargo test --release --lib matching -- --ignored --nocapture"]
    fn timing_of_500_parts_against_500() {
        use rand::RngExt;
        let mut stream = Seed(1).stream("timing");
        let mut many = || -> Vec<_> {
            let codes = |s: &mut crate::seed::Stream| -> Vec<u8> {
                let start = s.random_range(0..8);
                (0..s.random_range(4..10)).map(|_| (start + s.random_range(0..3)) % 8).collect()
            };
            (0..500)
                .map(|_| {
                    let c = codes(&mut stream);
                    ridge(&c, stream.random_range(0.0..1.0))
                })
                .collect()
        };
        let (drawn, exemplar) = (many(), many());
        let seconds = || {
            let start = std::time::Instant::now();
            align(&drawn, &exemplar, &MatchConfig::default(), Seed(1)).unwrap();
            start.elapsed().as_secs_f64()
        };
        let best = (0..50).map(|_| seconds()).fold(f64::INFINITY, f64::min);
        eprintln!("{:.2} ms for 500 x 500, best of 50", best * 1e3);
    }
}
