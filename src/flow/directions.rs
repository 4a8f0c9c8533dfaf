//! Where the water of each cell goes next.

#[cfg(test)]
use crate::error::{Error, Result};
use crate::grid::{Cell, Grid, d8};

/// Stored code of an outlet.
pub(super) const OUTLET: u8 = 8;
/// Stored code of a void.
pub(super) const OUTSIDE: u8 = 0xff;
/// Donor count of a cell that has been visited.
const VISITED: u8 = 0xff;

/// Where one cell drains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// To the neighbour in this D8 direction.
    Towards(u8),
    /// Out of the map.
    Out,
    /// Nowhere: the cell is void.
    Void,
}

/// One receiver for every cell. Following the receivers from any valid cell ends at an outlet: there are no cycles, and no
/// cell drains into a void.
#[derive(Clone, Debug, PartialEq)]
pub struct FlowDirections {
    codes: Grid<u8>,
    /// Position step by direction code.
    steps: [isize; 8],
}

impl FlowDirections {
    /// Directions from elsewhere.
    ///
    /// # Errors
    /// When a code is not 0 to 7, a direction leaves the frame or enters a void, or the directions run in a circle.
    #[cfg(test)]
    pub(crate) fn from_flows(flows: &Grid<Flow>) -> Result<Self> {
        let (rows, cols) = flows.shape();
        for (cell, &flow) in flows.cells() {
            if let Flow::Towards(code) = flow {
                let target = (code < 8).then(|| d8::neighbour(cell, code, rows, cols)).flatten();
                if target.is_none_or(|t| flows[t] == Flow::Void) {
                    return Err(Error::value(
                        format!("flow direction at row {}, column {}", cell.row, cell.col),
                        code,
                        "allowed: a D8 code 0 to 7 that leads to a valid cell",
                    ));
                }
            }
        }
        let directions = Self::from_codes(flows.map(|flow| match flow {
            Flow::Towards(code) => *code,
            Flow::Out => OUTLET,
            Flow::Void => OUTSIDE,
        }));
        let mut visited = 0;
        directions.visit_downstream(|_| true, |_, _| visited += 1);
        let draining = directions.codes.as_slice().iter().filter(|&&c| c != OUTSIDE).count();
        if visited < draining {
            return Err(Error::value(
                "flow directions",
                format!("a circle that {} cells drain into or belong to", draining - visited),
                "allowed: every cell drains to an outlet",
            ));
        }
        Ok(directions)
    }

    /// Codes that are known to be right.
    pub(super) fn from_codes(codes: Grid<u8>) -> Self {
        let cols = codes.cols() as isize;
        Self { codes, steps: d8::OFFSETS.map(|(dr, dc)| dr * cols + dc) }
    }

    /// (rows, columns).
    #[must_use]
    pub(crate) fn shape(&self) -> (usize, usize) {
        self.codes.shape()
    }

    /// Where `cell` drains.
    ///
    /// # Panics
    /// When `cell` lies outside the frame.
    #[must_use]
    pub fn flow(&self, cell: Cell) -> Flow {
        match self.codes[cell] {
            OUTSIDE => Flow::Void,
            OUTLET => Flow::Out,
            code => Flow::Towards(code),
        }
    }

    /// The cell that `cell` drains into; `None` for outlets and voids.
    ///
    /// # Panics
    /// When `cell` lies outside the frame.
    #[must_use]
    pub(crate) fn receiver(&self, cell: Cell) -> Option<Cell> {
        self.receiver_index(self.codes.index_of(cell)).map(|i| self.codes.cell_at(i))
    }

    pub(super) fn is_void(&self, index: usize) -> bool {
        self.codes.as_slice()[index] == OUTSIDE
    }

    pub(super) fn receiver_index(&self, index: usize) -> Option<usize> {
        let code = self.codes.as_slice()[index];
        (code < OUTLET).then(|| index.wrapping_add_signed(self.steps[code as usize]))
    }

    /// Visits every `member` cell once, after all members that drain into it: `visit(cell, receiver)`, where the receiver is
    /// a member too.
    ///
    /// Follows each chain from its source until it meets a cell that still waits for a donor: linear, and neighbours in
    /// time are neighbours in memory.
    pub(super) fn visit_downstream(
        &self,
        member: impl Fn(usize) -> bool,
        mut visit: impl FnMut(usize, Option<usize>),
    ) {
        let len = self.codes.len();
        let belongs = |i: usize| !self.is_void(i) && member(i);
        let mut waiting = vec![0u8; len];
        for i in (0..len).filter(|&i| belongs(i)) {
            if let Some(r) = self.receiver_index(i) {
                waiting[r] += 1;
            }
        }
        for source in 0..len {
            if waiting[source] != 0 || !belongs(source) {
                continue;
            }
            let mut cell = source;
            loop {
                let receiver = self.receiver_index(cell).filter(|&r| belongs(r));
                waiting[cell] = VISITED;
                visit(cell, receiver);
                let Some(next) = receiver else { break };
                waiting[next] -= 1;
                if waiting[next] != 0 {
                    break;
                }
                cell = next;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circles_and_dead_ends_are_refused() {
        let flows = |art: [Flow; 3]| Grid::from_vec(1, 3, art.to_vec()).unwrap();
        use Flow::{Out, Towards, Void};
        assert!(FlowDirections::from_flows(&flows([Towards(0), Towards(0), Out])).is_ok());
        assert!(FlowDirections::from_flows(&flows([Towards(0), Towards(4), Out])).is_err());
        assert!(FlowDirections::from_flows(&flows([Towards(0), Void, Out])).is_err());
        assert!(FlowDirections::from_flows(&flows([Towards(4), Out, Out])).is_err());
        assert!(FlowDirections::from_flows(&flows([Towards(9), Out, Out])).is_err());
    }
}
