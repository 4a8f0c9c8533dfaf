//! Least-cost routing: drainage without raising a pit.
//!
//! [`Surface`] -> [`FlowDirections`], or to chosen bases, [`Drainage`]. Ehlschlaeger 1989 (the A* search of GRASS
//! `r.watershed`): a flood starts at the outlets and always continues from the lowest cell in reach *by its true height*. A
//! cell drains into the cell from which the flood reached it, unless a lower neighbour was flooded before: then into the
//! steepest of those. Inside a pit the water therefore runs down to the bottom's thalweg and out along the lowest pass,
//! where filling would leave arbitrary lines. Outlets drain out of the map only, never along its frame. n log n for
//! ranking, then linear.

use super::Surface;
use super::directions::{FlowDirections, OUTLET, OUTSIDE};
use super::flood::{DONE, Flood, UNSEEN};
use crate::control::Stop;
use crate::error::{Error, Result};
use crate::grid::{Grid, d8};

/// Flag: reached over a divide, and waiting until nothing else is left.
const WAITING: u8 = 0x10;
/// The bits of a state that hold a direction.
const DIRECTION: u8 = 0x0f;
/// Cells that are routed from one look at the stop to the next: a few milliseconds.
const BETWEEN_POLLS: usize = 1 << 16;

/// Where the water of every cell goes on a surface that keeps its pits.
///
/// # Panics
/// Never: nobody stops it.
#[must_use]
pub fn route(surface: &Surface) -> FlowDirections {
    route_until(surface, &Stop::new()).expect("nobody stops it")
}

/// As [`route`], unless it is stopped.
///
/// # Errors
/// When it is stopped.
pub(crate) fn route_until(surface: &Surface, stop: &Stop) -> Result<FlowDirections> {
    let mut flood = Flood::new(surface, |_| false);
    spread(&mut flood, |_| false, |_, _, slope| slope, |_| {}, stop)?;
    Ok(FlowDirections::from_codes(flood.directions()))
}

/// What a cell is to water on its way to chosen bases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Role {
    /// Drains.
    #[default]
    Ground,
    /// Takes up whatever reaches it and sends nothing on, as an outlet does: a river, a shore, a frame.
    Base,
    /// Drains, and receives nothing unless there is no other way: a drawn ridge.
    Divide,
}

/// Drainage to chosen bases.
#[derive(Clone, Debug)]
pub(crate) struct Drainage {
    directions: FlowDirections,
    order: Vec<u32>,
}

impl Drainage {
    /// Positions (row by row) of all valid cells in the order in which the flood came: every cell after its receiver, and
    /// roughly from low to high.
    #[must_use]
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Position of the cell into which the cell at `index` drains; `None` for outlets, bases and voids.
    ///
    /// # Panics
    /// When `index` lies outside the raster.
    #[must_use]
    pub(crate) fn receiver(&self, index: usize) -> Option<usize> {
        self.directions.receiver_index(index)
    }

    /// Adds to the value of every cell the values of all cells that drain through it. Linear.
    ///
    /// # Panics
    /// When there is not one value for each cell.
    pub(crate) fn gather(&self, values: &mut [f32]) {
        let (rows, cols) = self.directions.shape();
        assert_eq!(values.len(), rows * cols, "one value for each cell");
        for &cell in self.order.iter().rev() {
            if let Some(receiver) = self.receiver(cell as usize) {
                values[receiver] += values[cell as usize];
            }
        }
    }
}

