#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Public functions and OpenMP teams that do not begin with BT_PLAIN_NUMBERS (src/base/inside.h): they would write
numbers as the calling program does, and compute in its floating-point environment. Exit code 1 if there is one."""
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs"))
from headers import FOR_CPP, NAME, parts, prototype  # noqa: E402

#: Functions that neither compute with fractions nor write or read any.
WITHOUT = set("""
    bt_alloc bt_realloc bt_alloc_aligned bt_alloc_unset bt_on_out_of_memory bt_text_begin bt_text_end bt_text_copy
    bt_errors_code bt_errors_free bt_errors_move bt_release bt_version bt_last_error
    bt_case_free bt_events_add bt_events_free bt_field_init bt_field_free bt_member_free bt_route_free bt_study_free
    bt_world_free bt_field_frame bt_field_share bt_outline_near_thickness bt_outline_chart_column bt_field_fixed_ours
    bt_field_outlines_ours bt_stats_start_step bt_stats_last_start
    bt_comm_world bt_comm_library bt_comm_abort bt_comm_split bt_comm_split_end bt_comm_bcast bt_comm_any bt_comm_rest
    bt_comm_wait bt_comm_before bt_comm_gather
    bt_force_is_applied bt_force_series_find bt_n_contact_laws bt_contact_law_of bt_n_estimates bt_estimate_of
    bt_n_series bt_series bt_series_find bt_n_added bt_added bt_balance_words
    bt_simulation_steps bt_simulation_steps_left bt_simulation_dt bt_simulation_bodies bt_simulation_towed
""".split())

FIRST = "BT_PLAIN_NUMBERS;"
DEFINED = re.compile(r"^(?!static\b|typedef\b|extern\b)\w[\w *]*?\b(bt_\w+)\([^;{]*\)\s*\{\s*", re.M)
TEAM = re.compile(r"^ *#pragma omp parallel\b(?:.*\\\n)*.*\n", re.M)


def public():
    """Names of the functions of the public headers that are not defined there."""
    for path in sorted((ROOT / "include/bergtow").glob("*.h")):
        for _, declaration in parts(FOR_CPP.sub("", path.read_text(encoding="utf-8"))):
            call = None if declaration.startswith("static inline") else prototype(declaration)
            if call:
                yield NAME.search(call).group(1)


def faults():
    names, begins = set(public()), {}
    for path in sorted([*ROOT.glob("src/*/*.c"), *ROOT.glob("partition/*.c")]):
        text, name = path.read_text(encoding="utf-8"), path.relative_to(ROOT)
        begins |= {m.group(1): text.startswith(FIRST, m.end()) for m in DEFINED.finditer(text) if m.group(1) in names}
        for m in TEAM.finditer(text):
            if not re.match(rf"\s*\{{\s*(\}}|{FIRST})", text[m.end():]):
                yield f"{name}:{text.count(chr(10), 0, m.start()) + 1}: a team that does not begin with {FIRST}"
    for name in sorted(names - begins.keys()):
        yield f"{name}: public, but not found in src/ or partition/"
    for name in sorted(names & begins.keys()):
        if begins[name] == (name in WITHOUT):
            yield f"{name}: " + ("begins" if begins[name] else "does not begin") + f" with {FIRST}"
    for name in sorted(WITHOUT - names):
        yield f"{name}: named in {Path(__file__).name}, but not public"


if __name__ == "__main__":
    found = list(faults())
    print("\n".join(found), end="\n" if found else "")
    sys.exit(bool(found))
