// The map: trails, ellipses and the car in local east and north, metres. Drag, scroll or pinch; "Follow" keeps the car in the middle.
import { canvas2d, colour, element, style, title } from './format.js';

const NINETEEN_OF_TWENTY = 2.448;  // sqrt of chi-square 0.95, 2 degrees of freedom
const JUMP_M = 50;                 // a trail is not drawn across this

export class MapView {
  constructor(canvas, legend) {
    this.canvas = canvas;
    this.legend = legend;
    this.scale = 3;  // pixels per metre
    this.centre = { e: 0, n: 0 };
    this.follow = true;
    this.trails = {};   // name -> {e: [], n: [], t: []}
    this.fixes = [];
    this.hidden = new Set(['POSE_LOCAL', 'POSE_VO_MAP']);
    this.known = new Set();
    this.frame = null;
    this.listen();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  listen() {
    const pointers = new Map();
    this.canvas.addEventListener('pointerdown', (event) => {
      pointers.set(event.pointerId, event);
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener('pointermove', (event) => {
      const last = pointers.get(event.pointerId);
      if (!last) return;
      const others = [...pointers.values()].filter((p) => p.pointerId !== event.pointerId);
      if (others.length === 1) {
        const o = others[0];
        const before = Math.hypot(last.clientX - o.clientX, last.clientY - o.clientY);
        const after = Math.hypot(event.clientX - o.clientX, event.clientY - o.clientY);
        if (before > 0) this.zoom(after / before);
      } else if (others.length === 0) {
        this.centre.e -= (event.clientX - last.clientX) / this.scale;
        this.centre.n += (event.clientY - last.clientY) / this.scale;
        this.setFollow(false);
      }
      pointers.set(event.pointerId, event);
      this.draw();
    });
    for (const end of ['pointerup', 'pointercancel']) this.canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
    this.canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    document.getElementById('zoom-in').onclick = () => this.zoom(1.6);
    document.getElementById('zoom-out').onclick = () => this.zoom(1 / 1.6);
    document.getElementById('follow').onclick = () => this.setFollow(!this.follow);
  }

  zoom(factor) {
    this.scale = Math.min(400, Math.max(0.005, this.scale * factor));
    this.draw();
  }

  setFollow(on) {
    this.follow = on;
    document.getElementById('follow').setAttribute('aria-pressed', String(on));
    this.draw();
  }

  /** The whole drive so far; with it everything known before is forgotten. */
  setHistory(history) {
    this.trails = {};
    for (const [name, columns] of Object.entries(history.poses)) {
      this.trails[name] = { t: history.t.slice(), e: columns.e, n: columns.n };
    }
    for (const name of Object.keys(this.trails)) this.learn(name);
    this.draw();
  }

  /** `append`: the frame continues the drive; otherwise the trails end at the frame's time. */
  show(frame, append) {
    this.frame = frame;
    const marks = frame.poses.filter((p) => p.map).map((p) => [p.name, p.map]);
    if (frame.reference) marks.push(['REFERENCE', frame.reference]);
    for (const [name, mark] of marks) {
      this.learn(name);
      if (append) this.append(name, frame.t, mark);
    }
    if (append && frame.fix) {
      const last = this.fixes[this.fixes.length - 1];
      if (!last || last.e !== frame.fix.e || last.n !== frame.fix.n) this.fixes.push(frame.fix);
      if (this.fixes.length > 500) this.fixes.splice(0, 100);
    }
    this.draw();
  }

  append(name, t, mark) {
    const trail = this.trails[name] || (this.trails[name] = { t: [], e: [], n: [] });
    trail.t.push(t);
    trail.e.push(mark.e);
    trail.n.push(mark.n);
    if (trail.t.length > 20000) for (const column of [trail.t, trail.e, trail.n]) column.splice(0, 5000);
  }

  learn(name) {
    if (this.known.has(name)) return;
    this.known.add(name);
    const box = element('input', '', { type: 'checkbox' });
    box.checked = !this.hidden.has(name);
    const label = element('label', '', { style: `--colour: ${colour(name)}` });
    label.append(box, element('i'), element('span', title(name), { title: name }));
    box.onchange = () => {
      if (box.checked) this.hidden.delete(name); else this.hidden.add(name);
      this.draw();
    };
    this.legend.append(label);
  }

  draw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.paint(); });
  }

  paint() {
    const { g, width, height } = canvas2d(this.canvas);
    g.clearRect(0, 0, width, height);
    const car = this.car();
    if (this.follow && car) this.centre = { e: car.e, n: car.n };
    this.x = (e) => width / 2 + (e - this.centre.e) * this.scale;
    this.y = (n) => height / 2 - (n - this.centre.n) * this.scale;
    this.paintGrid(g, width, height);
    g.fillStyle = style('--muted');
    for (const fix of this.fixes) g.fillRect(this.x(fix.e) - 1.5, this.y(fix.n) - 1.5, 3, 3);
    for (const name of this.known) if (!this.hidden.has(name)) this.paintTrail(g, name);
    for (const pose of this.frame ? this.frame.poses : []) {
      if (!pose.map || this.hidden.has(pose.name)) continue;
      if (pose.bound) this.paintBound(g, pose.map, pose.bound);
      this.paintMark(g, pose.name, pose.map, pose.name === this.frame.health.judged);
    }
    if (!car) {
      g.fillStyle = style('--muted');
      g.textAlign = 'center';
      g.fillText('No estimate has a place yet', width / 2, height / 2);
    }
  }

