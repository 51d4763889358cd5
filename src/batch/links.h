// The links of one environment as they stand in the world, one after the other. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "coordinates.h"
#include "impl.h"
#include "model/trees.h"

namespace lockstep {

/// Forces on a link: their sum, and their moment about its frame's origin.
struct LinkForce {
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), moment = Eigen::Vector3d::Zero();
};

/// For one thread. All vectors are in world axes, all moments of mass about the origins of the links' frames.
template <class S>
class Batch<S>::Impl::Links {
 public:
  struct Link {
    Eigen::Vector3d place, angular;  ///< of the frame's origin, m; rad/s
    Eigen::Matrix3d turn;
    double mass;
    Eigen::Vector3d moment;  ///< (M82)
    Eigen::Matrix3d second;
  };

  /// [rows][chosen environments] Threads have a Find each, which is made of links and coordinates; find(e, numbers)
  /// gives the rows of environment e, to which both stand then.
  template <class Find>
  static Array of_each(Impl& batch, const EnvironmentSet& which, int rows) {
    std::vector<int> ids;
    which.for_each(batch.environments, [&](int e) { ids.push_back(e); });
    const Alone alone(batch.in_use);
    const StatePointers<S> state = batch.state_pointers();
    check_couplings_hold(batch.plan, state, ids);
    batch.normalise_roots(0, batch.environments);
    const Trees trees(batch.plan.model());
    Array all(rows, static_cast<Eigen::Index>(ids.size()));
    batch.workers.for_environments(static_cast<std::ptrdiff_t>(ids.size()), nanoseconds, 1,
                                   [&](std::ptrdiff_t first, std::ptrdiff_t last, void* scratch) {
                                     Links links(batch, trees, scratch);
                                     Coordinates<S> coordinates(batch.plan);
                                     Find find(links, coordinates);
                                     Eigen::VectorXd numbers(rows);
                                     for (std::ptrdiff_t i = first; i < last; ++i) {
                                       const int e = ids[static_cast<std::size_t>(i)];
                                       links.find(e), coordinates.find(state, e), find.find(e, numbers);
                                       all.col(i) = numbers.cast<S>().array();
                                     }
                                   });
    return all;
  }

  Links(const Impl& batch, const Trees& trees, void* scratch)
      : batch_(batch),
        trees_(trees),
        rows_(batch.state_pointers()),
        numbers_(reinterpret_cast<S*>(static_cast<std::byte*>(scratch) + batch.frames_at())),
        scratch_(scratch),
        links_(batch.plan.model().links.size()) {
    for (const Root& root : trees.roots) {
      root_velocity_.push_back(root.floating ? first_dof_ : -1);
      first_dof_ += root.floating ? 6 : 0;
    }
  }

  /// For environment e, as it stands.
  void find(int e) {
    const std::ptrdiff_t first = e / batch_.kernels.lanes * batch_.kernels.lanes;
    if (first != tile_)
      batch_.kernels.read_frames(batch_.tables, kernels::at(batch_.tables, rows_, first), 0, batch_.frames.data(),
                                 static_cast<int>(links_.size()), numbers_, scratch_);
    tile_ = first;
    for (std::size_t l = 0; l < links_.size(); ++l) {
      const auto number = [&](std::size_t k) {
        return static_cast<double>(
            numbers_[(l * kernels::frame_numbers + k) * static_cast<std::size_t>(batch_.kernels.lanes) +
                     static_cast<std::size_t>(e - first)]);
      };
      Link& link = links_[l];
      for (int k = 0; k < 9; ++k) link.turn(k / 3, k % 3) = number(3 + static_cast<std::size_t>(k));
      link.place = {number(0), number(1), number(2)}, link.angular = {number(12), number(13), number(14)};
      find_mass(e, static_cast<int>(l));
    }
  }

  const Link& operator[](int link) const { return links_[static_cast<std::size_t>(link)]; }
  const Trees& trees() const { return trees_; }
  const Model& model() const { return batch_.plan.model(); }
  int root_velocity(int tree) const { return root_velocity_[static_cast<std::size_t>(tree)]; }  ///< -1 if it is bolted
  const Joint& joint(int j) const { return model().joints[static_cast<std::size_t>(j)]; }
  bool slides(int j) const { return joint(j).kind == JointKind::prismatic; }
  int parent(int j) const { return trees_.joint_parent[static_cast<std::size_t>(j)]; }
  int child(int j) const { return trees_.joint_child[static_cast<std::size_t>(j)]; }
  int dof(int j) const { return program_of(batch_.plan).dof_of_joint[static_cast<std::size_t>(j)]; }  ///< -1 if fixed
  int velocity(int j) const { return first_dof_ + dof(j); }
  Eigen::Vector3d axis(int j) const { return (*this)[child(j)].turn * joint(j).axis.normalized(); }
  /// From the origin of its parent to that of its child.
  Eigen::Vector3d arm(int j) const { return (*this)[child(j)].place - (*this)[parent(j)].place; }
  double speed(int j, int e) const {
    return static_cast<double>(rows_.velocity[dof(j) * rows_.stride + e]);  // rad/s or m/s
  }
  double root_twist(int velocity, int e) const {
    return static_cast<double>(rows_.root_velocity[velocity * rows_.stride + e]);
  }
  double field(Parameter parameter, int row, int e) const {
    const S* const own = rows_.field(parameter);
    return own ? static_cast<double>(own[row * rows_.stride + e])
               : fields_of(program_of(batch_.plan)).value(parameter, row);
  }

 private:
  static constexpr double nanoseconds = 1e4;  // of an environment, about

  void find_mass(int e, int l) {
    Link& link = links_[static_cast<std::size_t>(l)];
    const Inertia& model = this->model().links[static_cast<std::size_t>(l)].inertia;
    link.mass = field(Parameter::mass, l, e);
    Eigen::Vector3d center;
    for (int k = 0; k < 3; ++k) center[k] = field(Parameter::center_of_mass, 3 * l + k, e);
    Eigen::Matrix3d tensor;
    for (int k = 0; k < 6; ++k)
      tensor(tensor_rows[k], tensor_columns[k]) = tensor(tensor_columns[k], tensor_rows[k]) =
          field(Parameter::inertia, 6 * l + k, e);
    if (!rows_.field(Parameter::inertia) && model.mass > 0.0) tensor *= link.mass / model.mass;
    center = link.turn * center;
    link.moment = link.mass * center;
    link.second = link.turn * (0.5 * tensor.trace() * Eigen::Matrix3d::Identity() - tensor) * link.turn.transpose() +
                  link.mass * center * center.transpose();
  }

  const Impl& batch_;
  const Trees& trees_;
  StatePointers<S> rows_;
  S* numbers_;
  void* scratch_;
  std::ptrdiff_t tile_ = -1;  // whose frames stand in numbers_
  std::vector<Link> links_;
  std::vector<int> root_velocity_;
  int first_dof_ = 0;  // its velocity
};

}  // namespace lockstep
