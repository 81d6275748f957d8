// SPDX-License-Identifier: MIT
// The table of keys of a case file.
//
// Sources named in the sentences:
//   [Yulmetov & Løset 2017]  Cold Reg. Sci. Technol. 138: broken-ice towing tests and their numerical model
//   [Hunke & Comeau 2011]    J. Geophys. Res. 116, C05008: icebergs in sea ice, drag coefficients
//   [Sukhorukov & Løset 2013] Cold Reg. Sci. Technol. 94: friction of sea ice on sea ice
//   [Rothrock & Thorndike 1984] J. Geophys. Res. 89: floe size distribution
//   [Lichey & Hellmer 2001]  J. Glaciol. 47: giant iceberg drift, force of sea ice on a berg; numbers also as in
//                            FESOM2's iceberg code
//   [Flato & Hibler 1995]    J. Geophys. Res. 100: ridging, work / potential energy
//   [Metrikin 2014]          NTNU: numerical simulation of dynamic positioning in ice, position projection
// "assumed" marks a choice of this program without a measurement behind it.
#include "case/schema.h"

#include "bergtow/shape.h"

#include "base/largest.h"
#include "base/name.h"
#include "case/case_derived.h"

#include <math.h>
#include <string.h>

static const char *const frames[] = {"basin", "geographic", NULL};
static const char *const bounds[] = {"wall", "periodic", "open", NULL};
static const char *const end_bounds[] = {"wall", "periodic", "open", "moving", NULL};
static const char *const ice_shapes[] = {"voronoi", "rectangles", "polygons", NULL};
static const char *const size_laws[] = {"single", "lognormal", "power", NULL};
static const char *const crss[] = {"file", "lonlat", "plane", "frame", NULL};
static const char *const nonconvexes[] = {"refuse", "hull", "split", NULL};
static const char *const starts[] = {"drift", "rest", NULL};
static const char *const thickness_laws[] = {"constant", "lognormal", NULL};
static const char *const floe_shapes[] = {BT_SHAPE_NAMES, "polygon", NULL};
static const char *const tow_modes[] = {"none", "speed", "line", "thrust", NULL};
static const char *const rope_types[] = {"numbers", "steel-wire", "polypropylene", "dyneema", NULL};
static const char *const conversions[] = {"none", "duration", "crushing", NULL};
static const char *const corners[] = {"given", "real", NULL};
static const char *const tilts[] = {"none", "slope", "geostrophic", "dynamic", NULL};
static const char *const lead_modes[] = {"none", "channel", "managed", NULL};

#define AT(member) .offset = offsetof(bt_case, member)
/// A key with the default of a model basin; `sea`: how to give its value in the geographic frame, which has no default.
#define BASIN(key, member, kind, preset_, range_, sea, doc_)                                                           \
    {                                                                                                                  \
        .name = key, .type = BT_KEY_REAL, .unit = BT_UNIT_##kind, .preset = preset_, .range = range_, AT(member),      \
        .at_sea = sea, .doc = doc_                                                                                     \
    }
#define REAL(key, member, kind, preset_, range_, doc_) BASIN(key, member, kind, preset_, range_, NULL, doc_)
#define BASIN_CHOICE(key, member, names, preset_, sea, doc_)                                                           \
    {                                                                                                                  \
        .name = key, .type = BT_KEY_CHOICE, .choices = names, .preset = preset_, AT(member), .at_sea = sea,            \
        .doc = doc_                                                                                                    \
    }
#define CHOICE(key, member, names, preset_, doc_) BASIN_CHOICE(key, member, names, preset_, NULL, doc_)
#define INT(key, member, preset_, range_, doc_) \
    {.name = key, .type = BT_KEY_INT, .preset = preset_, .range = range_, AT(member), .doc = doc_}
#define BOOL(key, member, preset_, doc_) {.name = key, .type = BT_KEY_BOOL, .preset = preset_, AT(member), .doc = doc_}
#define TEXT(key, member, preset_, doc_) {.name = key, .type = BT_KEY_TEXT, .preset = preset_, AT(member), .doc = doc_}
#define PATH(key, member, doc_) \
    {.name = key, .type = BT_KEY_TEXT, .preset = "none", AT(member), .file = true, .doc = doc_}

// Ranges guard against slips of units and against values that have no meaning in the model; they are wide on purpose.
#define ANYWHERE "[-1e7, 1e7]"
#define ANY_SPEED "[-100, 100]"

#define SPARE {.name = NULL}
#define EIGHT_SPARE SPARE, SPARE, SPARE, SPARE, SPARE, SPARE, SPARE, SPARE

