// The motion that was written into the page. SPDX-License-Identifier: Apache-2.0

// From the JSON of the page: what src/view/page.h describes.
export function decode(json) {
  const motion = JSON.parse(json);
  fill(motion, motion.numbers);
  delete motion.numbers;
  return motion;
}

// What base64 stands for.
export const buffer_of = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;

// Gives the motion these numbers, in base64, as views into one array, without copies.
export function fill(motion, text) {
  const numbers = new Float32Array(buffer_of(text));
  let at = 0;
  const take = (count) => numbers.subarray(at, (at += count));
  const rows = motion.samples;
  const series = (names) => names.map(() => take(rows));
  motion.times = take(rows);
  for (const environment of motion.environments) {
    environment.poses = take(rows * motion.links.length * 7);
    environment.pushes = take(rows * motion.contacts.length * 6);
    environment.positions = series(motion.joints);
    environment.errors = series(motion.couplings);
    environment.forces = series(motion.contacts);
    environment.energies = series(['kinetic', 'potential']);
  }
  if (at !== numbers.length) throw new Error(`the page holds ${numbers.length} numbers, its description ${at}`);
}

// The sample before the time and how far on the way to the next one it is, in [0, 1); and the nearest sample.
export function sample_at(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle - 1;
  }
  const next = Math.min(low + 1, times.length - 1), span = times[next] - times[low];
  const share = span > 0 ? Math.min(Math.max((time - times[low]) / span, 0), 1) : 0;
  return { row: low, share, nearest: share > 0.5 ? next : low };
}
