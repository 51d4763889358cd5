// Constraint velocities as velocities of the solver (M77). SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "plan/layout.h"
#include "plan/parts.h"

namespace lockstep {
namespace {

// Elimination must leave this share of a follower's entry of A. With less, rounding would grow.
constexpr double least_share = 1e-3;

// A coupling whose constraint velocity may replace the velocity of its first joint.
struct Candidate {
  int coupling;
  Follower first;
};

// The couplings whose first joint is in no other candidate. They need A.
std::vector<Candidate> find_candidates(const Tables<double>& t, const std::vector<double>& shares) {
  std::vector<int> couplings(t.rows.coupling.data, t.rows.coupling.data + t.rows.count);
  std::sort(couplings.begin(), couplings.end());
  std::vector<Candidate> candidates;
  std::vector<char> follows(t.joints, 0), leads(t.velocities, 0);
  for (int c : couplings) {
    if (t.tree_of_joint(t.term_joint[t.term_start[c]]).inertia == InertiaKind::articulated_bodies) continue;
    Follower first{t.term_joint[t.term_start[c]], {}};
    bool independent = shares[c] >= least_share && !follows[first.joint] && !leads[t.velocity_of(first.joint)];
    for (int k = t.term_start[c] + 1; k < t.term_start[c + 1]; ++k) {
      independent = independent && !follows[t.term_joint[k]];
      first.shares.push_back({t.velocity_of(t.term_joint[k]), -t.term_value[k]});
    }
    if (!independent) continue;
    follows[first.joint] = 1;
    for (const auto& [velocity, share] : first.shares) leads[velocity] = 1;
    candidates.push_back({c, std::move(first)});
  }
  return candidates;
}

// Finds the hard rows that are one solver velocity each (M79).
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

// Velocities that move each other, through the trees of a fixed root and through couplings. Returns each velocity's
// part. The work of one part does not depend on the others.
std::vector<int> parts_of(const Tables<double>& t) {
  Parts parts(t.velocities);
  for (int i = 0; i < t.velocities; ++i)
    if (t.matrix.parent[i] >= 0) parts.join(t.matrix.parent[i], i);
  for (int c = 0; c < t.couplings; ++c)
    for (int k = t.term_start[c] + 1; k < t.term_start[c + 1]; ++k)
      parts.join(t.velocity_of(t.term_joint[t.term_start[c]]), t.velocity_of(t.term_joint[k]));
  return parts.all();
}

// By part, the work to factor the matrix and, where rows are solved, to compute their responses. Bounds do not count:
// one that is never reached may not change the result by a bit.
std::vector<long> work_by_part(const Program& program, const std::vector<int>& part) {
  const Tables<double>& t = program.f64;
  const Rows<double>& rows = t.rows;
  std::vector<long> work(t.velocities, 0);
  const auto part_of = [&](int z) { return part[t.reduction.velocity_of(z)]; };
  const auto part_of_row = [&](int r) { return part_of(rows.term_index[rows.term_start[r]]); };
  const auto factoring = [](const Columns& columns, int i) {
    return static_cast<long>(columns.row_start[i + 1] - columns.row_start[i] + 2) * columns.size[i];
  };

  // To factor A or A_r, and to compute A_r.
  for (int z = 0; z < t.solver.n; ++z) work[part_of(z)] += factoring(t.solver, z);
  // Without followers, these are copies beside folded couplings of other parts.
  for (int e = 0; t.reduction.followers > 0 && e < t.reduction.product_entry.count; ++e) {
    const int* const first = t.solver.offset.data;
    const auto column = std::upper_bound(first, first + t.solver.n, t.reduction.product_entry[e]) - first - 1;
    work[part_of(static_cast<int>(column))] += t.reduction.product_start[e + 1] - t.reduction.product_start[e];
  }

  // To compute K and factor it, in parts where not all constraint velocities are known.
  std::vector<char> solves(t.velocities, 0);  // by part: not all of its constraint velocities are known
  for (int r = 0; r < rows.count; ++r) {
    const bool known = rows.known.count > 0 && rows.known[rows.term_index[rows.term_start[r]]] == r;
    if (program.method != Method::direct || !known) solves[part_of_row(r)] = 1;
  }
  std::vector<int> movers(t.solver.n, 0);  // by velocity: how many rows so far move it
  for (int r = 0; r < rows.count; ++r) {
    long& sum = work[part_of_row(r)];
    for (int s = rows.support_start[r]; s < rows.support_start[r + 1]; ++s) ++movers[rows.support[s].index];
    if (!solves[part_of_row(r)]) continue;
    for (int s = rows.support_start[r]; s < rows.support_start[r + 1]; ++s)
      sum += rows.support[s].end - rows.support[s].index + movers[rows.support[s].index];
    if (rows.columns.n > 0) sum += factoring(rows.columns, r);
  }
  return work;
}

void solve_for_constraint_velocities(Program& program, const std::vector<Candidate>& candidates) {
  Tables<double>& t = program.f64;
  std::vector<Follower> followers;
  std::vector<int> couplings;
  for (const Candidate& candidate : candidates) {
    followers.push_back(candidate.first);
    couplings.push_back(candidate.coupling);
  }
  lay_out_basis(program, followers, true);
  t.reduction.measured_coupling = program.storage.keep(std::move(couplings));
  lay_out_rows(program);
  find_known_velocities(program);
}

}  // namespace

void take_constraint_velocities(Program& program,
                                const std::function<std::vector<double>(const Program&)>& first_joints_shares) {
  Tables<double>& t = program.f64;

  // Where they apply (section 15).
  if (t.rows.count == 0 || t.reduction.followers > 0) return;
  if (program.integrator != Integrator::euler) return;
  if (has_own_inertias(program)) return;  // the share that elimination leaves is unknown
  for (const Parameter inertia :
       {Parameter::gear_ratio, Parameter::drive_gains, Parameter::damping, Parameter::armature, Parameter::stiffness})
    if (declared(program, inertia)) return;

  // Candidates: first by structure alone, then by the share that elimination leaves.
  if (find_candidates(t, std::vector<double>(t.couplings, 1.0)).empty()) return;
  narrow(program);
  std::vector<Candidate> candidates = find_candidates(t, first_joints_shares(program));
  if (candidates.empty()) return;

  // Tried on all candidates, kept where the part of the candidate gets less work.
  const Tables<double> original = t;
  const std::vector<int> part = parts_of(t);
  const std::vector<long> before = work_by_part(program, part);
  solve_for_constraint_velocities(program, candidates);
  const std::vector<long> after = work_by_part(program, part);
  const auto saves_nothing = [&](const Candidate& candidate) {
    const int p = part[t.velocity_of(candidate.first.joint)];
    return after[p] >= before[p];
  };
  if (std::erase_if(candidates, saves_nothing) == 0) return;
  t = original;
  if (!candidates.empty()) solve_for_constraint_velocities(program, candidates);
}

}  // namespace lockstep
