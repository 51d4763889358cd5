// Where an MJCF file comes to rest in MuJoCo. SPDX-License-Identifier: Apache-2.0
//   node rest.mjs FOLDER/node_modules/@mujoco/mujoco FOLDER/model.xml KEY SECONDS [IMPRATIO]
// Puts a ground below what has none, and starts in the keyframe KEY, or as drawn. Prints as JSON what the positions
// belong to, the positions and the largest speed at the end, and how deep the points overlap that bear a force there.
// FOLDER/rest.xml is the file with this ground and with the end as its key "rest".
import fs from 'fs';
import path from 'path';
import {copy, load, open, owners} from './mujoco.mjs';

const [library, file, key, seconds, impratio] = process.argv.slice(2);
const mj = await open(library), folder = path.dirname(file), name = path.basename(file);
copy(mj, folder, '/model', true);
const plane = mj.mjtGeom.mjGEOM_PLANE.value;
const ground = load(mj, `/model/${name}`).geom_type.includes(plane) ? '' :
  '<worldbody><geom name="ground" type="plane" size="0 0 1"/></worldbody>';
mj.FS.writeFile('/model/scene.xml', `<mujoco><include file="${name}"/>${ground}</mujoco>`);
const m = load(mj, '/model/scene.xml'), d = new mj.MjData(m);
if (impratio) m.opt.impratio = Number(impratio);
if (key) mj.mj_resetDataKeyframe(m, d, mj.mj_name2id(m, mj.mjtObj.mjOBJ_KEY.value, key));
while (d.time < Number(seconds)) mj.mj_step(m, d);
const end = ['qpos', 'ctrl'].map(field => `${field}="${[...d[field]].join(' ')}"`).join(' ');
fs.writeFileSync(`${folder}/rest.xml`,
  `<mujoco><include file="${name}"/>${ground}<keyframe><key name="rest" ${end}/></keyframe></mujoco>\n`);
const points = Array.from({length: d.ncon}, (_, i) => d.contact.get(i)).filter(point => point.efc_address >= 0);
console.log(JSON.stringify({owners: owners(mj, m), positions: [...d.qpos],
  speed: Math.max(...d.qvel.map(Math.abs)), depths: points.map(point => -point.dist)}));
