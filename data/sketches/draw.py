"""Draws the sample sketches of this folder: closed and open curves through hand-placed points, heights along them.

Run it to make the files again:  python3 data/sketches/draw.py
Curves are centripetal Catmull-Rom splines; every third of a cell's worth of wobble is written in the points themselves.
"""

import json
import math
import pathlib

SIDE = 128
HERE = pathlib.Path(__file__).parent


def spline(points, closed=False, step=2.5):
    """Points (x, y, z) about `step` cells apart on a smooth curve through `points`."""
    n = len(points)
    at = (lambda i: points[i % n]) if closed else (lambda i: points[min(max(i, 0), n - 1)])
    out = []
    for i in range(n if closed else n - 1):
        p0, p1, p2, p3 = (at(i + k) for k in (-1, 0, 1, 2))
        # An end point is continued straight on.
        if not closed and i == 0:
            p0 = tuple(2 * a - b for a, b in zip(p1, p2))
        if not closed and i == n - 2:
            p3 = tuple(2 * a - b for a, b in zip(p2, p1))
        knot = lambda a, b: max(math.hypot(a[0] - b[0], a[1] - b[1]) ** 0.5, 1e-9)
        t1 = knot(p0, p1)
        t2 = t1 + knot(p1, p2)
        t3 = t2 + knot(p2, p3)
        pieces = max(1, round(math.hypot(p2[0] - p1[0], p2[1] - p1[1]) / step))
        for k in range(pieces):
            t = t1 + (t2 - t1) * k / pieces
            mix = lambda a, b, ta, tb: tuple(((tb - t) * u + (t - ta) * v) / (tb - ta) for u, v in zip(a, b))
            a1, a2, a3 = mix(p0, p1, 0, t1), mix(p1, p2, t1, t2), mix(p2, p3, t2, t3)
            b1, b2 = mix(a1, a2, 0, t2), mix(a2, a3, t1, t3)
            x, y, _ = mix(b1, b2, t1, t2)
            # Heights linear between the points, so that they never overshoot.
            z = p1[2] + (p2[2] - p1[2]) * k / pieces
            out.append((x, y, z))
    out.append(points[0] if closed else points[-1])
    return out


def save(name, title, strokes):
    features = []
    for kind, points in strokes:
        rounded = [[round(x, 2), round(y, 2), round(z, 3)] for x, y, z in points]
        geometry = {"type": "LineString", "coordinates": rounded}
        if len(rounded) == 1:
            geometry = {"type": "Point", "coordinates": rounded[0]}
        features.append({"type": "Feature", "properties": {"kind": kind}, "geometry": geometry})
    compact = lambda value: json.dumps(value, separators=(",", ":"))
    member = {"rows": SIDE, "cols": SIDE, "unit": "normalised"}
    text = '{"type":"FeatureCollection",\n"title":%s,\n"monadnock":%s,\n"features":[\n%s\n]}\n' % (
        json.dumps(title), compact(member), ",\n".join(compact(f) for f in features))
    (HERE / f"{name}.geojson").write_text(text)


def polar(centre, radii, heights, start=0.0):
    """A closed curve: radii and heights by equal angles, counter-clockwise from east."""
    n = len(radii)
    cx, cy = centre
    angles = [start + 2 * math.pi * i / n for i in range(n)]
    return [(cx + r * math.cos(a), cy - r * math.sin(a), z) for a, r, z in zip(angles, radii, heights)]


def lambda_ring():
    ring = polar((64, 64), [54, 51, 53, 56, 54, 52, 55, 56, 53, 52, 55, 53],
                 [.08, .10, .13, .16, .18, .17, .15, .12, .09, .07, .06, .07])
    stem = [(40, 26, .62), (49, 29, .74), (56, 38, .86), (62, 51, .97), (68, 64, .93), (75, 78, .84), (83, 91, .72),
            (93, 98, .55)]
    leg = [(65, 58, .95), (60, 69, .85), (54, 79, .76), (47, 89, .66), (38, 98, .50)]
    save("lambda-ring", "A ridge like a lambda inside a closed ring of valleys",
         [("valley", spline(ring, True)), ("ridge", spline(stem)), ("ridge", spline(leg))])