/// Routes water to the outlets (frame and voids) and to every [`Role::Base`]. With `preferences` a cell chooses among its
/// lower neighbours that of the greatest slope times preference (by D8 code, positive); a preference that varies at random
/// frees the paths from the eight directions of the raster.
///
/// # Errors
/// When `roles` or `preferences` have another shape than the surface, or when it is stopped.
pub(crate) fn drain(
    surface: &Surface,
    roles: &Grid<Role>,
    preferences: Option<&Grid<[f32; 8]>>,
    stop: &Stop,
) -> Result<Drainage> {
    let shapes = [("roles of cells", Some(roles.shape())), ("preferences", preferences.map(Grid::shape))];
    for (name, shape) in shapes {
        if let Some(shape) = shape.filter(|shape| *shape != surface.shape()) {
            let allowed = format!("the surface is {:?}", surface.shape());
            return Err(Error::value(name, format!("{shape:?}"), allowed));
        }
    }
    let cols = surface.shape().1;
    let roles = roles.as_slice();
    let mut flood = Flood::new(surface, |index| roles[index] == Role::Base);
    // Positions of the flood lie in a raster with a rim.
    let inner = |position: usize| (position / (cols + 2) - 1) * cols + position % (cols + 2) - 1;
    let mut order = Vec::with_capacity(flood.cells.len());
    let is_divide = |position| roles[inner(position)] == Role::Divide;
    let reach = |position| order.push(inner(position) as u32);
    match preferences {
        None => spread(&mut flood, is_divide, |_, _, slope| slope, reach, stop)?,
        Some(preferences) => {
            let preferences = preferences.as_slice();
            let weigh =
                |position, code: u8, slope| slope * f64::from(preferences[inner(position)][code as usize]);
            spread(&mut flood, is_divide, weigh, reach, stop)?;
        }
    }
    Ok(Drainage { directions: FlowDirections::from_codes(flood.directions()), order })
}

