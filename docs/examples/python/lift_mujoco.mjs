// How the policy that learned to lift in lockstep fares in MuJoCo, and what MuJoCo's steps cost.
// SPDX-License-Identifier: Apache-2.0
//
//   node --no-liftoff lift_mujoco.mjs MODULE lift-1.json [episodes]
//
// MODULE is the folder of @mujoco/mujoco from npm; lift-1.json is what lift.py writes. Places, masses and frictions are
// drawn as in lift.py, by other random numbers. One line of JSON for each size: the share of episodes in which the cube
// was held, and control steps a second of processor time with random actions, without the policy's own time. A native
// build makes about 1.33 times as many, which is an estimate.
import { readFileSync } from "node:fs";
import { between, inBody, load, normalForces, policy, rate } from "./mujoco_policy.mjs";

const [module, file, episodes = 25] = process.argv.slice(2);
if (!file) {
  console.error("node --no-liftoff lift_mujoco.mjs MODULE lift-1.json [episodes]");
  process.exit(2);
}
const mujoco = await load(module), act = policy(file);
const arm = readFileSync(new URL("models/arm.xml", import.meta.url), "utf8");
const controlSteps = 100, substeps = 8, step = [0.02, 0.02, 0.02, 0.2];
const low = [0.28, -0.18, 0.03], high = [0.5, 0.18, 0.25];
const clip = (x, a, b) => Math.min(b, Math.max(a, x));

/// The five joints with the hand at this place, its fingers down: lengths are those of arm.xml.
function inverseKinematics([x, y, z, angle]) {
  const yaw = Math.atan2(y, x), across = Math.hypot(x, y), up = z + 0.22 - 0.3, square = across ** 2 + up ** 2;
  const elbow = Math.acos(clip((square - 0.3 ** 2 - 0.26 ** 2) / (2 * 0.3 * 0.26), -1, 1));
  const shoulder = Math.atan2(across, up) - Math.atan2(0.26 * Math.sin(elbow), 0.3 + 0.26 * Math.cos(elbow));
  const roll = yaw - angle, turns = Math.round(roll / (2 * Math.PI));
  return [yaw, shoulder, elbow, Math.PI - shoulder - elbow, roll - 2 * Math.PI * turns];
}

function run(size) {
  const half = size / 2;
  const xml = arm.replace('size="0.02 0.02 0.02" mass="0.1"', `size="${half} ${half} ${half}" mass="0.1"`);
  const model = mujoco.MjModel.from_xml_string(xml), data = new mujoco.MjData(model);
  const geom = (name) => mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM.value, name);
  const cubeGeom = geom("cube"), pads = [geom("left_pad"), geom("right_pad")];
  const inertia = Float64Array.from(model.body_inertia), body = model.nbody - 1;
  let hand, held;

  function start() {
    const mass = Math.exp(between(Math.log(0.03), Math.log(0.3))), friction = between(0.5, 1);
    model.body_mass[body] = mass;
    for (let k = 3 * body; k < 3 * body + 3; ++k) model.body_inertia[k] = (inertia[k] * mass) / 0.1;
    for (let pair = 0; pair < 4; ++pair)  // those of the cube
      model.pair_friction.fill(friction, 5 * pair, 5 * pair + 2);
    mujoco.mj_setConst(model, data);
    mujoco.mj_resetDataKeyframe(model, data, 0);
    for (let j = 0; j < 5; ++j) data.qpos[j] += between(-0.03, 0.03);
    const turn = between(-Math.PI, Math.PI) / 2;
    data.qpos.set([0.4 + between(-0.1, 0.1), between(-0.15, 0.15), half, Math.cos(turn), 0, 0, Math.sin(turn)], 9);
    mujoco.mj_forward(model, data);
    hand = [...data.site_xpos, data.qpos[0] - data.qpos[4]], held = 0;
  }

  const cube = () => [...data.qpos.subarray(9, 12), 2 * Math.atan2(data.qpos[15], data.qpos[12])];

  /// What the policy sees: as Lift.observe() of lift.py.
  function observe() {
    const forces = normalForces(mujoco, model, data, pads, cubeGeom);  // first: views may end when memory grows
    const place = cube(), at = [...data.site_xpos], turn = 4 * (place[3] - hand[3]), v = data.qvel;
    return [...at.map((x, i) => 10 * (place[i] - x)), ...at.map((x, i) => 20 * (hand[i] - x)), Math.cos(turn),
      Math.sin(turn), 5 * at[2], 5 * (place[2] - half), ...v.subarray(12, 15),
      ...inBody(data.qpos.subarray(12, 16), v.subarray(9, 12)), 2 * data.qpos[5],
      ...forces.map((f) => Math.min(f / 20, 1)), 20 * size];
  }

  /// As Lift.reach() and Lift.advance().
  function advance(actions) {
    const place = cube(), way = hand.map((x, i) => place[i] - x), quarter = Math.PI / 2;
    if (Math.max(Math.abs(way[0]), Math.abs(way[1])) > 0.015) way[2] += 0.08;
    way[3] -= quarter * Math.round(way[3] / quarter);
    hand = hand.map((x, i) => x + clip(way[i], -step[i] / 2, step[i] / 2) + step[i] * actions[i]);
    for (let i = 0; i < 3; ++i) hand[i] = clip(hand[i], low[i], high[i]);
    data.ctrl.set([...inverseKinematics(hand), 0.365 * (1 + actions[4])]);
    for (let k = 0; k < substeps; ++k) mujoco.mj_step(model, data);
    held = data.qpos[11] - half > 0.1 ? held + 1 : 0;
  }

  let successes = 0;
  for (let episode = 0; episode < episodes; ++episode) {
    start();
    for (let k = 0; k < controlSteps; ++k) advance(act(observe()));
    successes += held >= 25;
  }
  let count = 0;
  const randomRate = rate(() => {
    if (count++ % controlSteps === 0) start();
    advance(step.concat(0).map(() => between(-1, 1)));
  }, 2000);
  data.delete(), model.delete();
  return { cube: size, held: successes / episodes, control_steps_per_s: randomRate };
}

for (const size of [0.03, 0.04, 0.05]) console.log(JSON.stringify(run(size)));
