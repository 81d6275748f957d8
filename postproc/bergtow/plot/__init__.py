# SPDX-License-Identifier: MIT
"""Pictures and films, each a matplotlib Figure."""
