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
// The page puts this file, raster.js and replay_controls.js into one function, in this order.
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
const [X0, DX] = head.quanta.x, [Y0, DY] = head.quanta.y, DYAW = head.quanta.yaw[1], [PX, PY] = head.period;
const shown = {n: 0, floe: new Uint32Array(4 * N), at: new Float64Array(12 * N)};  // in view: up to four images each
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
    let most = 4;
    for (let i = 0; i < N; i++) {
        data.offset[i + 1] = data.offset[i] + data.counts[i];
        most = Math.max(most, data.counts[i]);
        for (let v = data.offset[i]; v < data.offset[i + 1]; v++)
            data.radius[i] = Math.max(data.radius[i], Math.hypot(data.vertices[2 * v], data.vertices[2 * v + 1]));
    }
    paint.x = new Float64Array(most);
    paint.y = new Float64Array(most);
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

// Pose [x, y, yaw] of floe i at the playhead, as stored (wrapped into the domain), between frames if smooth; in `out`.
function floePose(i, p, out = [0, 0, 0]) {
    const k = Math.min(Math.floor(p), T - 1), a = k * N + i, w = p - k;
    const xa = X0 + DX * data.x[a], ya = Y0 + DY * data.y[a];
    out[0] = xa;
    out[1] = ya;
    out[2] = DYAW * data.yaw[a];
    if (!w || k + 1 >= T) return out;
    const b = a + N, xb = X0 + DX * data.x[b], yb = Y0 + DY * data.y[b];
    const ux = image(xb - xa, PX), uy = image(yb - ya, PY);
    const between = head.times[k + 1] - head.times[k];
    const reach = 2 * (value("speed", k, i) + value("speed", k + 1, i)) * between + 2 * data.radius[i];
    if (ux * ux + uy * uy > reach * reach) {
        if (w < 0.5) return out;
        out[0] = xb;
        out[1] = yb;
        out[2] = DYAW * data.yaw[b];
        return out;
    }
    let turn = (data.yaw[b] - data.yaw[a]) & 65535;
    if (turn > 32767) turn -= 65536;
    out[0] += w * ux;
    out[1] += w * uy;
    out[2] += w * DYAW * turn;
    return out;
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

// Where the towed body is: at the image nearest to the centre.
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

// Levels of colour of a colouring: of each number that a value is stored as, or of each floe.
function levelsOf(c) {
    if (!c.levels) {
        const top = head.quanta[c.kind], n = top === undefined ? N : 65536;
        const of = (k) => top === undefined ? data[c.kind][k] : top * (k / 65535) ** 2;
        c.levels = Uint8Array.from({length: n}, (_, k) => level(c, of(k)));
    }
    return c.levels;
}

function path(g, outline, pose, o) {
    const c = Math.cos(pose[2]), s = Math.sin(pose[2]);
    g.beginPath();
    for (const [x, y] of outline) g.lineTo(...toScreen(pose[0] + c * x - s * y, pose[1] + s * x + c * y, o));
    g.closePath();
}

// What is in view of the floes, images of those that reach over the edge among them: {n, floe, at: x, y, yaw of each}.
function visible(p, C, o) {
    const pose = [0, 0, 0], frame = nearest();
    const low = toWorld(0, canvas.height, o), high = toWorld(canvas.width, 0, o);
    let n = 0;
    for (let i = 0; i < N; i++) {
        if (!there(i, frame)) continue;
        floePose(i, p, pose);
        const r = data.radius[i], x = C[0] + image(pose[0] - C[0], PX), y = C[1] + image(pose[1] - C[1], PY);
        const ex = PX > 0 && Math.abs(x - C[0]) + r > PX / 2 ? (x > C[0] ? -PX : PX) : 0;
        const ey = PY > 0 && Math.abs(y - C[1]) + r > PY / 2 ? (y > C[1] ? -PY : PY) : 0;
        for (let kx = 0; kx < (ex ? 2 : 1); kx++) for (let ky = 0; ky < (ey ? 2 : 1); ky++) {
            const u = x + kx * ex, v = y + ky * ey;
            if (u + r <= low[0] || u - r >= high[0] || v + r <= low[1] || v - r >= high[1]) continue;
            shown.floe[n] = i;
            shown.at[3 * n] = u;
            shown.at[3 * n + 1] = v;
            shown.at[3 * n++ + 2] = pose[2];
        }
    }
    shown.n = n;
    return shown;
}

const LARGE = 30;   // pixels of a floe, from which on there are few, and each gets an outline
const SEAMS = 5;    // pixels of a floe, below which it has no seam, so that a far view is not the darker
const DOT = 4;      // pixels of a floe, below which it is a square of its area, and what it lies over cannot be seen

function drawFloes(g, p, C, o) {
    const {table, kind} = head.colouring[state.colour], levels = levelsOf(head.colouring[state.colour]);
    const {n, floe, at} = visible(p, C, o), turn = head.geographic, s = state.scale, frame = nearest();
    const halfW = canvas.width / 2 - state.cx * s, halfH = canvas.height / 2 + state.cy * s;
    const ground = rgba(...ofText(head.style.water)), over = head.rafts ? ofText(head.style.rafted) : null;
    const {x, y} = paint, vertices = data.vertices, stored = kind in head.quanta ? data[kind] : null;
    beginPaint(canvas.width, canvas.height);
    g.beginPath();
    for (let j = 0; j < n; j++) {
        const i = floe[j], u = at[3 * j] - o[0], v = at[3 * j + 1] - o[1], first = data.offset[i];
        const size = 2 * data.radius[i] * s, mx = halfW + (turn ? v : u) * s, my = halfH - (turn ? u : v) * s;
        const colour = table[levels[stored ? stored[i + frame * N] : i]];
        if (size < DOT) {
            const half = 0.5 * Math.sqrt(data.area[i]) * s;
            x[0] = x[3] = mx - half;
            x[1] = x[2] = mx + half;
            y[0] = y[1] = my - half;
            y[2] = y[3] = my + half;
            fillPolygon(4, colour, ground, 0, null);
            continue;
        }
        const c = s * Math.cos(at[3 * j + 2]), d = s * Math.sin(at[3 * j + 2]), m = data.offset[i + 1] - first;
        for (let k = 0; k < m; k++) {
            const vx = vertices[2 * (first + k)], vy = vertices[2 * (first + k) + 1];
            const wx = c * vx - d * vy, wy = d * vx + c * vy;
            x[k] = mx + (turn ? wy : wx);
            y[k] = my - (turn ? wx : wy);
        }
        if (size > LARGE) {
            for (let k = 0; k < m; k++) if (k) g.lineTo(x[k], y[k]); else g.moveTo(x[k], y[k]);
            g.closePath();
        }
        fillPolygon(m, colour, ground, Math.max(0, Math.min(1, (size - SEAMS) / SEAMS)), over);
    }
    endPaint(g);
    g.strokeStyle = head.style.water;
    g.lineWidth = 1.2;
    g.stroke();
    const hover = state.hover;
    if (hover === null || hover < 0) return;
    for (let j = 0; j < n; j++) if (floe[j] === hover) {
        path(g, outlineOf(hover), at.subarray(3 * j, 3 * j + 3), o);
        g.strokeStyle = "#ffffff";
        g.lineWidth = 3;
        g.stroke();
        g.strokeStyle = "#000000";
        g.lineWidth = 1.2;
        g.stroke();
    }
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
    g.strokeStyle = head.style.wall;
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
    const shifts = (period, c, at, laps = [-1, 0, 1]) => period > 0
        ? laps.map((k) => period * (Math.round((c - at) / period) + k)) : [0];
    const images = (b, along) => {
        const [x, y, yaw] = bodyPose(b, p);
        return shifts(head.period[0], C[0], x, along).flatMap(
            (ax) => shifts(head.period[1], C[1], y).map((ay) => [x + ax, y + ay, yaw]));
    };
    head.bodies.forEach((body, b) => {
        if (body.towed) return;
        g.fillStyle = body.wall ? head.style.wall : head.style.fixed;
        for (const pose of images(b)) {
            path(g, body.vertices, pose, o);
            g.fill();
        }
    });
    if (head.towed === null) return;
    for (const pose of images(head.towed, moving ? [0] : undefined)) {  // it goes with a moving window
        drawLine(g, p, pose, o);
        path(g, head.bodies[head.towed].vertices, pose, o);
        g.fillStyle = head.style.body;
        g.strokeStyle = head.style.body_edge;
        g.lineWidth = 1.5;
        g.fill();
        g.stroke();
        if (head.heading) drawArrow(g, p, pose, o);
    }
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
    g.fillStyle = g.strokeStyle = head.style.ink;
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
    g.fillStyle = head.style.ink;
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
    const within = (px, py, parts) => {  // images end at the edges of a periodic domain
        const [across, up] = flat(px, py);
        g.save();
        g.beginPath();
        g.rect(across ? rect[0] : 0, up ? rect[1] : 0, across ? rect[2] : canvas.width, up ? rect[3] : canvas.height);
        g.clip();
        for (const part of parts) part(g, p, C, o);
        g.restore();
    };
    within(PX, PY, [drawFloes, drawTrack]);
    within(moving ? 0 : PX, PY, [drawBodies]);  // the line may end ahead of a moving window
    drawEdges(g, rect);
    drawScale(g);
}
