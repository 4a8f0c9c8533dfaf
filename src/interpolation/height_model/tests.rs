use super::network::{CROSSES, Network};
use super::*;
use crate::dem::{CellSize, Dem, Normalization, bundled};
use crate::grid::{Cell, Grid, Window};
use crate::sketch::{Sketch, Stroke, StrokeKind, Vertex};
use proptest::prelude::*;
use std::sync::OnceLock;

/// The model of a window of sierra.
fn sierra() -> &'static HeightModel {
    static MODEL: OnceLock<HeightModel> = OnceLock::new();
    MODEL.get_or_init(|| {
        let dem = bundled::load("sierra").unwrap();
        HeightModel::fit(&dem.crop(Window::square(Cell::new(128, 128), 192)).unwrap()).unwrap()
    })
}

/// A stroke through (x, y), open where no height stands.
type Drawn<'a> = (StrokeKind, &'a [Place]);
/// (x, y, height).
type Place = (f64, f64, Option<f64>);

fn drawn(strokes: &[Drawn<'_>]) -> (Sketch, Vec<Vec<bool>>) {
    let stroke = |(kind, points): &Drawn<'_>| Stroke {
        kind: *kind,
        vertices: points.iter().map(|&(x, y, z)| Vertex { x, y, z: z.unwrap_or(0.0) }).collect(),
    };
    let given = strokes.iter().map(|(_, points)| points.iter().map(|p| p.2.is_some()).collect()).collect();
    (Sketch::new(128, 128, strokes.iter().map(stroke).collect()).unwrap(), given)
}

