// Forces of contacts as arrows that end where they push. SPDX-License-Identifier: Apache-2.0
import * as THREE from 'three';

export const arrow_colour = '#d6296b';

export class Arrows {
  // The largest force gets an arrow of length `longest`.
  constructor(scene, motion, longest) {
    this.count = motion.contacts.length;
    this.largest = 0;
    this.measure(motion);
    this.longest = longest;
    // Seen through bodies: a contact lies between two of them.
    const material = new THREE.MeshBasicMaterial({ color: arrow_colour, depthTest: false, transparent: true,
      opacity: 0.85, toneMapped: false });
    const head = 0.06 * longest;
    this.head = 2 * head;
    const cone = new THREE.ConeGeometry(head, this.head, 20).translate(0, -head, 0);
    const shaft = new THREE.CylinderGeometry(0.25 * head, 0.25 * head, 1, 12).translate(0, -0.5, 0);
    this.arrows = motion.contacts.map(() => {
      const arrow = new THREE.Group(), line = new THREE.Mesh(shaft, material);
      line.position.y = -this.head;
      arrow.add(new THREE.Mesh(cone, material), line);
      arrow.traverse((part) => (part.renderOrder = 1));
      scene.add(arrow);
      return arrow;
    });
  }

  // Looks for larger forces than those so far.
  measure(motion) {
    for (const { pushes } of motion.environments)
      for (let at = 0; at < pushes.length; at += 6)
        this.largest = Math.max(this.largest, Math.hypot(pushes[at + 3], pushes[at + 4], pushes[at + 5]));
  }

  pose({ pushes }, row) {
    const up = new THREE.Vector3(0, 1, 0), force = new THREE.Vector3();
    this.arrows.forEach((arrow, i) => {
      const at = (row * this.count + i) * 6;
      force.fromArray(pushes, at + 3);
      const size = force.length();
      arrow.visible = size > 0;
      if (!arrow.visible) return;
      arrow.position.fromArray(pushes, at);
      arrow.quaternion.setFromUnitVectors(up, force.divideScalar(size));
      arrow.children[1].scale.y = Math.max((this.longest * size) / this.largest - this.head, 1e-6);
    });
  }
}
