"""Makes tests/fixtures/tiff/*.tif and tests/oracle/terrain_files.json with independent tools.

Needs numpy, tifffile, imagecodecs, rasterio (GDAL) and pyproj; run from the repository's root:
    python tests/oracle/terrain_files.py [DIRECTORY OF THE EVALUATION DATA]
The expected numbers are read back with tifffile / rasterio, never computed by this program.
"""

import json
import pathlib
import sys
import warnings

import numpy as np
import pyproj
import rasterio
import tifffile
from rasterio.transform import Affine

warnings.filterwarnings("ignore")
ROOT = pathlib.Path(__file__).parents[2]
OUT = ROOT / "tests/fixtures/tiff"
ROWS, COLS = 37, 29
r, c = np.mgrid[0:ROWS, 0:COLS]
HEIGHTS = 60 + 40 * np.sin(r / 5.0) + 20 * np.cos(c / 3.0)


def gdal(name, dtype, heights=HEIGHTS, nodata=None, crs=None, transform=None, tags=None, band_tags=None, **creation):
    data = np.atleast_3d(heights.T).T if heights.ndim == 2 else heights
    profile = dict(driver="GTiff", width=data.shape[2], height=data.shape[1], count=data.shape[0], dtype=dtype,
                   nodata=nodata, crs=crs, transform=transform or Affine(30, 0, 0, 0, -30, 0), **creation)
    with rasterio.open(OUT / name, "w", **profile) as d:
        d.write(data.astype(dtype))
        if band_tags:
            band_tags(d)
        if tags:
            d.update_tags(**tags)


def sparse(name):
    profile = dict(driver="GTiff", width=64, height=48, count=1, dtype="float32", nodata=-9999.0, tiled=True,
                   blockxsize=16, blockysize=16, compress="deflate", sparse_ok=True,
                   transform=Affine(30, 0, 0, 0, -30, 0))
    with rasterio.open(OUT / name, "w", **profile) as d:
        d.write(HEIGHTS[:16, :16].astype("f4"), 1, window=((16, 32), (32, 48)))


def feet(d):
    d.scales, d.offsets, d.units = (0.1,), (5.0,), ("ft",)


def make():
    OUT.mkdir(parents=True, exist_ok=True)
    for old in OUT.glob("*.tif"):
        old.unlink()
    for dtype in ["uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float32", "float64"]:
        gdal(f"plain-{dtype}.tif", dtype)
    for compress in ["lzw", "packbits", "deflate"]:
        for dtype, predictors in [("int16", [1, 2]), ("float32", [1, 2, 3]), ("float64", [3])]:
            for predictor in predictors if compress != "packbits" else [1]:
                gdal(f"strips-{compress}-p{predictor}-{dtype}.tif", dtype, compress=compress, predictor=predictor,
                     blockysize=7)
                gdal(f"tiles-{compress}-p{predictor}-{dtype}.tif", dtype, compress=compress, predictor=predictor,
                     tiled=True, blockxsize=16, blockysize=16)
    gdal("bigtiff.tif", "float32", BIGTIFF="YES", compress="deflate", predictor=3)
    gdal("big-endian.tif", "int16", ENDIANNESS="BIG", compress="lzw", predictor=2)
    gdal("big-endian-p3.tif", "float32", ENDIANNESS="BIG", compress="deflate", predictor=3, tiled=True,
         blockxsize=16, blockysize=16)
    gdal("big-endian-bigtiff.tif", "float64", ENDIANNESS="BIG", BIGTIFF="YES")
    tifffile.imwrite(OUT / "half.tif", HEIGHTS.astype("f2"), compression="deflate", predictor=3)
    sparse("sparse-tiles.tif")
    holes = HEIGHTS.copy()
    holes[3:6, 4:9] = -9999
    gdal("nodata-f32.tif", "float32", holes, nodata=-9999)
    gdal("nodata-f32-max.tif", "float32", np.where(holes < 0, np.float32(-3.4028234663852886e38), holes),
         nodata=-3.4028234663852886e38)
    gdal("nodata-nan.tif", "float32", np.where(holes < 0, np.nan, holes), nodata=np.nan)
    bands = np.stack([HEIGHTS + 100 * b for b in range(3)])
    gdal("bands-pixel.tif", "int16", bands, interleave="pixel", compress="deflate", predictor=2)
    gdal("bands-band.tif", "float32", bands, interleave="band", compress="lzw", predictor=3, tiled=True,
         blockxsize=16, blockysize=16)
    gdal("rgb.tif", "uint8", bands / 2, photometric="RGB", compress="lzw")
    gdal("zstd.tif", "int16", compress="zstd")
    gdal("jpeg.tif", "uint8", compress="jpeg")
    gdal("feet-scaled.tif", "int16", band_tags=feet)
    degree = Affine(1 / 1200, 0, 8, 0, -1 / 1200, 47)
    gdal("geographic.tif", "int16", crs="EPSG:4326", transform=degree)
    gdal("geographic-point.tif", "int16", crs="EPSG:4326", transform=degree, tags={"AREA_OR_POINT": "Point"})
    gdal("utm.tif", "float32", crs="EPSG:32611", transform=Affine(30, 0, 300000, 0, -20, 4100000))
    gdal("us-feet.tif", "float32", crs="EPSG:2263", transform=Affine(100, 0, 980000, 0, -100, 200000))
    gdal("moon.tif", "float32", crs="+proj=longlat +a=1737400 +b=1737400 +no_defs", transform=degree)
    gdal("rotated.tif", "float32", crs="EPSG:32611",
         transform=Affine.translation(300000, 4100000) * Affine.rotation(30) * Affine.scale(30, -30))
    gdal("south-up.tif", "float32", crs="EPSG:32611", transform=Affine(30, 0, 300000, 0, 30, 4000000))


