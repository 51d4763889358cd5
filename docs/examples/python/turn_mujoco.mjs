// How the policy that learned to turn a cube in lockstep fares in MuJoCo, and what MuJoCo's steps cost.
// SPDX-License-Identifier: Apache-2.0
//
//   node --no-liftoff turn_mujoco.mjs MODULE turn-1.json [episodes]
//
// MODULE is the folder of @mujoco/mujoco from npm; turn-1.json is what turn.py writes. Places, masses and frictions are
// drawn as in turn.py, by other random numbers. One line of JSON: the mean speed about the vertical in rad/s, the
// share of episodes in which it was dropped, and control steps a second of processor time with random actions, without
// the policy's own time. A native build makes about 1.33 times as many, which is an estimate.
import { readFileSync } from "node:fs";
import { between, inBody, load, normalForces, policy, rate } from "./mujoco_policy.mjs";

const [module, file, episodes = 10] = process.argv.slice(2);
if (!file) {
  console.error("node --no-liftoff turn_mujoco.mjs MODULE turn-1.json [episodes]");
  process.exit(2);
}
const mujoco = await load(module), act = policy(file), controlSteps = 250, substeps = 8, dt = 0.005;
const model = mujoco.MjModel.from_xml_string(readFileSync(new URL("models/hand.xml", import.meta.url), "utf8"));
const data = new mujoco.MjData(model), fingers = ["index", "middle", "ring", "thumb"];
const geom = (name) => mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM.value, name), cube = geom("cube");
const links = fingers.flatMap((name) => [1, 2, 3].map((i) => geom(`${name}_${i}`)));
// Actions come joint by joint, then the tendons; the file's servos come finger by finger.
const order = [0, 1, 3, 4, 6, 7, 9, 10, 2, 5, 8, 11];
const ranges = order.map((servo) => [[-0.3, 0.3], [-0.2, 1.7], [-0.2, 2.6]][servo % 3]);
const inertia = Float64Array.from(model.body_inertia), body = model.nbody - 1;
let targets;

function start() {
  const mass = Math.exp(between(Math.log(0.05), Math.log(0.2)));
  model.body_mass[body] = mass;
  for (let k = 3 * body; k < 3 * body + 3; ++k) model.body_inertia[k] = (inertia[k] * mass) / 0.1;
  const friction = between(0.5, 1);
  for (let pair = 0; pair < model.npair; ++pair) model.pair_friction.fill(friction, 5 * pair, 5 * pair + 2);
  mujoco.mj_setConst(model, data);
  mujoco.mj_resetDataKeyframe(model, data, 0);
  for (let j = 0; j < 16; ++j) data.qpos[j] += between(-0.03, 0.03);
  const turn = between(-0.3, 0.3) / 2;
  data.qpos.set([between(-0.003, 0.003), between(-0.003, 0.003), 0.04, Math.cos(turn), 0, 0, Math.sin(turn)], 16);
  mujoco.mj_forward(model, data);
  targets = order.map((servo) => data.ctrl[servo]);
}

const angle = () => 2 * Math.atan2(data.qpos[22], data.qpos[19]);
const upright = () => 1 - 2 * (data.qpos[20] ** 2 + data.qpos[21] ** 2);

/// What the policy sees: the terms of turn.py, in their order.
function observe() {
  const forces = normalForces(mujoco, model, data, links, cube);  // first: views may end when memory grows
  const q = data.qpos, v = data.qvel, turn = 4 * angle(), clip = (x, a, b) => Math.min(b, Math.max(a, x));
  return [...[...q.subarray(0, 16)].map((x) => 2 * x), ...[...v.subarray(0, 16)].map((x) => 0.1 * x),
    ...targets.map((x) => 2 * x), 30 * (q[16] + 0.005), 30 * q[17], 30 * (q[18] - 0.04), Math.cos(turn), Math.sin(turn),
    upright(), 2 * q[20], 2 * q[21],
    ...[...v.subarray(19, 22), ...inBody(q.subarray(19, 23), v.subarray(16, 19))].map((x) => 0.3 * clip(x, -5, 5)),
    ...forces.map((f) => 0.1 * clip(f, 0, 20))];
}

/// Returns the angle by which the cube has turned.
function advance(actions) {
  const before = angle();
  targets = targets.map((x, i) => {
    const [low, high] = ranges[i];
    return Math.min(high, Math.max(low, x + 0.05 * (high - low) * actions[i]));
  });
  order.forEach((servo, i) => { data.ctrl[servo] = targets[i]; });
  for (let k = 0; k < substeps; ++k) mujoco.mj_step(model, data);
  const turned = angle() - before;
  return turned - 2 * Math.PI * Math.round(turned / (2 * Math.PI));
}

const dropped = () => Math.abs(data.qpos[16] + 0.005) > 0.04 || Math.abs(data.qpos[17]) > 0.04 ||
  Math.abs(data.qpos[18] - 0.05) > 0.03 || upright() < 0.8;

let sum = 0, drops = 0;
for (let episode = 0; episode < episodes; ++episode) {
  start();
  for (let k = 0; k < controlSteps; ++k) {
    sum += advance(act(observe()));
    if (dropped()) {
      ++drops;
      break;
    }
  }
}
let count = 0;
const randomRate = rate(() => {
  if (count++ % controlSteps === 0 || dropped()) start();
  advance(order.map(() => between(-1, 1)));
}, 1000);
console.log(JSON.stringify({ rad_per_s: sum / (episodes * controlSteps * substeps * dt), dropped: drops / episodes,
  control_steps_per_s: randomRate }));
