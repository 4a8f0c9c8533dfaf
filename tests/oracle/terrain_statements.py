"""Place, system, units and validity of terrain files, as GDAL and as this program understand them.

    cargo build --release
    python tests/oracle/terrain_statements.py target/release/monadnock
    python tests/oracle/terrain_statements.py target/release/monadnock FILE...

Needs numpy, rasterio (GDAL) and pyproj. Makes files with GDAL, in every way that GDAL says these things, and reads each with
GDAL and with `monadnock info --json`; or reads the files that are named. What GDAL does not do (heights are not converted to metres,
floating-point alpha is no mask) is done here on its numbers.
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
from rasterio.enums import ColorInterp
from rasterio.transform import Affine

warnings.filterwarnings("ignore")
ROWS, COLS = 24, 20
r, c = np.mgrid[0:ROWS, 0:COLS]
HEIGHTS = (1600 + 40 * np.sin(r / 5.0) + 20 * np.cos(c / 3.0)).round(2)
FEET = {"ft": 0.3048, "US survey foot": 1200 / 3937, "m": 1.0, "metre": 1.0, "": 1.0, None: 1.0}
UTM = dict(crs="EPSG:32611", transform=Affine(30, 0, 500000, 0, -30, 4100000))


def make(folder):
    """Yields the files."""

    def tif(name, heights=HEIGHTS, dtype="float32", edit=None, mask=None, **profile):
        profile = dict(driver="GTiff", width=COLS, height=ROWS, count=1, dtype=dtype) | UTM | profile
        path = folder / name
        with rasterio.open(path, "w", **profile) as d:
            for band in range(1, profile["count"] + 1):
                d.write(heights.astype(dtype), band)
            if edit:
                edit(d)
            if mask is not None:
                d.write_mask(mask)
        return path

    systems = ["EPSG:32611", "EPSG:2227", "EPSG:2223", "EPSG:2314", "EPSG:3395", "EPSG:3413", "EPSG:3035", "EPSG:5070", "EPSG:28992",
               "EPSG:2056", "EPSG:4087", "EPSG:3857", "EPSG:26911+6360", "EPSG:26911+5703"]
    systems += [
        "+proj=merc +lon_0=10 +k=0.9 +x_0=0 +y_0=0 +datum=WGS84", "+proj=tmerc +lat_0=40 +lon_0=-117 +k=0.9999 +datum=NAD83 +units=us-ft",
        "+proj=lcc +lat_1=33 +lat_2=45 +lat_0=39 +lon_0=-96 +datum=NAD83 +units=us-ft", "+proj=lcc +lat_1=40 +lat_0=40 +lon_0=-110 +k_0=0.999 +datum=WGS84",
        "+proj=aea +lat_1=29.5 +lat_2=45.5 +lat_0=23 +lon_0=-96 +datum=NAD83", "+proj=laea +lat_0=45 +lon_0=-100 +datum=WGS84",
        "+proj=aeqd +lat_0=45 +lon_0=-100 +datum=WGS84", "+proj=stere +lat_0=90 +lat_ts=71 +lon_0=-45 +datum=WGS84",
        "+proj=sterea +lat_0=52 +lon_0=5 +k=0.9999 +ellps=bessel", "+proj=eqc +lat_ts=30 +lon_0=0 +datum=WGS84",
        "+proj=cass +lat_0=10 +lon_0=-61 +ellps=clrk66", "+proj=poly +lat_0=0 +lon_0=-54 +ellps=GRS80",
        "EPSG:6933", "EPSG:3410", "ESRI:54009", "ESRI:54030", "+proj=cea +lat_ts=30 +datum=WGS84", "+proj=sinu +lon_0=0 +R=6371007.181",
        "+proj=eqdc +lat_1=20 +lat_2=60 +lat_0=40 +lon_0=-96 +datum=NAD83", "+proj=moll +lon_0=-90 +datum=WGS84",
    ]
    for i, system in enumerate(systems):
        yield tif(f"system-{i}.tif", crs=system, transform=Affine(60, 0, 100000, 0, -60, 500000))
    # GDAL reads a world file beside a GeoTIFF, but no .prj: those are read beside grids below.
    world = tif("world.tif", crs=None, transform=None)
    (folder / "world.tfw").write_text("60\n0\n0\n-60\n100030\n499970\n")
    yield world
    for i, system in enumerate(["EPSG:4326", "EPSG:4269", "EPSG:4267", "+proj=longlat +R=1737400"]):
        yield tif(f"degrees-{i}.tif", crs=system, transform=Affine(0.001, 0, -117, 0, -0.001, 37))
    yield tif("point.tif", edit=lambda d: d.update_tags(AREA_OR_POINT="Point"))
    yield tif("rotated.tif", transform=Affine(24, 18, 500000, 18, -24, 4100000))
    yield tif("nodata.tif", np.where(r < 3, -9999, HEIGHTS), nodata=-9999)
    yield tif("nodata-nan.tif", np.where(r < 3, np.nan, HEIGHTS), nodata=np.nan)
    yield tif("nodata-int.tif", np.where(c < 3, -32768, HEIGHTS.round()), dtype="int16", nodata=-32768)
    mask = np.where((r + c) % 7 == 0, 0, 255).astype("uint8")
    for inside in [True, False]:
        with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=inside):
            yield tif(f"mask-{inside}.tif", mask=mask)
            yield tif(f"mask-{inside}-tiled.tif", mask=mask, tiled=True, blockxsize=16, blockysize=16, compress="lzw")

    def alpha(d):
        d.write(mask.astype("uint16"), 2)
        d.colorinterp = [ColorInterp.gray, ColorInterp.alpha]

    yield tif("alpha.tif", dtype="uint16", count=2, edit=alpha, alpha="yes")

    def units(name):
        def edit(d):
            d.scales, d.offsets, d.units = (0.5,), (100.0,), (name,)
        return edit

    for name in ["ft", "US survey foot", "metre"]:
        yield tif(f"units-{name}.tif", edit=units(name))
    pam = tif("pam.tif", np.where(r < 2, 1234, HEIGHTS))
    pathlib.Path(f"{pam}.aux.xml").write_text(
        '<PAMDataset><SRS>EPSG:2227</SRS><GeoTransform>100000,50,0,500000,0,-50</GeoTransform><PAMRasterBand band="1">'
        "<NoDataValue>1234</NoDataValue><Offset>5</Offset><Scale>2</Scale><UnitType>ft</UnitType></PAMRasterBand></PAMDataset>")
    yield pam
    rows = "\n".join(" ".join(map(str, row)) for row in np.where(r < 2, -9999, HEIGHTS))
    for name, prj in [("utm", "EPSG:32611"), ("feet", "EPSG:2227"), ("albers", "EPSG:5070"), ("polar", "EPSG:3413"),
                      ("gauss", "EPSG:31467"), ("sinusoidal", "ESRI:54008"), ("none", None)]:
        path = folder / f"grid-{name}.asc"
        path.write_text(f"ncols {COLS}\nnrows {ROWS}\nxllcorner 500000\nyllcorner 4100000\ncellsize 30\nNODATA_value -9999\n{rows}\n")
        if prj:
            path.with_suffix(".prj").write_text(pyproj.CRS.from_user_input(prj).to_wkt("WKT1_ESRI"))
        yield path


def facts(crs):
    """A system without its names: what a computation needs of it."""
    crs = pyproj.CRS.from_user_input(crs)
    if crs.is_compound:
        crs = crs.sub_crs_list[0]
    if crs.type_name.startswith("Engineering"):
        return {"local": crs.axis_info[0].unit_conversion_factor}
    ellipsoid = crs.ellipsoid
    found = {"a": ellipsoid.semi_major_metre, "rf": ellipsoid.inverse_flattening}
    if crs.is_projected:
        found |= {"unit": crs.axis_info[0].unit_conversion_factor, "method": crs.coordinate_operation.method_name.split(" (")[0]}
        try:
            probe = pyproj.Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True).transform(-100.0, 41.0)
        except pyproj.exceptions.ProjError as error:
            probe = (str(error), crs.to_wkt())
        found |= {"probe x": probe[0], "probe y": probe[1]}
    return found


def same(a, b):
    if a.keys() != b.keys():
        return False
    near = lambda x, y: x == y or (isinstance(x, float) and isinstance(y, float) and abs(x - y) <= 1e-3 + 1e-9 * abs(x))
    return all(near(a[key], b[key]) or key == "method" for key in a)


def compare(program, path):
    command = [program, "info", path, "--json"]
    answer = subprocess.run(command, capture_output=True, text=True)
    if answer.returncode:
        return [answer.stderr.strip()]
    ours = json.loads(answer.stdout)
    wrong = []
    with rasterio.open(path) as d:
        stored = d.read(1).astype(float)
        known = (d.dataset_mask() if d.count == 1 else d.read_masks(1)) > 0
        known &= np.isfinite(stored)
        heights = (stored * d.scales[0] + d.offsets[0]) * FEET[d.units[0]]
        if not np.array_equal(known.sum(), known.size - ours["voids"]):
            wrong.append(f"voids {ours['voids']}, GDAL {(~known).sum()}")
        for name, value in [("lowest", heights[known].min()), ("highest", heights[known].max()), ("mean", heights[known].mean())]:
            if abs(ours["elevation"][name] - value) > 2e-7 * abs(value) + 1e-3:
                wrong.append(f"{name} {ours['elevation'][name]}, GDAL {value}")
        place = ours["georeference"]
        if not np.allclose(place["transform"], list(d.transform)[:6], rtol=1e-12, atol=1e-9):
            wrong.append(f"transform {place['transform']}, GDAL {list(d.transform)[:6]}")
        if (place["raster_space"] == "pixel-is-point") != (d.tags().get("AREA_OR_POINT") == "Point"):
            wrong.append(f"raster space {place['raster_space']}, GDAL {d.tags().get('AREA_OR_POINT')}")
        system = place.get("definition") or (f"EPSG:{place['epsg']}" if place["epsg"] else None)
        if (system is None) != (d.crs is None):
            wrong.append(f"system {system}, GDAL {d.crs}")
        elif system and not same(facts(system), facts(d.crs.to_wkt())):
            wrong.append(f"system {facts(system)}, GDAL {facts(d.crs.to_wkt())}")
    return wrong


def main():
    program, named = sys.argv[1], sys.argv[2:]
    with tempfile.TemporaryDirectory() as folder:
        paths = list(map(pathlib.Path, named)) if named else list(make(pathlib.Path(folder)))
        failed = 0
        for path in paths:
            wrong = compare(program, path)
            failed += bool(wrong)
            print(path.name, "; ".join(wrong) if wrong else "ok")
    print(f"{len(paths)} files, {failed} differ")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
