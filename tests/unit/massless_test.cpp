// Links without mass: Model::validate() accepts a model exactly where its mass matrix is positive definite.
// SPDX-License-Identifier: Apache-2.0
//
// The matrix is the sum of J^T I J over all links, from the velocities of their centres in world axes. So it shares
// nothing with the pivots that validate() computes.
#include <random>

#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "physics.h"
#include "reference/step.h"

namespace lockstep {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// The mass matrix, armatures included. `q` by joint. Parents come before their children in Model::joints.
MatrixXd mass_matrix(const Model& model, const std::vector<double>& q) {
  const bool floats = !model.roots.empty() && model.roots[0].floating;
  const int root = floats ? 6 : 0;
  int size = root;
  for (const Joint& joint : model.joints) size += joint.moves();
  struct Frame {
    Isometry3d pose = Isometry3d::Identity();
    MatrixXd turning, moving;  // angular velocity, and velocity of the frame's origin, by generalised velocity
  };
  std::vector<Frame> frames(model.links.size(),
                            {Isometry3d::Identity(), MatrixXd::Zero(3, size), MatrixXd::Zero(3, size)});
  const auto shifted = [](const Frame& frame, const Vector3d& to) {  // velocity of another point of the body
    MatrixXd moving = frame.moving;
    const Vector3d arm = to - frame.pose.translation();
    for (int i = 0; i < moving.cols(); ++i) moving.col(i) += Vector3d(frame.turning.col(i)).cross(arm);
    return moving;
  };
  if (root > 0) frames[0].turning.leftCols(3) = frames[0].moving.middleCols(3, 3) = Matrix3d::Identity();
  MatrixXd mass = MatrixXd::Zero(size, size);
  int dof = root;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const Joint& joint = model.joints[j];
    const Frame& parent = frames[model.link_index(joint.parent)];
    Frame& child = frames[model.link_index(joint.child)];
    child.pose = parent.pose * Isometry3d(joint.origin);
    const Vector3d axis = child.pose.linear() * joint.axis.normalized();
    if (joint.kind == JointKind::prismatic) child.pose = Eigen::Translation3d(q[j] * axis) * child.pose;
    child.turning = parent.turning;
    child.moving = shifted(parent, child.pose.translation());
    if (!joint.moves()) continue;
    if (joint.kind == JointKind::prismatic) {
      child.moving.col(dof) += axis;
    } else {
      child.pose.rotate(Eigen::AngleAxisd(q[j], joint.axis.normalized()));
      child.turning.col(dof) += axis;
    }
    mass(dof, dof) += joint.armature;
    ++dof;
  }
  for (std::size_t i = floats ? 0 : 1; i < frames.size(); ++i) {
    const Inertia& body = model.links[i].inertia;
    const Matrix3d turn = frames[i].pose.linear();
    const MatrixXd center = shifted(frames[i], frames[i].pose * body.center);
    mass += body.mass * center.transpose() * center +
            frames[i].turning.transpose() * turn * body.about_center * turn.transpose() * frames[i].turning;
  }
  return mass;
}

// Of the matrix with its diagonal scaled to 1; 0 if it has a zero on the diagonal.
double smallest_eigenvalue(MatrixXd mass) {
  if (mass.size() == 0) return 1.0;
  if (!(mass.diagonal().minCoeff() > 1e-13)) return 0.0;
  const VectorXd unit = mass.diagonal().cwiseSqrt().cwiseInverse();
  mass = unit.asDiagonal() * mass * unit.asDiagonal();
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(mass).eigenvalues()[0];
}

// Trees with axes and offsets of a coarse grid, so that axes often meet, coincide or are parallel. Most links have no
// mass, others are point masses, thin rods, bodies or rotors.
class RandomTrees {
 public:
  explicit RandomTrees(unsigned seed) : random_(seed) {}

  Model next() {
    Model model;
    model.roots = {{"l0", pick(6) == 0}};
    const int links = 2 + pick(5);
    for (int i = 0; i < links; ++i) model.links.push_back({physics::numbered("l", i), inertia(i == 0)});
    for (int i = 1; i < links; ++i) {
      Joint joint;
      joint.name = physics::numbered("j", i);
      joint.parent = physics::numbered("l", pick(3) == 0 ? pick(i) : i - 1);
      joint.child = physics::numbered("l", i);
      joint.kind = pick(8) == 0 ? JointKind::fixed : pick(4) == 0 ? JointKind::prismatic : JointKind::continuous;
      joint.axis = Vector3d::Unit(pick(3)) * (pick(2) == 0 ? 1.0 : -2.0);
      joint.origin.translation() = grid_point();
      if (pick(3) == 0) joint.origin.linear() = Eigen::AngleAxisd(angle(), Vector3d::Unit(pick(3))).toRotationMatrix();
      if (joint.kind != JointKind::fixed) joint.position = pick(2) == 0 ? 0.0 : angle();
      if (pick(8) == 0) joint.armature = 0.01;
      model.joints.push_back(joint);
    }
    return model;
  }

