// The page: live it follows the stream of frames; over a log it goes where the slider says.
import { CameraView } from './camera.js';
import { ErrorChart } from './chart.js';
import { MapView } from './map.js';
import { showFusion, showTables, showVerdict } from './tables.js';
import { Timeline } from './timeline.js';

const byId = (id) => document.getElementById(id);

// For whoever measures the page: when it first showed something.
new PerformanceObserver((list) => {
  const paint = list.getEntriesByName('first-contentful-paint')[0];
  if (paint) document.documentElement.dataset.firstPaintMs = paint.startTime.toFixed(0);
}).observe({ type: 'paint', buffered: true });

const map = new MapView(byId('map'), byId('legend'));
const camera = new CameraView(byId('camera'), byId('camera-empty'), byId('camera-hint'));
const chart = new ErrorChart(byId('errors'), byId('errors-title'), byId('errors-hint'));

function show(frame, live) {
  showVerdict(frame, live);
  showFusion(frame);
  showTables(frame);
  map.show(frame, live);
  camera.show(frame);
  document.documentElement.dataset.shown = frame.t;
}

function say(words) {
  byId('connection').textContent = words;
  byId('connection').hidden = !words;
}

async function history() {
  const all = await (await fetch('history')).json();
  map.setHistory(all);
  chart.setHistory(all);
  return all;
}

async function live() {
  await history();
  let last = Date.now();
  const stream = new EventSource('live');
  stream.onmessage = (event) => {
    last = Date.now();
    say('');
    const frame = JSON.parse(event.data);
    show(frame, true);
    chart.append(frame);
  };
  stream.onerror = () => say('The monitor does not answer. This page goes on when it is back.');
  setInterval(() => { if (Date.now() - last > 3000) say('The monitor sends nothing: what you see is old.'); }, 1000);
}

async function log(about) {
  const timeline = new Timeline((frame) => {
    show(frame, false);
    chart.setMoment(frame.t);
  });
  timeline.setCount(about.frames);
  const at = Number(new URLSearchParams(location.search).get('at'));  // ?at=45: seconds into the drive
  while (about.done < 1) {
    say(`Reading ${about.name}: ${Math.round(100 * about.done)} %`);
    await new Promise((done) => setTimeout(done, 300));
    about = await (await fetch('about')).json();
  }
  say('');
  timeline.setCount(about.frames);
  timeline.setHistory(await history());
  await timeline.goToSecond(at > 0 ? at : 0);
}

const about = await (await fetch('about')).json();
if (about.mode === 'log') await log(about); else await live();
