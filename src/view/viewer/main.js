// The page: clock, controls and keys, and what they move. SPDX-License-Identifier: Apache-2.0
import { decode, sample_at } from './motion.js';
import { Charts } from './charts.js';
import { arrow_colour } from './arrows.js';
import { Pictures } from './pictures.js';
import { Scene, roles } from './scene.js';

const get = (id) => document.getElementById(id);
const motion = decode(get('motion').textContent);
const start = motion.times[0], end = motion.times.at(-1);
let time = start, playing = false, drawn_at = 0, selected = 0, wanted = true;

// A browser without WebGL still shows the curves.
let scene = null;
try {
  scene = new Scene(document.querySelector('canvas'), motion);
} catch (error) {
  get('about').textContent = `no picture: ${error.message}`;
}
const charts = new Charts(get('charts'), motion, seek);

function seek(to) {
  time = Math.min(Math.max(to, start), end);
  wanted = true;
}

function play(on = !playing) {
  if (on && time >= end) time = start;
  playing = on;
  drawn_at = performance.now();
  get('play').textContent = on ? 'Pause' : 'Play';
  wanted = true;
}

// To the sample `steps` on.
function step(steps) {
  play(false);
  const { nearest } = sample_at(motion.times, time);
  seek(motion.times[Math.min(Math.max(nearest + steps, 0), motion.samples - 1)]);
}

function select(environment) {
  selected = environment;
  [...get('labels').children].forEach((label, i) => label.setAttribute('aria-pressed', i === selected));
  charts.show(selected);
  wanted = true;
}

function draw() {
  scene?.draw(time);
  charts.draw(time, sample_at(motion.times, time).nearest);
  get('scrub').value = time;
  get('time').textContent = `${time.toFixed(3)} / ${end.toFixed(3)} s`;
  motion.environments.forEach(({ label, faults }, i) => {
    const fault = faults.find((one) => time >= one.time && !(time >= one.until));
    const text = fault ? `${label}: ${fault.name} at ${fault.time.toFixed(3)} s, frozen` : label;
    const button = get('labels').children[i];
    if (button.textContent !== text) button.textContent = text;
    button.classList.toggle('faulted', fault !== undefined);
  });
}

// Advances the clock by what the last frame took, and draws if there is something new to see.
function frame(now) {
  if (playing) {
    time += (get('speed').value * (now - drawn_at)) / 1000;
    drawn_at = now;
    if (time >= end) get('loop').checked ? (time = start) : ((time = end), play(false));
  }
  if (playing || wanted) {
    const before = performance.now();
    wanted = false;
    draw();
    page.script_ms = performance.now() - before;
  }
  requestAnimationFrame(frame);
}

function pictures(width, height) {
  return new Pictures(scene, motion, width, height);
}

function resize() {
  scene?.resize();
  const views = scene ? scene.viewports() : [];
  [...get('labels').children].forEach((label, i) => {
    label.hidden = !views[i];
    if (!views[i]) return;
    label.style.left = `${views[i].x + 8}px`;
    label.style.top = `${views[i].y + (views[i].y === 0 ? 50 : 8)}px`;
  });
  charts.resize();
  wanted = true;
}

document.title = `${motion.model}: lockstep view`;
document.querySelector('h1').textContent = motion.model;
if (scene) get('about').textContent = [motion.about, `grid ${+scene.spacing.toPrecision(1)} m`].join(' · ');
const used = new Set(motion.links.map((link) => link.role));
function legend(colour, words) {
  const entry = document.createElement('li'), patch = document.createElement('i');
  patch.style.background = colour;
  entry.append(patch, words);
  get('roles').append(entry);
}
for (const [role, { words, colour }] of Object.entries(roles)) if (used.has(role)) legend(colour, words);
if (scene?.arrows.largest > 0) legend(arrow_colour, `contact force, up to ${scene.arrows.largest.toPrecision(3)} N`);
const note = (text) => get('roles').append(Object.assign(document.createElement('li'), { textContent: text }));
if (motion.links.some((link) => link.solids.some((solid) => solid.inertia))) note('pale: shape of the inertia');
if (scene?.follows) note('the view follows the links');
for (const text of motion.notes) note(text);

motion.environments.forEach(({ label }, i) => {
  const button = Object.assign(document.createElement('button'), { textContent: label, title: 'Shows its curves' });
  button.addEventListener('click', () => select(i));
  get('labels').append(button);
});
get('scrub').min = start;
get('scrub').max = end;
get('scrub').addEventListener('input', (event) => seek(+event.target.value));
get('play').addEventListener('click', () => play());
scene?.controls.addEventListener('change', () => (wanted = true));

const speed = get('speed');
const faster = (by) => {
  speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + by, 0), speed.options.length - 1);
};
const keys = {
  ' ': () => play(),
  ArrowLeft: (event) => step(event.shiftKey ? -10 : -1),
  ArrowRight: (event) => step(event.shiftKey ? 10 : 1),
  ArrowUp: () => faster(1),
  ArrowDown: () => faster(-1),
  Home: () => seek(start),
  End: () => seek(end),
  r: () => scene?.reset_camera(),
};
// Before the element that has the focus sees it: space would press a button, too.
window.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
  event.preventDefault();
  event.stopPropagation();
  keys[event.key](event);
  wanted = true;
}, true);
window.addEventListener('keyup', (event) => event.key === ' ' && event.preventDefault(), true);
window.addEventListener('resize', resize);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
  scene?.dress();
  charts.show();
  wanted = true;
});

// For scripts that steer the page, such as its test. `script_ms` is what drawing the last frame took.
const page = { seek, play, select, draw, pictures, script_ms: 0, get time() { return time; }, get playing() { return playing; } };
window.lockstep = page;
select(0);
resize();
new ResizeObserver(resize).observe(get('scene'));
requestAnimationFrame(frame);
