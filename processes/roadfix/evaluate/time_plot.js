// Plots over time. The page that includes this has `plots` with scored [begin, end] and outages [[begin, end], ...], s, and draw(), which draws all of it again.
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

function legendEntry(legend, name, color) {
  const entry = node("span", {}, legend);
  node("i", { style: `background:${color}` }, entry);
  entry.append(name);
}
