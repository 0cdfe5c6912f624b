// Everything on the page that is words and numbers.
import { clock, colour, describe, duration, element, fixed, metres, title } from './format.js';

const VERDICTS = ['OK to use', 'Degraded: use with care', 'Do not use'];
const VALIDITIES = ['invalid', 'coasting', 'valid'];
const MODES = { constant_acceleration: 'going straight', constant_turn: 'turning' };

const byId = (id) => document.getElementById(id);

export function showVerdict(frame, live) {
  const health = frame.health;
  byId('verdict').dataset.verdict = health.verdict;
  byId('verdict-text').textContent = VERDICTS[health.verdict];
  document.title = `${VERDICTS[health.verdict]} – Roadfix`;
  const since = duration(Math.max(0, (frame.t - health.since) / 1000));
  const day = live && frame.lag > 86400 ? `, a drive of ${Math.round(frame.lag / 86400)} days ago played again` : '';
  byId('verdict-about').textContent = health.judged ? `The verdict on ${describe(health.judged)} (${health.judged}), for ${since}${day}` : 'Nobody says where the car is';
  byId('reasons').replaceChildren(...health.reasons.slice(0, 6).map((r) => element('li', r.text, { class: `v${r.verdict}` })),
    ...(health.reasons.length > 6 ? [element('li', `and ${health.reasons.length - 6} more`)] : []));
  const pose = frame.poses.find((p) => p.name === health.judged);
  const facts = [['Clock, UTC', clock(frame.t), '']];
  if (pose) {
    const valid = VALIDITIES[pose.validity] !== 'invalid';
    const placed = valid && pose.map; // in a local frame alone it has no place and no heading
    const heading = placed && pose.yaw_sigma < 180;
    const sigma = 'one standard deviation: the error is smaller two times out of three';
    facts.unshift(['Place sure to', placed ? `± ${metres(pose.sigma)}` : 'not known', '', sigma], ['Heading sure to', heading ? `± ${fixed(pose.yaw_sigma, 1)}` : 'not known', heading ? '°' : '', sigma],
      ['Speed', valid ? (Math.abs(pose.speed) * 3.6).toFixed(0) : 'not known', valid ? 'km/h' : '']);
    if (valid && pose.bound) {
      const { along, across, up, risk, usable, reason } = pose.bound;
      const size = along == null ? 'without bound' : `${metres(along)} · ${metres(across)} · ${metres(up)}`;
      facts.unshift([usable ? 'Bound: usable' : 'Bound: do not use', size, '', `along, across and up; exceeded once in ${Math.round(1 / risk)} poses${reason ? `. ${reason}` : ''}`]);
    }
    if (valid && pose.err != null) facts.unshift(['Really off by', metres(pose.err), '', 'against the drive’s truth, which a car on the road does not have']);
  }
  byId('facts').replaceChildren(...facts.map(([name, value, unit, words]) => {
    const box = element('div', '', words ? { title: words } : {});
    const number = element('dd', value);
    if (unit) number.append(' ', element('small', unit));
    box.append(element('dt', name), number);
    return box;
  }));
}

