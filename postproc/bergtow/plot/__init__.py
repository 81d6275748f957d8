# SPDX-License-Identifier: MIT
"""Pictures and films, each a Figure of matplotlib."""
