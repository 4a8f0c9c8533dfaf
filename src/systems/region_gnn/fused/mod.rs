//! Message passing at the speed of memory: the whole network as one operation, nothing stored per edge.
//!
//! The first layer of `Enc` is linear in its concatenated inputs, so it splits into a pixel part, a region part and an
//! edge part; the second layer is linear too and commutes with the attention average. What is left per edge is
//!
//! ```text
//! h_e   = relu(pixel[p] + region[r] + W f_e)        f_e: edge features and noise
//! t_e   = w . h_e + q[v]                            v: the receiving node
//! a_e   = softmax over the edges of v of leaky_relu(t_e)
//! out_v = sum a_e h_e
//! ```
//!
//! Edges of masked regions are left out; a node without edges receives zero. Forward costs about 2 (features + 3) H
//! flops an edge and layer, backward three times that; `docs/performance.md` has the measured shares. Edges are streamed
//! in pixel order, a few pixels at a time, in a number of tasks that does not depend on the threads; what goes to regions
//! and parameters is summed a task at a time and merged in order, so that every thread count gives the same bytes.
//! `plain` is the literal formula, the oracle of this one.

#![allow(clippy::needless_range_loop, reason = "an index names the same register of several states")]

mod block;
mod lanes;
mod layout;
mod op;
mod pass;
mod pixel_states;
mod small;
mod tasks;
mod to_pixels;
mod to_regions;

pub(super) use block::LEAK;
pub(super) use layout::{EMBEDDING, Layout};
pub(super) use op::{Buffers, fused};
pub(super) use pass::Pass;
