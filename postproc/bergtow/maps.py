# SPDX-License-Identifier: MIT
"""Maps of ice as outlines for a case."""
from __future__ import annotations

import html
import json
import os
import tempfile
from pathlib import Path
from typing import Any

from .pictures import Picture, _call, _words


class Outlines:
    """What `outlines` has made of a map: `file`, the GeoJSON for ice.outlines; `record`, every number as a dictionary
    (coordinates, plane, changes with areas, floes); `text`, the same in words, with lines for a case."""

    def __init__(self, map: Path, file: Path, record: dict[str, Any], text: str, options: list[str]) -> None:
        self.map, self.file, self.record, self.text = map, file, record, text
        self._options = options

    def picture(self) -> Picture:
        """The map beside the floes, with what was left out."""
        def draw(path: Path) -> None:
            with tempfile.TemporaryDirectory() as there:
                _call("outlines.py", self.map, "-o", Path(there) / "x.geojson", "--picture", path, "--force",
                      *self._options)
        drawn = Picture(draw)
        drawn._repr_png_()
        return drawn

    def __repr__(self) -> str:
        return f"<bergtow.Outlines {self.file}>"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self))}</p><pre>{html.escape(self.text)}</pre>"


def outlines(map: str | os.PathLike[str], file: str | os.PathLike[str], *, replace: bool = False,
             **options: Any) -> Outlines:
    """Floe outlines for a case from a map: any vector format that GDAL knows (shapefile, GeoPackage, ...) or an image
    of labels, in any coordinate reference system, repaired with every change counted.

        floes = bergtow.outlines("mosaic.gpkg", "floes.geojson", centre=(-12, 80), box=("1.1 km", "900 m"))
        case = bergtow.Case({"ice": {"outlines": "floes.geojson", ...}, ...})

    file: GeoJSON to write. options: those of `bergtow outlines`, where pairs may be tuples: centre, heading, crs,
    layer, where, thickness, water, unseen, footprint, band, pixel, box, clear, cut, stairs, tolerance, least. Needs
    GDAL, pyproj and shapely.
    Errors: BergtowError, with what to say of a map that is not understood.
    """
    known = {name: ",".join(str(v) for v in value) if isinstance(value, (list, tuple)) else value
             for name, value in options.items()}
    words = _words(known)
    with tempfile.TemporaryDirectory() as there:
        record = Path(there) / "record.json"
        text = _call("outlines.py", map, "-o", file, "--record", record, *(["--force"] if replace else []), *words)
        text = text.replace(f"{record}\n", "")
        return Outlines(Path(map), Path(file), json.loads(record.read_text(encoding="utf-8")), text, words)
