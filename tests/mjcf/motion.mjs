// The motion of an MJCF file in MuJoCo with couplings as hard as lockstep's. SPDX-License-Identifier: Apache-2.0
//   node motion.mjs FOLDER/node_modules/mujoco-js FOLDER/model.xml SECONDS STEP LOOPS [KEY]
// Starts in the keyframe KEY or as drawn, with each control half-way to the farther end of its range. Steps by the
// fourth-order Runge-Kutta method without contacts, limits and dry friction. LOOPS says whether loops are held.
// Prints positions as mujoco.mjs does. FOLDER/motion.xml is the file with this start as its key "motion".
import fs from 'fs';
import path from 'path';
import {copy, open, play} from './mujoco.mjs';

const [library, file, seconds, step, loops, key] = process.argv.slice(2);
const mj = await open(library), {mjtDisableBit: disable, mjtEq: kind, mjtObj: object} = mj;
const folder = path.dirname(file), name = path.basename(file);
copy(mj, folder, '/model');
const m = mj.MjModel.loadFromXML(`/model/${name}`), d = new mj.MjData(m);
m.opt.timestep = Number(step);
m.opt.integrator = mj.mjtIntegrator.mjINT_RK4.value;
for (const what of ['FRICTIONLOSS', 'LIMIT', 'CONTACT']) m.opt.disableflags |= disable[`mjDSBL_${what}`].value;
for (let e = 0; e < m.neq; ++e) {
  m.eq_solref.set([4 * step, 1], 2 * e);
  m.eq_solimp.set([0.9999, 0.9999, 0.001, 0.5, 2], 5 * e);
  if (loops !== 'held' && [kind.mjEQ_CONNECT.value, kind.mjEQ_WELD.value].includes(m.eq_type[e])) m.eq_active0[e] = 0;
}
if (key) mj.mj_resetDataKeyframe(m, d, Math.max(0, mj.mj_name2id(m, object.mjOBJ_KEY.value, key)));
else mj.mj_resetData(m, d);
mj.mj_forward(m, d);
for (let a = 0; a < m.nu; ++a) {
  const gain = m.actuator_gainprm.subarray(10 * a), bias = m.actuator_biasprm.subarray(10 * a);
  const holding = bias[1] ? -(bias[0] + bias[1] * d.actuator_length[a]) / gain[0] : 0;
  const [lower, upper] = m.actuator_ctrllimited[a] ? m.actuator_ctrlrange.slice(2 * a) : [holding - 1, holding + 1];
  d.ctrl[a] = 0.5 * (holding + (upper - holding < holding - lower ? lower : upper));
}
const start = ['qpos', 'qvel', 'ctrl'].map(field => `${field}="${[...d[field]].join(' ')}"`).join(' ');
fs.writeFileSync(`${folder}/motion.xml`,
  `<mujoco><include file="${name}"/><keyframe><key name="motion" ${start}/></keyframe></mujoco>\n`);
play(mj, m, d, seconds);
