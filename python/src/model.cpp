// Models between C++ and the classes of lockstep/model.py. SPDX-License-Identifier: Apache-2.0
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>

#include "convert.h"

namespace lockstep::python {
namespace {

using namespace pybind11::literals;

py::object python_class(const char* name) { return py::module_::import("lockstep.model").attr(name); }

[[noreturn]] void refuse(const py::handle& element, const char* attribute) {
  const py::object name = py::getattr(element, "name", py::type::of(element).attr("__name__"));
  throw py::type_error(py::str("{}: {} cannot be {!r}").format(name, attribute, element.attr(attribute)));
}

template <class Value>
void read(const py::handle& element, const char* attribute, Value& to) {
  try {
    to = element.attr(attribute).cast<Value>();
  } catch (const py::cast_error&) {
    refuse(element, attribute);
  }
}

// A vector or matrix of this size, or with any number of rows, from nested sequences or an array; `refuse` throws where
// it is none.
template <class Matrix, class Refuse>
Matrix matrix_from(const py::handle& given, const Refuse& refuse) {
  using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
  constexpr int columns = Matrix::ColsAtCompileTime;
  Numbers numbers;
  try {
    numbers = Numbers(py::reinterpret_borrow<py::object>(given));
  } catch (py::error_already_set&) {
    refuse();
  }
  constexpr bool any_rows = Matrix::RowsAtCompileTime == Eigen::Dynamic;
  py::ssize_t rows = Matrix::RowsAtCompileTime;
  if (any_rows) rows = numbers.ndim() > 0 ? numbers.shape(0) : 0;
  const bool none = any_rows && numbers.ndim() == 1 && rows == 0;  // an empty sequence has no columns
  const bool fits =
      none || (columns == 1 ? numbers.ndim() == 1 && numbers.shape(0) == rows
                            : numbers.ndim() == 2 && numbers.shape(0) == rows && numbers.shape(1) == columns);
  if (!fits) refuse();
  Matrix matrix(rows, columns);
  for (py::ssize_t i = 0; i < rows; ++i)
    for (int k = 0; k < columns; ++k) matrix(i, k) = numbers.data()[i * columns + k];
  return matrix;
}

template <class Matrix>
Matrix matrix_of(const py::handle& element, const char* attribute) {
  return matrix_from<Matrix>(element.attr(attribute), [&] { refuse(element, attribute); });
}

template <class Matrix>
py::tuple tuple_of(const Matrix& matrix) {
  py::tuple rows(matrix.rows());
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    if (matrix.cols() == 1) {
      rows[i] = py::float_(matrix(i, 0));
      continue;
    }
    py::tuple row(matrix.cols());
    for (Eigen::Index k = 0; k < matrix.cols(); ++k) row[k] = py::float_(matrix(i, k));
    rows[i] = row;
  }
  return rows;
}

Pose pose_of(const py::handle& element, const char* attribute) {
  Pose pose;
  pose.matrix() = matrix_of<Eigen::Matrix4d>(element, attribute);
  return pose;
}

constexpr const char* joint_kinds[] = {"fixed", "revolute", "continuous", "prismatic", "tendon", "ball"};

JointKind kind_of(const py::handle& joint) {
  std::string kind;
  read(joint, "kind", kind);
  for (int k = 0; k < 6; ++k)
    if (kind == joint_kinds[k]) return static_cast<JointKind>(k);
  throw ModelError("joint '" + text_of(joint.attr("name")) + "'", "is of the unknown kind '" + kind + "'",
                   "give fixed, revolute, continuous, prismatic, tendon or ball");
}

Softness softness_of(const py::handle& element, const char* attribute) {
  const py::object softness = element.attr(attribute);
  const auto number = [&](const char* name) {
    double value = 0.0;
    read(softness, name, value);
    return value;
  };
  const auto is = [&](const char* name) { return py::isinstance(softness, python_class(name)); };
  if (is("Hard")) return Hard{number("erp")};
  if (is("ErpCfm")) return ErpCfm{number("erp"), number("cfm")};
  if (is("Spring")) return Spring{number("kp"), number("kd")};
  if (is("Frequency")) return Frequency{number("rad_per_s"), number("damping_ratio")};
  refuse(element, attribute);
}

struct SoftnessToPython {
  py::object operator()(const Hard& s) const { return python_class("Hard")(s.erp); }
  py::object operator()(const ErpCfm& s) const { return python_class("ErpCfm")(s.erp, s.cfm); }
  py::object operator()(const Spring& s) const { return python_class("Spring")(s.kp, s.kd); }
  py::object operator()(const Frequency& s) const { return python_class("Frequency")(s.rad_per_s, s.damping_ratio); }
};

// Every number of a joint that has the same name in both languages.
template <class Visit>
void each_number(Joint& j, Visit&& visit) {
  visit("damping", j.damping), visit("armature", j.armature), visit("stiffness", j.stiffness), visit("rest", j.rest);
  visit("effort", j.effort), visit("lower", j.lower), visit("upper", j.upper), visit("restitution", j.restitution);
  visit("velocity_limit", j.velocity_limit), visit("effort_limit", j.effort_limit), visit("friction", j.friction);
  visit("position", j.position), visit("velocity", j.velocity);
}
template <class Visit>
void each_number(Drive& d, Visit&& visit) {
  visit("kp", d.kp), visit("kd", d.kd), visit("position_target", d.position_target);
  visit("velocity_target", d.velocity_target), visit("kinematic", d.kinematic), visit("delay", d.delay);
  visit("lag", d.lag), visit("stall_effort", d.stall_effort), visit("no_load_speed", d.no_load_speed);
}

TendonSegment segment_of(const py::handle& from) {
  TendonSegment segment;
  read(from, "first", segment.first), read(from, "second", segment.second);
  segment.first_point = matrix_of<Eigen::Vector3d>(from, "first_point");
  segment.second_point = matrix_of<Eigen::Vector3d>(from, "second_point");
  read(from, "share", segment.share);
  return segment;
}

Joint joint_of(const py::handle& from) {
  Joint joint;
  read(from, "name", joint.name), read(from, "parent", joint.parent), read(from, "child", joint.child);
  joint.kind = kind_of(from);
  joint.origin = pose_of(from, "origin");
  joint.axis = matrix_of<Eigen::Vector3d>(from, "axis");
  each_number(joint, [&](const char* name, double& number) { read(from, name, number); });
  const py::object drive = from.attr("drive");
  each_number(joint.drive, [&](const char* name, auto& number) { read(drive, name, number); });
  joint.drive.softness = softness_of(drive, "softness");
  joint.limit_softness = softness_of(from, "limit_softness");
  for (const py::handle& segment : from.attr("path")) joint.path.push_back(segment_of(segment));
  return joint;
}

py::object joint_to_python(Joint joint) {
  py::object drive = python_class("Drive")();
  each_number(joint.drive, [&](const char* name, auto number) { drive.attr(name) = number; });
  drive.attr("softness") = std::visit(SoftnessToPython{}, joint.drive.softness);
  py::object to = python_class("Joint")(joint.name, joint_kinds[static_cast<int>(joint.kind)], joint.parent,
                                        joint.child, tuple_of(joint.origin.matrix()), tuple_of(joint.axis));
  each_number(joint, [&](const char* name, double number) { to.attr(name) = number; });
  to.attr("drive") = drive;
  to.attr("limit_softness") = std::visit(SoftnessToPython{}, joint.limit_softness);
  py::list path;
  for (const TendonSegment& s : joint.path)
    path.append(
        python_class("TendonSegment")(s.first, s.second, tuple_of(s.first_point), tuple_of(s.second_point), s.share));
  to.attr("path") = path;
  return to;
}

std::optional<Function> function_of(const py::handle& coupling) {
  const py::object function = coupling.attr("function");
  if (function.is_none()) return std::nullopt;
  const auto is = [&](const char* name) { return py::isinstance(function, python_class(name)); };
  if (is("Polynomial")) {
    Polynomial polynomial;
    read(function, "coefficients", polynomial.coefficients);
    return polynomial;
  }
  if (is("CamTable")) {
    CamTable table;
    read(function, "leader", table.leader), read(function, "follower", table.follower);
    return table;
  }
  if (is("Harmonic")) {
    Harmonic harmonic;
    read(function, "mean", harmonic.mean), read(function, "cosine", harmonic.cosine);
    read(function, "sine", harmonic.sine), read(function, "rate", harmonic.rate);
    return harmonic;
  }
  refuse(coupling, "function");
}

struct FunctionToPython {
  py::object operator()(const Polynomial& p) const { return python_class("Polynomial")(p.coefficients); }
  py::object operator()(const CamTable& t) const { return python_class("CamTable")(t.leader, t.follower); }
  py::object operator()(const Harmonic& h) const { return python_class("Harmonic")(h.mean, h.cosine, h.sine, h.rate); }
};

Coupling coupling_of(const py::handle& from) {
  Coupling coupling;
  read(from, "joint", coupling.joint);
  std::vector<std::pair<std::string, double>> terms;
  read(from, "terms", terms);
  for (auto& [joint, ratio] : terms) coupling.terms.push_back({joint, ratio});
  read(from, "offset", coupling.offset), read(from, "force_limit", coupling.force_limit);
  coupling.softness = softness_of(from, "softness");
  coupling.function = function_of(from);
  return coupling;
}

py::object coupling_to_python(const Coupling& coupling) {
  py::list terms;
  for (const CouplingTerm& term : coupling.terms) terms.append(py::make_tuple(term.joint, term.ratio));
  const py::object function = coupling.function ? std::visit(FunctionToPython{}, *coupling.function) : py::none();
  return python_class("Coupling")(coupling.joint, terms, coupling.offset,
                                  std::visit(SoftnessToPython{}, coupling.softness), coupling.force_limit, function);
}

// The kind of that name. Throws ModelError, as the element has none.
template <class Kind, std::size_t n>
Kind kind_of(const std::string& name, const Kind (&all)[n], const std::string& element, const char* rule,
             const char* remedy) {
  const auto found = std::find_if(all, all + n, [&](Kind kind) { return to_string(kind) == name; });
  if (found == all + n) throw ModelError(element, rule + (" '" + name + "'"), remedy);
  return *found;
}

Loop loop_of(const py::handle& from) {
  Loop loop;
  std::string kind;
  read(from, "name", loop.name), read(from, "first", loop.first), read(from, "second", loop.second);
  read(from, "kind", kind);
  loop.kind = kind_of(kind, all_loop_kinds, "loop '" + loop.name + "'", "is of the unknown kind",
                      "give point, hinge, slider or weld");
  loop.first_pose = pose_of(from, "first_pose"), loop.second_pose = pose_of(from, "second_pose");
  loop.axis = matrix_of<Eigen::Vector3d>(from, "axis");
  loop.softness = softness_of(from, "softness");
  read(from, "force_limit", loop.force_limit), read(from, "torque_limit", loop.torque_limit);
  return loop;
}

py::object loop_to_python(const Loop& l) {
  return python_class("Loop")(l.name, to_string(l.kind), l.first, l.second, tuple_of(l.first_pose.matrix()),
                              tuple_of(l.second_pose.matrix()), tuple_of(l.axis),
                              std::visit(SoftnessToPython{}, l.softness), l.force_limit, l.torque_limit);
}

// Rows in Python are rows here.
Eigen::MatrixXd heights_of(const py::handle& shape) {
  const auto numbers = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(shape.attr("heights"));
  if (!numbers) throw py::type_error("heights are no array of numbers: give rows of one length");
  if (numbers.size() == 0) return {};
  if (numbers.ndim() != 2)
    throw UsageError("heights", "have the shape " + text_of(numbers.attr("shape")), "give [rows, columns]");
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      numbers.data(), numbers.shape(0), numbers.shape(1));
}

