// Program: what compile() makes of a Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "lockstep/plan.h"
#include "model/contact_pairs.h"
#include "obstacles.h"
#include "tables.h"

namespace lockstep {

/// Owns the arrays that the spans in Tables point to.
class TableStorage {
 public:
  template <class E>
  Span<E> keep(std::vector<E> values) {
    auto owned = std::make_shared<const std::vector<E>>(std::move(values));
    arrays_.push_back(owned);
    return {owned->data(), static_cast<int>(owned->size())};
  }

 private:
  std::vector<std::shared_ptr<const void>> arrays_;
};

/// A value that get() makes when it is first called. Copies share it. Thread-safe.
template <class T>
class Lazy {
 public:
  template <class Make>
  const T& get(Make make) const {
    std::call_once(made_->once, [&] { made_->value = make(); });
    return *made_->value;
  }

 private:
  struct Made {
    std::once_flag once;
    std::shared_ptr<const T> value;
  };
  std::shared_ptr<Made> made_ = std::make_shared<Made>();
};

/// How couplings place their followers: the turns one after the other, then the ring.
struct Placing {
  struct Turn {
    int coupling;
    int term;  ///< of the joint that it places
  };
  std::vector<Turn> turns;
  std::vector<int> ring;            ///< couplings that place their followers together
  std::vector<int> ring_followers;  ///< joints in the solver's order
};

struct Identity;       // identity.h
struct CompiledSteps;  // src/jit/compile.h
struct Fields;         // fields.h

/// A compiled scene: the tables, what they were made from, and the reasons for each choice.
struct Program {
  Model model;
  StepSettings settings;
  Method method = Method::automatic;
  Integrator integrator = Integrator::automatic;
  bool second_phase_anyway = false;  ///< a step has as many solves without active bounds as with them
  std::string integrator_reason;
  std::vector<int> limited_servos;      ///< joints that have a servo with an effort limit
  std::vector<PlanObstacle> obstacles;  ///< in the order in which the stages of compile() found them
  std::vector<int> folded;              ///< couplings that are part of A_r instead of rows
  double length = 0.0;                  ///< Tables::dt
  std::vector<double> stage_times;
  double explicit_rate = 0.0;  ///< the largest |lambda| of (M75), for Integrator::runge_kutta
  std::string method_reason;
  std::vector<std::string> dof_names;
  std::vector<std::string> root_names;  ///< links that float, in the order of the views
  std::vector<PlanTree> trees;
  std::vector<int> dof_of_joint;               ///< by joint of the model: its row in the views, -1 if fixed
  std::vector<int> solver_joint;               ///< by joint of the model: its number in the solver's order, -1 if fixed
  std::vector<int> redundant;                  ///< couplings that follow from others
  std::vector<std::vector<int>> follows_from;  ///< by redundant coupling: the couplings that it follows from
  std::vector<int> absent;                     ///< couplings without stiffness and damping
  std::vector<int> eliminated;                 ///< dofs
  std::vector<int> independent_dofs, follower_dofs, driven_dofs;
  std::vector<Following> following;  ///< by dof
  std::vector<LockedJoints> locked;
  Placing placing_all, placing_hard;  ///< by all couplings, by those that may be hard
  ContactPairs contacts;
  std::vector<PlanContact> plan_contacts;
  std::vector<PlanLoop> plan_loops;
  std::vector<int> loop_dependent_dofs;
  std::vector<std::string> row_names;
  std::vector<Reported> reported;  ///< by row name
  int merged_links = 0;
  TableStorage storage;
  Tables<double> f64;
  Tables<float> f32;
  Lazy<std::uint64_t> kernel_hash;
  Lazy<CompiledSteps> compiled;
  Lazy<Identity> identity;
  Lazy<Fields> fields;
  std::vector<Softness> bound_softness;     ///< by row of Bounds
  std::shared_ptr<const Program> half;      ///< owns Tables::half
  std::shared_ptr<const Program> midpoint;  ///< owns Tables::midpoint
  bool fits_single = true;                  ///< no number of f64 is too large for f32
};

const Program& program_of(const Plan& plan);

/// Whether the coupling's follower is a tendon, which no other joint can stand for (couplings/couplings.cpp).
bool places_tendon(const Tables<double>& t, int coupling);

template <class S>
const Tables<S>& tables(const Program& program);
template <>
inline const Tables<double>& tables(const Program& program) {
  return program.f64;
}
template <>
inline const Tables<float>& tables(const Program& program) {
  return program.f32;
}

}  // namespace lockstep
