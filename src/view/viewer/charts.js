// Curves over time, below the scene. SPDX-License-Identifier: Apache-2.0
import uPlot from 'uplot';
import { colour_now } from './style.js';

// Okabe and Ito's colours, which most people can tell apart; the yellow is darker, and grey stands for black.
const palette = ['#0072b2', '#e69f00', '#009e73', '#d55e00', '#cc79a7', '#56b4e9', '#9a8f00', '#808890'];
const colour_of = (i) => palette[i % palette.length];
// A tick of an axis, as short as it can be.
const tick_of = (value) => {
  const round = Number(value.toPrecision(4));
  return round !== 0 && Math.abs(round) < 1e-3 ? round.toExponential() : String(round);
};
const number = (value) => (value == null ? '' : value === 0 ? '0' : Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5
  ? value.toExponential(2) : value.toPrecision(4));

// What is drawn of an environment: titles, and the series of each. A follower has the colour of its leader, dashed.
function charts_of(motion, environment) {
  const independent = motion.joints.filter((joint) => joint.leader === undefined);
  const joints = motion.joints.map((joint, i) => {
    const leader = joint.leader === undefined ? joint : motion.joints[joint.leader] ?? joint;
    const own = Math.max(0, independent.indexOf(leader));
    return { label: joint.name, unit: joint.unit, colour: colour_of(own),
      dash: joint.leader === undefined ? [] : [4, 3], values: environment.positions[i] };
  });
  const plain = (names, values, unit) =>
    names.map((label, i) => ({ label, unit, colour: colour_of(i), values: values[i] }));
  const errors = motion.couplings.map(({ name, unit }, i) =>
    ({ label: name, unit, colour: colour_of(i), values: environment.errors[i] }));
  const [kinetic, potential] = environment.energies;
  const total = kinetic.map((value, i) => value + potential[i]);
  return [
    { title: 'joints', note: 'followers dashed, in their leader\'s colour', series: joints },
    { title: 'coupling errors', note: '', series: errors },
    { title: 'contact forces', note: 'normal', series: plain(motion.contacts, environment.forces, 'N') },
    { title: 'energy', note: 'potential: of gravity', series: plain(['kinetic', 'potential', 'sum'],
      [kinetic, potential, total], 'J') },
  ].filter((chart) => chart.series.length > 0);
}

function options_of(chart, width, seek, times) {
  const line = colour_now('--line'), text = colour_now('--faint');
  const units = [...new Set(chart.series.map((series) => series.unit))];
  // uPlot has no range for a curve that is constant.
  const range = (_, low, high) => {
    if (low == null) return [-1, 1];
    const pad = high > low ? 0.05 * (high - low) : Math.max(0.1 * Math.abs(low), 1e-9);
    return [low - pad, high + pad];
  };
  const axis = { stroke: text, font: '11px system-ui, "DejaVu Sans", sans-serif', grid: { stroke: line, width: 1 },
    ticks: { stroke: line, width: 1, size: 4 } };
  return {
    width, height: 150, padding: [6, units.length > 1 ? 0 : 10, 0, 0],
    scales: { x: { time: false }, ...Object.fromEntries(units.map((unit) => [unit, { range }])) },
    axes: [{ ...axis, size: 24, values: (_, ticks) => ticks.map((tick) => `${+tick.toPrecision(6)} s`) },
      ...units.map((unit, i) => ({ ...axis, scale: unit, size: 66, side: i === 0 ? 3 : 1, gap: 2,
        grid: { ...axis.grid, show: i === 0 },
        values: (_, ticks) => ticks.map((tick) => `${tick_of(tick)} ${unit}`) }))],
    series: [{ label: 'time', value: (_, value) => (value == null ? '' : `${value.toFixed(3)} s`) },
      ...chart.series.map((series) => ({ label: series.label, scale: series.unit, stroke: series.colour,
        dash: series.dash, width: 1.5, points: { show: false }, value: (_, value) => number(value) }))],
    cursor: { y: false, drag: { x: false, y: false }, sync: { key: 'time' }, points: { size: 5 } },
    legend: { live: true },
    hooks: {
      ready: [(plot) => {
        const to = (event) => {
          const left = event.clientX - plot.over.getBoundingClientRect().left;
          seek(Math.min(Math.max(plot.posToVal(left, 'x'), times[0]), times.at(-1)));
        };
        plot.over.addEventListener('pointerdown', (event) => {
          plot.over.setPointerCapture(event.pointerId);
          to(event);
        });
        plot.over.addEventListener('pointermove', (event) => event.buttons === 1 && to(event));
      }],
    },
  };
}

export class Charts {
  // `seek` is called with the time that is clicked.
  constructor(place, motion, seek) {
    this.place = place;
    this.motion = motion;
    this.seek = seek;
    this.plots = [];
    this.environment = 0;
  }

  show(environment = this.environment) {
    this.environment = environment;
    this.row = undefined;  // new legends hold no numbers yet
    this.plots.forEach(({ plot }) => plot.destroy());
    this.place.replaceChildren();
    const charts = charts_of(this.motion, this.motion.environments[environment]);
    this.plots = charts.map((chart) => {
      const figure = document.createElement('figure'), caption = document.createElement('figcaption');
      caption.append(chart.title, ' ', Object.assign(document.createElement('small'), { textContent: chart.note }));
      figure.append(caption);
      this.place.append(figure);
      return { chart, figure };
    }).map(({ chart, figure }) => {
      const data = [this.motion.times, ...chart.series.map((series) => series.values)];
      const plot = new uPlot(options_of(chart, figure.clientWidth, this.seek, this.motion.times), data, figure);
      const now = Object.assign(document.createElement('div'), { className: 'now' });
      plot.over.append(now);
      return { plot, figure, now };
    });
  }

  resize() {
    for (const { plot, figure } of this.plots)
      if (plot.width !== figure.clientWidth) plot.setSize({ width: figure.clientWidth, height: 150 });
  }

  // The line at the present time, and the legend's numbers where no pointer asks for others.
  draw(time, row) {
    for (const { plot, now } of this.plots) {
      now.style.transform = `translateX(${plot.valToPos(time, 'x')}px)`;
      if (row !== this.row && !(plot.cursor.left >= 0)) plot.setLegend({ idx: row }, false);
    }
    this.row = row;
  }
}
