// How a walker that learned in lockstep fares in MuJoCo, and what its steps cost. SPDX-License-Identifier: Apache-2.0
//
//   node --no-liftoff walk_mujoco.mjs MODULE agent.json [starts]
//
// MODULE is the folder of @mujoco/mujoco from npm; agent.json is what walk.py writes. Starts, noise, pushes, masses and
// frictions are drawn as in walk.py, by other random numbers. One line of JSON goes to stdout: the share that fell, the
// share near the command without a fall, the mean speed and the mean error, and control steps a second of
// processor time with random actions. A native build makes about 1.33 times as many, which is an estimate.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [module, agentFile, starts = 64] = process.argv.slice(2);
if (!agentFile) {
  console.error("node --no-liftoff walk_mujoco.mjs MODULE agent.json [starts]");
  process.exit(2);
}
const agent = JSON.parse(readFileSync(agentFile, "utf8"));
const mujoco = await (await import(pathToFileURL(`${module}/mujoco.js`).href)).default();
const model = mujoco.MjModel.from_xml_string(agent.xml), data = new mujoco.MjData(model);
model.opt.timestep = agent.dt;
const control = agent.dt * agent.substeps;
const masses = Float64Array.from(model.body_mass), inertias = Float64Array.from(model.body_inertia);
const frictions = Float64Array.from(model.geom_friction);
const trunk = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM.value, "trunk");

let state = 12345;
const random = () => (state = (48271 * state) % 2147483647) / 2147483647;  // Lehmer
const between = (low, high) => low + (high - low) * random();

/// v in the axes of the trunk, whose quaternion is q[3..6].
function inTrunk(q, [x, y, z]) {
  const [w, a, b, c] = q.subarray(3, 7);
  const row = [[1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b)],
    [2 * (a * b - w * c), 1 - 2 * (a * a + c * c), 2 * (b * c + w * a)],
    [2 * (a * c + w * b), 2 * (b * c - w * a), 1 - 2 * (a * a + b * b)]];
  return row.map(([i, j, k]) => i * x + j * y + k * z);
}

function start() {
  const mass = masses.map(() => between(0.9, 1.1)), friction = between(0.6, 1.4);
  model.body_mass.set(masses.map((m, i) => m * mass[i]));
  model.body_inertia.set(inertias.map((m, i) => m * mass[Math.floor(i / 3)]));
  model.geom_friction.set(frictions.map((f) => f * friction));
  mujoco.mj_setConst(model, data);
  mujoco.mj_resetDataKeyframe(model, data, 0);
  const yaw = between(-Math.PI, Math.PI);
  data.qpos.set([Math.cos(yaw / 2), 0, 0, Math.sin(yaw / 2)], 3);
  for (let j = 0; j < 12; ++j) data.qpos[7 + j] += between(-0.1, 0.1), data.qvel[6 + j] = between(-0.5, 0.5);
  for (let j = 0; j < 6; ++j) data.qvel[j] = between(-0.3, 0.3);
  mujoco.mj_forward(model, data);
}

/// What the policy sees: the terms of the group "policy" of walk.py, in their order.
function observe(actions, step) {
  const q = data.qpos, v = data.qvel, noise = (size) => between(-size, size);
  const twist = [...v.subarray(3, 6), ...inTrunk(q, v.subarray(0, 3))];
  const angle = (2 * Math.PI * step * control) / agent.period;
  return [...inTrunk(q, [0, 0, -1]).map((x) => x + noise(0.05)), ...twist.map((x) => x + noise(0.1)),
    ...agent.home.map((home, j) => q[7 + j] - home + noise(0.02)),
    ...agent.home.map((_, j) => 0.1 * (v[6 + j] + noise(1))), ...actions, agent.command, Math.sin(angle),
    Math.cos(angle)];
}

const act = (seen) => agent.layers.reduce((x, { weight, bias }, layer) => {
  const y = weight.map((row, i) => row.reduce((sum, w, j) => sum + w * x[j], bias[i]));
  return layer + 1 < agent.layers.length ? y.map(Math.tanh) : y.map((a) => Math.min(1, Math.max(-1, a)));
}, seen);

function step(actions) {
  data.ctrl.set(actions.map((a, j) => agent.home[j] + agent.scale * a));
  for (let i = 0; i < agent.substeps; ++i) mujoco.mj_step(model, data);
}

function fallen() {
  if (inTrunk(data.qpos, [0, 0, -1])[2] > -0.5) return true;
  for (let c = 0; c < data.ncon; ++c) {
    const { geom1, geom2 } = data.contact.get(c);
    if (geom1 === trunk || geom2 === trunk) return true;
  }
  return false;
}

let falls = 0, good = 0, sum = 0, errors = 0;
for (let run = 0; run < starts; ++run) {
  start();
  let actions = new Array(12).fill(0), speed = 0, fell = false, due = between(5, 10);
  for (let k = 0; k < agent.episode && !fell; ++k) {
    if (k * control >= due) {
      for (const axis of [0, 1]) data.qvel[axis] += between(-0.5, 0.5);
      due += between(5, 10);
    }
    step(actions = act(observe(actions, k)));
    fell = fallen();
    if (k >= agent.settled) speed += inTrunk(data.qpos, data.qvel.subarray(0, 3))[0];
  }
  speed /= agent.episode - agent.settled;
  falls += fell;
  if (!fell) sum += speed, errors += Math.abs(speed - agent.command);
  good += !fell && Math.abs(speed - agent.command) < agent.near;
}

start();
const randomly = 3000;
let begin;
for (let k = -300; k < randomly; ++k) {  // the first ones are compiled meanwhile
  if (k === 0) begin = process.cpuUsage();
  step(agent.home.map(() => between(-1, 1)));
  if (fallen()) start();
}
const used = process.cpuUsage(begin);
const upright = Math.max(1, starts - falls);
console.log(JSON.stringify({ starts: Number(starts), fell: falls / starts, success: good / starts, speed: sum / upright,
  error: errors / upright, random_steps_per_s: Math.round((randomly / (used.user + used.system)) * 1e6) }));
