# SPDX-License-Identifier: MIT
"""The report of a run or of an ensemble, as a web page and as PDF."""
