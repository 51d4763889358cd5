// The scenes of tests/contact_scenes.h as MJCF, with their targets and measures. SPDX-License-Identifier: Apache-2.0
//
// A scene has: seconds; xml(setting, h); start(qpos, qvel); targets(t) of its actuators; and judge(run), which looks at
// the path of a run: `run.q(k)` and `run.v(k)` are qpos and qvel after step k + 1, at the time (k + 1) h. Everything is
// measured from the path by the geometry here, not from MuJoCo's own list of contacts: a finger that has gone through a
// box reports no contact.
const gravity = 9.81;
const numbers = (values) => values.join(" ");
const element = (name, attributes, inside = "") =>
  `<${name} ${Object.entries(attributes).map(([key, value]) => `${key}="${value}"`).join(" ")}>${inside}</${name}>`;

const inertial = (mass, center, moments) =>
  element("inertial", { mass, pos: numbers(center), diaginertia: numbers(moments) });
const boxMoments = (mass, [x, y, z]) =>
  [y * y + z * z, x * x + z * z, x * x + y * y].map((square) => (mass / 12) * square);
const half = (size) => numbers(size.map((side) => side / 2));
const body = (name, place, inside) => element("body", { name, pos: numbers(place) }, inside);
const geom = (name, type, size, more = {}) => element("geom", { name, type, size, ...more });
const freeBlock = (name, mass, size, place) =>
  body(name, place, `<freejoint/>${inertial(mass, [0, 0, 0], boxMoments(mass, size))}` +
    geom(name, "box", half(size)));
const floor = geom("floor", "plane", "1 1 1");

/// kd goes into the joint's damping, as the targets of velocity are zero: all integrators but RK4 take that implicitly.
const joint = (name, type, axis, drive = {}, more = {}) =>
  element("joint", { name, type, axis: numbers(axis), damping: drive.kd ?? 0, ...more });
const servo = (name, kp) =>
  element("general", { joint: name, gainprm: kp, biastype: "affine", biasprm: `0 ${-kp} 0` });

const impedances = {
  soft: "0.9 0.95 0.001", stiff: "0.99 0.999 0.001", hard: "0.9999 0.9999 0.001",  // soft is MuJoCo's default
  graded: "0 0.95 0.001",  // none at touch, as models of feet have it
};
/// A time constant in seconds from "20ms" or from a number of steps.
const timeConstant = (word, h) => (word.endsWith("ms") ? parseFloat(word) / 1000 : word * h);

const switches = { diagexact: ["diagexact", "enable"], norefsafe: ["refsafe", "disable"] };

function mjcf(setting, h, scene) {
  const contact = { solref: `${timeConstant(setting.contactTime, h)} 1`, solimp: impedances[setting.impedance] };
  if (setting.friction) contact.solreffriction = `${timeConstant(setting.friction, h)} 1`;
  const flags = element("flag", Object.fromEntries(setting.flags.map((flag) => switches[flag])));
  const option = element("option", {
    timestep: h, integrator: setting.integrator, cone: setting.cone, impratio: setting.impratio, solver: "Newton",
    noslip_iterations: setting.noslip, gravity: numbers(scene.gravity ?? [0, 0, -gravity]),
  }, flags);
  const pairs = scene.pairs.map(([geom1, geom2]) => element("pair", {
    geom1, geom2, condim: 3, friction: `${scene.friction} ${scene.friction} 0.005 0.0001 0.0001`, ...contact,
  }));
  // follower = ratio leader
  const mimics = (scene.mimics ?? []).map(([joint1, joint2, ratio]) => element("joint", {
    joint1, joint2, polycoef: `0 ${ratio} 0 0 0`,
    ...(setting.mimic === "soft" ? {} : { solref: `${timeConstant(setting.mimic, h)} 1`, solimp: impedances.hard }),
  }));
  return `<mujoco><compiler angle="radian" autolimits="true" boundmass="0" boundinertia="0"/>${option}
<default><geom contype="0" conaffinity="0"/></default><worldbody>${scene.bodies}</worldbody>
<contact>${pairs.join("")}</contact><equality>${mimics.join("")}</equality>
<actuator>${(scene.servos ?? []).map(([name, kp]) => servo(name, kp)).join("")}</actuator></mujoco>`;
}

export const ramp = (t, a, b) => {
  const s = Math.min(1, Math.max(0, (t - a) / (b - a)));
  return s * s * (3 - 2 * s);
};

// Quaternions are w, x, y, z.
const product = (a, b) => [
  a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
  a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]];
