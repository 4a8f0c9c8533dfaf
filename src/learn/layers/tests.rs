//! Every layer against a twin of candle's operations in double precision, and the gradient penalty against finite differences of
//! that twin.

use super::*;
use crate::learn::convolution::Plane;
use crate::learn::gan::{NormOver, add_gradient_penalty};
use candle_core::{DType, Device, Tensor, Var};

fn draw(n: usize, name: &str) -> Vec<f32> {
    let mut stream = Seed(4).stream(name);
    (0..n).map(|_| stream.random_range(-1.0f32..1.0)).collect()
}

/// A net with the sizes of its inputs, and how many images at once.
struct Case {
    name: &'static str,
    net: Net,
    inputs: Vec<(usize, usize)>,
    images: usize,
}

fn conv(
    side: usize,
    stride: usize,
    channels: usize,
    padding: Padding,
    norm: Option<Norm>,
    activation: Activation,
) -> Conv {
    Conv { side, stride, channels, padding, transposed: false, norm, activation }
}

const LEAKY: Activation = Activation::Leaky(0.2);

/// An encoder and decoder with skips, at odd sizes, with every padding and resampling.
fn with_skips() -> Case {
    let mut net = Net::new();
    let x = net.input(6).unwrap();
    let noise = net.input(1).unwrap();
    let wide = net.conv(x, conv(3, 1, 7, Padding::Zero(1), Some(Norm::Instance), LEAKY)).unwrap();
    let half = net.conv(wide, conv(4, 2, 18, Padding::Reflect(1), None, LEAKY)).unwrap();
    let both = net.concat(half, noise).unwrap();
    let quarter = net.conv(both, conv(3, 2, 33, Padding::Repeat(1), Some(Norm::Layer), LEAKY)).unwrap();
    let up = net.resample(quarter, Resampling::Bilinear, Size::Like(wide)).unwrap();
    let narrow = net.conv(up, conv(1, 1, 7, Padding::Valid, None, Activation::None)).unwrap();
    let sum = net.add(narrow, wide).unwrap();
    let mean = net.resample(sum, Resampling::Mean, Size::Over(2)).unwrap();
    let nearest = net.resample(mean, Resampling::Nearest, Size::Times(3)).unwrap();
    let dropped = net.dropout(nearest, 0.3).unwrap();
    net.conv(dropped, conv(4, 1, 3, Padding::Valid, None, Activation::Tanh)).unwrap();
    Case { name: "skips", net, inputs: vec![(11, 8), (5, 4)], images: 2 }
}

/// What SinGAN plays with, smaller: the fast convolutions.
fn plain(norm: Option<Norm>) -> Case {
    let mut net = Net::new();
    let mut at = net.input(2).unwrap();
    for _ in 0..2 {
        at = net.conv(at, conv(3, 1, 32, Padding::Valid, norm, LEAKY)).unwrap();
    }
    net.conv(at, Conv::new(3, 1)).unwrap();
    Case { name: "plain", net, inputs: vec![(10, 9)], images: 1 }
}

/// A critic of strides that ends in one number an image.
fn strided(norm: Norm, images: usize) -> Case {
    let mut net = Net::new();
    let x = net.input(3).unwrap();
    let a = net.conv(x, conv(4, 2, 8, Padding::Zero(1), None, LEAKY)).unwrap();
    let b = net.conv(a, conv(3, 2, 17, Padding::Zero(1), Some(norm), LEAKY)).unwrap();
    let c = net.conv(b, conv(2, 1, 5, Padding::Valid, None, Activation::Tanh)).unwrap();
    let d = net.dense(c, 2 * 5, (1, 2, 3), Activation::Sigmoid).unwrap();
    net.dense(d, 6, (1, 1, 1), Activation::None).unwrap();
    Case { name: "strides", net, inputs: vec![(12, 7)], images }
}