fn filled(strokes: &[Drawn<'_>]) -> Filled {
    let (sketch, given) = drawn(strokes);
    sierra().fill(&sketch, &given).unwrap()
}

fn heights(stroke: &Stroke) -> Vec<f64> {
    stroke.vertices.iter().map(|v| v.z).collect()
}

fn falls(heights: &[f64]) -> bool {
    heights.windows(2).all(|w| w[1] < w[0])
}

use StrokeKind::{Ridge, Valley};
const RIVER: &[(f64, f64, Option<f64>)] = &[(64.0, 10.0, None), (70.0, 60.0, None), (64.0, 127.0, None)];

#[test]
fn the_figures_are_those_of_mountains() {
    let m = sierra();
    assert!((0.05..0.6).contains(&m.concavity), "{m:?}");
    assert!(m.slope_spread > 0.1 && m.ridge_step > 0.0 && m.densities.len() >= 4, "{m:?}");
    for d in &m.densities {
        assert!(d.ridges[0] > d.valleys[0] && d.relief > 0.0 && (0.0..=1.5).contains(&d.exponent), "{d:?}");
    }
    assert!(m.densities.windows(2).all(|w| w[0].spacing < w[1].spacing), "{:?}", m.densities);
    let text = serde_json::to_string(m).unwrap();
    assert_eq!(&serde_json::from_str::<HeightModel>(&text).unwrap(), m);
    // Twice the range, from another level.
    let (from, to) = (Normalization::new(1000.0, 2000.0).unwrap(), Normalization::new(0.0, 2000.0).unwrap());
    let twice = m.in_range(from, to);
    assert_eq!((twice.valley_slope, twice.ridge_step), (2.0 * m.valley_slope, 2.0 * m.ridge_step));
    assert_eq!(twice.densities[0].ridges[0], 2.0 * (m.densities[0].ridges[0] - 1000.0));
    for level in [0.0, 7.0] {
        let flat = Dem::new(Grid::filled(96, 96, level), CellSize::square(1.0).unwrap()).unwrap();
        assert!(HeightModel::fit(&flat).unwrap_err().to_string().contains("96x96 cells without"));
    }
}

#[test]
fn a_valley_falls_to_the_frame() {
    let one = filled(&[(Valley, RIVER)]);
    let z = heights(&one.sketch.strokes[0]);
    assert!(falls(&z), "{z:?}");
    assert_eq!((one.without, one.partly, one.assumed_outlets.as_slice()), (1, 0, &[0][..]));
    let slope = (z[0] - z[z.len() - 1]) / 117.0;
    assert!(slope > 0.2 * sierra().slope(8000.0) && slope < sierra().slope(30.0), "{slope} m a cell");
    // Drawn the other way round it is the same river.
    let back: Vec<_> = RIVER.iter().rev().copied().collect();
    let other = heights(&filled(&[(Valley, &back)]).sketch.strokes[0]);
    assert!(falls(&other.iter().rev().copied().collect::<Vec<_>>()), "{other:?}");
    // Two ends at the frame: where it was drawn to.
    let through = filled(&[(Valley, &[(0.0, 64.0, None), (127.0, 60.0, None)])]);
    assert!(falls(&heights(&through.sketch.strokes[0])));
    let through = filled(&[(Valley, &[(127.0, 60.0, None), (0.0, 64.0, None)])]);
    assert!(falls(&heights(&through.sketch.strokes[0])));
    // Given heights tell, whatever lies nearer.
    let up = [(64.0, 10.0, Some(1500.0)), (70.0, 60.0, None), (64.0, 120.0, Some(1900.0))];
    let told = filled(&[(Valley, &up)]);
    assert!(told.assumed_outlets.is_empty());
    assert!(falls(&heights(&told.sketch.strokes[0]).into_iter().rev().collect::<Vec<_>>()), "{told:?}");
}

#[test]
fn tributaries_join_their_river() {
    // The tributary's end misses the river by three cells, as hands do.
    let tributary = [(20.0, 20.0, None), (66.0, 57.0, None)];
    let both = filled(&[(Valley, RIVER), (Valley, &tributary)]);
    let (river, side) = (&both.sketch.strokes[0], &both.sketch.strokes[1]);
    assert!(falls(&heights(river)) && falls(&heights(side)));
    let mouth = side.vertices.last().unwrap();
    let near = |a: &Vertex, b: &Vertex| (a.x - b.x).hypot(a.y - b.y);
    let met = river.vertices.iter().min_by(|a, b| near(a, mouth).total_cmp(&near(b, mouth))).unwrap();
    assert!(mouth.z > met.z && mouth.z - met.z < 10.0 * sierra().slope(30.0), "{} above {}", mouth.z, met.z);
    assert_eq!(both.assumed_outlets, [0], "one outlet for both");
}

#[test]
fn ridges_stand_above_valleys_and_crossings_agree() {
    let crest = [(20.0, 30.0, None), (30.0, 100.0, None)];
    let across = [(20.0, 80.0, None), (120.0, 84.0, None)];
    let all = filled(&[(Valley, RIVER), (Ridge, &crest), (Ridge, &across)]);
    let lines = all.sketch.rasterize();
    let river = &all.sketch.strokes[0];
    for v in &all.sketch.strokes[1].vertices {
        let beside =
            river.vertices.iter().min_by(|a, b| (a.y - v.y).abs().total_cmp(&(b.y - v.y).abs())).unwrap();
        assert!(v.z > beside.z + 30.0, "{} beside {}", v.z, beside.z);
    }
    let apart = |a: &Vertex, b: &Vertex| (a.x - b.x).hypot(a.y - b.y);
    let (ridge, valley) = all.sketch.strokes[2]
        .vertices
        .iter()
        .flat_map(|r| river.vertices.iter().map(move |v| (r, v)))
        .min_by(|(a, b), (c, d)| apart(a, b).total_cmp(&apart(c, d)))
        .unwrap();
    assert!(apart(ridge, valley) <= CROSSES && ridge.z == valley.z, "{ridge:?} and {valley:?}");
    let ends = &all.sketch.strokes[2].vertices;
    assert!(
        ends[0].z > ridge.z + 30.0 && ends[ends.len() - 1].z > ridge.z + 30.0,
        "a gorge through the ridge"
    );
    assert_eq!(
        lines.line_count(),
        drawn(&[(Valley, RIVER), (Ridge, &crest), (Ridge, &across)]).0.rasterize().line_count()
    );
    // Two ridges that cross are as high there.
    let cross = filled(&[
        (Ridge, &[(20.0, 60.0, Some(2500.0)), (100.0, 60.0, Some(2500.0))]),
        (Ridge, &[(60.0, 20.0, None), (60.0, 100.0, None)]),
    ]);
    let middle = cross.sketch.strokes[1].vertices.iter().find(|v| (v.y - 60.0).abs() < 1.0).unwrap();
    assert!((middle.z - 2500.0).abs() < 5.0, "{middle:?}");
}

#[test]
fn rings_and_single_strokes_have_heights() {
    let ring: Vec<_> = (0..=24)
        .map(|i| f64::from(i) / 24.0 * std::f64::consts::TAU)
        .map(|a| (64.0 + 40.0 * a.cos(), 64.0 + 40.0 * a.sin(), None))
        .collect();
    let volcano = filled(&[(Valley, &ring), (Ridge, &[(50.0, 64.0, None), (78.0, 64.0, None)])]);
    let (moat, top) = (heights(&volcano.sketch.strokes[0]), heights(&volcano.sketch.strokes[1]));
    let highest = moat.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(top.iter().all(|z| *z > highest), "{top:?} above {highest}");
    assert_eq!(moat[0], moat[moat.len() - 1], "the ring closes");
    let [low, high] = [sierra().densities[0].valleys, sierra().densities[0].ridges].map(|d| d[0]);
    for strokes in [
        vec![(Ridge, &[(20.0, 64.0, None), (100.0, 60.0, None)][..])],
        vec![(Ridge, &[(20.0, 64.0, None)][..])],
        vec![(Valley, &[(20.0, 64.0, None)][..])],
        vec![(Ridge, &ring[..]), (Ridge, &[(10.0, 10.0, None), (50.0, 12.0, None)][..])],
    ] {
        let alone = filled(&strokes);
        let spare = high - low;
        for z in alone.sketch.strokes.iter().flat_map(heights) {
            assert!((low - 2.0 * spare..high + 2.0 * spare).contains(&z), "{z}");
        }
    }
}

#[test]
fn given_heights_stay_and_contradictions_are_named() {
    let whole = [(Ridge, &[(5.25, 7.5, Some(2000.1)), (90.0, 20.0, Some(2100.7))][..])];
    let (sketch, given) = drawn(&whole);
    assert_eq!(sierra().fill(&sketch, &given).unwrap().sketch, sketch, "nothing to fill");
    // Low, high, low, high downstream.
    let rising = [
        (64.0, 10.0, Some(1800.0)),
        (64.0, 40.0, Some(1500.3)),
        (64.0, 60.0, None),
        (64.0, 80.0, Some(1700.9)),
        (64.0, 127.0, Some(1400.2)),
    ];
    let kept = filled(&[(Valley, &rising), (Ridge, &[(10.0, 10.0, Some(100.0)), (20.0, 100.0, None)])]);
    assert_eq!((kept.rising.as_slice(), kept.without, kept.partly), (&[0][..], 0, 2));
    for (stroke, points) in kept.sketch.strokes.iter().zip([&rising[..], &[(10.0, 10.0, Some(100.0))]]) {
        for &(x, y, z) in points {
            let v = stroke.vertices.iter().find(|v| (v.x, v.y) == (x, y)).unwrap();
            assert!(z.is_none_or(|z| z == v.z), "{v:?}");
        }
    }
    let between = kept.sketch.strokes[0].vertices.iter().filter(|v| v.y > 40.0 && v.y < 80.0);
    assert!(
        between.clone().count() >= 15 && between.clone().all(|v| (1500.3..=1700.9).contains(&v.z)),
        "{kept:?}"
    );
    let bad = sierra().fill(&sketch, &[]).unwrap_err().to_string();
    assert!(bad.contains("given heights"), "{bad}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn any_drawing_gets_heights_and_open_valleys_fall(
        strokes in prop::collection::vec(
            (any::<bool>(), prop::collection::vec((-40.0_f64..180.0, -40.0_f64..180.0, any::<bool>(), 1000.0_f64..3000.0), 1..6)),
            1..7,
        ),
        far in any::<bool>(),
    ) {
        let mut points: Vec<(StrokeKind, Vec<Place>)> = strokes
            .iter()
            .map(|(ridge, p)| (if *ridge { Ridge } else { Valley }, p.iter().map(|&(x, y, g, z)| (x, y, g.then_some(z))).collect()))
            .collect();
        if far {
            points[0].1.push((1e300, -1e300, None));
        }
        let plain: Vec<Drawn<'_>> = points.iter().map(|(k, p)| (*k, p.as_slice())).collect();
        let (sketch, given) = drawn(&plain);
        let once = sierra().fill(&sketch, &given).unwrap();
        prop_assert_eq!(&once, &sierra().fill(&sketch, &given).unwrap());
        prop_assert!(once.sketch.validate().is_ok());
        for ((old, given), new) in sketch.strokes.iter().zip(&given).zip(&once.sketch.strokes) {
            // The old vertices in their order, given ones to the bit.
            let mut rest = new.vertices.iter();
            for (v, given) in old.vertices.iter().zip(given) {
                let found = rest.find(|w| (w.x, w.y) == (v.x, v.y) && (!*given || w.z == v.z));
                prop_assert!(found.is_some(), "{v:?}");
            }
        }
        // Without a given height every valley falls all the way.
        let open: Vec<Vec<bool>> = given.iter().map(|g| vec![false; g.len()]).collect();
        let all = sierra().fill(&sketch, &open).unwrap();
        prop_assert!(all.rising.is_empty());
        let network = Network::of(&all.sketch, &all.sketch.strokes.iter().map(|s| vec![true; s.vertices.len()]).collect::<Vec<_>>());
        prop_assert_eq!(network.points.iter().filter(|p| p.given.is_none()).count(), 0);
        // Heights of mountains, not of the sums of their parts.
        for z in all.sketch.strokes.iter().flat_map(heights) {
            prop_assert!((-5e4..5e4).contains(&z), "{z}");
        }
    }
}
