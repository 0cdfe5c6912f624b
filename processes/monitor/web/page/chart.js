// Errors over time where there is a reference, otherwise what the estimates claim. uPlot draws.
import { clock, colour, style, title } from './format.js';

const WINDOW_MS = 120000;
const MOST = 4000;

export class ErrorChart {
  constructor(box, heading, hint) {
    this.box = box;
    this.heading = heading;
    this.hint = hint;
    this.t = [];
    this.poses = {};  // name -> {err: [], sig: []}
    this.frame = null;
    new ResizeObserver(() => this.plot && this.plot.setSize(this.size())).observe(box);
  }

  size() { return { width: Math.max(200, this.box.clientWidth), height: 200 }; }

  setHistory(history) {
    this.t = history.t.slice();
    this.poses = {};
    for (const [name, columns] of Object.entries(history.poses)) {
      if (name !== 'REFERENCE') this.poses[name] = { err: columns.err.slice(), sig: columns.sig.slice() };
    }
    this.build();
  }

  append(frame) {
    const last = this.t[this.t.length - 1] || 0;
    if (frame.t - last < 450) return;
    this.t.push(frame.t);
    let fresh = false;
    for (const pose of frame.poses) {
      if (!this.poses[pose.name]) {
        this.poses[pose.name] = { err: Array(this.t.length - 1).fill(null), sig: Array(this.t.length - 1).fill(null) };
        fresh = true;
      }
    }
    for (const [name, columns] of Object.entries(this.poses)) {
      const pose = frame.poses.find((p) => p.name === name && p.map);
      columns.err.push(pose && pose.err != null ? pose.err : null);
      columns.sig.push(pose ? pose.sigma : null);
    }
    if (this.t.length > MOST) {
      this.t.splice(0, 1000);
      for (const columns of Object.values(this.poses)) { columns.err.splice(0, 1000); columns.sig.splice(0, 1000); }
    }
    if (fresh || !this.plot || this.kind !== this.wantedKind()) this.build(); else this.plot.setData(this.data(), false);
    this.plot.setScale('x', { min: (frame.t - WINDOW_MS) / 1000, max: frame.t / 1000 });
  }

  wantedKind() { return Object.values(this.poses).some((c) => c.err.some((x) => x != null)) ? 'err' : 'sig'; }

  names() { return Object.keys(this.poses).filter((n) => n !== 'POSE_LOCAL' && n !== 'POSE_VO_MAP'); }

  data() { return [this.t.map((t) => t / 1000), ...this.names().map((n) => this.poses[n][this.kind])]; }

  build() {
    this.kind = this.wantedKind();
    this.heading.textContent = this.kind === 'err' ? 'How far off each estimate is' : 'How unsure each estimate is';
    this.hint.textContent = this.kind === 'err'
      ? 'Horizontal distance from the reference, metres.'
      : 'No reference here, so only what the estimates claim of themselves: one standard deviation, metres.';
    if (this.plot) this.plot.destroy();
    const axis = { stroke: style('--muted'), grid: { stroke: style('--grid'), width: 1 }, ticks: { stroke: style('--grid') } };
    const time = { ...axis, values: (_, ticks) => ticks.map((t) => clock(t * 1000)) };
    const series = this.names().map((n) => ({
      label: title(n), stroke: colour(n), width: 1.6, spanGaps: false, points: { show: false },
      value: (_, v) => (v == null ? '–' : `${v.toFixed(2)} m`),
    }));
    const cursorTime = { hooks: { draw: [(u) => this.mark(u)] } };
    this.plot = new window.uPlot({
      ...this.size(), series: [{ label: 'Time', value: (_, t) => (t == null ? '–' : clock(t * 1000)) }, ...series], axes: [time, { ...axis, size: 54 }],
      scales: { y: { range: (_, low, high) => [0, Math.max(0.2, (high || 0) * 1.1)] } }, plugins: [cursorTime],
    }, this.data(), this.box);
  }

  /** The moment that a log is looked at. */
  mark(u) {
    if (!this.moment) return;
    const x = u.valToPos(this.moment / 1000, 'x', true);
    u.ctx.save();
    u.ctx.strokeStyle = style('--ink');
    u.ctx.beginPath();
    u.ctx.moveTo(x, u.bbox.top);
    u.ctx.lineTo(x, u.bbox.top + u.bbox.height);
    u.ctx.stroke();
    u.ctx.restore();
  }

  setMoment(t) {
    this.moment = t;
    if (this.plot) this.plot.redraw(false);
  }
}
