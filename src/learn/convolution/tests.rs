//! Against candle's own convolution, finite differences and another number of threads.

use super::*;
use crate::learn::ParamStore;
use crate::seed::Seed;
use candle_core::{DType, Device, Tensor};

const PAIRS: [(usize, usize); 9] =
    [(1, 32), (2, 64), (3, 32), (32, 32), (32, 64), (64, 64), (32, 1), (64, 2), (128, 32)];

fn flat(t: &Tensor) -> Vec<f32> {
    t.to_dtype(DType::F32).unwrap().flatten_all().unwrap().to_vec1::<f32>().unwrap()
}

fn assert_close(what: &str, a: &[f32], b: &[f32], tolerance: f32) {
    assert_eq!(a.len(), b.len());
    let scale = b.iter().fold(0f32, |m, v| m.max(v.abs()));
    let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0f32, f32::max);
    assert!(worst <= tolerance * scale, "{what}: off by {worst} of {scale}");
}

/// candle's convolution in double precision, from and to our layout.
fn candle_twin(image: &Tensor, weights: &Tensor) -> Tensor {
    let (_, channels, out_channels) = weights.dims3().unwrap();
    let image = image.to_dtype(DType::F64).unwrap().permute((2, 0, 1)).unwrap().unsqueeze(0).unwrap();
    let weights = weights.to_dtype(DType::F64).unwrap().reshape((3, 3, channels, out_channels)).unwrap();
    let weights = weights.permute((3, 2, 0, 1)).unwrap().contiguous().unwrap();
    let out = image.contiguous().unwrap().conv2d(&weights, 0, 1, 1, 1).unwrap();
    out.squeeze(0).unwrap().permute((1, 2, 0)).unwrap().contiguous().unwrap()
}

/// Sides that leave every kind of tile end; the last one has more tiles than a pass, and odd sides.
#[test]
fn equals_candle_forward_and_backward() {
    for (channels, out_channels) in PAIRS {
        for (rows, cols) in [(3, 3), (9, 22), (21, 40), (9, 103)] {
            let mut params = ParamStore::new(Seed(5));
            let image = params.normal("image", (rows, cols, channels), 1.0).unwrap();
            let weights = params.normal("weights", (9, channels, out_channels), 1.0).unwrap();
            let shape = (rows - 2, cols - 2, out_channels);
            let toward = ParamStore::new(Seed(6)).normal("toward", shape, 1.0).unwrap();
            let ours = convolve3(&image, &weights).unwrap();
            let twin = candle_twin(&image, &weights);
            let what = format!("{channels} -> {out_channels} at {rows}x{cols}");
            assert_close(&what, &flat(&ours), &flat(&twin), 1e-6 * (channels as f32).sqrt());
            let a = (ours * &toward).unwrap().sum_all().unwrap().backward().unwrap();
            let toward = toward.to_dtype(DType::F64).unwrap();
            let b = (twin * toward).unwrap().sum_all().unwrap().backward().unwrap();
            for (name, var) in params.iter() {
                let (a, b) = (flat(a.get(var).unwrap()), flat(b.get(var).unwrap()));
                assert_close(&format!("{what}, gradient of {name}"), &a, &b, 1e-5);
            }
        }
    }
}

/// candle's convolution of any side and stride in double precision, from and to our layout.
fn kernel_twin(image: &Tensor, weights: &Tensor, side: usize, stride: usize) -> Tensor {
    let (_, channels, out_channels) = weights.dims3().unwrap();
    let image = image.permute((2, 0, 1)).unwrap().unsqueeze(0).unwrap().contiguous().unwrap();
    let weights = weights.reshape((side, side, channels, out_channels)).unwrap();
    let weights = weights.permute((3, 2, 0, 1)).unwrap().contiguous().unwrap();
    // candle's way back of a stride fails where rows and columns leave over different numbers of cells.
    let whole = image.conv2d(&weights, 0, 1, 1, 1).unwrap();
    let every = |n: usize| Tensor::from_iter((0..n as u32).step_by(stride), &Device::Cpu).unwrap();
    let (_, _, rows, cols) = whole.dims4().unwrap();
    let out = whole.index_select(&every(rows), 2).unwrap().index_select(&every(cols), 3).unwrap();
    out.squeeze(0).unwrap().permute((1, 2, 0)).unwrap().contiguous().unwrap()
}