def p_valley():
    stem = [(44, 22, .22), (43, 40, .19), (44, 58, .16), (45, 72, .13), (43, 90, .09), (45, 110, .05)]
    bowl = [(44, 22, .22), (58, 20, .23), (74, 24, .22), (85, 35, .20), (86, 49, .19), (77, 62, .18), (62, 68, .16),
            (45, 72, .13)]
    inner = [(58, 36, .55), (65, 40, .66), (66, 48, .63), (60, 54, .52)]
    west = [(22, 14, .62), (19, 34, .74), (22, 56, .81), (18, 80, .70), (23, 112, .52)]
    east = [(66, 7, .60), (90, 12, .74), (104, 30, .86), (105, 52, .90), (94, 72, .82), (76, 84, .74), (68, 98, .64),
            (70, 118, .50)]
    save("p-valley", "A valley like a letter P between ridges",
         [("valley", spline(stem)), ("valley", spline(bowl)), ("ridge", spline(inner)), ("ridge", spline(west)),
          ("ridge", spline(east))])


def volcano_ring():
    centre, spurs = (64, 63), 8
    radii = [17, 16, 18, 17, 19, 18, 16, 17]
    rim = polar(centre, radii, [.93, .96, .99, .97, .93, .90, .88, .90])
    shift = [.0, .14, -.1, .06, -.12, .1, -.05, .09]
    strokes = [("ridge", spline(rim, True)), ("valley", [(*centre, .66)])]
    for i in range(spurs):
        point = lambda r, turn, z: (centre[0] + r * math.cos(turn), centre[1] - r * math.sin(turn), z)
        turn = 2 * math.pi * i / spurs
        bend = .20
        reach = 48 + 4 * ((3 * i) % 4)
        # A spur starts on the rim itself; a gully a few cells below it.
        spur = [rim[i], point(29, turn + bend * .3, .72), point(39, turn + bend * .7, .50), point(reach - 4, turn + bend, .28)]
        strokes.append(("ridge", spline(spur)))
        turn += (math.pi + 2 * shift[i]) / spurs
        gully = [point(25, turn, .70), point(34, turn + bend * .3, .46), point(44, turn + bend * .6, .28),
                 point(reach + 4, turn + bend * .8, .12)]
        strokes.append(("valley", spline(gully)))
    save("volcano-ring", "A crater rim with spurs and gullies", strokes)


def meander():
    course = [(-2, 58), (8, 50), (18, 54), (24, 66), (32, 78), (42, 78), (48, 66), (50, 52), (58, 44), (68, 50), (70, 64),
              (76, 76), (87, 78), (94, 66), (97, 52), (106, 46), (116, 52), (130, 58)]
    river = [(x, y, .16 - .10 * i / (len(course) - 1)) for i, (x, y) in enumerate(course)]
    brooks = [[(28, 8, .56), (22, 22, .46), (24, 38, .32), river[2]], [(66, 6, .60), (71, 18, .50), (62, 30, .32), river[8]],
              [(104, 9, .54), (110, 22, .44), (104, 34, .26), river[15]],
              [(22, 122, .52), (31, 110, .42), (27, 94, .28), river[4]], [(92, 122, .50), (84, 108, .40), (91, 93, .24), river[12]]]
    ridges = [[(4, 34, .58), (11, 23, .70), (13, 8, .80)], [(42, 6, .88), (46, 20, .80), (40, 35, .64), (37, 52, .42)],
              [(86, 5, .92), (90, 20, .82), (83, 36, .66), (82, 57, .40)], [(121, 7, .72), (124, 22, .62), (120, 36, .46)],
              [(7, 118, .70), (11, 101, .62), (8, 82, .46)], [(58, 121, .88), (53, 105, .80), (61, 90, .62), (60, 68, .40)],
              [(117, 119, .80), (108, 104, .72), (113, 87, .58), (107, 66, .40)]]
    save("meander", "A meandering river with brooks between spurs",
         [("valley", spline(b)) for b in [river, *brooks]] + [("ridge", spline(r)) for r in ridges])


def single_stroke():
    crest = [(16, 92, .42), (30, 80, .56), (44, 76, .70), (58, 64, .88), (70, 50, .96), (84, 46, .82), (98, 36, .66),
             (112, 34, .48)]
    save("single-stroke", "One ridge", [("ridge", spline(crest))])


