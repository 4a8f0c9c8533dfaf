"""Cells on the ground for every projected system of EPSG's and Esri's, as PROJ and as this program measure them.

    cargo build --release
    python tests/oracle/coordinate_systems.py target/release/monadnock [FORM] [AUTHORITY]

Needs pyproj. A grid of 30 units lies in the middle of each system's area of use, with the system beside it in a `.prj`: as
FORM code (EPSG codes only), esri, gdal or wkt2. Systems that this program defines anew for files (`info --json`) must mean the
same to PROJ. Systems whose longitudes are not counted from Greenwich, or not in degrees, are left out.
"""

import collections
import concurrent.futures
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import warnings

import pyproj
from pyproj.database import query_crs_info
from pyproj.enums import PJType

warnings.filterwarnings("ignore")
TOLERANCE = 0.011  # below 1 %, maps count as true


def middle(crs, area):
    """Longitude and latitude of a place where the map is used."""
    east = area.east if area.east >= area.west else area.east + 360
    latitude = (max(area.south, -85) + min(area.north, 85)) / 2
    if area.north - area.south > 100 and abs(latitude) < 1:
        latitude = 60.0
    return ((area.west + east) / 2 + 180) % 360 - 180, latitude


def ground(crs, x, y):
    """Metres of 30 units east and north, by a geodesic of a kilometre."""
    unit = crs.axis_info[0].unit_conversion_factor
    back = pyproj.Transformer.from_crs(crs, crs.geodetic_crs, always_xy=True)
    step = 500 / unit
    side = lambda dx, dy: crs.get_geod().inv(*back.transform(x - dx * step, y - dy * step), *back.transform(x + dx * step, y + dy * step))[2]
    return side(1, 0) / 1000 * 30 * unit, side(0, 1) / 1000 * 30 * unit


def compare(program, folder, form, info):
    """The projection, and what is wrong with it; nothing for systems that cannot be compared."""
    crs = pyproj.CRS.from_authority(info.auth_name, info.code)
    base = crs.geodetic_crs
    if info.area_of_use is None or base.prime_meridian.longitude != 0 or abs(base.axis_info[0].unit_conversion_factor - math.pi / 180) > 1e-9:
        return None
    try:
        x, y = pyproj.Transformer.from_crs(base, crs, always_xy=True).transform(*middle(crs, info.area_of_use))
        wanted = ground(crs, x, y)
        text = {"code": lambda: f"EPSG:{info.code}", "esri": lambda: crs.to_wkt("WKT1_ESRI"), "gdal": lambda: crs.to_wkt("WKT1_GDAL"),
                "wkt2": lambda: crs.to_wkt("WKT2_2019")}[form]()
    except pyproj.exceptions.ProjError:
        return None
    if not text or not all(map(math.isfinite, (x, y, *wanted))):
        return None
    path = folder / f"{info.auth_name}{info.code}.asc"
    path.write_text(f"ncols 2\nnrows 2\nxllcorner {float(x) - 30}\nyllcorner {float(y) - 30}\ncellsize 30\n1 2\n3 4\n")
    path.with_suffix(".prj").write_text(text)
    answer = subprocess.run([program, "info", path, "--json"], capture_output=True, text=True)
    method = crs.coordinate_operation.method_name
    if answer.returncode:
        return method, info.code, answer.stderr.strip(), True
    ours = json.loads(answer.stdout)
    found = ours["cell_size"]["x"], ours["cell_size"]["y"]
    said = "; ".join(ours["notes"] + ours["warnings"])
    if any(words in said for words in ("not known", "taken for metres")):
        return method, info.code, "said: " + said[-90:], False
    if max(abs(a / b - 1) for a, b in zip(found, wanted)) > TOLERANCE:
        return method, info.code, f"cells of {found} m, PROJ {wanted}", True
    definition = ours["georeference"].get("definition")
    if definition and form != "code":
        again = pyproj.CRS.from_user_input(definition)
        place = pyproj.Transformer.from_crs(again.geodetic_crs, again, always_xy=True).transform(*middle(crs, info.area_of_use))
        if max(abs(a - b) for a, b in zip(place, (x, y))) > 0.5 / crs.axis_info[0].unit_conversion_factor:
            return method, info.code, f"as written {definition[:2000]} a place is {place}, PROJ {(x, y)}", True
    return method, info.code, None, False


def main():
    program, form, authority = (sys.argv[1:] + ["code", "EPSG"][len(sys.argv) - 2:])[:3]
    systems = query_crs_info(auth_name=authority, pj_types=[PJType.PROJECTED_CRS], allow_deprecated=False)
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(2) as pool:
        found = list(filter(None, pool.map(lambda info: compare(program, pathlib.Path(folder), form, info), systems)))
    told = collections.Counter(method for method, _, what, is_wrong in found if what and not is_wrong)
    for method, code, what, is_wrong in found:
        if is_wrong:
            print(code, method, what)
    print(f"not known, and said so: {dict(told)}")
    wrong = sum(is_wrong for *_, is_wrong in found)
    print(f"{form}: {len(found)} of {len(systems)} systems compared, {sum(told.values())} not known, {wrong} wrong")
    sys.exit(bool(wrong))


main()
