// What MuJoCo makes of MJCF files, as JSON beside the tests. SPDX-License-Identifier: Apache-2.0
//   node facts.mjs FOLDER/node_modules/mujoco-js MODELS_FOLDER FACTS_FOLDER
// For each model in its first keyframe, or off the drawn pose: the joints, the mass matrix, the energy of
// gravity, the efforts of springs, damping and actuators, and the pairs of geoms that may touch. Constraints are off.
// Off the drawn pose, also by how much connects, welds and joints that are polynomials of others miss each other, in
// world axes, and as the vector part of the quaternion between welded frames. Where bodies compensate gravity, also the forces that hold all joints at rest.
import fs from 'fs';
import {copy, name_of, open, turn_by, vector_of} from './mujoco.mjs';

const [library, models, facts] = process.argv.slice(2);
const mj = await open(library);
const types = ['free', 'ball', 'slide', 'hinge'];

// The pairs of geoms that MuJoCo lets touch, with names where they have one.
function pairs(m, name) {
  const found = [], seen = new Set();
  const key = (i, j) => Math.min(i, j) * m.ngeom + Math.max(i, j);
  // With sliding, torsional and rolling friction.
  const words = (i, j, dimension, frictions) =>
    [name(5, i) || `#${i}`, name(5, j) || `#${j}`, ...frictions.map((f, k) => dimension > [1, 3, 4][k] ? f : 0)];
  for (let p = 0; p < m.npair; ++p) {
    const [i, j] = [m.pair_geom1[p], m.pair_geom2[p]];
    seen.add(key(i, j));
    found.push(words(i, j, m.pair_dim[p], [0, 2, 3].map(k => m.pair_friction[5 * p + k])));
  }
  const excluded = new Set(m.exclude_signature);
  const weld = g => m.body_weldid[m.geom_bodyid[g]];
  const above = g => m.body_weldid[m.body_parentid[weld(g)]];
  for (let i = 0; i < m.ngeom; ++i)
    for (let j = i + 1; j < m.ngeom; ++j) {
      const masks = (m.geom_contype[i] & m.geom_conaffinity[j]) | (m.geom_contype[j] & m.geom_conaffinity[i]);
      if (!masks || seen.has(key(i, j)) || weld(i) == weld(j)) continue;
      if (weld(i) && weld(j) && (weld(i) == above(j) || weld(j) == above(i))) continue;
      const bodies = [m.geom_bodyid[i], m.geom_bodyid[j]];
      if (excluded.has((Math.min(...bodies) << 16) + Math.max(...bodies))) continue;
      const [p, q] = [m.geom_priority[i], m.geom_priority[j]];
      const chosen = p == q ? [i, j] : [p > q ? i : j];
      const dimension = Math.max(...chosen.map(g => m.geom_condim[g]));
      const larger = k => Math.max(...chosen.map(g => m.geom_friction[3 * g + k]));
      found.push(words(i, j, dimension, [0, 1, 2].map(larger)));
    }
  return found;
}

function leave_the_drawn_pose(m, d) {
  mj.mj_resetData(m, d);
  for (let j = 0; j < m.njnt; ++j) {
    if (m.jnt_type[j] == 1) d.qpos.set(turn_by([1, 2, 3].map(k => 0.4 * Math.sin(j + k))), m.jnt_qposadr[j]);
    if (m.jnt_type[j] < 2) continue;
    d.qpos[m.jnt_qposadr[j]] += 0.3 * Math.sin(j + 1);
    d.qvel[m.jnt_dofadr[j]] = 0.5 * Math.cos(j + 1);
  }
}

function missed(m, d, name) {
  const found = {positions: {}, equalities: []};
  const is_linear = e => m.eq_type[e] == 2 && [2, 3, 4].every(k => m.eq_data[11 * e + k] == 0);
  leave_the_drawn_pose(m, d);
  for (let j = 0; j < m.njnt; ++j)
    if (m.jnt_type[j] > 1) found.positions[name(3, j)] = d.qpos[m.jnt_qposadr[j]];
  m.opt.disableflags &= ~1;
  mj.mj_forward(m, d);
  for (let row = 0; row < d.ne; ++row) {
    const e = d.efc_id[row];
    if (m.eq_type[e] > 2 || is_linear(e)) continue;
    if (found.equalities.at(-1)?.name != name(17, e)) found.equalities.push({name: name(17, e), misses: []});
    found.equalities.at(-1).misses.push(d.efc_pos[row]);
  }
  return found;
}