const conjugate = (a) => [a[0], -a[1], -a[2], -a[3]];
const turned = (a, v) => product(product(a, [0, ...v]), conjugate(a)).slice(1);
const about = (axis, angle) => [Math.cos(angle / 2), ...axis.map((x) => x * Math.sin(angle / 2))];
const turnOf = (a) => 2 * Math.atan2(Math.hypot(a[1], a[2], a[3]), Math.abs(a[0]));
const less = (a, b) => a.map((x, i) => x - b[i]);
const plus = (a, b) => a.map((x, i) => x + b[i]);
const length = (a) => Math.hypot(...a);
const placeOf = (q, at) => [q[at], q[at + 1], q[at + 2]];
const turnAt = (q, at) => [q[at + 3], q[at + 4], q[at + 5], q[at + 6]];

/// The largest of f over the samples from `from` s on; NaN counts as infinite, as no comparison finds it.
function largest(run, from, f) {
  let worst = -Infinity;
  for (let k = run.index(from); k < run.steps; k += run.stride) {
    const value = f(run.q(k), run.v(k));
    if (!(value <= worst)) worst = Number.isNaN(value) ? Infinity : value;
  }
  return worst;
}
const fastest = (run, from) => largest(run, from, (q, v) => {
  let most = 0;
  for (const speed of v) most = Math.abs(speed) <= most ? most : Math.abs(speed);
  return most;
});
const signs = [-1, 1];
const corners = (h) => signs.flatMap((x) => signs.flatMap((y) => signs.map((z) => [x * h, y * h, z * h])));
const lowestCorner = (q, at, h) => {
  const turn = turnAt(q, at);
  return q[at + 2] + Math.min(...corners(h).map((corner) => turned(turn, corner)[2]));
};
/// How deep a box of half side h above sits in the one below: the corners of each in the other.
function overlap(q, below, above, h) {
  let deepest = 0;
  for (const [inside, other, sign] of [[below, above, 1], [above, below, -1]]) {
    const back = conjugate(turnAt(q, inside)), turn = turnAt(q, other);
    for (const corner of corners(h)) {
      const local = turned(back, less(plus(placeOf(q, other), turned(turn, corner)), placeOf(q, inside)));
      if (Math.abs(local[0]) < h && Math.abs(local[1]) < h) deepest = Math.max(deepest, h - sign * local[2]);
    }
  }
  return deepest;
}

