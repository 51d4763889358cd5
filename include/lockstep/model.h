// Model: one environment's mechanism, in names, doubles and SI units. SPDX-License-Identifier: Apache-2.0
//
// A Model is plain data. Fill it in code or read it from a file (import.h); either way compile()
// (plan.h) checks it and turns it into the tables that a Batch steps. Units: m, kg, s, rad, N, N m.
#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "lockstep/enums.h"
#include "lockstep/export.h"
#include "lockstep/softness.h"

namespace lockstep {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

// Without Eigen's alignment, which depends on the compiler's -m flags: a Model looks the same to an application
// compiled for AVX and to a library that was not.
using Pose = Eigen::Transform<double, 3, Eigen::Isometry, Eigen::DontAlign>;
using Twist = Eigen::Matrix<double, 6, 1, Eigen::DontAlign>;

/// Mass and its distribution, in the axes of the link's own frame.
struct Inertia {
  double mass = 0.0;                                       ///< kg
  Eigen::Vector3d center = Eigen::Vector3d::Zero();        ///< centre of mass in the link frame, m
  Eigen::Matrix3d about_center = Eigen::Matrix3d::Zero();  ///< rotational inertia about it, kg m^2

  /// A solid box of uniform density, its centre at `center`.
  LOCKSTEP_API static Inertia box(double mass, const Eigen::Vector3d& size, const Eigen::Vector3d& center);
};

struct Link {
  std::string name;
  Inertia inertia;
  /// The share of Model::gravity that acts on the link's mass; finite. Where it is 0, the link is balanced: it hangs at
  /// rest in any pose. Below 0 it rises.
  double gravity = 1.0;
};

enum class JointKind {
  fixed,       ///< the child is part of its parent: merged when compiling
  revolute,    ///< turns about the axis, rad
  continuous,  ///< the same without position limits. It turns for ever: see Batch::angles()
  prismatic,   ///< slides along the axis, m
  /// Moves no link: its position is a sum of other joints' positions, each times a ratio, and its forces act on them.
  /// A range, a spring, a servo, friction or an armature of such a sum: fixed tendons, differential drives. See
  /// Coupling. With a Joint::path, its position is the length of that instead: muscles, cables, ropes.
  tendon,
  /// One of the three parts of a ball joint, which Model::add_ball() makes: the last part's child turns about a point
  /// in any way. The parts are the child's axes x, y and z. Their velocities are the components along these axes of the
  /// child's angular velocity against the parent, rad/s. Their positions are those of the rotation vector: the child
  /// has turned by its length about its direction, rad, section 42 of docs/mathematics.md. That stays within pi, and
  /// jumps to the opposite vector there.
  ball,
};

/// What moves a joint towards its targets.
///
/// A servo applies effort = kp (target - q) + kd (target velocity - v), within the joint's effort limit. It is
/// integrated implicitly, (M13) of docs/mathematics.md.
///
/// A kinematic drive prescribes the motion instead, with whatever force that takes, (M58). Hard{1} puts the joint on
/// its target at the end of each step. Hard{erp} corrects that share of the error per step and adds the target
/// velocity. Soft ones pull as a soft coupling does. The joint's effort limit does not apply.
///
/// Both may be late: `delay` and `lag` are between the targets and feed-forward effort that a Batch shows and those
/// that the drive applies, (M153) and (M154). A reset fills both with what the Batch shows then. A motor's effort limit
/// may fall with its speed, (M155).
struct Drive {
  double kp = 0.0;                ///< N m/rad or N/m, >= 0
  double kd = 0.0;                ///< N m s/rad or N s/m, >= 0
  double position_target = 0.0;   ///< rad or m, the value that a Batch starts with
  double velocity_target = 0.0;   ///< rad/s or m/s
  bool kinematic = false;         ///< the position is prescribed; kp and kd are 0 then
  Softness softness = Hard{1.0};  ///< of a kinematic drive
  int delay = 0;                  ///< steps of dt that targets and efforts take to the drive, 0 to 1000
  double lag = 0.0;               ///< s, >= 0: time constant with which the drive then follows them
  /// Of a DC motor, both finite and > 0, or both infinite: its effort at rest, N m or N, and the speed, rad/s or m/s,
  /// at which none is left. The joint's effort limit, which has to be finite, bounds it further, and alone bounds
  /// braking.
  double stall_effort = infinity, no_load_speed = infinity;
};

/// A straight line from a point of one link to a point of another.
struct TendonSegment {
  std::string first, second;  ///< links; empty: the world
  Eigen::Vector3d first_point = Eigen::Vector3d::Zero(), second_point = Eigen::Vector3d::Zero();  ///< in the link, m
  double share = 1.0;  ///< > 0: how much of its length counts; 1 / n where n strands run side by side
};

struct Joint {
  std::string name;
  JointKind kind = JointKind::fixed;
  std::string parent;                               ///< link that carries the joint; empty for a tendon
  std::string child;                                ///< link that it moves; empty for a tendon
  Pose origin = Pose::Identity();                   ///< child frame in the parent's at q = 0
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  ///< in the child frame; any length > 0

