// SPDX-License-Identifier: MIT
// The frames for ParaView: an XML description of the datasets in result.h5.
//
// ParaView cannot move cells by a pose, so result.h5 also holds the drawn vertices of every frame, in single precision
// (xdmf.h); the polygons never change, and their connectivity is stored once:
//     /xdmf/floes, /xdmf/bodies     mixed topology
//     /xdmf/floe_id                 ids: a filter of ParaView renumbers the cells that it keeps
//     /xdmf/NNNNNN/{floe,body}_{points,speed,velocity,net_force}, floe_force     frame NNNNNN
//     /xdmf/NNNNNN/pieces, piece_...                                             pieces of floes that have split
// A floe that has split shrinks to a point: its cell stays, as ids are indices in the list.
// Thickness and height are those of /floes and /bodies; data of a few bodies (ids, the towed one) and the ends of the
// tow line are in the XML itself. Vectors have a third component, 0, as ParaView's vectors have. Floes and other bodies
// are two blocks, because only floes have the largest force of a contact. Each frame has its own datasets: ParaView
// 5.11's Xdmf3 reader does not read hyperslabs of one large dataset, and its Xdmf2 reader, which caches a geometry by
// its path, complains. result.h5 is named relative to frames.xdmf, so that the folder can be moved.
#include "output/xdmf.h"

#include <inttypes.h>
#include <math.h>

#include "field/map_crs.h"

// --- axes ------------------------------------------------------------------------------------------------------------

// Drawing programs hold coordinates in single precision, 24 bits. At a northing of 8,676 km the resolution is then 1 m,
// and floes of 0.4 m have no area. So the origin is the middle of the domain, rounded towards 0 to the least power of
// ten that is no less than the domain: 0, 0 for most cases, and never farther from the ice than ten domains, where the
// resolution is below a millionth of the domain.

static double rounded(double middle, double extent)
{
    double unit = 1;
    if (!(extent > 0)) return 0;
    while (unit < extent) unit *= 10;
    while (unit >= 10 * extent) unit /= 10;
    return trunc(middle / unit) * unit;
}

bt_map_axes bt_map_axes_of(const bt_case *input, const bt_outline_counts *counts)
{
    const double extent = bt_max(input->domain.length, input->domain.width);
    bt_map_axes axes = {.swapped = input->domain.frame == BT_FRAME_GEOGRAPHIC,
                        .origin = {rounded(input->domain.x0 + input->domain.length / 2, extent),
                                   rounded(input->domain.y0 + input->domain.width / 2, extent)}};
    const bt_map_place place = bt_map_place_of(counts, input);
    const double degree = BT_PI / 180;
    if (place.kind == BT_MAP_DEGREES)
        snprintf(axes.crs, sizeof axes.crs, "+proj=aeqd +lat_0=%.12g +lon_0=%.12g +datum=WGS84 +units=m",
                 place.second / degree, place.first / degree);
    else if (place.kind == BT_MAP_PLANE) snprintf(axes.crs, sizeof axes.crs, "%s", place.crs);
    bt_map_axes_point(&(bt_map_axes){.swapped = axes.swapped}, axes.origin[0], axes.origin[1], axes.crs_place);
    if (place.kind == BT_MAP_PLANE) axes.crs_place[0] += place.first, axes.crs_place[1] += place.second;
    return axes;
}

// --- XDMF ------------------------------------------------------------------------------------------------------------

static void data_item(FILE *f, int64_t n, int width, const char *type, int bytes, const char *dataset)
{
    char columns[16] = "";
    if (width > 1) snprintf(columns, sizeof columns, " %d", width);
    fprintf(f,
            "<DataItem Dimensions=\"%" PRId64
            "%s\" NumberType=\"%s\" Precision=\"%d\" Format=\"HDF\">result.h5:%s</DataItem>",
            n, columns, type, bytes, dataset);
}

static void begin_attribute(FILE *f, const char *name, const char *type)
{
    fprintf(f, "          <Attribute Name=\"%s\" AttributeType=\"%s\" Center=\"Cell\">\n            ", name, type);
}

