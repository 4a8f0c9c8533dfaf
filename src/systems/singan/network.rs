//! The network of both players: five valid 3x3 convolutions (SinGAN, section 2.1).
//!
//! inputs -> width -> width -> width -> width -> 1, leaky ReLU after the first four, batch normalisation before each of them
//! when asked for. An output pixel sees 11x11 inputs.

use crate::learn::convolution::Plane;
use crate::learn::layers::{Activation, Conv, LayerId, Net, Norm, Tape};

/// Convolutions of a network.
const LAYERS: usize = 5;
/// Cells by which the output is narrower than the input on each side.
pub(super) const REACH: usize = LAYERS;
/// Slope of the leaky ReLU below 0 (SinGAN, supplementary material).
const LEAK: f32 = 0.2;

/// What a network looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    /// Channels of the input: 1 to 3.
    pub(super) inputs: usize,
    /// Channels of the hidden layers: 32 or 64.
    pub(super) width: usize,
    /// Whether batch normalisation stands before each activation.
    pub(super) batch_norm: bool,
}

impl Shape {
    /// The network.
    pub(super) fn net(self) -> Net {
        let mut net = Net::new();
        let hidden = Conv {
            norm: self.batch_norm.then_some(Norm::Batch),
            activation: Activation::Leaky(LEAK),
            ..Conv::new(3, self.width)
        };
        let input = net.input(self.inputs).expect("up to three channels");
        let hidden = (1..LAYERS).fold(input, |at, _| net.conv(at, hidden).expect("a checked width"));
        net.conv(hidden, Conv::new(3, 1)).expect("one channel");
        net
    }
}

/// The only input of a network.
fn input_of(net: &Net) -> LayerId {
    net.inputs().next().expect("an input")
}

/// Where the input of a pass goes.
pub(super) fn input_mut(tape: &mut Tape) -> &mut Plane {
    let input = input_of(tape.net());
    tape.input_mut(input, 0)
}

/// The input's gradient after a pass back.
pub(super) fn input_delta(tape: &Tape) -> &Plane {
    tape.delta(input_of(tape.net()), 0)
}

/// Buffers for outputs of `rows` x `cols`.
pub(super) fn tape(net: &Net, rows: usize, cols: usize) -> Tape {
    Tape::new(net, 1, &[(rows + 2 * REACH, cols + 2 * REACH)])
}

/// A generator for use, its batch normalisations folded.
#[derive(Clone, Debug)]
pub(super) struct Network {
    pub(super) net: Net,
    pub(super) values: Vec<f32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the widths of the paper: 9 taps between 1, 32, 32, 32, 32 and 1 channels, biases, and gains where they are.
    #[test]
    fn networks_have_the_published_size_and_reach() {
        for (batch_norm, gains) in [(false, 0), (true, 4 * 32)] {
            let net = Shape { inputs: 1, width: 32, batch_norm }.net();
            assert_eq!(net.value_count(), 9 * (32 + 3 * 32 * 32 + 32) + 4 * 32 + 1 + gains);
            let tape = tape(&net, 7, 9);
            assert_eq!((tape.output(0).rows(), tape.output(0).cols(), tape.output(0).channels()), (7, 9, 1));
        }
    }
}
