"""Numbers of scipy, scikit-image and numpy for tests/oracle_interpolation.rs and tests/oracle_metrics.rs.

    python tests/oracle/interpolation_and_metrics.py PATH_TO_AREAS > tests/oracle/interpolation_and_metrics.json

PATH_TO_AREAS holds sierra.tif (CC0) and grand-canyon.tif (public domain, credit Tilezen); a 48x48 crop of each goes into
the file, heights in decimetres. Needs numpy, scipy, scikit-image, tifffile.
"""

import json
import sys

import numpy as np
import scipy
import scipy.sparse as sp
import scipy.sparse.linalg as sla
import skimage
import tifffile
from scipy import ndimage
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import cKDTree
from scipy.stats import wasserstein_distance
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

SIDE, EVERY = 48, 5


def laplacian(rows, cols):
    def line(n):
        degree = np.full(n, 2.0)
        degree[0] = degree[-1] = 1
        return sp.diags([degree, -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1])

    return (sp.kron(line(rows), sp.eye(cols)) + sp.kron(sp.eye(rows), line(cols))).tocsr()


def surface(z, lines, order):
    a = laplacian(*z.shape)
    a = (a @ a).tocsr() if order == 2 else a
    known, u = lines.ravel(), np.where(lines, z, 0.0).ravel()
    free = ~known
    u[free] = sla.spsolve(a[free][:, free].tocsc(), -a[free][:, known] @ u[known])
    return u.reshape(z.shape)


def lines_of(z):
    """Crests and troughs of the smoothed patch across rows or columns: line-like, with empty regions between."""
    s = ndimage.gaussian_filter(z, 1.5)
    crest = lambda v, axis: (v > np.roll(v, 1, axis)) & (v > np.roll(v, -1, axis))
    lines = crest(s, 1) | crest(-s, 0)
    lines[:2] = lines[-2:] = False
    lines[:, :2] = lines[:, -2:] = False
    return lines


def interpolated(z, lines):
    points, values = np.argwhere(lines), z[lines]
    cells = np.argwhere(np.ones_like(lines))
    nearest = NearestNDInterpolator(points, values)(cells).reshape(z.shape)
    distances = cKDTree(points).query(cells, 2)[0].reshape(*z.shape, 2)
    sure_nearest = (distances[..., 1] - distances[..., 0] > 1e-9) | lines

    def linear(shift):
        u = LinearNDInterpolator(points + shift, values)(cells).reshape(z.shape)
        return np.where(np.isnan(u), nearest, u)

    # Where four points lie on one circle the triangles are a matter of taste: such cells change when points are shaken.
    rng = np.random.default_rng(1)
    shaken = np.array([linear(rng.normal(0, 1e-7, points.shape)) for _ in range(12)])
    sure_linear = np.ptp(shaken, 0) < 1e-2
    hull = ~np.isnan(LinearNDInterpolator(points, values)(cells)).reshape(z.shape)
    sure_linear &= hull | sure_nearest
    # A cell on the hull's edge may fall on either side of it.
    sure_linear &= ndimage.binary_erosion(hull, border_value=1) | ~ndimage.binary_dilation(hull)

    def sampled(u, sure=None):
        flat = [round(float(x), 6) for x in u.ravel()[::EVERY]]
        return flat if sure is None else [x if s else None for x, s in zip(flat, sure.ravel()[::EVERY])]

    return {
        "laplace": sampled(surface(z, lines, 1)),
        "biharmonic": sampled(surface(z, lines, 2)),
        "nearest": sampled(nearest, sure_nearest),
        "delaunay-linear": sampled(linear(0.0), sure_linear),
    }


def spectrum(z):
    rows, cols = z.shape
    hann = lambda n: 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(n) + 0.5) / n)
    w = np.outer(hann(rows), hann(cols))
    p = np.abs(np.fft.fft2((z - (w * z).sum() / w.sum()) * w)) ** 2
    f = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.fftfreq(cols)[None])
    ring = np.floor(f * min(rows, cols) + 0.5).astype(int)
    return np.array([p[ring == k].mean() for k in range(1, min(rows, cols) // 2 + 1)])


def scores(a, b):
    a, b = a.astype(np.float64), b.astype(np.float64)
    mean, full = structural_similarity(
        a, b, data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, win_size=11, full=True
    )
    row, col = np.mgrid[:SIDE, :SIDE]
    void = (row - 20) ** 2 + (col - 9) ** 2 <= 9
    clear = ~ndimage.binary_dilation(void, np.ones((11, 11)))
    clear[:5] = clear[-5:] = False
    clear[:, :5] = clear[:, -5:] = False
    slope = lambda u: np.hypot(*np.gradient(u))
    curvature = lambda u: ndimage.laplace(u)[1:-1, 1:-1].ravel() / 4
    return {
        "ssim": mean,
        "ssim_with_voids": full[clear].mean(),
        "psnr": peak_signal_noise_ratio(b, a, data_range=1.0),
        "psnr_with_voids": 10 * np.log10(1 / ((a - b)[~void] ** 2).mean()),
        "mean_slope_ratio": slope(a).mean() / slope(b).mean(),
        "slope_distance": wasserstein_distance(slope(a).ravel(), slope(b).ravel()) / slope(b).mean(),
        "curvature_distance": wasserstein_distance(curvature(a), curvature(b)) / np.abs(curvature(b)).mean(),
        "spectrum_distance": np.sqrt(np.mean((10 * np.log10(spectrum(a) / spectrum(b))) ** 2)),
    }


def patch(path, row, col):
    decimetres = np.rint(tifffile.imread(path).astype(np.float64)[row : row + SIDE, col : col + SIDE] * 10)
    z = decimetres / 10
    lines = lines_of(z)
    unit = ((z - z.min()) / (z.max() - z.min())).astype(np.float32)
    outputs = {
        "moved one column": np.concatenate([unit[:, :1], unit[:, :-1]], 1),
        "squared": (unit.astype(np.float64) ** 2).astype(np.float32),
    }
    return {
        "decimetres": [int(x) for x in decimetres.ravel()],
        "lines": ["".join("#" if x else "." for x in line) for line in lines],
        "interpolated": interpolated(z, lines),
        "scores": {name: scores(output, unit) for name, output in outputs.items()},
    }


areas = sys.argv[1]
json.dump(
    {
        "made_by": f"numpy {np.__version__}, scipy {scipy.__version__}, scikit-image {skimage.__version__}",
        "rows": SIDE,
        "cols": SIDE,
        "every": EVERY,
        "patches": {
            "sierra, rows and columns from 300": patch(f"{areas}/sierra.tif", 300, 300),
            "grand-canyon, rows from 200, columns from 250": patch(f"{areas}/grand-canyon.tif", 200, 250),
        },
    },
    sys.stdout,
    separators=(",", ":"),
)
