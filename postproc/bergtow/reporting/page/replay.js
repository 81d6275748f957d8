// SPDX-License-Identifier: MIT
// The replay of a run within its report: ice field and force curve, from the data that postproc/replay.py embedded.
//
// Coordinates. Positions are in metres of the case's frame. On the screen the basin frame has x to the right and y
// upwards; the geographic frame is a map, y (east) to the right and x (north) upwards. In a periodic domain a floe is
// drawn at the image nearest to a centre C: the middle of the domain, the towed body when the view follows it, or the
// middle of the moving window.
//
// Time. The playhead p is a frame number with a fraction. Between two frames positions are interpolated (if asked for);
// the values shown, speed and force, are those of the nearest frame. A floe that goes farther between two frames than
// its speed allows was put elsewhere by a moving window: it is not interpolated.
//
// The page puts this file and replay_controls.js into one function, in this order.
const $ = (id) => document.getElementById(id);
const root = $("replay");
const head = JSON.parse($("replay-head").textContent);
const T = head.times.length, N = head.n;
const canvas = $("replay-field"), chart = $("replay-curve"), slider = $("replay-time"), tip = $("replay-tip");
const LEVELS = head.colouring[0].table.length;
const state = {
    p: 0, playing: false, rate: 1, last: 0, smooth: true, colour: 0, hover: null,
    follow: head.follow, cx: 0, cy: 0, scale: 1,
};
let data = null;      // decoded arrays
let scheduled = false;

// ---- data

function bytes(id) {
    const text = atob($("replay-" + id).textContent.trim()), out = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
    return out;
}

async function blob(id) {
    const raw = bytes(id);
    if (!head.deflate) return raw.buffer;
    const stream = new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
}

async function frames(id) {
    const b = new Uint8Array(await blob(id)), n = T * N, q = new Uint16Array(n);
    for (let i = 0; i < n; i++) {
        const change = b[i] | (b[n + i] << 8);
        q[i] = i < N ? change : q[i - N] + change;  // modulo 65536
    }
    return q;
}

async function load() {
    if (head.deflate && typeof DecompressionStream === "undefined")
        throw new Error("this browser cannot unpack the replay (it needs Chromium 80, Firefox 113, Safari 16.4 or " +
                        "later); make the page again with postproc/report.py RUN --no-compression, which any browser " +
                        "shows");
    const [x, y, yaw, speed, force] = await Promise.all(["x", "y", "yaw", "speed", "force"].map(frames));
    const [vertices, counts, thickness, area, lives, body] =
        await Promise.all(["vertices", "counts", "thickness", "area", "lives", "body_pose"].map(blob));
    data = {
        x, y, yaw, speed, force,
        vertices: new Float32Array(vertices), counts: new Uint16Array(counts), thickness: new Float32Array(thickness),
        area: new Float32Array(area), lives: new Uint32Array(lives), body: new Float64Array(body),
        offset: new Uint32Array(N + 1), radius: new Float32Array(N),
    };
    for (let i = 0; i < N; i++) {
        data.offset[i + 1] = data.offset[i] + data.counts[i];
        for (let v = data.offset[i]; v < data.offset[i + 1]; v++)
            data.radius[i] = Math.max(data.radius[i], Math.hypot(data.vertices[2 * v], data.vertices[2 * v + 1]));
    }
}

const clampFrame = (k) => Math.max(0, Math.min(T - 1, k));
const nearest = () => clampFrame(Math.round(state.p));

function timeAt(p) {
    const k = Math.min(Math.floor(p), T - 1), w = p - k;
    return k + 1 < T ? head.times[k] * (1 - w) + head.times[k + 1] * w : head.times[T - 1];
}

function frameAt(time) {  // playhead of a time
    let low = 0, high = T - 1;
    if (time <= head.times[0]) return 0;
    if (time >= head.times[high]) return high;
    while (high - low > 1) { const m = (low + high) >> 1; if (head.times[m] <= time) low = m; else high = m; }
    return low + (time - head.times[low]) / (head.times[high] - head.times[low]);
}

// Value of a floe in a frame, SI.
function value(kind, frame, i) {
    if (kind === "thickness") return data.thickness[i];
    const q = data[kind][frame * N + i] / 65535;
    return head.quanta[kind] * q * q;
}

