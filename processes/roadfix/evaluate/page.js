// Draws the report's plots as SVG from the data in the page; nothing is fetched.
const plots = JSON.parse(document.getElementById("plots").textContent);
const figures = JSON.parse(document.getElementById("figures").textContent);
const channels = plots.channels.map((c, i) => ({ ...c, color: palette[i % palette.length], figures: figures.channels[c.channel] }));
let zoom = null;

const timeRange = () => zoom || plots.scored;
const quantile = (values, q) => { const sorted = values.filter((v) => v !== null).sort((a, b) => a - b); return sorted[Math.floor(q * (sorted.length - 1))] ?? 0; };

/** Longest stretches without a hole in time, so that a line does not bridge what was not scored. */
function pathOf(t, y, x2, y2) {
  const steps = t.slice(1).map((v, i) => v - t[i]);
  const hole = 6 * quantile(steps, 0.5) + 1;
  let d = "", pen = false;
  for (let i = 0; i < t.length; ++i) {
    if (y[i] === null || (i > 0 && t[i] - t[i - 1] > hole)) pen = false;
    if (y[i] === null) continue;
    d += (pen ? "L" : "M") + x2(t[i]).toFixed(1) + " " + y2(y[i]).toFixed(1);
    pen = true;
  }
  return d;
}

function timeLabels(svg, x, width, y) {
  for (const t of ticks(...timeRange(), width / 100)) {
    const anchor = x(t) > width - 30 ? "end" : "middle";
    node("text", { x: Math.min(x(t), width - 2), y, "text-anchor": anchor, class: "tick" }, svg, +t.toPrecision(8) + " s");
  }
}

let clips = 0;
/** One plot over time. options: height, series [{name, color, t, y}], band {t, s, color}, log, low, high, line, unit */
function timePlot(host, options) {
  host.textContent = "";
  const width = Math.max(260, host.clientWidth), height = options.height || 220;
  const left = 52, right = 10, top = 8, bottom = 24;
  const [t0, t1] = timeRange();
  const x = (t) => left + ((t - t0) / (t1 - t0)) * (width - left - right);
  const scale = options.log ? Math.log10 : (v) => v;
  const y = (v) => top + ((scale(options.high) - scale(options.log ? Math.max(v, options.low / 10) : v)) / (scale(options.high) - scale(options.low))) * (height - top - bottom);
  const svg = node("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": options.label || "" }, host);
  const clip = "clip" + ++clips;
  node("rect", { x: left, y: top, width: width - left - right, height: height - top - bottom }, node("clipPath", { id: clip }, node("defs", {}, svg)));
  for (const v of options.log ? logTicks(options.low, options.high) : ticks(options.low, options.high, height / 36)) {
    node("line", { x1: left, x2: width - right, y1: y(v), y2: y(v), class: "gridline" }, svg);
    node("text", { x: left - 6, y: y(v) + 4, "text-anchor": "end", class: "tick" }, svg, options.log ? String(+v.toPrecision(1)) : String(+v.toPrecision(6)));
  }
  timeLabels(svg, x, width, height - 7);
  const inside = node("g", { "clip-path": `url(#${clip})` }, svg);
  for (const [a, b] of plots.outages) node("rect", { x: x(a), y: top, width: Math.max(1, x(b) - x(a)), height: height - top - bottom, fill: "var(--outage)", opacity: 0.2 }, inside);
  if (options.band) {
    const { t, s, color } = options.band;
    const edge = (sign) => t.map((v, i) => x(v).toFixed(1) + " " + y(sign * 3 * s[i]).toFixed(1));
    if (t.length) node("path", { d: "M" + edge(1).concat(edge(-1).reverse()).join("L") + "Z", fill: color, opacity: 0.16 }, inside);
  }
  if (options.line !== undefined) node("line", { x1: left, x2: width - right, y1: y(options.line), y2: y(options.line), stroke: "var(--muted)", "stroke-dasharray": "5 4" }, inside);
  for (const s of options.series) node("path", { d: pathOf(s.t, s.y, x, y), fill: "none", stroke: s.color, "stroke-width": 1.4, "stroke-linejoin": "round" }, inside);
  node("line", { x1: left, x2: width - right, y1: height - bottom, y2: height - bottom, class: "axis" }, svg);
  interact(host, svg, { left, right, top, bottom, width, height, t0, t1, options });
}

