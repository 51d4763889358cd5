// Small models as MJCF. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace lockstep {

using std::string;

inline const string ball = "<geom size='0.1'/>";
inline string body(const string& inside, const string& name) {
  return "<body name='" + name + "'>" + inside + ball + "</body>";
}
inline string world(const string& bodies, const string& beside = "") {
  return "<mujoco>" + beside + "<worldbody>" + bodies + "</worldbody></mujoco>";
}
inline const string pair = body("<joint name='x'/>", "one") + body("<joint name='y'/>", "two");
inline const string floating = body("<freejoint name='f'/>", "car");

}  // namespace lockstep