  double damping = 0.0;   ///< N m s/rad or N s/m, >= 0
  double armature = 0.0;  ///< rotor inertia seen at the joint, kg m^2 or kg, >= 0
  /// A spring beside the drive, N m/rad or N/m, >= 0. It is passive, so no effort limit bounds it, and implicit, so
  /// none is too stiff for a step.
  double stiffness = 0.0;
  double rest = 0.0;  ///< where the spring has no force, rad or m
  Drive drive;
  double effort = 0.0;  ///< feed-forward effort, N m or N

  // Bounds, section 12 of docs/mathematics.md; StepSettings::ignore leaves them out of a step.
  /// Position range, rad or m; lower <= upper. That of a ball's first part is for the angle: lower is -infinity, and
  /// upper more than 0. The other two parts have none.
  double lower = -infinity, upper = infinity;
  Softness limit_softness = Hard{};  ///< of both ends of the range
  double restitution = 0.0;          ///< share of the speed that a hard end gives back, 0 to 1
  double velocity_limit = infinity;  ///< rad/s or m/s, > 0; hard
  double effort_limit = infinity;    ///< N m or N, >= 0: of servo and feed-forward effort together
  double friction = 0.0;             ///< dry friction, N m or N, >= 0

  double position = 0.0;  ///< state after reset(), rad or m; a tendon's is that of its joints, whatever stands here
  double velocity = 0.0;  ///< rad/s or m/s; the same
  /// Of a spatial tendon: its position is the sum of these lengths, each times its share, m. No coupling says it then.
  /// A segment without length has no direction, and pulls at nothing. Section 43 of docs/mathematics.md.
  std::vector<TendonSegment> path = {};