export function showFusion(frame) {
  const fusion = frame.fusion;
  byId('modes').parentElement.hidden = !fusion;
  if (!fusion) return;
  const tints = ['#4a7dbf', '#c27c3a', '#7a9a4a'];
  byId('modes').replaceChildren(...fusion.modes.map((mode, i) => {
    const share = Math.round(100 * (mode.p || 0));
    const words = share >= 18 ? `${MODES[mode.name] || mode.name} ${share} %` : '';
    return element('div', words, { style: `width: ${share}%; background: ${tints[i % 3]}`, title: `${mode.name} ${share} %` });
  }));
  byId('weights').replaceChildren(...fusion.channels.map((channel) => {
    const used = channel.age != null && channel.age >= 0 && channel.age < 1;
    const row = element('div', '', { class: 'weight', style: `--colour: ${colour(channel.name)}` });
    const rail = element('div', '', { class: 'rail' });
    rail.append(element('div', '', { style: `width: ${used ? Math.round(100 * channel.weight) : 0}%` }));
    row.title = `weight ${channel.weight}, variance times ${channel.alpha}, NIS ${channel.nis} of at most ${channel.gate}, heard ${channel.age} s ago`;
    const health = HEALTH[channel.health] || 'not used';
    let words = health === 'good' ? `${used ? Math.round(100 * channel.weight) : 0} %` : health;
    if (channel.contradicts) words += `, contradicts ${channel.contradicts.split(' ').map(title).join(' and ')}`;
    row.append(element('span', title(channel.name)), rail, element('span', words));
    return row;
  }));
  const leader = fusion.leader ? title(fusion.leader) : 'nobody';
  const sources = ['There is no pose yet.', 'The fused pose is GNSS + inertial’s.', `The last trusted pose is carried on by ${leader}.`, 'The fused pose is the paper’s scheme’s.'];
  byId('tie').textContent = `${sources[fusion.source] || ''} ${fusion.reason ? `Why: ${fusion.reason}.` : ''}`.trim();
}

const HEALTH = ['silent', 'says it is invalid', 'frozen', 'on trial', 'contradicted', 'good'];

/** A head that begins with '-' is a column that a narrow screen goes without. */
function table(id, heads, rows) {
  const minor = heads.map((h) => h.startsWith('-'));
  const head = element('tr');
  head.append(...heads.map((h, i) => element('th', h.replace(/^-/, ''), minor[i] ? { class: 'minor' } : {})));
  const body = rows.map((cells) => {
    const row = element('tr');
    row.append(...cells.map((c, i) => {
      const cell = c instanceof Node ? c : element('td', Array.isArray(c) ? c[0] : c, Array.isArray(c) && c[1] ? { class: 'warn' } : {});
      if (minor[i]) cell.classList.add('minor');
      return cell;
    }));
    return row;
  });
  byId(id).replaceChildren(head, ...body);
}

function named(name, state, words) {
  const cell = element('td');
  cell.append(element('span', '', { class: `dot ${state}` }), document.createTextNode(name));
  if (words) cell.title = words;
  return cell;
}

/** What a channel or a program is, for who has never seen one. */
const meaning = (name) => element('td', describe(name), { class: 'meaning' });

export function showTables(frame) {
  table('channels', ['Channel', '-what it is', 'per second', 'should be', 'late ms', '-jitter ms', '-silent s', 'lost', 'unreadable'], frame.channels.map((c) => {
    const slow = c.expected != null && c.rate < 0.7 * c.expected;
    const never = c.age == null || c.age < 0;
    return [named(c.name, never || c.silent ? 'warn' : ''), meaning(c.name), [fixed(c.rate, 1), slow], c.expected == null ? 'learning' : fixed(c.expected, c.expected < 10 ? 1 : 0),
      fixed(c.latency, 0), fixed(c.jitter, 1), never ? ['never heard', true] : [fixed(c.age, 1), c.silent], [String(c.lost), false], [String(c.bad), c.bad > 0]];
  }));
  table('processes', ['Program', '-what it does', 'state', 'CPU %', 'MiB', 'waits ms', 'restarts'], frame.processes.map((p) => {
    const fine = p.state === 'running' || p.state === 'starting';
    return [named(p.name, fine ? '' : 'warn', p.reason), meaning(p.name), [p.state, !fine], fixed(p.cpu, 1), fixed(p.mib, 0), fixed(p.waits, 0), [String(p.restarts), p.restarts > 0]];
  }));
  if (frame.processes.length === 0) byId('processes').replaceChildren(element('caption', 'No heartbeat in this log: it was computed at the desk.'));
  table('fits', ['Measurement', 'error / claim', 'used', 'refused'], frame.fits.map((f) => [named(f.source, f.ratio > 5 ? 'warn' : ''), [fixed(f.ratio, 2), f.ratio > 5], String(f.used), [String(f.refused), f.refused > f.used]]));
}

export { VALIDITIES };
