"""Depth-first runs over real line masks, straight from the recipe (Liu & Benes 2025, 4.1), for sketch::split_parts.

  python tests/oracle/split_runs.py DEM.tif > tests/oracle/split_runs.json      (numpy, scipy, scikit-image, tifffile)

The mask is a skeleton of strongly convex cells of a window, with loops, branches and staircases as lines from real
terrain have them. The walk is quadratic on purpose: after each line it looks for the next end point from scratch.
"""

import json
import sys

import numpy as np
import tifffile
from scipy import ndimage
from skimage.morphology import skeletonize

ROW, COL, SIDE = 300, 260, 72
ORDER = [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1)]


def line_mask(heights):
    smooth = ndimage.gaussian_filter(heights.astype(float), 1.5)
    bend = -ndimage.laplace(smooth)
    return skeletonize(bend > np.quantile(bend, 0.80))


def neighbours(cell, left):
    return [(cell[0] + a, cell[1] + b) for a, b in ORDER if (cell[0] + a, cell[1] + b) in left]


def runs(mask):
    left = {(int(r), int(c)) for r, c in zip(*np.nonzero(mask))}
    out = []
    while left:
        cells = sorted(left)
        ends = [c for c in cells if len(neighbours(c, left)) <= 1]
        walk, seen = [], set()
        stack = [ends[0] if ends else cells[0]]
        while stack:
            cell = stack.pop()
            if cell not in seen:
                seen.add(cell)
                walk.append(cell)
                stack += [n for n in reversed(neighbours(cell, left)) if n not in seen]
        left -= seen
        run = [walk[0]]
        for cell in walk[1:]:
            if max(abs(cell[0] - run[-1][0]), abs(cell[1] - run[-1][1])) > 1:
                out.append(run)
                run = []
            run.append(cell)
        out.append(run)
    return out


window = tifffile.imread(sys.argv[1])[ROW : ROW + SIDE, COL : COL + SIDE]
mask = line_mask(window)
flat = [[r * SIDE + c for r, c in run] for run in runs(mask)]
print(json.dumps({"side": SIDE, "runs": flat}, separators=(",", ":")))
