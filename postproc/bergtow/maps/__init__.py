# SPDX-License-Identifier: MIT
"""Maps of ice: read, projected onto a plane, and repaired."""
