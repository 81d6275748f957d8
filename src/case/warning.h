// SPDX-License-Identifier: MIT
// Warnings of a case and a run, and reasons of a verdict: a code, a text for readers, and the values in it.
//
// Scripts and postproc/ read codes and values, which stay the same. Texts may change at any time; each stands where the
// fact is known, beside the values in it. A row describes a code: its name, the names of the values in the order of the
// text's conversions, and its meaning, which does not depend on the values. A value is a number, or the name of a key,
// a series or a choice. "-" marks a conversion that is wording only, as are all after the last name.
#ifndef BT_WARNING_H
#define BT_WARNING_H

#include "base/json.h"

#define BT_WARNINGS(ROW)                                                                                               \
    /* the run */                                                                                                      \
    ROW(STOPPED, "stopped", "", "the run stopped early")                                                               \
    ROW(ENDED_EARLY, "ended_early", "steps of_steps", "the run took fewer steps than the case has")                    \
    ROW(NOT_STEADY, "not_steady", "", "the tow is not steady over the window")                                         \
    ROW(TOO_SHORT, "too_short", "", "the window is too short for its means")                                           \
    ROW(NO_TOW, "no_tow", "direction_deg", "nothing tows the body")                                                    \
    ROW(HELD_BACK, "held_back", "mean_n least_n", "the tow holds the body back, which is carried along faster")        \
    ROW(BODY_BALANCE, "body_balance", "- relative", "the momentum balance of the body does not close")                 \
    ROW(ICE_BALANCE, "ice_balance", "relative", "the momentum balance of ice and walls does not close")                \
    ROW(MOMENTUM, "momentum", "relative", "a step does not conserve momentum")                                         \
    ROW(UNCONVERGED, "unconverged", "steps of_steps residual_m_s tolerance_m_s",                                       \
        "steps reached the work limit before the tolerance")                                                           \
    ROW(LOCKED, "locked", "steps of_steps", "bodies were locked between others that cannot give way")                  \
    ROW(UNPROJECTED, "unprojected", "steps of_steps", "the position projection left overlap")                          \
    ROW(OUTRUN, "outrun", "steps of_steps", "a body moved farther than the contact detection looks ahead")             \
    ROW(REBOUNDS_LOWERED, "rebounds_lowered", "steps of_steps",                                            \
        "rebounds that would have added energy, or had no room, were lowered")                                         \
    ROW(ENERGY_ADDED, "energy_added", "steps of_steps", "contacts added energy")                                       \
    ROW(OVERLAP, "overlap", "overlap_m share_percent", "bodies overlap")                                             \
    ROW(CRUSHED, "crushed", "depth_m share_percent", "floes were crushed deeper than the model is valid for")          \
    ROW(END_INSIDE, "end_inside", "time_s from_s", "the towing end was inside the hull")                               \
    ROW(STALLED, "stalled", "time_s of_s speed_percent", "the towed body stood still, held by the ice")                \
    ROW(FLOES_LEFT, "floes_left", "floes", "floes left the open domain")                                               \
    ROW(LINE_BROKEN, "line_broken", "time_s", "a branch of the tow line parted")                                       \
    ROW(ADRIFT, "adrift", "time_s", "the last line parted, and nothing has towed the body since")                      \
    ROW(ICE_OVERTOOK, "ice_overtook", "distance_m", "ice overtook the body in a moving window")                        \
    ROW(WINDOW_LAPS, "window_laps", "laps", "the moving window passes through its ice more than once")                 \
    ROW(PLACES_MISSED, "places_missed", "share_percent", "floes due to enter the moving window found no free place")   \
    ROW(FLOES_KEPT, "floes_kept", "share_percent", "disturbed floes came back ahead of the moving window")             \
    /* reasons of a verdict alone */                                                                                   \
    ROW(SETTLING, "settling", "- from_s start_s", "a reported force is still settling where the window begins")        \
    ROW(NO_LOAD, "no_load", "share_percent", "the load on the body has no bound in some steps of the window")          \
    ROW(UNCONVERGED_SHARE, "unconverged_share", "share_percent limit_percent", "too many steps did not converge")      \
    ROW(RESIDUAL, "residual", "residual_m_s limit speed_m_s", "a step ended far from its solution")                    \
    ROW(COURSE_CHANGES, "course_changes", "angle_deg waypoint", "the course changes within the window")                \
    ROW(COURSE_FOLLOWS, "course_follows", "angle_deg", "the course of the body still changes within the window")       \
    ROW(PROGRAMME, "programme", "from_m_s to_m_s start_s end_s", "the speed of the tow changes within the window")     \
    ROW(PARTED_IN_WINDOW, "parted_in_window", "time_s", "a line parted within the window")                             \
    ROW(STOOD_STILL, "stood_still", "time_s of_s", "the body stood still for too much of the tow")                     \
    ROW(NO_HEADWAY, "no_headway", "asked_m start_s end_s", "the body makes no headway")                                \
    ROW(TREND, "trend", "- - - - - share_percent", "a reported force has a trend over the window")                     \
    ROW(NO_ICE_CHANNEL, "no_ice_channel", "start_s end_s width_m", "the body met no ice in its channel")               \
    ROW(NO_ICE, "no_ice", "start_s end_s concentration_percent", "the body met no ice within the window")              \
    ROW(FEW_CONTACTS, "few_contacts", "start_s end_s stretches needed", "the mean rests on a few contacts")            \
    ROW(FEW_SWINGS, "few_swings", "window_s swings period_s", "the window is shorter than two swings on the line")     \
    ROW(FEW_SAMPLES, "few_samples", "window_s samples - correlation_s needed",                                         \
        "the window holds too few independent samples")                                                                \
    ROW(NO_WINDOW, "no_window", "start_s end_s", "the run ends before a window can begin")                             \
    ROW(NOT_FINITE, "not_finite", "", "the forces on the body are not finite")                                         \
    ROW(WITHIN_RAMP, "within_ramp", "start_s - ramp_s", "the window begins before the tow reaches its speed")          \
    /* the case */                                                                                                     \
    ROW(IDLE, "idle", "keys", "keys of the case have no effect")                                                       \
    ROW(SPEED_JUMP, "speed_jump", "from_m_s to_m_s", "the speed of the tow changes within a step")                     \
    ROW(TURN_JUMP, "turn_jump", "waypoint", "the course of the tow changes within a step")                             \
    ROW(CURRENT_OVERTAKES, "current_overtakes", "source current_m_s tow_m_s", "the current is faster than the tow")    \
    ROW(STEEP_PROGRAMME, "steep_programme", "speed_m_s rise_s period_s least_s", "a rise in speed jerks the line")     \
    ROW(SHORT_RAMP, "short_ramp", "ramp_s period_s least_s", "the start jerks the line")                               \
    ROW(ODD_MASS, "odd_mass", "key ratio", "the mass of the body is not that of the displaced water")                  \
    ROW(ODD_DRAFT, "odd_draft", "draft_m ratio width_m", "the body is so deep that it would capsize")                  \
    ROW(BERG_STABILITY, "berg_stability", "draft_m - metacentric_height_m width_m",                                   \
        "a column with the body's waterline, draft and sail would roll over")                                          \
    ROW(SHORT_RUN, "short_run", "ramp_s duration_s", "the run ends within the ramp of the tow")                        \
    ROW(LONG_IMPACT, "long_impact", "duration_s steps", "the duration of a collision is set too long")                 \
    ROW(TABLE_ROWS, "table_rows", "key dt_s rows first_s", "a table changes within less than a time step")             \
    ROW(FILE_CHANGED, "file_changed", "key file now recorded",                                                         \
        "a file that the case names is not the one that it was recorded with")                                         \
    ROW(LEAD_CORNERS, "lead_corners", "aside_m width_m", "the body leaves the lead at a corner of its path")           \
    ROW(LEAD_DRIFT, "lead_drift", "drift_m - width_m", "the lead drifts off the planned path")                         \
    ROW(NARROW_DOMAIN, "narrow_domain", "key widths concentration_percent - - needed",                                 \
        "the domain is too narrow for its ice")                                                                        \
    ROW(ICE_STRIP, "ice_strip", "keys water_m", "beside the tow, the ice ends before the domain does")                 \
    ROW(ICE_GAP, "ice_gap", "water_m", "the ice does not fill the moving window")                                      \
    ROW(LOAD_UNBOUNDED, "load_unbounded", "concentration_percent - limit_percent",                                     \
        "the load from dense ice of rigid floes has no upper bound")                                                   \
    ROW(PACKED_AT_START, "packed_at_start", "packed", "packed ice reaches the wall ahead from the start")              \
    ROW(PACKED, "packed", "time_s earliest_s packed end_s", "packed ice reaches the wall ahead")                       \
    ROW(CLOSED_ICE, "closed_ice", "boundary concentration packed", "the walls close until the ice is packed")          \
    ROW(SLOW_CLOSING, "slow_closing", "boundary speed_m_s floes share_m_s accepted_m_s tolerance",                     \
        "the walls close more slowly than the tolerance resolves")                                                     \
    ROW(THIN_SPLITS, "thin_splits", "thickness_m", "floes that would raft or bend may split")                          \
    ROW(ODD_STRENGTH, "odd_strength", "key value - least most", "ice is far weaker or stronger than published values") \
    ROW(THICK_ICE, "thick_ice", "thickness_m", "the ice is implausibly thick")                                         \
    ROW(OWN_WAKE, "own_wake", "time_s", "the body meets ice that it has already opened")                               \
    ROW(LEAVES_ICE, "leaves_ice", "time_s", "the body leaves the ice")                                                 \
    ROW(LONG_STEP, "long_step", "dt_s - longest_s", "a time step is longer than a collision")                          \
    ROW(FAST_FLOES, "fast_floes", "dt_s - share longest_s", "floes move too far in a time step")                       \
    ROW(LOW_REFERENCE_SPEED, "low_reference_speed", "reference_m_s ice_m_s",                                           \
        "the reference speed is below that of the ice")                                                                \
    ROW(ICE_OVERTAKES, "ice_overtakes", "distance_m", "ice will overtake the body in a moving window")                 \
    ROW(LARGE_FLOES, "large_floes", "size_m period_m", "the largest floes may not turn side by side in a period")      \
    ROW(DENSE_POLYGONS, "dense_polygons", "concentration most", "regular polygons may not pack so densely")            \
    /* the ice */                                                                                                      \
    ROW(UNPLACED, "unplaced", "floes of_floes share_percent", "floes drawn from the size law found no place")          \
    ROW(MEAN_SIZE, "mean_size", "floes size_m share_percent", "the mean size of the floes is not the requested one")   \
    ROW(SPREAD, "spread", "- spread asked", "floe sizes spread less than requested")                                   \
    ROW(SMALL_FLOES, "small_floes", "small floes share_percent least_m", "some floes are smaller than requested")      \
    ROW(ICE_OUTSIDE, "ice_outside", "floes of_floes area_m2", "floes lie outside the ice region")                      \
    ROW(MAP_ENDS, "map_ends", "x_min_m x_max_m y_min_m y_max_m", "the map of the ice ends within the ice region")      \
    ROW(ICE_CHART, "ice_chart", "columns", "the polygons are regions of an ice chart, not floes")                      \
    ROW(OTHER_REGION, "other_region", "file_m2 domain_m2", "the file's concentration refers to another ice region")    \
    ROW(LATITUDE_FIRST, "latitude_first", "latitude_deg longitude_deg", "coordinates may be in the wrong order")       \
    ROW(NO_LATITUDE, "no_latitude", "latitude_deg", "the map has a latitude, but the case has none")                   \
    ROW(OTHER_LATITUDE, "other_latitude", "latitude_deg case_deg", "the case and its map differ in latitude")          \
    ROW(GRID_PLANE, "grid_plane", "crs along across area_percent", "plane coordinates are not corrected")              \
    ROW(NO_THICKNESS, "no_thickness", "outlines of_outlines property thickness_m", "outlines have no thickness")       \
    ROW(STAYS_RIGID, "stays_rigid", "floes", "floes in convex parts do not raft")                                      \
    ROW(THICKNESS_IDLE, "thickness_idle", "", "the thickness of the case has no effect")                               \
    ROW(SPLIT_DEFERRED, "split_deferred", "floes", "floes split a step later than their load required")                \
    ROW(SPLIT_RESERVE, "split_reserve", "floes reserve", "floes could not split, as no ids were left")                 \
    ROW(SPLIT_UNCONVERGED, "split_unconverged", "steps of_steps", "no floe split in steps that did not converge")

typedef enum bt_warning {
#define BT_WARNING_NAME(name, code, values, meaning) BT_WARN_##name,
    BT_WARNINGS(BT_WARNING_NAME)
#undef BT_WARNING_NAME
        BT_N_WARNINGS
} bt_warning;

extern const struct bt_warning_row {
    const char *code, *values, *meaning;
} bt_warning_rows[BT_N_WARNINGS];

/// Append a warning with its text (printf-style); the values of its row follow from the conversions. list: NULL = not
/// wanted.
void bt_warn(bt_errors *list, bt_warning w, const char *text, ...) __attribute__((format(printf, 3, 4)));
/// Add a value to the last warning that its text gives in other words. name: as in a row.
void bt_warn_number(bt_errors *list, const char *name, double value);
void bt_warn_name(bt_errors *list, const char *name, const char *value);

/// An array of {"code", "text", "values"}, one a line; "code" is null for entries without one.
void bt_warnings_json(bt_json *json, const char *key, const bt_errors *list);
/// All texts as one, "; " between them; the caller frees it.
char *bt_warnings_text(const bt_errors *list);

#endif
