# SPDX-License-Identifier: MIT
"""Make up a labelled mosaic, as a classifier makes one of a satellite's or a drone's pictures: mosaic.tif.

    /usr/bin/python3 cases/outlines/make_mosaic.py [-o FILE.tif]

SYNTHETIC: no ice of this shape was ever seen, and the file says so itself. A GeoTIFF in polar stereographic metres
(EPSG:3413), 2 m a pixel: 0 water, 1 an iceberg, each other label a floe, 65535 beyond the edge of the swath. It has
what such files have: shores as staircases, ponds, crumbs of a pixel or two, one label in several pieces, floes cut by
the edge.
"""
import argparse
import pathlib

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

LON0, LAT0 = -12.0, 80.0    # degrees, in the Fram Strait, for no reason but the frame
PIXELS, SIZE = 700, 2.0     # a side; m
FLOES, LEAD = 650, 7.0      # seeds; m, mean width of the water between floes
BERG = (38.0, 26.0)         # m, half axes
NO_DATA = 65535
SAYS = "SYNTHETIC: made up by cases/outlines/make_mosaic.py, no ice that was ever seen"


def smooth(rng, length, shape=(PIXELS, PIXELS)):
    """A random field of so many pixels' correlation, with standard deviation 1."""
    field = gaussian_filter(rng.standard_normal(shape), length, mode="reflect")
    return field / field.std()


def labels(seed=19):
    """The image, north up."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:PIXELS, :PIXELS] * SIZE
    x, y = x + 8 * smooth(rng, 12) + 3 * smooth(rng, 3), y + 8 * smooth(rng, 12) + 3 * smooth(rng, 3)
    seeds = cKDTree(rng.uniform(-0.05, 1.05, (FLOES, 2)) * PIXELS * SIZE)
    distance, floe = seeds.query(np.c_[x.ravel(), y.ravel()], k=2)
    gap = (distance[:, 1] - distance[:, 0]).reshape(x.shape)
    image = 2 + floe[:, 0].reshape(x.shape).astype(np.uint16)
    image[gap < np.maximum(0, LEAD * (1 + 1.2 * smooth(rng, 40)))] = 0
    image[smooth(rng, 6) > 2.6] = 0                                         # ponds
    crumbs = (rng.random(image.shape) < 5e-3) & (image == 0)
    image[crumbs] = 2 + FLOES + np.arange(crumbs.sum())
    away = np.hypot(x - PIXELS * SIZE / 2, y - PIXELS * SIZE / 2)
    turned = ((x - y) / np.sqrt(2), (x + y - PIXELS * SIZE) / np.sqrt(2))
    image[(image > 0) & (away < 60)] = 0                                    # open water about the berg
    image[np.hypot(turned[0] / BERG[0], turned[1] / BERG[1]) < 1] = 1
    rows, columns = np.mgrid[:PIXELS, :PIXELS]
    image[rows > 640 + 0.12 * columns] = NO_DATA                            # the swath ends
    return image


def write(image, path):
    from osgeo import gdal, osr
    gdal.UseExceptions()
    polar, degrees = osr.SpatialReference(), osr.SpatialReference()
    polar.ImportFromEPSG(3413)
    degrees.ImportFromEPSG(4326)
    degrees.SetAxisMappingStrategy(osr.OAMS_TRADITIONAL_GIS_ORDER)
    east, north, _ = osr.CoordinateTransformation(degrees, polar).TransformPoint(LON0, LAT0)
    half = PIXELS * SIZE / 2
    file = gdal.GetDriverByName("GTiff").Create(str(path), PIXELS, PIXELS, 1, gdal.GDT_UInt16, ["COMPRESS=DEFLATE"])
    file.SetGeoTransform((east - half, SIZE, 0, north + half, 0, -SIZE))
    file.SetProjection(polar.ExportToWkt())
    file.SetMetadataItem("TIFFTAG_IMAGEDESCRIPTION", SAYS)
    file.GetRasterBand(1).SetNoDataValue(NO_DATA)
    file.GetRasterBand(1).WriteArray(image)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", default=pathlib.Path("mosaic.tif"), type=pathlib.Path)
    path = parser.parse_args().output
    path.parent.mkdir(parents=True, exist_ok=True)
    write(labels(), path)
    print(f"{path}: {SAYS}")


if __name__ == "__main__":
    main()
