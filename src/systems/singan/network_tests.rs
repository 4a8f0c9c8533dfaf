//! The hand-written passes against a plain twin: candle's operations in double precision, and finite differences of it.

use super::network::{LAYERS, LEAK, Network, Shape, Start, Tape};
use super::penalty::Penalty;
use crate::learn::convolution::Plane;
use crate::seed::Seed;
use candle_core::{DType, Device, Tensor, Var};
use rand::RngExt;

const ROWS: usize = 5;
const COLS: usize = 7;

fn draw(n: usize, name: &str) -> Vec<f32> {
    let mut stream = Seed(4).stream(name);
    (0..n).map(|_| stream.random_range(-1.0f32..1.0)).collect()
}

/// Random gains and offsets too, so that none of them hides behind its first value.
fn network(shape: Shape) -> Network {
    let mut net = Network::new(shape, Start::Scaled, 1.0, Seed(3));
    for layer in 0..LAYERS {
        let [_, offsets, gains] = shape.places(layer);
        for i in offsets.chain(gains) {
            net.values[i] += 0.3 * draw(net.values.len(), "shift")[i];
        }
    }
    net
}

fn shapes() -> [Shape; 3] {
    [(1, false), (2, false), (1, true)].map(|(inputs, batch_norm)| Shape { inputs, width: 32, batch_norm })
}

/// (1, channels, rows, cols) in double precision.
fn image(plane: &Plane) -> Tensor {
    let (rows, cols) = plane.stored();
    let t = Tensor::from_slice(plane.values(), (rows, cols, plane.channels()), &Device::Cpu).unwrap();
    let t = t.to_dtype(DType::F64).unwrap().permute((2, 0, 1)).unwrap().unsqueeze(0).unwrap();
    t.contiguous().unwrap()
}

/// Values of (1, channels, rows, cols) in our order.
fn flat(t: &Tensor) -> Vec<f64> {
    let t = t.squeeze(0).unwrap().permute((1, 2, 0)).unwrap();
    t.contiguous().unwrap().flatten_all().unwrap().to_vec1::<f64>().unwrap()
}

/// The network of candle's operations; `values` as [`Network::values`].
fn twin(shape: Shape, values: &Tensor, input: &Tensor) -> Tensor {
    let mut x = input.clone();
    for layer in 0..LAYERS {
        let (inputs, outputs) = shape.channels(layer);
        let [weights, bias, gains] = shape.places(layer);
        let part = |r: std::ops::Range<usize>| values.narrow(0, r.start, r.len()).unwrap();
        let per_channel = |r| part(r).reshape((1, outputs, 1, 1)).unwrap();
        let w = part(weights).reshape((3, 3, inputs, outputs)).unwrap().permute((3, 2, 0, 1)).unwrap();
        x = x.conv2d(&w.contiguous().unwrap(), 0, 1, 1, 1).unwrap();
        if shape.normalised(layer) {
            let mean = |t: &Tensor| t.mean_keepdim(3).unwrap().mean_keepdim(2).unwrap();
            let centred = x.broadcast_sub(&mean(&x)).unwrap();
            let variance = mean(&centred.sqr().unwrap());
            let unit = centred.broadcast_div(&(variance + 1e-5).unwrap().sqrt().unwrap()).unwrap();
            x = unit.broadcast_mul(&per_channel(gains)).unwrap();
        }
        x = x.broadcast_add(&per_channel(bias)).unwrap();
        if layer + 1 < LAYERS {
            // max(x, leak x) has the derivative of a leaky ReLU, ties aside.
            let active = x.relu().unwrap();
            x = (active - (x.neg().unwrap().relu().unwrap() * f64::from(LEAK)).unwrap()).unwrap();
        }
    }
    x
}

fn assert_close(what: &str, a: &[f32], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    let scale = b.iter().fold(0f64, |m, v| m.max(v.abs()));
    let worst = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0f64, f64::max);
    assert!(worst <= tolerance * scale, "{what}: off by {worst} of {scale}");
}

fn inputs(shape: Shape) -> Plane {
    let (rows, cols) = (ROWS + 10, COLS + 10);
    Plane::from_values(rows, cols, shape.inputs, draw(rows * cols * shape.inputs, "input"))
}

#[test]
fn passes_equal_candles_operations() {
    for shape in shapes() {
        let net = network(shape);
        let mut tape = Tape::new(shape, ROWS, COLS);
        tape.input = inputs(shape);
        tape.forward(&net, None);
        let toward = draw(ROWS * COLS, "toward");
        for (row, values) in toward.chunks_exact(COLS).enumerate() {
            tape.deltas[LAYERS - 1].row_mut(row).copy_from_slice(values);
        }
        let mut gradient = vec![0.0; net.values.len()];
        let mut d_input = tape.input.clone();
        tape.backward(&net, Some(&mut gradient), Some(&mut d_input));

        let values = Var::from_slice(&net.values, net.values.len(), &Device::Cpu).unwrap();
        let values = Var::from_tensor(&values.to_dtype(DType::F64).unwrap()).unwrap();
        let input = Var::from_tensor(&image(&tape.input)).unwrap();
        let out = twin(shape, &values, &input);
        let toward = image(&Plane::from_values(ROWS, COLS, 1, toward));
        let gradients = (&out * toward).unwrap().sum_all().unwrap().backward().unwrap();
        assert_close("output", tape.out.values(), &flat(&out), 1e-5);
        assert_close("input gradient", d_input.values(), &flat(gradients.get(&input).unwrap()), 1e-4);
        let want = gradients.get(&values).unwrap().to_vec1::<f64>().unwrap();
        for layer in 0..LAYERS {
            for (place, what) in shape.places(layer).into_iter().zip(["weights", "bias", "gains"]) {
                let name = format!("{shape:?}, layer {layer}, {what}");
                assert_close(&name, &gradient[place.clone()], &want[place], 1e-4);
            }
        }
    }
}

