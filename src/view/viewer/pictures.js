// Pictures of the present, for scripts: the page's one sample is replaced for each. SPDX-License-Identifier: Apache-2.0
import { fill } from './motion.js';

const room = 0.2;  // around what there is to see at first, as a share of its radius: it will move

export class Pictures {
  constructor(scene, motion, width, height) {
    Object.assign(this, { scene, motion, width, height });
    scene.follows = motion.floats;
    scene.box.expandByScalar(room * scene.radius);
    scene.camera.aspect = width / height;
    scene.camera.updateProjectionMatrix();
    scene.reset_camera();
  }

  // Of each environment, with these numbers of a sample: [environments][height][width][4] bytes from the left lower
  // corner, by zlib, which takes less time than to hand over all of them, in base64.
  async take(numbers) {
    const { scene, motion, width, height } = this, size = 4 * width * height;
    fill(motion, numbers);
    scene.arrows.measure(motion);
    scene.renderer.setPixelRatio(1);
    scene.renderer.setSize(width, height, false);
    scene.renderer.setViewport(0, 0, width, height);
    scene.renderer.setScissor(0, 0, width, height);
    const pixels = new Uint8Array(motion.environments.length * size), gl = scene.renderer.getContext();
    motion.environments.forEach((environment, i) => {
      scene.pose(environment, motion.times[0]);
      scene.renderer.render(scene.scene, scene.camera);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels.subarray(i * size, (i + 1) * size));
    });
    const packed = new Blob([pixels]).stream().pipeThrough(new CompressionStream('deflate'));
    return base64(new Uint8Array(await new Response(packed).arrayBuffer()));
  }
}

// In pieces: a call takes some ten thousand arguments.
function base64(bytes) {
  let text = '';
  for (let at = 0; at < bytes.length; at += 0x8000) text += String.fromCharCode(...bytes.subarray(at, at + 0x8000));
  return btoa(text);
}