function interact(host, svg, frame) {
  const cursor = node("line", { y1: frame.top, y2: frame.height - frame.bottom, stroke: "var(--muted)", visibility: "hidden" }, svg);
  const brush = node("rect", { y: frame.top, height: frame.height - frame.top - frame.bottom, fill: "var(--ink)", opacity: 0.12, visibility: "hidden" }, svg);
  let from = null, tip = null;
  const at = (event) => {
    const px = ((event.clientX - svg.getBoundingClientRect().left) / svg.clientWidth) * frame.width;
    const clamped = Math.min(Math.max(px, frame.left), frame.width - frame.right);
    return { px: clamped, t: frame.t0 + ((clamped - frame.left) / (frame.width - frame.left - frame.right)) * (frame.t1 - frame.t0) };
  };
  svg.addEventListener("pointermove", (event) => {
    const { px, t } = at(event);
    cursor.setAttribute("x1", px); cursor.setAttribute("x2", px); cursor.setAttribute("visibility", "visible");
    if (from) { brush.setAttribute("x", Math.min(from.px, px)); brush.setAttribute("width", Math.abs(px - from.px)); brush.setAttribute("visibility", "visible"); }
    const lines = frame.options.series.map((s) => {
      let low = 0, high = s.t.length - 1;
      while (low < high) { const middle = (low + high) >> 1; if (s.t[middle] < t) low = middle + 1; else high = middle; }
      return `${s.name}  ${digits(s.y[low])} ${frame.options.unit || ""}`;
    });
    tip = tip || node("div", { class: "tip" }, host);
    tip.textContent = [`${t.toFixed(1)} s`, ...lines].join("\n");
    tip.style.top = "10px";
    tip.style.left = (px > frame.width / 2 ? (px / frame.width) * svg.clientWidth - tip.offsetWidth - 10 : (px / frame.width) * svg.clientWidth + 10) + "px";
  });
  svg.addEventListener("pointerdown", (event) => { if (event.pointerType === "mouse") from = at(event); });
  svg.addEventListener("pointerup", (event) => {
    const to = at(event);
    if (from && Math.abs(to.px - from.px) > 8) { zoom = [Math.min(from.t, to.t), Math.max(from.t, to.t)]; draw(); }
    from = null; brush.setAttribute("visibility", "hidden");
  });
  svg.addEventListener("pointerleave", () => { cursor.setAttribute("visibility", "hidden"); from = null; brush.setAttribute("visibility", "hidden"); if (tip) { tip.remove(); tip = null; } });
  svg.addEventListener("dblclick", () => { zoom = null; draw(); });
}

const inTime = (t, values) => { const [a, b] = timeRange(); return values.filter((v, i) => v !== null && t[i] >= a && t[i] <= b); };
const largest = (values, floor) => values.reduce((m, v) => Math.max(m, Math.abs(v)), floor);

function drawHorizontal() {
  const series = channels.map((c) => ({ name: c.channel, color: c.color, t: c.series.t, y: c.series.h }));
  const values = series.flatMap((s) => inTime(s.t, s.y));
  const log = byId("log-scale").checked;
  const high = largest(values, 1e-3) * (log ? 1.5 : 1.08);
  timePlot(byId("horizontal"), { label: "Horizontal error", height: 280, series, log, unit: "m", high, low: log ? Math.max(high * 1e-5, Math.min(high / 10, quantile(values, 0.02) / 2 || high * 1e-4)) : 0 });
}

function drawAxes() {
  const c = channels[+byId("axis-channel").value] || channels[0];
  const host = byId("axes"), cells = [];
  host.textContent = "";
  if (!c) return;
  for (const [axis, unit] of [["longitudinal", "m"], ["lateral", "m"], ["vertical", "m"], ["roll", "deg"], ["pitch", "deg"], ["yaw", "deg"]]) {
    const data = c.series[axis];
    if (!data) continue;
    const cell = node("div", {}, host);
    node("h4", {}, cell, `${axis}, ${unit}`);
    cells.push([node("div", { class: "plot" }, cell), axis, unit, data]);
  }
  for (const [plot, axis, unit, data] of cells) {
    const error = largest(inTime(c.series.t, data.e), 1e-4);
    const sigma = 3 * quantile(inTime(c.series.t, data.s), 0.9);
    const high = Math.max(error, Math.min(sigma, 6 * error)) * 1.1;
    timePlot(plot, { label: axis, height: 170, unit, low: -high, high, series: [{ name: axis, color: c.color, t: c.series.t, y: data.e }], band: { t: c.series.t, s: data.s, color: c.color } });
  }
}

