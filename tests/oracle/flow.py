"""Numbers of pysheds for src/flow: filled heights, D8 directions, accumulation and Strahler order of two real DEMs.

    python tests/oracle/flow.py fixture AREAS_DIR            writes tests/oracle/flow.json (64 x 64 crops)
    python tests/oracle/flow.py compare AREA.tif OURS.u8     shares of agreement on a whole area

Needs numpy, tifffile, imagecodecs, pysheds 0.5. OURS.u8 holds this crate's directions over the filled area (fill, then d8),
a byte a cell: D8 code, or 8 at outlets.

A direction is *unambiguous* at an inner cell that filling did not raise, when one neighbour is steeper than all others (by
more than one part in 10^9) and lies lower. A cell is *settled* when no ambiguous cell can reach it: an ambiguous cell may
drain into any neighbour that is not higher. At settled cells accumulation and order do not depend on how ties are broken.

pysheds' stream order is Strahler's only above the first junction of three or more channels (it adds 1 only when the lowest
and the highest donor agree: 2 + 2 + 1 gives 2), and at outlets it counts the outlet among its own donors. `plain` marks
the cells that neither touches; everywhere else the definition itself, written out below, is the oracle.
"""
import json
import sys
import numpy as np
import tifffile

if not hasattr(np, "in1d"):  # pysheds 0.5 still calls what numpy 2.4 dropped
    np.in1d = np.isin
from pysheds.grid import Grid
from pysheds.sview import Raster, ViewFinder

# This crate's D8 codes: counter-clockwise from east; and pysheds' direction map in the order N NE E SE S SW W NW.
OFFSETS = [(0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1)]
DIRMAP = (64, 128, 1, 2, 4, 8, 16, 32)
CODE_OF = {1: 0, 128: 1, 64: 2, 32: 3, 16: 4, 8: 5, 4: 6, 2: 7}
THRESHOLD = 12


def pysheds_of(z):
    """Filled heights, codes (8 at the frame), accumulation and order by pysheds."""
    view = ViewFinder(shape=z.shape, nodata=np.float64(-1e9))
    grid = Grid(viewfinder=view)
    filled = grid.fill_depressions(Raster(z.astype(np.float64), viewfinder=view))
    inflated = grid.resolve_flats(filled)
    directions = np.asarray(grid.flowdir(inflated, dirmap=DIRMAP)).copy()
    frame = np.ones(z.shape, bool)
    frame[1:-1, 1:-1] = False
    codes = np.full(z.shape, 8, int)
    for value, code in CODE_OF.items():
        codes[(directions == value) & ~frame] = code
    return np.asarray(filled), codes, *drained(codes)


def drained(codes):
    """Accumulation and Strahler order of pysheds for given codes."""
    back = {code: value for value, code in CODE_OF.items()}
    values = np.vectorize(lambda c: back.get(c, 0))(codes).astype(np.int64)
    # A rim of cells without direction, because pysheds treats the outermost cells specially.
    values = np.pad(values, 1)
    view = ViewFinder(shape=values.shape, nodata=np.int64(-9))
    grid = Grid(viewfinder=view)
    fdir = Raster(values, viewfinder=view)
    acc = grid.accumulation(fdir, dirmap=DIRMAP)
    mask = Raster(np.asarray(acc) >= THRESHOLD, viewfinder=ViewFinder(shape=values.shape, nodata=False))
    order = grid.stream_order(fdir, mask, dirmap=DIRMAP)
    return np.asarray(acc)[1:-1, 1:-1].astype(int), np.asarray(order)[1:-1, 1:-1].astype(int)


def strahler(codes, acc):
    """Orders by the definition, and the cells with neither an outlet nor a junction of three channels at or above them."""
    rows, cols = codes.shape
    orders = np.zeros(codes.shape, int)
    plain = codes < 8
    donors = {}
    for index in np.argsort(acc, axis=None, kind="stable"):
        r, c = divmod(int(index), cols)
        if acc[r, c] < THRESHOLD:
            continue
        above = donors.get((r, c), [])
        top = max((orders[d] for d in above), default=0)
        orders[r, c] = max(1, top + (sum(orders[d] == top for d in above) >= 2))
        plain[r, c] &= len(above) < 3 and all(plain[d] for d in above)
        if codes[r, c] < 8:
            dr, dc = OFFSETS[codes[r, c]]
            donors.setdefault((r + dr, c + dc), []).append((r, c))
    return orders, plain


