// SPDX-License-Identifier: MIT
// The frames for ParaView: an XML description of what is in result.h5.
//
// ParaView moves no cells by a pose, so result.h5 also holds the vertices of every frame in the world frame, in single
// precision (/frames/points). The polygons never change: their connectivity is stored once (/xdmf/floes,
// /xdmf/bodies) and each frame is a hyperslab of the points. Floes and other bodies are two blocks, because only
// floes have a contact force; the speed is one dataset of which each block takes its part. References to
// result.h5 are absolute: ParaView's Xdmf3 reader does not resolve relative ones.
#include "xdmf.h"

#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>

#define XDMF_POLYGON 3

int64_t bt_xdmf_topology(int64_t n, const int64_t *offsets, int32_t *out)
{
    int64_t k = 0;
    for (int64_t i = 0; i < n; i++) {
        const int64_t first = offsets[i] - offsets[0], count = offsets[i + 1] - offsets[i];
        if (out) {
            out[k] = XDMF_POLYGON;
            out[k + 1] = (int32_t)count;
            for (int64_t v = 0; v < count; v++) out[k + 2 + v] = (int32_t)(first + v);
        }
        k += 2 + count;
    }
    return k;
}

static void escape(FILE *f, const char *s)
{
    for (; *s; s++) {
        switch (*s) {
        case '&': fputs("&amp;", f); break;
        case '<': fputs("&lt;", f); break;
        case '>': fputs("&gt;", f); break;
        default: fputc(*s, f);
        }
    }
}

/// One block of one frame: cells [cell0, cell0 + cells) with points [point0, point0 + points).
typedef struct block {
    const char *name, *topology;
    int64_t cell0, cells, point0, points;
    bool forced; ///< has a contact force
} block;

static void attribute(FILE *f, const char *h5, const char *name, const char *dataset, int64_t frame, int64_t n_frames,
                      int64_t first, int64_t count, int64_t width)
{
    fprintf(f,
            "          <Attribute Name=\"%s\" AttributeType=\"Scalar\" Center=\"Cell\">\n"
            "            <DataItem ItemType=\"HyperSlab\" Dimensions=\"1 %" PRId64 "\">\n"
            "              <DataItem Dimensions=\"3 2\" Format=\"XML\">%" PRId64 " %" PRId64 " 1 1 1 %" PRId64 "</DataItem>\n"
            "              <DataItem Dimensions=\"%" PRId64 " %" PRId64 "\" NumberType=\"Float\" Precision=\"8\" Format=\"HDF\">",
            name, count, frame, first, count, n_frames, width);
    escape(f, h5);
    fprintf(f, ":%s</DataItem>\n            </DataItem>\n          </Attribute>\n", dataset);
}

static void write_block(FILE *f, const bt_xdmf *x, const char *h5, const block *b, int64_t frame)
{
    const int64_t all_points = x->floe_vertices + x->other_vertices;
    fprintf(f,
            "        <Grid Name=\"%s\" GridType=\"Uniform\">\n"
            "          <Topology TopologyType=\"Mixed\" NumberOfElements=\"%" PRId64 "\">\n"
            "            <DataItem Dimensions=\"%" PRId64 "\" NumberType=\"Int\" Precision=\"4\" Format=\"HDF\">",
            b->name, b->cells, b->points + 2 * b->cells);
    escape(f, h5);
    fprintf(f,
            ":%s</DataItem>\n          </Topology>\n"
            "          <Geometry GeometryType=\"XY\">\n"
            "            <DataItem ItemType=\"HyperSlab\" Dimensions=\"1 %" PRId64 " 2\">\n"
            "              <DataItem Dimensions=\"3 3\" Format=\"XML\">%" PRId64 " %" PRId64 " 0 1 1 1 1 %" PRId64
            " 2</DataItem>\n"
            "              <DataItem Dimensions=\"%" PRId64 " %" PRId64
            " 2\" NumberType=\"Float\" Precision=\"4\" Format=\"HDF\">",
            b->topology, b->points, frame, b->point0, b->points, x->n_frames, all_points);
    escape(f, h5);
    fputs(":/frames/points</DataItem>\n            </DataItem>\n          </Geometry>\n", f);
    attribute(f, h5, "speed", "/frames/speed", frame, x->n_frames, b->cell0, b->cells, x->n_floes + x->n_others);
    if (b->forced) attribute(f, h5, "contact_force", "/frames/contact_force", frame, x->n_frames, 0, b->cells, x->n_floes);
    fputs("        </Grid>\n", f);
}

char *bt_xdmf_text(const bt_xdmf *x)
{
    char absolute[PATH_MAX];
    const char *h5 = realpath(x->h5, absolute) ? absolute : x->h5;
    const block blocks[] = {
        {"floes", "/xdmf/floes", 0, x->n_floes, 0, x->floe_vertices, true},
        {"bodies", "/xdmf/bodies", x->n_floes, x->n_others, x->floe_vertices, x->other_vertices, false},
    };
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);
    fputs("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<Xdmf Version=\"2.0\">\n  <Domain>\n"
          "    <Grid Name=\"frames\" GridType=\"Collection\" CollectionType=\"Temporal\">\n", f);
    for (int64_t i = 0; i < x->n_frames; i++) {
        fprintf(f, "      <Grid Name=\"frame %" PRId64 "\" GridType=\"Collection\" CollectionType=\"Spatial\">\n"
                   "        <Time Value=\"%.17g\"/>\n", i, x->time[i]);
        for (size_t k = 0; k < sizeof blocks / sizeof *blocks; k++)
            if (blocks[k].cells > 0) write_block(f, x, h5, &blocks[k], i);
        fputs("      </Grid>\n", f);
    }
    fputs("    </Grid>\n  </Domain>\n</Xdmf>\n", f);
    fclose(f);
    return text;
}