const bounded = channels.filter((c) => c.levels);
const axisNames = ["along", "across", "up"];
const riskColor = (i) => palette[(i + 3) % palette.length];
const chosenLevels = () => bounded[+byId("levels-channel").value] || bounded[0];

function drawLevels() {
  const host = byId("levels"), c = chosenLevels();
  host.textContent = "";
  const cells = c.levels.axes.map((axis, a) => {
    const cell = node("div", {}, host);
    node("h4", {}, cell, `${axisNames[a]}, m`);
    return [node("div", { class: "plot" }, cell), axis, a];
  });
  for (const [plot, axis, a] of cells) {
    const t = c.levels.t, limit = c.levels.alert_limit_m[a];
    const series = axis.level_m.map((y, r) => ({ name: `level at ${c.levels.risks[r]}`, color: riskColor(r), t, y }));
    series.push({ name: "error", color: c.color, t, y: axis.error_m });
    const errors = inTime(t, axis.error_m), levels = axis.level_m.flatMap((y) => inTime(t, y));
    const high = largest(errors.concat(levels, limit < 1e3 ? [limit] : []), 1e-2) * 1.5;
    const low = Math.max(high * 1e-5, 1e-3, Math.min(high / 10, quantile(errors, 0.05)));
    timePlot(plot, { label: `Error and levels ${axisNames[a]}`, height: 190, log: true, unit: "m", low, high, series, line: limit < high ? limit : undefined });
  }
}

function drawStanford() {
  const host = byId("stanford"), figures = chosenLevels().figures.protection, risk = figures.risks[+byId("levels-risk").value] || figures.risks[0];
  host.textContent = "";
  byId("levels-facts").textContent = `${risk.misleading} of ${figures.samples} samples misleading, ${risk.hazardous} hazardous, ${figures.unbounded} without a bound; about ${Math.round(figures.independent)} independent.`;
  const plotsOf = risk.stanford.map((cells, a) => {
    const cell = node("div", {}, host);
    node("h4", {}, cell, `${axisNames[a]}: ${risk.misleading_by_axis[a]} misleading`);
    return [node("div", { class: "plot" }, cell), cells];
  });
  for (const [plot, cells] of plotsOf) stanford(plot, cells, plots.bins, 300);
}

function levelsControls() {
  if (!bounded.length) { byId("levels-section").remove(); return; }
  bounded.forEach((c, i) => node("option", { value: i }, byId("levels-channel"), c.channel));
  bounded[0].levels.risks.forEach((risk, i) => {
    node("option", { value: i }, byId("levels-risk"), String(risk));
    legendEntry(byId("levels-legend"), `level at ${risk}`, riskColor(i));
  });
  byId("levels-channel").addEventListener("change", () => { drawLevels(); drawStanford(); });
  byId("levels-risk").addEventListener("change", drawStanford);
}

function drawNees() {
  const series = channels.map((c) => ({ name: c.channel + " position", color: c.color, t: c.series.t, y: c.series.nees_position }));
  const values = series.flatMap((s) => inTime(s.t, s.y)).filter((v) => v > 0);
  timePlot(byId("nees"), { label: "NEES", height: 230, series, log: true, line: 1, high: Math.max(10, largest(values, 1) * 1.5), low: Math.min(0.1, Math.max(1e-3, quantile(values, 0.02))) });
}

const weightColors = () => Object.keys(plots.fusion.weights).map((name, i) => [name, (channels.find((c) => c.channel === name) || { color: palette[(i + 3) % palette.length] }).color]);

function drawFusion() {
  if (!plots.fusion.t.length) return;
  const modes = [{ name: "constant turn", color: palette[3], t: plots.fusion.mode_t, y: plots.fusion.turn }];
  timePlot(byId("modes"), { label: "Mode probability", height: 130, low: 0, high: 1.02, series: modes, line: 0.5 });
  const series = weightColors().map(([name, color]) => ({ name, color, t: plots.fusion.t, y: plots.fusion.weights[name] }));
  timePlot(byId("weights"), { label: "Channel weights", height: 170, low: 0, high: 1.02, series });
}

function fusionLegend() {
  if (!plots.fusion.t.length) { byId("fusion-section").remove(); return; }
  for (const [name, color] of weightColors()) legendEntry(byId("weights-legend"), name, color);
}

function legendEntry(legend, name, color) {
  const entry = node("span", {}, legend);
  node("i", { style: `background:${color}` }, entry);
  entry.append(name);
}

