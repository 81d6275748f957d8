// SPDX-License-Identifier: MIT
// A case: everything a run depends on, as read from the YAML file, in SI units and radians.
//
// The schema table in src/case/schema.c is the only place that defines each key with its unit, default, range and one
// sentence of documentation; it drives parsing, --set, --list-keys and case.resolved.yml. This header only
// holds the values. Choices are indices into the name lists of the schema.
#ifndef BERGTOW_CASE_H
#define BERGTOW_CASE_H

#include <math.h>

#include "bergtow/base.h"

BT_BEGIN_C

typedef enum { BT_FRAME_BASIN, BT_FRAME_GEOGRAPHIC } bt_frame;              // basin, geographic
// wall, periodic, open, moving (ends only)
typedef enum { BT_BOUND_WALL, BT_BOUND_PERIODIC, BT_BOUND_OPEN, BT_BOUND_MOVING } bt_bound;
typedef enum { BT_ICE_VORONOI, BT_ICE_RECTANGLES, BT_ICE_POLYGONS } bt_ice_shape; // voronoi, rectangles, polygons
typedef enum { BT_SIZE_SINGLE, BT_SIZE_LOGNORMAL, BT_SIZE_POWER } bt_size_law;    // single, lognormal, power
/// Coordinates of outlines: file, lonlat, plane, frame, metres.
typedef enum { BT_CRS_FILE, BT_CRS_LONLAT, BT_CRS_PLANE, BT_CRS_FRAME } bt_crs;
typedef enum { BT_NONCONVEX_REFUSE, BT_NONCONVEX_HULL, BT_NONCONVEX_SPLIT } bt_nonconvex; // refuse, hull, split
typedef enum { BT_START_DRIFT, BT_START_REST } bt_start;                           // drift, rest
typedef enum { BT_THICK_CONSTANT, BT_THICK_LOGNORMAL } bt_thickness_law;          // constant, lognormal
typedef enum {
    BT_BODY_DISC,
    BT_BODY_SQUARE,
    BT_BODY_RECTANGLE,
    BT_BODY_SHIP,
    BT_BODY_POLYGON,
    BT_BODY_ABSENT ///< added shapes (bergtow/shape.h) follow
} bt_body_shape;
typedef enum { BT_TOW_NONE, BT_TOW_SPEED, BT_TOW_LINE, BT_TOW_THRUST } bt_tow_mode; // none, speed, line, thrust
// numbers, steel-wire, polypropylene, dyneema
typedef enum { BT_ROPE_NUMBERS, BT_ROPE_STEEL, BT_ROPE_POLYPROPYLENE, BT_ROPE_DYNEEMA } bt_rope_type;
// none, slope, geostrophic, dynamic
typedef enum { BT_TILT_NONE, BT_TILT_SLOPE, BT_TILT_GEOSTROPHIC, BT_TILT_DYNAMIC } bt_tilt;
typedef enum { BT_LEAD_NONE, BT_LEAD_CHANNEL, BT_LEAD_MANAGED } bt_lead_mode;    // none, channel, managed

// none, duration, crushing
typedef enum { BT_IMPACT_NONE, BT_IMPACT_DURATION, BT_IMPACT_CRUSHING } bt_impact_conversion;
typedef enum { BT_CORNER_GIVEN, BT_CORNER_REAL } bt_corner;                  // given, real

/// Drag coefficients of a class of bodies (ice: floes; body: the towed body).
typedef struct bt_drag_coefs {
    double water_form; ///< C_w, on ½ρ draft×width
    double water_skin; ///< C_ws, on ρ A
    double air_form;   ///< C_a, on ½ρ sail×width
    double air_skin;   ///< C_as, on ρ A
    double tangential; ///< τ, share of the flow along a side in the moment of form drag
} bt_drag_coefs;

/// A velocity in time, read from a file: rows of time, x and y component; linear between them.
typedef struct bt_table {
    int64_t n;
    double *row;   ///< [n][3] s, m/s, m/s; ascending in time
} bt_table;

