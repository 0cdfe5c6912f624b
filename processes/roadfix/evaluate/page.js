// Draws the report's plots as SVG from the data in the page; nothing is fetched.
const plots = JSON.parse(document.getElementById("plots").textContent);
const figures = JSON.parse(document.getElementById("figures").textContent);
const channels = plots.channels.map((c, i) => ({ ...c, color: palette[i % palette.length], figures: figures.channels[c.channel] }));

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
