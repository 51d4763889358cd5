// The motion of an MJCF file in MuJoCo, from its first keyframe. SPDX-License-Identifier: Apache-2.0
//   node motion.mjs FOLDER/node_modules/mujoco-js model.xml SECONDS
// Steps by the fourth-order Runge-Kutta method and prints the positions every 10 ms, one row a line.
import fs from 'fs';
import path from 'path';

const [library, file, seconds] = process.argv.slice(2);
const mj = await (await import(path.resolve(library, 'dist/mujoco_wasm.js'))).default();
mj.FS.writeFile('/model.xml', fs.readFileSync(file));
const m = mj.MjModel.loadFromXML('/model.xml'), d = new mj.MjData(m);
m.opt.integrator = 1;
mj.mj_resetDataKeyframe(m, d, 0);
const between = Math.round(0.01 / m.opt.timestep);
for (let row = 0; row <= Math.round(seconds / 0.01); ++row) {
  console.log([...d.qpos].join(' '));
  for (let k = 0; k < between; ++k) mj.mj_step(m, d);
}