def a_circle():
    ring = polar((64, 64), [50, 52, 51, 49, 50, 52, 51, 50, 49, 51, 52, 50],
                 [.14, .12, .10, .08, .07, .06, .07, .09, .11, .13, .15, .15])
    bowl = polar((58, 66), [21, 20, 21, 22, 21, 20, 21, 22], [.82, .90, .95, .92, .86, .80, .76, .78], start=.3)
    stem = [(80, 36, .52), (82, 50, .70), (81, 64, .86), (83, 80, .72), (92, 92, .50)]
    save("a-circle", "A ridge like a letter a inside a circle of valleys",
         [("valley", spline(ring, True)), ("ridge", spline(bowl, True)), ("ridge", spline(stem))])


def fault_line():
    scarp = [(6, 40, .70), (28, 46, .76), (50, 55, .82), (74, 62, .84), (98, 72, .78), (122, 80, .70)]
    foot = [(x - 3, y + 8, .30 - .02 * i) for i, (x, y, _) in enumerate(scarp)]
    # Streams that the fault has moved sideways: their upper and lower courses do not meet.
    upper = [[(34, 6, .90), (30, 20, .86), (34, 36, .78)], [(70, 8, .92), (66, 28, .86), (70, 48, .80)],
             [(108, 12, .88), (102, 34, .82), (104, 58, .74)]]
    lower = [[(46, 66, .22), (42, 88, .16), (46, 120, .08)], [(84, 78, .20), (80, 98, .14), (84, 122, .07)]]
    save("fault-line", "A fault with a scarp and streams that it has moved",
         [("ridge", spline(scarp)), ("valley", spline(foot))] + [("valley", spline(s)) for s in upper + lower])


def empty_corner():
    trunk = [(4, 60, .10), (22, 54, .14), (42, 48, .20), (58, 34, .28), (64, 14, .38)]
    side = [(42, 48, .20), (30, 34, .28), (24, 18, .38)]
    crest = [(6, 96, .64), (22, 84, .76), (42, 76, .90), (58, 62, .96), (78, 48, .88), (86, 26, .78), (88, 8, .66)]
    spur = [(42, 76, .90), (36, 66, .70), (30, 60, .48)]
    west = [(8, 36, .60), (12, 20, .72), (10, 6, .64)]
    save("empty-corner", "A valley and a crest; the south-eastern corner is left to the style",
         [("valley", spline(trunk)), ("valley", spline(side)), ("ridge", spline(crest)), ("ridge", spline(spur)),
          ("ridge", spline(west))])


def range_and_river():
    crest = [(14, 12, .58), (24, 30, .74), (31, 50, .90), (47, 66, .96), (58, 84, 1.), (60, 104, .84), (57, 121, .66)]
    river = [(118, 125, .03), (112, 104, .07), (101, 88, .10), (92, 68, .14), (81, 52, .18), (78, 32, .23), (68, 6, .31)]
    save("range-and-river", "A mountain range beside a river", [("ridge", spline(crest)), ("valley", spline(river))])


def three_peaks():
    west = [(26, 30, .72), (31, 37, .92), (40, 41, .66)]
    south = [(33, 82, .70), (38, 92, 1.), (48, 97, .78)]
    east = [(92, 50, .68), (98, 59, .97), (93, 69, .74), (86, 75, .56)]
    pass_ = [(61, 3, .26), (66, 30, .19), (63, 62, .13), (68, 94, .08), (72, 125, .04)]
    save("three-peaks", "Three short ridges around a valley",
         [("ridge", spline(ridge)) for ridge in (west, south, east)] + [("valley", spline(pass_))])


def valley_system():
    trunk = [(62, 126, .04), (66, 108, .08), (60, 90, .12), (66, 70, .17), (71, 52, .23), (64, 32, .33), (60, 9, .48)]
    west = [(60, 90, .12), (47, 79, .19), (34, 66, .28), (24, 54, .38), (8, 46, .50)]
    east = [(71, 52, .23), (86, 46, .32), (99, 38, .42), (121, 30, .56)]
    save("valley-system", "A valley with two tributaries, no ridge",
         [("valley", spline(valley)) for valley in (trunk, west, east)])


for draw in (a_circle, empty_corner, fault_line, lambda_ring, p_valley, volcano_ring, meander, single_stroke, range_and_river,
             three_peaks, valley_system):
    draw()
