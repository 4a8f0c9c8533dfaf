//! Search in the clusters that are nearest to a query, in place of all keys (an inverted file: Jégou, Douze, Schmid, *Product
//! Quantization for Nearest Neighbor Search*, PAMI 2011, section IV).

use super::patches::as_keys;
use super::search::{Packed, Table, least};
use crate::control::Stop;
use crate::machine;
use rayon::prelude::*;

/// Keys of a cluster, in the mean.
const KEYS: usize = 256;
/// Keys of a cluster from which its centre is found.
const SAMPLE: usize = 16;
/// Rounds of k-means.
const ROUNDS: usize = 4;
/// Clusters into which a query looks.
const PROBES: usize = 4;
/// Queries of one task.
const CHUNK: usize = 256;

/// Keys, sorted by likeness.
pub(super) struct Clusters {
    /// The centres as keys, (depth, clusters).
    centres: Vec<f32>,
    depth: usize,
    clusters: Vec<Cluster>,
}

struct Cluster {
    keys: Packed,
    /// Of each key in the whole table.
    numbers: Vec<u32>,
}

impl Clusters {
    /// Sorts rows that end in their squared norm and 1. The distance to each counts by its weight.
    pub(super) fn new(rows: &Table, weights: &[f32], stop: &Stop) -> Self {
        let centres = centres(rows, rows.rows().div_ceil(KEYS), stop);
        let mut members: Vec<Vec<u32>> = vec![Vec::new(); centres.rows()];
        for (row, centre) in (0u32..).zip(nearest(rows, &centres, stop)) {
            members[centre].push(row);
        }
        let filled: Vec<u32> =
            (0u32..).zip(&members).filter(|(_, m)| !m.is_empty()).map(|(c, _)| c).collect();
        let centres = as_keys(&centres.pick(&filled), &vec![1.0; filled.len()]);
        let members: Vec<Vec<u32>> = members.into_iter().filter(|m| !m.is_empty()).collect();
        let cluster = |numbers: Vec<u32>| {
            let weights: Vec<f32> = numbers.iter().map(|row| weights[*row as usize]).collect();
            Cluster { keys: Packed::new(&as_keys(&rows.pick(&numbers), &weights)), numbers }
        };
        let mut across = vec![0.0; centres.values.len()];
        for (c, centre) in centres.values.chunks(rows.depth).enumerate() {
            for (d, v) in centre.iter().enumerate() {
                across[d * filled.len() + c] = *v;
            }
        }
        Self { centres: across, depth: rows.depth, clusters: members.into_par_iter().map(cluster).collect() }
    }

    /// For every query the key with the least weighted distance in the clusters that are nearest to it, and that distance.
    pub(super) fn least(&self, queries: &Table, stop: &Stop) -> Vec<(f32, u32)> {
        assert_eq!(queries.depth, self.depth, "queries and keys of one length");
        let probes: Vec<Vec<u32>> =
            queries.values.par_chunks(CHUNK * self.depth).map(|rows| self.probes(rows)).collect();
        let mut asked: Vec<Vec<u32>> = vec![Vec::new(); self.clusters.len()];
        let each = PROBES.min(self.clusters.len());
        for (query, probes) in (0u32..).zip(probes.iter().flat_map(|chunk| chunk.chunks(each))) {
            probes.iter().for_each(|cluster| asked[*cluster as usize].push(query));
        }
        let answers: Vec<Vec<(f32, u32)>> = asked
            .par_iter()
            .zip(&self.clusters)
            .map(|(asked, cluster)| {
                let found = cluster.keys.least(&queries.pick(asked).values, stop);
                found.into_iter().map(|(cost, key)| (cost, cluster.numbers[key as usize])).collect()
            })
            .collect();
        let mut best = vec![(f32::INFINITY, 0); queries.rows()];
        for (query, answer) in asked.iter().flatten().zip(answers.iter().flatten()) {
            let best = &mut best[*query as usize];
            // The first of equal ones, in whatever order the clusters are.
            if answer.0 < best.0 || (answer.0 == best.0 && answer.1 < best.1) {
                *best = *answer;
            }
        }
        best
    }

    /// The nearest clusters of every query, [`PROBES`] each or all.
    fn probes(&self, queries: &[f32]) -> Vec<u32> {
        let count = self.clusters.len();
        let each = PROBES.min(count);
        let mut probes = Vec::with_capacity(queries.len() / self.depth * each);
        let (mut costs, mut order) = (vec![0.0f32; count], Vec::with_capacity(count));
        let arch = machine::arch();
        for query in queries.chunks(self.depth) {
            arch.dispatch(
                #[inline(always)]
                || {
                    costs.fill(0.0);
                    for (value, centres) in query.iter().zip(self.centres.chunks(count)) {
                        costs.iter_mut().zip(centres).for_each(|(cost, centre)| *cost += value * centre);
                    }
                },
            );
            order.clear();
            order.extend(0..count as u32);
            let nearer = |a: &u32, b: &u32| costs[*a as usize].total_cmp(&costs[*b as usize]).then(a.cmp(b));
            if each < count {
                order.select_nth_unstable_by(each - 1, nearer);
            }
            probes.extend_from_slice(&order[..each]);
        }
        probes
    }
}

/// The centre of each row, by number.
fn nearest(rows: &Table, centres: &Table, stop: &Stop) -> Vec<usize> {
    let found = least(rows, &as_keys(centres, &vec![1.0; centres.rows()]), stop);
    found.into_iter().map(|(_, centre)| centre as usize).collect()
}

/// Some `count` centres of rows, by k-means on some of them, as rows of the same kind.
fn centres(rows: &Table, count: usize, stop: &Stop) -> Table {
    let depth = rows.depth;
    let evenly = |table: &Table, count: usize| {
        let numbers: Vec<u32> = (0..count).map(|i| (i * table.rows() / count) as u32).collect();
        table.pick(&numbers)
    };
    let sample = evenly(rows, rows.rows().min(SAMPLE * count));
    let mut centres = evenly(&sample, count);
    for _ in 0..ROUNDS {
        let mut sums = vec![0.0f32; centres.values.len()];
        for (row, centre) in sample.values.chunks(depth).zip(nearest(&sample, &centres, stop)) {
            // The last number of a row is 1: its sum counts the rows.
            sums[centre * depth..][..depth].iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
        }
        for (centre, sum) in centres.values.chunks_mut(depth).zip(sums.chunks(depth)) {
            if sum[depth - 1] > 0.0 {
                centre.iter_mut().zip(sum).for_each(|(v, total)| *v = total / sum[depth - 1]);
                centre[depth - 2] = centre[..depth - 2].iter().map(|v| v * v).sum();
            }
        }
    }
    centres
}
