# SPDX-License-Identifier: MIT
"""Results of runs and ensembles: the only reader of their files, and quantities derived from the files alone."""
