# SPDX-License-Identifier: MIT
"""For ParaView's Python: what its readers make of a frames.xdmf, as arrays in a file of numpy.

    pvpython tests/long/paraview_read.py FRAMES.xdmf OUT.npz
"""
import sys

import numpy as np
from paraview import servermanager, simple
from vtk.util.numpy_support import vtk_to_numpy


def pieces(data, name=""):
    """(name, grid) of every block; the new reader takes the blocks of a frame for nameless pieces, 0, 1, 2."""
    if not hasattr(data, "GetNumberOfCells") or data.IsA("vtkCompositeDataSet"):
        count = data.GetNumberOfPieces if data.IsA("vtkMultiPieceDataSet") else data.GetNumberOfBlocks
        get = data.GetPiece if data.IsA("vtkMultiPieceDataSet") else data.GetBlock
        for k in range(count()):
            of = data.GetMetaData(k)
            if get(k) is not None:
                yield from pieces(get(k), of and of.Get(data.NAME()) or str(k))
    else:
        yield name.split("[")[0], data


found = {}
for reader in (simple.XDMFReader(FileNames=[sys.argv[1]]), simple.Xdmf3ReaderS(FileName=[sys.argv[1]])):
    kind = "new" if "3" in type(reader).__name__ else "old"
    reader.UpdatePipelineInformation()
    found[f"{kind}/times"] = np.array(reader.TimestepValues)
    for k, time in enumerate(reader.TimestepValues):
        reader.UpdatePipeline(time)
        for name, grid in pieces(servermanager.Fetch(reader)):
            at = f"{kind}/{k}/{name}"
            found[f"{at}/points"] = np.array(vtk_to_numpy(grid.GetPoints().GetData()))
            found[f"{at}/offsets"] = np.array(vtk_to_numpy(grid.GetCells().GetOffsetsArray()))
            found[f"{at}/connectivity"] = np.array(vtk_to_numpy(grid.GetCells().GetConnectivityArray()))
            found[f"{at}/types"] = np.array(vtk_to_numpy(grid.GetCellTypesArray()))
            of_cells = grid.GetCellData()
            for j in range(of_cells.GetNumberOfArrays()):
                found[f"{at}/{of_cells.GetArrayName(j)}"] = np.array(vtk_to_numpy(of_cells.GetArray(j)))
np.savez(sys.argv[2], **found)