/// One floe or body given by hand (list `floes:`).
typedef struct bt_floe_def {
    bt_body_shape shape;
    double length, width;      ///< m, of a named shape
    double *vertices;          ///< [n_vertices][2] m, shape: polygon
    int n_vertices;
    double x, y, yaw;          ///< m, m, rad
    double vx, vy, yaw_rate;   ///< at time zero, m/s, m/s, rad/s; NaN: by ice.start
    double thickness;          ///< m
    bool fixed;                ///< infinite mass, at rest
    int line;                  ///< line in the case file, for messages
} bt_floe_def;


enum { BT_EXTRA_KEYS = 32 }; ///< most added keys

typedef struct bt_case {
    char *path;       ///< file name as given, for messages
    char *text;       ///< the file's text; with a base, those of all its files as YAML documents; with overrides, a
                      ///< last document {"set": {key: value}}
    char *floes_path; ///< base file that lists the floes, for messages; NULL if none
    struct {
        char *title;
        double dt;           ///< Δt, s
        double duration;     ///< s
        int64_t threads;     ///< OpenMP threads, 0 = as OMP_NUM_THREADS or all cores
    } run;
    struct {
        bt_frame frame;
        double x0, y0;         ///< low corner, m; defaults: basin (0, −width/2), geographic (−length/2, −width/2)
        double length, width;  ///< along x, along y, m
        bt_bound ends, sides;  ///< boundaries at the ends of x, and at the sides (ends of y)
        double wall_friction;  ///< Coulomb coefficient ice–wall
        double wall_restitution;
        double ends_closing, sides_closing; ///< inward speed of each wall, m/s
        double ahead;          ///< from the body to the end ahead of the tow, for moving ends, m
    } domain;
    struct {
        double concentration;           ///< area fraction in the ice region less the body's footprint, 0..0.95
        double x_min, x_max, y_min, y_max; ///< ice region, m; default the whole domain
        /// region of the field before it is cut to the ice region, m; NaN: that end of the ice region
        double extent_x_min, extent_x_max, extent_y_min, extent_y_max;
        bt_ice_shape shape;
        int64_t sides;                  ///< of shape: polygons
        double aspect;                  ///< length / width of shape: rectangles
        double size;                    ///< mean diameter of the circle of equal area, m
        bt_size_law size_law;
        double size_spread;             ///< standard deviation / mean of the diameter, laws single and lognormal
        double size_min, size_max;      ///< m, truncation of law power (and of lognormal when given; 0 = none)
        double size_exponent;           ///< a in N(>d) ~ d^−a
        double thickness;               ///< mean, m
        bt_thickness_law thickness_law;
        double thickness_spread;        ///< standard deviation / mean
        double density;                 ///< ρ_i, kg/m³
        double friction;                ///< μ ice–ice
        double restitution;             ///< e
        double crushing_pressure;       ///< Pa; 0 = rigid contact
        double crushing_least;          ///< least contact length / thickness
        double rafting_kappa;           ///< κ of the line load at which floes raft; 0 = they do not
        struct {
            double toughness;           ///< K, Pa √m; 0 = floes do not split
            double strength;            ///< σ_t of ice without a crack, Pa
            double least_size;          ///< least width of a piece, m
            int64_t generations;        ///< how often a floe and its pieces may split
            double aspect;              ///< largest length / width of a piece
            int64_t reserve;            ///< largest total number of pieces; 0 = twice the floes
            double scatter;             ///< Weibull modulus of the strength; 0 = the same for all
        } splitting;
        double added_mass;              ///< C_m
        double added_inertia;           ///< C_I
        bt_drag_coefs drag;
        double sheltering;              ///< λ, length of the lee of an edge / its height; 0 = none
        bt_start start;                 ///< velocity at time zero
        int64_t seed;
        double shake;                   ///< relaxation length of the generator, in mean free gaps (0 = none)
        char *field;                    ///< HDF5 field file instead of a generator, or NULL; relative to the case file
        /// GeoJSON file of outlines instead of a generator, or NULL; relative to the case file
        char *outlines;
        bt_crs outlines_crs;            ///< type of its coordinates
        double origin_lon, origin_lat; ///< place of x = y = 0 on the earth, rad; NaN: the middle of outlines in degrees
        double origin_east, origin_north; ///< of x = y = 0 in the plane of the outlines, m; NaN: by the keys
        bt_nonconvex nonconvex;         ///< treatment of outlines that are not convex
    } ice;
    bt_floe_def *floes;   ///< [n_floes] given by hand
    bt_idx n_floes;
    struct {
        bt_body_shape shape;
        double length, width;    ///< m
        double *vertices;        ///< [n_vertices][2] m, shape: polygon
        int n_vertices;
        double x, y, yaw;        ///< centroid at time zero, m, m, rad
        double vx, vy, yaw_rate; ///< velocity at time zero (tow: none or line), m/s, rad/s; vx, vy NaN: free drift
        double draft, sail;      ///< m
        double density;          ///< ρ of the body, kg/m³, used when mass is not given
        double mass;             ///< kg; 0 = density × waterline area × (draft + sail)
        double added_mass, added_inertia; ///< C_m, C_I
        double friction;         ///< μ ice–body
        double restitution;      ///< e ice–body
        bt_drag_coefs drag;
    } body;
    struct {
        bt_tow_mode mode;
        /// of the body (speed), of the end (line), the vessel's limit (thrust), m/s; with a programme its largest
        double speed;
        double direction;        ///< heading of the tow at the start from +x towards +y, rad
        double ramp;             ///< time over which the speed rises linearly from 0, s
        double *programme;       ///< [n_programme][2] time s, speed m/s; empty = ramp and speed
        int n_programme;
        double *waypoints;       ///< [n_waypoints][2] m; empty = straight
        int n_waypoints;
        double turn_radius;      ///< m, of the corners at way-points; 0 = sharp
        double line_length;      ///< L0 unstretched, m
        double line_stiffness;   ///< EA, N
        double line_damping;     ///< c, N s/m
        double hull_x, hull_y;   ///< fastening point, body frame, m; default the foremost point of the waterline
        struct {
            bt_rope_type type;   ///< rope type that gives stiffness and breaking load
            double diameter;     ///< m, of a named line
            int64_t branches;    ///< 1, or 2: a bridle
            double breaking_load;///< N, 0 = never breaks
            double weight;       ///< in water, N/m; 0 = straight, without sag (catenary.h)
        } line;
        struct {                 ///< the second branch; default: as the first, on the other side of the hull
            double hull_x, hull_y, length, stiffness, damping, breaking_load; ///< m, m, m, N, N s/m, N
        } branch2;
        struct {                 ///< mode thrust, see tow.h
            double mass;         ///< kg
            double added_mass;   ///< C_m
            double bollard_pull; ///< N
            double free_speed;   ///< m/s
            double free_resistance; ///< N at the free-running speed
            double lateral_drag; ///< drag across / along
            double lookahead;    ///< m
        } vessel;
    } tow;
    struct {
        bt_lead_mode mode;       ///< treatment of the ice ahead by the vessel
        double width;            ///< m
        double length;           ///< of the path, from the body's place, m
        double floe_size;        ///< managed: equivalent diameter of the largest piece, m
    } lead;
    struct {
        double density;          ///< ρ_w, kg/m³
        double current_x, current_y; ///< U_w, its constant part, m/s
        struct {
            double major, minor;     ///< semi-axes of the tidal ellipse, m/s; minor > 0 rotates from x towards y
            double inclination;      ///< of the major axis from x towards y, rad
            double period, phase;    ///< s; rad: the current is largest along the major axis at time phase/2π × period
        } tide;
        char *current_table;     ///< CSV file of the current in time, or NULL; relative to the case file
        bt_table table;          ///< its contents
        double latitude;         ///< rad; Coriolis parameter f = 2Ω sin(latitude); 0 = off
        bt_tilt tilt;
        double slope_x, slope_y; ///< ∇η for tilt: slope
    } water;
    struct {
        double density;          ///< ρ_a, kg/m³
        double wind_x, wind_y;   ///< U_a, m/s
        char *wind_table;        ///< CSV file of the wind in time, or NULL; relative to the case file
        bt_table table;          ///< its contents
    } air;
    struct {
        double tolerance;        ///< natural-map residual / reference speed for convergence
        double reference_speed;  ///< m/s; 0 = tow speed, or the largest speed prescribed in the case
        int64_t max_sweeps;
        int64_t inner_sweeps;    ///< sweeps of a cell before the next cell
        double cell_size;             ///< least side of a cell / mean floe size
        bool plain;              ///< no acceleration
        bool plain_schedule;     ///< passes by one thread (space/phases.h)
        bool warm_start;
        double slop;             ///< overlap left alone by the position projection / mean floe size
        int64_t position_sweeps; ///< limit of the position projection
        double rest_speed;       ///< approach below this speed has no restitution, m/s
    } solver;
    struct {                     ///< guards that end a run, see src/run/guard.h; 0 or false = off
        double overlap;          ///< / mean floe size
        double energy;           ///< / the energy to which the case can drive the bodies
        int64_t unconverged;     ///< consecutive steps
        double no_solution;      ///< share of the steps of the case
        bool escape;             ///< a floe beyond a wall
    } guard;
    struct {
        bt_impact_conversion conversion; ///< of the impulse of a collision into a force
        double duration;         ///< T_c of a collision, s
        double pressure;         ///< p of crushed ice, Pa
        bt_corner corner;        ///< source of the angle of the crushed corner
        double corner_angle;     ///< φ when given, or without a corner, rad
        double least_speed;      ///< approach below this is quasi-static, m/s
        int64_t panels;          ///< pieces of the hull's perimeter
    } impact;
    struct {
        int64_t sample_every;    ///< steps per entry of the series
        double frame_interval;   ///< s between frames; 0 becomes a 200th of the duration; negative: no frames
        double window_start;     ///< s, start of the steady window; negative = found from the series
        double progress;         ///< s of wall time between progress lines
        int64_t checkpoint_steps;///< steps between checkpoints, 0 = none by steps
        double checkpoint_wall;  ///< s of wall time between checkpoints, 0 = none by time
        bool panels;             ///< series of the loads on the hull's panels
    } output;
    struct {
        double p_star, p_s;      ///< ice strength Pa and capture threshold N/m of Lichey and Hellmer, at full scale
        double c_si;             ///< drag coefficient of ice on the body
        double kappa, kappa_low, kappa_high; ///< 2 × work of rafting / potential energy gained
        double phi_j;            ///< concentration to which ice is swept together
        double length_scale;     ///< full scale / this case
    } estimate;
    struct {
        double mean_force;       ///< measured mean ice resistance, N; NaN = none
        char *source;            ///< publication
    } reference;
    struct {
        char *client, *project, *author, *document, *revision, *distribution; ///< for the title block of reports
    } report;
    /// [k] values of added keys (bt_keys_add: of force laws, contact laws and sections of a program), SI, in the order
    /// of their addition
    double extra[BT_EXTRA_KEYS];
    int n_extra;                 ///< number of keys added before it was read; later ones have no value
} bt_case;

