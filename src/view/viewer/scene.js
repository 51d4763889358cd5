// The mechanisms in space: one scene, drawn once for each environment. SPDX-License-Identifier: Apache-2.0
import * as THREE from 'three';
import { ConvexGeometry } from 'three/addons/geometries/ConvexGeometry.js';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { toCreasedNormals } from 'three/addons/utils/BufferGeometryUtils.js';
import { buffer_of, sample_at } from './motion.js';
import { Arrows } from './arrows.js';
import { colour_now } from './style.js';

// By role of a link: what the legend says, and its colour in light and dark.
export const roles = {
  base: { words: 'fixed', colour: '#7c8791' },
  driver: { words: 'moved by independent joints', colour: '#3d85c6' },
  follower: { words: 'moved by followers', colour: '#e59036' },
  free: { words: 'free', colour: '#3fa07a' },
};

const style = (variable) => new THREE.Color(colour_now(variable));

// Two triangles a cell, cut from its corner of least x and y.
function terrain_of(heights, x, y) {
  const rows = heights.length, columns = heights[0].length, points = [], corners = [];
  heights.forEach((row, j) => row.forEach((height, i) =>
    points.push(x * (i / (columns - 1) - 0.5), y * (j / (rows - 1) - 0.5), height)));
  for (let j = 0; j < rows - 1; ++j)
    for (let i = 0; i < columns - 1; ++i) {
      const at = j * columns + i, across = at + columns + 1;
      corners.push(at, at + 1, across, at, across, at + columns);
    }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.Float32BufferAttribute(points, 3));
  geometry.setIndex(corners);
  const flat = geometry.toNonIndexed();
  flat.computeVertexNormals();
  return flat;
}

function geometry_of({ kind, size: [x, y, z], points, heights }) {
  if (kind === 'height_field') return terrain_of(heights, x, y);
  if (kind === 'hull') return new ConvexGeometry(points.map((point) => new THREE.Vector3(...point)));
  if (kind === 'box') return new THREE.BoxGeometry(x, y, z);
  if (kind === 'sphere') return new THREE.SphereGeometry(x, 32, 20);
  if (kind === 'ellipsoid') return new THREE.SphereGeometry(1, 32, 20).scale(x, y, z);
  // Those of three lie along y, those of lockstep along z.
  const round = kind === 'capsule' ? new THREE.CapsuleGeometry(x, y, 12, 32) : new THREE.CylinderGeometry(x, x, y, 40);
  return round.rotateX(Math.PI / 2);
}

// Edges of more than 40 degrees stay sharp.
function geometry_of_mesh({ vertices, triangles }) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(buffer_of(vertices)), 3));
  geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(buffer_of(triangles)), 1));
  return toCreasedNormals(geometry, (40 * Math.PI) / 180);
}

function place(object, pose) {
  object.position.set(pose[0], pose[1], pose[2]);
  object.quaternion.set(pose[4], pose[5], pose[6], pose[3]);
}

// A step of 1, 2 or 5 times a power of ten, not above `length`.
function round_step(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * ([5, 2, 1].find((step) => step * power <= length) ?? 1);
}

// Lines through a square of `cells` to each side. Each is in short pieces: some drivers drop lines that begin behind
// the camera.
function grid_of(spacing, cells) {
  const points = [];
  for (let i = -cells; i <= cells; ++i)
    for (let j = -cells; j < cells; ++j) points.push(i, j, 0, i, j + 1, 0, j, i, 0, j + 1, i, 0);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.Float32BufferAttribute(points.map((x) => x * spacing), 3));
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial());
}

export class Scene {
  constructor(canvas, motion) {
    this.motion = motion;
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.toneMapping = THREE.NeutralToneMapping;
    this.renderer.setScissorTest(true);
    this.scene = new THREE.Scene();
    this.world = new THREE.Group();  // moves where the view follows
    this.scene.add(this.world);
    this.links = motion.links.map((link) => this.add_link(link));
    this.add_world();
    this.home = new Map(motion.environments.map((environment) => [environment, this.middle(environment, 0)]));
    this.frame();
    this.arrows = new Arrows(this.world, motion, 0.3 * this.radius);
    this.dress();
  }

  // `white`, in [0, 1], is mixed into the colour.
  add_mesh(parent, geometry, colour, white) {
    const material = new THREE.MeshStandardMaterial({ roughness: 0.62, metalness: 0.05 });
    material.color.set(colour).lerp(new THREE.Color('#ffffff'), white);
    const mesh = new THREE.Mesh(geometry, material);
    mesh.castShadow = mesh.receiveShadow = true;
    parent.add(mesh);
    return mesh;
  }

