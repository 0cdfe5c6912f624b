// The camera's picture with the points that the tracker follows. A picture is asked for when the last one has come: a slow line shows
// fewer pictures, never older ones.
import { canvas2d, style } from './format.js';

const NEW = 0, MATCHED = 1, INLIER = 2, OUTLIER = 3;

export class CameraView {
  constructor(canvas, empty, hint) {
    this.canvas = canvas;
    this.empty = empty;
    this.hint = hint;
    this.trails = new Map();  // track id -> [[u, v], ...]
    this.loading = false;
    this.wanted = null;
    this.shown = null;
    this.image = null;
    new ResizeObserver(() => this.paint()).observe(canvas.parentElement);
    this.canvas.hidden = true;
  }

  show(frame) {
    const camera = frame.camera;
    this.empty.hidden = Boolean(camera);
    this.hint.hidden = !camera || !camera.features;
    this.canvas.hidden = !camera;
    if (!camera) return;
    const moment = camera.features_of || camera.picture;
    if (moment === this.shown || camera.picture === '0') return;
    this.wanted = { moment, features: camera.features || [] };
    if (!this.loading) this.load();
  }

  load() {
    const { moment, features } = this.wanted;
    this.wanted = null;
    this.loading = true;
    const image = new Image();
    const done = () => {
      this.loading = false;
      if (this.wanted) this.load();
    };
    image.onload = () => {
      this.image = image;
      this.features = features;
      this.shown = moment;
      this.follow(features);
      this.paint();
      done();
    };
    image.onerror = done;
    image.src = `picture?t=${moment}`;
  }

  follow(features) {
    const trails = new Map();
    for (const [id, u, v] of features) {
      const trail = (this.trails.get(id) || []).slice(-8);
      trail.push([u, v]);
      trails.set(id, trail);
    }
    this.trails = trails;
  }

  paint() {
    if (!this.image) return;
    this.canvas.style.aspectRatio = `${this.image.naturalWidth} / ${this.image.naturalHeight}`;
    const { g, width, height } = canvas2d(this.canvas);
    g.drawImage(this.image, 0, 0, width, height);
    const sx = width / this.image.naturalWidth, sy = height / this.image.naturalHeight;
    const colours = { [NEW]: '#b8c0cc', [MATCHED]: '#b8c0cc', [INLIER]: '#3ddc97', [OUTLIER]: '#ff6b6b' };
    g.lineWidth = 1.2;
    for (const [id, u, v, use] of this.features) {
      g.strokeStyle = g.fillStyle = colours[use] || colours[NEW];
      const trail = this.trails.get(id) || [];
      g.beginPath();
      trail.forEach(([a, b], i) => (i === 0 ? g.moveTo(a * sx, b * sy) : g.lineTo(a * sx, b * sy)));
      g.stroke();
      g.beginPath();
      g.arc(u * sx, v * sy, 2.2, 0, 2 * Math.PI);
      g.fill();
    }
  }
}