  std::vector<double> positions(const Model& model) {
    std::vector<double> q;
    for (std::size_t j = 0; j < model.joints.size(); ++j) q.push_back(angle());
    return q;
  }

 private:
  int pick(int count) { return static_cast<int>(random_() % static_cast<unsigned>(count)); }
  double angle() { return std::uniform_real_distribution<double>(-1.5, 1.5)(random_); }
  Vector3d grid_point() { return Vector3d(pick(3) - 1, pick(3) - 1, pick(3) - 1) * (pick(2) == 0 ? 0.0 : 0.1); }
  Inertia inertia(bool is_root) {
    const double mass = pick(4) == 0 ? 1e-4 : 1.0;
    const Vector3d center = grid_point();
    const double square = 0.01 * mass;
    switch (pick(is_root ? 5 : 9)) {
      case 0: return Inertia::box(mass, {0.1, 0.2, 0.3}, center);
      case 1: return Inertia::box(mass, {0.1, 0.1, 0.1}, center);
      case 2: return {mass, center, Matrix3d::Zero()};                              // a point
      case 3: return {mass, center, Vector3d(0, square, square).asDiagonal()};      // a thin rod
      case 4: return {0.0, Vector3d::Zero(), Vector3d(0, 0, square).asDiagonal()};  // a rotor
      default: return {};
    }
  }

  std::mt19937 random_;
};

TEST(MasslessLinks, are_accepted_exactly_where_the_mass_matrix_is_positive_definite) {
  RandomTrees trees(7);
  int accepted = 0, refused = 0, with_massless = 0, unclear = 0;
  for (int seed = 0; seed < 20000; ++seed) {
    const Model model = trees.next();
    std::vector<double> start;
    for (const Joint& joint : model.joints) start.push_back(joint.position);
    const double smallest = smallest_eigenvalue(mass_matrix(model, start));
    if (smallest > 1e-13 && smallest < 1e-7 && ++unclear) continue;
    bool is_accepted = true;
    std::string error;
    try {
      model.validate();
    } catch (const ModelError& refusal) {
      is_accepted = false;
      error = refusal.what();
      if (error.find("impossible") != std::string::npos) continue;  // a rotor alone
    }
    ASSERT_EQ(is_accepted, smallest >= 1e-7)
        << "seed " << seed << ": smallest eigenvalue " << smallest << "; " << error;
    ++(is_accepted ? accepted : refused);
    if (!is_accepted) continue;
    for (std::size_t i = 1; i < model.links.size(); ++i)
      if (model.links[i].inertia.mass == 0.0 && model.joints[i - 1].moves() && model.joints[i - 1].armature == 0.0) {
        ++with_massless;
        break;
      }
    // det M is an analytic function of the positions, so it vanishes almost nowhere.
    EXPECT_GT(smallest_eigenvalue(mass_matrix(model, trees.positions(model))), 0.0) << "seed " << seed;
  }
  EXPECT_GT(accepted, 2000);
  EXPECT_GT(refused, 2000);
  EXPECT_GT(with_massless, 500);
  EXPECT_LT(unclear, 20);
}

// A link, one joint further out, without mass unless it is given.
Joint& append(Model& model, const char* name, const Vector3d& axis, const Inertia& inertia = {},
              const std::string& parent = "") {
  if (model.links.empty()) model.links.push_back({"base", {}});
  Joint joint;
  joint.name = name;
  joint.parent = parent.empty() ? model.links.back().name : parent;
  joint.child = std::string(name) + "_link";
  joint.kind = JointKind::continuous;
  joint.axis = axis;
  model.links.push_back({joint.child, inertia});
  model.joints.push_back(joint);
  return model.joints.back();
}

const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
const Inertia body = Inertia::box(1.0, {0.1, 0.2, 0.3}, {0, 0, -0.3});

std::string refusal_of(const Model& model) {
  try {
    model.validate();
  } catch (const ModelError& error) {
    return error.what();
  }
  return "";
}

TEST(MasslessLinks, of_a_gimbal_are_refused_only_where_it_is_locked) {
  Model gimbal;
  append(gimbal, "yaw", z);
  append(gimbal, "pitch", y);
  append(gimbal, "roll", x, body);
  EXPECT_EQ(refusal_of(gimbal), "");
  gimbal.joints[1].position = std::acos(0.0);  // roll turns about the axis of yaw
  EXPECT_NE(refusal_of(gimbal).find("link 'yaw_link'"), std::string::npos) << refusal_of(gimbal);
  EXPECT_NE(refusal_of(gimbal).find("joint 'yaw'"), std::string::npos) << refusal_of(gimbal);
  gimbal.joints[0].armature = 1e-5;
  EXPECT_EQ(refusal_of(gimbal), "");
}

