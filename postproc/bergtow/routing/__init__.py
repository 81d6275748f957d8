# SPDX-License-Identifier: MIT
"""Route and speed of a tow through known ice: planned, then verified by tows."""
