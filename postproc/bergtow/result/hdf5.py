# SPDX-License-Identifier: MIT
"""Read HDF5 files that the program writes: clear messages on opening, and values as Python types."""
import h5py
import numpy as np

from bergtow.errors import RunError


def opened(path, remedy):
    """Open the file, read only. Raises RunError."""
    try:
        return h5py.File(path, "r")
    except FileNotFoundError:
        raise RunError(path, "missing", remedy) from None
    except OSError as error:
        raise RunError(path, f"not readable as HDF5 ({first_line(error)})", remedy) from None


def plain(value):
    """An attribute or scalar as str, number or array."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace").rstrip("\0")
    return value.item() if isinstance(value, np.generic) else value


def first_line(error):
    return str(error).splitlines()[0] if str(error) else type(error).__name__