def unambiguous(z, filled):
    slopes = np.full((8,) + z.shape, -np.inf)
    for code, (dr, dc) in enumerate(OFFSETS):
        slopes[code, 1:-1, 1:-1] = (
            filled[1:-1, 1:-1] - filled[1 + dr : z.shape[0] - 1 + dr, 1 + dc : z.shape[1] - 1 + dc]
        ) / np.hypot(dr, dc)
    first, second = np.sort(slopes, 0)[[-1, -2]]
    return (filled == z) & (first > 0) & (first > second * (1 + 1e-9)), slopes.argmax(0)


def settled(filled, clear, codes):
    rows, cols = filled.shape
    touched = np.zeros(filled.shape, bool)
    stack = []

    def touch(r, c):
        if 0 <= r < rows and 0 <= c < cols and not touched[r, c]:
            touched[r, c] = True
            stack.append((r, c))

    inner = np.zeros(filled.shape, bool)
    inner[1:-1, 1:-1] = True
    for r, c in np.argwhere(inner & ~clear):
        touch(r, c)
    while stack:
        r, c = stack.pop()
        if not inner[r, c]:
            continue
        for code, (dr, dc) in enumerate(OFFSETS):
            if codes[r, c] == code if clear[r, c] else filled[r + dr, c + dc] <= filled[r, c]:
                touch(r + dr, c + dc)
    return ~touched


def fixture(areas):
    out = []
    for name, row, col in (("sierra", 416, 500), ("alps", 300, 120)):
        z = tifffile.imread(f"{areas}/{name}.tif")[row : row + 64, col : col + 64].astype(np.float64)
        filled, codes, acc, order = pysheds_of(z)
        clear, _ = unambiguous(z, filled)
        calm = settled(filled, clear, codes)
        flat = lambda a: np.asarray(a).astype(int).ravel().tolist()
        digits = lambda a: "".join(map(str, flat(a)))
        defined, plain = strahler(codes, acc)
        assert (defined == order)[plain].all(), "pysheds and the definition agree on plain cells"
        print(name, "raised", (filled > z).sum(), "unambiguous", clear.mean().round(3), "settled", calm.mean().round(3),
              "settled channels", (calm & (acc >= THRESHOLD)).sum(), "orders", np.unique(order),
              "order equal to the definition on", ((defined == order)[acc >= THRESHOLD]).mean().round(3))
        out.append(dict(area=name, row=row, col=col, side=64, threshold=THRESHOLD, heights=flat(z),
                        raised=[[int(i), int(filled.flat[i])] for i in np.flatnonzero(filled > z)],
                        directions=digits(codes), accumulation=flat(acc), order=digits(defined),
                        unambiguous=digits(clear), settled=digits(calm)))
    with open("tests/oracle/flow.json", "w") as f:
        f.write("[" + ",\n".join(json.dumps(a, separators=(",", ":")) for a in out) + "]\n")


def compare(path, ours_path):
    z = tifffile.imread(path).astype(np.float64)
    ours = np.fromfile(ours_path, np.uint8).reshape(z.shape).astype(int)
    filled, codes, acc, order = pysheds_of(z)
    clear, _ = unambiguous(z, filled)
    calm = settled(filled, clear, codes)
    our_acc, our_order = drained(ours)
    defined, plain = strahler(ours, our_acc)
    for name, values in (("accumulation", our_acc), ("order", defined)):
        values.astype("<u4").tofile(f"{ours_path}.{name}.u32")
    inner = np.s_[1:-1, 1:-1]
    print(path, z.shape)
    print(f"  inner cells unambiguous {clear[inner].mean():.4f}, directions equal there {(ours == codes)[clear].mean():.6f},"
          f" on all inner cells {(ours == codes)[inner].mean():.4f}")
    print(f"  settled {calm.mean():.4f}: accumulation equal {(our_acc == acc)[calm].mean():.6f},"
          f" order equal {(our_order == order)[calm].mean():.6f}")
    print(f"  pysheds' order equals the definition on {(defined == our_order)[plain].mean():.6f} of the plain cells")


if __name__ == "__main__":
    {"fixture": fixture, "compare": compare}[sys.argv[1]](*sys.argv[2:])
