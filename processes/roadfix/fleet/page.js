// Draws a fleet's distributions as SVG from the data in the page; nothing is fetched.
const data = JSON.parse(byId("data").textContent);
const names = Object.keys(data.channels);
const colorOf = (name) => palette[names.indexOf(name) % palette.length];
const columns = ["horizontal RMSE m", "horizontal 95 % m", "vertical RMSE m", "yaw RMSE deg", "NEES/dof", "available share"];
const finished = data.tasks.filter((t) => t.status === "ok");
const valuesOf = (name, column) => finished.map((t) => (t.channels[name] || [])[column]).filter((v) => v !== null && v !== undefined);

/** Axes with both scales logarithmic in x, linear or logarithmic in y; returns the plot's place and its scales. */
function frame(host, { low, high, yLow, yHigh, logY, label, height = 260 }) {
  host.textContent = "";
  const width = Math.max(260, host.clientWidth), left = 56, right = 12, top = 8, bottom = 26;
  const x = (v) => left + (Math.log10(v / low) / Math.log10(high / low)) * (width - left - right);
  const up = logY ? (v) => Math.log10(v / yLow) / Math.log10(yHigh / yLow) : (v) => (v - yLow) / (yHigh - yLow);
  const y = (v) => height - bottom - up(v) * (height - top - bottom);
  const svg = node("svg", { viewBox: `0 0 ${width} ${height}`, height, role: "img", "aria-label": label }, host);
  for (const v of logY ? logTicks(yLow, yHigh) : ticks(yLow, yHigh, height / 50)) {
    node("line", { x1: left, x2: width - right, y1: y(v), y2: y(v), class: "gridline" }, svg);
    node("text", { x: left - 6, y: y(v) + 4, "text-anchor": "end", class: "tick" }, svg, String(+v.toPrecision(3)));
  }
  for (const v of logTicks(low, high)) {
    node("line", { x1: x(v), x2: x(v), y1: top, y2: height - bottom, class: "gridline" }, svg);
    node("text", { x: x(v), y: height - 8, "text-anchor": "middle", class: "tick" }, svg, String(+v.toPrecision(2)));
  }
  node("line", { x1: left, x2: width - right, y1: height - bottom, y2: height - bottom, class: "axis" }, svg);
  return { svg, x, y, width, height };
}

/** Cumulative shares of several sets over a logarithmic axis. */
function shares(host, sets, label, line) {
  const all = sets.flatMap((s) => s.values).filter((v) => v > 0);
  if (!all.length) { host.textContent = "nothing to show"; return; }
  const low = 10 ** Math.floor(Math.log10(all.reduce((a, b) => Math.min(a, b)))), high = Math.max(low * 10, 10 ** Math.ceil(Math.log10(all.reduce((a, b) => Math.max(a, b)))));
  const { svg, x, y } = frame(host, { low, high, yLow: 0, yHigh: 1, label });
  if (line !== undefined && line > low && line < high) node("line", { x1: x(line), x2: x(line), y1: y(0), y2: y(1), stroke: "var(--muted)", "stroke-dasharray": "5 4" }, svg);
  for (const set of sets) {
    const sorted = set.values.slice().sort((a, b) => a - b);
    let d = "", before = 0;
    sorted.forEach((v, i) => {
      const at = x(Math.max(v, low)).toFixed(1);
      d += `${d ? "L" : "M"}${at} ${y(before).toFixed(1)}L${at} ${y((i + 1) / sorted.length).toFixed(1)}`;
      before = (i + 1) / sorted.length;
    });
    if (d) node("path", { d, fill: "none", stroke: set.color, "stroke-width": 1.6 }, svg);
  }
}

const setsOf = (column) => names.map((name) => ({ values: valuesOf(name, column), color: colorOf(name) }));

