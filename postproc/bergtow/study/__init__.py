# SPDX-License-Identifier: MIT
"""Ensembles, and studies that start their own runs."""
