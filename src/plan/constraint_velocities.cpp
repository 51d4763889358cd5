// Speeds of couplings as velocities of the solver, where that is less work: (M77). SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "layout.h"

namespace lockstep {
namespace {

// What is eliminated from a coupling's speed may leave so little of its inertia before rounding is felt.
constexpr double least_share = 1e-3;

struct Measured {
  int coupling;
  Follower first;
};

// The couplings whose first joints none of the others moves, and these joints.
std::vector<Measured> measured_couplings(const Tables<double>& t, const std::vector<double>& shares) {
  std::vector<int> couplings(t.rows.coupling.data, t.rows.coupling.data + t.rows.count);
  std::sort(couplings.begin(), couplings.end());
  std::vector<Measured> measured;
  std::vector<char> follows(t.joints, 0), drives(t.joints, 0);
  for (int c : couplings) {
    Follower first{t.term_joint[t.term_start[c]], {}};
    bool alone = shares[c] >= least_share && !follows[first.joint] && !drives[first.joint];
    for (int k = t.term_start[c] + 1; k < t.term_start[c + 1]; ++k) {
      alone = alone && !follows[t.term_joint[k]];
      first.shares.push_back({t.term_joint[k], -t.term_value[k]});
    }
    if (!alone) continue;
    follows[first.joint] = 1;
    for (const auto& [joint, share] : first.shares) drives[joint] = 1;
    measured.push_back({c, std::move(first)});
  }
  return measured;
}

// Rows that are hard and one velocity each: (M79).
void find_known_velocities(Program& program) {
  Tables<double>& t = program.f64;
  if (program.method != Method::direct && program.method != Method::pgs) return;
  std::vector<int> known(t.solver.n, -1);
  t.rows.all_known = true;
  for (int r = 0; r < t.rows.count; ++r)
    if (always_hard(program, t.rows.coupling[r]) && t.rows.term_start[r + 1] == t.rows.term_start[r] + 1)
      known[t.rows.term_index[t.rows.term_start[r]]] = r;
    else
      t.rows.all_known = false;
  t.rows.known = program.storage.keep(std::move(known));
  t.rows.known_suffice = t.rows.all_known && program.method == Method::direct && !program.settings.record_impulses &&
                         !program.settings.record_diagnostics;
}

// Velocities that move each other, by trees of a fixed root and by couplings: what one part takes is no matter of
// others.
std::vector<int> parts_of(const Tables<double>& t) {
  std::vector<int> part(t.velocities);
  for (int i = 0; i < t.velocities; ++i) part[i] = t.matrix.parent[i] < 0 ? i : part[t.matrix.parent[i]];
  for (int c = 0; c < t.couplings; ++c)
    for (int k = t.term_start[c] + 1; k < t.term_start[c + 1]; ++k) {
      const int first = part[t.velocity_of(t.term_joint[t.term_start[c]])],
                other = part[t.velocity_of(t.term_joint[k])];
      std::replace(part.begin(), part.end(), other, first);
    }
  return part;
}

// What the matrix that is factored takes, and the rows' responses where these are asked for, by part. Bounds have no
// say: one that is never reached may not change a bit.
std::vector<long> work_by_part(const Program& program, const std::vector<int>& part) {
  const Tables<double>& t = program.f64;
  const Rows<double>& rows = t.rows;
  std::vector<long> work(t.velocities, 0);
  const auto part_of = [&](int z) { return part[t.reduction.followers > 0 ? t.reduction.independent[z] : z]; };
  const auto part_of_row = [&](int r) { return part_of(rows.term_index[rows.term_start[r]]); };
  const auto factoring = [](const Columns& columns, int i) {
    return static_cast<long>(columns.row_start[i + 1] - columns.row_start[i] + 2) * columns.size[i];
  };
  for (int z = 0; z < t.solver.n; ++z) work[part_of(z)] += factoring(t.solver, z);
  for (int e = 0; e < t.reduction.product_entry.count; ++e) {
    const int* const first = t.solver.offset.data;
    const auto column = std::upper_bound(first, first + t.solver.n, t.reduction.product_entry[e]) - first - 1;
    work[part_of(static_cast<int>(column))] += t.reduction.product_start[e + 1] - t.reduction.product_start[e];
  }

  std::vector<char> solves(t.velocities, 0);  // by part: not all of its speeds are prescribed
  std::vector<std::vector<char>> moved(rows.count, std::vector<char>(t.solver.n, 0));
  for (int r = 0; r < rows.count; ++r) {
    const bool known = rows.known.count > 0 && rows.known[rows.term_index[rows.term_start[r]]] == r;
    if (program.method != Method::direct || !known) solves[part_of_row(r)] = 1;
    for (int s = rows.support_start[r]; s < rows.support_start[r + 1]; ++s) moved[r][rows.support[s].index] = 1;
  }
  for (int r = 0; r < rows.count; ++r) {
    long& sum = work[part_of_row(r)];
    if (!solves[part_of_row(r)]) continue;
    for (int s = rows.support_start[r]; s < rows.support_start[r + 1]; ++s)
      sum += rows.support[s].end - rows.support[s].index;
    for (int other = 0; other <= r; ++other)
      for (int z = 0; z < t.solver.n; ++z) sum += moved[r][z] && moved[other][z];
    if (rows.columns.n > 0) sum += factoring(rows.columns, r);
  }
  return work;
}

void solve_for_constraint_velocities(Program& program, const std::vector<Measured>& couplings) {
  Tables<double>& t = program.f64;
  std::vector<Follower> followers;
  std::vector<int> measured;
  for (const Measured& coupling : couplings) {
    followers.push_back(coupling.first);
    measured.push_back(coupling.coupling);
  }
  lay_out_basis(program, followers, true);
  t.reduction.measured_coupling = program.storage.keep(std::move(measured));
  lay_out_rows(program);
  find_known_velocities(program);
}

}  // namespace

void take_constraint_velocities(Program& program,
                                const std::function<std::vector<double>(const Program&)>& first_joints_shares) {
  Tables<double>& t = program.f64;
  if (t.rows.count == 0 || t.reduction.followers > 0 || t.articulated.used()) return;
  if (program.integrator != Integrator::euler) return;
  for (const Parameter inertia : {Parameter::gear_ratio, Parameter::drive_gains, Parameter::damping, Parameter::mass})
    if (declared(program, inertia)) return;  // it is not known what elimination leaves of it
  if (measured_couplings(t, std::vector<double>(t.couplings, 1.0)).empty()) return;
  narrow(program);
  std::vector<Measured> couplings = measured_couplings(t, first_joints_shares(program));
  if (couplings.empty()) return;
  const Tables<double> plain = t;
  const std::vector<int> part = parts_of(t);
  const std::vector<long> before = work_by_part(program, part);
  solve_for_constraint_velocities(program, couplings);
  const std::vector<long> after = work_by_part(program, part);
  const auto saves_nothing = [&](const Measured& coupling) {
    const int p = part[t.velocity_of(coupling.first.joint)];
    return after[p] >= before[p];
  };
  if (std::erase_if(couplings, saves_nothing) == 0) return;
  t = plain;
  if (!couplings.empty()) solve_for_constraint_velocities(program, couplings);
}

}  // namespace lockstep
