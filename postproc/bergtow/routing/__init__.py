# SPDX-License-Identifier: MIT
"""Routes of a tow through ice whose floes are known."""