/// Name of the case in messages.
static inline const char *bt_case_name(const bt_case *input) { return input->path ? input->path : "case"; }

/// Read and check a case file, with its base files (key `base`); every error of the files is appended to err with file,
/// line, key and remedy.
/// overrides: [n] texts "key=value" that replace the file's values. *input is overwritten without being released;
/// release it with bt_case_free, also after an error. Errors: BT_ERR_CASE, BT_ERR_IO.
bt_status bt_case_read(bt_case *input, const char *path, const char *const *overrides, int n, bt_errors *err);

/// The same, with the place of each override: [n] texts "FILE:LINE: " that messages name instead of "--set ".
bt_status bt_case_read_placed(bt_case *input, const char *path, const char *const *overrides, const char *const *place,
                              int n, bt_errors *err);

/// The same from a text; path: its name in messages, and the base of relative file names in the text.
bt_status bt_case_read_text(bt_case *input, const char *path, const char *text, const char *const *overrides,
                            const char *const *place, int n, bt_errors *err);

/// The same from the text in a checkpoint, with its tables of current and wind: no file is read.
bt_status bt_case_read_kept(bt_case *input, const char *path, const char *text, const bt_table *current,
                            const bt_table *wind, bt_errors *err);

/// Set all defaults, for tests and programs that build a case in memory. *input is overwritten without being released.
void bt_case_defaults(bt_case *input);