// Four revolute joints through one point move a body in three ways.
TEST(MasslessLinks, are_refused_where_more_joints_than_motions_move_one_body) {
  Model model;
  append(model, "a", z);
  append(model, "b", y);
  append(model, "c", x);
  append(model, "d", Vector3d(1, 1, 1), body);
  EXPECT_NE(refusal_of(model), "");
  model.joints.back().origin.translation() = Vector3d(0.1, 0.0, 0.2);  // the centre now moves in another way, too
  EXPECT_EQ(refusal_of(model), "");
}

// A fork without mass turns with either of two bodies, so it may turn about the axis of one of them.
TEST(MasslessLinks, may_lean_on_any_of_the_branches_that_they_carry) {
  Model fork;
  append(fork, "fork", z);
  append(fork, "left", z, body, "fork_link");
  EXPECT_NE(refusal_of(fork), "") << "fork and left turn about one axis";
  append(fork, "right", x, body, "fork_link");
  EXPECT_EQ(refusal_of(fork), "");
}

TEST(MasslessLinks, of_floating_roots_need_two_bodies_that_turn_about_different_axes) {
  Model model;
  append(model, "a", z, body);
  model.roots = {{"base", true}};
  EXPECT_NE(refusal_of(model).find("floats"), std::string::npos);
  append(model, "b", z, body, "base");
  EXPECT_NE(refusal_of(model).find("floats"), std::string::npos);
  append(model, "c", x, body, "base");
  EXPECT_EQ(refusal_of(model), "");
}

TEST(MasslessLinks, at_the_end_of_a_chain_are_named_all_together) {
  Model model;
  append(model, "a", z, body);
  append(model, "b", y);
  append(model, "c", x);
  EXPECT_NE(refusal_of(model).find("link 'b_link'"), std::string::npos);
  EXPECT_NE(refusal_of(model).find("the same holds for c_link"), std::string::npos) << refusal_of(model);
}

// Rounding of long chains must not hide the pivots of their first links: a share of 1e-13 of the whole.
TEST(MasslessLinks, in_front_of_long_chains_are_accepted) {
  const auto chain = [](int links, const Inertia& first) {
    Model model;
    append(model, "first", y, first);
    for (int i = 0; i < links; ++i)
      append(model, physics::numbered("j", i).c_str(), i % 2 ? y : z, {1.0, x, Matrix3d::Zero()}).origin.translation() =
          x;
    return model;
  };
  EXPECT_EQ(refusal_of(chain(3000, {})), "");
  EXPECT_EQ(refusal_of(chain(30000, {1.0, x, Matrix3d::Zero()})), "");
}

TEST(MasslessLinks, step_as_in_the_reference) {
  Model gimbal;
  append(gimbal, "yaw", z).position = 0.3;
  append(gimbal, "pitch", y).position = 0.4;
  append(gimbal, "roll", x, body).velocity = 1.0;
  Joint& tip = append(gimbal, "tip", y, Inertia::box(0.2, {0.1, 0.1, 0.1}, {0.1, 0, 0}));
  tip.origin.translation() = Vector3d(0, 0, -0.5);
  gimbal.couplings.push_back(Coupling::mimic("tip", "pitch", -0.5, 0.2));
  gimbal.joints[3].position = 0.0;  // 0.5 * 0.4 - 0.2
  for (const Method method : physics::methods) {
    StepSettings settings = physics::settings(method);
    settings.integrator = Integrator::euler;
    const Plan plan = compile(gimbal, settings);
    Batch<double> batch(plan, 1, {.threads = 1});
    const reference::Mechanism mechanism(gimbal);
    reference::State state = mechanism.initial_state();
    for (int i = 0; i < 100; ++i) {
      state = reference::step(mechanism, settings, state, mechanism.initial_inputs()).state;
      batch.step();
    }
    EXPECT_EQ(batch.faults()[0], Fault::none);
    EXPECT_LT(physics::distance(physics::state_of(batch).q, state.q), 1e-10) << to_string(method);
    Batch<float> single(plan, 1, {.threads = 1});
    single.step(100);
    EXPECT_LT(physics::distance(physics::state_of(single).q, state.q), 1e-3) << to_string(method);
  }
}

TEST(MasslessLinks, with_inertia_cannot_have_masses_of_their_own) {
  Model model;
  append(model, "rotor", z, {0.0, Vector3d::Zero(), Matrix3d::Identity()});
  StepSettings settings;
  EXPECT_NO_THROW(compile(model, settings));
  settings.per_environment = {Parameter::mass};
  EXPECT_THROW(compile(model, settings), SettingsError);
}

}  // namespace
}  // namespace lockstep