// Floes that split, and their pieces, are there in some frames only.
const there = (i, frame) => frame >= data.lives[2 * i] && frame < data.lives[2 * i + 1];
const image = (d, period) => period > 0 ? d - period * Math.round(d / period) : d;

// Pose of floe i at the playhead, as stored (wrapped into the domain), between frames if smooth.
function floePose(i, p) {
    const [x0, dx] = head.quanta.x, [y0, dy] = head.quanta.y, dyaw = head.quanta.yaw[1];
    const k = Math.min(Math.floor(p), T - 1), a = k * N + i, w = p - k;
    const pose = [x0 + dx * data.x[a], y0 + dy * data.y[a], dyaw * data.yaw[a]];
    if (!w || k + 1 >= T) return pose;
    const b = a + N, x = x0 + dx * data.x[b], y = y0 + dy * data.y[b];
    const ux = image(x - pose[0], head.period[0]), uy = image(y - pose[1], head.period[1]);
    const between = head.times[k + 1] - head.times[k];
    const reach = 2 * (value("speed", k, i) + value("speed", k + 1, i)) * between + 2 * data.radius[i];
    if (Math.hypot(ux, uy) > reach) return w < 0.5 ? pose : [x, y, dyaw * data.yaw[b]];
    let turn = (data.yaw[b] - data.yaw[a]) & 65535;
    if (turn > 32767) turn -= 65536;
    return [pose[0] + w * ux, pose[1] + w * uy, pose[2] + w * dyaw * turn];
}

function bodyPose(b, p) {
    const k = Math.min(Math.floor(p), T - 1), w = p - k, B = head.bodies.length;
    const a = 3 * (k * B + b), c = k + 1 < T ? a + 3 * B : a;
    return [0, 1, 2].map((j) => data.body[a + j] * (1 - w) + data.body[c + j] * w);
}

const playhead = () => state.smooth ? state.p : nearest();

// ---- view

const moving = head.window_low !== null;

// Centre of the images that are drawn, and of the view.
function centre(p) {
    const [x0, x1, y0, y1] = head.box, C = [(x0 + x1) / 2, (y0 + y1) / 2];
    if (moving) {
        const k = Math.min(Math.floor(p), T - 1), w = p - k, low = head.window_low;
        C[0] = (k + 1 < T ? low[k] * (1 - w) + low[k + 1] * w : low[k]) + (x1 - x0) / 2;
    }
    if (!state.follow || head.towed === null) return C;
    const body = bodyPose(head.towed, p);
    if (!moving) C[0] = body[0];
    C[1] = body[1];
    return C;
}

// Where the towed body is drawn: at the image nearest to the centre.
function towedPose(p, C) {
    const pose = bodyPose(head.towed, p);
    return [C[0] + image(pose[0] - C[0], head.period[0]), C[1] + image(pose[1] - C[1], head.period[1]), pose[2]];
}

function origin(p) { return state.follow && head.towed !== null ? bodyPose(head.towed, p) : [0, 0, 0]; }

const flat = (x, y) => head.geographic ? [y, x] : [x, y];  // metres to the right, metres upwards

function toScreen(x, y, o) {
    const [u, v] = flat(x - o[0], y - o[1]);
    return [canvas.width / 2 + (u - state.cx) * state.scale, canvas.height / 2 - (v - state.cy) * state.scale];
}

function toWorld(sx, sy, o) {
    const u = (sx - canvas.width / 2) / state.scale + state.cx, v = state.cy - (sy - canvas.height / 2) / state.scale;
    return head.geographic ? [v + o[0], u + o[1]] : [u + o[0], v + o[1]];
}

function look(x0, x1, y0, y1, margin) {
    const [u0, v0] = flat(x0, y0), [u1, v1] = flat(x1, y1);
    state.cx = (u0 + u1) / 2;
    state.cy = (v0 + v1) / 2;
    state.scale = margin * Math.min(canvas.width / Math.abs(u1 - u0), canvas.height / Math.abs(v1 - v0));
}

// The whole domain, or the neighbourhood of the body that the view follows, as far as a moving window reaches.
function fit() {
    const C = centre(state.p), [x0, x1, y0, y1] = head.box, half = (x1 - x0) / 2;
    if (!state.follow || !head.view)
        return look(C[0] - half, C[0] + half, C[1] - (y1 - y0) / 2, C[1] + (y1 - y0) / 2, 0.96);
    const view = head.view.slice(), ahead = C[0] - bodyPose(head.towed, state.p)[0];
    if (moving) {
        view[0] = Math.max(view[0], ahead - half);
        view[1] = Math.min(view[1], ahead + half);
    }
    look(...view, 0.98);
}