function drawPresence() {
  const host = byId("presence");
  host.textContent = "";
  const width = Math.max(260, host.clientWidth), row = 26, left = Math.min(110, width / 3), height = channels.length * row + 24;
  const [t0, t1] = timeRange();
  const x = (t) => left + ((Math.min(Math.max(t, t0), t1) - t0) / (t1 - t0)) * (width - left - 10);
  const svg = node("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": "Validity over time" }, host);
  const colors = ["var(--silent)", "var(--invalid)", "var(--coasting)", "var(--valid)"];
  channels.forEach((c, i) => {
    node("text", { x: 0, y: i * row + 17, class: "tick" }, svg, c.channel);
    for (const [a, b, kind] of c.presence) if (b > t0 && a < t1) node("rect", { x: x(a), y: i * row + 5, width: Math.max(0.5, x(b) - x(a)), height: row - 10, fill: colors[kind] }, svg);
  });
  timeLabels(svg, x, width, height - 6);
  const legend = byId("presence-legend");
  legend.textContent = "";
  [["valid", 3], ["coasting", 2], ["invalid", 1], ["silent", 0]].forEach(([name, kind]) => legendEntry(legend, name, colors[kind]));
}

const heat = (share) => `hsl(${Math.round(220 - 220 * Math.min(1, Math.max(0, share)))} 85% 50%)`;

function drawMap() {
  const host = byId("map");
  host.textContent = "";
  const ref = plots.reference, mode = byId("map-mode").value;
  const xs = ref.x.concat(...channels.map((c) => c.series.x)), ys = ref.y.concat(...channels.map((c) => c.series.y));
  if (!xs.length) return;
  const reduce = (f, values) => values.reduce((a, b) => f(a, b));
  let [x0, x1, y0, y1] = [reduce(Math.min, xs), reduce(Math.max, xs), reduce(Math.min, ys), reduce(Math.max, ys)];
  const width = Math.max(260, host.clientWidth), pad = 22;
  const size = Math.max(x1 - x0, y1 - y0, 1);
  const height = Math.round(Math.min(560, Math.max(240, (width - 2 * pad) * Math.max(0.2, (y1 - y0) / Math.max(x1 - x0, size * 0.2)) + 2 * pad)));
  const factor = Math.min((width - 2 * pad) / Math.max(x1 - x0, size * 0.05), (height - 2 * pad) / Math.max(y1 - y0, size * 0.05));
  const X = (v) => width / 2 + (v - (x0 + x1) / 2) * factor, Y = (v) => height / 2 - (v - (y0 + y1) / 2) * factor;
  const svg = node("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": "Map of reference and estimates" }, host);
  const hole = (p) => 6 * quantile(p.t.slice(1).map((t, i) => t - p.t[i]), 0.5) + 1;
  const line = (p, keep) => { const gap = hole(p); let d = "", pen = false; p.t.forEach((t, i) => { if (!keep(t)) { pen = false; return; } if (i > 0 && t - p.t[i - 1] > gap) pen = false; d += (pen ? "L" : "M") + X(p.x[i]).toFixed(1) + " " + Y(p.y[i]).toFixed(1); pen = true; }); return d; };
  const stroke = { fill: "none", "stroke-linejoin": "round", "stroke-linecap": "round" };
  node("path", { ...stroke, d: line(ref, () => true), stroke: "var(--reference)", "stroke-width": 6, opacity: 0.45 }, svg);
  const dark = (t) => plots.outages.some(([a, b]) => t >= a && t <= b);
  if (plots.outages.length) node("path", { ...stroke, d: line(ref, dark), stroke: "var(--outage)", "stroke-width": 9, opacity: 0.7 }, svg);
  if (mode === "all") {
    for (const c of channels) node("path", { ...stroke, d: line(c.path, (t) => t >= plots.scored[0]), stroke: c.color, "stroke-width": 1.6 }, svg);
  } else {
    const s = channels[+mode].series, top = quantile(s.h, 0.98) || 1;
    s.t.forEach((_, i) => node("circle", { cx: X(s.x[i]).toFixed(1), cy: Y(s.y[i]).toFixed(1), r: 2.2, fill: heat(s.h[i] / top) }, svg));
    for (let i = 0; i <= 60; ++i) node("rect", { x: pad + i * 2, y: 8, width: 2.5, height: 8, fill: heat(i / 60) }, svg);
    node("text", { x: pad, y: 30, class: "tick" }, svg, `0 to ${digits(top)} m (98 % of the errors)`);
  }
  const bar = niceBelow(width / 4 / factor);
  node("path", { d: `M${pad} ${height - 12}v4h${bar * factor}v-4`, fill: "none", stroke: "var(--muted)" }, svg);
  node("text", { x: pad + bar * factor + 8, y: height - 6, class: "tick" }, svg, `${bar} m`);
}

