// SPDX-License-Identifier: MIT
// The replay's force curve, controls, keys and what scripts may ask of it; follows replay.js within one function.

// ---- force curve

const curve = head.curve;
const margin = {left: 64, right: 14, top: 18, bottom: 34};

// Round numbers that cut [low, high] into about n pieces.
function ticks(low, high, n) {
    const raw = (high - low) / n, power = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw), out = [];
    for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-9); k++) out.push(+(k * step).toPrecision(12));
    return out;
}

// Limits of the force axis: they hold the running mean of the ice force and the other forces of the steady window.
// Samples beyond them are named, not drawn. side: 1 above zero, -1 below.
function forceRange() {
    const [ice, ...others] = curve.lines, steady = curve.window ? curve.window[0] : curve.start;
    const largest = (side, values, from = curve.start) =>
        values.reduce((top, v, k) => v !== null && curve.time[k] >= from ? Math.max(top, side * v) : top, 0);
    const most = (side, lines) => Math.max(...lines.flatMap((l) => [largest(side, l.low), largest(side, l.high)]));
    const wish = (side) => Math.min(
        most(side, curve.lines),
        Math.max(2.5 * largest(side, ice.smooth), 1.5 * side * (curve.mean || 0),
                 ...others.map((l) => 1.25 * largest(side, l.smooth, steady))));
    const [above, below] = [1, -1].map((side) => {
        const all = most(side, curve.lines);
        return wish(1) || wish(-1) ? Math.max(wish(side), Math.min(all, 0.3 * wish(-side))) : all;
    });
    const beyond = [["up", 1, above], ["down", -1, below]].flatMap(([way, side, end]) => {
        const single = most(side, [ice]);
        return single > 1.05 * end ? [`${way} to ${quantity(side * single, ice.unit)}`] : [];
    });
    return {low: -1.04 * below, high: 1.04 * above || (below ? 0 : 1), beyond};
}

const range = curve ? forceRange() : null;
const widest = range && Math.max(range.high, -range.low);
const prefix = widest >= 2e6 ? [1e6, "M"] : widest >= 2e3 ? [1e3, "k"] : [1, ""];

const chartScale = (ratio) => {
    const left = margin.left * ratio, right = chart.width - margin.right * ratio;
    const top = margin.top * ratio, bottom = chart.height - margin.bottom * ratio;
    return {
        left, right, top, bottom,
        x: (t) => left + (right - left) * (t - curve.start) / (curve.end - curve.start),
        y: (f) => bottom - (bottom - top) * (f - range.low) / (range.high - range.low),
    };
};

function axes(g, s, ink, faint, ratio) {
    g.font = `${11 * ratio}px sans-serif`;
    g.fillStyle = ink;
    g.strokeStyle = faint;
    g.lineWidth = ratio * 0.7;
    g.textAlign = "right";
    g.textBaseline = "middle";
    for (const f of ticks(range.low, range.high, 5)) {
        g.beginPath();
        g.moveTo(s.left, s.y(f));
        g.lineTo(s.right, s.y(f));
        g.stroke();
        g.fillText(+(f / prefix[0]).toPrecision(6), s.left - 6 * ratio, s.y(f));
    }
    g.textAlign = "center";
    g.textBaseline = "top";
    for (const t of ticks(curve.start, curve.end, Math.max(3, (s.right - s.left) / ratio / 110)))
        g.fillText(t, s.x(t), s.bottom + 5 * ratio);
    g.fillText("time (s)", (s.left + s.right) / 2, s.bottom + 19 * ratio);
    g.save();
    g.translate(11 * ratio, (s.top + s.bottom) / 2);
    g.rotate(-Math.PI / 2);
    g.textBaseline = "middle";
    g.fillText(`${curve.lines.length > 1 ? "force" : curve.lines[0].label} (${prefix[1]}${curve.lines[0].unit})`, 0, 0);
    g.restore();
}

// Each piece from its least to its largest sample.
function band(g, s, line, ratio) {
    g.strokeStyle = line.colour;
    g.lineWidth = 0.8 * ratio;
    g.globalAlpha = 0.4;
    g.beginPath();
    curve.time.forEach((t, k) => {
        if (line.low[k] === null) return;
        g.lineTo(s.x(t), s.y(line.high[k]));
        g.lineTo(s.x(t), s.y(line.low[k]));
    });
    g.stroke();
    g.globalAlpha = 1;
}