/// The decoder of pix2pix: transposed convolutions, one of which reads a layer that others read too.
fn transposed() -> Case {
    let mut net = Net::new();
    let x = net.input(5).unwrap();
    let a = net.conv(x, conv(3, 2, 9, Padding::Valid, None, LEAKY)).unwrap();
    let up = |side, channels, padding, norm, activation| Conv {
        transposed: true,
        ..conv(side, 2, channels, padding, norm, activation)
    };
    let b = net.conv(a, up(4, 20, Padding::Zero(1), Some(Norm::Batch), LEAKY)).unwrap();
    let c = net.conv(a, up(4, 20, Padding::Zero(1), None, Activation::None)).unwrap();
    let sum = net.add(b, c).unwrap();
    let d = net.conv(sum, up(3, 4, Padding::Valid, None, LEAKY)).unwrap();
    let same = Conv { stride: 1, ..up(3, 2, Padding::Zero(1), None, Activation::Tanh) };
    net.conv(d, same).unwrap();
    Case { name: "transposed", net, inputs: vec![(8, 7)], images: 2 }
}

fn cases() -> Vec<Case> {
    vec![
        with_skips(),
        transposed(),
        plain(None),
        plain(Some(Norm::Batch)),
        strided(Norm::Batch, 3),
        strided(Norm::Instance, 1),
        strided(Norm::Layer, 2),
    ]
}

impl Case {
    /// Random gains and offsets too, so that none of them hides behind its first value.
    fn values(&self) -> Vec<f32> {
        let mut values = self.net.start(Start::Scaled, 1.0, Seed(3));
        for layer in self.net.weighted() {
            let [_, offsets, gains] = self.net.places(layer);
            for i in offsets.chain(gains) {
                values[i] += 0.3 * draw(values.len(), "shift")[i];
            }
        }
        values
    }

    fn tape(&self) -> Tape {
        let mut tape = Tape::new(&self.net, self.images, &self.inputs);
        for (layer, (rows, cols)) in self.net.inputs().zip(&self.inputs) {
            for image in 0..self.images {
                let plane = tape.input_mut(layer, image);
                let values = draw(rows * cols * plane.channels(), &format!("input {layer:?} {image}"));
                plane.values_mut().copy_from_slice(&values);
            }
        }
        tape.draw_dropout(&mut Seed(8).stream("dropout"));
        tape
    }

    /// The inputs of the twin: (images, channels, rows, columns).
    fn images(&self, tape: &Tape) -> Vec<Tensor> {
        let images = |layer| {
            let all: Vec<Tensor> = (0..self.images).map(|image| image_of(tape.value(layer, image))).collect();
            Tensor::cat(&all, 0).unwrap()
        };
        self.net.inputs().map(images).collect()
    }
}

/// (1, channels, rows, columns) in double precision.
fn image_of(plane: &Plane) -> Tensor {
    let rows: Vec<f32> = (0..plane.rows()).flat_map(|row| plane.row(row).to_vec()).collect();
    let t = Tensor::from_vec(rows, (plane.rows(), plane.cols(), plane.channels()), &Device::Cpu).unwrap();
    let t = t.to_dtype(DType::F64).unwrap().permute((2, 0, 1)).unwrap().unsqueeze(0).unwrap();
    t.contiguous().unwrap()
}

/// Values of (images, channels, rows, columns) in our order.
fn flat(t: &Tensor) -> Vec<f64> {
    t.permute((0, 2, 3, 1)).unwrap().contiguous().unwrap().flatten_all().unwrap().to_vec1::<f64>().unwrap()
}

/// Rows and columns by two matrices, written down from the definitions anew.
fn by_matrices(x: &Tensor, of: impl Fn(usize, usize) -> Vec<Vec<f64>>, sizes: (usize, usize)) -> Tensor {
    let (images, channels, rows, cols) = x.dims4().unwrap();
    let matrix = |inputs: usize, outputs: usize| {
        let values: Vec<f64> = of(inputs, outputs).concat();
        Tensor::from_vec(values, (outputs, inputs), &Device::Cpu).unwrap()
    };
    let (down, across) = (matrix(rows, sizes.0), matrix(cols, sizes.1).t().unwrap());
    let x = x.reshape((images * channels, rows, cols)).unwrap();
    let down = down.unsqueeze(0).unwrap().broadcast_as((images * channels, sizes.0, rows)).unwrap();
    let across = across.unsqueeze(0).unwrap().broadcast_as((images * channels, cols, sizes.1)).unwrap();
    let x = down.contiguous().unwrap().matmul(&x.contiguous().unwrap()).unwrap();
    let x = x.matmul(&across.contiguous().unwrap()).unwrap();
    x.reshape((images, channels, sizes.0, sizes.1)).unwrap()
}

