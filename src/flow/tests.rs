//! What must hold for water on any terrain, terrain whose answer is known, and the numbers of another program.

use super::*;
use crate::grid::{Cell, Grid, Mask, d8 as neighbours};
use proptest::prelude::*;

fn surface(heights: &Grid<f32>) -> Surface {
    Surface::new(heights.clone(), heights.map(|_| true)).unwrap()
}

/// Small terrain with pits, flats and voids; few `levels` make many flats.
fn terrain() -> impl Strategy<Value = Surface> {
    (1usize..16, 1usize..16, 1u16..400, 0u8..60).prop_flat_map(|(rows, cols, levels, voids)| {
        let cell = (0..levels, any::<u8>());
        proptest::collection::vec(cell, rows * cols).prop_map(move |cells| {
            let valid: Mask = Grid::from_fn(rows, cols, |c| {
                let i = c.row * cols + c.col;
                i == 0 || cells[i].1 >= voids
            });
            let z = Grid::from_fn(rows, cols, |c| f32::from(cells[c.row * cols + c.col].0) - 100.0);
            Surface::new(z, valid).unwrap()
        })
    })
}

fn is_outlet(surface: &Surface, cell: Cell) -> bool {
    let (rows, cols) = surface.shape();
    (0..8).any(|code| neighbours::neighbour(cell, code, rows, cols).is_none_or(|n| !surface.valid()[n]))
}

/// The cells from `start` to its outlet.
fn path(directions: &FlowDirections, start: Cell) -> Vec<Cell> {
    let mut path = vec![start];
    while let Some(next) = directions.receiver(path[path.len() - 1]) {
        path.push(next);
        assert!(path.len() <= directions.shape().0 * directions.shape().1, "a circle");
    }
    path
}

/// The lowest height of the highest cell over all paths to an outlet, by relaxation until nothing changes.
fn spill_heights(surface: &Surface) -> Grid<f32> {
    let (rows, cols) = surface.shape();
    let mut spill = surface.heights().map(|_| f32::INFINITY);
    loop {
        let mut changed = false;
        for (cell, &z) in surface.heights().cells().filter(|(c, _)| surface.valid()[*c]) {
            let around = (0..8).filter_map(|code| neighbours::neighbour(cell, code, rows, cols));
            let lowest = around.map(|n| spill[n]).fold(f32::INFINITY, f32::min);
            let new = if is_outlet(surface, cell) { z } else { z.max(lowest) };
            changed |= new < spill[cell];
            spill[cell] = spill[cell].min(new);
        }
        if !changed {
            return spill;
        }
    }
}

/// Least-cost routing again, as its definition says it, by searching the whole map for the lowest cell in reach. For
/// heights that are all different.
fn route_by_definition(surface: &Surface) -> Grid<Flow> {
    let (rows, cols) = surface.shape();
    let mut flows = Grid::filled(rows, cols, Flow::Void);
    let mut reached = Grid::filled(rows, cols, false);
    let mut flooded = Grid::filled(rows, cols, false);
    for (cell, _) in surface.valid().cells().filter(|(c, ok)| **ok && is_outlet(surface, *c)) {
        reached[cell] = true;
        flows[cell] = Flow::Out;
    }
    let height = |c: Cell| f64::from(surface.heights()[c]);
    while let Some(here) = reached
        .cells()
        .filter(|(c, r)| **r && !flooded[*c])
        .map(|(c, _)| c)
        .min_by(|a, b| height(*a).total_cmp(&height(*b)))
    {
        let mut best: Option<(f64, u8)> = None;
        for code in 0..8 {
            let Some(there) = neighbours::neighbour(here, code, rows, cols).filter(|&n| surface.valid()[n])
            else {
                continue;
            };
            if !reached[there] {
                reached[there] = true;
                flows[there] = Flow::Towards(neighbours::opposite(code));
            }
            let slope = (height(here) - height(there)) / neighbours::DISTANCES[code as usize];
            if flooded[there] && slope > 0.0 && best.is_none_or(|b| slope > b.0) {
                best = Some((slope, code));
            }
        }
        if let (Some((_, code)), Flow::Towards(_)) = (best, flows[here]) {
            flows[here] = Flow::Towards(code);
        }
        flooded[here] = true;
    }
    flows
}