/// `firmness` multiplies the squeeze of the original. At 10 kg the fingers share 310 N, 155 N each, which can carry
/// 248 N by friction, and the shaking asks for 256 N. That grasp has to slip; with twice the squeeze it need not.
function grasp(mass, firmness = 1) {
  const squeeze = firmness * (10 + 30 * mass), pad = [0.01, 0.02, 0.04], side = 0.04;
  const amplitude = (2 * gravity) / (6 * Math.PI) ** 2;
  const small = (m, center) => inertial(m, center, [1e-3, 1e-3, 1e-3]);
  const finger = (name, x, direction, drive) => body(name, [x, 0, 0], joint(name, "slide", [direction, 0, 0], drive) +
    inertial(0.025, [0, 0, 0], boxMoments(0.025, pad)) + geom(name, "box", half(pad)));
  const palm = small(0.5, [0, 0, 0.06]) + joint("wrist", "hinge", [0, 0, 1], { kd: 0.5 }) +
    finger("left", -0.055, 1, { kd: squeeze }) + finger("right", 0.055, -1);
  const lift = small(0.5, [0, 0, 0]) + joint("z", "slide", [0, 0, 1], { kd: 500 }) + body("palm", [0, 0, 0], palm);
  const mount = small(0.5, [0, 0, 0]) + joint("y", "slide", [0, 1, 0], { kd: 500 }) + body("lift", [0, 0, 0], lift);
  const scene = {
    bodies: floor + body("mount", [0, 0, 0.03], mount) +
      freeBlock("object", mass, [side, side, side], [0, 0, side / 2]),
    pairs: [["left", "object"], ["right", "object"], ["floor", "object"]], friction: 0.8,
    mimics: [["right", "left", 1]],
    servos: [["y", 5e4], ["z", 5e4], ["wrist", 50], ["left", squeeze / 0.01]],
  };
  // qpos: y, z, wrist, left, right, object.
  const inPalm = (q) => {
    const back = about([0, 0, 1], -q[2]);
    return [turned(back, less(placeOf(q, 5), [0, q[0], 0.03 + q[1]])), product(back, turnAt(q, 5))];
  };
  // Of points spread over the pad's face, the deepest in the object behind the object's face that the pad presses on.
  const padDepth = (q) => {
    const [place, turn] = inPalm(q), back = conjugate(turn), h = side / 2;
    let deepest = 0;
    for (const [x, sign] of [[-0.05 + q[3], 1], [0.05 - q[4], -1]])
      for (let i = -2; i <= 2; ++i)
        for (let j = -4; j <= 4; ++j) {
          const local = turned(back, less([x, (i * pad[1]) / 4, (j * pad[2]) / 8], place));
          if (Math.abs(local[1]) > h || Math.abs(local[2]) > h || sign * local[0] > h) continue;
          deepest = Math.max(deepest, sign * local[0] + h);
        }
    return deepest;
  };
  return {
    seconds: 11, xml: (setting, h) => mjcf(setting, h, scene), start() {},
    targets(t) {
      const r = ramp(t, 1, 1.5);
      return [amplitude * r * Math.sin(6 * Math.PI * (t - 1)),
        0.1 * ramp(t, 0.5, 1) + ((r * amplitude) / 2) * Math.sin(4 * Math.PI * (t - 1)),
        (r / 2) * Math.sin(2 * Math.PI * (t - 1)), 0.03 + 0.01 * ramp(t, 0, 0.3)];
    },
    judge(run) {
      const [place, turn] = inPalm(run.q(run.index(1)));
      const slip = largest(run, 1, (q) => length(less(inPalm(q)[0], place)));
      const rotation = largest(run, 1, (q) => turnOf(product(inPalm(q)[1], conjugate(turn))));
      const depth = largest(run, 0, padDepth);
      // A finger that stands where the object should be has gone through it, or the object has left.
      const finger = largest(run, 0.5, (q) => Math.max(q[3], q[4])) - 0.03;
      const coupling = largest(run, 0, (q) => Math.abs(q[4] - q[3]));
      let last = run.index(1);  // a second after the start the object is lifted
      while (last < run.steps && length(less(inPalm(run.q(last))[0], [0, 0, -0.01])) < 0.01) last += run.stride;
      const lost = last < run.steps, through = !(depth < 0.005 && finger < 0.005);
      return { error: lost ? Infinity : slip, rotation, depth, finger, coupling, through,
        ...(lost ? { lost_at: (last + 1) * run.h } : {}),
        held: !lost && !through && rotation < 0.1 && coupling < 0.005 };
    },
  };
}

const cube = 0.1;
function blockScene(seconds, share, judge, speed = 0) {
  const angle = share * Math.atan(0.5);
  const scene = {
    bodies: floor + freeBlock("block", 1, [cube, cube, cube], [0, 0, cube / 2]), pairs: [["floor", "block"]],
    friction: 0.5, gravity: [gravity * Math.sin(angle), 0, -gravity * Math.cos(angle)],
  };
  return { seconds, xml: (setting, h) => mjcf(setting, h, scene), targets: () => [], judge: (run) => judge(run, angle),
    start(q, v) { v[0] = speed; } };
}
const blockDepth = (run) => largest(run, 0, (q) => -lowestCorner(q, 0, cube / 2));

function stands(run) {
  const from = placeOf(run.q(run.index(1)), 0);
  const error = largest(run, 1, (q) => length(less(placeOf(q, 0), from)));
  return { error, depth: blockDepth(run), held: error < 1e-3 };
}
function slides(run, angle) {
  const ideal = gravity * (Math.sin(angle) - 0.5 * Math.cos(angle)) * run.seconds;
  const speed = run.v(run.steps - 1)[0];
  const error = Math.abs(speed / ideal - 1);
  return { error, speed, depth: blockDepth(run), held: error < 0.05 };
}
function stops(run) {
  const ideal = 9 / (2 * 0.5 * gravity), distance = run.q(run.steps - 1)[0];
  const rise = largest(run, 0, (q) => q[2] - cube / 2), sink = largest(run, 0, (q) => cube / 2 - q[2]);
  const stop = Math.abs(distance / ideal - 1);
  const error = Math.max(rise, sink);
  return { error, rise, sink, depth: blockDepth(run), stop, held: stop < 0.02 && error < 2e-3 };
}

