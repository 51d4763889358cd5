// MuJoCo for the scripts of tests. SPDX-License-Identifier: Apache-2.0
//   npm install mujoco-js@0.0.7   (MuJoCo 3.3.8), or @mujoco/mujoco   (3.14)
import fs from 'fs';
import path from 'path';

export async function open(library) {
  const file = ['dist/mujoco_wasm.js', 'mujoco.js'].map(name => path.resolve(library, name)).find(fs.existsSync);
  return (await import(file)).default();
}

export const load = (mj, file) => (mj.MjModel.loadFromXML ?? mj.MjModel.from_xml_path)(file);

// Shapes and pictures that need not be there: all are a tetrahedron and a dot. No inertia may come from a mesh.
function without_assets(text) {
  const replaced = (tag, inline) => {
    const file = / file="(.*?)"/.exec(tag)[1];
    return tag.replace(/ file=".*?"/, / name=/.test(tag) ? inline : ` name="${path.parse(file).name}"${inline}`);
  };
  return text.replace(/<mesh\b[^>]* file=[^>]*>/g, tag => replaced(tag, ' vertex="0 0 0 1 0 0 0 1 0 0 0 1"'))
    .replace(/<texture\b[^>]* file=[^>]*>/g, tag => replaced(tag, ' builtin="flat" width="1" height="1"'));
}

// A folder with all that it holds, for MuJoCo to read.
export function copy(mj, from, to, keeps_assets = false) {
  mj.FS.mkdir(to);
  for (const entry of fs.readdirSync(from, {withFileTypes: true})) {
    const [source, target] = [`${from}/${entry.name}`, `${to}/${entry.name}`];
    if (entry.isDirectory()) copy(mj, source, target, keeps_assets);
    else mj.FS.writeFile(target, keeps_assets ? fs.readFileSync(source) : without_assets(fs.readFileSync(source, 'utf8')));
  }
}

// Of a body (1), joint (3), geom (5), equality (17) or tendon (18); empty where it has none.
export function name_of(mj, m, kind, i) {
  const starts = {1: m.name_bodyadr, 3: m.name_jntadr, 5: m.name_geomadr, 17: m.name_eqadr, 18: m.name_tendonadr}[kind];
  return m.names[starts[i]] ? mj.mj_id2name(m, kind, i) : '';
}

// The rotation vector of a quaternion, and back.
export function vector_of([w, ...v]) {
  const sine = Math.hypot(...v), angle = 2 * Math.atan2(sine, Math.abs(w));
  return v.map(part => sine ? (w < 0 ? -1 : 1) * angle / sine * part : 0);
}
export function turn_by(vector) {
  const angle = Math.hypot(...vector);
  return [Math.cos(angle / 2), ...vector.map(part => angle ? Math.sin(angle / 2) / angle * part : 0)];
}

// What each position belongs to, by the names that lockstep gives: joints, free bodies seven times, balls by axis.
export function owners(mj, m) {
  const found = [];
  for (let j = 0; j < m.njnt; ++j) {
    const body = name_of(mj, m, 1, m.jnt_bodyid[j]) || 'body', own = name_of(mj, m, 3, j) || body;
    if (m.jnt_type[j] == mj.mjtJoint.mjJNT_FREE.value) found.push(...Array(7).fill(body));
    else if (m.jnt_type[j] == mj.mjtJoint.mjJNT_BALL.value) found.push(...['x', 'y', 'z'].map(axis => `${own}.${axis}`));
    else found.push(own);
  }
  return found;
}

// The positions of all of these.
export function positions(mj, m, d) {
  const found = [];
  for (let j = 0; j < m.njnt; ++j) {
    const numbers = {[mj.mjtJoint.mjJNT_FREE.value]: 7, [mj.mjtJoint.mjJNT_BALL.value]: 4}[m.jnt_type[j]] ?? 1;
    const own = [...d.qpos.slice(m.jnt_qposadr[j], m.jnt_qposadr[j] + numbers)];
    found.push(...(numbers == 4 ? vector_of(own) : own));
  }
  return found;
}

// Prints these, and the positions at the start and every 10 ms, as JSON.
export function play(mj, m, d, seconds) {
  const rows = [positions(mj, m, d)], between = Math.round(0.01 / m.opt.timestep);
  while (rows.length <= Math.round(seconds / 0.01)) {
    for (let k = 0; k < between; ++k) mj.mj_step(m, d);
    rows.push(positions(mj, m, d));
  }
  console.log(JSON.stringify({owners: owners(mj, m), rows}));
}