proptest! {
    #[test]
    fn filling_raises_to_the_spill_height(surface in terrain()) {
        let (filled, spill) = (fill(&surface), spill_heights(&surface));
        for (cell, &z) in surface.heights().cells().filter(|(c, _)| surface.valid()[*c]) {
            prop_assert!(filled.heights()[cell] >= z);
            prop_assert_eq!(filled.heights()[cell], spill[cell]);
        }
    }

    #[test]
    fn every_cell_drains_out_over_the_lowest_pass(surface in terrain()) {
        let spill = spill_heights(&surface);
        let (steep, least_cost) = (d8(&fill(&surface)), route(&surface));
        for (cell, _) in surface.valid().cells().filter(|(_, ok)| **ok) {
            for directions in [&steep, &least_cost] {
                let path = path(directions, cell);
                let last = path[path.len() - 1];
                prop_assert!(is_outlet(&surface, last) && directions.flow(last) == Flow::Out);
                prop_assert_eq!(directions.flow(cell) == Flow::Out, is_outlet(&surface, cell));
                let highest = path.iter().map(|&c| surface.heights()[c]).fold(f32::MIN, f32::max);
                prop_assert_eq!(highest, spill[cell]);
            }
            let levels: Vec<f32> = path(&steep, cell).iter().map(|&c| spill[c]).collect();
            prop_assert!(levels.is_sorted_by(|a, b| a >= b), "the filled surface never rises downstream");
        }
    }

    #[test]
    fn all_water_leaves_and_orders_never_fall(surface in terrain(), threshold in 1u32..6, skip in 1usize..5) {
        let valid = surface.valid();
        for directions in [d8(&fill(&surface)), route(&surface)] {
            let all = accumulate(&directions);
            let sources = Grid::from_fn(valid.rows(), valid.cols(), |c| valid[c] && (c.row + c.col) % skip == 0);
            let some = accumulate_from(&directions, &sources);
            for (counts, sources) in [(&all, valid), (&some, &sources)] {
                let out = valid.cells().map(|(c, _)| c).filter(|&c| directions.flow(c) == Flow::Out);
                let drained: u32 = out.map(|c| counts.counts()[c]).sum();
                prop_assert_eq!(drained as usize, sources.as_slice().iter().filter(|s| **s).count());
            }
            let channels = all.channels(threshold);
            let orders = strahler(&directions, &channels);
            for (cell, &ok) in valid.cells() {
                let order = orders.orders()[cell];
                prop_assert_eq!(order > 0, channels[cell]);
                prop_assert_eq!(all.counts()[cell] > 0, ok);
                if let Some(next) = directions.receiver(cell) {
                    prop_assert!(order <= orders.orders()[next]);
                    prop_assert!(all.counts()[cell] < all.counts()[next]);
                }
            }
        }
    }

    #[test]
    fn routing_is_what_its_definition_says(
        rows in 1usize..14, cols in 1usize..14, voids in 0u8..40,
        order in Just((0..196u16).collect::<Vec<_>>()).prop_shuffle(), holes in proptest::collection::vec(any::<u8>(), 196),
    ) {
        let z = Grid::from_fn(rows, cols, |c| f32::from(order[c.row * 14 + c.col]));
        let valid = Grid::from_fn(rows, cols, |c| c == Cell::new(0, 0) || holes[c.row * 14 + c.col] >= voids);
        let surface = Surface::new(z, valid).unwrap();
        let expected = route_by_definition(&surface);
        let directions = route(&surface);
        for (cell, &flow) in expected.cells() {
            prop_assert_eq!(directions.flow(cell), flow, "{:?}", cell);
        }
    }

    #[test]
    fn directions_do_not_depend_on_scale_or_offset(surface in terrain(), exponent in -3i32..4, offset in -50i16..50) {
        let z = surface.heights().map(|z| z * 2f32.powi(exponent) + f32::from(offset));
        let other = Surface::new(z, surface.valid().clone()).unwrap();
        prop_assert_eq!(route(&surface), route(&other));
        prop_assert_eq!(d8(&fill(&surface)), d8(&fill(&other)));
    }
}