function setFollow(on) {
    if (on === state.follow || head.towed === null) return;
    state.follow = on;
    $("replay-follow").checked = on;
    fit();
    draw();
}

function zoom(factor, sx, sy) {
    const o = [0, 0, 0], before = toWorld(sx, sy, o);
    state.scale = Math.max(1e-5, Math.min(1e5, state.scale * factor));
    const after = toWorld(sx, sy, o), [u, v] = flat(before[0] - after[0], before[1] - after[1]);
    state.cx += u;
    state.cy += v;
    draw();
}

function resize() {
    const ratio = window.devicePixelRatio || 1;
    for (const c of [canvas, chart]) {
        const w = Math.max(1, Math.round(c.clientWidth * ratio)), h = Math.max(1, Math.round(c.clientHeight * ratio));
        if (c.width === w && c.height === h) continue;
        if (c === canvas) state.scale *= w / c.width;
        c.width = w;
        c.height = h;
    }
    draw();
}

// ---- ice field

// 0 … LEVELS-1, place of a value on the colour scale.
function level(c, v) {
    const share = Math.max(0, Math.min(1, (v / c.factor - c.low) / (c.high - c.low || 1)));
    return Math.min(LEVELS - 1, Math.floor(Math.pow(share, c.power) * LEVELS));
}

function path(g, outline, pose, o) {
    const c = Math.cos(pose[2]), s = Math.sin(pose[2]);
    g.beginPath();
    for (const [x, y] of outline) g.lineTo(...toScreen(pose[0] + c * x - s * y, pose[1] + s * x + c * y, o));
    g.closePath();
}

// Floes that are in view, as [floe, x, y, yaw] one after the other, sorted into levels of colour.
function visible(p, C, o) {
    const bins = Array.from({length: LEVELS}, () => []), colouring = head.colouring[state.colour];
    const frame = nearest(), [Px, Py] = head.period;
    const low = toWorld(0, canvas.height, o), high = toWorld(canvas.width, 0, o);
    const see = (x, y, r) => x + r > low[0] && x - r < high[0] && y + r > low[1] && y - r < high[1];
    for (let i = 0; i < N; i++) {
        if (!there(i, frame)) continue;
        const pose = floePose(i, p), r = data.radius[i];
        const x = C[0] + image(pose[0] - C[0], Px), y = C[1] + image(pose[1] - C[1], Py);
        const bin = bins[level(colouring, value(colouring.kind, frame, i))];
        // Images of floes that reach over the edge.
        const kx = Px > 0 && Math.abs(x - C[0]) + r > Px / 2 ? [0, x > C[0] ? -Px : Px] : [0];
        const ky = Py > 0 && Math.abs(y - C[1]) + r > Py / 2 ? [0, y > C[1] ? -Py : Py] : [0];
        for (const ax of kx) for (const ay of ky) if (see(x + ax, y + ay, r)) bin.push(i, x + ax, y + ay, pose[2]);
    }
    return bins;
}

function drawFloes(g, p, C, o) {
    const table = head.colouring[state.colour].table, bins = visible(p, C, o), turn = head.geographic, s = state.scale;
    const halfW = canvas.width / 2 - state.cx * s, halfH = canvas.height / 2 + state.cy * s;
    const size = N ? Math.sqrt(data.area[0]) * s : 0;
    g.strokeStyle = head.style.water;
    g.lineWidth = Math.max(0.3, Math.min(1.2, 0.035 * size));
    bins.forEach((bin, k) => {
        if (!bin.length) return;
        g.fillStyle = `rgb(${table[k]})`;
        g.beginPath();
        for (let j = 0; j < bin.length; j += 4) {
            const i = bin[j], x = bin[j + 1] - o[0], y = bin[j + 2] - o[1], r = data.radius[i] * s;
            if (r < 1) {  // smaller than two pixels
                const a = Math.max(0.5, 0.85 * r);
                g.rect(halfW + (turn ? y : x) * s - a, halfH - (turn ? x : y) * s - a, 2 * a, 2 * a);
                continue;
            }
            const c = Math.cos(bin[j + 3]), d = Math.sin(bin[j + 3]), first = data.offset[i], end = data.offset[i + 1];
            for (let v = first; v < end; v++) {
                const vx = data.vertices[2 * v], vy = data.vertices[2 * v + 1];
                const wx = x + c * vx - d * vy, wy = y + d * vx + c * vy;
                const sx = halfW + (turn ? wy : wx) * s, sy = halfH - (turn ? wx : wy) * s;
                if (v === first) g.moveTo(sx, sy); else g.lineTo(sx, sy);
            }
            g.closePath();
        }
        g.fill();
        if (size > 5) g.stroke();
    });
    if (head.rafts) drawOverlaps(g, bins, o);
    const hover = state.hover;
    if (hover === null || hover < 0) return;
    for (const bin of bins) for (let j = 0; j < bin.length; j += 4) if (bin[j] === hover) {
        path(g, outlineOf(hover), bin.slice(j + 1, j + 4), o);
        g.strokeStyle = "#ffffff";
        g.lineWidth = 3;
        g.stroke();
        g.strokeStyle = "#000000";
        g.lineWidth = 1.2;
        g.stroke();
    }
}

