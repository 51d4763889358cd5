// What elements there are, and what they have. SPDX-License-Identifier: Apache-2.0
#include "known.h"

#include <algorithm>
#include <iterator>

namespace lockstep::importer::mjcf {
namespace {

// Elements that nothing is read of.
constexpr std::string_view unread[] = {
    // clang-format off
    "bone", "camera", "composite", "config", "custom", "dcmotor", "deformable", "element", "exclude", "extension",
    "flex", "flexcomp", "flexstrain", "flexvert", "global", "headlight", "instance", "layer", "lengthrange", "light", "map",
    "material", "numeric", "pair", "pid", "plugin", "quality", "rgba", "scale", "sensor", "size", "skin", "statistic",
    "text", "texture", "tuple", "visual",
    // clang-format on
};
static_assert(std::is_sorted(std::begin(unread), std::end(unread)));

// An element in elements of one kind, or in all others where there is no owner, and what it may have.
struct Attributes {
  std::string_view owner, tag, names, more = "";  // blanks between names
};

constexpr std::string_view of_poses = "axisangle euler pos quat xyaxes zaxis";
constexpr std::string_view of_constraints = "active class name solimp solref";
constexpr std::string_view of_tendons =
    "actuatorfrclimited actuatorfrcrange armature class damping frictionloss group limited margin name range "
    "solimpfriction solimplimit solreffriction solreflimit springlength stiffness user";
constexpr std::string_view of_actuators =
    "armature class cranklength cranksite ctrllimited ctrlrange damping delay forcelimited forcerange gear group "
    "interp "
    "joint jointinparent lengthrange name nsample plugin refsite site slidersite tendon user";

constexpr Attributes attributes[] = {
    {"", "mujoco", "model xmlns"},
    {"", "mujocoinclude", "model xmlns"},
    {"", "compiler",
     "alignfree angle assetdir autolimits balanceinertia boundinertia boundmass conflict convexhull coordinate "
     "discardvisual eulerseq exactmeshinertia fitaabb fusestatic inertiafromgeom inertiagrouprange meshdir "
     "saveinertial "
     "settotalmass strippath texturedir usethread"},
    {"", "option",
     "actuatorgroupdisable apirate ccd_iterations ccd_tolerance collision cone density gravity impratio integrator "
     "iterations jacobian ls_iterations ls_tolerance magnetic mpr_iterations mpr_tolerance noslip_iterations "
     "noslip_tolerance o_friction o_margin o_solimp o_solref sdf_initpoints sdf_iterations sleep_tolerance solver "
     "timestep tolerance viscosity wind"},
    {"", "flag",
     "actuation autoreset clampctrl constraint contact damper diagexact energy equality eulerdamp filterparent "
     "frictionloss fwdinv gravity invdiscrete island limit midphase multiccd nativeccd override passive refsafe sensor "
     "sensornoise sleep spring warmstart"},
    {"", "asset", ""},
    {"", "mesh",
     "builtin class content_type face file inertia material maxhullvert name normal params refpos refquat scale "
     "smoothnormal texcoord vertex"},
    {"", "hfield", "content_type elevation file name ncol nrow size"},
    {"", "model", "content_type file name"},
    {"", "default", "class"},
    {"", "worldbody", "childclass name"},
    {"", "body", "childclass gravcomp mocap name sleep user", of_poses},
    {"", "frame", "childclass name", of_poses},
    {"", "replicate", "childclass count offset sep", of_poses},
    {"", "attach", "body frame model name prefix"},
    {"", "inertial", "diaginertia fullinertia mass", of_poses},
    {"", "freejoint", "align group name"},
    {"", "joint",
     "actuatorfrclimited actuatorfrcrange actuatorgravcomp armature axis class damping frictionloss group limited "
     "margin name pos range ref solimpfriction solimplimit solreffriction solreflimit springdamper springref stiffness "
     "type user"},
    {"", "geom",
     "class conaffinity condim contype density fitscale fluidcoef fluidshape friction fromto gap group hfield margin "
     "mass material mesh name priority rgba shellinertia size solimp solmix solref type user",
     of_poses},
    {"", "site", "class fromto group material mesh name rgba size type user", of_poses},
    {"", "contact", ""},
    {"", "pair", "class condim friction gap geom1 geom2 margin name solimp solref solreffriction"},
    {"", "exclude", "body1 body2 name"},
    {"", "equality", ""},
    {"", "connect", "anchor body1 body2 site1 site2", of_constraints},
    {"", "weld", "anchor body1 body2 relpose site1 site2 torquescale", of_constraints},
    {"equality", "joint", "joint1 joint2 polycoef", of_constraints},
    {"equality", "tendon", "polycoef tendon1 tendon2", of_constraints},
    {"default", "equality", of_constraints},
    {"", "tendon", ""},
    {"", "fixed", of_tendons},
    {"", "spatial", "material rgba width", of_tendons},
    {"default", "tendon", "material rgba width", of_tendons},
    {"fixed", "joint", "coef joint"},
    {"spatial", "site", "site"},
    {"spatial", "geom", "geom sidesite"},
    {"", "pulley", "divisor"},
    {"", "actuator", ""},
    {"", "general", "actdim actearly actlimited actrange biasprm biastype body dynprm dyntype gainprm gaintype",
     of_actuators},
    {"", "motor", "", of_actuators},
    {"", "position", "dampratio inheritrange kp kv timeconst", of_actuators},
    {"", "velocity", "kv", of_actuators},
    {"", "intvelocity", "actlimited actrange dampratio inheritrange kp kv", of_actuators},
    {"", "damper", "kv", of_actuators},
    {"", "cylinder", "area bias diameter timeconst", of_actuators},
    {"", "muscle", "force fpmax fvmax lmax lmin range scale tausmooth timeconst vmax", of_actuators},
    {"", "adhesion", "body gain", of_actuators},
    {"", "keyframe", ""},
    {"", "key", "act ctrl mpos mquat name qpos qvel time"},
};

bool is_among(std::string_view name, std::string_view names) {
  while (!names.empty()) {
    const std::size_t end = std::min(names.find(' '), names.size());
    if (names.substr(0, end) == name) return true;
    names.remove_prefix(std::min(end + 1, names.size()));
  }
  return false;
}

}  // namespace

bool is_known(std::string_view tag) {
  return std::binary_search(std::begin(unread), std::end(unread), tag) ||
         std::any_of(std::begin(attributes), std::end(attributes), [&](const Attributes& of) { return of.tag == tag; });
}

bool has_attribute(std::string_view owner, std::string_view tag, std::string_view name) {
  const Attributes* own = nullptr;
  for (const Attributes& candidate : attributes)
    if (candidate.tag == tag && (candidate.owner == owner || (candidate.owner.empty() && !own))) own = &candidate;
  return !own || is_among(name, own->names) || is_among(name, own->more);
}

bool is_of_mechanism(std::string_view element) {
  for (const std::string_view tag :
       {"attach",    "body", "compiler", "connect",  "fixed", "flag",     "frame",  "freejoint",
        "general",   "geom", "inertial", "joint",    "key",   "motor",    "option", "position",
        "replicate", "site", "spatial",  "velocity", "weld",  "worldbody"})
    if (element == tag) return true;
  return false;
}

bool is_for_names(std::string_view attribute) {
  return attribute == "name" || attribute == "class" || attribute == "childclass" || attribute == "model";
}

}  // namespace lockstep::importer::mjcf