function stack(top) {
  const places = [[0, 0, 0.05], [0.005, 0.003, 0.151], [-0.004, 0.006, 0.252]], size = [cube, cube, cube];
  const scene = {
    bodies: floor + places.map((place, i) => freeBlock(`block${i + 1}`, i === 2 ? top : 1, size, place)).join(""),
    pairs: [["floor", "block1"], ["block1", "block2"], ["block2", "block3"]], friction: 0.6,
  };
  return {
    seconds: 12, xml: (setting, h) => mjcf(setting, h, scene), start() {}, targets: () => [],
    judge(run) {
      const h = cube / 2, error = fastest(run, 2), from = run.q(run.index(2)).slice();
      const depth = largest(run, 0, (q) => Math.max(-lowestCorner(q, 0, h), overlap(q, 0, 7, h), overlap(q, 7, 14, h)));
      const drift = largest(run, 2, (q) => Math.max(...[0, 7, 14].map((at) =>
        length(less(placeOf(q, at), placeOf(from, at))))));
      const away = largest(run, 0, (q) => Math.max(...[0, 7, 14].map((at, i) =>
        length(less(placeOf(q, at), places[i])))));
      return { error, depth, drift, away, held: away < 0.01 && error < 0.05 };
    },
  };
}

const legs = [["fl", 0.18, 1], ["fr", 0.18, -1], ["hl", -0.18, 1], ["hr", -0.18, -1]], radius = 0.02;
function quadruped(trots) {
  const m = { shank: 0.2, foot: 0.05 }, lower = m.shank + m.foot;
  const c = -(m.shank * 0.1 + m.foot * 0.2) / lower, own = 0.4 * m.foot * radius * radius;
  const apart = m.shank * (0.1 + c) ** 2 + m.foot * (0.2 + c) ** 2;
  const driven = [{ kd: 6 }, { armature: 0.005 }];
  const trunk = legs.map(([name, x, side]) => {
    const shank = joint(`${name}_knee`, "hinge", [0, 1, 0]) +
      inertial(lower, [0, 0, c], [1e-3 + own + apart, 1e-3 + own + apart, 1e-4 + own]) +
      geom(`${name}_foot`, "sphere", radius, { pos: "0 0 -0.2" });
    const thigh = joint(`${name}_hip`, "hinge", [0, 1, 0], ...driven) +
      inertial(0.6, [0, 0, -0.1], [3e-3, 3e-3, 5e-4]) + body(`${name}_shank`, [0, 0, -0.2], shank);
    return body(`${name}_abductor`, [x, 0.1 * side, 0], joint(`${name}_abduction`, "hinge", [1, 0, 0], ...driven) +
      inertial(0.5, [0, 0.02 * side, 0], [5e-4, 5e-4, 5e-4]) + body(`${name}_thigh`, [0, 0.04 * side, 0], thigh));
  });
  const scene = {
    bodies: floor + body("trunk", [0, 0, 0.371], "<freejoint/>" +
      inertial(6, [0, 0, 0], boxMoments(6, [0.4, 0.16, 0.1])) + trunk.join("")),
    pairs: legs.map(([name]) => ["floor", `${name}_foot`]), friction: 0.7,
    mimics: legs.map(([name]) => [`${name}_knee`, `${name}_hip`, -2]),
    servos: legs.flatMap(([name]) => [[`${name}_abduction`, 300], [`${name}_hip`, 300]]),
  };
  const sink = (q) => radius - Math.min(...legs.map(([, x, side], i) => {
    const at = 7 + 3 * i, first = about([1, 0, 0], q[at]);
    const thigh = product(first, about([0, 1, 0], q[at + 1])), shank = product(thigh, about([0, 1, 0], q[at + 2]));
    let foot = plus([x, 0.1 * side, 0], turned(first, [0, 0.04 * side, 0]));
    foot = plus(foot, plus(turned(thigh, [0, 0, -0.2]), turned(shank, [0, 0, -0.2])));
    return q[2] + turned(turnAt(q, 0), foot)[2];
  }));
  const lift = (t, phase) => 0.5 + (t < 0.5 ? 0 : 0.25 * Math.max(0, Math.sin(4 * Math.PI * t + phase)));
  return {
    seconds: 10, xml: (setting, h) => mjcf(setting, h, scene),
    start(q) { legs.forEach((_, i) => q.set([0, 0.5, -1], 7 + 3 * i)); },
    targets: (t) => [0, Math.PI, Math.PI, 0].flatMap((phase) => [0, trots ? lift(t, phase) : 0.5]),
    judge(run) {
      const depth = largest(run, 0, sink), from = placeOf(run.q(run.index(3)), 0);
      const coupling = largest(run, 0, (q) => Math.max(...legs.map((_, i) =>
        Math.abs(q[9 + 3 * i] + 2 * q[8 + 3 * i]))));
      const drift = largest(run, 3, (q) => length(less(placeOf(q, 0), from)));
      const low = largest(run, 0, (q) => 0.371 - q[2]);
      const tilt = largest(run, 0, (q) => Math.acos(Math.min(1, turned(turnAt(q, 0), [0, 0, 1])[2])));
      const speed = fastest(run, 3);
      // A trot moves, so its error is how deep the feet sink; a stand's is what still moves.
      const stood = low < 0.08 && tilt < 0.3 && coupling < 0.05;
      return { error: trots ? depth : speed, depth, coupling, drift, low, tilt,
        held: stood && (trots || speed < 0.05) };
    },
  };
}