fn row_of(inputs: usize, taps: &[(isize, f64)]) -> Vec<f64> {
    let mut row = vec![0.0; inputs];
    taps.iter().filter(|(i, _)| (0..inputs as isize).contains(i)).for_each(|(i, w)| row[*i as usize] += w);
    row
}

fn resampled(x: &Tensor, how: Resampling, sizes: (usize, usize)) -> Tensor {
    let of = |inputs: usize, outputs: usize| {
        let ratio = inputs as f64 / outputs as f64;
        let row = |i: usize| match how {
            Resampling::Nearest => row_of(inputs, &[((i as f64 * ratio) as isize, 1.0)]),
            Resampling::Bilinear => {
                let at = ((i as f64 + 0.5) * ratio - 0.5).clamp(0.0, (inputs - 1) as f64);
                let low = at.floor();
                let high = (low as isize + 1).min(inputs as isize - 1);
                row_of(inputs, &[(low as isize, 1.0 - (at - low)), (high, at - low)])
            }
            Resampling::Mean => {
                // A thousand points in each cell.
                let mut row = vec![0.0; inputs];
                (0..1000 * inputs).for_each(|k| {
                    let at = (i as f64 + (k as f64 + 0.5) / (1000 * inputs) as f64) * ratio;
                    row[at as usize] += 1.0 / (1000 * inputs) as f64;
                });
                row
            }
        };
        (0..outputs).map(row).collect()
    };
    by_matrices(x, of, sizes)
}

fn padded(x: &Tensor, padding: Padding) -> Tensor {
    let width = padding.width();
    let of = |inputs: usize, outputs: usize| {
        let row = |i: usize| {
            let (at, last) = (i as isize - width as isize, inputs as isize - 1);
            let at = match padding {
                Padding::Reflect(_) if at < 0 => -at,
                Padding::Reflect(_) if at > last => 2 * last - at,
                Padding::Repeat(_) => at.max(0).min(last),
                _ => at,
            };
            row_of(inputs, &[(at, 1.0)])
        };
        (0..outputs).map(row).collect()
    };
    let (_, _, rows, cols) = x.dims4().unwrap();
    by_matrices(x, of, (rows + 2 * width, cols + 2 * width))
}

/// Every so many rows and columns, the first ones included. A stride in candle's own convolution has a way back that fails where
/// rows and columns leave over different numbers of cells.
fn every(x: &Tensor, step: usize) -> Tensor {
    let (_, _, rows, cols) = x.dims4().unwrap();
    let every = |n: usize| Tensor::from_iter((0..n as u32).step_by(step), &Device::Cpu).unwrap();
    x.index_select(&every(rows), 2).unwrap().index_select(&every(cols), 3).unwrap()
}

/// Zeros between rows and columns.
fn spread(x: &Tensor, step: usize) -> Tensor {
    let row = |inputs, i: usize| {
        let taps = [((i / step) as isize, 1.0)];
        row_of(inputs, if i.is_multiple_of(step) { &taps } else { &[] })
    };
    let (_, _, rows, cols) = x.dims4().unwrap();
    let sizes = ((rows - 1) * step + 1, (cols - 1) * step + 1);
    by_matrices(x, |inputs, outputs| (0..outputs).map(|i| row(inputs, i)).collect(), sizes)
}

fn normalised(x: &Tensor, norm: Norm) -> Tensor {
    let over: &[usize] = match norm {
        Norm::Batch => &[0, 2, 3],
        Norm::Instance => &[2, 3],
        Norm::Layer => &[1, 2, 3],
    };
    let mean = |t: &Tensor| over.iter().fold(t.clone(), |t, dim| t.mean_keepdim(*dim).unwrap());
    let centred = x.broadcast_sub(&mean(x)).unwrap();
    let variance = mean(&centred.sqr().unwrap());
    centred.broadcast_div(&(variance + 1e-5).unwrap().sqrt().unwrap()).unwrap()
}

