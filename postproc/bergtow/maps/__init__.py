# SPDX-License-Identifier: MIT
"""Maps of ice: read, brought into a plane, repaired."""