/// (side, stride, channels, output channels): every kind of tile and group end, with inputs that strides leave over, and pairs
/// that have a fast way.
const KERNELS: [(usize, usize, usize, usize); 12] = [
    (1, 1, 5, 40),
    (1, 1, 33, 1),
    (2, 1, 3, 7),
    (2, 2, 4, 9),
    (3, 1, 24, 48),
    (3, 1, 32, 64),
    (3, 1, 32, 3),
    (3, 2, 6, 33),
    (4, 1, 7, 65),
    (4, 2, 64, 16),
    (4, 2, 3, 3),
    (3, 1, 130, 512),
];

#[test]
fn kernels_of_all_sizes_equal_candles() {
    for (side, stride, channels, out_channels) in KERNELS {
        for (rows, cols) in [(4, 4), (9, 14), (8, 33)] {
            let kernel = Kernel::new(side, stride).unwrap();
            let mut params = ParamStore::new(Seed(5));
            let image = params.normal("image", (rows, cols, channels), 1.0).unwrap();
            let weights = params.normal("weights", (side * side, channels, out_channels), 1.0).unwrap();
            let (out_rows, out_cols) = (kernel.outputs(rows), kernel.outputs(cols));
            let shape = (out_rows, out_cols, out_channels);
            let toward = flat(&ParamStore::new(Seed(6)).normal("toward", shape, 1.0).unwrap());
            let (pixels, taps) = (flat(&image), flat(&weights));
            let input = Image::new(rows, cols, channels, &pixels);
            let mut out = Plane::zeros(out_rows, out_cols, out_channels, 1);
            kernel.convolve(input, &taps, &mut out, Finish::Store);
            let mut delta = Plane::zeros(out_rows, out_cols, out_channels, kernel.frame());
            for (row, values) in toward.chunks_exact(out_cols * out_channels).enumerate() {
                delta.row_mut(row).copy_from_slice(values);
            }
            let mut d_weights = vec![0.0; taps.len()];
            kernel.add_weight_gradient(input, &delta, &mut d_weights);
            let mut d_image = Plane::zeros(rows, cols, channels, 0);
            d_image.values_mut().fill(7.0);
            kernel.input_gradient(&delta, &taps, &mut d_image, Finish::Store);

            let var = |t: &Tensor| candle_core::Var::from_tensor(&t.to_dtype(DType::F64).unwrap()).unwrap();
            let (image, weights) = (var(&image), var(&weights));
            let twin = kernel_twin(&image, &weights, side, stride);
            let toward = Tensor::from_vec(toward, shape, &Device::Cpu).unwrap().to_dtype(DType::F64).unwrap();
            let gradients = (&twin * toward).unwrap().sum_all().unwrap().backward().unwrap();
            let what = format!("{side}x{side} by {stride}, {channels} -> {out_channels} at {rows}x{cols}");
            let got: Vec<f32> = (0..out_rows).flat_map(|row| out.row(row).to_vec()).collect();
            assert_close(&what, &got, &flat(&twin), 1e-5);
            assert_close(
                &format!("{what}, input"),
                d_image.values(),
                &flat(gradients.get(&image).unwrap()),
                1e-5,
            );
            assert_close(
                &format!("{what}, weights"),
                &d_weights,
                &flat(gradients.get(&weights).unwrap()),
                1e-5,
            );
        }
    }
}

