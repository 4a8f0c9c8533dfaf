"""An epoch of ours beside the same epoch in PyTorch, in one run, as ratios.

    python3 experiments/speed/peers.py PEERS [--rounds N] [--splice DOCUMENT] [--csv FILE]

PEERS is a folder with the PyTorch re-writes (`peer_gnn.py`: the paper's network at 128x128, k = 10, 10,000 random edges,
T = 2, width 32, six losses, Adam, two threads; `plain` as one would write it, `fast` with factorised first layers).
Rounds of ours, plain and fast follow each other, so that what else the machine does falls on all. Without torch it says so
and ends well. --splice puts the table between the marks `<!-- speed -->` and `<!-- /speed -->`; --csv writes the peers'
numbers for `monadnock experiment run experiments/full/cost.toml --peers FILE`.

Bias: the peers run on another terrain (matplotlib's sample) with 241 parts, ours on the bundled tile with 333.
"""
import argparse
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]


def ours():
    """Seconds of an epoch of the paper's and of the default configuration, and the peak memory of whole trainings, MB."""
    out = subprocess.run(
        ["cargo", "bench", "-q", "--bench", "epoch", "--", "stages"],
        cwd=REPOSITORY, capture_output=True, text=True, check=True,
    ).stdout
    times = [float(re.search(rf"^epoch, {name} +([\d.]+) ms", out, re.M)[1]) / 1e3 for name in ("paper", "anchored")]
    with tempfile.TemporaryDirectory() as folder:
        memory = []
        for preset in ("paper", "anchored"):
            style = f"{folder}/{preset}.safetensors"
            program = ["cargo", "run", "-q", "--release", "--"]
            command = [*program, "-q", "train", "sierra", "-o", style, "--preset", preset, "--epochs", "10"]
            subprocess.run(command, cwd=REPOSITORY, check=True)
            info = subprocess.run([*program, "info", style, "--json"], cwd=REPOSITORY, capture_output=True, text=True, check=True)
            memory.append(float(re.search(r'"peak_memory": (\d+)', info.stdout)[1]) / 1e6)
    return times, memory


def peer(folder, kind):
    """Seconds of an epoch and peak memory, MB."""
    command = [sys.executable, "peer_gnn.py", "--epochs", "15", "--time", "--threads", "2", "--impl", kind]
    out = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout
    found = re.search(r"median ([\d.]+) .*peakRSS (\d+) MB", out)
    return float(found[1]), float(found[2])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("peers")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--splice")
    parser.add_argument("--csv")
    args = parser.parse_args()
    if subprocess.run([sys.executable, "-c", "import torch"], capture_output=True).returncode != 0:
        print("skipped: torch is not installed")
        return
    rounds = []
    for _ in range(args.rounds):
        (paper, anchored), memory = ours()
        (plain, plain_memory), (fast, fast_memory) = peer(args.peers, "plain"), peer(args.peers, "fast")
        rounds.append((paper, anchored, plain, fast))
        print(f"ours {paper:.4f} s, anchored {anchored:.4f} s, plain {plain:.3f} s, fast {fast:.3f} s; load {os.getloadavg()[0]:.1f}")
    median = [statistics.median(column) for column in zip(*rounds)]
    ratio = lambda column: statistics.median(row[column] / row[0] for row in rounds)
    table = "\n".join([
        "| an epoch at 128x128 | seconds | times ours | peak memory, MB |",
        "|---|---:|---:|---:|",
        f"| monadnock, `paper` | {median[0]:.3f} | 1 | {memory[0]:.0f} |",
        f"| PyTorch, as one would write it | {median[2]:.3f} | {ratio(2):.1f} | {plain_memory:.0f} |",
        f"| PyTorch, first layers factorised | {median[3]:.3f} | {ratio(3):.1f} | {fast_memory:.0f} |",
        f"| monadnock, `anchored` (default) | {median[1]:.3f} | {ratio(1):.2f} | {memory[1]:.0f} |",
    ])
    print("\n" + table)
    if args.csv:
        lines = ["stage,system,n,seconds,peak_memory_mb"]
        for name, column, memory_mb in (("plain", 2, plain_memory), ("factorised", 3, fast_memory)):
            lines.append(f"an epoch,PyTorch {name},{len(rounds)},{median[column]:.5f},{memory_mb:.0f}")
        pathlib.Path(args.csv).write_text("\n".join(lines) + "\n")
    if args.splice:
        path = pathlib.Path(args.splice)
        text = path.read_text()
        begin, end = "<!-- speed -->", "<!-- /speed -->"
        if begin not in text or end not in text:
            sys.exit(f"{path}: no marks {begin} and {end}")
        head, rest = text.split(begin, 1)
        temporary = path.with_suffix(".tmp")
        temporary.write_text(f"{head}{begin}\n{table}\n{end}{rest.split(end, 1)[1]}")
        temporary.replace(path)


if __name__ == "__main__":
    main()
