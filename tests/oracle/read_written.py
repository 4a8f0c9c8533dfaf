"""Reads the files that this program wrote with GDAL, tifffile, NumPy and imagecodecs, and compares them.

    cargo test --release --test terrain_round_trips -- --ignored --nocapture
    python tests/oracle/read_written.py DIRECTORY THAT THE TEST PRINTED
"""

import json
import pathlib
import sys
import warnings

import imagecodecs
import numpy as np
import pyproj
import rasterio
import tifffile

warnings.filterwarnings("ignore")
here = pathlib.Path(sys.argv[1])

truth = np.load(here / "plain.npy")
assert truth.dtype == np.float32 and np.isnan(truth).any()
for words in sorted(here.glob("*.json")):
    wanted = json.loads(words.read_text())
    path = words.with_suffix(".tif")
    with rasterio.open(path) as d:
        assert np.array_equal(d.read(1), truth, equal_nan=True), path
        assert np.isnan(d.nodata)
        assert np.allclose(list(d.transform)[:6], wanted["transform"], rtol=1e-13), (path, d.transform)
        epsg = d.crs.to_epsg() if d.crs else None
        # GDAL finds codes for some that have none.
        assert wanted["definition"] or epsg == wanted["epsg"], (path, d.crs)
        if wanted["definition"]:
            # A system without a code: the same to whoever computes with it.
            ours, gdals = (pyproj.CRS.from_user_input(text) for text in (wanted["definition"], d.crs.to_wkt()))
            assert np.isclose(ours.axis_info[0].unit_conversion_factor, gdals.axis_info[0].unit_conversion_factor, rtol=1e-12), path
            if ours.is_projected:
                probes = [pyproj.Transformer.from_crs(s.geodetic_crs, s, always_xy=True).transform(-100, 41) for s in (ours, gdals)]
                assert np.allclose(*probes, rtol=1e-12, atol=1e-3), (path, probes)
            assert ours.ellipsoid is None or np.isclose(ours.ellipsoid.semi_major_metre, gdals.ellipsoid.semi_major_metre)
        elif wanted["epsg"] is None and d.crs and wanted["transform"][0] > 1:
            assert 'UNIT["metre",1' in d.crs.to_wkt(), (path, d.crs)
        assert d.tags().get("AREA_OR_POINT", "Area") == wanted["space"], path
    assert np.array_equal(tifffile.imread(path), truth, equal_nan=True), path
    print(path.name, wanted["epsg"], "ok")
with rasterio.open(here / "int16.tif") as d:
    whole = d.read(1, masked=True)
    assert whole.dtype == np.int16 and d.nodata == -32768
    assert np.array_equal(whole.mask, np.isnan(truth)) and np.abs(whole - truth).max() <= 0.5
with rasterio.open(here / "plain.asc") as d:
    grid = d.read(1, masked=True)
    assert np.array_equal(grid.mask, np.isnan(truth)) and np.abs(grid - truth).max() < 1e-3
    assert list(d.transform)[:6] == [30, 0, 0, 0, -25, 301 * 25]
grey = imagecodecs.png_decode((here / "plain.png").read_bytes())
assert grey.dtype == np.uint16 and np.array_equal(grey == 0, np.isnan(truth))
low, high = np.nanmin(truth), np.nanmax(truth)
back = low + (grey.astype(float) - 1) * (high - low) / 65534
assert np.nanmax(np.abs(back - truth)[grey > 0]) <= (high - low) / 65534 / 2 + 1e-4
print("int16, asc, png ok")