/// The direct sum is the oracle of the fast ways.
#[test]
fn fast_ways_equal_the_direct_sum() {
    let values = |n: usize, seed: u64| flat(&ParamStore::new(Seed(seed)).normal("x", n, 1.0).unwrap());
    for (channels, out_channels) in PAIRS {
        let input = Plane::from_values(13, 20, channels, values(13 * 20 * channels, 1));
        let weights = values(9 * channels * out_channels, 2);
        let bias = values(out_channels, 3);
        let finish = Finish::Activate { bias: &bias, leak: 0.2 };
        let [mut fast, mut direct] = [(); 2].map(|()| Plane::zeros(11, 18, out_channels, 2));
        convolve(&input, &weights, &mut fast, finish);
        general::forward(3, 1, (&input).into(), &weights, &mut direct, finish);
        assert_close("forward", fast.values(), direct.values(), 1e-5);
        let [mut a, mut b] = [(); 2].map(|()| vec![0.5; weights.len()]);
        add_weight_gradient(&input, &fast, &mut a);
        general::add_weight_gradient(3, 1, (&input).into(), &fast, &mut b);
        assert_close("weights", &a, &b, 1e-5);
        if check_channels(out_channels, channels).is_ok() {
            let [mut a, mut b] = [(); 2].map(|()| Plane::zeros(13, 20, channels, 0));
            let by = values(13 * 20 * channels, 4);
            let finish = Finish::Damp { by: &by, leak: 0.3 };
            convolve(&fast, &turned(&weights, channels, out_channels), &mut a, finish);
            general::input_gradient(3, 1, 0, &fast, &weights, &mut b, finish);
            assert_close("input", a.values(), b.values(), 1e-5);
        }
    }
}

#[test]
fn kernels_that_do_not_exist_are_refused() {
    for (side, stride) in [(0, 1), (5, 1), (3, 0), (3, 3), (1, 2)] {
        assert!(Kernel::new(side, stride).is_err(), "{side} {stride}");
    }
    assert_eq!(Kernel::new(4, 2).unwrap().outputs(11), 4);
}

/// The sum of squares of the output is quadratic in every input: central differences are exact but for rounding.
#[test]
fn gradients_equal_finite_differences() {
    let mut params = ParamStore::new(Seed(7));
    params.normal("image", (7, 9, 2), 1.0).unwrap();
    params.normal("weights", (9, 2, 32), 1.0).unwrap();
    let tensors: Vec<Tensor> = params.iter().map(|(_, v)| v.as_tensor().clone()).collect();
    let loss = |image: &Tensor, weights: &Tensor| {
        convolve3(image, weights).unwrap().sqr().unwrap().sum_all().unwrap()
    };
    let gradients = loss(&tensors[0], &tensors[1]).backward().unwrap();
    for which in 0..2 {
        let gradient = flat(gradients.get(&tensors[which]).unwrap());
        for at in [0, 17, gradient.len() - 1] {
            let shifted = |by: f32| {
                let mut values = flat(&tensors[which]);
                values[at] += by;
                let moved = Tensor::from_vec(values, tensors[which].shape(), &Device::Cpu).unwrap();
                let both = if which == 0 { (&moved, &tensors[1]) } else { (&tensors[0], &moved) };
                f64::from(loss(both.0, both.1).to_scalar::<f32>().unwrap())
            };
            let difference = (shifted(0.5) - shifted(-0.5)) as f32;
            assert!((difference - gradient[at]).abs() < 2e-3 * (1.0 + gradient[at].abs()), "{which} {at}");
        }
    }
}