  bool moves() const { return kind != JointKind::fixed; }
};

/// A function of a leader's position x, rad or m, that a follower's position is: q = f(x). A polynomial,
/// q = c_0 + c_1 x + c_2 x^2 + ...
struct Polynomial {
  std::vector<double> coefficients;  ///< c_0, c_1 ...: at least 2, at most 16
};

/// A cam: the cubic spline through points, straight beyond its ends.
struct CamTable {
  std::vector<double> leader;    ///< rad or m, ascending, 3 to 1000, 1e-5 of their length apart or more
  std::vector<double> follower;  ///< rad or m, as many
};

/// A crank: q = mean + cosine cos(rate x) + sine sin(rate x).
struct Harmonic {
  double mean = 0.0, cosine = 0.0, sine = 0.0;  ///< rad or m
  double rate = 1.0;                            ///< rad per rad or m of the leader, not 0
};

using Function = std::variant<Polynomial, CamTable, Harmonic>;

struct CouplingTerm {
  std::string joint;
  double ratio = 1.0;  ///< G of (3) and (17) of the note (PhysX, Mimic Joints); finite, not 0
};

/// A linear relation of joint positions, (17) of the note:
///     C = q_joint + ratio_1 q_1 + ... + ratio_k q_k + offset = 0.
/// With one term it is the mimic joint (3). The joints may lie anywhere in the tree.
/// URDF's q_joint = multiplier * q_leader + offset is ratio = -multiplier, offset = -offset.
///
/// A tendon without a path is the follower of one coupling, hard and without a force limit, which says what its
/// position is. No tendon leads a coupling. q_tendon = q_1 + q_2 is the ratios -1 and -1.
struct Coupling {
  std::string joint;                ///< the follower
  std::vector<CouplingTerm> terms;  ///< its leaders
  double offset = 0.0;              ///< gamma
  Softness softness;
  double force_limit = infinity;  ///< > 0, of the force along the first joint, N m or N; beyond it the coupling slips
  /// Where it is given, C = q_joint - f(q_1) = 0. The coupling has one leader, of ratio 1, no offset and no force
  /// limit, and it is hard. It needs the method reduced.
  std::optional<Function> function = {};

  /// `follower` + ratio * `leader` + offset = 0.
  static Coupling mimic(std::string follower, std::string leader, double ratio, double offset = 0.0,
                        Softness softness = {}) {
    return {std::move(follower), {{std::move(leader), ratio}}, offset, softness, infinity, {}};
  }

  /// `follower` = f(`leader`).
  static Coupling cam(std::string follower, std::string leader, Function f) {
    return {std::move(follower), {{std::move(leader), 1.0}}, 0.0, {}, infinity, std::move(f)};
  }
};

/// A joint that closes a loop, section 30 of docs/mathematics.md: it holds a frame on one link to a frame on another,
/// or in the world. A tree has all other joints; what a loop holds follows from theirs. compile() closes the loops of
/// a model: from its joints' positions, it takes the closest pose in which the frames meet.
struct Loop {
  std::string name;
  LoopKind kind = LoopKind::point;
  std::string first, second;            ///< links; empty: the world, for one of the two
  Pose first_pose = Pose::Identity();   ///< the frame in the first link, or in the world
  Pose second_pose = Pose::Identity();  ///< the frame in the second link, or in the world
  Eigen::Vector3d axis{0.0, 0.0, 1.0};  ///< of a hinge or a slider, in both frames; any length > 0
  Softness softness = Hard{1.0};        ///< of all rows
  double force_limit = infinity;        ///< of each row that holds the origins, N, > 0
  double torque_limit = infinity;       ///< of each row that holds the directions, N m, > 0
};

/// A named frame on a link: a fingertip, a sensor.
struct Site {
  std::string name;
  std::string link;
  Pose pose = Pose::Identity();  ///< in the link frame
};

inline constexpr ShapeKind all_shape_kinds[] = {ShapeKind::half_space, ShapeKind::height_field, ShapeKind::box,
                                                ShapeKind::hull,       ShapeKind::cylinder,     ShapeKind::capsule,
                                                ShapeKind::ellipsoid,  ShapeKind::sphere};

/// The enumerator's name: "half_space", "box" ... The string lives forever.
LOCKSTEP_API const char* to_string(ShapeKind kind) noexcept;

/// A solid.
struct Shape {
  ShapeKind kind = ShapeKind::sphere;
  /// Height field: its edges along x and y. Box: its edges along x, y and z. Hull: radius, >= 0. Cylinder: radius, and
  /// length along z. Capsule: radius, and length of the cylinder between its half spheres, which lies along z.
  /// Ellipsoid: semi-axes along x, y and z. Sphere: radius. m, > 0. Numbers that a kind does not have are 0.
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  /// Of a hull: 3 x n, m. Their convex hull has 4 to 64 corners. The other kinds have none.
  Eigen::Matrix3Xd points = {};
  /// Of a height field: m, 2 x 2 or more, at most 2.7 million. A column has the heights along y, from -size[1] / 2 to
  /// size[1] / 2, and columns go along x in the same way. The other kinds have none.
  Eigen::MatrixXd heights = {};

