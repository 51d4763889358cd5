// The names, sorted. SPDX-License-Identifier: Apache-2.0
#include "known.h"

#include <algorithm>
#include <iterator>

namespace lockstep::importer::mjcf {
namespace {

constexpr std::string_view known[] = {
    // clang-format off
    "accel", "act", "actdim", "actearly", "active", "actlimited", "actrange", "actuation", "actuator",
    "actuatorfrclimited", "actuatorfrcrange", "actuatorgravcomp", "actuatorgroupdisable", "adhesion", "align",
    "alignfree", "ambient", "anchor", "angle", "apirate", "area", "armature", "asset", "assetdir", "attach",
    "attenuation", "autolimits", "autoreset", "axis", "axisangle", "balanceinertia", "bias", "biasprm", "biastype",
    "body", "body1", "body2", "bone", "boundinertia", "boundmass", "camera", "castshadow", "ccd_iterations",
    "ccd_tolerance", "center", "childclass", "clampctrl", "coef", "compiler", "composite", "conaffinity", "condim",
    "cone", "config", "conflict", "connect", "constraint", "contact", "content_type", "contype", "convexhull", "coordinate",
    "count", "cranklength", "cranksite", "ctrl", "ctrllimited", "ctrlrange", "custom", "cutoff", "cylinder",
    "damper", "damping", "dampratio", "dcmotor", "default", "deformable", "delay", "density", "diaginertia",
    "diameter", "diffuse", "dir", "directional", "discardvisual", "dynprm", "dyntype", "element", "energy",
    "equality", "euler", "eulerdamp", "eulerseq", "exactmeshinertia", "exclude", "exponent", "extension", "extent",
    "face", "file", "filterparent", "fitscale", "fixed", "flag", "flex", "flexcomp", "flexstrain", "flexvert",
    "fluidcoef", "fluidshape", "focal", "force", "forcelimited", "forcerange", "fovy", "fpmax", "frame",
    "freejoint", "friction", "frictionloss", "fromto", "fullinertia", "fusestatic", "fvmax", "fwdinv", "gain",
    "gainprm", "gaintype", "gap", "gear", "general", "geom", "geom1", "geom2", "global", "gravcomp", "gravity",
    "group", "headlight", "hfield", "impratio", "inertia", "inertiafromgeom", "inertiagrouprange", "inertial",
    "inheritrange", "instance", "integrator", "interp", "interval", "inttotal", "intvelocity", "invdiscrete", "ipd",
    "island", "iterations", "jacobian", "joint", "joint1", "joint2", "jointinparent", "key", "keyframe", "kp", "kv",
    "layer", "lengthrange", "light", "limit", "limited", "lmax", "lmin", "ls_iterations", "ls_tolerance",
    "magnetic", "map", "margin", "mass", "material", "maxhullvert", "maxuse", "meaninertia", "meanmass", "meansize",
    "memory", "mesh", "meshdir", "midphase", "mintimeconst", "mocap", "mode", "model", "motor", "mpos",
    "mpr_iterations", "mpr_tolerance", "mquat", "multiccd", "multithread", "muscle", "nativeccd", "nconmax",
    "njmax", "nkey", "noise", "noslip_iterations", "noslip_tolerance", "nsample", "nstack", "numeric",
    "nuser_actuator", "nuser_body", "nuser_cam", "nuser_geom", "nuser_jnt", "nuser_sensor", "nuser_site",
    "nuser_tendon", "nuserdata", "o_friction", "o_margin", "o_solimp", "o_solref", "objtype", "offset", "option",
    "override", "pair", "passive", "pid", "pixel", "plugin", "polycoef", "pos", "position", "prefix", "priority", "pulley", "qpos",
    "quality", "quat", "qvel", "range", "ref", "refpos", "refquat", "refsafe", "refsite", "relpose", "replicate",
    "resolution", "rgba", "saveinertial", "scale", "sdf_initpoints", "sdf_iterations", "sensor", "sensorsize",
    "sep", "settotalmass", "shellinertia", "sidesite", "site", "site1", "site2", "size", "skin", "sleep",
    "sleep_tolerance", "slidersite", "smoothnormal", "solimp", "solimpfriction", "solimplimit", "solmix", "solref",
    "solreffriction", "solreflimit", "solver", "spatial", "specular", "spring", "springdamper", "springinertia",
    "springlength", "springref", "statistic", "stiffness", "strippath", "target", "tausmooth", "tendon", "tendon1",
    "tendon2", "text", "texture", "texturedir", "time", "timeconst", "timestep", "tolerance", "tolrange",
    "torquescale", "tuple", "type", "useaccel", "useexisting", "uselimit", "user", "usethread", "velocity",
    "vertex", "viscosity", "visual", "vmax", "warmstart", "weld", "width", "wind", "xmlns", "xyaxes", "zaxis",
    // clang-format on
};
static_assert(std::is_sorted(std::begin(known), std::end(known)));

}  // namespace

bool is_known(std::string_view name) { return std::binary_search(std::begin(known), std::end(known), name); }

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