/// The penalty of the twin in double precision, from one ordinary backward pass.
fn penalty_of(shape: Shape, values: &[f64], input: &Tensor) -> f64 {
    let values = Tensor::from_slice(values, values.len(), &Device::Cpu).unwrap();
    let input = Var::from_tensor(input).unwrap();
    let gradients = twin(shape, &values, &input).sum_all().unwrap().backward().unwrap();
    let g = flat(gradients.get(&input).unwrap());
    let norms = g.chunks_exact(shape.inputs).map(|g| g.iter().map(|g| g * g).sum::<f64>().sqrt());
    norms.map(|norm| (norm - 1.0).powi(2)).sum::<f64>() / (g.len() / shape.inputs) as f64
}

/// Steps of 1e-7 in double precision meet no kink of the leaky ReLU here, so that the real activation can be tested.
#[test]
fn the_penaltys_gradient_equals_finite_differences() {
    for shape in shapes() {
        let net = network(shape);
        let mut tape = Tape::new(shape, ROWS, COLS);
        tape.input = inputs(shape);
        let input = image(&tape.input);
        let mut gradient = vec![0.0; net.values.len()];
        let penalty = Penalty::new(shape, ROWS, COLS).add(&net, &mut tape, 1.0, &mut gradient);
        let values: Vec<f64> = net.values.iter().map(|v| f64::from(*v)).collect();
        let want = penalty_of(shape, &values, &input);
        assert!((penalty - want).abs() < 1e-4 * want, "{penalty} {want}");
        for layer in 0..LAYERS {
            for place in shape.places(layer) {
                let (mut got, mut differences) = (Vec::new(), Vec::new());
                for i in place.clone().step_by(place.len() / 5 + 1) {
                    let shifted = |by: f64| {
                        let mut values = values.clone();
                        values[i] += by;
                        penalty_of(shape, &values, &input)
                    };
                    got.push(gradient[i]);
                    differences.push((shifted(1e-7) - shifted(-1e-7)) / 2e-7);
                }
                let scale = gradient[place].iter().fold(0f32, |m, g| m.max(g.abs()));
                if !shape.batch_norm && differences.iter().all(|d| d.abs() < 1e-6) {
                    // Without batch normalisation biases move only kinks.
                    assert_eq!(scale, 0.0);
                } else if layer + 1 < LAYERS || scale > 0.0 {
                    for (g, d) in got.iter().zip(&differences) {
                        assert!(
                            (f64::from(*g) - d).abs() <= 1e-3 * f64::from(scale) + 1e-7,
                            "{shape:?} layer {layer}: {g} {d} of {scale}"
                        );
                    }
                }
            }
        }
    }
}

/// The penalty must reach every layer, and through batch normalisation also gains and offsets.
#[test]
fn the_penalty_reaches_every_layer() {
    for shape in shapes() {
        let net = network(shape);
        let mut tape = Tape::new(shape, ROWS, COLS);
        tape.input = inputs(shape);
        let mut gradient = vec![0.0; net.values.len()];
        Penalty::new(shape, ROWS, COLS).add(&net, &mut tape, 1.0, &mut gradient);
        for layer in 0..LAYERS {
            let [weights, offsets, gains] = shape.places(layer);
            assert!(gradient[weights].iter().any(|g| *g != 0.0), "layer {layer}");
            let hidden = shape.normalised(layer);
            assert!(gradient[gains].iter().filter(|g| **g != 0.0).count() == if hidden { 32 } else { 0 });
            // The offset of the last normalised layer moves nothing but kinks.
            let moves = shape.normalised(layer + 1);
            assert_eq!(gradient[offsets].iter().any(|g| *g != 0.0), moves, "layer {layer}");
        }
    }
}

#[test]
fn folding_keeps_the_function() {
    let shape = Shape { inputs: 1, width: 32, batch_norm: true };
    let mut net = network(shape);
    let mut tape = Tape::new(shape, ROWS, COLS);
    tape.input = inputs(shape);
    let mut running = net.running.clone();
    // The running moments come to those of the only batch, its variance without bias.
    (0..400).for_each(|_| tape.forward(&net, Some(&mut running)));
    net.running = running;
    let folded = net.folded();
    let mut plain = Tape::new(folded.shape, ROWS, COLS);
    plain.input = tape.input.clone();
    plain.forward(&folded, None);
    for (a, b) in plain.out.values().iter().zip(tape.out.values()) {
        assert!((a - b).abs() < 0.05 * (1.0 + b.abs()), "{a} {b}");
    }
}