  /// Everything below the plane z = 0 of the collider's frame. It never moves.
  static Shape half_space() { return {ShapeKind::half_space, Eigen::Vector3d::Zero()}; }
  /// Everything below a surface through heights on a grid, about the collider's origin. Each cell is two triangles, cut
  /// from its corner of least x and y. Beyond its edges there is nothing. It never moves. What touches it does so by
  /// points: docs/contacts.md says which.
  static Shape height_field(Eigen::MatrixXd heights, double edge_x, double edge_y) {
    return {ShapeKind::height_field, {edge_x, edge_y, 0.0}, {}, std::move(heights)};
  }
  static Shape box(const Eigen::Vector3d& edges) { return {ShapeKind::box, edges}; }
  /// All within `radius` of the convex hull of `points`, which is 3 x n.
  static Shape hull(Eigen::Matrix3Xd points, double radius = 0.0) {
    return {ShapeKind::hull, {radius, 0.0, 0.0}, std::move(points)};
  }
  static Shape cylinder(double radius, double length) { return {ShapeKind::cylinder, {radius, length, 0.0}}; }
  static Shape capsule(double radius, double length) { return {ShapeKind::capsule, {radius, length, 0.0}}; }
  static Shape ellipsoid(const Eigen::Vector3d& semi_axes) { return {ShapeKind::ellipsoid, semi_axes}; }
  static Shape sphere(double radius) { return {ShapeKind::sphere, {radius, 0.0, 0.0}}; }
};

/// A solid on a link, or in the world. It touches others only as Model::contacts says.
struct Collider {
  std::string name = {};
  std::string link = {};  ///< empty: it stands in the world
  Shape shape = {};
  Pose pose = Pose::Identity();  ///< in the link's frame, or in the world's
  double friction = 0.5;         ///< Coulomb's coefficient, 0 to 100. A pair has the geometric mean of both
  double restitution = 0.0;      ///< share of the speed that an impact gives back, 0 to 1. A pair has the larger one
  /// How far contacts yield, section 23 of docs/mathematics.md. Hard ones yield by a thousandth of what the mass that
  /// they move would, and lose the share `erp` of an overlap per step.
  Softness softness = Hard{};
  std::string group = {};  ///< empty: in none
  /// The largest moments about the normal and about the tangents over the normal force, m, >= 0. A pair has the larger
  /// ones, and needs a `friction`, with which they share one cone: (M171) of docs/mathematics.md. A disc of radius r
  /// that presses evenly has a torsional friction of two thirds of r times its `friction`.
  double torsional_friction = 0.0, rolling_friction = 0.0;
};

/// Colliders that may touch: two of them, or all of a group with one or with all of another group, or with each other.
/// A group leaves out pairs that cannot move against each other and those on links that a joint connects;
/// Plan::describe() lists these. Two colliders that are named here may touch whatever connects them.
struct Contact {
  std::string first, second;  ///< each the name of a collider or of a group
  // Where these are absent, the colliders' own numbers hold, and colliders that differ from the default in softness
  // have to agree.
  std::optional<double> friction = {}, restitution = {};
  std::optional<Softness> softness = {};
  std::optional<double> torsional_friction = {}, rolling_friction = {};
};

/// Where a tree of links begins: at a link that no joint carries, bolted to the world or floating in it.
///
/// Conventions of a floating root, here and wherever a Batch shows them:
/// - its pose maps coordinates of the root link's frame to world coordinates (p_world = R p + t);
/// - quaternions are unit, stored w, x, y, z, and stand for that same R;
/// - its velocity is a twist in the axes of the root link's own frame: first the angular velocity
///   (rad/s), then the velocity of the frame's origin (m/s), as in Featherstone (2008), section 2.
struct Root {
  std::string link;  ///< name of the root link
  bool floating = false;
  Pose pose = Pose::Identity();
  Twist velocity = Twist::Zero();
};

/// A pose to start in, beside the model's own: a stand, a grasp. Batch::reset_to() goes there. MJCF calls it a
/// keyframe. What it does not name is as the model starts.
struct NamedPose {
  std::string name = {};
  std::map<std::string, double> positions = {};   ///< by joint, rad or m; followers are placed by their couplings
  std::map<std::string, double> velocities = {};  ///< by joint, rad/s or m/s
  /// By joint, rad or m. A drive that is not named holds the joint where `positions` has it.
  std::map<std::string, double> position_targets = {};
  std::map<std::string, double> velocity_targets = {};  ///< by joint, rad/s or m/s
  std::map<std::string, double> efforts = {};           ///< by joint, N m or N
  std::map<std::string, Pose> root_poses = {};          ///< by the link of a floating root
  std::map<std::string, Twist> root_velocities = {};    ///< the same, as Root::velocity
};

/// Links and joints form one tree or several. A tree stands or floats in the world, which is no link.
struct Model {
  std::string name = "model";
  std::vector<Link> links;
  std::vector<Joint> joints;
  std::vector<Coupling> couplings;
  std::vector<Loop> loops;
  std::vector<Site> sites;
  std::vector<Collider> colliders;
  std::vector<Contact> contacts;
  /// One for each tree, in the order in which a Batch shows floating roots. May be empty if there is one tree: it is
  /// bolted to the world's origin then.
  std::vector<Root> roots;
  Eigen::Vector3d gravity{0.0, 0.0, -9.81};  ///< m/s^2, world axes
  std::vector<NamedPose> poses = {};         ///< to start in, beside the state of the joints and roots above
  /// s, >= 0: the step that the file asks for; 0 if it asks for none. A Plan takes the step of its StepSettings.
  double time_step = 0.0;