  /** The judged estimate's mark, or else any. */
  car() {
    if (!this.frame) return null;
    const placed = this.frame.poses.filter((p) => p.map);
    const judged = placed.find((p) => p.name === this.frame.health.judged);
    return (judged || placed[0] || { map: this.frame.reference }).map || null;
  }

  paintGrid(g, width, height) {
    const wanted = 90 / this.scale;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= wanted);
    g.strokeStyle = style('--grid');
    g.lineWidth = 1;
    g.beginPath();
    const e0 = Math.floor((this.centre.e - width / 2 / this.scale) / step) * step;
    for (let e = e0; this.x(e) < width; e += step) { g.moveTo(this.x(e), 0); g.lineTo(this.x(e), height); }
    const n0 = Math.floor((this.centre.n - height / 2 / this.scale) / step) * step;
    for (let n = n0; this.y(n) > 0; n += step) { g.moveTo(0, this.y(n)); g.lineTo(width, this.y(n)); }
    g.stroke();
    g.fillStyle = g.strokeStyle = style('--muted');
    g.lineWidth = 2;
    g.beginPath();
    g.moveTo(14, height - 14);
    g.lineTo(14 + step * this.scale, height - 14);
    g.stroke();
    g.font = '12px system-ui, sans-serif';
    g.textAlign = 'left';
    g.fillText(step >= 1000 ? `${step / 1000} km` : step >= 1 ? `${step} m` : `${Math.round(step * 100)} cm`, 14, height - 20);
  }

  paintTrail(g, name) {
    const trail = this.trails[name];
    if (!trail) return;
    const until = this.frame ? this.frame.t : Infinity;
    for (const past of [false, true]) {
      g.strokeStyle = colour(name);
      g.globalAlpha = past ? 0.9 : 0.25;
      g.lineWidth = name === 'REFERENCE' ? 4 : 2;
      if (name === 'REFERENCE') g.globalAlpha *= 0.5;
      g.beginPath();
      let last = null;
      for (let i = 0; i < trail.t.length; ++i) {
        if (trail.e[i] == null || (past && trail.t[i] > until)) { last = null; continue; }
        const p = { e: trail.e[i], n: trail.n[i] };
        if (last && Math.hypot(p.e - last.e, p.n - last.n) < JUMP_M) g.lineTo(this.x(p.e), this.y(p.n));
        else g.moveTo(this.x(p.e), this.y(p.n));
        last = p;
      }
      g.stroke();
    }
    g.globalAlpha = 1;
  }

  /** The protection levels: a box along and across the car, red where the pose may not be used. */
  paintBound(g, mark, bound) {
    if (bound.along == null || bound.across == null) return;
    const along = Math.min(1e5, bound.along * this.scale), across = Math.min(1e5, bound.across * this.scale);
    g.save();
    g.translate(this.x(mark.e), this.y(mark.n));
    g.rotate(-mark.yaw);
    g.strokeStyle = style(bound.usable ? '--ok' : '--bad');
    g.lineWidth = 1.5;
    g.setLineDash(bound.usable ? [] : [5, 4]);
    g.strokeRect(-along, -across, 2 * along, 2 * across);
    g.restore();
  }

  paintMark(g, name, mark, judged) {
    const x = this.x(mark.e), y = this.y(mark.n);
    g.strokeStyle = g.fillStyle = colour(name);
    if (mark.major != null && mark.minor != null) {
      g.beginPath();
      g.ellipse(x, y, Math.min(1e5, NINETEEN_OF_TWENTY * mark.major * this.scale), Math.min(1e5, NINETEEN_OF_TWENTY * mark.minor * this.scale), -mark.dir, 0, 2 * Math.PI);
      g.globalAlpha = 0.12;
      g.fill();
      g.globalAlpha = 1;
      g.lineWidth = 1.5;
      g.stroke();
    }
    const size = judged ? 11 : 7;
    g.save();
    g.translate(x, y);
    g.rotate(-mark.yaw);
    g.beginPath();
    g.moveTo(size, 0); g.lineTo(-size * 0.7, size * 0.62); g.lineTo(-size * 0.35, 0); g.lineTo(-size * 0.7, -size * 0.62);
    g.closePath();
    g.fill();
    g.lineWidth = 1.5;
    g.strokeStyle = style('--card');
    g.stroke();
    g.restore();
  }
}