function mean(g, s, line, ratio) {
    g.strokeStyle = line.colour;
    g.lineWidth = 1.7 * ratio;
    g.beginPath();
    let pen = false;
    curve.time.forEach((t, k) => {
        if (line.smooth[k] === null) { pen = false; return; }
        g[pen ? "lineTo" : "moveTo"](s.x(t), s.y(line.smooth[k]));
        pen = true;
    });
    g.stroke();
}

// All of the chart but for the cursor.
function drawCurves(g, s, ratio, colour) {
    g.clearRect(0, 0, chart.width, chart.height);
    if (curve.window) {
        g.fillStyle = colour("--shade");
        g.fillRect(s.x(curve.window[0]), s.top, s.x(curve.window[1]) - s.x(curve.window[0]), s.bottom - s.top);
    }
    axes(g, s, colour("--ink"), colour("--rule"), ratio);
    g.save();
    g.beginPath();
    g.rect(s.left, s.top, s.right - s.left, s.bottom - s.top);
    g.clip();
    band(g, s, curve.lines[0], ratio);
    for (const line of curve.lines) mean(g, s, line, ratio);
    if (curve.window && curve.mean !== null) {
        g.strokeStyle = colour("--ink");
        g.setLineDash([6 * ratio, 4 * ratio]);
        g.lineWidth = 1.3 * ratio;
        g.beginPath();
        g.moveTo(s.x(curve.window[0]), s.y(curve.mean));
        g.lineTo(s.x(curve.window[1]), s.y(curve.mean));
        g.stroke();
        g.setLineDash([]);
        if (curve.at_least) {
            g.fillStyle = colour("--warn");
            g.textAlign = "right";
            g.textBaseline = "bottom";
            g.fillText("mean at least this", s.x(curve.window[1]), s.y(curve.mean) - 2 * ratio);
        }
    }
    g.restore();
    if (range.beyond.length) {
        g.fillStyle = colour("--faint");
        g.textAlign = "right";
        g.textBaseline = "top";
        const words = `${curve.lines[0].label}: single samples ${range.beyond.join(" and ")}`;
        g.fillText(words, s.right, s.top - 11 * ratio);
    }
    for (const e of curve.events) {
        g.fillStyle = colour("--warn");
        g.beginPath();
        const x = s.x(e.time);
        g.moveTo(x, s.top + 9 * ratio);
        g.lineTo(x - 5 * ratio, s.top);
        g.lineTo(x + 5 * ratio, s.top);
        g.fill();
    }
}

const curves = document.createElement("canvas");  // what the chart shows at any time of the replay

function drawChart() {
    if (!curve) return;
    const g = chart.getContext("2d"), ratio = window.devicePixelRatio || 1, s = chartScale(ratio);
    const look = getComputedStyle(root), colour = (name) => look.getPropertyValue(name).trim();
    const drawn = `${chart.width} ${chart.height} ${ratio} ${colour("--ink")}`;
    if (curves.drawn !== drawn) {
        curves.drawn = drawn;
        curves.width = chart.width;
        curves.height = chart.height;
        drawCurves(curves.getContext("2d"), s, ratio, colour);
    }
    g.clearRect(0, 0, chart.width, chart.height);
    g.drawImage(curves, 0, 0);
    const x = s.x(timeAt(state.p));
    g.strokeStyle = colour("--cursor");
    g.lineWidth = 2 * ratio;
    g.beginPath();
    g.moveTo(x, s.top);
    g.lineTo(x, s.bottom);
    g.stroke();
}

// Values of the curve at a time, in words.
function reading(time) {
    if (!curve) return "";
    let k = curve.time.findIndex((t) => t >= time);
    if (k < 0) k = curve.time.length - 1;
    const said = (l) => `${l.label} ${l.smooth[k] === null ? "–" : quantity(l.smooth[k], l.unit)}`;
    return `at ${+time.toPrecision(6)} s, running means: ` + curve.lines.map(said).join(", ");
}

// ---- words

function quantity(v, unit) {
    const a = unit === "N" || unit === "J" ? Math.abs(v) : 0;
    const [f, p] = a >= 2e9 ? [1e9, "G"] : a >= 2e6 ? [1e6, "M"] : a >= 2e3 ? [1e3, "k"] : [1, ""];
    return `${+(v / f).toPrecision(3)} ${p}${unit}`;
}