// Floes over each other: the intersections of their outlines, pair by pair, of those that are large enough to be seen.
// As postproc/rafted.py.

const LEAST_OVERLAP = 1e-3, SEEN = 3;  // of a floe's area: less is the slop of the solver; pixels

// Convex polygon a cut by convex polygon b, both anticlockwise [Sutherland & Hodgman 1974].
function intersection(a, b) {
    for (let k = 0; k < b.length && a.length; k++) {
        const p = b[k], q = b[(k + 1) % b.length], ex = q[0] - p[0], ey = q[1] - p[1], out = [];
        const side = (v) => ex * (v[1] - p[1]) - ey * (v[0] - p[0]);
        let from = a[a.length - 1], before = side(from);
        for (const v of a) {
            const now = side(v);
            if ((now >= 0) !== (before >= 0)) {
                const w = before / (before - now);
                out.push([from[0] + w * (v[0] - from[0]), from[1] + w * (v[1] - from[1])]);
            }
            if (now >= 0) out.push(v);
            from = v;
            before = now;
        }
        a = out;
    }
    return a;
}

function areaOf(a) {
    let sum = 0;
    for (let k = 0, j = a.length - 1; k < a.length; j = k++) sum += a[j][0] * a[k][1] - a[k][0] * a[j][1];
    return sum / 2;
}

// Outline at a pose [x, y, yaw].
function placed(i, x, y, yaw) {
    const c = Math.cos(yaw), s = Math.sin(yaw);
    return outlineOf(i).map(([u, v]) => [x + c * u - s * v, y + s * u + c * v]);
}

function overlaps(bins) {
    const shown = [], out = [];
    let widest = 0;
    for (const bin of bins) for (let j = 0; j < bin.length; j += 4) {
        const r = data.radius[bin[j]];
        if (r * state.scale < SEEN) continue;
        shown.push({i: bin[j], x: bin[j + 1], y: bin[j + 2], yaw: bin[j + 3], r, outline: null});
        widest = Math.max(widest, r);
    }
    shown.sort((a, b) => a.x - b.x);
    const outline = (f) => f.outline || (f.outline = placed(f.i, f.x, f.y, f.yaw));
    shown.forEach((a, k) => {
        for (let m = k + 1; m < shown.length && shown[m].x - a.x < a.r + widest; m++) {
            const b = shown[m], reach = a.r + b.r;
            if ((a.x - b.x) ** 2 + (a.y - b.y) ** 2 >= reach * reach) continue;
            const both = intersection(outline(a), outline(b));
            if (areaOf(both) > LEAST_OVERLAP * Math.min(data.area[a.i], data.area[b.i])) out.push(both);
        }
    });
    return out;
}

function drawOverlaps(g, bins, o) {
    g.fillStyle = head.style.rafted;
    g.beginPath();
    for (const polygon of overlaps(bins)) {
        polygon.forEach((v, k) => g[k ? "lineTo" : "moveTo"](...toScreen(...v, o)));
        g.closePath();
    }
    g.fill();
}

function outlineOf(i) {
    const out = [];
    for (let v = data.offset[i]; v < data.offset[i + 1]; v++)
        out.push([data.vertices[2 * v], data.vertices[2 * v + 1]]);
    return out;
}

