// Going back and forth in a log: frames come in chunks, as they are wanted.
import { canvas2d, clock, duration, style } from './format.js';

const CHUNK = 50;
const KEPT_CHUNKS = 40;

export class Timeline {
  /** `show(frame)` is called with each frame to be shown. */
  constructor(show) {
    this.show = show;
    this.chunks = new Map();
    this.count = 0;
    this.index = 0;
    this.playing = false;
    this.scrub = document.getElementById('scrub');
    this.play = document.getElementById('play');
    this.speed = document.getElementById('speed');
    this.moment = document.getElementById('moment');
    this.verdicts = document.getElementById('verdicts');
    document.getElementById('timeline').hidden = false;
    this.scrub.oninput = () => this.go(Number(this.scrub.value));
    this.play.onclick = () => this.setPlaying(!this.playing);
    new ResizeObserver(() => this.paintVerdicts()).observe(this.verdicts);
    document.addEventListener('keydown', (event) => {
      if (event.target.tagName === 'SELECT' || event.target.tagName === 'BUTTON') return;
      const step = { ArrowLeft: -5, ArrowRight: 5 }[event.key];
      if (event.key === ' ') { event.preventDefault(); this.setPlaying(!this.playing); }
      if (step && event.target !== this.scrub) this.go(this.index + step);
    });
  }

  setCount(count) {
    this.count = count;
    this.scrub.max = Math.max(0, count - 1);
  }

  setHistory(history) {
    this.history = history;
    this.paintVerdicts();
  }

  paintVerdicts() {
    if (!this.history) return;
    const { g, width, height } = canvas2d(this.verdicts);
    const t = this.history.t;
    if (t.length < 2) return;
    const colours = [style('--ok'), style('--degraded'), style('--bad')];
    const x = (ms) => (width * (ms - t[0])) / (t[t.length - 1] - t[0]);
    for (let i = 0; i + 1 < t.length; ++i) {
      g.fillStyle = colours[this.history.verdict[i]];
      g.globalAlpha = 0.55;
      g.clearRect(x(t[i]), 0, width, height);
      g.fillRect(x(t[i]), 0, x(t[i + 1]) - x(t[i]) + 0.5, height);
    }
  }

  setPlaying(on) {
    this.playing = on;
    this.play.innerHTML = on ? '&#10074;&#10074;' : '&#9654;';
    if (on && this.index >= this.count - 1) this.index = 0;
    clearInterval(this.timer);
    if (on) this.timer = setInterval(() => this.tick(), 100);
  }

  /** A tenth of a second; frames are 0.2 s apart (fewer in a very long log). */
  tick() {
    if (this.busy) return;
    this.carry = (this.carry || 0) + 0.5 * Number(this.speed.value);
    const step = Math.floor(this.carry);
    this.carry -= step;
    if (this.index + step >= this.count) this.setPlaying(false);
    if (step > 0) this.go(Math.min(this.count - 1, this.index + step));
  }

  async go(index) {
    this.index = Math.max(0, Math.min(this.count - 1, index));
    this.scrub.value = this.index;
    const wanted = this.index;
    this.busy = true;
    try {
      const frame = await this.frame(wanted);
      if (frame && wanted === this.index) {
        this.first = this.first || (await this.frame(0)).t;
        this.moment.textContent = `${duration((frame.t - this.first) / 1000)} · ${clock(frame.t)}`;
        this.show(frame);
      }
    } finally {
      this.busy = false;
    }
  }

  /** The frame of so many seconds into the drive, by bisection: a very long log keeps fewer frames. */
  async goToSecond(second) {
    const start = (await this.frame(0)).t;
    let low = 0, high = this.count - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if ((await this.frame(middle)).t < start + 1000 * second) low = middle + 1; else high = middle;
    }
    await this.go(low);
  }

  async frame(index) {
    const chunk = Math.floor(index / CHUNK);
    if (!this.chunks.has(chunk)) {
      this.chunks.set(chunk, fetch(`frames?from=${chunk * CHUNK}&count=${CHUNK}`).then((r) => r.json()));
      if (this.chunks.size > KEPT_CHUNKS) this.chunks.delete(this.chunks.keys().next().value);
    }
    return (await this.chunks.get(chunk))[index % CHUNK];
  }
}
