# SPDX-License-Identifier: MIT
"""Make up floe outlines with bays, as a trace of an image would give them, in longitude and latitude: made_up.geojson.

    /usr/bin/python3 cases/outlines/make_outlines.py [-o FILE.geojson]

No ice of this shape was ever seen: the floes are those of bergtow's own generator (grounds.yml), their shores drawn in
at random towards the middle. A third of the rings run clockwise and every tenth has a double vertex, as happens in
traces.
"""
import argparse
import json
import math
import pathlib
import subprocess
import tempfile

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
LON0, LAT0 = 20.0, 76.5  # degrees, in the north-west Barents Sea, for no reason but the frame
A, E2 = 6378137.0, 6.69437999014e-3  # WGS84


def place(north, east):
    """Longitude and latitude in degrees of metres north and east of the origin, by the radii of curvature there: good
    to some cm at 1 km."""
    lat = math.radians(LAT0)
    for _ in range(3):  # the meridians' convergence: the latitude of the foot point
        w = 1 - E2 * math.sin(lat) ** 2
        meridian, normal = A * (1 - E2) / w ** 1.5, A / math.sqrt(w)
        lat = math.radians(LAT0) + (north - east ** 2 * math.tan(lat) / (2 * normal)) / meridian
    return LON0 + math.degrees(east / (normal * math.cos(lat))), math.degrees(lat)


def bays(polygon, rng):
    """Shores of a convex floe drawn in towards the middle; every ray from the middle still meets the shore once, so
    that it stays simple."""
    middle, out = polygon.mean(axis=0), []
    for p, q in zip(polygon, np.roll(polygon, -1, axis=0)):
        out.append(p)
        for t in (1 / 3, 2 / 3):
            out.append(middle + (p + t * (q - p) - middle) * (1 - 0.3 * rng.random() ** 2))
    return np.array(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", default=HERE / "made_up.geojson", type=pathlib.Path)
    parser.add_argument("--bergtow", default=HERE.parents[1] / "build/release/bergtow")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        convex = pathlib.Path(folder) / "convex.geojson"
        subprocess.run([args.bergtow, "field", HERE / "grounds.yml", "-o", convex], check=True)
        features = json.loads(convex.read_text())["features"]
    rng = np.random.default_rng(1)
    for k, feature in enumerate(features):
        # metres north, east; the file has east, north
        ring = bays(np.array(feature["geometry"]["coordinates"][0][:-1])[::-1, ::-1], rng)
        lonlat = [[round(c, 8) for c in place(x, y)] for x, y in ring]
        if k % 10 == 0:
            lonlat.insert(1, lonlat[0])
        if k % 3 == 0:
            lonlat.reverse()
        feature["id"] = k
        feature["properties"] = {"thickness": round(float(rng.normal(1.0, 0.15)), 2)}
        feature["geometry"]["coordinates"] = [lonlat + lonlat[:1]]
    text = ",\n".join(json.dumps(f, separators=(",", ":")) for f in features)
    args.output.write_text(
        '{"type":"FeatureCollection",\n"description":"MADE UP by cases/outlines/make_outlines.py; no '
        'observation",\n"features":[\n'
        + text + "\n]}\n")
    print(f"{args.output}: {len(features)} floes")


if __name__ == "__main__":
    main()