/// The flood: `weigh(position, code, slope)` is what a cell compares its lower neighbours by, `reach` hears of every
/// position when its direction is known.
fn spread(
    flood: &mut Flood,
    is_divide: impl Fn(usize) -> bool,
    weigh: impl Fn(usize, u8, f64) -> f64,
    mut reach: impl FnMut(usize),
    stop: &Stop,
) -> Result<()> {
    let Flood { steps, nodes, cells, state, queue, .. } = flood;
    // What lies behind a divide waits in a second half of the queue.
    let behind = cells.len() as u32;
    let mut done = 0usize;
    while let Some(rank) = queue.pop() {
        if done.is_multiple_of(BETWEEN_POLLS) {
            stop.check()?;
        }
        done += 1;
        let here = cells[(if rank < behind { rank } else { rank - behind }) as usize] as usize;
        if state[here] & DONE != 0 {
            continue;
        }
        let height = f64::from(nodes[here].height);
        let divides = is_divide(here);
        let mut steepest = 0.0;
        let mut direction = state[here] & DIRECTION;
        for code in 0..8u8 {
            let there = here.wrapping_add_signed(steps[code as usize]);
            let seen = state[there];
            if seen == OUTSIDE {
                continue;
            }
            if seen & DONE != 0 {
                let slope = (height - f64::from(nodes[there].height)) / d8::DISTANCES[code as usize];
                if slope > 0.0 && weigh(here, code, slope) > steepest && !is_divide(there) {
                    steepest = weigh(here, code, slope);
                    direction = code;
                }
            } else if seen == UNSEEN && divides {
                state[there] = WAITING | d8::opposite(code);
                queue.insert(behind + nodes[there].rank);
            } else if seen == UNSEEN || (seen & WAITING != 0 && !divides) {
                state[there] = d8::opposite(code);
                queue.insert(nodes[there].rank);
            }
        }
        if state[here] != OUTLET {
            state[here] = direction;
        }
        state[here] |= DONE;
        reach(here);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::{Flow, accumulate};
    use crate::grid::{Cell, Mask};

    fn surface(height: impl Fn(Cell) -> f32) -> Surface {
        let z = Grid::from_fn(31, 41, height);
        let everywhere = Mask::filled(31, 41, true);
        Surface::new(z, everywhere).unwrap()
    }

    fn rough(c: Cell) -> f32 {
        ((c.row * 37 + c.col * 61 + c.row * c.col * 7) % 101) as f32 + 3.0 * c.col as f32
    }

    #[test]
    fn without_bases_it_is_plain_routing() {
        let surface = surface(rough);
        let drainage = drain(&surface, &Grid::filled(31, 41, Role::Ground), None, &Stop::new()).unwrap();
        assert_eq!(drainage.directions, route(&surface));
        let mut place = vec![usize::MAX; 31 * 41];
        for (n, &cell) in drainage.order().iter().enumerate() {
            place[cell as usize] = n;
            assert!(drainage.receiver(cell as usize).is_none_or(|r| place[r] < n));
        }
        assert!(place.iter().all(|&n| n < 31 * 41), "every cell once");
        let mut counts = vec![1.0; 31 * 41];
        drainage.gather(&mut counts);
        let expected = accumulate(&drainage.directions);
        assert!(counts.iter().zip(expected.counts().as_slice()).all(|(a, &b)| *a == b as f32));
    }

    #[test]
    fn bases_take_the_water_of_their_surroundings() {
        let hill = surface(|c| 100.0 - c.distance_squared(Cell::new(15, 20)) as f32 * 0.01);
        let well = Cell::new(15, 20);
        let roles = Grid::from_fn(31, 41, |c| if c == well { Role::Base } else { Role::Ground });
        let drainage = drain(&hill, &roles, None, &Stop::new()).unwrap();
        assert_eq!(drainage.directions.flow(well), Flow::Out, "even on the summit");
        for code in 0..8u8 {
            let near = d8::neighbour(well, code, 31, 41).unwrap();
            assert_ne!(drainage.directions.flow(near), Flow::Void);
        }
        let slope = surface(|c| 40.0 - c.col as f32);
        let roles = Grid::from_fn(31, 41, |c| if c.col == 20 { Role::Base } else { Role::Ground });
        let drainage = drain(&slope, &roles, None, &Stop::new()).unwrap();
        let mut counts = vec![1.0; 31 * 41];
        drainage.gather(&mut counts);
        assert_eq!(
            counts[15 * 41 + 20],
            20.0,
            "all that comes down its row from the west but for the outlet"
        );
    }

    #[test]
    fn a_divide_receives_only_what_has_no_other_way() {
        // Everything falls to the west across a wall of divides, lower than what lies to the west of it.
        let height = |c: Cell| if c.col == 20 { 5.0 } else { 10.0 + c.col as f32 };
        let surface = surface(height);
        let wall = |c: Cell| c.col == 20 && (3..28).contains(&c.row);
        let roles = Grid::from_fn(31, 41, |c| if wall(c) { Role::Divide } else { Role::Ground });
        let drainage = drain(&surface, &roles, None, &Stop::new()).unwrap();
        let mut counts = vec![1.0; 31 * 41];
        drainage.gather(&mut counts);
        for row in 3..28 {
            assert_eq!(counts[row * 41 + 20], 1.0, "row {row}");
        }
        // A closed ring must let its inside out.
        let ring = |c: Cell| {
            let (down, right) = (c.row.abs_diff(15), c.col.abs_diff(20));
            down.max(right) == 5
        };
        let roles = Grid::from_fn(31, 41, |c| if ring(c) { Role::Divide } else { Role::Ground });
        let drainage = drain(&surface, &roles, None, &Stop::new()).unwrap();
        assert_eq!(drainage.order().len(), 31 * 41);
        let mut counts = vec![1.0f32; 31 * 41];
        drainage.gather(&mut counts);
        let on_ring: f32 = (0..31 * 41).filter(|&i| ring(Cell::new(i / 41, i % 41))).map(|i| counts[i]).sum();
        assert!(on_ring >= 81.0 + 40.0, "the inside leaves over the ring: {on_ring}");
    }

    #[test]
    fn preferences_choose_among_lower_neighbours() {
        let slope = surface(|c| c.row as f32 + 0.9 * c.col as f32);
        let west = Grid::filled(31, 41, [1.0, 1.0, 1.0, 1.0, 9.0, 1.0, 1.0, 1.0]);
        let roles = Grid::filled(31, 41, Role::Ground);
        let at = Cell::new(15, 20);
        let plain = drain(&slope, &roles, None, &Stop::new()).unwrap();
        let drawn = drain(&slope, &roles, Some(&west), &Stop::new()).unwrap();
        assert_ne!(plain.directions.flow(at), Flow::Towards(4));
        assert_eq!(drawn.directions.flow(at), Flow::Towards(4));
        assert!(drain(&slope, &Grid::filled(3, 3, Role::Ground), None, &Stop::new()).is_err());
    }
}
