// Closes the loops of the model's start, and finds what they hold there. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "lockstep/error.h"
#include "model/functions.h"
#include "plan/layout.h"
#include "plan/relations.h"

namespace lockstep {
namespace {

constexpr int most_tangents = 30;
constexpr double closes = 1e-6;          // m and rad, what files round off included
constexpr double closed = 1e-11;         // where tangents need no other turn
constexpr double same_direction = 1e-5;  // what is left of a row of J, as a share of the longest

std::string end_of(const std::string& link) { return link.empty() ? "the world" : "link '" + link + "'"; }

// Followers stand where hard couplings put them. A function is its tangent where its leader stands.
Relations hard_relations(const Program& program, const Configuration& at) {
  const Tables<double>& t = program.f64;
  const auto coupling = [&](int c) -> const Coupling& { return program.model.couplings[static_cast<std::size_t>(c)]; };
  const auto tangent = [&](int c) {
    const Coupling& own = coupling(c);
    const double x = at.position[static_cast<std::size_t>(program.model.joint_index(own.terms[0].joint))];
    const simd::Curve<double> curve = curve_at(*own.function, x);
    return std::pair{-curve.slope, curve.slope * x - curve.value};
  };
  return relations_of(
      program, [&](int c) { return is_hard(coupling(c).softness); },
      [&](int c, int k) { return coupling(c).function && k > t.term_start[c] ? tangent(c).first : t.term_value[k]; },
      [&](int c) { return coupling(c).function ? tangent(c).second : t.offset[c]; });
}

// Directions that are linearly independent.
class Basis {
 public:
  // `size` is that of the largest direction.
  explicit Basis(double size) : size_(size) {}

  // Takes the direction, and returns whether it is independent of those before.
  bool take(Eigen::VectorXd direction) {
    for (int time = 0; time < 2; ++time)
      for (const Eigen::VectorXd& other : all_) direction -= direction.dot(other) * other;
    if (direction.norm() <= same_direction * size_) return false;
    all_.push_back(direction.normalized());
    return true;
  }

 private:
  double size_;
  std::vector<Eigen::VectorXd> all_;
};

// What the rows hold where the model starts.
void find_ranks(Program& program, const Trees& trees, const Configuration& at, const std::vector<PlacedLoop>& loops,
                const Relations& relations) {
  const Model& model = program.model;
  const Eigen::MatrixXd jacobian = loop_jacobian(model, trees, at, loops);
  const Eigen::Index joints = relations.rows.cols(), coupled = relations.rows.rows();
  Eigen::MatrixXd all(coupled + jacobian.rows(), jacobian.cols());
  all << relations.rows, Eigen::MatrixXd::Zero(coupled, jacobian.cols() - joints), jacobian;

  // Rows that follow from those before.
  Basis rows(all.rowwise().norm().maxCoeff());
  Eigen::Index row = 0;
  for (; row < coupled; ++row) rows.take(all.row(row).transpose());
  for (const Loop& loop : model.loops) {
    PlanLoop counted{loop.name, rows_of(loop.kind), 0};
    for (int k = 0; k < counted.rows; ++k, ++row) counted.redundant += !rows.take(all.row(row).transpose());
    program.plan_loops.push_back(std::move(counted));
  }

  // Joints that follow from the others: those of couplings, then those without a drive.
  Basis columns(all.colwise().norm().maxCoeff());
  std::vector<int> dependent;
  const auto take = [&](const auto& wanted) {
    for (std::size_t j = model.joints.size(); j-- > 0;) {
      const int dof = program.dof_of_joint[j];
      if (dof < 0 || model.joints[j].kind == JointKind::tendon || !wanted(model.joints[j], dof)) continue;
      if (columns.take(all.col(static_cast<Eigen::Index>(j)))) dependent.push_back(dof);
    }
  };
  const auto follows = [&](int dof) {
    return std::find(program.follower_dofs.begin(), program.follower_dofs.end(), dof) != program.follower_dofs.end();
  };
  const auto driven = [](const Joint& joint) {
    return joint.drive.kinematic || joint.drive.kp > 0.0 || joint.drive.kd > 0.0;
  };
  take([&](const Joint&, int dof) { return follows(dof); });
  dependent.clear();
  take([&](const Joint& joint, int dof) { return !follows(dof) && !driven(joint); });
  take([&](const Joint& joint, int dof) { return !follows(dof) && driven(joint); });
  std::sort(dependent.begin(), dependent.end());
  program.loop_dependent_dofs = std::move(dependent);
}

}  // namespace

void close_start(Program& program) {
  Model& model = program.model;
  if (model.loops.empty()) return;
  const Trees trees(model);
  std::vector<PlacedLoop> loops;
  for (const Loop& loop : model.loops) loops.push_back(placed(model, loop));
  Configuration at = start_of(model, trees);
  Relations relations = hard_relations(program, at);
  Eigen::VectorXd gaps = close_loops(model, trees, loops, relations, at);
  for (int time = 0; time < most_tangents && program.f64.functions.used(); ++time) {
    std::vector<double> speeds(at.position.size(), 0.0);
    place_curved(model, curved_couplings(model), at.position, speeds);
    relations = hard_relations(program, at);
    gaps = loop_gaps(model, trees, at, loops);
    if (gaps.norm() <= closed) break;
    gaps = close_loops(model, trees, loops, relations, at);
  }

  // What does not close is named, the widest gap first.
  Eigen::Index row = 0;
  int worst = -1;
  double widest = closes, gap = 0.0, turn = 0.0;
  for (std::size_t l = 0; l < loops.size(); ++l) {
    const Eigen::VectorXd own = gaps.segment(row, rows_of(loops[l].kind));
    row += own.size();
    if (own.norm() <= widest && own.allFinite()) continue;
    worst = static_cast<int>(l), widest = own.norm();
    gap = own.head(translations_of(loops[l].kind)).norm(), turn = own.tail(rotations_of(loops[l].kind)).norm();
  }
  if (worst >= 0) {
    const Loop& loop = model.loops[static_cast<std::size_t>(worst)];
    throw ModelError(
        "loop '" + loop.name + "'",
        fmt::format("does not close: from the joints' start, the closest pose leaves {:.3g} m and {:.3g} rad between "
                    "its frame on {} and its frame on {}",
                    gap, turn, end_of(loop.first), end_of(loop.second)),
        "correct the poses of its frames, or start the joints near a pose in which they meet");
  }
  for (std::size_t j = 0; j < model.joints.size(); ++j)
    if (model.joints[j].moves() && model.joints[j].kind != JointKind::tendon) model.joints[j].position = at.position[j];
  for (int tree = 0; tree < trees.count(); ++tree)
    if (trees.roots[tree].floating) model.roots[static_cast<std::size_t>(tree)].pose = Pose(at.root[tree]);
  find_ranks(program, trees, at, loops, relations);
}

}  // namespace lockstep