// A value out of a range, with decimals for a hundredth of that range or less.
const fixed = (v, span) => v.toFixed(Math.max(0, 2 - Math.floor(Math.log10(span || 1)))).replace(/^-(?=[0.]*$)/, "");

function say() {
    const t = timeAt(state.p), end = head.times[T - 1];
    $("replay-now").textContent = `${fixed(t, end)} s of ${+end.toPrecision(6)} s`;
    $("replay-reading").textContent = reading(t);
    slider.value = state.p;
    slider.setAttribute("aria-valuetext", $("replay-now").textContent);
    $("replay-play").textContent = state.playing ? "❚❚ pause" : "▶ play";
}

function legend() {
    const c = head.colouring[state.colour], bar = $("replay-bar").getContext("2d");
    c.table.forEach((rgb, k) => { bar.fillStyle = `rgb(${rgb})`; bar.fillRect(k * 4, 0, 4, 14); });
    const at = (share) => +(c.low + (c.high - c.low) * Math.pow(share, 1 / c.power)).toPrecision(2);
    $("replay-bar-low").textContent = at(0);
    $("replay-bar-middle").textContent = at(0.5);
    $("replay-bar-high").textContent = at(1) + (c.above ? " and above" : "");
    $("replay-bar-label").textContent = c.label;
    $("replay-rafts").hidden = !head.rafts;
    $("replay-rafts-square").style.background = head.style.rafted;
}

function draw() {
    if (!data || scheduled) return;
    scheduled = true;
    requestAnimationFrame(() => { scheduled = false; drawField(); drawChart(); say(); });
}

// ---- play

function seek(p) {
    state.p = clampFrame(+p || 0);
    hideTip();
    draw();
}

function play(on) {
    if (on && state.p >= T - 1) state.p = 0;
    if (on && T < 2) return;
    state.playing = on;
    state.last = performance.now();
    if (on) { hideTip(); requestAnimationFrame(tick); }
    draw();
}

function tick(now) {
    if (!state.playing) return;
    const step = Math.min(0.25, Math.max(0, (now - state.last) / 1000)) * state.rate;
    state.last = now;
    const time = timeAt(state.p) + step;
    state.p = time >= head.times[T - 1] ? T - 1 : frameAt(time);
    if (state.p >= T - 1) state.playing = false;
    draw();
    if (state.playing) requestAnimationFrame(tick);
}

// Rates, simulated seconds a second: the whole run in some 20 s, and round multiples of that.
function rates() {
    const whole = (head.times[T - 1] - head.times[0]) / 20 || 1, power = Math.pow(10, Math.floor(Math.log10(whole)));
    const nearer = (a, b) => Math.abs(a - whole) < Math.abs(b - whole) ? a : b;
    const base = [1, 2, 5, 10].map((k) => k * power).reduce(nearer);
    const select = $("replay-rate");
    for (const k of [0.1, 0.2, 0.5, 1, 2, 5])
        select.append(new Option(`${+(base * k).toPrecision(2)} × real time`, base * k, k === 1, k === 1));
    state.rate = base;
    select.onchange = () => { state.rate = +select.value; };
}

// ---- pointer

function inside(i, x, y, pose) {
    const c = Math.cos(pose[2]), s = Math.sin(pose[2]), dx = x - pose[0], dy = y - pose[1];
    const lx = c * dx + s * dy, ly = c * dy - s * dx, o = outlineOf(i);
    let odd = false;
    for (let a = 0, b = o.length - 1; a < o.length; b = a++) {
        if ((o[a][1] > ly) === (o[b][1] > ly)) continue;
        if (lx < (o[b][0] - o[a][0]) * (ly - o[a][1]) / (o[b][1] - o[a][1]) + o[a][0]) odd = !odd;
    }
    return odd;
}

function floeAt(sx, sy) {
    const p = playhead(), C = centre(p), [x, y] = toWorld(sx, sy, origin(p));
    for (let i = 0; i < N; i++) {
        if (!there(i, nearest())) continue;
        const pose = floePose(i, p);
        const dx = image(x - pose[0], head.period[0]), dy = image(y - pose[1], head.period[1]);
        if (Math.hypot(dx, dy) <= data.radius[i] && inside(i, pose[0] + dx, pose[1] + dy, pose)) return i;
    }
    return -1;
}

const idOf = (i) => head.ids ? head.ids[i] : i;