fn activated(x: Tensor, activation: Activation) -> Tensor {
    match activation {
        Activation::None => x,
        Activation::Leaky(leak) => {
            (x.relu().unwrap() - (x.neg().unwrap().relu().unwrap() * f64::from(leak)).unwrap()).unwrap()
        }
        Activation::Tanh => x.tanh().unwrap(),
        Activation::Sigmoid => ((x.neg().unwrap().exp().unwrap() + 1.0).unwrap()).recip().unwrap(),
    }
}

/// The net of candle's operations; `values` in the order of ours.
fn twin(case: &Case, values: &Tensor, inputs: &[Tensor], kept: &Tape) -> Tensor {
    let mut inputs = inputs.iter().cloned();
    let mut done: Vec<Tensor> = Vec::new();
    for (i, layer) in case.net.layers.iter().enumerate() {
        let [weights, biases, gains] = layer.places.clone();
        let part = |r: Range<usize>| values.narrow(0, r.start, r.len()).unwrap();
        let per_channel = |r: Range<usize>| part(r).reshape((1, layer.channels, 1, 1)).unwrap();
        let size = |layer: usize| {
            let (_, _, rows, cols) = done[layer].dims4().unwrap();
            (rows, cols)
        };
        let next = match &layer.kind {
            Kind::Input => inputs.next().unwrap(),
            Kind::Conv { from, conv, .. } => {
                let inputs = case.net.layers[*from].channels;
                let w = if conv.transposed {
                    // (taps, output channels, input channels), turned round.
                    let w = part(weights).reshape((conv.side, conv.side, layer.channels, inputs)).unwrap();
                    let back = Tensor::from_iter((0..conv.side as u32).rev(), &Device::Cpu).unwrap();
                    let w = w.index_select(&back, 0).unwrap().index_select(&back, 1).unwrap();
                    w.permute((2, 3, 0, 1)).unwrap()
                } else {
                    let w = part(weights).reshape((conv.side, conv.side, inputs, layer.channels)).unwrap();
                    w.permute((3, 2, 0, 1)).unwrap()
                };
                let x = if conv.transposed {
                    let zeros = Padding::Zero(conv.side - 1 - conv.padding.width());
                    padded(&spread(&done[*from], conv.stride), zeros)
                } else {
                    padded(&done[*from], conv.padding)
                };
                let x = x.contiguous().unwrap().conv2d(&w.contiguous().unwrap(), 0, 1, 1, 1).unwrap();
                let x = if conv.transposed { x } else { every(&x, conv.stride) };
                let x = match conv.norm {
                    Some(norm) => normalised(&x, norm).broadcast_mul(&per_channel(gains)).unwrap(),
                    None => x,
                };
                activated(x.broadcast_add(&per_channel(biases)).unwrap(), conv.activation)
            }
            Kind::Dense { from, inputs, shape: (rows, cols), activation } => {
                let x = done[*from].permute((0, 2, 3, 1)).unwrap().contiguous().unwrap();
                let x = x.reshape((case.images, *inputs)).unwrap();
                let outputs = rows * cols * layer.channels;
                let y = x.matmul(&part(weights).reshape((*inputs, outputs)).unwrap()).unwrap();
                let y = y.broadcast_add(&part(biases).reshape((1, outputs)).unwrap()).unwrap();
                let y = y.reshape((case.images, *rows, *cols, layer.channels)).unwrap();
                activated(y.permute((0, 3, 1, 2)).unwrap().contiguous().unwrap(), *activation)
            }
            Kind::Resample { from, how, size: to } => {
                let (rows, cols) = size(*from);
                let sizes = match *to {
                    Size::Times(n) => (rows * n, cols * n),
                    Size::Over(n) => (rows.div_ceil(n), cols.div_ceil(n)),
                    Size::Like(LayerId(other)) => size(other),
                };
                resampled(&done[*from], *how, sizes)
            }
            Kind::Add(a, b) => (&done[*a] + &done[*b]).unwrap(),
            Kind::Concat(a, b) => Tensor::cat(&[&done[*a], &done[*b]], 1).unwrap(),
            Kind::Dropout { from, .. } => {
                let (rows, cols) = size(*from);
                let factors: Vec<f64> =
                    kept.kept(LayerId(i)).iter().flatten().map(|f| f64::from(*f)).collect();
                let factors =
                    Tensor::from_vec(factors, (case.images, rows, cols, layer.channels), &Device::Cpu);
                (&done[*from] * factors.unwrap().permute((0, 3, 1, 2)).unwrap()).unwrap()
            }
        };
        done.push(next);
    }
    done.pop().unwrap()
}