static void end_attribute(FILE *f) { fputs("\n          </Attribute>\n", f); }

/// Write an attribute of the cells, in a dataset of the file.
static void attribute(FILE *f, int64_t n, const char *name, const char *type, int bytes, const char *dataset)
{
    begin_attribute(f, name, "Scalar");
    data_item(f, n, 1, type, bytes, dataset);
    end_attribute(f);
}

/// The same in a dataset of the frame.
static void of_frame(FILE *f, int64_t n, const char *name, int width, int64_t frame, const char *kind,
                     const char *quantity)
{
    char path[64];
    snprintf(path, sizeof path, "/xdmf/%06" PRId64 "/%s_%s", frame, kind, quantity);
    begin_attribute(f, name, width > 1 ? "Vector" : "Scalar");
    data_item(f, n, width, "Float", 4, path);
    end_attribute(f);
}

static void begin_xml(FILE *f, int64_t n, int width, const char *type, int bytes)
{
    fprintf(f, "<DataItem Dimensions=\"%" PRId64, n);
    if (width > 1) fprintf(f, " %d", width);
    fprintf(f, "\" NumberType=\"%s\" Precision=\"%d\" Format=\"XML\">", type, bytes);
}

/// Write floes or other bodies of one frame: kind "floe" or "body". topology: the dataset.
static void begin_block(FILE *f, const char *name, const char *kind, const char *topology, int64_t cells,
                        int64_t points, int64_t frame)
{
    char path[64];
    fprintf(f,
            "        <Grid Name=\"%s\" GridType=\"Uniform\">\n"
            "          <Topology TopologyType=\"Mixed\" NumberOfElements=\"%" PRId64 "\">\n            ",
            name, cells);
    data_item(f, points + 2 * cells, 1, "Int", 4, topology);
    fputs("\n          </Topology>\n          <Geometry GeometryType=\"XY\">\n            ", f);
    snprintf(path, sizeof path, "/xdmf/%06" PRId64 "/%s_points", frame, kind);
    data_item(f, points, 2, "Float", 4, path);
    fputs("\n          </Geometry>\n", f);
    of_frame(f, cells, "speed", 1, frame, kind, "speed");
    of_frame(f, cells, "velocity", 3, frame, kind, "velocity");
    of_frame(f, cells, "net_force", 3, frame, kind, "net_force");
}

static void floes(FILE *f, const bt_xdmf *xdmf, int64_t frame)
{
    const int64_t n = xdmf->n_floes;
    if (n == 0) return;
    begin_block(f, "floes", "floe", "/xdmf/floes", n, xdmf->floe_vertices, frame);
    of_frame(f, n, "contact_force", 1, frame, "floe", "force");
    attribute(f, n, "thickness", "Float", 8, "/floes/thickness");
    attribute(f, n, "id", "Int", 4, "/xdmf/floe_id");
    fputs("        </Grid>\n", f);
}

/// Write the existing pieces of floes.
static void pieces(FILE *f, const bt_xdmf *xdmf, int64_t frame)
{
    if (!xdmf->pieces || xdmf->pieces[frame].cells == 0) return;
    const int64_t n = xdmf->pieces[frame].cells;
    char path[64];
#define OF_FRAME(name) (snprintf(path, sizeof path, "/xdmf/%06" PRId64 "/" name, frame), path)
    begin_block(f, "pieces", "piece", OF_FRAME("pieces"), n, xdmf->pieces[frame].points, frame);
    of_frame(f, n, "contact_force", 1, frame, "piece", "force");
    attribute(f, n, "thickness", "Float", 4, OF_FRAME("piece_thickness"));
    attribute(f, n, "id", "Int", 4, OF_FRAME("piece_id"));
#undef OF_FRAME
    fputs("        </Grid>\n", f);
}

