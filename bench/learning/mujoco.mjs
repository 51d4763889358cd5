// Steps an MJCF file in MuJoCo's WebAssembly build with random targets. SPDX-License-Identifier: Apache-2.0
//
//   node mujoco.mjs MODULE model.xml targets.json STEPS
//
// MODULE is the folder of @mujoco/mujoco from npm. targets.json has rows of targets, one for every 8 steps, used in turn.
// Prints seconds of processor time a step, the largest error of a coupling, and whether MuJoCo has reset a diverged state.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [module, file, targetsFile, count] = process.argv.slice(2);
const load = (await import(pathToFileURL(`${module}/mujoco.js`).href)).default;
const mujoco = await load();
const model = mujoco.MjModel.from_xml_string(readFileSync(file, "utf8"));
const data = new mujoco.MjData(model);
const targets = JSON.parse(readFileSync(targetsFile, "utf8"));
const steps = Number(count);
let worst = 0;
const couplings = JSON.parse(readFileSync(`${file}.couplings.json`, "utf8")); // [follower, leader, ratio, offset]
let start;
for (let step = -1000; step < steps; ++step) {  // the first ones are compiled meanwhile
  if (step === 0) start = process.cpuUsage();
  if (step % 8 === 0) data.ctrl.set(targets[((step + 1000) / 8) % targets.length]);
  mujoco.mj_step(model, data);
  if (step > 0 && step % 64 === 63)
    for (const [follower, leader, ratio, offset] of couplings)
      worst = Math.max(worst, Math.abs(data.qpos[follower] + ratio * data.qpos[leader] + offset));
}
const used = process.cpuUsage(start);
console.log(JSON.stringify({ seconds: (used.user + used.system) / 1e6 / steps, error: worst, reset: data.time < 0.99 * (steps + 1000) * model.opt.timestep }));
