//! The best key of every query as a matrix product: least q . k over all keys, at the widest registers.
//!
//! Squared distances are such products: |q - k|^2 w = (q, |q|^2, 1) . (-2 w k, w, w |k|^2), with any weight w of the key.
//! `pulp` picks the instruction set at run time; a tile of queries x two registers of keys stays in registers while the depth
//! runs, and a panel of keys stays in the cache while the queries of a task pass by. Nothing but the best of every register
//! lane is kept, so that memory does not grow with the number of pairs.

use crate::control::Stop;
use crate::machine;
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Keys that lie side by side: two registers of 16 lanes.
const BLOCK: usize = 32;
/// Blocks of a panel: with 100 values a key they fill half of the second-level cache.
const PANEL: usize = 32;
/// Queries of one task.
const CHUNK: usize = 128;
/// Queries of a tile: 8 x 2 sums, 2 keys and a broadcast of 32 registers.
const TILE_32: usize = 8;
/// The same for 16 registers: 6 x 2 sums.
const TILE_16: usize = 6;

/// Rows of numbers, all of one length.
pub(super) struct Table {
    pub(super) depth: usize,
    /// (rows, depth)
    pub(super) values: Vec<f32>,
}

impl Table {
    /// Number of rows.
    pub(super) fn rows(&self) -> usize {
        self.values.len() / self.depth
    }

    /// Some of the rows, in the order of their numbers.
    pub(super) fn pick(&self, numbers: &[u32]) -> Self {
        let row = |&number: &u32| &self.values[number as usize * self.depth..][..self.depth];
        Self { depth: self.depth, values: numbers.iter().flat_map(row).copied().collect() }
    }
}

/// For every query the key with the least product, and that product; the first of equal ones. Anything once it is stopped.
pub(super) fn least(queries: &Table, keys: &Table, stop: &Stop) -> Vec<(f32, u32)> {
    assert_eq!(queries.depth, keys.depth, "queries and keys of one length");
    let packed = Packed::new(keys);
    let chunks: Vec<Vec<(f32, u32)>> =
        queries.values.par_chunks(CHUNK * queries.depth).map(|rows| packed.least(rows, stop)).collect();
    chunks.concat()
}

/// Keys as the search reads them.
pub(super) struct Packed {
    /// (blocks, depth, [`BLOCK`])
    values: Vec<f32>,
    depth: usize,
    rows: usize,
}

impl Packed {
    /// Packs at least one key.
    pub(super) fn new(keys: &Table) -> Self {
        let (depth, rows) = (keys.depth, keys.rows());
        let mut values = vec![0.0f32; rows.div_ceil(BLOCK) * depth * BLOCK];
        values.par_chunks_mut(depth * BLOCK).enumerate().for_each(|(block, out)| {
            for lane in 0..BLOCK {
                // The last key fills the last block.
                let key = (block * BLOCK + lane).min(rows - 1);
                for (d, v) in keys.values[key * depth..(key + 1) * depth].iter().enumerate() {
                    out[d * BLOCK + lane] = *v;
                }
            }
        });
        Self { values, depth, rows }
    }

    /// [`least`] of a few queries, (queries, depth), on one thread.
    pub(super) fn least(&self, queries: &[f32], stop: &Stop) -> Vec<(f32, u32)> {
        assert!(queries.len().is_multiple_of(self.depth), "queries and keys of one length");
        let (depth, count) = (self.depth, queries.len() / self.depth);
        if stop.is_raised() {
            return vec![(f32::INFINITY, 0); count];
        }
        if count == 0 {
            return Vec::new();
        }
        let found = machine::arch().dispatch(Search { queries, keys: &self.values, depth });
        let best = |q: usize| {
            let lanes = q * BLOCK..(q + 1) * BLOCK;
            let each = found.cost[lanes.clone()].iter().zip(&found.block[lanes]).enumerate();
            let each = each.map(|(lane, (cost, block))| (*cost, block * BLOCK as u32 + lane as u32));
            let first = each.reduce(|a, b| if (b.0, b.1) < (a.0, a.1) { b } else { a });
            let (cost, key) = first.unwrap_or((f32::INFINITY, 0));
            (cost, key.min(self.rows as u32 - 1))
        };
        (0..count).map(best).collect()
    }
}

/// The best of every lane: (queries, [`BLOCK`]).
struct Found {
    cost: Vec<f32>,
    block: Vec<u32>,
}

/// One task.
struct Search<'a> {
    /// (queries, depth)
    queries: &'a [f32],
    /// (blocks, depth, [`BLOCK`])
    keys: &'a [f32],
    depth: usize,
}

impl WithSimd for Search<'_> {
    type Output = Found;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Found {
        if S::F32_LANES == 16 { self.run::<S, TILE_32>(simd) } else { self.run::<S, TILE_16>(simd) }
    }
}

impl Search<'_> {
    #[inline(always)]
    fn run<S: Simd, const P: usize>(self, simd: S) -> Found {
        let depth = self.depth;
        // Whole tiles: the last query fills the last one.
        let mut queries = self.queries.to_vec();
        while !(queries.len() / depth).is_multiple_of(P) {
            queries.extend_from_slice(&self.queries[self.queries.len() - depth..]);
        }
        let lanes = queries.len() / depth * BLOCK;
        let mut found = Found { cost: vec![f32::INFINITY; lanes], block: vec![0; lanes] };
        let registers = BLOCK / S::F32_LANES;
        let cost: &mut [S::f32s] = cast_slice_mut(&mut found.cost);
        let origin: &mut [S::u32s] = cast_slice_mut(&mut found.block);
        let keys: &[S::f32s] = cast_slice(self.keys);
        for (p, panel) in keys.chunks(PANEL * depth * registers).enumerate() {
            for (t, tile) in queries.chunks_exact(P * depth).enumerate() {
                for pair in 0..registers / 2 {
                    let place = |q: usize| (t * P + q) * registers + 2 * pair;
                    let mut best = [[simd.splat_f32s(0.0); 2]; P];
                    let mut from = [[simd.splat_u32s(0); 2]; P];
                    for q in 0..P {
                        for r in 0..2 {
                            (best[q][r], from[q][r]) = (cost[place(q) + r], origin[place(q) + r]);
                        }
                    }
                    for (b, block) in panel.chunks_exact(depth * registers).enumerate() {
                        let mut sums = [[simd.splat_f32s(0.0); 2]; P];
                        for d in 0..depth {
                            let low = block[d * registers + 2 * pair];
                            let high = block[d * registers + 2 * pair + 1];
                            for q in 0..P {
                                let value = simd.splat_f32s(tile[q * depth + d]);
                                sums[q][0] = simd.mul_add_e_f32s(value, low, sums[q][0]);
                                sums[q][1] = simd.mul_add_e_f32s(value, high, sums[q][1]);
                            }
                        }
                        let number = simd.splat_u32s((p * PANEL + b) as u32);
                        for q in 0..P {
                            for r in 0..2 {
                                let less = simd.less_than_f32s(sums[q][r], best[q][r]);
                                best[q][r] = simd.select_f32s(less, sums[q][r], best[q][r]);
                                from[q][r] = simd.select_u32s(less, number, from[q][r]);
                            }
                        }
                    }
                    for q in 0..P {
                        for r in 0..2 {
                            (cost[place(q) + r], origin[place(q) + r]) = (best[q][r], from[q][r]);
                        }
                    }
                }
            }
        }
        found
    }
}