bt_key bt_case_keys[] = {
    TEXT("run.title", run.title, "none", "one line for the reports"),
    REAL("run.dt", run.dt, TIME, NULL, "(0, 1000]",
         "time step, about the duration of a collision and much smaller than floe size / speed: 0.1 s in a basin, at "
         "most 5 s at full scale [Yulmetov & Løset 2017]"),
    REAL("run.duration", run.duration, TIME, NULL, "(0, 1e9]", "simulated time"),
    INT("run.threads", run.threads, "0", "[0, 1024]",
        "OpenMP threads, 0 = OMP_NUM_THREADS or all cores; the result does not depend on it"),

    CHOICE("domain.frame", domain.frame, frames, "basin",
           "basin: origin at the middle of the short side, x along the basin, y across it (on a map, x east and y "
           "north); geographic: origin at the body, x north, y east [Yulmetov & Løset 2017]"),
    BASIN("domain.length", domain.length, LENGTH, "72 m", "(0, 1e7]", "as in 2 km",
         "extent along x; the default is HSVA's large ice tank, from memory"),
    BASIN("domain.width", domain.width, LENGTH, "10 m", "(0, 1e7]", "as in 1.2 km",
         "extent along y; the default is HSVA's large ice tank, from memory"),
    REAL("domain.x0", domain.x0, LENGTH, "= 0 (basin), -length/2 (geographic)", ANYWHERE, "low corner of the domain"),
    REAL("domain.y0", domain.y0, LENGTH, "= -width/2", ANYWHERE, "low corner of the domain"),
    BASIN_CHOICE("domain.ends", domain.ends, end_bounds, "wall",
                 "moving, periodic, open or wall",
           "boundaries at the ends of x; moving: the domain follows the towed body, ice enters ahead and leaves "
           "behind"),
    BASIN_CHOICE("domain.sides", domain.sides, bounds, "wall",
                 "periodic, open or wall", "boundaries at the ends of y"),
    REAL("domain.wall_friction", domain.wall_friction, RATIO, "0.1", "[0, 10]",
         "Coulomb coefficient between ice or body and walls, assumed"),
    REAL("domain.wall_restitution", domain.wall_restitution, RATIO, "0", "[0, 1]", "restitution at walls, assumed"),
    REAL("domain.ends_closing", domain.ends_closing, SPEED, "0 m/s", "[0, 10]", "inward speed of each end wall"),
    REAL("domain.sides_closing", domain.sides_closing, SPEED, "0 m/s", "[0, 10]", "inward speed of each side wall"),
    REAL("domain.ahead", domain.ahead, LENGTH,
         "= from body.x to the end ahead of the tow; with moving ends, 0.6 domain.length if that end or body.x is not "
         "given",
         "(0, 1e7]",
         "distance from the body to the end ahead of it, kept constant by ends: moving; without body.x it places the "
         "body; the default is assumed"),

    BASIN("ice.concentration", ice.concentration, RATIO, "0.8", "[0, 0.95]", "as in 50 %, or 0 for open water",
          "area fraction of ice in the ice region, outside the body and the floes given by hand; 0 = open water"),
    REAL("ice.x_min", ice.x_min, LENGTH, "= domain.x0", ANYWHERE, "ice region, low end of x"),
    REAL("ice.x_max", ice.x_max, LENGTH, "= domain.x0 + domain.length", ANYWHERE, "ice region, high end of x"),
    REAL("ice.y_min", ice.y_min, LENGTH, "= domain.y0", ANYWHERE, "ice region, low end of y"),
    REAL("ice.y_max", ice.y_max, LENGTH, "= domain.y0 + domain.width", ANYWHERE, "ice region, high end of y"),
    REAL("ice.extent.x_min", ice.extent_x_min, LENGTH, "none", ANYWHERE,
         "low end of x of a larger region: the field is made for it, then cut to the ice region. Cases that differ "
         "only in their domain then have the same floes, except in a strip at the cut; none: the end of the ice "
         "region"),
    REAL("ice.extent.x_max", ice.extent_x_max, LENGTH, "none", ANYWHERE, "high end of x, as ice.extent.x_min"),
    REAL("ice.extent.y_min", ice.extent_y_min, LENGTH, "none", ANYWHERE, "low end of y, as ice.extent.x_min"),
    REAL("ice.extent.y_max", ice.extent_y_max, LENGTH, "none", ANYWHERE, "high end of y, as ice.extent.x_min"),
    CHOICE("ice.shape", ice.shape, ice_shapes, "voronoi",
           "floe outlines: convex cells, rectangles as sawn in a basin, or regular polygons"),
    INT("ice.sides", ice.sides, "6", "[3, 32]", "corners of the floes of shape polygons"),
    REAL("ice.aspect", ice.aspect, RATIO, "1", "[1, 10]", "length / width of the floes of shape rectangles"),
    BASIN("ice.size", ice.size, LENGTH, "1 m", "(0, 1e5]", "as in 30 m",
          "mean equivalent diameter (of the circle with a floe's area); 1 m in the basin, 30 m at full scale [Yulmetov "
          "& Løset 2017]; where the program makes no ice, the default in the geographic frame is the mean of `floes`, "
          "or the size of the body"),
    CHOICE("ice.size_law", ice.size_law, size_laws, "single", "distribution of the diameter"),
    REAL("ice.size_spread", ice.size_spread, RATIO, "0.2", "[0, 2]",
         "standard deviation / mean of the diameter, laws single and lognormal, assumed; above about 0.6 the floes "
         "come out with a larger mean and a smaller spread, and a run warns of it"),
    REAL("ice.size_min", ice.size_min, LENGTH, "0 m", "[0, 1e5]",
         "smallest diameter, needed by law power; 0 = no limit"),
    REAL("ice.size_max", ice.size_max, LENGTH, "0 m", "[0, 1e5]",
         "largest diameter, needed by law power; 0 = no limit"),
    REAL("ice.size_exponent", ice.size_exponent, NONE, "2", "[0.5, 4]",
         "a of the power law N(>d) ~ d^-a, 1.5 to 2.5 observed [Rothrock & Thorndike 1984]"),
    BASIN("ice.thickness", ice.thickness, LENGTH, "0.04 m", "(0, 100]", "as in 1 m",
          "mean floe thickness, assumed; none: every floe, read or given by hand, has its own thickness"),
    CHOICE("ice.thickness_law", ice.thickness_law, thickness_laws, "constant",
           "distribution of the thickness over the floes; lognormal: cut at the ends of its range"),
    REAL("ice.thickness_spread", ice.thickness_spread, RATIO, "0.2", "[0, 2]",
         "standard deviation / mean of the thickness, law lognormal, assumed"),
    REAL("ice.density", ice.density, DENSITY, "910 kg/m3", "[100, 1100]", "density of the floes [Hunke & Comeau 2011]"),
    REAL("ice.friction", ice.friction, RATIO, "0.35", "[0, 10]",
         "Coulomb coefficient ice on ice, assumed between natural (0.48) and polished (0.05) surfaces [Sukhorukov & "
         "Løset 2013]"),
    REAL("ice.restitution", ice.restitution, RATIO, "0", "[0, 1]", "restitution of floe collisions, assumed"),
    REAL("ice.crushing.pressure", ice.crushing_pressure, PRESSURE, "0 Pa", "[0, 1e9]",
         "pressure at which the edge of a floe crushes: a contact bears at most pressure x thickness x length; 0 = "
         "rigid contact without limit"),
    REAL("ice.crushing.least_length", ice.crushing_least, RATIO, "1", "[0, 100]",
         "least length of a contact / thickness of the crushed floe, assumed; 0: corners are sharp"),
    REAL("ice.rafting.kappa", ice.rafting_kappa, RATIO, "0", "[0, 1000]",
         "load at which floes slide over each other / the load that their potential energy alone needs on one side, "
         "1/2 rho_i (1 - rho_i/rho_w) g h2 per m; 0 = they never do; 2 = without loss. Kappa is twice the ratio of "
         "work to potential energy gained: a ratio of 17 for pressure ridges [Flato & Hibler 1995] is 34, and 5 to 17 "
         "is 10 to 34; the value for rafting is assumed"),
    REAL("ice.splitting.toughness", ice.splitting.toughness, TOUGHNESS, "0 Pa m^0.5", "[0, 1e9]",
         "fracture toughness K at which floes split along straight lines; 0 = they never split. At full scale 150 kPa "
         "m^0.5 (50 to 250 in the literature), not calibrated"),
    REAL("ice.splitting.strength", ice.splitting.strength, PRESSURE, "300 kPa", "(0, 1e9]",
         "tensile strength of uncracked ice, the limit for short sections; 200 to 500 kPa in the literature, not "
         "calibrated"),
    REAL("ice.splitting.least_size", ice.splitting.least_size, LENGTH,
         "= 3 ice.thickness, in the geographic frame at least 2 m", "(0, 1e5]",
         "least width of a piece: a floe does not split if a piece would be narrower; assumed"),
    INT("ice.splitting.generations", ice.splitting.generations, "5", "[1, 60]",
        "how often in a row a floe and its pieces may split, assumed"),
    REAL("ice.splitting.aspect", ice.splitting.aspect, RATIO, "6", "[1, 1000]",
         "largest length / width of a piece, unless that of the splitting floe is larger; assumed"),
    INT("ice.splitting.reserve", ice.splitting.reserve, "0", "[0, 2e7]",
        "most pieces added in the whole run; after that no floe splits; 0 = twice the number of floes"),
    REAL("ice.splitting.scatter", ice.splitting.scatter, NONE, "0", "[0, 1000]",
         "Weibull modulus of the floes' strength about its median, the value of ice.splitting; for example 10, "
         "assumed; 0 = the same strength for all floes"),
    REAL("ice.added_mass", ice.added_mass, RATIO, "0", "[0, 10]", "added mass of a floe / its mass, assumed"),
    REAL("ice.added_inertia", ice.added_inertia, RATIO, "0", "[0, 10]",
         "added moment of inertia of a floe / its own, assumed"),
    REAL("ice.drag.water_form", ice.drag.water_form, RATIO, "0.85", "[0, 100]",
         "form drag of the floe's edge in water; the value of icebergs [Hunke & Comeau 2011], assumed for floes"),
    REAL("ice.drag.water_skin", ice.drag.water_skin, RATIO, "5.5e-3", "[0, 10]",
         "skin drag of water under a floe [Hunke & Comeau 2011]"),
    REAL("ice.drag.air_form", ice.drag.air_form, RATIO, "0.4", "[0, 100]",
         "form drag of the floe's edge in air; the value of icebergs [Hunke & Comeau 2011], assumed for floes"),
    REAL("ice.drag.air_skin", ice.drag.air_skin, RATIO, "2e-3", "[0, 10]",
         "skin drag of air over a floe [Hunke & Comeau 2011]"),
    REAL("ice.drag.tangential", ice.drag.tangential, RATIO, "0", "[0, 1]",
         "share of the flow along a side that counts in the moment of form drag on floes; 0: pressure only, see "
         "body.drag.tangential"),
    REAL("ice.drag.sheltering", ice.sheltering, RATIO, "5.556", "[0, 100]",
         "length over which the lee of a floe's edge fades / height of the edge (draft in water, freeboard in air). "
         "With "
         "the value 1/s, an edge at the distance D behind another floe has 1 - exp(-s D/height) of its form drag in "
         "the free stream. The default is s = 0.18 [Hanssen-Bauer & Gjessing 1988; Steele et al. 1989; Tsamados et "
         "al. 2014]; s = 0.5 [Luepkes et al. 2012] is 2; 0 = none: every edge feels the free stream. The default "
         "lowers the drag of floes close to others, and so the load on a body that pushes them"),
    CHOICE("ice.start", ice.start, starts, "drift",
           "velocity of floes, and of an untowed body, at time zero; drift: the forces of wind, water, Coriolis and "
           "slope balance at that time, without motion across walls; rest: 0"),
    INT("ice.seed", ice.seed, "1", "[0, 9.2e18]", "seed of the field; the same seed gives the same field"),
    REAL("ice.shake", ice.shake, RATIO, "15", "[0, 1000]",
         "random displacement that breaks up the order of the field, in mean free gaps; 0 = none; assumed"),
    PATH("ice.field", ice.field,
         "HDF5 field file read instead of making a field; relative to the folder of the case file"),
    PATH("ice.outlines", ice.outlines,
         "GeoJSON file of floe outlines (FeatureCollection of Polygons, positions [east, north]; properties thickness "
         "in m and id are optional) read instead of making a field; relative to the folder of the case file"),
    CHOICE("ice.outlines_crs", ice.outlines_crs, crss, "file",
           "coordinates of the outlines: as the file's crs says, degrees if it has none [RFC 7946]; for a file without "
           "a crs also lonlat (degrees, WGS84), plane (metres east, north) or frame (metres x, y of this case)"),
    REAL("ice.origin_lon", ice.origin_lon, ANGLE, "none", "[-180, 360]",
         "longitude of x = y = 0, for outlines in degrees (none: their middle), and of any other field (none: that of "
         "its file); outlines are projected about it (azimuthal equidistant, within 100 km)"),
    REAL("ice.origin_lat", ice.origin_lat, ANGLE, "none", "[-90, 90]", "latitude of x = y = 0, as ice.origin_lon"),
    REAL("ice.origin_east", ice.origin_east, LENGTH, "none", "[-1e8, 1e8]",
         "easting of x = y = 0 in the plane of outlines in metres; none: the middle of the outlines if their crs is a "
         "projection, otherwise 0"),
    REAL("ice.origin_north", ice.origin_north, LENGTH, "none", "[-1e8, 1e8]",
         "northing of x = y = 0 in the plane of outlines in metres, as ice.origin_east"),
    CHOICE("ice.nonconvex", ice.nonconvex, nonconvexes, "refuse",
           "outlines that deviate from convex by more than a thousandth of their extent: refused, replaced by their "
           "hull (the area grows), or split into convex parts that move as one floe"),

    CHOICE("body.shape", body.shape, bt_body_shapes, "disc", "waterline of the towed body; none: no body"),
    BASIN("body.length", body.length, LENGTH, "2 m", "(0, 1e5]", "as in 80 m, or set body.shape: none",
          "length of a named shape along its own x, assumed"),
    REAL("body.width", body.width, LENGTH, "= body.length", "(0, 1e5]", "width of a named shape"),
    {.name = "body.vertices",
     .type = BT_KEY_POINTS,
     .unit = BT_UNIT_LENGTH,
     .preset = "none",
     .range = "[-1e5, 1e5]",
     AT(body.vertices),
     .offset_count = offsetof(bt_case, body.n_vertices),
     .doc =
         "corners of shape polygon, convex and anticlockwise: [[x, y], ...]; moved so that the centroid is the origin"},
    REAL("body.x", body.x, LENGTH,
         "= domain.x0 + 2 body.length (basin; for a polygon, its extent along x), 0 (geographic)",
         ANYWHERE, "centroid at time zero"),
    REAL("body.y", body.y, LENGTH, "0 m", ANYWHERE, "centroid at time zero"),
    REAL("body.yaw", body.yaw, ANGLE, "0 deg", "[-360, 360]",
         "angle of the body's own x from the x axis towards y at time zero"),
    REAL("body.vx", body.vx, SPEED, "none", ANY_SPEED,
         "velocity at time zero, in every tow mode except speed; none: 0, or free drift in mode none without body.vy "
         "(ice.start)"),
    REAL("body.vy", body.vy, SPEED, "none", ANY_SPEED,
         "velocity at time zero, in every tow mode except speed; none: as body.vx"),
    REAL("body.yaw_rate", body.yaw_rate, TURN, "0 deg/s", "[-360, 360]",
         "rate of turn at time zero, in every tow mode except speed"),
    BASIN("body.draft", body.draft, LENGTH, "0.5 m", "(0, 1000]", "as in 60 m, or set body.shape: none",
          "depth below the waterline, assumed"),
    REAL("body.sail", body.sail, LENGTH, "= draft x (water.density / body.density - 1), at least 0", "[0, 1000]",
         "height above the waterline"),
    REAL("body.density", body.density, DENSITY, "900 kg/m3", "[1, 2e4]",
         "density of the body, for its mass when none is given [Hunke & Comeau 2011]"),
    REAL("body.mass", body.mass, MASS, "0 kg", "[0, 1e13]",
         "mass without added mass; 0 = density x waterline area x (draft + sail)"),
    REAL("body.added_mass", body.added_mass, RATIO, "0.5", "[0, 10]", "added mass / mass [Hunke & Comeau 2011]"),
    REAL("body.added_inertia", body.added_inertia, RATIO, "0.5", "[0, 10]",
         "added moment of inertia / its own, assumed equal to the added mass"),
    REAL("body.friction", body.friction, RATIO, "= ice.friction", "[0, 10]", "Coulomb coefficient ice on body"),
    REAL("body.restitution", body.restitution, RATIO, "= ice.restitution", "[0, 1]", "restitution ice on body"),
    REAL("body.drag.water_form", body.drag.water_form, RATIO, "0.85", "[0, 100]",
         "form drag over the draft [Hunke & Comeau 2011]"),
    REAL("body.drag.water_skin", body.drag.water_skin, RATIO, "5e-4", "[0, 10]",
         "skin drag of water under the body [Hunke & Comeau 2011]"),
    REAL("body.drag.air_form", body.drag.air_form, RATIO, "0.4", "[0, 100]",
         "form drag over the sail [Hunke & Comeau 2011]"),
    REAL("body.drag.air_skin", body.drag.air_skin, RATIO, "2.5e-4", "[0, 10]",
         "skin drag of air over the body [Hunke & Comeau 2011]"),
    REAL("body.drag.tangential", body.drag.tangential, RATIO, "0", "[0, 1]",
         "share of the flow along a side that counts in the moment of form drag: 0 = pressure, along the normal "
         "[cross-flow principle: Faltinsen 1990]; 1 = along the local flow, which damps turning two to four times as "
         "much. The force on a body that does not turn is the same"),

    CHOICE("tow.mode", tow.mode, tow_modes, "speed",
           "none: free drift; speed: the body's velocity is prescribed; line: the towing end of a line follows a "
           "prescribed path; thrust: a vessel pulls the line with its own thrust"),
    BASIN("tow.speed", tow.speed, SPEED, "0.13 m/s", "[0, 50]", "as in 0.5 m/s, or set tow.mode: none",
          "speed of the body (mode speed), of the towing end (mode line), or of the vessel if it can keep it (mode "
          "thrust) [Yulmetov & Løset 2017]; with a programme, its largest speed"),
    REAL("tow.direction", tow.direction, ANGLE, "0 deg", "[-360, 360]",
         "heading of the tow at the start, from the x axis towards y; with way-points, the direction from the body to "
         "the first"),
    REAL("tow.ramp", tow.ramp, TIME,
         "= the longer of 2 periods of the body on its line and the time to tow it by its own size at "
         "tow.speed", "[0, 1e7]",
         "time over which the speed rises linearly from 0, assumed; with a programme, the time at which it reaches its "
         "largest speed"),
    {.name = "tow.programme",
     .type = BT_KEY_POINTS,
     .unit = BT_UNIT_SPEED,
     .preset = "none",
     .range = "[0, 50]",
     AT(tow.programme),
     .unit_first = BT_UNIT_TIME,
     .range_first = "[0, 1e9]",
     .offset_count = offsetof(bt_case, tow.n_programme),
     .least = 1,
     .most = BT_MAX_POINTS,
     .doc = "speed over time, [[time, speed], ...], in place of speed and ramp: linear between the points, constant "
            "outside them"},
    {.name = "tow.waypoints",
     .type = BT_KEY_POINTS,
     .unit = BT_UNIT_LENGTH,
     .preset = "none",
     .range = ANYWHERE,
     AT(tow.waypoints),
     .offset_count = offsetof(bt_case, tow.n_waypoints),
     .least = 1,
     .most = BT_MAX_POINTS,
     .doc = "[[x, y], ...] on the path of the towing end (mode speed: of the body, which keeps its yaw) from its "
            "start; after the last point it continues straight ahead"},
    REAL("tow.turn_radius", tow.turn_radius, LENGTH, "0 m", "[0, 1e6]",
         "radius of the corners at way-points, 0 = sharp"),
    BASIN("tow.line_length", tow.line_length, LENGTH, "5 m", "[0, 1e5]", "as in 300 m",
          "length of the unstretched line, modes line and thrust, assumed"),
    BASIN("tow.line_stiffness", tow.line_stiffness, FORCE, "= 10 kN; for a named line, its own", "[0, 1e12]",
          "as in 100 MN, or name the line (tow.line.type, tow.line.diameter)",
          "EA: tension per unit of relative stretch, assumed unless the line is named"),
    REAL("tow.line_damping", tow.line_damping, DAMPING,
         "= 100 N s/m (basin), 0.03 of the critical damping of the body on its line (geographic)", "[0, 1e12]",
         "tension per stretching speed, assumed"),
    REAL("tow.hull_x", tow.hull_x, LENGTH,
         "= foremost point of the waterline; with two branches, the outermost on the +y side of the tow", "[-1e5, 1e5]",
         "where the line is fastened, from the centroid along the body's own x"),
    REAL("tow.hull_y", tow.hull_y, LENGTH, "= as hull_x", "[-1e5, 1e5]",
         "where the line is fastened, from the centroid along the body's own y"),
    CHOICE("tow.line.type", tow.line.type, rope_types, "numbers",
           "numbers: EA is tow.line_stiffness; a named line takes EA and breaking load from its diameter (unless "
           "given): steel-wire 6x19 and 8-strand polypropylene [Orcina, OrcaFlex manual], dyneema [MoorPy, NREL]. The "
           "wires and HMPE lines of bergtow.towing are other products"),
    REAL("tow.line.diameter", tow.line.diameter, LENGTH, "0 m", "[0, 1]", "diameter of a named line"),
    INT("tow.line.branches", tow.line.branches, "1", "[1, 2]",
        "lines from hull to towing end: one, or two as a bridle"),
    REAL("tow.line.breaking_load", tow.line.breaking_load, FORCE, "= 0 N; for a named line, its own when new",
         "[0, 1e12]", "mean tension over a step above which the branch breaks for good; 0 = never"),
    REAL("tow.line.weight", tow.line.weight, LINE_LOAD, "0 N/m", "[0, 1e5]",
         "weight in water of each branch of the line: it sags as an elastic catenary and starts with a pull of twice "
         "its weight, assumed; 0 = straight, without sag"),
    REAL("tow.branch2.hull_x", tow.branch2.hull_x, LENGTH,
         "= outermost point of the waterline on the -y side of the tow", "[-1e5, 1e5]",
         "where the second branch is fastened, along the body's own x"),
    REAL("tow.branch2.hull_y", tow.branch2.hull_y, LENGTH, "= as hull_x", "[-1e5, 1e5]",
         "where the second branch is fastened, along the body's own y"),
    REAL("tow.branch2.length", tow.branch2.length, LENGTH, "= tow.line_length", "(0, 1e5]",
         "length of the second branch, unstretched"),
    REAL("tow.branch2.stiffness", tow.branch2.stiffness, FORCE, "= tow.line_stiffness", "(0, 1e12]",
         "EA of the second branch"),
    REAL("tow.branch2.damping", tow.branch2.damping, DAMPING, "= tow.line_damping", "[0, 1e12]",
         "tension per stretching speed of the second branch"),
    REAL("tow.branch2.breaking_load", tow.branch2.breaking_load, FORCE, "= tow.line.breaking_load", "[0, 1e12]",
         "breaking load of the second branch, 0 = never"),
    REAL("tow.vessel.mass", tow.vessel.mass, MASS, "0 kg", "[0, 1e12]",
         "mass of the vessel without added mass, needed by mode thrust; the vessel touches no ice, assumed"),
    REAL("tow.vessel.added_mass", tow.vessel.added_mass, RATIO, "0.05", "[0, 10]",
         "added mass / mass of the vessel, assumed"),
    REAL("tow.vessel.bollard_pull", tow.vessel.bollard_pull, FORCE, "0 N", "[0, 1e9]",
         "thrust at rest at full power, needed by mode thrust"),
    REAL("tow.vessel.free_speed", tow.vessel.free_speed, SPEED, "0 m/s", "[0, 50]",
         "free-running speed at full power, needed by mode thrust; the net pull is bollard_pull x (1 - (speed / "
         "free_speed)^2), assumed"),
    REAL("tow.vessel.free_resistance", tow.vessel.free_resistance, FORCE, "= 0.4 tow.vessel.bollard_pull", "[0, 1e9]",
         "resistance of the vessel at its free-running speed, quadratic below it, assumed"),
    REAL("tow.vessel.lateral_drag", tow.vessel.lateral_drag, RATIO, "20", "[0, 1000]",
         "drag of the vessel across its course / along it at the same speed, assumed"),
    REAL("tow.vessel.lookahead", tow.vessel.lookahead, LENGTH, "= tow.line_length", "(0, 1e6]",
         "distance along its path to the point that the vessel steers for, assumed [line-of-sight guidance: Fossen "
         "2011]"),

    CHOICE("lead.mode", lead.mode, lead_modes, "none",
           "ice ahead of the body along its planned path at time zero; none: as it is; channel: floes that reach into "
           "it are removed; managed: these floes are cut into pieces"),
    REAL("lead.width", lead.width, LENGTH, "= width of the body across the tow", "[0, 1e5]", "width of the lead"),
    REAL("lead.length", lead.length, LENGTH,
         "= length of the tow + body.length (for a polygon, its extent along the tow)", "[0, 1e7]",
         "length of the lead from the body's place at time zero"),
    REAL("lead.floe_size", lead.floe_size, LENGTH, "0 m", "[0, 1e5]",
         "equivalent diameter of the largest piece, needed by mode managed"),

    REAL("water.density", water.density, DENSITY, "1027 kg/m3", "[500, 2000]",
         "density of the water [Hunke & Comeau 2011]"),
    REAL("water.current_x", water.current_x, SPEED, "0 m/s", ANY_SPEED, "current along x"),
    REAL("water.current_y", water.current_y, SPEED, "0 m/s", ANY_SPEED, "current along y"),
    REAL("water.tide.major", water.tide.major, SPEED, "0 m/s", "[0, 100]",
         "tidal ellipse, added to the current: largest speed"),
    REAL("water.tide.minor", water.tide.minor, SPEED, "0 m/s", ANY_SPEED,
         "tidal ellipse: speed across the major axis a quarter period later, positive when the current turns from x "
         "towards y"),
    REAL("water.tide.inclination", water.tide.inclination, ANGLE, "0 deg", "[-360, 360]",
         "tidal ellipse: angle of the major axis from the x axis towards y"),
    REAL("water.tide.period", water.tide.period, TIME, "44714.164 s", "(0, 1e9]",
         "tidal ellipse: period; the default is that of the constituent M2, 28.9841042 deg an hour"),
    REAL("water.tide.phase", water.tide.phase, ANGLE, "0 deg", "[-360, 360]",
         "tidal ellipse: lag; the current is largest along the major axis at phase / 360 deg x period"),
    PATH("water.current_table", water.current_table,
         "CSV file with the header t,u,v: current along x and y over time, linear between rows, in place of the keys "
         "above; relative to the folder of the case file"),
    REAL("water.latitude", water.latitude, ANGLE, "0 deg", "[-90, 90]",
         "latitude of the Coriolis force, 0 = no Coriolis force"),
    CHOICE("water.tilt", water.tilt, tilts, "none",
           "tilt of the sea surface: none; given by its slope; in geostrophic balance with the present current; or "
           "dynamic: it also accelerates the water as the current changes"),
    REAL("water.slope_x", water.slope_x, RATIO, "0", "[-0.1, 0.1]", "rise of the sea surface along x, for tilt slope"),
    REAL("water.slope_y", water.slope_y, RATIO, "0", "[-0.1, 0.1]", "rise of the sea surface along y, for tilt slope"),

    REAL("air.density", air.density, DENSITY, "1.29 kg/m3", "[0, 10]", "density of the air [Hunke & Comeau 2011]"),
    REAL("air.wind_x", air.wind_x, SPEED, "0 m/s", ANY_SPEED, "wind along x"),
    REAL("air.wind_y", air.wind_y, SPEED, "0 m/s", ANY_SPEED, "wind along y"),
    PATH("air.wind_table", air.wind_table,
         "CSV file with the header t,u,v: wind along x and y over time, linear between rows, in place of the keys "
         "above; relative to the folder of the case file"),

    REAL("solver.tolerance", solver.tolerance, RATIO, "1e-3", "(0, 1]",
         "residual of the contact law / reference speed at which a step has converged, assumed"),
    REAL("solver.reference_speed", solver.reference_speed, SPEED, "0 m/s", "[0, 100]",
         "speed the tolerance refers to; 0 = tow speed, or the largest speed prescribed"),
    INT("solver.max_sweeps", solver.max_sweeps, "500", "[1, 1e6]",
        "work limit of a step, at which it ends and counts as not converged: six updates of every contact for each of "
        "these sweeps, residual passes counted as updates; up to three times that if the residual is still large; "
        "assumed"),
    INT("solver.inner_sweeps", solver.inner_sweeps, "2", "[1, 100]",
        "number of sweeps over a cell that still changes before the next cell's turn"),
    REAL("solver.cell_size", solver.cell_size, RATIO, "5", "[2, 100]",
         "least side of the cells / mean floe size; cells set the order of the contacts and divide the work among "
         "ranks and threads"),
    BOOL("solver.plain", solver.plain, "false",
         "sweeps over all contacts without momentum, as a reference; max_sweeps and position_sweeps then count sweeps"),
    BOOL("solver.plain_schedule", solver.plain_schedule, "false",
         "as a reference, one thread of each rank solves the cells one after the other, colour by colour; the result "
         "is the same to the last bit"),
    BOOL("solver.warm_start", solver.warm_start, "true", "start from the impulses of the previous step"),
    REAL("solver.slop", solver.slop, RATIO, "1e-3", "[0, 0.1]",
         "overlap that the position projection tolerates / mean floe size, assumed [Metrikin 2014 for the projection]; "
         "values below 1e-6 count as that"),
    INT("solver.position_sweeps", solver.position_sweeps, "300", "[0, 1e5]",
        "work limit of the position projection, in updates of every contact, residual passes included; assumed"),
    REAL("solver.rest_speed", solver.rest_speed, SPEED, "= 1e-3 m/s (basin), 0.01 x reference speed (geographic)",
         "[0, 10]",
         "approaches below this speed have no restitution, assumed"),

    REAL("guard.overlap", guard.overlap, RATIO, "1", "[0, 100]",
         "overlap of two bodies / mean floe size that ends the run with exit code 5, 0 = no limit; assumed"),
    REAL("guard.energy", guard.energy, NONE, "1e4", "[0, 1e12]",
         "ratio that ends the run: kinetic energy of all bodies / that at the start and at the speeds to which tow, "
         "walls, current, wind and slope can drive them; 0 = no limit; assumed"),
    INT("guard.unconverged", guard.unconverged, "10000", "[0, 1e9]",
        "steps in a row without convergence that end the run, 0 = no limit; assumed"),
    REAL("guard.no_solution", guard.no_solution, RATIO, "10 %", "[0, 1]",
         "largest share of the case's steps in which bodies cannot give way to any load; beyond it the run ends; 0 = "
         "no limit; assumed"),
    BOOL("guard.escape", guard.escape, "true", "a floe or the towed body beyond a wall of the domain ends the run"),

    CHOICE("impact.conversion", impact.conversion, conversions, "duration",
           "force of a collision with the body from its impulse: half-sine of a given duration, or crushing of a "
           "corner at a pressure; none: collisions are not identified"),
    REAL("impact.duration", impact.duration, TIME, "= run.dt", "(0, 1000]",
         "duration of a collision for conversion duration; assumed, as the time step is chosen about as long as a "
         "collision [Yulmetov & Løset 2017]"),
    REAL("impact.pressure", impact.pressure, PRESSURE, "1 MPa", "(0, 1e9]",
         "pressure of crushed ice for conversion crushing, assumed; at model scale divided by the length ratio"),
    CHOICE("impact.corner", impact.corner, corners, "given",
           "crushed corner for conversion crushing: the given angle, or the real one of the corner in contact"),
    REAL("impact.corner_angle", impact.corner_angle, ANGLE, "90 deg", "(0, 179]",
         "angle of the crushed corner, assumed"),
    REAL("impact.least_speed", impact.least_speed, SPEED, "= 0.05 x reference speed of the solver", "[0, 100]",
         "approach speed of a floe below which its contact with the body counts as quasi-static, assumed"),
    INT("impact.panels", impact.panels, "36", "[1, 1000]",
        "panels of equal length along the hull's perimeter, for loads; the first is centred on the body's own x axis"),

    INT("output.sample_every", output.sample_every, "1", "[1, 1e6]", "steps per entry of the series"),
    REAL("output.frame_interval", output.frame_interval, TIME, "0 s", "[-1, 1e9]",
         "time between frames; 0 = a 200th of the duration, negative = no frames; the members of a study write none "
         "unless the study sets this key"),
    REAL("output.window_start", output.window_start, TIME, "-1 s", "[-1, 1e9]",
         "start of the window of all means, peaks, collisions and panel loads; negative = found from the series"),
    REAL("output.progress", output.progress, TIME, "5 s", "[0.01, 1e6]", "wall time between lines of progress"),
    INT("output.checkpoint_steps", output.checkpoint_steps, "0", "[0, 1e12]",
        "steps between checkpoints, 0 = none by steps"),
    REAL("output.checkpoint_wall", output.checkpoint_wall, TIME, "600 s", "[0, 1e9]",
         "wall time between checkpoints, 0 = none by time; one is always written at the end and at a stop"),
    BOOL("output.panels", output.panels, "false",
         "series of the load on every panel of the hull (impact.panels), in addition to its mean and maximum"),

    REAL("estimate.p_star", estimate.p_star, PRESSURE, "20 kPa", "[0, 1e9]",
         "P* of the ice strength P = P* h exp(-20 (1 - A)), at full scale [Lichey & Hellmer 2001, after Hibler 1979]"),
    REAL("estimate.p_s", estimate.p_s, LINE_LOAD, "13 kN/m", "[0, 1e9]",
         "strength P at which dense ice captures a berg, at full scale [Lichey & Hellmer 2001; FESOM2 uses 10 kN/m]"),
    REAL("estimate.c_si", estimate.c_si, RATIO, "1", "[0, 100]",
         "drag coefficient of sea ice on the body's side [Lichey & Hellmer 2001]"),
    REAL("estimate.kappa", estimate.kappa, RATIO, "11", "[1, 100]",
         "as ice.rafting.kappa, twice the work of rafting / potential energy gained; assumed"),
    REAL("estimate.kappa_low", estimate.kappa_low, RATIO, "5", "[1, 100]",
         "low end of the range of estimate.kappa, assumed"),
    REAL("estimate.kappa_high", estimate.kappa_high, RATIO, "17", "[1, 100]",
         "high end of the range of estimate.kappa, assumed; pressure ridges have 34 [ratio 17, Flato & Hibler 1995]"),
    REAL("estimate.phi_j", estimate.phi_j, RATIO, "0.9", "(0, 1]",
         "concentration to which the body packs the ice ahead, in the momentum closure and towards a wall, assumed"),
    REAL("estimate.length_scale", estimate.length_scale, RATIO, "1", "(0, 1e4]",
         "full scale / this case: p_star is divided by it and p_s by its square, 1 at full scale [Froude]"),

    REAL("reference.mean_force", reference.mean_force, FORCE, "none", "(0, 1e12]",
         "measured mean ice resistance, shown beside the computed one"),
    TEXT("reference.source", reference.source, "none", "where the measured force was published"),

    TEXT("report.client", report.client, "none", "client of the report, for the title block"),
    TEXT("report.project", report.project, "none", "name or number of the project, for the title block"),
    TEXT("report.author", report.author, "none", "person responsible for the report, for the title block"),
    TEXT("report.document", report.document, "none", "number of the document, for the title block and every page"),
    TEXT("report.revision", report.revision, "none", "revision of the report, for the title block and every page"),
    TEXT("report.distribution", report.distribution, "none", "recipients of the report, for the title block"),

    EIGHT_SPARE,
    EIGHT_SPARE,
    EIGHT_SPARE,
    EIGHT_SPARE, // BT_EXTRA_KEYS rows for bt_schema_add
};
int bt_n_case_keys = sizeof bt_case_keys / sizeof *bt_case_keys - BT_EXTRA_KEYS;