function card(c) {
  const f = c.figures, e = f.errors, box = node("article", { class: "card", style: `--channel:${c.color}` }, byId("cards"));
  const title = node("h3", {}, box, c.channel);
  node("span", {}, title, f.alignment === "none" ? "not aligned" : `aligned: ${f.alignment}`);
  const big = node("div", { class: "big" }, box, f.scored ? digits(e.horizontal_m.rmse) + " m " : "no pose scored");
  if (f.scored) node("small", {}, big, "horizontal RMSE");
  const list = node("dl", {}, box);
  const add = (name, value) => { node("dt", {}, list, name); node("dd", {}, list, value); };
  if (f.scored) {
    add("95 % / largest", `${digits(e.horizontal_m.p95)} / ${digits(e.horizontal_m.max)} m`);
    add("vertical RMSE", `${digits(e.vertical_m.rmse)} m`);
    if (e.yaw_deg) add("yaw RMSE", `${digits(e.yaw_deg.rmse)} deg`);
    if (f.kitti) add("drift (KITTI)", `${digits(f.kitti.translation_percent)} %`);
    if (f.honesty.position_m.samples) add("within 3 sigma", `${(100 * f.honesty.position_m.within_3sigma).toFixed(1)} %`);
  }
  if (f.outages.count) add(`end of ${f.outages.count} outages, RMS`, `${digits(f.outages.horizontal_m.rmse)} m`);
  if (f.availability.usable !== undefined) add("usable", `${(100 * f.availability.usable).toFixed(1)} %`);
  add("valid or coasting", `${(100 * (f.availability.valid + f.availability.coasting)).toFixed(1)} %`);
}

function outageTable() {
  const rows = channels.flatMap((c) => c.figures.outages.each.map((o) => ({ ...o, channel: c.channel })));
  if (!rows.length) { byId("outage-section").remove(); return; }
  const table = node("table", {}, byId("outages")), head = node("tr", {}, node("thead", {}, table)), body = node("tbody", {}, table);
  ["channel", "begins", "lasts s", "drives m", "horizontal m", "% of it", "vertical m", "yaw deg"].forEach((name) => node("th", {}, head, name));
  const start = Date.parse(plots.start) * 1000;
  for (const o of rows) {
    const row = node("tr", {}, body);
    [o.channel, ((o.first_withheld_us - start) / 1e6).toFixed(0) + " s", digits(o.duration_s), digits(o.distance_m), digits(o.horizontal_m), o.distance_m > 1 ? digits((100 * o.horizontal_m) / o.distance_m) : "-", digits(o.vertical_m), digits(o.yaw_deg)].forEach((v) => node("td", {}, row, v));
  }
}

function draw() {
  drawMap(); drawHorizontal(); drawPresence(); drawAxes(); drawNees(); drawFusion();
  if (bounded.length) { drawLevels(); drawStanford(); }
}

function start() {
  const first = channels[0] ? channels[0].figures : null;
  byId("facts").textContent = `${plots.start.replace("T", " ").slice(0, 19)} UTC` + (first ? ` · ${(first.duration_s / 60).toFixed(1)} min · ${(first.distance_m / 1000).toFixed(2)} km scored` : "") + (plots.outages.length ? ` · ${plots.outages.length} outages` : "") + (figures.drive.reference_from_fixes ? " · reference: the receiver's fixes" + (figures.drive.withheld_only ? ", the withheld ones" : "") : "");
  figures.notes.forEach((note) => node("li", {}, byId("notes"), note));
  channels.forEach((c, i) => {
    card(c);
    node("option", { value: i }, byId("axis-channel"), c.channel);
    node("option", { value: i }, byId("map-mode"), `error of ${c.channel}`);
  });
  byId("map-mode").prepend(node("option", { value: "all", selected: "" }, null, "all paths"));
  byId("map-mode").value = "all";
  outageTable();
  fusionLegend();
  levelsControls();
  byId("map-mode").addEventListener("change", drawMap);
  byId("axis-channel").addEventListener("change", drawAxes);
  byId("log-scale").addEventListener("change", drawHorizontal);
  let pending = 0, seen = 0;
  new ResizeObserver(() => { if (document.body.clientWidth === seen) return; seen = document.body.clientWidth; cancelAnimationFrame(pending); pending = requestAnimationFrame(draw); }).observe(document.body);
  draw();
}
start();
