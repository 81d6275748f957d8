# SPDX-License-Identifier: MIT
"""Routes of a tow through known floes."""