const BOWL: [[f32; 5]; 5] = [
    [9.0, 9.0, 9.0, 9.0, 9.0],
    [9.0, 5.0, 6.0, 7.0, 9.0],
    [9.0, 4.0, 1.0, 6.0, 9.0],
    [9.0, 3.0, 8.0, 7.0, 9.0],
    [9.0, 2.0, 9.0, 9.0, 9.0],
];

#[test]
fn five_by_five_by_hand() {
    // The pit (2, 2) lies lower than the outlet (4, 1); its water leaves over (3, 1).
    let bowl = surface(&Grid::from_fn(5, 5, |c| BOWL[c.row][c.col]));
    let inner = |directions: &FlowDirections| -> Vec<Option<u8>> {
        let cells = (1..4).flat_map(|row| (1..4).map(move |col| Cell::new(row, col)));
        let code = |flow| if let Flow::Towards(code) = flow { Some(code) } else { None };
        cells.map(|c| code(directions.flow(c))).collect()
    };
    let routed = route(&bowl);
    assert_eq!(inner(&routed), [7, 6, 5, 0, 5, 4, 6, 2, 3].map(Some));
    let counts = accumulate(&routed);
    let count = |row, col| counts.counts()[Cell::new(row, col)];
    assert_eq!([count(1, 1), count(2, 2), count(3, 1), count(4, 1), count(4, 2)], [1, 8, 9, 10, 1]);
    let orders = strahler(&routed, &counts.channels(1));
    assert_eq!([(1, 1), (2, 2), (4, 1)].map(|(r, c)| orders.orders()[Cell::new(r, c)]), [1, 2, 2]);

    let filled = fill(&bowl);
    assert_eq!(filled.heights()[Cell::new(2, 2)], 3.0);
    assert_eq!(filled.heights().cells().filter(|(c, z)| BOWL[c.row][c.col] != **z).count(), 1);
    assert_eq!(inner(&d8(&filled)), [7, 6, 5, 0, 5, 4, 6, 2, 3].map(Some));
}

#[test]
fn a_pit_drains_through_its_bottom_and_not_around_it() {
    // A cone upside down on a plain that falls to the south: least cost leads through the deepest cell.
    let z = Grid::from_fn(31, 31, |c| {
        let r = (c.distance_squared(Cell::new(15, 15)) as f32).sqrt();
        if r < 10.0 { 3.0 * r - 100.0 } else { 100.0 - 0.5 * c.row as f32 }
    });
    let counts = accumulate(&route(&surface(&z)));
    assert!(counts.counts()[Cell::new(15, 15)] > 250, "the pit gathers at its bottom");
}

#[test]
fn water_on_a_lake_takes_the_middle() {
    // A lake 41 wide and 21 high with an outlet in the east, between walls that rise by the distance.
    let z = Grid::from_fn(41, 61, |c| {
        let (dr, dc) = (c.row.abs_diff(20) as f32, c.col.abs_diff(30) as f32);
        if c.row == 20 && c.col > 50 {
            return -((c.col - 50) as f32) * 0.01;
        }
        (dr - 10.0).max(dc - 20.0).max(0.0)
    });
    let lake = surface(&z);
    let directions = route(&lake);
    let stems = main_stems(&directions, &accumulate(&directions), &lake.flats().unwrap());
    let along: Vec<usize> = (0..41).filter(|&row| stems[Cell::new(row, 30)]).collect();
    assert_eq!(along, [20], "one line, in the middle");
    let counts = accumulate(&directions);
    assert!(counts.counts()[Cell::new(20, 40)] > 500, "and it carries the lake");
}

