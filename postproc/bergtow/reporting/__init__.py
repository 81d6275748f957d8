# SPDX-License-Identifier: MIT
"""The report of a run or of an ensemble, as a page and as PDF."""
