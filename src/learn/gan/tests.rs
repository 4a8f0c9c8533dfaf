//! Losses against finite differences, and the loop.

use super::*;
use crate::control::Stop;
use crate::error::Error;
use crate::learn::Resumable;
use crate::learn::layers::{Activation, Conv, Start};
use crate::seed::Seed;
use rand::RngExt;
use serde::{Deserialize, Serialize};

const TURNS: [Turn; 3] = [Turn::Real, Turn::Made, Turn::Generator];

#[test]
fn gradients_of_losses_equal_finite_differences() {
    let scores = Plane::from_values(2, 3, 1, vec![-2.5, -0.4, 0.3, 0.9, 1.7, 4.0]);
    for loss in [Loss::Hinge, Loss::Bce, Loss::Wasserstein] {
        for turn in TURNS {
            let mut delta = Plane::zeros(2, 3, 1, 2);
            loss.of(turn, &scores, 0.7, &mut delta);
            for i in 0..6 {
                let shifted = |by: f32| {
                    let mut scores = scores.clone();
                    scores.values_mut()[i] += by;
                    0.7 * loss.of(turn, &scores, 1.0, &mut Plane::zeros(2, 3, 1, 0))
                };
                let want = (shifted(1e-3) - shifted(-1e-3)) / 2e-3;
                let got = f64::from(delta.row(i / 3)[i % 3]);
                assert!((got - want).abs() < 1e-4, "{loss:?} {turn:?} {i}: {got} {want}");
            }
        }
    }
}

#[test]
fn losses_follow_definitions_and_never_overflow() {
    let at = |loss: Loss, turn, s: f32| {
        loss.of(turn, &Plane::from_values(1, 1, 1, vec![s]), 1.0, &mut Plane::zeros(1, 1, 1, 0))
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-5 * (1.0 + b.abs()), "{a} {b}");
    near(at(Loss::Hinge, Turn::Real, 0.25), 0.75);
    near(at(Loss::Hinge, Turn::Made, 0.25), 1.25);
    near(at(Loss::Hinge, Turn::Real, 3.0), 0.0);
    near(at(Loss::Hinge, Turn::Generator, 3.0), -3.0);
    near(at(Loss::Wasserstein, Turn::Real, 2.0), -2.0);
    near(at(Loss::Wasserstein, Turn::Made, 2.0), 2.0);
    near(at(Loss::Bce, Turn::Real, 1.0), (1.0 + (-1f64).exp()).ln());
    near(at(Loss::Bce, Turn::Made, 1.0), (1.0 + 1f64.exp()).ln());
    near(at(Loss::Bce, Turn::Generator, -1.0), (1.0 + 1f64.exp()).ln());
    for turn in TURNS {
        for s in [-200.0, 200.0] {
            let loss = at(Loss::Bce, turn, s);
            assert!(loss.is_finite() && (loss < 1e-5 || (loss - 200.0).abs() < 1e-3), "{turn:?} {s}: {loss}");
        }
    }
}

/// A generator that learns one number, by a critic of one convolution.
struct Duel {
    players: [Player; 2],
    tapes: [Tape; 2],
    seed: Seed,
}

#[derive(Serialize, Deserialize)]
struct Kept {
    step: usize,
}

impl Resumable for Kept {
    const KEY: &'static str = "duel";
    const TRAINING: &'static str = "duel";

    fn identity(&self) -> &'static str {
        "duel"
    }
}

impl Duel {
    fn new() -> Self {
        let net = |channels: usize| {
            let mut net = Net::new();
            let x = net.input(1).unwrap();
            let hidden = Conv { activation: Activation::Leaky(0.2), ..Conv::new(1, channels) };
            let hidden = net.conv(x, hidden).unwrap();
            net.conv(hidden, Conv::new(1, 1)).unwrap();
            net
        };
        let nets = [net(4), net(8)];
        let tapes = [0, 1].map(|i| Tape::new(&nets[i], 1, &[(4, 4)]));
        let player = |net: Net, name: &str| {
            let values = net.start(Start::Scaled, 1.0, Seed(1).derive(name));
            Player::new(net, values, 0.5)
        };
        let [g, d] = nets;
        Self { players: [player(g, "generator"), player(d, "critic")], tapes, seed: Seed(5) }
    }

    fn input(&self, player: usize) -> LayerId {
        self.players[player].net.inputs().next().unwrap()
    }

    fn state(&self) -> Vec<(String, &[f32])> {
        [self.players[0].state("generator"), self.players[1].state("critic")].concat()
    }