fn assert_close(what: &str, a: &[f32], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len(), "{what}");
    let scale = b.iter().fold(1e-9f64, |m, v| m.max(v.abs()));
    let worst = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0f64, f64::max);
    assert!(worst <= tolerance * scale, "{what}: off by {worst} of {scale}");
}

fn all(tape: &Tape, of: impl Fn(&Tape, usize) -> Vec<f32>) -> Vec<f32> {
    (0..tape.images()).flat_map(|image| of(tape, image)).collect()
}

fn inside(plane: &Plane) -> Vec<f32> {
    (0..plane.rows()).flat_map(|row| plane.row(row).to_vec()).collect()
}

#[test]
fn passes_equal_candles_operations() {
    for case in cases() {
        let (values, mut tape) = (case.values(), case.tape());
        tape.forward(&values, None);
        let count = inside(tape.output(0)).len();
        let toward = draw(count * case.images, "toward");
        for (image, toward) in toward.chunks_exact(count).enumerate() {
            let delta = tape.output_delta(image);
            let length = delta.cols() * delta.channels();
            for (row, values) in toward.chunks_exact(length).enumerate() {
                delta.row_mut(row).copy_from_slice(values);
            }
        }
        let mut gradient = vec![0.0; values.len()];
        tape.backward(&values, Some(&mut gradient), true);

        let exact = Var::from_slice(&values, values.len(), &Device::Cpu).unwrap();
        let exact = Var::from_tensor(&exact.to_dtype(DType::F64).unwrap()).unwrap();
        let inputs: Vec<Var> =
            case.images(&tape).iter().map(|image| Var::from_tensor(image).unwrap()).collect();
        let tensors: Vec<Tensor> = inputs.iter().map(|var| var.as_tensor().clone()).collect();
        let out = twin(&case, &exact, &tensors, &tape);
        let name = case.name;
        assert_close(&format!("{name}: output"), &all(&tape, |t, i| inside(t.output(i))), &flat(&out), 1e-5);
        let (images, channels, rows, cols) = out.dims4().unwrap();
        let toward = Tensor::from_vec(toward, (images, rows, cols, channels), &Device::Cpu).unwrap();
        let toward = toward.to_dtype(DType::F64).unwrap().permute((0, 3, 1, 2)).unwrap();
        let gradients = (&out * toward).unwrap().sum_all().unwrap().backward().unwrap();
        for (layer, input) in case.net.inputs().zip(&inputs) {
            let got = all(&tape, |t, i| inside(t.delta(layer, i)));
            assert_close(
                &format!("{name}: gradient of {layer:?}"),
                &got,
                &flat(gradients.get(input).unwrap()),
                1e-4,
            );
        }
        let want = gradients.get(&exact).unwrap().to_vec1::<f64>().unwrap();
        for layer in case.net.weighted() {
            for (place, what) in case.net.places(layer).into_iter().zip(["weights", "bias", "gains"]) {
                assert_close(
                    &format!("{name}: {layer:?}, {what}"),
                    &gradient[place.clone()],
                    &want[place],
                    1e-4,
                );
            }
        }
    }
}