// The domain's water; edges that are open or periodic are dashed.
function drawWater(g, C, o) {
    const [x0, x1, y0, y1] = head.box, [Px, Py] = head.period;
    const shiftX = moving || (Px > 0 && state.follow) ? C[0] - (x0 + x1) / 2 : 0;
    const shiftY = Py > 0 && state.follow ? C[1] - (y0 + y1) / 2 : 0;
    const a = toScreen(x0 + shiftX, y0 + shiftY, o), b = toScreen(x1 + shiftX, y1 + shiftY, o);
    const left = Math.min(a[0], b[0]), top = Math.min(a[1], b[1]);
    const w = Math.abs(b[0] - a[0]), h = Math.abs(b[1] - a[1]);
    g.fillStyle = head.style.water;
    g.fillRect(left, top, w, h);
    return [left, top, w, h];
}

function drawEdges(g, rect) {
    const soft = (kind) => kind === "open" || kind === "periodic" || kind === "moving", [left, top, w, h] = rect;
    const ends = soft(head.edges[0]), sides = soft(head.edges[1]);
    const vertical = head.geographic ? sides : ends, horizontal = head.geographic ? ends : sides;
    g.strokeStyle = "#8a949e";
    g.lineWidth = 1;
    g.setLineDash([5, 4]);
    g.beginPath();
    if (vertical) for (const x of [left, left + w]) { g.moveTo(x, top); g.lineTo(x, top + h); }
    if (horizontal) for (const y of [top, top + h]) { g.moveTo(left, y); g.lineTo(left + w, y); }
    g.stroke();
    g.setLineDash([]);
}

function drawTrack(g, p, C, o) {
    if (!head.track) return;
    const {time, x, y} = head.track, now = timeAt(p), free = state.follow || moving;
    g.strokeStyle = head.style.track;
    g.lineWidth = 1.5;
    g.setLineDash([2, 4]);
    g.beginPath();
    let before = null;
    for (let k = 0; k < time.length && time[k] <= now; k++) {
        const at = free ? [x[k], y[k]]
            : [C[0] + image(x[k] - C[0], head.period[0]), C[1] + image(y[k] - C[1], head.period[1])];
        const jump = before && (Math.abs(at[0] - before[0]) > (head.box[1] - head.box[0]) / 2 ||
                                Math.abs(at[1] - before[1]) > (head.box[3] - head.box[2]) / 2);
        g[before && !jump ? "lineTo" : "moveTo"](...toScreen(...at, o));
        before = at;
    }
    g.stroke();
    g.setLineDash([]);
}

function drawBodies(g, p, C, o) {
    const shifts = (period, c, at) => period > 0 && (state.follow || moving)
        ? [-1, 0, 1].map((k) => period * (Math.round((c - at) / period) + k)) : [0];
    head.bodies.forEach((body, b) => {
        if (body.towed) return;
        const pose = bodyPose(b, p);
        g.fillStyle = body.wall ? head.style.wall : head.style.fixed;
        for (const ax of shifts(head.period[0], C[0], pose[0]))
            for (const ay of shifts(head.period[1], C[1], pose[1])) {
                path(g, body.vertices, [pose[0] + ax, pose[1] + ay, pose[2]], o);
                g.fill();
            }
    });
    if (head.towed === null) return;
    const pose = towedPose(p, C);
    drawLine(g, p, pose, o);
    path(g, head.bodies[head.towed].vertices, pose, o);
    g.fillStyle = head.style.body;
    g.strokeStyle = head.style.body_edge;
    g.lineWidth = 1.5;
    g.fill();
    g.stroke();
    if (head.heading) drawArrow(g, p, pose, o);
}

// Line from the hull to its towing end: a square, or a small ship, whose size is not to scale.
function drawLine(g, p, pose, o) {
    if (!head.line) return;
    const k = Math.min(Math.floor(p), T - 1), a = head.line[k], b = head.line[Math.min(k + 1, T - 1)], w = p - k;
    const same = a.length === b.length;
    const offset = (q, j, axis) => same ? q[axis] * (1 - w) + b[j][axis] * w : q[axis];
    const at = a.map((q, j) => toScreen(pose[0] + offset(q, j, 0), pose[1] + offset(q, j, 1), o));
    const end = at.length === 1 ? at[0] : at[1];
    for (const [width, colour] of [[4, "#ffffff"], [1.8, head.style.body_edge]]) {
        g.strokeStyle = colour;
        g.lineWidth = width;
        g.beginPath();
        at.forEach((q) => g.lineTo(...q));
        g.stroke();
    }
    g.fillStyle = "#ffffff";
    g.strokeStyle = head.style.body_edge;
    g.beginPath();
    if (head.vessel && at.length > 1) {
        const d = Math.atan2(end[1] - at[0][1], end[0] - at[0][0]), c = Math.cos(d), s = Math.sin(d);
        for (const [x, y] of [[-2, -5], [12, -5], [20, 0], [12, 5], [-2, 5]])
            g.lineTo(end[0] + c * x - s * y, end[1] + s * x + c * y);
    } else g.rect(end[0] - 4, end[1] - 4, 8, 8);
    g.closePath();
    g.fill();
    g.stroke();
}