#[test]
fn finishes_are_the_activation_and_its_derivative() {
    let values = |n: usize, seed: u64| {
        let mut params = ParamStore::new(Seed(seed));
        flat(&params.normal("x", n, 1.0).unwrap())
    };
    for (channels, out_channels) in [(32, 32), (32, 1)] {
        let input = Plane::from_values(8, 17, channels, values(8 * 17 * channels, 1));
        let weights = values(9 * channels * out_channels, 2);
        let (bias, by) = (values(out_channels, 3), values(6 * 15 * out_channels, 4));
        let run = |finish: Finish<'_>| {
            let mut out = Plane::zeros(6, 15, out_channels, 2);
            convolve(&input, &weights, &mut out, finish);
            (0..6).flat_map(|row| out.row(row).to_vec()).collect::<Vec<f32>>()
        };
        let plain = run(Finish::Store);
        let active = run(Finish::Activate { bias: &bias, leak: 0.2 });
        let damped = run(Finish::Damp { by: &by, leak: 0.2 });
        for i in 0..plain.len() {
            let sum = plain[i] + bias[i % out_channels];
            assert_eq!(active[i], if sum > 0.0 { sum } else { 0.2 * sum });
            assert_eq!(damped[i], if by[i] > 0.0 { plain[i] } else { 0.2 * plain[i] });
        }
    }
}

#[test]
fn the_frame_stays_zero() {
    let input = Plane::from_values(6, 7, 32, vec![1.0; 6 * 7 * 32]);
    let mut out = Plane::zeros(4, 5, 32, 2);
    convolve(&input, &[1.0; 9 * 32 * 32], &mut out, Finish::Store);
    let inside: f32 = (0..4).map(|row| out.row(row).iter().sum::<f32>()).sum();
    assert_eq!(inside, out.values().iter().sum::<f32>());
    assert_eq!(inside, 4.0 * 5.0 * 32.0 * 288.0);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let mut params = ParamStore::new(Seed(9));
    let image = flat(&params.normal("image", (70, 41, 32), 1.0).unwrap());
    let weights = flat(&params.normal("weights", (9, 32, 32), 1.0).unwrap());
    let image = Plane::from_values(70, 41, 32, image);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut out = Plane::zeros(68, 39, 32, 0);
            convolve(&image, &weights, &mut out, Finish::Store);
            let mut gradient = vec![0.0; weights.len()];
            add_weight_gradient(&image, &out, &mut gradient);
            (out, gradient)
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(5));
}

/// What tiled generators rely on: the sums of a window are those of the whole where it begins in an even row and column.
#[test]
fn an_even_window_has_the_bytes_of_the_whole() {
    let mut params = ParamStore::new(Seed(10));
    let image = flat(&params.normal("image", (40, 70, 32), 1.0).unwrap());
    let weights = flat(&params.normal("weights", (9, 32, 64), 1.0).unwrap());
    let mut whole = Plane::zeros(38, 68, 64, 0);
    convolve(&Plane::from_values(40, 70, 32, image.clone()), &weights, &mut whole, Finish::Store);
    for (top, left, rows, cols) in [(2, 4, 9, 11), (12, 50, 28, 20), (0, 2, 5, 60)] {
        let lines = (top..top + rows).map(|r| &image[(r * 70 + left) * 32..(r * 70 + left + cols) * 32]);
        let window = Plane::from_values(rows, cols, 32, lines.flatten().copied().collect());
        let mut out = Plane::zeros(rows - 2, cols - 2, 64, 1);
        convolve(&window, &weights, &mut out, Finish::Store);
        for row in 0..rows - 2 {
            assert_eq!(out.row(row), &whole.row(top + row)[left * 64..(left + cols - 2) * 64]);
        }
    }
}

#[test]
fn channels_without_a_kernel_are_refused() {
    for (channels, out_channels) in [(4, 32), (33, 32), (32, 48), (32, 3), (1, 1), (2, 2), (32, 0)] {
        assert!(check_channels(channels, out_channels).is_err(), "{channels} -> {out_channels}");
    }
    let (image, weights) = (Tensor::zeros((5, 5, 4), DType::F32, &Device::Cpu).unwrap(), (9, 4, 32));
    let weights = Tensor::zeros(weights, DType::F32, &Device::Cpu).unwrap();
    assert!(convolve3(&image, &weights).unwrap_err().to_string().contains("allowed: 1, 2, 3, 32"));
}