#undef AT
#define AT(member) .offset = offsetof(bt_floe_def, member)

const bt_key bt_floe_keys[] = {
    CHOICE("shape", shape, floe_shapes, "disc", "outline of the floe"),
    REAL("length", length, LENGTH, "none", "(0, 1e5]",
         "length of a named shape along its own x, needed unless the shape is polygon"),
    REAL("width", width, LENGTH, "= length", "(0, 1e5]", "width of a named shape"),
    {.name = "vertices",
     .type = BT_KEY_POINTS,
     .unit = BT_UNIT_LENGTH,
     .preset = "none",
     .range = "[-1e5, 1e5]",
     AT(vertices),
     .offset_count = offsetof(bt_floe_def, n_vertices),
     .doc =
         "corners of shape polygon, convex or not, anticlockwise: [[x, y], ...]; moved so that the centroid is the "
         "origin"},
    REAL("x", x, LENGTH, NULL, ANYWHERE, "centroid at time zero"),
    REAL("y", y, LENGTH, NULL, ANYWHERE, "centroid at time zero"),
    REAL("yaw", yaw, ANGLE, "0 deg", "[-360, 360]", "angle of the floe's own x from the x axis towards y"),
    REAL("vx", vx, SPEED, "none", ANY_SPEED,
         "velocity at time zero; none: 0 if vy is given, otherwise as ice.start sets it"),
    REAL("vy", vy, SPEED, "none", ANY_SPEED, "velocity at time zero; none: as vx"),
    REAL("yaw_rate", yaw_rate, TURN, "0 deg/s", "[-360, 360]", "rate of turn at time zero"),
    REAL("thickness", thickness, LENGTH, "= ice.thickness", "(0, 100]", "thickness"),
    BOOL("fixed", fixed, "false",
         "always at rest, like a structure, a coast or grounded ice; floes do not raft on it (ice.rafting.kappa); "
         "fixed floes that lie flush, or overlap, act as one outline"),
};
const int bt_n_floe_keys = sizeof bt_floe_keys / sizeof *bt_floe_keys;