function describe(i) {
    const k = nearest(), where = head.period[0] || head.period[1] ? " (within the domain)" : "";
    const [x0, x1, y0, y1] = head.box, [x, y] = floePose(i, k).map((v) => fixed(v, Math.max(x1 - x0, y1 - y0)));
    return [`floe ${idOf(i)}`,
            `speed ${quantity(value("speed", k, i), "m/s")}`,
            `largest contact force ${quantity(value("force", k, i), "N")}`,
            `thickness ${quantity(data.thickness[i], "m")}, area ${quantity(data.area[i], "m²")}`,
            `x ${x} m, y ${y} m${where}`,
            `values of the frame at ${+head.times[k].toPrecision(6)} s`];
}

function hideTip() { tip.hidden = true; state.hover = null; }

function hover(event) {
    const ratio = canvas.width / canvas.clientWidth, box = canvas.getBoundingClientRect();
    const i = floeAt((event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio);
    if (i !== state.hover) { state.hover = i; draw(); }
    tip.hidden = i < 0;
    if (i < 0) return;
    tip.textContent = describe(i).join("\n");
    const x = event.clientX - box.left, y = event.clientY - box.top;
    tip.style.left = `${Math.min(x + 14, Math.max(0, canvas.clientWidth - tip.offsetWidth - 4))}px`;
    const high = tip.offsetHeight, above = y + high + 24 > canvas.clientHeight;
    tip.style.top = `${above ? Math.max(0, y - high - 12) : y + 16}px`;
}

function pointers() {
    const held = new Map();
    const at = (event) => {
        const box = canvas.getBoundingClientRect(), ratio = canvas.width / canvas.clientWidth;
        return [(event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio];
    };
    const spread = () => { const [a, b] = [...held.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
    canvas.onpointerdown = (event) => {
        held.set(event.pointerId, at(event));
        canvas.setPointerCapture(event.pointerId);
        hideTip();
    };
    canvas.onpointermove = (event) => {
        if (!held.has(event.pointerId)) { if (!state.playing) hover(event); return; }
        const before = held.get(event.pointerId), now = at(event), old = held.size === 2 ? spread() : 0;
        held.set(event.pointerId, now);
        if (held.size === 2) {
            const [a, b] = [...held.values()];
            zoom(spread() / (old || 1), (a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
            return;
        }
        state.cx -= (now[0] - before[0]) / state.scale;
        state.cy += (now[1] - before[1]) / state.scale;
        draw();
    };
    canvas.onpointerup = canvas.onpointercancel = (event) => held.delete(event.pointerId);
    canvas.onpointerleave = () => { if (state.hover !== null) { hideTip(); draw(); } };
    // The wheel scrolls the page until the field has been clicked.
    canvas.addEventListener("wheel", (event) => {
        if (document.activeElement !== canvas && !event.ctrlKey) return;
        event.preventDefault();
        zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...at(event));
    }, {passive: false});
    if (!curve) return;
    const jump = (event) => {
        const box = chart.getBoundingClientRect(), ratio = chart.width / chart.clientWidth;
        const s = chartScale(window.devicePixelRatio || 1), across = (event.clientX - box.left) * ratio - s.left;
        seek(frameAt(curve.start + (curve.end - curve.start) * across / (s.right - s.left)));
    };
    chart.onpointerdown = (event) => { chart.setPointerCapture(event.pointerId); jump(event); };
    chart.onpointermove = (event) => { if (event.buttons) jump(event); };
}

// ---- buttons and keys

function colourBy(k) {
    state.colour = ((k % head.colouring.length) + head.colouring.length) % head.colouring.length;
    $("replay-colour").value = state.colour;
    legend();
    draw();
}

const middle = (factor) => zoom(factor, canvas.width / 2, canvas.height / 2);
const step = (n) => { play(false); seek((n > 0 ? Math.floor(state.p + 1e-9) : Math.ceil(state.p - 1e-9)) + n); };
const keys = {
    " ": () => play(!state.playing),
    ArrowRight: (e) => step(e.shiftKey ? 10 : 1),
    ArrowLeft: (e) => step(e.shiftKey ? -10 : -1),
    Home: () => seek(0),
    End: () => seek(T - 1),
    "+": () => middle(1.3),
    "=": () => middle(1.3),
    "-": () => middle(1 / 1.3),
    f: () => { fit(); draw(); },
    b: () => setFollow(!state.follow),
    c: () => colourBy(state.colour + 1),
};

// Is half of the field, or half of what the window can show of it, in the window?
function inSight() {
    const box = canvas.getBoundingClientRect(), height = Math.min(box.height, innerHeight);
    return Math.min(box.bottom, innerHeight) - Math.max(box.top, 0) >= height / 2;
}

function controls() {
    slider.max = T - 1;
    slider.oninput = () => { play(false); seek(slider.value); };
    $("replay-play").onclick = () => play(!state.playing);
    $("replay-fit").onclick = () => { fit(); draw(); };
    $("replay-in").onclick = () => middle(1.4);
    $("replay-out").onclick = () => middle(1 / 1.4);
    const select = $("replay-colour");
    head.colouring.forEach((c, k) => select.append(new Option(c.name, k)));
    select.onchange = () => colourBy(+select.value);
    $("replay-smooth").onchange = (event) => { state.smooth = event.target.checked; draw(); };
    const follow = $("replay-follow");
    follow.checked = state.follow;
    follow.disabled = head.towed === null;
    follow.onchange = () => setFollow(follow.checked);
    // On the whole page, so that no click has to come first; where the replay is out of sight, Space and Home scroll.
    document.addEventListener("keydown", (event) => {
        const {tagName, type} = event.target, inside = root.contains(event.target),
            own = ["INPUT", "SELECT", "TEXTAREA", "BUTTON", "SUMMARY"].includes(tagName);
        if (event.ctrlKey || event.altKey || event.metaKey || !keys[event.key]) return;
        if (own && (tagName === "SELECT" || type === "range" || event.key === " ")) return;
        if (!inside && (own || !inSight())) return;
        event.preventDefault();
        keys[event.key](event);
    });
    for (const query of ["(prefers-color-scheme: dark)", "print"]) matchMedia(query).addEventListener("change", draw);
    addEventListener("beforeprint", () => { drawField(); drawChart(); });
    new ResizeObserver(resize).observe(canvas);
    if (curve) new ResizeObserver(resize).observe(chart);
    else chart.hidden = true;
}

// Height of the canvas, so that what it shows at first fills it.
function shape() {
    const box = state.follow && head.view ? head.view : head.box, [w, h] = flat(box[1] - box[0], box[3] - box[2]);
    canvas.style.aspectRatio = `${w} / ${Math.min(Math.max(h * 1.08, 0.28 * w), 1.1 * w)}`;
}

const css = (at) => at.map((v) => v * canvas.clientWidth / canvas.width);

// What the page's own controls do, for scripts (and the tests): frame numbers from 0, SI units.
window.bergtow = {
    get ready() { return data !== null; },
    get frames() { return T; },
    get floes() { return N; },
    get playhead() { return state.p; },
    get time() { return timeAt(state.p); },
    get playing() { return state.playing; },
    get colour() { return head.colouring[state.colour].kind; },
    get follow() { return state.follow; },
    seek,
    play: () => play(true),
    pause: () => play(false),
    fit: () => { fit(); draw(); },
    id: idOf,
    pose: (i) => floePose(i, playhead()),
    value: (kind, i) => value(kind, nearest(), i),
    body: (b) => bodyPose(b, playhead()),
    get overlap() { return paint.over / 255 / state.scale ** 2; },  // area painted as floes over each other, m²
    screen: (i) => {  // where floe i is drawn, CSS pixels from the canvas's corner
        const p = playhead(), C = centre(p), pose = floePose(i, p);
        const x = C[0] + image(pose[0] - C[0], head.period[0]), y = C[1] + image(pose[1] - C[1], head.period[1]);
        return css(toScreen(x, y, origin(p)));
    },
    towed: () => {  // the same of the towed body
        const p = playhead();
        return css(toScreen(...towedPose(p, centre(p)).slice(0, 2), origin(p)));
    },
    get forces() { return [range.low, range.high]; },  // ends of the force axis
    get metre() { return css([state.scale, 0])[0]; },  // CSS pixels
};

load().then(() => {
    $("replay-state").hidden = true;
    shape();
    rates();
    controls();
    pointers();
    legend();
    resize();
    fit();
    draw();
}).catch((error) => {
    $("replay-state").hidden = false;
    $("replay-state").className = "warning";
    $("replay-state").textContent = `The replay cannot be shown: ${error.message}.`;
});
