# SPDX-License-Identifier: MIT
"""Many runs: ensembles, and what is found out by runs that are made for it."""
