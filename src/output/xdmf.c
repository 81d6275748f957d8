// SPDX-License-Identifier: MIT
// The frames for ParaView: an XML description of what is in result.h5.
//
// ParaView moves no cells by a pose, so result.h5 also holds the vertices of every frame in the world frame, in single
// precision; the polygons never change, and their connectivity is stored once:
//     /xdmf/floes, /xdmf/bodies                                  mixed topology
//     /xdmf/NNNNNN/{floe_points, floe_speed, floe_force, body_points, body_speed}     frame NNNNNN
// Floes and other bodies are two blocks, because only floes have a contact force. Each frame has datasets of its own:
// as hyperslabs of one large dataset ParaView 5.11's Xdmf3 reader does not read them, and its Xdmf2 reader, which keeps
// a geometry whose path it has seen, complains. result.h5 is named relative to frames.xdmf, so that the folder can be
// moved.
#include "output/xdmf.h"

#include <inttypes.h>
#include <stdio.h>

static void data_item(FILE *f, int64_t n, int width, const char *type, const char *dataset)
{
    fprintf(f,
            "<DataItem Dimensions=\"%" PRId64
            "%s\" NumberType=\"%s\" Precision=\"4\" Format=\"HDF\">result.h5:%s</DataItem>",
            n, width == 2 ? " 2" : "", type, dataset);
}

static void attribute(FILE *f, int64_t n, const char *name, int64_t frame, const char *kind, const char *quantity)
{
    char path[64];
    snprintf(path, sizeof path, "/xdmf/%06" PRId64 "/%s_%s", frame, kind, quantity);
    fprintf(f, "          <Attribute Name=\"%s\" AttributeType=\"Scalar\" Center=\"Cell\">\n            ", name);
    data_item(f, n, 1, "Float", path);
    fputs("\n          </Attribute>\n", f);
}

/// Floes or other bodies of one frame: kind "floe" or "body".
static void block(FILE *f, const char *name, const char *kind, int64_t cells, int64_t points, int64_t frame)
{
    if (cells == 0) return;
    char path[64];
    snprintf(path, sizeof path, "/xdmf/%s", name);
    fprintf(f,
            "        <Grid Name=\"%s\" GridType=\"Uniform\">\n"
            "          <Topology TopologyType=\"Mixed\" NumberOfElements=\"%" PRId64 "\">\n            ",
            name, cells);
    data_item(f, points + 2 * cells, 1, "Int", path);
    fputs("\n          </Topology>\n          <Geometry GeometryType=\"XY\">\n            ", f);
    snprintf(path, sizeof path, "/xdmf/%06" PRId64 "/%s_points", frame, kind);
    data_item(f, points, 2, "Float", path);
    fputs("\n          </Geometry>\n", f);
    attribute(f, cells, "speed", frame, kind, "speed");
    if (*kind == 'f') attribute(f, cells, "contact_force", frame, kind, "force");
    fputs("        </Grid>\n", f);
}

char *bt_xdmf_text(const bt_xdmf *x)
{
    bt_text text;
    bt_text_begin(&text);
    FILE *f = text.out;
    fputs(BT_XDMF_HEAD, f);
    for (int64_t i = 0; i < x->n_frames; i++) {
        fprintf(f, "      <Grid Name=\"frame %" PRId64 "\" GridType=\"Collection\" CollectionType=\"Spatial\">\n"
                   "        <Time Value=\"%.17g\"/>\n", i, x->time[i]);
        block(f, "floes", "floe", x->n_floes, x->floe_vertices, i);
        block(f, "bodies", "body", x->n_bodies, x->body_vertices, i);
        fputs("      </Grid>\n", f);
    }
    fputs("    </Grid>\n  </Domain>\n</Xdmf>\n", f);
    return bt_text_end(&text);
}