function drawArrow(g, p, pose, o) {
    const [hx, hy] = head.heading[Math.min(Math.floor(p), T - 1)];
    const ahead = (sizes) => toScreen(pose[0] + sizes * head.size * hx, pose[1] + sizes * head.size * hy, o);
    const from = ahead(0.6), to = ahead(1.2), length = Math.max(16, Math.hypot(to[0] - from[0], to[1] - from[1]));
    const d = Math.atan2(to[1] - from[1], to[0] - from[0]), c = Math.cos(d), s = Math.sin(d);
    g.beginPath();
    for (const [x, y] of [[0, -0.08], [0.58, -0.08], [0.52, -0.26], [1, 0], [0.52, 0.26], [0.58, 0.08], [0, 0.08]])
        g.lineTo(from[0] + length * (c * x - s * y), from[1] + length * (s * x + c * y));
    g.closePath();
    g.fillStyle = head.style.track;
    g.strokeStyle = head.style.body_edge;
    g.lineWidth = 1;
    g.fill();
    g.stroke();
}

// A bar of a round length; on a map, where north is.
function drawScale(g) {
    const ratio = window.devicePixelRatio || 1, wish = 110 * ratio / state.scale;
    const power = Math.pow(10, Math.floor(Math.log10(wish)));
    const length = [5, 2, 1].map((k) => k * power).find((v) => v <= wish), px = length * state.scale;
    const x = 14 * ratio, y = canvas.height - 14 * ratio;
    g.fillStyle = "rgba(255,255,255,0.85)";
    g.fillRect(x - 6 * ratio, y - 20 * ratio, px + 12 * ratio, 26 * ratio);
    g.fillStyle = g.strokeStyle = "#1d2733";
    g.lineWidth = 2 * ratio;
    g.beginPath();
    g.moveTo(x, y - 4 * ratio);
    g.lineTo(x, y);
    g.lineTo(x + px, y);
    g.lineTo(x + px, y - 4 * ratio);
    g.stroke();
    g.font = `${11 * ratio}px sans-serif`;
    g.textAlign = "center";
    g.textBaseline = "alphabetic";
    g.fillText(length >= 1000 ? `${length / 1000} km` : `${+length.toPrecision(3)} m`, x + px / 2, y - 7 * ratio);
    if (!head.geographic) return;
    g.fillStyle = "rgba(255,255,255,0.85)";
    g.fillRect(8 * ratio, 8 * ratio, 22 * ratio, 36 * ratio);
    g.fillStyle = "#1d2733";
    g.fillText("N", 19 * ratio, 40 * ratio);
    g.beginPath();
    for (const [u, v] of [[19, 11], [24, 26], [19, 23], [14, 26]]) g.lineTo(u * ratio, v * ratio);
    g.fill();
}

function drawField() {
    const g = canvas.getContext("2d"), p = playhead(), C = centre(p), o = origin(p);
    g.lineJoin = "round";
    g.fillStyle = getComputedStyle(root).getPropertyValue("--outside").trim() || "#ffffff";
    g.fillRect(0, 0, canvas.width, canvas.height);
    const rect = drawWater(g, C, o);
    g.save();
    const [across, up] = flat(...head.period);
    g.beginPath();  // images end at the edges of a periodic domain
    g.rect(across ? rect[0] : 0, up ? rect[1] : 0, across ? rect[2] : canvas.width, up ? rect[3] : canvas.height);
    g.clip();
    drawFloes(g, p, C, o);
    drawTrack(g, p, C, o);
    g.restore();
    drawBodies(g, p, C, o);
    drawEdges(g, rect);
    drawScale(g);
}