Collider collider_of(const py::handle& from) {
  Collider collider;
  read(from, "name", collider.name), read(from, "link", collider.link), read(from, "group", collider.group);
  read(from, "friction", collider.friction), read(from, "restitution", collider.restitution);
  read(from, "torsional_friction", collider.torsional_friction);
  read(from, "rolling_friction", collider.rolling_friction);
  collider.pose = pose_of(from, "pose");
  collider.softness = softness_of(from, "softness");
  const py::object shape = from.attr("shape");
  std::string kind;
  read(shape, "kind", kind);
  collider.shape = {
      kind_of(kind, all_shape_kinds, "collider '" + collider.name + "'", "has a shape of the unknown kind",
              "give half_space, height_field, box, hull, cylinder, capsule, ellipsoid or sphere"),
      matrix_of<Eigen::Vector3d>(shape, "size"),
      matrix_of<Eigen::Matrix<double, Eigen::Dynamic, 3>>(shape, "points").transpose(), heights_of(shape)};
  return collider;
}

py::object collider_to_python(const Collider& c) {
  return python_class("Collider")(
      c.name, c.link,
      python_class("Shape")(to_string(c.shape.kind), tuple_of(c.shape.size),
                            tuple_of(Eigen::Matrix<double, Eigen::Dynamic, 3>(c.shape.points.transpose())),
                            tuple_of(c.shape.heights)),
      tuple_of(c.pose.matrix()), c.friction, c.restitution, std::visit(SoftnessToPython{}, c.softness), c.group,
      c.torsional_friction, c.rolling_friction);
}

