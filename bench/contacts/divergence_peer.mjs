// MuJoCo on the scenes in which no two environments do the same. SPDX-License-Identifier: Apache-2.0
//
//   divergence_bench export FOLDER; node --no-liftoff divergence_peer.mjs MODULE FOLDER [seconds]
//
// MODULE is the folder of @mujoco/mujoco from npm, FOLDER has the models. One line of JSON for each scene, motion and
// setting: random targets every 50 ms, others in each of 16 environments; masses and friction are the file's. `us` is
// processor time of a step by the WebAssembly build; a native build needs about 1 / 1.33 of it, which is an estimate.
// `error` is the difference of velocities to the same step with 200 iterations to 1e-14, over 1 + the largest velocity:
// median and 99 %. `depth` is the deepest overlap of the run, m. `resets` counts states that MuJoCo started afresh.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { load } from "./runs.mjs";

const scenes = [["quadruped, feet", "feet.xml", 1 / 240], ["quadruped, all pairs", "all_pairs.xml", 1 / 240],
  ["hand with cube", "hand.xml", 1 / 200]];
/// The solver's iterations and those of its line search, and the cone. The first are MuJoCo's defaults, the last the
/// cheapest that hold: with one iteration states diverge.
const settings = [[100, 50, "pyramidal"], [100, 50, "elliptic"], [5, 8, "pyramidal"]];
const environments = 16, control = 0.05, cycle = 40;

const [folder, files, length] = process.argv.slice(2);
if (!files) {
  console.error("node divergence_peer.mjs MODULE FOLDER [seconds]");
  process.exit(2);
}
const mujoco = await load(folder), seconds = Number(length ?? 4);

/// Numbers between -1 and 1 (Lehmer).
function randoms(seed) {
  let state = seed;
  return () => (state = (48271 * state) % 2147483647) / 1073741823.5 - 1;
}

function run(xml, h, amplitude, [iterations, search, cone]) {
  const model = mujoco.MjModel.from_xml_string(xml), exact = mujoco.MjModel.from_xml_string(xml);
  for (const m of [model, exact]) {
    m.opt.timestep = h;
    m.opt.cone = cone === "elliptic" ? mujoco.mjtCone.mjCONE_ELLIPTIC.value : mujoco.mjtCone.mjCONE_PYRAMIDAL.value;
  }
  model.opt.iterations = iterations, model.opt.ls_iterations = search;
  exact.opt.iterations = 200, exact.opt.ls_iterations = 200, exact.opt.tolerance = 1e-14;
  const all = Array.from({ length: environments }, () => new mujoco.MjData(model)), other = new mujoco.MjData(exact);
  const start = (data) => mujoco.mj_resetDataKeyframe(model, data, 0);
  all.forEach(start);
  const rest = Float64Array.from(all[0].ctrl), random = randoms(7);
  const steps = Math.round(seconds / h), each = Math.round(control / h), errors = [];
  let spent = 0, depth = 0, resets = 0;
  for (let i = 0; i < steps; ++i) {
    if (i % each === 0)
      for (const data of all) for (let k = 0; k < rest.length; ++k) data.ctrl[k] = rest[k] + amplitude * random();
    all.forEach((data, e) => {
      if (amplitude > 0 && i > 0 && i % (cycle * each) === (e * 7919) % (cycle * each)) start(data);
    });
    const checked = all[i % environments], time = checked.time;
    other.qpos.set(checked.qpos), other.qvel.set(checked.qvel), other.ctrl.set(checked.ctrl);
    other.qacc_warmstart.set(checked.qacc_warmstart);
    const before = process.cpuUsage();
    for (const data of all) mujoco.mj_step(model, data);
    const used = process.cpuUsage(before);
    spent += used.user + used.system;
    mujoco.mj_step(exact, other);
    let difference = 0, fastest = 0;
    for (let k = 0; k < model.nv; ++k) {
      difference = Math.max(difference, Math.abs(checked.qvel[k] - other.qvel[k]));
      fastest = Math.max(fastest, Math.abs(other.qvel[k]));
    }
    errors.push(difference / (1 + fastest));
    if (checked.time < time) ++resets;
    for (let c = 0; c < checked.ncon; ++c) depth = Math.max(depth, -checked.contact.get(c).dist);
  }
  errors.sort((a, b) => a - b);
  for (const data of [...all, other]) data.delete();
  model.delete(), exact.delete();
  return { us: spent / steps / environments, error: errors[errors.length >> 1],
    error99: errors[Math.floor(0.99 * errors.length)], depth, resets };
}

for (const [name, file, h] of scenes) {
  const xml = readFileSync(join(files, file), "utf8");
  for (const targets of [0, 0.1, 0.5])
    for (const setting of settings) {
      const found = run(xml, h, targets, setting);
      console.log(JSON.stringify({ scene: name, targets, setting: setting.join(" "), ...found }));
    }
}
