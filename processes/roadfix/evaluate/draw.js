"use strict";
// What the report pages draw with: elements, ticks, numbers. Nothing is fetched.
const palette = ["#2f6fed", "#e4572e", "#1a9e77", "#9b51e0", "#c2255c", "#0b7285", "#a86b00"];
const byId = (id) => document.getElementById(id);

function node(name, attributes = {}, parent = null, text = null) {
  const svg = ["svg", "g", "path", "line", "rect", "text", "circle", "title", "clipPath", "defs"].includes(name);
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== null) element.textContent = text;
  if (parent) parent.append(element);
  return element;
}

function digits(value) {
  if (value === null || value === undefined || !isFinite(value)) return "-";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(1);
  return value.toFixed(size < 1 ? 3 : size < 10 ? 2 : size < 100 ? 1 : 0);
}

function ticks(low, high, count) {
  const raw = (high - low) / Math.max(1, count);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw * 0.999);
  const out = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + step * 1e-9; v += step) out.push(Math.abs(v) < step * 1e-9 ? 0 : v);
  return out;
}

/** The largest of 1, 2, 5 times a power of ten that is not above the value. */
function niceBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].map((f) => f * power).find((s) => s <= value);
}

function logTicks(low, high) {
  const out = [];
  for (let p = Math.ceil(Math.log10(low) - 1e-9); p <= Math.log10(high) + 1e-9; ++p) out.push(10 ** p);
  return out.filter((_, i) => out.length <= 7 || i % Math.ceil(out.length / 6) === 0);
}

/** Axes, logarithmic in x, linear or logarithmic in y; returns the plot's place and its scales. */
function logFrame(host, { low, high, yLow, yHigh, logY, label, height = 260 }) {
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

/** Stanford diagram: counts [bin of the error, bin of the bound, count] over logarithmic axes; red where the error is above its bound. */
function stanford(host, cells, binning, height) {
  host.textContent = "";
  if (!cells.length) { host.textContent = "nothing to show"; return; }
  const edge = (bin) => binning.first * 10 ** (bin / binning.per_decade);
  const bins = cells.flatMap((c) => [c[0], c[1]]);
  const first = bins.reduce((a, b) => Math.min(a, b)), last = bins.reduce((a, b) => Math.max(a, b)) + 1;
  const { svg, x, y } = logFrame(host, { low: edge(first), high: edge(last), yLow: edge(first), yHigh: edge(last), logY: true, label: "Errors against bounds", height });
  const most = cells.reduce((m, c) => Math.max(m, c[2]), 1);
  for (const [error, bound, count] of cells) {
    const rect = node("rect", { x: x(edge(bound)), y: y(edge(error + 1)), width: x(edge(bound + 1)) - x(edge(bound)), height: y(edge(error)) - y(edge(error + 1)), fill: error > bound ? "var(--invalid)" : "#2f6fed", opacity: 0.15 + 0.85 * Math.log1p(count) / Math.log1p(most) }, svg);
    node("title", {}, rect, `error ${digits(edge(error))} m, bound ${digits(edge(bound))} m: ${count}`);
  }
  node("line", { x1: x(edge(first)), y1: y(edge(first)), x2: x(edge(last)), y2: y(edge(last)), stroke: "var(--ink)" }, svg);
}
