// SPDX-License-Identifier: MIT
// The floes of a picture as pixels, by the area of each pixel that a floe covers; follows replay.js in one function.
//
// A canvas draws tens of thousands of outlines in seconds, and a graphics processor is not on every machine. What is
// asked for here is less than it does: convex or not, an outline is one closed polygon of one colour. Its edges add to
// `cover` what each takes from the pixels to its right, and sums along the rows are the area covered. `seen` adds up
// the areas of all floes in a pixel: what goes beyond the whole pixel is floes over each other.

const LEAST_OVER = 12;  // of 255 of a pixel: less is the rounding of two areas, and the slop of the solver

const paint = {
    canvas: document.createElement("canvas"), image: null, pixels: null, seen: null, over: 0,
    cover: new Float32Array(0), x: null, y: null,  // x, y: corners of a polygon, pixels
};

const rgba = (r, g, b) => 255 << 24 | b << 16 | g << 8 | r;  // as bytes lie in memory
const ofText = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));

function beginPaint(w, h) {
    if (!paint.image || paint.image.width !== w || paint.image.height !== h) {
        paint.canvas.width = w;
        paint.canvas.height = h;
        paint.image = new ImageData(w, h);
        paint.pixels = new Int32Array(paint.image.data.buffer);
        paint.seen = new Uint8Array(w * h);
    }
    paint.pixels.fill(0);
    paint.seen.fill(0);
    paint.over = 0;
}

// Adds to paint.cover, of h rows of `stride` numbers, what the edges of a polygon take from the pixels to their right,
// within the box of w by h pixels whose corner is (x0, y0). One loop, for a number that is handed to a function that is
// not inlined becomes an object.
function coverEdges(n, x0, y0, w, h, stride) {
    const cover = paint.cover, x = paint.x, y = paint.y;
    for (let c = 0, b = n - 1; c < n; b = c++) {
        const down = y[b] < y[c], from = down ? b : c, to = down ? c : b, top = y[from] - y0, bottom = y[to] - y0;
        if (bottom <= 0 || top >= h || top === bottom) continue;
        const slope = (x[to] - x[from]) / (bottom - top), end = bottom < h ? bottom : h;
        let at = top < 0 ? 0 : top, before = x[from] - x0 + slope * (at - top);
        for (let row = at | 0; at < end; row++) {
            const next = row + 1 < end ? row + 1 : end, after = before + slope * (next - at);
            const d = down ? next - at : at - next;
            let l = before < after ? before : after, r = before < after ? after : before;
            l = l < 0 ? 0 : l > w ? w : l;
            r = r < 0 ? 0 : r > w ? w : r;
            const first = l | 0, k = row * stride + first;
            if (r <= first + 1) {  // within one pixel
                const right = d * (0.5 * (l + r) - first);
                cover[k] += d - right;
                cover[k + 1] += right;
            } else {
                const last = Math.ceil(r), s = d / (r - l), tail = r - last + 1;
                let way = first + 1 - l, done = 0.5 * s * way * way;  // in x, and the area for it
                cover[k] += done;
                for (let column = first + 1; column < last; column++, way++) {
                    const all = column + 1 < last ? s * (way + 0.5) : d - 0.5 * s * tail * tail;
                    cover[k + column - first] += all - done;
                    done = all;
                }
                cover[k + last - first] += d - done;
            }
            before = after;
            at = next;
        }
    }
}

// The polygon of the first n corners of paint.x, paint.y, in [r, g, b] on `ground`, of rgba(). seam: 0 … 1, how much of
// the pixels at its edge is left to the ground, so that floes that touch are told apart. over: colour of floes over
// each other, or null.
function fillPolygon(n, colour, ground, seam, over) {
    const {x, y, pixels, seen, image} = paint;
    let x0 = Infinity, x1 = -Infinity, y0 = Infinity, y1 = -Infinity;
    for (let k = 0; k < n; k++) {
        if (x[k] < x0) x0 = x[k];
        if (x[k] > x1) x1 = x[k];
        if (y[k] < y0) y0 = y[k];
        if (y[k] > y1) y1 = y[k];
    }
    x0 = Math.max(0, Math.floor(x0));
    y0 = Math.max(0, Math.floor(y0));
    const w = Math.min(image.width, Math.ceil(x1)) - x0, h = Math.min(image.height, Math.ceil(y1)) - y0;
    if (!(w > 0 && h > 0)) return;
    const stride = w + 2;
    if (paint.cover.length < stride * h) paint.cover = new Float32Array(stride * h);
    coverEdges(n, x0, y0, w, h, stride);
    const cover = paint.cover;
    const cr = colour[0], cg = colour[1], cb = colour[2], solid = rgba(cr, cg, cb), wide = image.width;
    for (let row = 0; row < h; row++) {
        let sum = 0, p = (y0 + row) * wide + x0, k = row * stride;
        for (const end = k + w; k < end; k++, p++) {
            sum += cover[k];
            cover[k] = 0;
            let a = sum < 0 ? -sum : sum;
            if (a < 0.002) continue;
            if (a > 1) a = 1;
            const whole = seen[p] + (255 * a + 0.5 | 0), more = over ? whole - 255 : 0;
            seen[p] = whole < 255 ? whole : 255;
            if (more > LEAST_OVER) paint.over += more;
            if (a < 1 && (a -= seam * (1 - a)) <= 0 && more <= LEAST_OVER) continue;
            if (a === 1 && more <= LEAST_OVER) {
                pixels[p] = solid;
                continue;
            }
            const old = pixels[p] || ground;
            let r = old & 255, g = old >> 8 & 255, b = old >> 16 & 255;
            if (a > 0) {
                r += a * (cr - r);
                g += a * (cg - g);
                b += a * (cb - b);
            }
            if (more > LEAST_OVER) {
                const share = more / 255;
                r += share * (over[0] - r);
                g += share * (over[1] - g);
                b += share * (over[2] - b);
            }
            pixels[p] = rgba(r + 0.5 | 0, g + 0.5 | 0, b + 0.5 | 0);
        }
        cover[k] = cover[k + 1] = 0;
    }
}

// Put what has been painted on a canvas.
function endPaint(g) {
    paint.canvas.getContext("2d").putImageData(paint.image, 0, 0);
    g.drawImage(paint.canvas, 0, 0);
}