/// Is the section of this name in the table, but not at its end?
static bool section_is_closed(const char *name)
{
    const size_t n = strcspn(name, ".") + 1;
    const bool open = !strncmp(bt_case_keys[bt_n_case_keys - 1].name, name, n);
    char section[64] = {0};
    memcpy(section, name, bt_min(n - 1, sizeof section - 1));
    return !open && bt_schema_is_section(section);
}

int bt_schema_added(void) { return bt_n_case_keys - (int)(sizeof bt_case_keys / sizeof *bt_case_keys - BT_EXTRA_KEYS); }

void bt_schema_take_back(int added) { bt_n_case_keys -= bt_schema_added() - added; }

/// Is this one line of printable text? It becomes a comment behind the value.
static bool is_line(const char *text)
{
    for (const char *p = text; *p; p++)
        if ((unsigned char)*p < 0x20 || (unsigned char)*p == 0x7f) return false;
    return true;
}

/// Is this SECTION.NAME, with valid names, in a section that a case may have?
static bool is_key(const char *key)
{
    char section[64];
    const char *dot = strchr(key, '.');
    if (!dot || dot - key >= (ptrdiff_t)sizeof section) return false;
    snprintf(section, sizeof section, "%.*s", (int)(dot - key), key);
    return strcmp(section, "base") && strcmp(section, "floes") && bt_is_name(section, 60) && bt_is_name(dot + 1, 60);
}