/// Check keys against each other, and set defaults that follow from other keys; called by bt_case_read. Errors:
/// BT_ERR_CASE.
bt_status bt_case_finish(bt_case *input, bt_errors *err);

/// Every key with its value and unit as YAML that reads back to the same bits (17 digits). Caller frees.
char *bt_case_resolved(const bt_case *input);
/// One JSON object {"section.key": value}, in SI units, null for keys without a value. Caller frees.
char *bt_case_resolved_json(const bt_case *input);
#define BT_CASE_RESOLVED_HEAD                                                                                          \
    "# A case with every key, its value in SI units, and what it means. Running this file gives the same result.\n"

/// The text of bt_case_resolved below comment lines `head`. Caller frees.
char *bt_case_text(const bt_case *input, const char *head);

/// Turn a case into its Froude-scaled twin, with all lengths times ratio and all else by dimension (src/case/froude.c):
/// the twin has the same motion, with times sqrt(ratio) as long. Errors: BT_ERR_CASE for values out of range and for
/// keys that name files of numbers with a dimension.
bt_status bt_case_scale(bt_case *input, double ratio, bt_errors *err);

/// The twin as a case file, below comments on the scaling and on what is not similar. Caller frees.
char *bt_case_scaled_text(const bt_case *twin, double ratio);