    fn judge(&mut self, map: &Plane, turn: Turn, gradient: Option<&mut [f32]>) -> f64 {
        let (input, values) = (self.input(1), &self.players[1].values);
        let tape = &mut self.tapes[1];
        tape.input_mut(input, 0).clone_from(map);
        tape.forward(values, None);
        let scores = tape.output(0).clone();
        let loss = Loss::Hinge.of(turn, &scores, 1.0, tape.output_delta(0));
        tape.backward(values, gradient, true);
        loss
    }
}

impl Game for Duel {
    type Report = f64;

    fn step(&mut self, step: usize, share: f32) -> f64 {
        let mut stream = self.seed.derive_indexed("step", step).stream("noise");
        let rate = 0.02 * (1.0 - share);
        let input = self.input(0);
        let noise: Vec<f32> = (0..16).map(|_| stream.random_range(-1.0f32..1.0)).collect();
        self.tapes[0].input_mut(input, 0).values_mut().copy_from_slice(&noise);
        self.tapes[0].forward(&self.players[0].values, None);
        let made = self.tapes[0].output(0).clone();
        let real = Plane::from_values(
            4,
            4,
            1,
            (0..16).map(|_| 2.0 + 0.1 * stream.random_range(-1.0f32..1.0)).collect(),
        );
        let mut gradient = vec![0.0; self.players[1].values.len()];
        self.judge(&real, Turn::Real, Some(&mut gradient));
        self.judge(&made, Turn::Made, Some(&mut gradient));
        let (input, values) = (self.input(1), self.players[1].values.clone());
        add_gradient_penalty(&mut self.tapes[1], &values, input, NormOver::Pixel, 1.0, &mut gradient);
        self.players[1].descend(&gradient, rate);
        let mut gradient = vec![0.0; self.players[0].values.len()];
        self.judge(&made, Turn::Generator, None);
        let delta = self.tapes[1].delta(self.input(1), 0).clone();
        let out = self.tapes[0].output_delta(0);
        (0..4).for_each(|row| out.row_mut(row).copy_from_slice(delta.row(row)));
        self.tapes[0].backward(&self.players[0].values, Some(&mut gradient), false);
        self.players[0].descend(&gradient, rate);
        f64::from(made.values().iter().sum::<f32>() / 16.0)
    }
}

const LENGTH: Length = Length { steps: 300, time: None, done: (0, 0.0) };

#[test]
fn players_that_take_turns_learn_the_exemplar() {
    let mut duel = Duel::new();
    let mut means = Vec::new();
    let steps = play(&mut duel, LENGTH, &Stop::new(), |_, _, _, mean| {
        means.push(mean);
        Ok(())
    });
    assert_eq!((steps.unwrap(), means.len()), (300, 300));
    let last = means[280..].iter().sum::<f64>() / 20.0;
    assert!((last - 2.0).abs() < 0.5 && (means[0] - 2.0).abs() > 1.0, "{} to {last}", means[0]);
}

/// Stopped at any step and resumed from what was kept, a game ends with the same numbers.
#[test]
fn a_resumed_game_ends_with_the_same_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let kept = folder.path().join("kept");
    let length = Length { steps: 12, ..LENGTH };
    let mut whole = Duel::new();
    play(&mut whole, length, &Stop::new(), |_, _, _, _| Ok(())).unwrap();
    let mut broken = Duel::new();
    let stopped = play(&mut broken, length, &Stop::new(), |duel, step, _, _| {
        Kept { step: step + 1 }.save(&kept, duel.state())?;
        if step == 6 { Err(Error::value("power", "off", "on")) } else { Ok(()) }
    });
    assert!(stopped.unwrap_err().to_string().contains("power"));
    let (Kept { step }, mut numbers) = Kept::load(&kept, "duel").unwrap();
    let mut resumed = Duel::new();
    for (player, name) in resumed.players.iter_mut().zip(["generator", "critic"]) {
        player.restore(name, step, &mut numbers).unwrap();
    }
    play(&mut resumed, Length { done: (step, 0.0), ..length }, &Stop::new(), |_, _, _, _| Ok(())).unwrap();
    assert!(whole.state() == resumed.state());
}

#[test]
fn a_game_that_is_timed_takes_at_least_one_step() {
    let length = Length { time: Some(Duration::ZERO), ..LENGTH };
    assert_eq!(play(&mut Duel::new(), length, &Stop::new(), |_, _, _, _| Ok(())).unwrap(), 1);
}

#[test]
fn a_game_that_is_stopped_takes_no_step() {
    let stop = Stop::new();
    let mut steps = 0;
    let end = play(&mut Duel::new(), LENGTH, &stop, |_, _, _, _| {
        steps += 1;
        stop.raise();
        Ok(())
    });
    assert!(matches!(end, Err(Error::Stopped)));
    assert_eq!(steps, 1);
}