#[test]
fn voids_are_outside() {
    let z = Grid::from_fn(7, 7, |c| if c == Cell::new(3, 3) { f32::NAN } else { 5.0 + c.col as f32 });
    let valid = Grid::from_fn(7, 7, |c| c != Cell::new(3, 3));
    let directions = route(&Surface::new(z, valid).unwrap());
    assert_eq!(directions.flow(Cell::new(3, 3)), Flow::Void);
    assert_eq!(directions.flow(Cell::new(2, 2)), Flow::Out);
    assert_eq!(directions.flow(Cell::new(1, 1)), Flow::Towards(4));
    let counts = accumulate(&directions);
    assert_eq!(counts.counts()[Cell::new(3, 3)], 0);
}

#[derive(serde::Deserialize)]
struct Oracle {
    area: String,
    side: usize,
    threshold: u32,
    heights: Vec<f32>,
    raised: Vec<(usize, f32)>,
    directions: String,
    accumulation: Vec<u32>,
    order: String,
    unambiguous: String,
    settled: String,
}

fn digits(text: &str) -> Vec<u8> {
    text.bytes().map(|b| b - b'0').collect()
}

#[test]
fn agrees_with_pysheds() {
    let areas: Vec<Oracle> = serde_json::from_str(include_str!("../../tests/oracle/flow.json")).unwrap();
    assert_eq!(areas.len(), 2);
    for oracle in areas {
        let side = oracle.side;
        let surface = surface(&Grid::from_vec(side, side, oracle.heights.clone()).unwrap());
        let filled = fill(&surface);
        let mut expected = oracle.heights.clone();
        for &(index, z) in &oracle.raised {
            expected[index] = z;
        }
        assert_eq!(filled.heights().as_slice(), expected, "{}: filled heights", oracle.area);

        // Directions wherever only one answer is right.
        let ours = d8(&filled);
        let (codes, clear) = (digits(&oracle.directions), digits(&oracle.unambiguous));
        let unlike = (0..codes.len()).filter(|&i| clear[i] == 1);
        let unlike = unlike.filter(|&i| ours.flow(filled.heights().cell_at(i)) != Flow::Towards(codes[i]));
        assert_eq!(unlike.count(), 0, "{}: directions", oracle.area);
        assert!(clear.iter().filter(|&&c| c == 1).count() > codes.len() * 4 / 5);

        // Accumulation and order of the same directions, everywhere.
        let flows = Grid::from_fn(side, side, |c| match codes[c.row * side + c.col] {
            8 => Flow::Out,
            code => Flow::Towards(code),
        });
        let theirs = FlowDirections::from_flows(&flows).unwrap();
        let counts = accumulate(&theirs);
        assert_eq!(counts.counts().as_slice(), oracle.accumulation, "{}: accumulation", oracle.area);
        let orders = strahler(&theirs, &counts.channels(oracle.threshold));
        assert_eq!(orders.orders().as_slice(), digits(&oracle.order), "{}: order", oracle.area);

        // The whole chain where no tie can matter.
        let counts = accumulate(&ours);
        let orders = strahler(&ours, &counts.channels(oracle.threshold));
        let (settled, expected) = (digits(&oracle.settled), digits(&oracle.order));
        for i in (0..settled.len()).filter(|&i| settled[i] == 1) {
            assert_eq!(counts.counts().as_slice()[i], oracle.accumulation[i], "{}: cell {i}", oracle.area);
            assert_eq!(orders.orders().as_slice()[i], expected[i], "{}: cell {i}", oracle.area);
        }
        assert!(settled.iter().filter(|&&s| s == 1).count() > settled.len() * 3 / 4);
    }
}