  /// Throws ModelError for the first rule that is broken: names unique and known, trees with a root each, finite
  /// numbers in their ranges, inertias that a body can have, couplings between moving joints, contacts of colliders
  /// that can meet, poses of joints that move and roots that float.
  /// A tensor is judged as part of the body that its link forms with all links fixed to it. Links
  /// may be without mass where the mass matrix is positive definite at the model's start.
  /// compile() calls it.
  LOCKSTEP_API void validate() const;

  /// Adds a site at a pose in the link's frame. Throws ModelError for an unknown link and for a name that is empty or
  /// taken. The reference holds until the next site is added.
  LOCKSTEP_API Site& add_site(const std::string& name, const std::string& link, const Pose& pose = Pose::Identity());

  /// Adds a ball joint between two links: the joints `name`.x, `name`.y and `name`.z of kind ball, and the links
  /// without mass between them, which are called as the joints. `origin` is the child's frame in the parent's at rest.
  /// Throws ModelError where the name is empty or one of these is taken. Returns the number of the first joint; the
  /// others follow it.
  LOCKSTEP_API int add_ball(const std::string& name, const std::string& parent, const std::string& child,
                            const Pose& origin = Pose::Identity());

  /// Index of the element of that name; throws ModelError where there is none.
  LOCKSTEP_API int link_index(const std::string& link) const;
  LOCKSTEP_API int joint_index(const std::string& joint) const;
  LOCKSTEP_API int site_index(const std::string& site) const;

  /// Names of the colliders at the ends of chains, in the order of the colliders: on bodies that move and carry no
  /// other moving body, such as feet, fingertips and free objects. Links that fixed joints connect are one body. Throws
  /// ModelError where links and joints form no trees, and for an unknown link.
  LOCKSTEP_API std::vector<std::string> end_colliders() const;
};

/// Names of the couplings in files and reports: the follower's name, with "#2", "#3" ... behind it where several
/// couplings have the same follower. Length: couplings.
LOCKSTEP_API std::vector<std::string> coupling_names(const Model& model);

}  // namespace lockstep
