// Draws tables, maps and plots of an experiment from the data in the page; nothing is fetched.
const plots = JSON.parse(byId("data").textContent);
const names = [...new Set([...plots.plots.flatMap((p) => p.series.map((s) => s.name)), ...plots.maps.flatMap((m) => m.paths.slice(1).map((p) => p.name))])];
const colorOf = (name) => { const i = names.indexOf(name); return i < palette.length ? palette[i] : `hsl(${(i * 47) % 360} 55% 45%)`; };
const drawings = [];

function section(host, title, hint) {
  const box = node("section", {}, byId(host));
  node("h2", {}, box, title);
  if (hint) node("p", { class: "hint" }, box, hint);
  return box;
}

function addTable(table) {
  const grid = node("table", {}, node("div", { class: "scroll" }, section("tables", table.title)));
  const head = node("tr", {}, node("thead", {}, grid)), body = node("tbody", {}, grid);
  table.columns.forEach((name) => node("th", {}, head, name));
  for (const row of table.rows) {
    const line = node("tr", {}, body);
    [row.name, ...row.values.map(digits)].forEach((text) => node("td", {}, line, text));
  }
}

function addPlot(plot) {
  const box = section("plots", plot.title, plot.hint), host = node("div", { class: "plot" }, box), legend = node("p", { class: "legend" }, box);
  const series = plot.series.map((s) => ({ ...s, color: colorOf(s.name) }));
  series.forEach((s) => legendEntry(legend, s.name, s.color));
  drawings.push(() => {
    const values = series.flatMap((s) => inTime(s.t, s.y));
    if (plot.line !== null) values.push(plot.line);
    const log = plot.logarithmic, low = values.reduce((m, v) => Math.min(m, v), 0);
    const high = largest(values, 1e-6) * (log ? 1.5 : 1.08);
    const positive = values.filter((v) => v > 0);
    timePlot(host, { label: plot.title, height: 260, series, log, unit: plot.unit, high, low: log ? Math.max(high * 1e-5, quantile(positive, 0.02) / 2 || high * 1e-4) : low < 0 ? -high : 0, line: plot.line === null ? undefined : plot.line });
  });
}

function addMap(map) {
  const box = section("maps", map.title, map.hint), host = node("div", { class: "plot" }, box), legend = node("p", { class: "legend" }, box);
  map.paths.forEach((p, i) => legendEntry(legend, p.name, i ? colorOf(p.name) : "var(--reference)"));
  drawings.push(() => {
    host.textContent = "";
    const xs = map.paths.flatMap((p) => p.x), ys = map.paths.flatMap((p) => p.y);
    if (!xs.length) return;
    const range = (values) => values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
    const [x0, x1] = range(xs), [y0, y1] = range(ys), width = Math.max(260, host.clientWidth), pad = 22;
    const height = Math.round(Math.min(560, Math.max(240, (width - 2 * pad) * (y1 - y0) / Math.max(x1 - x0, 1) + 2 * pad)));
    const factor = Math.min((width - 2 * pad) / Math.max(x1 - x0, 1), (height - 2 * pad) / Math.max(y1 - y0, 1));
    const svg = node("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": map.title }, host);
    const at = (p, i) => `${(width / 2 + (p.x[i] - (x0 + x1) / 2) * factor).toFixed(1)} ${(height / 2 - (p.y[i] - (y0 + y1) / 2) * factor).toFixed(1)}`;
    map.paths.forEach((p, k) => {
      if (!p.x.length) return;
      const d = "M" + p.x.map((_, i) => at(p, i)).join("L");
      node("path", { d, fill: "none", "stroke-linejoin": "round", stroke: k ? colorOf(p.name) : "var(--reference)", "stroke-width": k ? 1.6 : 6, opacity: k ? 1 : 0.45 }, svg);
    });
    const bar = niceBelow(width / 4 / factor);
    node("path", { d: `M${pad} ${height - 12}v4h${bar * factor}v-4`, fill: "none", stroke: "var(--muted)" }, svg);
    node("text", { x: pad + bar * factor + 8, y: height - 6, class: "tick" }, svg, `${bar} m`);
  });
}

function draw() { drawings.forEach((drawing) => drawing()); }

function start() {
  byId("facts").textContent = `${plots.source}. Drive: ${plots.drive}; ${(plots.scored[1] - plots.scored[0]).toFixed(0)} s scored, ${plots.outages.length} intervals shaded.`;
  plots.notes.forEach((note) => node("li", {}, byId("notes"), note));
  plots.tables.forEach(addTable);
  plots.maps.forEach(addMap);
  plots.plots.forEach(addPlot);
  let pending = 0, seen = 0;
  new ResizeObserver(() => { if (document.body.clientWidth === seen) return; seen = document.body.clientWidth; cancelAnimationFrame(pending); pending = requestAnimationFrame(draw); }).observe(document.body);
  draw();
}
start();