function drawBounds() {
  const host = byId("bounds"), [name, which] = byId("bound-channel").value.split(" "), channel = (data.channels[name] || { bounds: [] }).bounds[which];
  if (!channel || !channel.cells.length) { host.textContent = "nothing to show"; return; }
  byId("bound-facts").textContent = `Bound: ${channel.bound}; ${channel.exceeded} of ${channel.samples} above it (${(100 * channel.exceeded / channel.samples).toPrecision(2)} %).`;
  const edge = (bin) => data.bins.first * 10 ** (bin / data.bins.per_decade);
  const bins = channel.cells.flatMap((c) => [c[0], c[1]]);
  const first = bins.reduce((a, b) => Math.min(a, b)), last = bins.reduce((a, b) => Math.max(a, b)) + 1;
  const { svg, x, y } = frame(host, { low: edge(first), high: edge(last), yLow: edge(first), yHigh: edge(last), logY: true, label: "Errors against bounds", height: 420 });
  const most = channel.cells.reduce((m, c) => Math.max(m, c[2]), 1);
  for (const [error, bound, count] of channel.cells) {
    const rect = node("rect", { x: x(edge(bound)), y: y(edge(error + 1)), width: x(edge(bound + 1)) - x(edge(bound)), height: y(edge(error)) - y(edge(error + 1)), fill: error > bound ? "var(--invalid)" : "#2f6fed", opacity: 0.15 + 0.85 * Math.log1p(count) / Math.log1p(most) }, svg);
    node("title", {}, rect, `error ${digits(edge(error))} m, bound ${digits(edge(bound))} m: ${count}`);
  }
  node("line", { x1: x(edge(first)), y1: y(edge(first)), x2: x(edge(last)), y2: y(edge(last)), stroke: "var(--ink)" }, svg);
}

let order = { column: 0, down: true };
function drawDrives() {
  const host = byId("drives"), name = byId("drive-channel").value;
  host.textContent = "";
  const table = node("table", {}, host), head = node("tr", {}, node("thead", {}, table)), body = node("tbody", {}, table);
  node("th", {}, head, "drive");
  columns.forEach((column, i) => {
    const cell = node("th", { role: "button", tabindex: 0, style: "cursor:pointer" }, head, column + (order.column === i ? (order.down ? " ▾" : " ▴") : ""));
    cell.addEventListener("click", () => { order = { column: i, down: order.column !== i || !order.down }; drawDrives(); });
  });
  const value = (t) => ((t.channels || {})[name] || [])[order.column] ?? -1;
  const sorted = finished.slice().sort((a, b) => (order.down ? value(b) - value(a) : value(a) - value(b)));
  for (const t of sorted.slice(0, 500)) {
    const row = node("tr", {}, body), first = node("td", {}, row);
    if (t.page) node("a", { href: encodeURI(t.page) }, first, t.name); else first.textContent = t.name;
    columns.forEach((_, i) => node("td", {}, row, digits(((t.channels || {})[name] || [])[i])));
  }
  if (sorted.length > 500) node("p", { class: "hint" }, host, `${sorted.length - 500} more drives are in results.jsonl.`);
}

function drawOutages() {
  const key = "outages_" + byId("outage-unit").value;
  shares(byId("outages"), names.map((name) => ({ values: data.channels[name][key], color: colorOf(name) })), "Errors at the ends of outages");
}

function draw() {
  shares(byId("distribution"), setsOf(+byId("figure").value), "Distribution over the drives");
  if (byId("outages")) drawOutages();
  shares(byId("nees"), setsOf(4), "NEES of the drives", 1);
  drawBounds();
}

function start() {
  const bad = data.tasks.filter((t) => t.status !== "ok");
  byId("facts").textContent = `${finished.length} drives · ${data.drive_h.toFixed(2)} h driven · ${data.cpu_h.toFixed(2)} h of CPU · at most ${data.max_rss_mb.toFixed(0)} MB · stages ${data.stages.join(", ")} · build ${data.build}`;
  if (data.builds > 1) node("li", {}, byId("notes"), `Results of ${data.builds} builds are mixed here.`);
  for (const t of bad.slice(0, 50)) node("li", {}, byId("notes"), `${t.name}: ${t.status}${t.reason ? ": " + t.reason : ""}`);
  if (bad.length > 50) node("li", {}, byId("notes"), `and ${bad.length - 50} more without a result`);
  columns.forEach((column, i) => node("option", { value: i }, byId("figure"), column));
  for (const name of names) {
    data.channels[name].bounds.forEach((b, i) => { if (b.samples) node("option", { value: `${name} ${i}` }, byId("bound-channel"), `${name}, ${b.bound}`); });
    node("option", { value: name }, byId("drive-channel"), name);
    const entry = node("span", {}, byId("legend"));
    node("i", { style: `background:${colorOf(name)}` }, entry);
    entry.append(name);
  }
  if (!names.some((name) => data.channels[name].outages_m.length)) byId("outage-section").remove();
  for (const [id, redraw] of [["figure", draw], ["outage-unit", draw], ["bound-channel", draw], ["drive-channel", drawDrives]]) if (byId(id)) byId(id).addEventListener("change", redraw);
  let pending = 0, seen = 0;
  new ResizeObserver(() => { if (document.body.clientWidth === seen) return; seen = document.body.clientWidth; cancelAnimationFrame(pending); pending = requestAnimationFrame(draw); }).observe(document.body);
  draw();
  drawDrives();
}
start();