Contact contact_of(const py::handle& from) {
  Contact contact;
  read(from, "first", contact.first), read(from, "second", contact.second);
  read(from, "friction", contact.friction), read(from, "restitution", contact.restitution);
  read(from, "torsional_friction", contact.torsional_friction);
  read(from, "rolling_friction", contact.rolling_friction);
  if (!from.attr("softness").is_none()) contact.softness = softness_of(from, "softness");
  return contact;
}

py::object contact_to_python(const Contact& c) {
  const py::object softness = c.softness ? std::visit(SoftnessToPython{}, *c.softness) : py::none();
  return python_class("Contact")(c.first, c.second, c.friction, c.restitution, softness, c.torsional_friction,
                                 c.rolling_friction);
}

NamedPose named_pose_of(const py::handle& from) {
  NamedPose pose;
  read(from, "name", pose.name), read(from, "positions", pose.positions), read(from, "velocities", pose.velocities);
  read(from, "position_targets", pose.position_targets), read(from, "velocity_targets", pose.velocity_targets);
  read(from, "efforts", pose.efforts);
  std::map<std::string, py::object> poses, velocities;
  read(from, "root_poses", poses), read(from, "root_velocities", velocities);
  for (const auto& [link, matrix] : poses)
    pose.root_poses[link].matrix() = matrix_from<Eigen::Matrix4d>(matrix, [&] { refuse(from, "root_poses"); });
  for (const auto& [link, twist] : velocities)
    pose.root_velocities[link] =
        matrix_from<Eigen::Matrix<double, 6, 1>>(twist, [&] { refuse(from, "root_velocities"); });
  return pose;
}