  // What stands for an inertia is paler than a collider.
  add_solid(parent, solid, colour) {
    const mesh = this.add_mesh(parent, geometry_of(solid), colour, solid.inertia ? 0.6 : 0);
    place(mesh, solid.pose);
    const edges = new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry, 30),
      new THREE.LineBasicMaterial({ color: '#10161c', transparent: true, opacity: 0.35 }));
    mesh.add(edges);
  }

  add_link(link) {
    const group = new THREE.Group();
    for (const mesh of link.meshes) this.add_mesh(group, geometry_of_mesh(mesh), roles[link.role].colour, 0.3);
    for (const solid of link.solids) this.add_solid(group, solid, roles[link.role].colour);
    this.world.add(group);
    return group;
  }

  // Solids of the world. A half-space is a plane that shadows fall on.
  add_world() {
    this.ground_material = new THREE.MeshStandardMaterial({ roughness: 1 });
    this.grounds = [];
    for (const solid of this.motion.world) {
      if (solid.kind !== 'half_space') {
        this.add_solid(this.world, solid, roles.base.colour);
        continue;
      }
      const ground = new THREE.Group();
      place(ground, solid.pose);
      this.grounds.push(ground);
      this.world.add(ground);
    }
  }

  // The box around all that moves: over all samples, or at the first where a view follows what goes far away.
  bounds() {
    const reach = this.links.map((link) => {
      place(link, [0, 0, 0, 1, 0, 0, 0]);
      link.updateMatrixWorld(true);
      return new THREE.Box3().setFromObject(link);
    });
    const around = (rows) => {
      const box = new THREE.Box3(), solid = new THREE.Box3(), matrix = new THREE.Matrix4();
      const holder = new THREE.Object3D();
      for (const environment of this.motion.environments)
        for (const row of rows)
          this.links.forEach((link, i) => {
            if (reach[i].isEmpty()) return;
            const at = (row * this.links.length + i) * 7;
            place(holder, environment.poses.subarray(at, at + 7));
            holder.updateMatrix();
            box.union(solid.copy(reach[i]).applyMatrix4(matrix.copy(holder.matrix)));
          });
      return box;
    };
    const length = (box) => box.getSize(new THREE.Vector3()).length();
    const first = around([0]), rows = this.motion.samples, stride = Math.ceil(rows / 200);
    const all = around(Array.from({ length: Math.ceil(rows / stride) }, (_, i) => i * stride));
    this.follows = this.motion.floats && length(all) > 2 * length(first);
    const box = this.follows ? first : all;
    if (box.isEmpty()) box.set(new THREE.Vector3(-0.5, -0.5, -0.5), new THREE.Vector3(0.5, 0.5, 0.5));
    return box;
  }

  // Lights, grid and camera, sized by what there is to see.
  frame() {
    const box = (this.box = this.bounds());
    this.centre = box.getCenter(new THREE.Vector3());
    this.radius = Math.max(box.getSize(new THREE.Vector3()).length() / 2, 1e-3);
    const r = this.radius;
    this.sky = new THREE.HemisphereLight('#ffffff', '#b0b3b8', 2.45);
    this.sky.position.set(0, 0, 1);
    this.sun = new THREE.DirectionalLight('#fff8ee', 2.3);
    this.sun.position.copy(this.centre).add(new THREE.Vector3(1.4, -1.1, 2.6).multiplyScalar(r));
    this.sun.target.position.copy(this.centre);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    const wide = 1.6 * r;
    Object.assign(this.sun.shadow.camera,
      { left: -wide, right: wide, top: wide, bottom: -wide, near: 0.1 * r, far: 7 * r });
    this.sun.shadow.bias = -5e-4;
    this.sun.shadow.normalBias = 0.004 * r;
    this.sun.shadow.radius = 3;
    this.scene.add(this.sky, this.sun, this.sun.target);

    this.spacing = round_step(r / 2.5);
    this.grid = grid_of(this.spacing, 30);
    this.grid.position.z = 1e-3 * r;  // or the plane would hide it
    const flat = this.grounds[0] ?? new THREE.Group();
    if (!this.grounds.length) {  // only lines, below everything: there is no ground
      flat.position.z = box.min.z;
      this.world.add(flat);
    }
    for (const ground of this.grounds) {
      const plane = new THREE.Mesh(new THREE.CircleGeometry(60 * this.spacing, 48), this.ground_material);
      plane.receiveShadow = true;
      ground.add(plane);
    }
    flat.add(this.grid);

    this.camera = new THREE.PerspectiveCamera(35, 1, 0.02 * r, 60 * r);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.maxDistance = 25 * r;
    this.controls.minDistance = 0.05 * r;
    this.reset_camera();
  }

  // As near as all corners of the box allow.
  reset_camera() {
    const back = new THREE.Vector3(1.0, -1.25, 0.62).normalize();
    const right = new THREE.Vector3().crossVectors(this.camera.up, back).normalize();
    const up = new THREE.Vector3().crossVectors(back, right);
    const tall = 0.92 * Math.tan((this.camera.fov * Math.PI) / 360), wide = tall * this.camera.aspect;
    let distance = 0;
    for (let corner = 0; corner < 8; ++corner) {
      const { min, max } = this.box, pick = (bit, axis) => (corner & bit ? max : min)[axis];
      const p = new THREE.Vector3(pick(1, 'x'), pick(2, 'y'), pick(4, 'z')).sub(this.centre);
      distance = Math.max(distance, p.dot(back) + Math.max(Math.abs(p.dot(right)) / wide, Math.abs(p.dot(up)) / tall));
    }
    this.camera.position.copy(this.centre).addScaledVector(back, distance);
    this.controls.target.copy(this.centre);
    this.controls.update();
  }

  // Takes the colours of the page, which follow the system's.
  dress() {
    const back = style('--back');
    this.scene.background = back;
    this.scene.fog = new THREE.Fog(back, 7 * this.radius, 26 * this.radius);
    this.ground_material.color.copy(style('--ground'));
    this.grid.material.color.copy(style('--grid'));
  }

  // Where each environment is drawn, in pixels of the page from its left upper corner.
  viewports() {
    const { clientWidth: width, clientHeight: height } = this.canvas, count = this.motion.environments.length;
    // As many columns as make the shorter side of a viewport longest.
    const shorter = (columns) => Math.min(width / columns, height / Math.ceil(count / columns));
    let columns = 1;
    for (let more = 2; more <= count; ++more) if (shorter(more) > shorter(columns)) columns = more;
    const rows = Math.ceil(count / columns);
    return this.motion.environments.map((_, i) => ({ x: ((i % columns) * width) / columns,
      y: (Math.floor(i / columns) * height) / rows, width: width / columns, height: height / rows }));
  }

  // To the size of its place in the page.
  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    const [view] = this.viewports();
    const untouched = !this.framed;
    this.camera.aspect = view.width / view.height;
    this.camera.updateProjectionMatrix();
    if (untouched) this.reset_camera();
    this.framed = true;
  }

  // The mean place of the links in a sample.
  middle({ poses }, row) {
    const count = this.links.length, sum = new THREE.Vector3();
    for (let i = 0; i < count; ++i) sum.add(new THREE.Vector3().fromArray(poses, (row * count + i) * 7));
    return sum.divideScalar(Math.max(count, 1));
  }

  pose(environment, time) {
    const { row, share, nearest } = sample_at(this.motion.times, time), count = this.links.length;
    const next = Math.min(row + 1, this.motion.samples - 1), turn = new THREE.Quaternion();
    this.arrows.pose(environment, nearest);
    if (this.follows)
      this.world.position.lerpVectors(this.middle(environment, row), this.middle(environment, next), share).negate()
        .add(this.home.get(environment));
    this.links.forEach((link, i) => {
      const a = (row * count + i) * 7, b = (next * count + i) * 7, p = environment.poses;
      place(link, p.subarray(a, a + 7));
      if (share === 0) return;
      for (const [k, axis] of ['x', 'y', 'z'].entries()) link.position[axis] += share * (p[b + k] - p[a + k]);
      link.quaternion.slerp(turn.set(p[b + 4], p[b + 5], p[b + 6], p[b + 3]), share);
    });
  }

  draw(time) {
    const height = this.canvas.clientHeight;
    this.viewports().forEach((view, i) => {
      this.pose(this.motion.environments[i], time);
      const box = [view.x, height - view.y - view.height, view.width, view.height];
      this.renderer.setViewport(...box);
      this.renderer.setScissor(...box);
      this.renderer.render(this.scene, this.camera);
    });
  }
}