/// Write a number for each of the other bodies: its id, or 1 for the towed body.
static void in_xml(FILE *f, const bt_xdmf *xdmf, const char *name, bool ids)
{
    begin_attribute(f, name, "Scalar");
    begin_xml(f, xdmf->n_bodies, 1, "Int", 4);
    for (int64_t i = 0; i < xdmf->n_bodies; i++)
        fprintf(f, "%s%" PRId64, i ? " " : "", ids ? xdmf->n_floes + i : i == xdmf->towed);
    fputs("</DataItem>", f);
    end_attribute(f);
}

static void bodies(FILE *f, const bt_xdmf *xdmf, int64_t frame)
{
    if (xdmf->n_bodies == 0) return;
    begin_block(f, "bodies", "body", "/xdmf/bodies", xdmf->n_bodies, xdmf->body_vertices, frame);
    attribute(f, xdmf->n_bodies, "height", "Float", 8, "/bodies/height");
    in_xml(f, xdmf, "id", true);
    in_xml(f, xdmf, "towed", false);
    fputs("        </Grid>\n", f);
}

/// Write the branches of the tow line, each of two points.
static void line(FILE *f, const bt_xdmf *xdmf, int64_t frame)
{
    const int k = xdmf->branches;
    if (k == 0) return;
    const bt_frame_line *line = &xdmf->line[frame];
    fprintf(f,
            "        <Grid Name=\"line\" GridType=\"Uniform\">\n"
            "          <Topology TopologyType=\"Polyline\" NodesPerElement=\"2\" NumberOfElements=\"%d\">\n"
            "            ",
            k);
    begin_xml(f, k, 2, "Int", 4);
    for (int i = 0; i < 2 * k; i++) fprintf(f, "%s%d", i ? " " : "", i);
    fputs("</DataItem>\n          </Topology>\n          <Geometry GeometryType=\"XY\">\n            ", f);
    begin_xml(f, 2 * (int64_t)k, 2, "Float", 8);
    for (int i = 0; i < 2 * k; i++) {
        double drawn[2];
        bt_map_axes_point(&xdmf->axes, line->point[i / 2][i % 2][0], line->point[i / 2][i % 2][1], drawn);
        fprintf(f, "%s%.9g %.9g", i ? " " : "", drawn[0], drawn[1]);
    }
    fputs("</DataItem>\n          </Geometry>\n", f);
    begin_attribute(f, "tension", "Scalar");
    begin_xml(f, k, 1, "Float", 8);
    for (int i = 0; i < k; i++) fprintf(f, "%s%.9g", i ? " " : "", line->tension[i]);
    fputs("</DataItem>", f);
    end_attribute(f);
    fputs("        </Grid>\n", f);
}

/// Describe the coordinates for a reader of the file; ParaView ignores this.
static void information(FILE *f, const bt_map_axes *axes)
{
    fprintf(f,
            "      <Information Name=\"axes\" Value=\"%s\"/>\n"
            "      <Information Name=\"origin\" Value=\"x = %.17g m, y = %.17g m\"/>\n",
            bt_map_axes_names(axes), axes->origin[0], axes->origin[1]);
    if (*axes->crs)
        fprintf(f,
                "      <Information Name=\"crs\" Value=\"%s\"/>\n"
                "      <Information Name=\"origin in crs\" Value=\"%.17g m, %.17g m\"/>\n",
                axes->crs, axes->crs_place[0], axes->crs_place[1]);
}

char *bt_xdmf_text(const bt_xdmf *xdmf)
{
    bt_text text;
    bt_text_begin(&text);
    FILE *f = text.out;
    fputs(BT_XDMF_HEAD, f);
    information(f, &xdmf->axes);
    for (int64_t i = 0; i < xdmf->n_frames; i++) {
        fprintf(f, "      <Grid Name=\"frame %" PRId64 "\" GridType=\"Collection\" CollectionType=\"Spatial\">\n"
                   "        <Time Value=\"%.17g\"/>\n", i, xdmf->time[i]);
        floes(f, xdmf, i);
        pieces(f, xdmf, i);
        bodies(f, xdmf, i);
        line(f, xdmf, i);
        fputs("      </Grid>\n", f);
    }
    fputs("    </Grid>\n  </Domain>\n</Xdmf>\n", f);
    return bt_text_end(&text);
}