/// The waterline polygon of the towed body, centroid at the origin. v: [BT_MAX_VERTICES][2] m. Returns the count, 0
/// without a body and for an invalid outline.
int bt_case_waterline(const bt_case *input, double *v);

/// The outline of a floe given by hand, centroid at the origin. v: [BT_MAX_VERTICES][2] m. Returns the count.
int bt_case_floe_outline(const bt_floe_def *floe, double *v);

/// Potential energy that sheets gain on each other, over area and thickness squared, Pa/m (docs/theory.md, rafting).
double bt_case_rise(double ice_density, double water_density);

/// Mass of the towed body without added mass, kg.
double bt_case_body_mass(const bt_case *input);

/// Is space periodic between two such boundaries? A moving window is, along x (window.h).
static inline bool bt_bound_wraps(bt_bound b) { return b == BT_BOUND_PERIODIC || b == BT_BOUND_MOVING; }

/// Direction of the tow and of a moving window: +1 towards +x, −1 towards −x.
double bt_case_tow_sign(const bt_case *input);

/// A velocity at time zero as a number: 0 if it is left to free drift.
static inline double bt_case_start(double v) { return isnan(v) ? 0 : v; }

/// Steps of the whole run: duration / dt rounded up, with a slack of 1e-12 of it, so that 2.1 s / 0.3 s is 7.
int64_t bt_case_steps(const bt_case *input);

/// Earliest start of the window of the statistics, s: output.window_start, or the end of the ramp; at a prescribed
/// speed one step later; plus two periods if the ramp is short for a body on its line, but at most halfway to the end
/// of the run.
double bt_case_earliest_window(const bt_case *input);

/// Reference speed of the solver tolerance, m/s (> 0).
double bt_case_reference_speed(const bt_case *input);

/// Release the contents of a case; the caller owns `input` itself.
void bt_case_free(bt_case *input);

/// Table of keys for --list-keys: key, unit, default, range, one sentence. Printed to the stream (FILE *).
void bt_case_list_keys(void *stream);

/// The same as JSON: {"keys": [...], "floe_keys": [...]}, each with name, type, default (or its rule), unit, range,
/// choices and meaning; the range is in the unit that a number without a unit has.
void bt_case_list_keys_json(void *stream);

BT_END_C

#endif
