// What the programs share that run a learned policy in MuJoCo. SPDX-License-Identifier: Apache-2.0
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

/// `module` is the folder of @mujoco/mujoco from npm.
export async function load(module) {
  return (await import(pathToFileURL(`${module}/mujoco.js`).href)).default({ print() {}, printErr() {} });
}

let state = 12345;
/// Numbers between low and high (Lehmer).
export function between(low, high) {
  state = (48271 * state) % 2147483647;
  return low + ((high - low) * state) / 2147483647;
}

/// The function of a policy's file: means of actions, -1 to 1, of what is seen.
export function policy(file) {
  const { layers } = JSON.parse(readFileSync(file, "utf8"));
  return (seen) => layers.reduce((x, { weight, bias }, layer) => {
    const y = weight.map((row, i) => row.reduce((sum, w, j) => sum + w * x[j], bias[i]));
    return y.map(layer + 1 < layers.length ? Math.tanh : (a) => Math.min(1, Math.max(-1, a)));
  }, seen);
}

/// v in the axes of a body with this quaternion.
export function inBody([w, a, b, c], [x, y, z]) {
  return [[1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b)],
    [2 * (a * b - w * c), 1 - 2 * (a * a + c * c), 2 * (b * c + w * a)],
    [2 * (a * c + w * b), 2 * (b * c - w * a), 1 - 2 * (a * a + b * b)]].map(([i, j, k]) => i * x + j * y + k * z);
}

/// The sum of normal forces between each geom and the other one, N.
export function normalForces(mujoco, model, data, geoms, other) {
  const sums = geoms.map(() => 0), force = new mujoco.DoubleBuffer(6);
  for (let c = 0; c < data.ncon; ++c) {
    const { geom1, geom2 } = data.contact.get(c), own = geoms.indexOf(geom1 === other ? geom2 : geom1);
    if (own < 0 || (geom1 !== other && geom2 !== other)) continue;
    mujoco.mj_contactForce(model, data, c, force);
    sums[own] += force.GetView()[0];
  }
  force.delete();
  return sums;
}

/// Calls of `step` a second of processor time; the first ones are compiled meanwhile.
export function rate(step, count) {
  for (let i = 0; i < count / 10; ++i) step();
  const begin = process.cpuUsage();
  for (let i = 0; i < count; ++i) step();
  const used = process.cpuUsage(begin);
  return Math.round((count / (used.user + used.system)) * 1e6);
}
