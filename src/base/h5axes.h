// SPDX-License-Identifier: MIT
// What a dataset holds, for programs that do not know this one: units, a name to print, and the name of each axis.
//
// Axes are HDF5 dimension scales [HDF5 Dimension Scale Specification], as netCDF-4 writes and reads them: an axis is
// the one-dimensional dataset of its name beside the dataset or in the root group (time, member), its coordinate; where
// there is none, it is a dimension alone, in the root group, of netCDF's name for that and without a byte of storage.
// So xarray, the netCDF library and MATLAB's HDF5 functions find them.
#ifndef BT_H5AXES_H
#define BT_H5AXES_H

#include "base/h5util.h"

/// Units of a dataset, as UDUNITS reads them [CF 1.8, 3.1]: attribute units. Those of columns that differ, with commas
/// between, are no unit there: attribute units_of_columns.
void bt_h5_units(bt_h5 *h, const char *dataset, const char *units);

/// Units ("1": none, NULL: it is text, or no one unit holds for all of it) and meaning of a dataset, as attributes
/// long_name and description beside the units. axes: the name of each dimension, with blanks between; NULL: they are
/// not named.
void bt_h5_describe(bt_h5 *h, const char *dataset, const char *axes, const char *units, const char *meaning);

/// The axes alone, where a coordinate is made after the dataset.
void bt_h5_axes(bt_h5 *h, const char *dataset, const char *axes);

/// What a file as a whole is, by the conventions of the Climate and Forecast metadata (CF 1.8: groups).
void bt_h5_describe_file(bt_h5 *h, const char *title);

#endif