int bt_schema_add(const bt_key *key, bt_errors *err)
{
    const int place = bt_schema_added();
    const size_t before = err->n, length = strlen(key->name);
    bt_key row = *key;
    bt_range range;
    char why[BT_WHY];
    row.type = BT_KEY_REAL;
    row.offset = offsetof(bt_case, extra) + (size_t)place * sizeof(double);
    if (place >= BT_EXTRA_KEYS)
        bt_errors_add(err, "%s: there is no room for more than %d added keys; raise BT_EXTRA_KEYS", key->name,
                      BT_EXTRA_KEYS);
    else if (length > 60 || !is_key(key->name))
        bt_errors_add(err,
                      "%s: a key is SECTION.NAME, of lower-case letters, digits and _, of at most 60 characters, and "
                      "no section is base or floes",
                      key->name);
    else if (bt_schema_find(bt_case_keys, bt_n_case_keys, key->name) >= 0)
        bt_errors_add(err, "%s: this key exists already; choose another name", key->name);
    else if (section_is_closed(key->name))
        bt_errors_add(err, "%s: its section has keys of the program; choose a section of its own", key->name);
    else if (!key->range || !bt_value_range(&row, &range))
        bt_errors_add(err, "%s: the range must be \"[least, most]\" or with ( and )", key->name);
    else if (!key->preset || key->preset[0] == '=' || !bt_value_read(&row, &(bt_case){0}, key->preset, true, why))
        bt_errors_add(err, "%s: the default must be a number within the range, or none", key->name);
    else if (!key->doc || strlen(key->doc) < 8 || !is_line(key->doc))
        bt_errors_add(err, "%s: describe it in one sentence, on one line", key->name);
    if (err->n > before) return -1;
    bt_case_keys[bt_n_case_keys++] = row;
    return place;
}

