// Draws a fleet's distributions as SVG from the data in the page; nothing is fetched.
const data = JSON.parse(byId("data").textContent);
const names = Object.keys(data.channels);
const colorOf = (name) => palette[names.indexOf(name) % palette.length];
const columns = ["horizontal RMSE m", "horizontal 95 % m", "vertical RMSE m", "yaw RMSE deg", "NEES/dof", "available share"];
const finished = data.tasks.filter((t) => t.status === "ok");
const valuesOf = (name, column) => finished.map((t) => (t.channels[name] || [])[column]).filter((v) => v !== null && v !== undefined);

/** Cumulative shares of several sets over a logarithmic axis. */
function shares(host, sets, label, line) {
  const all = sets.flatMap((s) => s.values).filter((v) => v > 0);
  if (!all.length) { host.textContent = "nothing to show"; return; }
  const low = 10 ** Math.floor(Math.log10(all.reduce((a, b) => Math.min(a, b)))), high = Math.max(low * 10, 10 ** Math.ceil(Math.log10(all.reduce((a, b) => Math.max(a, b)))));
  const { svg, x, y } = logFrame(host, { low, high, yLow: 0, yHigh: 1, label });
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
  stanford(host, channel.cells, data.bins, 420);
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