/// The penalty of the twin in double precision, from one ordinary backward pass.
fn penalty_of(case: &Case, values: &[f64], inputs: &[Tensor], over: NormOver, kept: &Tape) -> f64 {
    let values = Tensor::from_slice(values, values.len(), &Device::Cpu).unwrap();
    let first = Var::from_tensor(&inputs[0]).unwrap();
    let mut all = inputs.to_vec();
    all[0] = first.as_tensor().clone();
    let gradients = twin(case, &values, &all, kept).sum_all().unwrap().backward().unwrap();
    let g = flat(gradients.get(&first).unwrap());
    let length = match over {
        NormOver::Pixel => first.dim(1).unwrap(),
        NormOver::Image => g.len() / case.images,
    };
    let norms = g.chunks_exact(length).map(|g| g.iter().map(|g| g * g).sum::<f64>().sqrt());
    norms.map(|norm| (norm - 1.0).powi(2)).sum::<f64>() / (g.len() / length) as f64
}

/// Steps of 1e-7 in double precision meet no kink of the leaky ReLU here, so that the real activation can be tested.
#[test]
fn the_penaltys_gradient_equals_finite_differences() {
    for case in cases() {
        for over in [NormOver::Pixel, NormOver::Image] {
            let (values, mut tape) = (case.values(), case.tape());
            let inputs = case.images(&tape);
            let mut gradient = vec![0.0; values.len()];
            let layer = case.net.inputs().next().unwrap();
            let penalty = add_gradient_penalty(&mut tape, &values, layer, over, 1.0, &mut gradient);
            let exact: Vec<f64> = values.iter().map(|v| f64::from(*v)).collect();
            let want = penalty_of(&case, &exact, &inputs, over, &tape);
            assert!((penalty - want).abs() < 1e-4 * want, "{}: {penalty} {want}", case.name);
            let largest = gradient.iter().fold(0f32, |m, g| m.max(g.abs()));
            for layer in case.net.weighted() {
                for place in case.net.places(layer) {
                    for i in place.clone().step_by(place.len() / 4 + 1) {
                        let shifted = |by: f64| {
                            let mut exact = exact.clone();
                            exact[i] += by;
                            penalty_of(&case, &exact, &inputs, over, &tape)
                        };
                        let want = (shifted(1e-7) - shifted(-1e-7)) / 2e-7;
                        let own = gradient[place.clone()].iter().fold(0f32, |m, g| m.max(g.abs()));
                        let scale = f64::from(own.max(1e-2 * largest));
                        let got = f64::from(gradient[i]);
                        assert!(
                            (got - want).abs() <= 2e-3 * scale + 1e-7,
                            "{} {layer:?}: {got} {want} of {scale}",
                            case.name
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    for case in cases() {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (values, mut tape) = (case.values(), case.tape());
                let mut gradient = vec![0.0; values.len()];
                let layer = case.net.inputs().next().unwrap();
                add_gradient_penalty(&mut tape, &values, layer, NormOver::Pixel, 1.0, &mut gradient);
                (gradient, inside(tape.output(0)))
            })
        };
        assert!(run(1) == run(3), "{}", case.name);
    }
}

#[test]
fn folding_keeps_the_function() {
    let case = plain(Some(Norm::Batch));
    let (values, mut tape) = (case.values(), case.tape());
    let mut running = case.net.running();
    // The running moments come to those of the only batch, its variance without bias.
    (0..400).for_each(|_| tape.forward(&values, Some(&mut running)));
    let (net, folded) = case.net.folded(&values, &running);
    assert_eq!(net.value_count(), folded.len());
    let input = case.net.inputs().next().unwrap();
    let mut plain = Tape::new(&net, 1, &case.inputs);
    plain.input_mut(input, 0).clone_from(tape.value(input, 0));
    plain.forward(&folded, None);
    for (a, b) in plain.output(0).values().iter().zip(tape.output(0).values()) {
        assert!((a - b).abs() < 0.05 * (1.0 + b.abs()), "{a} {b}");
    }
}

#[test]
fn dropout_drops_its_share_and_keeps_the_mean() {
    let mut net = Net::new();
    let x = net.input(4).unwrap();
    net.dropout(x, 0.25).unwrap();
    let mut tape = Tape::new(&net, 1, &[(50, 50)]);
    tape.input_mut(x, 0).values_mut().fill(1.0);
    tape.draw_dropout(&mut Seed(1).stream("dropout"));
    tape.forward(&[], None);
    let (out, n) = (tape.output(0).values().to_vec(), 10_000.0);
    let dropped = out.iter().filter(|v| **v == 0.0).count() as f64 / n;
    assert!((dropped - 0.25).abs() < 0.02 && (out.iter().sum::<f32>() / 1e4 - 1.0).abs() < 0.03, "{dropped}");
    tape.draw_dropout(&mut Seed(1).stream("dropout"));
    tape.forward(&[], None);
    assert_eq!(tape.output(0).values(), out, "the same stream drops the same");
    tape.keep_all();
    tape.forward(&[], None);
    assert!(tape.output(0).values().iter().all(|v| *v == 1.0));
}

/// A diagonal matrix has its singular values on the diagonal; the gradient is that of w / sigma(w) by finite differences.
#[test]
fn spectral_norm_divides_by_the_largest_value() {
    let mut net = Net::new();
    let x = net.input(3).unwrap();
    net.conv(x, Conv::new(1, 3)).unwrap();
    let mut values = vec![0.0; net.value_count()];
    (values[0], values[4], values[8]) = (0.5, -4.0, 1.0);
    let mut spectrum = SpectralNorm::new(&net, Seed(2));
    let out = spectrum.normalise(&values, 30);
    assert!((spectrum.sigmas().next().unwrap() - 4.0).abs() < 1e-5);
    assert!((out[4] + 1.0).abs() < 1e-5 && (out[0] - 0.125).abs() < 1e-5);

    let mut values = draw(net.value_count(), "weights");
    let toward = draw(net.value_count(), "toward");
    let mut loss = |values: &[f32]| {
        let out = spectrum.normalise(values, 40);
        (out.iter().zip(&toward).map(|(a, b)| f64::from(a * b)).sum::<f64>(), out)
    };
    let (_, out) = loss(&values);
    let mut differences = Vec::new();
    for i in 0..9 {
        let kept = values[i];
        values[i] = kept + 1e-2;
        let up = loss(&values).0;
        values[i] = kept - 1e-2;
        differences.push((up - loss(&values).0) / 2e-2);
        values[i] = kept;
    }
    loss(&values);
    let mut gradient = toward.clone();
    spectrum.back(&out, &mut gradient);
    for (g, d) in gradient.iter().zip(&differences) {
        assert!((f64::from(*g) - d).abs() < 2e-3, "{g} {d}");
    }
    assert_eq!(gradient[9..], toward[9..], "biases are left alone");
}

#[test]
fn what_cannot_be_built_is_refused_by_name() {
    let mut net = Net::new();
    let (x, y) = (net.input(3).unwrap(), net.input(4).unwrap());
    let message = |r: Result<LayerId>| r.unwrap_err().to_string();
    assert!(message(net.input(0)).contains("1 to 512") && message(net.input(513)).contains("513"));
    assert!(message(net.conv(x, Conv::new(5, 8))).contains("kernel is 5"));
    assert!(
        message(net.conv(x, Conv { stride: 3, ..Conv::new(3, 8) })).contains("stride of a convolution is 3")
    );
    assert!(message(net.conv(x, Conv { stride: 2, ..Conv::new(1, 8) })).contains("stride"));
    assert!(
        message(net.conv(x, Conv { activation: Activation::Leaky(1.5), ..Conv::new(3, 8) })).contains("1.5")
    );
    let bent = Conv { norm: Some(Norm::Layer), activation: Activation::Tanh, ..Conv::new(3, 8) };
    assert!(message(net.conv(x, bent)).contains("Tanh"));
    let mirrored = Conv { transposed: true, padding: Padding::Reflect(1), ..Conv::new(4, 8) };
    assert!(message(net.conv(x, mirrored)).contains("Reflect(1)"));
    assert!(message(net.add(x, y)).contains("channels of a sum is 4"));
    assert!(message(net.dropout(x, 1.0)).contains("rate of dropout is 1"));
    assert!(message(net.resample(x, Resampling::Mean, Size::Over(0))).contains("factor"));
    assert!(message(net.dense(x, 0, (1, 1, 1), Activation::None)).contains("dense"));
}