function facts_of(file) {
  const m = mj.MjModel.loadFromXML(file), d = new mj.MjData(m);
  const name = (kind, i) => name_of(mj, m, kind, i);
  m.opt.disableflags |= 1 | 16;  // constraints, contacts
  if (m.nkey)
    mj.mj_resetDataKeyframe(m, d, 0);
  else
    leave_the_drawn_pose(m, d);
  mj.mj_forward(m, d);
  const column = i => {
    const product = new mj.DoubleBuffer(m.nv);
    mj.mj_mulM(m, d, product, [...Array(m.nv).keys()].map(k => k == i ? 1 : 0));
    const values = [...product.GetView()];
    product.delete();
    return values;
  };
  let gravity = 0;  // the energy without springs
  for (let b = 1; b < m.nbody; ++b)
    for (let k = 0; k < 3; ++k)
      gravity -= m.body_mass[b] * (1 - m.body_gravcomp[b]) * m.opt.gravity[k] * d.xipos[3 * b + k];
  const result = {mass: 0, energy: gravity, joints: [], pairs: pairs(m, name)};
  result.mass_matrix = [...Array(m.nv).keys()].map(column);
  for (let b = 1; b < m.nbody; ++b) result.mass += m.body_mass[b];
  for (let j = 0; j < m.njnt; ++j) {
    const dof = m.jnt_dofadr[j], type = types[m.jnt_type[j]];
    const add = (own, dof, position, range, rest) => result.joints.push({
      name: own, type, body: name(1, m.jnt_bodyid[j]), dof, position, velocity: d.qvel[dof], range,
      damping: m.dof_damping[dof], armature: m.dof_armature[dof], friction: m.dof_frictionloss[dof],
      stiffness: m.jnt_stiffness[j], rest,
      effort: d.qfrc_passive[dof] - d.qfrc_gravcomp[dof] + d.qfrc_actuator[dof],
    });
    const at = m.jnt_qposadr[j], range = m.jnt_limited[j] ? [m.jnt_range[2 * j], m.jnt_range[2 * j + 1]] : null;
    if (type == 'free')
      result.joints.push({name: name(3, j), type, body: name(1, m.jnt_bodyid[j]), dof});
    else if (type == 'ball')  // the first part has the range, which begins at 0
      vector_of([...d.qpos.slice(at, at + 4)]).forEach((position, k) =>
        add(`${name(3, j) || name(1, m.jnt_bodyid[j])}.${'xyz'[k]}`, dof + k, position,
            range && k == 0 ? [null, range[1]] : null, 0));
    else
      add(name(3, j), dof, d.qpos[at], range, m.qpos_spring[at]);
  }
  const spatial = [...Array(m.ntendon).keys()].filter(t => m.wrap_type[m.tendon_adr[t]] == 3);  // begins at a site
  if (spatial.length)
    result.tendons = spatial.map(t => ({name: name(18, t), length: d.ten_length[t], rate: d.ten_velocity[t]}));
  if (m.ngravcomp) {
    d.qvel.fill(0);
    mj.mj_forward(m, d);
    for (const joint of result.joints) {
      const dofs = [...Array(joint.type == 'free' ? 6 : 1).keys()].map(k => joint.dof + k);
      joint.holding = dofs.map(k => d.qfrc_bias[k] - d.qfrc_gravcomp[k]);
    }
  }
  const off = missed(m, d, name);
  if (off.equalities.length) result.missed = off;
  return result;
}

copy(mj, models, '/models');
for (const file of fs.readdirSync(models).filter(file => file.endsWith('.xml')).sort()) {
  try {
    const text = JSON.stringify(facts_of(`/models/${file}`), null, 1).replace(/\n\s+(?=[-\d\]"]|null)/g, ' ');
    fs.writeFileSync(`${facts}/${file.replace('.xml', '.json')}`, text + '\n');
  } catch (error) {
    console.log(`${file}: ${error.message ?? error}`);
  }
}
