// Arrays of the loops: their frames, J, and what their rows miss. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diagnostic_arrays.h"

namespace lockstep::kernels {

/// The frames of a loop in a step.
template <class T>
struct LoopFrames {
  Vec3<T> axes[3];  // of the first frame in the world
  Vec3<T> point;    // origin of the second frame in the world
  T size;           // of the positions that meet in it
};

template <class T>
struct LoopArrays {
  Motion<T> motion;
  Vec3<T>* turning;         // [bodies] angular acceleration in the world at constant velocities
  Vec3<T>* moving;          // [bodies] the same of the origin
  LoopFrames<T>* frames;    // [loops]
  T* value;                 // [values] J, by row and velocity
  T *turned, *moved;        // [columns] squares of what a velocity turns and moves of the second body
  T* gap;                   // [rows] C
  T* bias;                  // [rows] J' v
  T* impulse;               // 2 [rows]
  T* force;                 // [6] by loop: on the second body, N and N m in the world
  T* pose;                  // [7] by floating root: where a leapfrog's midpoint is
  typename T::Mask* stays;  // [single bounds] lanes in which it holds its velocity

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const auto& l = t.loops;
    motion.arrays(t, take);
    take("loops.turning", turning, t.bodies);
    take("loops.moving", moving, t.bodies);
    take("loops.frames", frames, l.loops.count);
    take("loops.value", value, l.values);
    take("loops.turned", turned, l.columns.count);
    take("loops.moved", moved, l.columns.count);
    take("loops.gap", gap, l.rows);
    take("loops.bias", bias, l.rows);
    take("loops.impulse", impulse, 2 * l.rows);
    take("loops.force", force, 6 * l.loops.count);
    take("loops.pose", pose, 7 * t.roots.count);
    take("loops.stays", stays, t.bounds.single);
  }
};

}  // namespace lockstep::kernels
