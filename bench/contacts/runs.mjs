// One timed run of a scene in MuJoCo's WebAssembly build. SPDX-License-Identifier: Apache-2.0
import { pathToFileURL } from "node:url";

/// `module` is the folder of @mujoco/mujoco from npm. MuJoCo's warnings are counted, not printed.
export async function load(module) {
  const factory = (await import(pathToFileURL(`${module}/mujoco.js`).href)).default;
  return factory({ print() {}, printErr() {} });
}

/// "discrete elliptic 100 0.1/hard noslip0 mimic0.1 norefsafe": integrator, cone, impratio, the contacts' time constant
/// (in steps or as 20ms) and impedance, iterations of noslip, the time constant of the mimics (in steps or soft). More
/// words may follow: friction100ms, the time constant of the friction rows, and MuJoCo's flags norefsafe and diagexact.
export function parse(words) {
  const [integrator, cone, impratio, contacts, noslip, mimic, ...rest] = words.split(" ");
  const [contactTime, impedance] = contacts.split("/");
  const friction = rest.find((word) => word.startsWith("friction"))?.replace("friction", "");
  return { integrator, cone, impratio, contactTime, impedance, friction, noslip: noslip.replace("noslip", ""),
    mimic: mimic.replace("mimic", ""), flags: rest.filter((word) => !word.startsWith("friction")) };
}

/// Runs the scene and returns its errors and its cost. The path is kept and judged later, so that only steps are timed:
/// beside them the clock sees a copy of the targets, which are worked out before, and of the state; about 0.1 us.
export function measure(mujoco, scene, setting, hz) {
  const h = 1 / hz, steps = Math.round(scene.seconds * hz);
  const model = mujoco.MjModel.from_xml_string(scene.xml(setting, h));
  const data = new mujoco.MjData(model);
  try {
    const { nq, nv, nu } = model;
    const targets = new Float64Array(steps * nu);
    for (let k = 0; k < steps; ++k) targets.set(scene.targets(k * h), k * nu);
    const qs = new Float64Array(steps * nq).fill(0), vs = new Float64Array(steps * nv).fill(0);  // its pages exist now
    const start = () => {
      mujoco.mj_resetData(model, data);
      scene.start(data.qpos, data.qvel);
    };
    start();
    for (let k = 0; k < 200; ++k) mujoco.mj_step(model, data);  // the first steps of a process are compiled meanwhile
    start();
    const { qpos, qvel, ctrl } = data;  // views, which live while the memory does not grow
    const before = process.cpuUsage();
    for (let k = 0; k < steps; ++k) {
      if (nu) ctrl.set(targets.subarray(k * nu, (k + 1) * nu));
      mujoco.mj_step(model, data);
      qs.set(qpos, k * nq);
      vs.set(qvel, k * nv);
    }
    const used = process.cpuUsage(before);
    if (qpos.length !== nq) throw new Error("the memory has grown during the run; keep no views");
    const seconds = (used.user + used.system) / 1e6;
    const stride = Math.max(1, Math.floor(hz / 480));
    const run = { steps, h, seconds: scene.seconds, stride,
      q: (k) => qs.subarray(k * nq, (k + 1) * nq), v: (k) => vs.subarray(k * nv, (k + 1) * nv),
      index: (t) => Math.max(0, Math.round(t * hz) - 1) };
    const warnings = [];
    for (let i = 0; i < data.warning.size(); ++i) if (data.warning.get(i).number > 0) warnings.push(i);
    // MuJoCo starts a diverged state afresh, with a time of zero, and says so in a warning only.
    const resets = data.time < (steps - 0.5) * h ? countResets() : 0;
    function countResets() {
      let count = 0, time = 0;
      start();
      for (let k = 0; k < steps; ++k) {
        if (nu) data.ctrl.set(targets.subarray(k * nu, (k + 1) * nu));
        mujoco.mj_step(model, data);
        if (data.time < time + 0.5 * h) ++count;
        time = data.time;
      }
      return count;
    }
    const judged = scene.judge(run);
    return { ...judged, held: judged.held && resets === 0, us: (1e6 * seconds) / steps,
      cpu_per_s: seconds / scene.seconds, resets, warnings: warnings.join() };
  } finally {
    data.delete();
    model.delete();
  }
}
