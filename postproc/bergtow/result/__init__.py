# SPDX-License-Identifier: MIT
"""What runs and ensembles have left: the one reader of their files, and what follows from these alone."""