int bt_schema_find(const bt_key *keys, int n, const char *name)
{
    for (int i = 0; i < n; i++)
        if (!strcmp(keys[i].name, name)) return i;
    return -1;
}

bool bt_schema_is_section(const char *name)
{
    size_t n = strlen(name);
    for (int i = 0; i < bt_n_case_keys; i++)
        if (!strncmp(bt_case_keys[i].name, name, n) && bt_case_keys[i].name[n] == '.') return true;
    return false;
}

const char *bt_schema_suggest(const bt_key *keys, int n, const char *name, char buffer[64])
{
    int least = bt_suggest_limit(name) + 1;
    const char *best = NULL;
    // A known last part in the wrong section counts as one edit: run.seed is nearer to ice.seed than to anything else.
    for (int i = 0; i < n; i++) {
        int d = bt_suggest_distance(name, keys[i].name, least);
        if (d > 1 && !strcmp(bt_last_part(name), bt_last_part(keys[i].name))) d = 1;
        if (d < least) {
            least = d;
            best = keys[i].name;
        }
    }
    if (keys != bt_case_keys) return best;
    for (int i = 0; i < n; i++)
        for (const char *dot = strchr(keys[i].name, '.'); dot; dot = strchr(dot + 1, '.')) {
            char section[64] = {0};
            memcpy(section, keys[i].name, (size_t)(dot - keys[i].name));
            int d = bt_suggest_distance(name, section, least);
            if (d >= least) continue;
            least = d;
            memcpy(buffer, section, sizeof section);
            best = buffer;
        }
    if (bt_suggest_distance(name, "floes", least) < least) best = "floes";
    return best;
}

void bt_schema_preset(const bt_key *keys, int n, void *base)
{
    char why[BT_WHY];
    for (int i = 0; i < n; i++) {
        const bt_key *key = &keys[i];
        if (key->type == BT_KEY_POINTS) continue;
        char *member = (char *)base + key->offset;
        // tests/unit/test_case.c checks that every preset can be read. In a real, NaN stands for "not given".
        if (key->preset && key->preset[0] != '=') bt_value_read(key, base, key->preset, true, why);
        else if (key->type == BT_KEY_REAL) memcpy(member, &(double){NAN}, sizeof(double));
    }
}

void bt_schema_release(const bt_key *keys, int n, void *base)
{
    for (int i = 0; i < n; i++) {
        if (keys[i].type != BT_KEY_TEXT && keys[i].type != BT_KEY_POINTS) continue;
        void *p;
        memcpy(&p, (char *)base + keys[i].offset, sizeof p);
        free(p);
        memset((char *)base + keys[i].offset, 0, sizeof p);
    }
}
