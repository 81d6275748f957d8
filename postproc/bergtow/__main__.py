# SPDX-License-Identifier: MIT
"""python3 -m bergtow COMMAND ..."""
from bergtow.cli import main

main()
