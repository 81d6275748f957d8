# SPDX-License-Identifier: MIT
"""Statistics of runs and ensembles: means, extremes, fits, variances, the design value."""
