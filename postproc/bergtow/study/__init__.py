# SPDX-License-Identifier: MIT
"""Many runs: ensembles, and studies that make their runs."""
