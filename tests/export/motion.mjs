// The motion of an MJCF file in MuJoCo, from its first keyframe. SPDX-License-Identifier: Apache-2.0
//   node motion.mjs FOLDER/node_modules/mujoco-js model.xml SECONDS
// Steps by the fourth-order Runge-Kutta method and prints positions as ../mjcf/mujoco.mjs does.
import fs from 'fs';
import {open, play} from '../mjcf/mujoco.mjs';

const [library, file, seconds] = process.argv.slice(2);
const mj = await open(library);
mj.FS.writeFile('/model.xml', fs.readFileSync(file));
const m = mj.MjModel.loadFromXML('/model.xml'), d = new mj.MjData(m);
m.opt.integrator = mj.mjtIntegrator.mjINT_RK4.value;
mj.mj_resetDataKeyframe(m, d, 0);
play(mj, m, d, seconds);
