"""What every command writes, as GDAL and PROJ read it: place, system, unit, nodata, mask.

    cargo build --release
    python tests/oracle/written_by_commands.py target/release/monadnock

Needs numpy, rasterio (GDAL) and pyproj. A piece of terrain with voids lies in turn in systems of every kind; amplify, eval --save,
extract, sketch fill, generate (on the sketch's own map, and --like) and sample write what follows from it.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import warnings

import numpy as np
import pyproj
import rasterio
from rasterio.transform import Affine
from terrain_statements import facts, same

warnings.filterwarnings("ignore")
program = str(pathlib.Path(sys.argv[1]).resolve())
SIDE = 132
FEET = Affine(200, 0, 6500000, 0, -200, 1900000)
METRES = Affine(60, 0, 500000, 0, -60, 4100000)
SYSTEMS = {
    "EPSG:32611": METRES, "EPSG:2227": FEET, "EPSG:2223": Affine(200, 0, 700000, 0, -200, 800000), "EPSG:26911+6360": METRES,
    "EPSG:4326": Affine(0.0007, 0, -118, 0, -0.0006, 37), "EPSG:4269": Affine(0.0006, 0, -118, 0, -0.0006, 37),
    "EPSG:3857": Affine(80, 0, -13000000, 0, -80, 4400000), "EPSG:5070": Affine(60, 0, -1900000, 0, -60, 1900000), "EPSG:3413": Affine(60, 0, 0, 0, -60, -2000000),
    "+proj=lcc +lat_1=33 +lat_2=45 +lat_0=39 +lon_0=-96 +datum=NAD83 +units=us-ft": Affine(200, 0, 100000, 0, -200, 500000),
    "+proj=aea +lat_1=29.5 +lat_2=45.5 +lat_0=23 +lon_0=-96 +datum=NAD83": METRES, "+proj=stere +lat_0=90 +lat_ts=71 +lon_0=-45 +datum=WGS84": METRES,
    "+proj=tmerc +lat_0=40 +lon_0=-117 +k=0.9999 +x_0=3000 +datum=NAD83 +units=us-ft": FEET, "+proj=laea +lat_0=45 +lon_0=-100 +datum=WGS84": METRES,
    "+proj=sterea +lat_0=52 +lon_0=5 +k=0.9999 +ellps=bessel": METRES, "+proj=eqc +lat_ts=30 +lon_0=0 +datum=WGS84": Affine(60, 0, 100000, 0, -60, 3000000),
    "ESRI:54009": Affine(60, 0, 100000, 0, -60, 1000000), None: METRES,
}


def run(folder, *command):
    answer = subprocess.run([program, *command], cwd=folder, capture_output=True, text=True)
    assert answer.returncode == 0, (command, answer.stderr)


def heights():
    with rasterio.open(pathlib.Path(__file__).parents[2] / "data" / "grand-canyon.tif") as d:
        z = d.read(1)[100:100 + SIDE, 100:100 + SIDE].astype("float32")
    z[30:44, 60:71] = np.nan
    return z


def check_raster(path, system, transform, mask=None):
    """What is wrong with a written GeoTIFF."""
    wrong = []
    with rasterio.open(path) as d:
        z = d.read(1)
        if not np.allclose(list(d.transform)[:6], list(transform)[:6], rtol=1e-12, atol=1e-9):
            wrong.append(f"transform {list(d.transform)[:6]}, not {list(transform)[:6]}")
        if not (d.dtypes[0] == "float32" and np.isnan(d.nodata)):
            wrong.append(f"{d.dtypes[0]}, nodata {d.nodata}")
        known = d.dataset_mask() > 0
        if mask is not None and not np.array_equal(known, mask) or not np.array_equal(known, np.isfinite(z)):
            wrong.append(f"{(~known).sum()} voids")
        if system is None:
            unit = d.crs and facts(d.crs.to_wkt())
            if unit not in ({"local": 1.0}, None):
                wrong.append(f"system {d.crs}")
        elif d.crs is None or not same(facts(system), facts(d.crs.to_wkt())):
            wrong.append(f"system {d.crs and facts(d.crs.to_wkt())}, not {facts(system)}")
    return wrong


def check_sketch(path, system, transform, z, exact):
    """What is wrong with a written sketch: the system that it names, lines off the terrain or at other heights."""
    sketch, wrong = json.loads(path.read_text()), []
    named = sketch.get("crs", {}).get("properties", {}).get("name")
    code = system and pyproj.CRS.from_user_input(system).sub_crs_list[:1] or system and [pyproj.CRS.from_user_input(system)]
    code = code and code[0].to_epsg(min_confidence=100)
    if code == 4326 and named or code not in (4326, None) and (not named or pyproj.CRS.from_user_input(named).to_epsg() != code):
        wrong.append(f"names {named}, not EPSG:{code}")
    for feature in sketch["features"]:
        for x, y, height in feature["geometry"]["coordinates"]:
            col, row = ~transform * (x, y)
            inside = -1e-6 <= row <= SIDE + 1e-6 and -1e-6 <= col <= SIDE + 1e-6
            true = z[min(int(row), SIDE - 1), min(int(col), SIDE - 1)] if inside else np.nan
            if not inside or exact and not abs(true - height) < 1e-3:
                wrong.append(f"a vertex {x, y, height} at {row, col}, where the height is {true}")
                return wrong
    return wrong


def main():
    z, failed, count = heights(), 0, 0
    mask = np.isfinite(z)
    tiny = ["--epochs", "2", "--set", "model.extractions=1", "--set", "model.splits=1", "-q"]
    with tempfile.TemporaryDirectory() as folder:
        at = pathlib.Path(folder)
        run(at, "train", "grand-canyon", "--crop", "0,0,96", "-o", "s.safetensors", *tiny)
        for system, transform in SYSTEMS.items():
            with rasterio.open(at / "d.tif", "w", driver="GTiff", width=SIDE, height=SIDE, count=1, dtype="float32", crs=system,
                               transform=transform, nodata=np.nan) as d:
                d.write(np.where(mask, z / (1200 / 3937 if system == "EPSG:26911+6360" else 1), np.nan).astype("float32"), 1)
            horizontal = system and system.split("+")[0] if system and system.startswith("EPSG") else system
            keep = ["--keep-cells"]
            run(at, "extract", "d.tif", "-o", "s.geojson", *keep)
            run(at, "amplify", "s.safetensors", "d.tif", "--factor", "2", "-o", "a.tif", *keep)
            run(at, "eval", "s.safetensors", "d.tif", "--patches", "2,3", "--systems", "laplace", "--save", "e", "-q", *keep)
            run(at, "generate", "s.safetensors", "--sketch", "s.geojson", "--size", f"{SIDE}x{SIDE}", "-o", "g.tif", "--no-detail")
            run(at, "sketch", "fill", "s.geojson", "--style", "s.safetensors", "--size", f"{SIDE}x{SIDE}", "-o", "f.geojson")
            fine = transform * Affine.scale(0.5)
            cut = transform * Affine.translation(3, 2)
            found = {
                "amplify": check_raster(at / "a.tif", horizontal, fine, mask.repeat(2, 0).repeat(2, 1)),
                "eval truth": check_raster(at / "e/2_3/truth.tif", horizontal, cut, mask[2:130, 3:131]),
                "eval laplace": check_raster(at / "e/2_3/laplace.tif", horizontal, cut, np.ones((128, 128), bool)),
                "generate": check_raster(at / "g.tif", horizontal, transform, np.ones((SIDE, SIDE), bool)),
                "extract": check_sketch(at / "s.geojson", horizontal, transform, z, True),
                "sketch fill": check_sketch(at / "f.geojson", horizontal, transform, z, True),
            }
            answer = subprocess.run([program, "info", "d.tif", "--json"], cwd=at, capture_output=True, text=True)
            size = json.loads(answer.stdout)["cell_size"]
            if max(size["x"], size["y"]) / min(size["x"], size["y"]) < 1.019:
                run(at, "generate", "s.safetensors", "--sketch", "lambda-ring", "--like", "d.tif", "-o", "l.tif", "--no-detail")
                found["generate --like"] = check_raster(at / "l.tif", horizontal, transform, np.ones((SIDE, SIDE), bool))
            for command, wrong in found.items():
                count += 1
                failed += bool(wrong)
                if wrong:
                    print(system, command, "; ".join(wrong))
            print(system, "done")
        run(at, "sample", "s.safetensors", "--size", "64", "-o", "n.tif")
        with rasterio.open(at / "n.tif") as d:
            side = d.transform.a
        wrong = check_raster(at / "n.tif", None, Affine(side, 0, 0, 0, -side, 64 * side))
        wrong = wrong and check_raster(at / "n.tif", None, Affine(side, 0, 0, 0, -side, 0))
        count, failed = count + 1, failed + bool(wrong)
        print("sample", wrong or "ok")
    print(f"{count} files, {failed} differ")
    sys.exit(bool(failed))


main()
