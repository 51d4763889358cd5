// The stages of a step one by one, as src/kernels/step.h calls them. SPDX-License-Identifier: Apache-2.0
//
// They are those of plain steps: without bounds, effort limits, records and softness per environment.
#pragma once

#include "kernels/step.h"

namespace lockstep::bench {

template <class T>
using Stage = void (*)(const Tables<simd::ScalarOf<T>>&, const StatePointers<simd::ScalarOf<T>>&, kernels::Tile<T>&);

template <class T>
struct NamedStage {
  const char* name;
  bool (*present)(const Tables<simd::ScalarOf<T>>&);
  Stage<T> run;
};

template <class T>
struct Stages {
  using S = simd::ScalarOf<T>;
  using Table = Tables<S>;
  using Tile = kernels::Tile<T>;

  static bool always(const Table&) { return true; }
  static bool coupled(const Table& t) { return t.couplings > 0; }
  static bool eliminates(const Table& t) { return t.reduction.by_entries(); }
  static bool by_matrix(const Table& t) { return !t.articulated.used(); }
  static bool has_rows(const Table& t) { return t.rows.count > 0; }
  static bool solves_rows(const Table& t) { return has_rows(t) && !t.rows.known_suffice; }

  static void row_terms(const Table& t, const StatePointers<S>& batch, Tile& x) {
    kernels::row_softness(t, batch, x);
    if (t.rows.columns.n > 0) kernels::factor_rows(t, x);
    kernels::row_terms(t, x);
  }
  static void solve(const Table& t, const StatePointers<S>&, Tile& x) {
    if (t.rows.known_suffice) return kernels::known_constraint_velocities(t, x);
    switch (t.method) {
      case Method::pgs: kernels::pgs(t, x); break;
      case Method::tgs: kernels::tgs(t, x); break;
      default: kernels::direct(t, x); break;
    }
  }
  static void integrate(const Table& t, const StatePointers<S>&, Tile& x) {
    kernels::solved_velocities(t, x);
    kernels::integrate(t, x);
    kernels::turn_root_twists(t, x, x.next.v);
  }

  static void finish(const Table& t, const StatePointers<S>& batch, Tile& x) {
    kernels::check(t, batch, x);
    kernels::store(t, batch, x);
  }

  static constexpr NamedStage<T> all[] = {
      {"load", always, [](const Table& t, const StatePointers<S>& batch, Tile& x) { kernels::load(t, batch, x); }},
      {"kinematics", always, [](const Table& t, const StatePointers<S>&, Tile& x) { kernels::kinematics(t, x); }},
      {"coupling errors", coupled,
       [](const Table& t, const StatePointers<S>&, Tile& x) {
         kernels::coupling_errors(t, x);
         if (t.reduction.eliminates()) kernels::follow(t, x);
         if (t.reduction.has_constraint_velocities()) kernels::start_velocities(t, x);
       }},
      {"bias forces", always,
       [](const Table& t, const StatePointers<S>& batch, Tile& x) { kernels::bias_forces(t, batch, x); }},
      {"joint terms", always,
       [](const Table& t, const StatePointers<S>& batch, Tile& x) {
         kernels::joint_inertias(t, batch, x);
         kernels::joint_forces(t, batch, x);
       }},
      {"mass matrix", by_matrix,
       [](const Table& t, const StatePointers<S>& batch, Tile& x) { kernels::inertia_matrix(t, batch, x); }},
      {"elimination", eliminates,
       [](const Table& t, const StatePointers<S>&, Tile& x) { kernels::reduce_matrix(t, x); }},
      {"free velocity", always,
       [](const Table& t, const StatePointers<S>&, Tile& x) {
         kernels::factor_matrix(t, x);
         kernels::free_velocity(t, x);
       }},
      {"responses", solves_rows, [](const Table& t, const StatePointers<S>&, Tile& x) { kernels::responses(t, x); }},
      {"row terms", solves_rows, row_terms},
      {"rows solved", has_rows, solve},
      {"integration", always, integrate},
      {"check and store", always, finish},
  };
  static constexpr int count = sizeof(all) / sizeof(*all);

  /// Runs the first `stages` of a step on a tile that is laid out.
  static void run(const Table& t, const StatePointers<S>& batch, Tile& x, int stages) {
    x.servos.pass = 0;
    for (int s = 0; s < stages; ++s)
      if (all[s].present(t)) all[s].run(t, batch, x);
  }
};

}  // namespace lockstep::bench