py::object named_pose_to_python(const NamedPose& p) {
  py::dict poses, velocities;
  for (const auto& [link, pose] : p.root_poses) poses[py::str(link)] = tuple_of(pose.matrix());
  for (const auto& [link, twist] : p.root_velocities) velocities[py::str(link)] = tuple_of(twist);
  return python_class("NamedPose")(p.name, p.positions, p.velocities, p.position_targets, p.velocity_targets, p.efforts,
                                   poses, velocities);
}

}  // namespace

Model model_of(const py::handle& from) {
  if (!py::isinstance(from, python_class("Model")))
    throw py::type_error("a lockstep.Model is needed, not a " + text_of(py::type::of(from)));
  Model model;
  read(from, "name", model.name);
  for (const py::handle& link : from.attr("links")) {
    const py::object inertia = link.attr("inertia");
    model.links.emplace_back();
    read(link, "name", model.links.back().name);
    read(inertia, "mass", model.links.back().inertia.mass);
    model.links.back().inertia.center = matrix_of<Eigen::Vector3d>(inertia, "center");
    model.links.back().inertia.about_center = matrix_of<Eigen::Matrix3d>(inertia, "about_center");
    read(link, "gravity", model.links.back().gravity);
  }
  for (const py::handle& joint : from.attr("joints")) model.joints.push_back(joint_of(joint));
  for (const py::handle& coupling : from.attr("couplings")) model.couplings.push_back(coupling_of(coupling));
  for (const py::handle& loop : from.attr("loops")) model.loops.push_back(loop_of(loop));
  for (const py::handle& site : from.attr("sites")) {
    model.sites.emplace_back();
    read(site, "name", model.sites.back().name), read(site, "link", model.sites.back().link);
    model.sites.back().pose = pose_of(site, "pose");
  }
  for (const py::handle& collider : from.attr("colliders")) model.colliders.push_back(collider_of(collider));
  for (const py::handle& contact : from.attr("contacts")) model.contacts.push_back(contact_of(contact));
  for (const py::handle& root : from.attr("roots")) {
    model.roots.emplace_back();
    read(root, "link", model.roots.back().link), read(root, "floating", model.roots.back().floating);
    model.roots.back().pose = pose_of(root, "pose");
    model.roots.back().velocity = matrix_of<Eigen::Matrix<double, 6, 1>>(root, "velocity");
  }
  model.gravity = matrix_of<Eigen::Vector3d>(from, "gravity");
  for (const py::handle& pose : from.attr("poses")) model.poses.push_back(named_pose_of(pose));
  read(from, "time_step", model.time_step);
  return model;
}

py::object to_python(const Model& model) {
  py::list links, joints, couplings, loops, sites, colliders, contacts, roots, poses;
  for (const Link& link : model.links)
    links.append(python_class("Link")(
        link.name,
        python_class("Inertia")(link.inertia.mass, tuple_of(link.inertia.center), tuple_of(link.inertia.about_center)),
        link.gravity));
  for (const Joint& joint : model.joints) joints.append(joint_to_python(joint));
  for (const Coupling& coupling : model.couplings) couplings.append(coupling_to_python(coupling));
  for (const Loop& loop : model.loops) loops.append(loop_to_python(loop));
  for (const Site& site : model.sites)
    sites.append(python_class("Site")(site.name, site.link, tuple_of(site.pose.matrix())));
  for (const Collider& collider : model.colliders) colliders.append(collider_to_python(collider));
  for (const Contact& contact : model.contacts) contacts.append(contact_to_python(contact));
  for (const Root& root : model.roots)
    roots.append(python_class("Root")(root.link, root.floating, tuple_of(root.pose.matrix()), tuple_of(root.velocity)));
  for (const NamedPose& pose : model.poses) poses.append(named_pose_to_python(pose));
  return python_class("Model")(model.name, links, joints, couplings, loops, sites, colliders, contacts, roots,
                               tuple_of(model.gravity), poses, model.time_step);
}

}  // namespace lockstep::python