function wall() {
  const link = (name, mass, span, place, inside) => {
    const across = (mass * (3 * 0.01 ** 2 + span ** 2)) / 12, range = name === "upper" ? { range: "-1.5 1.2" } : {};
    const drive = name === "upper" ? { kd: 1000 } : {};
    return body(name, place, joint(name, "hinge", [0, 1, 0], drive, { armature: 1e-4, ...range }) +
      inertial(mass, [0, 0, span / 2], [across, across, (mass * 0.01 ** 2) / 2]) +
      geom(name, "capsule", numbers([0.01, span / 2]), { pos: numbers([0, 0, span / 2]) }) + inside);
  };
  const scene = {
    bodies: geom("wall", "plane", "1 1 1", { pos: "0.12 0 0", zaxis: "-1 0 0" }) +
      link("upper", 0.05, 0.1, [0, 0, 0], link("tip", 0.04, 0.08, [0, 0, 0.1], "")),
    pairs: [["wall", "tip"]], friction: 0.8, mimics: [["tip", "upper", 1]], servos: [["upper", 1e6]],
  };
  return {
    seconds: 4, xml: (setting, h) => mjcf(setting, h, scene), start(q) { q.fill(0.05); },
    targets: (t) => [0.05 + 0.7 * ramp(t, 0, 0.5)],
    judge(run) {
      const speed = fastest(run, 3.5), coupling = largest(run, 0, (q) => Math.abs(q[1] - q[0]));
      const reach = (first, second) => 0.1 * Math.sin(first) + 0.08 * Math.sin(first + second) - 0.11;
      const depth = largest(run, 0, (q) => reach(q[0], q[1])), end = run.q(run.steps - 1);
      let touch = 0.4;
      for (let i = 0; i < 50; ++i) touch -= reach(touch, touch) / 0.2;  // the slope there is about 0.18
      const off = Math.max(Math.abs(end[0] - touch), Math.abs(end[1] - touch)), error = Math.max(coupling, off);
      return { error, coupling, speed, depth, angle: end[0], held: speed < 0.05 && error < 0.05 };
    },
  };
}

function ball() {
  const scene = {
    bodies: floor + body("ball", [0, 0, 1.1], "<freejoint/>" + inertial(1, [0, 0, 0], [4e-3, 4e-3, 4e-3]) +
      geom("ball", "sphere", 0.1)),
    pairs: [["floor", "ball"]], friction: 0.5,
  };
  return {
    seconds: 2, xml: (setting, h) => mjcf(setting, h, scene), start() {}, targets: () => [],
    judge(run) {
      let lowest = Infinity, hop = 0, landed = false;
      for (let k = 0; k < run.steps; ++k) {
        const height = run.q(k)[2] - 0.1;
        landed ||= height <= 1e-3;
        lowest = Math.min(lowest, height);
        if (landed && k * run.h > 0.48) hop = Math.max(hop, height);
      }
      return { error: Math.max(hop, -lowest), hop, depth: -lowest, speed: fastest(run, 1.9),
        held: landed && hop < 0.01 && -lowest < 0.02 };
    },
  };
}

export const scenes = {
  "grasp 0.001": grasp(0.001), "grasp 0.1": grasp(0.1), "grasp 1": grasp(1), "grasp 10": grasp(10),
  "grasp 10 firm": grasp(10, 2),
  "stack 1": stack(1), "stack 10": stack(10), "stack 100": stack(100),
  "slope 0.99": blockScene(5, 0.99, stands), "slope 1.01": blockScene(5, 1.01, slides),
  "slide": blockScene(2, 0, stops, 3), "stand": quadruped(false), "trot": quadruped(true), "wall": wall(),
  "ball": ball(),
};