def probe(heights, valid, samples=24):
    """Some cells with their heights, spread by a fixed recipe, and the totals."""
    rows, cols = heights.shape
    picks = []
    for i in range(samples):
        row, col = (i * 7919 + 13) % rows, (i * 104729 + 5) % cols
        picks.append([row, col, float(heights[row, col]) if valid[row, col] else None])
    known = heights[valid].astype(float)
    return dict(shape=[rows, cols], voids=int((~valid).sum()), low=float(known.min()), high=float(known.max()),
                mean=float(known.mean()), cells=picks)


def describe(path, band=1):
    with rasterio.open(path) as d:
        nodata, epsg = d.nodatavals[band - 1], (d.crs.to_epsg() if d.crs else None)
        transform = list(d.transform)[:6]
        point = d.tags().get("AREA_OR_POINT") == "Point"
        sparse_read = d.read(band)
    pages = tifffile.imread(path)
    # tifffile is the independent reader where it can be; GDAL fills sparse tiles.
    heights = sparse_read if "sparse" in path.name else (
        pages if pages.ndim == 2 else (pages[band - 1] if pages.shape[0] == 3 else pages[..., band - 1]))
    assert np.array_equal(heights, sparse_read, equal_nan=True), path
    valid = np.isfinite(heights.astype(float))
    if nodata is not None and not np.isnan(nodata):
        valid &= heights != np.array(nodata, heights.dtype)
    return dict(probe(heights, valid), transform=transform, epsg=epsg, point=point, band=band)


def main():
    make()
    result = dict(fixtures={}, real={})
    unreadable = {"zstd.tif", "jpeg.tif"}
    for path in sorted(OUT.glob("*.tif")):
        if path.name not in unreadable:
            result["fixtures"][path.name] = describe(path, 2 if "band" in path.name or path.name == "rgb.tif" else 1)
    if len(sys.argv) > 1:
        data = pathlib.Path(sys.argv[1])
        for path in sorted(data.glob("*/*.tif")):
            result["real"][f"{path.parent.name}/{path.name}"] = describe(path)
        hgt = np.fromfile(data / "formats/N36W118.hgt", ">i2").reshape(1201, 1201)
        result["real"]["formats/N36W118.hgt"] = probe(hgt, hgt != -32768)
        import imagecodecs
        grey = imagecodecs.png_decode((data / "formats/montblanc-16bit.png").read_bytes())
        metres = 454 + grey.astype(float) * (4810 - 454) / 65535
        result["real"]["formats/montblanc-16bit.png"] = probe(metres, grey >= 0)
    # Metres in a degree: a thousand times a thousandth of it along the geodesic.
    geod = pyproj.Geod(ellps="WGS84")
    result["degrees"] = [
        [lat, 1000 * geod.inv(-5e-4, lat, 5e-4, lat)[2], 1000 * geod.inv(0, lat - 5e-4, 0, lat + 5e-4)[2]]
        for lat in [0.0, 15.0, 36.5, 45.0, 46.5, 60.0, 80.0]]
    groups = []
    for group, entries in result.items():
        items = entries.items() if isinstance(entries, dict) else None
        lines = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in items] if items else [json.dumps(v) for v in entries]
        open_, close = "{}" if items else "[]"
        groups.append(f"{json.dumps(group)}: {open_}\n" + ",\n".join(lines) + f"\n{close}")
    (ROOT / "tests/oracle/terrain_files.json").write_text("{\n" + ",\n".join(groups) + "\n}\n")


main()
